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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, RandomSteps, merged, together
from pinsing.algebra.decompose import Decomposition
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.long_chain import LongChain, gaps
from pinsing.families.pieces import PieceMaker
from pinsing.families.slices import RandomSingular, SliceCount, SliceSearch
from pinsing.families.zero_set import OwnPoints
from pinsing.measures import NDArray
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import IDENTITY, Nominal
from pinsing.robot.task import Task

Vector = NDArray[np.object_]
"""Exact numbers: (3,), or (3, 3) for a rotation."""
_EYE: Vector = np.array(IDENTITY)


def planar_chain(
    geometry: Nominal, task: Task, rank: int, ring: Ring
) -> tuple[Component, ...] | None:
    """Return the singular set of a planar chain without mimics, at most one component; else None.

    Its relations are products: sin q2, which is zero at 0 and at 180 degrees.
    """
    prismatic, n = geometry.prismatic, len(geometry.prismatic)
    # Axes, points on them with the tip's as the last, and which of them turn, at the ring's zero.
    turn, at = _EYE, _EYE[0] * 0
    axes, places, turning = list[Vector](), list[Vector](), list[int]()
    for j, (rotation, shift) in enumerate(
        zip(geometry.rotation, geometry.translation, strict=True)
    ):
        at = at + turn @ np.array(shift)
        turn = turn @ np.array(rotation)
        places.append(at)
        axes.append(turn[:, 2])
        if j < n and not prismatic[j]:
            turning.append(j)
            if _apart(axes[j], axes[turning[0]]):
                return None
    if not turning:
        return None
    normal = axes[turning[0]]
    if any(axes[j] @ normal for j, slides in enumerate(prismatic) if slides):
        return None
    # Of the rows: directions of the plane at right angles to theirs, fixed on the base or the tip.
    tip, turns = turn @ np.array(geometry.tip_rotation), False
    across: list[tuple[bool, Vector]] = []
    for row, at_tip in zip(task.rows, task.tip_rows, strict=True):
        axis = tip[:, row % 3] if at_tip else _EYE[row % 3]
        if row >= 3:
            turns = turns or axis @ normal != 0
        elif _apart(normal, axis):
            across.append((at_tip, np.cross(normal, axis)))
    if len({at_tip for at_tip, _ in across}) != 1:
        return None
    at_tip, aside = across[0]
    both = any(_apart(aside, other) for _, other in across)
    if rank != 1 + both + turns:
        return None
    values: dict[int, Value] = {}
    relations: list[Poly] = []
    directions: list[tuple[int, Vector]] = []  # with the last turning joint before each; -1: none
    gens = ring.context.gens()
    for before, after in itertools.pairwise([-1, *turning, n]):
        # What turns together has one direction, that of its slides and at right angles to its link.
        slides = range(before + 1, after)
        counts = before >= 0 and not (turns and after == n)
        link = places[after] - places[before] if counts else normal * 0
        link = link - (link @ normal) * normal
        direction = np.cross(normal, link)
        if slides:
            direction = axes[slides[0]]
            if any(_apart(direction, axes[j]) for j in slides):
                return ()
            # The link has to be perpendicular to the slides, for its column to be along them.
            rest = direction @ link
            if counts and len(slides) == 1:
                values[slides[0]] = (-rest,)
            elif counts:
                shares = ((direction @ axes[j], gens[ring.variables(j)[0]]) for j in slides)
                relations.append(sum((ring.number(c) * z for c, z in shares), ring.number(rest)))
        directions += [(before, direction)] if direction.any() else []
    if not directions:
        return None
    if not both:
        directions.append((turning[-1] if at_tip else -1, aside))
        directions.sort(key=lambda found: found[0])
    signs = [1 if axes[j] @ normal == 1 else -1 for j in range(n)]
    for (first, v), (last, w) in itertools.pairwise(directions):
        between = [j for j in turning if first < j <= last]
        if between:
            relations.append(_parallel(v, w, between, signs, normal, ring))
        elif _apart(v, w):
            return ()
    if not values and not relations:
        return None
    return (Component(values, tuple(relations), True, len(values) + len(relations)),)


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
        for name, step in STEPS.items():
            if not self.closed and step(self):
                self.steps.append(name)
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


def planar(s: ComponentSearch) -> bool:
    """Of long chains whose axes are parallel; yields their component, relies on exact axes alone.

    Minors would state the branches of each condition, which long chains have too many of.
    """
    if s.arm.n < _FEW or s.arm.coupling is not None:
        return False
    if (found := planar_chain(s.geometry, s.task, s.rank, s.ring)) is None:
        return False
    s.components, s.closed = list(found), True
    s.maker.products = True
    return True


