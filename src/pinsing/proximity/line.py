"""check_line: a straight line of the tip (MoveL), and where it ends, nears or overspeeds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np
import pinocchio as pin

from pinsing.algebra.conditions import sums_of
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import Branch
from pinsing.families.solve import form_to_measure
from pinsing.interface import JsonResult, checked, typed
from pinsing.kinematics.jacobian import (
    SINGULAR_RTOL,
    ratios,
    read_pose,
    task_rows,
    tip_and_jacobian,
    turn_left,
)
from pinsing.kinematics.tip_speed import check_speeds, limits_of
from pinsing.measures import ALIKE, FLOAT_NOISE, Array, ArrayLike
from pinsing.prose import listed
from pinsing.proximity.clearance import Forms, Watched, forms_of, metric_note, titled, watch
from pinsing.proximity.crossings import Approach, Crossing, NearStretch, Passage, runs
from pinsing.proximity.trajectory import (
    NEAR,
    OUTSIDE,
    angle_text,
    joint_text,
    joint_unit,
    section,
    singularity,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize

_LONGEST, _FIRST = 0.02, 1e-3


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line of the tip, from 0 to 1."""

    start: Array  # (3,), position at 0, base frame
    turn: Array  # (3, 3), rotation at 0
    along: Array  # (3,), from the first position to the last
    axis: Array  # (3,), rotation vector of all of the turn, base axes

    @classmethod
    def to(cls, arm: Arm, q: Array, target: tuple[Array, Array | None]) -> Line:
        """The line from the tip at q to a target; what the task leaves out is as at q."""
        here, R, _ = tip_and_jacobian(arm, q)
        position, rotation = target
        axis, task = np.zeros(3), arm.task
        OptionError.refuse_if(
            not task.places,
            f"task {task} only says how the tip moves, not where it is: a line needs all "
            "rows of a translation or rotation, or base axes, or tool-axis",
        )
        along = position - here
        if rotation is not None:
            axis = turn_left(task, R[None], np.asarray(rotation, dtype=float))[0]
        rows = np.isin(np.arange(6).reshape(2, 3), task.rows)
        if task.at_tip:  # it turns about no free axis, and by nothing that is not wanted
            rows = np.any(rows, axis=1, keepdims=True)
        along, axis = np.where(rows, [along, axis], 0.0)
        return cls(here, R, along, axis)

    @property
    def length(self) -> float:
        """Metres; radians where the tip only turns."""
        moved = float(np.linalg.norm(self.along))
        return moved if moved > 1e-12 else float(np.linalg.norm(self.axis))

    def rows(self, arm: Arm, q: Array, s: float) -> tuple[Array, Array, Array]:
        """Return task rows: what is missing (m,) at q to s, Jacobian (m, n), velocity (m,) by s."""
        here, R, J = tip_and_jacobian(arm, q)
        off = turn_left(arm.task, R[None], pin.exp3(self.axis * s) @ self.turn)[0]
        error = np.concatenate([self.start + s * self.along - here, off])
        velocity = np.concatenate([self.along, self.axis])
        found = task_rows(arm, np.column_stack([error, J, velocity]), q, R)
        return found[:, 0], found[:, 1:-1], found[:, -1]


Tracked: TypeAlias = tuple[Array, Array, Array]
"""Places s (N,) of a line, configurations (N, n), and their rates dq/ds (N, n)."""


def span(arm: Arm) -> float | None:
    """Return metres that the tip is from the origin of joint 1 at most; None if not known."""
    if arm.coupling is not None:
        return None
    model = arm.model
    links = [model.jointPlacements[i].translation for i in range(2, model.njoints)]
    links.append(model.frames[arm.tip_id].placement.translation)
    stroke = np.maximum(np.abs(arm.lower), np.abs(arm.upper))[arm.prismatic]
    total = sum(float(np.linalg.norm(v)) for v in links) + float(stroke.sum())
    return total if np.isfinite(total) else None


