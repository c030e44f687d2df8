"""Points of a mechanism as exact numbers, so that three-fold symmetry about z survives.

Where points are turned into each other by a third of a turn, coordinates have square roots of 3.
With y in units of the root of 3 such a turn is rational: (x, Y) -> (-x/2 - 3Y/2, x/2 - Y/2). One
point of each orbit is rounded, the others follow exactly.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.algebra.ring import Poly, Ring, rational
from pinsing.measures import Array

Vector = tuple[Fraction, Fraction, Fraction]


@dataclass(frozen=True)
class ExactPoints:
    """Vectors (x, y / sqrt(square), z), exact."""

    square: int  # 1 or 3: y is in units of its square root
    vectors: tuple[Vector, ...]  # in the order given
    off: float  # by how much a coordinate was changed at most, metres


def exact_points(points: Sequence[Array]) -> ExactPoints:
    """Exact vectors near the given ones, each (3,)."""
    # As many exact turns as possible; without any, plain coordinates.
    (plain, few), (turned, many) = (_snapped(points, square) for square in (1, 3))
    return turned if many > few else plain


def _snapped(points: Sequence[Array], square: int) -> tuple[ExactPoints, int]:
    unit = float(np.sqrt(square))
    # Decimals, so that points that differ by a sign stay so; round ones first, the others follow.
    plain = [
        tuple(Fraction(repr(round(float(v), 12))) for v in (p[0], p[1] / unit, p[2]))
        for p in points
    ]
    order = sorted(range(len(points)), key=lambda k: max(v.denominator for v in plain[k]))
    found: dict[int, Vector] = {}
    related = 0
    for k in order:
        images = (v for old in found.values() for v in (old, *_images(old, square)))
        image = next((v for v in images if _off(v, points[k], unit) <= 1e-9), None)
        related += image is not None
        x, y, z = plain[k]
        found[k] = (x, y, z) if image is None else image
    out = tuple(found[k] for k in range(len(points)))
    off = max((_off(v, p, unit) for v, p in zip(out, points, strict=True)), default=0.0)
    return ExactPoints(square, out, off), related


def _images(v: Vector, square: int) -> list[Vector]:
    """The vector turned about z by the angles that are rational here, and mirrored."""
    x, y, z = v
    out = [(-x, -y, z), (x, -y, z), (-x, y, z)]
    turns = [(-y, x)] if square == 1 else [
        (-x / 2 - 3 * y / 2, x / 2 - y / 2), (-x / 2 + 3 * y / 2, -x / 2 - y / 2)
    ]  # fmt: skip
    out += [w for a, b in turns for w in ((a, b, z), (-a, -b, z))]
    return [w for w in out if w != v]


def _off(v: Vector, p: Array, unit: float) -> float:
    """By how much an exact vector is another one than p (3,)."""
    return float(np.abs(np.array([float(v[0]), float(v[1]) * unit, float(v[2])]) - p).max())


Row = list[Poly]
Turn = tuple[tuple[Fraction, Fraction, Fraction], ...]


def near(value: float) -> Fraction:
    """A simple fraction where there is one; otherwise the decimals."""
    found = Fraction(value).limit_denominator(1000)
    return found if abs(float(found) - value) <= 1e-13 else Fraction(repr(round(value, 13)))


def short_fraction(value: float) -> Fraction:
    """A length without what the solver left: a short fraction where there is one."""
    short = Fraction(value).limit_denominator(10**4)
    return short if abs(float(short) - value) <= 1e-9 else Fraction(repr(round(value, 12)))


def quaternion_turn(e: Sequence[Poly], square: int = 1) -> tuple[list[Row], Poly]:
    """Return a quaternion's rotation matrix times the square N of its length, and N."""
    # With y, and e1 and e3, in units of the root of ``square``.
    (a, b, c, d), k = e, square
    a2, b2, c2, d2 = a * a, k * b * b, c * c, k * d * d
    R = [
        [a2 + b2 - c2 - d2, 2 * k * (b * c - a * d), 2 * (k * b * d + a * c)],
        [2 * (b * c + a * d), a2 - b2 + c2 - d2, 2 * (c * d - a * b)],
        [2 * (k * b * d - a * c), 2 * k * (c * d + a * b), a2 - b2 - c2 + d2],
    ]
    return R, a2 + b2 + c2 + d2


def rational_turn(R: Array) -> Turn:
    """A rotation matrix with rational entries near R (3, 3)."""
    turn = pin.Quaternion(np.array(R))
    e = np.array([turn.w, turn.x, turn.y, turn.z])
    grown, n = quaternion_turn([near(float(v)) for v in e / e[int(np.argmax(np.abs(e)))]])
    return tuple((x / n, y / n, z / n) for x, y, z in grown)


def turn_to(axis: Array) -> Array:
    """A rotation (3, 3) that takes z to a unit vector (3,)."""
    return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix())


def vector(values: Array) -> tuple[Fraction, Fraction, Fraction]:
    """A vector (3,) with rational entries near the given one."""
    x, y, z = (near(float(v)) for v in values)
    return x, y, z


@dataclass(frozen=True, eq=False)
class Hinge:
    """A joint where it stands in its chain."""

    joint: int  # index of the joint
    slides: bool  # whether it slides
    # axis and origin: times ``scale``
    axis: Row
    origin: Row
    scale: Poly  # product of the squared half-angle lengths of the joints before


