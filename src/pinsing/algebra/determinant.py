"""Determinants of small matrices of polynomials, by expansion along rows.

Elimination multiplies minors with minors and divides again; expansion multiplies entries, which are
short, with minors. What minors of one matrix have in common is computed once: those of the last
rows, which all of them are made of.
"""

from __future__ import annotations

from collections.abc import Sequence

from pinsing.algebra.budget import Budget
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Poly, Ring

_MOST_KEPT = 100_000
"""Terms of minors that are kept at a time."""


class RowExpansion:
    """Minors of one matrix, each from smaller ones.

    Parameters
    ----------
    matrix : list of rows
        Polynomials.
    ring : Ring
        Of these.
    time : Budget
        Asked before each product.
    """

    def __init__(self, matrix: Matrix, ring: Ring, time: Budget) -> None:
        self.matrix, self.ring, self.time = matrix, ring, time
        filled = [sum(x != 0 for x in row) for row in matrix]
        # Rows with many zeros first: they ask for few minors of the others.
        self._order = sorted(range(len(matrix)), key=lambda i: filled[i])
        self._known: dict[tuple[tuple[int, ...], tuple[int, ...]], Poly] = {}
        self._kept = 0

    def minor(self, rows: Sequence[int], columns: Sequence[int]) -> Poly:
        """The minor of some rows and as many columns, both ascending.

        Raises
        ------
        BudgetExceeded
            If it would take longer than the budget allows.
        """
        if not rows:
            return self.ring.one
        if self._kept > _MOST_KEPT:
            self._known.clear()
            self._kept = 0
        ordered = tuple(i for i in self._order if i in rows)
        found = self._minor(ordered, tuple(columns))
        return -found if _odd([rows.index(i) for i in ordered]) else found

    def _minor(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Poly:
        first = self.matrix[rows[0]]
        if len(rows) == 1:
            return first[columns[0]]
        key = rows, columns
        if key in self._known:
            return self._known[key]
        total = self.ring.zero
        for k, j in enumerate(columns):
            x = first[j]
            if x == 0:
                continue
            rest = self._minor(rows[1:], columns[:k] + columns[k + 1 :])
            if rest == 0:
                continue
            self.time.check(len(x) * len(rest))
            product = x * rest
            total = total - product if k % 2 else total + product
        total = self.ring.reduce(total)
        self._known[key] = total
        self._kept += len(total)
        return total


def determinant(matrix: Matrix, ring: Ring, time: Budget) -> Poly:
    """Determinant of a square matrix.

    Raises
    ------
    BudgetExceeded
        If it would take longer than the budget allows.
    """
    every = range(len(matrix))
    return RowExpansion(matrix, ring, time).minor(every, every)


def _odd(places: Sequence[int]) -> bool:
    """Whether a permutation is odd."""
    return sum(a > b for i, a in enumerate(places) for b in places[i + 1 :]) % 2 == 1
