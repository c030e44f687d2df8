"""Motions: waypoints joined by straight segments, or piecewise polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Ints
from pinsing.algebra.along import place
from pinsing.arguments import real_numbers
from pinsing.errors import ConfigurationError, OptionError
from pinsing.proximity.watched import Watched

_MOST_DEGREE = 15
# Beyond it a float says nothing of an angle that is worth a check, and speeds overflow.
_FARTHEST = 1e9


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion in pieces.

    Attributes
    ----------
    t : (m + 1,) array
        Times at which pieces begin and end, ascending.
    pieces : (m, degree + 1, n) array
        On piece i, joint values are ``sum_k pieces[i, k] s^k``, with s from 0 to 1 in the time of
        the piece.
    """

    t: Array
    pieces: Array

    def at(self, u: Array) -> Array:
        """Joint values (K, n) at places u (K,): number of the piece plus s."""
        index, s = self.split(u)
        return place(self.pieces, index, s)

    def time(self, u: Array) -> Array:
        """Times (K,) of places u (K,)."""
        index, s = self.split(u)
        return np.asarray(self.t[index] + s * (self.t[index + 1] - self.t[index]))

    def split(self, u: Array) -> tuple[Ints, Array]:
        """Pieces and s of places u."""
        index = np.clip(np.floor(u).astype(np.int64), 0, len(self.pieces) - 1)
        return index, u - index


def motion_of(watched: Watched, motion: Any, t: npt.ArrayLike | None = None) -> Motion:
    """Read a motion: waypoints (N, n), or an object with ``c`` and ``x`` as SciPy's PPoly has.

    Raises
    ------
    ConfigurationError
        If waypoints have the wrong shape, or a value that is not finite or beyond 1e9.
    OptionError
        If times are not finite, not ascending, or not as many as waypoints.
    """
    if hasattr(motion, "c") and hasattr(motion, "x"):
        if t is not None:
            raise OptionError("a piecewise polynomial has times of its own: leave out t")
        return _polynomial(watched, motion)
    Q = watched.check(motion)
    if Q.ndim != 2:
        raise ConfigurationError(f"waypoints have shape (N, {watched.n}), got {Q.shape}")
    if len(Q) == 0:
        raise ConfigurationError("there is no waypoint")
    check_reach(watched, Q)
    times = check_times(t, len(Q))
    if len(Q) == 1:  # a motion that rests
        Q, times = np.repeat(Q, 2, axis=0), np.array([times[0], times[0]])
    return Motion(times, np.stack([Q[:-1], np.diff(Q, axis=0)], axis=1))


def check_reach(watched: Watched, Q: Array, what: str = "sample", first: int = 1) -> None:
    """Refuse values (N, n) that are no position of a joint: what is wrong is named by its number.

    Raises
    ------
    ConfigurationError
        If a value is beyond 1e9.
    """
    far = np.argwhere(np.abs(Q) > _FARTHEST)
    if len(far):
        i, j = far[0]
        raise ConfigurationError(
            f"{what} {first + i}: {watched.joints[j]} is {Q[i, j]:g}; values beyond "
            f"{_FARTHEST:g} (radians, metres) are no positions of a joint"
        )


def check_times(t: npt.ArrayLike | None, count: int) -> Array:
    """Times of ``count`` samples, checked; 0, 1, 2, ... by default.

    Raises
    ------
    OptionError
        If they are not finite, not ascending, or not as many.
    """
    if t is None:
        return np.arange(count, dtype=float)
    try:
        times = np.array(t, dtype=float)
    except (TypeError, ValueError) as error:
        raise OptionError(f"t is not an array of numbers: {error}") from None
    except OverflowError:
        raise OptionError("t holds a number too large for a float") from None
    if times.shape != (count,):
        raise OptionError(f"t needs {count} times, one a sample; got shape {times.shape}")
    wrong = np.flatnonzero(~np.isfinite(times))
    if wrong.size:
        raise OptionError(f"time of sample {wrong[0] + 1} is {times[wrong[0]]}")
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        i = int(back[0])
        raise OptionError(
            f"times must ascend: sample {i + 2} is at {times[i + 1]:g}, "
            f"the one before at {times[i]:g}"
        )
    return times


def _polynomial(watched: Watched, motion: Any) -> Motion:
    c, x = real_numbers(motion.c, "c of the motion"), real_numbers(motion.x, "x of the motion")
    if c.ndim != 3 or x.ndim != 1 or c.shape[1:] != (len(x) - 1, watched.n) or not c.size:
        raise ConfigurationError(
            f"a piecewise polynomial has coefficients c of shape (k, m, {watched.n}) and m + 1 "
            f"breakpoints x; got {c.shape} and {x.shape}"
        )
    if len(c) > _MOST_DEGREE + 1:
        raise OptionError(f"polynomials of degree {len(c) - 1}: at most {_MOST_DEGREE}")
    if not np.isfinite(c).all():
        raise ConfigurationError("a coefficient of the motion is not finite")
    times = check_times(x, len(x))
    rising = np.moveaxis(c[::-1], 0, 1)  # (m, degree + 1, n), powers of the local time
    width = np.diff(times)[:, None, None] ** np.arange(len(c))[None, :, None]
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = np.ascontiguousarray(rising * width)
    # Of a piece, no value exceeds the sum of its coefficients.
    check_reach(watched, np.nan_to_num(np.abs(pieces).sum(axis=1), nan=np.inf), "piece")
    return Motion(times, pieces)
