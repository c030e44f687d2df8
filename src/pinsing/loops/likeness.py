"""When two configurations are one mode: alike but for flipped balls and universal joints.

Compared are the pose of the output, the values of the actuated joints, the lines of the passive
joints' axes without a sense, and the points in which loops close. A universal joint that is
flipped has the same two lines, and the leg that it carries lies on the same line; of a ball only
the centre counts. What loads pass through is the same then, and so is every measure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.loops.structure import structure
from pinsing.robot.mechanism import Mechanism

SAME = 1e-6
"""Largest difference, metres over the length scale and parts of a unit vector."""


def likeness(
    mechanism: Mechanism, q: Array, joints: Sequence[int] | None = None, pose: bool = True
) -> Array:
    """Numbers (k,) that two configurations q (n,) of one mode share.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    q : (n,) array
        A closed configuration.
    joints : sequence of int, optional
        Only these joints (a leg's); all by default, and the loops.
    pose : bool
        With the pose of the output.
    """
    model, data = mechanism.model, mechanism.model.createData()
    pin.forwardKinematics(model, data, mechanism.model_q(q))
    built, scale = structure(mechanism), mechanism.length_scale
    chosen = range(mechanism.n) if joints is None else joints
    out: list[Array] = []
    if pose:
        placement = pin.updateFramePlacement(model, data, mechanism.output_id)
        out += [np.array(placement.translation) / scale, np.array(placement.rotation).ravel()]
    for j in chosen:
        if j in mechanism.actuated:
            slides = mechanism.prismatic[j]
            out.append(np.array([q[j] / scale] if slides else [np.cos(q[j]), np.sin(q[j])]))
        elif mechanism.prismatic[j]:
            axis = data.oMi[j + 1].rotation @ built.axes[j]
            out += [np.outer(axis, axis).ravel(), np.array(data.oMi[j + 1].translation) / scale]
    wanted = set(chosen)
    for centre in built.centres:
        if not wanted & set(centre.joints):
            continue
        first = data.oMi[centre.joints[0] + 1]
        if len(centre.joints) > 1:
            out.append(np.array(first.act(centre.point)) / scale)
        if len(centre.joints) > 2:
            continue
        for j in centre.joints:
            axis = data.oMi[j + 1].rotation @ built.axes[j]
            out.append(np.outer(axis, axis).ravel())
            if len(centre.joints) == 1:
                at = np.array(data.oMi[j + 1].translation)
                out.append((at - (at @ axis) * axis) / scale)
    if joints is None:
        names = {f.name: i for i, f in enumerate(model.frames)}
        for loop in mechanism.loops:
            at = pin.updateFramePlacement(model, data, names[loop.frame_a]).translation
            out.append(np.array(at) / scale)
    return np.concatenate(out) if out else np.zeros(0)


def output_pose(mechanism: Mechanism, q: Array) -> pin.SE3:
    """Placement of the output frame at q (n,)."""
    model, data = mechanism.model, mechanism.model.createData()
    pin.forwardKinematics(model, data, mechanism.model_q(q))
    return pin.SE3(pin.updateFramePlacement(model, data, mechanism.output_id))


def same(a: Array, b: Array) -> bool:
    """Whether two likenesses (k,) are of one mode."""
    return bool(np.abs(a - b).max(initial=0.0) <= SAME)
