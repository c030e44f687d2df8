"""The axis of one joint of a model, in the joint's own frame."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import JointError

_ALONG = {
    f"JointModel{kind}{axis}": (k, kind == "P")
    for kind in ("R", "RUB", "P")
    for k, axis in enumerate("XYZ")
}
"""Pinocchio's joints about and along coordinate axes: which axis, and whether they slide."""

_Z = np.array([0.0, 0.0, 1.0])
_DOWN = -0.9


def joint_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """Unit axis (3,) of a model's joint in its own frame, and whether it slides along it.

    Raises
    ------
    JointError
        If the joint neither turns nor slides: a screw, or several joints in one.
    """
    kind = joint.shortname()
    if kind in _ALONG:
        k, slides = _ALONG[kind]
        return np.eye(3)[k], slides
    if "Composite" in kind:
        raise JointError(name, "is several joints in one; give each a joint of its own")
    return computed_axis(joint, name)


def computed_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """The same from the joint's own motion subspace, of joints of any kind; raises likewise."""
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
    sizes = [abs(x) for x in axis.tolist()]
    k = sizes.index(max(sizes))
    if max(sizes[k - 1], sizes[k - 2]) < 1e-12:
        out = np.zeros((3, 3))  # columns: axes k+1, k+2, k; the last two turned over
        sign = 1.0 if axis[k] > 0 else -1.0
        out[(k + 1) % 3, 0], out[(k + 2) % 3, 1], out[k, 2] = 1.0, sign, sign
        return out
    if axis[2] > _DOWN:
        return np.array(pin.Quaternion.FromTwoVectors(_Z, axis).matrix())
    # Near -z that loses half of the digits: half a turn about x first.
    over = np.array([1.0, -1.0, -1.0])
    turned = np.array(pin.Quaternion.FromTwoVectors(_Z, over * axis).matrix())
    return np.asarray(over[:, None] * turned)
