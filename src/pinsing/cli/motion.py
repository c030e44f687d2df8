"""``pinsing at``, ``check``, ``line``, ``path``, ``postures``, ``zones``: how an arm is and moves.

``at`` is one configuration, ``at --suggest`` one far from all singular ones; ``check`` a
trajectory; ``path`` the best joint path through a toolpath, ``line`` a straight line of the tip;
``postures`` other postures of a pose, aspects, and posture changes (cuspidal); ``zones`` how near
is too near.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import math
import os
import re
import shlex
import signal
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pinsing import families, kinematics, postures, proximity, robot, view
from pinsing.cli.options import (
    VECTOR,
    JointValues,
    RobotRequest,
    Typed,
    argument,
    arm_options,
    chosen_for,
    command,
    deg_option,
    doubt_degrees,
    fail_option,
    follow_option,
    ignore_limits_option,
    in_degrees,
    joint_names,
    joint_speeds_option,
    joint_values,
    json_option,
    loops_at_hand,
    only_option,
    option,
    parse_numbers,
    tip_speed_option,
    told_degrees,
    turn_speed_option,
    typed_speeds,
    written,
    zones_option,
)
from pinsing.cli.output import (
    STDOUT,
    doing,
    emit,
    emit_json,
    emit_json_data,
    emit_lines,
    followed,
    off_screen,
    put,
    run_progress,
    save_figure,
    say,
    show_page,
    waiting,
)
from pinsing.errors import ConfigurationError, OptionError, PinsingError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.kinematics.lost_motion import LostMotion
    from pinsing.measures import Array
    from pinsing.proximity.clearance import Distances, FamilyDistance
    from pinsing.proximity.trajectory_file import TrajectoryFile


def _tell(found: Any, json_target: str | Path | None, deg: bool) -> None:
    """Print an answer, or write it as JSON."""
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))


@command("zones")
def zones_command(
    request: RobotRequest = arm_options,
    tip_speed: float = tip_speed_option,
    turn_speed: float = turn_speed_option,
    joint_speeds: str | None = joint_speeds_option,
    within: tuple[str, ...] = option(
        "Only within limits, in a posture (elbow up), or with a joint or the tip's x, y, z in a "
        "range (q3=A..B, z=A..B); repeatable.",
        multiple=True,
        metavar="limits|POSTURE|RANGE",
    ),
    boxes: int | None = option(
        "Work: with more, smaller distances are proven.  [default: 1500000, 4 s of a UR5, "
        "less with --within]",
        type=click.IntRange(min=1),
        metavar="N",
    ),
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
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
        (value,) = parse_numbers(text, f"--within {name}", deg and turns(name))
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
    _tell(answer, json_target, deg)


_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_ANGLE = re.compile(rf"\s*({_NUMBER})\s*(deg|°|rad)?\s*")


def angle(text: str, option: str, degrees: bool | None) -> float:
    """Return radians of ``3deg``, ``0.05rad`` or a number; OptionError if in no unit, or <= 0."""
    match = _ANGLE.fullmatch(text)
    value = float(match[1]) if match else math.nan
    OptionError.refuse_if(
        not (value > 0 and math.isfinite(value)),
        f"{option}: {text!r} is no positive angle such as 3deg or 0.05rad",
    )
    unit = match[2] if match else None
    OptionError.refuse_if(
        unit is None and degrees is None,
        f"{option} {text} is in no unit: write {text}deg or {text}rad",
    )
    return math.radians(value) if unit in ("deg", "°") or (degrees and not unit) else value


ANGLE = Typed("ANGLE", angle)


def _columns(text: str, option: str, degrees: bool | None) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(","))


units_option = option(
    "Of the angles in FILE; by default as its head says, else of --deg or --rad.",
    type=click.Choice(["rad", "deg"]),
)
columns_option = option(
    "Columns of the joints, base to tip, by name or number from 1, and t=NAME for times.",
    type=Typed("A,B,...", _columns),
)


def _in_degrees(units: str | None) -> bool | None:
    """Return what --units, --deg or --rad says of angles; None where nothing was typed."""
    return told_degrees() if units is None else units == "deg"


def read_samples(
    file: Path, arm: robot.Arm, units: str | None, columns: tuple[str, ...] | None
) -> TrajectoryFile:
    """Read a trajectory as the options say, and print what was assumed."""
    from pinsing.proximity.crossings import check_times
    from pinsing.proximity.trajectory_file import read_trajectory

    read = read_trajectory(file, arm, _in_degrees(units), columns or ())
    for note in read.notes:
        say(f"note: {note}")
    try:
        check_times(read.t, len(read.Q))
    except OptionError as error:
        raise OptionError(f"{file}: {error}") from None
    return read


@command("check")
def check_command(
    request: RobotRequest = arm_options,
    file: Path | None = argument(required=False, type=click.Path(path_type=Path, allow_dash=True)),
    follow: Path | None = follow_option(
        "Print a verdict for each line of STREAM as it comes, as JSON"
    ),
    deg: bool = deg_option,
    units: str | None = units_option,
    columns: tuple[str, ...] | None = columns_option,
    near: float = option("Report segments closer than this.", default="5deg", type=ANGLE),
    fail_within: float | None = option(
        "Exit with code 1 unless it is proven to stay farther away than this.", type=ANGLE
    ),
    only: tuple[str, ...] = only_option,
    tip_speed: float = tip_speed_option,
    turn_speed: float = turn_speed_option,
    joint_speeds: str | None = joint_speeds_option,
    zones: proximity.Zones | None = zones_option,
    live: bool = option("Show the path in a browser, by clearance.", "--view"),
    no_open: bool = option("With --view: do not open a browser."),
    json_target: str | Path | None = written(".json"),
    html: Path | None = written(".html"),
    plot: Path | None = written(".png .svg .pdf"),
) -> int:
    """Check the trajectory in FILE: which singularities it meets, when, and how near it comes.

    FILE is a table as text (joints by name or number, or without a head; a column t or time),
    NPY, NPZ (q, t), YAML or JSON of ROS, or a robot program (.ls, .script).
    Between samples joints move linearly; what is said to be clear is proven clear.

    Example: pinsing check ur5 path.csv --deg --fail-within 3deg
    """
    OptionError.refuse_if(
        follow is not None and loops_at_hand(request.robot),
        f"--follow judges serial arms alone: {request.robot} has closed loops",
    )
    arm = request.load()

    if follow is not None:
        if any((file, only, columns, fail_within, plot, live, html, json_target)):
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
        return _followed(arm, follow, _in_degrees(units), near, speeds | {"zones": zones})
    OptionError.refuse_if(zones is not None, "--zones is for --follow STREAM")
    if file is None:
        raise OptionError("name the FILE of a trajectory, or --follow - for standard input")
    from pinsing.proximity.trajectory import check_trajectory, details, summary

    read = read_samples(file, arm, units, columns)
    with doing("looking for families"):
        form = families.closed_form(arm)
    with run_progress() as progress:
        check = check_trajectory(
            arm,
            read.Q,
            read.t,
            forms=form,
            families=only or None,
            near=near,
            tip_speed=tip_speed,
            turn_speed=turn_speed,
            joint_speeds=typed_speeds(arm, joint_speeds, turn_speed, deg),
            progress=progress,
        )
    check = with_aspects(check, arm, form, read.Q, read.t)
    if plot is not None:
        off_screen()
        from pinsing.plot.curves import clearance_along

        axes: Any = clearance_along(form, read.Q, read.t, families=only or None)
        save_figure(axes.figure, plot, bbox_inches="tight")
    if not emit_json(check, json_target):
        degrees = in_degrees(deg)
        answer = summary(check, degrees, file.name, request.words)
        emit_lines(f"{answer}\n\n{details(check, degrees)}")
    if live or html is not None:
        from pinsing.families.form import coverage_words
        from pinsing.view.trajectory import trajectory_data

        shown = trajectory_data(
            arm, check, read.Q, read.t, name=file.name, robot=request.words, notes=read.notes
        )
        viewer = view.Viewer(arm, form.families, shown=shown, coverage=coverage_words(form))
        show_page(arm.name, lambda at: viewer, live, html=html, no_open=no_open)
    return int(fail_within is not None and not check.clearance > fail_within)


def with_aspects(
    check: proximity.TrajectoryCheck,
    arm: robot.Arm,
    form: families.ClosedForm,
    Q: Array,
    t: Array | None,
) -> proximity.TrajectoryCheck:
    """Return a check with the changes of aspect, where it crosses, and the posture to start in."""
    if all(c.kind != "crossing" for c in check.crossings):
        return check

    with doing("counting the aspects"):
        found = postures.aspects(form, not check.outside)
    if not found.proven:
        skipped = "changes of aspect are left out: not all aspects are distinguished"
        return replace(check, notes=(*check.notes, skipped))
    # Of a robot with a design, no way in its aspect is known to be regular.
    other, alone = _posture_of_the_end(arm, Q, found) if form.tube is None else (None, False)
    changes = postures.aspect_changes(form, Q, t, of=found)
    return replace(check, aspect_changes=changes, other=other, alone=alone and not check.outside)


def _posture_of_the_end(
    arm: robot.Arm, Q: Array, found: postures.Aspects
) -> tuple[Array | None, bool]:
    """Another posture of the first pose, in the aspect that the end is in; whether none is left."""
    from pinsing.kinematics.jacobian import tip_placement

    end = found.of(Q[-1])
    if end is None or arm.n > 6 or arm.coupling is not None:
        return None, False
    solutions = kinematics.inverse(arm, tip_placement(arm, Q[0]).homogeneous, near=Q[0])
    usable = [s for s in solutions if s.regular and s.within_limits]
    for s in usable:
        near = Q[-1] + arm.space.wrap(s.q - Q[-1])  # of its whole-turn copies the nearest
        near[arm.space.outside(near)] = s.q[arm.space.outside(near)]
        for q in (near, s.q):
            if found.of(q) == end:
                return q, False
    return None, len(usable) == 1


def _followed(
    arm: robot.Arm, file: Path, degrees: bool | None, near: float, more: Mapping[str, Any]
) -> int:
    """Judge each line that comes. A plain file is read whole; of a live stream, old lines go."""
    from pinsing._batch import engine
    from pinsing.proximity.monitor import Follower, follow

    if not engine.available():
        say("note: without the compiled kernel a verdict may take half a second")
    form, judged = families.closed_form(arm), False
    follower = Follower(form, arm, degrees, near, told=say, **more)
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


@command("at")
def at_command(
    request: RobotRequest = arm_options,
    q: JointValues = option(
        "Joint values, base to tip: radians (pi/2 is understood) and metres.",
        required=True,
        type=VECTOR,
    ),
    use_nominal: bool = option(
        "The nominal geometry (the design if there is one, else without rounding), or the numbers "
        "of the file.  [default: raw]",
        "--nominal/--raw",
    ),
    rtol: float | None = option(
        "Singular if sigma_r/sigma_1 is at or below this.  [default: 1e-9]", metavar="RATIO"
    ),
    near_rtol: float | None = option(
        "Near-singular at or below this.  [default: 0.01]", metavar="RATIO"
    ),
    far: bool = option(
        "Measure the distance to every family of singular configurations.",
        "--distances/--no-distances",
        default=True,
    ),
    tip_speed: float = tip_speed_option,
    turn_speed: float = turn_speed_option,
    joint_speeds: str | None = joint_speeds_option,
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
    fail_if_singular: bool = fail_option,
) -> int:
    """Analyze one configuration of ROBOT.

    Singular values, rank, manipulability, condition number, velocity ellipsoids, what motion
    is lost, which joint axes line up, and how far it is to each family of singular configurations,
    nearest first, with a proof that it is not nearer.

    Example: pinsing at ur5 --q 0,-90,90,0,0,0 --deg
    """
    arm = request.load()
    from pinsing.kinematics.at import LABEL, at, state_text
    from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
    from pinsing.proximity.clearance import distance_words

    values = q(arm)
    state = at(
        robot.nominal(arm.design or arm).arm if use_nominal else arm,
        values,
        rtol=SINGULAR_RTOL if rtol is None else rtol,
        near_rtol=NEAR_RTOL if near_rtol is None else near_rtol,
        tip_speed=tip_speed,
        turn_speed=turn_speed,
        joint_speeds=typed_speeds(arm, joint_speeds, turn_speed, deg),
    )
    degrees = in_degrees(deg)
    for said in arm.space.outside_words(values, degrees):
        say(f"note: {said}")
    found = _distances(arm, values) if far else None
    data = state.to_dict()
    if found is not None:
        data["distances"] = found[1].to_dict()
    if not emit_json_data(data, json_target):
        page = Page.of()
        emit_lines(_answer(state, found, degrees, request.words))
        emit("")
        emit(state_text(state, degrees, page))
        if found is not None:
            lines = distance_words(found[1], degrees, arm.space)
            emit("")
            rows = [("distance" if i == 0 else "", line) for i, line in enumerate(lines)]
            emit(page.fields(rows, LABEL))
    return int(fail_if_singular and state.singular)


def _answer(
    state: kinematics.State,
    found: tuple[families.ClosedForm, Distances] | None,
    degrees: bool,
    name: str,
) -> str:
    """Return what is wrong there, if anything, what is near, and what to do: five lines at most."""
    from pinsing.interface import typed
    from pinsing.kinematics.ladder import posture_names
    from pinsing.measures import ALIKE
    from pinsing.proximity.clearance import step_text, titled, watch
    from pinsing.proximity.trajectory import singularity

    arm, near = state.arm, () if found is None else found[1].families
    watched = None if found is None else watch(found[0])
    of = " of the design" * bool(watched and watched.tube)
    on = [d for d in near if d.upper <= ALIKE]
    called = " and ".join(singularity(d.family, d.title, d.where) + of for d in on)
    status = "SINGULAR" if state.singular else state.status
    geometry = None if found is None or state.singular else found[0].geometry
    posture = () if geometry is None else posture_names(geometry, state.q[None])[0]
    said = [f"on {called}"] * bool(on) + [", ".join(posture)] * bool(posture)
    lines = [", ".join([f"{arm.name}: {status}", *said])]
    if state.singular:
        lines += [f"  Lost: {_plain(motion)}" for motion in state.lost[:2]]
    others = [d for d in near if d.upper > ALIKE]
    d = None if found is None else _nearest(found[0], others, state)
    other = "other " * bool(on)
    # Of the distances some may be nearer, out of reach of the joints.
    within = " within the joint limits" * (d is not None and all(d is not o for o in others))
    if d is not None:
        away = d.q - state.q
        moved = [j for j, x in enumerate(away) if abs(x) > 1e-6]
        moves = ", ".join(
            f"{arm.joints[j]} by {step_text(float(away[j]), degrees, bool(arm.prismatic[j]))}"
            for j in moved
        )
        slides, scale = bool(arm.prismatic[moved].all()), arm.length_scale
        mixed = not slides and arm.prismatic[moved].any()
        far, least = (
            f"{x:.4g}" if mixed else step_text(scale * x if slides else x, degrees, slides, "")
            for x in (d.upper, d.lower)
        )
        proven = f" (at least {least}, proven{of * watched.nominal})" if watched and of else ""
        what = f"{titled(d.family, d.title)}{of}, {far} away{proven}: {moves}"
        lines.append(f"  Nearest {other}singularity{within}: {what}")
    elif others:
        lines.append(f"  No {other}singularity within the joint limits")
    if watched is not None and watched.tube:
        lines.append(f"  {watched.tube}")
    typed_q = typed(state.q, arm.prismatic, degrees, digits=6)
    word = "Other postures" if state.singular else "See it"
    lines.append(f"  {word}: pinsing {'postures' if state.singular else 'view'} {name} {typed_q}")
    return "\n".join(lines)


def _plain(motion: LostMotion) -> str:
    """What cannot be done, of a line or a screw with the tool's orientation held."""
    if motion.kind not in ("line", "screw"):
        return motion.words
    where = motion.words.replace("the line", "in direction of the line").split(" in direction ")[-1]
    return f"cannot move in direction {where} with the tool's orientation held"


