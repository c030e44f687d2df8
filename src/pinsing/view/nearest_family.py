"""How far a configuration is from the nearest family, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.view.entries import Entry

ON = 1e-7
"""Closer than this, in joint space, is on the family."""


@dataclass(frozen=True)
class NearestFamily:
    """The nearest family.

    Attributes
    ----------
    entry : int
        Its place in the list of entries.
    value : float
        Distance, radians, or metres over the length scale.
    on : bool
        Whether the configuration belongs to it.
    text : str
        ``0.8° from q5 = 0``.
    """

    entry: int
    value: float
    on: bool
    text: str


def nearest_family(arm: Arm, q: Array, entries: Sequence[Entry]) -> NearestFamily | None:
    """Find the nearest family to q (n,) among those that the arm can reach."""
    best: NearestFamily | None = None
    for index, entry in enumerate(entries):
        if entry.family is None or entry.reachable is False:
            continue
        found = entry.family.distance(q)
        if best is not None and found.value >= best.value:
            continue
        where = entry.where(np.asarray(found.q))
        on = bool(found.value <= ON)
        slides = [bool(arm.prismatic[j]) for j in entry.moved]
        how_far = f"{_length(found.value, arm.length_scale, slides)} from"
        words = f"{'on' if on else how_far} {entry.name}: {where}"
        best = NearestFamily(index, float(found.value), on, words)
    return best


def _length(value: float, length_scale: float, slides: Sequence[bool]) -> str:
    if slides and all(slides):
        return f"{_short(value * length_scale * 1000)} mm"
    return f"{_short(math.degrees(value))}°"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 20 else f"{value:.1f}" if value >= 0.1 else f"{value:.2g}"
