"""Mimic joints: who follows whom, and what that makes of a chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pinsing._types import Array
from pinsing.errors import JointError
from pinsing.robot.source import Coupling

Follow = tuple[str, float, float]
"""Name of the joint that is followed, multiplier, offset (radians or metres)."""


def leader_of(name: str, mimics: Mapping[str, Follow]) -> Follow:
    """Follow mimics of mimics to the joint that moves by itself."""
    leader, multiplier, offset = mimics[name]
    while leader in mimics:
        further, m, o = mimics[leader]
        leader, multiplier, offset = further, multiplier * m, multiplier * o + offset
    return leader, multiplier, offset


def couple(
    names: Sequence[str], independent: Sequence[str], leaders: Mapping[str, Follow]
) -> Coupling:
    """Coupling of the joints ``names`` of a model, of which ``independent`` move by themselves."""
    matrix = np.zeros((len(names), len(independent)))
    offset = np.zeros(len(names))
    for row, name in enumerate(names):
        leader, multiplier, shift = leaders.get(name, (name, 1.0, 0.0))
        matrix[row, independent.index(leader)] = multiplier
        offset[row] = shift
    return Coupling(matrix, offset)


def coupled_limits(
    lower: Array,
    upper: Array,
    coupling: Coupling,
    names: Sequence[str],
    independent: Sequence[str],
) -> tuple[Array, Array]:
    """Limits of the free joints, so that their followers stay within their own.

    Raises
    ------
    JointError
        If a follower can stay within its limits nowhere.
    """
    low = np.full(len(independent), -np.inf)
    high = np.full(len(independent), np.inf)
    for row, name in enumerate(names):
        moved = np.flatnonzero(coupling.matrix[row])
        if len(moved) == 0:  # multiplier zero: it stands still
            continue
        column = int(moved[0])
        m, o = coupling.matrix[row, column], coupling.offset[row]
        ends = sorted(((lower[row] - o) / m, (upper[row] - o) / m))
        low[column], high[column] = max(low[column], ends[0]), min(high[column], ends[1])
        if low[column] > high[column]:
            raise JointError(name, f"cannot follow {independent[column]!r} within its own limits")
    return low, high
