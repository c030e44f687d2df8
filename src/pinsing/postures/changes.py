"""posture_changes: the other inverse solutions of a pose, and which can be reached freely.

Whole-turn copies of a configuration within the limits, and which are in the aspect of another.

A joint whose limits are wider than a turn brings the tip to one pose at several values. Such
copies are singular together, but may be in different aspects. Joint space is a product of parts,
so copies are told apart part by part: two copies are in one aspect if no part separates them.

line_postures: how far a straight line of the tip is followed from them.

cuspidality: whether two inverse solutions of one pose are joined without a singularity.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations, islice, pairwise, product
from typing import ClassVar

import numpy as np

from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.families.solve import form_to_measure
from pinsing.interface import MAX_SEED, JsonResult, checked, typed, whole_number
from pinsing.kinematics.inverse import InverseSolution, columns, inverse, one_sheet, regular_way
from pinsing.kinematics.jacobian import generic_rank, picked, ratios, tip_placement, turn_left
from pinsing.kinematics.ladder import ladder_of, posture_names
from pinsing.measures import ALIKE, PRACTICAL, ROUNDING, Array, ArrayLike
from pinsing.postures.aspects import (
    DIFFERENT,
    NOT_COMPLETE,
    PROVEN,
    SAME,
    UNDECIDED,
    Connection,
    aspects,
    connect,
    map_of,
    missing,
    nearly,
    opposite,
)
from pinsing.postures.joint_map import Map, Piece, Spot, apart
from pinsing.proximity.clearance import forms_of
from pinsing.proximity.line import LinePosture, check_line
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import nominal

_TRIED = 8
"""Copies to which a way is looked for, at most."""
_LOOKED = 512
"""Copies of the joints of one part that are looked at, the nearest; a joint has as many at most."""


@dataclass(frozen=True, eq=False)
class Copies:
    """Whole-turn copies of a configuration within the limits, itself included."""

    total: int  # how many there are
    joined: int  # how many are in the aspect of the start
    # how many are proven to be in other aspects; the others were not looked at, or could not be
    # told
    apart: int
    nearest: Array  # (n,): that which is nearest to the start
    # of those that are not proven to be in other aspects the first eight: those in the aspect of
    # the start before others, near ones before far ones
    likely: tuple[Array, ...]


def whole_turns(chosen: Map, q: Array, start: Array, *, held: Collection[int] = ()) -> Copies:
    """Return the whole-turn copies of q (n,), and which are in the aspect of the start (n,)."""
    # Endless joints have none; ``held`` ones stay as in q, which is within the limits, perhaps by
    # turns.
    counts, each = _values(chosen, q, start, held)
    total = math.prod(counts)
    nearest = np.array([values[0] for values in each])
    place = chosen.place(start)
    if place is None or chosen.on(nearest):
        return Copies(total, 0, 0, nearest, (nearest,))
    joined, open_ = 1, 1
    likely, rank = nearest[None], np.zeros((1, 2))
    for pieces, target in zip(chosen.pieces, place, strict=True):
        joints = list(target[0].part.joints)
        some, told = _told(chosen, pieces, target, nearest, start, each)
        joined *= int((told[:, 0] == 0).sum())
        open_ *= math.prod(counts[j] for j in joints) - int((told[:, 0] == 2).sum())
        some, told = some[told[:, 0] < 2], told[told[:, 0] < 2]
        sums = (rank[:, None] + told).reshape(-1, 2)
        best = np.lexsort(sums.T[::-1])[:_TRIED]
        before, here = np.divmod(best, max(1, len(told)))
        likely, rank = likely[before], sums[best]
        likely[:, joints] = some[here]
    return Copies(total, joined, total - open_, nearest, tuple(likely))


def _values(
    chosen: Map, q: Array, start: Array, held: Collection[int]
) -> tuple[list[int], list[Array]]:
    """How many values each joint has within the limits; those nearest to the start, in order."""
    still = chosen.endless | chosen.watched.prismatic | np.isin(np.arange(len(q)), list(held))
    first = np.ceil((chosen.low - ROUNDING - q) / math.tau)
    last = np.floor((chosen.high + ROUNDING - q) / math.tau)
    still |= last < first  # outside whatever the turns
    first, last = (np.where(still, 0, x).astype(np.int64) for x in (first, last))
    middle = np.clip(np.round((start - q) / math.tau), first, last).astype(np.int64)
    each = []
    for j, x in enumerate(q):
        near = np.clip([middle[j] - _LOOKED // 2, middle[j] + _LOOKED // 2], first[j], last[j])
        values = x + math.tau * np.arange(near[0], near[1] + 1)
        if first[j] < last[j]:
            values = np.clip(values, chosen.low[j], chosen.high[j])
        each.append(values[np.lexsort((values, np.round(np.abs(values - start[j]), 9)))])
    return (last - first + 1).tolist(), each


def _told(
    chosen: Map,
    pieces: tuple[Piece, ...],
    target: Spot,
    q: Array,
    start: Array,
    each: list[Array],
) -> tuple[Array, Array]:
    """Return values (M, d) of the joints of a part, and (M, 2) what it tells, and how far they are.

    It tells 0 where it does not separate them from the start, 1 where it may, 2 where it does.
    """
    joints = list(target[0].part.joints)
    near = [each[j] for j in joints]
    while math.prod(map(len, near)) > _LOOKED:
        far = [
            abs(v[-1] - start[j]) if len(v) > 1 else -1.0 for j, v in zip(joints, near, strict=True)
        ]
        k = int(np.argmax(far))
        near[k] = near[k][:-1]
    values, told = np.array(list(product(*near))), []
    for copy in values:
        there = q.copy()
        there[joints] = copy
        spot = chosen.located(pieces, there)
        sure = spot is not None and apart(target, spot)
        told.append(2 if sure else int(spot != target))
    gap = np.round(((values - start[joints]) ** 2).sum(axis=1), 9)  # ties alike everywhere
    return values, np.column_stack([told, gap])


_ITSELF = 1e-4
"""Joint distance up to which two solutions are one, as in `inverse`."""
_LITTLE = 1e-3
"""sigma_r / sigma_1 of the joints that stay free, under which others are held instead."""


@dataclass(frozen=True, eq=False)
class PostureChange:
    """Another inverse solution of the pose.

    Attributes
    ----------
    solution : InverseSolution
        It.
    aspect : int or None
        Number of its aspect; None where it is singular or outside the limits that count.
    connection : Connection or None
        Whether it can be reached without a singularity, and by which way; None where it is
        singular or outside the limits.
    names : tuple of str
        Words of the field for the posture, such as "elbow up", where it has some.
    copies : int
        How many configurations within the limits are this one but for whole turns, itself
        included. ``solution`` is the one that is reached, or else the one nearest to the start.
    copies_in_aspect : int
        How many of them are in the aspect of the start.
    copies_undecided : int
        Of how many it could not be told, or was not looked at, whether they are.
    """

    solution: InverseSolution
    aspect: int | None
    connection: Connection | None
    names: tuple[str, ...] = field(default=(), metadata={"optional": True})
    copies: int = field(default=1, metadata={"optional": True})
    copies_in_aspect: int = field(default=0, metadata={"optional": True})
    copies_undecided: int = field(default=0, metadata={"optional": True})

    @property
    def answer(self) -> str | None:
        """As of `Connection`, of all whole-turn copies: "different" only if each of them is."""
        if self.connection is None:
            return None
        if self.connection.answer == DIFFERENT and self.copies_in_aspect + self.copies_undecided:
            return UNDECIDED
        return self.connection.answer


@dataclass(frozen=True, eq=False)
class PostureChanges(JsonResult):
    """The postures of one pose.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    q : (n,) array
        The configuration that was given.
    aspect : int or None
        Its aspect; None where it is singular.
    within_limits : bool
        Whether ways stay within the joint limits.
    others : tuple of PostureChange
        The other inverse solutions: those that can be reached first.
    doubt : str
        What speaks against that these are all.
    notes : tuple of str
        What the answers rest on.
    names : tuple of str
        Words of the field for the posture at q, where it has some.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.posture_changes(pinsing.load("puma560"), [0.1, -0.6, 0.4, 0.2, 0.7, 0.3])
    >>> len(found.others)
    7
    """

    schema: ClassVar[str] = "pinsing/posture_changes/1"
    made_by: ClassVar[str] = "pinsing.posture_changes(arm, q)"

    arm: ArmSummary
    q: Array
    aspect: int | None
    within_limits: bool
    others: tuple[PostureChange, ...]
    doubt: str
    notes: tuple[str, ...]
    names: tuple[str, ...] = field(default=(), metadata={"optional": True})

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text: how many are reached freely, each, and the grounds.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> found = pinsing.posture_changes(pinsing.load("scara"), [0.1, 0.6, 0.1, 0.2])
        >>> print(found.text().splitlines()[0])
        scara: 1 other posture of this pose, reached only through a singularity (proven)
        """

        def shown(q: Array) -> str:
            return typed(q, self.arm.prismatic, degrees, digits=6)

        listed = [o for o in self.others if o.solution.regular]
        singular = [o for o in self.others if not o.solution.regular]
        here = [*self.names, *[f"aspect {self.aspect}"] * (self.aspect is not None)]
        lines = [f"{self.arm.name}: {self._answer(listed)}"]
        lines += [f"  This one: {', '.join(here)}"] * bool(here)
        barred = all(other.answer == DIFFERENT for other in listed)  # which is said above
        for k, other in enumerate(listed, 1):
            how = f"aspect {other.aspect}" if barred else self._how(other)
            called = ", ".join(filter(None, [*other.names, how]))
            lines += [f"  {k}  {called}".rstrip(), f"     {shown(other.solution.q)}"]
            way = other.connection
            if way is not None and way.answer == SAME and way.path is not None:
                by = way.path[1:-1] if len(way.path) <= 8 else ()
                lines += [f"       by {shown(q)}" for q in by]
        copies = max((o.copies for o in listed if o.answer == DIFFERENT), default=1)
        if copies > 1:
            lines.append(
                f"  The same holds with joints turned by whole turns: up to {copies:,} per posture"
            )
        if singular:
            count = len(singular)
            more = f"examples, {count} found" if count > 1 or self.aspect is None else "one"
            lines.append(f"  Singular solutions too ({more}), such as")
            lines.append(f"     {shown(singular[0].solution.q)}")
        notes = [f"note: {n}" for n in (self.doubt, *self.notes) if n]
        return "\n".join([*lines, *[""] * bool(notes), *notes])

    def _answer(self, others: list[PostureChange]) -> str:
        """Return how many others there are, and how many of them can be reached freely."""
        count, answers = len(others), [other.answer for other in others]
        head = f"{count} other posture{'s' * (count != 1)} of this pose"
        if self.aspect is None:
            return f"{head}; this one is singular or nearly so: no change from it is judged"
        if not count:
            return head
        ways = [o.connection for o in others if o.connection and o.answer == DIFFERENT]
        sure = "proven" if all(way.proven for way in ways) else "of the design"
        if len(ways) == count:
            all_ = "each " * (count > 1)
            return f"{head}, {all_}reached only through a singularity ({sure})"
        words = {
            DIFFERENT: f"only through one ({sure})",
            None: "outside the limits",
            UNDECIDED: "undecided",
        }
        said = [f"{answers.count(SAME)} reached without a singularity"]
        said += [f"{answers.count(a)} {how}" for a, how in words.items() if a in answers]
        return f"{head}: {', '.join(said)}"

    def _how(self, other: PostureChange) -> str:
        """Return how another posture is reached."""
        if (way := other.connection) is None:
            return "" if other.solution.within_limits else "outside the limits"
        if way.answer == SAME and way.path is not None:
            more = " (in the JSON)" if len(way.path) > 8 else ""
            sure = "without a singularity" if way.proven else "without meeting a family"
            return f"reached {sure} by {len(way.path)} waypoints{more}{_among(other)}"
        apart = f", aspect {other.aspect}" if other.aspect != self.aspect else ""
        if other.answer == DIFFERENT:
            sure = "proven" if way.proven else "of the design"
            return f"only through a singularity ({sure}){apart}"
        why = way.notes[0] if way.notes and way.answer != DIFFERENT else ""
        return f"undecided{f': {why}' if why else apart}{_among(other)}"


