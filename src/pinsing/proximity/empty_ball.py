"""Where a large ball around a configuration holds no point of any family.

Points of families are gathered ("sites"). A configuration is no farther from the families than
from its nearest site, which is cheap to tell for many at once and over whole boxes; where that
promises much, the true distance is searched, with its proof, and the nearest point found is a
site from then on. So the promise falls and what is proven rises, until they meet or the work is
done that there is to be.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pinsing._types import Array, Bool, Ints
from pinsing.algebra.nearest import SearchOptions, nearest_points
from pinsing.families import Branch, Family
from pinsing.proximity.watched import Watched

_CLIMBERS = 48
_STEPS = 25
_TRIED = 4
_BATCH = 256
_GAP = 1e-3
_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class Room:
    """The configurations that are to choose from, in weighted coordinates.

    Attributes
    ----------
    low, high : (n,) arrays
        A box; of no width for joints that do not matter.
    center : (n,) array
        In the box: what is preferred where nothing else decides.
    around : (n,) array
        Centre of a ball that counts as well.
    reach : float
        Its radius; infinite without one.
    """

    low: Array
    high: Array
    center: Array
    around: Array
    reach: float

    def fit(self, X: Array) -> Array:
        """Move points X (N, n) into the box and the ball."""
        X = np.clip(X, self.low, self.high)
        if not np.isfinite(self.reach):
            return X
        far = np.linalg.norm(X - self.around, axis=1)
        left = self.reach - float(np.linalg.norm(self.center - self.around))
        size = np.maximum(np.linalg.norm(X - self.center, axis=1), 1e-300)
        share = np.where(far <= self.reach, 1.0, np.minimum(1.0, max(left, 0.0) / size))
        return np.asarray(self.center + share[:, None] * (X - self.center))


@dataclass
class Clearest:
    """The clearest point so far."""

    x: Array
    lower: float = -np.inf
    upper: float = np.inf
    most: float = np.inf


class Sites:
    """Points of the families, each with the joints that make it one: the others are free."""

    def __init__(self, watched: Watched, rng: np.random.Generator) -> None:
        self.watched = watched
        self.turn = watched.conditions.turn
        self._groups: dict[tuple[int, tuple[int, ...]], Array] = {}
        for number, family in enumerate(watched.families):
            for branch in family.branches:
                count = 96 if branch.equations else 1
                found = replace(family, branches=(branch,)).points(count, rng)
                self._take(number, branch, found * watched.weight)

    def _take(self, family: int, branch: Branch, X: Array) -> None:
        joints = branch.involved
        old = self._groups.get((family, joints), np.zeros((0, len(joints))))
        points = self._folded(X)[:, list(joints)]
        self._groups[family, joints] = np.concatenate([old, points])

    def add(self, X: Array, families: Ints) -> None:
        """Take points X (N, n) of families (N,), known by their number; -1 is none."""
        for x, number in zip(X, families, strict=True):
            if number >= 0:
                family = self.watched.families[int(number)]
                branch = _branch_of(family, x / self.watched.weight)
                if branch is not None:
                    self._take(int(number), branch, x[None])

    def each(self, X: Array, half: Array | float = 0.0) -> Array:
        """No point of boxes around X (N, n), ``half`` (N, n) to each side, is farther: (N, F)."""
        X, half = self._folded(X), np.broadcast_to(half, X.shape)
        out = np.full((len(X), len(self.watched.families)), np.inf)
        for (family, joints), points in self._groups.items():
            total = np.zeros((len(X), len(points)))
            for k, j in enumerate(joints):
                off = np.abs(X[:, j, None] - points[:, k])
                if self.turn[j] > 0:
                    off = np.minimum(off, self.turn[j] - off)
                off += half[:, j, None]
                if self.turn[j] > 0:
                    np.minimum(off, self.turn[j] / 2, out=off)
                total += off * off
            least = np.sqrt(total.min(axis=1, initial=np.inf))
            out[:, family] = np.minimum(out[:, family], least)
        return out

    def within(self, X: Array, half: Array | float = 0.0) -> Array:
        """The same of the nearest family: (N,)."""
        return np.asarray(self.each(X, half).min(axis=1))

    def _folded(self, X: Array) -> Array:
        """Values (N, n) of turning joints within half a turn of zero."""
        turns = np.round(X / np.where(self.turn > 0, self.turn, np.inf))
        return np.asarray(X - self.turn * turns)


def _branch_of(family: Family, q: Array) -> Branch | None:
    """Branch of a family that q is on, with the fewest joints."""
    found = [b for b in family.branches if replace(family, branches=(b,)).contains(q, 1e-9).item()]
    return min(found, key=lambda b: len(b.involved), default=None)


def clearest(
    watched: Watched,
    room: Room,
    rng: np.random.Generator,
    seconds: float,
    usable: Callable[[Array], Bool],
) -> Clearest:
    """Find a point of the room with a large clearance, and how large one can be.

    Parameters
    ----------
    watched : Watched
        Some families.
    room : Room
        What there is to choose from.
    rng : np.random.Generator
        Where starts are drawn from.
    seconds : float
        Time after which what was found is returned.
    usable : callable
        Which of points (N, n) may be chosen at all.
    """
    search = _Search(watched, room, rng, time.monotonic() + seconds, usable)
    search.climb()
    search.split()
    search.settle()
    return search.best


class _Search:
    def __init__(
        self,
        watched: Watched,
        room: Room,
        rng: np.random.Generator,
        end: float,
        usable: Callable[[Array], Bool],
    ) -> None:
        self.watched, self.room, self.rng, self.end = watched, room, rng, end
        self.usable = usable
        self.sites = Sites(watched, rng)
        self.best = Clearest(room.center.copy())
        self.prove(room.center[None])

    def prove(self, X: Array) -> Array:
        """Lower bounds (N,) of the clearance at X, and sites where the nearest points are."""
        w = self.watched
        options = SearchOptions(_GAP, 1.0)
        found = nearest_points(w.conditions, X / w.weight, w.lower, w.upper, options)
        self.sites.add(found.q * w.weight, found.family)
        lower = np.where(self.usable(X / w.weight), found.lower, -np.inf)
        k = int(np.argmax(lower))
        if lower[k] > self.best.lower:
            self.best.x, self.best.lower = X[k].copy(), float(lower[k])
            self.best.upper = float(found.upper[k])
        return lower

    @property
    def over(self) -> bool:
        return time.monotonic() > self.end

    def climb(self) -> None:
        """From many starts uphill on what the sites promise, proving the best."""
        room, width = self.room, self.room.high - self.room.low
        X = room.fit(self.rng.uniform(room.low, room.high, (4096, self.watched.n)))
        promise = np.concatenate([self.sites.within(x) for x in np.array_split(X, 16)])
        X = X[np.argsort(-promise, kind="stable")[:_CLIMBERS]]
        for round_ in range(12):
            if self.over:
                return
            promise = self.sites.within(X)
            size = 0.3 * 0.8**round_
            for step in range(_STEPS):
                move = self.rng.normal(size=X.shape) * width * size * 0.85**step
                tried = room.fit(X + move)
                there = self.sites.within(tried)
                better = there > promise
                X[better], promise[better] = tried[better], there[better]
            order = np.argsort(-promise, kind="stable")
            if promise[order[0]] <= self.best.lower + _GAP:
                return
            self.prove(X[self._apart(X, order)])

    def _apart(self, X: Array, order: Ints) -> list[int]:
        """The first few that are not all in one place."""
        chosen: list[int] = []
        for i in order:
            if all(np.linalg.norm(X[i] - X[k]) > 0.1 for k in chosen):
                chosen.append(int(i))
            if len(chosen) == _TRIED:
                break
        return chosen

    def split(self) -> None:
        """Rule boxes out that promise no more than was proven; what is left bounds all."""
        room = self.room
        centers, halves = (room.low + room.high)[None] / 2, (room.high - room.low)[None] / 2
        bounds = self._promise(centers, halves)
        for _ in range(40):
            goal = max(self.best.lower, 0.0) + _GAP
            keep = bounds > goal
            centers, halves, bounds = centers[keep], halves[keep], bounds[keep]
            if not len(bounds) or self.over:
                break
            order = np.argsort(-bounds, kind="stable")
            now, later = order[:_BATCH], order[_BATCH:]
            center, half = centers[now], halves[now]
            self.prove(room.fit(center[:2]))
            rows, axis = np.arange(len(now)), np.argmax(half, axis=1)
            half[rows, axis] /= 2
            move = np.zeros_like(half)
            move[rows, axis] = half[rows, axis]
            parts, both = np.concatenate([center - move, center + move]), np.tile(half, (2, 1))
            fresh = np.minimum(self._promise(parts, both), np.tile(bounds[now], 2))
            centers = np.concatenate([centers[later], parts])
            halves = np.concatenate([halves[later], both])
            bounds = np.concatenate([bounds[later], fresh])
        goal = max(self.best.lower, 0.0) + _GAP
        self.best.most = max(goal, float(bounds.max(initial=0.0))) + _SLACK

    def _promise(self, centers: Array, halves: Array) -> Array:
        out = self.sites.within(centers, halves * (1 + 1e-12))
        if np.isfinite(self.room.reach):
            gap = np.maximum(np.abs(centers - self.room.around) - halves, 0.0)
            out = np.where(np.linalg.norm(gap, axis=1) > self.room.reach + _SLACK, -np.inf, out)
        return out

    def settle(self) -> None:
        """Farther from the other families too, and to where joints are preferred, at no cost."""
        if not np.isfinite(self.best.lower) or self.over:
            return
        enough, width = self.best.lower - _GAP, self.room.high - self.room.low
        X = np.repeat(self.best.x[None], _CLIMBERS, axis=0)
        value = self._worth(X, -np.inf)
        for step in range(3 * _STEPS):
            scale = 0.5 * 0.93**step
            one = self.rng.integers(2, size=X.shape)  # some joints at a time
            tried = self.room.fit(X + one * self.rng.normal(size=X.shape) * width * scale)
            there = self._worth(tried, enough)
            better = there > value
            X[better], value[better] = tried[better], there[better]
        for i in np.argsort(-value, kind="stable")[:_TRIED]:
            kept = replace(self.best)
            self.best.lower = -np.inf
            if self.prove(X[i][None])[0] >= enough:
                return
            self.best = kept

    def _worth(self, X: Array, enough: float) -> Array:
        each = self.sites.each(X)
        off = np.linalg.norm(X - self.room.center, axis=1)
        # Of clearance that is given for being nearer to where joints are preferred.
        return np.where(each.min(axis=1) >= enough, each.sum(axis=1) - 0.05 * off, -np.inf)
