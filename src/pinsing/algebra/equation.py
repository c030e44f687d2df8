"""Equations as trigonometric polynomials: exact coefficients, values, gradients, text and LaTeX.

A polynomial in half-angle coordinates is a trigonometric polynomial of the joint angles;
it is shortest in the Fourier basis cos(k.q), sin(k.q), where sums over parallel joints
show as sums of angles.

With w = exp(i q), cos(q/2) and sin(q/2) are (w + 1) and -i (w - 1), both over 2 exp(i q/2): put
in, a form of degree d is a polynomial in w whose coefficients are rational where the form's are,
and w^k stands for the frequency k - d/2. Nothing is rounded, and nothing dropped.

How equations are written: signs, coefficients, angles and powers, as plain text or LaTeX.
"""

from __future__ import annotations

import math
import operator
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from flint import Ordering, fmpz_mpoly_ctx

from pinsing.algebra.ring import Poly, Ring, terms_of, whole_terms
from pinsing.measures import Array, ArrayLike, Ints
from pinsing.robot.arm import Memory
from pinsing.robot.surd import SQUARES, Exact, exact_of, exact_text, parts_of, surd


def angles_text(values: Sequence[float], latex: bool = False) -> str:
    """Angles one of which it is: ``0° or 180°``, ``±90°``."""
    ordered = sorted(values, key=lambda v: (abs(v), v))
    if len(ordered) == 2 and abs(sum(ordered)) < 1e-12:
        return (r"\pm " if latex else "±") + format_angle(ordered[1], latex)
    either = r"\ \text{or}\ " if latex else " or "
    return either.join(format_angle(v, latex) for v in ordered)


def symbol_text(symbol: str, latex: bool = True) -> str:
    r"""``q_{12}`` for q12, ``\alpha_{2}`` for alpha2; names of several words upright."""
    if not latex:
        return symbol
    head = symbol.rstrip("0123456789")
    digits = symbol[len(head) :]
    if head == "alpha":
        head = r"\alpha"
    elif len(head) > 1:
        escaped = _SPECIAL.sub(lambda m: rf"\{m[0]}" if m[0] in "_#$%&{} " else "-", symbol)
        return rf"\mathrm{{{escaped}}}"
    return f"{head}_{{{digits}}}" if digits else head


_SPECIAL = re.compile(r"[^A-Za-z0-9.]")
"""Characters that LaTeX would take for a command, or that no name has."""


def format_angle(radians: float, latex: bool = False) -> str:
    """Degrees with as many digits as tell anything: ``90°``, ``-11.537°``."""
    shown = round(math.degrees(radians), 4)
    return (f"{shown:.10g}" if shown != 0 else "0") + (r"^\circ" if latex else "°")


def moved(name: str, radians: float, size: str) -> str:
    """``q2 + 30°``: a name, and an angle that is added, whose ``size`` is written."""
    return f"{name} {'+' if radians > 0 else '-'} {size}"


def sized(number: float | Exact, latex: bool = False) -> tuple[bool, str]:
    """Whether a minus stands before a number, and its size; sums with roots are in brackets."""
    if isinstance(number, float):
        return number < 0, f"{abs(number):.6g}"
    parts = [p for p in parts_of(number) if p]
    negative = len(parts) == 1 and parts[0] < 0
    size = exact_text(-number if negative else number)
    size = re.sub(r"sqrt\((\d)\)", r"\\sqrt{\1}", size) if latex else size
    return negative, f"({size})" if len(parts) > 1 else size


def signed_sum(
    pieces: Iterable[tuple[float | Exact, str]], tight: bool = False, latex: bool = False
) -> str:
    """Numbers and what they multiply, with signs in between, a one left out; 0 without any."""
    out, gap = "", "" if tight else " "
    for number, body in pieces:
        negative, size = sized(number, latex)
        term = body if size == "1" and body else f"{size} {body}".strip()
        sign = "-" if negative else "+" if out else ""
        out += f"{gap}{sign}{gap}{term}" if out else f"{sign}{term}"
    return out or "0"


Key = tuple[tuple[int, ...], tuple[int, ...]]
"""Twice the multiple of each angle, the first one that is not 0 positive; powers of sliders."""


