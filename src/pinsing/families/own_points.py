"""Which points of a family's equations are singular, and these to all digits.

Where equations touch, as at a double root, a point may be off the set by the square root of
rounding though its residuals are rounding. Then Newton's method goes on with what singular means.
"""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.verdict import ratios
from pinsing.robot.arm import Arm

_CONFIRMED = 1e-6
"""sigma_r / sigma_1 of what is singular among the points of equations."""
_SHARP = 1e-12
"""sigma_r / sigma_1 of a point that has all its digits."""
_FAR = 1e-3
"""Radians or metres: what is this far away is another point."""
_STEPS = 8
_FLAT = 1e-10
"""Singular values of Newton's matrix that count, relative to the largest."""


@dataclass(frozen=True, eq=False)
class OwnPoints:
    """The singular ones among the points of equations.

    Attributes
    ----------
    arm : Arm
        The exact one, without mimic joints.
    """

    arm: Arm

    def __call__(self, points: Array) -> Bool:
        """Which of some points (N, n) are singular."""
        return ratios(self.arm, points) <= _CONFIRMED

    def sharpened(self, points: Array, free: Bool) -> Array:
        """Singular points (N, n) to all digits, moved along ``free`` joints (n,); see `_newton`.

        One that does not become more singular nearby stays as it is.
        """
        before = ratios(self.arm, points)
        blunt = np.flatnonzero(before > _SHARP)
        if not len(blunt):
            return points
        moved = _newton(self.arm, points[blunt], free)
        near = np.isfinite(moved).all(axis=-1)
        near &= np.abs(np.where(np.isfinite(moved), moved, 0.0) - points[blunt]).max(axis=-1) < _FAR
        moved = np.where(near[:, None], moved, points[blunt])
        better = ratios(self.arm, moved) < before[blunt]
        sharp = points.copy()
        sharp[blunt[better]] = moved[better]
        return sharp


def _newton(arm: Arm, q: Array, free: Bool) -> Array:
    """Solve J(q)^T u = 0 and u.u = 1 for q (N, n) and the lost direction u, from near a solution.

    Minimum-norm steps: the solutions are a set of some dimension.
    """
    J, H = own_jacobians_and_derivatives(arm, q)
    u = np.linalg.svd(J)[0][..., -1]
    n = q.shape[-1]
    for _ in range(_STEPS):
        residual = np.concatenate(
            [np.einsum("kr,krj->kj", u, J), (u * u).sum(axis=-1, keepdims=True) - 1], axis=-1
        )
        A = np.zeros((len(q), n + 1, n + u.shape[-1]))
        A[:, :n, :n] = np.einsum("kr,krij->kij", u, H) * free
        A[:, :n, n:] = np.swapaxes(J, -1, -2)
        A[:, n, n:] = 2 * u
        step = -np.einsum("kij,kj->ki", np.linalg.pinv(A, rcond=_FLAT), residual)
        q = q + np.where(free, step[:, :n], 0.0)
        u = u + step[:, n:]
        J, H = own_jacobians_and_derivatives(arm, q)
    return q
