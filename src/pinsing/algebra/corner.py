"""A square corner of a matrix beside which some rows are zero.

With the rows and columns in the right order the matrix is [[B, C], [0, D]], B square. Where det B
is not zero its rank is that of B and D together; and where the rank of D is short, so is that of
the whole, whatever B is. So the whole drops its rank where D does, and elsewhere only where
det B = 0: two smaller questions instead of one whose minors mix them.

Axes of a chain give such corners: parallel ones have no part along their common direction, one
through the reference point moves it nowhere.
"""

from __future__ import annotations

import itertools

from pinsing._dataclass import dataclass
from pinsing.algebra.budget import Budget
from pinsing.algebra.determinant import determinant
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Poly, Ring


@dataclass(frozen=True, eq=False)
class SquareCorner:
    """A corner B of a matrix.

    Attributes
    ----------
    rows, columns : tuples of int
        Of B, which is square; the other rows are zero in these columns.
    determinant : Poly
        Of B, without factors that are nowhere zero.
    rest : Matrix
        D: the other rows in the other columns.
    """

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    determinant: Poly
    rest: Matrix


def corner(matrix: Matrix, ring: Ring, time: Budget) -> SquareCorner | None:
    """The smallest square corner beside which rows are zero, the shortest of these.

    Raises
    ------
    BudgetExceeded
        If its determinant would take too long.
    """
    support = [
        frozenset(i for i, row in enumerate(matrix) if row[j] != 0) for j in range(len(matrix[0]))
    ]
    for size in range(1, len(matrix)):
        found = [
            (sum(len(matrix[i][j]) for j in columns for i in used), sorted(used), columns)
            for columns in itertools.combinations(range(len(support)), size)
            if len(used := frozenset().union(*(support[j] for j in columns))) == size
        ]
        if found:
            _, rows, columns = min(found)
            square = [[matrix[i][j] for j in columns] for i in rows]
            return SquareCorner(
                tuple(rows),
                columns,
                ring.strip(determinant(square, ring, time)),
                [
                    [x for j, x in enumerate(row) if j not in columns]
                    for i, row in enumerate(matrix)
                    if i not in rows
                ],
            )
    return None
