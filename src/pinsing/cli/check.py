"""``pinsing check``: a trajectory."""

from __future__ import annotations

import contextlib
import gc
import json
import math
import os
import re
import signal
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    follow_option,
    in_degrees,
    joint_speeds_option,
    loops_at_hand,
    output_option,
    tip_speed_options,
    told_degrees,
    typed_speeds,
)
from pinsing.cli.output import emit_json, emit_lines, followed, off_screen, save_figure, say, show
from pinsing.cli.running import doing, run_progress
from pinsing.cli.zones import zones_option
from pinsing.errors import ConfigurationError, OptionError

if TYPE_CHECKING:
    from pinsing.families import ClosedForm
    from pinsing.measures import Array
    from pinsing.postures.aspects import Aspects
    from pinsing.proximity.trajectory import TrajectoryCheck
    from pinsing.proximity.trajectory_file import TrajectoryFile
    from pinsing.proximity.zones import Zones
    from pinsing.robot.arm import Arm

F = TypeVar("F", bound=Callable[..., Any])
_ANGLE = re.compile(r"\s*([0-9.eE+-]+)\s*(deg|°|rad)?\s*")


def angle(text: str, option: str, degrees: bool | None) -> float:
    """Return radians of ``3deg``, ``0.05rad`` or a number; OptionError if in no unit, or <= 0."""
    match = _ANGLE.fullmatch(text)
    try:
        value = float(match.group(1)) if match else math.nan
    except ValueError:
        value = math.nan
    OptionError.refuse_if(
        not (value > 0 and math.isfinite(value)),
        f"{option}: {text!r} is no positive angle such as 3deg or 0.05rad",
    )
    unit = match.group(2) if match else None
    OptionError.refuse_if(
        unit is None and degrees is None,
        f"{option} {text} is in no unit: write {text}deg or {text}rad",
    )
    return math.radians(value) if unit in ("deg", "°") or (degrees and not unit) else value


def file_options(command: F) -> F:
    """Add how FILE, a trajectory, is read: see `read_samples`."""
    told = "Of the angles in FILE; by default as its head says, else of --deg or --rad."
    columns = "Columns of the joints, base to tip, by name or number from 1, and t=NAME for times."
    command = click.option("--columns", metavar="A,B,...", help=columns)(command)
    return click.option("--units", type=click.Choice(["rad", "deg"]), help=told)(command)


def _in_degrees(deg: bool, units: str | None) -> bool | None:
    """Return what --units, --deg or --rad says of angles; None where nothing was typed."""
    return told_degrees(deg) if units is None else units == "deg"


def read_samples(
    file: Path, arm: Arm, deg: bool, units: str | None, columns: str | None
) -> TrajectoryFile:
    """Read a trajectory as the options say, and print what was assumed."""
    from pinsing.proximity.trajectory_file import read_trajectory

    names = [] if columns is None else [word.strip() for word in columns.split(",")]
    read = read_trajectory(file, arm, _in_degrees(deg, units), names)
    for note in read.notes:
        say(f"note: {note}")
    return read


@command("check")
@arm_options
@click.argument("file", required=False, type=click.Path(path_type=Path, allow_dash=True))
@follow_option("Print a verdict for each line of STREAM as it comes, as JSON")
@deg_option
@file_options
@click.option(
    "--near",
    default="5deg",
    show_default=True,
    metavar="ANGLE",
    help="Report segments closer than this.",
)
@click.option(
    "--fail-within",
    metavar="ANGLE",
    help="Exit with code 1 unless it is proven to stay farther away than this.",
)
@click.option(
    "--family", "families", multiple=True, metavar="NAME", help="Only this family; repeatable."
)
@tip_speed_options
@joint_speeds_option
@zones_option
@click.option("--view", "view", is_flag=True, help="Show the path in a browser, by clearance.")
@click.option("--no-open", is_flag=True, help="With --view: do not open a browser.")
@output_option(json_target=".json", html=".html", plot=".png .svg .pdf")
def check_command(
    request: RobotRequest,
    file: Path | None,
    follow: Path | None,
    deg: bool,
    units: str | None,
    columns: str | None,
    near: str,
    fail_within: str | None,
    families: tuple[str, ...],
    tip_speed: float,
    turn_speed: float,
    joint_speeds: str | None,
    zones: Zones | None,
    plot: Path | None,
    view: bool,
    html: Path | None,
    no_open: bool,
    json_target: str | Path | None,
) -> int:
    """Check the trajectory in FILE: which singularities it meets, when, and how near it comes.

    FILE is a table as text (joints by name or number, or without a head; a column t or time),
    NPY, NPZ (q, t), YAML or JSON of ROS, or a robot program (.ls, .script).
    Between samples joints move linearly; what is said to be clear is proven clear.

    Example: pinsing check ur5 path.csv --deg --fail-within 3deg
    """
    bound = angle(near, "--near", told_degrees(deg))
    fail = None if fail_within is None else angle(fail_within, "--fail-within", told_degrees(deg))
    OptionError.refuse_if(
        follow is not None and loops_at_hand(request.robot),
        f"--follow judges serial arms alone: {request.robot} has closed loops",
    )
    arm = request.load()
    from pinsing.families import closed_form

    if follow is not None:
        if any((file, families, columns, fail_within, plot, view, html, json_target)):
            said = "leave out FILE, --family, --columns, --fail-within, --view and -o"
            raise OptionError(f"--follow STREAM prints a verdict for each line: {said}")
        source = click.get_current_context().get_parameter_source
        speeds: dict[str, Any] = {
            "tip_speed": tip_speed,
            "turn_speed": turn_speed,
            "joint_speeds": typed_speeds(arm, joint_speeds, turn_speed, deg),
        }
        if all(source(name) is ParameterSource.DEFAULT for name in speeds):
            speeds = {}
        return _followed(arm, follow, _in_degrees(deg, units), bound, speeds | {"zones": zones})
    OptionError.refuse_if(zones is not None, "--zones is for --follow STREAM")
    if file is None:
        raise OptionError("name the FILE of a trajectory, or --follow - for standard input")
    from pinsing.proximity.trajectory import check_trajectory, details, summary

    read = read_samples(file, arm, deg, units, columns)
    with doing("looking for families"):
        form = closed_form(arm)
    with run_progress() as progress:
        check = check_trajectory(
            arm,
            read.Q,
            read.t,
            forms=form,
            families=families or None,
            near=bound,
            tip_speed=tip_speed,
            turn_speed=turn_speed,
            joint_speeds=typed_speeds(arm, joint_speeds, turn_speed, deg),
            progress=progress,
        )
    check = with_aspects(check, arm, form, read.Q, read.t)
    if plot is not None:
        off_screen()
        from pinsing.plot.curves import clearance_along

        axes: Any = clearance_along(form, read.Q, read.t, families=families or None)
        save_figure(axes.figure, plot, bbox_inches="tight")
    if not emit_json(check, json_target):
        degrees = in_degrees(deg)
        answer = summary(check, degrees, file.name, request.words)
        emit_lines(f"{answer}\n\n{details(check, degrees)}")
    if view or html is not None:
        from pinsing.families.form import coverage_words
        from pinsing.view.trajectory import trajectory_data
        from pinsing.view.viewer import Viewer

        said = coverage_words(form)
        shown = trajectory_data(
            arm, check, read.Q, read.t, name=file.name, robot=request.words, notes=read.notes
        )
        viewer = Viewer(arm, form.families, shown=shown, coverage=said, host="127.0.0.1")
        show(viewer, html, view, no_open)
    return int(fail is not None and not check.clearance > fail)


