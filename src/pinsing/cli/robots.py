"""``pinsing list`` and the DH tables of ``pinsing export``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pinsing.atomic_write import check_writable
from pinsing.cli import completion
from pinsing.cli.options import (
    RobotRequest,
    argument,
    arm_options,
    command,
    deg_option,
    in_degrees,
    json_option,
    written,
)
from pinsing.cli.output import STDOUT, doing, emit, emit_json, emit_json_data, put
from pinsing.errors import ChainError, OptionError, shown_path
from pinsing.prose import Page, Table

if TYPE_CHECKING:
    from pinsing.description.catalog import CatalogEntry


@command("info")
def info_command(
    request: RobotRequest = arm_options,
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
) -> None:
    """Show how pinsing interprets ROBOT: chain, joints, limits, tip, generic rank, geometry.

    Where several arms could be meant, lists them with the command for each.
    """
    try:
        arm = request.load(quiet=True)
    except ChainError as error:
        if error.chains and request.base is None and json_target != STDOUT:
            from pinsing.robot.models import chains_text

            emit(chains_text(error.chains, request.words))
        raise
    from pinsing.measures import ROUNDING
    from pinsing.report.arm_report import describe
    from pinsing.robot.second_reader import second_reading

    with doing("reading the file with a second program"):
        info = replace(describe(arm), second_reading=second_reading(arm))
    if emit_json(info, json_target):
        return
    page, degrees = Page.of(), in_degrees(deg)
    lines = [info.head(page), "", page.table(info.joints(degrees))]
    said = [f"note: {note}" for note in info.arm.notes]
    if not info.assumed:  # else families are of the design
        said += [f"moved: {snap}" for snap in info.snaps if snap.size > ROUNDING]
    said += [f"pose: {text}" for text in info.poses(degrees, page.width - 2)]
    if said:
        lines += ["", *(page.paragraph(text, rest="  ") for text in said)]
    emit("\n".join([*lines, "", page.fitted(f"Next: pinsing families {request.words}")]))


@command("list")
def list_command(
    word: str = argument(required=False, default="", shell_complete=completion.robots),
    json_target: str | Path | None = json_option,
) -> None:
    """List the robots known by name; with WORD, those that have it in their name or title.

    Of arms also what they are known for, and the reach: the largest distance of the tip from the
    first axis within the limits, computed. Robots of the package robot_descriptions, where it is
    installed, are called rd:NAME.
    """
    from pinsing.description.catalog import (
        PREFIX,
        canonical,
        described_entries,
        described_robot,
        find_robot,
        known_robots,
    )

    described = word.startswith(PREFIX)
    wanted = canonical(word) or word  # of signs alone: in no name
    entries = [
        e
        for e in (*(() if described else known_robots().values()), *described_entries())
        if wanted in canonical(e.name) or wanted in canonical(e.title)
    ] or [described_robot(word) if described else find_robot(word)]
    if json_target is not None:
        robots = [
            {"name": e.name, "title": e.title, "source": e.source, "alias_of": e.alias_of}
            for e in entries
        ]
        if emit_json_data({"schema": "pinsing/robots/1", "robots": robots}, json_target):
            return
    emit(_listed(entries))


def _listed(entries: list[CatalogEntry]) -> str:
    """Show arms with what ``arms.yaml`` knows of them, then the others; aliases of neither."""
    from pinsing.description.catalog import known_arms

    names = {e.name for e in entries}
    known, arms, others = known_arms(), [], []
    for e in entries:
        if e.name in known:
            arm = known[e.name]
            joints = str(arm.get("joints") or len(arm["rows"]))
            title = f"{arm['maker']} {arm['model']}"
            arms.append((e.name, title, joints, f"{arm['reach']:.2f}", arm["known_for"]))
        elif e.alias_of not in names:
            text = f"same as {e.alias_of}" if e.alias_of else e.title
            others.append((e.name, f"{text} ({e.note})" if e.note else text, e.source))
    header = ("name", "arm", "joints", "reach [m]", "known for")
    tables = (
        Table(header, tuple(arms), frozenset({2, 3})),
        Table(("name", "robot", "from"), tuple(others)),
    )
    return "\n\n".join(Page.of().table(table) for table in tables if table.rows)


@command("dh", needs_output=True)
def dh_command(
    table: str = argument(shell_complete=completion.files),
    urdf: str | Path = written(".urdf"),
) -> None:
    """Turn a DH table (YAML, standard or modified convention) into a URDF."""
    from pinsing.description.catalog import locate_robot
    from pinsing.description.dh_table import dh_to_urdf, known_table, read_dh

    if urdf != STDOUT:
        check_writable(urdf, inputs=(table,))
    found = locate_robot(table)
    path = found if isinstance(found, Path) else found.path
    OptionError.refuse_if(
        path.suffix not in (".yaml", ".yml"),
        f"{table} is a description already: {shown_path(path)}",
    )
    named = not isinstance(found, Path) and path.name == "arms.yaml"
    text = dh_to_urdf(known_table(found.name) if named else read_dh(path))
    put(text, urdf)
