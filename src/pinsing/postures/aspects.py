"""Aspects, the connected pieces that singular configurations cut joint space into, and grounds.

aspect_changes: where a motion leaves one for another.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import ClassVar

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.arguments import checked, typed
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.kinematics.ladder import ladder_of, posture_names
from pinsing.kinematics.newton import columns, regular_way
from pinsing.measures import PRACTICAL, ROUNDING, Array, ArrayLike
from pinsing.postures.joint_map import Map, Part, Piece, make_map, require_same_families
from pinsing.proximity.clearance import quick
from pinsing.proximity.crossings import check_times, crossings_of, motion_of
from pinsing.proximity.trajectory import AspectChange
from pinsing.proximity.watched import Forms, each_of, watch
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.robot.nominal import nominal
from pinsing.serialization import JsonResult

_PIECES = (2_000, 20_000)


PROVEN, PROBABLE, NOT_COMPLETE = "proven", "probable", "not complete"


def sureness(forms: Forms) -> str:
    """Return how sure it is that no family is missing: of several forms the least sure."""
    words = [form.word for form in each_of(forms)]
    return next((w for w in (NOT_COMPLETE, PROBABLE) if w in words), PROVEN)


def missing(forms: Forms) -> list[str]:
    """Return the doubts about completeness, in sentences; empty where there are none."""
    gaps = [g for form in each_of(forms) if not form.complete for g in form.gaps[:1]]
    if sureness(forms) == NOT_COMPLETE:
        because = f" ({gaps[0]})" if gaps else ""
        return [f"the closed form is not complete{because}: a family that is missing may cut more"]
    tried = [form.proof for form in each_of(forms) if form.proof and not form.proof.accepted]
    if tried:
        return [f"that no family is missing is probable: no certificate ({tried[0].reason})"]
    if sureness(forms) == PROBABLE:
        return ["that no family is missing is probable: no certificate was looked for"]
    return []


_OF_DESIGN = "aspects are of the design: where two walls meet this robot may pass between them"


def of_design(forms: Forms) -> list[str]:
    """Return what is to be said where the families are of a robot's design; empty elsewhere."""
    return [_OF_DESIGN] * any(form.tube is not None for form in each_of(forms))


def proven_regular(forms: Forms, path: Array) -> bool:
    """Return True if the rank along a path is proven from the Jacobian, for each form's task."""
    # Given up early where the families are probably all: then it is no more than a second proof.
    most = _PIECES[sureness(forms) == NOT_COMPLETE]
    arms = [form.loaded for form in each_of(forms)]
    return all(arm and arm.coupling is None and regular_way(arm, path, most) for arm in arms)


def opposite(forms: Forms, a: Array, b: Array) -> bool:
    """Return True if a square Jacobian's determinant differs in sign at a and b: they are apart."""
    for form in each_of(forms):
        arm = None if form.geometry is None else form.geometry.arm
        if arm is None or arm.coupling is not None or len(arm.task.rows) != arm.n:
            continue
        J = columns(arm, np.stack([a, b]))
        sizes = np.linalg.svd(J, compute_uv=False)
        if (sizes[:, -1] > ROUNDING * sizes[:, 0]).all() and np.prod(np.linalg.det(J)) < 0:
            return True
    return False


def nearly(arm: Arm, least: float) -> list[str]:
    """Say that a way is singular for all that a motor can tell, and what tiny lengths do."""
    if not least < PRACTICAL:
        return []
    # Lengths, in length scales, that rounding makes: no arm is built that exactly.
    small = 1e-6 * arm.length_scale
    if (ladder := ladder_of(nominal(arm, snap_length=small))) is None:
        found = "what the arm is without its tiny lengths is not known"
    else:
        found = f"with lengths under {small:.1g} m as zero the arm is not cuspidal: {ladder.reason}"
    return [f"the path is practically singular, sigma_r/sigma_1 falls to {least:.1e}; {found}"]


WORK = 5.0
"""Of `aspects`: arms with offset wrists use all of it, others 0.01. With 1.0 fewer changes of
posture are decided, with 20 hardly more."""
LISTED = 256
"""Aspects that are listed one by one; the rest are only counted."""

_EXAMPLES = 192


