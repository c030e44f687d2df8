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

Points of equations: real ones, or ones modulo primes, one equation solved after the other.

The equations of neighbouring axes have few joints each, and can be put in an order in which each is
solved for a joint that those before it do not have. Modulo a prime of 62 bits that takes
milliseconds, whatever the lengths are; and a rank there is a rank. All joints that are not solved
for are drawn at random: so a point is a generic one of a part that has as few dimensions as there
are equations. Parts on which an equation holds whatever its joint does are not met.
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

import numpy as np
from flint import nmod_mat, nmod_poly

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, by_size, inside, vanishing
from pinsing.algebra.conditions import Branch
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.jacobian_matrix import NearMinors, NotSquare
from pinsing.algebra.ring import MadeOnce, Poly, Ring, Value, coefficients_by
from pinsing.families.describe import PieceMaker
from pinsing.families.zero_set import SearchBox, project, system_of
from pinsing.kinematics.jacobian import ratios, task_jacobians
from pinsing.measures import Array
from pinsing.robot.mimic import own_jacobian_modulo
from pinsing.robot.nominal import PRIMES, Nominal
from pinsing.robot.surd import residue
from pinsing.robot.task import Task

_TRIES = 4
"""Times that a point is begun, for each that is wanted."""

Order = tuple[tuple[Poly, int], ...]
"""Equations, and the joint that each is solved for."""
At = dict[int, tuple[int, ...]]
"""Half-angle coordinates (x, y) of joints, or their lengths, modulo a prime."""
Columns = Sequence[Sequence[int]]


@dataclass(frozen=True, eq=False)
class ModularPoint:
    """A configuration modulo a prime."""

    values: list[int]  # of the ring's variables
    rows: Columns  # task rows of the Jacobian there
    residues: Residues  # images of polynomials

    def rank(self, columns: Sequence[int]) -> int:
        """Rank of some columns of the Jacobian."""
        return rank(self.rows, columns, self.residues.prime)

    def full(self, columns: Sequence[int]) -> bool:
        """Return True if some columns, as many as the rank, have it."""
        return self.rank(columns) == len(columns)

    def is_zero(self, poly: Poly) -> bool:
        """Return True if a polynomial vanishes there."""
        return int(self.residues.of(poly)(*self.values)) == 0

    def on(self, component: Component) -> bool:
        """Return True if it lies on a component."""
        return all(map(self.is_zero, vanishing(component, self.residues.ring)))


class ModularPoints:
    """Looks for points of equations of one chain, drawn from a seed."""

    def __init__(self, geometry: Nominal, task: Task, ring: Ring, seed: int) -> None:
        self.geometry, self.task, self.ring = geometry, task, ring
        self._draw = random.Random(seed)
        self._parts = defaultdict[int, MadeOnce](MadeOnce)
        self._residues = [Residues(ring, prime) for prime in PRIMES]

    def points(
        self, place: Mapping[int, Value], relations: Sequence[Poly], count: int, time: Budget
    ) -> list[ModularPoint] | None:
        """Return up to ``count`` points with joints at values on which relations vanish."""
        # None where relations cannot be solved in turn, or have square roots unknown to the primes.
        if not self.ring.rational or (order := solving_order(relations, self.ring)) is None:
            return None
        found: list[ModularPoint] = []
        for k in range(_TRIES * count):
            residues = self._residues[k % len(self._residues)]
            held = {j: tuple(residue(x, residues.prime) for x in v) for j, v in place.items()}
            # Roots that are computed for one point.
            at = self._solved(order, held, residues, iter(range(400)), time)
            if at is not None:
                found.append(self._point(at, residues))
            if len(found) == count or (k >= _TRIES and not found):
                break
        return found

    def _point(self, at: At, residues: Residues) -> ModularPoint:
        """A point, at random where joints are at no value."""
        joints = range(len(self.ring.prismatic))
        at = at | {j: self._random(j, residues.prime) for j in joints if j not in at}
        exact = {j: tuple(map(Fraction, values)) for j, values in at.items()}
        rows = own_jacobian_modulo(self.geometry, self.task, residues.prime, self._draw, exact)
        return ModularPoint([x for j in joints for x in at[j]], rows, residues)

    def _solved(
        self, order: Order, at: At, residues: Residues, tries: Iterator[int], time: Budget
    ) -> At | None:
        """Values at which all equations vanish, going on from some; None if none were found."""
        if not order:
            return at
        (poly, joint), *rest = order
        unset = [j for j in self.ring.joints_of(poly) if j != joint and j not in at]
        # Times that joints of one equation are drawn: half of all quadratics have no root.
        for _ in range(4 if unset else 1):
            time.check()
            if next(tries, None) is None:
                return None
            here = at | {j: self._random(j, residues.prime) for j in unset}
            for root in self._roots(poly, joint, here, residues):
                found = self._solved(tuple(rest), here | {joint: root}, residues, tries, time)
                if found is not None:
                    return found
        return None

    def _random(self, joint: int, prime: int) -> tuple[int, ...]:
        drawn = self._draw.randrange(1, prime)
        return (drawn,) if self.ring.prismatic[joint] else (1, drawn)

    def _roots(self, poly: Poly, joint: int, at: At, residues: Residues) -> list[tuple[int, ...]]:
        """Values of one joint at which a polynomial vanishes, the others being given."""
        prime, joints = residues.prime, range(len(self.ring.prismatic))
        parts = self._parts[joint].of(
            poly, lambda p: coefficients_by(p, self.ring.variables(joint))
        )
        point = [x for j in joints for x in at.get(j, (0,) * len(self.ring.variables(j)))]
        line = [0] * (1 + max(map(sum, parts)))
        for powers, c in parts.items():
            line[powers[-1]] = int(residues.of(c)(*point))
        if not any(line):
            return []  # whatever the joint does: a point of a larger part
        roots = [int(r) for r, _ in nmod_poly(line, prime).roots()]
        values: list[tuple[int, ...]] = [(r,) for r in roots]
        if not self.ring.prismatic[joint]:
            values = [(1, r) for r in roots if (r * r + 1) % prime]
            values += [(0, 1)] if line[-1] == 0 else []
        self._draw.shuffle(values)
        return values


