"""Equations are made exactly of polynomials: no small term is dropped, and none is invented."""

from fractions import Fraction

import numpy as np
import pytest

from pinsing.algebra.equation import equation, fourier
from pinsing.algebra.ring import make_ring

TINY = Fraction(1, 10**30)


def test_a_tiny_term_stays():
    ring = make_ring((False, False))
    x1, y1, x2, y2 = ring.context.gens()
    # cos q1 + 1e-30 sin q2, both times (x1^2 + y1^2)(x2^2 + y2^2)
    poly = (x1**2 - y1**2) * (x2**2 + y2**2) + ring.number(TINY) * 2 * x2 * y2 * (x1**2 + y1**2)
    terms = fourier(poly, ring, [0, 0])
    assert set(terms) == {((2, 0), (0, 0)), ((0, 2), (0, 0))}
    assert terms[(0, 2), (0, 0)][1] / terms[(2, 0), (0, 0)][0] == TINY
    made = equation(poly, ring, ("q1", "q2"), np.zeros(2))
    assert (made.involved, made.sin.max()) == ((0, 1), pytest.approx(1e-30, rel=1e-15))
    ring = make_ring((False,))
    x, y = ring.context.gens()
    assert fourier((x**2 + y**2) ** 3, ring, [1]).keys() == {((0,), (0,))}


def value_at(terms, tangents, lengths):
    """Exactly, at angles given by the tangents of their halves, where all frequencies are even."""
    total = Fraction(0)
    for (frequency, power), (cos, sin) in terms.items():
        real, imag = Fraction(1), Fraction(0)
        for k, t in zip(frequency, tangents, strict=True):
            c, s = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
            for _ in range(abs(k) // 2):
                turn = s if k > 0 else -s
                real, imag = real * c - imag * turn, real * turn + imag * c
        scale = Fraction(1)
        for length, e in zip(lengths, power, strict=True):
            scale *= length**e
        total += (cos * real + sin * imag) * scale
    return total


@pytest.mark.parametrize(("digits", "degree"), [(3, 4), (40, 4), (200, 6), (5, 64)])
def test_long_numbers_and_high_degrees_are_exact(digits, degree):
    """Coefficients of many machine's words, and forms that leave no room in one."""
    rng = np.random.default_rng(digits)
    ring = make_ring((False, True, False))
    x1, y1, z, x3, y3 = ring.context.gens()

    def number():
        return Fraction(int("".join(map(str, rng.integers(1, 10, digits)))) * -1, 10**digits + 1)

    poly = ring.zero
    for _ in range(12):
        a, b, e = (int(k) for k in rng.integers(0, (degree + 1, 3, 3)))
        one = x1**a * y1 ** (degree - a) * x3**b * y3 ** (2 - b) * z**e
        poly += ring.number(number()) * one
    terms = fourier(poly, ring, [0, 0, 0])
    assert all(next(k for k in (*f, 1) if k) > 0 for f, _ in terms)
    ratios = set()
    for t, u, length in ((Fraction(1, 3), Fraction(-2), Fraction(5, 7)), (2, 5, -3), (-7, 3, 11)):
        t, u, length = Fraction(t), Fraction(u), Fraction(length)
        told = value_at(terms, (t, Fraction(0), u), (Fraction(0), length, Fraction(0)))
        whole = sum(
            c * t ** m[1] * length ** m[2] * u ** m[4] for m, c in ring.terms(poly).items()
        ) / ((1 + t * t) ** (degree // 2) * (1 + u * u))
        ratios.add(told / whole)
    (ratio,) = ratios
    assert ratio > 0