def _nearest(
    form: families.ClosedForm, others: list[FamilyDistance], state: kinematics.State
) -> FamilyDistance | None:
    """The nearest family, within the joint limits where the configuration is; None without any."""
    from pinsing.measures import ALIKE

    space, best = state.arm.space, None
    inside = not space.outside(state.q).any()
    for d in others:
        if best is not None and d.lower >= best.upper:
            break
        if inside and (space.unreachable(d.q) & (abs(d.q - state.q) > ALIKE)).any():
            family = form[d.family]
            if family.is_reachable is False:
                continue
            within = family.distance(state.q, within_limits=True)
            d = replace(d, upper=within.upper, q=within.q)  # no nearer than without limits
        if math.isfinite(d.upper) and (best is None or d.upper < best.upper):
            best = d
    return best


def _distances(arm: robot.Arm, q: Array) -> tuple[families.ClosedForm, Distances] | None:
    """Distances to all families; none, and why, where closed forms are not to be had."""
    from pinsing.families.solve import form_to_measure
    from pinsing.proximity.clearance import distances

    try:
        with doing("looking for families"):
            form = form_to_measure(arm)
    except PinsingError as error:
        say(f"note: no distances to families: {error}")
        return None
    if not form.complete:
        say("note: the closed form is not complete: a singular configuration may be nearer")
    if not any(f.real for f in form.families):
        say(
            "note: no configuration of this arm is singular"
            if form.complete
            else "note: no family is known"
        )
        return None
    with doing("measuring the distance to each family"):
        return form, distances(form, q)