def track(arm: Arm, line: Line, q: Array) -> Tracked:
    """Follow a line from q as far as it goes, with steps that are sure of their branch."""
    # ConfigurationError if it starts where a tip velocity along it is not possible.
    scale = np.where(np.array(arm.task.rows) < 3, max(arm.length_scale, 1e-9), 1.0)
    largest = max(1.0, float(np.abs([line.along, line.axis]).max()))
    s, step = 0.0, _FIRST
    passed: list[tuple[float, Array, Array]] = []
    while len(passed) < 200_000:
        _, J, twist = line.rows(arm, q, s)
        rate = np.asarray(np.linalg.lstsq(J, twist, rcond=1e-12)[0], dtype=float)
        if np.abs((J @ rate - twist) / scale).max() > 1e-6 * largest:
            few = arm.n < len(arm.task.rows)
            task = f": {arm.n} joints cannot hold the full pose, so try --task position"
            ConfigurationError.refuse_if(
                not passed,
                "the line starts at a configuration at which the tip cannot move along it"
                + task * few,
            )
            passed.append((s, q, passed[-1][2]))
            break
        passed.append((s, q, rate))
        step = min(2 * step, _LONGEST / max(float(np.abs(rate).max()), _LONGEST * 20), 1.0 - s)
        ahead = None
        while ahead is None and step >= 1e-10:
            ahead = _step(arm, line, scale, q, s + step, step * rate)
            step = step if ahead is not None else step / 2
        if ahead is None:
            break
        s, q = 1.0 if 1.0 - (s + step) < 1e-14 else s + step, ahead
    places, Q, rates = (np.array(part) for part in zip(*passed, strict=True))
    return places, Q, rates


def _step(arm: Arm, line: Line, scale: Array, q: Array, s: float, ahead: Array) -> Array | None:
    """The configuration at s near q + ahead; None if Newton's method strays from it."""
    x = q + ahead
    # Correction over step from which on a step is too long to be sure of the branch.
    allowed = 0.3 * float(np.abs(ahead).max()) + 1e-12
    for _ in range(8):
        error, J, _ = line.rows(arm, x, s)
        if np.abs(error / scale).max() < FLOAT_NOISE:
            return x
        x = x + np.linalg.lstsq(J, error, rcond=1e-12)[0]
        if not np.isfinite(x).all() or np.abs(x - q - ahead).max() > allowed:
            return None
    return x if np.abs(line.rows(arm, x, s)[0] / scale).max() < 100 * FLOAT_NOISE else None


def landing(arm: Arm, line: Line, branch: Branch, q: Array, s: float) -> tuple[Array, float] | None:
    """Return the point of a branch on the line near (q, s): the pose and its conditions at once."""
    # At a fold the joints turn back; with the place on the line and the family's condition as
    # unknowns it is a regular zero of Newton's method.
    x, at = q.copy(), s
    sums = sums_of(branch, arm.prismatic, np.ones(arm.n))
    sizes = np.array([f.amplitude.sum() for f in sums])
    for _ in range(30):
        there = [f.at(x[None]) for f in sums]
        values = np.array([c.value[0] for c in there]) / sizes
        slopes = np.array([c.gradient[0] for c in there]) / sizes[:, None]
        error, J, along = line.rows(arm, x, at)
        residual = np.concatenate([error, -values])
        if np.abs(residual).max() < 1e-14:
            break
        A = np.block([[J, -along[:, None]], [slopes, np.zeros((len(values), 1))]])
        delta = np.linalg.lstsq(A, residual, rcond=1e-11)[0]
        delta *= min(1.0, 0.2 / max(float(np.abs(delta[:-1]).max()), 1e-300))
        x, at = x + delta[:-1], at + float(delta[-1])
        if not np.isfinite(x).all() or np.abs(x - q).max() > 0.5:
            return None
    good = np.abs(residual).max() < 1e-11 and -1e-9 <= at <= 1 + 1e-9
    return (x, at) if good and np.abs(x - q).max() < 0.3 and abs(at - s) < 0.02 else None


