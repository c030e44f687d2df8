"""Points that were met on some equations: real ones, or ones modulo a prime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from flint import nmod_mat

from pinsing._types import Array, Bool
from pinsing.algebra.components import Component
from pinsing.algebra.minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Value
from pinsing.families.modular_points import ModularPoint
from pinsing.families.parts import Branch
from pinsing.families.pieces import PieceMaker
from pinsing.families.zero_set import gradients, project, residuals
from pinsing.robot.nominal import PRIMES

_ON = 1e-8


class MetPoints(Protocol):
    """Some points of one set."""

    def __len__(self) -> int: ...

    def full(self, columns: Sequence[int]) -> Bool:
        """At which of them (N,) some columns of the Jacobian, as many as the rank, have it."""

    def on(self, component: Component) -> bool:
        """Whether all lie on a component."""

    def vanishes(self, poly: Poly) -> Bool:
        """At which of them (N,) a polynomial is zero."""


@dataclass(frozen=True, eq=False)
class RealPoints:
    """Real points q (N, n), to rounding."""

    maker: PieceMaker
    q: Array
    rank: int

    def __len__(self) -> int:
        return len(self.q)

    def full(self, columns: Sequence[int]) -> Bool:
        """See ``MetPoints``."""
        sizes = np.linalg.svd(self.maker.jacobians(self.q)[..., list(columns)], compute_uv=False)
        ratio = sizes[:, self.rank - 1] / np.maximum(sizes[:, 0], 1e-300)
        return np.asarray(ratio >= 1e-5)

    def on(self, component: Component) -> bool:
        """See ``MetPoints``."""
        branch = self.maker.branch_of(component.values, component.relations)
        if any((self.maker.away(self.q, v) > _ON).any() for v in branch.values):
            return False
        if not branch.equations:
            return True
        return bool((np.abs(residuals(branch.equations, self.q)) < _ON).all())

    def vanishes(self, poly: Poly) -> Bool:
        """See ``MetPoints``."""
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
        """See ``MetPoints``."""
        return np.array([p.rank(columns) == self.rank for p in self.points], dtype=bool)

    def on(self, component: Component) -> bool:
        """See ``MetPoints``."""
        return all(
            all(p.has(j, v) for j, v in component.values.items())
            and all(p.is_zero(r) for r in component.relations)
            for p in self.points
        )

    def vanishes(self, poly: Poly) -> Bool:
        """See ``MetPoints``."""
        return np.array([p.is_zero(poly) for p in self.points], dtype=bool)


Columns = Sequence[Sequence[int]]


def rank(J: Sequence[Sequence[int]], columns: Sequence[int]) -> int:
    """Rank of some columns modulo the prime."""
    flat = [row[j] for row in J for j in columns]
    return int(nmod_mat(len(J), len(columns), flat, PRIMES[0]).rank())


def neighbours(J: Sequence[Sequence[int]], start: int, count: int, n: int) -> list[int]:
    """The first ``count`` joints from ``start`` outward whose columns are independent."""
    chosen: list[int] = []
    for j in (*range(start, n), *range(start - 1, -1, -1)):
        if len(chosen) == count:
            break
        if rank(J, [*chosen, j]) > len(chosen):
            chosen.append(j)
    return chosen


def nearest(J: Sequence[Sequence[int]], j: int, among: Sequence[int], count: int) -> list[int]:
    """The ``count`` independent joints that are nearest to j."""
    chosen: list[int] = []
    for k in sorted(among, key=lambda k: (abs(k - j), k)):
        if len(chosen) == count:
            break
        if rank(J, [*chosen, k]) > len(chosen):
            chosen.append(k)
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
