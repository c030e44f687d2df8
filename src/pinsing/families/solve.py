"""closed_form: all families of singular configurations of an arm.

The exact geometry (`nominal`), the search for components of the singular set, their real parts as
families in words (`describe`), whether these are the components (`faithful`), a count on slices
where that is open, and then the proof (`certificate`), by a tree of its own.

The search for components is an ordered list of steps:

Planar chain: all axes that turn are parallel; the links in line say all.
All minors: branch on the factors of all minors of the Jacobian. What ends is complete.
Near minors: minors of neighbouring axes, which are short however long the chain is.
Slices: singular points over small fields lead to what is missing, and count that nothing is.
All minors again: with the time that is left, where slices do not close the search.

Each step states when it applies, what it yields and what that relies on. The search takes the
steps in this order until one of them closes it: all that is singular is known then, or nothing
more can be found in the time. Shares of the time stand in the steps.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

import numpy as np

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import (
    Component,
    Decomposition,
    RandomSteps,
    decompose,
    merged,
    together,
)
from pinsing.algebra.equation import Equation
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.ring import Poly, Ring, Value, make_ring
from pinsing.errors import OptionError
from pinsing.families.certificate import LONG, prove as add_proof, prove_briefly
from pinsing.families.describe import (
    PieceMaker,
    SolvedPiece,
    describe,
    joint_symbols,
    mirror_key,
    stated,
)
from pinsing.families.faithful import disagreements
from pinsing.families.family import Family
from pinsing.families.form import ClosedForm
from pinsing.families.long_chain import LongChain, gaps
from pinsing.families.slices import RandomSingular, SliceCount, SliceSearch, count_on_slices
from pinsing.families.tube import find_tube
from pinsing.families.zero_set import OwnPoints
from pinsing.interface import checked
from pinsing.kinematics.jacobian import generic_rank
from pinsing.measures import ROUNDING, NDArray
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.load import load
from pinsing.robot.mimic import NotFollowed, drives
from pinsing.robot.nominal import (
    ANGLE,
    ANGLE_TOL,
    IDENTITY,
    LENGTH,
    Deviation,
    Nominal,
    Snap,
    design_of,
    deviation_of,
    flatten,
    jacobian_change,
    nominal,
)
from pinsing.robot.task import Task

if TYPE_CHECKING:
    from pinsing.families.design import DesignForm


Vector = NDArray[np.object_]
"""Exact numbers: (3,), or (3, 3) for a rotation."""
_EYE: Vector = np.array(IDENTITY)


def planar_chain(
    geometry: Nominal, task: Task, rank: int, ring: Ring
) -> tuple[Component, ...] | None:
    """Return the singular set of a planar chain without mimics, at most one component; else None.

    Its relations are products: sin q2, which is zero at 0 and at 180 degrees.

    All axes that turn are parallel, and all that slide are perpendicular to them. Seen along the
    axes, joint j moves a point at right angles to the vector from it, so that the differences of
    neighbouring columns are the links between them, turned by a right angle. Position is lost where
    all links up to the tip and all directions of slides are parallel; position and orientation
    together where those between the first and the last turning joint are. What lies between two
    turning joints has one direction; each with the next gives one condition, on the sum of the
    angles between them, and slides between the same two joints one on their lengths. No joint is in
    two of these: they are independent, and nothing else is singular. Where only one direction of
    the plane counts, all have to be at right angles to it as well: it is one more link, on the base
    or on the tip.
    """
    prismatic, n = geometry.prismatic, len(geometry.prismatic)
    turning = [j for j in range(n) if not prismatic[j]]
    if not turning:
        return None
    # Axes, and points on them with the tip's as the last, at the ring's zero.
    turn, at = _EYE, _EYE[0] * 0
    axes, places = list[Vector](), list[Vector]()
    placements = zip(geometry.rotation, geometry.translation, strict=True)
    for j, (rotation, shift) in enumerate(placements):
        at = at + turn @ np.array(shift)
        turn = turn @ np.array(rotation)
        places.append(at)
        axes.append(turn[:, 2])
        if j in turning and _apart(axes[j], axes[turning[0]]):
            return None  # as most chains do early
    normal = axes[turning[0]]
    if any(axes[j] @ normal for j in range(n) if prismatic[j]):
        return None
    # Of the rows: directions of the plane at right angles to theirs, fixed on the base or the tip.
    tip = turn @ np.array(geometry.tip_rotation)
    rows = [
        (row < 3, at_tip, tip[:, row % 3] if at_tip else _EYE[row % 3])
        for row, at_tip in zip(task.rows, task.tip_rows, strict=True)
    ]
    turns = any(axis @ normal for shifts, _, axis in rows if not shifts)
    across = [
        (at_tip, np.cross(normal, axis))
        for shifts, at_tip, axis in rows
        if shifts and _apart(normal, axis)
    ]
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

    def __init__(self, geometry: Nominal, time: Budget, angle_tol: float) -> None:
        self.geometry, self.arm, self.time = geometry, geometry.arm, time
        self.task, self.rank = self.arm.task, generic_rank(self.arm)
        # Slices can lead on where each joint moves on its own, and all rows count.
        known = _FEW <= self.arm.n <= MAX_JOINTS and self.arm.coupling is None
        self.slices = known and self.arm.n > self.rank == len(self.task.rows)
        slides = tuple(bool(p) for p in self.arm.prismatic)
        # Families are described after the search, in the same ring: polynomials with square roots
        # may take more time than the search.
        self.ring = make_ring(slides, constants(geometry, self.task), time.part(1.0, 1.2))
        self.maker = PieceMaker(geometry, self.ring, time, angle_tol)
        self.components: list[Component] = []
        self.gaps: list[str] = []
        self.random = RandomSteps(0, (), ())
        self.count: SliceCount | None = None
        self.steps: list[str] = []
        self.origins: dict[int, tuple[Component, str]] = {}  # all that was found: by which step
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
                for c in self.components:
                    self.origins.setdefault(id(c), (c, name))
        return self

    def rest(self, share: float) -> Budget:
        """A share of the time that is left, a tenth of the whole at least."""
        return self.time.part(share, 0.1)

    def all_minors(self, time: Budget) -> Decomposition:
        """The components by all minors, as far as the time goes."""
        return decompose(
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
        s.gaps.append(f"short minors did not end: {reason}")
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
    real = RandomSingular.of(s.maker)
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
        # From the same random numbers each time.
        s.maker = PieceMaker(s.geometry, s.ring, s.time, s.maker.angle_tol)
        s.count, s.closed = None, True
    return True


STEPS: dict[str, Callable[[ComponentSearch], bool]] = {
    "planar chain": planar,
    "all minors": all_minors,
    "near minors": near_minors,
    "slices": slices,
    "all minors again": all_minors_again,
}
"""The steps by name; each returns whether it applied, and says when it does."""


Prove: TypeAlias = bool | Literal["auto"] | None
"""Whether to look for a certificate: as far as some work leads, till it is found, or not at all."""
Design: TypeAlias = Arm | str | os.PathLike[str] | bool | None
"""What an arm is an imperfect copy of; True to find it."""
SECONDS = 10.0
"""Work, in seconds, for the algebra where none is given."""


@overload
def closed_form(
    arm: Arm | str | os.PathLike[str],
    *,
    seconds: float | None = None,
    angle_tol: float = ANGLE_TOL,
    snap_length: float = 0.0,
    prove: Prove = "auto",
    design: Design = None,
    progress: Callable[[str], None] | None = None,
) -> ClosedForm: ...


@overload
def closed_form(
    arm: Arm | str | os.PathLike[str],
    *,
    symbols: bool | str | Sequence[str],
    seconds: float | None = None,
    angle_tol: float = ANGLE_TOL,
) -> DesignForm: ...


@checked
def closed_form(
    arm: Arm | str | os.PathLike[str],
    *,
    symbols: bool | str | Sequence[str] | None = None,
    seconds: float | None = None,
    angle_tol: float = ANGLE_TOL,
    snap_length: float = 0.0,
    prove: Prove = "auto",
    design: Design = None,
    progress: Callable[[str], None] | None = None,
) -> ClosedForm | DesignForm:
    """Find all families of singular configurations, exactly, on the nominal geometry.

    Parameters
    ----------
    arm : Arm, str or path
        A serial arm, or the name or file of one, as ``load`` takes it.
    symbols : bool, str or sequence of str, optional
        Lengths that stay symbols: all that are not zero (True), or those named, such as
        ``"a2,d4"``. Of a DH table they are a1, d1, a2, ..., and twists alpha1, ... that are named
        stay symbols, too; of any other arm they are named after its joints, as ``elbow_joint_x``.
    seconds : float, optional
        Work after which the algebra is given up, 10 by default; what was found till then is
        returned, with ``complete`` False and the reason. Work is counted in steps, so that the
        answer does not depend on the machine; as a rule it takes less than these seconds. On the
        clock all ends within 1.5 times as many, or within a minute where none are given: where that
        strikes first, the reason says so.
        With ``prove=True`` a certificate is looked for in what is left, for a minute by default.
    angle_tol, snap_length : float
        As in ``nominal``: radians, metres.
    prove : bool, "auto" or None
        Whether to look for a certificate that nothing is missing. "auto" gives up after some
        work, which takes a few seconds and is the same on every machine: ``word`` is then what
        every command, page and report says of the arm; None means the same. True goes on until
        the time is over. False looks for none, for where ``word`` is not needed: it is at most
        "probable" then.
    design : Arm, name, path or bool, optional
        What the arm is an imperfect copy of, as a calibrated robot is: the families are of the
        design, and ``tube`` says how far from these the singular configurations of the arm are.
        True finds it: right angles within 0.01 rad (or ``angle_tol``), offsets below 1 mm (or
        ``snap_length``) zero, lengths that are one within that equal. By default that of the arm,
        if it has one; False ignores that, and with ``angle_tol=0`` all is of the file's own
        numbers. A design without singular configurations tells nothing.
    progress : callable
        Told now and then how far the search for a certificate is.

    Returns
    -------
    ClosedForm
        Families, each with equations, joints, points, distance, reachability and reason.
        With ``symbols`` a DesignForm: families in symbols, what was assumed of the lengths, and
        where the design changes the answer.

    Raises
    ------
    OptionError
        If ``seconds`` is not positive, a tolerance makes no sense, or options do not go together.
    UnknownNameError
        If there is no length of a name in ``symbols``.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("stanford"))
    >>> [family.text for family in form.families]
    ['q2 = 0° or 180°', 'd3 = 0', 'q5 = 0° or 180°']
    >>> form.complete, form.word
    (True, 'proven')
    """
    given, seconds = seconds, SECONDS if seconds is None else seconds
    OptionError.refuse_if(not seconds > 0, f"seconds must be positive, got {seconds!r}")
    if symbols is not None and symbols is not False:
        OptionError.refuse_if(
            prove is True or snap_length,
            "symbols do not go with prove or snap_length: give numbers for these",
        )
        return _design(arm, symbols, seconds, angle_tol)
    arm = arm if isinstance(arm, Arm) else load(arm)
    design = arm.design if design is None else design
    if design is not None and design is not False:
        tolerances = (max(angle_tol, ANGLE), snap_length or LENGTH)
        like = design if isinstance(design, (Arm, bool)) else load(design)
        made = design_of(arm, like, *tolerances)
        found = closed_form(made, seconds=given, prove=prove, design=False, progress=progress)
        if found.families:
            return about_robot(found, arm, made)
    started = time.monotonic()
    # Where no time is given a minute on the clock is enough for the work on a busy machine, too.
    budget = Budget(seconds) if given is not None else Budget(LONG, seconds)
    found = _found(arm, budget, angle_tol, snap_length)
    if prove is False:
        return found
    # Time on the clock after which a certificate is given up, of that given.
    whole = LONG if given is None else 1.4 * seconds
    left = max(whole - (time.monotonic() - started), 0.0)
    return (add_proof if prove is True else prove_briefly)(found, left, progress)


def about_robot(found: ClosedForm, robot: Arm, design: Arm) -> ClosedForm:
    """The families of a design, with how far those of a robot are from it."""
    change = jacobian_change(flatten(robot), flatten(design), robot)
    if change <= ROUNDING:
        return found
    tube = find_tube(robot, design, found.families)
    return replace(
        found,
        arm=summarize(robot),
        loaded=robot,
        jacobian_change=found.jacobian_change + change,
        seconds=found.seconds,
        deviation=deviation_of(tube.assumed),
        tube=tube,
    )


def form_to_measure(arm: Arm) -> ClosedForm:
    """Return the form for distances, with a certificate only where families may be missing."""
    found = closed_form(arm, prove=False)
    return found if found.complete else prove_briefly(found, SECONDS)


def _found(
    arm: Arm, whole: Budget, angle_tol: float, snap_length: float, told: bool = True
) -> ClosedForm:
    """The closed form, without a proof; unless ``told`` families may be their conditions alone."""
    started = time.monotonic()
    geometry = nominal(arm, angle_tol, snap_length)
    symbols = joint_symbols(arm)
    rank = generic_rank(geometry.arm)  # lengths that were snapped away may lower it
    families: list[Family] = []
    step_of: dict[str, str] = {}
    gaps: list[str] = []
    off: list[str] = []
    left_out: list[Component] = []
    moved: tuple[Snap, ...] = ()
    search: ComponentSearch | None = None
    try:
        _, moved = drives(geometry)
    except NotFollowed as reason:
        gaps.append(
            f"the algebra cannot follow a mimic joint of the chain: {reason}; `pinsing analyze` "
            "and `map` follow it, and find singular configurations one by one"
        )
    if not gaps and arm.n > 0 and rank > 0:
        # Share of the time that there is for finding components; describing them needs some too.
        search = ComponentSearch(geometry, whole.part(0.9), angle_tol).run()
        maker = search.maker
        gaps += search.gaps
        # Share of the time that there is for describing families, however long finding them took.
        maker.time = describing = whole.part(1.0, 0.1)
        grouped: dict[object, list[SolvedPiece]] = {}
        for c in search.components:
            pieces = maker.pieces(c, search.components)
            left_out += [] if pieces else [c]
            for piece in pieces:
                grouped.setdefault((piece.real, mirror_key(piece)), []).append(piece)
        for i, group in enumerate(grouped.values(), 1):
            # Most take little; one that takes long leaves as much to the others.
            # Share of what is left for describing families that one of them may take.
            maker.time = describing if i == len(grouped) else describing.part(0.5)
            if told or any(len(b.equations) > 1 for p in group for b in p.branches):
                families.append(describe(group, maker, arm))
            else:
                families.append(stated(group, maker, arm))
        families.sort(key=_order)
        families = [replace(f, name=f"F{i}") for i, f in enumerate(families, 1)]
        step_of = {f.name: search.origins[id(f.components[0])][1] for f in families}
        off = disagreements(families, left_out, maker.ring, geometry, symbols)
        gaps += off
    counted: SliceCount | None = None if search is None else search.count
    if (
        gaps
        and search is not None
        and counted is None
        and whole.on_clock > 0.2 * whole.seconds  # one round of slices takes up to half a second
        and (rank == len(arm.task.rows) and arm.n >= 6 and arm.coupling is None)
    ):
        # Share of the time that there is for counting on slices what a long chain's families miss.
        counted = count_on_slices(
            geometry, arm.task, maker.ring, search.components, arm.n - rank + 1,
            whole.part(1.0, 0.05),
        )  # fmt: skip
    if counted is not None and counted.off:
        gaps.append(f"{counted.sentence()}, and so it is over another: something is missing")
    stated_families = tuple(families)
    found = ClosedForm(
        arm=summarize(arm),
        symbols=symbols,
        generic_rank=rank,
        families=stated_families,
        complete=not gaps,
        fully_decomposed=all(len(b.equations) <= 1 for f in families for b in f.branches),
        gaps=tuple(gaps),
        dropped=len(left_out),
        left_out=tuple(left_out),
        geometry=geometry,
        faithful=None if off else stated_families,
        loaded=arm,
        snaps=tuple(str(s) for s in (*geometry.snaps, *moved)),
        jacobian_change=geometry.jacobian_change,
        seconds=time.monotonic() - started,
        random_steps=None if search is None else search.random,
        steps=() if search is None else tuple(search.steps),
        step_of=step_of,
        slice_count=counted,
        deviation=Deviation.of((*geometry.snaps, *moved)),
    )
    unsolved = 0 if search is None else search.maker.unsolved
    tol = None if snap_length else angle_tol
    hints = tuple(_hints(found, arm, geometry, unsolved, whole, tol))
    return replace(found, hints=hints, seconds=time.monotonic() - started)


def _hints(
    form: ClosedForm,
    arm: Arm,
    geometry: Nominal,
    unsolved: int,
    whole: Budget,
    angle_tol: float | None,
) -> Iterator[str]:
    """What may be worth trying, small offsets with a tolerance alone; how equations are meant."""
    lengths = [abs(float(x)) for row in geometry.translation for x in row]
    offset = max((x for x in lengths if 0 < x < LENGTH), default=0.0)
    if angle_tol is not None and offset and sum(lengths) >= 100 * LENGTH:
        kept = (
            f"offsets of up to {1e3 * offset:.3g} mm are kept as they are: "
            f"--snap-length {LENGTH:g} puts them to zero"
        )
        if whole.over:
            yield f"{kept} (there was no time to tell what it gives)"
        else:
            # Share of what is left for what lengths snapped away would change.
            snapped = _found(arm, whole.part(0.5), angle_tol, LENGTH, told=False)
            texts = [f.text for f in snapped.families]
            if texts != [f.text for f in form.families]:
                given = " | ".join(texts) or "no singular configurations"
                yield f"{kept} and gives {given}{'' if snapped.complete else ' (not complete)'}"
    if unsolved:
        one = ("a system of equations was", "it stays")
        many, they = (
            one if unsolved == 1 else (f"{unsolved} systems of equations were", "they stay")
        )
        yield (
            f"time was over before {many} solved for joint values: {they} as stated, which is as "
            "true; more time (--seconds) may give these"
        )
    # Equations of neighbouring axes, or of slices, may be zero at regular configurations, too.
    if names := [f.name for f in form.families if f.also_regular]:
        yield (
            f"equations of {', '.join(names)}: they may hold at some regular configurations, too; "
            f"singular are those at which the rank drops below {form.generic_rank}, for which "
            "`contains`, `distance` and `sample` ask"
        )


def _design(
    arm: Arm | str | os.PathLike[str],
    symbols: bool | str | Sequence[str],
    seconds: float,
    angle_tol: float,
) -> DesignForm:
    """The closed form with some lengths as symbols."""
    # With the readers of files, only where symbols are asked for.
    from pinsing.families.design import design_form, of_arm

    if isinstance(symbols, str):
        symbols = symbols.strip() == "all" or symbols.split(",")
    chosen = None if isinstance(symbols, bool) else tuple(symbols)
    loaded = arm if isinstance(arm, Arm) else load(arm)
    OptionError.refuse_if(
        loaded.coupling is not None, "lengths stay symbols in chains without mimic joints"
    )
    OptionError.refuse_if(
        loaded.n > MAX_JOINTS,
        f"lengths stay symbols in chains of at most {MAX_JOINTS} joints, and this has {loaded.n}",
    )
    return design_form(of_arm(loaded, chosen, angle_tol), joint_symbols(loaded), seconds)


def _order(family: Family) -> tuple[int, int, int, tuple[str, ...]]:
    equations: list[Equation] = list(family.branches[0].equations)
    return (
        family.codimension,
        len(equations),
        sum(len(e.cos) for e in equations),
        tuple(str(j) for b in family.branches[:1] for j in b.involved),
    )
