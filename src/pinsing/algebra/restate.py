"""A system of equations, stated by what its own points say: part by part, and shorter.

Where a part of the common zeros does not depend on a joint, every coefficient with respect to
that joint's variables vanishes on it; where a polynomial falls into factors, one of them does.
Stated by these the part is smaller, never larger, than the system: whatever is zero here makes
all of the system's polynomials zero. That nothing of the part is lost its points show.
"""

from __future__ import annotations

from collections.abc import Sequence

from flint import Ordering, fmpz_mpoly_ctx, fmpz_mpoly_vec

from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.ring import Poly, Ring, coefficients_by, terms_of, whole_terms

Part = tuple[tuple[Poly, ...], list[SlicePoint]]


def restated(
    relations: Sequence[Poly], points: list[SlicePoint], count: int, ring: Ring, time: Budget
) -> list[Part]:
    """The parts of a system, each with equations and the points that are on it.

    Parameters
    ----------
    relations : sequence of Poly
        The system.
    points : list of SlicePoint
        Generic points of all of its parts that are meant.
    count : int
        How many independent equations there are.
    ring : Ring
        Its ring.
    time : Budget
        Asked before each long factorization.
    """
    polys = _distinct(_expanded(relations, points, ring), ring)
    chosen: list[Poly] = []
    for p in polys:
        # Terms up to which a polynomial is factored however late it is: the statement must not
        # depend on the load of a machine where it costs nothing.
        if len(p) > 100:
            time.check_factor(len(p), ring.long_to_factor(p))
        factors = ring.factors(p)
        whole = [f for f in factors if all(s.is_zero(f) for s in points)]
        if whole:
            chosen.append(min(whole, key=len))
            continue
        for f in factors:
            on = [s for s in points if s.is_zero(f)]
            if on and len(on) < len(points):
                off = [s for s in points if s not in on]
                return [
                    *restated(relations, on, count, ring, time),
                    *restated(relations, off, count, ring, time),
                ]
        return [(tuple(relations), points)]  # a point on none of the factors: leave it
    kept = _distinct(chosen, ring)
    return [(_fewest(kept, count, ring), points)]


def divided(relations: tuple[Poly, ...], ring: Ring) -> tuple[Poly, ...]:
    """The system, with relations that are products but for multiples of shorter ones as these.

    Their common zeros are the same: they fall into parts. Only products of what has fewer joints
    are made: others are no simpler, and may have zeros more where x^2 + y^2 of a joint is zero.
    """
    if not ring.rational or len(relations) < 2:
        return relations
    kept = list(relations)
    for k in range(1, len(kept)):
        for r in kept[:k]:
            quotient, rest = divmod(kept[k], r)
            if quotient == 0 or rest == 0 or len(rest) > len(kept[k]):
                continue
            rest = ring.strip(rest)
            many = len(ring.joints_of(kept[k]))
            if all(len(ring.joints_of(f)) < many for f in ring.factors(rest)):
                kept[k] = rest
    return tuple(kept)


def _expanded(relations: Sequence[Poly], points: Sequence[SlicePoint], ring: Ring) -> list[Poly]:
    """Coefficients with respect to all joints that no part of the points depends on."""
    polys = list(relations)
    for j in sorted({j for p in polys for j in ring.joints_of(p)}):
        together = _coefficients_on(polys, j, points, ring)
        if together is not None:
            polys = together
    return polys


def _coefficients_on(
    polys: Sequence[Poly], joint: int, points: Sequence[SlicePoint], ring: Ring
) -> list[Poly] | None:
    """All coefficients with respect to a joint, if they are not too many and zero at all points."""
    variables = ring.variables(joint)
    out: list[Poly] = []
    for p in polys:
        free = not any(p.degrees()[v] for v in variables)
        mine = [p] if free else list(coefficients_by(p, variables).values())
        mine = [ring.strip(c) for c in mine]
        out += mine
        # Equations after which expanding is given up.
        if len(out) > 60 or not all(s.is_zero(c) for c in mine for s in points):
            return None
    return out


def _distinct(polys: Sequence[Poly], ring: Ring) -> list[Poly]:
    """The polynomials, the short ones first, without multiples of earlier ones."""
    kept: list[Poly] = []
    for p in sorted(polys, key=len):
        factors = [k for k in kept if len(k) <= len(p)]
        if not any(_divides(k, p, ring) for k in factors):
            kept.append(p)
    return kept


def _divides(k: Poly, p: Poly, ring: Ring) -> bool:
    if ring.rational:
        return bool(divmod(p, k)[1] == 0)
    return bool(p == k)


def _fewest(polys: list[Poly], count: int, ring: Ring) -> tuple[Poly, ...]:
    """The first ``count`` polynomials, if all others lie in their ideal; else all."""
    if len(polys) <= count or not ring.rational:
        return tuple(polys)
    names = polys[0].context().names()
    context = fmpz_mpoly_ctx.get(list(names), Ordering.degrevlex)

    few = fmpz_mpoly_vec([context.from_dict(whole_terms(p)) for p in polys[:count]], context)
    # Of a Groebner basis: polynomials, terms, bits of coefficients.
    basis, done = few.buchberger_naive(limits=(60, 200, 5_000))
    if not done:
        return tuple(polys)
    over_q = [polys[0].context().from_dict(dict(terms_of(g))) for g in basis]
    if all(_reduced(p, over_q) == 0 for p in polys[count:]):
        return tuple(polys[:count])
    return tuple(polys)


def _reduced(poly: Poly, basis: Sequence[Poly]) -> Poly:
    """Remainder of division by all of a basis."""
    before = None
    while poly != 0 and poly != before:
        before = poly
        for g in basis:
            poly = divmod(poly, g)[1]
            if poly == 0:
                break
    return poly
