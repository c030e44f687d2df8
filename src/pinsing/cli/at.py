"""``pinsing at``: one configuration; ``--suggest``: one far from all singular ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.cli.check import angle
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    fail_option,
    in_degrees,
    joint_speeds_option,
    joint_vector,
    json_option,
    once_option,
    parse_numbers,
    tip_speed_options,
    told_degrees,
    typed_speeds,
)
from pinsing.cli.output import emit, emit_json, emit_json_data, emit_lines, say
from pinsing.cli.running import doing
from pinsing.errors import OptionError, PinsingError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families import ClosedForm
    from pinsing.kinematics.at import State
    from pinsing.kinematics.lost_motion import LostMotion
    from pinsing.measures import Array
    from pinsing.proximity.clearance import Distances, FamilyDistance
    from pinsing.robot.arm import Arm


@command("at")
@arm_options
@once_option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="Joint values, base to tip: radians (pi/2 is understood) and metres.",
)
@click.option(
    "--nominal/--raw",
    "use_nominal",
    help="The nominal geometry (the design if there is one, else without rounding), or the numbers "
    "of the file.  [default: raw]",
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
@click.option(
    "--distances/--no-distances",
    "far",
    default=True,
    help="Measure the distance to every family of singular configurations.",
)
@tip_speed_options
@joint_speeds_option
@deg_option
@json_option
@fail_option
def at_command(
    request: RobotRequest,
    q: str,
    use_nominal: bool,
    rtol: float | None,
    near_rtol: float | None,
    far: bool,
    tip_speed: float,
    turn_speed: float,
    joint_speeds: str | None,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Analyze one configuration of ROBOT.

    Singular values, rank, manipulability, condition number, velocity ellipsoids, what motion
    is lost, which joint axes line up, and how far it is to each family of singular configurations,
    nearest first, with a proof that it is not nearer.

    Example: pinsing at ur5 --q 0,-90,90,0,0,0 --deg
    """
    parse_numbers(q, "--q", deg)  # a slip of the pen, before the robot is read
    arm = request.load()
    from pinsing.kinematics.at import LABEL, at, state_text
    from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
    from pinsing.proximity.clearance import distance_words
    from pinsing.robot.nominal import nominal

    values = joint_vector(arm, q, "--q", deg)
    state = at(
        nominal(arm.design or arm).arm if use_nominal else arm,
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
    state: State, found: tuple[ClosedForm, Distances] | None, degrees: bool, robot: str
) -> str:
    """Return what is wrong there, if anything, what is near, and what to do: five lines at most."""
    from pinsing.arguments import typed
    from pinsing.kinematics.ladder import posture_names
    from pinsing.measures import ALIKE
    from pinsing.proximity.clearance import titled, watch
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
            f"{arm.joints[j]} by {_amount(float(away[j]), degrees and not slides, '+')}"
            f"{' m' * slides or ' rad' * (not degrees)}"
            for j, slides in ((j, bool(arm.prismatic[j])) for j in moved)
        )
        turns, slides = not arm.prismatic[moved].any(), arm.prismatic[moved].all()
        unit = " m" if slides else " rad" * (turns and not degrees)
        scale = arm.length_scale if slides else 1.0
        far, least = (f"{_amount(x * scale, degrees and turns)}{unit}" for x in (d.upper, d.lower))
        proven = f" (at least {least}, proven{of * watched.nominal})" if watched and of else ""
        what = f"{titled(d.family, d.title)}{of}, {far} away{proven}: {moves}"
        lines.append(f"  Nearest {other}singularity{within}: {what}")
    elif others:
        lines.append(f"  No {other}singularity within the joint limits")
    if watched is not None and watched.tube:
        lines.append(f"  {watched.tube}")
    typed_q = typed(state.q, arm.prismatic, degrees, digits=6)
    word = "Other postures" if state.singular else "See it"
    lines.append(f"  {word}: pinsing {'postures' if state.singular else 'view'} {robot} {typed_q}")
    return "\n".join(lines)


def _plain(motion: LostMotion) -> str:
    """What cannot be done, of a line or a screw with the tool's orientation held."""
    if motion.kind not in ("line", "screw"):
        return motion.words
    where = motion.words.rpartition(" in direction ")[2]
    return f"cannot move in direction {where} with the tool's orientation held"


def _nearest(form: ClosedForm, others: list[FamilyDistance], state: State) -> FamilyDistance | None:
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


def _amount(value: float, degrees: bool, sign: str = "") -> str:
    return f"{math.degrees(value):{sign}.4g}°" if degrees else f"{value:{sign}.4g}"


def _distances(arm: Arm, q: Array) -> tuple[ClosedForm, Distances] | None:
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
@arm_options
@click.option(
    "--near",
    "--q",
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
    OptionError.refuse_if(reach is not None and near is None, "--reach is for use with --near")
    if near is not None:
        parse_numbers(near, "--near", deg)
    from pinsing.proximity.suggestion import REACH, suggest

    radius = REACH if reach is None else angle(reach, "--reach", told_degrees(deg))
    arm = request.load()
    start = None if near is None else joint_vector(arm, near, "--near", deg)
    with doing("searching for a configuration"):
        found = suggest(arm, near=start, reach=radius, families=families or None, seed=seed)
    if not emit_json(found, json_target):
        emit_lines(found.text(in_degrees(deg)))
