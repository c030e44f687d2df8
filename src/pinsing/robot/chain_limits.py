"""What a model says of the joints of a chain: limits, which slide, and where others are locked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import JointError
from pinsing.robot.joint_axis import joint_axis
from pinsing.robot.mimic import Follow, leader_of


def locked_at(model: pin.Model, mimics: Mapping[str, Follow]) -> Array:
    """Where joints are locked: neutral, moved inside the limits; followers where they belong."""
    q = pin.neutral(model)
    for joint in model.joints[1:]:
        if joint.nq == 1:
            i = joint.idx_q
            low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
            if low <= high:
                q[i] = float(np.clip(q[i], low, high))
    for name in mimics:
        leader, multiplier, shift = leader_of(name, mimics)
        here = model.joints[model.getJointId(name)]
        there = model.joints[model.getJointId(leader)]
        angle = q[there.idx_q]
        if there.nq == 2:
            angle = np.arctan2(q[there.idx_q + 1], q[there.idx_q])
        value = multiplier * angle + shift
        q[here.idx_q : here.idx_q + here.nq] = (
            value if here.nq == 1 else (np.cos(value), np.sin(value))
        )
    return np.array(q)


def chain_limits(model: pin.Model) -> tuple[Array, Array, np.ndarray, list[str]]:
    """Limits of each joint of a chain, which ones slide, and notes."""
    lower, upper, prismatic, notes = [], [], [], []
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        axis, slides = joint_axis(joint, name)
        if not np.isfinite(axis).all() or abs(np.linalg.norm(axis) - 1) > 1e-6:
            raise JointError(name, f"its axis {axis.tolist()} is not a direction")
        if not np.isfinite(model.jointPlacements[index].homogeneous).all():
            raise JointError(name, "its placement is not finite")
        low, high = -np.inf, np.inf
        if joint.nq == 1:
            low = float(model.lowerPositionLimit[joint.idx_q])
            high = float(model.upperPositionLimit[joint.idx_q])
            if np.isnan(low) or np.isnan(high):
                raise JointError(name, "its limits are not numbers; set lower and upper")
            if low > high:
                raise JointError(
                    name,
                    f"lower limit {low:g} is above upper limit {high:g}",
                    limits=(low, high),
                )
            if abs(low) > 1e300 or abs(high) > 1e300:  # Pinocchio's way of saying "no limit"
                low = -np.inf if abs(low) > 1e300 else low
                high = np.inf if abs(high) > 1e300 else high
                notes.append(f"joint {name} has no limits")
            if low == high:
                notes.append(f"WARNING: joint {name} cannot move: both its limits are {low:g}")
        lower.append(low)
        upper.append(high)
        prismatic.append(slides)
    return np.array(lower), np.array(upper), np.array(prismatic, dtype=bool), notes
