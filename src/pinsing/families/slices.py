"""Singular configurations on random slices, over small finite fields, held against the families.

All joints but a few are put at random values of a field, and the few at all of its values: a
slice. Each singular configuration on it must lie on a family. A family of codimension k has about
one point on a slice of k joints, for some choice of k joints: so many slices are gone through, over
several fields, and how seldom a family that is known was met says how likely one was missed.

Short equations of neighbouring axes tell the large families of a long chain. Smaller ones, on which
several groups of axes are special at once, are no factors of them. But they have points on random
slices over small fields, and in these points some joint is at a value that occurs in a factor of a
minor: 0, 90 or 180 degrees, or where an axis passes through a wrist. At that value the search by
all minors takes seconds, where in general it would take hours.

Slices are gone through until nothing new turns up over several fields. A component that has points
over none of these may have real ones: those on no family lead on in the same way. A component whose
joint values are roots of an equation has points over the fields only that have these roots; over
the real numbers random starts meet it where it has real points at all.
"""

from __future__ import annotations

import random
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations
from typing import TypeVar

import numpy as np
from flint import fmpz

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, RandomSteps, merged, on_any, settled
from pinsing.algebra.conditions import Branch
from pinsing.algebra.decompose import Decomposition, Within
from pinsing.algebra.generic_points import Residues, Undecided, slice_points
from pinsing.algebra.jacobian_matrix import jacobian_matrix
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.families.modular_chain import (
    ModularChain,
    ModularRows,
    ModularSet,
    at_value,
    joints_that_matter,
    short_everywhere,
    value_modulo,
)
from pinsing.families.pieces import PieceMaker
from pinsing.families.proof_forms import roots_in
from pinsing.families.zero_set import BLUNT, OwnPoints, SearchBox
from pinsing.measures import Array, Bool, Ints
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import root_modulo
from pinsing.robot.task import Task

FIELDS = tuple(p for p in range(7, 48) if fmpz(p).is_prime())
"""Primes: one may divide what must not vanish, such as a sum of lengths: what it alone contradicts
may be its own doing. Families whose joint values are roots have points over some of them only."""
ASKED = 23, 47
"""Where slices are gone through once: the second where the first contradicts."""
SEED = 31
MOST_JOINTS = 4
"""Joints of a slice of a chain of which no more is asked: one more is some 20 times the work."""
NEEDED = 3
"""Fields over which no point may be left over, where nothing contradicts."""
_FEW_JOINTS = 3
"""Slices of so few joints are small: in larger fields less is special by chance."""


@dataclass(frozen=True)
class SliceCount:
    """What was counted.

    Attributes
    ----------
    joints : int
        That vary on each slice: sets of no larger codimension are met.
    slices, choices : int
        How many slices were gone through, and how many choices of so many joints there are.
    points : int
        Singular configurations on them that were held against the families.
    off : int
        Those that lie on none: something is missing unless it is 0.
    prime, seed : int
        The field, and what the slices were drawn from.
    primes : tuple of int
        All fields, where there are several.
    known, met : int
        How many components the families have, and how many of them were met on some slice: the
        others have no points over these fields, or were missed as one that is not known may be.
    real, real_off : int
        Singular configurations over the real numbers that random starts led to, and those of them
        that lie on none: families whose joint values are roots may have no points over the fields.
    """

    joints: int
    slices: int
    choices: int
    points: int
    off: int
    prime: int
    seed: int
    primes: tuple[int, ...] = field(default=(), metadata={"optional": True})
    known: int = field(default=0, metadata={"optional": True})
    met: int = field(default=0, metadata={"optional": True})
    real: int = field(default=0, metadata={"optional": True})
    real_off: int = field(default=0, metadata={"optional": True})

    def evidence(self) -> str:
        """The same, said to be no proof, or where nothing was met no evidence."""
        return f"{'evidence, no proof' if self.points else 'no evidence'}: {self.sentence()}"

    def sentence(self) -> str:
        """Return what it says, in words."""
        slices = "one random slice" if self.slices == 1 else f"{self.slices} random slices"
        where = (
            f"on {slices} of {self.joints} joints ({self.choices} choices of joints) over the "
            f"{self._fields()} elements (seed {self.seed})"
        )
        if not self.points:
            return f"no singular point was met {where}"
        if self.off:
            lie = "lies" if self.off == 1 else "lie"
            return f"{self.off} of {self.points:,} singular points {where} {lie} on no family"
        said = f"all {self.points:,} singular points {where} lie on the families"
        if self.known:
            said += f", {self.met} of whose {self.known} components were met"
        if self.real and not self.real_off:
            said += f", and so do {self.real} real ones found from random starts"
        return said

    def _fields(self) -> str:
        if len(self.primes) < 2:
            return f"field of {self.prime}"
        *first, last = self.primes
        return f"fields of {', '.join(map(str, first))} and {last}"


