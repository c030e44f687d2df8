"""Boxes halved where they must be, until two counts of components agree.

Components of a box less the zeros of equations, counted from both sides with proof.

A box is *certain* where every equation keeps its sign on it. An uncertain one is *regular* where
for every combination of signs the product of all |f| has no largest value on it
(`pinsing.postures.boxes`). The product has its largest value in
a component somewhere; not in a regular box, so in a certain one: every component has a certain
box, and there are no more components than connected sets of certain boxes. There are no fewer
than connected sets of boxes in which a combination of signs is possible. Where both numbers
agree, they are the number.

On a joint that turns endlessly the ends of the box are the same; an equation of half angles
changes its sign there.

Components of a box less the zeros of R cos(q - phi), by sections across one joint, its hub.

The hub q is in every term of the equation exactly once, so for given other joints x its zeros are
half a turn apart. Put sections q = c_0, ..., c_m across its range, the first and the last at its
ends, less than half a turn from each other. Between two neighbouring ones f has at most one zero
over x. So a point with f > 0 is joined, over its own x, with one of the two sections; and two
sections where f > 0 at x are joined there. The components of f > 0 are therefore those of the sets
{x: f(x, c_i) > 0}, glued where neighbours have an x in common: one joint fewer, and none of the
tangencies that limits of the hub would make. The sets themselves are looked at by boxes as in
`pinsing.postures.subdivision`, from both sides; nothing rests on the equation being irreducible.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from pinsing._types import Array, Bool, Ints
from pinsing.algebra.budget import Budget
from pinsing.algebra.trig_sum import TrigSum
from pinsing.postures.boxes import Ground, Leaves, growing, is_regular, on_boxes, sum_of
from pinsing.postures.partition import Arc, Counts, Part

DEEPEST = 14
"""How often boxes are halved at most."""
_BOX = 100.0
"""Products that a box costs beside those of its terms, of which each takes some five."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Counted(Counts):
    """Components of boxes; closed if every box is certain or regular, on every section."""

    ground: Ground  # what was subdivided; of sections the other joints, an equation for each
    leaves: Leaves  # its boxes; of sections with the signs of every one
    # (N,) or for each section (N, m): component of each certain box, from 0; else -1
    label: Ints
    edges: Ints  # (2, E): pairs of boxes that share a face


F = TypeVar("F", bound=Counted)
Classify = Callable[[Ground, Ints, Ints], Leaves]
"""Signs on boxes of levels (N,) and indices (N, d), and which are certain or regular."""
Count = Callable[[Leaves], tuple[F, Bool]]
"""Both numbers, and which boxes (N,) should be halved where they differ."""


def halved(ground: Ground, classify: Classify, count: Count[F], budget: Budget) -> F:
    """Halve what is neither certain nor regular, count, and halve what keeps the counts apart."""

    def looked_at(level: Ints, index: Ints) -> Leaves:
        budget.spend(cost * len(level))
        return classify(ground, level, index)

    def split(which: Bool) -> Leaves:
        left, more = which.copy(), list[Leaves]()
        while left.any() and not budget.over:  # what the budget does not cover stays whole
            # Boxes that are halved between two looks at the budget.
            some = left & (np.cumsum(left) <= 4_096)
            more.append(looked_at(*leaves.halves(some)))
            left &= ~some
        return functools.reduce(Leaves.with_more, more, leaves.take(left | ~which))

    cost = _BOX + 5.0 * sum(len(t.amplitude) for t in ground.terms)
    grid = np.stack(
        np.meshgrid(*(np.arange(k) for k in ground.first), indexing="ij"), axis=-1
    ).reshape(-1, ground.d)
    leaves = looked_at(np.zeros(len(grid), dtype=np.int64), grid)
    while True:
        while (bad := ~leaves.regular & (leaves.level < DEEPEST)).any() and not budget.over:
            leaves = split(bad)
        found, torn = count(leaves)
        again = torn & (leaves.level < DEEPEST)
        if found.proven or budget.over or not again.any():
            return found
        leaves = split(again)


@dataclass(frozen=True, eq=False, kw_only=True)
class Components(Counted):
    """What a subdivision has found."""

    passable: Bool  # (E,): where both are certain, and all signs are the same through the face


def subdivide(ground: Ground, budget: Budget) -> Components:
    """Count components, until both numbers agree or the budget is over."""
    return halved(ground, _classified, partial(_count, ground), budget)


def _classified(ground: Ground, level: Ints, index: Ints) -> Leaves:
    x, h = ground.boxes(level, index)
    known = [on_boxes(t, x, h) for t in ground.terms]
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
    """Label (n,) of the connected set of each of n things, its first, given pairs that touch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
    label = connected_components(pairs, directed=False)[1]
    return np.asarray(np.unique(label, return_index=True)[1][label], dtype=np.int64)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sections(Counted):
    """What sections across a hub have found."""

    cuts: Array  # (m,): values of the hub, ascending: its ends first and last


def across(part: Part, box: tuple[Arc, ...]) -> int | None:
    """Return the part's joint of least range that ends and is once in every term; or None."""
    # None, too, where an equation changes its sign once round another joint.
    if len(part.surfaces) != 1 or len(part.joints) < 2:
        return None
    equation = part.surfaces[0].equation
    wide = {}
    for place, j in enumerate(part.joints):
        often = np.abs(equation.frequencies[:, j])
        if box[place].circle and (often % 2 != 0).any():
            return None
        width = math.inf if box[place].circle else box[place].high - box[place].low
        if math.isfinite(width) and (often == 2).all() and not equation.powers[:, j].any():
            wide[place] = width
    return min(wide, key=lambda place: wide[place]) if wide else None


