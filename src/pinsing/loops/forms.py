"""What loops are in exact numbers: points and chains, and the equations that are made of them.

Where points are turned into each other by a third of a turn about z, coordinates have square roots
of 3. With y in units of the root of 3 such a turn is rational: (x, Y) -> (-x/2 - 3Y/2, x/2 - Y/2).
One point of each orbit is rounded, the others follow exactly.

An equation is a polynomial in the pose of the output, and in inputs where they are needed, or a
determinant of such polynomials; in the joint angles it may be a trigonometric polynomial as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing.algebra.equation import Equation, signed_sum
from pinsing.algebra.ring import Poly, Ring, coefficients_by, fraction, rational
from pinsing.interface import JsonResult
from pinsing.measures import ALIKE, Array, ArrayLike, NDArray

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
    """Vectors of which as many as can be are turned or mirrored others, and how many are."""
    unit, given = np.array([1.0, np.sqrt(square), 1.0]), np.reshape(points, (-1, 3))
    # Matrices of mirrors, and of turns about z that are rational with y in units of the root.
    cos, sin = (0, 1) if square == 1 else (Fraction(-1, 2), Fraction(1, 2))
    signs = list(itertools.product((1, -1), repeat=2))
    ways: list[Any] = [(k, 0, 0, m) for k, m in signs]
    ways += [(k * cos, -square * m * sin, m * sin, k * cos) for k, m in signs]
    # Decimals, so that points that differ by a sign stay so; round ones first, the others follow.
    found: list[Any] = [
        tuple(Fraction(repr(round(v, 12))) for v in p) for p in (given / unit).tolist()
    ]
    known: list[Vector] = []
    related = 0
    for k in sorted(range(len(found)), key=lambda k: max(v.denominator for v in found[k])):
        images = [(a * x + b * y, c * x + d * y, z) for x, y, z in known for a, b, c, d in ways]
        away = np.reshape(np.array(images, dtype=float), (-1, 3)) * unit - given[k]
        near = np.flatnonzero(np.abs(away).max(axis=1, initial=0.0) <= 1e-9)
        if len(near):
            related, found[k] = related + 1, images[near[0]]
        known.append(found[k])
    off = np.abs(np.array(found, dtype=float).reshape(-1, 3) * unit - given).max(initial=0.0)
    return ExactPoints(square, tuple(found), float(off)), related


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
    """Joints from the base outwards, and the frame behind the last one; all of it in the base.

    From ``axes`` and points ``origins`` (k, 3) at zero, base, metres; ``turn`` is a rotation of the
    base before anything else. Times ``scale``, the product of all joints' squared half-angle
    lengths, are ``rotation`` and ``position`` of the last frame, where the last joint is at
    ``last`` with all joints at zero. Numbers are made exact in axes ``frame`` (3, 3) about
    ``start`` in the base, which ``base`` and ``at`` are in exact numbers.
    """

    def __init__(
        self, ring: Ring, joints: Sequence[int], axes: Array, origins: Array, turn: Turn
    ) -> None:
        gens, zero = ring.context.gens(), ring.zero
        self.ring, self.frame, self.start = ring, _frame(axes), origins[0]
        base, at = rational_turn(self.frame), vector(self.start)
        # By how much numbers were changed at most to be rational.
        self.off = max(away(base, self.frame), away((at,), [self.start]))
        none = Fraction(0)
        self.base = [[ring.number(x) for x in row] for row in _product(turn, base, none)]
        self.at = [ring.number(dot(row, at, none)) for row in turn]
        R, p, scale = self.base, self.at, ring.one
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

    def point(self, place: Array, rests: bool = False) -> Row:
        """A point (3,), given with all joints at zero: of the last body, times ``scale``.

        One that ``rests`` is of the base.
        """
        R, p, last = self.rotation, self.position, np.array(self.last, dtype=float)
        if rests:
            R, p, last = self.base, self.at, np.zeros(3)
        exact = [self.ring.number(v) for v in vector(self.frame.T @ (place - self.start) - last)]
        return [a + dot(row, exact, self.ring.zero) for a, row in zip(p, R, strict=True)]

    def velocity(self, hinge: Hinge, point: Row, scale: Poly) -> Row:
        """Velocity of a point (times ``scale``) by a joint, up to a positive factor."""
        if hinge.slides:
            return [scale * a for a in hinge.axis]
        grown = scale / hinge.scale
        return cross(hinge.axis, [b - grown * o for b, o in zip(point, hinge.origin, strict=True)])


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


_ANGLE = ("cos φ", "sin φ")
TURNS = ("e0", "e1", "e2", "e3")
SHORT = 24
"""Terms up to which an equation is written out for people."""


@dataclass(frozen=True, eq=False)
class PoseEquation:
    """sum of coefficient * product of powers = 0, or a determinant of such sums.

    Attributes
    ----------
    names : tuple of str
        Variables: x, y, z in metres, the unit quaternion e0, e1, e2, e3 (scalar first), in the
        plane x, y, cos φ, sin φ; cos and sin of inputs that turn, inputs that slide.
    powers : (T, V) array of int
        Of each variable in each term.
    coefficients : tuple of str
        Exact: fractions, times sqrt(3) where the mechanism is three-fold symmetric.
    values : (T,) array
        The same as numbers; the largest is 1 in size.
    matrix : tuple of tuple of PoseEquation
        Entries (left sides, not divided by anything) of the square matrix whose determinant is the
        left side, where that is not multiplied out; there are no terms then. Empty elsewhere.
    """

    names: tuple[str, ...]
    powers: NDArray[np.int_]
    coefficients: tuple[str, ...]
    values: Array
    matrix: tuple[tuple[PoseEquation, ...], ...] = field(default=(), metadata={"optional": True})

    def entries(self, at: ArrayLike) -> Array:
        """Return the matrix (..., k, k) at values (..., V) of the variables."""
        x = np.asarray(at, dtype=float)
        return np.stack([np.stack([e(x) for e in row], axis=-1) for row in self.matrix], axis=-2)

    def __call__(self, at: ArrayLike) -> Array:
        """Left side (...) at values (..., V) of the variables."""
        x = np.asarray(at, dtype=float)
        if self.matrix:
            return np.asarray(np.linalg.det(self.entries(x)))
        return np.asarray(np.prod(x[..., None, :] ** self.powers, axis=-1) @ self.values)

    def degree(self, names: tuple[str, ...]) -> int:
        """Return the degree in some variables together; of a determinant a bound of it."""
        if self.matrix:
            return sum(max(e.degree(names) for e in row) for row in self.matrix)
        places = [k for k, n in enumerate(self.names) if n in names]
        return int(self.powers[:, places].sum(axis=1).max(initial=0))

    @property
    def used(self) -> tuple[str, ...]:
        """Variables that occur."""
        if self.matrix:
            found = {n for row in self.matrix for e in row for n in e.used}
            return tuple(n for n in self.names if n in found)
        return tuple(n for n, p in zip(self.names, self.powers.T, strict=True) if p.any())

    def without(self, least: float) -> PoseEquation:
        """Return the same without terms whose coefficients are smaller than that."""
        kept = np.abs(self.values) >= least
        exact = tuple(c for c, k in zip(self.coefficients, kept.tolist(), strict=True) if k)
        return PoseEquation(self.names, self.powers[kept], exact, self.values[kept])

    def rows(self, exact: bool = False) -> list[str]:
        """Return the rows of the determinant as text; none where it is multiplied out."""
        return [f"({', '.join(e.text(exact) for e in row)})" for row in self.matrix]

    def text(self, exact: bool = False) -> str:
        """Return the left side, with exact coefficients or numbers; rows of a determinant."""
        if self.matrix:
            return f"det[{', '.join(self.rows(exact))}]"
        bodies = [" ".join(_factors(self.names, p)) for p in self.powers.tolist()]
        if exact:
            terms = zip(self.coefficients, bodies, strict=True)
            return " + ".join(f"({c}) {body}".rstrip() for c, body in terms) or "0"
        return signed_sum(list(zip(self.values.tolist(), bodies, strict=True)))

    def exact(self) -> str:
        """Return the whole equation with its exact coefficients."""
        return f"{self.text(exact=True)} = 0"

    def __str__(self) -> str:
        if self.matrix:
            size = len(self.matrix)
            return f"determinant of {size} x {size} entries = 0 in {', '.join(self.used)}"
        if len(self.values) <= SHORT:
            return f"{self.text()} = 0"
        turn, degree = self.degree((*TURNS, *_ANGLE)), f"{self.degree(self.names)}"
        if {"x", "y", "z"} & set(self.names):
            degree = f"{self.degree(('x', 'y', 'z'))} in the position"
            degree += f", {turn} in the rotation" if turn else ""
        return f"f({', '.join(self.used)}) = 0 [{len(self.values)} terms, degree {degree}]"


def _factors(names: tuple[str, ...], powers: list[int]) -> list[str]:
    return [
        n if p == 1 else f"({n})^{p}" if " " in n and n[0] != "(" else f"{n}^{p}"
        for n, p in zip(names, powers, strict=True)
        if p
    ]


def _equation(
    names: tuple[str, ...],
    terms: Sequence[tuple[tuple[int, ...], Fraction, int]],
    square: int = 1,
    roots: int = 0,
) -> PoseEquation:
    """Terms, each over so many roots of ``square``; all of them times ``roots`` of these."""
    terms = sorted(terms, key=lambda t: [-p for p in t[0]])
    exact, values = [], []
    for _, c, k in terms:
        whole, rest = divmod(roots - k, 2)
        scaled = c * Fraction(square) ** whole
        exact.append(f"{scaled} sqrt({square})" if rest and square > 1 else str(scaled))
        values.append(float(scaled) * float(np.sqrt(square)) ** rest)
    powers = np.array([p for p, _, _ in terms], dtype=int).reshape(len(terms), len(names))
    return PoseEquation(names, powers, tuple(exact), np.array(values))


def _terms(poly: Any, odd: Sequence[int] = ()) -> list[tuple[tuple[int, ...], Fraction, int]]:
    """Powers, coefficients, and how many variables ``odd`` each term has."""
    powers = ((tuple(int(e) for e in m), c) for m, c in poly.to_dict().items())
    return [(p, fraction(c), sum(p[k] for k in odd)) for p, c in powers]


def pose_equation(
    poly: Any, names: tuple[str, ...], odd: tuple[int, ...] = (), square: int = 1
) -> PoseEquation:
    """Return a polynomial's equation, largest coefficient 1; ``odd`` in units of sqrt(square)."""
    terms = _terms(poly, odd)
    found = _equation(names, terms, square, int(all(k % 2 for _, _, k in terms)))
    size = np.abs(found.values)
    lead = found.values[int(np.argmax(size >= size.max() * (1 - 1e-12)))]
    return replace(found, values=found.values / lead)


