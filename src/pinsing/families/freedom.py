"""How many directions a set goes on in from one of its points."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.families.parts import Branch
from pinsing.families.zero_set import gradients, project

_STEP = 1e-3
_DEPENDENT = 1e-6
_STAYS = 0.3
"""Of a step: what is left of it, at least, where the set goes on in its direction."""


def freedom(branch: Branch, q: Array) -> int:
    """Dimension of a branch near one of its points, by small steps brought back to it.

    Where gradients vanish or depend on each other they allow more than the set does: a step into
    what they allow comes back then.

    Parameters
    ----------
    branch : Branch
        Joint values and equations.
    q : (n,) array
        A point of it.
    """
    free = np.ones(len(q), dtype=bool)
    free[[v.joint for v in branch.values]] = False
    loose = np.eye(len(q))[free]
    if not branch.equations:
        return len(loose)
    slopes = gradients(branch.equations, q[None])[0] @ loose.T
    _, sizes, right = np.linalg.svd(slopes)
    rank = int((sizes > _DEPENDENT * max(float(sizes[0]), 1e-300)).sum())
    directions = right[rank:] @ loose
    if not len(directions):
        return 0
    moved, ok = project(branch.equations, q + _STEP * directions, free)
    steps = np.where(ok[:, None], (moved - q) / _STEP, 0.0)
    return int((np.linalg.svd(steps, compute_uv=False) > _STAYS).sum())
