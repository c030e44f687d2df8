"""Polynomials, with square roots in them or none: factors, roots; matrices and their minors."""

import itertools
import math
import random
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from singular_sets import random_form, ring_for
from tiers import tiered

from pinsing import load
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import SearchPlace
from pinsing.algebra.jacobian_matrix import (
    Minors,
    dependent,
    determinant,
    jacobian_matrix,
    reduce_matrix,
)
from pinsing.algebra.real_roots import real_roots
from pinsing.algebra.ring import _EXPONENTS, WORD_PRIME, Ring, make_ring
from pinsing.robot.nominal import nominal
from pinsing.robot.surd import cosine, residue, root_modulo, surd

RING = make_ring((False, True, False, False))
X1, Y1, Z, X3, Y3, X4, Y4 = RING.context.gens()


def by_flint(poly: Any) -> list[str]:
    """Without x^2 + y^2."""
    factors = [f for f, _ in poly.factor()[1]]
    return sorted(str(f) for f in factors if all(w is None or f != w for w in RING.w))


@pytest.mark.parametrize("seed", range(12))
def test_forms_fall_into_the_same_factors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = ((2, seed % 3, 3, 2), 9), ((1, 1, 0, 2), 5), ((0, seed % 2, 2, 1), 4)
    one, other, square = (random_form(RING, rng, *shape) for shape in shapes)
    for poly in (
        one * other,
        one * X1 * Y1**2 * Y4 * (X3**2 + Y3**2),
        one * other * square**2 * Z * Y3,
        (one * other) * 7 * X4,
    ):
        whole = RING._of_form(poly)
        found = [f for f in whole if all(w is None or f != w for w in RING.w)]
        assert sorted(map(str, found)) == by_flint(poly) == sorted(map(str, RING.factors(poly)))
        joints = [min(RING.joints_of(f)) for f in found]
        assert joints == sorted(joints, reverse=True)


def test_what_is_no_form_is_left_to_flint() -> None:
    rng = np.random.default_rng(3)
    poly = (X1 + Y1 + 1) * (random_form(RING, rng, (2, 1, 2, 2), 14) + 5)
    assert len(poly) >= 20
    assert RING._of_form(poly) is None
    assert sorted(map(str, RING.factors(poly))) == by_flint(poly)
    whole = random_form(RING, rng, (2, 1, 2, 2), 30)
    for v in (X1, Y1, X3, Y3, X4, Y4):
        assert RING._of_form(whole * v + whole) is None
    assert RING._of_form(whole * Z + whole) is not None  # a slide may have any power


ROOT2, ROOT3, ROOT6 = (surd(*(Fraction(int(i == k)) for i in range(4))) for k in (1, 2, 3))


def ring(*numbers, prismatic=(False, False, True)) -> Ring:
    made = make_ring(prismatic, numbers, Budget(60))
    assert made.roots
    return made


def gens(r: Ring):
    return r.context.gens()[: r.nvars]


def product(r, polys):
    out = r.one
    for p in polys:
        out = r.reduce(out * p)
    return out


def test_the_ring_has_the_roots_that_are_needed():
    assert make_ring((False,), [Fraction(1, 3), Fraction(2)], Budget(1)) == make_ring((False,))
    assert ring(cosine(3)).roots == (2,)
    assert ring(cosine(2), Fraction(1, 2)).roots == (3,)
    assert (ring(ROOT2, ROOT3).roots, ring(cosine(1)).roots) == ((2, 3), (2, 3))
    with pytest.raises(ValueError, match="square root of 3"):
        ring(ROOT2).number(ROOT3)
    with pytest.raises(ValueError, match="square root of 2"):
        make_ring((False,)).number(ROOT2)


