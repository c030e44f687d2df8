"""Places of a search: each matrix and its minors made once, and as they are made anew."""

from fractions import Fraction

import pytest
from singular_sets import ring_for

from pinsing import load
from pinsing.algebra.budget import Budget
from pinsing.algebra.decompose import PlaceMatrices, SearchPlace
from pinsing.algebra.jacobian_matrix import jacobian_matrix
from pinsing.algebra.matrix import reduce_matrix
from pinsing.algebra.minors import Minors
from pinsing.robot.nominal import nominal

STRAIGHT, BACK = (Fraction(1), Fraction(0)), (Fraction(0), Fraction(1))


@pytest.fixture
def places():
    """The places of an arm of seven joints, and where all of them are free."""
    arm = load("panda")
    geometry, time = nominal(arm), Budget(60)
    ring = ring_for(geometry)
    matrix = jacobian_matrix(geometry, ring, arm.task, time)
    return PlaceMatrices(ring, time), SearchPlace({}, matrix, 6, 2)


def test_a_place_that_is_come_to_again_has_the_same_matrix_and_minors(places):
    known, everywhere = places
    first, again = (known.at(everywhere, {1: STRAIGHT}) for _ in range(2))
    assert first.values == again.values == {1: STRAIGHT}
    assert first.matrix is again.matrix
    assert known.smaller(first)[0] is known.smaller(again)[0]
    assert known.minors(first) is known.minors(again)
    assert known.at(everywhere, {1: BACK}).matrix != first.matrix
    known, everywhere = places
    part = everywhere.beside([row[:3] for row in everywhere.matrix[:3]], 3)
    assert known.at(part, {1: STRAIGHT}).matrix is known.at(everywhere, {1: STRAIGHT}).matrix
    assert known.smaller(part)[0] is not known.smaller(everywhere)[0]


def test_what_is_known_is_what_is_made_anew(places):
    known, everywhere = places
    ring, time = known.ring, known.time
    for values in ({1: STRAIGHT}, {4: BACK}, {1: STRAIGHT, 5: BACK}):
        for _ in range(2):
            there = known.at(everywhere, values)
            put = ring.putting(values)
            assert there.matrix == [[put(x) for x in row] for row in everywhere.matrix]
            smaller, rank = known.smaller(there)
            assert (smaller, rank) == reduce_matrix(there.matrix, 6, ring, time)
            reduced = SearchPlace(values, smaller, rank, 2, reduced=True)
            assert known.smaller(reduced) == (smaller, rank)
            fresh = Minors(smaller, rank, ring, time)
            assert list(known.minors(reduced)) == list(fresh)
