"""The task Jacobian as a matrix of polynomials.

Every column is the joint's screw written in a frame in the middle of the chain (for the
full pose; the rank does not depend on the frame), times a product of x^2 + y^2, which no
real angle makes zero.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.algebra.matrix import Matrix, primitive
from pinsing.algebra.mimic import driven_by, drives
from pinsing.algebra.ring import Poly, Ring
from pinsing.robot.nominal import Matrix as Rotation, Nominal
from pinsing.robot.surd import Exact
from pinsing.robot.task import Task


def in_axes(task: Task, at_tip: bool) -> tuple[int, ...]:
    """Rows whose set depends on axes, of those in base axes or those in the tip's."""
    return tuple(
        r
        for r, tip in zip(task.rows, task.tip_rows, strict=True)
        if tip is at_tip and not set(range(r - r % 3, r - r % 3 + 3)) <= set(task.rows)
    )


def round_about(rows: Sequence[int]) -> tuple[int, ...]:
    """Axes, out of 0, 1, 2, under turns about which a set of rows stays the same."""
    return tuple(k for k in range(3) if all(_closed(rows, first, k) for first in (0, 3)))


def _closed(rows: Sequence[int], first: int, axis: int) -> bool:
    others = {first, first + 1, first + 2} - {first + axis}
    return others <= set(rows) or not others & set(rows)


def tip_axes(geometry: Nominal, task: Task) -> tuple[Rotation, bool]:
    """Return the rotation of the tip's axes behind the last joint, and if its turn is no matter."""
    # Where only the axis of that joint counts, the others are as simple as can be.
    rotation = geometry.tip_rotation
    for k in round_about(in_axes(task, True)):
        sign = _along_z(rotation, k, row=False)
        if sign:
            return _simple(k, sign), True
    return rotation, False


def _along_z(rotation: Rotation, k: int, row: bool) -> int:
    """1 or -1 if axis k of the rotation's outer (or inner) frame is the joint's, else 0."""
    line: list[Exact] = [rotation[k][i] if row else rotation[i][k] for i in range(3)]
    if line[0] != 0 or line[1] != 0:
        return 0
    return 1 if line[2] == 1 else -1


def _simple(k: int, sign: int) -> Rotation:
    """A rotation whose column k is z, or minus z."""
    one, zero = Fraction(1), Fraction(0)
    columns: list[list[Exact]] = [[zero] * 3 for _ in range(3)]
    columns[k] = [zero, zero, one * sign]
    columns[(k + 1) % 3] = [one, zero, zero]
    columns[(k + 2) % 3] = [zero, one * sign, zero]
    rows = [tuple(c[i] for c in columns) for i in range(3)]
    return rows[0], rows[1], rows[2]  # type: ignore[return-value]


Row = list[Poly]


@dataclass(frozen=True)
class RigidMotion:
    """Rigid motion with a common denominator: rotation R / d and position p / d."""

    R: Matrix
    p: list[Poly]
    d: Poly


