"""Whether the branches that an answer states are its exact components: every answer is checked.

What was made of polynomials is compared with them in numbers, by nothing that made it. The
equations of a branch must be multiples of a component's relations at random configurations with
its joints at their values. Each component must be on a branch: either that one has its joints at
the same values, with all of its relations, or each real point that is found of the component, by
all roots in one joint after the other, must be on some branch.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from pinsing.algebra.components import Component
from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import equation
from pinsing.algebra.ring import MadeOnce, Poly, Ring, terms_of
from pinsing.algebra.trig_sum import TINY
from pinsing.families.family import Family
from pinsing.families.zero_set import BLUNT, OwnPoints, SearchBox, thrown
from pinsing.interface import typed
from pinsing.measures import ALIKE, FLOAT_NOISE, Array
from pinsing.robot.mimic import own_offsets
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


class _Form:
    """A polynomial in numbers: exponents (T, variables), and coefficients (T,), largest 1."""

    def __init__(self, poly: Poly, ring: Ring) -> None:
        terms = terms_of(poly)
        top = max(abs(c) for c in terms.values())
        every = np.array(list(terms), dtype=np.int64)
        self.numbers = np.array([int(q.p) / int(q.q) for q in (c / top for c in terms.values())])
        for at, square in enumerate(ring.roots, ring.nvars):
            self.numbers = self.numbers * math.sqrt(square) ** every[:, at]
        self.exponents = every[:, : ring.nvars]
        self.joints = frozenset(ring.joints_of(poly))

    def __call__(self, x: Array) -> tuple[Array, float]:
        """Return values (N,) at x (N, variables), and how large terms can be."""
        # With any sines and cosines: x y has no rounding at 180 degrees relative to x y itself.
        values = np.prod(x[:, None, :] ** self.exponents, axis=-1) @ self.numbers
        most = np.maximum(1.0, np.abs(x)).max(axis=0) ** self.exponents
        return values, float(np.prod(most, axis=-1) @ np.abs(self.numbers))


class _Exact:
    """The side of the polynomials: their values, and real points of components."""

    def __init__(self, ring: Ring, geometry: Nominal, symbols: Sequence[str]) -> None:
        self.ring, self.symbols, self.offset = ring, symbols, own_offsets(geometry)
        self.own = OwnPoints(geometry.arm)
        self.slides = np.array(ring.prismatic, dtype=bool)
        self.rng = np.random.default_rng(11)
        size = sum(abs(float(x)) for row in geometry.translation for x in row) or 1.0
        self.reach = np.where(self.slides, size, np.pi)
        self._made = MadeOnce()

    def same(self, branch: Branch, component: Component) -> bool:
        """Return True if a branch is a component with its joints put at their values."""
        there = {v.joint: v.value for v in branch.values}
        for j, value in self._values(component).items():
            if j not in there or self._apart(j, there[j] - value) > ALIKE:
                return False
        # Random configurations at which equations are compared with relations.
        q = self.rng.uniform(-self.reach, self.reach, (6, len(self.reach)))
        q[:, list(there)] = list(there.values())
        x = self._variables(q)
        stated = [_unit(e(q), e.unit) for e in branch.equations]
        left = set(range(len(stated)))
        for poly in component.relations:
            values, size = self._form(poly)(x)
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
        # What vanishes, one of each list: of one joint's multiple roots each is a factor's.
        conditions = [
            [self._form(p) for p, _ in poly.factor()[1]]
            if self.ring.rational and len(self.ring.joints_of(poly)) == 1
            else [self._form(poly)]
            for poly in component.relations
        ]
        # Choices of free joints by which points of a component are looked for, and such points.
        values, found = self._values(component), False
        starts = self.rng.uniform(-self.reach, self.reach, (3, len(self.reach)))
        starts[:, list(values)] = list(values.values())
        points = (self._followed(conditions, q, frozenset(values), ALIKE) for q in starts)
        for q, tol in itertools.islice(itertools.chain.from_iterable(points), 257):
            if self._missed(branches, q, tol):
                return q
            found = True
        # Random starts where roots in one joint after the other give no point; up to so many terms.
        if found or sum(map(len, component.relations)) > 500:
            return None
        for forms in conditions:
            joints = frozenset().union(*(f.joints for f in forms))
            q = np.zeros(len(self.slides))
            if len(joints) < 2 and not any(self._roots(f, j, q) for f in forms for j in joints):
                return None  # it has no real point: a condition of one joint has no real root
        every = range(len(self.slides))
        free = np.array([j not in values for j in every])
        fixed = np.array([values.get(j, 0.0) for j in every])
        box = SearchBox(-self.reach, self.reach, free, fixed)
        stated = [equation(p, self.ring, self.symbols, self.offset) for p in component.relations]
        for q in self.own.arm.fold(thrown(stated, box, 16, self.rng)):
            if self._missed(branches, q, BLUNT):
                return np.asarray(q)
        return None

    def _missed(self, branches: Sequence[Branch], q: Array, tol: float) -> bool:
        """Whether q (n,) is singular, which what is nearly zero may only seem, and on no branch."""
        if any(self._on(b, q, tol) for b in branches):
            return False
        return bool(self.own(self.own.sharpened(q[None], np.ones(len(q), dtype=bool)))[0])

    def _on(self, branch: Branch, q: Array, tol: float) -> bool:
        at = q.copy()
        for v in branch.values:
            if self._apart(v.joint, q[v.joint] - v.value) > tol:
                return False
            at[v.joint] = v.value
        return all(abs(float(e(at))) <= tol * e.unit for e in branch.equations)

    def _apart(self, joint: int, difference: float) -> float:
        return abs(difference if self.slides[joint] else math.remainder(difference, 2 * math.pi))

    def _values(self, component: Component) -> dict[int, float]:
        """The joints that a component has at values: angles in radians, metres."""
        out = {}
        for j, value in component.values.items():
            numbers = [float(x) for x in value]
            turned = 0.0 if self.slides[j] else 2 * math.atan2(numbers[1], numbers[0])
            out[j] = numbers[0] if self.slides[j] else turned - float(self.offset[j])
        return out

    def _form(self, poly: Poly) -> _Form:
        return self._made.of(poly, lambda p: _Form(p, self.ring))  # type: ignore[no-any-return]

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

    def _followed(
        self, conditions: Sequence[Sequence[_Form]], q: Array, known: frozenset[int], tol: float
    ) -> Iterator[tuple[Array, float]]:
        """The points with the known joints as they are in q (n,), and some of the others, too."""
        unknown: list[frozenset[int]] = []
        left = []
        x = self._variables(q[None])
        for forms in conditions:
            if joints := frozenset().union(*(f.joints for f in forms)) - known:
                left.append(forms)
                unknown.append(joints)
            elif not any(abs(v[0]) <= tol * s for v, s in (f(x) for f in forms)):
                return
        if not left:
            yield q, tol
            return
        least = min(range(len(left)), key=lambda k: len(unknown[k]))
        joint = int(self.rng.choice(sorted(unknown[least])))
        if len(unknown[least]) > 1:
            if len(frozenset().union(*unknown)) > len(left):
                yield from self._followed(left, q, known | {joint}, tol)
            return
        for form in left[least]:
            for value, sharp in self._roots(form, joint, q):
                at = q.copy()
                at[joint] = value
                yield from self._followed(left, at, known | {joint}, tol if sharp else BLUNT)

    def _roots(self, form: _Form, joint: int, q: Array) -> list[tuple[float, bool]]:
        """Return zeros of a form in a joint, the others as in q (n,), and which are simple."""
        # On the circle it is a polynomial in exp(i angle), with coefficients by Fourier transform.
        variables = list(self.ring.variables(joint))
        degree = int(form.exponents[:, variables].sum(axis=1).max())
        angles = 2 * np.pi * np.arange(degree + 1) / (degree + 1)
        x = np.repeat(self._variables(q[None]), degree + 1, axis=0).astype(complex)
        if self.slides[joint]:
            x[:, variables[0]] = self.reach[joint] * np.exp(1j * angles)
            values, size = form(x)
        else:
            x[:, variables] = np.stack([np.cos(angles / 2), np.sin(angles / 2)], axis=-1)
            values, size = form(x)
            values = values * np.exp(0.5j * degree * angles)
        line = (np.exp(-1j * np.arange(degree, -1, -1)[:, None] * angles) * values).mean(axis=-1)
        if (np.abs(line) <= _ZERO * size).all():
            return [(float(q[joint]), True)]  # whatever it is
        line[np.abs(line) <= 1e-14 * size] = 0.0
        roots = np.roots(line)
        out = []
        for k, w in enumerate(roots):
            sharp = not (np.abs(np.delete(roots, k) - w) < BLUNT).any()
            if self.slides[joint]:
                if abs(w.imag) < ALIKE:
                    out.append((float(w.real) * float(self.reach[joint]), sharp))
            elif abs(abs(w) - 1) < ALIKE:
                angle = math.atan2(w.imag, w.real) - float(self.offset[joint])
                out.append((math.remainder(angle, 2 * math.pi), sharp))
        return out


def _unit(values: Array, size: float) -> tuple[Array, float]:
    """Values of length 1, and the relative error that terms of this size leave, 1 at most."""
    length = max(float(np.linalg.norm(values)), TINY)
    return values / length, min(FLOAT_NOISE * size / length, 1.0)
