"""Conditions as flat arrays: joints at values, and equations that are zero.

All of it in weighted coordinates ``x = w q``, in which distances are plain norms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from pinsing._batch import engine
from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.algebra.equation import Equation
from pinsing.errors import OptionError

NORMS = ("euclidean", "max")

_EPS = 2.3e-16
_HEAVIEST = 1e30  # squares and powers of weights have to be floats


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
class Conditions:
    """The branches of some families, ready to be asked at many configurations.

    A point lies on a branch where all its values and equations hold, on a family where it lies
    on one of its branches.

    Attributes
    ----------
    families : int
        How many; branches refer to them by index.
    family : (B,) array of int
        Family of each branch.
    weight : (n,) array
        Weighted coordinate over joint value: 1 for revolute joints, 1 / length scale for
        prismatic ones unless weights were given.
    turn : (n,) array
        A whole turn in weighted coordinates; 0 for prismatic joints.
    value_start : (B + 1,) array of int
        Where the values of each branch start in ``value_joint`` and ``value``.
    equation_start : (B + 1,) array of int
        Where its equations start.
    term_start : (E + 1,) array of int
        Where the terms of each equation start in ``amplitude`` and ``phase``:
        ``f(x) = sum amplitude prod x_j^power cos(phase + sum rate_j x_j)``.
    noise, reach : (E,) arrays
        Error of a computed value, relative to the sum of amplitudes:
        ``noise + 4.5e-16 reach max(4, |x|)``.
    curvature, steepness : (E,) arrays
        Bounds of second and first derivatives where no powers occur, else 0.
    sliding : (E,) array of bool
        Whether powers occur.
    rate_start, power_start : (T + 1,) arrays of int
        Where the rates and powers of each term start.
    norm : str
        "euclidean" or "max".
    """

    families: int
    family: Ints
    weight: Array
    turn: Array
    value_start: Ints
    value_joint: Ints
    value: Array
    equation_start: Ints
    term_start: Ints
    noise: Array
    reach: Array
    curvature: Array
    steepness: Array
    sliding: Bool
    amplitude: Array
    phase: Array
    rate_norm: Array
    rate_start: Ints
    rate_joint: Ints
    rate: Array
    power_start: Ints
    power_joint: Ints
    power: Ints
    norm: str = field(default="euclidean")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.weight)

    @property
    def branches(self) -> int:
        """Number of branches."""
        return len(self.family)

    def scaled(self, Q: Array) -> Array:
        """Weighted coordinates of joint values Q (..., n), C-contiguous."""
        if bool((self.weight == 1.0).all()):
            return np.ascontiguousarray(Q)
        return np.ascontiguousarray(Q * self.weight)

    def compiled(self) -> Any | None:
        """The same in the compiled engine; None where that is not installed, or too small."""
        return self._compiled

    @cached_property
    def _compiled(self) -> Any | None:
        return engine.condition_set(self)

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "_compiled"}

    @classmethod
    def of(
        cls,
        families: Sequence[Sequence[Branch]],
        prismatic: Bool,
        weight: Array,
        norm: str = "euclidean",
    ) -> Conditions:
        """Conditions of families, each a sequence of branches.

        Parameters
        ----------
        families : sequence of sequences of Branch
            The union of its branches is a family.
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
        if not ((weight >= 1 / _HEAVIEST) & (weight <= _HEAVIEST)).all():
            raise OptionError(
                f"weights must lie between {1 / _HEAVIEST:g} and {_HEAVIEST:g}, "
                f"got {weight.tolist()}"
            )
        if norm not in NORMS:
            raise OptionError(f"norm must be one of {', '.join(NORMS)}, got {norm!r}")
        rows = _Rows(weight, norm == "max")
        for f, branches in enumerate(families):
            for branch in branches:
                rows.add(f, branch)
        return cls(
            families=len(families),
            weight=weight,
            turn=np.where(prismatic, 0.0, 2 * np.pi * weight),
            norm=norm,
            **rows.arrays(),
        )


class _Rows:
    """Collects the arrays of Conditions."""

    def __init__(self, weight: Array, largest: bool) -> None:
        self.weight, self.largest = weight, largest
        self.whole: dict[str, list[int]] = {
            k: []
            for k in ("family", "value_joint", "rate_joint", "power_joint", "power", "sliding")
        }
        starts = ("value_start", "equation_start", "term_start", "rate_start", "power_start")
        self.starts: dict[str, list[int]] = {k: [0] for k in starts}
        reals = ("value", "noise", "reach", "curvature", "steepness", "amplitude", "phase")
        self.real: dict[str, list[float]] = {k: [] for k in (*reals, "rate_norm", "rate")}

    def add(self, family: int, branch: Branch) -> None:
        self.whole["family"].append(family)
        for v in branch.values:
            self.whole["value_joint"].append(v.joint)
            self.real["value"].append(v.value * float(self.weight[v.joint]))
        self.starts["value_start"].append(len(self.real["value"]))
        for e in branch.equations:
            self._equation(e)
        self.starts["equation_start"].append(len(self.real["noise"]))

    def _equation(self, e: Equation) -> None:
        amplitude = np.hypot(e.cos, e.sin)
        amplitude = amplitude / self._powers(e.powers)
        rates = e.frequencies / 2
        phase = np.arctan2(-e.sin, e.cos) + rates @ e.shift
        scaled = rates / self.weight
        terms = len(amplitude)
        sliding = bool(e.powers.any())
        norms = np.abs(scaled).sum(1) if self.largest else np.linalg.norm(scaled, axis=1)
        for t in range(terms):
            self.real["amplitude"].append(float(amplitude[t]))
            self.real["phase"].append(float(phase[t]))
            self.real["rate_norm"].append(float(norms[t]) * (1 + 1e-14))
            for j in np.flatnonzero(scaled[t]):
                self.whole["rate_joint"].append(int(j))
                self.real["rate"].append(float(scaled[t, j]))
            for j in np.flatnonzero(e.powers[t]):
                self.whole["power_joint"].append(int(j))
                self.whole["power"].append(int(e.powers[t, j]))
            self.starts["rate_start"].append(len(self.real["rate"]))
            self.starts["power_start"].append(len(self.whole["power"]))
        self.starts["term_start"].append(len(self.real["amplitude"]))
        self.real["noise"].append(max(e.accuracy, 1e-15) + _EPS * (2 * terms + 16))
        self.real["reach"].append(float(np.abs(scaled).sum(1).max(initial=0.0)) + 1.0)
        if self.largest:
            curvature = float(amplitude @ norms**2)
        else:
            curvature = float(np.linalg.eigvalsh((scaled.T * amplitude) @ scaled)[-1])
        self.real["curvature"].append(0.0 if sliding else curvature * (1 + 1e-12))
        self.real["steepness"].append(0.0 if sliding else float(amplitude @ norms) * (1 + 1e-12))
        self.whole["sliding"].append(int(sliding))

    def _powers(self, powers: Ints) -> Array:
        """What a coefficient is divided by where lengths are weighted."""
        return np.asarray(np.prod(self.weight**powers, axis=-1), dtype=float)

    def arrays(self) -> dict[str, Any]:
        whole: dict[str, Any] = {
            k: np.array(v, dtype=np.int64) for k, v in {**self.whole, **self.starts}.items()
        }
        whole["sliding"] = whole["sliding"].astype(bool)
        return {**whole, **{k: np.array(v, dtype=float) for k, v in self.real.items()}}
