"""Random slices modulo a prime: the points that they must meet, and their ranks."""

from fractions import Fraction

import numpy as np
import pytest

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import decompose
from pinsing.algebra.generic_points import Residues, slice_points
from pinsing.algebra.ring import make_ring


@pytest.fixture
def ring():
    return make_ring((False, False, False, True))


def points(*polys, ring, values=None):
    rng = np.random.default_rng(1)
    return list(slice_points(polys, Residues(ring), rng, values or {}, lambda products: None))


def degrees(found):
    """Number of points, conjugates counted one by one."""
    return sum(s.field.degree() for s in found)


def test_the_common_zeros_are_met(ring):
    x1, y1, x2, y2, x3, y3, z = ring.context.gens()
    p, g = x1 * y2 - 3 * x2 * y1, z * x1 - 2 * y1
    found = points(p, g, ring=ring)
    # (q1, q2): z fixed gives one q1 and with it one q2; (q1, z): one; (q2, z): one.
    assert degrees(found) == 3
    for s in found:
        assert s.is_zero(p)
        assert s.is_zero(g)
        assert s.is_zero(p * x3 + g * y3)
        assert not s.is_zero(x1 * y2 - 2 * x2 * y1)
        assert (s.rank([[p, x1], [g, y1]]), s.rank([[p, x1], [y1, g]])) == (1, 2)
        assert s.transversal((p, g))


def test_special_points(ring):
    x1, y1, x2, y2, x3, y3, _ = ring.context.gens()
    p = x1**2 * y2 + 3 * y1**2 * x2 + 5 * x1 * y1 * x2 - 7 * x1**2 * x2
    g = x1 * x2**2 + 11 * y1 * y2**2 - 2 * x1 * y2 * x2 + 13 * y1 * x2**2
    assert degrees(points(p, g, ring=ring)) == 5  # Bezout: 2 * 2 + 1 * 1
    found = points(x1 * 5 - y1 * 2, x2**2 - 3 * y2**2 + x1**2 * 0, ring=ring)
    assert degrees(found) == 2
    assert all(s.has(0, (Fraction(2), Fraction(5))) for s in found)
    assert not any(s.has(0, (Fraction(2), Fraction(-5))) for s in found)
    line, parabola = y2, y2 * x1**2 - y1**2 * x2  # u = 0 and u = t^2
    found = points(line, parabola, ring=ring)
    assert degrees(found) == 1
    assert not found[0].transversal((line, parabola))
    assert found[0].has(0, (Fraction(1), Fraction(0)))
    # x1^2 + y1^2 vanishes where p and g do
    p = x1 * x2 + y1 * y2
    g = x1 * y2 - y1 * x2
    assert points(p, g, ring=ring) == []
    found = points(x1 - 2 * y1, x2 * y3 - x3 * y2, ring=ring)  # never both in (q2, q3) alone
    assert degrees(found) == 2  # (q1, q2) and (q1, q3)


@pytest.mark.parametrize("said", [1, 3])
def test_a_generic_rank_that_is_wrong_is_noticed(said):
    """The matrix has rank 2: its last row is the sum of multiples of the others."""
    ring = make_ring((False, False))
    x1, y1, x2, y2 = ring.context.gens()
    first, second = [x1, y1, x2], [y2, x1, y1]
    third = [x2 * a + y1 * b for a, b in zip(first, second, strict=True)]
    matrix = [first, second, third]
    right = decompose(lambda: matrix, 2, ring, Budget(30.0))
    assert not any("generic rank" in gap for gap in right.gaps)
    wrong = decompose(lambda: matrix, said, ring, Budget(30.0))
    assert any("generic rank" in gap for gap in wrong.gaps)
