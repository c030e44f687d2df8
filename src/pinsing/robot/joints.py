"""Joints of a model: axes, limits, where they are locked, and which follow others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import JointError
from pinsing.robot.source import Coupling

_Z = np.eye(3)[2]


def joint_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """Return a joint's unit axis (3,) and if it slides; JointError for screws and compounds."""
    JointError.refuse_if(
        "Composite" in joint.shortname(), name, "is several joints in one; write one joint for each"
    )
    data = joint.createData()
    q = np.zeros(joint.idx_q + joint.nq)  # of the whole model up to it: calc reads from idx_q on
    q[joint.idx_q] = 1.0 if joint.nq == 2 else 0.0
    joint.calc(data, q)
    motion = np.array(data.S).ravel()
    slide, turn = np.abs(motion[:3]).max(), np.abs(motion[3:]).max()
    JointError.refuse_if(
        min(slide, turn) > 0, name, "is a screw; only revolute and prismatic joints can be analysed"
    )
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
    if axis[2] > -0.9:
        return np.array(pin.Quaternion.FromTwoVectors(_Z, axis).matrix())
    # Near -z that loses half of the digits: half a turn about x first.
    over = np.array([1.0, -1.0, -1.0])
    turned = np.array(pin.Quaternion.FromTwoVectors(_Z, over * axis).matrix())
    return np.asarray(over[:, None] * turned)


Follow = tuple[str, float, float]
"""Name of the joint that is followed, multiplier, offset (radians or metres)."""


def leader_of(name: str, mimics: Mapping[str, Follow]) -> Follow:
    """Follow mimics of mimics to the joint that moves by itself."""
    leader, multiplier, offset = mimics[name]
    while leader in mimics:
        further, m, o = mimics[leader]
        leader, multiplier, offset = further, multiplier * m, multiplier * o + offset
    return leader, multiplier, offset


def couple(
    names: Sequence[str], independent: Sequence[str], leaders: Mapping[str, Follow]
) -> Coupling:
    """Coupling of the joints ``names`` of a model, of which ``independent`` move by themselves."""
    matrix = np.zeros((len(names), len(independent)))
    offset = np.zeros(len(names))
    for row, name in enumerate(names):
        leader, multiplier, shift = leaders.get(name, (name, 1.0, 0.0))
        matrix[row, independent.index(leader)] = multiplier
        offset[row] = shift
    return Coupling(matrix, offset)


def coupled_limits(
    lower: Array, upper: Array, coupling: Coupling, names: Sequence[str], independent: Sequence[str]
) -> tuple[Array, Array]:
    """Return limits of free joints that keep their followers in theirs; JointError if none do."""
    low = np.full(len(independent), -np.inf)
    high = np.full(len(independent), np.inf)
    for row, name in enumerate(names):
        moved = np.flatnonzero(coupling.matrix[row])
        if len(moved) == 0:  # multiplier zero: it stands still
            continue
        column = int(moved[0])
        m, o = coupling.matrix[row, column], coupling.offset[row]
        ends = sorted(((lower[row] - o) / m, (upper[row] - o) / m))
        low[column], high[column] = max(low[column], ends[0]), min(high[column], ends[1])
        JointError.refuse_if(
            low[column] > high[column],
            name,
            f"cannot follow {independent[column]!r} within its own limits",
        )
    return low, high


def locked_at(model: pin.Model, mimics: Mapping[str, Follow]) -> Array:
    """Return the values of locked joints: neutral, within limits; followers follow."""
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
        angle = np.arctan2(q[there.idx_q + 1], q[there.idx_q]) if there.nq == 2 else q[there.idx_q]
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
        JointError.refuse_if(
            not np.isfinite(axis).all() or abs(np.linalg.norm(axis) - 1) > 1e-6,
            name,
            f"its axis {axis.tolist()} is not a direction",
        )
        JointError.refuse_if(
            not np.isfinite(model.jointPlacements[index].homogeneous).all(),
            name,
            "its placement is not finite",
        )
        low, high = -np.inf, np.inf
        if joint.nq == 1:
            low = float(model.lowerPositionLimit[joint.idx_q])
            high = float(model.upperPositionLimit[joint.idx_q])
            JointError.refuse_if(
                np.isnan(low) or np.isnan(high),
                name,
                "its limits are not numbers; set lower and upper",
            )
            if low > high:
                raise JointError(
                    name, f"lower limit {low:g} is above upper limit {high:g}", limits=(low, high)
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
    limits, sliding = np.array([lower, upper]), np.array(prismatic, dtype=bool)
    largest = np.abs(limits).max(axis=0, initial=0.0)
    turning = largest[~sliding & np.isfinite(largest)]
    # More than two turns each way of every joint, and fewer than stand for "no limit".
    if len(turning) > 1 and (turning > 4 * np.pi).all() and turning.max() <= 3600:
        notes.append(
            f"WARNING: joint limits up to {turning.max():g} rad: are they degrees? The file must "
            "have radians"
        )
    reach = sum(float(np.linalg.norm(p.translation)) for p in model.jointPlacements[2:])
    if reach > 50:  # no arm is; the smallest one in millimetres is
        notes.append(
            f"WARNING: links of {reach:.0f} m in a row: are they millimetres? The file must have "
            "metres"
        )
    return limits[0], limits[1], sliding, notes