def determinant_equation(
    rows: Sequence[Sequence[Poly]],
    names: tuple[str, ...],
    odd: tuple[int, ...],
    square: int,
    roots: Sequence[int],
) -> PoseEquation:
    """Return a determinant that is not multiplied out, with ``roots`` of ``square`` a column."""
    made = [[_equation(names, _terms(x, odd), square, r) for x, r in zip(row, roots, strict=True)]
            for row in rows]  # fmt: skip
    return replace(_equation(names, ()), matrix=tuple(map(tuple, made)))


def planar_equation(
    poly: Any, names: tuple[str, ...], odd: tuple[int, ...], square: int, half: tuple[int, int]
) -> PoseEquation:
    """Return a `pose_equation` with half-angle variables e0, e3 (``half``) as cos φ, sin φ."""
    # Where the degree in them is odd, they stay.
    if all(sum(powers) % 2 == 0 for powers in coefficients_by(poly, half)):
        poly = _in_angle(poly, half, square)
        angle = dict(zip(half, _ANGLE, strict=True))
        names = tuple(angle.get(k, n) for k, n in enumerate(names))
    return pose_equation(poly, names, odd, square)


def trig_polynomial(poly: Poly, ring: Ring, joints: Sequence[str]) -> PoseEquation:
    """Return the polynomial in cos q, sin q of joints that turn, q of slides; its scale is kept."""
    # Every degree in a pair of half-angle variables must be even.
    used = ring.joints_of(poly) if poly != 0 else ()
    for j in used:
        if not ring.prismatic[j]:
            poly = _in_angle(poly, ring.variables(j))
    heads = {True: ("",), False: ("cos ", "sin ")}
    names = [f"{head}{joints[j]}" for j in used for head in heads[ring.prismatic[j]]]
    columns = [v for j in used for v in ring.variables(j)]
    terms = [(tuple(powers[v] for v in columns), c, k) for powers, c, k in _terms(poly)]
    return _equation(tuple(names), terms)