@command("suggest")
def suggest_command(
    request: RobotRequest = arm_options,
    near: JointValues | None = option(
        "A configuration that it should be near: radians (or --deg) and metres.",
        "--near",
        "--q",
        type=VECTOR,
    ),
    reach: float | None = option(
        "How far from --near it may be, such as 30deg.  [default: 0.5rad]", type=ANGLE
    ),
    only: tuple[str, ...] = only_option,
    seed: int = option("Of the search's starts.", default=0, metavar="N"),
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
) -> None:
    """Suggest a configuration of ROBOT within its limits with a large, proven clearance.

    Such as for a home pose. The first line is ready to paste.

    Example: pinsing at --suggest ur5 --near 0,-90,90,0,0,0 --deg
    """
    OptionError.refuse_if(reach is not None and near is None, "--reach is for use with --near")
    arm = request.load()

    chosen = chosen_for(arm, near=near, reach=reach, families=only or None)
    with doing("searching for a configuration"):
        found = proximity.suggest(arm, seed=seed, **chosen)
    _tell(found, json_target, deg)


@command("aspects")
def aspects_command(
    request: RobotRequest = arm_options,
    ignore_limits: bool = ignore_limits_option,
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
) -> None:
    """Count the aspects of ROBOT (singularity-free regions of joint space).

    Every path from one aspect to another meets a singular configuration.

    Example: pinsing postures --aspects ur5
    """
    arm = request.load()

    with doing("counting aspects"):
        found = postures.aspects(families.closed_form(arm), limits=not ignore_limits)
    _tell(found, json_target, deg)


