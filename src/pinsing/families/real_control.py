"""Real singular points from random starts, held against what slices over finite fields led to.

A component whose joint values are roots of an equation has points over the fields only that have
these roots; over the real numbers random starts meet it where it has real points at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Value
from pinsing.families.own_points import OwnPoints
from pinsing.families.pieces import PieceMaker
from pinsing.families.zero_set import residuals

_BATCH, _BATCHES = 100, 4
"""Random starts at once, and how often."""
_OF_A_BATCH = 1e6
"""Work of a batch of starts, in products of terms."""
_SEED = 37
_OFF = 1e-4
"""Radians, metres, or shares of an equation's coefficients: points that Newton's method found are
singular to 1e-12, and so within 1e-6 of what touches, and others are rarely this near."""


def real_points(maker: PieceMaker, own: OwnPoints, time: Budget) -> Array:
    """Singular configurations (k, n) that random starts over whole circles led to.

    Parameters
    ----------
    maker : PieceMaker
        Of the chain: its box is what starts are drawn from.
    own : OwnPoints
        What singular means.
    time : Budget
        After which no further starts are made; the first ones are made all the same.
    """
    rng = np.random.default_rng(_SEED)
    box = maker.lower, maker.upper
    n = len(maker.symbols)
    found = []
    for _ in range(_BATCHES):
        starts = rng.uniform(*box, (_BATCH, n))
        found.append(own.drawn(starts, np.ones(n, dtype=bool), box))
        if time.stop(_OF_A_BATCH):
            break
    return np.concatenate(found)


def on_none(maker: PieceMaker, points: Array, components: Sequence[Component]) -> Bool:
    """Which of some singular configurations (N, n) are clearly on none of some components."""
    left = np.ones(len(points), dtype=bool)
    for c in components:
        q = points[left]
        if not len(q):
            break
        branch = maker.branch_of(c.values, c.relations)
        off = np.zeros(len(q))
        for v in branch.values:
            away = q[:, v.joint] - v.value
            if not maker.ring.prismatic[v.joint]:
                away = away - 2 * np.pi * np.round(away / (2 * np.pi))
            off = np.maximum(off, np.abs(away))
        if branch.equations:
            off = np.maximum(off, np.abs(residuals(branch.equations, q)).max(axis=-1))
        left[left] = off > _OFF
    return left


@dataclass(frozen=True, eq=False)
class RandomSingular:
    """Singular configurations that random starts led to.

    Attributes
    ----------
    maker : PieceMaker
        Of the chain.
    q : (k, n)
        The configurations.
    """

    maker: PieceMaker
    q: Array

    def missed(self, components: Sequence[Component]) -> Array:
        """Those (m, n) that are clearly on none of some components."""
        return self.q[on_none(self.maker, self.q, components)]

    def on(self, component: Component) -> Bool:
        """Which of them are on a component, as near as rounding tells: (k,)."""
        return ~on_none(self.maker, self.q, [component])

    def at(self, q: Array, joint: int, value: Value) -> Bool:
        """Which of some configurations (m, n) have a joint at a value."""
        held = self.maker.branch_of({joint: value}, ()).values[0]
        away = q[:, joint] - held.value
        if not self.maker.ring.prismatic[joint]:
            away = away - 2 * np.pi * np.round(away / (2 * np.pi))
        return np.asarray(np.abs(away) < _OFF)


def gap(points: Array, missed: Bool, prismatic: Bool) -> list[str]:
    """What missed points say, with one of them; nothing where none was missed."""
    if not missed.any():
        return []
    q = points[int(np.argmax(missed))]
    turned = np.remainder(q + np.pi, 2 * np.pi) - np.pi
    shown = ", ".join(f"{x:.4g}" for x in np.where(prismatic, q, turned))
    return [
        f"{int(missed.sum())} of {len(points)} singular configurations that random starts led to "
        f"lie on no family, such as q = {shown}: something is missing"
    ]
