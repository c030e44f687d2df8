"""That equations have no common zero, in ball arithmetic: what a component is dropped for.

Subdivision in floats proposes boxes that cover the whole, each with an equation that is too large
in the middle to reach zero within. Every one of these is checked again with balls (Arb, Johansson
2017), in which all rounding and the accuracy of the coefficients are carried along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from flint import arb

from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.families.empty_box import Box, proven_empty

_WIDER = 1e-9
"""Share by which each box is taken wider: so they overlap, and 2 pi is covered whole."""
_MOST = 400_000
"""Terms times boxes that there is time for."""


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
    if count > _MOST:
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
