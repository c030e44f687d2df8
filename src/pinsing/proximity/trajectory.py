"""check_trajectory: whether, when and where a trajectory meets or nears singular configurations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar, TypeVar

import numpy as np

from pinsing.errors import ConfigurationError, OptionError
from pinsing.families.solve import form_to_measure
from pinsing.interface import JsonResult, checked, columns_of, typed
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.tip_speed import TIP_SPEED, TURN_SPEED, SpeedJudge, check_speeds
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool
from pinsing.prose import LISTED, listed, one_line
from pinsing.proximity.clearance import Forms, forms_of, metric_note, titled, watch
from pinsing.proximity.crossings import (
    Approach,
    Crossing,
    NearStretch,
    Passage,
    check_reach,
    check_times,
    runs,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize

T = TypeVar("T")

OUTSIDE = {
    "": "",
    "point": " (its nearest point is outside the joint limits)",
    "family": " (outside the joint limits)",
}
"""What is said of an approach, by where the family is."""


def summary(check: TrajectoryCheck, degrees: bool = True, file: str = "", robot: str = "") -> str:
    """Return at most six lines: what is met and when, what is near, speeds, and what to do."""
    near = [_nearest(check, degrees), _near(check, degrees)]
    lines = [check.tube, *near, *_speeds(check), _advice(check, robot or check.arm.typed, degrees)]
    said = _met(check, degrees)
    return "\n".join([f"{file or check.arm.name}: {said}", "", *(f"  {x}" for x in lines if x)])


def details(check: TrajectoryCheck, degrees: bool = True) -> str:
    """Every meeting, approach and excess, the first of each kind."""

    def meeting(c: Crossing) -> str:
        q = (joint_text(x, s, degrees) for x, s in zip(c.q, check.arm.prismatic, strict=True))
        met = f"{c.kind} {_title(check, c.family)}, q = {', '.join(q)}"
        return f"{_when(check, c.t, c.t_end)}: {met}"

    def change(a: AspectChange) -> str:
        sides = (a.before, a.names_before), (a.after, a.names_after)
        before, after = (f"{k}" + f" ({', '.join(names)})" * bool(names) for k, names in sides)
        return f"{_when(check, a.t)} ({', '.join(a.families)}): from {before} to {after}"

    def approach(a: Approach) -> str:
        far, least = (angle_text(x, degrees) for x in (a.upper, a.lower))
        where = f"{far} {_when(check, a.t)}, at least {least} ({_proven(check)})"
        return f"{_title(check, a.family)}: {where}{OUTSIDE[a.outside]}"

    def stretch(s: NearStretch) -> str:
        least = f"{angle_text(s.clearance, degrees)} from {_title(check, s.family)}"
        return f"{_when(check, s.t, s.t_end)}: at least {least}"

    own = "this robot itself is singular, with the nearest family:"
    beyond = " --ignore-limits" * bool(check.outside)
    aspects = f"changes of aspect (as `pinsing postures{beyond}` numbers them):"
    nearest = f"nearest approach to each family{' of the design' * bool(check.tube)}:"
    within = f"within {angle_text(check.near, degrees)}:"
    lines = [
        *section("meetings:", check.crossings, meeting, check.cut),
        *section(own, check.own_crossings, meeting, check.cut),
        *section(aspects, check.aspect_changes, change),
        *section(nearest, check.approaches, approach, most=len(check.approaches)),
        *section(within, check.stretches, stretch),
    ]
    tip = f"{check.tip_speed:g} m/s and {check.turn_speed:g} rad/s of the tip"
    unbounded = ", no bound is known in between" * bool(check.tube and check.clearance == 0)
    for name, per, found in (
        ("joint speeds above their limits", "/s", check.too_fast),
        ("joint accelerations above the limits given", "/s²", check.too_abrupt),
        (
            f"joint speeds that {tip} would take in the worst directions, at samples and "
            f"nearest to families{unbounded}",
            "/s",
            check.costly,
        ),
        ("jumps between two samples", "", check.jumps),
        ("outside the joint limits", "", check.outside),
    ):
        often = ", one line per interval" * (len({e.joint for e in found}) < len(found))
        said = partial(_excess, check, per=per, degrees=degrees)
        lines += section(f"{name}{often}:", found, said)
    return "\n".join([*lines, *(f"note: {n}" for n in check.notes)])


def section(
    head: str, found: Sequence[T], say: Callable[[T], str], cut: bool = False, most: int = LISTED
) -> list[str]:
    """A heading, a line for each of the first found, and how many more; nothing for none."""
    lines = [head, *(f"  {say(x)}" for x in found[:most])] if found else []
    if len(found) > most:
        lines.append(f"  and {len(found) - most} more{' and others' * cut}")
    return lines


def joint_text(x: float, slides: bool, degrees: bool, places: int = 2) -> str:
    """The value of a joint, in degrees with so many decimals, or radians or metres; no -0."""
    if degrees and not slides:
        return f"{round(math.degrees(x), places) + 0.0:.{places}f}°"
    return f"{round(x, 9) + 0.0:.{places + 3}g}"


def joint_unit(arm: ArmSummary, joint: str, degrees: bool) -> tuple[str, float]:
    """Unit of a joint, and what radians or metres are multiplied by."""
    if arm.prismatic[arm.joints.index(joint)]:
        return "m", 1.0
    return ("deg", 180 / math.pi) if degrees else ("rad", 1.0)


def _excess(check: TrajectoryCheck, e: Excess, per: str, degrees: bool) -> str:
    """One excess, ``per`` second or second squared or as it is, in the units of its joint."""
    unit, factor = joint_unit(check.arm, e.joint, degrees)
    worst, limit = (
        f"{factor * x:{',.0f' if factor * x >= 9999.5 else '.4g'}} {unit}{per}"
        if math.isfinite(x)
        else "without bound"
        for x in (e.worst, e.limit)
    )
    gap = 1e-9 * (1 + abs(e.t_worst))
    met = [c for c in check.crossings if c.t - gap <= e.t_worst <= c.t_end + gap]
    called = "this robot itself" if check.tube else listed([c.title or c.family for c in met])
    where = f" ({called})" * bool(called and math.isinf(e.worst))
    span = f", {_when(check, e.t, e.t_end)}" * (e.t < e.t_end)
    return f"{e.joint}: {worst} {_when(check, e.t_worst)}{where} (limit {limit}){span}"


def _met(check: TrajectoryCheck, degrees: bool) -> str:
    near = f"comes within {angle_text(check.near, degrees)} of one"
    faults = [
        words
        for words, found in (
            ("jumps", check.jumps),
            ("leaves joint limits", check.outside),
            ("exceeds joint speed limits", check.too_fast),
            ("exceeds joint acceleration limits", check.too_abrupt),
            (near, check.stretches),
        )
        if found
    ]
    left_out = f"; {listed(check.unchecked)} not looked at" if check.unchecked else ""
    if not (met := check.crossings or check.own_crossings):
        none = "meets no singular configuration" if check.complete else "meets no known family"
        if check.tube and check.clearance == 0 and not check.nominal:
            none = "meets no family of the design, perhaps a singular configuration of this robot"
        elif check.unchecked:
            seen = [_title(check, a.family) for a in check.approaches]
            none = f"meets no {listed(seen) or 'family that was looked at'}"
        none += " of the design" * check.nominal
        sure = "proven between samples" if check.samples > 1 else "1 sample"
        return none + (f", but {listed(faults)}" if faults else f" ({sure})") + left_out
    first, *rest = met
    verb = {"crossing": "crosses", "touch": "touches", "along": "stays on"}[first.kind]
    more = [f"{len(rest)} more meetings"] * bool(rest)
    if len(rest) == 1:
        more = [f"{_title(check, rest[0].family)} {_when(check, rest[0].t)}"]
    also = [*more, *(words for words in faults if words != near)]
    when = _when(check, first.t, first.t_end if first.kind == "along" else None)
    singular = "a singular configuration of this robot itself"
    if check.crossings:
        singular = singularity(first.family, first.title, first.where)
        singular += " of the design" * bool(check.tube)
        if check.own_crossings:
            when += f" (this robot itself {_when(check, check.own_crossings[0].t)})"
    return f"{verb} {singular} {when}{'; also ' * bool(also)}{listed(also)}{left_out}"


def singularity(family: str, title: str, where: str = "") -> str:
    """Return ``the wrist singularity (wrist_2_joint = 0°)``, or ``singularity F4``."""
    name = f"the {title} singularity" if title else f"singularity {family}"
    return f"{name} ({where})" if where else name


def angle_text(x: float, degrees: bool = True) -> str:
    """Return a distance in joint space, in degrees or radians."""
    if not math.isfinite(x):
        return "any distance"
    return f"{math.degrees(x):.3g}°" if degrees else f"{x:.3g} rad"


def _title(check: TrajectoryCheck, family: str) -> str:
    title = next((a.title for a in check.approaches if a.family == family), "")
    return titled(family, title)


def _when(check: TrajectoryCheck, t: float, end: float | None = None) -> str:
    first = f"{t:.6g} s" if check.timed else f"sample {t:.6g}"
    if end is None or f"{end:.6g}" == f"{t:.6g}":
        return f"at t = {first}" if check.timed else f"at {first}"
    return f"from {first} to {end:.6g}{' s' * check.timed}"


def _proven(check: TrajectoryCheck) -> str:
    return "proven of the design" if check.nominal else "proven"


def _nearest(check: TrajectoryCheck, degrees: bool) -> str:
    met = {c.family for c in check.crossings}
    others = (x for x in check.approaches if x.family not in met and x.upper > 0)
    of = " of the design" * bool(check.tube)
    if (a := next((x for x in others if x.outside != "family"), None)) is None:
        return ""
    least = f" (at least {angle_text(a.lower, degrees)}, {_proven(check)})"
    where = " elsewhere" * bool(met) + least * bool(of or not met)
    return (
        f"Closest approach{where}: {_title(check, a.family)}{of}, "
        f"{angle_text(a.upper, degrees)} {_when(check, a.t)}{OUTSIDE[a.outside]}"
    )


def _near(check: TrajectoryCheck, degrees: bool) -> str:
    if not check.stretches:
        return ""
    total = sum(s.t_end - s.t for s in check.stretches)
    span = check.t_last - check.t_first
    part = total / span if span > 0 else 1.0
    share = f"{100 * part:.3g} %" if part < 0.9995 else "all"
    share += f" of the {'time' if check.timed else 'samples'}" if span > 0 else " of it"
    ends = {"toward": "moving toward", "away": "moving away from"}
    end = f"; it ends {ends[check.trend]} the nearest one" if check.trend in ends else ""
    return f"Within {angle_text(check.near, degrees)} of a singularity for {share}{end}"


def _speeds(check: TrajectoryCheck) -> list[str]:
    """One line for each kind of excess, its first or worst."""
    out = [
        f"{what}: {found[0].joint} {verb} {_when(check, found[0].t, found[0].t_end)}"
        + f" and {len(found) - 1} more" * (len(found) > 1)
        for what, verb, found in (
            ("Joint speeds", "exceeds its limit", check.too_fast),
            ("Joint accelerations", "exceeds its limit", check.too_abrupt),
            ("Joint limits", "leaves its limits", check.outside),
        )
        if found
    ]
    if not (check.timed and check.speed_limits):
        why = "the robot names no limits" if check.timed else "there are no times"
        out.append(f"Joint speeds: not judged, {why}")
    elif not out:
        out.append("Joint speeds and limits are kept")
    return out


def _advice(check: TrajectoryCheck, robot: str, degrees: bool) -> str:
    if check.jumps:
        e = check.jumps[0]
        return f"Look at the jump of {e.joint} {_when(check, e.t)}: " + (
            "is it wrapped by a turn?" if e.worst > math.pi else "are samples missing there?"
        )
    if met := check.crossings or check.own_crossings:
        c = met[0]
        if any(note.startswith("mimic joints of the chain follow") for note in check.arm.notes):
            away = f"Keep away from {_title(check, c.family)}, {_when(check, c.t)}"
            return f"{away}; other postures are not looked for where joints mimic others"
        if check.alone:
            return "Move the path: no other posture of its start was found within the joint limits"
        start, other = c.q if check.start is None else check.start, check.other
        beyond = " --ignore-limits" if check.outside else ""
        command = f"postures {robot}{beyond}" if other is None else f"at {robot}"
        q = typed(start if other is None else other, check.arm.prismatic, degrees, digits=6)
        best = "Start in this posture, from which some motion reaches the end without a singularity"
        what = "Try another posture" if other is None else best
        return f"{what}: pinsing {command} {q}"
    if check.outside:
        return f"Bring {check.outside[0].joint} within its limits"
    if check.too_fast:
        e = max(check.too_fast, key=lambda x: x.worst / x.limit)
        share = f"{100 * e.limit / e.worst:.3g} %"
        return f"Slow down to {share} around {_when(check, e.t_worst)[3:]} ({e.joint})"
    if check.too_abrupt:
        e = max(check.too_abrupt, key=lambda x: x.worst / x.limit)
        return f"Accelerate less around {_when(check, e.t_worst)[3:]} ({e.joint})"
    if check.stretches:
        s = min(check.stretches, key=lambda x: x.clearance)
        at = _when(check, s.t, s.t_end)
        return f"Slow down, or keep away from {_title(check, s.family)}, {at}"
    if not check.complete:
        return "The closed form is not complete: look at singular values along it as well"
    return ""


@dataclass(frozen=True)
class Excess:
    """A stretch of time in which a joint exceeds something.

    Attributes
    ----------
    joint : str
        Name of the joint.
    t, t_end : float
        From the first to the last sample (step) at which it does.
    worst : float
        The largest value, of magnitude; of a position outside its limits the value itself.
    t_worst : float
        When.
    limit : float
        What it exceeds.
    """

    joint: str
    t: float
    t_end: float
    worst: float
    t_worst: float
    limit: float


class Speeds:
    """Gathers what a trajectory, fed in pieces, asks of the joints."""

    def __init__(
        self,
        arm: Arm,
        tip_speed: float,
        turn_speed: float,
        joint_speeds: ArrayLike | None,
        accelerations: Array | None,
        timed: bool,
    ) -> None:
        self.arm, self.timed, self.accelerations = arm, timed, accelerations
        self.judge = SpeedJudge(arm, joint_speeds)
        self.limits = self.judge.limits
        self.tip_speed, self.turn_speed = tip_speed, turn_speed
        self._found: dict[str, list[Excess]] = {}

    def found(self, kind: str) -> tuple[Excess, ...]:
        """Excesses of a kind, in the order of time."""
        return tuple(sorted(self._found.get(kind, []), key=lambda e: (e.t, e.joint)))

    def feed(self, t: Array, Q: Array, first: int, last: int) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        # What goes on from the piece before is known by the time of the sample before.
        own = slice(max(first - 1, 0), last)
        low, high = self.arm.lower - ROUNDING, self.arm.upper + ROUNDING
        out = np.maximum(Q[own] - high, low - Q[own])
        limit = np.where(Q[own] > high, self.arm.upper, self.arm.lower)
        self._keep("outside", t[own], t[own], out, Q[own], limit, out > 0)
        self._cost(t[own], Q[own])
        steps = slice(max(first, 1) - 1, last - 1)  # those that end at these samples
        step = np.abs(np.diff(Q, axis=0)[steps])
        before, after = t[:-1][steps], t[1:][steps]
        slides = self.arm.prismatic
        far = np.where(slides, self.arm.length_scale, 1.0)
        often = 20.0 * np.median(step, axis=0) if len(step) > 8 else np.inf
        # A step of over half a turn is a jump, one below 0.2 rad is none.
        bound = np.minimum(np.maximum(0.2 * far, often), np.where(slides, np.inf, np.pi))
        self._keep("jump", before, after, step, step, bound, step > bound)
        if self.timed:
            speed = step / (after - before)[:, None]
            share = speed / self.limits
            self._keep("speed", before, after, share, speed, self.limits, share > 1 + 1e-9)
        if self.timed and self.accelerations is not None:
            rate = np.diff(Q, axis=0) / np.diff(t)[:, None]
            middle = (t[1:] + t[:-1]) / 2
            inner = slice(max(first - 3, 0), max(last - 2, 0))
            bend = np.abs(np.diff(rate, axis=0) / np.diff(middle)[:, None])[inner]
            share, at = bend / self.accelerations, t[1:-1][inner]
            self._keep("acceleration", at, at, share, bend, self.accelerations, share > 1 + 1e-9)

    def _cost(self, t: Array, Q: Array) -> None:
        """Return where some tip velocity of the given speeds needs more than a joint's limit."""
        if self.judge.reason:
            return
        L, limits = self.arm.length_scale, self.judge.limits
        sigma = np.asarray(singular_values(self.arm, Q))[:, self.judge.rank - 1]
        size = math.hypot(self.tip_speed / L, self.turn_speed)
        hard = np.flatnonzero(size > sigma * limits.min() * (1 - 1e-9))
        share = np.zeros(Q.shape)
        for part in np.array_split(hard, max(1, len(hard) // 4096)):
            share[part] = self.judge.shares(Q[part], self.tip_speed, self.turn_speed)
        worst = np.where(share > 0, share * np.where(share > 0, limits, 0.0), 0.0)
        self._keep("cost", t, t, share, worst, limits, share > 1)

    def between(self, passage: Passage) -> None:
        """Take, too, where the motion meets families and is nearest to them, as of ``passage``."""
        met = passage.own_crossings if passage.watched.tube else passage.crossings
        places: list[Crossing | Approach] = [*met, *passage.crossings, *passage.approaches]
        if self.judge.reason or not places:
            return
        share = self.judge.shares(np.array([p.q for p in places]), self.tip_speed, self.turn_speed)
        share[: len(met)][share[: len(met)] > 1e5] = np.inf  # singular but for rounding
        for i, j in np.argwhere(share > 1):
            t, limit = places[i].t, float(self.limits[j])
            new = Excess(self.arm.joints[j], t, t, float(share[i, j]) * limit, t, limit)
            self._add("cost", new, 1e-9 * (1 + abs(t)))

    def _keep(
        self, kind: str, t: Array, t_end: Array, size: Array, value: Array, limit: Array, bad: Bool
    ) -> None:
        """Turn runs of bad entries (K, n) into excesses over limits (n,) or (K, n)."""
        limit = np.broadcast_to(limit, value.shape)
        for j in range(self.arm.n):
            for first, end in runs(bad[:, j]):
                if first and len(self._found.get(kind, [])) >= 200:
                    break
                k = first + int(np.argmax(size[first:end, j]))
                times = float(t[first]), float(t_end[end - 1])
                worst = float(value[k, j]), float(t[k]), float(limit[k, j])
                self._add(kind, Excess(self.arm.joints[j], *times, *worst))

    def _add(self, kind: str, new: Excess, gap: float = 0.0) -> None:
        """Take an excess, as one with that of the joint that it goes on from."""
        listed = self._found.setdefault(kind, [])
        for k, old in enumerate(listed):
            if old.joint == new.joint and old.t - gap <= new.t <= old.t_end + gap:
                worse = max(old, new, key=lambda e: abs(e.worst - e.limit))
                listed[k] = replace(worse, t=old.t, t_end=max(old.t_end, new.t_end))
                return
        if gap or len(listed) < 200:
            listed.append(new)


NEAR = np.radians(5.0)
"""Clearance below which a stretch is told, radians."""


_CHUNK = 20_000


@dataclass(frozen=True, eq=False)
class AspectChange:
    """A place at which a motion leaves one aspect for another.

    Attributes
    ----------
    t : float
        Time, or the number of the sample.
    families : tuple of str
        What it meets there.
    before, after : int or None
        Numbers of the aspects, as `Aspects` has them; None where it could not be told.
    names_before, names_after : tuple of str
        Words of the field for both postures, where it has some.
    """

    t: float
    families: tuple[str, ...]
    before: int | None
    after: int | None
    names_before: tuple[str, ...]
    names_after: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class TrajectoryCheck(JsonResult):
    """What a trajectory meets.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    samples : int
        How many configurations were given; between them joints move linearly.
    timed : bool
        Whether times were given; else t counts samples from 0, and speeds are not judged.
    t_first, t_last : float
        Times of the first and the last sample.
    crossings : tuple of Crossing
        Meetings with families, in the order of time; none is missing, unless ``cut``.
    cut : bool
        Whether there were more meetings or stretches than are listed.
    approaches : tuple of Approach
        The nearest approach to each family, the nearest first.
    near : float
        The clearance that stretches are told for.
    stretches : tuple of NearStretch
        Where the clearance is, or may be, below ``near``.
    trend : str
        "toward", "away" or "steady": how the clearance changes at the end of the motion.
    too_fast : tuple of Excess
        Where joint speeds of the motion exceed the limits of the description.
    too_abrupt : tuple of Excess
        Where joint accelerations exceed ``acceleration_limits``, if those were given.
    costly : tuple of Excess
        Where some tip motion at ``tip_speed`` and ``turn_speed`` at once would need a joint speed
        above its limit.
    tip_speed, turn_speed : float
        Metres and radians per second.
    jumps : tuple of Excess
        Steps between two samples that are no motion: over half a turn, or far longer than the
        others.
    outside : tuple of Excess
        Where joints are outside their limits.
    complete : bool
        Whether the closed form is complete: else other singular configurations may be met.
    notes : tuple of str
        What was assumed, and what could not be judged.
    aspect_changes : tuple of AspectChange
        Where the motion changes its aspect, as `pinsing check` has them from `aspect_changes`;
        empty where that was not asked.
    start : (n,) array or None
        The first sample.
    other : (n,) array or None
        Another posture there, from which some motion reaches the end without a singularity, as
        `pinsing check` has it; not written to JSON.
    alone : bool
        Whether no other posture there was found within the joint limits; likewise.
    tube : str
        What is known of the arm where the families are of its design; else empty.
    own_crossings : tuple of Crossing
        Where families are of the design: where the robot's own Jacobian is singular, by a change of
        sign of its determinant, with the nearest family. Where the sign does not change from one
        place looked at to the next (0.01 rad, or a 64th of a longer step) none is found.
    nominal : bool
        Whether it is not known how far from those families the arm itself is singular.
    speed_limits : bool
        Whether the robot names limits of joint speeds.
    unchecked : tuple of str
        Families that were left out, as they are called.
    """

    schema: ClassVar[str] = "pinsing/trajectory_check/1"

    arm: ArmSummary
    samples: int
    timed: bool
    t_first: float
    t_last: float
    crossings: tuple[Crossing, ...]
    cut: bool
    approaches: tuple[Approach, ...]
    near: float
    stretches: tuple[NearStretch, ...]
    trend: str
    too_fast: tuple[Excess, ...]
    too_abrupt: tuple[Excess, ...]
    costly: tuple[Excess, ...]
    tip_speed: float
    jumps: tuple[Excess, ...]
    outside: tuple[Excess, ...]
    complete: bool
    notes: tuple[str, ...]
    aspect_changes: tuple[AspectChange, ...] = field(default=(), metadata={"optional": True})
    start: Array | None = field(default=None, metadata={"optional": True})
    other: Array | None = field(default=None, metadata={"json": False})
    alone: bool = field(default=False, metadata={"json": False})
    speed_limits: bool = field(default=True, metadata={"optional": True})
    turn_speed: float = field(default=TURN_SPEED, metadata={"optional": True})
    tube: str = field(default="", metadata={"optional": True})
    own_crossings: tuple[Crossing, ...] = field(default=(), metadata={"optional": True})
    nominal: bool = field(default=False, metadata={"optional": True})
    unchecked: tuple[str, ...] = field(default=(), metadata={"optional": True})

    def __repr__(self) -> str:
        names = ", ".join(dict.fromkeys(c.family for c in self.crossings))
        said = f"meets {names}" if names else f"clearance {self.clearance:.3g}"
        said += " (not complete)" * (not self.complete)
        return one_line("TrajectoryCheck", f"{self.arm.name}, {self.samples} samples: {said}")

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return at most six lines: what is met and when, what is near, what to do.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import pinsing
        >>> check = pinsing.check_trajectory(pinsing.load("planar3r"), [[0, -0.5, 1], [0, 0.5, 1]])
        >>> "F1" in check.text()
        True
        """
        return summary(self, degrees)

    @property
    def clearance(self) -> float:
        """Proven: the motion is nowhere nearer to a family; infinite without families."""
        return 0.0 if self.crossings else min((a.lower for a in self.approaches), default=np.inf)


@checked
def check_trajectory(
    arm: Arm,
    Q: ArrayLike,
    t: ArrayLike | None = None,
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    near: float = NEAR,
    tip_speed: float = TIP_SPEED,
    turn_speed: float = TURN_SPEED,
    joint_speeds: ArrayLike | None = None,
    acceleration_limits: ArrayLike | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TrajectoryCheck:
    """Check a trajectory: what it meets, how near it comes, and where joints would be too fast.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    Q : (N, n) or (N, nq) array_like
        Samples, radians and metres; joints move linearly between them. Of a table (pandas, Polars,
        Arrow) the columns are found by the joints' names. A ``numpy.memmap`` is
        read in pieces, so that memory stays bounded.
    t : (N,) array_like, optional
        Seconds, ascending. Without them speeds are not judged, and t counts samples from 0.
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm; computed if not given.
    families : sequence of str, optional
        Names of the families that count; by default all that have real points.
    near : float
        Clearance in radians (or metres over the length scale) below which stretches are told.
    tip_speed, turn_speed : float
        Metres and radians per second: tip motions at both at once, in the worst directions, are
        judged by the joint speeds that they take.
    joint_speeds : (n,) array_like, optional
        Speed limits, radians or metres per second; those of the description if not given.
    acceleration_limits : (n,) array_like, optional
        Radians or metres per second squared; descriptions have none.
    progress : callable, optional
        Called with samples done and samples in all.

    Returns
    -------
    TrajectoryCheck
        ``pinsing.proximity.trajectory.summary`` puts it into six lines.

    Raises
    ------
    ConfigurationError
        If there is no sample, or samples have the wrong shape or a value that is not finite.
    OptionError, UnknownNameError
        If times do not ascend, an option makes no sense, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> check = pinsing.check_trajectory(pinsing.load("planar3r"), [[0, -0.5, 1], [0, 0.5, 1]])
    >>> [(c.family, c.kind, round(c.t, 6)) for c in check.crossings]
    [('F1', 'crossing', 0.5)]
    """
    OptionError.refuse_if(not near > 0, f"near must be positive, got {near!r}")
    check_speeds(tip_speed, turn_speed)
    given = forms_of(arm, forms, form_to_measure)
    watched = watch(given, families)
    every = watched if families is None else watch(given)
    watched.require_angle(near, "near")
    table = columns_of(Q, arm.joints, "Q")
    samples = table if isinstance(table, np.ndarray) else np.asarray(table, dtype=float)
    if samples.ndim == 2 and samples.shape[1] != arm.n:
        samples = arm.check(samples, "Q")
    ConfigurationError.refuse_if(
        samples.ndim != 2,
        f"a trajectory has shape (N, {arm.n}), one column a joint "
        f"({', '.join(arm.joints)}); got {samples.shape}",
    )
    N = len(samples)
    ConfigurationError.refuse_if(N == 0, "the trajectory has no sample")
    times = check_times(t, N)
    passage = Passage(watched, near)
    limits = None if acceleration_limits is None else np.array(acceleration_limits, dtype=float)
    OptionError.refuse_if(
        limits is not None and (limits.shape != (arm.n,) or not (limits > 0).all()),
        f"acceleration_limits needs {arm.n} positive numbers",
    )
    speeds = Speeds(arm, tip_speed, turn_speed, joint_speeds, limits, t is not None)
    for first in range(0, N, _CHUNK):
        last = min(first + _CHUNK, N)
        # Some samples to each side, so that what happens at the seams is seen as a whole.
        low, high = max(first - 3, 0), min(last + 2, N)
        block = samples[low:high]
        plain = block.dtype.kind in "fiub"
        part = np.array(block, dtype=float) if plain else watched.check(block)
        wrong = np.argwhere(~np.isfinite(part))
        if len(wrong):
            i, j = (int(k) for k in wrong[0])
            raise ConfigurationError(
                f"joint {arm.joints[j]!r} is {part[i, j]} in sample {low + i + 1} of {N}"
            )
        check_reach(watched, part, "sample", low + 1)
        if arm.units is None:
            arm.space.require_radians(part, "sample", first=low + 1, rows=len(part))
        passage.feed(times[low:high], part, first - low, last - low, last == N)
        speeds.feed(times[low:high], part, first - low, last - low)
        if progress is not None:
            progress(last, N)
    passage.finish()
    speeds.between(passage)
    return TrajectoryCheck(
        arm=summarize(arm),
        samples=N,
        timed=t is not None,
        t_first=float(times[0]),
        t_last=float(times[-1]),
        crossings=tuple(passage.crossings),
        cut=passage.cut,
        approaches=passage.approaches,
        near=float(near),
        stretches=tuple(passage.stretches),
        trend=passage.trend,
        too_fast=speeds.found("speed"),
        too_abrupt=speeds.found("acceleration"),
        costly=speeds.found("cost"),
        tip_speed=float(tip_speed),
        turn_speed=float(turn_speed),
        jumps=speeds.found("jump"),
        outside=speeds.found("outside"),
        complete=watched.complete,
        notes=_notes(arm, speeds, limits is not None, watched.gaps),
        start=np.array(samples[0], dtype=float),
        tube=watched.tube,
        own_crossings=tuple(passage.own_crossings),
        nominal=watched.nominal,
        unchecked=tuple(
            titled(name, f.title)
            for name, f in zip(every.names, every.families, strict=True)
            if name not in watched.names
        ),
        speed_limits=bool(np.isfinite(speeds.limits).any()),
    )


def _notes(arm: Arm, speeds: Speeds, accelerations: bool, gaps: list[str]) -> tuple[str, ...]:
    notes = ["between samples joints are taken to move linearly"]
    unknown = [n for n, c in zip(arm.joints, speeds.limits, strict=True) if not math.isfinite(c)]
    if unknown:
        notes.append(f"no speed limits are known of {listed(unknown)}: none were judged")
    if not speeds.timed:
        notes.append("no times given: joint speeds and accelerations were not judged")
    elif not accelerations:
        notes.append("robot descriptions hold no acceleration limits: none were judged")
    if arm.prismatic.any():
        notes.append(metric_note(arm.length_scale))
    return (*notes, *gaps)
