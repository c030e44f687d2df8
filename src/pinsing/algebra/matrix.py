"""Matrices of polynomials: smaller ones whose rank drops in the same places.

Constant entries are used up as pivots: what is left is a smaller matrix whose rank drops exactly
where that of the given one does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.algebra.ring import MadeOnce, Monomial, Poly, Ring

Matrix = list[list[Poly]]
_NO_CONSTANT = 1000
"""What a pivot that is no constant costs more."""
_Place = tuple[int, Monomial]  # column and monomial


def primitive(line: list[Poly], ring: Ring) -> list[Poly]:
    """Divide a row or column by the x^2 + y^2 that all its entries share."""
    filled = [x for x in line if x]
    if not filled or min(map(len, filled)) == 1:  # a multiple has two terms at least
        return line
    degrees = [x.degrees() for x in filled]
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
    own = _sharing(matrix, ring)
    gone = {own[i] for i in dependent([matrix[i] for i in own], ring)}
    return [row for i, row in enumerate(matrix) if i not in gone and any(x != 0 for x in row)]


def dependent(
    lines: Sequence[Sequence[Poly]], ring: Ring, check: Callable[[], None] = lambda: None
) -> dict[int, dict[int, Any]]:
    """Return lines that are sums of multiples of earlier ones that stay, and these multiples."""
    basis: list[tuple[_Place, dict[_Place, Any], dict[int, Any]]] = []
    found: dict[int, dict[int, Any]] = {}
    for i, line in enumerate(lines):
        check()
        vector: dict[_Place, Any] = {
            (j, m): c for j, x in enumerate(line) for m, c in ring.coefficients(x).items()
        }
        terms: dict[int, Any] = {}
        for lead, other, its_terms in basis:
            if lead in vector:
                check()
                ratio = vector[lead] / other[lead]
                for place, value in other.items():
                    vector[place] = vector.get(place, 0) - ratio * value
                vector = {k: v for k, v in vector.items() if v != 0}
                for k, value in its_terms.items():
                    terms[k] = terms.get(k, 0) - ratio * value
        if vector:
            basis.append((next(iter(vector)), vector, {i: 1, **terms}))
        else:
            found[i] = {k: -c for k, c in terms.items() if c != 0}
    return found


def _sharing(matrix: Matrix, ring: Ring) -> list[int]:
    """Return rows that may be combinations of others: these have all of their monomials."""
    places = {
        i: {(j, m) for j, x in enumerate(row) if x != 0 for m in ring.monomials(x)}
        for i, row in enumerate(matrix)
    }
    while True:
        counts = Counter(place for own in places.values() for place in own)
        left = {i: own for i, own in places.items() if all(counts[place] > 1 for place in own)}
        if len(left) == len(places):
            return list(left)
        places = left


def reduce_matrix(
    matrix: Matrix, rank: int, ring: Ring, time: Budget, generic: bool = False
) -> tuple[Matrix, int]:
    """Use up pivots that never vanish: the rest is below its rank exactly where the given is."""
    # If the rank is ``generic``, that at almost every point, as many rows are independent.
    rows = matrix
    if not (generic and len(rows) == rank):
        rows = independent_rows(matrix, ring)
    rows = _without_zeros(rows)
    never = MadeOnce()
    while rows and rank > 0:
        time.check()
        pivot = _unit(rows, ring, never)
        if pivot is None:
            break
        i, j = pivot
        p = rows[i][j]
        rest = []
        for k, row in enumerate(rows):
            if k == i:
                continue
            time.check()
            if not row[j]:
                rest.append([x for c, x in enumerate(row) if c != j])
            else:
                longest = max(map(len, row)) * len(p), len(row[j]) * max(map(len, rows[i]))
                time.check(max(longest))
                rest.append(
                    [ring.reduce(x * p - row[j] * rows[i][c]) for c, x in enumerate(row) if c != j]
                )
        rank -= 1
        rows = [primitive(row, ring) for row in rest if any(row)]
        if not (generic and len(rows) == rank):
            rows = independent_rows(rows, ring)
        if rows:
            columns = [primitive(list(c), ring) for c in zip(*_without_zeros(rows), strict=True)]
            rows = [list(row) for row in zip(*columns, strict=True)]
    return rows, rank


def _without_zeros(rows: Matrix) -> Matrix:
    """Drop columns of zeros: with them a bound on codimensions would be too large."""
    columns = [c for c in zip(*rows, strict=True) if any(x != 0 for x in c)]
    return [list(row) for row in zip(*columns, strict=True)]


def _unit(rows: Matrix, ring: Ring, never: MadeOnce) -> tuple[int, int] | None:
    """Return the position of an entry that vanishes nowhere, which disturbs the rest least."""
    # What is known of entries is kept in ``never``.
    in_row = [sum(map(len, row)) for row in rows]
    in_column = [sum(map(len, column)) for column in zip(*rows, strict=True)]
    best: tuple[int, int, int] | None = None
    for plain in (True, False):  # constants first: what else is one of them has a cost to beat
        if best is not None and best[0] < _NO_CONSTANT:
            break
        for i, row in enumerate(rows):
            for j, x in enumerate(row):
                if not x or ring.is_constant(x) is not plain:
                    continue
                cost = (in_column[j] - len(x)) * in_row[i] + (0 if plain else _NO_CONSTANT)
                if (best is None or (cost, i, j) < best) and never.of(x, ring.nowhere_zero):
                    best = (cost, i, j)
    return None if best is None else (best[1], best[2])
