"""Joint space as a product of parts, each with its pieces: where a configuration is.

Only what has codimension 1 separates. A joint value cuts its joint exactly; equations join the
joints that they share into a group, and a group is looked at on each box of arcs, where its
components and ways within them are found: by algebra, or by boxes, halved where they must be, until
two counts of components agree.

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
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any, TypeAlias

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation
from pinsing.algebra.trig_sum import TrigSum
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families.zero_set import fix_joint
from pinsing.measures import PRACTICAL, Array, ArrayLike, Bool, Ints, NDArray
from pinsing.postures.boxes import Ground, Leaves, is_regular, on_boxes, sum_of
from pinsing.proximity.clearance import Forms, Watched, quick, watch
from pinsing.proximity.crossings import crossings_of, motion_of

DEEPEST = 14
"""How often boxes are halved at most."""
_BOX = 100.0
"""Products that a box costs beside those of its terms, of which each takes some five."""
_LINES = 32
"""Straight lines to certain boxes that are tried, the shortest."""


@dataclass(frozen=True)
class Arc:
    """An open range of one joint, between cuts or limits."""

    # low and high: radians or metres; infinite for a slide without an end
    low: float
    high: float
    # whether both ends are the same point: a joint that turns endlessly, and has no cut
    circle: bool = False


@dataclass(frozen=True, eq=False)
class Surface:
    """An equation that separates."""

    family: str  # name of its family
    equation: Equation  # it; its sign tells the sides apart
    irreducible: bool  # whether it is one factor over the field of the geometry, and known to be


@dataclass(frozen=True, eq=False)
class Part:
    """Joints that are told apart from the others: one joint, or a group that equations join."""

    joints: tuple[int, ...]  # their indices, ascending
    arcs: tuple[tuple[Arc, ...], ...]  # what cuts and limits leave of each of them
    surfaces: tuple[Surface, ...]  # equations in these joints
    families: tuple[str, ...] = ()  # what cuts them, by name


def partition(watched: Watched, limits: bool) -> Map:
    """Cut joint space, within the limits or on whole circles, where slides are endless."""
    n, cutting = watched.n, _separating(watched)
    low, high = (watched.lower, watched.upper) if limits else np.full((2, n), [[-np.inf], [np.inf]])
    endless = ~watched.prismatic & ~(np.isfinite(low) & np.isfinite(high))
    cuts: list[tuple[int, float, str]] = []  # joint, value, and family
    surfaces: list[Surface] = []
    notes: list[str] = []
    exact = watched.complete
    for name, family in zip(cutting.names, cutting.families, strict=True):
        for branch in family.branches:
            if len(branch.values) == 1 and not branch.equations:
                (value,) = branch.values
                cuts.append((value.joint, value.value, name))
            elif len(branch.equations) == 1 and not branch.values:
                whole = len(family.branches) == 1 and watched.complete
                surfaces.append(Surface(name, branch.equations[0], whole))
            else:
                exact = False
                notes.append(
                    f"{name} is stated by several equations: what it separates is not counted"
                )
    arcs = []
    for j, name in enumerate(watched.joints):
        values = {value for joint, value, _ in cuts if joint == j}
        ends = float(low[j]), float(high[j])
        found, at_limit = _arcs(values, *ends, bool(endless[j]), bool(watched.prismatic[j]))
        arcs.append(found)
        said = f"{name}: a singular value lies on the joint limit, within {PRACTICAL:g}"
        notes += [said] * at_limit
    parts = []
    for joints in _groups(n, surfaces):
        mine = tuple(s for s in surfaces if set(s.equation.involved) <= set(joints))
        together = [joints]
        free = [j for j in joints if mine and any(math.isinf(a.high - a.low) for a in arcs[j])]
        if free:
            exact = False
            names = ", ".join(watched.joints[j] for j in free)
            notes.append(f"{names} has no limits: what equations separate is not counted")
            mine, together = (), [(j,) for j in joints]
        for some in together:
            families = {s.family for s in mine}.union(name for j, _, name in cuts if j in some)
            parts.append(Part(some, tuple(arcs[j] for j in some), mine, tuple(sorted(families))))
    return Map(watched, cutting, tuple(parts), low, high, endless, exact, tuple(notes))


def _separating(watched: Watched) -> Watched:
    """The families of codimension 1: only they separate."""
    keep = [i for i, f in enumerate(watched.families) if f.real and f.codimension == 1]
    names, families = (watched.names[i] for i in keep), (watched.families[i] for i in keep)
    # Sides are asked for, not distances: no margin.
    return replace(watched, names=tuple(names), families=tuple(families), margin=None)


def _arcs(
    cuts: set[float], low: float, high: float, endless: bool, slides: bool
) -> tuple[tuple[Arc, ...], bool]:
    """What is left of a joint, and whether a cut lies on one of its limits."""
    if endless and not cuts:
        return (Arc(-math.pi, math.pi, True),), False
    if endless:
        ends = sorted(math.remainder(c, math.tau) for c in cuts)
        return tuple(Arc(a, b) for a, b in pairwise([*ends, ends[0] + math.tau])), False
    every = sorted(cuts)
    if not slides:
        turns = {c: ((low - c) / math.tau, (high - c) / math.tau) for c in cuts}
        copies = {c: range(math.floor(a), math.ceil(b) + 1) for c, (a, b) in turns.items()}
        every = sorted(c + math.tau * k for c in cuts for k in copies[c])
    inside = [v for v in every if low + PRACTICAL < v < high - PRACTICAL]
    at_limit = sum(low < v < high for v in every) > len(inside)
    return tuple(Arc(a, b) for a, b in pairwise([low, *inside, high])), at_limit


def _groups(n: int, surfaces: list[Surface]) -> list[tuple[int, ...]]:
    """Joints that share an equation, directly or by way of others."""
    groups = [{j} for j in range(n)]
    for s in surfaces:
        joined = [g for g in groups if not g.isdisjoint(s.equation.involved)]
        groups = [g for g in groups if g not in joined] + [set[int]().union(*joined)]
    return sorted(tuple(sorted(g)) for g in groups)


Clear = Callable[[Array], bool]
"""Whether a polyline (K, d) in the joints of a part meets nothing that separates."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """How many components there are, counted from both sides."""

    lower: int  # no fewer components than this
    upper: int  # those that were found; no more where ``closed``
    closed: bool = True  # whether none can be missing

    @property
    def proven(self) -> bool:
        """True if both numbers agree."""
        return self.closed and self.lower == self.upper


def toward(a: Array, b: Array, circle: Bool) -> Array:
    """b, by whole turns of circles as near to a as can be."""
    return np.where(circle, b + 2 * math.pi * np.round((a - b) / (2 * math.pi)), b)


@dataclass(frozen=True, eq=False)
class _OfArcs:
    """A box of arcs of the joints of a part: ends (d,), and which joints turn endlessly."""

    part: Part
    box: tuple[Arc, ...]

    @cached_property
    def ends(self) -> Array:
        """The lower ones and the upper ones, (2, d)."""
        return np.array([(a.low, a.high) for a in self.box]).T

    @cached_property
    def circle(self) -> Bool:
        """Joints that turn endlessly."""
        return np.array([a.circle for a in self.box])


@dataclass(frozen=True, eq=False)
class Plain(_OfArcs):
    """A box that no equation divides."""

    found: Counts = Counts(lower=1, upper=1)

    def examples(self, component: int) -> Array:
        """Points (K, d) of the component, its middle first; of a slide without an end near one."""
        low, high = self.ends
        known = np.isfinite(self.ends)
        with np.errstate(invalid="ignore"):
            middle = np.select([known.all(axis=0), *known], [(low + high) / 2, low + 1, high - 1])
        low, high = np.clip(self.ends, middle - 3, middle + 3)
        share = np.random.default_rng(0).uniform(0.05, 0.95, (63, len(middle)))
        return np.concatenate([middle[None], low + share * (high - low)])

    def signs(self, component: int) -> tuple[int, ...]:
        """Nothing has a sign."""
        return ()

    def locate(self, x: Array, clear: Clear) -> int | None:
        """Every point is of the only component."""
        return 0

    def route(self, a: Array, b: Array, clear: Clear) -> Array | None:
        """The straight line."""
        return np.stack([a, toward(a, b, self.circle)])


def top_of(f: TrigSum, hub: int, x: Array, s: Array | float) -> Array:
    """Values (...,) of the hub, once in every term, at which s f is largest over x (..., d)."""
    a, b = x.copy(), x.copy()
    a[..., hub], b[..., hub] = 0.0, math.pi / 2
    top = np.arctan2(s * f(b), s * f(a))
    return np.asarray(top + 2 * math.pi * np.round((x[..., hub] - top) / (2 * math.pi)))


def turns_once(equation: Equation, joint: int) -> bool:
    """Return True if a joint turns exactly once in every term."""
    once = (np.abs(equation.frequencies[:, joint]) == 2).all()
    return bool(once) and not equation.powers[:, joint].any()


@dataclass(frozen=True, eq=False)
class Wheel(_OfArcs):
    """A box divided by one equation that has a joint which turns endlessly once in every term.

    Then f = R cos(q - phi) with R and phi functions of the other joints. Where R is not zero, f is
    positive on one arc of q and negative on another. R is zero where two polynomials are that have
    no factor in common, since it would be one of f, which is irreducible: on a set of codimension 2
    or more, which does not separate the box of the other joints. So f > 0 is connected, and f < 0
    is. They are one where f changes its sign once round another joint.
    """

    hub: int

    @cached_property
    def _terms(self) -> TrigSum:
        return sum_of(self.part.surfaces[0].equation, self.part.joints)

    @cached_property
    def _odd(self) -> Bool:
        """Joints once round which f changes its sign."""
        odd = np.round(2 * self._terms.rate).astype(np.int64) % 2 != 0
        return np.asarray(odd.any(axis=0) & self.circle)

    @property
    def _joined(self) -> bool:
        return bool(self._odd.any())

    @property
    def found(self) -> Counts:
        """Both signs, or one set."""
        count = 1 if self._joined else 2
        return Counts(lower=count, upper=count)

    def examples(self, component: int) -> Array:
        """Points (K, d), where |f| is large first."""
        rng, (low, high) = np.random.default_rng(0), self.ends
        inside = low + (high - low) * rng.uniform(0.05, 0.95, (512, len(low)))
        s = 1.0 if component == 0 else -1.0
        x = self._top(inside, s)
        return np.asarray(x[np.argsort(-np.abs(self._terms(x)))[:32]])

    def signs(self, component: int) -> tuple[int, ...]:
        """The sign of the equation."""
        return (0 if self._joined else (1, -1)[component],)

    def locate(self, x: Array, clear: Clear) -> int | None:
        """The sign of the equation tells."""
        return 0 if self._joined or self._terms(x) > 0 else 1

    def _top(self, x: Array, s: float) -> Array:
        """Points (..., d) with the hub where s f is largest, by whole turns near to what it was."""
        top = x.copy()
        top[..., self.hub] = top_of(self._terms, self.hub, x, s)
        return top

    def route(self, a: Array, b: Array, clear: Clear) -> Array | None:
        """By way of the tops over a line in the other joints, or over lines round R = 0."""
        s, rng = float(np.sign(self._terms(a))), np.random.default_rng(0)
        goal, (low, high) = toward(a, b, self.circle), self.ends
        if self._terms(goal) * s < 0:  # half a turn of signs away
            goal[self._odd.argmax()] += 2 * math.pi
        for attempt in range(12):
            middle = [low + (high - low) * rng.uniform(0.05, 0.95, len(a))] if attempt else []
            points, stops = [a, self._top(a, s)], [(goal, 0), *((x, 0) for x in middle)]
            while stops:  # the next one last, with how often the way there was halved
                stop, depth = stops.pop()
                here, there = points[-1], stop.copy()
                there[self.hub] = here[self.hub]
                end = self._top(there, s)
                if abs(end[self.hub] - here[self.hub]) < 1.2 and clear(np.stack([here, end])):
                    points.append(end)
                elif depth > 9:
                    break
                else:
                    stops += [(there, depth + 1), ((here + there) / 2, depth + 1)]
            else:
                end = goal.copy()
                end[self.hub] = toward(points[-1], goal, self.circle)[self.hub]
                path = np.array([*points, end])
                if clear(path):
                    return path
        return None


@dataclass(frozen=True, eq=False, kw_only=True)
class Counted(Counts):
    """Components of a ground, or of layers of it; closed if every box is certain or regular.

    A place is one of N boxes on a layer: its number, and N times that of the layer.
    """

    layers: tuple[Ground, ...]  # of sections one each, alike but for the equation
    leaves: Leaves  # their boxes
    label: Ints  # (N layers,): component of each certain place, from 0; else -1
    sign: Ints  # (N layers, m): of the equations there
    joined: Ints  # (2, P): pairs of places that are certain, and of one component


def subdivide(layers: tuple[Ground, ...], budget: Budget) -> Counted:
    """Count components, until both numbers agree or the budget is over."""
    # Halve what is neither certain nor regular, count, and halve what keeps the counts apart.
    ground = layers[0]
    cost = _BOX + 5.0 * sum(len(t.amplitude) for g in layers for t in g.terms)

    def looked_at(level: Ints, index: Ints) -> Leaves:
        budget.spend(cost * len(level))
        return _classified(layers, level, index)

    def split(which: Bool) -> Leaves:
        left, more = which.copy(), list[Leaves]()
        while left.any() and not budget.over:  # what the budget does not cover stays whole
            # Boxes that are halved between two looks at the budget.
            some = left & (np.cumsum(left) <= 4_096)
            more.append(looked_at(*leaves.halves(some)))
            left &= ~some
        return functools.reduce(Leaves.with_more, more, leaves.take(left | ~which))

    grid = np.stack(
        np.meshgrid(*(np.arange(k) for k in ground.first), indexing="ij"), axis=-1
    ).reshape(-1, ground.d)
    leaves = looked_at(np.zeros(len(grid), dtype=np.int64), grid)
    while True:
        while (bad := ~leaves.regular & (leaves.level < DEEPEST)).any() and not budget.over:
            leaves = split(bad)
        found, torn = _count(layers, leaves)
        again = torn & (leaves.level < DEEPEST)
        if found.proven or budget.over or not again.any():
            return found
        leaves = split(again)


def _classified(layers: tuple[Ground, ...], level: Ints, index: Ints) -> Leaves:
    """Signs on boxes of levels (N,) and indices (N, d), and which are certain or regular."""
    x, h = layers[0].boxes(level, index)
    side = layers[0].sides(level, index)
    sign = np.empty((len(level), len(layers), len(layers[0].terms)), dtype=np.int64)
    regular = np.ones(len(level), dtype=bool)
    for i, ground in enumerate(layers):
        known = [on_boxes(t, x, h) for t in ground.terms]
        for j, k in enumerate(known):
            sign[:, i, j] = np.where(np.abs(k.value) > k.swing, np.sign(k.value), 0)
        unsure = sign[:, i] == 0
        for pattern in np.unique(unsure[unsure.any(axis=1)], axis=0):
            rows = np.flatnonzero((unsure == pattern).all(axis=1))
            here, open_ = [k.take(rows) for k in known], np.flatnonzero(pattern).tolist()
            regular[rows] &= is_regular(ground, here, open_, x[rows], h[rows], side[rows])
    return Leaves(level, index, sign, regular)


def _count(layers: tuple[Ground, ...], leaves: Leaves) -> tuple[Counted, Bool]:
    """Both numbers, and which boxes should be halved where they differ."""
    N, L, m = leaves.sign.shape
    places, sign = N * L, leaves.sign.swapaxes(0, 1).reshape(N * L, m)
    a, b, flip = boxes_that_touch(layers[0], leaves)
    # Boxes touch on each layer, and from layer to layer.
    shift, up = N * np.arange(L)[:, None], np.arange(places - N)
    one, other = np.append(a + shift, up), np.append(b + shift, up + N)
    flip = np.append(np.tile(flip, L), 0 * up)
    bit = 1 << np.arange(m)
    state, mask, certain = (sign > 0) @ bit, (sign != 0) @ bit, (sign != 0).all(axis=1)
    same = certain[one] & certain[other] & ((state[one] ^ flip) == state[other])
    joined = np.stack([one[same], other[same]])
    label = np.where(certain, connected(places, *joined), -1)
    names, label[certain] = np.unique(label[certain], return_inverse=True)
    # Every place once for each combination of signs that is possible on it.
    pairs = []
    for sigma in range(1 << m):
        both = ((sigma ^ state[one]) & mask[one]) == 0
        both &= ((sigma ^ flip ^ state[other]) & mask[other]) == 0
        pairs.append([one[both] + sigma * places, other[both] + (sigma ^ flip[both]) * places])
    outer = connected(places << m, *np.concatenate(pairs, axis=1))
    of_place = outer[np.flatnonzero(certain) + state[certain] * places]
    # Halve the uncertain boxes of those that may hang together and are not seen to.
    seen = np.unique(np.stack([of_place, label[certain]]), axis=1)[0]
    sets, times = np.unique(seen, return_counts=True)
    again = np.zeros(places, dtype=bool)
    for sigma in range(1 << m):
        possible = ((sigma ^ state) & mask) == 0
        again |= possible & np.isin(outer[sigma * places :][:places], sets[times > 1])
    found = Counted(
        lower=len(sets), upper=len(names), layers=layers,
        closed=bool(len(names) and leaves.regular.all()),
        leaves=leaves, label=label, sign=sign, joined=joined,
    )  # fmt: skip
    return found, (again & ~certain).reshape(L, N).any(axis=0)


def boxes_that_touch(ground: Ground, leaves: Leaves) -> tuple[Ints, Ints, Ints]:
    """Pairs of boxes that share a face, and the bits of equations that change sign in between."""
    level, index = leaves.level, leaves.index
    count = ground.first * 2 ** level[:, None]
    none = np.zeros(0, dtype=np.int64)  # a single box touches no other
    found = [(none, none, none)]
    for j, step in product(range(ground.d), (-1, 1)):
        place = index + step * (np.arange(ground.d) == j)
        over = (place[:, j] < 0) | (place[:, j] >= count[:, j])
        place[:, j] %= count[:, j]
        todo = np.flatnonzero(~over | ground.circle[j])
        at, place = level[todo], place[todo]
        while len(todo):
            hit = leaves.find(at, place)
            ok = hit >= 0
            found.append((todo[ok], hit[ok], np.where(over[todo[ok]], ground.flips[j], 0)))
            up = ~ok & (at > 0)
            todo, at, place = todo[up], at[up] - 1, place[up] >> 1
    a, b, flip = (np.concatenate(x) for x in zip(*found, strict=True))
    return a, b, flip


def _graph(n: int, a: Ints, b: Ints, far: Ints | float = 1.0) -> Any:
    """A sparse matrix (n, n) of pairs of things, and how far they are apart."""
    from scipy.sparse import coo_array

    return coo_array((np.broadcast_to(far, a.shape), (a, b)), shape=(n, n)).tocsr()


def connected(n: int, a: Ints, b: Ints) -> Ints:
    """Label (n,) of the connected set of each of n things, its first, given pairs that touch."""
    from scipy.sparse.csgraph import connected_components

    label = connected_components(_graph(n, a, b), directed=False)[1]
    return np.asarray(np.unique(label, return_index=True)[1][label], dtype=np.int64)


def across(part: Part, box: tuple[Arc, ...]) -> int | None:
    """Return the part's joint of least range that ends and is once in every term; or None."""
    # None, too, where an equation changes its sign once round another joint.
    if len(part.surfaces) != 1 or len(part.joints) < 2:
        return None
    equation, places = part.surfaces[0].equation, range(len(box))
    odd = (equation.frequencies[:, list(part.joints)] % 2 != 0).any(axis=0)
    if any(odd[k] and box[k].circle for k in places):
        return None
    wide = [
        (box[k].high - box[k].low, k)
        for k in places
        if not box[k].circle and turns_once(equation, part.joints[k])
    ]
    return min(wide)[1] if wide else None


