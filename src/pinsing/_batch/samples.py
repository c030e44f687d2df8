"""Sobol points, and counts of values, in the compiled kernel, behind checked NumPy functions.

Both give the bits of the NumPy operations that are used where the kernel is not available.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pinsing._batch import engine

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Words = NDArray[np.uint64]


class ValueCounts(NamedTuple):
    """How values are distributed.

    Attributes
    ----------
    low, high : int
        How many are at most the lower, and the higher tolerance.
    least, greatest : int
        Where the first least, and the first greatest value are; -1 where there is no number.
    """

    low: int
    high: int
    least: int
    greatest: int


def available() -> bool:
    """Whether the functions of this module are there."""
    return engine.available()


def put_sobol(
    out: Floats,
    directions: Words,
    words: Words,
    start: int,
    columns: Counts,
    low: Floats,
    width: Floats,
) -> None:
    """Put points ``start``, ``start`` + 1, ... of a Sobol sequence into rows of ``out`` (N, n).

    Parameters
    ----------
    out : (N, n) ndarray
        C-contiguous; column ``columns[j]`` gets ``low[j]`` plus ``width[j]`` times coordinate j.
    directions : (bits, k) ndarray
        Direction numbers of ``bits`` digits.
    words : (k,) ndarray
        Digits of point 0, as those of floats from 1 to 2.
    start : int
        Number of the first point.
    columns, low, width : (k,) ndarray
        As above.

    Raises
    ------
    ValueError
        For shapes that do not fit, or points behind the end of the sequence.
    """
    engine.module().sobol_points(directions, words, start, columns, low, width, out)


def count_values(
    values: Floats, shift: int, first: int, bins: Counts, tolerances: tuple[float, float]
) -> ValueCounts:
    """Add ``values`` (N,), of any stride, to their ``bins`` (B,), and say what their extremes are.

    The number of a bin is the float's bits without the last ``shift``, less ``first``; what is
    below or above all bins goes to the first or the last.

    Raises
    ------
    ValueError
        For shapes that do not fit.
    """
    low, high = tolerances
    return ValueCounts(*engine.module().count_values(values, shift, first, bins, low, high))
