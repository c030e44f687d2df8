"""What a search by neighbours misses, found where singular points on random slices lie.

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

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, RandomSteps, merged, on_any, settled
from pinsing.algebra.decompose import Decomposition, Within
from pinsing.algebra.generic_points import Residues, slice_points
from pinsing.algebra.jacobian_matrix import jacobian_matrix
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.zeros import Undecided
from pinsing.families.modular_chain import at_value, value_modulo
from pinsing.families.nearness import BLUNT, OwnPoints
from pinsing.families.pieces import PieceMaker
from pinsing.families.slice_count import NEEDED, Slice, SliceCount, Slices
from pinsing.families.zero_set import residuals
from pinsing.robot.nominal import Nominal
from pinsing.robot.task import Task


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
        box, n = (maker.lower, maker.upper), len(maker.symbols)
        found = []
        for _ in range(4):
            # Random starts at once.
            starts = rng.uniform(*box, (100, n))
            found.append(own.drawn(starts, np.ones(n, dtype=bool), box))
            # Work of a batch of starts, in products of terms.
            if time.stop(1e6):
                break
        return cls(maker, np.concatenate(found))

    def off(self, components: Sequence[Component]) -> Bool:
        """Return which of them are clearly on none of some components: (k,)."""
        left = np.ones(len(self.q), dtype=bool)
        for c in components:
            q = self.q[left]
            if not len(q):
                break
            branch = self.maker.branch_of(c.values, c.relations)
            off = np.zeros(len(q))
            for v in branch.values:
                off = np.maximum(off, self.maker.away(q, v))
            if branch.equations:
                off = np.maximum(off, np.abs(residuals(branch.equations, q)).max(axis=-1))
            left[left] = off > BLUNT
        return left

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
        self.kept: dict[int, list[Slice]] = defaultdict(list)
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
            self.kept[prime] += new
            if len(new) == len(self.slices.choices):
                self._turns[prime] += 1
            if self._follow(new):  # what no value explains
                self._open.add(prime)
                self._turns.pop(prime, None)
                fields.remove(prime)
        self._follow_real()
        clean = [p for p in self.kept if p not in self._open]
        counted = [s for p in (clean or self.kept) for s in self.kept[p]]
        if not counted or (self._open and not clean and len(self._open) < NEEDED):
            return
        unmet = [c for c in self.components if not any(map(np.any, self.slices.held(counted, c)))]
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

    def _follow(self, slices: Sequence[Slice]) -> bool:
        """Search where points on no family lead to; whether some are left."""
        off = self._taken_in(self._left(slices))
        in_vain = 0
        while off and not self.time.stop():
            at = self._next(off)
            # Searches of many joints after which another field is asked: one alone may be
            # misleading.
            if at is None or (self.near is not None and in_vain == 2):
                return True
            self._tried.add(at)
            before = len(self.components)
            self._search(dict([at]))
            in_vain += 1
            if len(self.components) != before:
                off, in_vain = self._left(off), 0
        return bool(off)

    def _follow_real(self) -> None:
        """Search at the joint values of real points on no family, the most frequent first."""
        if self.real is None or self.time.over:
            return
        off = self.real.q[self.real.off(self.components)]
        while len(off) and not self.time.stop():
            if (at := self._next_real(off)) is None:
                return
            self._tried.add(at)
            before = self.components
            self._search(dict([at]))
            if self.components != before:
                off = self.real.q[self.real.off(self.components)]

    def _next_real(self, off: Array) -> At | None:
        """The value of a joint that most of some real points share, of those not tried."""
        assert self.real is not None
        shared = {
            (j, value): count
            for j, values in self._values().items()
            for value in values
            if (j, value) not in self._tried and (count := self._at(off, j, value))
        }
        return max(shared, key=lambda at: shared[at], default=None)

    def _at(self, q: Array, joint: int, value: Value) -> int:
        """Return how many of some configurations (m, n) have a joint at a value."""
        assert self.real is not None
        maker = self.real.maker
        held = maker.branch_of({joint: value}, ()).values[0]
        return int((maker.away(q, held) < BLUNT).sum())

    def _taken_in(self, off: list[Slice]) -> list[Slice]:
        """Return what is left of points when systems that have some of them are components, too."""
        while off and self._unseen and not self.time.stop():
            has = [sum(int(m.sum()) for m in self.slices.held(off, c)) for c in self._unseen]
            best = max(range(len(has)), key=lambda i: (has[i], self._unseen[i].codimension))
            if not has[best]:
                break
            c = self._unseen.pop(best)
            on = max(off, key=lambda s: int(self.slices.held([s], c)[0].sum()))
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

    def _left(self, slices: Sequence[Slice]) -> list[Slice]:
        """The points of slices that are on no family, where there are some."""
        for c in self.components:  # together, which takes less
            self.slices.held(slices, c)
        masks = [self.slices.off(s, self.components) for s in slices]
        return [s.at(m) for s, m in zip(slices, masks, strict=True) if m.any()]

    def _next(self, off: Sequence[Slice]) -> At | None:
        """The value of a joint that most of some points share, of those not tried."""
        special = self._values()
        shared: Counter[At] = Counter()
        of, at_one = Counter[int](), Counter[int]()
        for s in off:
            for j in s.chosen:
                of[j] += s.x.shape[1]
                for value in special[j]:
                    on = at_value(s.x[j], s.y[j], value_modulo(value, s.prime), s.prime)
                    at_one[j] += int(on.sum())
                    if (j, value) not in self._tried:
                        shared[j, value] += int(on.sum())

        def telling(at: At) -> tuple[float, int]:
            """Return the joint at whose values all missing points are, first."""
            return at_one[at[0]] / (of[at[0]] + 1), shared[at]

        return max(+shared, key=telling, default=None)

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
