"""The search for the components of a chain's singular set: an ordered list of steps.

Planar chain: all axes that turn are parallel; the links in line say all.
All minors: branch on the factors of all minors of the Jacobian. What ends is complete.
Near minors: minors of neighbouring axes, which are short however long the chain is.
Slices: singular points over small fields lead to what is missing, and count that nothing is.
All minors again: with the time that is left, where slices contradict what is known.

Each step states when it applies, what it yields and what that relies on. The search takes the
steps in this order until one of them closes it: all that is singular is known then, or nothing
more can be found in the time. Shares of the time stand in the steps.

Planar chains of any length: singular where all links are in line.

All axes that turn are parallel, and all that slide are perpendicular to them. Seen along the axes,
joint j moves a point at right angles to the vector from it, so that the differences of neighbouring
columns are the links between them, turned by a right angle. Position is lost where all links up
to the tip and all directions of slides are parallel; position and orientation together where
those between the first and the last turning joint are. What lies between two turning joints has
one direction; each with the next gives one condition, on the sum of the angles between them, and
slides between the same two joints one on their lengths. No joint is in two of these: they are
independent, and nothing else is singular. Where only one direction of the plane counts, all have to
be at right angles to it as well: it is one more link, on the base or on the tip.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pinsing._types import NDArray
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, RandomSteps, merged, together
from pinsing.algebra.decompose import Decomposition
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.long_chain import LongChain, gaps
from pinsing.families.pieces import PieceMaker
from pinsing.families.real_control import OwnPoints, RandomSingular, gap, on_none, real_points
from pinsing.families.slice_count import SliceCount
from pinsing.families.slice_search import SliceSearch
from pinsing.robot.arm import Arm
from pinsing.robot.exact_placements import IDENTITY
from pinsing.robot.nominal import Nominal
from pinsing.robot.task import Task

Vector = NDArray[np.object_]
"""Exact numbers: (3,), or (3, 3) for a rotation."""
_EYE: Vector = np.array(IDENTITY)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """What turns together: all between two turning joints."""

    # from one axis to the next, or to the tip, with slides at zero; None where it does not count
    link: Vector | None
    slides: tuple[tuple[int, Vector], ...]  # prismatic joints of it, and their directions


def planar_chain(
    geometry: Nominal, task: Task, rank: int, ring: Ring
) -> tuple[Component, ...] | None:
    """Return the singular set of a planar chain without mimics, at most one component; else None.

    Its relations are products: sin q2, which is zero at 0 and at 180 degrees.
    """
    axes, places, tip_turn = _home(geometry)
    prismatic = geometry.prismatic
    turning = [j for j, slides in enumerate(prismatic) if not slides]
    if not turning:
        return None
    normal = axes[turning[0]]
    if any(axes[j] @ normal if s else _apart(axes[j], normal) for j, s in enumerate(prismatic)):
        return None
    counted = _counted(task, normal, tip_turn)
    if counted is None or rank != counted.directions + counted.turns:
        return None
    stretches = _stretches(axes, places, prismatic, normal, counted.turns)
    values: dict[int, Value] = {}
    relations: list[Poly] = []
    directions: list[tuple[int, Vector]] = []
    for last, stretch in stretches:
        if (found := _direction(stretch, normal, ring, values, relations)) is None:
            return ()
        directions += [(last, found)] if found.any() else []
    if not directions:
        return None
    if counted.across is not None:
        directions += [(-1, counted.across), (turning[-1], counted.across)][counted.at_tip :][:1]
        directions.sort(key=lambda found: found[0])
    signs = [1 if axes[j] @ normal == 1 else -1 for j in range(len(prismatic))]
    for (first, v), (last, w) in itertools.pairwise(directions):
        between = [j for j in turning if first < j <= last]
        if between:
            relations.append(_parallel(v, w, between, signs, normal, ring))
        elif _apart(v, w):
            return ()
    if not values and not relations:
        return None
    return (Component(values, tuple(relations), True, len(values) + len(relations)),)


def turn_alike(geometry: Nominal) -> bool:
    """Return True if all revolute joints have parallel axes."""
    turn: Vector | None = None  # from the first turning joint on
    for rotation, slides in zip(geometry.rotation, geometry.prismatic, strict=False):
        if turn is not None:
            turn = turn @ np.array(rotation)
            if not slides and (turn[0, 2] != 0 or turn[1, 2] != 0):
                return False
        elif not slides:
            turn = _EYE
    return True


def _home(geometry: Nominal) -> tuple[list[Vector], list[Vector], Vector]:
    """Axes, points on them with the tip's as the last, and the tip's axes, at the ring's zero."""
    turn, at = _EYE, _EYE[0] * 0
    axes, places = list[Vector](), list[Vector]()
    for rotation, translation in zip(geometry.rotation, geometry.translation, strict=True):
        at = at + turn @ np.array(translation)
        turn = turn @ np.array(rotation)
        places.append(at)
        axes.append(turn[:, 2])
    return axes[:-1], places, turn @ np.array(geometry.tip_rotation)


@dataclass(frozen=True, eq=False)
class _Counted:
    """What counts of the motions in a plane."""

    directions: int  # how many directions of the plane: 1 or 2
    # where it is one, the direction of the plane at right angles to it, at the ring's zero
    across: Vector | None
    at_tip: bool  # whether that is fixed on the tip; else on the base
    turns: bool  # whether turns count


