"""Forms in half-angle coordinates as polynomials in the cosines and sines of joints."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx

from pinsing.algebra.ring import Poly, Ring, fraction, rational
from pinsing.loops.pose_equation import PoseEquation


def trig_polynomial(poly: Poly, ring: Ring, joints: Sequence[str]) -> PoseEquation:
    """The polynomial in cos q, sin q of joints that turn and in q of those that slide.

    Its scale is kept. Every degree in a pair of half-angle variables must be even.

    Parameters
    ----------
    poly : Poly
        A form: of one degree in each joint's pair of variables.
    ring : Ring
        Its ring.
    joints : sequence of str
        Names of all joints.
    """
    used = ring.joints_of(poly) if poly != 0 else ()
    names: list[str] = []
    for j in used:
        names += [joints[j]] if ring.prismatic[j] else [f"cos {joints[j]}", f"sin {joints[j]}"]
    if not names:
        constant = [fraction(c) for c in poly.to_dict().values()] if poly != 0 else []
        return _polynomial((), [((), c) for c in constant])
    there = fmpq_mpoly_ctx.get([f"t{k}" for k in range(len(names))], Ordering.lex)
    gens = iter(there.gens())
    places = [(next(gens),) if ring.prismatic[j] else (next(gens), next(gens)) for j in used]
    known: dict[tuple[int, ...], Poly] = {}
    total = there.constant(0)
    for monomial, c in poly.to_dict().items():
        line = there.constant(c)
        for k, j in enumerate(used):
            exponents = tuple(int(monomial[v]) for v in ring.variables(j))
            key = (k, *exponents)
            if key not in known:
                known[key] = (
                    places[k][0] ** exponents[0]
                    if ring.prismatic[j]
                    else _pair(exponents[0], exponents[1], *places[k])
                )
            line *= known[key]
        total += line
    found = [(tuple(int(e) for e in powers), fraction(c)) for powers, c in total.to_dict().items()]
    return _polynomial(tuple(names), sorted(found, key=lambda t: tuple(-p for p in t[0])))


def _polynomial(
    names: tuple[str, ...], found: Sequence[tuple[tuple[int, ...], Fraction]]
) -> PoseEquation:
    return PoseEquation(
        names,
        np.array([k for k, _ in found], dtype=int).reshape(len(found), len(names)),
        tuple(str(v) for _, v in found),
        np.array([float(v) for _, v in found]),
    )


def _pair(i: int, j: int, c: Poly, s: Poly) -> Poly:
    """x^i y^j as a polynomial in cos and sin: x^2 = (1 + c) / 2, y^2 = (1 - c) / 2, x y = s / 2."""
    if (i + j) % 2:
        raise ValueError("a form of odd degree has no cosines and sines of the whole angle")
    half = rational(Fraction(1, 2))
    out = ((1 + c) * half) ** (i // 2) * ((1 - c) * half) ** (j // 2)
    return out * (s * half) if i % 2 else out
