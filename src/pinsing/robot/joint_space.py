"""Joint space: names, limits, what counts as far, what is outside, values at random.

An arm, a family of its singular configurations and a mechanism each have one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool


def named(word: str, names: Sequence[str]) -> str:
    """Return the joint that ``q2`` stands for, the second, unless one is called so."""
    place = re.fullmatch(r"[qQ]([1-9]\d{0,3})", word)
    if word not in names and place and int(place[1]) <= len(names):
        return names[int(place[1]) - 1]
    return word


@dataclass(frozen=True, eq=False)
class JointSpace:
    """What is known of the joints alone, whatever they carry.

    Attributes
    ----------
    names : tuple of str
        One for each joint.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite where there are none.
    length_scale : float
        Metres that count as one radian.
    """

    names: tuple[str, ...]
    prismatic: Bool
    lower: Array
    upper: Array
    length_scale: float

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.names)

    @cached_property
    def metric(self) -> Array:
        """Unit of each joint, (n,): 1 rad, or the length scale of a prismatic joint."""
        return np.where(self.prismatic, self.length_scale, 1.0)

    @cached_property
    def span(self) -> tuple[Array, Array]:
        """Return the range (lower, upper), each (n,), that joints are swept or drawn over."""
        # Without limits: a full turn, or one length scale to both sides; twice that beside one.
        reach = np.where(self.prismatic, self.length_scale, np.pi)
        high = np.where(np.isfinite(self.lower), self.lower + 2 * reach, reach)
        high = np.where(np.isfinite(self.upper), self.upper, high)
        return np.where(np.isfinite(self.lower), self.lower, high - 2 * reach), high

    @cached_property
    def circles(self) -> tuple[Array, Array]:
        """As `span`, with whole circles of all revolute joints, whatever their limits."""
        low, high = self.span
        return np.where(self.prismatic, low, -np.pi), np.where(self.prismatic, high, np.pi)

    def range(self, ignore_limits: bool) -> tuple[Array, Array]:
        """`circles` or `span`."""
        return self.circles if ignore_limits else self.span

    def one_turn(self, ignore_limits: bool) -> Array:
        """`range` as (n, 2), but no more than one turn: from -pi on if that is in the range."""
        low, high = self.range(ignore_limits)
        turn = 2 * np.pi
        long = ~self.prismatic & (high - low > turn * (1 + 1e-6))
        low = np.where(long, np.maximum(low, np.minimum(-np.pi, high - turn)), low)
        return np.stack([low, np.where(long, low + turn, high)], axis=1)

    def index(self, name: str) -> int:
        """Return the index of a joint, by name or as ``q1``; UnknownNameError if there is none."""
        found = named(name, self.names)
        UnknownNameError.refuse_if(found not in self.names, "joint", name, self.names)
        return self.names.index(found)

    def mask(self, names: Iterable[str]) -> Bool:
        """Return which joints (n,) are among ``names``; as `index`."""
        found = np.zeros(self.n, dtype=bool)
        found[[self.index(name) for name in names]] = True
        return found

    def wrap(self, q: ArrayLike) -> Array:
        """Revolute values, or differences of such, (..., n) within half a turn of zero.

        Half a turn is -pi, however it was rounded.
        """
        q = np.asarray(q, dtype=float)
        turns = np.where(self.prismatic, 0.0, np.floor((q + np.pi + ROUNDING) / (2 * np.pi)))
        return np.asarray(q - 2 * np.pi * turns)

    def fold(self, q: ArrayLike) -> Array:
        """Move angles of q (..., n) by whole turns to the limits, without them to [-pi, pi]."""
        q = np.array(q, dtype=float)
        low, high = self.span
        turn = 2 * np.pi
        center = np.where(self.prismatic, 0.0, (low + high) / 2)
        folded = np.where(self.prismatic, q, q - turn * np.round((q - center) / turn))
        return np.where((q >= low) & (q <= high), q, folded)

    def outside(self, q: ArrayLike, slack: float = ROUNDING) -> Bool:
        """Return which values of q (..., n) are beyond a limit as they are, no turn taken off."""
        q = np.asarray(q, dtype=float)
        return np.asarray((q < self.lower - slack) | (q > self.upper + slack))

    def unreachable(self, q: ArrayLike, slack: float = ROUNDING) -> Bool:
        """Return which values of q (..., n) are beyond a limit, whatever whole turns are added."""
        return self.outside(self.fold(q), slack)

    def turns_within(self, Q: Array) -> Array:
        """Return whole turns (n,), as few as bring each joint of a path Q (N, n) into its limits.

        Radians; zero for joints that slide, and where no turns do.
        """
        turn = 2 * np.pi
        fewest = np.ceil((self.lower - 1e-9 - Q.min(axis=0)) / turn)
        most = np.floor((self.upper + 1e-9 - Q.max(axis=0)) / turn)
        usable = ~self.prismatic & (fewest <= most)
        return np.where(usable, np.clip(0.0, fewest, most), 0.0) * turn

    def range_words(self, j: int, degrees: bool = False) -> str:
        """Return the limits of joint j, such as ``-6.283 to 6.283 rad``."""
        turns = not self.prismatic[j]
        factor, unit = (180 / np.pi, "°") if degrees and turns else (1.0, " rad" if turns else " m")
        return f"{factor * self.lower[j]:.4g} to {factor * self.upper[j]:.4g}{unit}"

    def outside_words(self, q: Array, degrees: bool = False) -> list[str]:
        """Return a sentence about each value of q (n,) outside its limits."""
        folded = self.fold(q)
        out = []
        for j in map(int, np.flatnonzero(self.outside(q))):
            factor = 180 / np.pi if degrees and not self.prismatic[j] else 1.0
            unit = "m" if self.prismatic[j] else "°" if degrees else "rad"
            value, near = (f"{factor * x[j]:.6g} {unit}".replace(" °", "°") for x in (q, folded))
            limits = self.range_words(j, degrees)
            hint = "" if self.outside(folded)[j] else f"; {near}, whole turns aside, is within them"
            out.append(f"{self.names[j]} = {value} is outside its limits, {limits}{hint}")
        return out

    def require_radians(
        self,
        q: Array,
        called: str,
        *,
        first: int | None = None,
        rows: int = 1000,
        endless: bool = True,
    ) -> None:
        """Raise ConfigurationError if values of q (..., n) make sense in degrees only.

        One does if it is more than a turn beyond a limit, and as degrees within the limits; a
        joint without limits, if ``endless``, has those of a turn to each side. About ``rows`` rows
        are looked at; messages number them from ``first``.
        """
        if q.ndim == 1 and max(map(abs, q.tolist())) < self._near:  # a microsecond, for loops
            return
        step = max(1, len(q) // rows) if q.ndim > 1 else 1
        looked = (q[::step] if q.ndim > 1 else q).reshape(-1, self.n)
        low, high = self._ends
        over = np.maximum(looked - high, low - looked)
        if not (over > 2 * np.pi).any():
            return
        as_degrees = np.radians(looked)
        odd = (over > 2 * np.pi) & (as_degrees > low - 0.01) & (as_degrees < high + 0.01)
        odd &= ~self.prismatic & (endless | np.isfinite(self.upper))
        if not odd.any():
            return
        i, j = (int(k) for k in np.argwhere(odd)[0])
        value = float(looked[i, j])
        row = "" if q.ndim == 1 else f"[{i * step}]" if first is None else f" {first + i * step}"
        limits = f"limits {self.range_words(j)}" if np.isfinite(self.upper[j]) else "no limits"
        raise ConfigurationError(
            f"{called}{row}: {self.names[j]} = {value:g} rad is {value / (2 * np.pi):.1f} turns "
            f"({limits}). For degrees add --deg (Python: numpy.radians); if radians are meant, "
            'add --rad (Python: load(..., units="rad"))',
            joint=self.names[j],
            value=value,
            limits=(float(self.lower[j]), float(self.upper[j])),
        )

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Limits, a turn to each side for joints without."""
        turn = np.where(self.prismatic, np.inf, 2 * np.pi)
        low = np.where(np.isfinite(self.lower), self.lower, -turn)
        return low, np.where(np.isfinite(self.upper), self.upper, turn)

    @cached_property
    def _near(self) -> float:
        """Magnitude below which no value is more than a turn beyond a limit."""
        low, high = self._ends
        return float(np.minimum(high, -low)[~self.prismatic].min(initial=np.inf)) + 2 * np.pi

    def sample(self, count: int, rng: np.random.Generator, ignore_limits: bool = False) -> Array:
        """Random joint vectors (count, n) in `range`."""
        return rng.uniform(*self.range(ignore_limits), (count, self.n))


