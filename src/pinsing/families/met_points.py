"""Points of equations: real ones, or ones modulo primes, one equation solved after the other.

The equations of neighbouring axes have few joints each, and can be put in an order in which each is
solved for a joint that those before it do not have. Modulo a prime of 62 bits that takes
milliseconds, whatever the lengths are; and a rank there is a rank. All joints that are not solved
for are drawn at random: so a point is a generic one of a part that has as few dimensions as there
are equations. Parts on which an equation holds whatever its joint does are not met.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TypeAlias

import numpy as np
from flint import nmod_mat, nmod_poly

from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.generic_points import Powers, Residues
from pinsing.algebra.mimic import own_jacobian_modulo
from pinsing.algebra.minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.families.modular_chain import value_modulo
from pinsing.families.parts import Branch
from pinsing.families.pieces import PieceMaker
from pinsing.families.zero_set import gradients, project, residuals
from pinsing.robot.nominal import PRIMES, Nominal
from pinsing.robot.task import Task

_TRIES = 4
"""Times that a point is begun, for each that is wanted."""

Order = tuple[tuple[Poly, int], ...]
"""Equations, and the joint that each is solved for."""
ByPower = list[list[tuple[int, Powers]]]
At = dict[int, tuple[int, ...]]
"""Half-angle coordinates (x, y) of joints, or their lengths, modulo a prime."""


@dataclass(frozen=True, eq=False)
class ModularPoint:
    """A configuration modulo a prime.

    Attributes
    ----------
    at : mapping of int to (x, y) or (metres,)
        Values of all joints.
    rows : list of list of int
        Task rows of the Jacobian there.
    residues : Residues
        Images of polynomials.
    """

    at: At
    rows: list[list[int]]
    residues: Residues

    def rank(self, columns: Sequence[int]) -> int:
        """Rank of some columns of the Jacobian."""
        return rank(self.rows, columns, self.residues.prime)

    def is_zero(self, poly: Poly) -> bool:
        """Whether a polynomial vanishes there."""
        prime = self.residues.prime
        total = 0
        for monomial, c in self.residues.terms(poly):
            for v, e in monomial:
                c = c * pow(self._variables[v], e, prime) % prime
            total += c
        return total % prime == 0

    def has(self, joint: int, value: Value) -> bool:
        """Whether a joint is at an exact value."""
        here, there = self.at[joint], value_modulo(value, self.residues.prime)
        if len(here) == 1 or not there:
            return here == there
        return (here[0] * there[1] - here[1] * there[0]) % self.residues.prime == 0

    @cached_property
    def _variables(self) -> list[int]:
        ring = self.residues.ring
        out = [0] * ring.nvars
        for j, values in self.at.items():
            for v, value in zip(ring.variables(j), values, strict=True):
                out[v] = value
        return out


class ModularPoints:
    """Looks for points of equations of one chain.

    Parameters
    ----------
    geometry, task
        The chain and the rows.
    ring : Ring
        Of the equations.
    seed : int
        What points are drawn from.
    """

    def __init__(self, geometry: Nominal, task: Task, ring: Ring, seed: int) -> None:
        self.geometry, self.task, self.ring = geometry, task, ring
        self._draw = random.Random(seed)
        self._variables = [ring.variables(j) for j in range(len(ring.prismatic))]
        self._sorted: dict[tuple[int, int, int], tuple[Poly, ByPower]] = {}
        self._residues = [Residues(ring, prime) for prime in PRIMES]

    def points(
        self, place: Mapping[int, Value], relations: Sequence[Poly], count: int, time: Budget
    ) -> list[ModularPoint] | None:
        """Up to ``count`` points with joints at values on which relations vanish.

        Returns
        -------
        list of ModularPoint or None
            None where the relations are not to be solved one after the other, or have square roots
            that the values' primes do not tell.
        """
        if not self.ring.rational:
            return None
        order = solving_order(relations, self.ring)
        if order is None:
            return None
        found: list[ModularPoint] = []
        for k in range(_TRIES * count):
            residues = self._residues[k % len(self._residues)]
            at: At = {j: value_modulo(v, residues.prime) for j, v in place.items()}
            # Roots that are computed for one point.
            if self._solve(order, at, residues, [400], time):
                for j in range(len(self.ring.prismatic)):
                    if j not in at:
                        at[j] = self._random(j, residues.prime)
                found.append(ModularPoint(at, self._rows(at, residues.prime), residues))
            if len(found) == count or (k >= _TRIES and not found):
                break
        return found

    def _rows(self, at: At, prime: int) -> list[list[int]]:
        exact = {j: tuple(map(Fraction, values)) for j, values in at.items()}
        return own_jacobian_modulo(self.geometry, self.task, prime, self._draw, exact)

    def _solve(
        self, order: Order, at: At, residues: Residues, left: list[int], time: Budget
    ) -> bool:
        """Solve all equations from some values on, or go back to others; tells whether it did."""
        if not order:
            return True
        (poly, joint), *rest = order
        unset = [j for j in self.ring.joints_of(poly) if j != joint and j not in at]
        # Times that joints of one equation are drawn: half of all quadratics have no root.
        for _ in range(4 if unset else 1):
            time.check()
            left[0] -= 1
            if left[0] < 0:
                return False
            for j in unset:
                at[j] = self._random(j, residues.prime)
            for root in self._roots(poly, joint, at, residues):
                at[joint] = root
                before = set(at)
                if self._solve(tuple(rest), at, residues, left, time):
                    return True
                for j in set(at) - before:
                    del at[j]
            at.pop(joint, None)
        for j in unset:
            del at[j]
        return False

    def _random(self, joint: int, prime: int) -> tuple[int, ...]:
        drawn = self._draw.randrange(1, prime)
        return (drawn,) if self.ring.prismatic[joint] else (1, drawn)

    def _roots(self, poly: Poly, joint: int, at: At, residues: Residues) -> list[tuple[int, ...]]:
        """Values of one joint at which a polynomial vanishes, the others being given."""
        prime = residues.prime
        base = {
            v: value
            for j, values in at.items()
            for v, value in zip(self._variables[j], values, strict=True)
        }
        powers: dict[tuple[int, int], int] = {}
        flat = []
        for terms in self._by_power(poly, joint, residues):
            total = 0
            for c, others in terms:
                for one in others:
                    factor = powers.get(one)
                    if factor is None:
                        factor = powers[one] = pow(base[one[0]], one[1], prime)
                    c = c * factor % prime
                total += c
            flat.append(total % prime)
        if not any(flat):
            return []  # whatever the joint does: a point of a larger part
        roots = [int(r) for r, _ in nmod_poly(flat, prime).roots()]
        if self.ring.prismatic[joint]:
            values: list[tuple[int, ...]] = [(r,) for r in roots]
        else:
            values = [(1, r) for r in roots if (r * r + 1) % prime]
            if flat[-1] == 0:
                values.append((0, 1))
        self._draw.shuffle(values)
        return values

    def _by_power(self, poly: Poly, joint: int, residues: Residues) -> ByPower:
        """Terms by the power of the last variable of one joint, without that joint's variables."""
        key = (id(poly), joint, residues.prime)  # the polynomial is kept: its id stays its own
        if key not in self._sorted:
            own = self._variables[joint]
            found: dict[int, list[tuple[int, Powers]]] = {}
            degree = 0
            for monomial, c in residues.terms(poly):
                mine = {v: e for v, e in monomial if v in own}
                degree = max(degree, sum(mine.values()))
                rest = tuple((v, e) for v, e in monomial if v not in own)
                found.setdefault(mine.get(own[-1], 0), []).append((c, rest))
            self._sorted[key] = poly, [found.get(k, []) for k in range(degree + 1)]
        return self._sorted[key][1]