@command("postures")
def postures_command(
    request: RobotRequest = arm_options,
    q: JointValues = option(
        "A configuration: joint values, base to tip, radians (or --deg) and metres.",
        required=True,
        type=VECTOR,
    ),
    ignore_limits: bool = ignore_limits_option,
    live: bool = option("Show them in a browser.", "--view"),
    no_open: bool = option("With --view: do not open a browser."),
    deg: bool = deg_option,
    json_target: str | Path | None = written(".json"),
    html: Path | None = written(".html"),
) -> None:
    """List the other inverse solutions of the pose of ROBOT at a configuration.

    Of each: its aspect, and whether a path without a singularity leads to it.

    Example: pinsing postures ur5 --q 10,-70,75,-90,-80,0 --deg
    """
    arm = request.load()

    at = q(arm)
    with doing("looking for other postures and paths to them, for a minute or so"):
        form = families.closed_form(arm)
        found = postures.posture_changes(arm, at, forms=form, limits=not ignore_limits)
    _tell(found, json_target, deg)
    if live or html is not None:
        from pinsing.families.form import coverage_words

        viewer = view.Viewer(arm, form.families, postures=found, coverage=coverage_words(form))
        show_page(arm.name, lambda at: viewer, live, html=html, no_open=no_open)


@command("cuspidal")
def cuspidal_command(
    request: RobotRequest = arm_options,
    poses: int = option("Random poses to try.", default=60, metavar="N"),
    seed: int = option("Of the poses.", default=0, metavar="N"),
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
) -> None:
    """Test whether ROBOT is cuspidal: it can change posture without meeting a singularity.

    Joint limits do not count. With a witness where it is: two inverse solutions of one pose, and
    a proven way from one to the other.

    Example: pinsing postures --cuspidal puma560 --poses 20
    """
    arm = request.load()

    with doing("trying random poses"):
        found = postures.cuspidality(arm, forms=families.closed_form(arm), poses=poses, seed=seed)
    _tell(found, json_target, deg)


