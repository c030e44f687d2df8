"""connect: whether two configurations are joined without a singularity, and by which way."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.joint_text import typed
from pinsing.postures.aspects import Aspects, aspects, map_of
from pinsing.postures.grounds import (
    NOT_COMPLETE,
    PROVEN,
    missing,
    opposite,
    proven_regular,
    sureness,
)
from pinsing.postures.joint_map import Map
from pinsing.postures.way_clearance import beside, least, lowest, raised, shortened
from pinsing.proximity.watched import Forms
from pinsing.robot.arm import ArmSummary
from pinsing.serialization import JsonResult

SECONDS = 5.0
"""Time for a way, beside that for the aspects."""

_RANK = (
    "the rank on all of the way is proven from the Jacobian, with a bound of how fast it changes: "
    "no certificate of the families is needed"
)

_KNOWN = (
    "a way was found that meets no family that is known; that no configuration on it is singular "
    "is not proven"
)
_SIGNS = "the determinant of the Jacobian is positive at one and negative at the other"

SAME, DIFFERENT, UNDECIDED = "same", "different", "undecided"


@dataclass(frozen=True, eq=False)
class Connection(JsonResult):
    """Whether two configurations are in one aspect.

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
        """Lines for people.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("scara"))
        >>> print(pinsing.connect(form, [0, 1, 0, 0], [0, 2, 0, 0]).text().splitlines()[0])
        same aspect: joined by a way on which no configuration is singular, proven
        """
        notes = self.notes
        if self.answer == DIFFERENT:
            a, b = self.aspects
            which = f"{a} and {b}" if a != b else f"both of what is known as {a}"
            lines = [
                f"different aspects ({which}), proven: every way from one to the other meets a "
                "singular configuration"
            ]
        elif any(self.singular):
            lines, notes = [notes[0]], notes[1:]
        elif self.answer == UNDECIDED and None in self.aspects and notes:
            lines, notes = [f"undecided: {notes[0]}"], notes[1:]
        elif self.answer == UNDECIDED or self.path is None:
            lines = ["undecided: no way was found, and none is ruled out"]
        else:
            sure = "on which no configuration is singular, proven"
            lines = [
                f"same aspect: joined by a way {sure if self.proven else 'that meets no family'}",
                f"{self._clear(degrees)}; {len(self.path)} waypoints:",
                *(f"  {typed(q, self.arm.prismatic, degrees, digits=6)}" for q in self.path),
            ]
        return "\n".join([*lines, *(f"note: {n}" for n in notes)])

    def _clear(self, degrees: bool) -> str:
        if not np.isfinite(self.clearance):
            return "there is no family to keep away from"
        far = f"{np.degrees(self.clearance):.3g}°" if degrees else f"{self.clearance:.3g} rad"
        return f"clearance of the way: at least {far}"


