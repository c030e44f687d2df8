"""Aspects, the connected pieces that singular configurations cut joint space into, and grounds.

aspect_changes: where a motion leaves one for another.

connect: join two configurations by a path without a singularity, or prove that there is none.

How clear a way is, and how waypoints are pushed away from what is near.

All families count: one of two conditions or more separates nothing, but is singular.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice, pairwise, product
from typing import ClassVar

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.interface import JsonResult, Sequenced, checked, typed
from pinsing.kinematics.inverse import columns, regular_way
from pinsing.kinematics.ladder import ladder_of, posture_names
from pinsing.measures import PRACTICAL, ROUNDING, Array, ArrayLike
from pinsing.postures.joint_map import (
    Map,
    Piece,
    Spot,
    apart,
    make_map,
    require_same_families,
    toward,
)
from pinsing.proximity.clearance import Forms, each_of, watch
from pinsing.proximity.crossings import check_times, crossings_of, least_along, motion_of
from pinsing.proximity.trajectory import AspectChange, angle_text
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.robot.nominal import nominal

PROVEN, PROBABLE, NOT_COMPLETE = "proven", "probable", "not complete"


def sureness(forms: Forms) -> str:
    """Return how sure it is that no family is missing: of several forms the least sure."""
    words = [form.word for form in each_of(forms)]
    return next((w for w in (NOT_COMPLETE, PROBABLE) if w in words), PROVEN)


def missing(forms: Forms) -> list[str]:
    """Return the doubts about completeness, in sentences; empty where there are none."""
    every, sure = each_of(forms), sureness(forms)
    if sure == PROVEN:
        return []
    if sure == NOT_COMPLETE:
        gaps = [gap for form in every if not form.complete for gap in form.gaps[:1]]
        because = f" ({gaps[0]})" if gaps else ""
        return [f"the closed form is not complete{because}: a family that is missing may cut more"]
    tried = [form.proof.reason for form in every if form.proof and not form.proof.accepted]
    why = f"no certificate ({tried[0]})" if tried else "no certificate was looked for"
    return [f"that no family is missing is probable: {why}"]


_OF_DESIGN = "aspects are of the design: where two walls meet this robot may pass between them"


def of_design(forms: Forms) -> list[str]:
    """Return what is to be said where the families are of a robot's design; empty elsewhere."""
    return [_OF_DESIGN] * any(form.tube is not None for form in each_of(forms))


