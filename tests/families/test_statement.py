"""Families in one line: what one sum of angles is, where branches differ in that alone."""

import math

import numpy as np
import pytest

from pinsing.algebra.equation import Equation

SYMBOLS = ("q1", "q2", "q3")


def sum_at(angle: float, third: float = 0.0) -> Equation:
    """q1 + q2 (+ third q3) is an angle: sin((q1 + q2 - angle) / 2) = 0."""
    frequencies = np.array([[1, 1, third]], dtype=np.int64)
    cos, sin = np.array([-math.sin(angle / 2)]), np.array([math.cos(angle / 2)])
    return Equation(SYMBOLS, frequencies, np.zeros((1, 3), dtype=np.int64), cos, sin, np.zeros(3))


def test_the_angle_is_where_the_equation_holds() -> None:
    for turn in (math.pi, -math.pi, 3 * math.pi):
        assert sum_at(turn).text() == "q1+q2 = 180° (mod 360°)"
        assert sum_at(turn).angle_sum == pytest.approx(math.pi)
    rng = np.random.default_rng(3)
    for angle in rng.uniform(-math.pi, math.pi, 20):
        e = sum_at(float(angle))
        q = rng.uniform(-math.pi, math.pi, 3)
        q[1] = angle - q[0]
        assert abs(float(e(q))) < 1e-12
        assert e.angle_sum == pytest.approx(angle)
        q[1] += 0.1
        assert abs(float(e(q))) > 1e-3