@dataclass(frozen=True, eq=False)
class SlicePoints:
    """Singular points of slices over one field, one slice for each choice of joints."""

    prime: int
    slices: int  # how many there were
    chosen: Ints  # (N, k): the joints that vary on the slice of each point
    # x and y: (n, N): the points, in half-angle coordinates; of a slider its length and 0
    x: Ints
    y: Ints

    def at(self, points: Bool | Sequence[int]) -> SlicePoints:
        """Some of the points."""
        some = self.chosen[points], self.x[:, points], self.y[:, points]
        return SlicePoints(self.prime, self.slices, *some)

    def __len__(self) -> int:
        return len(self.chosen)


class Slices:
    """Random slices, of so many ``joints``, of a chain without mimics and with independent rows."""

    def __init__(self, geometry: Nominal, task: Task, ring: Ring, joints: int) -> None:
        self.geometry, self.task, self.ring = geometry, task, ring
        n = len(geometry.prismatic)
        # The first and the last joint move all axes of a pose, or none.
        inner = range(1, n - 1) if task.name == "pose" else joints_that_matter(geometry, task)
        self.joints = min(joints, len(inner))
        self._draw = random.Random(SEED)
        self.choices = list(combinations(inner, self.joints))
        self._draw.shuffle(self.choices)
        self._chains: dict[int, ModularChain] = {}
        # What was made of components, which are kept, so that their ids stay their own.
        self._sets: dict[tuple[int, int], tuple[Component, ModularSet]] = {}
        self._held: dict[tuple[int, int], tuple[SlicePoints, Bool]] = {}

    @property
    def fields(self) -> tuple[int, ...]:
        """Those over which a slice is not too large."""
        # Slices of so few joints are small: in larger fields less is special by chance.
        few = self.joints <= _FEW_JOINTS
        known = [p for p in FIELDS if (p >= 17 or not few) and _has_roots(self.geometry, p)]
        # Of one slice: beyond the first number it is gone through only where few fields are as
        # small.
        small, larger = (
            tuple(p for p in known if (p + 1) ** self.joints <= most)
            for most in (350_000, 3_500_000)
        )
        chosen = small if len(small) >= NEEDED else larger
        lengths = [Fraction(x) for row in self.geometry.translation for x in row if x != 0]
        whole = tuple(p for p in chosen if all(x.numerator * x.denominator % p for x in lengths))
        return whole if few and len(whole) >= NEEDED else chosen

    def turn(self, prime: int, time: Budget) -> SlicePoints:
        """Return points of one slice for each choice of joints, as many as there is time for."""
        # ValueError if the prime divides a denominator of the chain, or a length its rank needs.
        if prime not in self._chains:
            pose = self.task.name == "pose"
            chain = (
                ModularChain(self.geometry, prime)
                if pose
                else ModularRows(self.geometry, self.task, prime)
            )
            if short_everywhere(chain, self.geometry, self.task):
                raise ValueError(f"modulo {prime} all configurations are singular")
            self._chains[prime] = chain
        nothing = np.zeros((len(self.geometry.prismatic), 0), dtype=np.int64)
        found = [(np.zeros((0, self.joints), dtype=np.int64), nothing, nothing)]
        for chosen in self.choices:
            # Work that each point of a slice is asked with, in products of terms.
            if time.stop(3.0 * prime ** len(chosen)):
                break
            x, y = self._chains[prime].singular(chosen, self._draw)
            found.append((np.tile(chosen, (x.shape[1], 1)), x, y))
        of, *sides = zip(*found, strict=True)
        x, y = (np.concatenate(side, axis=1) for side in sides)
        return SlicePoints(prime, len(found) - 1, np.concatenate(of), x, y)

    def left(self, points: SlicePoints, components: Sequence[Component]) -> SlicePoints:
        """Those of some points that lie on none of some components."""
        return points.at(np.asarray(~self.on(points, components).any(axis=0)))

    def on(self, points: SlicePoints, components: Sequence[Component]) -> Bool:
        """Which points (N) lie on each of some components: (C, N)."""
        every = [self.held(points, c) for c in components]
        return np.array(every, dtype=bool).reshape(len(components), len(points))

    def held(self, points: SlicePoints, component: Component) -> Bool:
        """Return which points lie on a component, computed once."""
        key = id(points), id(component)
        if key not in self._held:
            holds = self._modular(component, points.prime).holds(points.x, points.y)
            self._held[key] = points, holds
        return self._held[key][1]

    def regular_too(self, on: SlicePoints, component: Component) -> bool:
        """Return True if a component has points on a slice, some singular, that are regular."""
        chain = self._chains[on.prime]
        x, y = (np.repeat(a[:, :1], 1, axis=1) for a in (on.x, on.y))
        for j in on.chosen[0]:
            every = chain.every(j)
            count = len(every[0])
            x, y = (np.repeat(a, count, axis=1) for a in (x, y))
            for a, values in zip((x, y), every, strict=True):
                a[j] = np.tile(values, a.shape[1] // count)
        singular = self.held(on, component).sum()
        return bool(self._modular(component, on.prime).holds(x, y).sum() > singular)

    def without_parts(
        self,
        points: Sequence[SlicePoints],
        components: Sequence[Component],
        off: Callable[[list[Component]], Bool] | None = None,
    ) -> list[Component]:
        """Return components but for those of whose points, which are many, one other has all."""
        # Two searches state one set in two ways: the shorter is kept. Values that differ may agree
        # over one small field: points over two must say it, and real ones, of those ``off`` tells.
        left = sorted(components, key=lambda c: (c.codimension, sum(map(len, c.relations))))
        for c in reversed(tuple(left)):
            # Points of one field, and such fields, that a component must have been met at to be
            # told from others by them.
            met = Counter[int]()
            for p in points:
                met[p.prime] += int(self.held(p, c).sum())
            if sum(count >= 12 for count in met.values()) < 2:
                continue
            for k in left:
                if k is c or any((self.held(p, c) & ~self.held(p, k)).any() for p in points):
                    continue
                if off is None or not (~off([c]) & off([k])).any():
                    left = [x for x in left if x is not c]
                    break
        return [c for c in components if any(c is k for k in left)]

    def count(self, points: Sequence[SlicePoints], components: Sequence[Component]) -> SliceCount:
        """Hold the points of slices against components."""
        on = [self.on(p, components) for p in points]
        met = np.any([m.any(axis=1) for m in on], axis=0) if on else np.zeros(0)
        primes = tuple(dict.fromkeys(p.prime for p in points if p.slices))
        return SliceCount(
            self.joints,
            sum(p.slices for p in points),
            len(self.choices),
            sum(map(len, points)),
            sum(int((~m.any(axis=0)).sum()) for m in on),
            primes[0] if primes else FIELDS[0],
            SEED,
            primes if len(primes) > 1 else (),
            len(components),
            int(met.sum()),
        )

    def _modular(self, component: Component, prime: int) -> ModularSet:
        key = (id(component), prime)
        if key not in self._sets:
            self._sets[key] = component, ModularSet(component, self.ring, prime)
        return self._sets[key][1]


def _has_roots(geometry: Nominal, prime: int) -> bool:
    """Return True if the square roots of a chain are numbers modulo a prime."""
    try:
        return all(root_modulo(square, prime) for square in roots_in(geometry))
    except ValueError:
        return False


def count_on_slices(
    geometry: Nominal,
    task: Task,
    ring: Ring,
    components: Sequence[Component],
    most: int,
    time: Budget,
) -> SliceCount | None:
    """Count singular points of a chain on slices, within a time; no mimics, independent rows.

    ``most``: the largest codimension of a component. None where the field does not know the chain's
    numbers (denominators, roots), or one field contradicts and there is no time to ask the other.
    """
    counted: list[SliceCount] = []
    for prime in ASKED:
        slices = Slices(geometry, task, ring, min(most, MOST_JOINTS))
        try:
            again = slices.count([slices.turn(prime, time)], components)
        except ValueError:  # a denominator that the prime divides
            continue
        if again.slices:
            counted.append(again)
        if not again.off:
            return counted[-1] if counted and not counted[-1].off else None
    # What one field alone contradicts may be its own doing: then nothing is said.
    return counted[-1] if len(counted) == len(ASKED) else None


def without_inner(
    components: Sequence[Component], doubtful: Sequence[Component], ring: Ring, time: Budget
) -> list[Component]:
    """Return components without ``doubtful`` ones whose points all lie on others that are left."""
    # Points of random slices modulo a prime of 62 bits decide; what is undecided in time stays.
    left = list(components)
    residues, rng = Residues(ring), np.random.default_rng(43)
    for c in sorted(doubtful, key=lambda c: -c.codimension):
        # Terms of a component's relations up to which its points are looked for: others are no
        # pieces.
        if not c.relations or sum(map(len, c.relations)) > 200:
            continue
        others = [k for k in left if k is not c]
        count = c.codimension - len(c.values)
        try:
            found = slice_points(c.relations, residues, rng, c.values, time.check, count)
            points = [on_any(others, s) for s in found]
        except (BudgetExceeded, Undecided):
            continue
        if points and all(points):
            left = others
    return left


@dataclass(frozen=True, eq=False)
class RandomSingular:
    """Singular configurations that random starts led to."""

    maker: PieceMaker  # of the chain
    q: Array  # (k, n): the configurations

    @classmethod
    def of(cls, maker: PieceMaker, time: Budget) -> RandomSingular:
        """Those that random starts over whole circles lead to."""
        own, rng = OwnPoints(maker.geometry.arm), np.random.default_rng(37)
        box = SearchBox.of(Branch((), ()), maker.lower, maker.upper)
        found = []
        for _ in range(4):
            # Random starts at once.
            found.append(own.drawn(100, box, rng))
            # Work of a batch of starts, in products of terms.
            if time.stop(1e6):
                break
        return cls(maker, np.concatenate(found))

    def off(self, components: Sequence[Component]) -> Bool:
        """Return which of them are clearly on none of some components: (k,)."""
        left = np.arange(len(self.q))
        for c in components:
            left = left[self.maker.off(self.q[left], c.values, c.relations) > BLUNT]
        return np.isin(np.arange(len(self.q)), left)

    def gap(self, missed: Bool) -> list[str]:
        """Return what missed ones say, with one of them; nothing where none was missed."""
        if not missed.any():
            return []
        q = self.q[int(np.argmax(missed))]
        turned = np.remainder(q + np.pi, 2 * np.pi) - np.pi
        shown = ", ".join(f"{x:.4g}" for x in np.where(self.maker.ring.prismatic, q, turned))
        return [
            f"{int(missed.sum())} of {len(self.q)} singular configurations that random starts led "
            f"to lie on no family, such as q = {shown}: something is missing"
        ]


_FOR_VALUES = 0.1
"""Share of the time that minors have which say at what values of joints axes are special."""

At = tuple[int, Value]
Near = Callable[[Mapping[int, Value], Budget], Sequence[Component]]
Points = TypeVar("Points", SlicePoints, Array)


class SliceSearch:
    """Goes through slices, and searches at joint values to which points on no family lead.

    The chain is as of ``Slices``; ``limit`` is the largest codimension of a component. ``unseen``
    are components if they have points that lie on no other. ``near`` is a search by neighbours,
    asked before all minors are. ``real`` configurations on no component lead on when slices no
    longer do. ``count``: slices against ``components``, without a field that alone contradicts.
    ``enough``: times, and fields, after which nothing is open. ``steps``: what else rests on
    random points.
    """

    def __init__(
        self,
        geometry: Nominal,
        task: Task,
        ring: Ring,
        components: Sequence[Component],
        limit: int,
        time: Budget,
        unseen: Sequence[Component] = (),
        near: Near | None = None,
        real: RandomSingular | None = None,
    ) -> None:
        self.near, self.real = near, real
        self.geometry, self.task, self.ring = geometry, task, ring
        self.components, self.limit, self.time = list(components), limit, time
        self.slices = Slices(geometry, task, ring, limit)
        self.steps: list[RandomSteps] = []
        self.count: SliceCount | None = None
        self.enough = False
        self._unseen = list(unseen)
        self.kept: dict[int, list[SlicePoints]] = defaultdict(list)
        self._turns: Counter[int] = Counter()
        self._open: set[int] = set()
        self._tried: set[At] = set()
        self._special: dict[int, list[Value]] = {}
        self._matrix: Matrix | None = None

    def run(self) -> None:
        """Go through slices until nothing new turns up, or the time is over."""
        fields = list(self.slices.fields)
        while not self.time.stop() and not self._done():
            if len(fields) < NEEDED + len(self._open):
                break  # so many contradict that too few are left to say otherwise
            # Times that a field is asked before a larger one.
            prime = min(fields, key=lambda p: (self._turns[p] // 2, p))
            try:
                new = self.slices.turn(prime, self.time)
            except ValueError:  # a denominator that the prime divides
                fields.remove(prime)
                continue
            self.kept[prime].append(new)
            if new.slices == len(self.slices.choices):
                self._turns[prime] += 1
            off = self._taken_in(self._left(new))
            # Searches of many joints after which another field is asked: one alone may be
            # misleading.
            most = None if self.near is None else 2
            if self._follow(off, self._next, self._left, most):  # what no value explains
                self._open.add(prime)
                self._turns.pop(prime, None)
                fields.remove(prime)
        if self.real is not None and not self.time.over:
            self._follow(self._real_left(), self._next_real, lambda off: self._real_left())
        clean = [p for p in self.kept if p not in self._open]
        counted = [s for p in (clean or self.kept) for s in self.kept[p]]
        if not sum(s.slices for s in counted) or (
            self._open and not clean and len(self._open) < NEEDED
        ):
            return
        unmet = [
            c for c in self.components if not any(self.slices.held(p, c).any() for p in counted)
        ]
        # Share of the time for whether components that were not met are parts of others.
        time = self.time.part(1.0, 0.03)
        self.components = without_inner(self.components, unmet, self.ring, time)
        self.components = self.slices.without_parts(
            counted, self.components, None if self.real is None else self.real.off
        )
        self.count = count = self.slices.count(counted, self.components)
        # Share of the components that must have been met: of those not known, as many may have
        # been.
        self.enough = self._enough() and not count.off and count.met >= 0.8 * count.known

    def _done(self) -> bool:
        """Return True if slices were gone through often enough."""
        if not self._enough():
            return False
        count = self.slices.count([s for p in self._turns for s in self.kept[p]], self.components)
        # Times that all slices are gone through, each time over another field or with other values:
        # up to the second number while one of the components was met on none.
        return count.met == count.known or sum(self._turns.values()) >= 7

    def _enough(self) -> bool:
        """Return True if slices were gone through as often as must be, over as many fields."""
        # Times that all slices are gone through, each time over another field or with other values:
        # up to the second number while one of the components was met on none.
        return sum(self._turns.values()) >= 5 and len(+self._turns) >= NEEDED + len(self._open)

    def _follow(
        self,
        off: Points,
        following: Callable[[Points], At | None],
        left: Callable[[Points], Points],
        most: int | None = None,
    ) -> bool:
        """Search where points on no family lead to, ``most`` in vain; whether some are left."""
        in_vain = 0
        while len(off) and not self.time.stop():
            at = following(off)
            if at is None or in_vain == most:
                return True
            self._tried.add(at)
            before = self.components
            self._search(dict([at]))
            in_vain += 1
            if self.components != before:
                off, in_vain = left(off), 0
        return len(off) > 0

    def _left(self, off: SlicePoints) -> SlicePoints:
        """Return those of some points that are on no family."""
        return self.slices.left(off, self.components)

    def _real_left(self) -> Array:
        """Return the real points that are on no family."""
        assert self.real is not None
        return self.real.q[self.real.off(self.components)]

    def _next_real(self, off: Array) -> At | None:
        """The value of a joint that most of some real points share, of those not tried."""
        assert self.real is not None
        shared = {
            (j, value): count
            for j, values in self._values().items()
            for value in values
            if (j, value) not in self._tried
            and (count := int((self.real.maker.off(off, {j: value}) < BLUNT).sum()))
        }
        return max(shared, key=lambda at: shared[at], default=None)

    def _taken_in(self, off: SlicePoints) -> SlicePoints:
        """Return what is left of points when systems that have some of them are components, too."""
        while len(off) and self._unseen and not self.time.stop():
            has = self.slices.on(off, self._unseen).sum(axis=1).tolist()
            best = max(range(len(has)), key=lambda i: (has[i], self._unseen[i].codimension))
            if not has[best]:
                break
            c = self._unseen.pop(best)
            of = map(tuple, off.chosen[self.slices.held(off, c)].tolist())
            ((most, _),) = Counter(of).most_common(1)
            on = off.at((off.chosen == most).all(axis=1))
            if c.codimension < self.limit and self.slices.regular_too(on, c):
                self._unseen += self._cut(c)  # what is singular of it is smaller
            else:
                self.components.append(c)
                off = self._left(off)
        return off

    def _cut(self, c: Component) -> list[Component]:
        """A system with one equation more: each factor of a short minor that is not zero on it."""
        time = self.time.part(_FOR_VALUES)
        rank, n = len(self.task.rows), len(self.ring.prismatic)
        minors = NearMinors(self.geometry, self.ring, self.task, rank, time)
        found: list[list[Poly]] = []
        try:
            for some in sorted(combinations(range(n), rank), key=lambda s: s[-1] - s[0]):
                # Minors that are not zero on a system, among which the shortest cuts it.
                if len(found) >= 3:
                    break
                minor = minors.minor(some, c.values)
                if minor != 0 and not any(self.ring.divides(r, minor) for r in c.relations):
                    found.append(self.ring.factors(minor, time))
        except (BudgetExceeded, NotSquare):
            pass
        shortest = min(found, key=lambda fs: max(map(len, fs), default=0), default=[])
        cuts = (Component(c.values, (*c.relations, f), False, c.codimension + 1) for f in shortest)
        return [settled(cut, self.ring) for cut in cuts]

    def _next(self, off: SlicePoints) -> At | None:
        """The value of a joint that most of some points share, of those not tried."""
        shared: Counter[At] = Counter()
        share: dict[int, float] = {}  # of the points at whose slices a joint varies
        for j, values in self._values().items():
            some = off.at((off.chosen == j).any(axis=1))
            here = Counter(
                {
                    (j, v): int(at_value(some.x[j], some.y[j], value_modulo(v, p), p).sum())
                    for p in [off.prime]
                    for v in values
                }
            )
            share[j] = here.total() / (len(some) + 1)
            shared += Counter({at: count for at, count in here.items() if at not in self._tried})
        # The joint at whose values all missing points are, first.
        return max(shared, key=lambda at: (share[at[0]], shared[at]), default=None)

    def _values(self) -> dict[int, list[Value]]:
        """Values of each joint at which axes are special: quarter turns, and factors of minors."""
        if self._special:
            return self._special
        one, none = Fraction(1), Fraction(0)
        turns: list[Value] = [(one, none), (none, one), (one, one), (one, -one)]
        n = len(self.ring.prismatic)
        found: dict[int, dict[Value, None]] = {
            j: dict.fromkeys([(none,)] if self.ring.prismatic[j] else turns) for j in range(n)
        }
        until = self.time.part(_FOR_VALUES)
        rank = len(self.task.rows)
        for some in sorted(combinations(range(n), rank), key=lambda c: c[-1] - c[0]):
            if until.stop():
                break
            # Seconds that one of them may take.
            one_of = until.at_most(0.2)
            minors = NearMinors(self.geometry, self.ring, self.task, rank, one_of)
            try:
                minor = minors.minor(some, {})
                one_of.check_factor(len(minor))
                factors = self.ring.factors(minor) if minor != 0 else []
            except (BudgetExceeded, NotSquare):
                continue
            for f in factors:
                if (fixed := self.ring.joint_value(f)) is not None:
                    found[fixed[0]][fixed[1]] = None
        self._special = {j: list(values) for j, values in found.items()}
        return self._special

    def _search(self, values: Mapping[int, Value]) -> None:
        """All components at a joint's value, or, if they are new, those that neighbours tell."""
        # Share of what time is left that the search by neighbours at one value may take.
        if self.near is not None and self._add(self.near(values, self.time.part(0.1))):
            return
        # Share of what time is left that the search at one value may take.
        time = self.time.part(0.4)
        try:
            if self._matrix is None:
                self._matrix = jacobian_matrix(self.geometry, self.ring, self.task, self.time)
        except BudgetExceeded:
            return
        put = self.ring.putting(values)
        matrix = [[put(x) for x in row] for row in self._matrix]
        rank = len(self.task.rows)
        within = Within(values, self.limit, self.components)
        found = Decomposition(matrix, rank, self.ring, time, within)
        self.components = found.components
        self.steps.append(found.second)

    def _add(self, found: Sequence[Component]) -> bool:
        """Take components in; whether some lie in none of those that are known."""
        before = self.components
        self.components = merged(before, found, self.ring)
        return self.components != before
