"""Sums of squares: why a form is nowhere negative, or has few real zeros."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import arb, ctx, fmpq, fmpz_poly

from pinsing.proof.checker import Poly, Ring

Squares = list[tuple[Fraction, Poly]]
"""Positive factors, and forms that are squared."""


def squares(ring: Ring, p: Poly) -> tuple[Poly, Squares] | None:
    """A form and a sum of squares that are the same: the form is a multiple of ``p``.

    Where ``p`` is in one joint that is a multiple by 1 or -1; else the square is completed in
    one joint, and what is left is a sum of squares in the others.
    """
    joints = ring.joints(p)
    if len(joints) == 1:
        for sign in (1, -1):
            parts = _in_one_joint(ring, sign * p, joints[0])
            if parts is not None:
                return ring.one * sign, parts
        return None
    for j in joints:
        if ring.degree(p, j) != 2:
            continue
        found = _completed(ring, p, j)
        if found is not None:
            return found
    return None


def _completed(ring: Ring, p: Poly, j: int) -> tuple[Poly, Squares] | None:
    """With p = a y^2 + b x y + c x^2: 4 a p = (2 a y + b x)^2 + (4 a c - b^2) x^2."""
    x, y = ring.pairs[j]
    a, b, c = (_coefficient(ring, p, j, k) for k in (2, 1, 0))
    rest = 4 * a * c - b * b
    if rest == 0:
        return 4 * a, [(Fraction(1), 2 * a * y + b * x)]
    if len(ring.joints(rest)) > 1:
        return None
    if not ring.joints(rest):
        value = rest.leading_coefficient()
        return (
            (4 * a, [(Fraction(1), 2 * a * y + b * x), (_fraction(value), x)])
            if value > 0
            else None
        )
    left = _in_one_joint(ring, rest, ring.joints(rest)[0])
    if left is None:
        return None
    return 4 * a, [(Fraction(1), 2 * a * y + b * x), *((w, g * x) for w, g in left)]


def _coefficient(ring: Ring, p: Poly, j: int, power: int) -> Poly:
    terms = {
        (*m[: 2 * j], 0, 0, *m[2 * j + 2 :]): c
        for m, c in p.to_dict().items()
        if m[2 * j + 1] == power
    }
    return ring.context.from_dict(terms)


def _in_one_joint(ring: Ring, p: Poly, j: int) -> Squares | None:
    """A form in one joint as a sum of squares, if it is nowhere negative."""
    constant, factors = p.factor()
    if constant < 0 or ring.squares:
        return None
    found: Squares = [(_fraction(constant), ring.one)]
    for f, times in factors:
        found = [(w, g * f ** (times // 2)) for w, g in found]
        if times % 2:
            one = _positive(ring, f, j)
            if one is None:
                return None
            found = [(w * u, g * h) for w, g in found for u, h in one]
    return found


def _positive(ring: Ring, f: Poly, j: int) -> Squares | None:
    """An irreducible form in one joint as a sum of squares, if it has no real zero."""
    degree = ring.degree(f, j)
    if degree % 2:
        return None
    coefficients = [Fraction(0)] * (degree + 1)
    for m, c in f.to_dict().items():
        coefficients[m[2 * j + 1]] = _fraction(c)
    # How small a part of a polynomial is set aside for rounding: 2 to the minus these.
    for part in (8, 16, 32, 64, 128):
        parts = _of_positive(coefficients, part)
        if parts is not None:
            return [(w, _form(ring, g, j)) for w, g in parts]
    return None


def _form(ring: Ring, coefficients: Sequence[Fraction], j: int) -> Poly:
    (x, y), top = ring.pairs[j], len(coefficients) - 1
    terms = (
        fmpq(c.numerator, c.denominator) * y**k * x ** (top - k) for k, c in enumerate(coefficients)
    )
    return sum(terms, ring.zero)


def _of_positive(p: list[Fraction], part: int) -> list[tuple[Fraction, list[Fraction]]] | None:
    """A polynomial in t as squares: A^2 + B^2 from its roots, and what rounding leaves.

    From a p - e (1 + t^2 + ... + t^2m) without real roots, whose roots above the real axis give
    A + iB. The rest is e t^2k and small odd terms, and d t^(2k+1) is half of
    |d| (t^(k+1) +- t^k)^2 less that of t^(2k+2) and t^2k.
    """
    half = len(p) // 2
    if p[0] <= 0 or p[-1] <= 0:
        return None
    if half == 1:  # complete the square
        c, b, a = p
        rest = c - b * b / (4 * a)
        return (
            [(a, [b / (2 * a), Fraction(1)]), (rest, [Fraction(1), Fraction(0)])]
            if rest > 0
            else None
        )
    small = min(p[0], p[-1]) / 2**part
    less = [c - (small if k % 2 == 0 else 0) for k, c in enumerate(p)]
    parts = _from_roots(less, part + 16)
    if parts is None:
        return None
    lead = less[-1]
    left = list(p)
    for g in parts:
        for i, k in itertools.product(range(half + 1), repeat=2):
            left[i + k] -= lead * g[i] * g[k]
    found = [(lead, g) for g in parts if any(g)]
    for k in range(half):
        d = left[2 * k + 1]
        if d:
            sign = 1 if d > 0 else -1
            pair = [Fraction(0)] * (half + 1)
            pair[k], pair[k + 1] = Fraction(sign), Fraction(1)
            found.append((abs(d) / 2, pair))
            left[2 * k] -= abs(d) / 2
            left[2 * k + 2] -= abs(d) / 2
    for k in range(half + 1):
        if left[2 * k] < 0:
            return None
        if left[2 * k] > 0:
            found.append((left[2 * k], [Fraction(int(i == k)) for i in range(half + 1)]))
    return found


def _from_roots(p: list[Fraction], bits: int) -> tuple[list[Fraction], list[Fraction]] | None:
    """A and B, rounded, of a polynomial that is its first coefficient times A^2 + B^2."""
    scale = math.lcm(*(c.denominator for c in p))
    # Precision of the roots that a sum of squares is made from.
    with ctx.workprec(200):
        roots = fmpz_poly([int(c * scale) for c in p]).complex_roots()
        if any(z.imag.contains(0) for z, _ in roots):
            return None
        real, imag = [arb(1)], [arb(0)]
        for z in (z for z, times in roots if z.imag > 0 for _ in range(times)):
            real, imag = (
                [b - z.real * a + z.imag * c for a, b, c in _shifted(real, imag)],
                [b - z.real * a - z.imag * c for a, b, c in _shifted(imag, real)],
            )
        return [_rounded(c, bits) for c in real], [_rounded(c, bits) for c in imag]


def _shifted(own: list[arb], other: list[arb]) -> Iterator[tuple[arb, arb, arb]]:
    """Coefficients of a polynomial, of t times it, and of another one, power by power."""
    return zip([*own, arb(0)], [arb(0), *own], [*other, arb(0)], strict=True)


def _rounded(value: arb, bits: int) -> Fraction:
    return Fraction(round(float(value.mid() * 2**bits)), 2**bits)


def _fraction(value: fmpq) -> Fraction:
    return Fraction(int(value.p), int(value.q))
