"""Boxes of different sizes that fill a range of joint values."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.postures.bound_on_boxes import Terms

_FIRST = 1.0  # radians, or lengths of the range: largest width of a box to begin with


@dataclass(frozen=True, eq=False)
class Ground:
    """What is subdivided.

    Attributes
    ----------
    terms : tuple of Terms
        The equations.
    low, high : (d,) arrays
        The box.
    circle : (d,) array of bool
        Which joints turn endlessly.
    scale : (d,) array
        What counts as one radian: 1, or a length for slides.
    """

    terms: tuple[Terms, ...]
    low: Array
    high: Array
    circle: Bool
    scale: Array

    @property
    def d(self) -> int:
        """Number of joints."""
        return len(self.low)

    @cached_property
    def first(self) -> Ints:
        """Boxes along each joint to begin with."""
        return np.maximum(1, np.ceil((self.high - self.low) / self.scale / _FIRST - 1e-9)).astype(
            np.int64
        )

    @cached_property
    def flips(self) -> Ints:
        """Bits of the equations that change sign once round each joint, (d,)."""
        odd = [
            [bool((np.round(2 * t.rate[:, j]).astype(np.int64) % 2 != 0).any()) for t in self.terms]
            for j in range(self.d)
        ]
        bits = [sum(1 << i for i, o in enumerate(row) if o) for row in odd]
        return np.where(self.circle, np.array(bits, dtype=np.int64), 0)

    def boxes(self, level: Ints, index: Ints) -> tuple[Array, Array]:
        """Middles and half widths (N, d) of boxes."""
        width = (self.high - self.low) / (self.first * 2.0 ** level[:, None])
        return self.low + (index + 0.5) * width, width / 2

    def sides(self, level: Ints, index: Ints) -> Array:
        """Which limits boxes touch, (N, d): 1 the lower, -1 the upper, NaN both, else 0."""
        count = self.first * 2 ** level[:, None]
        side = np.where(~self.circle & (index == 0), 1.0, 0.0)
        side -= np.where(~self.circle & (index == count - 1), 1.0, 0.0)
        return np.where(~self.circle & (count == 1), np.nan, side)


@dataclass(frozen=True, eq=False)
class Leaves:
    """Boxes that fill the ground.

    Attributes
    ----------
    level : (N,) array of int
        How often each was halved.
    index : (N, d) array of int
        Place on the grid of its level.
    sign : (N, m) array of int
        Of the equations; 0 where unknown.
    regular : (N,) array of bool
        Whether certain or regular.
    """

    level: Ints
    index: Ints
    sign: Ints
    regular: Bool

    @property
    def certain(self) -> Bool:
        """Where all signs are known, (N,)."""
        return np.asarray((self.sign != 0).all(axis=1))

    @cached_property
    def _order(self) -> dict[int, tuple[Ints, Ints]]:
        """Keys of the boxes of each level in order, and which boxes these are."""
        out = {}
        for k in np.unique(self.level):
            rows = np.flatnonzero(self.level == k)
            keys = self._key(self.index[rows])
            order = np.argsort(keys)
            out[int(k)] = keys[order], rows[order]
        return out

    @cached_property
    def _widest(self) -> int:
        return int(self.index.max()) + 2

    def _key(self, index: Ints) -> Ints:
        out = np.zeros(len(index), dtype=np.int64)
        for j in range(index.shape[1]):
            out = out * self._widest + np.minimum(index[:, j], self._widest - 1)
        return out

    def find(self, level: Ints, index: Ints) -> Ints:
        """Which boxes have these levels and places; -1 for none."""
        hit = np.full(len(level), -1, dtype=np.int64)
        for k, (keys, rows) in self._order.items():
            mine = np.flatnonzero(level == k)
            wanted = self._key(index[mine])
            pos = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            hit[mine] = np.where(keys[pos] == wanted, rows[pos], -1)
        return hit

    def take(self, which: Bool) -> Leaves:
        """Some of them."""
        return Leaves(self.level[which], self.index[which], self.sign[which], self.regular[which])

    def halves(self, which: Bool) -> tuple[Ints, Ints]:
        """Levels and places of what some of the boxes are halved into along every joint."""
        d = self.index.shape[1]
        corner = np.stack(np.meshgrid(*([np.arange(2)] * d), indexing="ij"), axis=-1).reshape(-1, d)
        index = (2 * self.index[which][:, None, :] + corner).reshape(-1, d)
        return np.repeat(self.level[which] + 1, 2**d), index

    def with_more(self, more: Leaves) -> Leaves:
        """These and others."""
        return Leaves(
            np.concatenate([self.level, more.level]),
            np.concatenate([self.index, more.index]),
            np.concatenate([self.sign, more.sign]),
            np.concatenate([self.regular, more.regular]),
        )
