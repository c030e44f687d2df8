"""Joint space as a product of parts, each with its pieces: where a configuration is.

Boxes whose components were counted by subdivision or by sections, and ways through them.

Boxes halved where they must be, until two counts of components agree.

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
tangencies that limits of the hub would make. The sets themselves are looked at by boxes as above,
from both sides; nothing rests on the equation being irreducible.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any, TypeVar

import numpy as np

from pinsing._types import Array, ArrayLike, Bool, Ints, NDArray
from pinsing.algebra.budget import Budget
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.trig_sum import TrigSum
from pinsing.errors import ConfigurationError, OptionError
from pinsing.postures.boxes import Ground, Leaves, growing, is_regular, on_boxes, sum_of
from pinsing.postures.partition import (
    Arc,
    Clear,
    Counts,
    Part,
    Partition,
    Piece,
    Plain,
    Wheel,
    hub_of,
    partition,
    top_of,
    toward,
)
from pinsing.proximity.clearance import quick
from pinsing.proximity.crossings import crossings_of, motion_of
from pinsing.proximity.watched import Forms, Watched, watch

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
        if open_:
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
        both = (((sigma ^ state[a]) & mask[a]) == 0) & (((sigma ^ flip ^ state[b]) & mask[b]) == 0)
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
        again |= (((sigma ^ state) & mask) == 0) & np.isin(outer[np.arange(N) + sigma * N], torn)
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
    return found, ((sign.T == 0) & np.isin(wide, torn_ids[times > 1]).any(axis=1)).any(axis=0)


def tree_to_hubs(label: Ints, order: Ints, a: Ints, b: Ints) -> Ints:
    """Return each place's next one on the shortest way to the hub of its component, (N,)."""
    # Components are ``label`` (N,), edges ``a`` and ``b`` (E,). The first place in ``order`` (N,)
    # of a component is its hub; there, and where the label is -1, it is -1.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    rows = np.lexsort((order, label))
    rows = rows[label[rows] >= 0]
    hubs = rows[np.unique(label[rows], return_index=True)[1]]
    edges = coo_array((np.ones(len(a)), (a, b)), shape=(len(label), len(label)))
    how = {"directed": False, "unweighted": True, "min_only": True, "return_predecessors": True}
    return np.asarray(np.maximum(dijkstra(edges.tocsr(), indices=hubs, **how)[1], -1), np.int64)


def row_between(tree: Ints, first: int, last: int) -> list[int] | None:
    """Places from one to another: to the hub and back, less what is common."""
    rows = []
    for place in (first, last):
        row = [place]
        while tree[row[-1]] >= 0:
            row.append(int(tree[row[-1]]))
        rows.append(row)
    there, back = rows
    if there[-1] != back[-1]:
        return None
    while len(there) > 1 and len(back) > 1 and there[-2] == back[-2]:
        there.pop()
        back.pop()
    return there + back[-2::-1]


_ASCENT = 60


