"""Matrices of polynomials: determinants, rows that depend on each other, minors made once."""

import random
from fractions import Fraction

import pytest
from flint import fmpq, fmpq_mat
from singular_sets import ring_for

from pinsing import load
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import SearchPlace
from pinsing.algebra.jacobian_matrix import (
    Minors,
    determinant,
    independent_rows,
    jacobian_matrix,
    reduce_matrix,
)
from pinsing.algebra.ring import Ring, make_ring
from pinsing.robot.nominal import nominal
from pinsing.robot.surd import cosine

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
        kept = independent_rows(rows, ring)
        assert len(kept) == count
        assert all(row in rows for row in kept)


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
