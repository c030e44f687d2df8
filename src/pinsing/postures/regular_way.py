"""That no configuration on a way is singular: proven from the Jacobian of the arm itself.

The singular values of a matrix change by no more than its norm does (Weyl, 1912). With K a bound
of the second derivatives (`pinsing.postures.kantorovich`), the Jacobian has rank r within h of a
configuration where ``sigma_r > K h``. Straight pieces are halved until that holds for each from
its middle. No closed form is needed, and families of every codimension count.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pinsing._types import Array
from pinsing.kinematics.verdict import generic_rank
from pinsing.postures.kantorovich import bend
from pinsing.postures.newton import Solver
from pinsing.robot.arm import Arm

_ROUNDING = 1e-12
_MOST = 200_000
_SHORT = 1e-8
"""Half a piece, radians: where that is not short enough a configuration is as good as singular."""
_ALIKE = 1e-6


def regular_way(arm: Arm, path: Array, most: int = _MOST) -> bool:
    """Whether a polyline is proven to have the generic rank throughout.

    Parameters
    ----------
    arm : Arm
        A serial arm whose joints are independent.
    path : (K, n) array
        Waypoints, joined by straight lines in joint space.
    most : int
        Pieces after which it is given up.
    """
    solver, rank = _solver(arm), generic_rank(arm)
    steep = float(bend(solver, path).max())
    ends = np.array(list(pairwise(path)))
    done = 0
    while len(ends):
        done += len(ends)
        a, b = ends[:, 0], ends[:, 1]
        middle = (a + b) / 2
        half = np.linalg.norm((b - a) * solver.weight, axis=1) / 2
        sizes = np.linalg.svd(solver.linear(middle)[1], compute_uv=False)
        open_ = sizes[:, rank - 1] - _ROUNDING * sizes[:, 0] <= steep * half
        if done > most or (half[open_] < _SHORT).any():
            return False
        a, b, middle = a[open_], b[open_], middle[open_]
        ends = np.concatenate([np.stack([a, middle], 1), np.stack([middle, b], 1)])
    return True


def one_sheet(arm: Arm, a: Array, b: Array) -> bool:
    """Whether the tip can leave a pose in the same directions from two configurations.

    An arm with fewer joints than a pose has conditions reaches a surface of poses. Where two
    sheets of it cross, two configurations have one pose by chance: poses near by have only one.
    """
    J = columns(arm, np.stack([a, b]))
    if J.shape[1] <= generic_rank(arm):
        return True
    u, v = (np.linalg.svd(A)[0][:, : generic_rank(arm)] for A in J)
    return bool(np.abs(v - u @ (u.T @ v)).max() < _ALIKE)


def columns(arm: Arm, Q: Array) -> Array:
    """Task Jacobians (N, m, n) of a serial arm whose joints are independent; joints weighted."""
    return _solver(arm).linear(Q)[1]


def _solver(arm: Arm) -> Solver:
    nothing = np.full(arm.n, np.nan)
    return Solver.of(arm, np.zeros(3), None, nothing, np.arange(arm.n))
