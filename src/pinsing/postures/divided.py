"""A box whose components are those of a subdivision, and ways through its boxes."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.postures.hubs import row_between, tree_to_hubs
from pinsing.postures.partition import Arc, Part
from pinsing.postures.piece import Clear, CountedPiece, toward
from pinsing.postures.subdivision import Components

_ASCENT = 60


@dataclass(frozen=True, eq=False)
class Divided(CountedPiece):
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
        out = np.zeros((self.upper, sign.shape[1]), dtype=np.int64)
        for c in range(self.upper):
            mine = sign[label == c]
            out[c] = np.where((mine == mine[0]).all(axis=0), mine[0], 0)
        return out

    def examples(self, component: int) -> Array:
        """Middles (K, d) of the largest boxes of a component."""
        rows = np.flatnonzero(self.found.label == component)
        size = self.found.leaves.level[rows]
        x = self.middles[0]
        value = np.min([np.abs(t(x[rows])) / t.size.sum() for t in self.found.ground.terms], axis=0)
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
        alike = [c for c in range(self.upper) if (np.abs(self._signs[c] - here) < 2).all()]
        if self.found.proven and len(alike) == 1:
            return alike[0]
        way = self.to_certain(x, clear)
        return None if way is None else int(self.found.label[way[0]])

    def _inside(self, x: Array) -> Array:
        """The same place with circles within one turn of the box."""
        low, circle = self.found.ground.low, self.found.ground.circle
        return np.where(circle, low + np.mod(x - low, 2 * math.pi), x)

    def box_of(self, x: Array) -> int:
        """Which box a point (d,) is in."""
        ground, leaves = self.found.ground, self.found.leaves
        share = (self._inside(x) - ground.low) / (ground.high - ground.low)
        levels = np.arange(int(leaves.level.max()) + 1)
        count = ground.first * 2 ** levels[:, None]
        index = np.clip((share * count).astype(np.int64), 0, count - 1)
        hit = leaves.find(levels, index)
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
            near = self._near_boxes(box, signs)
            for other in near[:6]:
                to = toward(here, middles[other], self.found.ground.circle) - here
                goal = points[-1] + to
                if clear(np.stack([points[-1], goal])):
                    return int(other), np.array([*points, goal])
            step = np.zeros(len(x))
            for t, s in zip(terms, signs, strict=True):
                h = np.zeros((1, len(x)))
                known = t.on(here[None], h)
                g = s * known.gradient[0] * self.found.ground.scale**2
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
        inside = np.clip(x, ground.low + margin, ground.high - margin)
        return np.where(ground.circle, x, inside)

    def _near_boxes(self, box: int, signs: Ints) -> Ints:
        a, b = self._neighbours
        start, end = np.searchsorted(a, (box, box + 1))
        ring = b[start:end]
        second = [b[slice(*np.searchsorted(a, (r, r + 1)))] for r in ring]
        every = np.unique(np.concatenate([ring, *second])) if len(ring) else ring
        leaves = self.found.leaves
        good = (self.found.label[every] >= 0) & (leaves.sign[every] == signs).all(axis=1)
        every = every[good]
        x = self.middles[0]
        away = np.linalg.norm(_toward_all(x[box], x[every], self.found.ground.circle), axis=1)
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
        boxes = row_between(self._tree, first, last)
        if boxes is None:
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


def _toward_all(a: Array, b: Array, circle: Bool) -> Array:
    gap = b - a
    return np.where(circle, gap - 2 * math.pi * np.round(gap / (2 * math.pi)), gap)