@dataclass(frozen=True)
class Overspeed:
    """A part of a line on which a joint would be too fast.

    Attributes
    ----------
    joint : str
        Name of the joint.
    s, s_end : float
        From where to where, along the line.
    worst : float
        Largest joint speed, radians or metres per second.
    limit : float
        Its limit.
    allowed : float
        Tip speed at which the joint keeps its limit on all of this part.
    """

    joint: str
    s: float
    s_end: float
    worst: float
    limit: float
    allowed: float


@dataclass(frozen=True, eq=False)
class LinePosture:
    """Another inverse solution of the pose at which a line starts, and how far it gets.

    Attributes
    ----------
    q : (n,) array
        The configuration at the start.
    names : tuple of str
        Words of the field for it, where it has some.
    outcome : str
        As of `LineCheck`.
    s_end : float
        How far the line can be followed.
    within_limits : bool
        Whether all joints are within their limits wherever the line was followed.
    clearance : float
        No family is nearer to the tracked configurations joined by straight joint motions.
    """

    q: Array
    names: tuple[str, ...]
    outcome: str
    s_end: float
    within_limits: bool
    clearance: float


@dataclass(frozen=True, eq=False)
class LineCheck(JsonResult):
    """What a straight line of the tip meets.

    Places ``s`` are lengths along the line in metres; angles in radians where the tip only turns.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    length : float
        Of the whole line.
    outcome : str
        "reached"; "singular": the line ends at a singular configuration, beyond which this
        posture has no solution; "undecided": the tracking stopped and no family explains it.
    s_end : float
        How far the line can be followed.
    q_end : (n,) array
        The configuration there.
    family : str
        With "singular": the family at the end.
    located : bool
        Whether the end was solved for with the family's equation, not only tracked to.
    crossings : tuple of Crossing
        Families met on the way, ``t`` being ``s``.
    approaches : tuple of Approach
        Nearest approach to each family, ``t`` being ``s``. ``lower`` is proven for straight
        joint motions between the tracked configurations.
    stretches : tuple of NearStretch
        Where the clearance may be below ``near``.
    near : float
        Radians.
    speed : float
        Tip speed that was asked for.
    too_fast : tuple of Overspeed
        Where joint speeds exceed their limits at this speed.
    allowed_speed : float
        Tip speed that keeps all limits on all of the line that can be followed.
    s : (N,) array
        Tracked places.
    q : (N, n) array
        Tracked configurations.
    notes : tuple of str
        What was assumed.
    postures : tuple of LinePosture
        Other inverse solutions of the pose at the start, those that get farthest first, as
        `pinsing line` has them from `line_postures` where the line ends early, leaves the
        limits or leads through a singularity; else empty.
    tube : str
        What is known of the arm where the families are of its design; else empty.
    """

    schema: ClassVar[str] = "pinsing/line_check/1"

    arm: ArmSummary
    length: float
    outcome: str
    s_end: float
    q_end: Array
    family: str
    located: bool
    crossings: tuple[Crossing, ...]
    approaches: tuple[Approach, ...]
    stretches: tuple[NearStretch, ...]
    near: float
    speed: float
    too_fast: tuple[Overspeed, ...]
    allowed_speed: float
    s: Array
    q: Array
    notes: tuple[str, ...]
    postures: tuple[LinePosture, ...] = field(default=(), metadata={"optional": True})
    tube: str = field(default="", metadata={"optional": True})

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return where the line ends, what it meets, and what to do.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import pinsing
        >>> line = pinsing.check_line(pinsing.load("planar3r"), [0, 1, 0.5], [1, 0.5, 0])
        >>> "F1" in line.text()
        True
        """
        return line_summary(self, degrees)


@checked
def check_line(
    arm: Arm,
    q0: ArrayLike,
    pose: ArrayLike,
    speed: float = 0.25,  # Metres per second: the usual limit beside people
    *,
    forms: Forms | None = None,
    near: float = NEAR,
) -> LineCheck:
    """Follow a straight line of the tip from a configuration to a pose, and say what it meets.

    The tip moves along a straight segment while it turns about one fixed axis (slerp); joints
    follow by Newton's method with steps of at most 0.02 rad. Where the line ends at a singular
    configuration, the end is solved for together with the equation of the family.

    Parameters
    ----------
    arm : Arm
        A serial arm; of the pose only what its task holds is followed.
    q0 : (n,) or (nq,) array_like
        Where it starts, radians and metres.
    pose : (3,), (6,) or (4, 4) array_like
        Target of the tip in the base frame: position (the orientation is kept); position and
        roll, pitch, yaw in radians (about the fixed x, y, z axes); or a homogeneous matrix.
    speed : float
        Metres per second along the line; radians per second where the tip only turns.
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm; computed if not given.
    near : float
        Clearance in radians below which stretches are told.

    Returns
    -------
    LineCheck
        Where it ends, what it meets and nears, and the speeds that are possible.

    Raises
    ------
    ConfigurationError
        If q0 or the pose make no sense, or the line starts at a singular configuration.
    OptionError
        If speed or near are not positive.

    Examples
    --------
    >>> import pinsing
    >>> line = pinsing.check_line(pinsing.load("planar3r"), [0, 1, 0.5], [1, 0.5, 0])
    >>> line.outcome, line.family, round(line.s_end, 4), round(line.length, 4)
    ('singular', 'F1', 0.0875, 0.4265)
    """
    OptionError.refuse_if(not 0 < speed < np.inf, f"speed must be a positive number, got {speed!r}")
    check_speeds(speed, 0.0)
    OptionError.refuse_if(not near > 0, f"near must be positive, got {near!r}")
    q = arm.check_one(q0, "q0")
    watched = watch(forms_of(arm, forms, form_to_measure))
    watched.require_angle(near, "near")
    line = Line.to(arm, q, read_pose(pose))
    longest, root = span(arm), arm.model.jointPlacements[1].translation
    away = float(np.linalg.norm(line.start + line.along - np.array(root)))
    if longest is not None and 50 * longest < away < 1e3 * longest:
        meant = ",".join(f"{x / 1e3:.6g}" for x in line.start + line.along)
        raise ConfigurationError(
            f"the target is {away:.4g} m from joint 1, and the links end to end are "
            f"{longest:.4g} m: it looks like millimetres: give metres, as {meant}"
        )
    ConfigurationError.refuse_if(
        line.length < 1e-9, "the line has no length: the tip is at the target already"
    )
    if float(ratios(arm, q[None])[0]) <= SINGULAR_RTOL:
        on = [n for n, f in zip(watched.names, watched.families, strict=True) if f.contains(q)]
        where = f" (on {', '.join(on)})" if on else ""
        raise ConfigurationError(
            f"the line starts at a singular configuration{where}: which way the joints go from "
            "there is not determined; begin beside it"
        )
    tracked, outcome, family, located = track(arm, line, q), "reached", "", False
    if tracked[0][-1] < 1.0:
        tracked, family, located = _end(watched, arm, line, tracked)
        outcome = "singular" if family else "undecided"
    share, Q, rates = tracked
    s = share * line.length
    passage = Passage(watched, near)
    passage.feed(s, Q, 0, len(s), True)
    passage.finish()
    too_fast, allowed = _speeds(arm, rates / line.length, s, speed)
    return LineCheck(
        arm=summarize(arm),
        length=line.length,
        outcome=outcome,
        s_end=float(s[-1]),
        q_end=Q[-1],
        family=family,
        located=located,
        crossings=tuple(passage.crossings),
        approaches=passage.approaches,
        stretches=tuple(passage.stretches),
        near=float(near),
        speed=float(speed),
        too_fast=too_fast,
        allowed_speed=allowed,
        s=s,
        q=Q,
        notes=_notes(arm, Q, outcome, watched.gaps, away, longest),
        tube=watched.tube,
    )


def _end(watched: Watched, arm: Arm, line: Line, tracked: Tracked) -> tuple[Tracked, str, bool]:
    """Where the line really ends: on the family that is nearest where the tracking stopped."""
    places, Q, rates = tracked
    q, s = Q[-1], float(places[-1])
    found = sorted((float(f.distance(q).upper), i) for i, f in enumerate(watched.families))
    for distance, i in found:
        if distance > 0.2:  # Clearance at a stall beyond which no family is to blame
            break
        branches: tuple[Branch, ...] = watched.families[i].branches
        for branch in branches:
            if (end := landing(arm, line, branch, q, s)) is not None:
                # Joints that turn back there move as the root of what is left of the line, with
                # infinite rates, the others in proportion to it.
                left = np.abs(end[0] - q)
                turned = (left > 1e-15) & (left > 1e-3 * left.max())
                last, keep = np.where(turned, np.inf, rates[-1]), places < end[1]
                Q, rates = np.vstack([Q[keep], end[0]]), np.vstack([rates[keep], last])
                return (np.append(places[keep], end[1]), Q, rates), watched.names[i], True
    if found and found[0][0] < 1e-3:
        return tracked, watched.names[found[0][1]], False
    return tracked, "", False


def _speeds(arm: Arm, rate: Array, s: Array, speed: float) -> tuple[tuple[Overspeed, ...], float]:
    """Where joints are too fast, by their rates (N, n) per metre of the line, and what none is."""
    limits = limits_of(arm)
    rate = np.where(np.isfinite(rate), np.abs(rate), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = np.where(rate > 0, limits / rate, np.inf)
    allowed = np.nan_to_num(allowed, nan=np.inf, posinf=np.inf)
    out = []
    for j, name in enumerate(arm.joints):
        for first, end in runs(allowed[:, j] < speed * (1 - 1e-12)):
            sides = (first, -1), (end - 1, 1)
            a, b = (_edge(s, allowed[:, j], i, side, speed) for i, side in sides)
            worst, least = rate[first:end, j].max() * speed, allowed[first:end, j].min()
            out.append(Overspeed(name, a, b, float(worst), float(limits[j]), float(least)))
    out.sort(key=lambda o: (o.s, o.joint))
    return tuple(out), float(allowed.min())


def _edge(s: Array, allowed: Array, i: int, side: int, speed: float) -> float:
    """Return where the allowed speed falls below the one asked for, between samples."""
    k = i + side
    if not 0 <= k < len(s) or not (np.isfinite(allowed[k]) and np.isfinite(allowed[i])):
        return float(s[i])
    share = (allowed[k] - speed) / max(allowed[k] - allowed[i], 1e-300)
    return float(s[k] + min(max(share, 0.0), 1.0) * (s[i] - s[k]))


def _notes(
    arm: Arm, Q: Array, outcome: str, gaps: list[str], away: float, longest: float | None
) -> tuple[str, ...]:
    notes = []
    if outcome != "reached" and longest is not None and away > longest + 1e-9:
        notes.append(
            f"the target is out of reach in any posture: it is {away:.4g} m from joint 1, and the "
            f"links end to end are {longest:.4g} m"
        )
    if outcome == "undecided":
        notes.append(
            "the tracking stopped and no family is there: the posture may jump to another branch, "
            "or the target be out of reach"
        )
    left = arm.space.outside(Q).any(axis=0)
    notes += [f"{arm.joints[j]} leaves its limits" for j in np.flatnonzero(left)]
    if arm.prismatic.any():
        notes.append(metric_note(arm.length_scale))
    return (*notes, *gaps)


def stopped(line: LineCheck) -> bool:
    """Return True if no speed is slow enough at some place."""
    return line.allowed_speed < ALIKE * line.speed


def line_summary(line: LineCheck, degrees: bool = True, robot: str = "", same: str = "") -> str:
    """Return where a line ends, what it meets, what is near, speeds, and commands for ``robot``."""
    robot = robot or line.arm.typed
    met, left = line.crossings, left_limits(line, degrees)
    titles = {a.family: a.title for a in line.approaches}
    of = " of the design" * bool(line.tube)
    named = dict.fromkeys(singularity(c.family, c.title, c.where) for c in met)
    first = listed([f"{x}{of}" for x in named])
    faults = [
        *["joints leave their limits"] * bool(left),
        *[f"joints are too fast at {line.speed:g} m/s"] * bool(line.too_fast),
        *[f"it comes within {angle_text(line.near, degrees)} of a singularity"]
        * bool(line.stretches and not met),
    ]
    but = f", but {listed(faults)}" if faults else f" and meets no singularity{of}"
    if met:
        but = f", but it meets {first}{'; also ' * bool(faults)}{listed(faults)}"
    whole, done = f"line of {line.length:.4g} m", f"{line.s_end:.6g} m"
    end = next((c.where for c in reversed(met) if c.family == line.family), "")
    if line.outcome == "reached":
        head = f"{'SINGULAR, ' * bool(met)}the {whole} is followed to its end{but}"
    elif line.outcome == "singular":
        family = singularity(line.family, titles.get(line.family, ""), end)
        earlier = listed([f"{x}{of}" for x in named if x != family])
        head = (
            f"SINGULAR, the {whole} ends at {family}{of} after {done}; beyond it this posture has "
            f"no solution{'; on the way it meets ' * bool(earlier)}{earlier}"
        )
    else:
        head = f"NOT DECIDED, the {whole} was followed for {done}{but * bool(met or faults)}"
    out = [*[line.tube] * bool(line.tube), *left]
    near = next((a for a in line.approaches if a.upper > 0 and a.outside != "family"), None)
    # What is met matters more; the rest is below.
    if near is not None and not met and not line.family:
        far = f"{angle_text(near.upper, degrees)} at {near.t:.4g} m{OUTSIDE[near.outside]}"
        out.append(f"Closest approach: {titled(near.family, near.title)}{of}, {far}")
    out.append(f"Joint speeds at {line.speed:g} m/s: {_line_speeds(line)}")
    if good := _clear(line):
        start = typed(good[0].q, line.arm.prismatic, degrees, digits=6)
        called = f" ({', '.join(good[0].names)})" * bool(good[0].names)
        works = "it reaches its end clear of singularities"
        out.append(f"From another posture{called} {works}: pinsing line {robot} {start} {same}")
    elif line.postures:
        others = [p for p in line.postures if not any(_turns(line, p))]
        most = max((p.s_end for p in others if p.outcome != "reached"), default=0.0)
        count = f"{len(others)} other posture{'s' * (len(others) != 1)}"
        out.append(
            f"None of {count} of the start follows it to its end within the joint limits and "
            "clear of singularities" + f"; the farthest gets {most:.4g} m" * (most > line.s_end)
        )
    last = typed(line.q_end, line.arm.prismatic, degrees, digits=6)
    out.append(f"See its end: pinsing view {robot} {last}")
    return "\n".join([f"{line.arm.name}: {head}", "", *(f"  {words}" for words in out)])


def _clear(line: LineCheck) -> list[LinePosture]:
    """Postures from which the line reaches its end within the limits, and meets nothing."""
    reached = [p for p in line.postures if p.outcome == "reached" and p.within_limits]
    return [p for p in reached if p.clearance > 0]


def _line_speeds(line: LineCheck) -> str:
    """Return what joint speeds allow."""
    if math.isinf(line.allowed_speed):
        return "not judged, the robot names no limits"
    if not line.too_fast:
        return "all are within their limits"
    start = min(o.s for o in line.too_fast)
    if stopped(line):
        return (
            f"too fast from {start:.4g} m on; at the singularity itself no speed is slow enough: "
            "stop before it"
        )
    return f"too fast from {start:.4g} m on; {line.allowed_speed:.4g} m/s keeps all limits"


def line_details(line: LineCheck, degrees: bool) -> str:
    """Return the end, every meeting, approach and excess, and the other postures."""

    def excess(o: Overspeed) -> str:
        unit, factor = joint_unit(line.arm, o.joint, degrees)
        worst, allowed = f"{factor * o.worst:.4g} {unit}/s", f"; allowed there: {o.allowed:.4g} m/s"
        if o.allowed < ALIKE * line.speed:
            worst, allowed = "without bound", ""
        limit = f"(limit {factor * o.limit:.4g} {unit}/s)"
        return f"{o.joint}: {worst} {limit} from {o.s:.6g} to {o.s_end:.6g} m{allowed}"

    def approach(a: Approach) -> str:
        far = f"{angle_text(a.upper, degrees)}, at {a.t:.6g} m{OUTSIDE[a.outside]}"
        return f"{titled(a.family, a.title)}: {far}"

    def meeting(c: Crossing) -> str:
        return f"{c.kind} {titled(c.family, c.title)} at {c.t:.6g} m"

    pairs = zip(line.q_end, line.arm.prismatic, strict=True)
    near, too_fast = line.approaches, f"joint speeds above their limits at {line.speed:g} m/s:"
    lines = [
        f"end, at {line.s_end:.6g} of {line.length:.6g} m:",
        f"  q = {', '.join(joint_text(x, slides, degrees, 3) for x, slides in pairs)}",
        *section("meetings:", line.crossings, meeting),
        *section("nearest approach to each family:", near, approach, most=len(near)),
        *section(too_fast, line.too_fast, excess),
        *_postures(line, degrees),
    ]
    return "\n".join([*lines, *(f"note: {n}" for n in line.notes)])


def left_limits(line: LineCheck, degrees: bool = True) -> list[str]:
    """Return where joints leave their limits, in a line; none where they keep them."""
    space = line.arm.space
    left = sorted((line.s[o.argmax()], j) for j, o in enumerate(space.outside(line.q).T) if o.any())
    if not left:
        return []
    (at, j), *later = left
    then = f"; then {', '.join(space.names[k] for _, k in later)}" if later else ""
    limits = space.range_words(j, degrees)
    return [f"Outside: {space.names[j]} leaves its limits, {limits}, at {at:.4g} m{then}"]


def _postures(line: LineCheck, degrees: bool) -> list[str]:
    """Return which postures of the start would do."""
    good = _clear(line)
    out = ["starts from which the line meets no singularity:"] if good else []
    for p in good:
        turned = ", ".join(
            f"{name} {360 * k:+d}°"
            for name, k in zip(line.arm.joints, _turns(line, p), strict=True)
            if k
        )
        called = f"the same posture, whole turns away ({turned})" if turned else ", ".join(p.names)
        near = f"stays {angle_text(p.clearance, degrees)} away from every family"
        out.append(f"  {called}{'; ' * bool(called)}{near}")
        out.append(f"    {typed(p.q, line.arm.prismatic, degrees, digits=6)}")
    return out


def _turns(line: LineCheck, posture: LinePosture) -> list[int]:
    """Whole turns of each joint from where the line was asked to start; zeros of others."""
    gap = (posture.q - line.q[0]) / (2 * math.pi)
    whole = gap.round()
    same = bool(abs(gap - whole).max() < 1e-7)
    return [int(k) * same for k in whole]
