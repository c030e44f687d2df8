"""The chain of an arm as plain numbers: constant placements between z axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing.errors import JointError
from pinsing.robot.arm import Arm, Array


@dataclass(frozen=True, eq=False)
class Chain:
    """Tip placement = C_0 M_0(q_0) C_1 M_1(q_1) ... M_{k-1}(q_{k-1}) C_k.

    C_i is the rigid motion (R[i], t[i]); M_i turns about z, or slides along z.

    Attributes
    ----------
    R : (k + 1, 3, 3) array
        Constant rotations.
    t : (k + 1, 3) array
        Constant translations, metres.
    prismatic : (k,) array of bool
        Which joints slide.
    """

    R: Array
    t: Array
    prismatic: npt.NDArray[np.bool_]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)


def joint_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """Unit axis (3,) in the joint's own frame, and whether the joint slides along it.

    Raises
    ------
    JointError
        If the joint neither turns nor slides: a screw, or several joints in one.
    """
    if "Composite" in joint.shortname():
        raise JointError(name, "is several joints in one; give each a joint of its own")
    data = joint.createData()
    q = np.array([1.0, 0.0]) if joint.nq == 2 else np.zeros(1)
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


def flatten(arm: Arm) -> Chain:
    """Write the chain of the arm's model with every joint axis turned to z.

    Mimic couplings are left out: the chain has one joint for each velocity of the model.
    """
    model = arm.model
    rotations, translations, sliding = [], [], []
    before = np.eye(3)
    for index in range(1, model.njoints):
        axis, prismatic = joint_axis(model.joints[index])
        turned = axis_rotation(axis)
        placement = model.jointPlacements[index]
        rotations.append(before.T @ placement.rotation @ turned)
        translations.append(before.T @ placement.translation)
        sliding.append(prismatic)
        before = turned
    tip = model.frames[arm.tip_id].placement
    rotations.append(before.T @ tip.rotation)
    translations.append(before.T @ tip.translation)
    return Chain(np.array(rotations), np.array(translations), np.array(sliding, dtype=bool))


def chain_model(chain: Chain, arm: Arm) -> pin.Model:
    """Build a Pinocchio model of ``chain`` with the joint names, limits and tip of ``arm``."""
    model = pin.Model()
    model.name = arm.name
    parent = 0
    names = list(arm.model.names)[1:]
    source = arm.model
    for i, name in enumerate(names):
        kind = pin.JointModelPZ() if chain.prismatic[i] else pin.JointModelRZ()
        placement = pin.SE3(chain.R[i], chain.t[i])
        joint = source.joints[i + 1]
        if joint.nq == 1:
            low = source.lowerPositionLimit[joint.idx_q : joint.idx_q + 1]
            high = source.upperPositionLimit[joint.idx_q : joint.idx_q + 1]
        else:
            low, high = np.array([-np.inf]), np.array([np.inf])
        big = np.array([np.finfo(float).max])
        parent = model.addJoint(parent, kind, placement, name, big, big, low, high)
        model.addJointFrame(parent)
    tip = pin.SE3(chain.R[-1], chain.t[-1])
    model.addFrame(pin.Frame(arm.tip, parent, 0, tip, pin.FrameType.OP_FRAME))
    return model