def _counted(task: Task, normal: Vector, tip: Vector) -> _Counted | None:
    """What the rows of a task make of a plane; None if no direction counts, or of both ends."""
    across: list[tuple[bool, Vector]] = []
    turns = False
    for row, at_tip in zip(task.rows, task.tip_rows, strict=True):
        axis = tip[:, row % 3] if at_tip else _EYE[row % 3]
        if row >= 3:
            turns = turns or axis @ normal != 0
        elif _apart(normal, axis):
            across.append((at_tip, np.cross(normal, axis)))
    if len({at_tip for at_tip, _ in across}) != 1:
        return None
    at_tip, first = across[0]
    if any(_apart(first, other) for _, other in across):
        return _Counted(2, None, at_tip, turns)
    return _Counted(1, first, at_tip, turns)


def _stretches(
    axes: Sequence[Vector],
    places: Sequence[Vector],
    prismatic: Sequence[bool],
    normal: Vector,
    turns: bool,
) -> list[tuple[int, _Stretch]]:
    """Each with the last turning joint before it; -1 is the base."""
    ends = [-1, *(j for j, slides in enumerate(prismatic) if not slides), len(prismatic)]
    out = []
    for before, after in itertools.pairwise(ends):
        slides = tuple((j, axes[j]) for j in range(before + 1, after))
        link = None
        if before >= 0 and not (turns and after == len(prismatic)):
            link = places[after] - places[before]
            link = link - (link @ normal) * normal
        out.append((before, _Stretch(link, slides)))
    return out


def _direction(
    stretch: _Stretch, normal: Vector, ring: Ring, values: dict[int, Value], relations: list[Poly]
) -> Vector | None:
    """Return the common direction of a stretch's columns, zero without any; None if never parallel.

    What its slides have to be goes into ``values`` or ``relations``.
    """
    across = normal * 0 if stretch.link is None else np.cross(normal, stretch.link)
    if not stretch.slides:
        return across
    _, d = stretch.slides[0]
    if any(_apart(d, e) for _, e in stretch.slides):
        return None
    if stretch.link is None:
        return d
    # The link has to be perpendicular to the slides, for its column to be along them.
    shares = [(j, d @ e) for j, e in stretch.slides]
    rest = d @ stretch.link
    if len(shares) == 1:
        (j, share) = shares[0]
        values[j] = (-rest / share,)
    else:
        gens = ring.context.gens()
        parts = (ring.number(share) * gens[ring.variables(j)[0]] for j, share in shares)
        relations.append(sum(parts, ring.number(rest)))
    return d


def _parallel(
    v: Vector, w: Vector, between: Sequence[int], signs: Sequence[int], normal: Vector, ring: Ring
) -> Poly:
    """That v is parallel to w, turned by the joints between: a polynomial in their half-angles."""
    gens = ring.context.gens()
    cos, sin = ring.one, ring.zero
    for j in between:
        x, y = (gens[k] for k in ring.variables(j))
        c, s = x * x - y * y, 2 * signs[j] * x * y
        cos, sin = cos * c - sin * s, sin * c + cos * s
    apart = ring.number(normal @ np.cross(v, w))
    along = ring.number(v @ w)
    product = ring.one
    for factor in ring.factors(ring.reduce(cos * apart + sin * along)):
        product = ring.reduce(product * factor)
    return product


def _apart(a: Vector, b: Vector) -> bool:
    """Return True unless two vectors are parallel."""
    return bool(np.cross(a, b).any())


MAX_JOINTS = 12
"""Beyond it all minors need more memory than there is before they can be stopped."""
_MANY = 9
"""Joints from which on all minors have a part of the time, and near ones and slices the rest."""
_FEW = 6
"""Joints from which on slices and planar chains have a step; with fewer all minors end."""


class ComponentSearch:
    """A search, and what its steps found: components, gaps, and what these rest on."""

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
        """True if slices can lead on: each joint moves on its own, and all rows count."""
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
        """Return True if it has something to add."""

    def take(self, s: ComponentSearch) -> None:
        """Add components, gaps and what these rest on; close the search where nothing is left."""


class PlanarChainStep:
    """Yields the component of a planar chain; relies on exact axes alone.

    Minors would state the branches of each condition, which long chains have too many of.
    """

    name = "planar chain"

    def applies(self, s: ComponentSearch) -> bool:
        """Of long chains whose axes are parallel."""
        return s.arm.n >= _FEW and s.arm.coupling is None and turn_alike(s.geometry)

    def take(self, s: ComponentSearch) -> None:
        """Close the search if the task counts in the plane."""
        if (found := planar_chain(s.geometry, s.task, s.rank, s.ring)) is not None:
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
        s.closed = not (found.gaps and (s.arm.n >= _MANY or s.slices or not s.components))

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
    """Yields components by short minors and points (modulo primes, real); always leaves gaps."""

    name = "near minors"

    def applies(self, s: ComponentSearch) -> bool:
        """Return where all minors did not end."""
        return True

    def take(self, s: ComponentSearch) -> None:
        """Add what is new, and drop what lies in it."""
        # Larger shares for slices of ten joints and more.
        share = (0.4 if s.arm.n <= _MANY else 0.25) if s.slices else 0.7
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

    Relies on a count: of components that slices met, and of real singular points that lie on them.
    """

    name = "slices"

    def applies(self, s: ComponentSearch) -> bool:
        """Return True if near minors ran, and slices can lead on."""
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
        """Return True where slices contradict the result, and enough time is left."""
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
