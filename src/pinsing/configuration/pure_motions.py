"""Velocity ellipsoids of pure motions: translations with the tool held, rotations about the tip."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.measures import SINGULAR_RTOL, Ellipsoid, velocity_ellipsoid

POSE_ROWS = 6


def pure_ellipsoids(J: Array) -> tuple[Ellipsoid, Ellipsoid]:
    """Ellipsoids of the tip velocities without rotation, and of the rotations of a resting tip.

    Those of all motions, paper Eqs. (15), (16), stay round at most singularities of a pose
    task: a wrist with two axes in line still turns every way, only not without moving the
    tip. The motions that leave the other part at rest do collapse there: if the wrench
    (f, m) needs no joint torque, J^T (f, m) = 0, then every qdot with w(qdot) = 0 has
    f . v(qdot) = 0, and every one with v(qdot) = 0 has m . w(qdot) = 0. So the first
    ellipsoid is flat along f, the second one along m.

    Parameters
    ----------
    J : (6, n) array
        Frame Jacobian, translation rows first.

    Returns
    -------
    (translations, rotations)
        In m/s and rad/s at unit joint speed.
    """
    v, w = J[:3], J[3:]
    return velocity_ellipsoid(v @ _at_rest(w)), velocity_ellipsoid(w @ _at_rest(v))


def pure_by_default(task: str, generic_rank: int) -> bool:
    """Whether pure motions are what to draw: of a pose, by arms that can move every way.

    Both ellipsoids have volume in general exactly where all six rows are independent.
    """
    return task == "pose" and generic_rank == POSE_ROWS


def _at_rest(rows: Array) -> Array:
    """Projector (n, n) onto the joint velocities that leave ``rows`` (3, n) at rest."""
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=False)
    V = Vt[sigma > SINGULAR_RTOL * max(float(sigma[0]), 1e-300)]
    return np.asarray(np.eye(rows.shape[1]) - V.T @ V)