def all_minors(s: ComponentSearch) -> bool:
    """Of chains of which all minors fit in memory; yields all components.

    Relies on division, and on random points of systems of equations. Closes the search if the
    minors end, or nothing else would find more.
    """
    if s.arm.n > MAX_JOINTS:
        return False
    # Share of the time: where all minors end they tell more sets apart than other steps.
    if s.arm.n >= _MANY:
        share = 0.1  # few end
    elif not s.slices:
        share = 0.8 if s.arm.n > s.rank else 1.0
    elif s.task.name == "pose":
        share = 0.6  # most end
    else:
        share = min(0.5, 20.0 / s.time.seconds)  # few rows leave motions free: slices take a few
    s.first = s.time.part(share)
    found = s.all_minors(s.first)
    s.components, s.random = list(found.components), found.second
    s.gaps = list(dict.fromkeys(found.gaps))
    s.closed = not (found.gaps and (s.arm.n >= _MANY or s.slices or not s.components))
    return True


def near_minors(s: ComponentSearch) -> bool:
    """Where all minors did not end; yields components by short minors and points.

    These are modulo primes, and real: it always leaves gaps. What is new is added, and what lies in
    it dropped.
    """
    # Larger shares for slices of ten joints and more.
    share = (0.4 if s.arm.n <= _MANY else 0.25) if s.slices else 0.7
    s.maker.time = time = s.rest(share)
    try:
        s.chain = LongChain(s.geometry, s.task, s.rank, s.ring, s.maker, time)
    except BudgetExceeded as reason:
        s.gaps.append(str(reason))
        return True
    s.components = merged(s.components, s.chain.components, s.ring)
    s.gaps += gaps(s.chain.open_ends, s.arm.n)
    s.maker.confirm = None if s.slices else OwnPoints(s.geometry.arm)
    return True


def slices(s: ComponentSearch) -> bool:
    """Where near minors ran, and slices can lead on.

    Yields components at joint values that singular points over small fields lead to. Relies on a
    count: of components that slices met, and of real singular points that lie on them. Drops the
    gaps if slices were gone through often enough, unless a real point is off.
    """
    if not s.slices or s.chain is None:
        return False

    def near(values: Mapping[int, Value], time: Budget) -> Sequence[Component]:
        s.maker.time = time
        given = s.geometry, s.task, s.rank, s.ring, s.maker, time, values
        return LongChain(*given, thorough=False).components

    near_at = near if s.arm.n > _MANY else None  # of nine joints all minors take seconds there
    # No random starts are made after a tenth of the time that is left.
    real = RandomSingular.of(s.maker, s.rest(0.1))
    # Of many joints families take long to describe: that has the rest of the time.
    time, largest = s.rest(0.7), s.arm.n - s.rank + 1
    given = s.geometry, s.task, s.ring, s.components, largest, time
    found = SliceSearch(*given, s.chain.unseen, near_at, real)
    found.run()
    s.components, s.count = found.components, found.count
    s.gaps = [] if found.enough else s.gaps
    s.random = together([s.random, *found.steps] if s.gaps else found.steps)
    missed = real.off(s.components)
    s.closed = found.enough and not missed.any()
    if s.count is not None:
        s.gaps = real.gap(missed) + s.gaps
        s.count = replace(s.count, real=len(real.q), real_off=int(missed.sum()))
    s.maker.confirm = OwnPoints(s.geometry.arm)
    return True


def all_minors_again(s: ComponentSearch) -> bool:
    """Where slices contradict the result; yields all components, as all minors do, if they end."""
    if s.arm.n != _MANY or s.first is None or "slices" not in s.steps:
        return False
    time = s.time.part(0.8)
    if time.seconds <= 2.0 * s.first.seconds:
        return False
    found = s.all_minors(time)
    if not found.gaps:
        s.components, s.gaps, s.random = list(found.components), [], found.second
        s.count, s.maker, s.closed = None, s.new_maker(), True
    return True


STEPS: dict[str, Callable[[ComponentSearch], bool]] = {
    "planar chain": planar,
    "all minors": all_minors,
    "near minors": near_minors,
    "slices": slices,
    "all minors again": all_minors_again,
}
"""The steps by name; each returns whether it applied, and says when it does."""