@checked
def connect(
    forms: Forms,
    qa: npt.ArrayLike,
    qb: npt.ArrayLike,
    *,
    limits: bool = True,
    of: Aspects | None = None,
    seconds: float = SECONDS,
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
    seconds : float
        Time for a way.

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
    if not seconds > 0:
        raise OptionError(f"seconds must be positive, got {seconds!r}")
    found = aspects(forms, limits) if of is None else of
    if found.within_limits != limits:
        raise OptionError(
            "the aspects given are "
            + ("of " if found.within_limits else "not of ")
            + "the space within the limits; limits says otherwise"
        )
    chosen = map_of(found, forms)
    start, end = chosen.check(qa), chosen.check(qb)
    places = [chosen.place(q) for q in (start, end)]
    numbers = [None if p is None else chosen.number(p) for p in places]
    notes: list[str] = []
    answer, path, sure = UNDECIDED, None, False
    until = time.monotonic() + seconds
    singular = [chosen.on(q) for q in (start, end)]
    if any(singular):
        which, names = _which(map(bool, singular)), " and ".join(filter(None, singular))
        are, belong = ("are", "belong") if all(singular) else ("is", "belongs")
        notes.append(f"{which} {are} singular, on {names}, and {belong} to no aspect")
    elif places[0] is None or places[1] is None:
        which = _which([p is None for p in places])
        notes.append(f"the aspect of {which} could not be told: a boundary is near")
    else:
        if _apart(chosen, places[0], places[1]):
            answer = DIFFERENT
        elif opposite(forms, start, end):
            answer = DIFFERENT
            notes.append(_SIGNS)
        else:
            path = _way(chosen, places[0], start, end, until)
            answer = UNDECIDED if path is None else SAME
            if path is None:
                notes.append("a way within the aspect was looked for and not found")
    if path is not None:
        path = raised(chosen, path, until)
        sure, said = _stands(forms, path)
        notes += said
        if not sure and sureness(forms) == NOT_COMPLETE:
            answer, path = UNDECIDED, None
    clearance = length = float("nan")
    if path is not None:
        clearance = least(chosen, path)
        length = float(chosen.watched.length(np.diff(path, axis=0)).sum())
    return Connection(
        arm=found.arm,
        answer=answer,
        start=start,
        end=end,
        aspects=(numbers[0], numbers[1]),
        path=path,
        clearance=clearance,
        length=length,
        within_limits=limits,
        notes=tuple(notes),
        proven=answer == DIFFERENT or (answer == SAME and sure),
        singular=(singular[0], singular[1]),
    )


def _stands(forms: Forms, path: Array) -> tuple[bool, list[str]]:
    """Whether it is proven that no configuration on a way is singular, and what that rests on."""
    if sureness(forms) == PROVEN:
        return True, []
    if proven_regular(forms, path):
        return True, [_RANK]
    return False, [_KNOWN, *missing(forms)]


def _which(ends: Iterable[bool]) -> str:
    return " and ".join(w for w, s in zip(("the start", "the end"), ends, strict=True) if s)


def _apart(chosen: Map, a: tuple[tuple[int, int], ...], b: tuple[tuple[int, int], ...]) -> bool:
    """Whether some part proves that two places are of different aspects."""
    parts = zip(chosen.pieces, a, b, strict=True)
    return any(chosen.apart(pieces, one, other) for pieces, one, other in parts)


def _way(
    chosen: Map, place: tuple[tuple[int, int], ...], start: Array, end: Array, until: float
) -> Array | None:
    """A polyline from start to end that is clear, part by part where a straight one is not."""
    goal = end.copy()
    endless = np.array(chosen.partition.endless)
    goal = np.where(endless, goal + 2 * np.pi * np.round((start - goal) / (2 * np.pi)), goal)
    if chosen.clear(np.stack([start, goal])):
        return beside(chosen, np.stack([start, goal]))
    rows = [start]
    parts = zip(chosen.partition.parts, chosen.pieces, place, strict=True)
    for part, pieces, (box, component) in parts:
        here = rows[-1]
        piece = pieces[box]
        a, b = (chosen.on_arcs(part, piece.box, q) for q in (here, end))
        if a is None or b is None:
            return None
        columns = list(part.joints)
        clear = chosen.clear_in(part, here)
        if np.array_equal(a, b):
            continue
        route = piece.route(component, a, b, clear)
        if route is None:
            return None
        route = shortened(route, clear, partial(_room, chosen, columns, here), until)
        for x in route[1:]:
            q = rows[-1].copy()
            q[columns] = here[columns] + (x - a)
            rows.append(q)
    path = shortened(np.array(rows), chosen.clear, partial(lowest, chosen), until)
    return beside(chosen, path) if chosen.clear(path) else None


def _room(chosen: Map, columns: list[int], here: Array, X: Array) -> float:
    Q = np.repeat(here[None], len(X), axis=0)
    Q[:, columns] = X
    return lowest(chosen, Q)
