"""The ``pinsing`` command: its groups, and how it ends.

Exit codes: 0, the work is done; 1, done and singular, with ``--fail-if-singular`` only, or a
certificate was rejected; 2, bad input, or output that cannot be written; 130, stopped with Ctrl-C
or out of time; 141, the reader of a pipe has gone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from pinsing._version import __version__
from pinsing.atomic_write import why
from pinsing.cli import memory_problem, memory_refusal
from pinsing.cli.commands import COMMANDS, RENAMED, Commands, variant_of
from pinsing.cli.grouped import placeholder
from pinsing.cli.output import STOPPED, complain, say
from pinsing.cli.running import WORDS
from pinsing.cli.streams import READER_GONE, StdoutError, give_up_stdout, guard_streams
from pinsing.errors import OptionError, PinsingError, UnknownNameError, shown_path

BAD_INPUT = 2


class PinsingGroup(click.Group):
    """A click group that turns every expected failure into one line and an exit code."""

    def __init__(self, *args: Any, **extra: Any) -> None:
        super().__init__(*args, **extra)
        self.commands = Commands()

    def main(self, args: Sequence[str] | None = None, **extra: Any) -> NoReturn:  # type: ignore[override]
        """Run a command line and exit."""
        extra["standalone_mode"] = False
        try:
            code = self._run(args, **extra)
            sys.stdout.flush()
        except StdoutError as error:
            give_up_stdout()
            if not error.reader_gone:  # else it, such as head, has seen enough
                complain(str(error))
            code = READER_GONE if error.reader_gone else BAD_INPUT
        sys.exit(code if isinstance(code, int) else 0)

    def _run(self, args: Sequence[str] | None, **extra: Any) -> Any:
        try:
            return super().main(args=None if args is None else list(args), **extra)
        except click.UsageError as error:
            return _usage(error)
        except click.ClickException as error:
            complain(error.format_message())
        except StdoutError:
            raise
        except PinsingError as error:
            complain(str(error))
        except OSError as error:  # no room, no handles, no processes: nothing of ours to mend
            where = f" ({shown_path(error.filename)})" if error.filename else ""
            complain(f"the system refuses: {why(error)}{where}")
        except (KeyboardInterrupt, click.Abort):
            say("stopped")
            return STOPPED
        except (MemoryError, ImportError, RuntimeError, SystemError) as error:
            said = memory_problem(error)
            if not said:
                raise
            complain(said)
        return BAD_INPUT

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Keep the words, for who says how to go on."""
        words = [info_name or "pinsing", *args]
        context = super().make_context(info_name, args, parent, **extra)
        context.meta[WORDS] = words
        return context

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name those that resemble it."""
        if args and args[0] in RENAMED:
            raise OptionError(f"there is no command {args[0]!r}: type pinsing {RENAMED[args[0]]}")
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise UnknownNameError("command", args[0], self.list_commands(ctx))
        if too_little := memory_refusal():
            raise click.ClickException(too_little)
        name, found, words = super().resolve_command(ctx, args)
        variant, words = variant_of(name or "", words)
        return (variant, self.commands[variant], words) if variant != name else (name, found, words)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands, those that most people want first."""
        return list(self.commands)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands with what they are for; none is imported."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][1]) for name in self.list_commands(ctx)])


def _missing(error: click.UsageError) -> str:
    """Return what to type where an option or argument is missing; empty for other slips."""
    if not isinstance(error, click.MissingParameter) or error.param is None or error.ctx is None:
        return ""
    param, usage = error.param, error.ctx.command.collect_usage_pieces(error.ctx)
    what = f"{param.opts[0]} " if isinstance(param, click.Option) else ""
    return (
        f"{what}{placeholder(param, error.ctx)} is missing: type {error.ctx.command_path} "
        f"{' '.join(piece for piece in usage if piece != '[OPTIONS]')}"
    )


def _usage(error: click.UsageError) -> int:
    if error.ctx is not None and not error.ctx.args and type(error).__name__.startswith("NoArgs"):
        click.echo(error.ctx.get_help())  # no command at all: show what there is
        return BAD_INPUT
    complain(_missing(error) or error.format_message())
    if error.ctx is not None:
        say(f"see {error.ctx.command_path} --help")
    return BAD_INPUT


@click.group(cls=PinsingGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, message="pinsing %(version)s")
def command() -> None:
    """Find, state, prove and show the singular configurations of robot arms.

    ROBOT is a URDF, xacro, MuJoCo (.xml) or DH table (.yaml) file, or a name out of
    `pinsing list`. Results go to stdout, messages to stderr.

    \b
    Exit codes:  0  done
                 1  done and singular (only with --fail-if-singular); verify: not accepted
                 2  bad input, or output that cannot be written
               130  stopped with Ctrl-C, or out of time: what is missing is said
               141  broken pipe
    """  # noqa: D301


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit: the ``pinsing`` program."""
    guard_streams()
    command.main(args, prog_name="pinsing")
