"""Components of a box less the zeros of equations, counted from both sides with proof.

A box is *certain* where every equation keeps its sign on it. An uncertain one is *regular* where
for every combination of signs the product of all |f| has no largest value on it
(`pinsing.postures.growth`). The product has its largest value in
a component somewhere; not in a regular box, so in a certain one: every component has a certain
box, and there are no more components than connected sets of certain boxes. There are no fewer
than connected sets of boxes in which a combination of signs is possible. Where both numbers
agree, they are the number.

On a joint that turns endlessly the ends of the box are the same; an equation of half angles
changes its sign there.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Bool, Ints
from pinsing.postures.boxes import Ground, Leaves
from pinsing.postures.growth import is_regular
from pinsing.postures.halving import MOST, halved


@dataclass(frozen=True, eq=False)
class Components:
    """What a subdivision has found.

    Attributes
    ----------
    ground : Ground
        What was subdivided.
    leaves : Leaves
        Its boxes.
    label : (N,) array of int
        Component of each certain box, from 0; -1 for uncertain ones.
    lower : int
        No fewer components than this.
    upper : int
        No more: the number of labels; only where ``closed``.
    closed : bool
        Whether every box is certain or regular.
    edges : (2, E) array of int
        Pairs of boxes that share a face.
    passable : (E,) array of bool
        Where both are certain, and all signs are the same through the face.
    """

    ground: Ground
    leaves: Leaves
    label: Ints
    lower: int
    upper: int
    closed: bool
    edges: Ints
    passable: Bool

    @property
    def proven(self) -> bool:
        """Whether both numbers agree."""
        return self.closed and self.lower == self.upper


def subdivide(ground: Ground, until: float, most: int = MOST) -> Components:
    """Count components, until both numbers agree or the time is over.

    Parameters
    ----------
    ground : Ground
        Box and equations.
    until : float
        Time by ``time.monotonic`` at which to stop.
    most : int
        Boxes at which to stop.
    """
    return halved(ground, _classified, partial(_count, ground), until, most)


def _classified(ground: Ground, level: Ints, index: Ints) -> Leaves:
    x, h = ground.boxes(level, index)
    known = [t.on(x, h) for t in ground.terms]
    sign = np.stack(
        [np.where(np.abs(k.value) > k.swing, np.sign(k.value), 0) for k in known], axis=1
    ).astype(np.int8)
    regular = (sign != 0).all(axis=1)
    side = ground.sides(level, index)
    for pattern in {tuple(row) for row in (sign == 0).tolist()}:
        open_ = [i for i, o in enumerate(pattern) if o]
        if not open_:
            continue
        rows = np.flatnonzero(((sign == 0) == np.array(pattern)).all(axis=1))
        here = [k.take(rows) for k in known]
        regular[rows] = is_regular(ground, here, open_, x[rows], h[rows], side[rows])
    return Leaves(level, index, sign.astype(np.int64), regular)


def _count(ground: Ground, leaves: Leaves) -> tuple[Components, Bool]:
    """Both numbers, and which boxes should be halved where they differ."""
    N, m = len(leaves.level), len(ground.terms)
    a, b, flip = boxes_that_touch(ground, leaves)
    certain = leaves.certain
    state = ((leaves.sign > 0).astype(np.int64) << np.arange(m)).sum(axis=1)
    same = certain[a] & certain[b] & ((state[a] ^ flip) == state[b])
    label = connected(N, a[same], b[same])
    label = np.where(certain, label, -1)
    names, inner = np.unique(label[certain], return_inverse=True)
    label[certain] = inner
    # Every box once for each combination of signs that is possible on it.
    mask = ((leaves.sign != 0).astype(np.int64) << np.arange(m)).sum(axis=1)
    edges_a, edges_b = [], []
    for sigma in range(1 << m):
        here = ((sigma ^ state[a]) & mask[a]) == 0
        there = ((sigma ^ flip ^ state[b]) & mask[b]) == 0
        both = here & there
        edges_a.append(a[both] + sigma * N)
        edges_b.append(b[both] + (sigma ^ flip[both]) * N)
    outer = connected(N << m, np.concatenate(edges_a), np.concatenate(edges_b))
    of_box = outer[np.flatnonzero(certain) + state[certain] * N]
    lower = len(np.unique(of_box))
    found = Components(
        ground=ground,
        leaves=leaves,
        label=label,
        lower=lower,
        upper=len(names),
        closed=bool(leaves.regular.all()),
        edges=np.stack([a, b]),
        passable=same,
    )
    # Halve the uncertain boxes of those that may hang together and are not seen to.
    pairs = np.unique(np.stack([of_box, label[certain]]), axis=1)
    torn_ids, times = np.unique(pairs[0], return_counts=True)
    torn = torn_ids[times > 1]
    again = np.zeros(N, dtype=bool)
    for sigma in range(1 << m):
        possible = ((sigma ^ state) & mask) == 0
        again |= possible & np.isin(outer[np.arange(N) + sigma * N], torn)
    again &= ~certain
    return found, again


def boxes_that_touch(ground: Ground, leaves: Leaves) -> tuple[Ints, Ints, Ints]:
    """Pairs of boxes that share a face, and the bits of equations that change sign in between."""
    level, index = leaves.level, leaves.index
    count = ground.first * 2 ** level[:, None]
    none = np.zeros(0, dtype=np.int64)  # a single box touches no other
    froms, tos, flips = [none], [none], [none]
    for j in range(ground.d):
        for step in (-1, 1):
            place = index.copy()
            place[:, j] += step
            over = (place[:, j] < 0) | (place[:, j] >= count[:, j])
            todo = np.flatnonzero(~over | ground.circle[j])
            place[:, j] %= count[:, j]
            place, at, wraps = place[todo], level[todo].copy(), over[todo]
            while len(todo):
                hit = leaves.find(at, place)
                ok = hit >= 0
                froms.append(todo[ok])
                tos.append(hit[ok])
                flips.append(np.where(wraps[ok], ground.flips[j], 0))
                up = ~ok & (at > 0)
                todo, place, at, wraps = todo[up], place[up] >> 1, at[up] - 1, wraps[up]
    return np.concatenate(froms), np.concatenate(tos), np.concatenate(flips)


def connected(n: int, a: Ints, b: Ints) -> Ints:
    """Label (n,) of the connected set of each of n things, given pairs that touch."""
    head = np.arange(n)
    while len(a):
        ra, rb = head[a], head[b]
        low, high = np.minimum(ra, rb), np.maximum(ra, rb)
        apart = low != high
        if not apart.any():
            break
        a, b = a[apart], b[apart]
        np.minimum.at(head, high[apart], low[apart])
        while True:
            jumped = head[head]
            if np.array_equal(jumped, head):
                break
            head = jumped
    return head
