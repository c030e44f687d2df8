"""Where the configurations of a map are: any stretch of them, computed from their numbers.

Nothing depends on how a map is cut into chunks, and nothing is as long as the map.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pinsing._types import Array
from pinsing.sampling import sobol

Sampling = Literal["grid", "sobol", "random"]

SAMPLINGS: tuple[Sampling, ...] = ("grid", "sobol", "random")

_TABLE_ROWS = 65_536  # at most, of the innermost joints of a grid together
_TURN = 2 * math.pi


def unit_points(sampling: str, start: int, stop: int, dimension: int, seed: int) -> Array:
    """Points ``start`` to ``stop`` of a Sobol or random sample of the unit cube: (N, dimension).

    Random points come from the counter-based generator Philox4x64-10 (Salmon et al.,
    "Parallel random numbers: as easy as 1, 2, 3", 2011) with the seed as its key. Sobol
    points are shifted digit by digit (exclusive-or) by a vector drawn with the seed.
    """
    if sampling == "sobol":
        return sobol.unit_points(start, stop, _shift(dimension, seed))
    skip, rest = divmod(start * dimension, 4)  # a step of the counter gives four numbers
    raw = np.random.Philox(key=seed).advance(skip).random_raw(rest + (stop - start) * dimension)
    return np.asarray((raw[rest:] >> np.uint64(11)) * 2.0**-53).reshape(-1, dimension)


def put_points(
    out: Array, columns: Sequence[int], sampling: str, start: int, ranges: Array, seed: int
) -> None:
    """Put points from ``start`` on of a Sobol or random sample of ``ranges`` (k, 2) into columns.

    ``out`` (N, n) is C-contiguous, and has a column for each of the k ranges.
    """
    if sampling == "sobol":
        sobol.put_points(out, columns, start, ranges, _shift(len(columns), seed))
        return
    points = unit_points(sampling, start, start + len(out), len(columns), seed)
    out[:, columns] = points * (ranges[:, 1] - ranges[:, 0]) + ranges[:, 0]


@functools.cache
def _shift(dimension: int, seed: int) -> sobol.Words:
    return np.random.Philox(key=seed).random_raw(dimension) >> np.uint64(64 - sobol.BITS)


def grid_axis(low: float, high: float, steps: int, prismatic: bool) -> Array:
    """Values (steps,) of one joint of a grid; of a whole turn, its end is left out."""
    if steps == 1:
        return np.array([(low + high) / 2])
    whole = not prismatic and high - low > _TURN * (1 - 1e-9)
    return low + (high - low) * (np.arange(steps) / (steps if whole else steps - 1))


def grid_points(axes: list[Array], start: int, stop: int) -> Array:
    """Points ``start`` to ``stop`` of the grid of ``axes``, the last joint fastest: (N, k)."""
    out = np.empty((stop - start, len(axes)))
    inner, size = len(axes) - 1, len(axes[-1])
    while inner > 0 and size * len(axes[inner - 1]) <= _TABLE_ROWS:
        inner -= 1
        size *= len(axes[inner])
    table = np.stack(np.meshgrid(*axes[inner:], indexing="ij"), axis=-1).reshape(size, -1)
    for outer in range(start // size, -(-stop // size)):
        first = outer * size
        low, top = max(start, first), min(stop, first + size)
        rows = out[low - start : top - start]
        rows[:, inner:] = table[low - first : top - first]
        left = outer
        for k in range(inner - 1, -1, -1):
            left, digit = divmod(left, len(axes[k]))
            rows[:, k] = axes[k][digit]
    return out