def _among(other: PostureChange) -> str:
    """Return what holds of the whole-turn copies, where there are several."""
    if (count := other.copies) < 2:
        return ""
    also = f", {other.copies_undecided:,} undecided" if other.copies_undecided else ""
    inside = f"{other.copies_in_aspect:,} in the aspect of the start"
    return f" ({count:,} whole-turn copies within the limits, {inside}{also})"


@checked
def posture_changes(
    arm: Arm,
    q: ArrayLike,
    *,
    forms: ClosedForm | None = None,
    limits: bool = True,
    fixed: Mapping[str, float] | None = None,
) -> PostureChanges:
    """Find the other inverse solutions of the pose at q, and which can be reached freely.

    Where limits are wider than a turn a solution has several whole-turn copies within them, which
    may be in different aspects (`pinsing.postures.changes`). All count: the copy that is
    reached is the one that is given, or else the one nearest to q; "different" is said where each
    is in another aspect. Copies of q itself are no other postures: a note counts them.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    q : (n,) or (nq,) array_like
        A configuration, radians and metres.
    forms : ClosedForm, optional
        Of the arm, if at hand.
    limits : bool
        Whether ways stay within the joint limits; else joints turn endlessly.
    fixed : mapping of str to float, optional
        Joints to hold, where the arm has more joints than the task has conditions; by default
        the first of those that are too many are held where they are in q, and it is said.

    Returns
    -------
    PostureChanges
        The other solutions, the aspect of each, and the way to it, if there is one.

    Raises
    ------
    ConfigurationError
        If q has the wrong length, is not finite, or is outside limits that count.
    OptionError, UnknownNameError
        As `inverse`; or if the form is of another arm.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.posture_changes(pinsing.load("ur5"), [0.1, -1, 1.2, 0.3, 0.9, 0.2])
    >>> {other.connection.answer for other in found.others if other.connection}
    {'different'}
    """
    here = arm.check_one(q, "q")
    form = forms_of(arm, forms)
    held, notes = _held(arm, here, fixed)
    found = aspects(form, limits)
    start = found.of(here)
    known = inverse(arm, tip_placement(arm, here).homogeneous, fixed=held, near=here)
    chosen, held_at = map_of(found, form), [arm.joints.index(j) for j in held]

    others, itself = [], False
    for s in known:
        if float(abs(arm.space.wrap(s.q - here)).max()) < _ITSELF:
            itself = True
            continue
        usable = s.regular and start is not None and (s.within_limits or not limits)
        names = posture_names(nominal(arm), s.q[None])[0] if s.regular else ()
        if not usable:
            others.append(PostureChange(s, None, None, names))
            continue
        copies = whole_turns(chosen, s.q, here, held=held_at)
        # The sign of the determinant is that of all copies.
        barred = opposite(form, here, copies.nearest)
        ways: list[Connection] = []
        for copy in (() if barred else copies.likely) or (copies.nearest,):
            ways.append(connect(form, here, copy, limits=limits, of=found))
            if ways[-1].answer == SAME:
                break
        way = ways[-1] if ways[-1].answer == SAME else ways[0]
        joined, open_ = copies.joined, copies.total - copies.joined - copies.apart
        told = (0, 0) if barred else (joined, open_)
        others.append(
            PostureChange(replace(s, q=way.end), way.aspects[1], way, names, copies.total, *told)
        )
    elsewhere = [j for j, x in held.items() if x != here[arm.joints.index(j)]]
    if elsewhere:
        notes.append(f"{', '.join(elsewhere)} held elsewhere than in q: all solutions are others")
    elif not itself and start is not None:  # of singular ones there are examples only
        notes.append("the configuration given was not found among the solutions: others may lack")
    if start is not None:
        notes += _own(whole_turns(chosen, here, here, held=held_at))
    order = {SAME: 0, UNDECIDED: 1, DIFFERENT: 2}
    free = (o.connection for o in others if o.connection and o.connection.answer == SAME)
    grounds = [n for way in free for n in way.notes]
    if found.word == NOT_COMPLETE:
        grounds += missing(form)
    others.sort(key=lambda o: 3 if o.answer is None else order[o.answer])
    return PostureChanges(
        arm=summarize(arm),
        q=here,
        aspect=start,
        within_limits=limits,
        others=tuple(others),
        doubt=known.doubt,
        notes=(*notes, *dict.fromkeys(grounds)),
        names=() if start is None else posture_names(nominal(arm), here[None])[0],
    )


