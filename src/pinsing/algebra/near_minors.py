"""Minors of the Jacobian of few neighbouring joints: short ones, however long the chain is.

Six neighbouring axes depend on each other where one polynomial in the four joints between them is
zero; the joints before, behind and beside them do not occur. Written in a frame in the middle of
the chain the same minors would have all joints from there. With mimic joints a joint has the sum of
their axes, and what moves between the first and the last of these occurs as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pinsing.algebra.budget import Budget
from pinsing.algebra.determinant import determinant
from pinsing.algebra.jacobian_matrix import jacobian_matrix, neighbouring_screws
from pinsing.algebra.matrix import Matrix, reduce_matrix
from pinsing.algebra.mimic import Drive, driven_by, drives
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.robot.nominal import Nominal
from pinsing.robot.task import Task


class NotSquare(Exception):
    """The task has more rows than its rank, and no constant combination of them is zero."""


class NearMinors:
    """Minors of as many columns as the rank, at values of some joints.

    Parameters
    ----------
    geometry : Nominal
        The chain.
    ring : Ring
        Of its polynomials.
    task : Task
        Rows.
    rank : int
        The generic rank of the whole chain.
    time : Budget
        Asked before long steps.
    """

    def __init__(self, geometry: Nominal, ring: Ring, task: Task, rank: int, time: Budget) -> None:
        self.geometry, self.ring, self.task, self.rank, self.time = geometry, ring, task, rank, time
        self._whole: Matrix | None = None
        self._screws: dict[tuple[int, ...], Matrix] = {}
        self._driven: tuple[Drive, ...] | None = None
        self._known: dict[object, Poly] = {}

    def minor(self, joints: Sequence[int], values: Mapping[int, Value]) -> Poly:
        """The minor of the columns of ``joints``, without factors that are nowhere zero.

        Raises
        ------
        BudgetExceeded
            If it would take too long.
        NotSquare
            If it is not one minor but several.
        """
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
        if self._driven is None:
            self._driven = drives(self.geometry)[0]
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
            if self._whole is None:
                self._whole = jacobian_matrix(self.geometry, ring, self.task, self.time)
            matrix = [[row[j] for j in joints] for row in self._whole]
        put = ring.putting(values)
        matrix = [[put(x) for x in row] for row in matrix]
        rows, rank = reduce_matrix(matrix, self.rank, ring, self.time)
        if rank == 0:
            return ring.one
        if min(len(rows), len(rows[0]) if rows else 0) < rank:
            return ring.zero
        if len(rows) > rank:
            raise NotSquare
        return ring.strip(determinant(rows, ring, self.time))