def _ranges(text: str, option: str, degrees: bool | None) -> dict[str, tuple[float, float]]:
    """Ranges by name from ``x=-0.1..0.1,yaw=-30..30``, in metres and radians."""
    from pinsing.postures.placement import ANGLES

    out: dict[str, tuple[float, float]] = {}
    for part in text.split(","):
        name, _, ends = (word.strip() for word in part.partition("="))
        turns = name in ANGLES
        values = parse_numbers(ends.replace("..", " "), f"{option} {name}", bool(degrees) and turns)
        OptionError.refuse_if(
            ends.count("..") != 1 or len(values) != 2 or name in out,
            f"{option} {part!r}: write each range once, as in x=-0.1..0.1",
        )
        OptionError.refuse_if(
            turns and not degrees and max(map(abs, values)) > 2 * math.pi,
            f"{option} {part} is over a turn: for degrees add --deg",
        )
        low, high = (math.radians(v) if degrees and turns else v for v in values)
        out[name] = (low, high)
    return out


def _pose(text: str, option: str, degrees: bool | None) -> list[float]:
    """Three numbers, or six with roll, pitch, yaw, in metres and radians."""
    values = parse_numbers(text, option, degrees)
    OptionError.refuse_if(
        len(values) not in (3, 6),
        f"{option} needs 3 numbers (x, y, z) or 6 (and roll, pitch, yaw): {text!r}",
    )
    if degrees:
        doubt_degrees(values[3:], option)
    elif max(map(abs, values[3:]), default=0.0) > 2 * math.pi:
        raise OptionError(f"{option} {text}: angles over a turn: for degrees add --deg")
    return [*values[:3], *(map(math.radians, values[3:]) if degrees else values[3:])]


