"""How a motion passes singular configurations: meetings, nearest approaches, stretches near them.

Families of several conditions can be passed by on all sides. Distance to a set changes by no more
than one moves: on a step of length d between places at which it is at least a and b it is at least
(a + b - d) / 2. Steps for which that is below a bound are halved, until they are short: nothing
nearer than the bound lies outside of what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from pinsing.algebra.conditions import (
    BOXES,
    SIMPLE,
    Conditions,
    SearchOptions,
    WeightedBranch,
    Zeros,
    nearest_points,
    place,
    sums_of,
    two_sided,
    zeros_along,
)
from pinsing.algebra.trig_sum import TrigSum
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import Branch
from pinsing.families.family import distance_to, owned
from pinsing.interface import JsonResult, Sequenced, checked, real_numbers
from pinsing.kinematics.jacobian import NEAR_RTOL, generic_rank, ratios, task_jacobians
from pinsing.measures import PRACTICAL, ROUNDING, Array, ArrayLike, Bool, Ints
from pinsing.proximity.clearance import CLOSE, Forms, Watched, nearest_family, watch
from pinsing.robot.arm import Arm

_MOST_DEGREE = 15
# Beyond it a float says nothing of an angle that is worth a check, and speeds overflow.
FARTHEST = 1e9


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion in pieces: joint values ``sum_k pieces[i, k] s^k`` on piece i, s from 0 to 1."""

    t: Array  # (m + 1,), where pieces begin and end, ascending
    pieces: Array  # (m, degree + 1, n)

    def at(self, u: Array) -> Array:
        """Joint values (K, n) at places u (K,): number of the piece plus s."""
        index, s = self.split(u)
        return place(self.pieces, index, s)

    def time(self, u: Array) -> Array:
        """Times (...) of places u (...)."""
        index, s = self.split(u)
        return np.asarray(self.t[index] + s * (self.t[index + 1] - self.t[index]))

    def split(self, u: Array) -> tuple[Ints, Array]:
        """Pieces and s of places u."""
        index = np.clip(np.floor(u).astype(np.int64), 0, len(self.pieces) - 1)
        return index, u - index


def motion_of(watched: Watched, motion: Any, t: ArrayLike | None = None) -> Motion:
    """Return a motion from waypoints (N, n), or an object with ``c`` and ``x`` as SciPy's PPoly."""
    if hasattr(motion, "c") and hasattr(motion, "x"):
        OptionError.refuse_if(
            t is not None, "a piecewise polynomial contains its times: leave out t"
        )
        return _polynomial(watched, motion)
    Q = watched.check(motion)
    ConfigurationError.refuse_if(
        Q.ndim != 2, f"waypoints have shape (N, {watched.n}), got {Q.shape}"
    )
    ConfigurationError.refuse_if(len(Q) == 0, "there is no waypoint")
    check_reach(watched, Q)
    times = check_times(t, len(Q))
    if len(Q) == 1:  # a motion that rests
        Q, times = np.repeat(Q, 2, axis=0), np.array([times[0], times[0]])
    return Motion(times, np.stack([Q[:-1], np.diff(Q, axis=0)], axis=1))


def check_reach(watched: Watched, Q: Array, what: str = "sample", first: int = 1) -> None:
    """Raise ConfigurationError if a value (N, n) is beyond 1e9; ``what`` and ``first`` name it."""
    for i, j in np.argwhere(np.abs(Q) > FARTHEST):
        raise ConfigurationError(
            f"{what} {first + i}: {watched.joints[j]} is {Q[i, j]:g}; values beyond "
            f"{FARTHEST:g} (radians, metres) are no positions of a joint"
        )


def check_times(t: ArrayLike | None, count: int) -> Array:
    """Return ascending times of ``count`` samples, by default 0, 1, 2, ...; else OptionError."""
    if t is None:
        return np.arange(count, dtype=float)
    times = real_numbers(t, "t")
    OptionError.refuse_if(
        times.shape != (count,), f"t needs {count} times, one a sample; got shape {times.shape}"
    )
    for i in np.flatnonzero(~np.isfinite(times)):
        raise OptionError(f"time of sample {i + 1} is {times[i]}")
    for i in np.flatnonzero(np.diff(times) <= 0):
        raise OptionError(
            f"times must ascend: sample {i + 2} is at {times[i + 1]:g}, "
            f"the one before at {times[i]:g}"
        )
    return times


