"""``pinsing at``: one configuration."""

from __future__ import annotations

from pathlib import Path

import click

from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    fail_option,
    joint_vector,
    json_option,
    parse_numbers,
)
from pinsing.cli.output import emit, emit_json, say
from pinsing.prose import Page


@click.command("at", short_help="Everything about one configuration.")
@arm_options
@click.option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="Joint values, base to tip: radians (pi/2 is understood) and metres.",
)
@click.option(
    "--nominal/--raw",
    "use_nominal",
    help="The nominal geometry (rounding taken out), or the numbers of the file.  [default: raw]",
)
@click.option(
    "--rtol",
    type=float,
    metavar="RATIO",
    help="Singular if sigma_r/sigma_1 is at or below this.  [default: 1e-9]",
)
@click.option(
    "--near-rtol",
    type=float,
    metavar="RATIO",
    help="Near-singular at or below this.  [default: 0.01]",
)
@deg_option
@json_option
@fail_option
def at_command(
    request: RobotRequest,
    q: str,
    use_nominal: bool,
    rtol: float | None,
    near_rtol: float | None,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Everything about one configuration of ROBOT.

    Singular values, rank, manipulability, condition number, velocity ellipsoids, what motion
    is lost, and which joint axes line up.

    Example: pinsing at ur5 --q 0,-90,90,0,0,0 --deg
    """
    parse_numbers(q, "--q", deg)  # a slip of the pen, before the robot is read
    arm = request.load()
    from pinsing.configuration.at import at
    from pinsing.configuration.state import state_text
    from pinsing.geometry.nominal import nominal
    from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL

    values = joint_vector(arm, q, "--q", deg)
    state = at(
        nominal(arm).arm if use_nominal else arm,
        values,
        rtol=SINGULAR_RTOL if rtol is None else rtol,
        near_rtol=NEAR_RTOL if near_rtol is None else near_rtol,
    )
    for name in state.outside:
        say(f"note: joint {name} is outside its limits")
    if not emit_json(state, json_target):
        emit(state_text(state, deg, Page.of()))
    return int(fail_if_singular and state.singular)
