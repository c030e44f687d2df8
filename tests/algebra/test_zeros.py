"""Common zeros modulo a prime: all of them, and nothing else."""

import functools
import itertools
import operator

import numpy as np
import pytest
from tiers import tiered

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.generic_points import Undecided, Zero, zeros
from pinsing.algebra.ring import WORD_PRIME, modular_context

NAMES = "xyzu"


def ring(k):
    return modular_context(tuple(NAMES[:k]), WORD_PRIME)


def random_poly(degrees, rng):
    """All monomials up to these degrees, with random coefficients."""
    context = ring(len(degrees))
    terms = {
        m: int(rng.integers(1, WORD_PRIME))
        for m in itertools.product(*(range(d + 1) for d in degrees))
    }
    return context.from_dict(terms)


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
    x, y = ring(2).gens()
    assert solve([p, g, random_poly((1, 1), rng)]) == []
    assert count(solve([p * x + g, g * y + p, p + g])) == 8
    x, y, z = ring(3).gens()
    assert solve([z * z - 2, z * z - 3, x * y * z - 1]) == []
    assert solve([ring(1).constant(5)]) == []


def test_unwanted_zeros_are_left_out():
    x, y, z = ring(3).gens()
    circle = x * x + 1
    p = circle * (y - 2) + x * (y - 5)
    assert count(solve([p, y * z - 3, x * z - 7], {0: circle})) == count(
        [s for s in solve([p, y * z - 3, x * z - 7]) if not value(circle, s).is_zero()]
    )
    # A whole line of unwanted ones does not hide the others.
    found = solve(
        [(x - 1) * z - (x * x + 1), (x - 1) * (y - 4) + circle * z, circle * y], {0: circle}
    )
    assert all(value(y, s).is_zero() for s in found)
    assert count(found) > 0


def test_what_is_not_solved():
    x, y, z = ring(3).gens()
    for polys in ([x * y, x * (y - 1), z - 1], [x - y, 2 * x - 2 * y, z], [x, x * y, x * z]):
        with pytest.raises(Undecided):
            solve(polys)
    with pytest.raises(Undecided):
        solve([x - 1, ring(3).constant(0), y])
    spent = Budget(1e-9)
    rng = np.random.default_rng(6)
    with pytest.raises(BudgetExceeded):
        solve([random_poly((2, 2), rng) for _ in range(2)], check=spent.check)


@pytest.mark.slow
def test_a_system_that_is_too_large_is_not_solved():
    rng = np.random.default_rng(5)
    with pytest.raises(Undecided):
        solve([random_poly((6, 6, 6), rng) for _ in range(3)])
