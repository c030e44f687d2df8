"""The exact chain of an arm, and how its axes lie: parallel, crossing, through one point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from pinsing._types import Array
from pinsing.robot.exact_placements import Length3, Matrix
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import Exact

Vector = tuple[Exact, Exact, Exact]


@dataclass(frozen=True, eq=False)
class ExactChain:
    """Placements between joints that turn about z, or slide along it, as exact numbers."""

    # of placement i, which stands before joint i; the last before the tip
    rotation: tuple[Matrix, ...]
    translation: tuple[Length3 | Vector, ...]  # of the same, metres
    prismatic: tuple[bool, ...]  # which joints slide
    # by which joint values are multiplied: -1 for a chain that is read from tip to base
    sign: float
    order: tuple[int, ...]  # the arm's joint at each place
    offset: Array  # (n,): added to the values of the arm's joints, radians

    @classmethod
    def of(cls, nominal: Nominal) -> ExactChain:
        """The chain from base to tip."""
        n = len(nominal.prismatic)
        return cls(
            nominal.rotation,
            nominal.translation,
            nominal.prismatic,
            1.0,
            tuple(range(n)),
            nominal.offset,
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    def backward(self) -> ExactChain:
        """The chain from tip to base: the same arm, with its tip held and its base moved."""
        turned = tuple(_transposed(R) for R in self.rotation[::-1])
        moved = tuple(
            _negated(apply(R, t)) for R, t in zip(turned, self.translation[::-1], strict=True)
        )
        return ExactChain(
            turned, moved, self.prismatic[::-1], -self.sign, self.order[::-1], self.offset
        )

    def values(self, Q: Array) -> Array:
        """Joint values (..., n) in the order and with the zeros of this chain."""
        return self.sign * (Q + self.offset)[..., list(self.order)]

    @cached_property
    def numbers(self) -> tuple[Array, Array]:
        """Rotations (n + 1, 3, 3) and translations (n + 1, 3) as floats."""
        R = np.array([[[float(x) for x in row] for row in M] for M in self.rotation])
        return R, np.array([[float(x) for x in t] for t in self.translation])

    def frames(self, x: Array) -> tuple[Array, Array]:
        """Return rotation (N, n, 3, 3) and origin (N, n, 3) of joint frames before they turn."""
        C, c = self.numbers
        N = len(x)
        R, p = np.broadcast_to(np.eye(3), (N, 3, 3)), np.zeros((N, 3))
        rotations, origins = np.empty((N, self.n, 3, 3)), np.empty((N, self.n, 3))
        for j in range(self.n):
            p = p + R @ c[j]
            R = R @ C[j]
            rotations[:, j], origins[:, j] = R, p
            if self.prismatic[j]:
                p = p + R[:, :, 2] * x[:, j, None]
            else:
                R = R @ turns(x[:, j])
        return rotations, origins

    def parallel(self, j: int) -> bool:
        """Return True if axes j and j + 1 are parallel."""
        R = self.rotation[j + 1]
        return R[0][2] == 0 and R[1][2] == 0

    def perpendicular(self, j: int) -> bool:
        """Return True if axes j and j + 1 are at right angles."""
        return self.rotation[j + 1][2][2] == 0

    def crossing(self, j: int) -> tuple[Exact, Exact] | None:
        """Heights along axes j and j + 1 of the point where they cross; None if they do not."""
        R, t = self.rotation[j + 1], self.translation[j + 1]
        x, y = R[0][2], R[1][2]
        size = x * x + y * y
        if size == 0 or t[0] * y - t[1] * x != 0:
            return None
        along = -(t[0] * x + t[1] * y) / size
        return t[2] + along * R[2][2], along

    def common_point(self, j: int) -> Vector | None:
        """Return the point where axes j, j + 1 and j + 2 always meet, before joint j; else None."""
        first, second = self.crossing(j), self.crossing(j + 1)
        if first is None or second is None or first[1] != second[0]:
            return None
        zero = Fraction(0)
        return zero, zero, first[0]

    def seen_before(self, j: int, height: Exact) -> Vector:
        """The point at a height along axis j, in the frame that joint j - 1 moves."""
        C, c = self.rotation[j], self.translation[j]
        return c[0] + C[0][2] * height, c[1] + C[1][2] * height, c[2] + C[2][2] * height

    def planar_middle(self) -> float | None:
        """Return the height along axis 4 of the last axis, if the three before are parallel."""
        # The joints all turn, and the axes before and after these three are not parallel to them.
        crossing = self.crossing(4)
        if any(self.prismatic) or crossing is None or self.parallel(0) or self.parallel(3):
            return None
        return float(crossing[0]) if self.parallel(1) and self.parallel(2) else None


def apply(R: Matrix, v: Sequence[Exact]) -> Vector:
    """The exact vector R v."""
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in R)
    return x, y, z


def added(a: Sequence[Exact], b: Sequence[Exact]) -> Vector:
    """The exact vector a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def transposed_apply(R: Matrix, v: Sequence[Exact]) -> Vector:
    """The exact vector R' v."""
    return apply(_transposed(R), v)


def turns(angle: Array) -> Array:
    """Rotations (N, 3, 3) about z."""
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros(len(angle))
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, zero + 1]]
    return np.moveaxis(np.array(rows), -1, 0)


def _transposed(R: Matrix) -> Matrix:
    a, b, c = R
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


def _negated(v: Vector) -> Vector:
    return -v[0], -v[1], -v[2]
