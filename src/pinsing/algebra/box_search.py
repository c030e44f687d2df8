"""Branch and bound for the nearest point of conditions, on NumPy arrays.

What the compiled engine does, for installations without it: many boxes at a time, and slower.
"""

from __future__ import annotations

import time

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import Sum, sum_at

_BATCH = 256
_ON = 1e-12
_STEPS = 60


@dataclass(frozen=True)
class Limits:
    """Limits (families, n) in weighted coordinates, and whether they count."""

    lower: Array
    upper: Array
    count: bool
    far: float


@dataclass
class Best:
    """What is known of one configuration so far."""

    x: Array
    lower: float = np.inf
    upper: float = np.inf
    family: int = -1
    boxes: int = 0


def search(c: Conditions, x: Array, limits: Limits, gap: float, seconds: float) -> Best:
    """Nearest point of conditions to x (n,), all in weighted coordinates."""
    best = Best(x.copy())
    end = time.monotonic() + seconds
    targets = [(_put(c, b, x, limits), b) for b in range(c.branches)]
    found = [(float(_norm(c, t - x)), b, t) for t, b in targets if t is not None]
    for fixed, b, target in sorted(found, key=lambda item: item[:2]):
        slack = 1e-15 * (1 + float(np.abs(x).max(initial=0.0)) + 2 * np.pi) * (c.n + 1)
        if fixed >= best.upper or c.equation_start[b] == c.equation_start[b + 1]:
            best.lower = min(best.lower, max(fixed - slack, 0.0))
            if fixed < best.upper:
                best.x, best.upper, best.family = target, fixed, int(c.family[b])
            continue
        _Boxes(c, b, x, limits, fixed, best).run(target, gap, end, slack)
    best.lower = min(best.lower, best.upper)
    return best


def _norm(c: Conditions, off: Array) -> Array:
    largest = c.norm == "max"
    return np.asarray(np.abs(off).max(axis=-1) if largest else np.linalg.norm(off, axis=-1))


def _put(c: Conditions, b: int, x: Array, limits: Limits) -> Array | None:
    """Put joints at their values, the nearest copies; None where the limits allow none.

    Joints that do not matter are put within their limits.
    """
    lower, upper = limits.lower[c.family[b]], limits.upper[c.family[b]]
    out = x.copy()
    if limits.count:
        out = np.where(_used(c, b), x, np.clip(x, lower, upper))
    for i in range(c.value_start[b], c.value_start[b + 1]):
        j, value, turn = c.value_joint[i], c.value[i], c.turn[c.value_joint[i]]
        low, high = lower[j] - 1e-9, upper[j] + 1e-9
        if turn > 0:
            value += turn * np.round((x[j] - value) / turn)
            if limits.count and value > high:
                value -= turn * np.ceil((value - high) / turn)
            if limits.count and value < low:
                value += turn * np.ceil((low - value) / turn)
        if limits.count and not low <= value <= high:
            return None
        out[j] = value
    return out


def _used(c: Conditions, b: int) -> Bool:
    """Joints (n,) that occur in the equations of a branch."""
    used = np.zeros(c.n, dtype=bool)
    for e in range(c.equation_start[b], c.equation_start[b + 1]):
        terms = slice(c.term_start[e], c.term_start[e + 1])
        for starts, joints in ((c.rate_start, c.rate_joint), (c.power_start, c.power_joint)):
            used[joints[starts[terms.start] : starts[terms.stop]]] = True
    return used