class _Chain:
    """Poses along the nominal chain, as polynomials: each product asks the time first."""

    def __init__(
        self, geometry: Nominal, ring: Ring, time: Budget, leaders: Sequence[int] | None = None
    ) -> None:
        self.ring, self.geometry, self.time = ring, geometry, time
        self.n = len(geometry.prismatic)
        self.drives, _ = drives(geometry)
        self.placed, self.moved = functools.cache(self._placed), functools.cache(self._moved)
        if leaders is not None:
            self.drives = tuple(replace(d, leader=leaders[d.leader]) for d in self.drives)

    def of(self, x: Poly, y: Poly) -> Poly:
        """X times y."""
        self.time.check(len(x) * len(y))
        return x * y

    def dot(self, a: Sequence[Poly], b: Sequence[Poly]) -> Poly:
        """Sum of the products of pairs."""
        total = self.ring.zero
        for x, y in zip(a, b, strict=True):
            if x and y:
                total = total + self.of(x, y)
        return self.ring.reduce(total)

    def cross(self, a: Sequence[Poly], b: Sequence[Poly]) -> list[Poly]:
        """A x b."""
        turned = ((1, 2), (2, 0), (0, 1))
        return [self.ring.reduce(self.of(a[i], b[j]) - self.of(a[j], b[i])) for i, j in turned]

    def _placed(self, i: int) -> RigidMotion:
        """Constant placement C_i."""
        number = self.ring.number
        R = [[number(x) for x in row] for row in self.geometry.rotation[i]]
        lengths: Sequence[Any] = self.geometry.translation[i]  # or polynomials, of symbols
        known = [number(x) if isinstance(x, Fraction) else x for x in lengths]
        return RigidMotion(R, known, self.ring.one)

    def _moved(self, j: int) -> RigidMotion:
        """Motion M_j of joint j of the chain."""
        one, zero = self.ring.one, self.ring.zero
        gens, number = self.ring.context.gens(), self.ring.number
        drive = self.drives[j]
        v = self.ring.variables(drive.leader)
        if self.geometry.prismatic[j]:
            eye = [[one if a == b else zero for b in range(3)] for a in range(3)]
            along = gens[v[0]] * number(drive.multiple) + number(drive.shift)
            return RigidMotion(eye, [zero, zero, along], one)
        c, s, w = one, zero, one
        if drive.multiple:  # one that stands still may have a leader of any kind
            x, y = gens[v[0]], gens[v[1]]
            y = y if drive.multiple > 0 else -y
            once = x * x - y * y, 2 * x * y, x * x + y * y
            for _ in range(abs(int(drive.multiple))):
                c, s, w = c * once[0] - s * once[1], c * once[1] + s * once[0], w * once[2]
        a, b = (number(value) for value in drive.turn)
        c, s = self.ring.reduce(c * a - s * b), self.ring.reduce(c * b + s * a)
        return RigidMotion([[c, -s, zero], [s, c, zero], [zero, zero, w]], [zero, zero, zero], w)

    def tip(self, middle: int) -> tuple[list[Poly], Poly]:
        """The tip's position in the frame of joint ``middle`` before its motion, over a scale."""
        p, scale = [self.ring.zero] * 3, self.ring.one
        for k in range(self.n - 1, middle - 1, -1):
            for pose in (self.placed(k + 1), self.moved(k)):
                moved = zip(pose.R, pose.p, strict=True)
                p = [self.dot(row, p) + self.ring.reduce(self.of(x, scale)) for row, x in moved]
                scale = self.of(scale, pose.d)
        return p, scale

    def screw(self, j: int, middle: int) -> tuple[list[Poly], list[Poly]]:
        """Return the screw (v, w) of joint j, seen from joint ``middle``."""
        axis = [self.ring.zero, self.ring.zero, self.ring.one]
        none = [self.ring.zero] * 3
        v, w = (axis, none) if self.geometry.prismatic[j] else (none, axis)
        return self.seen(v, w, j, middle)

    def seen(
        self, v: list[Poly], w: list[Poly], j: int, middle: int, still: bool = False
    ) -> tuple[list[Poly], list[Poly]]:
        """A screw of the frame of joint j, in that of joint ``middle`` before its motion.

        Up to a factor that no real angle makes zero. Carried step by step: that is two vectors to
        turn, where a pose has three columns and a position. It moves with joint j, or is ``still``.
        """
        for k in range(j - 1, middle - 1, -1):
            for pose in (self.placed(k + 1), self.moved(k)):
                v, w = ([self.dot(row, x) for row in pose.R] for x in (v, w))
                v = self._shifted(v, pose.p, w, 1)
        for k in range(j, middle):
            for pose in (self.moved(k), self.placed(k + 1))[0 if k > j or still else 1 :]:
                v = self._shifted(v, pose.p, w, -1)
                columns = list(zip(*pose.R, strict=True))
                v, w = ([self.dot(column, x) for column in columns] for x in (v, w))
        return v, w

    def _shifted(self, v: list[Poly], p: list[Poly], w: list[Poly], sign: int) -> list[Poly]:
        """V + p x w, or v - p x w: motions here turn or shift, so that p is over one."""
        if not any(p) or not any(w):
            return v
        turned = self.cross(p, w)
        return [a + b if sign > 0 else a - b for a, b in zip(v, turned, strict=True)]

    def scale(self, j: int, middle: int) -> Poly:
        """What ``screw`` is over: x^2 + y^2 of each joint that turns on the way."""
        scale = self.ring.one
        for k in range(j + 1, middle) if j < middle else range(middle, j):
            scale = self.of(scale, self.moved(k).d)
        return scale

    def directions(self, middle: int, task: Task) -> dict[int, Row]:
        """For each row that axes matter to, its direction, up to a factor that is never zero."""
        rotation, base = self.geometry.rotation[0], in_axes(task, False)
        # Whether the first joint's turn leaves the rows in base axes the same set.
        about = any(_along_z(rotation, k, row=True) for k in round_about(base))
        # The last placement does not turn: behind the last motion is where the tip is.
        turn, whole = tip_axes(self.geometry, task)
        end, columns = self.n - 1 if whole else self.n, list(zip(*turn, strict=True))
        from_base = {r: (rotation[r % 3], 0, not about) for r in base}
        axes = from_base | {r: (columns[r % 3], end, False) for r in in_axes(task, True)}
        none, number = [self.ring.zero] * 3, self.ring.number
        return {
            r: self.seen(none, [number(x) for x in axis], j, middle, still)[1]
            for r, (axis, j, still) in axes.items()
        }

    def columns(
        self, joints: Sequence[int], middle: int, rows: Callable[[Row, Row], Row]
    ) -> Matrix:
        """Columns of some of the arm's joints: ``rows`` of screws (v, w), up to factors."""
        out = []
        for joint in joints:
            self.time.check()
            moved = driven_by(self.drives, joint)
            found = [rows(*self.screw(j, middle)) for j in moved]
            total = found[0]
            if len(moved) > 1:  # a joint and its followers, each over a scale of its own
                scales = [self.scale(j, middle) for j in moved]
                total = [self.ring.zero] * len(total)
                for i, (j, column) in enumerate(zip(moved, found, strict=True)):
                    factors = [self.ring.number(self.drives[j].multiple), *scales]
                    factor = functools.reduce(self.of, factors[: i + 1] + factors[i + 2 :])
                    both = zip(total, column, strict=True)
                    total = [self.ring.reduce(t + self.of(x, factor)) for t, x in both]
            out.append(primitive(total, self.ring))
        return [list(row) for row in zip(*out, strict=True)]


