"""What a sweep will do, before it is done: nominal configuration, special values, sets, cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.robot.arm import ArmSummary
from pinsing.serialization import JsonResult

SPECIAL_ANGLES = (0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi)
"""Special values of revolute joints, radians (paper, Section 3.2)."""

Special = Sequence[float] | Mapping[str, Sequence[float]]
"""Special angles of all revolute joints, or the special values of single joints by name."""

SAMPLES = 181
"""Points of a curve: every two degrees of a whole turn."""

NO_EFFECT = 1e-9
"""Relative change of sigma_r along the whole range of a joint that counts as none."""

MOVES_TIP = "only moves the tip point, which never changes the rank for the pose"
NOT_ASKED = "not asked for"
NOT_CHANGING = "does not change sigma_min"
NOT_CHANGING_BOTH = "do not change sigma_min"


@dataclass(frozen=True, eq=False)
class JointEffect:
    """What one joint does to sigma_r, and the values it is set to.

    Attributes
    ----------
    joint : str
        Its name.
    change : float
        Greatest relative change (max - min) / max of sigma_r along its whole range, from the
        nominal and several random configurations, on the nominal geometry.
    swept : bool
        False if it is left out of the combinations.
    reason : str
        Why it is left out; empty otherwise.
    special : (k,) array
        Special values that it is set to, radians or metres.
    range : (2,) array
        Ends of the range that it moves over, radians or metres.
    """

    joint: str
    change: float
    swept: bool
    reason: str
    special: Array
    range: Array


@dataclass(frozen=True, eq=False)
class PlannedLevel:
    """All sets of special values of one size.

    Attributes
    ----------
    level : int
        Number of joints at special values.
    joints : (S, level) array of int
        Which joints, ascending.
    values : (S, level) array
        At which values, radians or metres.
    forced : (S,) array of bool
        Singular whatever the others, while none of its subsets among the special values is.
    swept : bool
        False if only the test for ``forced`` is asked of this level, and no curves.
    """

    level: int
    joints: npt.NDArray[np.intp]
    values: Array
    forced: npt.NDArray[np.bool_]
    swept: bool


@dataclass(frozen=True, eq=False)
class SweepPlan(JsonResult):
    """Everything that decides what a sweep computes, and how much that is.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    nominal : (n,) array
        Configuration that the joints rest at, radians or metres: step (1).
    nominal_sigma : (r,) array
        Singular values there.
    nominal_origin : str
        ``given``, ``pi/3`` (the paper's choice) or ``random`` (best conditioned of some).
    effects : tuple of JointEffect
        One a joint.
    uniform_values : (U,) array
        Special angles, radians, that all revolute joints are set to at once: step (2).
    uniform : (U, n) array
        Those configurations, prismatic joints at ``nominal``.
    levels : tuple of PlannedLevel
        The combinations: steps (2) to (4).
    samples : int
        Points of a curve.
    ignore_limits, prune : bool
        Whole circles instead of the limits; leave out sets that contain a forced one.
    seed : int
        Of all random values.
    n_curves, n_jacobians : int
        Curves, and Jacobians to be computed.
    notes : tuple of str
        What was left out, and why.
    """

    schema: ClassVar[str] = "pinsing/sweep-plan/1"
    made_by: ClassVar[str] = "pinsing.plan_sweep(arm)"

    arm: ArmSummary
    nominal: Array
    nominal_sigma: Array
    nominal_origin: str
    effects: tuple[JointEffect, ...]
    uniform_values: Array
    uniform: Array
    levels: tuple[PlannedLevel, ...]
    samples: int
    ignore_limits: bool
    prune: bool
    seed: int
    n_curves: int
    n_jacobians: int
    notes: tuple[str, ...]

    @property
    def relevant(self) -> tuple[int, ...]:
        """Indices of the joints that a singularity can depend on, asked for or not."""
        return tuple(
            i
            for i, effect in enumerate(self.effects)
            if effect.change > NO_EFFECT and effect.reason != MOVES_TIP
        )

    @property
    def swept(self) -> tuple[int, ...]:
        """Indices of the joints that are combined."""
        return tuple(i for i, effect in enumerate(self.effects) if effect.swept)

    @property
    def forced(self) -> tuple[Mapping[str, float], ...]:
        """Minimal sets of special values that are singular whatever the others."""
        names = self.arm.joints
        return tuple(
            {names[j]: float(v) for j, v in zip(joints, values, strict=True)}
            for level in self.levels
            for joints, values in zip(
                level.joints[level.forced], level.values[level.forced], strict=True
            )
        )

    @checked
    def moving(self, fixed: Iterable[int]) -> tuple[int, ...]:
        """Joints that move in turn while ``fixed`` are at special values.

        Parameters
        ----------
        fixed : iterable of int
            Indices of joints.

        Returns
        -------
        tuple of int
            Indices of the others that are swept.

        Examples
        --------
        >>> import pinsing
        >>> plan = pinsing.plan_sweep(pinsing.load("ur5"))
        >>> plan.swept, plan.moving([1])
        ((1, 2, 3, 4), (2, 3, 4))
        """
        held = set(fixed)
        return tuple(i for i in self.swept if i not in held)

    def __str__(self) -> str:
        sets = ", ".join(
            f"{len(p.values):,} of {p.level} joint{'s' * (p.level > 1)}"
            for p in self.levels
            if p.swept
        )
        held = f"; special values: {sets}" if sets else ", with no joint at a special value"
        return f"{self.n_curves:,} curves, {self.n_jacobians:,} Jacobians{held}"