def _frame(text: str, option: str, degrees: bool | None) -> Array:
    """A pose (4, 4) from three numbers, or six with roll, pitch, yaw."""
    import numpy as np
    import pinocchio as pin

    values = _pose(text, option, degrees)
    if max(map(abs, values[:3])) > 20:
        metres = ",".join(f"{x / 1000:g}" for x in values[:3])
        raise OptionError(
            f"{option} {text}: its lengths are metres, with --mm too: for millimetres type {metres}"
        )
    turn = pin.rpy.rpyToMatrix(np.array(values[3:] or [0.0] * 3))
    return np.array(pin.SE3(turn, np.array(values[:3])).homogeneous)


def _start(text: str, option: str, degrees: bool | None) -> JointValues | str:
    """Joint values, or words: letters of numbers are pi at most."""
    return text if re.search("[a-z]{3}", text) else joint_values(text, option, degrees)


@command("path")
def path_command(
    request: RobotRequest = arm_options,
    poses: Path = argument(type=click.Path(path_type=Path)),
    free: str = option(
        "What may be chosen: the rotation about the tool's z axis, a seventh joint, or only the "
        "inverse kinematics branch.",
        default="branch",
        metavar="roll|JOINT|branch",
    ),
    step: float = option("Its grid.", default="1deg", type=Typed("ANGLE", angle, degrees=True)),
    tool: Array = option(
        "Pose of the tool in the tip frame, metres.",
        type=Typed("X,Y,Z[,R,P,Y]", _frame),
        default="0,0,0",
        show_default=False,
    ),
    base_frame: Array = option(
        "Frame of the poses, in the base frame of the robot, metres.",
        type=Typed("X,Y,Z[,R,P,Y]", _frame),
        default="0,0,0",
        show_default=False,
    ),
    start: JointValues | str | None = option(
        "Configuration at the first pose, or its posture: elbow up, wrist no-flip.",
        type=Typed("Q1,Q2,...", _start),
    ),
    place: dict[str, tuple[float, float]] | None = option(
        "Move the workpiece for more clearance (searched), in ranges of x, y, z (metres along the "
        "axes of the base) and roll, pitch, yaw (about them, through the middle of the path).",
        type=Typed("x=A..B,yaw=A..B", _ranges),
    ),
    feed: float | None = option("Tool speed: joint speed limits are kept.", metavar="M/S"),
    mm: bool = option("x, y, z of the file are millimetres."),
    deg: bool = deg_option,
    csv: str | Path | None = written(".csv"),
    json_target: str | Path | None = written(".json"),
    plot: Path | None = written(".png .svg .pdf"),
) -> int:
    """Find the joint path through POSES that stays farthest from singularities.

    POSES is a CSV file with a header: x, y, z and qx, qy, qz, qw, or roll, pitch, yaw, or i, j, k
    (of length 1, from the cutter into the tool, its -z; tool0's z points out of the flange); t, if
    there is one, gives seconds. The exit code is 1 if there is no path.

    Example: pinsing path ur5 seam.csv --free roll --tool 0,0.05,0.15,45,0,0 --deg -o joints.csv
    """
    import numpy as np
    import pinocchio as pin

    if feed is not None and not feed > 0:
        raise OptionError(f"--feed must be positive, got {feed:g}")
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.postures.placement import read_poses

    read = read_poses(poses, degrees=deg, millimetres=mm)
    OptionError.refuse_if(
        not read.has_roll and free != "roll",
        f"{poses} has no rotation about the tool: add --free roll",
    )
    T, t = base_frame @ read.poses, read.t
    if feed is not None:
        moved = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) / feed
        OptionError.refuse_if(
            not (moved > 0).all(),
            "--feed needs poses at different positions: give times in a column t",
        )
        OptionError.refuse_if(
            t is not None, f"{poses} has times in a column t: leave out --feed, or the column"
        )
        t = np.concatenate([[0.0], np.cumsum(moved)])
    q0 = start(arm) if isinstance(start, JointValues) else start
    with waiting() as step_to:
        free = free if free in ("roll", "branch") else joint_names(arm, [free])[0]
        step_to("families")
        form = form_to_measure(arm)
        plan = postures.plan_path(
            form, T, free=free, step=step, start=q0, t=t, arm=arm, tool=tool, place=place,
            progress=lambda what, k, n: step_to(what, f"{100 * k // n} %"),
        )  # fmt: skip
    if not emit_json(plan, json_target):
        emit_lines(plan.text(in_degrees(deg)))
        if plan.placement is not None:
            made = plan.placement.transform @ base_frame
            angles = pin.rpy.matrixToRpy(made[:3, :3]) * (180 / math.pi if deg else 1.0)
            frame = ",".join(f"{x + 0.0:.6g}" for x in (*made[:3, 3], *angles.round(9)))
            emit_lines(f"  The poses are then in --base-frame {frame}")
    if plan.reason:
        return 1
    if csv is not None:
        factor = np.where(arm.prismatic, 1.0, 180 / math.pi) if deg else np.ones(arm.n)
        columns = plan.q * factor
        names = [j if f == 1 else f"{j} (deg)" for j, f in zip(arm.joints, factor, strict=True)]
        if t is not None:
            columns, names = np.column_stack([t, columns]), ["t", *names]
        text = io.StringIO()
        np.savetxt(text, columns, fmt="%.12g", delimiter=",", header=",".join(names), comments="")
        put(text.getvalue(), csv)
        if STDOUT not in (csv, json_target):
            file, page = (shlex.quote(str(f)) for f in (csv, Path(csv).with_suffix(".html")))
            check = f"pinsing check {request.words} {file} {'--deg' if deg else '--rad'}"
            emit_lines(f"  Next, to play the path: {check} -o {page}")
    elif json_target != STDOUT:
        emit_lines("  Next: the same with -o joints.csv, which writes the joint values")
    if plot is not None:
        off_screen()
        from pinsing.plot.curves import path_sheet

        save_figure(path_sheet(plan, form), plot)
    return 0