def _polynomial(watched: Watched, motion: Any) -> Motion:
    c, x = real_numbers(motion.c, "c of the motion"), real_numbers(motion.x, "x of the motion")
    ConfigurationError.refuse_if(
        c.ndim != 3 or x.ndim != 1 or c.shape[1:] != (len(x) - 1, watched.n) or not c.size,
        f"a piecewise polynomial has coefficients c of shape (k, m, {watched.n}) and m + 1 "
        f"breakpoints x; got {c.shape} and {x.shape}",
    )
    OptionError.refuse_if(
        len(c) > _MOST_DEGREE + 1, f"polynomials of degree {len(c) - 1}: at most {_MOST_DEGREE}"
    )
    ConfigurationError.refuse_if(
        not np.isfinite(c).all(), "a coefficient of the motion is not finite"
    )
    times = check_times(x, len(x))
    rising = np.moveaxis(c[::-1], 0, 1)  # (m, degree + 1, n), powers of the local time
    width = np.diff(times)[:, None, None] ** np.arange(len(c))[None, :, None]
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = np.ascontiguousarray(rising * width)
    # Of a piece, no value exceeds the sum of its coefficients.
    check_reach(watched, np.nan_to_num(np.abs(pieces).sum(axis=1), nan=np.inf), "piece")
    return Motion(times, pieces)


_SHORT = 2e-7


def _contacts(c: Conditions, motion: Motion) -> list[tuple[float, float]]:
    """From where to where a motion is on a family of several conditions."""
    u = np.arange(len(motion.pieces) + 1.0)
    least = two_sided(c, motion.at(u)).lower
    while True:
        length = _lengths(c, motion, u)
        # As near as this, in joint space, is on the family
        left = least[:-1] + least[1:] <= length + 2 * 1e-6
        k = np.flatnonzero(left & (length > _SHORT))
        if not len(k) or len(u) > 400_000:
            return [(float(u[a]), float(u[b])) for a, b in runs(left)]
        middle = (u[k] + u[k + 1]) / 2
        least = np.insert(least, k + 1, two_sided(c, motion.at(middle)).lower)
        u = np.insert(u, k + 1, middle)


def runs(inside: Bool) -> list[tuple[int, int]]:
    """Begin and end of each run of True."""
    change = np.diff(inside.astype(np.int8), prepend=0, append=0)
    ends = np.flatnonzero(change == 1).tolist(), np.flatnonzero(change == -1).tolist()
    return list(zip(*ends, strict=True))


def _lengths(c: Conditions, motion: Motion, u: Array) -> Array:
    """Bounds (K,) of the lengths from each place u (K + 1,) to the next, none beyond its piece."""
    index = u[:-1].astype(np.int64)
    norms = np.linalg.norm(motion.pieces[index, 1:] * c.weight, axis=2)
    k = np.arange(1, motion.pieces.shape[1])
    low, high = (x[:, None] - index[:, None] for x in (u[:-1], u[1:]))
    return np.asarray((norms * (high**k - low**k)).sum(axis=1) * (1 + 1e-12))