def _own(copies: Copies) -> list[str]:
    """Return what is said of the whole-turn copies of the configuration itself."""
    more, inside = copies.total - 1, copies.joined - 1
    if not more:
        return []
    left = more - inside - copies.apart
    also = f", {left:,} undecided" if left else ""
    many = more > 1
    return [
        f"whole turns away, within the limits, {'are' if many else 'is'} {more:,} more "
        f"cop{'ies' if many else 'y'} of this configuration, not listed: {inside:,} in its aspect, "
        f"{copies.apart:,} in others{also}"
    ]


def _held(
    arm: Arm, q: Array, fixed: Mapping[str, float] | None
) -> tuple[Mapping[str, float], list[str]]:
    if fixed is not None:
        return fixed, []
    if (more := arm.n - generic_rank(arm)) <= 0:
        return {}, []
    names = [arm.joints[j] for j in _spare(arm, q, more)]
    said = ", ".join(names)
    note = f"{said} held where {'it is' if more == 1 else 'they are'}: fixed= chooses others"
    return {name: float(q[arm.joints.index(name)]) for name in names}, [note]


def _spare(arm: Arm, q: Array, more: int) -> tuple[int, ...]:
    """Joints to hold: in the middle, where the others can then meet all conditions of the task."""
    first = arm.n // 2 - 1
    middle = tuple(range(first, first + more))
    sets = [middle, *islice(combinations(range(arm.n), more), 1000)]
    away = arm.space.sample(8, np.random.default_rng(0), True)
    J = columns(arm, np.concatenate([q[None], away]))
    sizes = np.linalg.svd([np.delete(J, held, axis=2) for held in sets], compute_uv=False)
    share = sizes[:, :, generic_rank(arm) - 1] / sizes[:, :, 0]
    # At a singular configuration no set is good there; then what counts is how it is elsewhere.
    for good in (share[:, 0], np.median(share[:, 1:], axis=1)):
        if good.max() > _LITTLE:
            return middle if good[0] > _LITTLE else sets[int(good.argmax())]
    return middle


