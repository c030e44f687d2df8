"""``pinsing zones``: how near is too near."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    in_degrees,
    joint_speeds_option,
    json_option,
    parse_numbers,
    tip_speed_options,
    typed_speeds,
)
from pinsing.cli.output import emit_json, emit_lines, read_json
from pinsing.cli.running import waiting
from pinsing.errors import OptionError, ResultError

if TYPE_CHECKING:
    from pinsing.proximity.zones import Zones


def _read(ctx: click.Context, param: click.Parameter, file: Path | None) -> Zones | None:
    if file is None:
        return None
    from pinsing.proximity.zones import Zones

    try:
        return Zones.from_dict(read_json(file))
    except ResultError as error:
        raise ResultError(f"{file}: {error}") from None


zones_option = click.option(
    "--zones",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.json",
    callback=_read,
    help="With the zones that `pinsing zones ROBOT -o FILE.json` wrote.",
)
"""Adds ``--zones``; the command gets the `Zones` of the file, or None."""


@command("zones")
@arm_options
@tip_speed_options
@joint_speeds_option
@click.option(
    "--within",
    multiple=True,
    metavar="limits|POSTURE|RANGE",
    help="Only within limits, in a posture (elbow up), or with a joint or the tip's x, y, z in a "
    "range (q3=A..B, z=A..B); repeatable.",
)
@click.option(
    "--boxes",
    type=click.IntRange(min=1),
    metavar="N",
    help="Work: with more, smaller distances are proven.  [default: 1500000, 4 s of a UR5, "
    "less with --within]",
)
@deg_option
@json_option
def zones_command(
    request: RobotRequest,
    tip_speed: float,
    turn_speed: float,
    joint_speeds: str | None,
    within: tuple[str, ...],
    boxes: int | None,
    deg: bool,
    json_target: str | Path | None,
) -> None:
    """Find how far to stay from singularities so that tip speeds keep the joint speed limits.

    Farther than the distances printed, no tip motion up to these speeds exceeds the speed limit of
    a joint: proven. A configuration that does exceed one is given, too.

    Example: pinsing zones ur5 --within elbow_joint=40..140 --deg
    """
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.proximity.zones import BOXES, bounds_of, is_of_tip, parts_of, zones

    speeds = typed_speeds(arm, joint_speeds, turn_speed, deg)
    bounds_of(arm, tip_speed, turn_speed, speeds)  # refuses before the families are looked for

    def turns(name: str) -> bool:
        return not (is_of_tip(arm, name) or arm.prismatic[arm.space.index(name)])

    def number(name: str, text: str) -> float:
        value = parse_numbers(text, f"--within {name}", deg and turns(name))[0]
        return math.radians(value) if deg and turns(name) else value

    parts = parts_of(",".join(within), number) if within else None
    for name, ends in (parts or {}).items():
        OptionError.refuse_if(
            not deg and ends is not None and turns(name) and max(map(abs, ends)) > 2 * math.pi,
            f"--within {name}: over a turn in radians: for degrees add --deg",
        )
    with waiting() as step_to:
        step_to("families")
        form = form_to_measure(arm)
        answer = zones(
            form, tip_speed, turn_speed,
            joint_speeds=speeds,
            within=parts,
            boxes=boxes or BOXES,
            progress=lambda what, k, n: step_to(what, f"{k} boxes of at most {n}"),
        )  # fmt: skip
    if not emit_json(answer, json_target):
        emit_lines(answer.text(in_degrees(deg)))
