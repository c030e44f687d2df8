"""How a motion passes families: meetings, nearest approaches, stretches that are near."""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import SearchOptions, nearest_points
from pinsing.algebra.two_sided import two_sided
from pinsing.proximity.crossings import Crossing, crossings_of
from pinsing.proximity.motion import Motion
from pinsing.proximity.stretches import NearStretch, Stretches
from pinsing.proximity.watched import Watched

_MOST = 1000
_STEP = 0.05
"""Longer steps are looked at in between, this far apart in joint space."""
_BETWEEN = 64
_CANDIDATES = 6
_SEARCH = SearchOptions(gap=1e-6, seconds=0.3)


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
    """

    family: str
    t: float
    q: Array
    upper: float
    lower: float


@dataclass(frozen=True, eq=False)
class Met:
    """What a motion met; fields as on TrajectoryCheck."""

    crossings: tuple[Crossing, ...]
    cut: bool
    approaches: tuple[Approach, ...]
    stretches: tuple[NearStretch, ...]
    trend: str


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A place at which a family may be nearest: the samples around it."""

    bound: float
    motion: Motion
    u: float


class Passage:
    """Gathers how a motion, fed in pieces, passes the watched families."""

    def __init__(self, watched: Watched, near: float) -> None:
        self.watched, self.near = watched, near
        count = len(watched.families)
        self._crossings: list[Crossing] = []
        self._stretches = Stretches(watched, near)
        self._cut = False
        self._least = np.full(count, np.inf)
        self._candidates: list[list[_Candidate]] = [[] for _ in range(count)]
        self._trend = "steady"

    def feed(self, t: Array, Q: Array, first: int, last: int, end: bool) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        if len(Q) == 1:
            t, Q, last = np.repeat(t, 2), np.repeat(Q, 2, axis=0), 2
        motion = Motion(t, np.stack([Q[:-1], np.diff(Q, axis=0)], axis=1))
        begin, stop = float(t[first]), float(t[min(last, len(t) - 1)])
        for c in crossings_of(self.watched, motion):
            if c.t_end < begin or (c.t >= stop and not end):
                continue
            self._add(c)
        self._look(motion, first, min(last, len(motion.pieces)), end)

    def _add(self, c: Crossing) -> None:
        for k in range(len(self._crossings) - 1, max(-1, len(self._crossings) - 8), -1):
            other = self._crossings[k]
            if other.family == c.family and c.t <= other.t_end + 1e-12 * (1 + abs(c.t)):
                if c.t_end > other.t_end:  # goes on in the next part
                    self._crossings[k] = Crossing(other.t, c.t_end, other.q, c.family, c.kind)
                return
        if len(self._crossings) >= _MOST:
            self._cut = True
            return
        self._crossings.append(c)

    def _look(self, motion: Motion, first: int, last: int, end: bool) -> None:
        """Clearance at samples and, where steps are long, in between."""
        steps = self.watched.length(motion.pieces[first:last, 1])
        counts = np.clip(np.ceil(steps / _STEP), 1, _BETWEEN).astype(np.int64)
        u = np.concatenate([first + k + np.arange(m) / m for k, m in enumerate(counts)] or [[]])
        u = np.append(u, float(last))
        Q = motion.at(u)
        bounds = two_sided(self.watched.conditions, Q, each=True).each
        assert bounds is not None
        if not bounds.shape[1]:
            return
        lower = bounds[..., 0]
        length = self.watched.length(np.diff(Q, axis=0))
        between = (lower[:-1] + lower[1:] - length[:, None]) / 2
        self._least = np.minimum(self._least, between.min(axis=0, initial=np.inf))
        self._least = np.minimum(self._least, lower.min(axis=0))
        for f in range(lower.shape[1]):
            self._candidate(f, motion, u, lower[:, f])
        self._stretches.feed(motion, u, Q, lower.min(axis=1), lower.argmin(axis=1))
        if end and len(u) > 1:
            f = int(np.argmin(lower[-1]))
            change = float(lower[-1, f] - lower[-2, f])
            small = 1e-6 * max(float(length[-1]), 1e-12)
            self._trend = "steady" if abs(change) <= small else "away" if change > 0 else "toward"

    def _candidate(self, f: int, motion: Motion, u: Array, lower: Array) -> None:
        """Keep the lowest local minima of the bound of family f."""
        padded = np.concatenate([[np.inf], lower, [np.inf]])
        dips = np.flatnonzero((lower <= padded[:-2]) & (lower <= padded[2:]))
        kept = self._candidates[f]
        for i in dips[np.argsort(lower[dips], kind="stable")][:_CANDIDATES]:
            low, high = int(max(np.floor(u[i]) - 1, 0)), int(np.ceil(u[i]) + 1)
            high = min(max(high, low + 1), len(motion.pieces))
            part = Motion(motion.t[low : high + 1], motion.pieces[low:high])
            kept.append(_Candidate(float(lower[i]), part, float(u[i] - low)))
        kept.sort(key=lambda c: c.bound)
        del kept[_CANDIDATES:]

    def finish(self) -> Met:
        """All of it, the nearest approaches certified."""
        approaches = [self._approach(f) for f in range(len(self.watched.families))]
        found = [a for a in approaches if a is not None]
        found.sort(key=lambda a: a.upper)
        self._crossings.sort(key=lambda c: c.t)
        return Met(
            tuple(self._crossings),
            self._cut or self._stretches.cut,
            tuple(found),
            self._stretches.finish(self._crossings),
            self._trend,
        )

    def _approach(self, f: int) -> Approach | None:
        name, watched = self.watched.names[f], self.watched
        for c in self._crossings:
            if c.family == name:
                return Approach(name, c.t, c.q, 0.0, 0.0)
        branches = [watched.families[f].branches]
        conditions = Conditions.of(branches, watched.prismatic, watched.weight, watched.norm)
        best: tuple[float, float, Array, float] | None = None
        for candidate in self._candidates[f]:
            if best is not None and candidate.bound >= best[0]:
                continue
            found = _refined(conditions, watched, candidate)
            if best is None or found[0] < best[0]:
                best = found
        if best is None:
            return None
        upper, t, q, _ = best
        return Approach(name, t, q, upper, max(0.0, min(float(self._least[f]), upper)))


def _refined(
    conditions: Conditions, watched: Watched, candidate: _Candidate
) -> tuple[float, float, Array, float]:
    """Least certified distance near a candidate: (upper, t, q, lower)."""
    motion = candidate.motion

    def at(places: Array) -> tuple[Array, Array]:
        Q = motion.at(places)
        found = nearest_points(conditions, Q, watched.lower, watched.upper, _SEARCH)
        return found.upper, found.lower

    low, high = 0.0, float(len(motion.pieces))
    u = np.unique(
        np.clip([candidate.u, low, high, candidate.u - 0.5, candidate.u + 0.5], low, high)
    )
    upper, lower = at(u)
    for _ in range(12):
        k = int(np.argmin(upper))
        left, right = u[max(k - 1, 0)], u[min(k + 1, len(u) - 1)]
        if right - left < 1e-6:
            break
        fresh = np.setdiff1d(np.array([(left + u[k]) / 2, (u[k] + right) / 2]), u)
        more, less = at(fresh)
        u, upper, lower = np.append(u, fresh), np.append(upper, more), np.append(lower, less)
        order = np.argsort(u)
        u, upper, lower = u[order], upper[order], lower[order]
    k = int(np.argmin(upper))
    place = u[k : k + 1]
    return float(upper[k]), float(motion.time(place)[0]), motion.at(place)[0], float(lower[k])
