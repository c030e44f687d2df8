"""The components of a chain's singular set: by all minors, or, of many joints, by near ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pinsing._dataclass import dataclass
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, FoundComponents
from pinsing.algebra.decompose import Decomposition
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Ring, Value
from pinsing.algebra.second_prime import RandomSteps, together
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.led_search import led
from pinsing.families.long_chain import LongChain
from pinsing.families.own_points import OwnPoints
from pinsing.families.pieces import PieceMaker
from pinsing.families.planar_chain import planar_chain, turn_alike
from pinsing.families.real_control import RandomSingular, gap, on_none, real_points
from pinsing.families.slice_count import SliceCount
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import Nominal

MAX_JOINTS = 12
"""Beyond it all minors need more memory than there is before they can be stopped."""
_SEED = 20
_AND_AFTER = 1.2
"""Times the search's own that polynomials with square roots may take, describing included."""
_MANY = 9
"""Joints from which on all minors have a part of the time, and near ones and slices the rest."""
_LINKS = 6
"""Joints from which on a planar chain is not searched: each condition would double its branches."""
_OPEN = 6
"""Joints from which on slices lead on where all minors do not end."""
_BRIEF = 0.1
"""Share of the time that all minors of many joints have first: where they end, nothing is open."""
_MOSTLY = 0.8
"""The same of fewer joints: near ones state the general case where all minors state nothing."""
_FIRST, _FIRST_SECONDS = 0.5, 20.0
"""The same where few rows leave motions free, and no more seconds: slices take a few. Where all
minors end they tell more sets apart."""
_MOST = 0.6
"""The same for the pose of fewer joints: most end."""
_NEAR, _NEAR_OF_MANY, _NEAR_ONLY = 0.4, 0.25, 0.7
"""Shares of the time that is left for near ones: before slices, before the larger slices of ten
joints and more, and where there are none."""
_LED = 0.7
"""Share of the time that is then left for slices: families of many joints take long to describe."""
_AGAIN, _LONGER = 0.8, 2.0
"""Where slices contradict what is known, share of what is left then for all minors once more, if it
is so much longer than they had."""
_CONTROL = 0.1
"""Share of the time that is then left after which no more random starts are made."""


@dataclass(frozen=True, eq=False)
class Searched:
    """What a search found.

    Attributes
    ----------
    ring : Ring
        Of its polynomials.
    components : list of Component
        Where the rank drops.
    gaps : list of str
        Why these may not be all.
    maker : PieceMaker
        For points and equations of them.
    steps : RandomSteps or None
        What rests on random points.
    count : SliceCount or None
        Of many joints: singular points on random slices, held against the components.
    """

    ring: Ring
    components: list[Component]
    gaps: list[str]
    maker: PieceMaker
    steps: RandomSteps | None
    count: SliceCount | None = None


@dataclass(frozen=True)
class Allowed:
    """The budget, and the tolerance that the nominal geometry is made with."""

    time: Budget
    angle_tol: float


