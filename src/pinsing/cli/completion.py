"""What the shell offers when Tab is pressed: robots, frames, joints, families, tasks, files.

Each function has the signature that click asks of ``shell_complete``. None may fail or print: what
cannot be read offers nothing.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, FishComplete, add_completion_class

from pinsing.robot.task import ROW_NAMES

if TYPE_CHECKING:
    from pinsing.description.urdf import Description

Offered = list[CompletionItem]
Completer = Callable[[click.Context, click.Parameter, str], Offered]

_ROBOT_FILES = (".urdf", ".xacro")
_TASKS = {
    "pose": "all six rows",
    "position": "of the tip point",
    "orientation": "of the tool",
    "tool-axis": "position, and where the tool points",
    **{row: "a row; several with commas" for row in ROW_NAMES},
}
_PLAIN = re.compile(r"[\w./:+@%-]+")
"""Names that a shell takes as they are; others come from files of anybody."""

_FAMILY_SECONDS = 2.0
"""Time for the algebra: longer than that nobody waits for Tab."""


@add_completion_class
class WholeValues(FishComplete):
    """What fish runs; click's own script cuts a value such as ``joint_a,joint_b`` at its comma."""

    source_template = FishComplete.source_template.replace(
        'string split ","', 'string split --max 1 ","'
    )


def _quiet(complete: Completer) -> Completer:
    def wrapper(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
        silent = contextlib.redirect_stderr(io.StringIO())
        with silent, contextlib.suppress(Exception):
            return complete(ctx, param, incomplete)
        return []

    return wrapper


def _starting(
    names: Iterable[tuple[str, str | None]], incomplete: str, prefix: str = "", suffix: str = ""
) -> Offered:
    return [
        CompletionItem(prefix + name + suffix, help=help)
        for name, help in names
        if name.startswith(incomplete) and _PLAIN.fullmatch(name)
    ]


def _listed(names: Iterable[tuple[str, str | None]], incomplete: str) -> Offered:
    """Names for the last place of a list with commas, none that is in it already."""
    before, comma, last = incomplete.rpartition(",")
    used = before.split(",")
    return _starting((n for n in names if n[0] not in used), last, before + comma)


@_quiet
def robots(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Known robots, and robot files here; all files where none fits."""
    from pinsing.description.catalog import known_robots

    found: list[tuple[str, str | None]] = []
    if "/" not in incomplete and not incomplete.startswith("~"):
        found = [(e.name, e.title) for e in known_robots().values() if not e.alias_of]
        here = sorted(p.name for p in Path().iterdir() if p.suffix in _ROBOT_FILES)
        found += [(name, "file") for name in here]
        aliases = ((e.name, e.title) for e in known_robots().values() if e.alias_of)
        if not any(name.startswith(incomplete) for name, _ in found):
            found += aliases
    return _starting(found, incomplete) or [CompletionItem(incomplete, type="file")]


@_quiet
def files(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Whatever files there are."""
    return [CompletionItem(incomplete, type="file")]


@_quiet
def frames(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Links of the robot that was named before."""
    return _starting(((link, None) for link in _description(ctx).links), incomplete)


@_quiet
def joints(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Joints of the robot, for a list with commas."""
    return _listed(_joints(ctx), incomplete)


@_quiet
def joint_value(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Joints of the robot, for JOINT=VALUE."""
    return [] if "=" in incomplete else _starting(_joints(ctx), incomplete, suffix="=")


@_quiet
def tasks(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Names of tasks, or rows with commas."""
    names = tuple(_TASKS.items())
    if "," in incomplete:
        names = names[-len(ROW_NAMES) :]
    return _listed(names, incomplete)


@_quiet
def families(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
    """Families of the arm: of the saved analysis if one is given, else computed."""
    saved = ctx.params.get("analysis")
    return _starting(_saved(Path(saved)) if saved else _computed(ctx), incomplete)


def choices(*names: str) -> Completer:
    """A few words."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offered:
        return _starting(((name, None) for name in names), incomplete)

    return complete


def _robot(ctx: click.Context) -> str:
    """Return the robot that was named before."""
    # An option without its value ends the parsing; what was read till then is in ``args``.
    if ctx.params.get("robot"):
        return str(ctx.params["robot"])
    names = [p.name for p in ctx.command.params if isinstance(p, click.Argument)]
    return ctx.args[names.index("robot")]


def _description(ctx: click.Context) -> Description:
    from pinsing.description.catalog import CatalogEntry, locate_robot
    from pinsing.description.urdf import read_description

    found = locate_robot(_robot(ctx))
    path = found.path if isinstance(found, CatalogEntry) else found
    return read_description(
        path,
        packages=dict(ctx.params.get("packages") or ()),
        xacro_args=dict(ctx.params.get("xacro_args") or ()),
    )


def _joints(ctx: click.Context) -> Iterator[tuple[str, str | None]]:
    for joint in _description(ctx).joints:
        if joint.kind != "fixed" and joint.mimic is None:
            yield joint.name, joint.kind


def _saved(path: Path) -> Iterator[tuple[str, str | None]]:
    import json

    data: Any = json.loads(path.read_text(encoding="utf-8"))
    for family in data.get("closed_form", data)["families"]:
        yield str(family["name"]), str(family["text"])


def _computed(ctx: click.Context) -> Iterator[tuple[str, str | None]]:
    from pinsing.families import closed_form
    from pinsing.robot.load import load

    given = ctx.params
    arm = load(
        _robot(ctx),
        tip=given.get("tip"),
        base=given.get("base"),
        joints=given.get("joints"),
        task="tool-axis" if given.get("tool_axis") else given.get("task") or "pose",
        tool_axis=given.get("tool_axis"),
        packages=dict(given.get("packages") or ()),
        xacro_args=dict(given.get("xacro_args") or ()),
    )
    for family in closed_form(arm, seconds=_FAMILY_SECONDS, prove=False).families:
        yield family.name, family.text
