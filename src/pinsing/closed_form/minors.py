"""Minors of a polynomial matrix, lazily."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from pinsing.closed_form.budget import Budget
from pinsing.closed_form.columns import Matrix, determinant
from pinsing.closed_form.ring import Poly, Ring


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
        cost = {c: sum(length[i][j] for i in c[0] for j in c[1]) for c in choices}
        self._left = sorted(choices, key=lambda c: cost[c])
        self._done: list[Poly] = []

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
        chosen = [[self.matrix[i][j] for j in columns] for i in rows]
        minor = determinant(chosen, self.ring, self.time)
        self._left.pop(0)
        if minor != 0:
            self._done.append(self.ring.strip(minor))
