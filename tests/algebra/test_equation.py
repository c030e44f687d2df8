"""Equations: exact, with values and slopes; and their text says the same as the numbers."""

import math
from fractions import Fraction

import numpy as np
import pytest
from arms import differences
from flint import arb, ctx, fmpq
from printed import value_of
from singular_sets import RIGHT, Array, arm_of, closed, random_form, terms

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import System, equation, fourier
from pinsing.algebra.ring import Poly, Ring, make_ring
from pinsing.families import Equation
from pinsing.families.zero_set import fix_joint, never_zero, proven_empty
from pinsing.robot.surd import surd

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
    ratios = []
    with ctx.workprec(2000):
        for half, length, other in ((0.3, 5, -2), (2, -3, 5), (-7, 11, 3)):
            told = whole = arb(0)
            for (frequency, power), numbers in terms.items():
                angle = frequency[0] * arb(half) + frequency[2] * arb(other)
                cos, sin = (arb(fmpq(*c.as_integer_ratio())) for c in numbers)
                told += (cos * angle.cos() + sin * angle.sin()) * arb(length) ** power[1]
            at = [f(arb(x)) for x in (half, other) for f in (arb.cos, arb.sin)]
            at.insert(2, arb(length))
            for powers, c in ring.terms(poly).items():
                product = math.prod(x**k for x, k in zip(at, powers, strict=True))
                whole += fmpq(*c.as_integer_ratio()) * product
            ratios.append(told / whole)
        assert all(ratio > 0 for ratio in ratios)
        assert all(abs(ratio / ratios[0] - 1) < arb("1e-400") for ratio in ratios)


def by_polynomial(poly: Poly, ring: Ring, q: Array, shift: Array) -> Array:
    """Value of a polynomial in half-angle coordinates, straight from its terms."""
    values = np.zeros(len(q))
    half = (q + shift) / 2
    for monomial, c in ring.terms(poly).items():
        term = np.full(len(q), float(c))
        for j in range(len(ring.prismatic)):
            v = ring.variables(j)
            if ring.prismatic[j]:
                term = term * q[:, j] ** int(monomial[v[0]])
            else:
                term = term * np.cos(half[:, j]) ** int(monomial[v[0]])
                term = term * np.sin(half[:, j]) ** int(monomial[v[1]])
        values += term
    return values


@pytest.mark.parametrize("seed", range(16))
def test_an_equation_is_its_polynomial(seed: int) -> None:
    """Its values, its slopes, what it is with a joint fixed, and what its text says."""
    rng = np.random.default_rng(seed)
    roots = [surd(Fraction(0), Fraction(1), Fraction(0), Fraction(0))] * (seed % 2)
    ring = make_ring((seed % 4 > 1, seed % 3 == 0, False, seed % 4 == 1), roots, Budget(10))
    degrees = [int(d) for d in rng.integers(0, 4, 4)]
    poly = random_form(ring, rng, degrees, 9)
    if poly == 0 or poly.is_constant():
        poly = poly + random_form(ring, rng, degrees, 9)
    for r in roots:
        poly = ring.reduce(poly + random_form(ring, rng, degrees, 5) * ring.number(r))
    turns = rng.choice([0.0, RIGHT, 3 * RIGHT, -np.pi, np.pi / 4, 0.3], 4)
    offset = np.where(ring.prismatic, 0.0, turns)
    names = tuple(f"{'d' if slides else 'q'}{j}" for j, slides in enumerate(ring.prismatic, 1))
    e = equation(poly, ring, names, offset)
    q = rng.uniform(-4, 4, (40, 4))
    ours, theirs = e(q), by_polynomial(poly, ring, q, offset)
    scale, size = ours @ theirs / (theirs @ theirs), np.abs(ours).max()
    assert scale != 0
    np.testing.assert_allclose(ours, scale * theirs, atol=1e-11 * size)
    numeric = differences(e, q.reshape(2, 20, 4), 1e-5)
    np.testing.assert_allclose(e.gradient(q.reshape(2, 20, 4)), numeric, atol=1e-7 * size)
    assert (e(q.reshape(2, 20, 4)).shape, e(q[0]).shape) == ((2, 20), ())
    assert np.isfinite(e.gradient(np.zeros((1, 4)))).all()
    every = e, equation(random_form(ring, rng, (2, 1, 0, 3), 9), ring, names, offset)
    values = np.stack([f(q) / f.unit for f in every], axis=-1)
    slopes = np.stack([f.gradient(q) / f.unit for f in every], axis=-2)
    for found, wanted in ((System(every).values, values), (System(every).gradients, slopes)):
        assert np.abs(found(q) - wanted).max() < 1e-13 * np.abs(wanted).max()
    left, right = e.text().split(" = ")
    assert right == "0"
    # Six digits of each coefficient, four decimals of a degree in each angle.
    atol = 2e-5 * e.size * 4.0 ** e.powers.max()
    assert value_of(left, dict(zip(names, q.T, strict=True))) == pytest.approx(ours, abs=atol)
    for joint in range(4):
        put = q.copy()
        put[:, joint] = value = float(rng.uniform(-3, 3))
        fixed = fix_joint(e, joint, value)
        assert joint not in fixed.involved
        np.testing.assert_allclose(fixed(q), e(put), atol=1e-11 * size)