@dataclass(frozen=True, eq=False)
class Aspect:
    """One connected piece of joint space without a singular configuration that separates it.

    Attributes
    ----------
    number : int
        From 1 on.
    q : (n,) array
        A configuration well inside.
    clearance : float
        Lower bound of its distance to the nearest family, as by `clearance`.
    where : tuple of str
        What tells it apart: signs of equations, ranges of joints between singular values.
    signs : dict of str to int
        Sign of each equation that separates, by family; 0 where it takes both.
    names : tuple of str
        Words of the field, such as "elbow up", where it has some for this arm
        (`pinsing.kinematics.ladder`).
    """

    number: int
    q: Array
    clearance: float
    where: tuple[str, ...]
    signs: dict[str, int]
    names: tuple[str, ...] = field(default=(), metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class PartCount:
    """How many pieces some joints are cut into, whatever the others do.

    Attributes
    ----------
    joints : tuple of str
        The joints.
    families : tuple of str
        What cuts them.
    lower, upper : int
        No fewer, no more pieces.
    """

    joints: tuple[str, ...]
    families: tuple[str, ...]
    lower: int
    upper: int


@dataclass(frozen=True, eq=False)
class Aspects(JsonResult):
    """The aspects of an arm, counted.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    within_limits : bool
        Whether joints end at their limits; else they turn endlessly.
    lower : int
        There are no fewer aspects, whatever else separates.
    upper : int or None
        There are no more; None where that is not known.
    parts : tuple of PartCount
        Groups of joints that are cut independently; their counts multiply.
    listed : tuple of Aspect
        The aspects, at most 256 of them.
    families : tuple of str
        Families that separate: those of codimension 1.
    notes : tuple of str
        What was not counted, or what the counts rest on.
    seconds : float
        Time it took.
    word : str
        How sure it is that the families are all: "proven" by a certificate, "probable", or "not
        complete"; the count is then a lower bound.
    _map : Map or None
        Joint space piece by piece, which `of` and `connect` ask; not written to JSON.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.aspects(pinsing.closed_form(pinsing.load("scara")))
    >>> found.proven, found.lower == found.upper
    (True, True)
    """

    schema: ClassVar[str] = "pinsing/aspects/1"
    made_by: ClassVar[str] = "pinsing.aspects(forms)"

    arm: ArmSummary
    within_limits: bool
    lower: int
    upper: int | None
    parts: tuple[PartCount, ...]
    listed: tuple[Aspect, ...]
    families: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float
    word: str = field(default=PROBABLE, metadata={"optional": True})
    _map: Map | None = field(default=None, repr=False, metadata={"json": False})

    @property
    def proven(self) -> bool:
        """True if both bounds agree: no fewer, and no more by the families that are known.

        ``word`` says how sure it is that these are all.
        """
        return self.lower == self.upper

    def __len__(self) -> int:
        return len(self.listed)

    def __iter__(self) -> Iterator[Aspect]:
        return iter(self.listed)

    def __getitem__(self, index: int) -> Aspect:
        return self.listed[index]

    @checked
    def of(self, q: ArrayLike) -> int | None:
        """Return the number of the aspect that a configuration is in.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Joint values, radians and metres; whole turns of joints that turn endlessly do not
            matter.

        Returns
        -------
        int or None
            From 1 on; None where it is singular (on a family, within 1e-9 rad), or where it could
            not be told, which happens only very near to one.

        Raises
        ------
        ConfigurationError
            If q has the wrong length, is not finite, or is outside the limits that count.

        Examples
        --------
        >>> import pinsing
        >>> found = pinsing.aspects(pinsing.closed_form(pinsing.load("ur5")))
        >>> len({found.of(aspect.q) for aspect in found})
        16
        """
        chosen = self._asked()
        place = chosen.place(chosen.check(q))
        return None if place is None else chosen.number(place)

    def _asked(self) -> Map:
        if self._map is None:
            raise OptionError("aspects that were read from JSON cannot be asked: make them again")
        return self._map

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
        >>> form = pinsing.closed_form(pinsing.load("stanford"))
        >>> print(pinsing.aspects(form).text().splitlines()[0])
        stanford: 8 aspects within the joint limits, proven
        """
        where = "within the joint limits" if self.within_limits else "without joint limits"
        if self.proven:
            head = f"{self.lower} aspect{'s' * (self.lower != 1)} {where}, proven"
            head += " for the design" * (_OF_DESIGN in self.notes)
            if self.word != PROVEN:
                head += " for the families found; that these are all is probable"
        elif self.upper is None:
            plural = "s" * (self.lower != 1)
            head = f"at least {self.lower} aspect{plural} {where}; how many more is not known"
        else:
            head = f"{self.lower} to {self.upper} aspects {where}"
        lines = [f"{self.arm.name}: {head}"]
        cut = [p for p in self.parts if p.families]
        for p in cut:
            count = f"{p.lower}" if p.lower == p.upper else f"{p.lower} to {p.upper}"
            lines.append(f"  {', '.join(p.joints)}: {count} ({', '.join(p.families)})")
        if len(self.listed) > self.lower:
            lines.append("  Regions of one sign that are listed apart may be one aspect")
        if len(self.listed) > 1:
            lines.append("")
        for a in self.listed if len(self.listed) > 1 else ():
            said = "; ".join(", ".join(words) for words in (a.names, a.where) if words)
            lines.append(f"{a.number:>4}  {said}")
            lines.append(f"      {typed(a.q, self.arm.prismatic, degrees, digits=4)}")
        if self.lower > len(self.listed):
            lines.append(f"(the first {len(self.listed)} of them)")
        lines += [f"note: {n}" for n in self.notes]
        return "\n".join(lines)


@checked
def aspects(forms: Forms, limits: bool = True, *, work: float = WORK) -> Aspects:
    """Count the aspects of an arm: the connected pieces of joint space less what is singular.

    Only families of codimension 1 separate. Joint values cut their joint; equations are looked
    at over the joints that they share, by algebra where one joint turns endlessly and is in
    every term once, else by certified subdivision (`pinsing.postures.joint_map`).

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm.
    limits : bool
        Within the joint limits, or with joints that turn endlessly.
    work : float
        Work after which counting ends, with bounds that need not agree; the same on every
        machine: in seconds of an idle one.

    Returns
    -------
    Aspects
        A lower and an upper bound, and the aspects. ``proven`` where the bounds agree.

    Raises
    ------
    OptionError
        If forms are none, or of different arms, or an option makes no sense.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("ur5"))
    >>> pinsing.aspects(form).lower, pinsing.aspects(form, limits=False).lower
    (16, 8)
    """
    OptionError.refuse_if(not work > 0, f"work must be positive, got {work!r}")
    begin = time.monotonic()
    budget = Budget(math.inf, work)
    chosen = make_map(forms, limits, budget)
    cut = chosen.partition
    lower, upper = 1, 1
    exact = cut.exact
    parts = []
    for part, pieces in zip(cut.parts, chosen.pieces, strict=True):
        low, high = (sum(getattr(p.found, k) for p in pieces) for k in ("lower", "upper"))
        exact &= all(p.found.closed for p in pieces)
        lower, upper = lower * low, upper * high
        joints = tuple(chosen.watched.joints[j] for j in part.joints)
        parts.append(PartCount(joints, part.families, low, high))
    form = each_of(forms)[0]
    notes = [*missing(forms), *of_design(forms), *dict.fromkeys(cut.notes)]
    if lower != upper and budget.over:
        notes.append(f"counting ended after {budget.allowed}")
    return Aspects(
        arm=form.arm,
        within_limits=limits,
        lower=lower,
        upper=upper if exact else None,
        parts=tuple(parts),
        listed=_listed(chosen, form),
        families=cut.cutting,
        notes=tuple(notes),
        seconds=time.monotonic() - begin,
        word=sureness(forms),
        _map=chosen,
    )


def map_of(found: Aspects, forms: Forms) -> Map:
    """The pieces of joint space that aspects stand on, if they are those of these forms."""
    chosen = found._asked()
    require_same_families(watch(forms), chosen.watched)
    return chosen


def _listed(chosen: Map, form: ClosedForm) -> tuple[Aspect, ...]:
    """Aspects with the words of the field, which are those of their representatives."""
    rng, found = np.random.default_rng(0), []
    for place in islice(chosen.places(), LISTED):
        where: list[str] = []
        signs: dict[str, int] = {}
        Q = np.zeros((_EXAMPLES, chosen.watched.n))
        parts = zip(chosen.partition.parts, chosen.pieces, place, strict=True)
        for part, pieces, (box, component) in parts:
            piece = pieces[box]
            x = piece.examples(component)
            drawn = np.append(0, rng.integers(0, len(x), _EXAMPLES - 1))
            Q[:, list(part.joints)] = x[drawn]
            where += _where(chosen, part, piece, component)
            for surface, s in zip(part.surfaces, piece.signs(component), strict=True):
                signs[surface.family] = signs.get(surface.family, 1) * s
        clear = np.full(len(Q), math.inf)
        if chosen.watched.families:
            clear = quick(chosen.watched, Q).lower
        best = int(np.argmax(clear))
        found.append(Aspect(chosen.number(place), Q[best], float(clear[best]), tuple(where), signs))
    if form.geometry is None or not found:
        return tuple(found)
    words = posture_names(form.geometry, np.array([a.q for a in found]))
    return tuple(replace(a, names=names) for a, names in zip(found, words, strict=True))


def _where(chosen: Map, part: Part, piece: Piece, component: int) -> Iterator[str]:
    for j, arc in zip(part.joints, piece.box, strict=True):
        if len(part.arcs[part.joints.index(j)]) > 1:
            slides = bool(chosen.watched.prismatic[j])
            ends = f"{_end(arc.low, slides)} to {_end(arc.high, slides)}"
            yield f"{chosen.watched.joints[j]} in {ends}"
    signs = piece.signs(component)
    for surface, s in zip(part.surfaces, signs, strict=True):
        if s:
            yield f"{surface.family} {'>' if s > 0 else '<'} 0"
    alike = [c for c in range(piece.found.upper) if piece.signs(c) == signs]
    if len(alike) > 1:
        yield f"piece {alike.index(component) + 1} of {len(alike)}"


def _end(x: float, slides: bool) -> str:
    if math.isinf(x):
        return "infinity" if x > 0 else "-infinity"
    return f"{x:.4g} m" if slides else f"{math.degrees(x):.4g}°"


@checked
def aspect_changes(
    forms: Forms, Q: ArrayLike, t: ArrayLike | None = None, *, of: Aspects | None = None
) -> tuple[AspectChange, ...]:
    """Find where a motion changes its aspect.

    It meets families that separate at places none of which is missing (`crossings`); of the
    configurations halfway between these the aspect is looked up.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of the arm.
    Q : (N, n) or (N, nq) array_like
        Samples, radians and metres; joints move linearly between them.
    t : (N,) array_like, optional
        Seconds, ascending; without them t counts samples from 0.
    of : Aspects, optional
        Aspects of the arm, if at hand; by default those within the limits where the motion is
        within them, else those of joints that turn endlessly. Where their count is not proven,
        two numbers may be of one aspect.

    Returns
    -------
    tuple of AspectChange
        In the order of time; a family that is met without another aspect behind it is left out.

    Raises
    ------
    ConfigurationError
        If Q has the wrong shape, a value that is not finite, or leaves the limits of ``of``.
    OptionError
        If forms are none, or of different arms, or times do not ascend; if ``of``
        are the aspects of another arm.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("scara"))
    >>> change, = pinsing.postures.aspect_changes(form, [[0, -1, 0, 0], [0, 1, 0, 0]])
    >>> round(change.t, 9), change.before, change.after
    (0.5, 1, 2)
    """
    OptionError.refuse_if(
        not isinstance(forms, ClosedForm) and not len(forms),
        "forms must be a ClosedForm, or several of one arm: see closed_form",
    )
    arm, geometry = each_of(forms)[0].arm, each_of(forms)[0].geometry
    samples = watch(forms).check(Q)
    ConfigurationError.refuse_if(
        samples.ndim != 2 or not len(samples),
        f"a trajectory has shape (N, {arm.n}), one column a joint; got {samples.shape}",
    )
    times = check_times(t, len(samples))
    if len(samples) == 1:
        return ()
    if of is None:
        inside = (samples >= arm.lower - 1e-9) & (samples <= arm.upper + 1e-9)
        of = aspects(forms, bool(inside.all()))
    chosen = map_of(of, forms)
    met = crossings_of(chosen.cutting, motion_of(chosen.cutting, samples, times))
    # Share of the motion within which two meetings are one.
    alike = 1e-9 * max(float(times[-1] - times[0]), 1e-300)
    groups: list[tuple[float, float, set[str]]] = []
    for event in sorted(met, key=lambda e: e.t):
        start, end, names = event.t, event.t_end, {event.family}
        if groups and start - groups[-1][1] <= alike:
            before = groups.pop()
            start, end, names = before[0], max(before[1], end), before[2] | names
        groups.append((start, end, names))
    begin, until = [times[0], *(g[1] for g in groups)], [*(g[0] for g in groups), times[-1]]
    halfway = np.stack(
        [np.interp(np.add(begin, until) / 2, times, column) for column in samples.T], axis=1
    )
    sides = zip(halfway, begin, until, strict=True)
    numbers = [of.of(q) if b > a else None for q, a, b in sides]
    words: list[tuple[str, ...]] = [()] * len(halfway)
    if geometry is not None:
        words = posture_names(geometry, halfway)
    changes = (
        AspectChange(t, tuple(sorted(names)), numbers[k], numbers[k + 1], words[k], words[k + 1])
        for k, (t, _, names) in enumerate(groups)
    )
    return tuple(c for c in changes if None not in (c.before, c.after) and c.before != c.after)
