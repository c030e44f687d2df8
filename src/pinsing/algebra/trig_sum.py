"""One trigonometric sum: value, gradient, bounds, and how far its zeros are, with proof.

``f(x) = sum_t amplitude_t prod_j x_j^power_tj cos(phase_t + sum_j rate_tj x_j)``.

With g the gradient at x and M a bound of the second derivatives, Taylor's theorem gives
``|f| >= |f(x)| - |g| r - M r^2 / 2`` within r of x: no zero is nearer than
``2 |f| / (|g| + sqrt(|g|^2 + 2 M |f|))``. Rounding is bounded and taken off. Several sums are
bounded one by one, and by the sum of multiples of them that the least-norm step to their linearised
zeros has. Exported guards in Python hold what follows the imports: it needs NumPy alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from pinsing.measures import Array, ArrayLike

TINY = 1e-300
COMBINED = 12  # sums of a branch that are combined into one bound


class At(NamedTuple):
    """A sum at points: value (N,), gradient (N, n), and bounds of their errors (N,)."""

    value: Array
    gradient: Array
    error: Array
    slope_error: Array


class TrigSum:
    """One trigonometric sum in weighted coordinates.

    ``noise + 4.5e-16 reach max(4, |x|)`` bounds the error of a computed value, relative to the
    terms. ``largest``: the metric is the largest difference, else the Euclidean one.
    """

    def __init__(
        self,
        amplitude: ArrayLike,
        phase: ArrayLike,
        rate: ArrayLike,
        power: ArrayLike,
        noise: float,
        largest: bool = False,
    ) -> None:
        self.amplitude, self.phase = np.array(amplitude, float), np.array(phase, float)
        self.rate, self.power = np.array(rate, float), np.array(power, int)
        self.noise, self.largest = noise, largest
        self.slides = np.flatnonzero(self.power.any(axis=0))
        self.used = np.flatnonzero((self.rate != 0).any(axis=0) | self.power.any(axis=0))
        self.reach = float(np.abs(self.rate).sum(axis=1).max(initial=0.0)) + 1.0
        norm = self.dual(self.rate)
        self.rate_norm = norm * (1 + 1e-14)
        # Bounds of the first and second derivatives where no powers occur.
        self.steepness = self.curvature = 0.0
        if not len(self.slides):
            self.steepness = float(self.amplitude @ norm) * (1 + 1e-12)
            gram = (self.rate.T * self.amplitude) @ self.rate
            bend = self.amplitude @ norm**2 if largest else np.linalg.eigvalsh(gram)[-1]
            self.curvature = float(bend) * (1 + 1e-12)

    def dual(self, g: Array) -> Array:
        """Size (N,) of gradients (N, n): the most by which a unit step changes a sum."""
        return np.asarray(np.abs(g).sum(axis=1) if self.largest else np.linalg.norm(g, axis=1))

    def __call__(self, x: Array) -> Array:
        """Values at x (..., n): (...)."""
        return self.at(x.reshape(-1, x.shape[-1])).value.reshape(x.shape[:-1])

    def at(self, X: Array, far: Array | float = 4.0) -> At:
        """Evaluate at X (N, n), to which a rounding of 4.5e-16 ``far`` was done."""
        angle = X[:, self.used] @ self.rate[:, self.used].T + self.phase
        cosine, size = np.cos(angle), self._products(X)
        gradient = -(size * np.sin(angle)) @ self.rate
        steep = np.full(len(X), self.steepness)
        if len(self.slides):
            steep = np.abs(size) @ self.rate_norm
        for j in self.slides.tolist():
            lowered = self.power[:, j] * self._products(X, j)
            gradient[:, j] += (lowered * cosine).sum(axis=1)
            steep = steep + np.abs(lowered).sum(axis=1)
        far = np.maximum(np.maximum(far, 4.0), np.abs(X[:, self.used]).max(axis=1, initial=0.0))
        relative = self.noise + 4.5e-16 * self.reach * far
        value, sizes = (size * cosine).sum(axis=1), np.abs(size).sum(axis=1)
        return At(value, gradient, sizes * relative, steep * relative)

    def _products(self, X: Array, less: int = -1) -> Array:
        """Amplitudes times powers (N, T), the exponent of one joint lowered by one."""
        out = np.broadcast_to(self.amplitude, (len(X), len(self.amplitude)))
        for j in self.slides:
            out = out * X[:, j, None] ** np.maximum(self.power[:, j] - (j == less), 0)
        return out

    def sizes(self, most: Array) -> Array:
        """Bounds (N, T) of the terms where |x| <= ``most`` (N, n)."""
        return self._products(np.maximum(most, 1e-150))

    def bend(self, most: Array, swing: Array, step: Array) -> Array:
        """Bound (N,) of the second derivative along a step where |x| <= ``most`` (N, n).

        ``swing`` (N, T) or (T,) bounds what the step adds to the angles, ``step`` (N, n) its size.
        """
        first, squares = np.zeros((len(most), 1)), np.zeros((len(most), 1))
        for j in self.slides:
            share = step[:, j, None] / np.maximum(most[:, j, None], 1e-150)
            first = first + self.power[:, j] * share
            squares = squares + self.power[:, j] * share**2
        second = first**2 if self.largest else np.maximum(first**2 - squares, 0.0)
        total = (self.sizes(most) * (swing**2 + 2 * swing * first + second)).sum(axis=1)
        return np.asarray(total * (1 + 1e-12))

    def bend_within(self, X: Array, radius: Array) -> Array:
        """Bound (N,) of the second derivatives within ``radius`` (N,) of X (N, n)."""
        if not len(self.slides):
            return np.full(len(X), self.curvature)
        return self.bend(np.abs(X) + radius[:, None], self.rate_norm, np.ones_like(X))


def to_zeros(sums: Sequence[TrigSum], at: Sequence[At], X: Array) -> Array:
    """Proven distance (N,) of X (N, n) to where all sums are zero, given these ``at`` X."""
    best = np.zeros(len(X))
    for s, a in zip(sums, at):  # noqa: B905 - guards run on Python 3.8, too
        left, slope = np.abs(a.value) - a.error, s.dual(a.gradient) + a.slope_error
        best = np.maximum(best, _clear(left, slope, partial(s.bend_within, X)))
    if len(sums) > 1:
        sums, at = sums[:COMBINED], at[:COMBINED]
        value, g = (np.stack([a[k] for a in at], axis=1) for k in (0, 1))
        multiple = least_norm(g, value)
        size = np.abs(multiple)
        error, slope_error = (
            (size * np.stack([a[k] for a in at], axis=1)).sum(axis=1) for k in (2, 3)
        )
        error = error + 1e-14 * (size * np.abs(value)).sum(axis=1)
        left = np.abs((multiple * value).sum(axis=1)) - error
        slope = sums[0].dual((multiple[..., None] * g).sum(axis=1)) + slope_error

        def bend(radius: Array) -> Array:
            bends = np.stack([s.bend_within(X, radius) for s in sums], axis=1)
            return np.asarray((size * bends).sum(axis=1))

        joined = _clear(left, slope, bend)
        best = np.maximum(best, np.where(np.isfinite(joined), joined, 0.0))
    return best


def least_norm(g: Array, value: Array) -> Array:
    """Multiples (N, k) of gradients (N, k, n) that the least-norm step to their zeros has."""
    gram = np.einsum("nij,nkj->nik", g, g)
    ridge = 1e-13 * np.trace(gram, axis1=1, axis2=2) + TINY
    gram = gram + ridge[:, None, None] * np.eye(gram.shape[1])
    usable = np.isfinite(gram).all(axis=(1, 2)) & np.isfinite(value).all(axis=1)
    multiple = np.zeros_like(value)
    multiple[usable] = np.linalg.solve(gram[usable], value[usable][..., None])[..., 0]
    return np.where(np.abs(multiple) < 1e200, multiple, 0.0)


def _clear(left: Array, slope: Array, bend: Callable[[Array], Array]) -> Array:
    """Radius within which Taylor's theorem allows no zero; squares of huge slopes overflow."""
    left = np.where(left > 0, left, 0.0)  # and not NaN
    radius = np.minimum(left / np.maximum(slope, TINY), 1e3)
    root = np.hypot(slope, np.sqrt(2 * (bend(radius) * left)))
    found = np.minimum(2 * left / np.maximum(slope + root, TINY) * (1 - 8e-15), radius)
    return np.where(found > 0, found, 0.0)


def off_values(X: Array, values: Array, turn: Array) -> tuple[Array, Array]:
    """Differences of X (N, k) from joint values (k,) modulo whole turns, and their error (N,)."""
    turns = np.round((X - values) / np.where(turn > 0, turn, np.inf))
    size = (np.abs(X) + np.abs(values) + turn).max(axis=1, initial=0.0)
    return X - values - turn * turns, 4.5e-16 * size * len(values)
