"""Whether the branches that an answer states are its exact components: every answer is checked.

What was made of polynomials is compared with them in numbers, by nothing that made it. The
equations of a branch must be multiples of a component's relations at random configurations with
its joints at their values. Each component must be on a branch: either that one has its joints at
the same values, with all of its relations, or each real point of the component that random starts
lead to must be on some branch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pinsing.algebra.components import Component
from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import equation
from pinsing.algebra.ring import MadeOnce, Poly, Ring, terms_of
from pinsing.algebra.trig_sum import TINY
from pinsing.families.family import Family
from pinsing.families.zero_set import BLUNT, OwnPoints, SearchBox, project, system_of
from pinsing.interface import typed
from pinsing.measures import ALIKE, FLOAT_NOISE, Array, Ints
from pinsing.robot.mimic import own_rows
from pinsing.robot.nominal import Nominal

_ZERO = 1e-10
"""A relation's value, relative to its terms, that is zero."""


def disagreements(
    families: Sequence[Family],
    left_out: Sequence[Component],
    ring: Ring,
    geometry: Nominal,
    symbols: Sequence[str],
) -> list[str]:
    """Return where families and exact components differ, in words."""
    # All real points of those that are ``left_out`` are on these families.
    exact = _Exact(ring, geometry, symbols)
    branches = [b for f in families for b in f.branches]
    said, whole = [], set()
    for family in families:
        for branch in family.branches:
            like = [c for c in family.components if exact.same(branch, c)]
            whole |= {id(c) for c in like if len(c.values) == len(branch.values)}
            if not like:
                said.append(
                    f"{family.name} has a branch that its exact equations do not have: "
                    "an error of pinsing"
                )
    for c in [c for f in families for c in f.components] + list(left_out):
        if id(c) not in whole and (q := exact.off(c, branches)) is not None:
            said.append(
                f"singular by the exact equations, and on no family that is stated: "
                f"{typed(q, np.array(ring.prismatic), True)}: an error of pinsing"
            )
    return list(dict.fromkeys(said))