def solving_order(relations: Sequence[Poly], ring: Ring) -> Order | None:
    """Relations in an order in which each is solved for a joint that none before it has."""
    left = [(r, ring.joints_of(r)) for r in relations]
    order: list[tuple[Poly, int]] = []
    while left:
        count = Counter(j for _, joints in left for j in joints)
        own = [(len(js), i, j) for i, (_, js) in enumerate(left) for j in js if count[j] == 1]
        if not own:
            return None
        _, i, j = max(own)  # what is solved last may have many joints
        order.append((left.pop(i)[0], j))
    return tuple(reversed(order))


_ON = 1e-8


@dataclass(frozen=True, eq=False)
class RealPoint:
    """A real configuration (n,), to rounding."""

    maker: PieceMaker
    q: Array
    rows: Array  # task rows of the Jacobian there

    def full(self, columns: Sequence[int]) -> bool:
        """Return True if some columns, as many as the rank, have it."""
        sizes = np.linalg.svd(self.rows[:, list(columns)], compute_uv=False)
        return bool(sizes[len(columns) - 1] >= 1e-5 * max(sizes[0], 1e-300))

    def on(self, component: Component) -> bool:
        """Return True if it lies on a component."""
        return bool(self.maker.off(self.q[None], component.values, component.relations)[0] < _ON)


MetPoints: TypeAlias = Sequence[ModularPoint] | Sequence[RealPoint]


def rank(J: Columns, columns: Sequence[int], prime: int = PRIMES[0]) -> int:
    """Rank of some columns modulo a prime."""
    flat = [row[j] for row in J for j in columns]
    return int(nmod_mat(len(J), len(columns), flat, prime).rank())


def independent(J: Columns, joints: Iterable[int], count: int) -> list[int]:
    """The first ``count`` of some joints whose columns are independent."""
    chosen: list[int] = []
    for j in joints:
        if len(chosen) < count and rank(J, [*chosen, j]) > len(chosen):
            chosen.append(j)
    return chosen


def cutting(
    minors: NearMinors, J: Columns, place: Mapping[int, Value], regular: MetPoints, most: int
) -> list[Poly]:
    """Minors of near joints, few, of which each point has one that is not zero there."""
    n, width = len(J[0]), minors.rank + 1
    windows = [range(first, first + width) for first in range(n - width + 1)]
    near = [tuple(j for j in w if j != skipped) for w in windows for skipped in w]
    useful = [some for some in near if rank(J, some) == minors.rank]
    choices = [(some, np.array([p.full(some) for p in regular])) for some in useful]
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
    """Return the dimension of a branch near q (n,), by small steps brought back to it."""
    # Where gradients vanish or depend on each other they allow more than the set does.
    free = SearchBox.of(branch, q, q).free
    loose = np.eye(len(q))[free]
    if not branch.equations:
        return len(loose)
    _, sizes, right = np.linalg.svd(system_of(branch.equations).gradients(q[None])[0] @ loose.T)
    rank = int((sizes > 1e-6 * max(float(sizes[0]), 1e-300)).sum())
    directions = right[rank:] @ loose
    if not len(directions):
        return 0
    moved, ok = project(branch.equations, q + _STEP * directions, free)
    steps = np.where(ok[:, None], (moved - q) / _STEP, 0.0)
    # Of a step: what is left of it, at least, where the set goes on in its direction.
    return int((np.linalg.svd(steps, compute_uv=False) > 0.3).sum())


