"""The scale that numerical verdicts are taken at: the arm's own length, not the user's unit.

Translation rows over a length, and columns of prismatic joints times it, make a Jacobian without
units. With the arm's own length in that place neither the length scale, which is a choice of
how metres and radians are weighed in sigma, nor the unit that a file is written in decides what
is called singular.
"""

from __future__ import annotations

import math

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.kinematics.engine import pinocchio_jacobians
from pinsing.kinematics.task_rows import task_rows
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten

_SEED = 20231
_SAMPLES = 16
_ROUNDING = 1e-9  # distances of axes relative to the largest placement that are no distance


@dataclass(frozen=True, eq=False)
class OwnScale:
    """How a frame Jacobian of one arm is made free of units.

    Attributes
    ----------
    length : float
        The arm's own length: the greatest distance of the tip from an axis that it turns about,
        rounded to a power of ten, metres. Units of length differ by powers of ten, and most
        arms have 1 m.
    rows : (m,) array
        Factors of the task rows: 1 / length for translations, else 1.
    columns : (n,) array
        Factors of the columns: length for prismatic joints, else 1.
    of_sigma : float or None
        Singular values at the arm's length scale times this are those at its own scale; None
        where these do not follow from those.
    """

    length: float
    rows: Array
    columns: Array
    of_sigma: float | None

    def apply(self, arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
        """Task rows (..., m, n) of frame Jacobians J (..., 6, n) at Q (..., n), without units.

        ``R`` is the tip's rotation there, where it is known.
        """
        return np.asarray(task_rows(arm, J, Q, R) * self.rows[:, None] * self.columns)


def own_scale(arm: Arm) -> OwnScale:
    """The own scale of ``arm``, which its task rows and length scale leave as it is."""
    return arm.once("own_scale", lambda: _own_scale(arm))


def random_turns(arm: Arm, count: int, seed: int = _SEED) -> Array:
    """Random configurations (count, n): whole circles, and as far as the arm is long."""
    reach = np.where(arm.prismatic, own_scale(arm).length, np.pi)
    return np.random.default_rng(seed).uniform(-1, 1, (count, arm.n)) * reach


def _own_scale(arm: Arm) -> OwnScale:
    length = _length(arm)
    translation = np.array(arm.task.rows) < 3
    rows = np.where(translation, 1.0 / length, 1.0)
    columns = np.where(arm.prismatic, length, 1.0)
    factors = rows / np.where(translation, 1.0 / arm.length_scale, 1.0)
    alike = (factors == factors[0]).all() and (columns == 1.0).all()
    return OwnScale(length, rows, columns, float(factors[0]) if alike else None)


def _length(arm: Arm) -> float:
    rng = np.random.default_rng(_SEED)
    bounded = arm.prismatic & np.isfinite(arm.lower) & np.isfinite(arm.upper)
    half = np.where(arm.prismatic, 0.0, np.pi)
    low, high = np.where(bounded, arm.lower, -half), np.where(bounded, arm.upper, half)
    J = pinocchio_jacobians(arm, rng.uniform(low, high, (_SAMPLES, arm.n)))
    chain = flatten(arm)
    reach = float(np.linalg.norm(J[:, :3, ~chain.prismatic], axis=1).max(initial=0.0))
    if reach <= _ROUNDING * float(np.abs(chain.t).max()):
        return 1.0  # it turns about the tip alone: any length will do
    return 10.0 ** round(math.log10(reach))