def proven_regular(forms: Forms, path: Array) -> bool:
    """Return True if the rank along a path is proven from the Jacobian, for each form's task."""
    # Given up early where the families are probably all: then it is no more than a second proof.
    most = 20_000 if sureness(forms) == NOT_COMPLETE else 2_000
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
class Aspects(JsonResult, Sequenced[Aspect]):
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
    _items: ClassVar[str] = "listed"
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
        plural = "s" * (self.lower != 1)
        if self.proven:
            head = f"{self.lower} aspect{plural} {where}, proven"
            head += " for the design" * (_OF_DESIGN in self.notes)
            if self.word != PROVEN:
                head += " for the families found; that these are all is probable"
        elif self.upper is None:
            head = f"at least {self.lower} aspect{plural} {where}; how many more is not known"
        else:
            head = f"{self.lower} to {self.upper} aspects {where}"
        lines = [f"{self.arm.name}: {head}"]
        for p in (p for p in self.parts if p.families):
            count = f"{p.lower}" if p.lower == p.upper else f"{p.lower} to {p.upper}"
            lines.append(f"  {', '.join(p.joints)}: {count} ({', '.join(p.families)})")
        if len(self.listed) > self.lower:
            lines.append("  Regions of one sign that are listed apart may be one aspect")
        if len(self.listed) > 1:
            lines.append("")
            for a in self.listed:
                said = "; ".join(", ".join(words) for words in (a.names, a.where) if words)
                q = typed(a.q, self.arm.prismatic, degrees, digits=4)
                lines += [f"{a.number:>4}  {said}", f"      {q}"]
        if self.listed and self.lower > len(self.listed):
            lines.append(f"(the first {len(self.listed)} of them)")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


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
    parts = []
    for part, pieces in zip(chosen.parts, chosen.pieces, strict=True):
        # An equation is not zero on all of a box: one component at least, seen or not.
        low, high = (sum(max(1, getattr(p.found, k)) for p in pieces) for k in ("lower", "upper"))
        joints = tuple(chosen.watched.joints[j] for j in part.joints)
        parts.append(PartCount(joints, part.families, low, high))
    lower, upper = (math.prod(getattr(p, k) for p in parts) for k in ("lower", "upper"))
    exact = chosen.exact and all(p.found.closed for pieces in chosen.pieces for p in pieces)
    form = each_of(forms)[0]
    notes = [*missing(forms), *of_design(forms), *dict.fromkeys(chosen.notes)]
    if lower != upper and budget.over:
        notes.append(f"counting ended after {budget.allowed}")
    return Aspects(
        arm=form.arm,
        within_limits=limits,
        lower=lower,
        upper=upper if exact else None,
        parts=tuple(parts),
        listed=tuple(_listed(chosen, form)),
        families=chosen.cutting.names,
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


def _listed(chosen: Map, form: ClosedForm) -> Iterator[Aspect]:
    """Aspects with the words of the field, which are those of their representatives."""
    rng = np.random.default_rng(0)
    for place in islice(product(*chosen.components), LISTED):
        where: list[str] = []
        signs: dict[str, int] = {}
        Q = np.zeros((192, chosen.watched.n))  # of which the clearest is given
        for piece, component in place:
            x = piece.examples(component)
            Q[:, list(piece.part.joints)] = x[np.append(0, rng.integers(0, len(x), len(Q) - 1))]
            where += _where(chosen, piece, component)
            for surface, s in zip(piece.part.surfaces, piece.signs(component), strict=True):
                signs[surface.family] = signs.get(surface.family, 1) * s
        clear = chosen.clearance(Q)
        best = int(np.argmax(clear))
        (names,) = posture_names(form.geometry, Q[best, None])
        number = chosen.number(place)
        yield Aspect(number, Q[best], float(clear[best]), tuple(where), signs, names)


def _where(chosen: Map, piece: Piece, component: int) -> Iterator[str]:
    part, signs = piece.part, piece.signs(component)
    for j, arcs, arc in zip(part.joints, part.arcs, piece.box, strict=True):
        if len(arcs) > 1:
            slides = bool(chosen.watched.prismatic[j])
            ends = f"{_end(arc.low, slides)} to {_end(arc.high, slides)}"
            yield f"{chosen.watched.joints[j]} in {ends}"
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
    form, samples = each_of(forms)[0], watch(forms).check(Q)
    ConfigurationError.refuse_if(
        samples.ndim != 2 or not len(samples),
        f"a trajectory has shape (N, {form.arm.n}), one column a joint; got {samples.shape}",
    )
    times = check_times(t, len(samples))
    if len(samples) == 1:
        return ()
    if of is None:
        inside = (samples >= form.arm.lower - 1e-9) & (samples <= form.arm.upper + 1e-9)
        of = aspects(forms, bool(inside.all()))
    cutting = map_of(of, forms).cutting
    met = sorted(crossings_of(cutting, motion_of(cutting, samples, times)), key=lambda e: e.t)
    # Share of the motion within which two meetings are one.
    alike = 1e-9 * max(float(times[-1] - times[0]), 1e-300)
    ends = np.maximum.accumulate([event.t_end for event in met])
    first = [k for k, event in enumerate(met) if not k or event.t - ends[k - 1] > alike]
    groups = [met[i:j] for i, j in pairwise([*first, len(met)])]
    begin = [times[0], *(ends[k - 1] for k in first[1:]), *ends[-1:]]
    until = [*(group[0].t for group in groups), times[-1]]
    halfway = np.stack(
        [np.interp(np.add(begin, until) / 2, times, column) for column in samples.T], axis=1
    )
    sides = zip(halfway, begin, until, strict=True)
    numbers = [of.of(q) if b > a else None for q, a, b in sides]
    told = list(zip(numbers, posture_names(form.geometry, halfway), strict=True))
    changes = (
        AspectChange(group[0].t, tuple(sorted({e.family for e in group})), a, b, before, after)
        for group, ((a, before), (b, after)) in zip(groups, pairwise(told), strict=True)
    )
    return tuple(c for c in changes if None not in (c.before, c.after) and c.before != c.after)


_STATIONS = 40
"""Waypoints that are pushed, at most; evenly along the way."""
_PROBE = 0.01
_STRIDE = 0.12
_ASIDE = np.geomspace(0.02, 0.8, 6)
"""How far a way bends, radians, that goes round what separates nothing."""


def lowest(chosen: Map, Q: Array) -> float:
    """Least lower bound of the clearance at some points of a polyline."""
    share = np.linspace(0, 1, 24)
    fine = np.concatenate([a + share[:, None] * (b - a) for a, b in pairwise(Q)])
    return float(chosen.clearance(fine).min())


def shortened(
    chosen: Map, Q: Array, clear: Callable[[Array], bool], lines: Iterator[int], keep: float = 0.7
) -> Array:
    """Leave out waypoints where the straight line is clear, while there are ``lines`` to try."""
    kept = [0]
    last = len(Q) - 1
    while kept[-1] < last:
        i = kept[-1]
        best, step = i + 1, 2
        while i + step <= last + step // 2 and next(lines, None) is not None:
            j = min(i + step, last)
            line = Q[[i, j]]
            enough = clear(line) and lowest(chosen, line) >= min(
                keep * lowest(chosen, Q[i : j + 1]), 0.3
            )
            best = j if enough else best
            if best == last or not enough:
                break
            step *= 2
        kept.append(best)
    return Q[kept]


def least(chosen: Map, path: Array) -> float:
    """Return a proven lower bound of the clearance of a polyline."""
    lower, length = chosen.clearance(path), chosen.watched.length
    known = float(lower.min())
    return least_along(path, lower, known, length, chosen.clearance, 200_000, 0.05)[0]


def raised(chosen: Map, path: Array, lines: Iterator[int]) -> Array:
    """Return a clearer way between the same ends, where pushing its waypoints finds one."""
    # Along differences of the clearance; kept where its certified least clearance is larger. It is
    # never larger than that of the ends.
    most = float(chosen.clearance(path[[0, -1]]).min())
    best, bound = path, least(chosen, path)
    points, stride = _stations(chosen, path), _STRIDE
    for _ in range(8):
        # Share of the clearance of the nearer end at which a way is clear enough: it can have no
        # more.
        if bound >= 0.85 * most:
            break
        tried = _pushed(chosen, points, most, stride)
        now = least(chosen, tried) if chosen.regular(tried) else 0.0
        if now > 1.02 * bound:
            points, best, bound = tried, tried, now
        elif stride > _STRIDE / 8:
            stride /= 2
        else:
            break
    if best is path:
        return path
    # What was laid in for the push is left out again where that costs nothing.
    short = shortened(chosen, best, chosen.regular, lines, keep=0.98)
    return short if chosen.regular(short) and least(chosen, short) >= 0.9 * bound else best


def beside(chosen: Map, path: Array) -> Array | None:
    """Return a way that meets no family, near one that meets none that separates; or None."""
    # Nearly every way misses what has two conditions: random bends, small ones first, are tried.
    if chosen.regular(path):
        return path
    points = _stations(chosen, path)
    bend = np.sin(np.pi * np.linspace(0, 1, len(points)))[:, None]
    low, high = chosen.low, chosen.high
    rng = np.random.default_rng(0)
    for size in _ASIDE.tolist():
        for direction in rng.normal(size=(4, path.shape[1])):
            aside = size * direction / np.linalg.norm(direction) / chosen.watched.weight
            tried: Array = np.clip(points + bend * aside, low, high)
            tried[0], tried[-1] = path[0], path[-1]
            if chosen.regular(tried):
                return tried
    return None


def _stations(chosen: Map, path: Array) -> Array:
    """The ends and the waypoints of a way, with points in between, evenly by length."""
    along = np.append(0.0, np.cumsum(chosen.watched.length(np.diff(path, axis=0))))
    if along[-1] == 0:
        return path
    even = np.linspace(0.0, along[-1], _STATIONS)
    at = np.union1d(even, along) if len(path) <= _STATIONS else even
    points = np.stack([np.interp(at, along, column) for column in path.T], axis=1)
    points[0], points[-1] = path[0], path[-1]
    return points


def _pushed(chosen: Map, points: Array, most: float, stride: float) -> Array:
    """Points between the ends, those that are nearer than an end pushed away by gradient."""
    out = points.copy()
    inner = out[1:-1]
    unit = 1 / chosen.watched.weight
    low, high = chosen.low, chosen.high
    probe = _PROBE * np.diag(unit)
    for _ in range(4):
        here = chosen.clearance(inner)
        near = np.flatnonzero(here < most)
        if not len(near):
            break
        x = inner[near]
        ahead, behind = (
            chosen.clearance((x[:, None, :] + s * probe).reshape(-1, x.shape[1])) for s in (1, -1)
        )
        slope = (ahead - behind).reshape(x.shape) / (2 * _PROBE)
        size = np.linalg.norm(slope, axis=1, keepdims=True)
        step = np.minimum(stride, np.maximum(most - here[near], 0))[:, None]
        inner[near] = np.clip(x + step * slope / np.maximum(size, 1e-12) * unit, low, high)
    return out


_LINES = 1_000
"""Straight lines that may be tried instead of the waypoints of one way, a few milliseconds each."""

_RANK = (
    "the rank along the path is proven from the Jacobian, with a bound of how fast it changes: "
    "no certificate of the families is needed"
)

_KNOWN = (
    "a path was found that meets no known family; that no configuration on it is singular "
    "is not proven"
)
_SIGNS = "the determinant of the Jacobian is positive at one and negative at the other"

SAME, DIFFERENT, UNDECIDED = "same", "different", "undecided"


@dataclass(frozen=True, eq=False)
class Connection(JsonResult):
    """Two configurations: in one aspect or not.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    answer : str
        "same": joined by ``path``, which meets no family. "different": proven to be in different
        aspects, whatever other families there are. "undecided".
    start, end : (n,) arrays
        The configurations.
    aspects : tuple of int or None
        Numbers of their aspects, as `Aspects` has them; None where it could not be told.
    path : (K, n) array or None
        Waypoints, joined by straight lines in joint space: proven to meet no family. The last
        is ``end`` but for whole turns of joints that turn endlessly.
    clearance : float
        No configuration of a family is nearer to the path, proven; NaN without, infinite where
        there is no family.
    length : float
        Of the path, radians (metres over the length scale); NaN without.
    within_limits : bool
        Whether joints end at their limits.
    notes : tuple of str
        What the answer rests on.
    proven : bool
        Whether the answer is. "different" always is. "same" is where a certificate says that no
        family is missing, or where the rank all along the path is proven from the Jacobian.
    singular : tuple of str
        The family that the start is on, and that the end is on; empty where it is on none. What
        is singular is in no aspect, and no way was looked for.
    """

    schema: ClassVar[str] = "pinsing/connection/1"
    made_by: ClassVar[str] = "pinsing.connect(forms, qa, qb)"

    arm: ArmSummary
    answer: str
    start: Array
    end: Array
    aspects: tuple[int | None, int | None]
    path: Array | None
    clearance: float
    length: float
    within_limits: bool
    notes: tuple[str, ...]
    proven: bool = field(default=False, metadata={"optional": True})
    singular: tuple[str, str] = field(default=("", ""), metadata={"optional": True})

    @property
    def same(self) -> bool | None:
        """True, False, or None where it is undecided."""
        return {SAME: True, DIFFERENT: False}.get(self.answer)

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
        >>> form = pinsing.closed_form(pinsing.load("scara"))
        >>> print(pinsing.connect(form, [0, 1, 0, 0], [0, 2, 0, 0]).text().splitlines()[0])
        same aspect: joined by a path on which no configuration is singular, proven
        """
        notes = self.notes
        if self.answer == DIFFERENT:
            a, b = self.aspects
            which = f"{a} and {b}" if a != b else f"both of what is known as {a}"
            sure = "proven" if self.proven else "of the design"
            lines = [
                f"different aspects ({which}), {sure}: every path from one to the other meets a "
                "singular configuration"
            ]
        elif any(self.singular):
            lines, notes = [notes[0]], notes[1:]
        elif self.answer == UNDECIDED and None in self.aspects and notes:
            lines, notes = [f"undecided: {notes[0]}"], notes[1:]
        elif self.answer == UNDECIDED or self.path is None:
            lines = ["undecided: no path was found, and none is ruled out"]
        else:
            sure = "on which no configuration is singular, proven"
            clear = f"clearance of the path: at least {angle_text(self.clearance, degrees)}"
            if math.isinf(self.clearance):
                clear = "there is no family to keep away from"
            lines = [
                f"same aspect: joined by a path {sure if self.proven else 'that meets no family'}",
                f"{clear}; {len(self.path)} waypoints:",
                *(f"  {typed(q, self.arm.prismatic, degrees, digits=6)}" for q in self.path),
            ]
        return "\n".join([*lines, *(f"note: {n}" for n in notes)])


@checked
def connect(
    forms: Forms,
    qa: ArrayLike,
    qb: ArrayLike,
    *,
    limits: bool = True,
    of: Aspects | None = None,
) -> Connection:
    """Join two configurations without a singularity, or prove that it cannot be done.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm.
    qa, qb : (n,) or (nq,) array_like
        The configurations, radians and metres.
    limits : bool
        Within the joint limits, or with joints that turn endlessly.
    of : Aspects, optional
        The aspects of the same arm and limits, where they are at hand.

    Returns
    -------
    Connection
        "same" with a way, "different", or "undecided".

    Raises
    ------
    ConfigurationError
        If a configuration has the wrong length, is not finite, or is outside the limits.
    OptionError
        If forms are none, or of different arms, or an option makes no sense; if ``of`` are the
        aspects of another arm.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("ur5"))
    >>> pinsing.connect(form, [0, -1, 1, 0, 1, 0], [0, -1, 1, 0, -1, 0]).answer
    'different'
    """
    found = aspects(forms, limits) if of is None else of
    OptionError.refuse_if(
        found.within_limits != limits,
        "the aspects given are "
        + ("of " if found.within_limits else "not of ")
        + "the space within the limits; limits says otherwise",
    )
    chosen, design = map_of(found, forms), of_design(forms)
    start, end = chosen.check(qa), chosen.check(qb)
    here, there = chosen.place(start), chosen.place(end)
    a, b = (None if p is None else chosen.number(p) for p in (here, there))
    answer, path, sure = UNDECIDED, None, False
    singular = (chosen.on(start), chosen.on(end))
    notes: list[str] = []
    if any(singular):
        which, names = _which(map(bool, singular)), " and ".join(filter(None, singular))
        are, belong = ("are", "belong") if all(singular) else ("is", "belongs")
        notes.append(f"{which} {are} singular, on {names}, and {belong} to no aspect")
    elif here is None or there is None:
        which = _which((here is None, there is None))
        notes.append(f"the aspect of {which} is undecided: a boundary is near")
    elif (parts := any(map(apart, here, there))) or opposite(forms, start, end):
        answer, sure, notes = DIFFERENT, not design, [*[_SIGNS] * (not parts), *design]
    elif (path := _way(chosen, here, start, end, lines := iter(range(_LINES)))) is None:
        where = f"within aspect {a}" if a == b else f"from aspect {a} to {b}, perhaps one"
        notes.append(f"no path was found {where}")
    else:
        answer, path = SAME, raised(chosen, path, lines)
        sure = sureness(forms) == PROVEN and not design
        if not sure and (sure := proven_regular(forms, path)):
            notes.append(_RANK)
        elif not sure:
            notes += [_KNOWN, *missing(forms)]
            if sureness(forms) == NOT_COMPLETE:
                answer, path = UNDECIDED, None
    clear = length = math.nan
    if path is not None:
        clear = least(chosen, path)
        length = float(chosen.watched.length(np.diff(path, axis=0)).sum())
    return Connection(
        arm=found.arm,
        answer=answer,
        start=start,
        end=end,
        aspects=(a, b),
        path=path,
        clearance=clear,
        length=length,
        within_limits=limits,
        notes=tuple(notes),
        proven=sure,
        singular=singular,
    )


def _which(ends: Iterable[bool]) -> str:
    return " and ".join(w for w, s in zip(("the start", "the end"), ends, strict=True) if s)


def _way(
    chosen: Map, place: tuple[Spot, ...], start: Array, end: Array, lines: Iterator[int]
) -> Array | None:
    """A polyline from start to end that is clear, part by part where a straight one is not."""
    path = np.stack([start, toward(start, end, chosen.endless)])
    if chosen.clear(path):
        return beside(chosen, path)
    rows = [start]
    for piece, _ in place:
        here = rows[-1]
        a, b = (chosen.on_arcs(piece, q) for q in (here, end))
        if a is None or b is None:
            return None
        if np.array_equal(a, b):
            continue
        if (route := piece.route(a, b, chosen.clear_in(piece.part, here))) is None:
            return None
        path = np.repeat(here[None], len(route), axis=0)
        path[:, list(piece.part.joints)] += route - a
        rows += list(shortened(chosen, path, chosen.clear, lines)[1:])
    path = shortened(chosen, np.array(rows), chosen.clear, lines)
    return beside(chosen, path) if chosen.clear(path) else None