@dataclass(frozen=True, eq=False)
class Crossing:
    """One meeting of a motion with a family.

    Attributes
    ----------
    t : float
        Time at which it begins; the number of the waypoint where no times were given.
    t_end : float
        Where it ends: the same but for "along".
    q : (n,) array
        The configuration at ``t``.
    family : str
        Name of the family.
    kind : str
        "crossing": the motion goes through, from one side to the other. "touch": it comes to
        the family, within rounding of it, and stays on its side; for families of several
        conditions, which have no sides, it comes within 1e-6 of it. "along": it stays on it.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the family.
    where : str
        Its condition with the values of joints at ``q``: ``wrist_2_joint = 0°``.
    """

    t: float
    t_end: float
    q: Array
    family: str
    kind: str
    title: str = field(default="", metadata={"optional": True})
    where: str = field(default="", metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class Crossings(JsonResult, Sequenced[Crossing]):
    """All meetings of a motion with families, in the order of time.

    Attributes
    ----------
    events : tuple of Crossing
        None is missing: every other part of the motion is proven to be off the families.
    names : tuple of str
        The families that were looked at.
    complete : bool
        Whether the closed form is complete: else other singular configurations may be met.
    """

    schema: ClassVar[str] = "pinsing/crossings/1"
    _items: ClassVar[str] = "events"

    events: tuple[Crossing, ...]
    names: tuple[str, ...]
    complete: bool

    def text(self) -> str:
        """Return one line a meeting, in the order of time.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("planar3r"))
        >>> print(pinsing.proximity.crossings(form, [[0, -0.5, 1], [0, 0.5, 1]]).text())
        t = 0.5: crossing family (F1)
        """
        lines = [f"t = {c.t:.6g}: {c.kind} {c.title or 'family'} ({c.family})" for c in self]
        lines = lines or [f"meets none of {', '.join(self.names) or 'no families'}"]
        return "\n".join([*lines, *["the closed form is not complete"] * (not self.complete)])


@checked
def crossings(
    forms: Forms,
    motion: Any,
    t: ArrayLike | None = None,
    *,
    families: Sequence[str] | None = None,
) -> Crossings:
    """Find all places at which a motion meets a family of singular configurations, with proof.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm.
    motion : (N, n) array_like, or an object with ``c`` (k, m, n) and ``x`` (m + 1,)
        Waypoints joined by straight segments in joint space, in radians and metres, as they are
        (not wrapped); or a piecewise polynomial as SciPy's PPoly and CubicSpline hold it.
    t : (N,) array_like, optional
        Times of waypoints, ascending; 0, 1, 2, ... by default.
    families : sequence of str, optional
        Names; by default all that have real points.

    Returns
    -------
    Crossings
        In the order of time.

    Raises
    ------
    ConfigurationError
        If the motion has the wrong shape, or a value that is not finite.
    OptionError, UnknownNameError
        If times do not ascend, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("ur5"))
    >>> [c.family for c in pinsing.crossings(form, [[0, -1, 1, 0, 1, 0], [0, -1, 1, 0, -1, 0]])]
    ['F2']
    """
    watched = watch(forms, families)
    return crossings_of(watched, motion_of(watched, motion, t))


def crossings_of(watched: Watched, motion: Motion) -> Crossings:
    """All meetings of a motion with watched families."""
    surfaces: list[tuple[int, TrigSum]] = []
    thin: dict[int, list[Branch]] = {}
    for f, family in enumerate(watched.families):
        for branch in family.branches:
            if len(branch.values) + len(branch.equations) > 1:
                thin.setdefault(f, []).append(branch)
            else:
                surfaces += [(f, s) for s in sums_of(branch, watched.prismatic, watched.weight)]
    no_values = np.empty(0, dtype=np.int64), np.empty(0)
    alone = tuple(WeightedBranch(k, *no_values, (s,)) for k, (_, s) in enumerate(surfaces))
    of_one = Conditions(len(alone), watched.weight, watched.conditions.turn, alone)
    found = _on_surfaces(of_one, [f for f, _ in surfaces], motion)
    for f, branches in thin.items():
        conditions = Conditions.of([branches], watched.prismatic, watched.weight)
        found += [(u, end, f, "touch") for u, end in _contacts(conditions, motion)]
    found.sort(key=lambda item: item[:3])
    events = []
    ends = np.array([item[:2] for item in found]).reshape(-1, 2)
    Q, times = motion.at(ends[:, 0]), motion.time(ends).tolist()
    for (u, to, f, kind), q, (begin, end) in zip(found, Q, times, strict=True):
        family = watched.families[f]
        long = kind == "along" or (kind == "touch" and end > begin)
        if family.confirm is not None:
            # Zeros of the equations at which the arm is not even near-singular are none of it.
            some = motion.at(np.linspace(u, to, 100 if long else 1))
            if (ratios(family.confirm.arm, some) > NEAR_RTOL).all():
                continue
        until = min(end, float(motion.t[-1])) if long else begin
        said = watched.names[f], kind, family.title, family.where(q)
        events.append(Crossing(begin, until, q, *said))
    return Crossings(tuple(events), watched.names, watched.complete)


def _on_surfaces(
    conditions: Conditions, of_equation: list[int], motion: Motion
) -> list[tuple[float, float, int, str]]:
    nodes = np.arange(len(motion.pieces) + 1.0)
    length, lower = (
        _lengths(conditions, motion, nodes),
        two_sided(conditions, motion.at(nodes), each=True).each,
    )
    # Zeros are looked for along the pieces that the bounds at their ends do not rule out.
    least = (lower[:-1, :, 0] + lower[1:, :, 0]).min(axis=1, initial=np.inf)
    open_ = np.flatnonzero(least <= length * (1 + 1e-9) + 1e-9)
    zeros = zeros_along(conditions, np.ascontiguousarray(motion.pieces[open_]))
    values = np.full((len(motion.pieces), *zeros.ends.shape[1:]), np.nan)
    values[open_] = zeros.ends
    zeros = replace(zeros, piece=open_[zeros.piece], ends=values)
    # Joint-space length within which events of one equation are one.
    near = 1e-12 + 1e-9 / np.maximum(length, 1e-300)  # in s, of each piece
    out = []
    for e, f in enumerate(of_equation):
        starts, ends, simple = _intervals(conditions, e, zeros, motion)
        if not len(starts):
            continue
        # Intervals that overlap, or nearly so, are one event.
        reach, piece = np.maximum.accumulate(ends), starts.astype(np.int64).clip(0, len(near) - 1)
        apart = starts[1:] - reach[:-1] > np.minimum(near, 1e-3)[piece[1:]]
        first = np.append(0, np.flatnonzero(apart) + 1)
        last = np.append(first[1:], len(starts)) - 1
        # Between two events the sign does not change.
        between = np.append(0.0, reach[last]) + np.append(starts[first], len(near))
        at = conditions.sums[e].at(conditions.scaled(motion.at(between / 2)))
        side = np.where(np.abs(at.value) > 2 * at.error, np.sign(at.value), 0.0)
        through = (side[1:] * side[:-1] < 0) | ((first == last) & simple[first])
        for u, end, goes in zip(starts[first], reach[last], through, strict=True):
            Q = motion.at(np.linspace(u, end, 4)) * conditions.weight
            # Joint-space length from which on an interval of zeros is called "along".
            long = bool(np.linalg.norm(Q - Q[0], axis=1).max() > 1e-3)
            kind = "crossing" if goes else "touch"
            out.append((float(u), float(end), f, "along" if long else kind))
    return out


def _intervals(c: Conditions, e: int, zeros: Zeros, motion: Motion) -> tuple[Array, Array, Bool]:
    """Events of one equation as intervals of places, in order, and which are simple zeros."""
    mine = zeros.equation == e
    at = zeros.piece[mine] + zeros.s[mine]
    start, end = at - zeros.width[mine], at + zeros.width[mine]
    simple = zeros.kind[mine] == SIMPLE
    # At the joints of pieces: a change of sign from one piece to the next, or a value that cannot
    # be told from zero.
    before, after = zeros.ends[:, e, 1], zeros.ends[:, e, 0]
    known = np.isfinite(before[:-1]) & np.isfinite(after[1:])  # else far from zero
    change = np.flatnonzero(known & ((before[:-1] < 0) != (after[1:] < 0))) + 1
    f = c.sums[e]
    values = np.fmin(np.abs(np.append(after, before[-1])), np.abs(np.append(after[0], before)))
    small = np.flatnonzero(values <= 1e-9 * float(f.amplitude.sum()))
    if len(small):
        here = f.at(c.scaled(motion.at(small.astype(float))))
        small = small[np.abs(here.value) <= 4 * here.error]
    nodes = np.concatenate([change, small]).astype(float)
    start, end = np.concatenate([start, nodes]), np.concatenate([end, nodes])
    flags = np.concatenate([simple, np.ones(len(change), bool), np.zeros(len(small), bool)])
    order = np.argsort(start, kind="stable")
    return start[order], end[order], flags[order]


@dataclass(frozen=True)
class NearStretch:
    """A time in which the clearance may be below a bound.

    Attributes
    ----------
    t, t_end : float
        From when to when.
    family : str
        The nearest one found where the clearance may be least.
    clearance : float
        Proven: nowhere in it is a family nearer than this.
    """

    t: float
    t_end: float
    family: str
    clearance: float


def least_along(
    Q: Array,
    lower: Array,
    known: float,
    length: Callable[[Array], Array],
    bounded: Callable[[Array], Array],
    most: float = np.inf,
    share: float = 0.0,
) -> tuple[float, float]:
    """Return the least distance along a path (N, n), proven between points too, and at which point.

    ``bounded`` gives ``lower`` bounds (N,). Segments are halved where their ends allow much less
    than is ``known`` of points, or less by a ``share`` of it, up to ``most`` points.
    """
    lowest, place = float(lower.min()), float(lower.argmin())
    least, step, at = np.inf if len(Q) > 1 else lowest, 1.0, np.arange(len(Q) - 1.0)
    ends, low = np.stack([Q[:-1], Q[1:]]), np.stack([lower[:-1], lower[1:]])
    while True:
        way = length(ends[1] - ends[0])
        bound = np.maximum((low[0] + low[1] - way) / 2, 0.0)
        wide = np.flatnonzero(bound < known - (share * known or BISECTED / 2))
        if not len(wide) or way[wide].max() < PRACTICAL or len(wide) > most:
            return float(bound.min(initial=least)), place
        least = float(np.delete(bound, wide).min(initial=least))
        most, step = most - len(wide), step / 2
        first, last = ends[:, wide]
        middle, at = (first + last) / 2, at[wide]
        lower = bounded(middle)
        known = min(known, float(lower.min()))
        if lower.min() < lowest:
            lowest, place = float(lower.min()), float(at[lower.argmin()] + step)
        # A bound at the middle holds at the ends, less the way.
        a, b = np.maximum(low[:, wide], lower - way[wide] / 2)
        ends = np.stack([np.concatenate([first, middle]), np.concatenate([middle, last])])
        low = np.stack([np.concatenate([a, lower]), np.concatenate([lower, b])])
        at = np.concatenate([at, at + step])


BISECTED = np.radians(0.1)
"""How near what is proven of a path is brought to what is found on it, radians."""
_CANDIDATES = 6
_SEARCH = SearchOptions(boxes=BOXES // 3)
_CLOSE, _APART, _PROVEN = SearchOptions(gap=CLOSE, boxes=20_000), 0.01, 2000
"""How closely distances of samples are proven, how far apart in joint space, how many of a part."""


@dataclass(frozen=True, eq=False)
class Approach:
    """The nearest approach to a family.

    Attributes
    ----------
    family : str
        Its name.
    t : float
        When.
    q : (n,) array
        The configuration.
    upper : float
        Distance from the family there.
    lower : float
        Proven: nowhere on the motion is the family nearer.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the family.
    outside : str
        "point" if the nearest point of the family is outside the joint limits, "family" if all
        of it is (proven), else empty.
    """

    family: str
    t: float
    q: Array
    upper: float
    lower: float
    title: str = field(default="", metadata={"optional": True})
    outside: str = field(default="", metadata={"optional": True})


class Passage:
    """Gathers how a motion, fed in pieces, passes the watched families; `finish` completes it.

    ``cut``: there are more meetings or stretches than are kept. ``trend`` of the clearance at the
    end: "toward", "away" or "steady". ``own_crossings``: where the determinant of a robot that has
    a design changes its sign from one place looked at to the next, and the family that is nearest.
    """

    def __init__(self, watched: Watched, near: float) -> None:
        self.watched, self.near = watched, near
        count = len(watched.families)
        self.crossings: list[Crossing] = []
        self.own_crossings: list[Crossing] = []
        self.stretches: list[NearStretch] = []
        self.cut = False
        # Of each family: the least distance proven along the path, found, and proven of a sample.
        self._least, self._nearest, self._proven = np.full((3, count), np.inf)
        # Of each family: a distance, and the samples around a place at which it may be nearest.
        self._candidates: list[list[tuple[float, Motion, float]]] = [[] for _ in range(count)]
        self.trend = "steady"

    def feed(self, t: Array, Q: Array, first: int, last: int, end: bool) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        if len(Q) == 1:
            t, Q, last = np.repeat(t, 2), np.repeat(Q, 2, axis=0), 2
        motion = Motion(t, np.stack([Q[:-1], np.diff(Q, axis=0)], axis=1))
        begin, stop = float(t[first]), float(t[min(last, len(t) - 1)])
        for c in crossings_of(self.watched, motion):
            if c.t_end >= begin and (c.t < stop or end):
                self._add(c)
        self._look(motion, first, min(last, len(motion.pieces)), end)

    def _add(self, c: Crossing) -> None:
        for k in range(len(self.crossings) - 1, max(-1, len(self.crossings) - 8), -1):
            other = self.crossings[k]
            if other.family == c.family and c.t <= other.t_end + 1e-12 * (1 + abs(c.t)):
                if c.t_end > other.t_end:  # goes on in the next part
                    self.crossings[k] = replace(other, t_end=c.t_end, kind=c.kind)
                return
        if len(self.crossings) < 1000:
            self.crossings.append(c)
        else:
            self.cut = True

    def _look(self, motion: Motion, first: int, last: int, end: bool) -> None:
        """Clearance at samples and, where steps are long, in between."""
        steps = self.watched.length(motion.pieces[first:last, 1])
        # Longer steps are looked at in between, this far apart in joint space.
        counts = np.clip(np.ceil(steps / _APART), 1, 64).astype(np.int64)
        parts = (first + k + np.arange(m) / m for k, m in enumerate(counts))
        u = np.concatenate([*parts, [float(last)]])
        Q = motion.at(u)
        length = self.watched.length(np.diff(Q, axis=0))
        if not self.watched.each:
            return
        way = np.append(0.0, np.cumsum(length)) * (1 + ROUNDING)
        lower, upper = self._bounds(Q, length, way)
        arm = self.watched.tube and self.watched.arm
        if arm and generic_rank(arm) == arm.n == len(arm.task.rows):
            self._change_sign(arm, motion, u, Q)
        for f, conditions in enumerate(self.watched.each):

            def bounded(x: Array, c: Conditions = conditions, f: int = f) -> Array:
                return nearest_points(c, x, *self.watched.families[f].limits, _CLOSE).lower

            known = float(min(self._nearest[f] - 0.75 * CLOSE, self._proven[f]))
            most = 0 if self.watched.margin else _PROVEN
            least, _ = least_along(Q, lower[:, f], known, self.watched.length, bounded, most)
            self._least[f] = min(self._least[f], least)
            some = np.isfinite(upper[:, f]).any()
            self._candidate(f, motion, u, way, (upper if some else lower)[:, f])
        self._stretch(motion, u, Q, lower.min(axis=1))
        if end and len(u) > 1:
            f = int(nearest_family(self.watched.conditions, Q[-1:])[0][0])
            two = two_sided(self.watched.conditions.zeros, Q[-2:], each=True).each[:, f, 0]
            change = float(two[1] - two[0])
            small = 1e-6 * max(float(length[-1]), 1e-12)
            self.trend = "steady" if abs(change) <= small else "away" if change > 0 else "toward"

    def _stretch(self, motion: Motion, u: Array, Q: Array, least: Array) -> None:
        """Keep the stretches between places u (K,), where the clearance is at least ``least``."""
        watched, near = self.watched, self.near
        for halvings in range(19):
            length = watched.length(np.diff(Q, axis=0))
            # A lower bound of the clearance on each step.
            bound = np.maximum((least[:-1] + least[1:] - length) / 2, 0.0)
            inside, outside = bound < near, least >= near
            # Ends of a stretch, and steps on which it may be a good deal nearer than is known.
            nearer = bound < 0.95 * np.minimum(least[:-1], least[1:]) - 0.01 * near
            again = outside[:-1] | outside[1:] | nearer
            # Steps of this length are not halved any more.
            k = np.flatnonzero(inside & again & (length > 1e-4))
            if halvings == 18 or not len(k):
                break
            middle = (u[k] + u[k + 1]) / 2
            there = motion.at(middle)
            lower = two_sided(watched.conditions, there).lower
            u, Q = np.insert(u, k + 1, middle), np.insert(Q, k + 1, there, axis=0)
            least = np.insert(least, k + 1, lower) * watched.known_along(Q)
        t = motion.time(u)
        for start, end in runs(inside):
            q = Q[start + int(np.argmin(least[start : end + 1]))]
            family = watched.names[int(nearest_family(watched.conditions, q[None])[0][0])]
            ends, clear = (float(t[start]), float(t[end])), float(bound[start:end].min())
            if self.stretches and ends[0] <= (old := self.stretches[-1]).t_end:
                deeper = clear < old.clearance
                new = replace(old, family=family, clearance=clear) if deeper else old
                self.stretches[-1] = replace(new, t_end=ends[1])
            elif len(self.stretches) < 1000:
                self.stretches.append(NearStretch(*ends, family, clear))
            else:
                self.cut = True

    def _change_sign(self, arm: Arm, motion: Motion, u: Array, Q: Array) -> None:
        """Keep where the determinant of the arm's Jacobian changes its sign between places u."""
        above = np.linalg.det(task_jacobians(arm, Q)) > 0
        first = np.flatnonzero(above[1:] != above[:-1])
        low, high = u[first], u[first + 1]
        for _ in range(50):
            middle = (low + high) / 2
            same = (np.linalg.det(task_jacobians(arm, motion.at(middle))) > 0) == above[first]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        there = motion.at(high)
        nearest = nearest_family(self.watched.conditions, there)[0]
        self.own_crossings += [
            Crossing(t, t, q, self.watched.names[f], "crossing", self.watched.families[f].title)
            for t, q, f in zip(motion.time(high).tolist(), there, nearest, strict=True)
        ]
        self.cut |= len(self.own_crossings) > 1000
        del self.own_crossings[1000:]

    def _bounds(self, Q: Array, length: Array, way: Array) -> tuple[Array, Array]:
        """Return bounds (M, F) of distances; close ones where these bound the least."""
        # Lower ones of one sample, less the way to another one, hold there.
        margin, each = (
            self.watched.margin,
            two_sided(self.watched.conditions.zeros, Q, each=True).each,
        )
        self._nearest = np.fmin(self._nearest, each[..., 1].min(axis=0))
        for f, conditions in enumerate(self.watched.each):
            low, limits = each[:, f, 0], self.watched.families[f].limits
            lost = ROUNDING + np.finfo(np.float64).eps * len(way) * way[-1]
            # First samples that are far apart: what is proven of them spares most of the others.
            for apart in 16 * _APART, 4 * _APART, _APART:
                least = np.append(np.inf, np.append((low[:-1] + low[1:] - length) / 2, np.inf))
                weak = np.flatnonzero(np.minimum(least[1:], least[:-1]) < self._nearest[f])
                weak = weak[np.unique(np.floor(way[weak] / apart), return_index=True)[1]]
                weak = weak[np.argsort(low[weak], kind="stable")[:_PROVEN]]
                found = nearest_points(conditions, Q[weak], *limits, _CLOSE)
                self._nearest[f] = min(self._nearest[f], found.upper.min(initial=np.inf))
                self._proven[f] = min(self._proven[f], found.lower.min(initial=np.inf))
                each[weak, f, 1] = np.fmin(each[weak, f, 1], found.upper)
                low[weak] = np.maximum(low[weak], found.lower)
                np.maximum(low, np.maximum.accumulate(low + way) - way - lost, out=low)
                back = np.maximum.accumulate((low - way)[::-1])[::-1] + way - lost
                np.maximum(low, back, out=low)
        if margin is None:
            return each[..., 0], each[..., 1]
        return margin.take_off(Q, each) * self.watched.known_along(Q)[:, None], each[..., 1]

    def _candidate(self, f: int, motion: Motion, u: Array, way: Array, upper: Array) -> None:
        """Keep the lowest local minima of distances to family f, of places u (M,)."""
        known = np.flatnonzero(np.isfinite(upper))
        padded = np.concatenate([[np.inf], upper[known], [np.inf]])
        dips = known[(padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:])]
        kept = self._candidates[f]
        for i in dips[np.argsort(upper[dips], kind="stable")][:_CANDIDATES]:
            a, b = np.searchsorted(way, way[i] + 2 * _APART * np.array([-1, 1]))
            low, high = int(max(u[a] - 1, 0)), int(np.ceil(u[min(b, len(u) - 1)]) + 1)
            high = min(max(high, low + 1), len(motion.pieces))
            part = Motion(motion.t[low : high + 1], motion.pieces[low:high])
            kept.append((float(upper[i]), part, float(u[i] - low)))
        kept.sort(key=lambda c: c[0])
        del kept[_CANDIDATES:]

    def finish(self) -> None:
        """Certify the nearest approaches, and put all in order."""
        found = [self._approach(f) for f in range(len(self.watched.families))]
        self.approaches = tuple(sorted(filter(None, found), key=lambda a: (a.upper, a.lower)))
        self.crossings.sort(key=lambda c: c.t)
        for k, s in enumerate(self.stretches):
            met = next((c for c in self.crossings if c.t <= s.t_end and c.t_end >= s.t), None)
            if met is not None:
                self.stretches[k] = replace(s, family=met.family, clearance=0.0)

    def _approach(self, f: int) -> Approach | None:
        name, watched = self.watched.names[f], self.watched
        title = watched.families[f].title
        for c in self.crossings:
            if c.family == name:
                return Approach(name, c.t, c.q, 0.0, 0.0, title)
        conditions = self.watched.each[f]
        found = [_refined(conditions, watched, m, u) for _, m, u in self._candidates[f]]
        if not found:
            return None
        upper, t, q = min(found, key=lambda x: (round(x[0], 9), x[1]))
        nearest = nearest_points(conditions, q[None], *watched.families[f].limits, _SEARCH)
        upper, there = min(upper, float(nearest.upper[0])), nearest.q[0]
        if not owned(watched.families[f], nearest.q)[0]:
            own = distance_to(watched.families[f], q, conditions, _SEARCH)
            upper, there = own.upper, own.q
        least = max(0.0, min(float(self._least[f]), upper))
        outside = "family" if watched.families[f].is_reachable is False else ""
        if not outside:
            moved = np.abs(there - q) > ROUNDING
            outside = "point" * bool((watched.space.unreachable(there) & moved).any())
        return Approach(name, t, q, upper, least, title, outside)


def _refined(
    conditions: Conditions, watched: Watched, motion: Motion, near: float
) -> tuple[float, float, Array]:
    """Least distance found near a place of a motion: (upper, t, q)."""
    least, place, q = np.inf, np.array([near]), motion.at(np.array([near]))[0]
    for step in (0.0, *0.5 ** np.arange(1.0, 14.0)):  # to where it is less, by half of it each time
        u = np.clip(np.append(place - step, place + step), 0.0, float(len(motion.pieces)))
        Q = motion.at(u)
        upper = nearest_points(conditions, Q, watched.lower, watched.upper, _CLOSE).upper
        k = int(np.argmin(upper))
        if upper[k] < least:
            least, place, q = float(upper[k]), u[k : k + 1], Q[k]
    return least, float(motion.time(place)[0]), q
