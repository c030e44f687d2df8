"""The nearest point of conditions, with a proof that none is much nearer: by branch and bound.

The compiled engine does it. What stands here in NumPy is the plain reference, for installations
without it and arms too long for it: the same bounds in fewer kinds, so that it needs more boxes.

Two-sided bounds of many configurations are in closed form. The lower one is that of
`pinsing.algebra.trig_sum`; along the gradient g of a sum f a zero is reached within
``2 |f| / (|g| + sqrt(|g|^2 - 2 M |f|))``, where that is real: the upper one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinsing._batch import engine
from pinsing.algebra.conditions import Conditions, WeightedBranch
from pinsing.algebra.trig_sum import TINY, At, TrigSum, least_norm, off_values, to_zeros
from pinsing.arguments import whole_number
from pinsing.errors import OptionError
from pinsing.measures import Array, Ints


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of the distance to the nearest family, and to each."""

    # lower and upper: (N,): in weighted coordinates; infinite where there is no family, or no
    # bound. Lower ones less the conditions' margin
    lower: Array
    upper: Array
    # (N,): the one of the least lower bound, before a margin is taken off; -1 without any
    family: Ints
    each: Array  # (N, F, 2): lower and upper bound of each family; (0, 0, 2) unless asked for
    # (N, F, n): weighted coordinates of points; families are no farther from them than upper bounds
    # are longer than the ways there. (0, F, n) unless asked for
    points: Array


