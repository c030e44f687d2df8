"""``pinsing zones``: how near is too near."""

from __future__ import annotations

import math
from pathlib import Path

import click

from pinsing.cli.grouped import command
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    in_degrees,
    joint_names,
    joint_speeds_option,
    json_option,
    parse_numbers,
    tip_speed_options,
    typed_speeds,
)
from pinsing.cli.output import emit_json, emit_lines
from pinsing.cli.waiting import waiting
from pinsing.errors import OptionError


@command("zones")
@arm_options
@tip_speed_options
@joint_speeds_option
@click.option(
    "--within",
    multiple=True,
    metavar="limits|JOINT=A..B",
    help="Only where joints are in these ranges (radians or --deg, and metres); repeatable.",
)
@deg_option
@json_option
def zones_command(
    request: RobotRequest,
    tip_speed: float,
    turn_speed: float,
    joint_speeds: str | None,
    within: tuple[str, ...],
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
    from pinsing.proximity.zones import zones

    ranges: dict[str, tuple[float, float]] = {}
    for text in within:
        name, found, ends = text.partition("=")
        if not found:
            continue
        low, dots, high = ends.partition("..")
        joint = joint_names(arm, name)
        if not dots or len(joint) != 1:
            raise OptionError(f"--within {text}: write JOINT=A..B, such as q3=40..140")
        slides = bool(arm.prismatic[arm.joints.index(joint[0])])
        factor = math.pi / 180 if deg and not slides else 1.0
        a, b = (factor * parse_numbers(x, "--within", deg)[0] for x in (low, high))
        ranges[joint[0]] = a, b
    words = [text for text in within if "=" not in text]
    if len(words) > 1 or (words and ranges):
        raise OptionError("--within takes ranges of joints, or one word alone")
    with waiting() as step_to:
        step_to("families")
        form = form_to_measure(arm)
        answer = zones(
            form, tip_speed, turn_speed,
            joint_speeds=typed_speeds(joint_speeds),
            within=words[0] if words else ranges or None,
            progress=lambda what, k, n: step_to(f"{what}: {k} boxes of at most {n}"),
        )  # fmt: skip
    if not emit_json(answer, json_target):
        emit_lines(answer.text(in_degrees(deg)))
