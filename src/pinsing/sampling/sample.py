"""Where the configurations of a map are: any stretch of them, computed from their numbers.

Nothing depends on how a map is cut into chunks, and nothing is as long as the map.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from pinsing._batch import engine
from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.robot.arm import Arm

Sampling = Literal["grid", "sobol", "random"]
Words = npt.NDArray[np.uint64]

SAMPLINGS: tuple[Sampling, ...] = ("grid", "sobol", "random")

BITS = 52
"""Binary digits of a coordinate of a Sobol point, and of its number: those of a float."""

MAX_DIMENSION = 64
"""Coordinates that the compiled kernel puts."""


def moving_ranges(arm: Arm, ignore_limits: bool, notes: list[str] | None = None) -> Array:
    """Range (n, 2) that each joint moves over: its limits, but no more than one turn."""
    low, high = arm.space.range(ignore_limits)
    turn = 2 * math.pi
    long = ~arm.prismatic & (high - low > turn * (1 + 1e-6))
    # From -pi on if that is in the range.
    low = np.where(long, np.maximum(low, np.minimum(-np.pi, high - turn)), low)
    high = np.where(long, low + turn, high)
    if notes is not None and long.any():
        names = ", ".join(np.array(arm.joints)[long])
        notes.append(f"one turn of {names} is swept: the rest of the range only repeats it")
    return np.stack([low, high], axis=1)


def put_points(
    out: Array, columns: Sequence[int], sampling: str, start: int, ranges: Array, seed: int
) -> None:
    """Put points from ``start`` on of a Sobol or random sample of ``ranges`` (k, 2) into columns.

    ``out`` (N, n) is C-contiguous, and has a column for each of the k ranges.
    """
    k, low = len(columns), np.ascontiguousarray(ranges[:, 0])
    width = ranges[:, 1] - low
    if sampling == "sobol" and engine.available():
        words = _shift(k, seed) ^ np.float64(1.0).view(np.uint64)  # of floats from 1 to 2
        where = np.array(columns, dtype=np.int64)
        engine.put_sobol(out, directions(k), words, start, where, low, width)
    else:
        out[:, columns] = unit_points(sampling, start, start + len(out), k, seed) * width + low


def unit_points(sampling: str, start: int, stop: int, dimension: int, seed: int) -> Array:
    """Points ``start`` to ``stop`` of a Sobol or random sample of the unit cube: (N, dimension).

    Random points come from the counter-based generator Philox4x64-10 (Salmon et al.,
    "Parallel random numbers: as easy as 1, 2, 3", 2011) with the seed as its key. Sobol
    points are shifted digit by digit (exclusive-or) by a vector drawn with the seed.
    """
    if sampling == "sobol":
        return np.asarray((sobol(start, stop, dimension) ^ _shift(dimension, seed)) * 2.0**-BITS)
    skip, rest = divmod(start * dimension, 4)  # a step of the counter gives four numbers
    raw = np.random.Philox(key=seed).advance(skip).random_raw(rest + (stop - start) * dimension)
    return np.asarray((raw[rest:] >> np.uint64(11)) * 2.0**-53).reshape(-1, dimension)


def sobol(start: int, stop: int, dimension: int) -> Words:
    """Sobol points ``start`` to ``stop`` as integers (N, dimension) of BITS digits.

    Point i is the exclusive-or of the direction numbers at the digits of its Gray code.
    """
    gray = np.arange(start, stop, dtype=np.uint64)
    gray ^= gray >> np.uint64(1)
    points = np.zeros((len(gray), dimension), dtype=np.uint64)
    for digit, v in enumerate(directions(dimension)[: stop.bit_length()]):
        points ^= ((gray >> np.uint64(digit)) & np.uint64(1))[:, None] * v
    return points


@functools.cache
def directions(dimension: int) -> Words:
    """Direction numbers (BITS, dimension) of a Sobol sequence, scaled to BITS digits.

    S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections",
    SIAM J. Sci. Comput. 30 (2008) 2635-2654. Their table is read from SciPy's file: to import
    ``scipy.stats`` for it takes longer than a small map.

    Raises
    ------
    OptionError
        If this SciPy has no such file.
    """
    folders = getattr(find_spec("scipy"), "submodule_search_locations", None) or [""]
    try:
        with np.load(Path(folders[0], "stats", "_sobol_direction_numbers.npz")) as table:
            polynomials = table["poly"][:dimension].tolist()
            first_numbers = table["vinit"][:dimension].tolist()
    except OSError:
        raise OptionError(
            "this SciPy has no table for Sobol samples: choose a random one"
        ) from None
    v = np.zeros((BITS, dimension), dtype=np.uint64)
    v[:, 0] = [1 << (BITS - 1 - j) for j in range(BITS)]
    for k in range(1, dimension):
        degree = polynomials[k].bit_length() - 1
        column = [x << (BITS - 1 - j) for j, x in enumerate(first_numbers[k][:degree])]
        for j in range(degree, BITS):
            new = column[j - degree] ^ (column[j - degree] >> degree)
            for i in range(1, degree):
                if polynomials[k] >> (degree - i) & 1:
                    new ^= column[j - i]
            column.append(new)
        v[:, k] = column
    v.setflags(write=False)
    return v


@functools.cache
def _shift(dimension: int, seed: int) -> Words:
    return np.random.Philox(key=seed).random_raw(dimension) >> np.uint64(64 - BITS)


def grid_axis(low: float, high: float, steps: int, prismatic: bool) -> Array:
    """Values (steps,) of one joint of a grid; of a whole turn, its end is left out."""
    if steps == 1:
        return np.array([(low + high) / 2])
    whole = not prismatic and high - low > 2 * math.pi * (1 - 1e-9)
    return low + (high - low) * (np.arange(steps) / (steps if whole else steps - 1))


def grid_points(axes: list[Array], start: int, stop: int) -> Array:
    """Points ``start`` to ``stop`` of the grid of ``axes``, the last joint fastest: (N, k)."""
    out, left = np.empty((stop - start, len(axes))), np.arange(start, stop)
    for k in range(len(axes) - 1, -1, -1):
        left, place = np.divmod(left, len(axes[k]))
        out[:, k] = axes[k][place]
    return out
