"""Real roots of a trigonometric equation in one joint."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.equation import Equation

_EXACT = 1e-12
_FLAT = 1e-6


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
    turn = frequency / 2
    for k in range(23):
        at = phase + np.multiply.outer(angles, turn)
        cos, sin = np.cos(at), np.sin(at)
        value = cos @ equation.cos + sin @ equation.sin
        slope = cos @ (equation.sin * turn) - sin @ (equation.cos * turn)
        going = (value != 0) & (np.abs(slope) > 1e-14 * equation.size)
        if k >= 20:
            # Newton stalls at half the digits of a double root, which is a single one of the slope.
            going = np.abs(slope) <= _FLAT * equation.size
            bend = -cos @ (equation.cos * turn**2) - sin @ (equation.sin * turn**2)
            going &= np.abs(bend) > _FLAT * equation.size
            value, slope = slope, bend
        angles[going] -= value[going] / slope[going]
    angles = np.pi - np.mod(np.pi - angles, 2 * np.pi)
    Q = np.tile(base, (len(angles), 1))
    Q[:, free] = angles
    out: list[float] = []
    for angle in angles[np.abs(equation(Q)) <= 1e-12 * equation.size].tolist():
        if all(abs(np.sin((angle - other) / 2)) > 1e-7 for other in out):
            out.append(angle)
    return np.sort(np.array(out))
