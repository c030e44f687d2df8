"""A polynomial equation in the pose of the output, and in inputs where they are needed."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx

from pinsing.algebra.equation import Equation, signed_sum
from pinsing.algebra.ring import Poly, Ring, coefficients_by, fraction, rational
from pinsing.measures import ALIKE, Array, ArrayLike, NDArray
from pinsing.serialization import JsonResult

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
    parts, total = coefficients_by(poly, half), 0 * poly
    if any(sum(powers) % 2 for powers in parts):
        return pose_equation(poly, names, odd, square)
    cos, sin = (poly.context().gens()[k] for k in half)
    for (i, j), rest in parts.items():
        # 3 f3^2 = e3^2, and sin φ is in units of the root as e3 is.
        total += rest * rational(Fraction(1, square ** (j // 2))) * _pair(i, j, cos, sin)
    angle = dict(zip(half, _ANGLE, strict=True))
    renamed = tuple(angle.get(k, n) for k, n in enumerate(names))
    return pose_equation(total, renamed, odd, square)


def trig_polynomial(poly: Poly, ring: Ring, joints: Sequence[str]) -> PoseEquation:
    """Return the polynomial in cos q, sin q of joints that turn, q of slides; its scale is kept."""
    # Every degree in a pair of half-angle variables must be even.
    used = ring.joints_of(poly) if poly != 0 else ()
    heads = {True: ("",), False: ("cos ", "sin ")}
    names = [f"{head}{joints[j]}" for j in used for head in heads[ring.prismatic[j]]]
    there = fmpq_mpoly_ctx.get([f"t{k}" for k in range(len(names))], Ordering.lex)
    gens = iter(there.gens())
    places = {j: [next(gens) for _ in ring.variables(j)] for j in used}

    @functools.cache
    def power(j: int, *exponents: int) -> Poly:
        """What powers of the variables of a joint are in its cosine and sine, or its value."""
        return places[j][0] ** exponents[0] if ring.prismatic[j] else _pair(*exponents, *places[j])

    total = there.constant(0)
    for monomial, c in poly.to_dict().items():
        line = there.constant(c)
        for j in used:
            line *= power(j, *(int(monomial[v]) for v in ring.variables(j)))
        total += line
    return _equation(tuple(names), _terms(total))


def _pair(i: int, j: int, c: Poly, s: Poly) -> Poly:
    """x^i y^j as a polynomial in cos and sin: x^2 = (1 + c) / 2, y^2 = (1 - c) / 2, x y = s / 2."""
    if (i + j) % 2:
        raise ValueError("a form of odd degree has no cosines and sines of the whole angle")
    half = rational(Fraction(1, 2))
    out = ((1 + c) * half) ** (i // 2) * ((1 - c) * half) ** (j // 2)
    return out * (s * half) if i % 2 else out


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
