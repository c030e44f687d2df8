"""The components of one part of joint space on one box of arcs, and ways within them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.trig_sum import TrigSum
from pinsing.postures.boxes import sum_of
from pinsing.postures.partition import Arc, Part

Clear = Callable[[Array], bool]
"""Whether a polyline (K, d) in the joints of a part meets nothing that separates."""

_ASCENT = 60


class Counts(Protocol):
    """How many components there are, as found."""

    @property
    def lower(self) -> int:
        """No fewer components."""

    @property
    def upper(self) -> int:
        """Components that were found; no more where ``closed``."""

    @property
    def closed(self) -> bool:
        """True if none can be missing."""


class Piece(Counts, Protocol):
    """Components of a box of arcs."""

    @property
    def part(self) -> Part:
        """Joints and equations."""

    @property
    def box(self) -> tuple[Arc, ...]:
        """An arc of each joint."""

    def examples(self, component: int) -> Array:
        """Points (K, d) of a component, well inside first."""

    def signs(self, component: int) -> tuple[int, ...]:
        """Sign of each equation there; 0 where it takes both."""

    def locate(self, x: Array, clear: Clear) -> int | None:
        """Component of a point (d,); None where it cannot be told."""

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """Points (K, d) of a polyline from a to b within a component, if one is found.

        The last is b but for whole turns of joints that turn endlessly.
        """


class CountedPiece:
    """The counts of a piece are those of what was found on its box."""

    found: Counts

    @property
    def lower(self) -> int:
        """No fewer components."""
        return self.found.lower

    @property
    def upper(self) -> int:
        """Components that were found, no more where ``closed``."""
        return self.found.upper

    @property
    def closed(self) -> bool:
        """True if none can be missing."""
        return self.found.closed


def toward(a: Array, b: Array, circle: Bool) -> Array:
    """b, by whole turns of circles as near to a as can be."""
    turns = np.round((a - b) / (2 * math.pi))
    return np.where(circle, b + 2 * math.pi * turns, b)


@dataclass(frozen=True, eq=False)
class Plain:
    """A box that no equation divides."""

    part: Part
    box: tuple[Arc, ...]
    lower: int = 1
    upper: int = 1
    closed: bool = True

    def examples(self, component: int) -> Array:
        """Points (K, d) of the component, its middle first."""
        rng = np.random.default_rng(0)
        middle = np.array([a.middle for a in self.box])
        pairs = zip(self.box, middle, strict=True)
        ends = np.array([[max(a.low, m - 3), min(a.high, m + 3)] for a, m in pairs])
        share = rng.uniform(0.05, 0.95, (63, len(middle)))
        return np.concatenate([middle[None], ends[:, 0] + share * (ends[:, 1] - ends[:, 0])])

    def signs(self, component: int) -> tuple[int, ...]:
        """Nothing has a sign."""
        return ()

    def locate(self, x: Array, clear: Clear) -> int | None:
        """Every point is of the only component."""
        return 0

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """The straight line."""
        return np.stack([a, toward(a, b, np.array([arc.circle for arc in self.box]))])


def top_of(f: TrigSum, hub: int, x: Array, s: Array | float) -> Array:
    """Values (...,) of the hub, once in every term, at which s f is largest over x (..., d)."""
    a, b = x.copy(), x.copy()
    a[..., hub], b[..., hub] = 0.0, math.pi / 2
    top = np.arctan2(s * f(b), s * f(a))
    return np.asarray(top + 2 * math.pi * np.round((x[..., hub] - top) / (2 * math.pi)))


def hub_of(part: Part, box: tuple[Arc, ...]) -> int | None:
    """Place in the part of a joint that turns endlessly and is in every term exactly once."""
    surface = part.surfaces[0]
    equation = surface.equation
    if not surface.irreducible or len(equation.involved) < 2:
        return None
    for place, j in enumerate(part.joints):
        turning = np.abs(equation.frequencies[:, j])
        if box[place].circle and (turning == 2).all() and not equation.powers[:, j].any():
            return place
    return None


@dataclass(frozen=True, eq=False)
class Wheel:
    """A box divided by one equation that has a joint which turns endlessly once in every term.

    Then f = R cos(q - phi) with R and phi functions of the other joints. Where R is not zero, f is
    positive on one arc of q and negative on another. R is zero where two polynomials are that
    have no factor in common, since it would be one of f, which is irreducible: on a set of
    codimension 2 or more, which does not separate the box of the other joints. So f > 0 is
    connected, and f < 0 is. They are one where f changes its sign once round another joint.
    """

    part: Part
    box: tuple[Arc, ...]
    hub: int
    closed: bool = True

    @cached_property
    def _terms(self) -> TrigSum:
        return sum_of(self.part.surfaces[0].equation, self.part.joints)

    @cached_property
    def _circle(self) -> Bool:
        return np.array([a.circle for a in self.box])

    @cached_property
    def _joined(self) -> bool:
        odd = np.round(2 * self._terms.rate).astype(np.int64) % 2 != 0
        return bool((odd.any(axis=0) & self._circle).any())

    @property
    def lower(self) -> int:
        """Number of components."""
        return 1 if self._joined else 2

    @property
    def upper(self) -> int:
        """Number of components."""
        return self.lower

    def examples(self, component: int) -> Array:
        """Points (K, d), where |f| is large first."""
        rng = np.random.default_rng(0)
        low, high = (np.array([getattr(a, k) for a in self.box]) for k in ("low", "high"))
        inside = low + (high - low) * rng.uniform(0.05, 0.95, (512, len(low)))
        s = 1.0 if component == 0 else -1.0
        x = self._top(inside, s)
        order = np.argsort(-np.abs(self._terms(x)))[:32]
        return np.asarray(x[order])

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

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """By way of the tops over a line in the other joints, or over lines round R = 0."""
        if self._joined:
            return self._half_turn(a, b, clear)
        return self._along_tops(a, b, clear)

    def _half_turn(self, a: Array, b: Array, clear: Clear) -> Array | None:
        s = float(np.sign(self._terms(a)))
        goal = toward(a, b, self._circle)
        if float(self._terms(goal)) * s < 0:
            odd = (np.round(2 * self._terms.rate).astype(np.int64) % 2 != 0).any(axis=0)
            j = int(np.flatnonzero(odd & self._circle)[0])
            goal[j] += 2 * math.pi
        return self._along_tops(a, goal, clear, wrap=False)

    def _along_tops(self, a: Array, b: Array, clear: Clear, wrap: bool = True) -> Array | None:
        s = float(np.sign(self._terms(a)))
        rng = np.random.default_rng(0)
        goal = toward(a, b, self._circle) if wrap else b
        low, high = (np.array([getattr(arc, k) for arc in self.box]) for k in ("low", "high"))
        for attempt in range(12):
            middle = [] if attempt == 0 else [low + (high - low) * rng.uniform(0.05, 0.95, len(a))]
            stops = [a, *middle, goal]
            points, here, lost = [a, self._top(a, s)], self._top(a, s), False
            for stop in stops[1:]:
                there = stop.copy()
                there[self.hub] = here[self.hub]
                way = self._follow(here, there, s, clear, 0)
                if way is None:
                    lost = True
                    break
                points += way
                here = points[-1]
            if lost:
                continue
            end = goal.copy()
            end[self.hub] = _near(here[self.hub], goal[self.hub]) if wrap else goal[self.hub]
            points.append(end)
            way_points = np.array(points)
            if clear(way_points):
                return way_points
        return None

    def _follow(
        self, here: Array, there: Array, s: float, clear: Clear, depth: int
    ) -> list[Array] | None:
        """Tops from one top to that over another point, close enough for straight lines."""
        there = there.copy()
        there[self.hub] = here[self.hub]
        end = self._top(there, s)
        if abs(end[self.hub] - here[self.hub]) < 1.2 and clear(np.stack([here, end])):
            return [end]
        if depth > 9:
            return None
        half = self._follow(here, (here + there) / 2, s, clear, depth + 1)
        if half is None:
            return None
        rest = self._follow(half[-1], there, s, clear, depth + 1)
        return None if rest is None else half + rest


def _near(a: float, b: float) -> float:
    return b + 2 * math.pi * round((a - b) / (2 * math.pi))
