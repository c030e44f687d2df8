"""The axis of one joint of a model, in the joint's own frame."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import JointError


def joint_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """Unit axis (3,) of a model's joint in its own frame, and whether it slides along it.

    Raises
    ------
    JointError
        If the joint neither turns nor slides: a screw, or several joints in one.
    """
    if "Composite" in joint.shortname():
        raise JointError(name, "is several joints in one; give each a joint of its own")
    data = joint.createData()
    q = np.zeros(joint.idx_q + joint.nq)  # of the whole model up to it: calc reads from idx_q on
    q[joint.idx_q] = 1.0 if joint.nq == 2 else 0.0
    joint.calc(data, q)
    motion = np.array(data.S).ravel()
    slide, turn = np.abs(motion[:3]).max(), np.abs(motion[3:]).max()
    if min(slide, turn) > 0:
        raise JointError(name, "is a screw; only joints that turn or slide can be analysed")
    prismatic = bool(slide > turn)
    return (motion[:3] if prismatic else motion[3:]), prismatic


def axis_rotation(axis: Array) -> Array:
    """Rotation (3, 3) that takes z to the unit ``axis``; a signed permutation where it is one."""
    k = int(np.argmax(np.abs(axis)))
    if np.abs(np.delete(axis, k)).max() < 1e-12:
        cyclic = np.roll(np.eye(3), k + 1, axis=0)  # columns: axes k+1, k+2, k
        return cyclic if axis[k] > 0 else cyclic @ np.diag([1.0, -1.0, -1.0])
    z = np.array([0.0, 0.0, 1.0])
    return np.array(pin.Quaternion.FromTwoVectors(z, axis).matrix())
