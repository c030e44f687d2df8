"""Proof that equations have no common zero in a box, by subdivision."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.equation import Equation

_MARGIN = 1e-8
"""Of the sum of an equation's coefficients: more than all rounding, in them and in their sums."""
_BOXES = 40_000
"""After which a proof is given up."""

Stop = Callable[[], bool]
"""Whether a search is to end with what it has; asked between its steps."""


def slopes(equation: Equation, lower: Array, upper: Array) -> Array:
    """Largest possible derivative by each joint within a box: (n,)."""
    size = np.hypot(equation.cos, equation.sin)
    bound = np.maximum(np.abs(lower), np.abs(upper))
    power = np.prod(bound**equation.powers, axis=-1)
    steep = (size * power) @ (np.abs(equation.frequencies) / 2)
    for j in np.flatnonzero(equation.powers.any(axis=0)):
        lowered = equation.powers.copy()
        factor = lowered[:, j].astype(float)
        lowered[:, j] = np.maximum(lowered[:, j] - 1, 0)
        steep[j] += size @ (factor * np.prod(bound**lowered, axis=-1))
    return np.asarray(steep)


@dataclass(frozen=True, eq=False)
class Box:
    """Boxes in which one equation has no zero.

    Attributes
    ----------
    equation : int
        Which one.
    centers, halves : (N, n) arrays
        Middles and half widths.
    """

    equation: int
    centers: Array
    halves: Array


def proven_empty(
    equations: Sequence[Equation],
    lower: Array,
    upper: Array,
    tell: Callable[[Box], None] | None = None,
    stop: Stop | None = None,
    boxes: int = _BOXES,
) -> bool:
    """Whether the equations have no common zero in a box, proven by subdivision.

    A box in which some equation is larger at the centre than its slopes allow it to change
    within holds no zero; any other is halved. Every comparison leaves room for rounding (a sum
    of thousands of terms is right to 1e-12 of their sizes). False means: not proven. ``tell`` hears
    of all boxes, whose union is the whole. It is not proven once ``stop`` says so, nor with more
    than so many ``boxes``.
    """
    used = np.zeros(len(lower), dtype=bool)
    for e in equations:
        used[list(e.involved)] = True
    if not np.isfinite(lower[used]).all() or not np.isfinite(upper[used]).all():
        return False
    # Whole turns say nothing new about a trigonometric polynomial (up to its sign).
    turning = used & ~np.any([e.powers.any(axis=0) for e in equations], axis=0)
    upper = np.where(turning, np.minimum(upper, lower + 2 * np.pi), upper)
    steep = [slopes(e, lower, upper) for e in equations]
    centers = np.where(used, (lower + upper) / 2, 0.0)[None, :]
    halves = np.where(used, (upper - lower) / 2, 0.0)[None, :]
    seen = 0
    while len(centers):
        seen += len(centers)
        if seen > boxes or (stop is not None and stop()):
            return False
        alive = np.ones(len(centers), dtype=bool)
        worst = np.zeros_like(centers)
        for i, (e, slope) in enumerate(zip(equations, steep, strict=True)):
            value = np.abs(e(centers))
            left = value <= halves @ slope * (1 + _MARGIN) + max(_MARGIN, 10 * e.accuracy) * e.size
            if tell is not None and (alive & ~left).any():
                tell(Box(i, centers[alive & ~left], halves[alive & ~left]))
            alive &= left
            worst = np.maximum(worst, halves * slope / e.size)
        centers, halves, worst = centers[alive], halves[alive], worst[alive]
        if not len(centers):
            return True
        axis = np.argmax(worst, axis=1)
        rows = np.arange(len(centers))
        halves = halves.copy()
        halves[rows, axis] /= 2
        shift = np.zeros_like(centers)
        shift[rows, axis] = halves[rows, axis]
        centers = np.concatenate([centers - shift, centers + shift])
        halves = np.concatenate([halves, halves])
    return True
