"""Determinants of polynomial matrices, and which of their rows depend on each other."""

import random
from fractions import Fraction

import pytest
from flint import fmpq, fmpq_mat

from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import determinant, independent_rows
from pinsing.algebra.ring import Ring, make_ring
from pinsing.robot.surd import surd

SLIDES = (False, False, True)
PLAIN = make_ring(SLIDES)
ROOTS = make_ring(
    SLIDES, [surd(*(Fraction(int(k == i)) for k in range(4))) for i in (1, 2)], Budget(60.0)
)


def entry(ring: Ring, draw: random.Random, terms: int = 2):
    """A short polynomial, often zero."""
    total = ring.zero
    for _ in range(draw.randint(0, terms)):
        product = ring.number(draw.randint(-3, 3))
        for x in ring.context.gens():
            product = product * x ** draw.choice([0, 0, 1])
        total = total + product
    return ring.reduce(total)


def matrix_of(ring: Ring, draw: random.Random, rows: int, columns: int):
    return [[entry(ring, draw) for _ in range(columns)] for _ in range(rows)]


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
def test_a_determinant_has_the_value_of_its_entries_determinant(size):
    draw = random.Random(size)
    for _ in range(6):
        matrix = matrix_of(PLAIN, draw, size, size)
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
        rows = [
            [x + own**k if j == 1 else x for j, x in enumerate(r)] for k, r in enumerate(free, 1)
        ]
        count = len(rows)
        for _ in range(draw.randint(0, 2)):
            factors = [draw.randint(-2, 2) for _ in range(count)]
            mixed = [
                ring.reduce(sum((f * r[j] for f, r in zip(factors, rows, strict=False)), ring.zero))
                for j in range(3)
            ]
            rows.insert(draw.randint(0, len(rows)), mixed)
        kept = independent_rows(rows, ring)
        assert len(kept) == count
        assert all(row in rows for row in kept)
