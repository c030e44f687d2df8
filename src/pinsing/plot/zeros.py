"""Where a curve over one joint truly falls to zero, between its samples too."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.kinematics.verdict import SINGULAR_RTOL, ratios
from pinsing.robot.arm import Arm

_LOW = 0.3
"""sigma_r / sigma_1 above which a dip is not looked at."""
_ROUNDS = 15
_FINE = 17


def curve_zeros(arm: Arm, q: Array, moving: int, x: Array, ratio: Array) -> Array:
    """Values of joint ``moving`` at which the arm is singular, the others at q (n,).

    Each dip of the samples ``ratio`` (N,) over ``x`` (N,) is closed in upon, since sigma_r falls
    to a zero like the absolute value of what it is the distance to: samples step over it.
    """
    padded = np.concatenate([[np.inf], ratio, [np.inf]])
    dips = np.flatnonzero((ratio <= padded[:-2]) & (ratio <= padded[2:]) & (ratio < _LOW))
    if not len(dips):
        return np.zeros(0)
    low, high = x[np.maximum(dips - 1, 0)], x[np.minimum(dips + 1, len(x) - 1)]
    part = np.linspace(0.0, 1.0, _FINE)
    for _ in range(_ROUNDS):
        grid = low[:, None] + (high - low)[:, None] * part
        Q = np.tile(q, (*grid.shape, 1))
        Q[..., moving] = grid
        found = ratios(arm, Q.reshape(-1, arm.n)).reshape(grid.shape)
        best = found.argmin(axis=1)
        rows = np.arange(len(dips))
        low, high = (
            grid[rows, np.maximum(best - 1, 0)],
            grid[rows, np.minimum(best + 1, _FINE - 1)],
        )
    values, least = grid[rows, best], found[rows, best]
    return np.asarray(values[least <= SINGULAR_RTOL])
