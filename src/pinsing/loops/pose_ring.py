"""Force lines of rods as rows of polynomials in the pose of the output and the inputs.

The rotation is that of a quaternion (e0, e1, e2, e3), homogeneous: multiplied by its squared length
N. With y in units of a root, e1 and e3 are as well, and all stays rational.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx

from pinsing.algebra.ring import Poly, coefficients_by, divided_by, rational
from pinsing.loops.exact import (
    ExactPoints,
    Row,
    Vector,
    cross,
    exact_points,
    quaternion_turn,
)
from pinsing.loops.forms import (
    TURNS,
    PoseEquation,
    PoseFamily,
    determinant_equation,
    entry,
    has_real_points,
    planar_equation,
    pose_equation,
)
from pinsing.loops.legs import Rod, Rods

PARALLEL = 1e-9
"""Metres: the rods of one crank are parallel where their ends are that near to it."""


@dataclass(frozen=True, eq=False)
class PoseRing:
    """The ring of one mechanism, and the lines of its rods.

    Attributes
    ----------
    rods : Rods
        What passes forces.
    level : bool
        The output keeps the orientation of the base axes: its rotation is left out.
    unit : bool
        The quaternion is of length 1: N = 1, and nothing is homogeneous.
    """

    rods: Rods
    level: bool
    unit: bool = False

    @cached_property
    def _exact(self) -> ExactPoints:
        points = []
        for rod in self.rods.rods:
            hinge = np.zeros(3) if rod.hinge is None else rod.hinge
            points += [rod.outer, rod.inner, rod.first, rod.second, hinge]
        points += [rod.across for rod in self.rods.rods]
        return exact_points(points)

    @cached_property
    def _alike(self) -> tuple[tuple[Vector, ...], float]:
        """The exact vectors, parallel rods of one crank exactly so, and what that changed."""
        vectors, rods = list(self._exact.vectors), self.rods.rods
        off = 0.0
        pairs = [
            (i, k)
            for k, rod in enumerate(rods)
            for i in range(k)
            if self.level and rod.moved and rods[i].joint == rod.joint
        ]
        for i, k in pairs:
            outer, inner, first, second, _ = vectors[5 * i : 5 * i + 5]
            _, start, *_ = vectors[5 * k : 5 * k + 5]
            across = (o + s - c for o, s, c in zip(outer, start, inner, strict=True))
            x, y, z = across
            wanted = ((x, y, z), start, first, second)
            gap = max(
                abs(float(a - b)) * (self.square**0.5 if axis == 1 else 1.0)
                for new, old in zip(wanted, vectors[5 * k : 5 * k + 4], strict=True)
                for axis, (a, b) in enumerate(zip(new, old, strict=True))
            )
            if gap <= PARALLEL:
                vectors[5 * k : 5 * k + 4] = wanted
                off = max(off, gap)
        return tuple(vectors), off

    @property
    def snapped(self) -> float:
        """By how much points were changed to make rods of one crank parallel, metres."""
        return self._alike[1]

    @property
    def square(self) -> int:
        """y, e1 and e3 are in units of its root."""
        return self._exact.square

    @property
    def off(self) -> float:
        """By how much coordinates were changed to be exact, metres."""
        return self._exact.off

    @cached_property
    def drivers(self) -> tuple[int, ...]:
        """Inputs that occur, since they move the inner ends of rods."""
        return tuple(dict.fromkeys(r.joint for r in self.rods.rods if r.moved))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the variables for people."""
        position = ("x", "y") if self.rods.planar else ("x", "y", "z")
        turn = ("e0", "e3") if self.rods.planar else ("e0", "e1", "e2", "e3")
        joints = self.rods.mechanism.joints
        inputs = [n for rod in self.rods.rods for n in rod.variables(joints[rod.joint])]
        return (*position, *(() if self.level else turn), *dict.fromkeys(inputs))

    @cached_property
    def context(self) -> Any:
        """Flint's ring."""
        return fmpq_mpoly_ctx.get([f"v{k}" for k in range(len(self.names))], Ordering.degrevlex)

    def variable(self, name: str) -> Poly:
        """A variable; zero for one that this ring leaves out."""
        if name in self.names:
            return self.context.gens()[self.names.index(name)]
        return self.number(0)

    def number(self, value: Any) -> Poly:
        """A constant."""
        return self.context.constant(rational(value))

    @property
    def odd(self) -> tuple[int, ...]:
        """Indices of the variables in units of the root."""
        return tuple(k for k, n in enumerate(self.names) if n in ("y", "e1", "e3"))

    @cached_property
    def turn(self) -> tuple[list[Row], Poly]:
        """Rotation matrix times N, and N."""
        one, zero = self.number(1), self.number(0)
        if self.level:
            return [[one if i == j else zero for j in range(3)] for i in range(3)], one
        R, N = quaternion_turn([self.variable(f"e{i}") for i in range(4)], self.square)
        return R, one if self.unit else N

    def _vectors(self, rod: Rod) -> tuple[Vector, ...]:
        # Rods are told apart as objects: two may be alike.
        k = next(i for i, r in enumerate(self.rods.rods) if r is rod)
        return self._alike[0][5 * k : 5 * k + 5]

    def outer(self, rod: Rod) -> Row:
        """B times N."""
        R, N = self.turn
        b = self._vectors(rod)[0]
        at = [self.variable(n) for n in "xyz"]
        return [N * at[i] + sum(R[i][j] * rational(b[j]) for j in range(3)) for i in range(3)]

    def inner(self, rod: Rod) -> Row:
        """C."""
        _, start, first, second, _ = self._vectors(rod)
        c, s = self.driver(rod)
        return [
            self.number(start[i]) + c * rational(first[i]) + s * rational(second[i])
            for i in range(3)
        ]

    def driver(self, rod: Rod) -> tuple[Poly, Poly]:
        """Cosine and sine of the crank before C; the slide's value, and 0."""
        names = rod.variables(self.rods.mechanism.joints[rod.joint])
        c, s, *_ = (*(self.variable(n) for n in names), self.number(0), self.number(0))
        return c, s

    def direction(self, rod: Rod) -> Row:
        """B - C times N."""
        _, N = self.turn
        return [b - N * c for b, c in zip(self.outer(rod), self.inner(rod), strict=True)]

    def line(self, rod: Rod) -> Row:
        """Plücker coordinates of the line C B about the origin; three numbers in the plane."""
        if rod.side:
            return self.wrench(self.force(rod), self.outer(rod))
        d = self.direction(rod)
        m = cross(self.inner(rod), self.outer(rod))
        return [d[0], d[1], m[2]] if self.rods.planar else [*d, *m]

    def force(self, rod: Rod) -> Row:
        """Direction of the force; of one across C B times the root."""
        d = self.direction(rod)
        if not rod.side:
            return d
        k = next(i for i, r in enumerate(self.rods.rods) if r is rod)
        axis = [self.number(v) for v in self._alike[0][5 * len(self.rods.rods) + k]]
        f = self.product(axis, d)
        return f if rod.side == 1 else self.product(f, d)

    def product(self, a: Row, b: Row) -> Row:
        """Vector product times the root, with y in units of it."""
        x, y, z = cross(a, b)
        return [self.square * x, y, self.square * z]

    def wrench(self, force: Row, at: Row) -> Row:
        """A force through a point that is given times N; three numbers in the plane."""
        _, N = self.turn
        f, m = [N * v for v in force], cross(at, force)
        return [f[0], f[1], m[2]] if self.rods.planar else [*f, *m]

    def hinge(self, rod: Rod) -> Row:
        """Direction of the hinge at C."""
        return [self.number(v) for v in self._vectors(rod)[4]]

    def hinge_line(self, rod: Rod) -> Row:
        """The line through B along the hinge at C."""
        return self.wrench(self.hinge(rod), self.outer(rod))

    def motion(self, rod: Rod) -> Row:
        """Velocity of C by the actuator."""
        _, _, first, second, _ = self._vectors(rod)
        if self.rods.mechanism.prismatic[rod.joint]:
            return [self.number(v) for v in first]
        c, s = self.driver(rod)
        return [c * rational(second[i]) - s * rational(first[i]) for i in range(3)]

    def length(self, rod: Rod, length: Fraction) -> Poly:
        """What is zero where C and B are at their distance, N times (B - C)^2 - length^2."""
        R, N = self.turn
        b, start, first, _, _ = self._vectors(rod)
        k = self.square
        away = [self.variable(n) - rational(v) for n, v in zip("xyz", start, strict=True)]
        moved = [c - rational(v) for c, v in zip(self.inner(rod), start, strict=True)]
        turned = [sum((R[i][j] * rational(b[j]) for j in range(3)), self.number(0))
                  for i in range(3)]  # fmt: skip
        if self.rods.planar:
            away[2] = moved[2] = turned[2] = self.number(0)
            b, first = (b[0], b[1], Fraction(0)), (first[0], first[1], Fraction(0))
        own = b[0] ** 2 + k * b[1] ** 2 + b[2] ** 2 - length**2
        arm = rational(first[0] ** 2 + k * first[1] ** 2 + first[2] ** 2)
        if self.rods.mechanism.prismatic[rod.joint]:
            arm = arm * self.variable(self.rods.mechanism.joints[rod.joint]) ** 2
        fixed = self.dot(away, away) + rational(own) + arm - 2 * self.dot(away, moved)
        reach = [x - y for x, y in zip(away, moved, strict=True)]
        return N * fixed + 2 * self.dot(reach, turned)

    def moment_arm(self, rod: Rod) -> Poly:
        """Force along C B in the direction in which the actuator moves C."""
        start = self._vectors(rod)[1]
        _, N = self.turn
        if self.rods.mechanism.prismatic[rod.joint]:
            return self.dot(self.direction(rod), self.motion(rod))
        along = self.motion(rod)
        # (cos first + sin second) is across the motion of C.
        reach = [b - N * rational(o) for b, o in zip(self.outer(rod), start, strict=True)]
        return self.dot(reach, along)

    def dot(self, a: Row, b: Row) -> Poly:
        """Scalar product of vectors with y in units of the root."""
        return a[0] * b[0] + self.square * a[1] * b[1] + a[2] * b[2]

    def without_norm(self, poly: Poly) -> Poly:
        """Divide by N as often as it goes: it is 1."""
        return poly if self.turn[1].is_constant() else divided_by(poly, self.turn[1])

    def lines(self) -> list[Row]:
        """All wrenches: of each rod, and of its hinge."""
        out = []
        for rod in self.rods.rods:
            out += [self.line(rod)] if rod.hinge is None else [self.line(rod), self.hinge_line(rod)]
        return out

    def determinant(self, rows: list[Row], roots: Sequence[int] = ()) -> PoseEquation:
        """The determinant of rows, not multiplied out, with so many roots of `square` a column.

        Without ``roots`` those of wrenches: forces, then moments.
        """
        roots = roots or ((0, 1, 1) if self.rods.planar else (0, 1, 0, 1, 0, 1))
        made = tuple(
            tuple(
                entry(x, self.names, self.odd, self.square, r)
                for x, r in zip(row, roots, strict=True)
            )
            for row in rows
        )
        return determinant_equation(self.names, made)

    def equation(self, poly: Poly) -> PoseEquation:
        """A polynomial as an equation; in the plane in the angle of the output."""
        if self.rods.planar and not self.level:
            half = (self.names.index("e0"), self.names.index("e3"))
            return planar_equation(poly, self.names, self.odd, self.square, half)
        return pose_equation(poly, self.names, self.odd, self.square)


