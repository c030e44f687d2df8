"""All zeros of equations along pieces of a motion, isolated with proof.

On an interval of half-width h, with f and f' in its middle and W a bound of |f''| on it: there is
no zero where |f| > |f'| h + W h^2 / 2; at most one where |f'| > W h, and the signs at the ends
tell; else the interval is halved, until f cannot be told from zero on it.
"""

from __future__ import annotations

import numpy as np

from pinsing._batch import engine
from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import sum_at

_ROUNDS = 44
_LOOKS = 6000

SIMPLE, FLAT = 1, 2
"""Kinds of an event: one change of sign; an interval on which the equation is zero to rounding."""


@dataclass(frozen=True, eq=False)
class Zeros:
    """Events along pieces, in the order of pieces.

    Attributes
    ----------
    piece, equation : (K,) arrays of int
        Where, and of which equation.
    s : (K,) array
        Place within the piece, 0 to 1: the zero, or the middle of the interval.
    width : (K,) array
        Half of the interval; 0 for a simple zero.
    kind : (K,) array of int
        SIMPLE or FLAT.
    ends : (m, E, 2) array
        Values of the equations at both ends of each piece.
    """

    piece: Ints
    equation: Ints
    s: Array
    width: Array
    kind: Ints
    ends: Array


def zeros_along(conditions: Conditions, pieces: Array, *, compiled: bool = True) -> Zeros:
    """Every zero of every equation of conditions along polynomial pieces.

    Parameters
    ----------
    conditions : Conditions
        Their equations count, whichever branches they belong to.
    pieces : (m, degree + 1, n) array
        Joint values are ``sum_k pieces[i, k] s^k`` for s from 0 to 1.
    compiled : bool
        Whether the compiled engine is used where there is one.
    """
    scaled = conditions.scaled(pieces)
    equations = len(conditions.noise)
    ends = np.empty((len(pieces), equations, 2))
    handle = conditions.compiled() if compiled else None
    if handle is not None:
        flat = handle.zeros(scaled, ends, engine.cpu_count())
        rows = np.array(flat, dtype=float).reshape(-1, 5)
    else:
        found = [_zeros(conditions, e, scaled, ends) for e in range(equations)]
        rows = np.concatenate(found) if found else np.zeros((0, 5))
        rows = rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
    whole = rows.astype(np.int64)
    return Zeros(whole[:, 0], whole[:, 1], rows[:, 2], rows[:, 3], whole[:, 4], ends)


def place(pieces: Array, index: Ints, s: Array) -> Array:
    """Joint values (K, n) at s (K,) of the pieces of some indices (K,)."""
    out = np.zeros((len(s), pieces.shape[2]))
    for k in range(pieces.shape[1] - 1, -1, -1):
        out = out * s[:, None] + pieces[index, k]
    return out


def _zeros(c: Conditions, e: int, pieces: Array, ends: Array) -> Array:
    every = np.arange(len(pieces))
    for side in (0, 1):
        at = place(pieces, every, np.full(len(pieces), float(side)))
        ends[:, e, side] = sum_at(c, e, at).value
    index, s, h = every, np.full(len(every), 0.5), np.full(len(every), 0.5)
    looks = np.zeros(len(every), dtype=np.int64)
    rows = [np.zeros((0, 5))]
    for _ in range(_ROUNDS):
        if not len(index):
            break
        value, slope, bend, error = _expand(c, e, pieces[index], s, h)
        swing = np.abs(slope) * h + 0.5 * bend * h * h
        left = np.abs(value) <= swing + error
        monotone = left & (np.abs(slope) > (bend * h + error) * (1 + 1e-12))
        np.add.at(looks, index, 1)
        flat = left & ~monotone
        flat &= (np.abs(value) + swing <= 4 * error) | (h < 1e-13) | (looks[index] > _LOOKS)
        rows.append(_rows(index[flat], e, s[flat], h[flat], FLAT))
        rows.append(_simple(c, e, pieces, index[monotone], s[monotone], h[monotone]))
        again = left & ~monotone & ~flat
        index, half = np.repeat(index[again], 2), np.repeat(h[again] / 2, 2)
        s = np.repeat(s[again], 2) + half * np.tile([-1.0, 1.0], int(again.sum()))
        h = half
    return np.concatenate(rows)