class _Exact:
    """The side of the polynomials: their values, and real points of components."""

    def __init__(self, ring: Ring, geometry: Nominal, symbols: Sequence[str]) -> None:
        self.ring, self.symbols = ring, symbols
        self.offset = geometry.offset[own_rows(geometry)]
        self.own = OwnPoints(geometry.arm)
        self.slides = np.array(ring.prismatic, dtype=bool)
        self.rng = np.random.default_rng(11)
        size = sum(abs(float(x)) for row in geometry.translation for x in row) or 1.0
        self.reach = np.where(self.slides, size, np.pi)
        self._in_numbers = MadeOnce()

    def same(self, branch: Branch, component: Component) -> bool:
        """Return True if a branch is a component with its joints put at their values."""
        there = {v.joint: v.value for v in branch.values}
        for j, value in self._values(component).items():
            if j not in there:
                return False
            apart = there[j] - value
            if abs(apart if self.slides[j] else math.remainder(apart, 2 * math.pi)) > ALIKE:
                return False
        # Random configurations at which equations are compared with relations.
        q = self.rng.uniform(-self.reach, self.reach, (6, len(self.reach)))
        q[:, list(there)] = list(there.values())
        x = self._variables(q)
        stated = [_unit(e(q), e.unit) for e in branch.equations]
        left = set(range(len(stated)))
        for poly in component.relations:
            values, size = self.values_at(poly, x)
            own, rounding = _unit(values, size)
            # Relative difference of an equation's values and a multiple of a relation's.
            alike = {
                k
                for k, (unit, error) in enumerate(stated)
                if rounding < 1 and 1 - (own @ unit) ** 2 < (1e-6 + rounding + error) ** 2
            }
            if not alike and (np.abs(values) > _ZERO * size).any():
                return False
            left -= alike
        return not left

    def off(self, component: Component, branches: Sequence[Branch]) -> Array | None:
        """A real point (n,) of a component on none of the branches; None if none is found."""
        relations, values = component.relations, self._values(component)
        stated = [equation(self._plain(p), self.ring, self.symbols, self.offset) for p in relations]
        every = range(len(self.slides))
        free = np.array([j not in values for j in every])
        fixed = np.array([values.get(j, 0.0) for j in every])
        # Random starts that lead to points, fewer where relations are long.
        count = max(4, min(32, 30_000 // max(1, sum(map(len, relations)))))
        starts = SearchBox(-self.reach, self.reach, free, fixed).drawn(count, self.rng)
        found, there = project(stated, starts, free, 20)
        points = self.own.arm.fold(found[there])
        tols = np.full(len(points), ALIKE)
        if not len(points):
            return None
        if stated:
            # Where slopes vanish, points have half of their digits.
            sizes = np.linalg.svd(system_of(stated).gradients(points) * free, compute_uv=False)
            count = min(component.codimension - len(values), len(stated))
            tols[sizes[:, count - 1] <= 1e-4] = BLUNT
        missed, x = np.ones(len(points), dtype=bool), self._variables(points)
        for poly in relations:
            at, size = self.values_at(poly, x)
            missed &= np.abs(at) <= tols * size
        for branch in branches:
            put = branch.put(points, self.own.arm.space)
            on = (np.abs(put - points) <= tols[:, None]).all(axis=1)
            for e in branch.equations:
                on &= np.abs(e(put)) <= tols * e.unit
            missed &= ~on
        # What is nearly zero may only seem singular.
        points = self.own.sharpened(points[missed], np.ones(len(every), dtype=bool))
        return next(iter(points[self.own(points)]), None)

    def _plain(self, poly: Poly) -> Poly:
        """The polynomial, if of one joint without multiple roots: of these points are blunt."""
        if not self.ring.rational or len(self.ring.joints_of(poly)) != 1:
            return poly
        return math.prod((p for p, _ in poly.factor()[1]), start=self.ring.one)

    def _values(self, component: Component) -> dict[int, float]:
        """The joints that a component has at values: angles in radians, metres."""
        out = {}
        for j, value in component.values.items():
            numbers = [float(x) for x in value]
            turned = 0.0 if self.slides[j] else 2 * math.atan2(numbers[1], numbers[0])
            out[j] = numbers[0] if self.slides[j] else turned - float(self.offset[j])
        return out

    def values_at(self, poly: Poly, x: Array) -> tuple[Array, float]:
        """Return a polynomial's values (N,) at x (N, variables), and how large terms can be."""
        exponents, numbers = self._in_numbers.of(poly, self._numbers)
        # With any sines and cosines: x y has no rounding at 180 degrees relative to x y itself.
        values = np.prod(x[:, None, :] ** exponents, axis=-1) @ numbers
        most = np.maximum(1.0, np.abs(x)).max(axis=0) ** exponents
        return values, float(np.prod(most, axis=-1) @ np.abs(numbers))

    def _numbers(self, poly: Poly) -> tuple[Ints, Array]:
        """Exponents (T, variables) of a polynomial, and its coefficients (T,), largest 1."""
        terms = terms_of(poly)
        top = max(abs(c) for c in terms.values())
        every = np.array(list(terms), dtype=np.int64)
        numbers = np.array([int(q.p) / int(q.q) for q in (c / top for c in terms.values())])
        for at, square in enumerate(self.ring.roots, self.ring.nvars):
            numbers = numbers * math.sqrt(square) ** every[:, at]
        return every[:, : self.ring.nvars], numbers

    def _variables(self, q: Array) -> Array:
        """The ring's variables (N, variables) at configurations (N, n)."""
        out = np.empty((len(q), self.ring.nvars))
        half = (q + self.offset) / 2
        for j, first in enumerate(self.ring.start):
            if self.slides[j]:
                out[:, first] = q[:, j]
            else:
                out[:, first], out[:, first + 1] = np.cos(half[:, j]), np.sin(half[:, j])
        return out


def _unit(values: Array, size: float) -> tuple[Array, float]:
    """Values of length 1, and the relative error that terms of this size leave, 1 at most."""
    length = max(float(np.linalg.norm(values)), TINY)
    return values / length, min(FLOAT_NOISE * size / length, 1.0)
