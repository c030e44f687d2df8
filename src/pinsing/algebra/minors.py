"""Minors of a polynomial matrix, lazily."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from pinsing.algebra.budget import Budget
from pinsing.algebra.determinant import RowExpansion
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Poly, Ring

_LOOKED_AT = 12
"""Minors among which the simplest is looked for."""


class Minors:
    """Minors of one size of a matrix, computed as they are asked for, the simplest first."""

    def __init__(self, matrix: Matrix, size: int, ring: Ring, time: Budget) -> None:
        self.matrix, self.size, self.ring, self.time = matrix, size, ring, time
        length = [[len(x) for x in row] for row in matrix]
        choices = [
            (rows, columns)
            for rows in itertools.combinations(range(len(matrix)), size)
            for columns in itertools.combinations(range(len(matrix[0])), size)
        ]
        terms = {c: sum(length[i][j] for i in c[0] for j in c[1]) for c in choices}
        self._left = sorted(choices, key=lambda c: terms[c])
        self._done: list[Poly] = []
        self._expansion = RowExpansion(matrix, ring, time)

    def __len__(self) -> int:
        return len(self._done) + len(self._left)

    def __iter__(self) -> Iterator[Poly]:
        """All minors that are not identically zero."""
        i = 0
        while True:
            while i < len(self._done):
                yield self._done[i]
                i += 1
            if not self._left:
                return
            self._compute()

    def _compute(self) -> None:
        rows, columns = self._left[0]
        minor = self._expansion.minor(rows, columns)
        self._left.pop(0)
        if minor != 0:
            self._done.append(self.ring.strip(minor))

    def factors(self, poly: Poly) -> list[Poly]:
        """Irreducible factors of a polynomial of the ring, if there is time for them."""
        self.time.check_factor(len(poly), self.ring.long_to_factor(poly))
        return self.ring.factors(poly)

    def simplest_cofactor(self, common: Poly) -> list[Poly]:
        """Factors of the minor, over the common factor, that branches into the least work."""
        best: list[Poly] | None = None
        for minor in itertools.islice(self, _LOOKED_AT):
            factors = self.factors(self.ring.quotient(minor, common))
            if not factors:
                return []
            if best is None or cost(factors) < cost(best):
                best = factors
        return best or []

    def cutting(self, regular: Sequence[SlicePoint]) -> list[Poly] | None:
        """Factors of a minor that vanishes at none of some points, simple if there is a choice."""
        left = iter(self)
        while batch := list(itertools.islice(left, _LOOKED_AT)):
            for minor in sorted(batch, key=lambda m: self.effort(self.factors(m))):
                self.time.check()
                if not any(s.is_zero(minor) for s in regular):
                    return self.factors(minor)
        return None

    def effort(self, factors: list[Poly]) -> tuple[int, int]:
        """How much work it makes to cut with these factors; joint values make none."""
        return cost([f for f in factors if self.ring.joint_value(f) is None])


def cost(factors: list[Poly]) -> tuple[int, int]:
    """How much work branching on these factors makes."""
    return max((len(f) for f in factors), default=0), len(factors)
