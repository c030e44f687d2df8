"""``pinsing postures``: other postures of a pose, aspects, and posture changes (cuspidal)."""

from __future__ import annotations

from pathlib import Path

import click

from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    in_degrees,
    joint_vector,
    json_option,
    once_option,
    output_option,
    parse_numbers,
)
from pinsing.cli.output import emit_json, emit_lines, show
from pinsing.cli.running import doing

_ignore_limits = click.option("--ignore-limits", is_flag=True, help="Ignore joint limits.")


@command("aspects")
@arm_options
@_ignore_limits
@deg_option
@json_option
def aspects_command(
    request: RobotRequest, ignore_limits: bool, deg: bool, json_target: str | Path | None
) -> None:
    """Count the aspects of ROBOT (singularity-free regions of joint space).

    Every path from one aspect to another meets a singular configuration.

    Example: pinsing postures --aspects ur5
    """
    arm = request.load()
    from pinsing.families import closed_form
    from pinsing.postures.aspects import aspects

    with doing("counting aspects"):
        found = aspects(closed_form(arm), limits=not ignore_limits)
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))


@command("postures")
@arm_options
@once_option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="A configuration: joint values, base to tip, radians (or --deg) and metres.",
)
@_ignore_limits
@click.option("--view", "view", is_flag=True, help="Show them in a browser.")
@click.option("--no-open", is_flag=True, help="With --view: do not open a browser.")
@deg_option
@output_option(json_target=".json", html=".html")
def postures_command(
    request: RobotRequest,
    q: str,
    ignore_limits: bool,
    view: bool,
    html: Path | None,
    no_open: bool,
    deg: bool,
    json_target: str | Path | None,
) -> None:
    """List the other inverse solutions of the pose of ROBOT at a configuration.

    Of each: its aspect, and whether a path without a singularity leads to it.

    Example: pinsing postures ur5 --q 10,-70,75,-90,-80,0 --deg
    """
    parse_numbers(q, "--q", deg)
    arm = request.load()
    from pinsing.families import closed_form
    from pinsing.postures.changes import posture_changes

    at = joint_vector(arm, q, "--q", deg)
    with doing("looking for other postures and paths to them, for a minute or so"):
        form = closed_form(arm)
        found = posture_changes(arm, at, forms=form, limits=not ignore_limits)
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))
    if view or html is not None:
        from pinsing.families.form import coverage_words
        from pinsing.view.viewer import Viewer

        said = coverage_words(form)
        viewer = Viewer(arm, form.families, postures=found, coverage=said, host="127.0.0.1")
        show(viewer, html, view, no_open)


@command("cuspidal")
@arm_options
@click.option(
    "--poses", type=int, default=60, show_default=True, metavar="N", help="Random poses to try."
)
@click.option("--seed", type=int, default=0, show_default=True, metavar="N", help="Of the poses.")
@deg_option
@json_option
def cuspidal_command(
    request: RobotRequest, poses: int, seed: int, deg: bool, json_target: str | Path | None
) -> None:
    """Test whether ROBOT is cuspidal: it can change posture without meeting a singularity.

    Joint limits do not count. With a witness where it is: two inverse solutions of one pose, and
    a proven way from one to the other.

    Example: pinsing postures --cuspidal puma560 --poses 20
    """
    arm = request.load()
    from pinsing.families import closed_form
    from pinsing.postures.changes import cuspidality

    with doing("trying random poses"):
        found = cuspidality(arm, forms=closed_form(arm), poses=poses, seed=seed)
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))
