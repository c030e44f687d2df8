"""Where a motion comes to families of several conditions, which it can pass by on all sides.

The distance to a set changes by no more than one moves: with ``lower`` at both ends of a part of a
motion, whose length is at most L, nothing on it is within r of the set if their sum is above
L + 2 r. Parts for which that is not so are halved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pinsing._types import Array, Ints
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.families import Branch
from pinsing.proximity.motion import Motion
from pinsing.proximity.watched import Watched

CONTACT = 1e-6
"""As near as this, in joint space, is on the family."""

_SHORT = 2e-7
_PARTS = 400_000


def contacts(
    watched: Watched, thin: Mapping[int, Sequence[Branch]], motion: Motion
) -> list[tuple[int, float, float]]:
    """Families of branches ``thin``, and from where to where the motion is on them."""
    out: list[tuple[int, float, float]] = []
    for f, branches in thin.items():
        conditions = Conditions.of([list(branches)], watched.prismatic, watched.weight)
        out += [(f, u, end) for u, end in _of_family(conditions, motion)]
    return out


def _of_family(c: Conditions, motion: Motion) -> list[tuple[float, float]]:
    nodes = np.arange(len(motion.pieces) + 1, dtype=float)
    at = two_sided(c, motion.at(nodes)).lower
    index = np.arange(len(motion.pieces))
    low, high = nodes[:-1], nodes[1:]
    before, after = at[:-1], at[1:]
    rested: list[tuple[Array, Array]] = []
    seen = 0
    while len(index):
        length = _length(c, motion.pieces[index], low - index, high - index)
        left = before + after <= length + 2 * CONTACT
        index, low, high, length = index[left], low[left], high[left], length[left]
        before, after = before[left], after[left]
        seen += len(index)
        done = length <= _SHORT
        if seen > _PARTS:
            done[:] = True
        rested.append((low[done], high[done]))
        index, low, high = index[~done], low[~done], high[~done]
        before, after = before[~done], after[~done]
        if not len(index):
            break
        middle = (low + high) / 2
        there = two_sided(c, motion.at(middle)).lower
        index = np.repeat(index, 2)
        low, high = _pairs(low, middle), _pairs(middle, high)
        before, after = _pairs(before, there), _pairs(there, after)
    return _joined(rested)


def _pairs(a: Array, b: Array) -> Array:
    return np.stack([a, b], axis=1).ravel()


def _length(c: Conditions, pieces: Array, low: Array, high: Array) -> Array:
    """Bound of the length of parts of pieces, in weighted coordinates."""
    norms = np.linalg.norm(pieces[:, 1:] * c.weight, axis=2)
    k = np.arange(1, pieces.shape[1])
    powers = high[:, None] ** k - low[:, None] ** k  # each term moves one way
    return np.asarray((norms * powers).sum(axis=1) * (1 + 1e-12))


def _joined(parts: list[tuple[Array, Array]]) -> list[tuple[float, float]]:
    low = np.concatenate([p[0] for p in parts]) if parts else np.zeros(0)
    high = np.concatenate([p[1] for p in parts]) if parts else np.zeros(0)
    order: Ints = np.argsort(low)
    out: list[tuple[float, float]] = []
    for i in order:
        if out and low[i] <= out[-1][1] + 1e-12:
            out[-1] = (out[-1][0], max(out[-1][1], float(high[i])))
        else:
            out.append((float(low[i]), float(high[i])))
    return out
