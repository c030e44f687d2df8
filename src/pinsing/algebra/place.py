"""Where a search is, and how many equations more there can be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pinsing.algebra.generic_points import SlicePoint
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
    whole : (Matrix, int) or None
        The matrix and the rank that singular means, where ``matrix`` is a part of it only.
    """

    values: Mapping[int, Value]
    matrix: Matrix
    rank: int
    limit: int
    whole: tuple[Matrix, int] | None = None

    @property
    def judged(self) -> tuple[Matrix, int]:
        """The matrix that says what is singular, and the rank below which it is."""
        return self.whole or (self.matrix, self.rank)

    def singular(self, point: SlicePoint) -> bool:
        """Whether a point is singular."""
        matrix, rank = self.judged
        return point.rank(matrix) < rank

    def beside(self, matrix: Matrix, rank: int) -> SearchPlace:
        """The same place, looked at by a part of the matrix."""
        return replace(self, matrix=matrix, rank=rank, whole=self.judged)

    @property
    def room(self) -> int:
        """How many equations more there may be."""
        return max(0, self.limit - len(self.values))


def bound(matrix: Matrix, rank: int) -> int:
    """Largest codimension of a component of where a matrix is below a rank (Eagon, Northcott)."""
    return (len(matrix) - rank + 1) * (len(matrix[0]) - rank + 1)
