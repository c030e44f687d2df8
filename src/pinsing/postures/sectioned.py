"""A box whose components are those of sections across a joint, and ways within them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
from pinsing.postures.bound_on_boxes import Terms
from pinsing.postures.boxes import Leaves
from pinsing.postures.divided import Divided
from pinsing.postures.hubs import row_between, tree_to_hubs
from pinsing.postures.partition import Arc, Part
from pinsing.postures.piece import Clear, CountedPiece
from pinsing.postures.sections import Sections
from pinsing.postures.subdivision import Components

_INSET = 1e-6
"""How far ways keep from the ends of a box, as a share of its length."""


@dataclass(frozen=True, eq=False)
class Sectioned(CountedPiece):
    """A box whose components are those of sections across a joint, its hub."""

    part: Part
    box: tuple[Arc, ...]
    hub: int
    found: Sections

    @cached_property
    def _terms(self) -> Terms:
        return Terms.of(self.part.surfaces[0].equation, self.part.joints)

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
            label = f.label[:, i]
            parts = Components(ground, leaves, label, f.lower, f.upper, False, f.edges, passable)
            out.append(Divided(self.part, self.box, parts))
        return tuple(out)

    @cached_property
    def _sign(self) -> Ints:
        """Of the equation on each component, (C,)."""
        out = np.zeros(self.upper, dtype=np.int64)
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
        a, b = x.copy(), x.copy()
        a[..., self.hub], b[..., self.hub] = 0.0, math.pi / 2
        s = np.where(self._terms(x) > 0, 1.0, -1.0)
        top = np.arctan2(s * self._terms(b), s * self._terms(a))
        top += 2 * math.pi * np.round((x[..., self.hub] - top) / (2 * math.pi))
        arc = self.box[self.hub]
        return np.maximum(arc.low, top - math.pi / 2), np.minimum(arc.high, top + math.pi / 2)

    @cached_property
    def _cuts(self) -> Array:
        """Sections as ways use them: the ends of the box may lie on families, so just within."""
        arc = self.box[self.hub]
        inset = _INSET * (arc.high - arc.low)
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
        middle = np.abs(cuts[inside] - (low + high) / 2)
        flat = np.delete(x, self.hub)
        for i in inside[np.argsort(middle)]:
            cut = float(self._cuts[i])
            if not clear(np.stack([x, self._lifted(flat, cut)])):
                continue
            way = self._on[i].to_certain(flat, partial(self._clear_on, clear, cut))
            if way is None:
                continue
            box, points = way
            last = self._lifted(points[-1], cut)
            # Signs that agree on both sides of the inset belong to one arc of the hub.
            if np.sign(self._terms(last)) == self.found.leaves.sign[box, i]:
                return box, int(i), np.concatenate([x[None], self._lifted(points, cut)])
        return None

    def _clear_on(self, clear: Callable[[Array], bool], cut: float, X: Array) -> bool:
        return clear(self._lifted(X, cut))

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
            flat = np.delete(points[-1], self.hub)
            ways = self._on[section].onward(flat, before, box)
            points += [self._lifted(p, self._cuts[section]) for p in ways]
        circle = np.array([arc.circle for arc in self.box])
        gap = points[-1] - end[2][-1]
        shift = np.where(circle, 2 * math.pi * np.round(gap / (2 * math.pi)), 0.0)
        points += [p + shift for p in end[2][::-1]]
        return np.array(points)
