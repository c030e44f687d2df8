"""From a polynomial matrix to the components of the set where its rank drops.

Every component of the complex set {rank M < r} of a rows x columns matrix has codimension
at most (rows - r + 1)(columns - r + 1) (Eagon and Northcott, 1962). So the search branches
on factors of the minors, puts joint values in as soon as a factor fixes one, and leaves a
branch whose codimension has passed the bound: whatever is left there lies on a component
of larger dimension, which another branch finds.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pinsing.closed_form.budget import Budget, BudgetExceeded
from pinsing.closed_form.columns import Matrix, reduce_matrix
from pinsing.closed_form.minors import Minors
from pinsing.closed_form.ring import Poly, Ring, Value
from pinsing.closed_form.slices import Residues, SlicePoint, UndecidedSlice, slice_points

_SEED = 7
_LOOKED_AT = 12
"""Minors among which the simplest is looked for."""
_RESULTANT_TERMS = 2_000
"""Largest product of term counts for which a symbolic resultant is tried."""


@dataclass(frozen=True)
class Component:
    """Where rank drops: joints at exact values, and polynomials that vanish.

    Attributes
    ----------
    values : mapping of joint to Value
        Exact joint values.
    relations : tuple of Poly
        Polynomials in the other joints; one, or a system of several.
    proven : bool
        Whether every minor was shown to vanish there by division (else at random points, in
        exact arithmetic modulo a prime).
    codimension : int
        Complex codimension.
    """

    values: Mapping[int, Value]
    relations: tuple[Poly, ...]
    proven: bool
    codimension: int


class Decomposition:
    """Runs the search and collects components, and what stopped it where it did not finish."""

    def __init__(self, matrix: Matrix, rank: int, ring: Ring, time: Budget) -> None:
        self.ring = ring
        self.time = time
        self.components: list[Component] = []
        self.gaps: list[str] = []
        self.stopped = False
        self._rng = np.random.default_rng(_SEED)
        self._residues = Residues(ring)
        self._seen: set[object] = set()
        rows, reduced = reduce_matrix(matrix, rank, ring)
        if reduced > 0 and rows:
            bound = (len(rows) - reduced + 1) * (len(rows[0]) - reduced + 1)
        else:
            bound = 1
        self.bound = bound
        try:
            self._matrix(rows, reduced, {}, bound)
        except BudgetExceeded as reason:
            self.stopped = True
            self.gaps.append(str(reason))
        self.components = self._irredundant(self.components)

    # Branches -----------------------------------------------------------------------

    def _matrix(self, matrix: Matrix, rank: int, values: dict[int, Value], budget: int) -> None:
        """All components of codimension up to ``budget`` of where ``matrix`` is below ``rank``."""
        key = frozenset(values.items())
        if key in self._seen or self._covered(values, ()):
            return
        self._seen.add(key)
        matrix, rank = reduce_matrix(matrix, rank, self.ring)
        if rank <= 0:
            return
        if not matrix or min(len(matrix), len(matrix[0])) < rank:
            self._emit(values, (), True)
            return
        budget = min(budget, (len(matrix) - rank + 1) * (len(matrix[0]) - rank + 1))
        if budget <= 0:
            return
        minors = Minors(matrix, rank, self.ring, self.time)
        common = self._common_factor(minors)
        if common is None:
            self._emit(values, (), True)
            return
        shared = self._factors(common)
        for f in shared:
            self._hypersurface(f, values)
        if budget < 2:
            return
        simplest = self._simplest_cofactor(minors, common)
        for f in simplest:
            if f in shared:
                continue
            fixed = self.ring.joint_value(f)
            if fixed is not None:
                j, value = fixed
                inner = {**values, j: value}
                self._matrix(self._put(matrix, {j: value}), rank, inner, budget - 1)
            else:
                self._relation(f, matrix, rank, values, minors, budget - 1)

    def _relation(
        self,
        p: Poly,
        matrix: Matrix,
        rank: int,
        values: dict[int, Value],
        minors: Minors,
        budget: int,
    ) -> None:
        """Components inside p = 0, of codimension up to ``budget`` there."""
        key = (frozenset(values.items()), str(p))
        if key in self._seen or self._covered(values, (p,)):
            return
        self._seen.add(key)
        others = []
        for minor in minors:
            if not self.ring.divides(p, minor):
                factors = self._factors(minor)
                if not factors:
                    return
                others.append(factors)
                if len(others) >= 6:
                    break
        if not others:
            self._emit(values, (p,), True)
            return
        if budget <= 0:
            return
        best = min(others, key=_cost)
        for g in best:
            fixed = self.ring.joint_value(g)
            if fixed is not None:
                j, value = fixed
                self._split(p, {j: value}, matrix, rank, values, budget - 1)
            else:
                self._pair(p, g, matrix, rank, values, minors, budget)

    def _split(
        self,
        p: Poly,
        new: Mapping[int, Value],
        matrix: Matrix,
        rank: int,
        values: dict[int, Value],
        budget: int,
    ) -> None:
        """Put joint values in, and go on with each factor of what p becomes there."""
        inner = {**values, **new}
        put = self._put(matrix, new)
        for h in self._factors(self.ring.strip(self.ring.substitute(p, new))):
            fixed = self.ring.joint_value(h)
            if fixed is not None:
                j, value = fixed
                self._matrix(self._put(put, {j: value}), rank, {**inner, j: value}, budget)
                continue
            reduced, r = reduce_matrix(put, rank, self.ring)
            if r <= 0:
                continue
            if not reduced or min(len(reduced), len(reduced[0])) < r:
                self._emit(inner, (), True)
                continue
            minors = Minors(reduced, r, self.ring, self.time)
            self._relation(h, reduced, r, inner, minors, budget)

    def _pair(
        self,
        p: Poly,
        g: Poly,
        matrix: Matrix,
        rank: int,
        values: dict[int, Value],
        minors: Minors,
        budget: int,
    ) -> None:
        """Components inside p = g = 0: none, or stated by as few joints as can be found."""
        self.time.check()
        try:
            points = list(slice_points(p, g, self._residues, self._rng, values))
        except UndecidedSlice:
            self.gaps.append("the common points of two equations were not told apart")
            return
        singular = [s for s in points if s.rank(matrix) < rank]
        if len(singular) < len(points) and budget > 1:
            self.gaps.append(
                f"sets of codimension {len(values) + 3} or more inside two simultaneous "
                "equations were not searched"
            )
        if not singular:
            return
        shared = self._common_joints(p, g)
        if shared and len(p) * len(g) <= _RESULTANT_TERMS:
            self._eliminate(p, g, shared[0], matrix, rank, values, singular, budget)
        missed = [s for s in singular if not any(self._holds(c, s) for c in self.components)]
        if missed:
            self._emit(values, self._system(p, g, missed, minors), False)

    def _eliminate(
        self,
        p: Poly,
        g: Poly,
        joint: int,
        matrix: Matrix,
        rank: int,
        values: dict[int, Value],
        singular: list[SlicePoint],
        budget: int,
    ) -> None:
        """Look for components of p = g = 0 by the factors of a resultant, free of one joint."""
        resultant = self.ring.strip(self._resultant(p, g, joint))
        for h in self._factors(resultant):
            fixed = self.ring.joint_value(h)
            if fixed is not None:
                j, value = fixed
                at = {j: value}
                common = self.ring.gcd(self.ring.substitute(p, at), self.ring.substitute(g, at))
                put = self._put(matrix, at)
                for e in self._factors(self.ring.strip(common)):
                    self._split(e, {}, put, rank, {**values, **at}, budget - 1)
            elif len(h) <= len(p) + len(g) and any(s.is_zero(h) for s in singular):
                for other in sorted((p, g), key=len):
                    points = list(slice_points(h, other, self._residues, self._rng, values))
                    if not points or not all(s.rank(matrix) < rank for s in points):
                        continue
                    if all(s.transversal((h, other)) for s in points):
                        self._emit(values, tuple(sorted((h, other), key=len)), False)
                        break

    def _system(
        self,
        p: Poly,
        g: Poly,
        singular: list[SlicePoint],
        minors: Minors,
    ) -> tuple[Poly, ...]:
        """Equations of the singular part of p = g = 0.

        One factor of every minor, that all of the singular part shares: where these vanish all
        minors do, so that not even a part of lower dimension is stated that is regular.
        """
        relations = [p, g]
        for minor in minors:
            self.time.check()
            if any(self.ring.divides(r, minor) for r in relations):
                continue
            whole = [f for f in self._factors(minor) if all(s.is_zero(f) for s in singular)]
            relations.append(min(whole, key=len) if whole else minor)
        return tuple(sorted(relations, key=len))

    def _holds(self, component: Component, point: SlicePoint) -> bool:
        """Whether a point lies on a component."""
        return all(point.has(j, value) for j, value in component.values.items()) and all(
            point.is_zero(r) for r in component.relations
        )

    # Pieces -------------------------------------------------------------------------

    def _factors(self, poly: Poly) -> list[Poly]:
        self.time.check_factor(len(poly))
        return self.ring.factors(poly)

    def _hypersurface(self, f: Poly, values: dict[int, Value]) -> None:
        fixed = self.ring.joint_value(f)
        if fixed is None:
            self._emit(values, (f,), True)
        else:
            self._emit({**values, fixed[0]: fixed[1]}, (), True)

    def _common_factor(self, minors: Minors) -> Poly | None:
        """Greatest common divisor of all minors; None if all of them are zero."""
        common = None
        for minor in minors:
            self.time.check_factor(len(minor))
            common = minor if common is None else self.ring.gcd(common, minor)
            if self.ring.is_constant(common):
                break
        return common

    def _simplest_cofactor(self, minors: Minors, common: Poly) -> list[Poly]:
        """Factors of the minor, over the common factor, that branches into the least work."""
        best: list[Poly] | None = None
        for minor in itertools.islice(minors, _LOOKED_AT):
            factors = self._factors(self.ring.quotient(minor, common))
            if not factors:
                return []
            if best is None or _cost(factors) < _cost(best):
                best = factors
        return best or []

    def _common_joints(self, p: Poly, g: Poly) -> list[int]:
        shared = set(self.ring.joints_of(p)) & set(self.ring.joints_of(g))

        def degree(j: int) -> int:
            v = self.ring.variables(j)[-1]
            return int(p.degrees()[v]) * int(g.degrees()[v])

        return sorted(shared, key=degree)

    def _resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """Resultant of two forms in the variables of one joint."""
        variables = self.ring.variables(joint)
        if len(variables) == 2:
            put = {self.ring.context.names()[variables[0]]: 1}
            p, g = p.subs(put), g.subs(put)
        return self.ring.resultant(p, g, variables[-1])

    def _put(self, matrix: Matrix, values: Mapping[int, Value]) -> Matrix:
        if not values:
            return matrix
        return [[self.ring.substitute(x, values) for x in row] for row in matrix]

    def _emit(self, values: Mapping[int, Value], relations: tuple[Poly, ...], proven: bool) -> None:
        codimension = len(values) + min(len(relations), 2)
        self.components.append(Component(dict(values), relations, proven, codimension))

    def _covered(self, values: Mapping[int, Value], relations: tuple[Poly, ...]) -> bool:
        here = Component(dict(values), relations, True, 0)
        return any(self._inside(here, c) for c in self.components)

    def _inside(self, a: Component, b: Component) -> bool:
        """Whether a is a subset of b, as far as substitution and division tell."""
        if any(a.values.get(j) != v for j, v in b.values.items()):
            return False
        for r in b.relations:
            rest = self.ring.substitute(r, a.values)
            if rest == 0:
                continue
            if not any(self.ring.divides(p, rest) for p in a.relations):
                return False
        return True

    def _irredundant(self, components: list[Component]) -> list[Component]:
        ordered = sorted(components, key=lambda c: (c.codimension, len(c.relations)))
        kept: list[Component] = []
        for c in ordered:
            if not any(self._inside(c, k) for k in kept):
                kept.append(c)
        return kept


def _cost(factors: list[Poly]) -> tuple[int, int]:
    """How much work branching on these factors makes."""
    return max(len(f) for f in factors), len(factors)
