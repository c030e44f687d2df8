"""Real roots of polynomials in one joint."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from flint import acb, arb, ctx, fmpz_poly

from pinsing._dataclass import dataclass
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.robot.surd import SQUARES, Exact, Surd, parts_of, surd

_BITS = (400, 1_600, 6_400)
_SIGNS = ((1, 1), (-1, 1), (1, -1), (-1, -1))


@dataclass(frozen=True)
class AlgebraicValue:
    """A real algebraic number: a joint's half-angle tangent, or its metres.

    Attributes
    ----------
    ball : arb or None
        Where it is; None is an infinite tangent, an angle of 180 degrees.
    minimal : tuple of int
        Coefficients of its minimal polynomial, the constant first; empty where it is infinite.
    """

    ball: Any
    minimal: tuple[int, ...]

    def angle(self) -> float:
        """The angle in radians whose half has this tangent."""
        return math.pi if self.ball is None else float(2 * self.ball.atan())

    def exact(self, slides: bool) -> Value | None:
        """The same as a joint's value in the ring, where it is rational or infinite."""
        if self.ball is None:
            return Fraction(0), Fraction(1)
        if len(self.minimal) != 2:
            return None
        number = Fraction(-self.minimal[0], self.minimal[1])
        return (number,) if slides else (Fraction(1), number)


def real_roots(poly: Poly, joint: int, ring: Ring) -> list[AlgebraicValue]:
    """All distinct real values of a joint at which a polynomial in it alone is zero.

    The polynomial may be a product: a turning joint's infinite tangent, 180 degrees, is a root
    where its x divides.

    Roots of a polynomial with square roots in it are among those of its norm, the product of
    its images under all changes of the roots' signs. Ball arithmetic throws out those that are
    not; what is left is right when it is no more than the polynomial has complex roots.
    """
    first, last = ring.variables(joint)[0], ring.variables(joint)[-1]
    found = ring.terms(poly)
    infinite = first != last and min(m[first] for m in found) > 0
    terms: dict[int, Exact] = {int(m[last]): c for m, c in found.items()}
    own = [terms.get(i, Fraction(0)) for i in range(max(terms) + 1)]
    images, norm = {tuple(own)}, own
    if any(isinstance(c, Surd) for c in own):
        images = {tuple(_conjugate(c, signs) for c in own) for signs in _SIGNS}
        norm = [Fraction(1)]
        for row in images:
            norm = _product(norm, row)
    plain = [parts_of(c)[0] for c in norm]  # the square roots cancel
    scale = math.lcm(*(c.denominator for c in plain))
    factors = [f for f, _ in fmpz_poly([int(c * scale) for c in plain]).factor()[1]]
    before = ctx.prec
    try:
        for bits in _BITS:
            ctx.prec = bits
            met = [(z, f) for f in factors for z, _ in f.complex_roots()]
            if len(images) > 1:
                met = [(z, f) for z, f in met if _may_vanish(own, acb(z))]
            if len(images) == 1 or len(met) < len(own):
                real = [
                    AlgebraicValue(arb(z.real), tuple(int(c) for c in f.coeffs()))
                    for z, f in met
                    if z.imag == 0
                ]
                return real + [AlgebraicValue(None, ())] * infinite
    finally:
        ctx.prec = before
    raise ArithmeticError("roots of a polynomial with square roots in it were not told apart")


def _conjugate(value: Exact, signs: tuple[int, int]) -> Exact:
    """The number with sqrt(2) and sqrt(3) of these signs."""
    one, two, three, six = parts_of(value)
    return surd(one, two * signs[0], three * signs[1], six * signs[0] * signs[1])


def _product(a: list[Exact], b: tuple[Exact, ...]) -> list[Exact]:
    out: list[Exact] = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            out[i + k] = out[i + k] + x * y
    return out


def _may_vanish(coefficients: list[Exact], root: acb) -> bool:
    """Whether zero is among the possible values at a root."""
    total = acb(0)
    for c in reversed(coefficients):
        value = arb(0)
        for square, part in zip(SQUARES, parts_of(c), strict=True):
            value += arb(part.numerator) / arb(part.denominator) * arb(square).sqrt()
        total = total * root + acb(value)
    return bool(total.contains(0))