@dataclass(frozen=True, eq=False)
class Divided:
    """A box whose components are those of a subdivision."""

    part: Part
    box: tuple[Arc, ...]
    found: Components

    @cached_property
    def middles(self) -> tuple[Array, Array]:
        """Middles and half widths (N, d) of the boxes."""
        leaves = self.found.leaves
        return self.found.ground.boxes(leaves.level, leaves.index)

    @cached_property
    def _signs(self) -> Ints:
        """Of the equations on each component, (C, m); 0 where it takes both round a circle."""
        label, sign = self.found.label, self.found.leaves.sign
        out = np.zeros((self.found.upper, sign.shape[1]), dtype=np.int64)
        for c in range(self.found.upper):
            mine = sign[label == c]
            out[c] = np.where((mine == mine[0]).all(axis=0), mine[0], 0)
        return out

    def examples(self, component: int) -> Array:
        """Middles (K, d) of the largest boxes of a component."""
        rows = np.flatnonzero(self.found.label == component)
        size = self.found.leaves.level[rows]
        x = self.middles[0]
        terms = self.found.ground.terms
        value = np.min([np.abs(t(x[rows])) / t.amplitude.sum() for t in terms], axis=0)
        return np.asarray(x[rows[np.lexsort((-value, size))[:256]]])

    def signs(self, component: int) -> tuple[int, ...]:
        """Sign of each equation there."""
        return tuple(int(s) for s in self._signs[component])

    def locate(self, x: Array, clear: Clear) -> int | None:
        """By the box that it is in; from an uncertain box by a way to a certain one."""
        box = self.box_of(x)
        if self.found.label[box] >= 0:
            return int(self.found.label[box])
        here = np.array([int(np.sign(t(self._inside(x)))) for t in self.found.ground.terms])
        alike = [c for c in range(self.found.upper) if (np.abs(self._signs[c] - here) < 2).all()]
        if self.found.proven and len(alike) == 1:
            return alike[0]
        way = self.to_certain(x, clear)
        return None if way is None else int(self.found.label[way[0]])

    def _inside(self, x: Array) -> Array:
        """The same place with circles within one turn of the box."""
        low, circle = self.found.ground.low, self.found.ground.circle
        return np.where(circle, low + np.mod(x - low, 2 * math.pi), x)

    def box_of(self, x: Array) -> int:
        """Return which box a point (d,) is in."""
        ground, leaves = self.found.ground, self.found.leaves
        share = (self._inside(x) - ground.low) / (ground.high - ground.low)
        levels = np.arange(int(leaves.level.max()) + 1)
        count = ground.first * 2 ** levels[:, None]
        hit = leaves.find(levels, np.clip((share * count).astype(np.int64), 0, count - 1))
        return int(hit[hit >= 0][0])

    def to_certain(self, x: Array, clear: Clear) -> tuple[int, Array] | None:
        """A certain box and a way (K, d) from x to a point in it."""
        points = [x]
        terms = self.found.ground.terms
        middles, half = self.middles
        for _ in range(_ASCENT):
            here = self._inside(points[-1])
            box = self.box_of(here)
            if self.found.label[box] >= 0:
                return box, np.array(points)
            signs = np.array([int(np.sign(t(here))) for t in terms])
            for other in self._near_boxes(box, signs)[:6]:
                goal = points[-1] + (toward(here, middles[other], self.found.ground.circle) - here)
                if clear(np.stack([points[-1], goal])):
                    return int(other), np.array([*points, goal])
            step = np.zeros(len(x))
            for t, s in zip(terms, signs, strict=True):
                g = s * t.at(here[None]).gradient[0] * self.found.ground.scale**2
                step += g / max(float(np.linalg.norm(g)), 1e-300)
            length = float(half[box].max()) / max(float(np.linalg.norm(step)), 1e-300)
            for shrink in (1.0, 0.5, 0.25, 0.1, 0.02):
                goal = points[-1] + step * length * shrink
                kept = self._kept(goal)
                if clear(np.stack([points[-1], kept])):
                    points.append(kept)
                    break
            else:
                return None
        return None

    def _kept(self, x: Array) -> Array:
        """The point within the box of arcs."""
        ground = self.found.ground
        margin = 1e-9 * (ground.high - ground.low)
        return np.where(ground.circle, x, np.clip(x, ground.low + margin, ground.high - margin))

    def _near_boxes(self, box: int, signs: Ints) -> Ints:
        a, b = self._neighbours
        start, end = np.searchsorted(a, (box, box + 1))
        ring = b[start:end]
        second = [b[slice(*np.searchsorted(a, (r, r + 1)))] for r in ring]
        every = np.unique(np.concatenate([ring, *second])) if len(ring) else ring
        good = (self.found.label[every] >= 0) & (self.found.leaves.sign[every] == signs).all(axis=1)
        every = every[good]
        x = self.middles[0]
        away = np.linalg.norm(toward(x[box], x[every], self.found.ground.circle) - x[box], axis=1)
        return np.asarray(every[np.argsort(away)])

    @cached_property
    def _neighbours(self) -> tuple[Ints, Ints]:
        """Boxes that share a face, both ways, sorted."""
        a, b = self.found.edges
        count = len(self.found.label)
        both = np.unique(np.append(a, b) * count + np.append(b, a))  # as numbers: much faster
        return both // count, both % count

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """Through certain boxes, from middle to middle by way of the faces in between."""
        first_way, last_way = (self.to_certain(p, clear) for p in (a, b))
        if first_way is None or last_way is None:
            return None
        (first, start), (last, finish) = first_way, last_way
        if (boxes := row_between(self._tree, first, last)) is None:
            return None
        circle = self.found.ground.circle
        points = [*start]
        for k, box in enumerate(boxes):
            points += self.onward(points[-1], boxes[k - 1] if k else box, box)
        shift = toward(points[-1], finish[-1], circle) - finish[-1]
        points += [p + shift for p in finish[::-1]]
        return np.array(points)

    def onward(self, here: Array, before: int, box: int) -> list[Array]:
        """Points from within a box to the middle of one that touches it, by way of the face."""
        middles, half = self.middles
        circle = self.found.ground.circle
        points = []
        if before != box:
            small = box if half[box][0] < half[before][0] else before
            face = toward(here, middles[small], circle)
            other = toward(face, middles[before if small == box else box], circle)
            reach = np.abs(other - face) >= half[small] + half[before + box - small] - 1e-12
            points.append(face + np.where(reach, np.sign(other - face) * half[small], 0.0))
            here = points[-1]
        return [*points, toward(here, middles[box], circle)]

    @cached_property
    def _tree(self) -> Ints:
        """Of each certain box the next one towards a hub: few boxes, so large and clear ones."""
        a, b = self.found.edges[:, self.found.passable]
        return tree_to_hubs(self.found.label, self.found.leaves.level, a, b)


