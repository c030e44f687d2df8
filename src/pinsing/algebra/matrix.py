"""Matrices of polynomials: smaller ones whose rank drops in the same places, and determinants.

Constant entries are used up as pivots: what is left is a smaller matrix whose rank drops exactly
where that of the given one does.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.algebra.ring import Monomial, Poly, Ring

Matrix = list[list[Poly]]
_Place = tuple[int, Monomial]  # column and monomial


def primitive(line: list[Poly], ring: Ring) -> list[Poly]:
    """Divide a row or column by the x^2 + y^2 that all its entries share."""
    degrees = [x.degrees() for x in line if x != 0]
    if not degrees:
        return line
    for j, w in enumerate(ring.w):
        # Only what has both squares can be a multiple.
        if w is None or any(d[v] < 2 for v in ring.variables(j) for d in degrees):
            continue
        while True:
            parts = [divmod(x, w) for x in line]
            if any(r != 0 for _, r in parts):
                break
            line = [q for q, _ in parts]
    return line


def independent_rows(matrix: Matrix, ring: Ring) -> Matrix:
    """Drop rows that are combinations of others with constant factors: no rank is lost."""
    doubtful = _sharing(matrix, ring)
    basis: list[tuple[_Place, dict[_Place, Any]]] = []
    kept = []
    for i, row in enumerate(matrix):
        if i not in doubtful:
            kept.append(row)
            continue
        vector: dict[_Place, Any] = {
            (j, m): c for j, x in enumerate(row) for m, c in ring.coefficients(x).items()
        }
        for lead, other in basis:
            if lead in vector:
                ratio = vector[lead] / other[lead]
                for key, value in other.items():
                    vector[key] = vector.get(key, 0) - ratio * value
                vector = {k: v for k, v in vector.items() if v != 0}
        if vector:
            basis.append((next(iter(vector)), vector))
            kept.append(row)
    return kept


def _sharing(matrix: Matrix, ring: Ring) -> set[int]:
    """Rows that may be combinations of others: all of their monomials occur in others of these.

    A row with one that no other has is in no combination of zero.
    """
    places = {
        i: {(j, m) for j, x in enumerate(row) if x != 0 for m in ring.monomials(x)}
        for i, row in enumerate(matrix)
    }
    while True:
        counts = Counter(place for own in places.values() for place in own)
        left = {i: own for i, own in places.items() if all(counts[place] > 1 for place in own)}
        if len(left) == len(places):
            return set(left)
        places = left


def reduce_matrix(
    matrix: Matrix, rank: int, ring: Ring, time: Budget | None = None
) -> tuple[Matrix, int]:
    """Use up pivots that never vanish.

    Parameters
    ----------
    matrix : list of rows
        Polynomials.
    rank : int
        The rank below which the matrix is singular.

    Returns
    -------
    (matrix, rank)
        A smaller matrix that is below the smaller rank exactly where the given one is
        below the given one.
    """
    rows = _without_zeros(independent_rows(matrix, ring))
    while rows and rank > 0:
        if time is not None:
            time.check()
        pivot = _unit(rows, ring)
        if pivot is None:
            break
        i, j = pivot
        p = rows[i][j]
        rest = []
        for k, row in enumerate(rows):
            if k == i:
                continue
            if time is not None:
                time.check()
            if row[j] == 0:
                rest.append([x for c, x in enumerate(row) if c != j])
            else:
                rest.append(
                    [ring.reduce(x * p - row[j] * rows[i][c]) for c, x in enumerate(row) if c != j]
                )
        rank -= 1
        rows = [primitive(row, ring) for row in rest]
        rows = independent_rows([row for row in rows if any(x != 0 for x in row)], ring)
        if rows:
            columns = [primitive(list(c), ring) for c in zip(*_without_zeros(rows), strict=True)]
            rows = [list(row) for row in zip(*columns, strict=True)]
    return rows, rank


def _without_zeros(rows: Matrix) -> Matrix:
    """Drop columns of zeros: with them a bound on codimensions would be too large."""
    columns = [c for c in zip(*rows, strict=True) if any(x != 0 for x in c)]
    return [list(row) for row in zip(*columns, strict=True)]


def _unit(rows: Matrix, ring: Ring) -> tuple[int, int] | None:
    """Position of an entry that vanishes nowhere, the one that disturbs the rest least."""
    best: tuple[int, int, int] | None = None
    for i, row in enumerate(rows):
        in_row = sum(len(x) for x in row if x != 0)
        for j, x in enumerate(row):
            if x == 0 or not ring.nowhere_zero(x):
                continue
            plain = ring.is_constant(x)
            column = [other[j] for k, other in enumerate(rows) if k != i and other[j] != 0]
            cost = sum(len(c) for c in column) * in_row + (0 if plain else 1000)
            if best is None or cost < best[0]:
                best = (cost, i, j)
    return None if best is None else (best[1], best[2])


def determinant(matrix: Matrix, ring: Ring, budget: Budget) -> Poly:
    """Determinant by Bareiss' fraction-free elimination, sparsest rows first.

    Square roots are variables like others here, so that all divisions go without a remainder.

    Raises
    ------
    BudgetExceeded
        If it would take longer than the budget allows.
    """
    rows = [list(row) for row in matrix]
    size = len(rows)
    previous = ring.one
    sign = 1
    for k in range(size - 1):
        choice = min(
            ((len(rows[i][k]), i) for i in range(k, size) if rows[i][k] != 0), default=None
        )
        if choice is None:
            return ring.zero
        i = choice[1]
        if i != k:
            rows[k], rows[i] = rows[i], rows[k]
            sign = -sign
        pivot = rows[k][k]
        for i in range(k + 1, size):
            head = rows[i][k]
            for j in range(k + 1, size):
                budget.check(len(rows[i][j]) * len(pivot) + len(head) * len(rows[k][j]))
                value = rows[i][j] * pivot
                if head != 0 and rows[k][j] != 0:
                    value = value - head * rows[k][j]
                rows[i][j] = value / previous if k else value
        previous = pivot
    return ring.reduce(rows[-1][-1] * sign)