def solving_order(relations: Sequence[Poly], ring: Ring) -> Order | None:
    """Relations in an order in which each is solved for a joint that none before it has.

    Parameters
    ----------
    relations : sequence of Poly
        As many as the joints that they leave no freedom.
    ring : Ring
        Theirs.

    Returns
    -------
    tuple of (Poly, int), or None
        None if there is no such order.
    """
    left = [(r, set(ring.joints_of(r))) for r in relations]
    first: list[tuple[Poly, int]] = []
    last: list[tuple[Poly, int]] = []
    known: set[int] = set()
    while left:
        alone = next(((i, j - known) for i, (_, j) in enumerate(left) if len(j - known) < 2), None)
        if alone is not None:
            i, joints = alone
            if not joints:
                return None  # more relations than joints
            first.append((left.pop(i)[0], *joints))
            known |= joints
            continue
        count: dict[int, int] = {}
        for _, joints in left:
            for j in joints - known:
                count[j] = count.get(j, 0) + 1
        own = [
            (len(js - known), i, j)
            for i, (_, js) in enumerate(left)
            for j in js
            if count.get(j) == 1
        ]
        if not own:
            return None
        _, i, j = max(own)  # what is solved last may have many joints
        last.append((left.pop(i)[0], j))
    return (*first, *reversed(last))


_ON = 1e-8