@dataclass(frozen=True, eq=False)
class Sectioned:
    """A box whose components are those of sections across a joint, its hub."""

    part: Part
    box: tuple[Arc, ...]
    hub: int
    found: Sections

    @cached_property
    def _terms(self) -> TrigSum:
        return sum_of(self.part.surfaces[0].equation, self.part.joints)

    @cached_property
    def _on(self) -> tuple[Divided, ...]:
        """Each section as a box of the other joints."""
        f = self.found
        out = []
        for i, terms in enumerate(f.ground.terms):
            sign = f.leaves.sign[:, [i]]
            leaves = Leaves(f.leaves.level, f.leaves.index, sign, f.leaves.regular)
            a, b = f.edges
            passable = (sign[a, 0] != 0) & (sign[a, 0] == sign[b, 0])
            ground = type(f.ground)(
                (terms,), f.ground.low, f.ground.high, f.ground.circle, f.ground.scale
            )
            parts = Components(
                ground=ground, leaves=leaves, label=f.label[:, i], lower=f.lower, upper=f.upper,
                closed=False, edges=f.edges, passable=passable,
            )  # fmt: skip
            out.append(Divided(self.part, self.box, parts))
        return tuple(out)

    @cached_property
    def _sign(self) -> Ints:
        """Of the equation on each component, (C,)."""
        out = np.zeros(self.found.upper, dtype=np.int64)
        known = self.found.label >= 0
        out[self.found.label[known]] = self.found.leaves.sign[known]
        return out

    def signs(self, component: int) -> tuple[int, ...]:
        """Sign of the equation there."""
        return (int(self._sign[component]),)

    def examples(self, component: int) -> Array:
        """Points (K, d) of a component over the middles of its largest boxes."""
        rows, cuts = np.nonzero(self.found.label == component)
        first = np.argsort(self.found.leaves.level[rows], kind="stable")[:256]
        x = self._lifted(self._on[0].middles[0][rows[first]], self.found.cuts[cuts[first]])
        x[:, self.hub] = np.mean(self._arcs(x), axis=0)
        return np.asarray(x[np.argsort(-np.abs(self._terms(x)), kind="stable")])

    def _lifted(self, x: Array, hub: float | Array) -> Array:
        """Points (..., d) with the hub where it is given, of points (..., d - 1)."""
        return np.insert(x, self.hub, hub, axis=-1)

    def _arcs(self, x: Array) -> tuple[Array, Array]:
        """Ends (...,) of the hub's values at which f keeps its sign over x, within the limits."""
        top = top_of(self._terms, self.hub, x, np.where(self._terms(x) > 0, 1.0, -1.0))
        arc = self.box[self.hub]
        return np.maximum(arc.low, top - math.pi / 2), np.minimum(arc.high, top + math.pi / 2)

    @cached_property
    def _cuts(self) -> Array:
        """Sections as ways use them: the ends of the box may lie on families, so just within."""
        arc = self.box[self.hub]
        # How far ways keep from the ends of a box, as a share of its length.
        inset = 1e-6 * (arc.high - arc.low)
        return np.clip(self.found.cuts, arc.low + inset, arc.high - inset)

    def locate(self, x: Array, clear: Clear) -> int | None:
        """By the section that it is joined with over the same other joints."""
        at = self._to_section(x, clear)
        return None if at is None else int(self.found.label[at[0], at[1]])

    def _to_section(self, x: Array, clear: Clear) -> tuple[int, int, Array] | None:
        """A certain box, its section, and a way (K, d) from x to a point in it."""
        low, high = self._arcs(x)
        cuts = self.found.cuts
        inside = np.flatnonzero((cuts >= low) & (cuts <= high))
        flat = np.delete(x, self.hub)
        for i in inside[np.argsort(np.abs(cuts[inside] - (low + high) / 2))]:
            cut = float(self._cuts[i])
            if not clear(np.stack([x, self._lifted(flat, cut)])):
                continue
            way = self._on[i].to_certain(flat, lambda X, cut=cut: clear(self._lifted(X, cut)))
            if way is None:
                continue
            box, points = way
            last = self._lifted(points[-1], cut)
            # Signs that agree on both sides of the inset belong to one arc of the hub.
            if np.sign(self._terms(last)) == self.found.leaves.sign[box, i]:
                return box, int(i), np.concatenate([x[None], self._lifted(points, cut)])
        return None

    @cached_property
    def _tree(self) -> Ints:
        """Of each certain place, box + N section, the next one towards a hub."""
        f = self.found
        N, m = f.label.shape
        sign = f.leaves.sign
        froms, tos = [], []
        for i in range(m):
            a, b = f.edges[:, self._on[i].found.passable]
            froms.append(a + i * N)
            tos.append(b + i * N)
            if i + 1 < m:
                up = np.flatnonzero((sign[:, i] != 0) & (sign[:, i] == sign[:, i + 1]))
                froms.append(up + i * N)
                tos.append(up + (i + 1) * N)
        # A hub within the limits rather than on one.
        level = np.tile(f.leaves.level, m) + 64 * np.repeat(np.isin(np.arange(m), (0, m - 1)), N)
        return tree_to_hubs(f.label.T.ravel(), level, np.concatenate(froms), np.concatenate(tos))

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """To a section, through certain boxes from section to section, and down again."""
        begin, end = self._to_section(a, clear), self._to_section(b, clear)
        if begin is None or end is None:
            return None
        N = len(self.found.label)
        row = row_between(self._tree, begin[0] + begin[1] * N, end[0] + end[1] * N)
        if row is None:
            return None
        points = [*begin[2]]
        for k, place in enumerate(row):
            section, box = divmod(place, N)
            before = row[k - 1] % N if k else box
            ways = self._on[section].onward(np.delete(points[-1], self.hub), before, box)
            points += [self._lifted(p, self._cuts[section]) for p in ways]
        circle = np.array([arc.circle for arc in self.box])
        gap = points[-1] - end[2][-1]
        shift = np.where(circle, 2 * math.pi * np.round(gap / (2 * math.pi)), 0.0)
        points += [p + shift for p in end[2][::-1]]
        return np.array(points)


