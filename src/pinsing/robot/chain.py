"""The chain of an arm as plain numbers: constant placements between z axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.robot.joint_axis import axis_rotation, joint_axis


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


def flatten(arm: Arm) -> Chain:
    """Write the chain of the arm's model with every joint axis turned to z; found once an arm.

    Mimic couplings are left out: the chain has one joint for each velocity of the model. Its
    arrays are not to be written to.
    """
    return arm.once("chain", lambda: _flatten(arm))


def _flatten(arm: Arm) -> Chain:
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
    return _frozen(
        Chain(np.array(rotations), np.array(translations), np.array(sliding, dtype=bool))
    )


def with_fixed_joints_put(
    arm: Arm, put: Callable[[int, Array], Array | None]
) -> tuple[Array, Array]:
    """The placements (R, t) of an arm with the fixed joints on the way put elsewhere.

    A fixed joint turned by 1.5708 tilts every length that is written behind it. Put at a right
    angle before placements are multiplied, it leaves these lengths as they are written.

    Parameters
    ----------
    arm : Arm
        Any arm.
    put : callable
        Gives the rotation (3, 3) to take for one of placement i, or None to leave it.
    """
    raw, model = flatten(arm), arm.model
    R, t = raw.R.copy(), raw.t.copy()
    own = {f.parentJoint: f.parentFrame for f in model.frames if f.type == pin.FrameType.JOINT}
    before = np.eye(3)
    for i in range(raw.n + 1):
        tip = model.frames[arm.tip_id]
        at = own.get(i + 1, 0) if i < raw.n else tip.parentFrame
        place = model.jointPlacements[i + 1] if i < raw.n else tip.placement
        composed = [place]
        while (here := model.frames[at]).parentJoint == i and here.type != pin.FrameType.JOINT:
            composed.append(here.placement)
            if here.parentFrame >= at:  # the universe, or a locked joint: Pinocchio's own parent
                break
            at = here.parentFrame
        made, last, moved = pin.SE3.Identity(), pin.SE3.Identity(), False
        for here in reversed(composed):
            step = last.actInv(here)
            found = None if here is place else put(i, step.rotation)
            made = made * (step if found is None else pin.SE3(found, step.translation))
            last, moved = here, moved or found is not None
        if moved:
            R[i] = before.T @ made.rotation @ place.rotation.T @ before @ R[i]
            t[i] = before.T @ made.translation
        if i < raw.n:
            before = axis_rotation(joint_axis(model.joints[i + 1])[0])
    return R, t


def keep_chain(arm: Arm, chain: Chain) -> None:
    """Tell an arm the chain that its model was made of by ``chain_model``."""
    plain = Chain(chain.R + 0.0, chain.t + 0.0, chain.prismatic)  # no zero has a sign
    arm.once("chain", lambda: _frozen(plain))


def _frozen(chain: Chain) -> Chain:
    for array in (chain.R, chain.t, chain.prismatic):
        array.flags.writeable = False
    return chain


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
