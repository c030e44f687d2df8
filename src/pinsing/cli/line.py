"""``pinsing line``: a straight line of the tip."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import click

from pinsing.cli.grouped import command
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    fail_option,
    in_degrees,
    joint_vector,
    json_option,
    once_option,
    parse_numbers,
)
from pinsing.cli.output import emit_json, emit_lines
from pinsing.cli.waiting import doing
from pinsing.errors import OptionError


@command("line")
@arm_options
@once_option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="Where it starts: joint values, base to tip, radians (or --deg) and metres.",
)
@once_option(
    "--to",
    "target",
    required=True,
    metavar="X,Y,Z[,R,P,Y]",
    help="Target of the tip in the base frame: metres; roll, pitch, yaw, or as it is.",
)
@click.option(
    "--speed", type=float, default=0.25, show_default=True, metavar="M/S", help="Tip speed."
)
@deg_option
@json_option
@fail_option
def line_command(
    request: RobotRequest,
    q: str,
    target: str,
    speed: float,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Follow a straight line of the tip: where it ends, what it meets, which speed is possible.

    Example: pinsing line ur5 --q 10,-70,75,-90,-80,0 --deg --to 0.3,0.2,0.5
    """
    parse_numbers(q, "--q", deg)
    pose = parse_numbers(target, "--to", deg)
    if len(pose) not in (3, 6):
        raise OptionError(f"--to needs 3 numbers (x, y, z) or 6 (and roll, pitch, yaw): {target!r}")
    shown = pose if deg else [*pose[:3], *map(math.degrees, pose[3:])]
    if deg:
        pose = [*pose[:3], *map(math.radians, pose[3:])]
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.postures.motions import line_postures
    from pinsing.proximity.line import (
        check_line,
        left_limits,
        line_details,
        line_summary,
        stopped,
    )

    start = joint_vector(arm, q, "--q", deg)
    with doing("following the line"):
        form = form_to_measure(arm)
        line = check_line(arm, start, pose, speed, forms=form)
    if line.outcome != "reached" or stopped(line) or left_limits(line):
        with doing("following the line from the other postures"):
            line = replace(line, postures=line_postures(arm, start, pose, forms=form))
    if not emit_json(line, json_target):
        same = f"--to {','.join(f'{x:.6g}' for x in shown)} --speed {speed:g}"
        degrees = in_degrees(deg)
        answer = line_summary(line, degrees, request.words, same)
        emit_lines(f"{answer}\n\n{line_details(line, degrees)}")
    met = line.outcome == "singular" or bool(line.crossings)
    return int(fail_if_singular and met)