def section(equation: Equation, joints: tuple[int, ...], hub: int, cut: float) -> TrigSum:
    """An equation at one value of a joint, in others."""
    fixed = fix_joint(equation, hub, cut)
    if fixed is None:  # zero everywhere
        fixed = replace(equation, cos=0 * equation.cos, sin=0 * equation.sin)
    s = sum_of(fixed, joints)
    # Rounding is a share of all terms before like ones were put together.
    s.noise *= max(1.0, equation.size / max(float(s.amplitude.sum()), 1e-300))
    return s


@dataclass(frozen=True, eq=False)
class Divided(_OfArcs):
    """A box whose components are those of boxes in it, or on sections across a joint, its hub.

    Points of sections have all joints but the hub; without a hub there is one section, all of the
    box.
    """

    hub: int | None
    cuts: Array  # (m,): values of the hub, ascending: its ends first and last
    terms: tuple[TrigSum, ...]  # the equations
    found: Counted

    @cached_property
    def middles(self) -> tuple[Array, Array]:
        """Middles and half widths (N, d) of the boxes."""
        return self._ground.boxes(self.found.leaves.level, self.found.leaves.index)

    @property
    def _ground(self) -> Ground:
        return self.found.layers[0]

    @cached_property
    def _signs(self) -> Ints:
        """Of the equations on each component, (C, m); 0 where it takes both round a circle."""
        each = (self.found.sign[self.found.label == c] for c in range(self.found.upper))
        return np.array([np.where((s == s[0]).all(axis=0), s[0], 0) for s in each])

    def signs(self, component: int) -> tuple[int, ...]:
        """Sign of each equation there."""
        return tuple(self._signs[component].tolist())

    def examples(self, component: int) -> Array:
        """Points (K, d) of a component: middles of its largest boxes, or points over them."""
        cuts, rows = divmod(np.flatnonzero(self.found.label == component), len(self.middles[0]))
        size, x = self.found.leaves.level[rows], self.middles[0][rows]
        if self.hub is None:
            value = np.min([np.abs(t(x)) / t.amplitude.sum() for t in self.terms], axis=0)
            return np.asarray(x[np.lexsort((-value, size))[:256]])
        first = np.lexsort((cuts, rows, size))[:256]
        x = self._lifted(x[first], self.cuts[cuts[first]])
        x[:, self.hub] = np.mean(self._arcs(x), axis=0)
        return np.asarray(x[np.argsort(-np.abs(self.terms[0](x)), kind="stable")])

    def _flat(self, x: Array) -> Array:
        """A point without the hub."""
        return x if self.hub is None else np.delete(x, self.hub)

    def _lifted(self, x: Array, hub: float | Array) -> Array:
        """Points (..., d) with the hub where it is given, of points of sections."""
        return x if self.hub is None else np.insert(x, self.hub, hub, axis=-1)

    def _arcs(self, x: Array) -> tuple[Array, Array]:
        """Ends (...,) of the hub's values at which f keeps its sign over x, within the limits."""
        f, hub = self.terms[0], self.hub or 0
        top = top_of(f, hub, x, np.where(f(x) > 0, 1.0, -1.0))
        arc = self.box[hub]
        return np.maximum(arc.low, top - math.pi / 2), np.minimum(arc.high, top + math.pi / 2)

    @cached_property
    def _inset(self) -> Array:
        """Sections as ways use them: the ends of the box may lie on families, so just within."""
        # By a share of the length of the box.
        inset = 1e-6 * (self.cuts[-1] - self.cuts[0])
        return np.clip(self.cuts, self.cuts[0] + inset, self.cuts[-1] - inset)

    def locate(self, x: Array, clear: Clear) -> int | None:
        """By the signs, if they tell it; else by a way to a certain place."""
        if self.hub is None and self.found.proven:
            here = [int(np.sign(t(self._inside(x)))) for t in self.terms]
            alike = np.flatnonzero((np.abs(self._signs - here) < 2).all(axis=1))
            if len(alike) == 1:
                return int(alike[0])
        way = self._to_certain(x, clear)
        return None if way is None else int(self.found.label[way[0]])

    def _to_certain(self, x: Array, clear: Clear) -> tuple[int, Array] | None:
        """A certain place and a way (K, d) from x to a point in it, along the hub first."""
        if self.hub is None:
            return self._on_section(0, x[None], clear)
        low, high = self._arcs(x)
        inside = np.flatnonzero((self.cuts >= low) & (self.cuts <= high))
        for i in inside[np.argsort(np.abs(self.cuts[inside] - (low + high) / 2))].tolist():
            way = np.stack([x, self._lifted(self._flat(x), self._inset[i])])
            found = self._on_section(i, way, clear) if clear(way) else None
            # Signs that agree on both sides of the inset belong to one arc of the hub.
            if found and np.sign(self.terms[0](found[1][-1])) == self.found.sign[found[0], 0]:
                return found
        return None

    def _inside(self, x: Array) -> Array:
        """The same place with circles within one turn of the box."""
        low, circle = self._ground.low, self._ground.circle
        return np.where(circle, low + np.mod(x - low, 2 * math.pi), x)

    def box_of(self, x: Array) -> int:
        """Return which box a point of a section is in."""
        ground, leaves = self._ground, self.found.leaves
        share = (self._inside(x) - ground.low) / (ground.high - ground.low)
        levels = np.arange(int(leaves.level.max()) + 1)
        count = ground.first * 2 ** levels[:, None]
        hit = leaves.find(levels, np.clip((share * count).astype(np.int64), 0, count - 1))
        return int(hit[hit >= 0][0])

    def _on_section(self, i: int, way: Array, clear: Clear) -> tuple[int, Array] | None:
        """A certain place of section i, and a way (K, d), which ends there, on to a point in it."""
        (middles, _), flat = self.middles, self._flat(way[-1])
        here, first = self._inside(flat), len(middles) * i
        if self.found.label[place := first + self.box_of(here)] >= 0:
            return place, way
        # The nearest ones where signs are the same.
        signs = [np.sign(t(here)) for t in self.found.layers[i].terms]
        places = slice(first, first + len(middles))
        same = (self.found.sign[places] == signs).all(axis=1)
        boxes = np.flatnonzero(same & (self.found.label[places] >= 0))
        moves = toward(here, middles[boxes], self._ground.circle) - here
        for k in np.argsort(np.linalg.norm(moves, axis=1))[:_LINES]:
            end = self._lifted(flat + moves[k], self._inset[i])
            if clear(np.stack([way[-1], end])):
                return first + int(boxes[k]), np.concatenate([way, end[None]])
        return None

    @cached_property
    def _tree(self) -> Ints:
        """Of each certain place the next one towards a hub, through large boxes, so clear ones."""
        from scipy.sparse.csgraph import dijkstra

        label, count, (one, other) = self.found.label, len(self.found.layers), self.found.joined
        far = np.tile(1 + self.found.leaves.level, count)
        if self.hub is not None:  # within the limits rather than on one
            far += 64 * np.isin(np.arange(len(far)) * count // len(far), (0, count - 1))
        each = (np.flatnonzero(label == c) for c in range(self.found.upper))
        hubs = [places[far[places].argmin()] for places in each]
        how = {"directed": False, "min_only": True, "return_predecessors": True}
        graph = _graph(len(far), one, other, far[one] + far[other])
        return np.asarray(dijkstra(graph, indices=hubs, **how)[1], np.int64)

    def _between(self, first: int, last: int) -> list[int] | None:
        """Places from one to another: toward a hub, from where both ways meet to the other."""
        there, back = [first], [last]
        for row in (there, back):
            while self._tree[row[-1]] >= 0:
                row.append(int(self._tree[row[-1]]))
        known = set(back)
        meet = next((place for place in there if place in known), None)
        if meet is None:
            return None
        return there[: there.index(meet)] + back[: back.index(meet) + 1][::-1]

    def route(self, a: Array, b: Array, clear: Clear) -> Array | None:
        """To a certain place, through others from middle to middle of boxes, and on from there."""
        begin, end = (self._to_certain(x, clear) for x in (a, b))
        if begin is None or end is None:
            return None
        (first, start), (last, finish) = begin, end
        if (row := self._between(first, last)) is None:
            return None
        N, points = len(self.middles[0]), [*start]
        for before, place in pairwise([first, *row]):
            onward = self._onward(self._flat(points[-1]), before % N, place % N)
            points += [self._lifted(p, self._inset[place // N]) for p in onward]
        shift = toward(points[-1], finish[-1], self.circle) - finish[-1]
        points += [p + shift for p in finish[::-1]]
        return np.array(points)

    def _onward(self, here: Array, before: int, box: int) -> list[Array]:
        """Points from within a box to the middle of one that touches it, by way of the face."""
        middles, half = self.middles
        circle, points = self._ground.circle, []
        if before != box:
            small = box if half[box][0] < half[before][0] else before
            face = toward(here, middles[small], circle)
            other = toward(face, middles[before if small == box else box], circle)
            reach = np.abs(other - face) >= half[small] + half[before + box - small] - 1e-12
            points.append(face + np.where(reach, np.sign(other - face) * half[small], 0.0))
            here = points[-1]
        return [*points, toward(here, middles[box], circle)]


Piece: TypeAlias = Plain | Wheel | Divided
"""A box of arcs: ``examples`` and ``signs`` of its components, ``locate`` and ``route`` in them."""
Spot: TypeAlias = tuple[Piece, int]
"""One of the components of a piece."""


def divided(
    part: Part, box: tuple[Arc, ...], hub: int | None, scale: Array, budget: Budget
) -> Divided:
    """Count components of a box, by sections across ``hub`` (of `across`) unless it is None."""
    # ``scale`` (d,) is what counts as one radian.
    terms = tuple(sum_of(s.equation, part.joints) for s in part.surfaces)
    cuts, each = np.zeros(1), [terms]
    others = [k for k in range(len(box)) if k != hub]
    if hub is not None:
        equation, joint = part.surfaces[0].equation, part.joints[hub]
        arc, left = box[hub], tuple(part.joints[k] for k in others)
        count = math.floor((arc.high - arc.low) / 2.4) + 1
        cuts = np.linspace(arc.low, arc.high, count + 1)
        # Sections are at most 2.8 rad apart, less than half a turn, and not at round angles.
        cuts[1:-1] += 0.2 * np.sin(2.4 * np.arange(1, count))
        each = [(section(equation, left, joint, float(c)),) for c in cuts]
    low, high, circle = (
        np.array([getattr(box[k], x) for k in others]) for x in ("low", "high", "circle")
    )
    layers = tuple(Ground(t, low, high, circle, scale[others]) for t in each)
    return Divided(part, box, hub, cuts, terms, subdivide(layers, budget))


def make_piece(part: Part, box: tuple[Arc, ...], scale: Array, budget: Budget) -> Piece:
    """Find the components of a box of arcs; ``scale`` (n,) is what counts as one radian."""
    if not part.surfaces:
        return Plain(part, box)
    equation, whole = part.surfaces[0].equation, part.surfaces[0].irreducible
    if len(part.surfaces) == 1 and whole and len(equation.involved) > 1:
        # A joint that turns endlessly and is in every term exactly once.
        for k, j in enumerate(part.joints):
            if box[k].circle and turns_once(equation, j):
                return Wheel(part, box, k)
    return divided(part, box, across(part, box), scale[list(part.joints)], budget)


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
    flat = _separating(watched).conditions.flat
    return {**flat, "phase": np.exp(1j * flat["phase"])}  # -pi is pi


@dataclass(frozen=True, eq=False)
class Map:
    """Joint space as a product of parts, each with its pieces: where a configuration is.

    Low and high are the ends of the joints: the limits, or infinite.
    """

    watched: Watched
    cutting: Watched  # the families that separate
    parts: tuple[Part, ...]  # they share no joint
    low: Array  # (n,)
    high: Array
    endless: Bool  # (n,): which joints are circles where nothing cuts them
    exact: bool  # whether these are all that separates
    notes: tuple[str, ...]  # what is not counted, or was taken for something else
    pieces: tuple[tuple[Piece, ...], ...] = ()  # of each part

    @cached_property
    def components(self) -> tuple[tuple[Spot, ...], ...]:
        """All of each part."""
        return tuple(
            tuple((p, c) for p in pieces for c in range(p.found.upper)) for pieces in self.pieces
        )

    def check(self, q: ArrayLike) -> Array:
        """A configuration (n,) within the limits that count."""
        found = self.watched.check(q, "q")
        ConfigurationError.refuse_if(
            found.ndim != 1, f"one configuration is wanted, got shape {found.shape}"
        )
        low, high = self.low, self.high
        for j in np.flatnonzero((found < low - 1e-9) | (found > high + 1e-9)):
            raise ConfigurationError(
                f"joint {self.watched.joints[j]!r} is {found[j]:.6g}, outside its limits "
                f"{low[j]:g} to {high[j]:g}: aspects within the limits do not hold it",
                joint=self.watched.joints[j],
                value=float(found[j]),
                limits=(float(low[j]), float(high[j])),
            )
        return np.clip(found, low, high)

    def clearance(self, Q: Array) -> Array:
        """Lower bounds of the distance of Q (N, n) to the families."""
        return quick(self.watched, Q).lower if self.watched.families else np.full(len(Q), np.inf)

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
        """The same as `clear` for the joints of a part, with the others as in q."""

        def clear(X: Array) -> bool:
            Q = np.repeat(q[None], len(X), axis=0)
            Q[:, list(part.joints)] = X
            return self.clear(Q)

        return clear

    def place(self, q: Array) -> tuple[Spot, ...] | None:
        """Where it is in each part; None on a family, or where it cannot be told."""
        if self.on(q):
            return None
        found = [self.located(pieces, q) for pieces in self.pieces]
        told = tuple(spot for spot in found if spot is not None)
        return told if len(told) == len(found) else None

    def located(self, pieces: tuple[Piece, ...], q: Array) -> Spot | None:
        """Where a configuration that is on no family is in one part."""
        for piece in pieces:
            if (x := self.on_arcs(piece, q)) is not None:
                component = piece.locate(x, self.clear_in(piece.part, q))
                return None if component is None else (piece, component)
        return None

    def on_arcs(self, piece: Piece, q: Array) -> Array | None:
        """The values (d,) of q on a box of arcs, by whole turns; None if they are not on it."""
        some, (low, high) = list(piece.part.joints), piece.ends
        x = q[some]
        turns = np.where(self.endless[some] & ~piece.circle, np.ceil((low - x) / math.tau), 0.0)
        x = x + math.tau * turns
        # Limits belong to joint space, and what lies on one is cut off by nothing.
        limit = ((x == self.low[some]) | (x == self.high[some])) & ((x == low) | (x == high))
        return x if (piece.circle | limit | (low < x) & (x < high)).all() else None

    def number(self, place: tuple[Spot, ...]) -> int:
        """Place in the list of aspects, from 1 on."""
        out = 0
        for spot, every in zip(place, self.components, strict=True):
            out = out * len(every) + every.index(spot)
        return out + 1


def apart(a: Spot, b: Spot) -> bool:
    """Return True if a part of joint space proves that two spots in it are of different aspects."""
    (piece, one), (other, two) = a, b
    if piece is not other or one == two:
        return piece is not other
    signs = zip(piece.signs(one), piece.signs(two), strict=True)
    return piece.found.proven or any(s * t < 0 for s, t in signs)


def _meets_none(watched: Watched, Q: Array) -> bool:
    return not watched.families or len(crossings_of(watched, motion_of(watched, Q, None))) == 0


def make_map(forms: Forms, limits: bool, budget: Budget) -> Map:
    """The pieces of every part of joint space."""
    watched = watch(forms)
    margin = watched.margin
    if margin is not None and margin.limits is not None and not limits:
        # Beyond the limits nothing is proven of a way, and balls reach from within.
        watched = replace(watched, margin=replace(margin, meeting=np.inf))
    chosen, scale = partition(watched, limits), 1 / watched.weight
    pieces = (
        tuple(make_piece(part, box, scale, budget) for box in product(*part.arcs))
        for part in chosen.parts
    )
    return replace(chosen, pieces=tuple(pieces))