class _Boxes:
    """The equations of one branch, and the boxes that may hold a zero nearer than the best."""

    def __init__(
        self, c: Conditions, b: int, x: Array, limits: Limits, fixed: float, best: Best
    ) -> None:
        self.c, self.b, self.x, self.limits, self.fixed, self.best = c, b, x, limits, fixed, best
        self.numbers = range(c.equation_start[b], c.equation_start[b + 1])
        self.used = used = _used(c, b)
        lower, upper = limits.lower[c.family[b]], limits.upper[c.family[b]]
        below = used & limits.count & np.isfinite(lower)
        above = used & limits.count & np.isfinite(upper)
        reach = np.where(c.turn > 0, c.turn / 2, limits.far)
        low = np.where(below, lower, x - reach)
        high = np.where(above, upper, x + reach)
        high = np.where(below & ~above, np.maximum(x, low) + 2 * reach, high)
        low = np.where(above & ~below, np.minimum(x, high) - 2 * reach, low)
        self.low, self.high = np.where(used, low, x), np.where(used, high, x)
        self.cut = bool((used & (c.turn == 0) & ~(below & above)).any())

    @property
    def part(self) -> float:
        """What of the best distance is left for the equations."""
        if not np.isfinite(self.best.upper) or self.c.norm == "max":
            return self.best.upper
        return float(np.sqrt(max(self.best.upper**2 - self.fixed**2, 0.0)))

    def run(self, target: Array, gap: float, end: float, slack: float) -> None:
        c, best = self.c, self.best
        self._attempt(np.clip(self.x, self.low, self.high)[None], target)
        beyond = self.limits.far if self.cut and not np.isfinite(self.part) else np.inf
        low = np.maximum(self.low, np.where(self.used, self.x - self.part, self.x))
        high = np.minimum(self.high, np.where(self.used, self.x + self.part, self.x))
        centers, halves = ((low + high) / 2)[None], ((high - low) / 2 * (1 + 1e-15))[None]
        bounds = self._bound(centers, halves) if (low <= high).all() else np.array([np.inf])
        proven = np.inf
        while True:
            keep = np.isfinite(bounds)
            done = keep & (bounds >= self.part - gap / 2)
            proven = min(proven, float(bounds[done].min(initial=np.inf)))
            keep &= ~done
            centers, halves, bounds = centers[keep], halves[keep], bounds[keep]
            if not len(bounds) or time.monotonic() > end:
                break
            order = np.argsort(bounds)
            now, later = order[:_BATCH], order[_BATCH:]
            axis = np.argmax(halves[now], axis=1)
            rows = np.arange(len(now))
            narrow = halves[now].copy()
            narrow[rows, axis] /= 2
            move = np.zeros_like(narrow)
            move[rows, axis] = narrow[rows, axis]
            narrow[rows, axis] *= 1 + 4e-16
            split = np.concatenate([centers[now] - move, centers[now] + move])
            both = np.concatenate([narrow, narrow])
            fresh = np.maximum(self._bound(split, both), np.tile(bounds[now], 2))
            best.boxes += len(split)
            likely = np.argsort(fresh)[:4]
            self._attempt(split[likely[np.isfinite(fresh[likely])]], target)
            centers = np.concatenate([centers[later], split])
            halves = np.concatenate([halves[later], both])
            bounds = np.concatenate([bounds[later], fresh])
        proven = min(proven, float(bounds.min(initial=np.inf)), self.part, beyond)
        if np.isfinite(proven):
            pair = (max(self.fixed - slack, 0.0), proven)
            whole = max(pair) if c.norm == "max" else float(np.hypot(*pair))
            best.lower = min(best.lower, max(whole * (1 - 4e-15), 0.0))

    def _bound(self, centers: Array, halves: Array) -> Array:
        """Lower bounds (N,) of the distance to the set within boxes; infinite where it is empty."""
        near = np.clip(self.x, centers - halves, centers + halves)
        out = np.asarray(_norm(self.c, (near - self.x)[:, self.used])) * (1 - 4e-15)
        sums = [sum_at(self.c, e, centers) for e in self.numbers]
        rests = [self._rest(e, centers, halves, s) for e, s in zip(self.numbers, sums, strict=True)]
        for s, rest in zip(sums, rests, strict=True):
            slab = self._slab(centers, halves, near, s.value, s.gradient, rest)
            out = np.maximum(out, slab)
        if len(sums) > 1:
            g = np.stack([s.gradient for s in sums], axis=1)
            value = np.stack([s.value for s in sums], axis=1)
            there = value + np.einsum("nij,nj->ni", g, near - centers)
            gram = g @ g.transpose(0, 2, 1)
            ridge = 1e-13 * np.trace(gram, axis1=1, axis2=2) + 1e-300
            gram = gram + ridge[:, None, None] * np.eye(len(sums))
            multiple = np.linalg.solve(gram, there[..., None])[..., 0]
            multiple = np.where(np.abs(multiple) < 1e200, multiple, 0.0)
            rest = np.stack(rests, axis=1) + 1e-15 * np.abs(value)
            value = (multiple * value).sum(axis=1)
            rest = (np.abs(multiple) * rest).sum(axis=1)
            g = (multiple[..., None] * g).sum(axis=1)
            out = np.maximum(out, self._slab(centers, halves, near, value, g, rest))
        return out

    def _rest(self, e: int, centers: Array, halves: Array, s: Sum) -> Array:
        """How far an equation can be off its linear approximation within boxes: (N,)."""
        c = self.c
        total = np.zeros(len(centers))
        for t in range(c.term_start[e], c.term_start[e + 1]):
            rates = slice(c.rate_start[t], c.rate_start[t + 1])
            swing = halves[:, c.rate_joint[rates]] @ np.abs(c.rate[rates])
            powers = slice(c.power_start[t], c.power_start[t + 1])
            h = halves[:, c.power_joint[powers]]
            a = np.maximum(np.abs(centers[:, c.power_joint[powers]]) + h, 1e-150)
            p = c.power[powers]
            size = abs(c.amplitude[t]) * np.prod(a**p, axis=1)
            first, squares = (p * h / a).sum(axis=1), (p * (h / a) ** 2).sum(axis=1)
            total += size * (swing**2 + 2 * swing * first + np.maximum(first**2 - squares, 0.0))
        return np.asarray(0.5 * total * (1 + 1e-12) + 2 * s.error)

    def _slab(
        self, centers: Array, halves: Array, near: Array, value: Array, g: Array, rest: Array
    ) -> Array:
        """Bounds (N,) of the distance to {|value + g (x - center)| <= rest} within boxes."""
        low, high = centers - halves, centers + halves
        reach = rest + (np.abs(g) * halves).sum(axis=1)
        there = value + (g * (near - centers)).sum(axis=1)
        sign = np.where(there > 0, 1.0, -1.0)
        short = np.abs(there) - rest  # how far the nearest point of the box is outside
        size = np.abs(value) + (np.abs(g) * (np.abs(low) + np.abs(high))).sum(axis=1)
        error = 4e-16 * (self.c.n + 2) * size
        out = np.zeros(len(centers))
        if self.c.norm == "max":
            out = np.maximum(short - error, 0.0) / np.maximum(np.abs(g).sum(axis=1), 1e-300)
        else:
            # Weak duality: for any multiplier m >= 0 the least of |y - q|^2 + 2 m (excess of y),
            # over y in the box, is a bound. The best m is where the excess is zero.
            at, least, most = np.zeros(len(out)), np.zeros(len(out)), np.full(len(out), np.inf)
            for _ in range(_STEPS):
                y = np.clip(self.x - (sign * at)[:, None] * g, low, high)
                excess = sign * (value + (g * (y - centers)).sum(axis=1)) - rest
                square = ((y - self.x) ** 2).sum(axis=1) * (1 - 1e-15)
                out = np.maximum(out, square + 2 * at * (excess - error))
                inside = (y > low) & (y < high)
                slope = (g**2 * inside).sum(axis=1)
                least, most = np.where(excess > 0, at, least), np.where(excess > 0, most, at)
                step = at + excess / np.maximum(slope, 1e-300)
                middle = np.where(np.isfinite(most), (least + most) / 2, 2 * at + 1.0)
                at = np.where((slope > 0) & (step > least) & (step < most), step, middle)
                at = np.minimum(at, 1e100)
                if (np.abs(excess) <= error)[short > 0].all():
                    break
            out = np.sqrt(np.maximum(out, 0.0)) * (1 - 1e-15)
        return np.where(np.abs(value) > reach * (1 + 1e-14), np.inf, np.where(short > 0, out, 0.0))

    def _attempt(self, starts: Array, target: Array) -> None:
        """Descend from starts (N, n) to points of the set that are near, and keep the nearest."""
        if not len(starts):
            return
        x, onto = self._descend(starts.copy())
        off = np.asarray(_norm(self.c, (x - self.x)[:, self.used]))
        off = np.where(onto, off, np.inf)
        k = int(np.argmin(off))
        whole = max(off[k], self.fixed) if self.c.norm == "max" else np.hypot(off[k], self.fixed)
        if whole < self.best.upper:
            self.best.upper, self.best.family = float(whole), int(self.c.family[self.b])
            self.best.x = np.where(self.used, x[k], target)

    def _descend(self, x: Array) -> tuple[Array, Bool]:
        relax, before = np.ones(len(x)), np.zeros_like(x)
        for iteration in range(_STEPS):
            residual, A = self._system(x)
            outward = (x <= self.low) | (x >= self.high)
            pinv = np.linalg.pinv(A, rcond=1e-9)
            onto = -np.einsum("nij,nj->ni", pinv, residual)
            pull = (self.x - x) * self.used if iteration < 40 else np.zeros_like(x)
            along = pull - np.einsum("nij,nj->ni", pinv, np.einsum("nij,nj->ni", A, pull))
            turned = (along * before).sum(axis=1) < 0
            relax, before = np.where(turned, relax / 2, np.minimum(1.0, 1.1 * relax)), along
            step = onto + relax[:, None] * along
            # A joint at its limit is held for one step where it would leave.
            leaves = outward & (np.clip(x + step, self.low, self.high) == x) & (step != 0)
            if leaves.any():
                A = np.where(leaves[:, None, :], 0.0, A)
                pinv = np.linalg.pinv(A, rcond=1e-9)
                pull = np.where(leaves, 0.0, pull)
                onto = -np.einsum("nij,nj->ni", pinv, residual)
                along = pull - np.einsum("nij,nj->ni", pinv, np.einsum("nij,nj->ni", A, pull))
                step = np.where(leaves, 0.0, onto + relax[:, None] * along)
            size = np.abs(step).max(axis=1)
            x = x + step * np.minimum(1.0, 0.6 / np.maximum(size, 1e-300))[:, None]
            x = np.clip(x, self.low, self.high)
        residual, _ = self._system(x)
        return x, np.asarray(np.abs(residual).max(axis=1) <= _ON)

    def _system(self, x: Array) -> tuple[Array, Array]:
        """Residuals (N, k) and their slopes (N, k, n), each over the size of its equation."""
        sums = [sum_at(self.c, e, x) for e in self.numbers]
        size = [
            float(self.c.amplitude[self.c.term_start[e] : self.c.term_start[e + 1]].sum())
            * max(1.0, float(self.c.noise[e]) * 1e13)
            for e in self.numbers
        ]
        values = np.stack([s.value / u for s, u in zip(sums, size, strict=True)], axis=1)
        slopes = np.stack([s.gradient / u for s, u in zip(sums, size, strict=True)], axis=1)
        return values, slopes * self.used