def determinant(rows: list[Row], one: Poly) -> Poly:
    """Determinant of polynomials by minors of the first columns, each formed once."""
    count = len(rows)
    minors: dict[tuple[int, ...], Poly] = {(): one}
    for column in range(count):
        level: dict[tuple[int, ...], Poly] = {}
        for used, value in minors.items():
            for k in range(count):
                if k in used or rows[k][column] == 0 or value == 0:
                    continue
                key = tuple(sorted((*used, k)))
                # Sign: how many of the rows used stand below.
                sign = -1 if sum(u > k for u in used) % 2 else 1
                term = sign * rows[k][column] * value
                level[key] = level[key] + term if key in level else term
        minors = level
    return minors.get(tuple(range(count)), one - one)


def counts_hinges(ring: PoseRing) -> bool:
    """Whether forces along hinges and rows of the output are six together."""
    hinges = sum(rod.hinge is not None for rod in ring.rods.rods)
    return hinges > 0 and hinges + len(ring.rods.mechanism.task.rows) == 6


def hinged_type1(ring: PoseRing) -> Poly:
    """The determinant of both; a constant where the output does not show each of the freedoms."""
    zero, one = ring.number(0), ring.number(1)
    at = [ring.variable(n) for n in "xyz"]
    rows = [ring.hinge_line(rod) for rod in ring.rods.rods if rod.hinge is not None]
    for k in ring.rods.mechanism.task.rows:
        unit = [one if i == k % 3 else zero for i in range(3)]
        rows.append([*unit, *cross(at, unit)] if k < 3 else [zero, zero, zero, *unit])
    value = determinant(rows, one)
    return one if value == 0 else ring.without_norm(value)


