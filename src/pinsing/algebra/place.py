"""Where a search is, and how many equations more there can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pinsing._dataclass import dataclass
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Poly, Ring, Value


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
    reduced : bool
        Whether all pivots of the matrix are used up, and its rows are independent.
    whole : SearchPlace or None
        The place with the matrix that says what is singular, where ``matrix`` is a part of it.
    """

    values: Mapping[int, Value]
    matrix: Matrix
    rank: int
    limit: int
    reduced: bool = False
    whole: SearchPlace | None = None

    @property
    def judge(self) -> SearchPlace:
        """The place that says what is singular."""
        return self.whole or self

    def singular(self, point: SlicePoint) -> bool:
        """Whether a point is singular."""
        return point.rank(self.judge.matrix) < self.judge.rank

    def beside(self, matrix: Matrix, rank: int) -> SearchPlace:
        """The same place, looked at by a part of the matrix."""
        return replace(self, matrix=matrix, rank=rank, reduced=False, whole=self.judge)

    def zeroed(self, relations: Sequence[Poly], ring: Ring) -> SearchPlace:
        """The same place with entries that are multiples of some equations at zero.

        They are, where these hold; minors fall into factors so.
        """
        matrix = [
            [
                ring.zero
                if x != 0 and any(len(r) <= len(x) and ring.divides(r, x) for r in relations)
                else x
                for x in row
            ]
            for row in self.matrix
        ]
        return self if matrix == self.matrix else self.beside(matrix, self.rank)

    @property
    def room(self) -> int:
        """How many equations more there may be."""
        return max(0, self.limit - len(self.values))


def bound(matrix: Matrix, rank: int) -> int:
    """Largest codimension of a component of where a matrix is below a rank (Eagon, Northcott)."""
    return (len(matrix) - rank + 1) * (len(matrix[0]) - rank + 1)
