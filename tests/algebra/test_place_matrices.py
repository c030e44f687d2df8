"""Places of a search: each matrix and its minors made once, and as they are made anew."""

from fractions import Fraction

import pytest
from singular_sets import ring_for

from pinsing import load
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import SearchPlace
from pinsing.algebra.jacobian_matrix import Minors, jacobian_matrix, reduce_matrix
from pinsing.robot.nominal import nominal

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
