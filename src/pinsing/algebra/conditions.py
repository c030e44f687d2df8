"""Conditions: joints at values, and trigonometric sums that are zero.

All of it in weighted coordinates ``x = w q``, in which distances are plain norms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from pinsing._batch import engine
from pinsing._types import Array, Bool, Ints
from pinsing.algebra.equation import Equation
from pinsing.algebra.trig_sum import TrigSum
from pinsing.errors import OptionError

NORMS = ("euclidean", "max")


class Fixed(Protocol):
    """A joint at a value."""

    @property
    def joint(self) -> int:
        """Index of the joint."""

    @property
    def value(self) -> float:
        """Radians or metres."""


class Branch(Protocol):
    """Joints at values, and equations in the others, all of which hold."""

    @property
    def values(self) -> Sequence[Fixed]:
        """Joints at values."""

    @property
    def equations(self) -> Sequence[Equation]:
        """Equations in the other joints."""


@dataclass(frozen=True, eq=False)
class WeightedBranch:
    """One branch of a family: joints (k,) at values (k,), and sums that are zero, all at once."""

    family: int
    joints: Ints
    values: Array
    sums: tuple[TrigSum, ...]

    def used(self, n: int) -> Bool:
        """Joints (n,) that occur in the sums."""
        used = np.zeros(n, dtype=bool)
        for s in self.sums:
            used[s.used] = True
        return used


@dataclass(frozen=True, eq=False)
class Margin:
    """How far what distances are asked of may be from the families that they are taken to.

    Every point of it is within ``alone`` of a family, or else within ``meeting`` of one and within
    ``near`` of a second one.

    Attributes
    ----------
    alone : (F,) array
        Of each family; in weighted coordinates.
    meeting, near : float
        Where families meet.
    """

    alone: Array
    meeting: float
    near: float

    def times(self, factor: float) -> Margin:
        """The same in coordinates in which no distance is longer than this many times."""
        return Margin(self.alone * factor, self.meeting * factor, self.near * factor)

    def take_off(self, lower: Array) -> Array:
        """Bounds (N, F) of the distance to the points near each family, of those to families."""
        second = np.sort(lower, axis=1)[:, 1:2] if lower.shape[1] > 1 else np.inf
        # The second nearest of a family and the others is not nearer than these two.
        there = np.maximum(lower - self.meeting, np.maximum(lower, second) - self.near)
        with np.errstate(invalid="ignore"):
            off = np.minimum(lower - self.alone, there)
        return np.where(np.isfinite(self.meeting), np.maximum(off, 0.0), 0.0)


@dataclass(frozen=True, eq=False)
class Conditions:
    """The branches of some families, ready to be asked at many configurations.

    Attributes
    ----------
    families : int
        How many; branches refer to them by index.
    weight : (n,) array
        Weighted coordinate over joint value: 1 for revolute joints, 1 / length scale for
        prismatic ones unless weights were given.
    turn : (n,) array
        A whole turn in weighted coordinates; 0 for prismatic joints.
    branches : tuple of WeightedBranch
        A point lies on a family where it lies on one of its branches.
    norm : str
        "euclidean" or "max".
    margin : Margin or None
        What is taken off lower bounds, for them to be about a robot whose design has the families.
    """

    families: int
    weight: Array
    turn: Array
    branches: tuple[WeightedBranch, ...]
    norm: str = "euclidean"
    margin: Margin | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.weight)

    @cached_property
    def plain(self) -> Conditions:
        """The same without a margin."""
        return replace(self, margin=None)

    @cached_property
    def sums(self) -> tuple[TrigSum, ...]:
        """The sums of all branches, one after the other."""
        return tuple(s for b in self.branches for s in b.sums)

    def size(self, X: Array) -> Array:
        """Length (...,) of differences X (..., n)."""
        largest = self.norm == "max"
        sizes = np.abs(X).max(axis=-1, initial=0.0) if largest else np.linalg.norm(X, axis=-1)
        return np.asarray(sizes)

    def joined(self, a: Array, b: Array) -> Array:
        """Length of a difference whose parts in some joints and the others have lengths a, b."""
        return np.asarray(np.maximum(a, b) if self.norm == "max" else np.hypot(a, b))

    def scaled(self, Q: Array) -> Array:
        """Weighted coordinates of joint values Q (..., n), C-contiguous."""
        if bool((self.weight == 1.0).all()):
            return np.ascontiguousarray(Q)
        return np.ascontiguousarray(Q * self.weight)

    @cached_property
    def flat(self) -> dict[str, Array | Ints | Bool]:
        """All numbers as flat arrays, as the kernel and guards in C hold them.

        ``x_start`` says where the values (equations, terms, rates, powers) of each branch
        (branch, equation, term, term) start.
        """
        sums, n = self.sums, self.n
        rate, power = (
            np.concatenate([np.zeros((0, n)), *(getattr(s, k) for s in sums)])
            for k in ("rate", "power")
        )
        per_sum = {
            k: np.array([getattr(s, k) for s in sums], dtype=float)
            for k in ("noise", "reach", "curvature", "steepness")
        }
        amplitude, phase, rate_norm = (
            np.concatenate([np.zeros(0), *(getattr(s, k) for s in sums)])
            for k in ("amplitude", "phase", "rate_norm")
        )
        return {
            "family": np.array([b.family for b in self.branches], dtype=np.int64),
            "weight": self.weight,
            "turn": self.turn,
            "value_start": _starts([len(b.joints) for b in self.branches]),
            "value_joint": np.array([j for b in self.branches for j in b.joints], dtype=np.int64),
            "value": np.array([v for b in self.branches for v in b.values], dtype=float),
            "equation_start": _starts([len(b.sums) for b in self.branches]),
            "term_start": _starts([len(s.amplitude) for s in sums]),
            **per_sum,
            "sliding": np.array([bool(len(s.slides)) for s in sums], dtype=bool),
            "amplitude": amplitude,
            "phase": phase,
            "rate_norm": rate_norm,
            "rate_start": _starts((rate != 0).sum(axis=1)),
            "rate_joint": np.nonzero(rate)[1],
            "rate": rate[rate != 0],
            "power_start": _starts((power != 0).sum(axis=1)),
            "power_joint": np.nonzero(power)[1],
            "power": power[power != 0].astype(np.int64),
        }

    @cached_property
    def compiled(self) -> Any | None:
        """The same in the compiled engine; None where that is not installed, or too small."""
        return engine.condition_set(self.families, self.flat, self.norm == "max")

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "compiled"}

    @classmethod
    def of(
        cls,
        families: Sequence[Sequence[Branch]],
        prismatic: Bool,
        weight: Array,
        norm: str = "euclidean",
    ) -> Conditions:
        """Conditions of families, each a sequence of branches whose union it is.

        Parameters
        ----------
        families : sequence of sequences of Branch
            The families.
        prismatic : (n,) array of bool
            Which joints slide.
        weight : (n,) array
            Positive; what joint differences are multiplied by.
        norm : str
            "euclidean", or "max": the largest weighted difference.

        Raises
        ------
        OptionError
            If a weight is not positive, or the norm unknown.
        """
        weight = np.array(weight, dtype=float)
        if not (np.isfinite(weight) & (weight > 0)).all():
            raise OptionError(f"weights must be positive numbers, got {weight.tolist()}")
        heaviest = 1e30  # squares and powers of weights have to be floats
        if not ((weight >= 1 / heaviest) & (weight <= heaviest)).all():
            raise OptionError(
                f"weights must lie between {1 / heaviest:g} and {heaviest:g}, got {weight.tolist()}"
            )
        if norm not in NORMS:
            raise OptionError(f"norm must be one of {', '.join(NORMS)}, got {norm!r}")
        turn = np.where(prismatic, 0.0, 2 * np.pi * weight)
        return cls(len(families), weight, turn, tuple(_weighted(families, weight, norm)), norm)


def _weighted(
    families: Sequence[Sequence[Branch]], weight: Array, norm: str
) -> Iterator[WeightedBranch]:
    for f, branches in enumerate(families):
        for branch in branches:
            joints = np.array([v.joint for v in branch.values], dtype=np.int64)
            values = np.array([v.value for v in branch.values], dtype=float) * weight[joints]
            sums = tuple(weighted_sum(e, weight, norm == "max") for e in branch.equations)
            yield WeightedBranch(f, joints, values, sums)


def weighted_sum(e: Equation, weight: Array, largest: bool = False) -> TrigSum:
    """An equation as a sum in weighted coordinates."""
    rate = e.frequencies / 2
    return TrigSum(
        amplitude=np.hypot(e.cos, e.sin) / np.prod(weight**e.powers, axis=-1),
        phase=np.arctan2(-e.sin, e.cos) + rate @ e.shift,
        rate=rate / weight,
        power=e.powers,
        noise=max(e.accuracy, 1e-15) + 2.3e-16 * (2 * len(e.cos) + 16),
        largest=largest,
    )


def _starts(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
