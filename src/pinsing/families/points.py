"""Points of a family, shared out among its branches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._types import Array
from pinsing.families.empty_box import Stop
from pinsing.families.parts import Branch
from pinsing.families.zero_set import search

_PASSES = 4


def spread(
    held: Sequence[tuple[Branch, Array]],
    lower: Array,
    upper: Array,
    count: int,
    rng: np.random.Generator,
    rounds: int,
    stop: Stop | None = None,
) -> Array:
    """Up to ``count`` points (k, n) in a box, about as many of each branch.

    Parameters
    ----------
    held : sequence of (Branch, (n,) array)
        Branches with the values of their fixed joints.
    lower, upper : (n,) arrays
        The box.
    count : int
        How many.
    rng : np.random.Generator
        Where they are drawn from.
    rounds : int
        Number of batches of random starts after which a branch is given up.
    stop : callable, optional
        As in ``search``.
    """
    alive = [held[i] for i in rng.permutation(len(held))]
    parts = [np.zeros((0, len(lower)))]
    missing = count
    for _ in range(_PASSES):  # what one branch lacks, the others give in the next pass
        share = np.full(len(alive), missing // max(1, len(alive)))
        share[: missing - share.sum()] += 1
        for (branch, fixed), some in zip(tuple(alive), share, strict=True):
            if some == 0:
                continue
            free = np.ones(len(lower), dtype=bool)
            free[[v.joint for v in branch.values]] = False
            part = search(branch.equations, lower, upper, free, fixed, int(some), rng, rounds, stop)
            parts.append(part)
            missing -= len(part)
            if not len(part):
                alive = [a for a in alive if a[1] is not fixed or a[0] is not branch]
        if missing == 0 or not alive or (stop is not None and stop()):
            break
    return np.concatenate(parts)
