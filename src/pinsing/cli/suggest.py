"""``pinsing at --suggest``: a configuration far from all singular ones."""

from __future__ import annotations

from pathlib import Path

import click

from pinsing.cli.check import angle
from pinsing.cli.grouped import command
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    in_degrees,
    joint_vector,
    json_option,
    parse_numbers,
)
from pinsing.cli.output import emit_json, emit_lines
from pinsing.cli.waiting import doing
from pinsing.errors import OptionError


@command("suggest")
@arm_options
@click.option(
    "--near",
    metavar="Q1,Q2,...",
    help="A configuration that it should be near: radians (or --deg) and metres.",
)
@click.option(
    "--reach",
    metavar="ANGLE",
    help="How far from --near it may be, such as 30deg.  [default: 0.5rad]",
)
@click.option(
    "--family", "families", multiple=True, metavar="NAME", help="Only this family; repeatable."
)
@click.option(
    "--seed", type=int, default=0, show_default=True, metavar="N", help="Of the search's starts."
)
@deg_option
@json_option
def suggest_command(
    request: RobotRequest,
    near: str | None,
    reach: str | None,
    families: tuple[str, ...],
    seed: int,
    deg: bool,
    json_target: str | Path | None,
) -> None:
    """Suggest a configuration of ROBOT within its limits with a large, proven clearance.

    Such as for a home pose. The first line is ready to paste.

    Example: pinsing at --suggest ur5 --near 0,-90,90,0,0,0 --deg
    """
    if reach is not None and near is None:
        raise OptionError("--reach is for use with --near")
    if near is not None:
        parse_numbers(near, "--near", deg)
    from pinsing.proximity.suggestion import REACH, suggest

    radius = REACH if reach is None else angle(reach, "--reach", deg)
    arm = request.load()
    start = None if near is None else joint_vector(arm, near, "--near", deg)
    with doing("searching for a configuration"):
        found = suggest(arm, near=start, reach=radius, families=families or None, seed=seed)
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))