def _in_angle(poly: Poly, half: Sequence[int], square: int = 1) -> Poly:
    """A polynomial with half-angle variables x and y replaced by the cosine and sine."""
    # x^2 = (1 + cos) / 2, y^2 = (1 - cos) / 2, x y = sin / 2. With y in units of a root so is sin.
    total, (c, s) = 0 * poly, (poly.context().gens()[k] for k in half)
    for (i, j), rest in coefficients_by(poly, half).items():
        if (i + j) % 2:
            raise ValueError("a form of odd degree has no cosines and sines of the whole angle")
        pair = (1 + c) ** (i // 2) * (1 - c) ** (j // 2) * s ** (i % 2)
        total += rest * pair * rational(Fraction(1, 2 ** ((i + j + 1) // 2) * square ** (j // 2)))
    return total


@dataclass(frozen=True, eq=False)
class JointLocus:
    """One singular locus in the joint angles.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, or ``passive``: joints that carry no load are dependent by
        themselves, and move with the actuators locked.
    words : str
        What happens there.
    joints : tuple of str
        Joints that occur.
    equation : Equation or None
        Zero exactly there; None where the determinant is left as it is.
    matrix : tuple of tuple of PoseEquation
        Entries of the determinant that is zero exactly there; with more rows than columns its
        columns are dependent exactly there. Empty where ``equation`` is short, or one of several
        factors.
    ball : bool
        Whether it is of three hinges that stand for a ball: they lie in a plane, the ball is free.
    """

    kind: str
    words: str
    joints: tuple[str, ...]
    equation: Equation | None
    matrix: tuple[tuple[PoseEquation, ...], ...] = field(default=(), metadata={"optional": True})
    ball: bool = field(default=False, metadata={"optional": True})

    def entries(self, q: ArrayLike, joints: Sequence[str]) -> Array:
        """Return the matrix (..., k, m) at configurations q (..., n) of joints with these names."""
        q = np.asarray(q, dtype=float)
        names = [f"{head}{name}" for head in ("", "cos ", "sin ") for name in joints]
        place = {name: k for k, name in enumerate(names)}
        values = np.concatenate([q, np.cos(q), np.sin(q)], axis=-1)

        def entry(x: PoseEquation) -> Array:
            return x(np.take(values, np.array([place[n] for n in x.names], dtype=int), axis=-1))

        rows = [np.stack([entry(x) for x in row], axis=-1) for row in self.matrix]
        return np.stack(rows, axis=-2)

    def scaled(self, M: Array) -> Array:
        """Return the matrix (..., k, m) with rows of unit length; those that vanish stay small."""
        sums = [[np.abs(x.values).sum() for x in row] for row in self.matrix]
        whole = np.linalg.norm(np.array(sums, dtype=float), axis=1)
        size = np.maximum(np.linalg.norm(M, axis=-1), ALIKE * whole)
        return np.asarray(M / np.where(size > 0, size, 1.0)[..., None])

    def value(self, q: ArrayLike, joints: Sequence[str]) -> Array:
        """Return the left side (...) at q (..., n), over its size; see `JointForms.values`."""
        if self.equation is not None:
            return np.asarray(self.equation(q) / self.equation.size)
        M = self.scaled(self.entries(q, joints))
        tall = M.shape[-2] > M.shape[-1]
        return np.asarray(
            np.prod(np.linalg.svd(M, compute_uv=False), axis=-1) if tall else np.linalg.det(M)
        )

    def ratio(self, q: ArrayLike, joints: Sequence[str]) -> Array:
        """Return a value over its size, or the least singular value, (...) at q (..., n).

        Zero on the locus, 1 at most.
        """
        if self.equation is not None:
            return np.abs(self.value(q, joints))
        sigma = np.linalg.svd(self.scaled(self.entries(q, joints)), compute_uv=False)
        return np.asarray(sigma[..., -1] / np.maximum(sigma[..., 0], ALIKE))

    def __str__(self) -> str:
        return f"{self.kind}, {self.words}: {self.statement()}"

    def statement(self) -> str:
        """Return the equation, or the size of the determinant and the joints in it."""
        if self.equation is not None and not self.matrix:
            return str(self.equation)
        size, columns = len(self.matrix), len(self.matrix[0])
        if size > columns:
            return f"rank of {size} x {columns} entries below {columns} in {', '.join(self.joints)}"
        return f"determinant of {size} x {size} entries = 0 in {', '.join(self.joints)}"

    def rows(self) -> list[str]:
        """Return the rows of the determinant as text."""
        return [f"({', '.join(x.text() for x in row)})" for row in self.matrix]


@dataclass(frozen=True, eq=False)
class JointForms(JsonResult):
    """All singular loci of a mechanism in its joint angles.

    Attributes
    ----------
    joints : tuple of str
        All joints, in the order of configurations.
    loci : tuple of JointLocus
        A configuration that closes the loops is singular if and only if one of them is zero.
    complete : bool
        Whether that holds; without it there are none, and the notes say why.
    notes : tuple of str
        What was assumed.
    always : tuple of str
        Kinds whose condition holds at every closed configuration that was tried.
    """

    schema: ClassVar[str] = "pinsing/joint-forms/1"

    joints: tuple[str, ...]
    loci: tuple[JointLocus, ...]
    complete: bool
    notes: tuple[str, ...]
    always: tuple[str, ...] = field(default=(), metadata={"optional": True})

    def values(self, q: ArrayLike) -> Array:
        """Return left sides (..., number of loci) at configurations q (..., n), radians and metres.

        Those of determinants have their rows scaled to unit length first, rows of rounding aside.
        Of a matrix with more rows than columns it is the product of the singular values, which is
        never negative.
        """
        q = np.asarray(q, dtype=float)
        out = [locus.value(q, self.joints) for locus in self.loci]
        return np.stack(out, axis=-1) if out else np.zeros((*q.shape[:-1], 0))

    def __str__(self) -> str:
        return "\n".join([*(str(x) for x in self.loci), *self.notes])


@dataclass(frozen=True, eq=False)
class PoseFamily:
    """Orientations of the output at which every position is singular."""

    words: str  # what they are
    zero: tuple[str, ...]  # components of the quaternion that are zero
    # what holds of the others; empty where nothing else is asked
    equations: tuple[PoseEquation, ...]

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True, eq=False)
class PoseLocus:
    """One irreducible locus.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, ``constraint`` or ``type 2 or constraint``.
    words : str
        What the lines of the legs do there.
    equation : PoseEquation
        Zero exactly there, on poses that the mechanism has with the inputs that they need.
    real : bool
        Whether the equation changes its sign over real poses, or is a sum of squares with real
        zeros; otherwise it is zero at isolated or no real ones, as far as was looked.
    """

    kind: str
    words: str
    equation: PoseEquation
    real: bool

    def __str__(self) -> str:
        none = "" if self.real else " [no real points found]"
        return f"{self.kind}, {self.words}: {self.equation}{none}"


@dataclass(frozen=True, eq=False)
class PoseForms(JsonResult):
    """All singular loci of a mechanism over the pose of its output.

    Attributes
    ----------
    variables : tuple of str
        In which the equations are.
    architecture : str
        Why every pose is singular; empty where not.
    loci : tuple of PoseLocus
        Irreducible over the rationals (or those with the root of 3).
    everywhere : tuple of PoseFamily
        Orientations at which every position is singular; parts of the loci, said by themselves.
    level : tuple of PoseLocus
        The type 2 loci with the output turned as at home, where that is not turned at all.
    complete : bool
        Whether every singular pose is on one of the loci, but for legs without length and passive
        joints that move by themselves, which the notes name.
    notes : tuple of str
        What was assumed, and what else must hold.
    inputs : tuple of PoseLocus
        Type 2 over the inputs alone, the pose eliminated, where that was done: at inputs on it two
        poses of the output meet, real or complex ones.
    closing : tuple of PoseEquation
        What a pose and inputs that close the loops fulfil, where the loci are in both together:
        the lengths of the rods, and the planes that hinges keep their ends in.
    joint_forms : JointForms or None
        Those in the joint angles, which ``families --loops`` writes into its JSON; elsewhere they
        are asked for by themselves, with `joint_forms`.
    """

    schema: ClassVar[str] = "pinsing/pose-forms/1"

    variables: tuple[str, ...]
    architecture: str
    loci: tuple[PoseLocus, ...]
    everywhere: tuple[PoseFamily, ...]
    level: tuple[PoseLocus, ...]
    complete: bool
    notes: tuple[str, ...]
    inputs: tuple[PoseLocus, ...] = field(default=(), metadata={"optional": True})
    closing: tuple[PoseEquation, ...] = field(default=(), metadata={"optional": True})
    joint_forms: JointForms | None = field(default=None, metadata={"optional": True})

    def __str__(self) -> str:
        lines = [self.architecture] if self.architecture else []
        lines += [str(x) for x in (*self.loci, *self.everywhere, *self.inputs)]
        return "\n".join([*lines, *self.notes])


def random_variables(names: Sequence[str], count: int) -> Array:
    """Random values (count, V): unit quaternions, cosines and sines of one angle, any lengths."""
    rng = np.random.default_rng(2718)
    x = rng.normal(size=(count, len(names))) * rng.choice([0.1, 1.0, 3.0], size=(count, 1))
    for k, name in enumerate(names[:-1]):
        if name.startswith("cos ") and names[k + 1] == f"sin {name[4:]}":
            angle = rng.uniform(-np.pi, np.pi, count)
            x[:, k], x[:, k + 1] = np.cos(angle), np.sin(angle)
    turn = [k for k, name in enumerate(names) if name in TURNS]
    if turn:
        x[:, turn] /= np.linalg.norm(x[:, turn], axis=1)[:, None]
    return np.asarray(x)


def has_real_points(found: PoseEquation) -> bool:
    """Whether it changes its sign over random poses and inputs."""
    values = found(random_variables(found.names, 400))
    return bool((values > 0).any() and (values < 0).any())
