"""Stretches of a motion in which it may be nearer to a singular configuration than a bound.

Distance changes no faster than the configuration moves. On a step of length d between places at
which it is at least a and b it is at least (a + b - d) / 2; steps for which that is below the
bound are halved, until they are short. So nothing nearer than the bound lies outside the
stretches, and they reach beyond it by no more than a short step and the slack of the bounds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.algebra.two_sided import two_sided
from pinsing.proximity.crossings import Crossing
from pinsing.proximity.motion import Motion
from pinsing.proximity.watched import Watched

_SHORT = 1e-4
"""Length of a step that is not halved any more."""
_ROUNDS = 18
_MOST = 1000


@dataclass(frozen=True)
class NearStretch:
    """A time in which the clearance may be below a bound.

    Attributes
    ----------
    t, t_end : float
        From when to when.
    family : str
        The nearest family.
    clearance : float
        Proven: nowhere in it is a family nearer than this.
    """

    t: float
    t_end: float
    family: str
    clearance: float


@dataclass(frozen=True, eq=False)
class _Places:
    """Places along a motion, with the least lower bound of the clearance there."""

    u: Array
    least: Array
    family: Ints
    Q: Array

    def step(self, watched: Watched) -> tuple[Array, Array]:
        """Length of each step, and a lower bound of the clearance on it."""
        length = watched.length(np.diff(self.Q, axis=0))
        return length, np.maximum((self.least[:-1] + self.least[1:] - length) / 2, 0.0)

    def halved(self, watched: Watched, motion: Motion, which: Bool) -> _Places:
        """The same with a place in the middle of some steps."""
        k = np.flatnonzero(which)
        u = (self.u[k] + self.u[k + 1]) / 2
        Q = motion.at(u)
        bounds = two_sided(watched.conditions, Q)
        return _Places(
            np.insert(self.u, k + 1, u),
            np.insert(self.least, k + 1, bounds.lower),
            np.insert(self.family, k + 1, bounds.family),
            np.insert(self.Q, k + 1, Q, axis=0),
        )


class Stretches:
    """Gathers the stretches of a motion that is fed in pieces."""

    def __init__(self, watched: Watched, near: float) -> None:
        self.watched, self.near = watched, near
        self.cut = False
        self._found: list[NearStretch] = []
        self._open = False

    def feed(self, motion: Motion, u: Array, Q: Array, least: Array, family: Ints) -> None:
        """Take places u (K,) of a motion, where the clearance is at least ``least``."""
        places, near = _Places(u, least, family, Q), self.near
        for _ in range(_ROUNDS):
            length, bound = places.step(self.watched)
            outside = places.least >= near
            edge = outside[:-1] | outside[1:]
            again = (bound < near) & edge & (length > _SHORT)
            again |= self._deeper(places, length, bound)
            if not again.any():
                break
            places = places.halved(self.watched, motion, again)
        _, bound = places.step(self.watched)
        self._add(motion.time(places.u), places, bound)

    def _deeper(self, places: _Places, length: Array, bound: Array) -> Bool:
        """Steps of a stretch on which it may be a good deal nearer than is known so far."""
        inside = bound < self.near
        a, b = _runs(inside)
        again = np.zeros(len(inside), dtype=bool)
        if not len(a):
            return again
        lows = np.minimum(places.least[:-1], places.least[1:])
        of_run = np.minimum.reduceat(lows, np.stack([a, b], axis=1).ravel()[: 2 * len(a) - 1])[::2]
        known = np.full(len(inside), np.inf)
        for k in range(len(a)):
            known[a[k] : b[k]] = of_run[k]
        worse = bound < 0.95 * known - 0.01 * self.near
        return np.asarray(inside & worse & (length > _SHORT))

    def _add(self, t: Array, places: _Places, bound: Array) -> None:
        inside = bound < self.near
        a, b = _runs(inside)
        for start, end in zip(a.tolist(), b.tolist(), strict=True):
            k = start + int(np.argmin(places.least[start : end + 1]))
            new = NearStretch(
                float(t[start]),
                float(t[end]),
                self.watched.names[int(places.family[k])],
                float(bound[start:end].min()),
            )
            if start == 0 and self._open and self._found:
                old = self._found[-1]
                deeper = new if new.clearance < old.clearance else old
                self._found[-1] = NearStretch(old.t, new.t_end, deeper.family, deeper.clearance)
            elif len(self._found) < _MOST:
                self._found.append(new)
            else:
                self.cut = True
        self._open = bool(len(inside) and inside[-1])

    def finish(self, crossings: Sequence[Crossing]) -> tuple[NearStretch, ...]:
        """All of them; where a family is met in one, that is its family."""
        out = []
        for s in self._found:
            met = next((c for c in crossings if c.t <= s.t_end and c.t_end >= s.t), None)
            out.append(s if met is None else NearStretch(s.t, s.t_end, met.family, 0.0))
        return tuple(out)


def _runs(inside: Bool) -> tuple[Ints, Ints]:
    """Begin and end of each run of True."""
    padded = np.concatenate([[False], inside, [False]]).astype(np.int8)
    change = np.diff(padded)
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)