class LegChain:
    """Joints from the base outwards, and the frame behind the last one.

    From ``axes`` and points ``origins`` (k, 3) at zero, base, metres; ``turn`` is a rotation of the
    base before anything else. Times ``scale``, the product of all joints' squared half-angle
    lengths, are ``rotation`` and ``position`` of the last frame, where the last joint is at
    ``last`` with all joints at zero. All of this is in the frame with axes ``frame`` (3, 3) and
    origin ``start`` in the base, or exactly ``base`` and ``at`` in the base that was turned.
    """

    def __init__(
        self, ring: Ring, joints: Sequence[int], axes: Array, origins: Array, turn: Turn
    ) -> None:
        gens = ring.context.gens()
        one, zero = ring.one, ring.zero
        self.ring, self.frame, self.start = ring, _frame(axes), origins[0]
        base, at = rational_turn(self.frame), vector(self.start)
        # By how much numbers were changed at most to be rational.
        self.off = max(away(base, self.frame), away((at,), [self.start]))
        R = [[one if i == k else zero for k in range(3)] for i in range(3)]
        p, scale = [zero, zero, zero], one
        self.last = (Fraction(0),) * 3
        self.hinges: list[Hinge] = []
        places = zip(joints, axes @ self.frame, (origins - self.start) @ self.frame, strict=True)
        for joint, axis0, origin0 in places:
            here = vector(origin0)
            unit = [row[2] for row in rational_turn(turn_to(axis0))]
            self.off = max(self.off, away((here, unit), [origin0, axis0]))
            step = [a - b for a, b in zip(here, self.last, strict=True)]
            self.last = here
            p = [p[i] + dot(R[i], map(rational, step), zero) for i in range(3)]
            axis = [dot(R[i], map(rational, unit), zero) for i in range(3)]
            slides = bool(ring.prismatic[joint])
            self.hinges.append(Hinge(joint, slides, axis, p, scale))
            if slides:
                (v,) = ring.variables(joint)
                p = [p[i] + gens[v] * axis[i] for i in range(3)]
                continue
            x, y = (gens[v] for v in ring.variables(joint))
            R = _product(R, _turned(unit, x, y, ring), zero)
            w = x**2 + y**2
            p, scale = [w * v for v in p], scale * w
        self.rotation, self.position, self.scale = R, p, scale
        self.base = _product(turn, base, Fraction(0))
        self.at = [row[0] for row in _product(turn, [[v] for v in at], Fraction(0))]

    def point(self, place: Array) -> Row:
        """A point of the last body, times ``scale``: where it is (3,) with all joints at zero."""
        away = vector(self._local(place) - np.array([float(v) for v in self.last]))
        turned = (dot(row, map(rational, away), self.ring.zero) for row in self.rotation)
        return [p + x for p, x in zip(self.position, turned, strict=True)]

    def fixed(self, place: Array) -> Row:
        """A point of the base (3,), in the frame of the chain."""
        return [self.ring.one * rational(v) for v in vector(self._local(place))]

    def _local(self, place: Array) -> Array:
        return np.array(self.frame.T @ (place - self.start))

    def velocity(self, hinge: Hinge, point: Row, scale: Poly) -> Row:
        """Velocity of a point (times ``scale``) by a joint, up to a positive factor."""
        if hinge.slides:
            return [scale * a for a in hinge.axis]
        grown = scale / hinge.scale
        return cross(hinge.axis, [b - grown * o for b, o in zip(point, hinge.origin, strict=True)])

    def in_base(self, row: Row) -> Row:
        """A vector in the axes of the base."""
        return [dot(row, map(rational, along), self.ring.zero) for along in self.base]

    def placed(self, point: Row, scale: Poly) -> Row:
        """A point (times ``scale``) in the base."""
        turned = self.in_base(point)
        return [turned[i] + scale * rational(self.at[i]) for i in range(3)]


def _frame(axes: Array) -> Array:
    """Axes in which those of the joints are simple, as near to the base's as they can be."""
    first = axes[0]
    second = next((a for a in axes[1:] if np.linalg.norm(np.cross(first, a)) > 1e-6), None)
    if np.abs(np.abs(axes).max(axis=1) - 1).max() <= 1e-9:
        return np.eye(3)
    if second is None:
        second = np.eye(3)[int(np.argmin(np.abs(first)))]
    e1 = first / np.linalg.norm(first)
    e2 = second - (second @ e1) * e1
    e2 /= np.linalg.norm(e2)
    triad = np.array([e1, e2, np.cross(e1, e2)]).T
    every = (
        triad[:, order] * signs
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    )
    # Of those that are as near but for rounding the first.
    return max((R for R in every if np.linalg.det(R) > 0), key=lambda R: round(np.trace(R), 9))


def _turned(unit: Sequence[Fraction], x: Poly, y: Poly, ring: Ring) -> list[Row]:
    """Rotation about a unit vector, times x^2 + y^2 (Rodrigues)."""
    a, b, c = unit
    none = Fraction(0)
    K = [[none, -c, b], [c, none, -a], [-b, a, none]]
    square = _product(K, K, none)
    w = x**2 + y**2
    return [
        [
            (w if i == k else ring.zero)
            + 2 * x * y * rational(K[i][k])
            + 2 * y**2 * rational(square[i][k])
            for k in range(3)
        ]
        for i in range(3)
    ]


def _product(A: Sequence[Sequence[Any]], B: Sequence[Sequence[Any]], zero: Any) -> list[list[Any]]:
    columns = list(zip(*B, strict=True))
    return [[sum((a * b for a, b in zip(row, c, strict=True)), zero) for c in columns] for row in A]


def cross(a: Row, b: Row) -> Row:
    """Vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Iterable[Poly], b: Iterable[Poly], zero: Poly) -> Poly:
    """Scalar product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), zero)


def away(found: Any, meant: Any) -> float:
    """By how much rows of exact numbers differ from the given ones at most."""
    values = np.array([[float(x) for x in row] for row in found])
    return float(np.abs(values - np.array([np.array(row) for row in meant])).max())
