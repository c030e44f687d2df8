"""The chain of an arm as plain numbers: constant placements between z axes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from pinsing.measures import ROUNDING, Array, Chain
from pinsing.robot.arm import Arm
from pinsing.robot.models import axis_rotation, joint_axis


def flatten(arm: Arm) -> Chain:
    """Return the chain with every axis along z, a joint for each model velocity; read-only."""
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


def chain_differs(arm: Arm, placements: Array) -> bool:
    """Whether joints of an arm are placed otherwise than ``placements`` (k + 1, 3, 4) say."""
    here = placements_of(arm)
    return here.shape != placements.shape or bool(np.abs(here - placements).max() > ROUNDING)


def placements_of(arm: Arm) -> Array:
    """Return where joints and tip are in the joint before (k + 1, 3, 4): rotations, and metres."""
    chain = flatten(arm)
    return np.concatenate([chain.R, chain.t[..., None]], axis=2)


def with_fixed_joints_put(
    arm: Arm, put: Callable[[int, Array], Array | None]
) -> tuple[Array, Array]:
    """Return placements (R, t), rotations of fixed joints by ``put(i, R)`` where it is not None."""
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
    R, t = (np.add(x, 0.0, order="C") for x in (chain.R, chain.t))  # no zero has a sign
    arm.once("chain", lambda: _frozen(Chain(R, t, chain.prismatic)))


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
        effort = source.effortLimit[joint.idx_v : joint.idx_v + 1]
        speed = source.velocityLimit[joint.idx_v : joint.idx_v + 1]
        parent = model.addJoint(parent, kind, placement, name, effort, speed, low, high)
        model.addJointFrame(parent)
    tip = pin.SE3(chain.R[-1], chain.t[-1])
    model.addFrame(pin.Frame(arm.tip, parent, 0, tip, pin.FrameType.OP_FRAME))
    return model


def jacobian_change(one: Chain, other: Chain, arm: Arm, tip_angle: float = 0.0) -> float:
    """Bound the norm by which scaled Jacobian columns differ between two chains, over the limits.

    With e_k the angle and d_k the length by which C_k differs, column i (z x p, z) turns by at most
    E_i, the sum of e_k, k <= i, and p moves by at most D_i, the sum over k > i of d_k plus
    |t_k| (e_{i+1} + ... + e_{k-1}), slides included: so the bounds are D_i + E_i reach (over the
    length scale) and E_i. The tip's own axes turn by all angles and ``tip_angle`` (radians) more.
    """
    n = one.n
    angle = np.array([rotation_angle(a.T @ b) for a, b in zip(one.R, other.R, strict=True)])
    angle[n] = 0.0  # what it turns is the tip frame alone
    with_tip = float(angle.sum()) + tip_angle if arm.task.at_tip else 0.0
    shift = np.linalg.norm(one.t - other.t, axis=1)
    travel = _travel(arm)
    step = np.linalg.norm(one.t, axis=1) + np.linalg.norm(other.t, axis=1)
    step /= 2
    step[1:] += np.where(one.prismatic, travel, 0.0)
    beyond = np.concatenate([np.cumsum(step[::-1])[::-1][1:], [0.0]])  # reach past C_k's origin
    turned = np.cumsum(angle)[:n]
    moved, spun = np.zeros(n), np.zeros(n)
    for i in range(n):
        if one.prismatic[i]:
            moved[i] = turned[i] + with_tip
            continue
        # An unlimited slide has an infinite step: no turn before it, no change.
        on_the_way = _product(np.cumsum(angle[i + 1 :]) - angle[i + 1 :], step[i + 1 :])
        moved[i] = shift[i + 1 :].sum() + on_the_way.sum()
        moved[i] += _product(turned[i] + with_tip, beyond[i])
        spun[i] = turned[i] + with_tip
    if arm.coupling is not None:  # a free joint moves its followers along
        matrix = np.abs(arm.coupling.matrix)
        moved, spun = _product(matrix.T, moved).sum(axis=-1), matrix.T @ spun
    return float(np.hypot(moved / arm.length_scale, spun).max())


def _travel(arm: Arm) -> Array:
    """Largest distance of each joint of the model from its zero, within the limits."""
    travel = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    if arm.coupling is None:
        return travel
    return np.asarray(
        _product(np.abs(arm.coupling.matrix), travel).sum(axis=1) + np.abs(arm.coupling.offset)
    )


def _product(a: Array | float, b: Array | float) -> Array:
    """Product in which zero times infinity is zero."""
    out = np.zeros(np.broadcast_shapes(np.shape(a), np.shape(b)))
    return np.multiply(a, b, out=out, where=(np.asarray(a) != 0) & (np.asarray(b) != 0))


def rotation_angle(R: Array) -> float:
    """Angle (radians) of a rotation matrix, accurate near zero."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    return math.atan2(math.hypot(zy - yz, xz - zx, yx - xy) / 2, (xx + yy + zz - 1) / 2)
