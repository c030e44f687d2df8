"""check_line: a straight line of the tip (MoveL), and where it ends, nears or overspeeds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import Branch
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.jacobian import read_pose
from pinsing.kinematics.verdict import SINGULAR_RTOL, ratios
from pinsing.proximity.crossings import Crossing
from pinsing.proximity.line_tracking import Line, Tracked, landing, span, track
from pinsing.proximity.passage import Approach, NearStretch, Passage
from pinsing.proximity.speeds import limits_of
from pinsing.proximity.trajectory import NEAR
from pinsing.proximity.watched import Forms, Watched, metric_note, require_forms_of, watch
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.serialization import JsonResult

SPEED = 0.25
"""Metres per second: the usual limit beside people."""

_CLOSE = 0.2
"""Clearance at a stall beyond which no family is to blame."""


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


@checked
def check_line(
    arm: Arm,
    q0: npt.ArrayLike,
    pose: npt.ArrayLike,
    speed: float = SPEED,
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
    if not 0 < speed < np.inf:
        raise OptionError(f"speed must be a positive number, got {speed!r}")
    if not near > 0:
        raise OptionError(f"near must be positive, got {near!r}")
    q = arm.check(q0)
    if q.ndim != 1:
        raise ConfigurationError(f"q0 is one configuration, got shape {q.shape}")
    if forms is None:
        forms = form_to_measure(arm)
    require_forms_of(forms, arm)
    watched = watch(forms)
    watched.require_angle(near, "near")
    line = Line.to(arm, q, read_pose(pose))
    if line.length < 1e-9:
        raise ConfigurationError("the line has no length: the tip is at the target already")
    if float(ratios(arm, q[None])[0]) <= SINGULAR_RTOL:
        on = [n for n, f in zip(watched.names, watched.families, strict=True) if f.contains(q)]
        where = f" (on {', '.join(on)})" if on else ""
        raise ConfigurationError(
            f"the line starts at a singular configuration{where}: which way the joints go from "
            "there is not determined; begin beside it"
        )
    tracked = track(arm, line, q)
    outcome, family, located = ("reached", "", False)
    if tracked.s[-1] < 1.0:
        tracked, family, located = _end(watched, arm, line, tracked)
        outcome = "singular" if family else "undecided"
    s = tracked.s * line.length
    passage = Passage(watched, near)
    passage.feed(s, tracked.q, 0, len(s), True)
    met = passage.finish()
    too_fast, allowed = _speeds(arm, tracked, s, speed, line.length)
    return LineCheck(
        arm=summarize(arm),
        length=line.length,
        outcome=outcome,
        s_end=float(s[-1]),
        q_end=tracked.q[-1],
        family=family,
        located=located,
        crossings=met.crossings,
        approaches=met.approaches,
        stretches=met.stretches,
        near=float(near),
        speed=float(speed),
        too_fast=too_fast,
        allowed_speed=allowed,
        s=s,
        q=tracked.q,
        notes=_notes(arm, line, tracked, outcome, watched.complete),
    )


def _end(watched: Watched, arm: Arm, line: Line, tracked: Tracked) -> tuple[Tracked, str, bool]:
    """Where the line really ends: on the family that is nearest where the tracking stopped."""
    q, s = tracked.q[-1], float(tracked.s[-1])
    found = sorted(
        (float(f.distance(q, seconds=0.3).upper), i) for i, f in enumerate(watched.families)
    )
    for distance, i in found:
        if distance > _CLOSE:
            break
        branches: tuple[Branch, ...] = watched.families[i].branches
        for branch in branches:
            end = landing(arm, line, branch, q, s)
            if end is not None:
                return tracked.ended(*end), watched.names[i], True
    if found and found[0][0] < 1e-3:
        return tracked, watched.names[found[0][1]], False
    return tracked, "", False


def _speeds(
    arm: Arm, tracked: Tracked, s: Array, speed: float, length: float
) -> tuple[tuple[Overspeed, ...], float]:
    limits = limits_of(arm)
    rate = np.abs(tracked.rate) / length  # per metre of the line
    finite = np.where(np.isfinite(rate), rate, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = np.where(finite > 0, limits / finite, np.inf)
    allowed = np.nan_to_num(allowed, nan=np.inf, posinf=np.inf)
    out = []
    for j in range(arm.n):
        rows = np.flatnonzero(allowed[:, j] < speed * (1 - 1e-12))
        for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []:
            a = _edge(s, allowed[:, j], int(run[0]), -1, speed)
            b = _edge(s, allowed[:, j], int(run[-1]), 1, speed)
            worst, least = float(finite[run, j].max()) * speed, float(allowed[run, j].min())
            out.append(Overspeed(arm.joints[j], a, b, worst, float(limits[j]), least))
    out.sort(key=lambda o: (o.s, o.joint))
    return tuple(out), float(allowed.min())


def _edge(s: Array, allowed: Array, i: int, side: int, speed: float) -> float:
    """Where the allowed speed falls below the one asked for, between samples."""
    k = i + side
    if not 0 <= k < len(s) or not (np.isfinite(allowed[k]) and np.isfinite(allowed[i])):
        return float(s[i])
    share = (allowed[k] - speed) / max(allowed[k] - allowed[i], 1e-300)
    return float(s[k] + min(max(share, 0.0), 1.0) * (s[i] - s[k]))


def _notes(arm: Arm, line: Line, tracked: Tracked, outcome: str, complete: bool) -> tuple[str, ...]:
    notes = []
    longest = span(arm)
    root = np.array(arm.model.jointPlacements[1].translation)
    away = float(np.linalg.norm(line.start + line.along - root))
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
    left = arm.space.outside(tracked.q).any(axis=0)
    notes += [f"{arm.joints[j]} leaves its limits" for j in np.flatnonzero(left)]
    if arm.prismatic.any():
        notes.append(metric_note(arm.length_scale))
    if not complete:
        notes.append("the closed form is not complete: other singular configurations may be met")
    return tuple(notes)