def with_aspects(
    check: TrajectoryCheck, arm: Arm, form: ClosedForm, Q: Array, t: Array | None
) -> TrajectoryCheck:
    """Return a check with the changes of aspect, where it crosses, and the posture to start in."""
    if all(c.kind != "crossing" for c in check.crossings):
        return check
    from pinsing.postures.aspects import aspect_changes, aspects

    with doing("counting the aspects"):
        found = aspects(form, not check.outside)
    if not found.proven:
        skipped = "changes of aspect are left out: not all aspects are distinguished"
        return replace(check, notes=(*check.notes, skipped))
    # Of a robot with a design, no way in its aspect is known to be regular.
    other, alone = _posture_of_the_end(arm, Q, found) if form.tube is None else (None, False)
    changes = aspect_changes(form, Q, t, of=found)
    return replace(check, aspect_changes=changes, other=other, alone=alone and not check.outside)


def _posture_of_the_end(arm: Arm, Q: Array, found: Aspects) -> tuple[Array | None, bool]:
    """Another posture of the first pose, in the aspect that the end is in; whether none is left."""
    from pinsing.kinematics.inverse import inverse
    from pinsing.kinematics.jacobian import tip_placement

    end = found.of(Q[-1])
    if end is None or arm.n > 6 or arm.coupling is not None:
        return None, False
    postures = inverse(arm, tip_placement(arm, Q[0]).homogeneous, near=Q[0])
    usable = [s for s in postures if s.regular and s.within_limits]
    for s in usable:
        near = Q[-1] + arm.space.wrap(s.q - Q[-1])  # of its whole-turn copies the nearest
        near[arm.space.outside(near)] = s.q[arm.space.outside(near)]
        for q in (near, s.q):
            if found.of(q) == end:
                return q, False
    return None, len(usable) == 1


def _followed(
    arm: Arm, file: Path, degrees: bool | None, near: float, more: Mapping[str, Any]
) -> int:
    """Judge each line that comes. A plain file is read whole; of a live stream, old lines go."""
    from pinsing._batch import engine
    from pinsing.families import closed_form
    from pinsing.proximity.monitor import Follower, follow

    if not engine.available():
        say("note: without the compiled kernel a verdict may take half a second")
    follower, judged = Follower(closed_form(arm), arm, degrees, near, told=say, **more), False
    with _ended_at_once(), followed(file) as (lines, live):
        gc.freeze()  # a collection of all that was imported takes many milliseconds
        for said in follow(follower, lines, live):
            judged |= "level" in said
            click.echo(json.dumps(said))
    ConfigurationError.refuse_if(not judged, "the stream: no line could be judged")
    return 0


@contextlib.contextmanager
def _ended_at_once() -> Iterator[None]:
    """Signals end the process between two verdicts, whether or not anybody takes the last one."""
    said = {signal.SIGINT: b"\npinsing: stopped\n", signal.SIGTERM: b"pinsing: terminated\n"}

    def end(number: int, frame: FrameType | None) -> None:
        os.write(2, said[signal.Signals(number)])
        os._exit(128 + number)

    before = {number: signal.signal(number, end) for number in said}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
