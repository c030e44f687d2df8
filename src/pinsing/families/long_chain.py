"""Families of chains with many joints, from the axes of neighbours.

A chain is singular where one wrench is reciprocal to all its axes. Five neighbouring axes fix that
wrench, and each joint farther out adds one equation: six neighbouring axes depend on each other.
These equations are short, have four joints each, and can be solved one after the other, whatever
the length of the chain; all minors of the Jacobian would be C(n, 6).

So a place (some joints at values, at first none) has no more equations than its codimension.
Their factors are combined: where one fixes a joint, the place with that value is searched in turn;
other combinations are judged at points of them. What is larger than a general set of equations
tells comes from joints whose axes depend on each other everywhere, though they are no neighbours:
two spherical groups, whose centres every such wrench passes through.
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
from collections.abc import Mapping, Sequence

import numpy as np
from flint import nmod_mat

from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, FoundComponents
from pinsing.algebra.near_minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.families.freedom import freedom
from pinsing.families.parts import Branch
from pinsing.families.pieces import PieceMaker
from pinsing.families.progress import Progress
from pinsing.families.zero_set import residuals
from pinsing.geometry.exact_rank import PRIMES, jacobian_modulo
from pinsing.geometry.nominal import Nominal
from pinsing.robot.task import Task

_SEED = 5
_POINTS = 24
_SINGULAR, _REGULAR = 1e-8, 1e-5
"""sigma_r / sigma_1 of points on a set that are singular, or not; between, they do not count."""
_ON = 1e-8
_TRIED = 10
"""Singular points at which the size of a set is asked."""
_CIRCUITS = 20_000
"""Choices of joints among which groups that depend on each other everywhere are looked for."""
_ROUNDS = 2
"""Times that regular parts are told apart by some equations more."""
_COMBINED = 16
"""Combinations of factors of these that are judged one by one."""
_LONG, _LONGEST = 200, 400
"""Terms of equations to which others are added that tell regular parts apart, and of these."""

Places = Mapping[int, Value]
Relations = tuple[Poly, ...]


class LongChain:
    """Looks for the families of a chain within a time.

    Parameters
    ----------
    geometry, task, rank
        The chain (each joint moves on its own), the rows, and their generic rank.
    ring : Ring
        Of the polynomials.
    maker : PieceMaker
        Turns polynomials into equations with points.
    time : Budget
        After which what was found is all.

    Attributes
    ----------
    components : list of Component
        None of them lies in another, as far as division and points tell.
    progress : Progress
        What was looked at.
    """

    def __init__(
        self,
        geometry: Nominal,
        task: Task,
        rank: int,
        ring: Ring,
        maker: PieceMaker,
        time: Budget,
    ) -> None:
        self.geometry, self.task, self.rank, self.ring = geometry, task, rank, ring
        self.maker, self.time = maker, time
        self.n = len(ring.prismatic)
        self.limit = (len(task.rows) - rank + 1) * (self.n - rank + 1)
        if len(task.rows) > rank:  # rows that depend on others raise the bound for nothing
            self.limit = self.n - rank + 1
        self.progress = Progress()
        self.components: list[Component] = []
        self._minors = NearMinors(geometry, ring, task, rank, time)
        self._found = FoundComponents(ring, lambda c: None)
        self._points: list[Array] = []
        self._draw = random.Random(_SEED)
        self._waiting: list[tuple[int, int, Places]] = []
        self._asked: set[object] = set()
        self._combined: set[object] = set()
        self._push({})
        self._run()
        self.components = self._irredundant()

    def _run(self) -> None:
        first = True
        while self._waiting:
            if self.time.over:
                break
            _, _, place = heapq.heappop(self._waiting)
            if self._found.covers(place):
                continue
            self.progress.places += 1
            try:
                self._search(place)
                if first:
                    self._groups(place)
            except BudgetExceeded:
                self.progress.waiting += 1
            first = False
        self.progress.waiting += len(self._waiting)

    # Places ---------------------------------------------------------------------------

    def _push(self, place: Places) -> None:
        key = frozenset(place.items())
        if key not in self._asked and len(place) <= self.limit:
            self._asked.add(key)
            heapq.heappush(self._waiting, (len(place), len(self._asked), place))

    def _columns(self, place: Places) -> list[list[int]]:
        """Jacobian (rows, n) modulo a prime at a random configuration of a place."""
        return jacobian_modulo(self.geometry, self.task, PRIMES[0], self._draw, place)

    def _search(self, place: Places) -> None:
        """All sets at a place that the equations of neighbours tell."""
        J = self._columns(place)
        if _rank(J, range(self.n)) < self.rank:
            self._add(place, (), len(place), np.zeros((0, self.n)))
            return
        start = max(0, (self.n - self.rank + 1) // 2)
        self._along(place, J, _neighbours(J, start, self.rank - 1, self.n))

    def _groups(self, place: Places) -> None:
        """Sets whose wrench is fixed by joints that depend on each other, but are no neighbours."""
        J = self._columns(place)
        seen: set[tuple[int, ...]] = set()
        choices = itertools.combinations(range(self.n), self.rank)
        for some in itertools.islice(choices, _CIRCUITS):
            if self.time.over:
                self.progress.waiting += 1
                return
            if _rank(J, some) != self.rank - 1 or any(
                _rank(J, [j for j in some if j != k]) < self.rank - 1 for k in some
            ):
                continue
            all_of = tuple(
                j for j in range(self.n) if j in some or _rank(J, [*some, j]) < self.rank
            )
            if all_of not in seen:
                seen.add(all_of)
                self._along(place, J, some[:-1])

    def _along(self, place: Places, J: Sequence[Sequence[int]], base: Sequence[int]) -> None:
        """Sets on which the wrench that is reciprocal to ``base`` is so to all other joints."""
        if len(base) < self.rank - 1:
            return
        polys: list[Poly] = []
        within = list(base)
        free = [j for j in range(self.n) if j not in base and _rank(J, [*base, j]) < self.rank]
        within += free
        middle = (min(base) + max(base)) / 2 if base else (self.n - 1) / 2  # none: a single row
        rest = [j for j in range(self.n) if j not in within]
        for j in sorted(rest, key=lambda j: abs(j - middle)):
            near = _nearest(J, j, within, self.rank - 1)
            within.append(j)
            if _rank(J, [*near, j]) < self.rank:
                continue
            try:
                polys.append(self._minors.minor([*near, j], place))
            except NotSquare:
                self.progress.too_long += 1
            except BudgetExceeded:
                self.progress.too_long += 1
                if self.time.over:
                    raise
        if not polys:
            return
        self._branch(place, [self._factors(p) for p in polys])

    def _factors(self, poly: Poly) -> list[Poly]:
        self.time.check_factor(len(poly))
        return self.ring.factors(poly)

    def _branch(self, place: Places, factors: Sequence[list[Poly]]) -> None:
        """Go on at joint values; judge what is left."""
        if any(not fs for fs in factors):
            return  # one of the minors is nowhere zero
        values = [[v for f in fs if (v := self.ring.joint_value(f))] for fs in factors]
        others = [[f for f in fs if not self.ring.joint_value(f)] for fs in factors]
        only = [v for v, o in zip(values, others, strict=True) if not o]
        for vs in [min(only, key=len)] if only else values:
            for joint, value in vs:
                self._push({**place, joint: value})
        if only:
            return
        # The largest set first: on it as many joints as can be take part in each equation.
        ordered = [sorted(o, key=lambda f: -len(self.ring.joints_of(f))) for o in others]
        for some in itertools.product(*ordered):
            relations = tuple(sorted({str(f): f for f in some}.values(), key=len))
            self._judge(place, relations)

    # Systems of equations -------------------------------------------------------------

    def _judge(
        self, place: Places, relations: Relations, more: Relations = (), rounds: int = 0
    ) -> None:
        """Whether the common zeros of some equations at a place are singular, in whole or part.

        ``more`` of them say which part is meant, and make it no smaller.
        """
        key = (frozenset(place.items()), frozenset(map(str, (*relations, *more))))
        codimension = len(place) + len(relations)
        if key in self._combined or codimension > self.limit:
            return
        self._combined.add(key)
        if self._found.covers(place, relations):
            return
        self.time.check()
        every = tuple(sorted((*relations, *more), key=len))
        points, ratio = self._met(place, every)
        singular, regular = points[ratio <= _SINGULAR], points[ratio >= _REGULAR]
        if not len(singular) and not len(regular):
            self.progress.unseen += 1
            return
        if len(regular) and codimension < self.limit and not more:
            # What else is singular there is smaller, and lies where one minor more is zero.
            self._cut(place, relations, regular)
        if len(singular) and (len(regular) or more):
            # What is singular may be smaller than the rest: then it is found inside.
            branch = self.maker.branch_of(place, every)
            some = singular[:: max(1, len(singular) // _TRIED)]
            singular = some[[self.n - freedom(branch, q) <= codimension for q in some]]
        if len(singular) and len(regular):
            # Parts of one size, which some minors more tell apart, unless these are long.
            told = self._telling(place, every, regular) if rounds < _ROUNDS else ()
            if told:
                self._tell_apart(place, relations, more, told, rounds)
                return
            self.progress.mixed += 1
        if len(singular):
            self._add(place, every, codimension, singular)

    def _tell_apart(
        self, place: Places, relations: Relations, more: Relations, told: Relations, rounds: int
    ) -> None:
        """Judge the part of some equations on which others are zero too, factor by factor."""
        factors = [self._factors(t) for t in told]
        if math.prod(map(len, factors)) > _COMBINED:
            self._judge(place, relations, (*more, *told), rounds + 1)
            return
        for some in itertools.product(*factors):
            fixed = next((v for f in some if (v := self.ring.joint_value(f))), None)
            if fixed is not None:
                self._push({**place, fixed[0]: fixed[1]})
                continue
            also = {str(f): f for f in some}
            self._judge(place, relations, (*more, *also.values()), rounds + 1)

    def _telling(self, place: Places, relations: Relations, regular: Array) -> Relations:
        """Minors that are zero where all are, and not at regular points; none if these are long."""
        longest = max(len(r) for r in relations)
        if longest > _LONG:
            return ()
        known = set(map(str, relations))
        minors = self._cutting(place, regular, self.n)
        told = {str(m): m for m in minors if len(m) <= _LONGEST}
        return tuple(m for name, m in told.items() if name not in known)

    def _cut(self, place: Places, relations: Relations, regular: Array) -> None:
        """Go on inside some equations with one minor that cuts what is regular of them."""
        minors = self._cutting(place, regular, 1)
        if not minors:
            self.progress.uncut += 1
            return
        for f in self._factors(minors[0]):
            fixed = self.ring.joint_value(f)
            if fixed:
                self._push({**place, fixed[0]: fixed[1]})
            else:
                self._judge(place, (*relations, f))

    def _cutting(self, place: Places, regular: Array, most: int) -> list[Poly]:
        """Minors of near joints, few, of which each point has one that is not zero there."""
        J = self._columns(place)
        width = self.rank + 1
        jacobians = self.maker.jacobians(regular)
        choices: list[tuple[tuple[int, ...], Bool]] = []
        for first in range(self.n - width + 1):
            window = range(first, first + width)
            for skipped in window:
                some = tuple(j for j in window if j != skipped)
                if _rank(J, some) < self.rank:
                    continue
                sizes = np.linalg.svd(jacobians[..., list(some)], compute_uv=False)
                ratio = sizes[:, self.rank - 1] / np.maximum(sizes[:, 0], 1e-300)
                choices.append((some, ratio >= _REGULAR))
        left = np.ones(len(regular), dtype=bool)
        chosen: list[Poly] = []
        while left.any() and choices and len(chosen) < most:
            some, cut = max(choices, key=lambda c: int((c[1] & left).sum()))
            if not (cut & left).any():
                break
            left &= ~cut
            try:
                chosen.append(self._minors.minor(some, place))
            except NotSquare:
                break
        return chosen

    def _met(self, place: Places, relations: Relations) -> tuple[Array, Array]:
        """Real points of a system (k, n), by drawing and from random starts, and their ratios."""
        branch = self.maker.branch_of(place, relations)
        parts = [self.maker.find(branch, _POINTS, rounds=3), self.maker.thrown(branch, _POINTS)]
        points = np.concatenate(parts)
        ratio = self.maker.ratios(points) if len(points) else np.zeros(0)
        return points, ratio

    def _vanishes(self, f: Poly, points: Array) -> bool:
        return bool((np.abs(residuals([self.maker.equation_of(f)], points)) < _ON).all())

    # What was found -------------------------------------------------------------------

    def _add(self, place: Places, relations: Relations, codimension: int, points: Array) -> None:
        self._found.add(place, relations, False, codimension)
        self._points.append(points)

    def _irredundant(self) -> list[Component]:
        """Those that do not lie in others, larger ones first."""
        every = list(zip(self._found.all, self._points, strict=True))
        every.sort(key=lambda e: (e[0].codimension, len(e[0].relations)))
        kept: list[tuple[Component, Branch]] = []
        for c, points in every:
            if any(self._found.inside(c, k) for k, _ in kept):
                continue
            if len(points) and any(self._on(branch, points) for _, branch in kept):
                continue
            kept.append((c, self.maker.branch_of(c.values, c.relations)))
        return [c for c, _ in kept]

    def _on(self, branch: Branch, points: Array) -> bool:
        """Whether all of some points lie on a branch."""
        for v in branch.values:
            away = points[:, v.joint] - v.value
            if not self.ring.prismatic[v.joint]:
                away = away - 2 * np.pi * np.round(away / (2 * np.pi))
            if (np.abs(away) > _ON).any():
                return False
        if not branch.equations:
            return True
        return bool((np.abs(residuals(branch.equations, points)) < _ON).all())


def _rank(J: Sequence[Sequence[int]], columns: Sequence[int]) -> int:
    """Rank of some columns modulo the prime."""
    flat = [row[j] for row in J for j in columns]
    return int(nmod_mat(len(J), len(columns), flat, PRIMES[0]).rank())


def _neighbours(J: Sequence[Sequence[int]], start: int, count: int, n: int) -> list[int]:
    """The first ``count`` joints from ``start`` outward whose columns are independent."""
    chosen: list[int] = []
    for j in (*range(start, n), *range(start - 1, -1, -1)):
        if len(chosen) == count:
            break
        if _rank(J, [*chosen, j]) > len(chosen):
            chosen.append(j)
    return chosen


def _nearest(J: Sequence[Sequence[int]], j: int, among: Sequence[int], count: int) -> list[int]:
    """The ``count`` independent joints that are nearest to j."""
    chosen: list[int] = []
    for k in sorted(among, key=lambda k: (abs(k - j), k)):
        if len(chosen) == count:
            break
        if _rank(J, [*chosen, k]) > len(chosen):
            chosen.append(k)
    return chosen
