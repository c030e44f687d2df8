"""Families in one line: what one sum of angles is, where branches differ in that alone."""

import math

import numpy as np
import pytest

from pinsing.algebra.equation import Equation
from pinsing.families.describe import statement
from pinsing.families.parts import Branch, JointValue

SYMBOLS = ("q1", "q2", "q3")


def sum_at(angle: float, third: float = 0.0) -> Equation:
    """q1 + q2 (+ third q3) is an angle: sin((q1 + q2 - angle) / 2) = 0."""
    frequencies = np.array([[1, 1, third]], dtype=np.int64)
    cos, sin = np.array([-math.sin(angle / 2)]), np.array([math.cos(angle / 2)])
    return Equation(SYMBOLS, frequencies, np.zeros((1, 3), dtype=np.int64), cos, sin, np.zeros(3))


def long_condition() -> Equation:
    """cos(q1 + q3) + 2 sin q3 = 0."""
    frequencies = np.array([[2, 0, 2], [0, 0, 2]], dtype=np.int64)
    cos, sin = np.array([1.0, 0.0]), np.array([0.0, 2.0])
    return Equation(SYMBOLS, frequencies, np.zeros((2, 3), dtype=np.int64), cos, sin, np.zeros(3))


def said(*branches: Branch, latex: bool = False) -> str:
    return statement(branches, [], SYMBOLS, [False] * 3, latex)


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


def test_angles_are_joined_where_all_else_is_the_same():
    two = Branch((), (sum_at(math.pi),)), Branch((), (sum_at(0.0),))
    assert said(*two) == "q1+q2 = 0° or 180° (mod 360°)"
    assert said(*two, latex=True) == (
        r"q_{1}+q_{2} = 0^\circ\ \text{or}\ 180^\circ \pmod{360^\circ}"
    )
    rest = long_condition()
    two = Branch((), (sum_at(0.5), rest)), Branch((), (sum_at(-0.5), rest))
    assert said(*two) == (f"q1+q2 = ±28.6479° (mod 360°) and {rest.text()}")
    # An "or" of angles would say that each goes with each.
    other = Branch((), (sum_at(math.pi, 1),))
    assert said(Branch((), (sum_at(0.0),)), other) == (
        "q1+q2 = 0° (mod 360°); or q1+q2+q3 = 180° (mod 360°)"
    )
    with_rest = Branch((), (sum_at(math.pi), long_condition()))
    assert said(Branch((), (sum_at(0.0),)), with_rest) == (
        f"q1+q2 = 0° (mod 360°); or q1+q2 = 180° (mod 360°) and {long_condition().text()}"
    )


@pytest.mark.parametrize("latex", [False, True])
def test_an_equation_stands_with_its_own_roots_only(latex: bool) -> None:
    turning = np.array([[2, 0, 0]], dtype=np.int64)
    one = np.array([1.0])
    powers = np.zeros((1, 3), dtype=np.int64)
    equation = Equation(SYMBOLS, turning, powers, one, -one, np.zeros(3))  # cos q1 - sin q1 = 0
    roots, mirrored = (
        [Branch((JointValue(0, sign * v, False),), ()) for v in (math.pi / 4, -3 * math.pi / 4)]
        for sign in (1, -1)
    )
    written = equation.latex() if latex else equation.text()
    alone = statement(roots, [equation], SYMBOLS, [False] * 3, latex)
    both = statement([*roots, *mirrored], [equation], SYMBOLS, [False] * 3, latex)
    assert written in alone
    assert "=" in both
    assert "cos" not in both  # -45 and 135 degrees are no roots of it