def constants(geometry: Nominal, task: Task) -> list[Exact]:
    """The numbers of the geometry that the task Jacobian has in it, up to its rank."""
    first = 0 if in_axes(task, False) else 1
    placed = [x for R in geometry.rotation[first:] for row in R for x in row]
    if in_axes(task, True):
        placed += [x for row in tip_axes(geometry, task)[0] for x in row]
    return placed + [x for drive in drives(geometry)[0] for x in drive.turn]


def jacobian_matrix(
    geometry: Nominal, ring: Ring, task: Task, time: Budget, leaders: Sequence[int] | None = None
) -> Matrix:
    """Return the task Jacobian as polynomials, up to nonzero row operations and column factors.

    Columns are in the order of the ring's joints: ``leaders`` says which of these each joint of the
    chain is, where they do not stand there in the chain's order.

    The reference point is moved into the chain only for the full pose, and the axes only for all
    translations or all rotations: elsewhere the rank depends on them. A joint with mimic joints has
    the sum of their columns, by the chain rule; NotFollowed if one is no polynomial.
    """
    chain = _Chain(geometry, ring, time, leaders)
    joints, middle = sorted({drive.leader for drive in chain.drives}), chain.n // 2
    if task.name == "pose":
        return chain.columns(joints, middle, operator.add)
    directions = chain.directions(middle, task)
    tip, over = chain.tip(middle) if min(task.rows) < 3 else ([], ring.one)

    def rows(v: Row, w: Row) -> Row:
        if tip and any(w):  # of the tip, where ``v`` is of the frame's origin
            levered = zip(v, chain.cross(w, tip), strict=True)
            v, w = [chain.of(a, over) + b for a, b in levered], [chain.of(x, over) for x in w]
        six = v + w
        return [
            chain.dot(directions[r], v if r < 3 else w) if r in directions else six[r]
            for r in task.rows
        ]

    return chain.columns(joints, middle, rows)


def neighbouring_screws(
    geometry: Nominal, ring: Ring, joints: Sequence[int], time: Budget
) -> Matrix:
    """Return screws of some of the arm's joints as columns (6, k), in the frame of a middle one.

    Up to row operations and column factors that are nowhere zero. Those of neighbours are short:
    only what moves between the first and the last occurs. Mimic joints are as of `jacobian_matrix`.
    """
    chain = _Chain(geometry, ring, time)
    every = sorted(j for a in joints for j in driven_by(chain.drives, a))
    return chain.columns(joints, every[len(every) // 2], operator.add)
