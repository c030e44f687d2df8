"""The way of a motion: its samples, thinned so that a page can play them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.errors import ConfigurationError
from pinsing.families import Family
from pinsing.robot.arm import Arm

FRAMES = 400
"""Poses of a way that a page shows."""

_LOOKED_AT = 4_000_000


def thinned(arm: Arm, families: Sequence[Family], Q: Array) -> Array:
    """At most FRAMES poses of a motion: of each stretch of it the one nearest to a family.

    Between samples joints move linearly, and a few samples get poses between them. First and
    last sample are kept.

    Parameters
    ----------
    arm : Arm
        The arm.
    families : sequence of Family
        What nearness is taken to; without any, samples are taken evenly.
    Q : (N, n) array
        Radians and metres.

    Raises
    ------
    ConfigurationError
        If there is no sample.
    """
    if Q.ndim != 2 or not len(Q):
        raise ConfigurationError(f"a path has shape (N, {arm.n}), N at least 1; got {Q.shape}")
    last = len(Q) - 1
    if not last:
        return Q
    if last < FRAMES:
        place = np.linspace(0, last, FRAMES)
        rows = np.stack([np.interp(place, np.arange(len(Q)), column) for column in Q.T], axis=1)
        rows[-1] = Q[-1]
        return rows
    watched = [f.branches for f in families if f.real]
    edges = np.linspace(1, last, FRAMES - 1).round().astype(int)
    places = [0]
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of(watched, np.asarray(arm.prismatic), weight)
    for low, high in pairwise(edges.tolist()):
        best = low
        if watched:
            step = max(1, (high - low) * FRAMES // _LOOKED_AT)  # very long paths by every k-th
            best = low + step * int(np.argmin(two_sided(conditions, Q[low:high:step]).lower))
        places.append(best)
    return np.asarray(Q[[*places, last]])