@checked
def line_postures(
    arm: Arm, q0: ArrayLike, pose: ArrayLike, *, forms: ClosedForm | None = None
) -> tuple[LinePosture, ...]:
    """Try a straight line of the tip in all other postures of the pose at which it starts.

    Joints that turn start as many whole turns away as keep them within their limits on all of
    the line, where that is possible; of the given posture, too, if it leaves them without.

    Parameters
    ----------
    arm : Arm
        A serial arm; where it has more joints than conditions there are endlessly many others,
        and none is tried.
    q0 : (n,) or (nq,) array_like
        Where the line starts, radians and metres.
    pose : (3,), (6,) or (4, 4) array_like
        Target, as of `check_line`.
    forms : ClosedForm, optional
        Of the arm, if at hand.

    Returns
    -------
    tuple of LinePosture
        Those that reach the end within the limits first; of these the clearest first.

    Raises
    ------
    ConfigurationError
        If q0 or the pose make no sense.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("scara")
    >>> [p.outcome for p in pinsing.postures.line_postures(arm, [0, 1.0, 0, 0], [0.4, 0.2, 0.1])]
    ['reached']
    """
    here = arm.check_one(q0, "q0")
    if arm.n != generic_rank(arm) or arm.coupling is not None:
        return ()
    form = forms_of(arm, forms, form_to_measure)
    try:
        known = inverse(arm, tip_placement(arm, here).homogeneous)
    except OptionError:
        return ()
    out = []
    for s in known:
        itself = bool(np.abs(arm.space.wrap(s.q - here)).max() < ALIKE)
        if not (s.regular or itself):
            continue
        start = here if itself else s.q
        try:
            line = check_line(arm, start, pose, forms=form)
        except ConfigurationError:
            continue
        turned = arm.space.turns_within(line.q)
        inside = not arm.space.outside(line.q + turned).any()
        if itself and not (inside and turned.any()):
            continue
        clear = min((a.lower for a in line.approaches), default=float("inf"))
        out.append(
            LinePosture(
                start + turned * inside,
                posture_names(nominal(arm), s.q[None])[0],
                line.outcome,
                line.s_end,
                inside,
                0.0 if line.crossings else clear,
            )
        )
    out.sort(key=lambda p: (p.outcome != "reached", not p.within_limits, -p.clearance, -p.s_end))
    return tuple(out)


