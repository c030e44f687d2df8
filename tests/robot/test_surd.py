"""Exact numbers with square roots of 2 and 3."""

import math
from fractions import Fraction

import pytest
from hypothesis import given, strategies as st

from pinsing.robot.surd import SQUARES, Surd, cosine, parts_of, sine, surd

fractions = st.fractions(min_value=-9, max_value=9, max_denominator=50)
numbers = st.builds(surd, fractions, fractions, fractions, fractions)


@pytest.mark.parametrize("steps", range(-30, 31))
def test_multiples_of_fifteen_degrees(steps):
    angle = math.radians(15 * steps)
    assert float(cosine(steps)) == pytest.approx(math.cos(angle), abs=1e-14)
    assert float(sine(steps)) == pytest.approx(math.sin(angle), abs=1e-14)
    assert cosine(steps) * cosine(steps) + sine(steps) * sine(steps) == 1
    if steps % 6 == 0 or steps % 4 == 0:
        assert isinstance(cosine(steps), Fraction)  # what is rational is no Surd


@pytest.mark.slow
@given(numbers, numbers, numbers)
def test_the_field(a, b, c):
    assert a + b == b + a
    assert a * b == b * a
    assert (a + b) * c == a * c + b * c
    assert (a - b, a - a) == (-(b - a), 0)
    if a != 0:
        assert a / a == 1
        assert b / a * a == b
        assert 1 / a * a == 1
    assert float(a * b) == pytest.approx(float(a) * float(b), rel=1e-9, abs=1e-9)
    assert hash(a + b) == hash(b + a)


@pytest.mark.slow
@given(numbers)
def test_floats_do_not_cancel(a):
    """A number close to zero keeps all its digits."""
    value = sum(float(p) * math.sqrt(s) for p, s in zip(parts_of(a), SQUARES, strict=True))
    assert float(a) == pytest.approx(value, abs=1e-12)
    tiny = surd(Fraction(-665857), Fraction(470832), Fraction(0), Fraction(0))  # a convergent
    assert isinstance(tiny, Surd)
    assert float(tiny) == pytest.approx(-1 / (665857 + 470832 * math.sqrt(2)), rel=1e-12)
