"""A polynomial equation in the pose of the output, and in inputs where they are needed."""

from __future__ import annotations

from dataclasses import field
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.ring import fraction

_ANGLE = ("cos φ", "sin φ")
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
    powers: npt.NDArray[np.int_]
    coefficients: tuple[str, ...]
    values: Array
    matrix: tuple[tuple[PoseEquation, ...], ...] = field(default=(), metadata={"optional": True})

    def entries(self, at: npt.ArrayLike) -> Array:
        """The matrix (..., k, k) at values (..., V) of the variables."""
        x = np.asarray(at, dtype=float)
        return np.stack([np.stack([e(x) for e in row], axis=-1) for row in self.matrix], axis=-2)

    def __call__(self, at: npt.ArrayLike) -> Array:
        """Left side (...) at values (..., V) of the variables."""
        x = np.asarray(at, dtype=float)
        if self.matrix:
            return np.asarray(np.linalg.det(self.entries(x)))
        terms = np.prod(x[..., None, :] ** self.powers, axis=-1)
        return np.asarray(terms @ self.values)

    def degree(self, names: tuple[str, ...]) -> int:
        """Degree in some of the variables together; of a determinant no more than that."""
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
        """The same without terms whose coefficients are smaller than that."""
        kept = np.abs(self.values) >= least
        exact = tuple(c for c, k in zip(self.coefficients, kept.tolist(), strict=True) if k)
        return PoseEquation(self.names, self.powers[kept], exact, self.values[kept])

    def rows(self, exact: bool = False) -> list[str]:
        """The rows of the determinant as text; none where it is multiplied out."""
        return [
            f"({', '.join(e.sum_exact() if exact else e.text() for e in row)})"
            for row in self.matrix
        ]

    def text(self) -> str:
        """The sum alone, written out; the rows of a determinant."""
        if self.matrix:
            return f"det[{', '.join(self.rows())}]"
        text = ""
        for value, powers in zip(self.values.tolist(), self.powers.tolist(), strict=True):
            factors = _factors(self.names, powers)
            size = f"{abs(value):.6g}"
            body = " ".join(([] if size == "1" and factors else [size]) + factors)
            sign = "-" if value < 0 else "+"
            text += f" {sign} {body}" if text else (f"-{body}" if value < 0 else body)
        return text or "0"

    def exact(self) -> str:
        """The whole equation with its exact coefficients."""
        return f"{self.sum_exact()} = 0"

    def sum_exact(self) -> str:
        """Its left side."""
        if self.matrix:
            return f"det[{', '.join(self.rows(exact=True))}]"
        terms = [
            " ".join([f"({c})", *_factors(self.names, powers)])
            for c, powers in zip(self.coefficients, self.powers.tolist(), strict=True)
        ]
        return " + ".join(terms) or "0"

    def __str__(self) -> str:
        if self.matrix:
            size = len(self.matrix)
            return f"determinant of {size} x {size} entries = 0 in {', '.join(self.used)}"
        if len(self.values) > SHORT:
            if not any(n in ("x", "y", "z") for n in self.names):
                whole = self.degree(self.names)
                return f"f({', '.join(self.used)}) = 0 [{len(self.values)} terms, degree {whole}]"
            where = self.degree(("x", "y", "z"))
            turn = self.degree(("e0", "e1", "e2", "e3", *_ANGLE))
            more = f", {turn} in the rotation" if turn else ""
            return (
                f"f({', '.join(self.used)}) = 0 [{len(self.values)} terms, degree {where} in the "
                f"position{more}]"
            )
        return f"{self.text()} = 0"


def _factors(names: tuple[str, ...], powers: list[int]) -> list[str]:
    return [
        n if p == 1 else f"({n})^{p}" if " " in n and n[0] != "(" else f"{n}^{p}"
        for n, p in zip(names, powers, strict=True)
        if p
    ]


def pose_equation(
    poly: Any, names: tuple[str, ...], odd: tuple[int, ...], square: int
) -> PoseEquation:
    """The equation of a polynomial whose variables ``odd`` are in units of sqrt(square)."""
    terms = []
    for monomial, c in poly.to_dict().items():
        powers = tuple(int(e) for e in monomial)
        terms.append((powers, fraction(c), sum(powers[k] for k in odd)))
    return _equation(names, terms, square)


