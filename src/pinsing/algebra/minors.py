"""Minors of a polynomial matrix, lazily."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.jacobian_matrix import jacobian_matrix, neighbouring_screws
from pinsing.algebra.matrix import Matrix, reduce_matrix
from pinsing.algebra.mimic import Drive, driven_by, drives
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.robot.nominal import Nominal
from pinsing.robot.task import Task


class RowExpansion:
    """Minors of one matrix, each from smaller ones, until the time is over."""

    def __init__(self, matrix: Matrix, ring: Ring, time: Budget) -> None:
        self.matrix, self.ring, self.time = matrix, ring, time
        filled = [sum(x != 0 for x in row) for row in matrix]
        # Rows with many zeros first: they ask for few minors of the others.
        self._order = sorted(range(len(matrix)), key=lambda i: filled[i])
        self._known: dict[tuple[tuple[int, ...], tuple[int, ...]], Poly] = {}
        self._kept = 0

    def minor(self, rows: Sequence[int], columns: Sequence[int]) -> Poly:
        """The minor of some rows and as many columns, both ascending."""
        if not rows:
            return self.ring.one
        # Terms of minors that are kept at a time.
        if self._kept > 100_000:
            self._known.clear()
            self._kept = 0
        ordered = tuple(i for i in self._order if i in rows)
        found = self._minor(ordered, tuple(columns))
        swaps = sum(a > b for k, a in enumerate(ordered) for b in ordered[k + 1 :])
        return -found if swaps % 2 else found

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
    """Determinant of a square matrix."""
    every = range(len(matrix))
    return RowExpansion(matrix, ring, time).minor(every, every)


@dataclass(frozen=True, eq=False)
class SquareCorner:
    """A corner B of a matrix."""

    # rows and columns: of B, which is square; the other rows are zero in these columns
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    determinant: Poly  # of B, without factors that are nowhere zero
    rest: Matrix  # d: the other rows in the other columns


def corner(matrix: Matrix, ring: Ring, time: Budget) -> SquareCorner | None:
    """The smallest square corner beside which rows are zero, the shortest of these."""
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


_LOOKED_AT = 12
"""Minors among which the simplest is looked for."""


class Minors:
    """A matrix, and its minors of one size, computed as they are asked for, the simplest first.

    Where all of them vanish its rank is below their size. What is made of it is made once.
    """

    def __init__(self, matrix: Matrix, size: int, ring: Ring, time: Budget) -> None:
        self.matrix, self.size, self.ring, self.time = matrix, size, ring, time
        self._done: list[Poly] = []
        self._put: dict[object, Minors] = {}
        self._expansion = RowExpansion(matrix, ring, time)

    @classmethod
    def reduced(
        cls, matrix: Matrix, size: int, ring: Ring, time: Budget, generic: bool = False
    ) -> Minors:
        """Those of what `reduce_matrix` makes of a matrix: none smaller is to be had."""
        found = cls(*reduce_matrix(matrix, size, ring, time, generic), ring, time)
        found.smaller = found
        return found

    @cached_property
    def smaller(self) -> Minors:
        """Those of a smaller matrix whose rank drops in the same places."""
        return Minors.reduced(self.matrix, self.size, self.ring, self.time)

    def at(self, values: Mapping[int, Value]) -> Minors:
        """Those of the matrix with some joints at values."""
        key = frozenset(values.items())
        if key not in self._put:
            put = self.ring.putting(values)
            rows = [[put(x) for x in row] for row in self.matrix]
            self._put[key] = Minors(rows, self.size, self.ring, self.time)
        return self._put[key]

    @property
    def short(self) -> int:
        """The largest rank that the matrix may have: the lesser of its numbers of rows, columns."""
        return min(len(self.matrix), len(self.matrix[0])) if self.matrix else 0

    @property
    def bound(self) -> int:
        """Largest codimension of a component of where all vanish (Eagon, Northcott)."""
        return (len(self.matrix) - self.size + 1) * (len(self.matrix[0]) - self.size + 1)

    @cached_property
    def _left(self) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
        """Rows and columns of those that were not computed, the shortest first."""
        length = [[len(x) for x in row] for row in self.matrix]
        sides = len(self.matrix), len(self.matrix[0])
        rows, columns = (itertools.combinations(range(k), self.size) for k in sides)
        return sorted(
            itertools.product(rows, columns),
            key=lambda c: sum(length[i][j] for i in c[0] for j in c[1]),
        )

    def __iter__(self) -> Iterator[Poly]:
        """All minors that are not identically zero."""
        i = 0
        while True:
            while i < len(self._done):
                yield self._done[i]
                i += 1
            if not self._left:
                return
            minor = self._expansion.minor(*self._left[0])
            del self._left[0]
            if minor != 0:
                self._done.append(self.ring.strip(minor))

    def simplest_cofactor(self, common: Poly) -> list[Poly]:
        """Factors of the minor, over the common factor, that branches into the least work."""
        best: list[Poly] | None = None
        for minor in itertools.islice(self, _LOOKED_AT):
            factors = self.ring.factors(self.ring.quotient(minor, common), self.time)
            if not factors:
                return []
            if best is None or cost(factors) < cost(best):
                best = factors
        return best or []

    def cutting(self, regular: Sequence[SlicePoint]) -> list[Poly] | None:
        """Factors of a minor that vanishes at none of some points, simple if there is a choice."""
        left = iter(self)
        while batch := list(itertools.islice(left, _LOOKED_AT)):
            for minor in sorted(batch, key=lambda m: self.effort(self.ring.factors(m, self.time))):
                self.time.check()
                if not any(s.is_zero(minor) for s in regular):
                    return self.ring.factors(minor, self.time)
        return None

    def effort(self, factors: list[Poly]) -> tuple[int, int]:
        """Return how much work it makes to cut with these factors; joint values make none."""
        return cost([f for f in factors if self.ring.joint_value(f) is None])


def cost(factors: list[Poly]) -> tuple[int, int]:
    """Return how much work branching on these factors makes."""
    return max((len(f) for f in factors), default=0), len(factors)


class NotSquare(Exception):
    """The task has more rows than its rank, and no constant combination of them is zero."""


class NearMinors:
    """Minors of as many columns as the whole chain's generic rank, at values of some joints."""

    def __init__(self, geometry: Nominal, ring: Ring, task: Task, rank: int, time: Budget) -> None:
        self.geometry, self.ring, self.task, self.rank, self.time = geometry, ring, task, rank, time
        self._screws: dict[tuple[int, ...], Matrix] = {}
        self._known: dict[object, Poly] = {}

    @cached_property
    def _whole(self) -> Matrix:
        return jacobian_matrix(self.geometry, self.ring, self.task, self.time)

    @cached_property
    def _driven(self) -> tuple[Drive, ...]:
        return drives(self.geometry)[0]

    def minor(self, joints: Sequence[int], values: Mapping[int, Value]) -> Poly:
        """Return the minor of columns ``joints``, without units; NotSquare if there are several."""
        joints = sorted(joints)
        inside = {j: v for j, v in values.items() if self._matters(j, joints)}
        key = (tuple(joints), frozenset(inside.items()))
        if key not in self._known:
            self.time.check()
            self._known[key] = self._minor(joints, inside)
        return self._known[key]

    def _matters(self, j: int, joints: Sequence[int]) -> bool:
        if self.task.name != "pose":
            return True
        rows = [row for a in joints for row in driven_by(self._driven, a)]
        return any(d.leader == j for d in self._driven[min(rows) + 1 : max(rows)])

    def _minor(self, joints: Sequence[int], values: Mapping[int, Value]) -> Poly:
        ring = self.ring
        if self.task.name == "pose":
            chosen = tuple(joints)
            if chosen not in self._screws:
                self._screws[chosen] = neighbouring_screws(self.geometry, ring, joints, self.time)
            matrix = self._screws[chosen]
        else:
            matrix = [[row[j] for j in joints] for row in self._whole]
        small = Minors(matrix, self.rank, ring, self.time).at(values).smaller
        if small.size == 0:
            return ring.one
        if small.short < small.size:
            return ring.zero
        if len(small.matrix) > small.size:
            raise NotSquare
        return ring.strip(determinant(small.matrix, ring, self.time))
