"""Which points of a family's equations are singular, and these to all digits.

Where equations touch, as at a double root, a point may be off the set by the square root of
rounding though its residuals are rounding. Then Newton's method goes on with what singular means.
"""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.kinematics.batch import own_scale
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
_FROM_AFAR = 30
"""Steps from random starts."""
_LONGEST = 1.0
"""Radians or metres of a step."""
_FLAT = 1e-10
"""Singular values of Newton's matrix that count, relative to the largest."""


@dataclass(frozen=True, eq=False)
class OwnPoints:
    """The singular ones among the points of equations.

    Attributes
    ----------
    arm : Arm
        The exact one.
    touching : bool
        Whether the equations are known to be zero at singular points only: they touch zero there,
        which leaves their points half of the digits.
    """

    arm: Arm
    touching: bool = False

    def __call__(self, points: Array) -> Bool:
        """Which of some points (N, n) are singular."""
        return ratios(self.arm, points) <= _CONFIRMED

    def drawn(self, starts: Array, free: Bool, box: tuple[Array, Array]) -> Array:
        """Singular points (k, n) of a box that starts (N, n) in it lead to; see ``Confirm``."""
        if not len(starts):
            return starts
        q = _newton(self.arm, starts, free, _FROM_AFAR, box)
        q = q[np.isfinite(q).all(axis=-1)]
        return q[ratios(self.arm, q) <= _SHARP] if len(q) else q

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


def _newton(
    arm: Arm,
    q: Array,
    free: Bool,
    steps: int = _STEPS,
    box: tuple[Array, Array] | None = None,
) -> Array:
    """Solve J(q)^T u = 0 and u.u = 1 for q (N, n) and the lost direction u, from near a solution.

    Or from anywhere: then many of them end nowhere. Minimum-norm steps, those of sliders in the
    arm's own length as H is: the solutions are a set of some dimension.
    """
    J, H = own_jacobians_and_derivatives(arm, q)
    u = np.linalg.svd(J)[0][..., -1]
    n, columns = q.shape[-1], own_scale(arm).columns
    for _ in range(steps):
        residual = np.concatenate(
            [np.einsum("kr,krj->kj", u, J), (u * u).sum(axis=-1, keepdims=True) - 1], axis=-1
        )
        A = np.zeros((len(q), n + 1, n + u.shape[-1]))
        A[:, :n, :n] = np.einsum("kr,krij->kij", u, H) * free
        A[:, :n, n:] = np.swapaxes(J, -1, -2)
        A[:, n, n:] = 2 * u
        step = -np.einsum("kij,kj->ki", np.linalg.pinv(A, rcond=_FLAT), residual)
        long = np.linalg.norm(step[:, :n], axis=-1, keepdims=True)
        step *= np.minimum(1.0, _LONGEST / np.maximum(long, 1e-300))
        q = q + np.where(free, step[:, :n] * columns, 0.0)
        q = q if box is None else np.clip(q, *box)  # sliders would go on without end
        u = u + step[:, n:]
        J, H = own_jacobians_and_derivatives(arm, q)
    return q