@command("line")
def line_command(
    request: RobotRequest = arm_options,
    q: JointValues = option(
        "Where it starts: joint values, base to tip, radians (or --deg) and metres.",
        required=True,
        type=VECTOR,
    ),
    target: list[float] = option(
        "Target of the tip in the base frame: metres; roll, pitch, yaw, or as it is.",
        "--to",
        required=True,
        type=Typed("X,Y,Z[,R,P,Y]", _pose),
    ),
    speed: float = option("Tip speed.", default=0.25, metavar="M/S"),
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
    fail_if_singular: bool = fail_option,
) -> int:
    """Follow a straight line of the tip: where it ends, what it meets, which speed is possible.

    Example: pinsing line ur5 --q 10,-70,75,-90,-80,0 --deg --to 0.3,0.2,0.5
    """
    degrees = in_degrees(deg)
    shown = [*target[:3], *map(math.degrees, target[3:])] if degrees else target
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.proximity.line import check_line, left_limits, line_details, line_summary, stopped

    start = q(arm)
    with doing("following the line"):
        form = form_to_measure(arm)
        line = check_line(arm, start, target, speed, forms=form)
    if line.outcome != "reached" or stopped(line) or left_limits(line):
        with doing("following the line from the other postures"):
            line = replace(line, postures=postures.line_postures(arm, start, target, forms=form))
    if not emit_json(line, json_target):
        same = f"--to {','.join(f'{x:.6g}' for x in shown)} --speed {speed:g}"
        answer = line_summary(line, degrees, request.words, same)
        emit_lines(f"{answer}\n\n{line_details(line, degrees)}")
    return int(fail_if_singular and (line.outcome == "singular" or bool(line.crossings)))
