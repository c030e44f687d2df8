"""The components of one part of joint space on one box of arcs, and ways within them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
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
        """Whether none can be missing."""


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
        """Whether none can be missing."""
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
