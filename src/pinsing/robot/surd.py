"""Exact numbers a + b sqrt(2) + c sqrt(3) + d sqrt(6): what sines of 15 degrees are made of."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

SQUARES = (1, 2, 3, 6)
_PRODUCT = {
    (i, j): (SQUARES.index(a * b // math.gcd(a, b) ** 2), math.gcd(a, b))
    for i, a in enumerate(SQUARES)
    for j, b in enumerate(SQUARES)
}
"""sqrt(a) sqrt(b) = gcd(a, b) sqrt(a b / gcd(a, b)^2), by position among SQUARES."""
_BITS = 512
_ROOTS = tuple(Fraction(math.isqrt(s << (2 * _BITS)), 1 << _BITS) for s in SQUARES)


@dataclass(frozen=True)
class Surd:
    """An irrational number of Q(sqrt 2, sqrt 3), by ``surd``; rational results are Fractions."""

    # coefficients of 1, sqrt(2), sqrt(3), sqrt(6)
    parts: tuple[Fraction, Fraction, Fraction, Fraction]

    def __add__(self, other: Exact | int) -> Exact:
        return surd(*(a + b for a, b in zip(self.parts, parts_of(other), strict=True)))

    __radd__ = __add__

    def __neg__(self) -> Exact:
        return surd(*(-a for a in self.parts))

    def __sub__(self, other: Exact | int) -> Exact:
        return self + (-other)

    def __rsub__(self, other: Exact | int) -> Exact:
        return -self + other

    def __mul__(self, other: Exact | int) -> Exact:
        out = [Fraction(0)] * 4
        for i, a in enumerate(self.parts):
            for j, b in enumerate(parts_of(other)):
                if a and b:
                    k, factor = _PRODUCT[i, j]
                    out[k] += a * b * factor
        return surd(*out)

    __rmul__ = __mul__

    def __truediv__(self, other: Exact | int) -> Exact:
        return self * (other.inverse() if isinstance(other, Surd) else 1 / Fraction(other))

    def __rtruediv__(self, other: Exact | int) -> Exact:
        return self.inverse() * other

    def inverse(self) -> Exact:
        """One over the number."""
        a, b, c, d = self.parts
        # Times its image under sqrt 3 -> -sqrt 3 it is in Q(sqrt 2); times that one's, in Q.
        half = surd(a, b, -c, -d)
        lower = parts_of(self * half)
        other = surd(lower[0], -lower[1], Fraction(0), Fraction(0))
        return half * other * (1 / (lower[0] ** 2 - 2 * lower[1] ** 2))

    def __float__(self) -> float:
        return float(sum((a * r for a, r in zip(self.parts, _ROOTS, strict=True)), Fraction(0)))


Exact: TypeAlias = Fraction | Surd
"""A number of the field: rational ones are Fractions."""


_NONE = Fraction()


def surd(one: Fraction, two: Fraction, three: Fraction, six: Fraction) -> Exact:
    """The number one + two sqrt(2) + three sqrt(3) + six sqrt(6)."""
    return one if not (two or three or six) else Surd((one, two, three, six))


def parts_of(value: Exact | int) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """Coefficients of 1, sqrt(2), sqrt(3), sqrt(6)."""
    if isinstance(value, Surd):
        return value.parts
    return value if type(value) is Fraction else Fraction(value), _NONE, _NONE, _NONE


def roots_of(numbers: Iterable[Exact]) -> tuple[int, ...]:
    """Return what numbers have square roots of: 2 or 3, both or none."""
    used = {
        s
        for x in numbers
        if isinstance(x, Surd)
        for s, a in zip(SQUARES, x.parts, strict=True)
        if a
    }
    return tuple(d for d in (2, 3) if any(s % d == 0 for s in used))


def cosine(steps: int) -> Exact:
    """Cosine of a multiple of 15 degrees."""
    steps %= 24
    if steps > 12:
        steps = 24 - steps
    if steps > 6:
        return -cosine(12 - steps)
    half, quarter, zero = Fraction(1, 2), Fraction(1, 4), Fraction(0)
    return (
        Fraction(1),
        surd(zero, quarter, zero, quarter),
        surd(zero, zero, half, zero),
        surd(zero, half, zero, zero),
        half,
        surd(zero, -quarter, zero, quarter),
        zero,
    )[steps]


def sine(steps: int) -> Exact:
    """Sine of a multiple of 15 degrees."""
    return cosine(steps - 6)


_ROOT = re.compile(r"(?P<sign>[-+]?)\s*(?P<number>\d+(?:/\d+)?)(?:\s*sqrt\((?P<root>[236])\))?\s*")


def exact_text(value: Exact) -> str:
    """``3/4``, or ``1/2 - 3 sqrt(2)``: read again by ``exact_of``."""
    if not isinstance(value, Surd):
        return str(value)
    said = ""
    for square, part in zip(SQUARES, value.parts, strict=True):
        if part:
            sign = ("-" if part < 0 else "") if not said else (" - " if part < 0 else " + ")
            root = "" if square == 1 else f" sqrt({square})"
            said += f"{sign}{abs(part)}{root}"
    return said or "0"


def exact_of(text: str) -> Exact:
    """Return the number that ``exact_text`` wrote; ValueError for anything else."""
    parts, end = [Fraction(0)] * 4, 0
    for match in _ROOT.finditer(text):
        if match.start() != end or (end > 0) != bool(match["sign"] if end else end):
            raise ValueError(f"not an exact number: {text!r:.40}")
        end = match.end()
        size = Fraction(match["number"])
        root = SQUARES.index(int(match["root"] or 1))
        parts[root] += -size if match["sign"] == "-" else size
    if end != len(text) or not text:
        raise ValueError(f"not an exact number: {text!r:.40}")
    return surd(*parts)


_SMALL = 1000
"""Primes below which all residues are tried."""


def residue(value: Exact, prime: int) -> int:
    """A number modulo a prime, square roots at one of their values there."""
    total = 0
    for square, part in zip(SQUARES, parts_of(value), strict=True):
        if part:
            total += part.numerator * pow(part.denominator, -1, prime) * root_modulo(square, prime)
    return total % prime


@functools.cache
def root_modulo(square: int, prime: int) -> int:
    """Return a square root of 1, 2, 3 or 6 modulo a prime; ValueError if there is none."""
    # sqrt(2) = z + 1/z for a z of order 8, sqrt(3) for one of order 12, where the prime is 1 mod
    # 24.
    if square == 1:
        return 1
    if square == 6:
        return root_modulo(2, prime) * root_modulo(3, prime) % prime
    order = {2: 8, 3: 12}[square]
    of_order = (pow(base, (prime - 1) // order, prime) for base in range(2, 1000))
    sums = ((z + pow(z, -1, prime)) % prime for z in of_order)
    for root in range(1, prime) if prime < _SMALL else sums:
        if (root * root - square) % prime == 0:
            return root
    raise ValueError(f"no square root of {square} modulo {prime}")