def make_piece(part: Part, box: tuple[Arc, ...], scale: Array, budget: Budget) -> Piece:
    """Find the components of a box of arcs; ``scale`` (n,) is what counts as one radian."""
    if not part.surfaces:
        return Plain(part, box)
    if len(part.surfaces) == 1 and (hub := hub_of(part, box)) is not None:
        return Wheel(part, box, hub)
    if (hub := across(part, box)) is not None:
        return Sectioned(part, box, hub, sections(part, box, hub, scale[list(part.joints)], budget))
    ground = Ground(
        terms=tuple(sum_of(s.equation, part.joints) for s in part.surfaces),
        low=np.array([a.low for a in box]),
        high=np.array([a.high for a in box]),
        circle=np.array([a.circle for a in box]),
        scale=scale[list(part.joints)],
    )
    return Divided(part, box, subdivide(ground, budget))


def require_same_families(asked: Watched, given: Watched) -> None:
    """Refuse aspects whose families differ from those of the forms ``asked`` about."""
    # Arms may share joint names and limits, and differ in lengths: so families are compared.
    if asked is given:
        return
    for what in ("joints", "prismatic", "lower", "upper"):
        OptionError.refuse_if(
            not np.array_equal(getattr(asked, what), getattr(given, what)),
            f"the aspects given are of another arm: {_PLURAL[what]} differ",
        )
    one, other = _numbers(asked), _numbers(given)
    OptionError.refuse_if(
        not all(
            one[k].shape == other[k].shape and np.allclose(one[k], other[k], rtol=1e-9, atol=1e-9)
            for k in one
        ),
        "the aspects given are of another arm: what is singular differs",
    )