def test_lengths_are_metres():
    (e,), (other,) = (closed(name).families[2].equations for name in ("ur5", "irb1400"))
    latex = r"0.6 \sin q_{2} + 0.72 \cos (q_{2}+q_{3}) + 0.12 \sin (q_{2}+q_{3}) + 0.15 = 0"
    assert other.latex() == latex
    assert (e.involved, e.size) == ((1, 2, 3), pytest.approx(0.425 + 0.39225 + 0.09465))
    q = np.random.default_rng(1).uniform(-9, 9, (100, arm_of("ur5").n))
    assert np.abs(e(q)).max() <= e.size
    np.testing.assert_allclose(e.scaled(2.0)(q), 2 * e(q))


def in_one(cos: list[float], sin: list[float], frequencies: list[int]) -> Equation:
    """Equation in q2 of three joints; frequencies are doubled, as in an Equation."""
    rows = zip(frequencies, cos, sin, strict=True)
    return terms(*(((0, f, 0), (0, 0, 0), c, s) for f, c, s in rows))


def sum_at(angle: float) -> Equation:
    """q1 + q2 is an angle: sin((q1 + q2 - angle) / 2) = 0."""
    return terms(((1, 1, 0), (0, 0, 0), -math.sin(angle / 2), math.cos(angle / 2)))


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
    # Nor is rounding told.
    assert in_one([1.0, 0.5], [1e-17, 0.0], [2, 0]).text() == "cos q2 + 0.5 = 0"


def test_fixing_at_a_root_leaves_nothing() -> None:
    """Also where terms cancel by sine and cosine at a time."""
    constant = 0.223185 * np.cos(0.6) + 0.153705 * np.sin(0.6)
    e = in_one([-0.223185, constant], [-0.153705, 0.0], [2, 0])
    assert fix_joint(e, 1, 0.6) is None
    left = fix_joint(e, 1, 0.7)
    assert left.involved == ()
    assert float(left(np.zeros(3))) == pytest.approx(float(e(np.array([0.0, 0.7, 0.0]))))


def test_proofs_that_there_is_no_zero() -> None:
    away = in_one([1.0, 1.5], [0.0, 0.0], [2, 0])  # cos q + 1.5
    touching = in_one([1.0, 1.0], [0.0, 0.0], [2, 0])  # cos q + 1
    mixed = in_one([1.0, 0.2, 1.05], [0.0, 0.0, 0.0], [2, 4, 0])  # cos q + .2 cos 2q + 1.05
    low, high = np.full(3, -np.pi), np.full(3, np.pi)
    every = (away, touching, mixed)
    assert [never_zero(e) for e in every] == [True, False, False]
    assert [proven_empty([e], low, high) for e in every] == [True, False, True]
    assert proven_empty([touching], np.full(3, -2.0), np.full(3, 2.0))
    zero_in_both = [in_one([1.0], [0.0], [2]), in_one([0.0], [1.0], [2])]  # cos q = sin q = 0
    assert not any(proven_empty([e], low, high) for e in zero_in_both)
    assert proven_empty(zero_in_both, low, high)
    assert proven_empty([away], low, np.full(3, np.inf))  # a whole turn tells
