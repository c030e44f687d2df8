"""connect: join two configurations by a path without a singularity, or prove that there is none.

How clear a way is, and how waypoints are pushed away from what is near.

All families count: one of two conditions or more separates nothing, but is singular.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar

import numpy as np

from pinsing.arguments import checked, typed
from pinsing.errors import OptionError
from pinsing.measures import Array, ArrayLike
from pinsing.postures.aspects import (
    NOT_COMPLETE,
    PROVEN,
    Aspects,
    aspects,
    map_of,
    missing,
    of_design,
    opposite,
    proven_regular,
    sureness,
)
from pinsing.postures.joint_map import Map, toward
from pinsing.proximity.clearance import quick
from pinsing.proximity.passage import least_along
from pinsing.proximity.watched import Forms
from pinsing.robot.arm import ArmSummary
from pinsing.serialization import JsonResult

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
    return float(quick(chosen.watched, fine).lower.min())


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

    def bounded(Q: Array) -> Array:
        return quick(chosen.watched, Q).lower

    lower, length = bounded(path), chosen.watched.length
    if not chosen.watched.families:
        return float("inf")
    return least_along(path, lower, float(lower.min()), length, bounded, 200_000, 0.05)[0]


def raised(chosen: Map, path: Array, lines: Iterator[int]) -> Array:
    """Return a clearer way between the same ends, where pushing its waypoints finds one."""
    # Along differences of the clearance; kept where its certified least clearance is larger. It is
    # never larger than that of the ends.
    if not chosen.watched.families:
        return path
    most = float(quick(chosen.watched, path[[0, -1]]).lower.min())
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
    low, high = chosen.partition.low, chosen.partition.high
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
    low, high = chosen.partition.low, chosen.partition.high
    probe = _PROBE * np.diag(unit)
    for _ in range(4):
        here = quick(chosen.watched, inner).lower
        near = np.flatnonzero(here < most)
        if not len(near):
            break
        x = inner[near]
        ahead, behind = (
            quick(chosen.watched, (x[:, None, :] + s * probe).reshape(-1, x.shape[1])).lower
            for s in (1, -1)
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
            lines = [
                f"same aspect: joined by a path {sure if self.proven else 'that meets no family'}",
                f"{self._clear(degrees)}; {len(self.path)} waypoints:",
                *(f"  {typed(q, self.arm.prismatic, degrees, digits=6)}" for q in self.path),
            ]
        return "\n".join([*lines, *(f"note: {n}" for n in notes)])

    def _clear(self, degrees: bool) -> str:
        if not np.isfinite(self.clearance):
            return "there is no family to keep away from"
        far = f"{np.degrees(self.clearance):.3g}°" if degrees else f"{self.clearance:.3g} rad"
        return f"clearance of the path: at least {far}"


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
    chosen = map_of(found, forms)
    start, end = chosen.check(qa), chosen.check(qb)
    here, there = (chosen.place(q) for q in (start, end))
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
    elif any(map(chosen.apart, chosen.pieces, here, there)):
        answer = DIFFERENT
    elif opposite(forms, start, end):
        answer, notes = DIFFERENT, [_SIGNS]
    elif (path := _way(chosen, here, start, end, lines := iter(range(_LINES)))) is None:
        where = f"within aspect {a}" if a == b else f"from aspect {a} to {b}, perhaps one"
        notes.append(f"no path was found {where}")
    else:
        answer, path = SAME, raised(chosen, path, lines)
        sure = sureness(forms) == PROVEN and not of_design(forms)
        if not sure and (sure := proven_regular(forms, path)):
            notes.append(_RANK)
        elif not sure:
            notes += [_KNOWN, *missing(forms)]
            if sureness(forms) == NOT_COMPLETE:
                answer, path = UNDECIDED, None
    if answer == DIFFERENT:
        notes += of_design(forms)
        sure = not of_design(forms)
    return Connection(
        arm=found.arm,
        answer=answer,
        start=start,
        end=end,
        aspects=(a, b),
        path=path,
        clearance=np.nan if path is None else least(chosen, path),
        length=np.nan
        if path is None
        else float(chosen.watched.length(np.diff(path, axis=0)).sum()),
        within_limits=limits,
        notes=tuple(notes),
        proven=sure,
        singular=singular,
    )


def _which(ends: Iterable[bool]) -> str:
    return " and ".join(w for w, s in zip(("the start", "the end"), ends, strict=True) if s)


def _way(
    chosen: Map, place: tuple[tuple[int, int], ...], start: Array, end: Array, lines: Iterator[int]
) -> Array | None:
    """A polyline from start to end that is clear, part by part where a straight one is not."""
    goal = toward(start, end, np.array(chosen.partition.endless))
    path = np.stack([start, goal])
    if chosen.clear(path):
        return beside(chosen, path)
    rows = [start]
    parts = zip(chosen.partition.parts, chosen.pieces, place, strict=True)
    for part, pieces, (box, component) in parts:
        here, piece = rows[-1], pieces[box]
        a, b = (chosen.on_arcs(part, piece.box, q) for q in (here, end))
        if a is None or b is None:
            return None
        if np.array_equal(a, b):
            continue
        if (route := piece.route(component, a, b, chosen.clear_in(part, here))) is None:
            return None
        path = np.repeat(here[None], len(route), axis=0)
        path[:, list(part.joints)] += route - a
        rows += list(shortened(chosen, path, chosen.clear, lines)[1:])
    path = shortened(chosen, np.array(rows), chosen.clear, lines)
    return beside(chosen, path) if chosen.clear(path) else None
