"""Exact real solutions of finitely many joint values that depend on each other.

A system of polynomials whose common zeros are finitely many is solved without any tolerance.
Each joint's values are roots of one polynomial over the rationals (the eliminant, from a
Groebner basis), whose complex roots flint isolates in balls. Of all their combinations those
are thrown out at which some polynomial is not zero by ball arithmetic; the rest is all right
when it is as many as there are solutions, and that number is known: with the squarefree
eliminants added the ideal is radical (Seidenberg, 1974), so it is the number of monomials that
no leading monomial of its Groebner basis divides.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from flint import Ordering, acb, arb, ctx, fmpz_mpoly_ctx, fmpz_mpoly_vec, fmpz_poly

from pinsing.algebra.budget import Budget
from pinsing.algebra.real_roots import AlgebraicValue
from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.terms import terms_of

_LIMITS = (120, 400, 20_000)
"""Of a Groebner basis: polynomials, terms, bits of coefficients."""
_MOST = 4_096
"""Combinations of roots that are tried."""
_BITS = (128, 512, 2_048)
_SHORT = (2, 60, 16)
"""Joints, terms and product of degrees of a system that is solved at once, whatever its numbers."""


class NotFinite(Exception):
    """The solutions are not finitely many, or too many to be told apart here."""


Solution = Mapping[int, AlgebraicValue]
"""Values of all joints of a system."""


def real_solutions(polys: Sequence[Poly], ring: Ring, time: Budget) -> list[Solution]:
    """All real common zeros of polynomials that have finitely many.

    Those of short systems are found however late it is: an answer must not depend on the load of a
    machine where it costs nothing.

    Parameters
    ----------
    polys : sequence of Poly
        Polynomials of the ring; every joint that occurs is solved for.
    ring : Ring
        Their ring.
    time : Budget
        Asked before each long step.

    Raises
    ------
    NotFinite
        If there are infinitely many, or too many.
    """
    joints = sorted({j for p in polys for j in ring.joints_of(p)})
    if _is_short(polys, joints, ring):
        time = Budget(math.inf)
    found: dict[object, Solution] = {}
    for s in _solve(list(polys), joints, ring, time):
        key = tuple(
            (j, v.minimal, v.ball is None or v.ball.str(20, radius=False))
            for j, v in sorted(s.items())
        )
        found.setdefault(key, s)
    return list(found.values())


def _is_short(polys: Sequence[Poly], joints: Sequence[int], ring: Ring) -> bool:
    degrees = (
        max(sum(int(m[v]) for v in ring.variables(j)) for p in polys for m in p.monoms())
        for j in joints
    )
    terms = sum(map(len, polys))
    return len(joints) <= _SHORT[0] and terms <= _SHORT[1] and math.prod(degrees) <= _SHORT[2]


def _solve(polys: list[Poly], joints: list[int], ring: Ring, time: Budget) -> list[Solution]:
    """Solutions with finite tangents, and those where one tangent is infinite or more."""
    polys = [p for p in polys if p != 0]
    if any(ring.is_constant(p) for p in polys):
        return []
    if not joints:
        return [{}]
    out = _Affine(polys, joints, ring, time).solutions()
    for k, j in enumerate(joints):
        if ring.prismatic[j]:
            continue
        x, y = (ring.context.names()[v] for v in ring.variables(j))
        there = [p.subs({x: 0, y: 1}) for p in polys]
        rest = [i for i in joints if i != j]
        if all(p == 0 for p in there) and rest:
            raise NotFinite
        for s in _solve(there, rest, ring, time):
            if all(s[i].ball is not None for i in joints[:k]):  # else it was met before
                out.append({**s, j: AlgebraicValue(None, ())})
    return out


class _Affine:
    """The system in half-angle tangents t (and metres), square roots s as variables more."""

    def __init__(self, polys: list[Poly], joints: list[int], ring: Ring, time: Budget) -> None:
        self.joints, self.ring, self.time = joints, ring, time
        self.roots: tuple[int, ...] = getattr(ring, "roots", ())
        self.size = len(joints) + len(self.roots)
        self.system = [self._terms(p) for p in polys]
        for k, d in enumerate(self.roots):
            at = len(joints) + k
            self.system.append({self._power(at, 2): 1, self._power(at, 0): -d})

    def _power(self, at: int, exponent: int) -> tuple[int, ...]:
        return tuple(exponent if i == at else 0 for i in range(self.size))

    def _terms(self, poly: Poly) -> dict[tuple[int, ...], int]:
        """Integer terms in t of each joint and the square roots; x is 1."""
        terms: dict[tuple[int, ...], Any] = {}
        last = [self.ring.variables(j)[-1] for j in self.joints]
        for m, c in terms_of(poly).items():
            key = tuple(int(m[v]) for v in last) + tuple(int(e) for e in m[self.ring.nvars :])
            terms[key] = terms.get(key, 0) + c
        scale = math.lcm(*(int(c.q) for c in terms.values()))
        return {m: int(c.p) * (scale // int(c.q)) for m, c in terms.items() if c != 0}

    def _basis(
        self, system: Sequence[Mapping[tuple[int, ...], int]], order: Sequence[int]
    ) -> tuple[list[Any], Any]:
        """Groebner basis, lexicographic, with the variables in this order."""
        self.time.check()
        context = fmpz_mpoly_ctx.get([f"v{i}" for i in order], Ordering.lex)
        polys = [
            context.from_dict({tuple(m[i] for i in order): c for m, c in terms.items()})
            for terms in system
        ]
        basis, done = fmpz_mpoly_vec(polys, context).buchberger_naive(limits=_LIMITS)
        if not done:
            raise NotFinite
        basis = fmpz_mpoly_vec(list(basis), context).autoreduction(groebner=True)
        return list(basis), context

    def _eliminant(self, variable: int) -> fmpz_poly | None:
        """The squarefree polynomial whose roots a variable has; None if there is no solution."""
        order = [i for i in range(self.size) if i != variable] + [variable]
        basis, _ = self._basis(self.system, order)
        for p in basis:
            if p.is_constant():
                return None
            terms = terms_of(p)
            if all(not any(m[:-1]) for m in terms):
                degree = max(int(m[-1]) for m in terms)
                line = [0] * (degree + 1)
                for m, c in terms.items():
                    line[int(m[-1])] = int(c)
                out = fmpz_poly([1])
                for f, _ in fmpz_poly(line).factor()[1]:
                    if f != fmpz_poly([1, 0, 1]) or variable >= len(self.joints):
                        out *= f
                return out
        raise NotFinite

    def solutions(self) -> list[Solution]:
        """Real solutions, square roots positive."""
        eliminants = []
        for i in range(self.size):
            e = self._eliminant(i)
            if e is None or e.degree() == 0:
                return []
            eliminants.append(e)
        if math.prod(e.degree() for e in eliminants) > _MOST:
            raise NotFinite
        lines = [
            {self._power(i, k): int(c) for k, c in enumerate(e.coeffs()) if c}
            for i, e in enumerate(eliminants)
        ]
        system = [*self.system, *lines]
        basis, _ = self._basis(system, range(self.size))
        count = _standard_monomials(basis, [e.degree() for e in eliminants])
        before = ctx.prec
        try:
            for bits in _BITS:
                ctx.prec = bits
                roots = [
                    [(z, f) for f, _ in e.factor()[1] for z, _ in f.complex_roots()]
                    for e in eliminants
                ]
                met = [c for c in itertools.product(*roots) if self._may_vanish(c)]
                if len(met) == count:
                    return [self._solution(c) for c in met if self._wanted(c)]
        finally:
            ctx.prec = before
        raise NotFinite

    def _may_vanish(self, combination: Sequence[tuple[Any, fmpz_poly]]) -> bool:
        self.time.check()
        values = [acb(z) for z, _ in combination]
        for terms in self.system:
            total = acb(0)
            for m, c in terms.items():
                term = acb(c)
                for value, e in zip(values, m, strict=True):
                    if e:
                        term *= value**e
                total += term
            if not total.contains(0):
                return False
        return True

    def _wanted(self, combination: Sequence[tuple[Any, fmpz_poly]]) -> bool:
        """Whether a solution is real, its square roots the positive ones."""
        parts = [acb(z) for z, _ in combination]
        return all(z.imag == 0 for z in parts) and all(
            z.real > 0 for z in parts[len(self.joints) :]
        )

    def _solution(self, combination: Sequence[tuple[Any, fmpz_poly]]) -> Solution:
        return {
            j: AlgebraicValue(arb(acb(z).real), tuple(int(c) for c in f.coeffs()))
            for j, (z, f) in zip(self.joints, combination, strict=False)
        }


def _standard_monomials(basis: Sequence[Any], bounds: Sequence[int]) -> int:
    """Monomials that no leading monomial of a Groebner basis divides."""
    leads = [tuple(int(e) for e in p.monomial(0)) for p in basis]
    return sum(
        not any(all(a <= b for a, b in zip(lead, m, strict=True)) for lead in leads)
        for m in itertools.product(*(range(b) for b in bounds))
    )
