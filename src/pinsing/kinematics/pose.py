"""Poses as people give them: a position, with roll, pitch and yaw, or a matrix."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import ConfigurationError

_FARTHEST = 1e9  # squares of positions have to be floats


def read_pose(pose: npt.ArrayLike) -> tuple[Array, Array | None]:
    """Position (3,), and rotation (3, 3) if one is given.

    Raises
    ------
    ConfigurationError
        If the numbers are no pose, not finite, or beyond all arms.
    """
    given = np.array(pose, dtype=float)
    if not np.isfinite(given).all():
        raise ConfigurationError("the pose has a value that is not finite")
    if (np.abs(given) > _FARTHEST).any():
        raise ConfigurationError(
            f"the pose has a value beyond {_FARTHEST:g} (metres, radians), which no arm reaches"
        )
    if given.shape == (3,):
        return given, None
    if given.shape == (6,):
        return given[:3], np.array(pin.rpy.rpyToMatrix(*given[3:]))
    if given.shape == (4, 4):
        R = given[:3, :3]
        proper = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
        if proper and np.allclose(given[3], [0, 0, 0, 1]):
            u, _, v = np.linalg.svd(R)
            return given[:3, 3], u @ v
        raise ConfigurationError("the 4 x 4 matrix is not a rotation and a translation")
    raise ConfigurationError(
        "one pose is 3 numbers (x, y, z), 6 (and roll, pitch, yaw) or a 4 x 4 matrix; "
        f"got shape {given.shape}"
    )