def fourier(poly: Poly, ring: Ring, quarters: Sequence[int]) -> dict[Key, tuple[Exact, Exact]]:
    """Return coefficients of cos(k.q/2), sin(k.q/2), up to a positive factor; none is (0, 0)."""
    # The ring's angle of each joint exceeds q by so many ``quarters`` of a turn.
    terms = whole_terms(poly)
    context = fmpz_mpoly_ctx.get(list(poly.context().names()), Ordering.lex)
    gens, some = context.gens(), next(iter(terms))
    images, seconds, degree = list(gens), [], [0] * len(ring.prismatic)
    for j, first in enumerate(ring.start):
        if not ring.prismatic[j]:
            images[first], images[first + 1] = gens[first] + 1, gens[first] - 1
            seconds.append(first + 1)
            degree[j] = int(some[first] + some[first + 1])
    halves: tuple[dict[Any, int], dict[Any, int]] = {}, {}  # what is real, and what is times i
    for m, c in terms.items():
        turns = sum([m[v] for v in seconds]) % 4
        halves[turns % 2][m] = c * (1, -1, -1, 1)[turns]  # of (-i)^k: 1, -i, -1, i
    joints = list(zip(ring.start, ring.prismatic, degree, strict=True))
    gathered: dict[Key, list[list[int]]] = defaultdict(lambda: [[0] * 4, [0] * 4])
    for imaginary, half in enumerate(halves):
        made = context.from_dict(half).compose(*images, ctx=context)
        for exponents, c in terms_of(made).items():
            m = list(map(int, exponents))
            frequency = tuple([0 if slides else 2 * m[v] - d for v, slides, d in joints])
            lead = next((f for f in frequency if f), 0)
            if lead < 0:  # it is real: w^-k has the conjugate coefficient
                continue
            key = frequency, tuple([m[v] if slides else 0 for v, slides, _ in joints])
            square = SQUARES.index(math.prod(map(pow, ring.roots, m[ring.nvars :])))
            eighths = sum(map(operator.mul, frequency, quarters))
            # An odd number of them is odd for all terms: times exp(i pi/4), up to sqrt 2.
            for turn in range(imaginary, imaginary + 1 + eighths % 2):
                quarter = (turn + eighths // 2) % 4
                if lead or quarter % 2 == 0:  # a constant has no sine
                    size = int(2 * c if lead else c)
                    gathered[key][quarter % 2][square] += -size if quarter >= 2 else size
    pairs = (
        (key, (surd(*map(Fraction, real)), -surd(*map(Fraction, imag))))
        for key, (real, imag) in gathered.items()
    )
    return {key: pair for key, pair in pairs if any(pair)}  # a Surd is never zero


_NOTHING = 1e-15
"""Coefficients this small, relative to the sum of all, are rounding, and are not written out."""


@dataclass(frozen=True, eq=False)
class Equation(Memory):
    """A trigonometric polynomial that is zero on a family.

    The value at q is the sum over terms t of
    ``prod_j q_j^powers[t, j] * (cos_[t] cos(phi_t) + sin_[t] sin(phi_t))`` with
    ``phi_t = sum_j frequencies[t, j] (q_j + shift_j) / 2``.

    Attributes
    ----------
    joints : tuple of str
        Symbols of all the arm's joints (q1, d2, ...), base to tip.
    frequencies : (T, n) array of int
        Twice the multiple of each revolute angle: half-angles have odd entries.
    powers : (T, n) array of int
        Exponents of the prismatic joints.
    cos, sin : (T,) arrays
        Coefficients; metres where a scale by a length of the arm was found.
    shift : (n,) array
        Radians added to each angle: links turned about their own axis.
    accuracy : float
        Of the coefficients, relative to their sum: less than rounding where most of an equation
        has cancelled at the value of some joint.
    exact : tuple of (str, str)
        The same coefficients of cosine and sine exactly, up to one positive factor for all:
        ``-3``, ``5 + 2 sqrt(3)``. Empty where joints were put at values that are no such numbers.
    """

    joints: tuple[str, ...]
    frequencies: Ints
    powers: Ints
    cos: Array
    sin: Array
    shift: Array
    accuracy: float = 1e-15
    exact: tuple[tuple[str, str], ...] = field(default=(), metadata={"optional": True})

    def __post_init__(self) -> None:
        if self.exact and len(self.exact) != len(self.cos):
            raise ValueError("there are more, or less, exact coefficients than terms")

    @cached_property
    def involved(self) -> tuple[int, ...]:
        """Indices of the joints that occur."""
        used = (self.frequencies != 0).any(axis=0) | (self.powers != 0).any(axis=0)
        return tuple(int(j) for j in np.flatnonzero(used))

    @cached_property
    def size(self) -> float:
        """Sum of the coefficients' magnitudes: what a residual is relative to."""
        return float(np.hypot(self.cos, self.sin).sum())

    @property
    def unit(self) -> float:
        """Size that a residual is relative to: 1e-14 of it is rounding."""
        return self.size * max(1.0, self.accuracy / 1e-14)

    def enters(self, joint: int) -> str:
        """Return how a joint enters if it does so once, else nothing.

        ``two``: by its cosine and sine beside other terms; ``opposite``: in all terms; ``half``: by
        those of half of it; ``length``: a slider, to the first power.
        """
        rates = set(np.abs(self.frequencies[:, joint]).tolist())
        powers = set(self.powers[:, joint].tolist())
        if powers != {0}:
            return "length" if powers <= {0, 1} and rates == {0} else ""
        if rates == {1}:
            return "half"
        # Twice its multiples.
        once = rates <= {0, 2} and rates != {0}
        return ("two" if 0 in rates else "opposite") if once else ""

    @property
    def half_angle(self) -> bool:
        """True if half-angles occur, so that q and q + 2 pi give opposite signs."""
        return bool((self.frequencies % 2 != 0).any())

    def __call__(self, q: ArrayLike) -> Array:
        """Value at q (..., n): (...)."""
        q = np.asarray(q, dtype=float)
        return self._alone.values(q.reshape(-1, q.shape[-1])).reshape(q.shape[:-1])

    def gradient(self, q: ArrayLike) -> Array:
        """Return the derivatives by the joints at q (..., n): (..., n)."""
        q = np.asarray(q, dtype=float)
        return self._alone.gradients(q.reshape(-1, q.shape[-1])).reshape(q.shape)

    @property
    def _alone(self) -> System:
        return self.once("alone", lambda: System((self,), (1.0,)))

    def scaled(self, factor: float) -> Equation:
        """Return the same equation with all coefficients multiplied."""
        exact = self.exact
        if factor < 0:
            exact = tuple((exact_text(-exact_of(c)), exact_text(-exact_of(s))) for c, s in exact)
        return replace(self, cos=self.cos * factor, sin=self.sin * factor, exact=exact)

    def text(self) -> str:
        """Return ``0.4318 cos q2 + 0.0203 cos(q2+q3) - 0.4318 sin(q2+q3) = 0``, or such a line."""
        return self.line()

    def latex(self) -> str:
        """Return the same line in LaTeX."""
        return self.line(latex=True)

    def exact_text(self, latex: bool = False) -> str:
        """Return the same line with exact coefficients, or nothing where they are not known.

        Parameters
        ----------
        latex : bool
            As LaTeX.
        """
        if not self.exact or self.angle_sum is not None:
            return ""
        numbers = [(exact_of(c), exact_of(s)) for c, s in self.exact]
        return self.line(latex, numbers)

    def __str__(self) -> str:
        return self.text()

    @property
    def angle_sum(self) -> float | None:
        """Value of a sum of angles, in (-pi, pi], where a half-angle equation says no more."""
        if len(self.cos) != 1 or not self.half_angle or self.powers.any():
            return None
        # a cos(p/2) + b sin(p/2) = 0 with p the sum: p = 2 atan2(-a, b), modulo whole turns.
        angle = 2 * math.atan2(-self.cos[0], self.sin[0]) - float(self.frequencies[0] @ self.shift)
        angle = math.remainder(angle, 2 * math.pi)
        return angle if angle > -math.pi + 1e-12 else math.pi

    def angle_sum_text(self, angles: Sequence[float], latex: bool = False) -> str:
        """Return ``q3+q4 = 0° or 180°``, of this equation's sum of angles.

        Parameters
        ----------
        angles : sequence of float
            What the sum is, modulo whole turns, radians.
        latex : bool
            As LaTeX.
        """
        names = self._angle(2 * self.frequencies[0], latex, shift=False).strip("()")
        modulo = r"\pmod{360^\circ}" if latex else "(mod 360°)"
        return f"{names} = {angles_text(angles, latex)} {modulo}"

    def line(self, latex: bool = False, exact: Sequence[tuple[Exact, Exact]] = ()) -> str:
        """Return signed coefficients and what they multiply, in a good order for reading.

        Parameters
        ----------
        latex : bool
            As LaTeX.
        exact : sequence of (number, number)
            Coefficients of cosine and sine of each term in place of the rounded ones.
        """
        if (found := self.angle_sum) is not None:
            return self.angle_sum_text([found], latex)
        numbers = exact or np.stack([self.cos, self.sin], axis=1).tolist()
        pieces: list[tuple[float | Exact, str]] = []
        functions = (r"\cos", r"\sin") if latex else ("cos", "sin")
        for t in self._reading_order:
            factors = []
            for j in self.powers[t].nonzero()[0]:
                name, power = symbol_text(self.joints[j], latex), int(self.powers[t, j])
                raised = f"{name}^{{{power}}}" if latex else f"{name}^{power}"
                factors.append(raised if power > 1 else name)
            angle = self._angle(self.frequencies[t], latex)
            gap = "" if angle.startswith("(") and not latex else " "
            heads = [f"{name}{gap}{angle}" for name in functions] if angle else [""]
            for number, head in zip(numbers[t], heads, strict=False):  # a constant has no sine
                if number and (exact or self._tells(t, number)):
                    pieces.append((number, " ".join([*factors, head]).strip()))
        pieces = pieces if len(pieces) > 1 else [(1.0, body) for _, body in pieces]
        return f"{signed_sum(pieces, latex=latex)} = 0"

    def _tells(self, t: int, coefficient: float) -> bool:
        """Whether a coefficient of a term is more than rounding, or of no angle."""
        return abs(coefficient) > _NOTHING * self.size or not self.frequencies[t].any()

    @cached_property
    def _reading_order(self) -> tuple[int, ...]:
        """Its terms: those of few joints first, the constant last."""
        size = np.abs(self.frequencies)
        used = (size > 0).sum(axis=1)
        return tuple(np.lexsort([*-size.T[::-1], used, used == 0]).tolist())

    def _angle(self, frequency: Array, latex: bool, shift: bool = True) -> str:
        """``q2``, ``(q2+q3)``, ``(2 q4 - q5 + 12 deg)``, or nothing for the constant term."""
        used = np.flatnonzero(frequency)
        parts = [(frequency[j] / 2, symbol_text(self.joints[j], latex)) for j in used]
        if not parts:
            return ""
        halves = any(k != int(k) for k, _ in parts)
        if halves:
            parts = [(2 * k, s) for k, s in parts]
        text = signed_sum(parts, tight=True)
        offset = math.remainder(float(frequency @ self.shift) / 2, 2 * math.pi) * (1 + halves)
        single = len(parts) == 1 and parts[0][0] == 1
        if shift and abs(offset) > 1e-12:
            size = abs(math.degrees(offset))
            small = f"{size:.2g}" + (r"^\circ" if latex else "°")
            size_text = format_angle(abs(offset), latex) if round(size, 4) else small
            text, single = moved(text, offset, size_text), False
        inner = text if single else f"({text})"
        return f"({inner}/2)" if halves else inner


class System:
    """Equations, each over its unit; their sines and cosines are computed once."""

    def __init__(self, equations: Sequence[Equation], units: Sequence[float] = ()) -> None:
        self.count = len(equations)
        rows = np.concatenate([np.hstack([e.frequencies, e.powers]) for e in equations])
        index, of = (
            np.arange(len(rows)),
            np.repeat(range(self.count), [len(e.cos) for e in equations]),
        )
        if self.count > 1:  # else its terms have angles and powers of their own
            # np.unique does the same, slower, and imports masked arrays for it.
            every = [tuple(row) for row in rows.tolist()]
            number = {row: k for k, row in enumerate(sorted(set(every)))}
            rows, index = np.array(list(number)), np.array([number[row] for row in every])
        self._rate, self._power = rows[:, : rows.shape[1] // 2] / 2, rows[:, rows.shape[1] // 2 :]
        self._slides = np.flatnonzero(self._power.any(axis=0))
        self._cos, self._sin = np.zeros((2, len(rows), self.count))
        # Links turned about their axes: each equation may count its angles from elsewhere.
        phase = np.concatenate([e.frequencies @ e.shift / 2 for e in equations])
        share = np.repeat(units or [e.unit for e in equations], [len(e.cos) for e in equations])
        cos, sin = (
            np.concatenate([getattr(e, k) for e in equations]) / share for k in ("cos", "sin")
        )
        c, s = np.cos(phase), np.sin(phase)
        np.add.at(self._cos, (index, of), cos * c + sin * s)
        np.add.at(self._sin, (index, of), sin * c - cos * s)
        rate = self._rate[:, None, :]
        self._slope_cos = (self._sin[:, :, None] * rate).reshape(len(rows), -1)
        self._slope_sin = (self._cos[:, :, None] * rate).reshape(len(rows), -1)

    def _waves(self, q: Array, less: int = -1) -> tuple[Array, Array]:
        """Cosines and sines (N, T) times powers, or derivatives of these by one joint."""
        phase = q @ self._rate.T
        c, s = np.cos(phase), np.sin(phase)
        for j in self._slides.tolist():
            exponent = self._power[:, j]
            size = q[:, j, None] ** np.maximum(exponent - (j == less), 0)
            size = size * exponent if j == less else size
            c, s = c * size, s * size
        return c, s

    def values(self, q: Array) -> Array:
        """Values at q (N, n): (N, k)."""
        c, s = self._waves(q)
        return np.asarray(c @ self._cos + s @ self._sin)

    def gradients(self, q: Array) -> Array:
        """Derivatives at q (N, n): (N, k, n)."""
        c, s = self._waves(q)
        out = (c @ self._slope_cos - s @ self._slope_sin).reshape(len(q), self.count, q.shape[1])
        for j in self._slides.tolist():
            c, s = self._waves(q, j)
            out[:, :, j] += c @ self._cos + s @ self._sin
        return np.asarray(out)


def equation(poly: Poly, ring: Ring, joints: Sequence[str], offset: Array) -> Equation:
    """Return the Fourier form of a half-angle polynomial, scaled to a largest term of 1.

    Coefficients are exact, and rounded once: no term is dropped, however small. ``offset`` (n,) is
    in radians, from the arm's joint angles to the ring's.
    """
    # Quarter turns of an offset only swap sines and cosines; the rest stays a shift.
    quarters = np.where(ring.prismatic, 0, np.round(offset / (np.pi / 2))).astype(int)
    shift = np.where(ring.prismatic, 0.0, offset - quarters * (np.pi / 2))
    shift[np.abs(shift) < 1e-12] = 0.0
    n = len(ring.prismatic)
    terms = fourier(poly, ring, [int(k) for k in quarters])
    pairs = list(terms.values())
    parts = [p for pair in pairs for number in pair for p in parts_of(number) if p]
    largest = max(map(abs, parts))
    cos, sin = np.array([[float(number / largest) for number in pair] for pair in pairs]).T
    top = float(np.max(np.hypot(cos, sin)))
    draft = Equation(
        joints=tuple(joints),
        frequencies=np.array([k[0] for k in terms], dtype=np.int64).reshape(-1, n),
        powers=np.array([k[1] for k in terms], dtype=np.int64).reshape(-1, n),
        cos=cos / top,
        sin=sin / top,
        shift=shift,
    )
    shared = Fraction(math.gcd(*(p.numerator for p in parts)))  # they are whole
    every = ((t, float(x)) for t in draft._reading_order for x in (draft.cos[t], draft.sin[t]))
    if next((x for t, x in every if draft._tells(t, x)), 0.0) < 0:  # the one that is read first
        draft, shared = draft.scaled(-1.0), -shared
    exact = tuple((exact_text(c / shared), exact_text(s / shared)) for c, s in pairs)
    return replace(draft, exact=exact)


def scale_to_lengths(equation: Equation, lengths: Sequence[float]) -> Equation:
    """Scale an equation so that most coefficients are lengths of the arm, sums or differences."""
    # The factors of a determinant come without a natural scale.
    found = np.concatenate([np.abs(equation.cos), np.abs(equation.sin)])
    found = found[found > _NOTHING]
    known = sorted({abs(x) for x in lengths if abs(x) > 0})
    # Of more coefficients than these no common length is looked for.
    if len(found) < 2 or len(found) > 16 or not known or equation.powers.any():
        return equation
    pairs = np.sort([abs(a + s * b) for a in known for b in known for s in (1, -1)])
    largest = sorted(set(np.round(found, 14).tolist()), reverse=True)  # np.unique takes an import
    factors = [length / c for c in largest for length in known]
    scaled = found * np.array(factors)[:, None]
    # Which of the values (factors, coefficients) are lengths, and which are sums of two.
    matches = []
    for targets in (np.array(known), pairs):
        place = np.searchsorted(targets, scaled)
        below, above = targets[place - 1], targets[place % len(targets)]
        off = np.minimum(np.abs(scaled - below), np.abs(scaled - above))
        matches.append(off < 1e-9 * scaled)
    alone, paired = matches
    points = alone.sum(axis=1) + 0.4 * (~alone & paired).sum(axis=1)
    best = int(points.round(6).argmax())
    enough = points[best] >= max(1.4, 0.6 * len(found))
    return equation.scaled(factors[best]) if enough else equation
