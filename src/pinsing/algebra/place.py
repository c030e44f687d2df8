"""Where a search is, and how many equations more there can be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Value


@dataclass(frozen=True, eq=False)
class SearchPlace:
    """Where the search is: some joints at values.

    Attributes
    ----------
    values : mapping of joint to Value
        These joints.
    matrix : Matrix
        What the matrix becomes there.
    rank : int
        Singular means: rank below this.
    limit : int
        Largest codimension of what is looked for; the joints at values count.
    """

    values: Mapping[int, Value]
    matrix: Matrix
    rank: int
    limit: int

    @property
    def room(self) -> int:
        """How many equations more there may be."""
        return max(0, self.limit - len(self.values))


def bound(matrix: Matrix, rank: int) -> int:
    """Largest codimension of a component of where a matrix is below a rank (Eagon, Northcott)."""
    return (len(matrix) - rank + 1) * (len(matrix[0]) - rank + 1)
