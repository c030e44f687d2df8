"""The ``pinsing`` command: its groups, and how it ends.

Exit codes: 0, the work is done; 1, done and singular, with ``--fail-if-singular`` only, or a
certificate was rejected;
2, bad input; 130, stopped with Ctrl-C.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from pinsing._version import __version__
from pinsing.cli.at import at_command
from pinsing.cli.families import families_command, verify_command
from pinsing.cli.map import map_command
from pinsing.cli.output import STOPPED, complain, say
from pinsing.cli.plot import plot_command
from pinsing.cli.robots import dh_command, info_command, list_command
from pinsing.cli.singularities import analyze_command, sweep_command
from pinsing.cli.view import view_command
from pinsing.errors import PinsingError, UnknownNameError

BAD_INPUT = 2


class PinsingGroup(click.Group):
    """A click group that turns every expected failure into one line and an exit code."""

    def main(self, args: Sequence[str] | None = None, **extra: Any) -> NoReturn:  # type: ignore[override]
        """Run a command line and exit."""
        extra["standalone_mode"] = False
        try:
            code = super().main(args=None if args is None else list(args), **extra)
            sys.stdout.flush()
        except click.UsageError as error:
            code = _usage(error)
        except click.ClickException as error:
            complain(error.format_message())
            code = BAD_INPUT
        except PinsingError as error:
            complain(str(error))
            code = BAD_INPUT
        except (KeyboardInterrupt, click.Abort):
            say("stopped")
            code = STOPPED
        except BrokenPipeError:  # the reader, such as head, has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            code = 0
        sys.exit(code if isinstance(code, int) else 0)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name those that resemble it."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise UnknownNameError("command", args[0], self.list_commands(ctx))
        return super().resolve_command(ctx, args)


def _usage(error: click.UsageError) -> int:
    if error.ctx is not None and not error.ctx.args and type(error).__name__.startswith("NoArgs"):
        click.echo(error.ctx.get_help())  # no command at all: show what there is
        return BAD_INPUT
    complain(error.format_message())
    if error.ctx is not None:
        say(f"see {error.ctx.command_path} --help")
    return BAD_INPUT


@click.group(cls=PinsingGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, message="pinsing %(version)s")
def command() -> None:
    """Find, state, prove and show the singular configurations of robot arms.

    ROBOT is a URDF or xacro file, or a name out of `pinsing list`. Results go to stdout,
    messages to stderr.

    \b
    Exit codes:  0  done
                 1  done and singular (only with --fail-if-singular); verify: rejected
                 2  bad input
               130  stopped with Ctrl-C
    """  # noqa: D301


for _part in (
    info_command,
    analyze_command,
    at_command,
    sweep_command,
    map_command,
    families_command,
    verify_command,
    view_command,
    plot_command,
    dh_command,
    list_command,
):
    command.add_command(_part)


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit: the ``pinsing`` program."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:  # a name that the terminal cannot show is no reason to fail
            reconfigure(errors="backslashreplace")
    command.main(args, prog_name="pinsing")
