"""From components over the rationals to pieces of the real singular set."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.equation import Equation, equation, scale_to_lengths
from pinsing.algebra.mimic import own_offsets
from pinsing.algebra.real_roots import real_roots
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.families.family import Branch, JointValue
from pinsing.families.zero_set import (
    ROUNDS,
    fix_joint,
    never_zero,
    proven_empty,
    roots_of,
    search,
)
from pinsing.geometry.nominal import Nominal
from pinsing.kinematics.verdict import ratios
from pinsing.robot.arm import Arm

_TRIALS = 4
_DECIDES = 1e-5
"""sigma_r / sigma_1 that tells singular from regular: a point where surfaces touch each other
is known to half of the digits only."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One component, its univariate equations solved.

    Attributes
    ----------
    branches : tuple of Branch
        One for each choice of roots.
    solved : tuple of Equation
        The univariate equations whose roots the branches have, for print.
    proof : str
        As on a Family.
    real : bool
        Whether a real point is known.
    codimension : int
        Complex codimension.
    component : Component
        What it was made of, exactly.
    """

    branches: tuple[Branch, ...]
    solved: tuple[Equation, ...]
    proof: str
    real: bool
    codimension: int
    component: Component


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
    ) -> None:
        self.geometry, self.ring, self.rank, self.time = geometry, ring, rank, time
        self.symbols = tuple(symbols)
        self.offset = own_offsets(geometry)
        self.rng = np.random.default_rng(seed)
        arm = geometry.arm
        flat = [float(x) for row in geometry.translation for x in row]
        self.lengths = [abs(x) for x in flat if x != 0]
        # A family is as real outside the limits: sliders range over the size of the arm at least.
        size = sum(self.lengths) or 1.0
        reach = np.where(arm.prismatic, size, np.pi)
        slides = [arm.prismatic & np.isfinite(limit) for limit in (arm.lower, arm.upper)]
        self.lower = np.where(slides[0], np.minimum(arm.lower, -reach), -reach)
        self.upper = np.where(slides[1], np.maximum(arm.upper, reach), reach)

    def make(self, component: Component) -> Piece | None:
        """The piece of a component; None if it is proven to have no real point."""
        fixed = [self._value(j, v) for j, v in component.values.items()]
        alone = [p for p in component.relations if len(self.ring.joints_of(p)) == 1]
        others = [p for p in component.relations if len(self.ring.joints_of(p)) > 1]
        choices: list[list[JointValue]] = []
        for p in alone:
            roots = self._roots(p)
            if not roots:
                return None
            choices.append(roots)
        equations = [self._equation(p) for p in others]
        branches = []
        for combination in itertools.product(*choices):
            branches += self._branches([*fixed, *combination], equations, bool(alone))
        if not branches:
            return None
        alive = [b for b in branches if not self._empty(b)]
        if not alive:
            return None
        known = [b for b in alive if self.find(b, 1).size]
        return Piece(
            branches=tuple(known or alive),
            solved=tuple(self._equation(p) for p in alone),
            proof="algebra" if component.proven else "generic points",
            real=bool(known),
            codimension=component.codimension,
            component=component,
        )

    def find(self, branch: Branch, count: int, rounds: int = 6) -> Array:
        """Points (k, n) of a branch over whole circles, k up to ``count``.

        Once the time is over the search is short.
        """
        n = len(self.symbols)
        free = np.ones(n, dtype=bool)
        fixed = np.zeros(n)
        for v in branch.values:
            free[v.joint] = False
            fixed[v.joint] = v.value
        return search(
            branch.equations,
            self.lower,
            self.upper,
            free,
            fixed,
            count,
            self.rng,
            self.rounds(rounds),
        )

    def rounds(self, wanted: int = ROUNDS) -> int:
        """Batches of random starts that there is time for."""
        return 1 if self.time.over else wanted

    def _value(self, joint: int, value: Value) -> JointValue:
        if self.ring.prismatic[joint]:
            return JointValue(joint, float(value[0]), True)
        x, y = (float(v) for v in value)
        angle = 2 * math.atan2(y, x) - float(self.offset[joint])
        return JointValue(joint, wrap(angle), True)

    def _roots(self, poly: Poly) -> list[JointValue]:
        """Real values of the one joint of ``poly``."""
        joint = self.ring.joints_of(poly)[0]
        variables = self.ring.variables(joint)
        if not self.ring.prismatic[joint]:  # irreducible of degree >= 2: x = 0 is no root
            poly = poly.subs({self.ring.context.names()[variables[0]]: 1})
        real = real_roots(poly, variables[-1], self.ring)
        if self.ring.prismatic[joint]:
            return [JointValue(joint, t, False) for t in real]
        offset = float(self.offset[joint])
        return [JointValue(joint, wrap(2 * math.atan(t) - offset), False) for t in real]

    def _equation(self, poly: Poly) -> Equation:
        made = equation(poly, self.ring, self.symbols, self.offset)
        return scale_to_lengths(made, self.lengths)

    def _branches(
        self, values: list[JointValue], equations: list[Equation], check: bool
    ) -> list[Branch]:
        """Put irrational values into the equations, and drop choices of roots that are regular.

        An equation that is left with one joint is solved for it in turn.
        """
        left: list[Equation] = list(equations)
        for v in values:
            if not v.rational:
                put = [fix_joint(e, v.joint, v.value) for e in left]
                left = _distinct([e for e in put if e is not None])
        if any(not e.involved for e in left):
            return []  # a nonzero constant: this root goes with another one
        single = next((e for e in left if len(e.involved) == 1 and not e.powers.any()), None)
        if single is not None and check:
            joint = single.involved[0]
            rest = [e for e in left if e is not single]
            return [
                branch
                for root in roots_of(single)
                for branch in self._branches(
                    [*values, JointValue(joint, wrap(float(root)), False)], rest, check
                )
            ]
        branch = Branch(tuple(sorted(values, key=lambda v: v.joint)), tuple(left))
        return [branch] if not check or self._singular(branch) else []

    def _singular(self, branch: Branch) -> bool:
        points = self.find(branch, _TRIALS, rounds=2)
        if not len(points):
            return True  # nothing known against it
        return bool((self.ratios(points) <= _DECIDES).all())

    def ratios(self, points: Array, arm: Arm | None = None) -> Array:
        """sigma_r / sigma_1 of the nominal arm (or ``arm``) at points (N, n)."""
        return ratios(arm or self.geometry.arm, points)

    def _empty(self, branch: Branch) -> bool:
        if any(never_zero(e) for e in branch.equations):
            return True
        if not branch.equations or self.find(branch, 1).size:
            return False
        if self.time.over or any(e.powers.any() for e in branch.equations):
            return False  # no box holds all values of a slider
        return proven_empty(branch.equations, self.lower, self.upper)


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