_PLURAL = {
    "joints": "its joints",
    "prismatic": "the kinds of its joints",
    "lower": "its joint limits",
    "upper": "its joint limits",
}


def _numbers(watched: Watched) -> dict[str, NDArray[Any]]:
    """What separates, number by number."""
    branches = [f.branches for f in watched.families if f.real and f.codimension == 1]
    flat = Conditions.of(branches, watched.prismatic, watched.weight).flat
    return {**flat, "phase": np.exp(1j * flat["phase"])}  # -pi is pi


@dataclass(frozen=True, eq=False)
class Map:
    """Joint space as a product of parts, each with its pieces: where a configuration is."""

    watched: Watched
    partition: Partition
    pieces: tuple[tuple[Piece, ...], ...]

    @cached_property
    def cutting(self) -> Watched:
        """The families that separate."""
        keep = [i for i, n in enumerate(self.watched.names) if n in self.partition.cutting]
        return replace(
            self.watched,
            names=tuple(self.watched.names[i] for i in keep),
            families=tuple(self.watched.families[i] for i in keep),
            margin=None,  # sides are asked for, not distances
        )

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """Components of each part."""
        return tuple(sum(p.found.upper for p in pieces) for pieces in self.pieces)

    def check(self, q: ArrayLike) -> Array:
        """A configuration (n,) within the limits that count."""
        found = self.watched.check(q, "q")
        ConfigurationError.refuse_if(
            found.ndim != 1, f"one configuration is wanted, got shape {found.shape}"
        )
        low, high = self.partition.low, self.partition.high
        for j in np.flatnonzero((found < low - 1e-9) | (found > high + 1e-9)):
            raise ConfigurationError(
                f"joint {self.watched.joints[j]!r} is {found[j]:.6g}, outside its limits "
                f"{low[j]:g} to {high[j]:g}: aspects within the limits do not hold it",
                joint=self.watched.joints[j],
                value=float(found[j]),
                limits=(float(low[j]), float(high[j])),
            )
        return np.clip(found, low, high)

    def clear(self, Q: Array) -> bool:
        """Return True if a polyline (K, n) meets no family that separates, with proof."""
        return len(Q) == 1 or _meets_none(self.cutting, Q)

    def regular(self, Q: Array) -> bool:
        """Return True if a polyline (K, n) meets no family at all, with proof."""
        return _meets_none(self.watched, Q)

    def on(self, q: Array) -> str:
        """Name of a family that a configuration is on, within 1e-9 rad; empty where on none."""
        if not self.watched.families:
            return ""
        for event in crossings_of(self.watched, motion_of(self.watched, np.stack([q, q]), None)):
            return event.family
        near = quick(self.watched, q[None])
        # Distance, radians, within which a configuration is on a family: files round their
        # limits.
        return self.watched.names[int(near.family[0])] if float(near.upper[0]) <= 1e-9 else ""

    def clear_in(self, part: Part, q: Array) -> Clear:
        """The same for the joints of a part, with the others as in q."""
        columns = list(part.joints)

        def clear(X: Array) -> bool:
            Q = np.repeat(q[None], len(X), axis=0)
            Q[:, columns] = X
            return self.clear(Q)

        return clear

    def place(self, q: Array) -> tuple[tuple[int, int], ...] | None:
        """Box and component of each part; None on a family, or where it cannot be told."""
        if self.on(q):
            return None
        out = []
        for part, pieces in zip(self.partition.parts, self.pieces, strict=True):
            if (found := self.located(part, pieces, q)) is None:
                return None
            out.append(found)
        return tuple(out)

    def located(self, part: Part, pieces: tuple[Piece, ...], q: Array) -> tuple[int, int] | None:
        """Box and component of one part, of a configuration that is on no family."""
        for box, piece in enumerate(pieces):
            if (x := self.on_arcs(part, piece.box, q)) is not None:
                component = piece.locate(x, self.clear_in(part, q))
                return None if component is None else (box, component)
        return None

    @staticmethod
    def apart(pieces: tuple[Piece, ...], a: tuple[int, int], b: tuple[int, int]) -> bool:
        """Return True if a part proves that two places are of different aspects."""
        (box, one), (other_box, other) = a, b
        if box != other_box or one == other:
            return box != other_box
        piece = pieces[box]
        signs = zip(piece.signs(one), piece.signs(other), strict=True)
        return piece.found.proven or any(s * t < 0 for s, t in signs)

    def on_arcs(self, part: Part, box: tuple[Arc, ...], q: Array) -> Array | None:
        """The values (d,) of q on a box of arcs, by whole turns; None if they are not on it."""
        x = np.empty(len(box))
        for k, (j, arc) in enumerate(zip(part.joints, box, strict=True)):
            value = float(q[j])
            put = arc.put(value, self.partition.endless[j])
            if put is None and not self.partition.endless[j]:
                # Limits belong to joint space, and what lies on one is cut off by nothing.
                low = value == self.partition.low[j] == arc.low
                put = value if low or value == self.partition.high[j] == arc.high else None
            if put is None:
                return None
            x[k] = put
        return x

    def number(self, place: tuple[tuple[int, int], ...]) -> int:
        """Place in the list of aspects, from 1 on."""
        out = 0
        for (box, component), pieces, count in zip(place, self.pieces, self.counts, strict=True):
            out = out * count + sum(p.found.upper for p in pieces[:box]) + component
        return out + 1

    def places(self) -> Iterator[tuple[tuple[int, int], ...]]:
        """All of them, in order."""
        each = [
            [(b, c) for b, p in enumerate(pieces) for c in range(p.found.upper)]
            for pieces in self.pieces
        ]
        return product(*each)


def _meets_none(watched: Watched, Q: Array) -> bool:
    return not watched.families or len(crossings_of(watched, motion_of(watched, Q, None))) == 0


def make_map(forms: Forms, limits: bool, budget: Budget) -> Map:
    """The pieces of every part of joint space."""
    watched = watch(forms)
    margin = watched.margin
    if margin is not None and margin.limits is not None and not limits:
        # Beyond the limits nothing is proven of a way, and balls reach from within.
        watched = replace(watched, margin=replace(margin, meeting=np.inf))
    cut = partition(watched, limits)
    scale = 1 / watched.weight
    pieces = tuple(
        tuple(make_piece(part, box, scale, budget) for box in part.boxes) for part in cut.parts
    )
    return Map(watched, cut, pieces)
