"""The pose of the output as numbers: position and unit quaternion, and what people type."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.arguments import real_numbers
from pinsing.errors import ConfigurationError
from pinsing.loops.likeness import output_pose
from pinsing.loops.modes import home
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.task import ROW_NAMES

_UNIT = 1e-6


@dataclass(frozen=True)
class Pose:
    """A pose of the output in the axes of the base.

    Attributes
    ----------
    position : tuple of 3 floats
        Metres.
    quaternion : tuple of 4 floats
        Unit quaternion (e0, e1, e2, e3), the scalar e0 first and not negative.
    """

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, radians: the rotation is Rz(yaw) Ry(pitch) Rx(roll)."""
        r, p, y = pin.rpy.matrixToRpy(self.se3.rotation)
        return float(r), float(p), float(y)

    @property
    def se3(self) -> pin.SE3:
        """As Pinocchio's placement."""
        e0, e1, e2, e3 = self.quaternion
        return pin.SE3(pin.Quaternion(e0, e1, e2, e3).matrix(), np.array(self.position))

    def __str__(self) -> str:
        x = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.position, 12))
        r = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.angles, 12))
        return f"({x}) m, roll, pitch, yaw ({r})"


def pose_of(placement: pin.SE3) -> Pose:
    """The pose of a placement."""
    turn = pin.Quaternion(np.array(placement.rotation))
    e = np.array([turn.w, turn.x, turn.y, turn.z])
    e /= np.linalg.norm(e)
    lead = e[int(np.argmax(np.abs(e) > 1e-9))]
    e = e * np.sign(lead) + 0.0
    x, y, z = (float(v) for v in placement.translation)
    return Pose((x, y, z), (float(e[0]), float(e[1]), float(e[2]), float(e[3])))


def read_pose(mechanism: Mechanism, pose: npt.ArrayLike | None) -> pin.SE3:
    """What a user means by a pose (see `working_modes`).

    Raises
    ------
    ConfigurationError
        If it has another shape, or is no pose.
    """
    at_home = output_pose(mechanism, home(mechanism))
    if pose is None:
        return at_home
    if isinstance(pose, pin.SE3):
        return pin.SE3(pose)
    values = real_numbers(pose, "pose")
    rows = mechanism.task.rows
    if not np.isfinite(values).all():
        raise ConfigurationError("pose holds a value that is not finite")
    if values.shape == (4, 4):
        return _matrix(values)
    if values.shape == (7,):
        e = values[3:]
        size = float(np.linalg.norm(e))
        if size <= _UNIT:
            raise ConfigurationError("the quaternion of the pose is zero: give e0, e1, e2, e3")
        return pin.SE3(pin.Quaternion(*(e / size)).matrix(), values[:3])
    if values.shape == (6,):
        return pin.SE3(pin.rpy.rpyToMatrix(*values[3:]), values[:3])
    if values.shape == (len(rows),):
        full = np.concatenate([at_home.translation, pin.rpy.matrixToRpy(at_home.rotation)])
        full[list(rows)] = values
        return pin.SE3(pin.rpy.rpyToMatrix(*full[3:]), full[:3])
    named = {"v": "", "w": "turn about "}
    names = ", ".join(named[ROW_NAMES[r][0]] + ROW_NAMES[r][1] for r in rows)
    raise ConfigurationError(
        f"a pose of {mechanism.output} has {len(rows)} numbers ({names}), 6 (x, y, z, roll, pitch, "
        f"yaw), 7 (x, y, z and a quaternion) or is a matrix (4, 4); got {_shape(values)}"
    )


def _shape(values: Array) -> str:
    if values.ndim == 1:
        return f"{len(values)} numbers"
    return f"an array {values.shape}" if values.ndim else "a single number"


def _matrix(values: Array) -> pin.SE3:
    R = values[:3, :3]
    if (
        np.abs(R @ R.T - np.eye(3)).max() > _UNIT
        or np.linalg.det(R) < 0
        or not np.allclose(values[3], [0, 0, 0, 1], atol=_UNIT)
    ):
        raise ConfigurationError("the matrix (4, 4) is no pose: its rotation is not orthogonal")
    U, _, Vt = np.linalg.svd(R)
    return pin.SE3(U @ Vt, values[:3, 3])
