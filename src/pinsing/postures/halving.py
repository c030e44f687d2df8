"""Boxes halved where they must be, until two counts of components agree."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from pinsing._types import Bool, Ints
from pinsing.postures.boxes import Ground, Leaves

DEEPEST = 14
"""How often boxes are halved at most."""
MOST = 400_000
"""Boxes at which to stop."""
_AT_ONCE = 4_096
"""Boxes that are halved between two looks at the clock."""


class Counted(Protocol):
    """Components that were counted from both sides."""

    @property
    def proven(self) -> bool:
        """Whether both numbers agree."""


F = TypeVar("F", bound=Counted)
Classify = Callable[[Ground, Ints, Ints], Leaves]
"""Signs on boxes of levels (N,) and indices (N, d), and which are certain or regular."""
Count = Callable[[Leaves], tuple[F, Bool]]
"""Both numbers, and which boxes (N,) should be halved where they differ."""


def halved(
    ground: Ground, classify: Classify, count: Count[F], until: float, most: int = MOST
) -> F:
    """Halve what is neither certain nor regular, count, and halve what keeps the counts apart.

    Parameters
    ----------
    ground : Ground
        Box and equations.
    classify, count
        What is known of boxes, and what follows for components.
    until : float
        Time by ``time.monotonic`` at which to stop.
    most : int
        Boxes at which to stop.
    """

    def full() -> bool:
        return time.monotonic() > until or len(leaves.level) > most

    def split(which: Bool) -> Leaves:
        left, more = which.copy(), list[Leaves]()
        while left.any() and not (more and full()):  # what there is no time for stays whole
            some = left & (np.cumsum(left) <= _AT_ONCE)
            more.append(classify(ground, *leaves.halves(some)))
            left &= ~some
        return functools.reduce(Leaves.with_more, more, leaves.take(left | ~which))

    grid = np.stack(
        np.meshgrid(*(np.arange(k) for k in ground.first), indexing="ij"), axis=-1
    ).reshape(-1, ground.d)
    leaves = classify(ground, np.zeros(len(grid), dtype=np.int64), grid)
    while True:
        while (bad := ~leaves.regular & (leaves.level < DEEPEST)).any() and not full():
            leaves = split(bad)
        found, torn = count(leaves)
        again = torn & (leaves.level < DEEPEST)
        if found.proven or full() or not again.any():
            return found
        leaves = split(again)