def entry(
    poly: Any, names: tuple[str, ...], odd: tuple[int, ...], square: int, roots: int
) -> PoseEquation:
    """A polynomial times so many roots of ``square`` as it is, an entry of a matrix."""
    powers, exact, values = [], [], []
    for monomial, c in poly.to_dict().items():
        mine = [int(e) for e in monomial]
        whole, rest = divmod(roots - sum(mine[k] for k in odd), 2)
        scaled = fraction(c) * Fraction(square) ** whole
        powers.append(mine)
        exact.append(f"{scaled} sqrt({square})" if rest and square > 1 else str(scaled))
        values.append(float(scaled) * float(np.sqrt(square)) ** rest)
    order = sorted(range(len(powers)), key=lambda k: [-p for p in powers[k]])
    return PoseEquation(
        names,
        np.array([powers[k] for k in order], dtype=int).reshape(-1, len(names)),
        tuple(exact[k] for k in order),
        np.array([values[k] for k in order]),
    )


def determinant_equation(
    names: tuple[str, ...], matrix: tuple[tuple[PoseEquation, ...], ...]
) -> PoseEquation:
    """The equation of a determinant that is not multiplied out."""
    none = np.zeros((0, len(names)), dtype=int)
    return PoseEquation(names, none, (), np.zeros(0), matrix)


def planar_equation(
    poly: Any, names: tuple[str, ...], odd: tuple[int, ...], square: int, half: tuple[int, int]
) -> PoseEquation:
    """As `pose_equation`, with half-angle variables e0, e3 (indices) written as cos φ, sin φ.

    Where the degree in them is odd, they stay.
    """
    a, b = half
    terms: dict[tuple[int, ...], Fraction] = {}
    for monomial, c in poly.to_dict().items():
        powers = [int(e) for e in monomial]
        i, j = powers[a], powers[b]
        if (i + j) % 2:
            return pose_equation(poly, names, odd, square)
        # e0^2 = (1 + c)/2; 3 f3^2 = e3^2 = (1 - c)/2; e0 f3 = s / (2 sqrt 3).
        line = {(0, 0): fraction(c)}
        for sign, count in ((1, i // 2), (-1, j // 2)):
            for _ in range(count):
                line = _times_half(line, sign, 1 if sign == 1 else square)
        if i % 2:
            line = {(p, q + 1): v / 2 for (p, q), v in line.items()}
        for (p, q), v in line.items():
            powers[a], powers[b] = p, q
            key = tuple(powers)
            terms[key] = terms.get(key, Fraction(0)) + v
    renamed = tuple({a: _ANGLE[0], b: _ANGLE[1]}.get(k, n) for k, n in enumerate(names))
    found = [(p, v, sum(p[k] for k in odd)) for p, v in terms.items() if v]
    return _equation(renamed, found, square)


def _times_half(
    line: dict[tuple[int, int], Fraction], sign: int, over: int
) -> dict[tuple[int, int], Fraction]:
    """Times (1 + sign c) / (2 over)."""
    out: dict[tuple[int, int], Fraction] = {}
    for (p, q), v in line.items():
        out[p, q] = out.get((p, q), Fraction(0)) + v / (2 * over)
        out[p + 1, q] = out.get((p + 1, q), Fraction(0)) + sign * v / (2 * over)
    return out


def _equation(
    names: tuple[str, ...], terms: list[tuple[tuple[int, ...], Fraction, int]], square: int
) -> PoseEquation:
    """Terms with a coefficient each, over so many roots of ``square``."""
    terms = sorted(terms, key=lambda t: tuple(-p for p in t[0]))
    odd = square > 1 and all(k % 2 for _, _, k in terms)
    exact: list[str] = []
    values = []
    for _, c, k in terms:
        k = k - 1 if odd else k
        whole, rest = divmod(k, 2)
        c = c / square**whole
        if rest and square > 1:
            exact.append(f"{c / square} sqrt({square})")
            values.append(float(c) / float(np.sqrt(square)))
        else:
            exact.append(str(c))
            values.append(float(c))
    found = np.array(values)
    lead = found[int(np.argmax(np.abs(found) >= np.abs(found).max() * (1 - 1e-12)))]
    return PoseEquation(
        names, np.array([p for p, _, _ in terms], dtype=int), tuple(exact), found / lead
    )