def require_values(values: Array, names: Sequence[str], called: str, whole: int = 0) -> None:
    """Raise ConfigurationError unless ``values`` (..., n or ``whole``) are finite numbers."""
    n = len(names)
    if values.ndim == 0 or values.shape[-1] not in (n, whole or n):
        got = "a single number" if values.ndim == 0 else f"{values.shape[-1]}"
        lengths = (n,) if whole in (0, n) else (n, whole)
        also = "" if len(lengths) == 1 else f", or the whole model's {whole}"
        raise ConfigurationError(
            f"{called} needs {n} values for {', '.join(names)}{also}; got {got}", lengths=lengths
        )
    finite = np.isfinite(values)
    if not finite.all():
        bad = np.argwhere(~finite)[0]
        value, i = float(values[tuple(bad)]), int(bad[-1])
        joint = names[i] if values.shape[-1] == n else None
        which = f"entry {i} of the whole model" if joint is None else f"joint {joint!r}"
        raise ConfigurationError(
            f"{called} of {which} is {value}; every value must be finite", joint=joint, value=value
        )


def require_scale(length_scale: float) -> None:
    """Raise an OptionError unless a length scale is a positive number."""
    OptionError.refuse_if(
        not (np.isfinite(length_scale) and length_scale > 0),
        f"length_scale must be a positive number of metres, got {length_scale!r}",
    )


def model_q(model: pin.Model, values: Array) -> Array:
    """Return Pinocchio's configurations (..., nq) for one value of each joint (..., nv)."""
    if model.nq == model.nv:
        return values
    out = np.empty((*values.shape[:-1], model.nq))
    for joint in model.joints[1:]:
        value = values[..., joint.idx_v]
        if joint.nq == 2:
            out[..., joint.idx_q], out[..., joint.idx_q + 1] = np.cos(value), np.sin(value)
        else:
            out[..., joint.idx_q] = value
    return out
