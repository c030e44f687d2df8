"""Proof that equations have no common zero in a box, by subdivision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb

from pinsing._types import Array
from pinsing.algebra.equation import Equation

_MARGIN = 1e-8
"""Of the sum of an equation's coefficients: more than all rounding, in them and in their sums."""

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


# After which a proof is given up.
def proven_empty(
    equations: Sequence[Equation],
    lower: Array,
    upper: Array,
    tell: Callable[[Box], None] | None = None,
    stop: Stop | None = None,
    boxes: int = 40_000,
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


_WIDER = 1e-9
"""Share by which each box is taken wider: so they overlap, and 2 pi is covered whole."""


def certainly_empty(
    equations: Sequence[Equation],
    lower: Array,
    upper: Array,
    stop: Callable[[], bool] | None = None,
) -> bool:
    """Whether equations of angles have no common zero in a box: proven, or False.

    It is not proven once ``stop`` says so.
    """
    if any(e.powers.any() for e in equations):
        return False
    if any(never_zero(e) for e in equations):
        return True
    boxes: list[Box] = []
    if not proven_empty(equations, lower, upper, boxes.append, stop):
        return False
    balls = [_Balls(e) for e in equations]
    count = sum(len(box.centers) * len(equations[box.equation].cos) for box in boxes)
    # Terms times boxes that there is time for.
    if count > 400_000:
        return False
    return all(
        balls[box.equation].away(center, half)
        for box in boxes
        for center, half in zip(box.centers, box.halves, strict=True)
    )


def never_zero(equation: Equation) -> bool:
    """Whether the constant term outweighs all the others: no zero anywhere."""
    if equation.powers.any():
        return False
    balls = _Balls(equation)
    constant = ~(equation.frequencies != 0).any(axis=1)
    inside = sum((abs(c) for c, k in zip(balls.cos, constant, strict=True) if k), arb(0))
    outside = sum((s for s, k in zip(balls.sizes, constant, strict=True) if not k), arb(0))
    return bool(inside > outside)


class _Balls:
    """An equation whose coefficients are balls that hold the true ones."""

    def __init__(self, equation: Equation) -> None:
        error = equation.accuracy * equation.size
        self.cos = [arb(float(c), error) for c in equation.cos]
        self.sin = [arb(float(c), error) for c in equation.sin]
        self.sizes = [(c * c + s * s).sqrt() for c, s in zip(self.cos, self.sin, strict=True)]
        self.frequencies = [[int(k) for k in row] for row in equation.frequencies]
        self.shift = [arb(float(x)) for x in equation.shift]

    def away(self, center: Array, half: Array) -> bool:
        """Whether the equation is not zero in a box: at its centre it is above what it can lose."""
        q = [arb(float(c)) + s for c, s in zip(center, self.shift, strict=True)]
        reach = [arb(float(h)) * (1 + _WIDER) + _WIDER for h in half]
        value, loss = arb(0), arb(0)
        terms = zip(self.frequencies, self.cos, self.sin, self.sizes, strict=True)
        for frequency, c, s, size in terms:
            used = [(k, j) for j, k in enumerate(frequency) if k]
            phase = sum((q[j] * k for k, j in used), arb(0)) / 2
            value += c * phase.cos() + s * phase.sin()
            loss += size * sum((reach[j] * abs(k) for k, j in used), arb(0)) / 2
        return bool(abs(value) > loss)
