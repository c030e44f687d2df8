"""Components of a box less the zeros of equations, counted from both sides with proof.

A box is *certain* where every equation keeps its sign on it. An uncertain one is *regular* where
for every combination of signs some direction, which does not leave the limits that the box
touches, makes the product of all |f| grow, all over the box. The product has its largest value in
a component somewhere; not in a regular box, so in a certain one: every component has a certain
box, and there are no more components than connected sets of certain boxes. There are no fewer
than connected sets of boxes in which a combination of signs is possible. Where both numbers
agree, they are the number.

On a joint that turns endlessly the ends of the box are the same; an equation of half angles
changes its sign there.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array, Bool, Ints
from pinsing.postures.bound_on_boxes import OnBoxes
from pinsing.postures.boxes import Ground, Leaves

_DEEPEST = 14
_MOST = 400_000


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


def subdivide(ground: Ground, until: float, most: int = _MOST) -> Components:
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
    grid = np.stack(
        np.meshgrid(*(np.arange(k) for k in ground.first), indexing="ij"), axis=-1
    ).reshape(-1, ground.d)
    leaves = _classified(ground, np.zeros(len(grid), dtype=np.int64), grid)
    while True:
        leaves = _refined(ground, leaves, until, most)
        found, again = _count(ground, leaves)
        full = time.monotonic() > until or len(leaves.level) > most
        if found.proven or full or not again.any():
            return found
        leaves = _split(ground, leaves, again)


def _refined(ground: Ground, leaves: Leaves, until: float, most: int) -> Leaves:
    """Halve what is neither certain nor regular, as long as there is room."""
    while True:
        bad = ~leaves.regular & (leaves.level < _DEEPEST)
        if not bad.any() or len(leaves.level) > most or time.monotonic() > until:
            return leaves
        leaves = _split(ground, leaves, bad)


def _split(ground: Ground, leaves: Leaves, which: Bool) -> Leaves:
    d = ground.d
    corner = np.stack(np.meshgrid(*([np.arange(2)] * d), indexing="ij"), axis=-1).reshape(-1, d)
    index = (2 * leaves.index[which][:, None, :] + corner).reshape(-1, d)
    level = np.repeat(leaves.level[which] + 1, 2**d)
    new, old = _classified(ground, level, index), leaves.take(~which)
    return Leaves(
        np.concatenate([old.level, new.level]),
        np.concatenate([old.index, new.index]),
        np.concatenate([old.sign, new.sign]),
        np.concatenate([old.regular, new.regular]),
    )


def _classified(ground: Ground, level: Ints, index: Ints) -> Leaves:
    x, h = ground.boxes(level, index)
    known = [t.on(x, h) for t in ground.terms]
    sign = np.stack(
        [np.where(np.abs(k.value) > k.swing, np.sign(k.value), 0) for k in known], axis=1
    ).astype(np.int8)
    regular = (sign != 0).all(axis=1)
    count = ground.first * 2 ** level[:, None]
    side = np.where(~ground.circle & (index == 0), 1.0, 0.0)
    side -= np.where(~ground.circle & (index == count - 1), 1.0, 0.0)
    both = ~ground.circle & (count == 1)
    side = np.where(both, np.nan, side)
    for pattern in {tuple(row) for row in (sign == 0).tolist()}:
        open_ = [i for i, o in enumerate(pattern) if o]
        if not open_:
            continue
        rows = np.flatnonzero(((sign == 0) == np.array(pattern)).all(axis=1))
        here = [k.take(rows) for k in known]
        regular[rows] = _is_regular(ground, here, open_, x[rows], h[rows], side[rows])
    return Leaves(level, index, sign.astype(np.int64), regular)


def _is_regular(
    ground: Ground, known: Sequence[OnBoxes], open_: Sequence[int], x: Array, h: Array, side: Array
) -> Bool:
    """Whether for all signs of the open equations the product of all |f| grows somewhere to.

    ``known`` is of the same K boxes as x, h and side, (K, d).
    """
    if len(open_) > ground.d:
        return np.zeros(len(x), dtype=bool)
    good = np.ones(len(x), dtype=bool)
    for bits in range(1 << len(open_)):
        s = [1.0 if bits >> i & 1 else -1.0 for i in range(len(open_))]
        grows = np.zeros(len(x), dtype=bool)
        for direction in (_together, _by_gradient):
            left = np.flatnonzero(good & ~grows)
            if not len(left):
                break
            here = [k.take(left) for k in known]
            v = direction(ground, here, open_, s, x[left], side[left])
            grows[left] = _grows(ground, here, open_, s, x[left], h[left], v)
        good &= grows
        if not good.any():
            break
    return good


def _grows(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    h: Array,
    v: Array,
) -> Bool:
    """Whether along v every open s f grows on the box, and the product of all |f| with them."""
    sure = np.ones(len(x), dtype=bool)
    growth = np.zeros(len(x))
    for i, (terms, k) in enumerate(zip(ground.terms, known, strict=True)):
        if len(ground.terms) == 1 or i in open_:
            slope, error = terms.slope(x, h, v)
            rate = s[open_.index(i)] * slope - error
            sure &= rate > 0
            growth += np.maximum(rate, 0) / (np.abs(k.value) + k.swing)
        else:
            slope, error = terms.slope(x, h, v)
            growth -= (np.abs(slope) + error) / (np.abs(k.value) - k.swing)
    return np.asarray(sure & (growth > 0))


def _inward(v: Array, side: Array, free: Array) -> tuple[Array, Array, bool]:
    """Directions without what leads out of a limit, and the joints that are left."""
    outward = np.where(np.isnan(side), v != 0, side * v < 0)
    return np.where(outward, 0.0, v), np.where(outward, 0.0, free), bool(outward.any())


def _together(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    side: Array,
) -> Array:
    """Directions in which every term of the only open equation grows; else `_by_gradient`."""
    terms = ground.terms[open_[0]]
    if len(open_) > 1 or terms.power.any():
        return _by_gradient(ground, known, open_, s, x, side)
    free = np.ones(side.shape) * ground.scale
    for _ in range(3):
        v, free, changed = _inward(s[0] * terms.steps(x, free), side, free)
        if not changed:
            break
    return v


def _by_gradient(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    side: Array,
) -> Array:
    """Directions in which all open s f grow to first order, none of them out of a limit."""
    A = np.stack([known[i].gradient for i in open_], axis=1)  # (K, u, d)
    free = np.ones(side.shape) * ground.scale
    for _ in range(3):
        B = A * free[:, None, :]
        if len(s) == 1:
            v = s[0] * B[:, 0] * free
        else:
            gram = B @ B.transpose(0, 2, 1)
            trace = np.einsum("kii->k", gram)[:, None, None]
            gram = gram + np.eye(len(s)) * np.maximum(trace * 1e-12, 1e-300)
            size = np.sqrt(np.einsum("kii->ki", gram))
            weight = np.linalg.solve(gram, (np.array(s) * size)[..., None])[..., 0]
            v = np.einsum("kud,ku->kd", B, weight) * free
        v, free, changed = _inward(v, side, free)
        if not changed:
            break
    return v


def _count(ground: Ground, leaves: Leaves) -> tuple[Components, Bool]:
    """Both numbers, and which boxes should be halved where they differ."""
    N, m = len(leaves.level), len(ground.terms)
    a, b, flip = _faces(ground, leaves)
    certain = leaves.certain
    state = ((leaves.sign > 0).astype(np.int64) << np.arange(m)).sum(axis=1)
    same = certain[a] & certain[b] & ((state[a] ^ flip) == state[b])
    label = _connected(N, a[same], b[same])
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
    outer = _connected(N << m, np.concatenate(edges_a), np.concatenate(edges_b))
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
    again &= ~certain & (leaves.level < _DEEPEST)
    return found, again


def _faces(ground: Ground, leaves: Leaves) -> tuple[Ints, Ints, Ints]:
    """Pairs of boxes that share a face, and the bits of equations that change sign in between."""
    level, index = leaves.level, leaves.index
    count = ground.first * 2 ** level[:, None]
    froms, tos, flips = [], [], []
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


def _connected(n: int, a: Ints, b: Ints) -> Ints:
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