_AXES = {"e1": "x", "e2": "y", "e3": "z"}


def every_position(ring: PoseRing, poly: Any) -> tuple[PoseFamily, ...]:
    """Families of orientations at which ``poly`` vanishes for all positions."""
    names = ring.names
    turn = [k for k, n in enumerate(names) if n in TURNS]
    others = [k for k in range(len(names)) if k not in turn]
    if not turn:
        return ()
    coefficients = list(coefficients_by(poly, others).values())
    found: list[tuple[frozenset[int], Any]] = []
    for count in range(len(turn)):
        for zero in itertools.combinations(turn, count):
            found += _within(ring, coefficients, turn, frozenset(zero), found)
    return tuple(_family(ring, zero, factor) for zero, factor in found)


def _within(
    ring: PoseRing,
    coefficients: list[Any],
    turn: list[int],
    zero: frozenset[int],
    known: list[tuple[frozenset[int], Any]],
) -> list[tuple[frozenset[int], Any]]:
    """Conditions that the coefficients share where the quaternion's ``zero`` parts are zero."""
    rest = [c for c in (_restricted(ring, c, zero) for c in coefficients) if c != 0]
    left = [k for k in turn if k not in zero]
    if not rest:
        # All of the subspace.
        if any(z <= zero and _restricted(ring, f, zero) == 0 for z, f in known):
            return []
        return [(zero, ring.number(0))]
    common = functools.reduce(lambda a, b: a.gcd(b), rest)
    out = []
    for factor, _ in common.factor()[1]:
        # A single component that vanishes is a smaller subspace, seen there.
        if factor.is_constant() or len(factor) == 1:
            continue
        used = sum(factor.degrees()[k] > 0 for k in left)
        plain = pose_equation(factor, ring.names, ring.odd, ring.square)
        if not (has_real_points(plain) if used > 1 else used):
            continue
        there = (_restricted(ring, f, zero) for z, f in known if z <= zero)
        if any(f == 0 or divmod(f, factor)[1] == 0 for f in there):
            continue
        out.append((zero, factor))
    return out