def cuts_of(arc: Arc) -> Array:
    """Values of the sections across the range of the hub."""
    count = math.floor((arc.high - arc.low) / 2.4) + 1
    share = np.linspace(arc.low, arc.high, count + 1)
    # Sections are at most 2.8 rad apart, less than half a turn, and not at round angles.
    share[1:-1] += 0.2 * np.sin(2.4 * np.arange(1, count))
    return share


def section(full: TrigSum, hub: int, cut: float) -> TrigSum:
    """An equation at one value of the hub, in the other joints; like terms are put together."""
    rate, power = np.delete(full.rate, hub, axis=1), np.delete(full.power, hub, axis=1)
    phase = full.phase + full.rate[:, hub] * cut
    if len(full.slides):
        return TrigSum(full.amplitude, phase, rate, power, full.noise)
    first = np.array([row[np.flatnonzero(row)[0]] if row.any() else 1.0 for row in rate])
    turn = np.where(first < 0, -1.0, 1.0)
    twice = np.round(rate * turn[:, None] * 2).astype(np.int64)
    rows, which = np.unique(twice, axis=0, return_inverse=True)
    wave = np.zeros(len(rows), dtype=complex)
    np.add.at(wave, which.ravel(), full.amplitude * np.exp(1j * turn * phase))
    size = np.abs(wave)
    # Rounding is a share of all terms before they were put together.
    noise = full.noise * float(full.amplitude.sum()) / max(float(size.sum()), 1e-300)
    return TrigSum(size, np.angle(wave), rows / 2, np.zeros_like(rows), noise)


def sections(part: Part, box: tuple[Arc, ...], hub: int, scale: Array, budget: Budget) -> Sections:
    """Count components of a box, of one equation, until both numbers agree or the budget is over.

    ``hub`` is of `across`; ``scale`` (d,) what counts as one radian.
    """
    cuts = cuts_of(box[hub])
    full = sum_of(part.surfaces[0].equation, part.joints)
    others = [a for k, a in enumerate(box) if k != hub]
    ground = Ground(
        terms=tuple(section(full, hub, float(c)) for c in cuts),
        low=np.array([a.low for a in others]),
        high=np.array([a.high for a in others]),
        circle=np.array([a.circle for a in others]),
        scale=np.delete(scale, hub),
    )
    return halved(ground, _classified_sections, partial(_count_sections, ground, cuts), budget)


def _classified_sections(ground: Ground, level: Ints, index: Ints) -> Leaves:
    """Signs of every section on boxes, and whether each is certain or regular."""
    x, h = ground.boxes(level, index)
    side = ground.sides(level, index)
    sign = np.empty((len(level), len(ground.terms)), dtype=np.int64)
    regular = np.ones(len(level), dtype=bool)
    for i, terms in enumerate(ground.terms):
        known = on_boxes(terms, x, h)
        sign[:, i] = np.where(np.abs(known.value) > known.swing, np.sign(known.value), 0)
        rows = np.flatnonzero(sign[:, i] == 0)
        regular[rows] &= growing(
            terms, ground.scale, known.take(rows), x[rows], h[rows], side[rows]
        )
    return Leaves(level, index, sign, regular)


def _count_sections(ground: Ground, cuts: Array, leaves: Leaves) -> tuple[Sections, Bool]:
    """Both numbers, and which boxes should be halved where they differ."""
    N, m = leaves.sign.shape
    a, b, _ = boxes_that_touch(ground, leaves)
    sign = leaves.sign
    # Every box on each section; then the same for each sign that is possible there.
    inner, outer = [], []
    place = np.arange(N)
    for i in range(m):
        same = (sign[a, i] != 0) & (sign[a, i] == sign[b, i])
        inner.append(np.stack([a[same], b[same]]) + i * N)
        for k, s in enumerate((1, -1)):
            possible = sign[:, i] != -s
            both = possible[a] & possible[b]
            outer.append(np.stack([a[both], b[both]]) + (2 * i + k) * N)
            if i + 1 < m:
                up = place[possible & (sign[:, i + 1] != -s)]
                outer.append(np.stack([up + (2 * i + k) * N, up + (2 * i + 2 + k) * N]))
        if i + 1 < m:
            up = place[(sign[:, i] != 0) & (sign[:, i] == sign[:, i + 1])]
            inner.append(np.stack([up + i * N, up + (i + 1) * N]))
    certain = (sign != 0).T.ravel()
    label = np.where(certain, connected(N * m, *np.concatenate(inner, axis=1)), -1)
    names, place_of = np.unique(label[certain], return_inverse=True)
    label[certain] = place_of
    wide = connected(2 * N * m, *np.concatenate(outer, axis=1)).reshape(m, 2, N)
    mine = np.where((sign.T > 0), wide[:, 0], wide[:, 1]).ravel()[certain]
    lower = len(np.unique(mine))
    found = Sections(
        ground=ground,
        cuts=cuts,
        leaves=leaves,
        label=label.reshape(m, N).T.copy(),
        lower=lower,
        upper=len(names),
        closed=bool(leaves.regular.all()),
        edges=np.stack([a, b]),
    )
    pairs = np.unique(np.stack([mine, label[certain]]), axis=1)
    torn_ids, times = np.unique(pairs[0], return_counts=True)
    torn = np.isin(wide, torn_ids[times > 1])
    open_ = sign.T == 0
    again = (open_ & torn.any(axis=1)).any(axis=0)
    return found, again
