"""Real roots of polynomials in one joint."""

from __future__ import annotations

import math
from fractions import Fraction

from flint import acb, arb, ctx, fmpz_poly

from pinsing.algebra.ring import Poly, Ring
from pinsing.geometry.surd import SQUARES, Exact, Surd, parts_of, surd

_BITS = (400, 1_600, 6_400)
_SIGNS = ((1, 1), (-1, 1), (1, -1), (-1, -1))


def real_roots(poly: Poly, variable: int, ring: Ring) -> list[float]:
    """Distinct real roots of a polynomial in one variable, accurate to double precision.

    Roots of a polynomial with square roots in it are among those of its norm, the product of
    its images under all changes of the roots' signs. Ball arithmetic throws out those that are
    not; what is left is right when it is as many as the polynomial, which is irreducible and so
    has no root twice, has complex roots.
    """
    terms: dict[int, Exact] = {int(m[variable]): c for m, c in ring.terms(poly).items()}
    degree = max(terms)
    own = [terms.get(i, Fraction(0)) for i in range(degree + 1)]
    images, norm = {tuple(own)}, own
    if any(isinstance(c, Surd) for c in own):
        images = {tuple(_conjugate(c, signs) for c in own) for signs in _SIGNS}
        norm = [Fraction(1)]
        for row in images:
            norm = _product(norm, row)
    plain = [parts_of(c)[0] for c in norm]  # the square roots cancel
    scale = math.lcm(*(c.denominator for c in plain))
    own_degree = max(i for i, c in enumerate(own) if c != 0)
    factors = [f for f, _ in fmpz_poly([int(c * scale) for c in plain]).factor()[1]]
    before = ctx.prec
    try:
        for bits in _BITS:
            ctx.prec = bits
            met = [z for f in factors for z, _ in f.complex_roots()]
            if len(images) > 1:
                met = [z for z in met if _may_vanish(own, acb(z))]
            if len(images) == 1 or len(met) <= own_degree:
                return [float(z.real) for z in met if z.imag == 0]
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