def gaps(open_ends: Counter[str], n: int) -> list[str]:
    """Return what a search by neighbouring axes left open in a chain of n joints, in sentences.

    Counted are ``places``, sets of joint values looked at; ``waiting``, places without time;
    ``unseen``, systems without a real point met; ``uncut``, systems with a regular part that no
    minor of near joints cut; and ``too_long`` minors.
    """
    places = open_ends["places"]
    sets = "one set" if places == 1 else f"{places} sets"
    out = [
        f"for {n} joints only what neighbouring axes tell was looked for, at {sets} of joint "
        "values (the empty one is the general case); that nothing else is singular is not shown"
    ]
    if waiting := open_ends["waiting"]:
        out.append(
            f"{waiting} more {'set' if waiting == 1 else 'sets'} of joint values waited for a turn "
            "when the time was over: more time looks at them"
        )
    if unseen := open_ends["unseen"]:
        out.append(f"no real point was met on {_systems(unseen)}, left out here")
    if stuck := open_ends["uncut"] + open_ends["too_long"]:
        out.append(f"{_systems(stuck)} could not be searched further")
    return out


def _systems(count: int) -> str:
    return "one system of equations" if count == 1 else f"{count} systems of equations"


_SEED = 5
_POINTS = 24

Places = Mapping[int, Value]
Relations = tuple[Poly, ...]


