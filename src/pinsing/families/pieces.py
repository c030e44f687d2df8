"""From components over the rationals to pieces of the real singular set."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component
from pinsing.algebra.conditions import Branch, JointValue
from pinsing.algebra.equation import Equation, equation, scale_to_lengths
from pinsing.algebra.mimic import own_offsets
from pinsing.algebra.real_roots import (
    AlgebraicValue,
    NotFinite,
    changes_sign,
    isolated_zeros,
    real_roots,
    real_solutions,
)
from pinsing.algebra.ring import MadeOnce, Poly, Ring, Value
from pinsing.families.zero_set import (
    ROUNDS,
    OwnPoints,
    SearchBox,
    fix_joint,
    never_zero,
    proven_empty,
    residuals,
    search,
    thrown,
)
from pinsing.measures import Array
from pinsing.robot.nominal import Nominal


@dataclass(frozen=True, eq=False)
class SolvedPiece:
    """One component, its univariate equations solved."""

    branches: tuple[Branch, ...]  # one for each choice of roots
    # the univariate equations whose roots the branches have, for print
    solved: tuple[Equation, ...]
    proof: str  # as on a Family
    real: bool  # whether a real point is known
    codimension: int  # joints minus the dimension: real where only that is known to be smaller
    component: Component  # what it was made of, exactly


class PieceMaker:
    """Turns components into pieces, for one arm."""

    def __init__(
        self,
        geometry: Nominal,
        ring: Ring,
        rank: int,
        symbols: Sequence[str],
        seed: int,
        time: Budget,
        angle_tol: float,
    ) -> None:
        self.geometry, self.ring, self.rank, self.time = geometry, ring, rank, time
        self.angle_tol = angle_tol
        self.symbols = tuple(symbols)
        self.offset = own_offsets(geometry)
        self.rng = np.random.default_rng(seed)
        self.unsolved = 0
        """Systems that stay equations because time was over."""
        self.confirm: OwnPoints | None = None
        """Which points of equations are singular, where that is to be asked; see ``Family``."""
        self.products = False
        """Whether relations may be products, whose roots are not to be listed."""
        self._met, self._made = MadeOnce(), MadeOnce()
        arm = geometry.arm
        flat = [float(x) for row in geometry.translation for x in row]
        self.lengths = [abs(x) for x in flat if x != 0]
        # A family is as real outside the limits: sliders range over the size of the arm at least.
        reach = np.where(arm.prismatic, sum(self.lengths) or 1.0, np.pi)
        slides = [arm.prismatic & np.isfinite(limit) for limit in (arm.lower, arm.upper)]
        self.lower = np.where(slides[0], np.minimum(arm.lower, -reach), -reach)
        self.upper = np.where(slides[1], np.maximum(arm.upper, reach), reach)

    def make(self, component: Component) -> list[SolvedPiece]:
        """Return the pieces of a component; none if proven not to have a real point."""
        # What is neither proven empty nor has a known point is a piece, too.
        fixed = [self._value(j, v) for j, v in component.values.items()]
        products = self.products
        solved, others = ([], list(component.relations)) if products else self._solvable(component)
        alone = len(others) == 1 and not solved
        sure = alone and changes_sign(others[0], self.ring)
        real = None if products or not alone or sure else self._real_part(others[0])
        if real is not None:  # smaller than the set of complex zeros
            combinations = real
            minimal: list[Equation] = []
            codimension = len(fixed) + len(self.ring.joints_of(others[0]))
            others = []
        else:
            combinations, minimal, unsolved = self._solutions(solved)
            others += unsolved
            codimension = component.codimension
        equations = [self.equation_of(p) for p in others]
        branches = (b for c in combinations for b in self._branches(fixed, c, equations))
        alive = [b for b in branches if not self._empty(b)]
        if not alive:
            return []
        known = [b for b in alive if sure or self._has_point(b)]
        unknown = [b for b in alive if b not in known]
        proof = "algebra" if component.proven else "generic points"
        return [
            SolvedPiece(tuple(part), tuple(minimal), proof, found, codimension, component)
            for part, found in ((known, True), (unknown, False))
            if part
        ]

    def lies_in_another(
        self, component: Component, pieces: Sequence[SolvedPiece], components: Sequence[Component]
    ) -> bool:
        """Return True if all real points of a component, isolated ones, lie in other components."""
        if all(p.codimension == component.codimension for p in pieces):
            return False
        others = [c for c in components if c is not component]
        return all(
            any(self._at_exact_values_of(b, c) for c in others) for p in pieces for b in p.branches
        )

    def own(
        self, component: Component, pieces: Sequence[SolvedPiece], components: Sequence[Component]
    ) -> list[SolvedPiece]:
        """Return pieces without isolated values that simpler or larger components have, too."""
        others = [
            c
            for c in components
            if c.codimension < component.codimension
            or (c.codimension == component.codimension and component.relations and not c.relations)
        ]
        left = []
        for piece in pieces:
            kept = tuple(
                b
                for b in piece.branches
                if b.equations or not any(self._at_exact_values_of(b, c) for c in others)
            )
            if kept:
                left.append(piece if kept == piece.branches else replace(piece, branches=kept))
        return left

    def _at_exact_values_of(self, branch: Branch, component: Component) -> bool:
        """Return True if exact joint values put a branch of nothing else into a component."""
        if branch.equations:
            return False
        values = {v.joint: v.exact for v in branch.values if v.exact is not None}
        if len(values) < len(branch.values):
            return False
        return all(values.get(j) == x for j, x in component.values.items()) and all(
            self.ring.substitute(r, values) == 0 for r in component.relations
        )

    def _solvable(self, component: Component) -> tuple[list[Poly], list[Poly]]:
        """Return the relations that fix joint values, and the others."""
        # A joint has finitely many values where it is alone in a relation, or alone with others of
        # these; or all joints do, where there are as many of them as the component has equations.
        relations = list(component.relations)
        joints = [set(self.ring.joints_of(p)) for p in relations]
        fixed = set().union(*joints)
        if len(fixed) != component.codimension - len(component.values):
            fixed = set()
            while new := next((j - fixed for j in joints if len(j - fixed) == 1), None):
                fixed |= new
        solved = [p for p, j in zip(relations, joints, strict=True) if j <= fixed]
        return solved, [p for p in relations if p not in solved]

    def _solutions(
        self, polys: Sequence[Poly]
    ) -> tuple[list[list[JointValue]], list[Equation], list[Poly]]:
        """Real values of joints, one equation a joint for print, and what was not solved."""
        alone = [p for p in polys if len(self.ring.joints_of(p)) == 1]
        together = [p for p in polys if len(self.ring.joints_of(p)) > 1]
        if together:
            try:
                found = real_solutions(polys, self.ring, self.time)
            except NotFinite:
                pass  # they stay equations
            except BudgetExceeded:
                self.unsolved += 1
            else:
                return [[self._algebraic(j, v) for j, v in s.items()] for s in found], [], []
        lines: dict[int, Poly] = {}
        for p in alone:
            (joint,) = self.ring.joints_of(p)
            lines[joint] = self.ring.gcd(lines[joint], p) if joint in lines else p
        roots = [
            [self._algebraic(j, v) for v in real_roots(p, j, self.ring)] for j, p in lines.items()
        ]
        unlike = [
            self.equation_of(p)
            for p, values in zip(lines.values(), roots, strict=True)
            if any(v.exact is None for v in values)  # else the values say as much
        ]
        return [list(c) for c in itertools.product(*roots)], unlike, together

    def _algebraic(self, joint: int, value: AlgebraicValue) -> JointValue:
        slides = self.ring.prismatic[joint]
        if (exact := value.exact(slides)) is not None:
            return replace(self._value(joint, exact), minimal=value.minimal)
        if slides:
            return JointValue(joint, float(value.ball), False, value.minimal)
        return JointValue(joint, self._angle(joint, value.angle()), False, value.minimal)

    def _real_part(self, poly: Poly) -> list[list[JointValue]] | None:
        """Return all real zeros of a polynomial, or None where they may be a hypersurface."""
        if len(self.ring.joints_of(poly)) < 2:
            return None
        try:
            found = isolated_zeros(poly, self.ring, self.time)
        except (NotFinite, BudgetExceeded):
            return None
        if found is None:
            return None
        return [[self._algebraic(j, v) for j, v in s.items()] for s in found]

    def find(self, branch: Branch, count: int, rounds: int = 6) -> Array:
        """Return up to ``count`` points (k, n) of a branch over whole circles."""
        box = SearchBox.of(branch, self.lower, self.upper)

        def searched(some: int) -> Array:
            given = some, self.rng, self.rounds(rounds), self.time.stop
            return search(branch.equations, box, *given)

        found = searched(count)
        if self.confirm is None:
            return found
        own = found[self.confirm(found)]
        if not len(own):  # a few points may all be regular ones of the equations, many seldom
            # Points of equations that are drawn, where none of the first ones is the family's own.
            more = searched(max(32, count))
            own = more[self.confirm(more)][:count]
        if not len(own):
            # Random starts, where no point of equations that was drawn is the family's own.
            more = self.thrown(branch, 40)
            own = more[self.confirm(more)][:count]
        return own

    def thrown(self, branch: Branch, count: int) -> Array:
        """Return points (k, n) that random starts converge to, so that all real parts are met."""
        box = SearchBox.of(branch, self.lower, self.upper)
        return thrown(branch.equations, box, count, self.rng, self.time.stop)

    def branch_of(self, values: Mapping[int, Value], relations: Sequence[Poly]) -> Branch:
        """Joints at exact values, and polynomials that vanish, as what points are found on."""
        held = sorted((self._value(j, v) for j, v in values.items()), key=lambda v: v.joint)
        return Branch(tuple(held), tuple(self.equation_of(p) for p in relations))

    def away(self, q: Array, value: JointValue) -> Array:
        """Return the distance (N,) of a joint from a value at q (N, n), without whole turns."""
        off = q[:, value.joint] - value.value
        if not self.ring.prismatic[value.joint]:
            off = off - 2 * np.pi * np.round(off / (2 * np.pi))
        return np.abs(off)

    def off(self, q: Array, values: Mapping[int, Value], relations: Sequence[Poly] = ()) -> Array:
        """How far (N,) configurations are from joint values and, in equations' sizes, relations."""
        branch = self.branch_of(values, relations)
        parts = [np.zeros(len(q)), *(self.away(q, v) for v in branch.values)]
        parts += list(np.abs(residuals(branch.equations, q)).T) if branch.equations else []
        return np.asarray(np.max(parts, axis=0))

    def rounds(self, wanted: int = ROUNDS) -> int:
        """Batches of random starts that there is time for."""
        return 1 if self.time.over else wanted

    def _value(self, joint: int, value: Value) -> JointValue:
        if self.ring.prismatic[joint]:
            return JointValue(joint, float(value[0]), True, exact=value)
        x, y = (float(v) for v in value)
        return JointValue(joint, self._angle(joint, 2 * math.atan2(y, x)), True, exact=value)

    def _angle(self, joint: int, angle: float) -> float:
        """A joint's angle of the ring's."""
        return wrap(angle - float(self.offset[joint]))

    def equation_of(self, poly: Poly) -> Equation:
        """A polynomial as an equation in the joints, made once."""
        given = self.ring, self.symbols, self.offset
        return self._made.of(  # type: ignore[no-any-return]
            poly, lambda p: scale_to_lengths(equation(p, *given), self.lengths)
        )

    def _branches(
        self, fixed: list[JointValue], solved: list[JointValue], equations: list[Equation]
    ) -> list[Branch]:
        """The equations with solved values put into them; none if one is a constant then."""
        left: list[Equation] = list(equations)
        for v in solved:
            put = [fix_joint(e, v.joint, v.value) for e in left]
            left = _distinct([e for e in put if e is not None])
        if any(not e.involved for e in left):
            return []  # far above rounding: this root goes with another one
        return [Branch(tuple(sorted([*fixed, *solved], key=lambda v: v.joint)), tuple(left))]

    def _has_point(self, branch: Branch) -> bool:
        """Return True if a point of a branch is found; looked for once."""
        if not branch.equations and self.confirm is None:
            return True
        return bool(self._met.of(branch, lambda b: self.find(b, 1).size))

    def _empty(self, branch: Branch) -> bool:
        if any(never_zero(e) for e in branch.equations):
            return True
        if not branch.equations or self._has_point(branch) or self.time.over:
            return False
        # No box holds all values of a slider.
        return not any(e.powers.any() for e in branch.equations) and proven_empty(
            branch.equations, self.lower, self.upper, self.time.stop
        )


def _distinct(equations: Sequence[Equation]) -> list[Equation]:
    """Equations, without those that say the same as an earlier one."""
    kept: dict[tuple[object, ...], Equation] = {}
    for e in equations:
        order = sorted(range(len(e.cos)), key=lambda t: (*e.frequencies[t], *e.powers[t]))
        numbers = np.concatenate([e.cos[order], e.sin[order]])
        largest = numbers[int(np.argmax(np.abs(numbers) > 0.999 * np.abs(numbers).max()))]
        key = (
            *(tuple(e.frequencies[t]) for t in order),
            *(tuple(e.powers[t]) for t in order),
            *np.round(numbers / largest, 9) + 0.0,
        )
        kept.setdefault(key, e)
    return list(kept.values())


def wrap(angle: float) -> float:
    """Angle in (-pi, pi], values within rounding of a multiple of 15 degrees put there."""
    step = math.pi / 12
    nearest = round(angle / step)
    if abs(angle - nearest * step) < 1e-14 * max(1.0, abs(angle)):
        angle = nearest * step
    angle = math.remainder(angle, 2 * math.pi)
    return math.pi if angle <= -math.pi else angle
