"""Real roots of a trigonometric equation in one joint."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.equation import Equation

_EXACT = 1e-12


def roots(equation: Equation, inputs: npt.ArrayLike, free: int) -> Array:
    """All real values, in (-pi, pi], of one input that solve an equation, the others held.

    The trigonometric polynomial becomes an algebraic one in exp(i q / 2), whose companion
    matrix has the roots; Newton steps on the equation itself sharpen them.
    """
    base = np.array(inputs, dtype=float)
    frequency = equation.frequencies[:, free]
    held = base.copy()
    held[free] = 0.0
    phase = (held + equation.shift) @ (equation.frequencies.T / 2)
    c = (equation.cos - 1j * equation.sin) * np.exp(1j * phase) / 2
    top = int(np.abs(frequency).max())
    coefficients = np.zeros(2 * top + 1, dtype=complex)
    np.add.at(coefficients, top + frequency, c)
    np.add.at(coefficients, top - frequency, np.conj(c))
    if np.abs(coefficients).max() <= _EXACT * equation.size or top == 0:
        return np.zeros(0)
    found = np.roots(coefficients[::-1])
    angles = 2 * np.angle(found[np.abs(np.abs(found) - 1) < 1e-5])
    out: list[float] = []
    for angle in angles:
        q = base.copy()
        q[free] = angle
        for _ in range(20):
            slope = float(equation.gradient(q)[free])
            value = float(equation(q))
            if value == 0 or abs(slope) <= 1e-14 * equation.size:
                break
            q[free] -= value / slope
        angle = float(np.pi - np.mod(np.pi - q[free], 2 * np.pi))
        # At a double root Newton stalls at half the digits.
        if abs(float(equation(q))) <= 1e-12 * equation.size and all(
            abs(np.sin((angle - other) / 2)) > 1e-7 for other in out
        ):
            out.append(angle)
    return np.sort(np.array(out))