class LongChain:
    """Looks for the families of a chain within a time, inside a ``place`` where one is given.

    ``thorough``: real points judge systems, too, where points modulo primes tell nothing. Of the
    ``components`` none lies in another, as far as division and points tell. ``unseen`` are systems
    with no real point met (components, if they have singular points modulo primes).
    """

    def __init__(
        self,
        geometry: Nominal,
        task: Task,
        rank: int,
        ring: Ring,
        maker: PieceMaker,
        time: Budget,
        place: Places | None = None,
        thorough: bool = True,
    ) -> None:
        self.geometry, self.task, self.rank, self.ring = geometry, task, rank, ring
        self.maker, self.time = maker, time
        self.n = len(ring.prismatic)
        self.limit = self.n - rank + 1  # rows that depend on others would raise it for nothing
        self.open_ends: Counter[str] = Counter()
        self.components: list[Component] = []
        self.unseen: list[Component] = []
        self._minors = NearMinors(geometry, ring, task, rank, time)
        self._found: list[tuple[Component, MetPoints]] = []
        self._exact = ModularPoints(geometry, task, ring, _SEED)
        self._later: list[tuple[Places, Relations]] = []
        self._draw = random.Random(_SEED)
        self._waiting: list[tuple[int, int, Places]] = []
        self._seen: set[object] = set()  # places, and systems
        self._push(dict(place or {}))
        self._go_on(first=True)
        while thorough and self._later and not self.time.stop():
            self._by_real_points()
            self._go_on()
        self.open_ends["waiting"] += len(self._waiting)
        self.open_ends["too_long"] += len(self._later)
        for c, points in sorted(self._found, key=lambda found: by_size(found[0])):
            # Larger ones first, without what lies in them.
            if not any(
                inside(c, k, ring) or (points and all(p.on(k) for p in points))
                for k in self.components
            ):
                self.components.append(c)

    @contextmanager
    def _counted(self, end: str) -> Iterator[None]:
        """What does not fit into the time is an end that stays open."""
        try:
            yield
        except BudgetExceeded:
            self.open_ends[end] += 1

    def _by_real_points(self) -> None:
        """Judge the first of the systems that were left for later."""
        place, relations = self._later.pop(0)
        if self._covered(place, relations):
            return
        with self._counted("too_long"):
            self._judge_real(place, relations, (), 0)
            if self.time.over and not self._covered(place, relations):
                self._later.append((place, relations))  # points were looked for but shortly

    @contextmanager
    def _part(self, share: float) -> Iterator[None]:
        """A share of the time for what is done meanwhile."""
        whole = self.time
        self.time = self._minors.time = self.maker.time = whole.part(share)
        try:
            with self._counted("too_long"):
                yield
        finally:
            self.time = self._minors.time = self.maker.time = whole

    def _go_on(self, first: bool = False) -> None:
        """Search at all places that wait."""
        while self._waiting and not self.time.stop():
            _, _, place = heapq.heappop(self._waiting)
            if self._covered(place):
                continue
            self.open_ends["places"] += 1
            with self._counted("waiting"):
                self._search(place)
            if first and not self.time.over:
                # Shares of the time for the general case by real points, and for what such groups
                # tell.
                with self._part(0.25):
                    while self._later and not self.time.stop():
                        self._by_real_points()
                with self._part(0.1):
                    self._groups(place)
            first = False

    # Places ---------------------------------------------------------------------------

    def _push(self, place: Places) -> None:
        key = frozenset(place.items())
        if key not in self._seen and len(place) <= self.limit:
            self._seen.add(key)
            heapq.heappush(self._waiting, (len(place), len(self._seen), place))

    def _columns(self, place: Places) -> list[list[int]]:
        """Jacobian (rows, n) modulo a prime at a random configuration of a place."""
        return own_jacobian_modulo(self.geometry, self.task, PRIMES[0], self._draw, place)

    def _search(self, place: Places) -> None:
        """All sets at a place that the equations of neighbours tell."""
        J = self._columns(place)
        if rank(J, range(self.n)) < self.rank:
            self._add(place, (), len(place), ())
            return
        start = max(0, (self.n - self.rank + 1) // 2)
        outward = (*range(start, self.n), *range(start - 1, -1, -1))
        self._along(place, J, independent(J, outward, self.rank - 1))

    def _groups(self, place: Places) -> None:
        """Look for dependent joints, not neighbours, that fix a wrench; in part of the time."""
        J = self._columns(place)
        seen: set[tuple[int, ...]] = set()
        # Choices of joints among which groups that depend on each other everywhere are looked for.
        for some in itertools.islice(itertools.combinations(range(self.n), self.rank), 20_000):
            self.time.check()
            if rank(J, some) != self.rank - 1 or any(
                rank(J, [j for j in some if j != k]) < self.rank - 1 for k in some
            ):
                continue
            all_of = tuple(j for j in range(self.n) if j in some or rank(J, [*some, j]) < self.rank)
            if all_of not in seen:
                seen.add(all_of)
                self._along(place, J, some[:-1])

    def _along(self, place: Places, J: Sequence[Sequence[int]], base: Sequence[int]) -> None:
        """Sets on which the wrench that is reciprocal to ``base`` is so to all other joints."""
        if len(base) < self.rank - 1:
            return
        polys: list[Poly] = []
        within = list(base)
        within += [j for j in range(self.n) if j not in base and rank(J, [*base, j]) < self.rank]
        middle = (min(base) + max(base)) / 2 if base else (self.n - 1) / 2  # none: a single row
        rest = [j for j in range(self.n) if j not in within]
        for j in sorted(rest, key=lambda j: abs(j - middle)):
            near = independent(J, sorted(within, key=lambda k: (abs(k - j), k)), self.rank - 1)
            within.append(j)
            if rank(J, [*near, j]) < self.rank:
                continue
            try:
                polys.append(self._minors.minor([*near, j], place))
            except (NotSquare, BudgetExceeded) as reason:
                self.open_ends["too_long"] += 1
                if self.time.over and isinstance(reason, BudgetExceeded):
                    raise
        factors = [self.ring.factors(p, self.time) for p in polys]
        if polys and all(factors):  # none of the minors is nowhere zero
            self._branch(place, factors)

    def _branch(self, place: Places, factors: Sequence[list[Poly]]) -> None:
        """Go on at joint values; judge what is left."""
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
            self._judge(place, tuple(sorted({str(f): f for f in some}.values(), key=len)))

    # Systems of equations -------------------------------------------------------------

    def _judge(
        self, place: Places, relations: Relations, more: Relations = (), rounds: int = 0
    ) -> None:
        """Judge if the common zeros of some equations at a place are singular, in whole or part.

        ``more`` of them say which part is meant, and make it no smaller. At points modulo primes
        where the equations can be solved in turn; else at real ones, when nothing else waits. So
        are those that are regular there: an equation may hold whatever its joint does.
        """
        key = (frozenset(place.items()), frozenset(map(str, (*relations, *more))))
        if key in self._seen or len(place) + len(relations) > self.limit:
            return
        self._seen.add(key)
        if self._covered(place, relations):
            return
        self.time.check()
        points = self._exact.points(place, relations, 6, self.time)
        if points is None and more:
            self._judge_real(place, relations, more, rounds)
            return
        met = [p for p in points or () if all(map(p.is_zero, more))]
        regular = [p for p in met if p.rank(range(self.n)) == self.rank]
        singular = [p for p in met if p not in regular]
        if not points or not (more or singular):
            self._later.append((place, relations))
        self._told(place, relations, more, singular, regular, rounds)

    def _judge_real(
        self, place: Places, relations: Relations, more: Relations, rounds: int
    ) -> None:
        """The same by real points."""
        codimension = len(place) + len(relations)
        every = tuple(sorted((*relations, *more), key=len))
        # By drawing, and from random starts.
        branch = self.maker.branch_of(place, every)
        points = np.concatenate(
            [self.maker.find(branch, _POINTS, rounds=3), self.maker.thrown(branch, _POINTS)]
        )
        arm = self.geometry.arm
        ratio = ratios(arm, points)
        # sigma_r / sigma_1 of points on a set that are singular, or not; between, they do not
        # count.
        singular, regular = points[ratio <= 1e-8], points[ratio >= 1e-5]
        if not len(singular) and not len(regular):
            self.open_ends["unseen"] += 1
            self.unseen.append(Component(dict(place), every, False, codimension))
            return
        if len(singular) and (len(regular) or more):
            # What is singular may be smaller than the rest: then it is found inside.
            # Singular points at which the size of a set is asked.
            some = singular[:: max(1, len(singular) // 10)]
            singular = some[[self.n - freedom(branch, q) <= codimension for q in some]]
        met = [
            [RealPoint(self.maker, *at) for at in zip(q, task_jacobians(arm, q), strict=True)]
            for q in (singular, regular)
        ]
        self._told(place, relations, more, met[0], met[1], rounds)

    def _told(
        self,
        place: Places,
        relations: Relations,
        more: Relations,
        singular: MetPoints,
        regular: MetPoints,
        rounds: int,
    ) -> None:
        """Go on with what points of equations, and of more of them, tell."""
        every = tuple(sorted((*relations, *more), key=len))
        codimension = len(place) + len(relations)
        if regular and codimension < self.limit and not more:
            # What else is singular there is smaller, and lies where one minor more is zero.
            minors = cutting(self._minors, self._columns(place), place, regular, 1)
            self.open_ends["uncut"] += not minors
            for f in self.ring.factors(minors[0], self.time) if minors else ():
                self._where(place, [f], lambda fs: self._judge(place, (*relations, *fs)))
        if singular and regular:
            # Parts of one size, which some minors more tell apart, unless these are long.
            # Times that regular parts are told apart by some equations more.
            told = self._telling(place, every, regular) if rounds < 2 else ()
            if told:
                factors = [self.ring.factors(t, self.time) for t in told]
                # Combinations of factors of these that are judged one by one.
                if math.prod(map(len, factors)) > 16:
                    self._judge(place, relations, (*more, *told), rounds + 1)
                    return
                for some in itertools.product(*factors):
                    self._where(
                        place,
                        some,
                        lambda fs: self._judge(place, relations, (*more, *fs), rounds + 1),
                    )
                return
        if singular:
            self._add(place, every, codimension, singular)

    def _where(
        self, place: Places, some: Sequence[Poly], judge: Callable[[Relations], None]
    ) -> None:
        """Go on where irreducible equations are zero, too: at a joint value, or as is judged."""
        if fixed := next((v for f in some if (v := self.ring.joint_value(f))), None):
            self._push({**place, fixed[0]: fixed[1]})
        else:
            judge(tuple({str(f): f for f in some}.values()))

    def _telling(self, place: Places, relations: Relations, regular: MetPoints) -> Relations:
        """Minors that are zero where all are, and not at regular points; none if these are long."""
        # Terms of equations to which others are added that tell regular parts apart, and of these.
        if max(len(r) for r in relations) > 200:
            return ()
        known = set(map(str, relations))
        minors = cutting(self._minors, self._columns(place), place, regular, self.n)
        told = {str(m): m for m in minors if len(m) <= 400}
        return tuple(m for name, m in told.items() if name not in known)

    # What was found -------------------------------------------------------------------

    def _covered(self, place: Places, relations: Relations = ()) -> bool:
        """Return True if a set is part of a component, as far as substitution and division tell."""
        here = Component(place, relations, False, len(place) + len(relations))
        return any(inside(here, c, self.ring) for c, _ in self._found)

    def _add(
        self, place: Places, relations: Relations, codimension: int, points: MetPoints
    ) -> None:
        found = Component(dict(place), tuple(sorted(relations, key=len)), False, codimension)
        self._found.append((found, points))
