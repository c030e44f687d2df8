"""``pinsing map``: how near to singular an arm is, over all of its joints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.cli import STOPPED, completion
from pinsing.cli.mechanism import loops_option, map_loops, over_option
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    fail_option,
    in_degrees,
    joint_names,
    joint_vector,
    once_option,
    output_option,
    parse_numbers,
    whole_number,
)
from pinsing.cli.output import emit, emit_json, say
from pinsing.cli.running import RunPlace, place_options, run_progress, say_stopped
from pinsing.errors import OptionError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.robot.arm import Arm


@command("map")
@loops_option(map_loops)
@arm_options
@click.option(
    "--sampling",
    default="sobol",
    show_default=True,
    metavar="NAME",
    shell_complete=completion.choices("sobol", "random", "grid"),
    help="sobol, random or grid.",
)
@click.option(
    "--measure",
    type=click.Choice(("sigma", "clearance")),
    default="sigma",
    show_default=True,
    help="clearance: bounds of the distance to the nearest family too.",
)
@click.option("--count", metavar="N", help="Configurations, such as 1e8.  [default: 2**20]")
@click.option("--steps", metavar="N|A=N,...", help="Values of each joint in a grid.")
@click.option(
    "--map-joints",
    metavar="A,B,...",
    shell_complete=completion.joints,
    help="Joints to map.  [default: all that matter]",
)
@click.option(
    "--range",
    "ranges",
    metavar="JOINT=LOW,HIGH",
    multiple=True,
    shell_complete=completion.joint_value,
    help="Range of a joint instead of its limits; repeatable.",
)
@once_option("--q", "q", metavar="Q1,Q2,...", help="Where joints that are not mapped stay.")
@click.option("--ignore-limits", is_flag=True, help="Ignore joint limits.")
@click.option(
    "--worst",
    type=click.IntRange(min=1),
    metavar="K",
    help="How many of the smallest ratios to keep.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--keep-values", is_flag=True, help="Keep all singular values in -o FOLDER too.")
@click.option("--chunk", metavar="N", help="Configurations in a chunk.")
@place_options
@deg_option
@output_option(json_target=".json", out="/")
@fail_option
@over_option
def map_command(
    request: RobotRequest,
    sampling: str,
    measure: str,
    count: str | None,
    steps: str | None,
    map_joints: str | None,
    ranges: tuple[str, ...],
    q: str | None,
    ignore_limits: bool,
    worst: int | None,
    seed: int,
    out: Path | None,
    keep_values: bool,
    chunk: str | None,
    place: RunPlace,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Compute how sigma_r of ROBOT is distributed over its joints, and where it is smallest.

    Takes any number of configurations in bounded memory. With -o FOLDER each finished chunk is
    kept, and the same command resumes a run that was stopped or killed, with the same result.
    With --fail-if-singular, exits with 1 if a configuration is singular. With --loops: of a
    mechanism, at inputs or poses of its output drawn at random (--count, --seed, --worst,
    --ignore-limits).
    """
    # All that can be wrong without the robot is found before it is read.
    chosen: dict[str, Any] = {"ignore_limits": ignore_limits, "seed": seed, "out": out}
    chosen |= {"keep_values": keep_values, "measure": measure}
    for name, text in (("count", count), ("chunk", chunk)):
        if text is not None:
            chosen[name] = whole_number(text, f"--{name}")
    if worst is not None:
        chosen["worst"] = worst
    by_joint: int | dict[str, int] | None = None
    if steps is not None:
        by_joint = _steps(steps)
    pairs = [_range(text, deg) for text in ranges]
    if q is not None:
        parse_numbers(q, "--q", deg)
    OptionError.refuse_if(
        keep_values and out is None, "--keep-values needs a folder to keep them in: give -o FOLDER"
    )
    arm = request.load()
    if q is not None:
        chosen["q"] = joint_vector(arm, q, "--q", deg)
    if map_joints is not None:
        chosen["joints"] = joint_names(arm, map_joints)
    if isinstance(by_joint, dict):
        by_joint = {joint_names(arm, name)[0]: count for name, count in by_joint.items()}
    if by_joint is not None:
        chosen["steps"] = by_joint
    if pairs:
        named = [(joint_names(arm, name)[0], low, high) for name, low, high in pairs]
        chosen["ranges"] = {n: _in_radians(arm, n, low, high, deg) for n, low, high in named}
    from pinsing.sampling import sigma_map
    from pinsing.sampling.execute import ctrl_c_afterwards

    result = None
    try:
        with place.options() as where, run_progress() as progress, ctrl_c_afterwards():
            result = sigma_map(arm, sampling, **chosen, **where, progress=progress, tell=say)
    except KeyboardInterrupt:  # what is complete is told, however late that came
        if result is None:
            say_stopped(out)
            return STOPPED
    if not emit_json(result, json_target):
        emit(result.text(Page.of(), in_degrees(deg)))
    if not result.complete:
        say_stopped(out)
        return STOPPED
    return int(fail_if_singular and result.singular > 0)


def _steps(text: str) -> int | dict[str, int]:
    if "=" not in text:
        return whole_number(text, "--steps")
    found = {}
    for part in text.split(","):
        name, equals, number = part.partition("=")
        OptionError.refuse_if(
            not equals or not name.strip(), f"--steps {text!r} is not of the form 9 or A=9,B=5"
        )
        found[name.strip()] = whole_number(number, "--steps")
    return found


def _range(text: str, deg: bool) -> tuple[str, float, float]:
    name, equals, values = text.rpartition("=")
    OptionError.refuse_if(
        not equals or not name.strip(), f"--range {text!r} is not of the form JOINT=LOW,HIGH"
    )
    numbers = parse_numbers(values, "--range", deg)
    OptionError.refuse_if(len(numbers) != 2, f"--range {text!r} needs two values: JOINT=LOW,HIGH")
    return name.strip(), numbers[0], numbers[1]


def _in_radians(arm: Arm, name: str, low: float, high: float, deg: bool) -> tuple[float, float]:
    slides = name in arm.joints and bool(arm.prismatic[arm.joints.index(name)])
    factor = 3.141592653589793 / 180 if deg and not slides else 1.0
    return low * factor, high * factor
