"""The search for the components of a chain's singular set: an ordered list of steps.

Planar chain: all axes that turn are parallel; the links in line say all.
All minors: branch on the factors of all minors of the Jacobian. What ends is complete.
Near minors: minors of neighbouring axes, which are short however long the chain is.
Slices: singular points over small fields lead to what is missing, and count that nothing is.
All minors again: with the time that is left, where slices contradict what is known.

Each step states when it applies, what it yields and what that relies on. The search takes the
steps in this order until one of them closes it: all that is singular is known then, or nothing
more can be found in the time. Shares of the time stand in the steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, RandomSteps, merged, together
from pinsing.algebra.decompose import Decomposition
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.ring import Value
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.long_chain import LongChain, gaps
from pinsing.families.pieces import PieceMaker
from pinsing.families.planar_chain import planar_chain, turn_alike
from pinsing.families.real_control import OwnPoints, RandomSingular, gap, on_none, real_points
from pinsing.families.slice_count import SliceCount
from pinsing.families.slice_search import SliceSearch
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import Nominal

MAX_JOINTS = 12
"""Beyond it all minors need more memory than there is before they can be stopped."""
_MANY = 9
"""Joints from which on all minors have a part of the time, and near ones and slices the rest."""
_FEW = 6
"""Joints up to which all minors are the only step: they end, and slices would be of all joints."""


class ComponentSearch:
    """A search, and what its steps found.

    Parameters
    ----------
    geometry : Nominal
        The exact chain.
    arm : Arm
        What it was made of.
    rank : int
        Singular means: rank below this.
    symbols : sequence of str
        Of the joints.
    time : Budget
        For all steps.
    angle_tol : float
        Tolerance that the exact chain was made with.

    Attributes
    ----------
    ring : Ring
        Of the components' polynomials.
    components : list of Component
        Where the rank drops.
    gaps : list of str
        Why these may not be all.
    maker : PieceMaker
        For points and equations of them.
    random : RandomSteps
        What rests on random points.
    count : SliceCount or None
        Singular points on random slices, held against the components.
    steps : list of str
        Names of the steps that were taken.
    """

    def __init__(
        self,
        geometry: Nominal,
        arm: Arm,
        rank: int,
        symbols: Sequence[str],
        time: Budget,
        angle_tol: float,
    ) -> None:
        self.geometry, self.arm, self.task, self.rank = geometry, arm, arm.task, rank
        self.time, self._symbols, self._angle_tol = time, symbols, angle_tol
        slides = tuple(bool(p) for p in arm.prismatic)
        # Families are described after the search, in the same ring: polynomials with square roots
        # may take more time than the search.
        self.ring = ring_of(slides, constants(geometry, arm.task), time.part(1.0, 1.2))
        self.maker = self.new_maker()
        self.components: list[Component] = []
        self.gaps: list[str] = []
        self.random = RandomSteps(0, (), ())
        self.count: SliceCount | None = None
        self.steps: list[str] = []
        self.closed = False
        self.first: Budget | None = None
        """What all minors had."""
        self.chain: LongChain | None = None
        """What near minors told."""

    def run(self) -> ComponentSearch:
        """Take the steps in their order until one closes the search."""
        for step in STEPS:
            if not self.closed and step.applies(self):
                self.steps.append(step.name)
                step.take(self)
        return self

    @property
    def slices(self) -> bool:
        """Whether slices can lead on: each joint moves on its own, and all rows count."""
        full = self.rank == len(self.task.rows)
        known = _FEW <= self.arm.n <= MAX_JOINTS and self.arm.coupling is None
        return known and full and self.arm.n > self.rank

    def rest(self, share: float) -> Budget:
        """A share of the time that is left, a tenth of the whole at least."""
        return self.time.part(share, 0.1)

    def new_maker(self) -> PieceMaker:
        """For points and equations of components, from the same random numbers each time."""
        given = self.geometry, self.ring, self.rank, self._symbols
        return PieceMaker(*given, 20, self.time, self._angle_tol)

    def all_minors(self, time: Budget) -> Decomposition:
        """The components by all minors, as far as the time goes."""
        return Decomposition(
            lambda: jacobian_matrix(self.geometry, self.ring, self.task, time),
            self.rank, self.ring, time,
        )  # fmt: skip


class SearchStep(Protocol):
    """What a step answers."""

    name: str

    def applies(self, s: ComponentSearch) -> bool:
        """Whether it has something to add."""

    def take(self, s: ComponentSearch) -> None:
        """Add components, gaps and what these rest on; close the search where nothing is left."""


class PlanarChainStep:
    """Yields the one component of a planar chain; relies on nothing but its exact axes.

    With fewer joints all minors state the branches of each condition, which long chains have too
    many of.
    """

    name = "planar chain"

    def applies(self, s: ComponentSearch) -> bool:
        """Of long chains whose axes are parallel."""
        return s.arm.n >= _FEW and s.arm.coupling is None and turn_alike(s.geometry)

    def take(self, s: ComponentSearch) -> None:
        """Close the search if the task counts in the plane."""
        found = planar_chain(s.geometry, s.task, s.rank, s.ring)
        if found is not None:
            s.components, s.closed = list(found), True
            s.maker.products = True


class AllMinorsStep:
    """Yields all components; relies on division, and on random points of systems of equations."""

    name = "all minors"

    def applies(self, s: ComponentSearch) -> bool:
        """Of chains of which all minors fit in memory."""
        return s.arm.n <= MAX_JOINTS

    def take(self, s: ComponentSearch) -> None:
        """Close the search if they end, or nothing else would find more."""
        s.first = s.time.part(self._share(s))
        found = s.all_minors(s.first)
        s.components, s.random = list(found.components), found.second
        s.gaps = list(dict.fromkeys(found.gaps))
        more = s.arm.n >= _MANY or s.slices or not s.components
        s.closed = not (found.gaps and more)

    @staticmethod
    def _share(s: ComponentSearch) -> float:
        """Share of the time: where all minors end they tell more sets apart than other steps."""
        if s.arm.n >= _MANY:
            return 0.1  # few end
        if not s.slices:
            return 0.8 if s.arm.n > s.rank else 1.0
        if s.task.name == "pose":
            return 0.6  # most end
        return min(0.5, 20.0 / s.time.seconds)  # few rows leave motions free: slices take a few


class NearMinorsStep:
    """Yields components by short minors; relies on points modulo primes, and on real ones.

    Nothing says that there are no others: so it leaves gaps.
    """

    name = "near minors"

    def applies(self, s: ComponentSearch) -> bool:
        """Where all minors did not end."""
        return True

    def take(self, s: ComponentSearch) -> None:
        """Add what is new, and drop what lies in it."""
        share = 0.7  # where no slices follow
        if s.slices:  # larger ones of ten joints and more
            share = 0.4 if s.arm.n <= _MANY else 0.25
        s.maker.time = time = s.rest(share)
        try:
            s.chain = LongChain(s.geometry, s.task, s.rank, s.ring, s.maker, time)
        except BudgetExceeded as reason:
            s.gaps.append(str(reason))
            return
        s.components = merged(s.components, s.chain.components, s.ring)
        s.gaps += gaps(s.chain.open_ends, s.arm.n)
        s.maker.confirm = None if s.slices else OwnPoints(s.geometry.arm)


class SlicesStep:
    """Yields components at joint values that singular points over small fields lead to.

    Relies on a count: how many of the known components such slices met, and how many real singular
    points from random starts lie on them.
    """

    name = "slices"

    def applies(self, s: ComponentSearch) -> bool:
        """Where near minors ran, and slices can lead on."""
        return s.slices and s.chain is not None

    def take(self, s: ComponentSearch) -> None:
        """Drop the gaps if slices were gone through often enough, unless a real point is off."""
        assert s.chain is not None
        own = OwnPoints(s.geometry.arm)

        def near(values: Mapping[int, Value], time: Budget) -> Sequence[Component]:
            s.maker.time = time
            given = s.geometry, s.task, s.rank, s.ring, s.maker, time, values
            return LongChain(*given, thorough=False).components

        near_at = near if s.arm.n > _MANY else None  # of nine joints all minors take seconds there
        # No random starts are made after a tenth of the time that is left.
        real = RandomSingular(s.maker, real_points(s.maker, own, s.rest(0.1)))
        # Of many joints families take long to describe: that has the rest of the time.
        time, largest = s.rest(0.7), s.arm.n - s.rank + 1
        given = s.geometry, s.task, s.ring, s.components, largest, time
        found = SliceSearch(*given, s.chain.unseen, near_at, real)
        found.run()
        s.components, s.count = found.components, found.count
        s.gaps = [] if found.enough else s.gaps
        s.random = together([s.random, *found.steps] if s.gaps else found.steps)
        missed = on_none(s.maker, real.q, s.components)
        s.closed = found.enough and not missed.any()
        if s.count is not None:
            s.gaps = gap(real.q, missed, s.arm.prismatic) + s.gaps
            s.count = replace(s.count, real=len(real.q), real_off=int(missed.sum()))
        s.maker.confirm = own


class AllMinorsAgainStep:
    """Yields all components, as all minors do, with more time."""

    name = "all minors again"

    def applies(self, s: ComponentSearch) -> bool:
        """Where slices contradict what is known, and much more time is left than minors had."""
        if s.arm.n != _MANY or s.first is None or "slices" not in s.steps:
            return False
        return s.time.part(0.8).seconds > 2.0 * s.first.seconds

    def take(self, s: ComponentSearch) -> None:
        """Take what they find for all that was known, if they end."""
        found = s.all_minors(s.time.part(0.8))
        if not found.gaps:
            s.components, s.gaps, s.random = list(found.components), [], found.second
            s.count, s.maker, s.closed = None, s.new_maker(), True


STEPS: tuple[SearchStep, ...] = (
    PlanarChainStep(),
    AllMinorsStep(),
    NearMinorsStep(),
    SlicesStep(),
    AllMinorsAgainStep(),
)