@dataclass(frozen=True, eq=False)
class RealPoints:
    """Real points q (N, n), to rounding."""

    maker: PieceMaker
    q: Array
    rank: int

    def __len__(self) -> int:
        return len(self.q)

    def full(self, columns: Sequence[int]) -> Bool:
        """At which of them (N,) some columns of the Jacobian, as many as the rank, have it."""
        sizes = np.linalg.svd(self.maker.jacobians(self.q)[..., list(columns)], compute_uv=False)
        ratio = sizes[:, self.rank - 1] / np.maximum(sizes[:, 0], 1e-300)
        return np.asarray(ratio >= 1e-5)

    def on(self, component: Component) -> bool:
        """Whether all lie on a component."""
        branch = self.maker.branch_of(component.values, component.relations)
        if any((self.maker.away(self.q, v) > _ON).any() for v in branch.values):
            return False
        if not branch.equations:
            return True
        return bool((np.abs(residuals(branch.equations, self.q)) < _ON).all())

    def vanishes(self, poly: Poly) -> Bool:
        """At which of them (N,) a polynomial is zero."""
        off = residuals([self.maker.equation_of(poly)], self.q)
        return np.asarray(np.abs(off)[:, 0] < _ON)


@dataclass(frozen=True, eq=False)
class PrimePoints:
    """Points modulo primes, exactly."""

    points: Sequence[ModularPoint]
    rank: int

    def __len__(self) -> int:
        return len(self.points)

    def full(self, columns: Sequence[int]) -> Bool:
        """See ``RealPoints``."""
        return np.array([p.rank(columns) == self.rank for p in self.points], dtype=bool)

    def on(self, component: Component) -> bool:
        """See ``RealPoints``."""
        return all(
            all(p.has(j, v) for j, v in component.values.items())
            and all(p.is_zero(r) for r in component.relations)
            for p in self.points
        )

    def vanishes(self, poly: Poly) -> Bool:
        """See ``RealPoints``."""
        return np.array([p.is_zero(poly) for p in self.points], dtype=bool)


MetPoints: TypeAlias = RealPoints | PrimePoints
Columns = Sequence[Sequence[int]]


def rank(J: Columns, columns: Sequence[int], prime: int = PRIMES[0]) -> int:
    """Rank of some columns modulo a prime."""
    flat = [row[j] for row in J for j in columns]
    return int(nmod_mat(len(J), len(columns), flat, prime).rank())


def independent(J: Columns, joints: Iterable[int], count: int) -> list[int]:
    """The first ``count`` of some joints whose columns are independent."""
    chosen: list[int] = []
    for j in joints:
        if len(chosen) == count:
            break
        if rank(J, [*chosen, j]) > len(chosen):
            chosen.append(j)
    return chosen


def cutting(
    minors: NearMinors,
    J: Columns,
    place: Mapping[int, Value],
    regular: MetPoints,
    most: int,
) -> list[Poly]:
    """Minors of near joints, few, of which each point has one that is not zero there."""
    n, width = len(J[0]), minors.rank + 1
    choices: list[tuple[tuple[int, ...], Bool]] = []
    for first in range(n - width + 1):
        window = range(first, first + width)
        for skipped in window:
            some = tuple(j for j in window if j != skipped)
            if rank(J, some) == minors.rank:
                choices.append((some, regular.full(some)))
    left = np.ones(len(regular), dtype=bool)
    chosen: list[Poly] = []
    while left.any() and choices and len(chosen) < most:
        some, cut = max(choices, key=lambda c: int((c[1] & left).sum()))
        if not (cut & left).any():
            break
        left &= ~cut
        try:
            chosen.append(minors.minor(some, place))
        except NotSquare:
            break
    return chosen


_STEP = 1e-3


def freedom(branch: Branch, q: Array) -> int:
    """Dimension of a branch near one of its points, by small steps brought back to it.

    Where gradients vanish or depend on each other they allow more than the set does: a step into
    what they allow comes back then.

    Parameters
    ----------
    branch : Branch
        Joint values and equations.
    q : (n,) array
        A point of it.
    """
    free = np.ones(len(q), dtype=bool)
    free[[v.joint for v in branch.values]] = False
    loose = np.eye(len(q))[free]
    if not branch.equations:
        return len(loose)
    slopes = gradients(branch.equations, q[None])[0] @ loose.T
    _, sizes, right = np.linalg.svd(slopes)
    rank = int((sizes > 1e-6 * max(float(sizes[0]), 1e-300)).sum())
    directions = right[rank:] @ loose
    if not len(directions):
        return 0
    moved, ok = project(branch.equations, q + _STEP * directions, free)
    steps = np.where(ok[:, None], (moved - q) / _STEP, 0.0)
    # Of a step: what is left of it, at least, where the set goes on in its direction.
    return int((np.linalg.svd(steps, compute_uv=False) > 0.3).sum())