def _rows(index: Ints, e: int, s: Array, h: Array, kind: int) -> Array:
    return np.stack([index, np.full(len(s), e), s, h, np.full(len(s), kind)], axis=1).astype(float)


def _simple(c: Conditions, e: int, pieces: Array, index: Ints, s: Array, h: Array) -> Array:
    """Zeros on intervals on which the equation is monotone."""
    low, high = s - h, s + h
    first = sum_at(c, e, place(pieces, index, low)).value < 0
    last = sum_at(c, e, place(pieces, index, high)).value < 0
    change = first != last
    index, low, high, first = index[change], low[change], high[change], first[change]
    for _ in range(60):
        middle = (low + high) / 2
        before = (sum_at(c, e, place(pieces, index, middle)).value < 0) == first
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return _rows(index, e, (low + high) / 2, np.zeros(len(low)), SIMPLE)


def _expand(
    c: Conditions, e: int, pieces: Array, s: Array, h: Array
) -> tuple[Array, Array, Array, Array]:
    """Value, slope, bound of the second derivative and error on intervals (K,)."""
    value, slope, bend, size = (np.zeros(len(s)) for _ in range(4))
    farthest = np.full(len(s), 4.0)
    for t in range(c.term_start[e], c.term_start[e + 1]):
        rates = slice(c.rate_start[t], c.rate_start[t + 1])
        used = pieces[:, :, c.rate_joint[rates]]
        farthest = np.maximum(farthest, np.abs(used).sum(axis=1).max(axis=1, initial=0.0))
        angle = used @ c.rate[rates]
        angle[:, 0] += c.phase[t]
        now, turning, _, second = _polynomial(angle, s, h)
        turning_most = np.abs(turning) + second * h
        m, m_slope = np.full(len(s), c.amplitude[t]), np.zeros(len(s))
        top, first, second_m = np.full(len(s), abs(c.amplitude[t])), 0.0, 0.0
        for k in range(c.power_start[t], c.power_start[t + 1]):
            x, x_slope, x_most, x_second = _polynomial(pieces[:, :, c.power_joint[k]], s, h)
            x_most = np.maximum(x_most, 1e-150)
            for _ in range(int(c.power[k])):
                m_slope = m_slope * x + m * x_slope
                m = m * x
                top = top * x_most
            first = first + c.power[k] * (np.abs(x_slope) + x_second * h) / x_most
            second_m = second_m + c.power[k] * x_second / x_most
        value += m * np.cos(now)
        slope += m_slope * np.cos(now) - m * np.sin(now) * turning
        bend += top * (turning_most**2 + second + 2 * first * turning_most + first**2 + second_m)
        size += top
    relative = c.noise[e] + 9e-16 * c.reach[e] * farthest * pieces.shape[1]
    return value, slope, bend * (1 + 1e-12), size * relative


def _polynomial(a: Array, s: Array, h: Array) -> tuple[Array, Array, Array, Array]:
    """Expand polynomials a (K, degree + 1) at s.

    Returns value and slope, and bounds of value and second derivative on s - h to s + h.
    """
    value, slope, second = (np.zeros(len(s)) for _ in range(3))
    for i in range(a.shape[1] - 1, -1, -1):
        slope = slope * s + value
        value = value * s + a[:, i]
    for i in range(a.shape[1] - 1, 1, -1):
        second = second * (s + h) + i * (i - 1) * np.abs(a[:, i])
    most = np.abs(value) + (np.abs(slope) + second * h) * h
    return value, slope, most, second