POSES = 60

CUSPIDAL, NOT_CUSPIDAL, NO_EVIDENCE = "cuspidal", "not cuspidal", "no evidence"


_WITNESS = (
    "two inverse solutions of one pose are joined by a path on which no configuration is singular"
)
_CLEAR = "two inverse solutions of one pose are joined by a path that meets no family"
_THIN = (
    "the path is so near to singular configurations that a bound of how fast the Jacobian changes "
    "does not clear it; the equations of the closed form do"
)
_RANK = (
    "the rank along the path is proven from the Jacobian of the arm itself, with a bound of how "
    "fast it changes; no closed form is needed for that"
)


@dataclass(frozen=True, eq=False)
class Cuspidality(JsonResult):
    """Whether an arm can change its posture without meeting a singularity.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    answer : str
        "cuspidal": by ``witness``, or by ``reason``. "not cuspidal": proven, by ``reason``.
        "no evidence": nothing was found at ``poses`` poses.
    proven : bool
        Whether the answer is: a witness by its Jacobian alone, or by the certificate of a closed
        form that is complete.
    reason : str
        Why.
    witness : Connection or None
        Two inverse solutions of one pose, and a way from one to the other on which no
        configuration is singular.
    pose_error : float
        How much their poses differ, metres and radians; NaN without a witness.
    least_ratio : float
        Least sigma_r / sigma_1 at points of the way; NaN without.
    aspects : int or None
        Aspects without joint limits, where their count is proven.
    most_solutions : int
        Regular inverse solutions of one pose, at most, that were met.
    poses : int
        Poses that were looked at.
    notes : tuple of str
        What the answer rests on.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.cuspidality(pinsing.load("puma560"), poses=5).answer
    'not cuspidal'
    """

    schema: ClassVar[str] = "pinsing/cuspidality/1"
    made_by: ClassVar[str] = "pinsing.cuspidality(arm)"

    arm: ArmSummary
    answer: str
    proven: bool
    reason: str
    witness: Connection | None
    pose_error: float
    least_ratio: float
    aspects: int | None
    most_solutions: int
    poses: int
    notes: tuple[str, ...]

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> found = pinsing.cuspidality(pinsing.load("puma560"), poses=3)
        >>> print(found.text().splitlines()[0][:59])
        puma560: not cuspidal, proven: three axes of the wrist meet
        """
        name = self.arm.name
        if self.answer == CUSPIDAL:
            lines = [f"{name}: cuspidal, {'' if self.proven else 'not '}proven: {self.reason}"]
        elif self.answer == NOT_CUSPIDAL:
            lines = [f"{name}: not cuspidal, proven: {self.reason}"]
        else:
            none = f"{name}: no evidence in {self.poses} poses that the arm is cuspidal"
            lines = [none, self.reason]
        if self.witness is not None and self.witness.path is not None:
            lines.append(
                f"path of {len(self.witness.path)} waypoints; poses differ by "
                f"{self.pose_error:.1e}; least sigma_r/sigma_1 on it {self.least_ratio:.3g}:"
            )
            prismatic = self.arm.prismatic
            lines += [f"  {typed(q, prismatic, degrees, digits=10)}" for q in self.witness.path]
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


@checked
def cuspidality(
    arm: Arm, *, forms: ClosedForm | None = None, poses: int = POSES, seed: int = 0
) -> Cuspidality:
    """Look whether an arm is cuspidal: two regular inverse solutions of a pose in one aspect.

    Joint limits do not count (Wenger, 1992). That an arm is not cuspidal is proven where its
    inverse solution goes step by step, each with two answers that a sign tells apart
    (`pinsing.kinematics.ladder`), or where no point has more than two solutions.
    Poses are those of random configurations; of each
    all inverse solutions are found and told apart by their aspects. Where two share one, a way
    is found and proven to be regular throughout (`pinsing.kinematics.inverse`); that is a
    witness. With fewer joints than a pose has conditions regular means that the rank is the number
    of joints; the tip must then be able to leave in the same directions from both ends. Where a
    pose has more regular solutions than there are aspects, two must share one; that is a reason
    without a way.

    Parameters
    ----------
    arm : Arm
        A serial arm with as many joints as its task has conditions.
    forms : ClosedForm, optional
        Of the arm, if at hand.
    poses : int
        Random poses.
    seed : int
        Of the poses.

    Returns
    -------
    Cuspidality
        An answer that is proven, or how many poses gave none.

    Raises
    ------
    OptionError
        If joints and conditions do not agree in number, or the form is of another arm.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.cuspidality(pinsing.load("ur5"), poses=3).proven
    True
    """
    whole_number(poses, "poses", 1, 1_000_000)
    whole_number(seed, "seed", 0, MAX_SEED)
    rank = generic_rank(arm)
    OptionError.refuse_if(
        arm.n != rank,
        f"{arm.name} has {arm.n} joints and task {arm.task} {rank} conditions: whether an arm "
        "is cuspidal is asked where they are as many: choose joints or a task of pinsing.load",
    )
    form = forms_of(arm, forms)
    found = aspects(form, limits=False)
    sure, doubts = form.word == PROVEN, tuple(missing(form))
    most, tried, crowded = 0, 0, ""
    none = Cuspidality(
        arm=summarize(arm),
        answer=NO_EVIDENCE,
        proven=False,
        reason="no two inverse solutions are known to share an aspect",
        witness=None,
        pose_error=np.nan,
        least_ratio=np.nan,
        aspects=found.lower if found.proven else None,
        most_solutions=0,
        poses=poses,
        notes=doubts,
    )
    for k, q in enumerate(arm.space.sample(poses, np.random.default_rng(seed), True)):
        known = inverse(arm, tip_placement(arm, q).homogeneous, seed=seed, near=q)
        regular = [(found.of(s.q), s.q) for s in known if s.regular]
        most = max(most, len(regular))
        for (place, a), (other, b) in combinations(regular, 2):
            if place is None or place != other:
                continue
            tried += 1
            way = connect(form, a, b, limits=False, of=found)
            if way.answer != SAME or way.path is None:
                continue
            error, least = _checked(arm, way.path)
            apart = float(np.abs(arm.space.wrap(way.path[-1] - way.path[0])).max())
            alike = apart > 1e-3 and one_sheet(arm, way.path[0], way.path[-1])
            if error > ROUNDING or not alike:
                continue
            if proven := regular_way(arm, way.path):
                reason, said = _WITNESS, [_RANK, *[_few(arm, error)] * (arm.n < len(arm.task.rows))]
            elif least < PRACTICAL:
                # Too thin for the bound: the families stand for it, by their certificate.
                proven, reason, said = sure, _CLEAR, [_THIN, *doubts]
            else:
                continue
            return replace(
                none, answer=CUSPIDAL, proven=proven, reason=reason, witness=way, pose_error=error,
                least_ratio=least, most_solutions=most, poses=k + 1,
                notes=(*said, *nearly(arm, least)),
            )  # fmt: skip
        if found.proven and nominal(arm).exact and known.certified > found.lower:
            crowded = (
                f"a pose has {known.certified} regular inverse solutions, each proven to exist, "
                f"and there are {found.lower} aspects: two of them share one"
            )
    none = replace(none, most_solutions=most)
    if crowded:
        return replace(none, answer=CUSPIDAL, proven=sure, reason=crowded, notes=doubts)
    if (ladder := ladder_of(nominal(arm))) is not None:
        # This stands on the chain alone, and not on the closed form.
        about = () if nominal(arm).exact else ("this is about the nominal geometry",)
        return replace(none, answer=NOT_CUSPIDAL, proven=True, reason=ladder.reason, notes=about)
    if tried:
        none = replace(
            none, reason=f"{tried} pairs of solutions share an aspect, and no path was found"
        )
    elif found.proven:
        each = f"of each pose all inverse solutions are in different ones of {found.lower} aspects"
        none = replace(none, reason=each)
    return none


def _few(arm: Arm, error: float) -> str:
    return (
        f"with {arm.n} joints regular means rank {arm.n}, and the tip has only the poses that "
        f"these reach; it can leave in the same {arm.n} directions from both ends, so this is no "
        "chance crossing of two sheets of poses; that the ends have one pose rests on numbers: "
        f"they differ by {error:.1e}, and no step could take away a difference in other directions"
    )


def _checked(arm: Arm, path: Array) -> tuple[float, float]:
    """Return how much the poses at the ends differ, and the least sigma_r / sigma_1 on the way."""
    first, last = (tip_placement(arm, q) for q in (path[0], path[-1]))
    R = np.array(first.rotation)
    turned = turn_left(arm.task, R[None], np.array(last.rotation))[0]
    apart = np.abs(
        picked(arm.task, np.append(last.translation - first.translation, turned)[:, None], R)
    )
    share = np.linspace(0, 1, max(2, 400 // len(path)))[:, None]
    fine = np.concatenate([a + share * (b - a) for a, b in pairwise(path)])
    return float(apart.max()), float(ratios(arm, fine).min())