@pytest.mark.parametrize("exponent", tiered(_EXPONENTS, [e for e in _EXPONENTS if e < 2000]))
def test_the_primes(exponent):
    """3 * 2^k + 1 = N is prime if a^((N-1)/2) = -1 for some a (Proth, 1878)."""
    prime = 3 * 2**exponent + 1
    assert any(pow(a, (prime - 1) // 2, prime) == prime - 1 for a in (5, 7, 11, 13, 17, 19))
    for square in (2, 3, 6):
        assert pow(root_modulo(square, prime), 2, prime) == square


def test_numbers_modulo_a_prime():
    for a, b in itertools.product((cosine(1), cosine(2) + 1, ROOT6 / 7), repeat=2):
        one, other = residue(a, WORD_PRIME), residue(b, WORD_PRIME)
        assert residue(a * b, WORD_PRIME) == one * other % WORD_PRIME
        assert residue(a + b, WORD_PRIME) == (one + other) % WORD_PRIME
    r = ring(ROOT2)
    x, y, u, v, z = gens(r)
    assert (r.gcd(y, y * v), r.gcd(x * y * z * z, x * x * u * z)) == (y, x * z)
    assert r.gcd(x * (u + v), x * y * (u - v)) == x


def test_a_rational_polynomial_falls_apart_only_over_the_right_root():
    r = ring(ROOT2)
    x, y, *_ = gens(r)
    two = r.factors(x**2 - 2 * y**2)
    assert set(map(str, two)) == {str(x - r.number(ROOT2) * y), str(x + r.number(ROOT2) * y)}
    quartic = x**4 - 10 * x**2 * y**2 + y**4  # roots +-sqrt 2 +-sqrt 3
    assert [len(r.factors(p)) for p in (x**2 - 3 * y**2, x**2 - 5 * y**2, quartic)] == [1, 1, 2]
    r = ring(ROOT2, ROOT3)
    x, y, *_ = gens(r)
    assert len(r.factors(x**4 - 10 * x**2 * y**2 + y**4)) == 4
    assert len(r.factors(x**4 - 2 * y**4)) == 2
    assert r.factors(x**2 + y**2) == []  # no angle


def factors_of(r, rng):
    """One to three polynomials, each with some sqrt in it or none."""
    x, y, u, v, z = gens(r)
    monomials = [x * u, x * v, y * u, y * v, x * u * z, y * v * z, z * x * v, r.one * y * u]
    root = ROOT2 if 2 in r.roots else ROOT3
    out = []
    for _ in range(rng.integers(1, 4)):
        numbers = [r.number(root * b + a) for a, b in rng.integers(-4, 5, (8, 2)).tolist()]
        some = rng.permutation(8)[: rng.integers(2, 5)]
        out.append(r.reduce(sum((monomials[k] * numbers[k] for k in some), r.zero)))
    return [p for p in out if not r.is_constant(p)]


@pytest.mark.parametrize("numbers", [(ROOT2,), (ROOT3,), (ROOT2, ROOT3)])
def test_factors_divide_and_multiply_up(numbers, rng):
    r = ring(*numbers)
    for _ in range(20):
        given = factors_of(r, rng)
        poly = product(r, given)
        found = r.factors(poly)
        assert all(r.divides(f, poly) for f in found)
        # Every given factor is made up of found ones, and nothing is left of the product.
        for g in [*given, poly]:
            rest = r.strip(g)
            for f in found:
                while not r.is_constant(rest) and r.divides(f, rest):
                    rest = r.quotient(rest, f)
            assert r.is_constant(rest)
        # And none of them falls apart any more.
        assert all(r.factors(f) == [f] == [r.monic(f)] for f in found)


def test_common_divisors(rng):
    r = ring(ROOT2)
    for _ in range(20):
        shared, one, other = (product(r, factors_of(r, rng)) for _ in range(3))
        a, b = r.reduce(shared * one), r.reduce(shared * other)
        common = r.gcd(a, b)
        assert all(r.divides(common, p) for p in (a, b))
        assert r.divides(r.monic(shared), common)
        assert r.is_constant(r.gcd(r.quotient(a, common), r.quotient(b, common)))
        assert r.gcd(a, r.zero) == r.monic(a)


def test_joint_values_with_square_roots():
    r = ring(ROOT2)
    x, y, u, v, z = gens(r)
    tan = ROOT2 - 1  # of 22.5 degrees
    assert r.joint_value(r.monic(y - x * r.number(tan))) == (0, (Fraction(1), tan))
    assert r.joint_value(r.monic(z * r.number(ROOT2) - r.one)) == (2, (ROOT2 / 2,))
    assert r.joint_value(x * u - y * v) is None
    assert r.joint_value(x**2 - 3 * y**2) is None
    put = r.putting({0: (Fraction(1), tan)})(x * v - y * u * r.number(ROOT2))
    assert put == v - u * r.number(ROOT2 * tan)
    r = ring(ROOT3)
    x1, y1, x2, _, z = gens(r)
    put = r.putting({0: (Fraction(1), ROOT3), 2: (Fraction(2, 5),)})
    assert put(x2) == x2
    assert put(r.zero) == 0
    assert r.reduce(put(x1**2 + y1**2)) == r.number(4)
    assert r.reduce(put(x2 * y1 * z)) == r.reduce(x2 * r.number(ROOT3 * Fraction(2, 5)))


@pytest.mark.slow
def test_too_long_coefficients_are_no_hang():
    r = ring(ROOT2)
    x, y, u, v, _ = gens(r)
    big = Fraction(10**400 + 7, 3**300)
    f = x * u * r.number(ROOT2 + big) + y * v * r.number(big * big)
    g = x * v - y * u * r.number(ROOT2 * big)
    with pytest.raises(BudgetExceeded, match="too long"):
        r.factors(r.reduce(f * g))


def test_real_roots_with_square_roots():
    r = ring(ROOT2, ROOT3)
    x = gens(r)[4]  # of a joint that slides
    wanted = [math.sqrt(2), 1 - math.sqrt(3), math.sqrt(6) / 5]
    linear = [x - r.number(root) for root in (ROOT2, 1 - ROOT3, ROOT6 / 5)]
    poly = product(r, [*linear, x**2 + r.number(ROOT3)])
    found = [float(v.ball) for v in real_roots(poly, 2, r)]
    assert sorted(found) == pytest.approx(sorted(wanted), rel=1e-15)
    plain = make_ring((True,))
    t = plain.context.gens()[0]
    found = [float(v.ball) for v in real_roots((t**2 - 2) * (t - 3) ** 2 * (t**2 + 1), 0, plain)]
    assert sorted(found) == pytest.approx([-math.sqrt(2), math.sqrt(2), 3], rel=1e-15)


def test_a_product_has_its_root_at_half_a_turn():
    """2 x y is sin q: zero at 0 and at 180 degrees, whose tangent of half the angle is infinite."""
    x, y = (ring := make_ring((False,))).context.gens()
    found = real_roots(2 * x * y, 0, ring)
    assert sorted(v.angle() for v in found) == [0.0, math.pi]
    assert [v.exact(slides=False) for v in found] == [(1, 0), (0, 1)]
    found = real_roots(x**3 * (x - y) ** 2 * (x**2 - 2 * y**2), 0, ring)
    angles = [2 * math.atan(t) for t in (1, math.sqrt(0.5), -math.sqrt(0.5), math.inf)]
    assert sorted(v.angle() for v in found) == pytest.approx(sorted(angles))
    assert sum(v.exact(slides=False) is None for v in found) == 2


@pytest.mark.parametrize("roots", [False, True])
def test_what_no_configuration_makes_zero(roots: bool) -> None:
    """Constants and products of x^2 + y^2, with and without square roots in the ring."""
    r = ring(ROOT2) if roots else make_ring((False, False, True))
    x1, y1, x2, y2, z = r.context.gens()[: r.nvars]
    constant = r.number(ROOT2) if roots else r.number(Fraction(-3, 7))
    w1, w2 = x1**2 + y1**2, x2**2 + y2**2
    for poly in (r.one, constant, w1, constant * w1, w1**2 * w2, constant * w1 * w2**3):
        assert r.nowhere_zero(r.reduce(poly)), poly
    for poly in (
        x1, z, z**2, w1 * z, x1**2 - y1**2, 2 * x1**2 + y1**2, w1 + w2, w1 * (x2**2 + 2 * y2**2),
        x1**2 * y1**2, w1 * x2 * y2, w1**2 + x1**2 * y1**2,
    ):  # fmt: skip
        assert not r.nowhere_zero(r.reduce(poly)), poly
        assert not r.nowhere_zero(r.reduce(constant * poly)), poly


SLIDES = (False, False, True)
PLAIN = make_ring(SLIDES)
ROOTS = make_ring(SLIDES, [cosine(1)], Budget(60.0))


def entry(ring: Ring, draw: random.Random, terms: int = 2):
    """A short polynomial, often zero."""
    total = ring.zero
    for _ in range(draw.randint(0, terms)):
        product = ring.number(draw.randint(-3, 3))
        for x in ring.context.gens():
            product = product * x ** draw.choice([0, 0, 1])
        total = total + product
    return ring.reduce(total)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
def test_a_determinant_has_the_value_of_its_entries_determinant(size):
    draw = random.Random(size)
    for _ in range(6):
        matrix = [[entry(PLAIN, draw) for _ in range(size)] for _ in range(size)]
        point = [fmpq(draw.randint(-9, 9), draw.randint(1, 5)) for _ in range(PLAIN.nvars)]
        values = fmpq_mat(size, size, [x(*point) for row in matrix for x in row])
        assert determinant(matrix, PLAIN, Budget(60.0))(*point) == values.det()


@pytest.mark.parametrize("ring", [PLAIN, ROOTS], ids=["rational", "with roots"])
def test_rows_that_are_combinations_of_others_are_dropped_and_no_others(ring):
    draw = random.Random(7)
    for _ in range(60):
        free = [[entry(ring, draw) for _ in range(3)] for _ in range(draw.randint(1, 3))]
        # A monomial of its own each makes these independent.
        own = ring.context.gens()[0] ** 3
        rows = [[a, b + own**k, c] for k, (a, b, c) in enumerate(free, 1)]
        count = len(rows)
        for _ in range(draw.randint(0, 2)):
            mixed = [ring.zero] * 3
            for row in rows:
                factor = draw.randint(-2, 2)
                mixed = [m + factor * x for m, x in zip(mixed, row, strict=True)]
            rows.insert(draw.randint(0, len(rows)), [ring.reduce(x) for x in mixed])
        assert len(rows) - len(dependent(rows, ring)) == count


STRAIGHT, BACK = (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1))


@pytest.fixture
def everywhere():
    """Where all joints of an arm of seven are free."""
    arm = load("panda")
    geometry, time = nominal(arm), Budget(60)
    ring = ring_for(geometry)
    matrix = jacobian_matrix(geometry, ring, arm.task, time)
    return SearchPlace({}, Minors(matrix, 6, ring, time), 2)


def test_a_place_that_is_come_to_again_has_the_same_matrix_and_minors(everywhere):
    first, again = (everywhere.at({1: STRAIGHT}) for _ in range(2))
    assert first.values == again.values == {1: STRAIGHT}
    assert first.minors is again.minors
    assert first.minors.smaller is again.minors.smaller
    assert everywhere.at({1: BACK}).minors.matrix != first.minors.matrix
    part = everywhere.beside([row[:3] for row in everywhere.minors.matrix[:3]], 3)
    assert part.at({1: STRAIGHT}).minors is first.minors
    assert part.minors.smaller is not everywhere.minors.smaller


def test_what_is_known_is_what_is_made_anew(everywhere):
    ring, time = everywhere.minors.ring, everywhere.minors.time
    for values in ({1: STRAIGHT}, {4: BACK}, {1: STRAIGHT, 5: BACK}):
        for _ in range(2):
            there = everywhere.at(values).minors
            put = ring.putting(values)
            assert there.matrix == [[put(x) for x in row] for row in everywhere.minors.matrix]
            small = there.smaller
            assert (small.matrix, small.size) == reduce_matrix(there.matrix, 6, ring, time)
            assert small.smaller is small
            fresh = Minors(small.matrix, small.size, ring, time)
            assert list(small) == list(small) == list(fresh)
