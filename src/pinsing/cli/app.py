"""The ``pinsing`` command: its groups, and how it ends.

Exit codes: 0, the work is done; 1, done and singular, with ``--fail-if-singular`` only, or a
certificate was rejected; 2, bad input, or output that cannot be written; 130, stopped with Ctrl-C
or out of time; 141, the reader of a pipe has gone.
"""

from __future__ import annotations

import importlib
import itertools
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from pinsing._version import __version__
from pinsing.cli import STOPPED, memory_problem, memory_refusal
from pinsing.cli.options import placeholder, values_named
from pinsing.cli.output import (
    READER_GONE,
    WORDS,
    StdoutError,
    complain,
    give_up_stdout,
    guard_streams,
    say,
)
from pinsing.errors import OptionError, PinsingError, UnknownNameError, shown_path, why

COMMANDS: dict[str, tuple[str, str]] = {
    "families": ("families", "Find all families of singular configurations."),
    "at": ("motion", "Analyze one configuration, or suggest one (--suggest)."),
    "check": ("motion", "Check a trajectory for singularities."),
    "path": ("motion", "Find the joint path of a toolpath with the largest clearance."),
    "zones": ("motion", "Find how near to singularities tip speeds are kept."),
    "line": ("motion", "Check a straight line of the tip (MoveL)."),
    "postures": ("motion", "List the other postures of a pose, or the aspects of an arm."),
    "analyze": ("families", "Cross-check the families with a sweep of the joints (--sweep)."),
    "map": ("families", "Compute singular values over a grid or sample."),
    "view": ("show", "Show singular poses and velocity ellipsoids in a browser."),
    "plot": ("show", "Draw curves, maps and ellipsoids."),
    "report": ("show", "Write a self-contained report."),
    "export": ("families", "Export a guard as C or Python, or a DH table as URDF."),
    "verify": ("families", "Check certificates."),
    "list": ("robots", "List the known robots, or show how one is interpreted."),
}
"""Module of `pinsing.cli` that holds the function NAME_command, and what it is for in a line."""

VARIANTS = {
    "analyze --sweep": ("families", "sweep"),
    "at --suggest": ("motion", "suggest"),
    "postures --aspects": ("motion", "aspects"),
    "postures --cuspidal": ("motion", "cuspidal"),
    "export --urdf": ("robots", "dh"),
    "list --info": ("robots", "info"),
}
"""Flags that make a command answer a related question: module, and NAME of NAME_command."""

RENAMED = {
    "info": "list ROBOT",
    "sweep": "analyze ROBOT --sweep",
    "suggest": "at ROBOT --suggest",
    "aspects": "postures ROBOT --aspects",
    "cuspidal": "postures ROBOT --cuspidal",
    "dh": "export TABLE.dh.yaml -o ROBOT.urdf",
    "guard": "export ROBOT -o guard.h",
    "trajectory": "check ROBOT FILE",
}
"""What to type instead of commands that there are no more."""


def variant_of(name: str, words: Sequence[str]) -> tuple[str, list[str]]:
    """Return the command that these words ask for, and the words that are left."""
    for variant in VARIANTS:
        command, flag = variant.split()
        if command == name and flag in words:
            return variant, [word for word in words if word != flag]
    written = [b for a, b in itertools.pairwise(words) if a in ("-o", "--output")]
    if name == "export" and written and written[0].lower().endswith(".urdf"):
        return "export --urdf", list(words)
    if name == "list" and words and _is_robot(words[0]):
        return "list --info", list(words)
    asks = any(word in ("-h", "--help", "--help-all") for word in words)
    if name == "postures" and words and not asks and not any(w.startswith("--q") for w in words):
        return "postures --aspects", list(words)
    return name, list(words)


def _is_robot(word: str) -> bool:
    """Return True if a word names one robot: a file, or a name in full."""
    if word.startswith("-") or word.endswith(":"):
        return False
    if os.sep in word or os.path.isfile(word):
        return True
    from pinsing.description.catalog import canonical, described_entries, known_robots

    if word.startswith("rd:"):
        return any(word == entry.name for entry in described_entries())
    return canonical(word) in map(canonical, known_robots())


def command_of(name: str) -> click.Command:
    """Import the command of a name out of `COMMANDS`, or `VARIANTS`."""
    place, called = VARIANTS.get(name) or (COMMANDS[name][0], name)
    found: click.Command = getattr(
        importlib.import_module(f"pinsing.cli.{place}"), f"{called}_command"
    )
    if name in COMMANDS:
        found.short_help = COMMANDS[name][1]
    return found


BAD_INPUT = 2


class PinsingGroup(click.Group):
    """A click group that turns every expected failure into one line and an exit code."""

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command when it is asked for."""
        return command_of(cmd_name) if cmd_name in COMMANDS else None

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
        args = ["--help" if args[:1] == ["--help-all"] else word for word in args[:1]] + args[1:]
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
            unknown = UnknownNameError("command", args[0], self.list_commands(ctx))
            if unknown.close:
                raise unknown
            robot = args[0] if _is_robot(args[0]) else "ROBOT"
            raise OptionError(
                f"there is no command {shown_path(args[0])!r}: type pinsing families {robot}, or "
                "pinsing --help for all commands"
            )
        if too_little := memory_refusal():
            raise click.ClickException(too_little)
        name, found, words = super().resolve_command(ctx, args)
        variant, words = variant_of(name or "", values_named(found, words))
        return variant or None, command_of(variant) if variant else found, words

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands, those that most people want first."""
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands with what they are for; none is imported."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][1]) for name in self.list_commands(ctx)])


def _instead(error: click.UsageError) -> str:
    """Return what to type where an option or argument is missing or of another file; else empty."""
    if isinstance(error, click.NoSuchOption) and error.ctx and error.ctx.command.name == "dh":
        return f"-o FILE.urdf takes a DH table or the name of one alone, not {error.option_name}"
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
    complain(_instead(error) or error.format_message())
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