def searched(
    geometry: Nominal, arm: Arm, rank: int, symbols: Sequence[str], limits: Allowed
) -> Searched:
    """Find the components of the singular set, as many as the time allows.

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
    limits : Allowed
        Time and tolerance.
    """
    slides = tuple(bool(p) for p in arm.prismatic)
    # Families are described after the search, in the same ring.
    ring = ring_of(slides, constants(geometry, arm.task), limits.time.part(1.0, _AND_AFTER))
    if arm.n >= _LINKS and arm.coupling is None and turn_alike(geometry):
        in_line = _in_line(geometry, arm, rank, symbols, limits, ring)
        if in_line is not None:
            return in_line
    every = arm.n <= MAX_JOINTS
    near = arm.n >= _MANY
    full = rank == len(arm.task.rows)
    lead = every and full and arm.n >= _OPEN and arm.n > rank and arm.coupling is None
    found: Decomposition | None = None
    if every:
        share = _BRIEF if near else _MOSTLY if arm.n > rank else 1.0
        if lead and not near:
            share = _MOST
            if arm.task.name != "pose":
                share = min(_FIRST, _FIRST_SECONDS / limits.time.seconds)
        first = limits.time.part(share)
        found = _all_minors(geometry, arm, rank, ring, first)

    def rest(share: float) -> Budget:
        return limits.time.part(share, 0.1)

    many = found is None or (bool(found.gaps) and (near or lead or not found.components))
    followed = _NEAR if arm.n <= _MANY else _NEAR_OF_MANY
    short = rest(1.0 if not many else followed if lead else _NEAR_ONLY)
    maker = PieceMaker(geometry, ring, rank, symbols, _SEED, short, limits.angle_tol)
    components = [] if found is None else list(found.components)
    gaps = [] if found is None else list(dict.fromkeys(found.gaps))
    steps = RandomSteps(0, (), ()) if found is None else found.second
    if not many:
        return Searched(ring, components, gaps, maker, steps)
    try:
        chain = LongChain(geometry, arm.task, rank, ring, maker, short)
    except BudgetExceeded as reason:
        return Searched(ring, components, [*gaps, str(reason)], maker, steps)
    test = FoundComponents(ring, lambda c: None)
    for c in chain.components:
        if not any(test.inside(c, k) for k in components):
            components = [k for k in components if not test.inside(k, c)] + [c]
    gaps += chain.progress.gaps(arm.n)
    count: SliceCount | None = None
    own = OwnPoints(geometry.arm)
    if lead:

        def at(values: Mapping[int, Value], some: Budget) -> Sequence[Component]:
            maker.time = some
            part = LongChain(geometry, arm.task, rank, ring, maker, some, values, thorough=False)
            return part.components

        near_at = at if arm.n > _MANY else None  # of nine joints all minors take seconds there
        real = RandomSingular(maker, real_points(maker, own, rest(_CONTROL)))
        most, time_left = arm.n - rank + 1, rest(_LED)
        slices = led(
            geometry, arm.task, ring, components, most, time_left, chain.unseen, near_at, real
        )
        components, count = slices.components, slices.count
        gaps = [] if slices.enough else gaps
        steps = together([steps, *slices.steps] if gaps else slices.steps)
        missed = on_none(maker, real.q, components)
        if arm.n == _MANY and (missed.any() or not slices.enough):
            again = limits.time.part(_AGAIN)
            if again.seconds > _LONGER * first.seconds:
                whole = _ended(geometry, arm, rank, symbols, limits, again, ring)
                if whole is not None:
                    return whole
        if count is not None:
            gaps = gap(real.q, missed, arm.prismatic) + gaps
            count = replace(count, real=len(real.q), real_off=int(missed.sum()))
    maker.confirm = own
    return Searched(ring, components, gaps, maker, steps, count)


def _ended(
    geometry: Nominal,
    arm: Arm,
    rank: int,
    symbols: Sequence[str],
    limits: Allowed,
    again: Budget,
    ring: Ring,
) -> Searched | None:
    """All minors once more, with more time; None if that is over before they end."""
    found = _all_minors(geometry, arm, rank, ring, again)
    if found.gaps:
        return None
    rest = limits.time.part(0.0, 0.1)
    maker = PieceMaker(geometry, ring, rank, symbols, _SEED, rest, limits.angle_tol)
    return Searched(ring, list(found.components), [], maker, found.second)


def _in_line(
    geometry: Nominal,
    arm: Arm,
    rank: int,
    symbols: Sequence[str],
    limits: Allowed,
    ring: Ring,
) -> Searched | None:
    """The singular set of a planar chain, whatever its length; None if the chain is none."""
    found = planar_chain(geometry, arm.task, rank, ring)
    if found is None:
        return None
    maker = PieceMaker(geometry, ring, rank, symbols, _SEED, limits.time, limits.angle_tol)
    maker.products = True
    return Searched(ring, list(found), [], maker, RandomSteps(0, (), ()))


def _all_minors(
    geometry: Nominal, arm: Arm, rank: int, ring: Ring, time_left: Budget
) -> Decomposition:
    """Components of the singular set."""

    def matrix() -> Matrix:
        return jacobian_matrix(geometry, ring, arm.task, time_left)

    return Decomposition(matrix, rank, ring, time_left)
