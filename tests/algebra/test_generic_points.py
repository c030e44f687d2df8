"""Common zeros modulo a prime, and the points of random slices: all of them, nothing else."""

import functools
import itertools
import operator
from fractions import Fraction

import numpy as np
import pytest
from tiers import tiered

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import decompose
from pinsing.algebra.generic_points import Residues, Undecided, Zero, slice_points, zeros
from pinsing.algebra.ring import WORD_PRIME, make_ring, modular_context

NAMES = "xyzu"


def context_of(k):
    return modular_context(tuple(NAMES[:k]), WORD_PRIME)


def random_poly(degrees, rng):
    """All monomials up to these degrees, with random coefficients."""
    monomials = itertools.product(*(range(d + 1) for d in degrees))
    terms = {m: int(rng.integers(1, WORD_PRIME)) for m in monomials}
    return context_of(len(degrees)).from_dict(terms)


def solve(polys, nonzero=None, check=lambda products: None):
    k = len(polys[0].degrees())
    return zeros(polys, range(k), nonzero or {}, np.random.default_rng(0), check)


def value(poly, zero: Zero):
    total = zero.field.zero()
    for monomial, c in poly.to_dict().items():
        powers = [zero.at[v] ** int(e) for v, e in enumerate(monomial)]
        total += zero.field(int(c)) * functools.reduce(operator.mul, powers)
    return total


def count(found):
    """Number of points, conjugates counted one by one."""
    return sum(z.field.degree() for z in found)


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        ([(3,)], 3),
        ([(2, 2), (2, 2)], 8),
        ([(1, 3), (2, 1)], 7),
        ([(2, 2, 2)] * 3, 48),  # mixed volume: 3! times 2 * 2 * 2
        ([(1, 2, 1), (1, 1, 1), (2, 1, 1)], 11),  # permanent of the degrees
        ([(2, 0, 0), (2, 2, 0), (2, 2, 2)], 8),
        ([(1, 1, 1, 1)] * 4, 24),
        ([(2, 0, 0, 0), (0, 2, 0, 0), (2, 2, 2, 0), (0, 2, 2, 2)], 16),
    ],
)
@pytest.mark.parametrize("seed", tiered(range(3), {0}))
def test_as_many_as_there_are(degrees, expected, seed):
    rng = np.random.default_rng(seed)
    polys = [random_poly(d, rng) for d in degrees]
    found = solve(polys)
    assert count(found) == expected
    assert all(value(p, z).is_zero() for p in polys for z in found)
    assert not any(value(random_poly(degrees[0], rng), z).is_zero() for z in found)


def test_more_equations_than_variables():
    rng = np.random.default_rng(4)
    p, g = random_poly((2, 2), rng), random_poly((2, 2), rng)
    x, y = context_of(2).gens()
    assert solve([p, g, random_poly((1, 1), rng)]) == []
    assert count(solve([p * x + g, g * y + p, p + g])) == 8
    x, y, z = context_of(3).gens()
    assert solve([z * z - 2, z * z - 3, x * y * z - 1]) == []
    assert solve([context_of(1).constant(5)]) == []


def test_unwanted_zeros_are_left_out():
    x, y, z = context_of(3).gens()
    circle = x * x + 1
    p = circle * (y - 2) + x * (y - 5)
    polys = [p, y * z - 3, x * z - 7]
    wanted = [s for s in solve(polys) if not value(circle, s).is_zero()]
    assert count(solve(polys, {0: circle})) == count(wanted)
    # A whole line of unwanted ones does not hide the others.
    line = [(x - 1) * z - (x * x + 1), (x - 1) * (y - 4) + circle * z, circle * y]
    found = solve(line, {0: circle})
    assert all(value(y, s).is_zero() for s in found)
    assert count(found) > 0


def test_what_is_not_solved():
    x, y, z = context_of(3).gens()
    for polys in ([x * y, x * (y - 1), z - 1], [x - y, 2 * x - 2 * y, z], [x, x * y, x * z]):
        with pytest.raises(Undecided):
            solve(polys)
    with pytest.raises(Undecided):
        solve([x - 1, context_of(3).constant(0), y])
    spent = Budget(1e-9)
    rng = np.random.default_rng(6)
    with pytest.raises(BudgetExceeded):
        solve([random_poly((2, 2), rng) for _ in range(2)], check=spent.check)


@pytest.mark.slow
def test_a_system_that_is_too_large_is_not_solved():
    rng = np.random.default_rng(5)
    with pytest.raises(Undecided):
        solve([random_poly((6, 6, 6), rng) for _ in range(3)])


RING = make_ring((False, False, False, True))
X1, Y1, X2, Y2, X3, Y3, Z = RING.context.gens()


def points(*polys):
    rng = np.random.default_rng(1)
    return list(slice_points(polys, Residues(RING), rng, {}, lambda products: None))


def test_the_common_zeros_are_met():
    p, g = X1 * Y2 - 3 * X2 * Y1, Z * X1 - 2 * Y1
    found = points(p, g)
    # (q1, q2): z fixed gives one q1 and with it one q2; (q1, z): one; (q2, z): one.
    assert count(found) == 3
    for s in found:
        assert all(map(s.is_zero, (p, g, p * X3 + g * Y3)))
        assert not s.is_zero(X1 * Y2 - 2 * X2 * Y1)
        assert (s.rank([[p, X1], [g, Y1]]), s.rank([[p, X1], [Y1, g]])) == (1, 2)
        assert s.transversal((p, g))


def test_special_points():
    p = X1**2 * Y2 + 3 * Y1**2 * X2 + 5 * X1 * Y1 * X2 - 7 * X1**2 * X2
    g = X1 * X2**2 + 11 * Y1 * Y2**2 - 2 * X1 * Y2 * X2 + 13 * Y1 * X2**2
    assert count(points(p, g)) == 5  # Bezout: 2 * 2 + 1 * 1
    found = points(X1 * 5 - Y1 * 2, X2**2 - 3 * Y2**2 + X1**2 * 0)
    assert count(found) == 2
    assert all(s.is_zero(RING.fixing(0, (Fraction(2), Fraction(5)))) for s in found)
    assert not any(s.is_zero(RING.fixing(0, (Fraction(2), Fraction(-5)))) for s in found)
    line, parabola = Y2, Y2 * X1**2 - Y1**2 * X2  # u = 0 and u = t^2
    found = points(line, parabola)
    assert count(found) == 1
    assert not found[0].transversal((line, parabola))
    assert found[0].is_zero(RING.fixing(0, (Fraction(1), Fraction(0))))
    # x1^2 + y1^2 vanishes where both do
    assert points(X1 * X2 + Y1 * Y2, X1 * Y2 - Y1 * X2) == []
    found = points(X1 - 2 * Y1, X2 * Y3 - X3 * Y2)  # never both in (q2, q3) alone
    assert count(found) == 2  # (q1, q2) and (q1, q3)


@pytest.mark.parametrize("said", [1, 3])
def test_a_generic_rank_that_is_wrong_is_noticed(said):
    """The matrix has rank 2: its last row is the sum of multiples of the others."""
    ring = make_ring((False, False))
    x1, y1, x2, y2 = ring.context.gens()
    first, second = [x1, y1, x2], [y2, x1, y1]
    matrix = [first, second, [x2 * a + y1 * b for a, b in zip(first, second, strict=True)]]
    for rank in (2, said):
        found = decompose(lambda: matrix, rank, ring, Budget(30.0))
        assert any("generic rank" in gap for gap in found.gaps) == (rank != 2)
