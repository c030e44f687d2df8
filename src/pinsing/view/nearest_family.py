"""How far a configuration is from the nearest family, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.view.entries import Entry

ON = 1e-7
"""Closer than this, in joint space, is on the family."""

_ALIKE = 2e-6
"""Bounds no farther apart are one distance."""


@dataclass(frozen=True)
class NearestFamily:
    """The nearest family that was found.

    Attributes
    ----------
    entry : int
        Its place in the list of entries.
    value : float
        How far the point of it is that was found, radians, or metres over the length scale.
    lower : float
        No point of this family is nearer: proven.
    least : float
        No point of any family is nearer: proven.
    on : bool
        Whether the configuration belongs to it.
    text : str
        ``0.8° from q5 = 0``; ``between 24° and 90° from ...`` where no more is known.
    """

    entry: int
    value: float
    lower: float
    least: float
    on: bool
    text: str


def nearest_family(arm: Arm, q: Array, entries: Sequence[Entry]) -> NearestFamily | None:
    """Find the nearest family to q (n,) among those that the arm can reach."""
    best, least = None, math.inf
    for index, entry in enumerate(entries):
        if entry.family is None or entry.reachable is False:
            continue
        found = entry.family.distance(q)
        # A set of fixed joints has one distance, which is exact.
        lower = float(getattr(found, "lower", found.value))
        least = min(least, lower)
        if best is None or found.value < best[2].value:
            best = index, entry, found, lower
    if best is None:
        return None
    index, entry, found, lower = best
    on = bool(found.value <= ON)
    slides = [bool(arm.prismatic[j]) for j in entry.moved]

    def far(value: float) -> str:
        return _length(value, arm.length_scale, slides)

    value = float(found.value)
    if not math.isfinite(value):
        words = f"at least {far(least)} from every family; no point of one was found"
        return NearestFamily(index, value, lower, least, on, words)
    said = "on" if on else _how_far(value, lower, least, far)
    words = f"{said} {entry.name}: {entry.where(np.asarray(found.q))}"
    return NearestFamily(index, value, lower, least, on, words)


def _how_far(value: float, lower: float, least: float, far: Callable[[float], str]) -> str:
    """The distance as far as it is known, as the page says it."""
    certain = min(lower, least)
    if far(certain) == far(value) or value - certain <= _ALIKE:
        return f"{far(value)} from"
    if certain <= 0:
        return f"at most {far(value)} from"
    between = f"between {far(certain)} and {far(value)} from"
    return f"{between} the nearest family; found:" if least < lower else between


def _length(value: float, length_scale: float, slides: Sequence[bool]) -> str:
    if slides and all(slides):
        return f"{_short(value * length_scale * 1000)} mm"
    return f"{_short(math.degrees(value))}°"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 20 else f"{value:.1f}" if value >= 0.1 else f"{value:.2g}"
