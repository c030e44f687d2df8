"""Sobol points by index: any stretch of the sequence at once, without what comes before it.

Direction numbers of S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better
two-dimensional projections", SIAM J. Sci. Comput. 30 (2008) 2635-2654, file new-joe-kuo-6.21201.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pinsing._batch import samples
from pinsing._types import Array

Words = npt.NDArray[np.uint64]

BITS = 52
"""Binary digits of a coordinate, and of an index."""

# Of dimension 2, 3, ...: coefficients a of the primitive polynomial, initial numbers m_1 .. m_s.
_TABLE: tuple[tuple[int, tuple[int, ...]], ...] = (
    (0, (1,)),
    (1, (1, 3)),
    (1, (1, 3, 1)),
    (2, (1, 1, 1)),
    (1, (1, 1, 3, 3)),
    (4, (1, 3, 5, 13)),
    (2, (1, 1, 5, 5, 17)),
    (4, (1, 1, 5, 5, 5)),
    (7, (1, 1, 7, 11, 19)),
    (11, (1, 1, 5, 1, 1)),
    (13, (1, 1, 1, 3, 11)),
    (14, (1, 3, 5, 5, 31)),
    (1, (1, 3, 3, 9, 7, 49)),
    (13, (1, 1, 1, 15, 21, 21)),
    (16, (1, 3, 1, 13, 27, 49)),
    (19, (1, 1, 1, 15, 7, 5)),
    (22, (1, 3, 1, 15, 13, 25)),
    (25, (1, 1, 5, 5, 19, 61)),
    (1, (1, 3, 7, 11, 23, 15, 103)),
    (4, (1, 3, 7, 13, 13, 15, 69)),
)

MAX_DIMENSION = len(_TABLE) + 1

_LOW = 12  # digits of an index that the table below covers


@functools.cache
def directions(dimension: int) -> Words:
    """Direction numbers (BITS, dimension), scaled to BITS digits."""
    v = np.zeros((BITS, dimension), dtype=np.uint64)
    for k in range(dimension):
        a, m = _TABLE[k - 1] if k else (0, (1,))
        s = len(m)
        column = [int(x) << (BITS - 1 - j) for j, x in enumerate(m)]
        for j in range(s, BITS):
            if k == 0:
                new = 1 << (BITS - 1 - j)
            else:
                new = column[j - s] ^ (column[j - s] >> s)
                for i in range(1, s):
                    new ^= column[j - i] * ((a >> (s - 1 - i)) & 1)
            column.append(new)
        v[:, k] = column
    v.setflags(write=False)
    return v


@functools.cache
def _low_table(dimension: int) -> Words:
    """Words of the first points: (dimension, 2**_LOW), by reflection of the Gray code."""
    v, table = directions(dimension), np.zeros((dimension, 1), dtype=np.uint64)
    for j in range(_LOW):
        table = np.concatenate([table, table[:, ::-1] ^ v[j, :, None]], axis=1)
    table.setflags(write=False)
    return table


def unit_points(start: int, stop: int, shift: Words) -> Array:
    """Points ``start`` to ``stop``, their words xor ``shift`` (dimension,) over 2**BITS: (N, dim).

    The digits of a word are those of a float between 1 and 2 beside its exponent, so that no
    integer is converted.
    """
    points = words(start, stop, len(shift), _beside_one(shift)).view(np.float64)
    points -= 1.0
    return points


def put_points(out: Array, columns: Sequence[int], start: int, ranges: Array, shift: Words) -> None:
    """Put points from ``start`` on, from the unit cube to ``ranges``, into ``columns`` of ``out``.

    Parameters
    ----------
    out : (N, n) array
        C-contiguous. Its other columns stay as they are.
    columns : sequence of int
        A column for each of the k coordinates.
    start : int
        Number of the first point.
    ranges : (k, 2) array
        Ends of the range of each coordinate.
    shift : (k,) array
        As of `unit_points`.
    """
    low = np.ascontiguousarray(ranges[:, 0])
    width = ranges[:, 1] - low
    if not samples.available():
        out[:, columns] = unit_points(start, start + len(out), shift) * width + low
        return
    where = np.array(columns, dtype=np.int64)
    samples.put_sobol(out, directions(len(shift)), _beside_one(shift), start, where, low, width)


def _beside_one(shift: Words) -> Words:
    return shift ^ np.float64(1.0).view(np.uint64)


def words(start: int, stop: int, dimension: int, shift: Words | int = 0) -> Words:
    """Points ``start`` to ``stop`` as integers (N, dimension) below 2**BITS, xor ``shift``.

    A column is contiguous, so that what is done to it does not hop. Point i is the exclusive-or of
    the direction numbers at the digits of its Gray code i ^ (i >> 1). That is linear in the digits
    of i, so that it splits into a part of the high digits and a table of the low ones.
    """
    v, table = directions(dimension), _low_table(dimension)
    out = np.empty((dimension, stop - start), dtype=np.uint64)
    size = table.shape[1]
    for high in range(start // size, -(-stop // size)):
        first = high * size
        gray = first ^ (first >> 1)
        chosen = [j for j in range(gray.bit_length()) if gray >> j & 1]
        base = np.bitwise_xor.reduce(v[chosen], axis=0) ^ np.asarray(shift, dtype=np.uint64)
        low, top = max(start, first), min(stop, first + size)
        part = table[:, low - first : top - first]
        np.bitwise_xor(part, base[:, None], out=out[:, low - start : top - start])
    return out.T
