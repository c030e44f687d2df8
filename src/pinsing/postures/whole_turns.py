"""Whole-turn copies of a configuration within the limits, and which are in the aspect of another.

A joint whose limits are wider than a turn brings the tip to one pose at several values. Such
copies are singular together, but may be in different aspects. Joint space is a product of parts,
so copies are told apart part by part: two copies are in one aspect if no part separates them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Collection
from dataclasses import dataclass
from itertools import product

import numpy as np

from pinsing._types import Array
from pinsing.postures.joint_map import Map
from pinsing.postures.partition import Part
from pinsing.postures.pieces import Piece

_TRIED = 8
"""Copies to which a way is looked for, at most."""
_LOOKED = 512
"""Copies of the joints of one part that are looked at, the nearest; a joint has as many at most."""
_TURN = 2 * math.pi
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Copies:
    """Whole-turn copies of a configuration within the limits, itself included.

    Attributes
    ----------
    total : int
        How many there are.
    joined : int
        How many are in the aspect of the start.
    apart : int
        How many are proven to be in other aspects; the others were not looked at, or could not
        be told.
    nearest : (n,) array
        That which is nearest to the start.
    likely : tuple of (n,) arrays
        Of those that are not proven to be in other aspects the first eight: those in the aspect
        of the start before others, near ones before far ones.
    """

    total: int
    joined: int
    apart: int
    nearest: Array
    likely: tuple[Array, ...]


@dataclass(frozen=True)
class _Choice:
    """Values of the joints of some parts. Choices add up part by part, and so does their order."""

    doubts: int
    far: float
    values: tuple[tuple[int, float], ...]

    @property
    def order(self) -> tuple[int, float]:
        return self.doubts, self.far

    def __add__(self, other: _Choice) -> _Choice:
        values = self.values + other.values
        return _Choice(self.doubts + other.doubts, self.far + other.far, values)


def whole_turns(
    chosen: Map,
    q: Array,
    start: Array,
    *,
    held: Collection[int] = (),
    until: float = math.inf,
) -> Copies:
    """Find the whole-turn copies of a configuration, and which are in the aspect of the start.

    Joints that turn endlessly have no copies: their whole turns do not matter.

    Parameters
    ----------
    chosen : Map
        Joint space piece by piece.
    q : (n,) array
        The configuration; within the limits, perhaps by whole turns.
    start : (n,) array
        Another.
    held : collection of int
        Joints that stay as they are in q.
    until : float
        Time by ``time.monotonic`` from which on no more copies are looked at.
    """
    counts, each = _values(chosen, q, start, held)
    total = math.prod(counts)
    nearest = np.array([values[0] for values in each])
    place = chosen.place(start)
    if place is None or chosen.on(nearest):
        return Copies(total, 0, 0, nearest, (nearest,))
    joined, open_ = 1, 1
    best = [_Choice(0, 0.0, ())]
    parts = zip(chosen.partition.parts, chosen.pieces, place, strict=True)
    for part, pieces, target in parts:
        some, apart = _told(chosen, part, pieces, target, nearest, start, each, until)
        joined *= sum(not choice.doubts for choice in some)
        open_ *= math.prod(counts[j] for j in part.joints) - apart
        sums = [a + b for a in best for b in sorted(some, key=lambda c: c.order)[:_TRIED]]
        best = sorted(sums, key=lambda c: c.order)[:_TRIED]
    likely = []
    for choice in best:
        copy = nearest.copy()
        for j, x in choice.values:
            copy[j] = x
        likely.append(copy)
    return Copies(total, joined, total - open_, nearest, tuple(likely))


def _values(
    chosen: Map, q: Array, start: Array, held: Collection[int]
) -> tuple[list[int], list[list[float]]]:
    """How many values each joint has within the limits; those nearest to the start, in order."""
    cut = chosen.partition
    counts, each = [], []
    for j, (x, low, high) in enumerate(zip(q.tolist(), cut.low, cut.high, strict=True)):
        first, last = 0, 0
        if not (cut.endless[j] or chosen.watched.prismatic[j] or j in held):
            first = math.ceil((low - _SLACK - x) / _TURN)
            last = math.floor((high + _SLACK - x) / _TURN)
        if last < first:  # outside the limits, whatever the turns
            first, last = 0, 0
        middle = min(max(round((start[j] - x) / _TURN), first), last)
        turns = range(max(first, middle - _LOOKED // 2), min(last, middle + _LOOKED // 2) + 1)
        values = [x + _TURN * k if k else x for k in turns]
        if first < last:
            values = [min(max(v, float(low)), float(high)) for v in values]
        counts.append(last - first + 1)
        each.append(sorted(values, key=lambda v, j=j: abs(v - start[j])))  # type: ignore[misc]
    return counts, each


def _told(
    chosen: Map,
    part: Part,
    pieces: tuple[Piece, ...],
    target: tuple[int, int],
    q: Array,
    start: Array,
    each: list[list[float]],
    until: float,
) -> tuple[list[_Choice], int]:
    """Values of the joints that a part does not separate from the start; how many it does.

    One that is in doubt may be separated.
    """
    joints = list(part.joints)
    some, apart = [], 0
    near = [list(each[j]) for j in joints]
    while math.prod(map(len, near)) > _LOOKED:
        far = [
            abs(v[-1] - start[j]) if len(v) > 1 else -1.0 for j, v in zip(joints, near, strict=True)
        ]
        near[int(np.argmax(far))].pop()
    for values in product(*near):
        if time.monotonic() > until:
            break
        copy = q.copy()
        copy[joints] = values
        at = chosen.located(part, pieces, copy)
        if at is not None and chosen.apart(pieces, target, at):
            apart += 1
            continue
        gap = float(np.sum((copy[joints] - start[joints]) ** 2))
        some.append(_Choice(int(at != target), gap, tuple(zip(joints, values, strict=True))))
    return some, apart
