"""Two-sided bounds of the clearance of many configurations.

With f an equation, g its gradient at x and M a bound of its second derivatives, Taylor's theorem
gives ``|f| >= |f(x)| - |g| r - M r^2 / 2`` within r of x, so that

- lower = 2 |f| / (|g| + sqrt(|g|^2 + 2 M |f|)): no zero is nearer;
- upper = 2 |f| / (|g| + sqrt(|g|^2 - 2 M |f|)), where real: a zero is reached along g.

Rounding is bounded and taken off (added), so that both are true in floating point. Several
equations are bounded one by one, and by the sum of multiples of them that the least-norm step to
their linearised zeros has.
"""

from __future__ import annotations

import numpy as np

from pinsing._batch import engine
from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
from pinsing.algebra.conditions import Conditions

_TINY = 1e-300
_WIDEST = 1e3
_COMBINED = 12
_CHUNK = 16384


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of the distance to the nearest family, and to each.

    Attributes
    ----------
    lower, upper : (N,) arrays
        In weighted coordinates; infinite where there is no family, or no bound.
    family : (N,) array of int
        The one of the least lower bound; -1 without any.
    each : (N, F, 2) array or None
        Lower and upper bound of each family.
    """

    lower: Array
    upper: Array
    family: Ints
    each: Array | None


def two_sided(
    conditions: Conditions,
    Q: Array,
    *,
    each: bool = False,
    compiled: bool = True,
    threads: int | None = None,
    isa: str | None = None,
) -> Bounds:
    """Bounds of the distance of Q (N, n) from conditions.

    Parameters
    ----------
    conditions : Conditions
        The families.
    Q : (N, n) array
        Joint values, finite.
    each : bool
        Whether the bounds of every family are wanted too.
    compiled : bool
        Whether the compiled engine is used where there is one.
    threads : int, optional
        Threads of the compiled engine; as many as there are processors.
    isa : str, optional
        Instruction set of the compiled engine, for the same bits on every machine; the best
        one here by default.
    """
    X = conditions.scaled(Q)
    handle = conditions.compiled() if compiled else None
    N, F = len(X), conditions.families
    every = np.empty((N, F, 2) if each or handle is None else (0, 0, 2))
    lower, upper, family = np.empty(N), np.empty(N), np.empty(N, dtype=np.int64)
    if handle is not None:
        count = 1 if N < 4096 else threads or engine.cpu_count()
        handle.clearances(X, lower, upper, family, every, isa or engine.isa_names()[-1], count)
        return Bounds(lower, upper, family, every if each else None)
    for first in range(0, N, _CHUNK):
        every[first : first + _CHUNK] = _each(conditions, X[first : first + _CHUNK])
    if F == 0:
        lower, upper, family = np.full(N, np.inf), np.full(N, np.inf), np.full(N, -1)
    else:
        family = np.argmin(every[..., 0], axis=1)
        lower, upper = every[..., 0].min(axis=1), every[..., 1].min(axis=1)
        family = np.where(np.isfinite(lower), family, -1)
    return Bounds(lower, upper, family, every if each else None)


def _each(c: Conditions, X: Array) -> Array:
    out = np.full((len(X), c.families, 2), np.inf)
    for b in range(c.branches):
        lower, upper = np.zeros(len(X)), np.zeros(len(X))
        if c.value_start[b] < c.value_start[b + 1]:
            lower, upper = _of_values(c, b, X)
        if c.equation_start[b] < c.equation_start[b + 1]:
            part_lower, part_upper = _of_equations(c, b, X)
            lower = _joined(c, lower, part_lower) * (1 - 1e-15)
            upper = _joined(c, upper, part_upper) * (1 + 1e-15)
        f = c.family[b]
        out[:, f, 0] = np.minimum(out[:, f, 0], lower)
        out[:, f, 1] = np.minimum(out[:, f, 1], upper)
    return out


def _joined(c: Conditions, a: Array, b: Array) -> Array:
    return np.asarray(np.maximum(a, b) if c.norm == "max" else np.hypot(a, b))


def _of_values(c: Conditions, b: int, X: Array) -> tuple[Array, Array]:
    these = slice(c.value_start[b], c.value_start[b + 1])
    joints, values = c.value_joint[these], c.value[these]
    turn = c.turn[joints]
    off = X[:, joints] - values
    off = off - turn * np.round(off / np.where(turn > 0, turn, np.inf))
    total = np.abs(off).max(axis=1) if c.norm == "max" else np.linalg.norm(off, axis=1)
    size = (np.abs(X[:, joints]) + np.abs(values) + turn).max(axis=1)
    slack = 4.5e-16 * size * len(joints) + 1e-15 * total
    return np.maximum(total - slack, 0.0), total + slack


@dataclass(frozen=True, eq=False)
class Sum:
    """An equation at points: value (N,), gradient (N, n), and their errors (N,)."""

    value: Array
    gradient: Array
    error: Array
    slope_error: Array


def sum_at(c: Conditions, e: int, X: Array) -> Sum:
    """Equation ``e`` of conditions, and its gradient, at weighted points X (N, n)."""
    value, size = np.zeros(len(X)), np.zeros(len(X))
    gradient = np.zeros_like(X)
    steep = np.full(len(X), c.steepness[e])
    farthest = np.full(len(X), 4.0)
    for t in range(c.term_start[e], c.term_start[e + 1]):
        rates = slice(c.rate_start[t], c.rate_start[t + 1])
        joints, rate = c.rate_joint[rates], c.rate[rates]
        angle = c.phase[t] + X[:, joints] @ rate
        farthest = np.maximum(farthest, np.abs(X[:, joints]).max(axis=1, initial=0.0))
        powers = slice(c.power_start[t], c.power_start[t + 1])
        slides, exponents = c.power_joint[powers], c.power[powers]
        power = c.amplitude[t] * np.prod(X[:, slides] ** exponents, axis=1)
        cosine = np.cos(angle)
        value += power * cosine
        size += np.abs(power)
        gradient[:, joints] -= (power * np.sin(angle))[:, None] * rate
        if c.sliding[e]:
            steep = steep + np.abs(power) * c.rate_norm[t]
        for k, j in enumerate(slides):
            less = exponents - (np.arange(len(slides)) == k)
            lowered = c.amplitude[t] * exponents[k] * np.prod(X[:, slides] ** less, axis=1)
            gradient[:, j] += lowered * cosine
            steep = steep + np.abs(lowered)
    relative = c.noise[e] + 4.5e-16 * c.reach[e] * farthest
    return Sum(value, gradient, size * relative, steep * relative)


def curvature_within(c: Conditions, e: int, X: Array, radius: Array) -> Array:
    """Bound (N,) of the second derivatives of an equation within ``radius`` (N,) of X (N, n)."""
    if not c.sliding[e]:
        return np.full(len(X), c.curvature[e])
    total = np.zeros(len(X))
    for t in range(c.term_start[e], c.term_start[e + 1]):
        powers = slice(c.power_start[t], c.power_start[t + 1])
        a = np.maximum(np.abs(X[:, c.power_joint[powers]]) + radius[:, None], 1e-150)
        p = c.power[powers]
        size = abs(c.amplitude[t]) * np.prod(a**p, axis=1)
        first, squares = (p / a).sum(axis=1), (p / a**2).sum(axis=1)
        rest = 0.0 if c.norm == "max" else squares
        r = c.rate_norm[t]
        total += size * (r * r + 2 * r * first + np.maximum(first**2 - rest, 0.0))
    return np.asarray(total * (1 + 1e-12))


def _dual(c: Conditions, g: Array) -> Array:
    return np.asarray(np.abs(g).sum(axis=1) if c.norm == "max" else np.linalg.norm(g, axis=1))


def _no_nearer(value: Array, slope: Array, curvature: Array) -> Array:
    root = np.hypot(slope, np.sqrt(2 * (curvature * value)))  # squares of huge slopes overflow
    return np.asarray(2 * value / np.maximum(slope + root, _TINY) * (1 - 8e-15))


@np.errstate(over="ignore")  # a quotient that overflows is a distance farther than any other
def _of_equations(c: Conditions, b: int, X: Array) -> tuple[Array, Array]:
    numbers = range(c.equation_start[b], c.equation_start[b + 1])
    sums = [sum_at(c, e, X) for e in numbers]
    lower, upper = np.zeros(len(X)), np.full(len(X), np.inf)
    for e, s in zip(numbers, sums, strict=True):
        slope = _dual(c, s.gradient)
        nearest = np.maximum(np.abs(s.value) - s.error, 0.0)
        radius = np.minimum(nearest / np.maximum(slope + s.slope_error, _TINY), _WIDEST)
        bound = _no_nearer(nearest, slope + s.slope_error, curvature_within(c, e, X, radius))
        lower = np.maximum(lower, np.minimum(bound, radius))
        if len(sums) == 1:
            upper = _reached(c, e, X, np.abs(s.value) + s.error, slope - s.slope_error)
    if len(sums) > 1:
        lower = np.maximum(lower, _combined(c, list(numbers)[:_COMBINED], X, sums[:_COMBINED]))
    return lower, upper


def _reached(c: Conditions, e: int, X: Array, value: Array, slope: Array) -> Array:
    """Distance by which a zero is reached along the gradient; infinite where it need not be."""
    within = np.minimum(2 * value / np.maximum(slope, _TINY), _WIDEST)
    least = np.sqrt(2 * (curvature_within(c, e, X, within) * value))
    # The root of slope^2 - least^2: squares of huge slopes overflow.
    root = np.sqrt(np.maximum(slope - least, 0.0)) * np.sqrt(np.maximum(slope + least, 0.0))
    found = 2 * value / np.maximum(slope + root, _TINY) * (1 + 8e-15)
    good = (slope >= least) & (slope > 0) & (found <= within * (1 + 1e-9))
    return np.where(good, found, np.inf)


def _combined(c: Conditions, numbers: list[int], X: Array, sums: list[Sum]) -> Array:
    value = np.stack([s.value for s in sums], axis=1)
    g = np.stack([s.gradient for s in sums], axis=1)
    gram = g @ g.transpose(0, 2, 1)
    ridge = 1e-13 * np.trace(gram, axis1=1, axis2=2) + _TINY
    gram = gram + ridge[:, None, None] * np.eye(len(sums))
    with np.errstate(all="ignore"):
        multiple = np.nan_to_num(np.linalg.solve(gram, value[..., None])[..., 0], posinf=0.0)
    size = np.abs(multiple)
    total = np.abs((multiple * value).sum(axis=1))
    error = (size * np.stack([s.error for s in sums], axis=1)).sum(axis=1)
    slope_error = (size * np.stack([s.slope_error for s in sums], axis=1)).sum(axis=1)
    slope = _dual(c, (multiple[..., None] * g).sum(axis=1)) + slope_error
    left = np.maximum(total - error - 1e-14 * (size * np.abs(value)).sum(axis=1), 0.0)
    radius = np.minimum(left / np.maximum(slope, _TINY), _WIDEST)
    bends = np.stack([curvature_within(c, e, X, radius) for e in numbers], axis=1)
    bound = _no_nearer(left, slope, (size * bends).sum(axis=1))
    return np.asarray(np.minimum(bound, radius))