def _restricted(ring: PoseRing, poly: Any, zero: frozenset[int]) -> Any:
    gens = ring.context.names()
    return poly.subs({gens[k]: 0 for k in zero}) if zero else poly


def _family(ring: PoseRing, zero: frozenset[int], factor: Any) -> PoseFamily:
    names = ring.names
    vanish = tuple(names[k] for k in sorted(zero))
    turn = [n for n in names if n in TURNS]
    left = [n for n in turn if n not in vanish]
    equations = () if factor == 0 else (pose_equation(factor, names, ring.odd, ring.square),)
    return PoseFamily(_words(vanish, left, equations), vanish, equations)


def _words(vanish: tuple[str, ...], left: list[str], equations: tuple[PoseEquation, ...]) -> str:
    axes = [_AXES[n] for n in left if n != "e0"]
    turned = len(left) > len(axes)
    conditions = [*(f"{n} = 0" for n in vanish), *(str(x) for x in equations)]
    words = f"orientations with {', '.join(conditions)}"
    if len(left) == 1 and not equations:
        words = "not turned at all" if turned else f"half a turn about {axes[0]}"
    elif len(left) == 2:
        bends = [math.atan(r) for x in equations for r in _ratios(x, left)]
        if turned:
            angles = _listed([2 * b for b in bends]) if equations else "any angle"
            words = f"turned by {angles} about {axes[0]}"
        else:
            where = f"an axis at {_listed(bends)} from {axes[0]} towards {axes[1]}"
            plane = f"any axis in the plane of {axes[0]} and {axes[1]}"
            words = f"half a turn about {where if equations else plane}"
    return f"{words}: singular at every position"


def _ratios(equation: PoseEquation, left: list[str]) -> list[float]:
    """Real values of the second component over the first."""
    one, two = (equation.names.index(n) for n in left)
    top = int(max(equation.powers[:, one] + equation.powers[:, two]))
    line = np.zeros(top + 1)
    for value, powers in zip(equation.values, equation.powers, strict=True):
        line[int(powers[two])] += value
    found = np.roots(line[::-1])
    return sorted(float(r.real) for r in found if abs(r.imag) <= 1e-9)


def _listed(values: list[float]) -> str:
    """Angles, radians, in degrees: ``±90°``."""
    degrees = sorted({round(math.degrees(v), 6) + 0.0 for v in values})
    plus = [d for d in degrees if d > 0]
    if [-d for d in reversed(plus)] == [d for d in degrees if d < 0] and 0.0 not in degrees:
        return " or ".join(f"±{d:.6g}°" for d in plus)
    return " or ".join(f"{d:.6g}°" for d in degrees)