def two_sided(
    conditions: Conditions,
    Q: Array,
    *,
    each: bool = False,
    compiled: bool = True,
    threads: int | None = None,
    isa: str | None = None,
    points: bool = False,
) -> Bounds:
    """Return distance bounds of finite Q (N, n) from conditions, or ``each`` family's.

    With ``points`` upper ones are closer where the engine is compiled.
    """
    # ``isa`` is an instruction set of the compiled engine, for the same bits on every machine.
    X = conditions.scaled(Q)
    handle = conditions.compiled if compiled else None
    N, F = len(X), conditions.families
    every = np.empty((N, F, 2) if each or handle is None else (0, 0, 2))
    lower, upper, family = np.empty(N), np.empty(N), np.empty(N, dtype=np.int64)
    near = np.repeat(X[: N if points else 0, None], F, axis=1)
    margin = conditions.margin
    if margin is not None:
        found = two_sided(
            conditions.plain, Q, each=True, compiled=compiled, threads=threads, isa=isa
        )
        family = _nearest(found.each)[2]
        found.each[..., 0] = margin.take_off(Q, found.each)
        return replace(found, lower=found.each[..., 0].min(axis=1, initial=np.inf), family=family)
    if handle is not None:
        count = 1 if N < 4096 else threads or engine.cpu_count()
        handle.clearances(
            X, lower, upper, family, every, near, isa or engine.isa_names()[-1], count
        )
        return Bounds(lower, upper, family, every, near)
    rows = max(1, 2_000_000 // max((len(s.amplitude) for s in conditions.sums), default=1))
    for first in range(0, N, rows):
        every[first : first + rows] = _each(conditions, X[first : first + rows])
    return Bounds(*_nearest(every), every, near)


def _nearest(each: Array) -> tuple[Array, Array, Ints]:
    lower, upper = (each[..., k].min(axis=1, initial=np.inf) for k in (0, 1))
    family = np.argmin(each[..., 0], axis=1) if each.shape[1] else np.full(len(each), -1)
    return lower, upper, np.where(np.isfinite(lower), family, -1)


@np.errstate(over="ignore")  # a quotient that overflows is a distance farther than any other
def _each(c: Conditions, X: Array) -> Array:
    out = np.full((len(X), c.families, 2), np.inf)
    for branch in c.branches:
        lower, upper = _of_values(c, branch, X)
        if branch.sums:
            at = [s.at(X) for s in branch.sums]
            reached = (
                _reached(branch.sums[0], X, at[0]) if len(at) == 1 else np.full(len(X), np.inf)
            )
            lower = c.joined(lower, to_zeros(branch.sums, at, X)) * (1 - 1e-15)
            upper = c.joined(upper, reached) * (1 + 1e-15)
        here = out[:, branch.family]
        np.minimum(here, np.stack([lower, upper], axis=1), out=here)
    return out


def _of_values(c: Conditions, branch: WeightedBranch, X: Array) -> tuple[Array, Array]:
    joints = branch.joints
    off, slack = off_values(X[:, joints], branch.values, c.turn[joints])
    total = c.size(off)
    slack = slack + 1e-15 * total
    return np.maximum(total - slack, 0.0), total + slack


def _reached(s: TrigSum, X: Array, at: At) -> Array:
    """Distance by which a zero is reached along the gradient; infinite where it need not be."""
    value, slope = np.abs(at.value) + at.error, s.dual(at.gradient) - at.slope_error
    within = np.minimum(2 * value / np.maximum(slope, TINY), 1e3)
    least = np.sqrt(2 * (s.bend_within(X, within) * value))
    # The root of slope^2 - least^2: squares of huge slopes overflow.
    root = np.sqrt(np.maximum(slope - least, 0.0)) * np.sqrt(np.maximum(slope + least, 0.0))
    found = 2 * value / np.maximum(slope + root, TINY) * (1 + 8e-15)
    return np.where((slope >= least) & (slope > 0) & (found <= within * (1 + 1e-9)), found, np.inf)


GAP = 1e-6
"""Upper less lower bound at which a search ends."""

BOXES = 300_000
"""Boxes for one configuration: half a second of the compiled search. Arms of the catalogue take up
to 10,000 for the default gap."""


@dataclass(frozen=True)
class SearchOptions:
    """How far, and among which points, the nearest one is searched."""

    gap: float = GAP  # upper less lower bound at which a search may end, in weighted coordinates
    # boxes looked at for one configuration; after them the bounds reached so far are returned
    boxes: int = BOXES
    # whether only points within the joint limits count. Otherwise revolute differences are wrapped,
    # and all values of prismatic joints allowed
    within_limits: bool = False

    def __post_init__(self) -> None:
        OptionError.refuse_if(not self.gap > 0, f"gap must be positive, got {self.gap!r}")
        whole_number(self.boxes, "boxes", 1, 10**12)


@dataclass(frozen=True, eq=False)
class Nearest:
    """Nearest points of conditions."""

    # lower and upper: (N,): no point is nearer than ``lower``, one was found at ``upper``; weighted
    # coordinates. Both are infinite where there is proven to be none; ``upper`` alone where none
    # was found
    lower: Array
    upper: Array
    family: Ints  # (N,): family of the point found, -1 without any
    q: Array  # (N, n): the points found, joint values
    boxes: Ints  # (N,): boxes looked at


def nearest_points(
    conditions: Conditions,
    Q: Array,
    lower: Array,
    upper: Array,
    options: SearchOptions,
    *,
    compiled: bool = True,
) -> Nearest:
    """Return nearest points of conditions to finite Q (N, n), by best-first branch and bound."""
    # Joint limits are (n,), or (families, n), infinite where there are none.
    margin = conditions.margin
    if margin is not None:
        # What is within the limits may be near to points of conditions that are not.
        off = min(max(margin.meeting, margin.near), 2 * np.pi) / conditions.weight
        limits = lower - off, upper + off
        plain = nearest_points(conditions.plain, Q, *limits, options, compiled=compiled)
        each = two_sided(conditions.plain, Q, each=True, compiled=compiled).each
        each[..., 0] = np.maximum(each[..., 0], plain.lower[:, None])
        least = margin.take_off(Q, each).min(axis=1, initial=np.inf)
        return replace(plain, lower=np.minimum(least, plain.upper))
    X = conditions.scaled(Q)
    N, n = X.shape
    low = np.ascontiguousarray(np.asarray(lower, dtype=float) * conditions.weight)
    high = np.ascontiguousarray(np.asarray(upper, dtype=float) * conditions.weight)
    far = 100.0 + float(np.abs(X).max(initial=0.0))  # how far slides without limits are searched
    least, most, points = np.full(N, np.inf), np.full(N, np.inf), X.copy()
    family, boxes = np.full(N, -1, dtype=np.int64), np.empty(N, dtype=np.int64)
    handle = conditions.compiled if compiled else None
    if handle is not None:
        found = (least, most, family, boxes, points, engine.cpu_count())
        how = options.within_limits, far, options.gap, options.boxes
        handle.nearest(X, low, high, *how, *found)
    else:
        low, high = (np.broadcast_to(x, (conditions.families, n)) for x in (low, high))
        search = _NearestSearch(conditions, low, high, far, options)
        for i, x in enumerate(X):
            least[i], most[i], family[i], points[i], boxes[i] = search.nearest(x)
    return Nearest(least, most, family, points / conditions.weight, boxes)


@dataclass(frozen=True, eq=False)
class _NearestSearch:
    """Conditions, and limits (families, n) in weighted coordinates."""

    c: Conditions
    lower: Array
    upper: Array
    far: float
    options: SearchOptions

    def nearest(self, x: Array) -> tuple[float, float, int, Array, int]:
        """Lower and upper bound of the distance of x (n,), family and point found, and boxes."""
        lower, upper, family, point = np.inf, np.inf, -1, x
        looked = 0
        slack = 1e-15 * (1 + float(np.abs(x).max(initial=0.0)) + 2 * np.pi) * (self.c.n + 1)
        starts = []
        for k, branch in enumerate(self.c.branches):
            target = self._put(branch, x)
            if target is not None:
                starts.append((float(self.c.size(target - x)), k, target))
        for fixed, k, target in sorted(starts, key=lambda s: s[:2]):
            branch, part = self.c.branches[k], max(fixed - slack, 0.0)
            if fixed >= upper:
                lower = min(lower, part)
            elif not branch.sums:
                lower, upper, family, point = min(lower, part), fixed, branch.family, target
            else:
                left = float(np.sqrt(max(upper**2 - fixed**2, 0.0)))
                room = left if np.isfinite(upper) and self.c.norm != "max" else upper
                boxes = _Boxes(self, branch, x, room)
                looked += boxes.run(self.options.boxes - looked)
                if boxes.point is not None:
                    upper = min(upper, float(self.c.joined(np.array(fixed), np.array(boxes.best))))
                    family, point = branch.family, np.where(boxes.used, boxes.point, target)
                if np.isfinite(boxes.proven):
                    whole = float(self.c.joined(np.array(part), np.array(boxes.proven)))
                    lower = min(lower, max(whole * (1 - 4e-15), 0.0))
        return min(lower, upper), upper, family, point, looked

    def _put(self, branch: WeightedBranch, x: Array) -> Array | None:
        """Put joints at their values, the nearest copies; None where the limits allow none."""
        # Joints that do not matter are put within their limits.
        lower, upper, limited = *self.limits(branch), self.options.within_limits
        out = np.where(branch.used(self.c.n), x, np.clip(x, lower, upper)) if limited else x.copy()
        for j, value in zip(branch.joints, branch.values, strict=True):
            turn, low, high = self.c.turn[j], lower[j] - 1e-9, upper[j] + 1e-9
            if turn > 0:
                value += turn * np.round((x[j] - value) / turn)
                if limited and value > high:
                    value -= turn * np.ceil((value - high) / turn)
                if limited and value < low:
                    value += turn * np.ceil((low - value) / turn)
            if limited and not low <= value <= high:
                return None
            out[j] = value
        return out

    def limits(self, branch: WeightedBranch) -> tuple[Array, Array]:
        """Limits (n,) of the family of a branch."""
        return self.lower[branch.family], self.upper[branch.family]


class _Boxes:
    """The sums of one branch, and the boxes that may hold a common zero nearer than the best."""

    def __init__(
        self, search: _NearestSearch, branch: WeightedBranch, x: Array, room: float
    ) -> None:
        self.c, self.sums, self.x, self.gap = search.c, branch.sums, x, search.options.gap
        self.best, self.point, self.proven = room, None, np.inf
        self.used = used = branch.used(self.c.n)
        lower, upper = search.limits(branch)
        below = used & search.options.within_limits & np.isfinite(lower)
        above = used & search.options.within_limits & np.isfinite(upper)
        reach = np.where(self.c.turn > 0, self.c.turn / 2, search.far)
        low, high = np.where(below, lower, x - reach), np.where(above, upper, x + reach)
        high = np.where(below & ~above, np.maximum(x, low) + 2 * reach, high)
        low = np.where(above & ~below, np.minimum(x, high) - 2 * reach, low)
        self.low, self.high = np.where(used, low, x), np.where(used, high, x)
        endless = bool((used & (self.c.turn == 0) & ~(below & above)).any())
        self.beyond = search.far if endless else np.inf

    def run(self, most: int) -> int:
        """Halve boxes, the nearest first, until the bounds are within the gap; return how many."""
        looked = 0
        self._attempt(np.clip(self.x, self.low, self.high)[None])
        if np.isfinite(self.best):
            self.beyond = np.inf
        low = np.maximum(self.low, np.where(self.used, self.x - self.best, self.x))
        high = np.minimum(self.high, np.where(self.used, self.x + self.best, self.x))
        centers, halves = ((low + high) / 2)[None], ((high - low) / 2 * (1 + 1e-15))[None]
        bounds = self._bound(centers, halves) if (low <= high).all() else np.array([np.inf])
        while True:
            done = bounds >= self.best - self.gap / 2
            self.proven = min(self.proven, float(bounds[done].min(initial=np.inf)))
            keep = np.isfinite(bounds) & ~done
            centers, halves, bounds = centers[keep], halves[keep], bounds[keep]
            if not len(bounds) or looked >= most:
                break
            order = np.argsort(bounds)
            now, later = order[:256], order[256:]
            rows, axis = np.arange(len(now)), np.argmax(halves[now], axis=1)
            narrow, move = halves[now], np.zeros((len(now), self.c.n))
            narrow[rows, axis] /= 2
            move[rows, axis] = narrow[rows, axis]
            narrow[rows, axis] *= 1 + 4e-16
            split = np.concatenate([centers[now] - move, centers[now] + move])
            both = np.tile(narrow, (2, 1))
            looked += len(split)
            fresh = np.maximum(self._bound(split, both), np.tile(bounds[now], 2))
            likely = np.argsort(fresh)[:4]
            self._attempt(split[likely[np.isfinite(fresh[likely])]])
            centers = np.concatenate([centers[later], split])
            halves = np.concatenate([halves[later], both])
            bounds = np.concatenate([bounds[later], fresh])
        self.proven = min(self.proven, float(bounds.min(initial=np.inf)), self.best, self.beyond)
        return looked

    def _bound(self, centers: Array, halves: Array) -> Array:
        """Lower bounds (N,) of the distance to the set within boxes; infinite where it is empty."""
        near = np.clip(self.x, centers - halves, centers + halves)
        out = self.c.size((near - self.x)[:, self.used]) * (1 - 4e-15)
        at = [s.at(centers) for s in self.sums]
        rests = []
        for s, a in zip(self.sums, at, strict=True):
            swing = halves @ np.abs(s.rate).T
            rests.append(0.5 * s.bend(np.abs(centers) + halves, swing, halves) + 2 * a.error)
            out = np.maximum(out, self._slab(centers, halves, a.value, a.gradient, rests[-1]))
        if len(at) > 1:  # and the sum of multiples that the least-norm step has
            value, g = (np.stack([a[k] for a in at], axis=1) for k in (0, 1))
            m = least_norm(g, value + np.einsum("nij,nj->ni", g, near - centers))
            rest = (np.abs(m) * (np.stack(rests, axis=1) + 1e-15 * np.abs(value))).sum(axis=1)
            g, value = (m[..., None] * g).sum(axis=1), (m * value).sum(axis=1)
            out = np.maximum(out, self._slab(centers, halves, value, g, rest))
        return out

    def _slab(self, centers: Array, halves: Array, value: Array, g: Array, rest: Array) -> Array:
        """Distance (N,) to {|value + g (y - center)| <= rest}; infinite where no box meets it."""
        there = value + (g * (self.x - centers)).sum(axis=1)
        size = np.abs(value) + (np.abs(g) * (np.abs(self.x) + np.abs(centers))).sum(axis=1)
        outside = np.abs(there) - rest - 4e-16 * (self.c.n + 2) * size
        far = np.maximum(outside, 0.0) / np.maximum(self.sums[0].dual(g), TINY) * (1 - 4e-15)
        reach = rest + (np.abs(g) * halves).sum(axis=1)
        return np.where(np.abs(value) > reach * (1 + 1e-14), np.inf, far)

    def _attempt(self, x: Array) -> None:
        """Descend from starts x (N, n) to points of the set that are near, and keep the nearest."""
        if not len(x):
            return
        for iteration in range(60):
            residual, A = self._system([s.at(x) for s in self.sums])
            relax = 0.5 ** (iteration // 12) if iteration < 48 else 0.0
            pull = relax * (self.x - x) * self.used
            free = np.ones(x.shape, dtype=bool)
            for _ in range(2):  # a joint at its limit is held where it would leave
                step = _step(np.where(free[:, None], A, 0.0), residual, np.where(free, pull, 0.0))
                step = np.where(free, step, 0.0)
                free &= (np.clip(x + step, self.low, self.high) != x) | (step == 0)
            size = np.abs(step).max(axis=1, keepdims=True)
            x = x + step * np.minimum(1.0, 0.6 / np.maximum(size, TINY))
            x = np.clip(x, self.low, self.high)
        residual, _ = self._system([s.at(x) for s in self.sums])
        off = self.c.size((x - self.x)[:, self.used])
        off = np.where(np.abs(residual).max(axis=1) <= 1e-12, off, np.inf)
        k = int(np.argmin(off))
        if off[k] < self.best:
            self.best, self.point = float(off[k]), x[k]

    def _system(self, at: list[At]) -> tuple[Array, Array]:
        """Residuals (N, k) and their slopes (N, k, n), each over the size of its sum."""
        size = [float(s.amplitude.sum()) * max(1.0, s.noise * 1e13) for s in self.sums]
        values = np.stack([a.value / u for a, u in zip(at, size, strict=True)], axis=1)
        slopes = np.stack([a.gradient / u for a, u in zip(at, size, strict=True)], axis=1)
        return values, slopes * self.used


def _step(A: Array, residual: Array, pull: Array) -> Array:
    """Least-norm steps (N, n) to linearised zeros, and what of the pull is along these."""
    pinv = np.linalg.pinv(A, rcond=1e-9)
    change = residual + np.einsum("nij,nj->ni", A, pull)
    return np.asarray(pull - np.einsum("nij,nj->ni", pinv, change))
