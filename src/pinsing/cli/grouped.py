"""A command with its options in groups, and vectors typed with spaces."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from typing import Any

import click

from pinsing.errors import OptionError

ROBOT = (
    *("loops", "no_loops", "tip", "base", "joints", "task", "tool_axis", "length_scale"),
    *("packages", "xacro_args", "design", "calibration"),
)
OUTPUT = (
    *("output", "verbose", "deg", "latex", "exact", "view", "no_open", "page", "skeleton", "keep"),
    *("keep_values", "size", "panel", "fail_if_singular", "fail_within"),
)
RARE = (
    *("length_scale", "packages", "xacro_args", "angle_tol", "snap_length", "engine", "threads"),
    *("workers", "dask", "chunk", "keep", "keep_values", "seed", "rtol", "near_rtol", "host"),
    *("port", "panel", "size", "no_open", "chosen", "prefix", "special", "levels"),
    *("samples", "sweep_joints", "no_prune", "nominal_q", "random_starts", "no_loops"),
)
"""Options that ``--help-all`` shows, and ``--help`` does not."""

REPLACED = {
    "--json": ".json", "--html": ".html", "--png": ".png", "--plot": ".png", "--pdf": ".pdf",
    "--c": ".h", "--python": ".py", "--certificate": ".cert.json", "--system": ".sing", "--out": "",
}  # fmt: skip
"""Options that ``-o FILE`` replaces, and an ending that it takes."""

_OTHERS = {
    "--tool": "--tool is an option of path: the task pose has the same singularities with any "
    "tool; for other tasks name a frame of the robot's file with --tip",
    "--trajectory": "--trajectory is an option of report; pinsing check ROBOT FILE judges one, and "
    "with --view shows it",
}
"""Options that people give to other commands, and what to do instead."""

_VECTORS = ("--q", "--near", "--nominal-q", "--to")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)


def placeholder(param: click.Parameter, ctx: click.Context) -> str:
    """Return what stands for a value in a line of usage, in all versions of click alike."""
    if isinstance(param, click.Argument):
        return param.get_usage_pieces(ctx)[0]
    return param.metavar or param.type.name.upper()


class GroupedCommand(click.Command):
    """What `command` makes."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take ``--q 0 -80 60``, point to ``-o``, show all options on demand."""
        ctx.meta["all options"] = "--help-all" in args
        args = ["--help" if word == "--help-all" else word for word in args]
        for word, following in itertools.zip_longest(args, args[1:], fillvalue=""):
            option, _, file = word.partition("=")
            if option in REPLACED:
                ending = REPLACED[option]
                file = file or following
                meant = file if file == "-" or file.endswith(ending) else f"FILE{ending}"
                raise OptionError(f"there is no {option}: did you mean -o {meant}?")
            if option in _OTHERS and not any(option in p.opts for p in self.params):
                raise OptionError(_OTHERS[option])
        for p in self.params:
            if {*p.opts} & {*args} and {*p.secondary_opts} & {*args}:
                raise OptionError(f"{p.opts[0]} and {p.secondary_opts[0]} exclude each other")
        return super().parse_args(ctx, _joined(args))

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Name the options that have to be given too."""
        needed = [
            f"{p.opts[0]} {placeholder(p, ctx)}"
            for p in self.params
            if isinstance(p, click.Option) and p.required
        ]
        return [*super().collect_usage_pieces(ctx), *needed]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List what to do, which robot, and what to write; rare options on demand."""
        every = ctx.meta.get("all options", False)
        groups: dict[str, list[tuple[str, str]]] = {"Options": [], "Robot": [], "Output": []}
        hidden = 0
        for p in self.get_params(ctx):
            record = p.get_help_record(ctx)
            if record is None or not isinstance(p, click.Option):
                continue
            if p.name in RARE and not every:
                hidden += 1
                continue
            group = "Robot" if p.name in ROBOT else "Output" if p.name in OUTPUT else "Options"
            groups[group].append(record)
        if hidden:
            groups["Options"].append(("--help-all", f"Show {hidden} more options."))
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def command(name: str) -> Callable[[Callable[..., Any]], GroupedCommand]:
    """As `click.command`, of a `GroupedCommand`."""
    return click.command(name, cls=GroupedCommand)


def values_named(found: click.Command | None, words: list[str]) -> list[str]:
    """Put ``--q`` before joint values that follow the robot without it: ``at ur5 0 -80 60``."""
    options = [p for p in found.params if isinstance(p, click.Option)] if found else []
    if not any("--q" in p.opts for p in options) or any(w.startswith("--q") for w in words):
        return words
    flags = {name for p in options if p.is_flag for name in (*p.opts, *p.secondary_opts)}
    for k, (before, word) in enumerate(itertools.pairwise(words), 1):
        if (before in flags or not before.startswith("-")) and _vector(word):
            return [*words[:k], "--q", *words[k:]]
    return words


def _joined(args: list[str]) -> list[str]:
    """Numbers after ``--q`` that stand apart as one word."""
    out: list[str] = []
    taking = False
    for word in args:
        if taking and _NUMBER.fullmatch(word) and _vector(out[-1]):
            out[-1] += f",{word}"
        else:
            out.append(word)
            taking = len(out) > 1 and out[-2] in _VECTORS
    return out


def _vector(word: str) -> bool:
    return all(_NUMBER.fullmatch(part) for part in word.split(","))
