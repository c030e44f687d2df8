"""How far apart two chains of the same joints are, as far as Jacobians go."""

from __future__ import annotations

import math

import numpy as np

from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.robot.chain import Chain


def jacobian_change(one: Chain, other: Chain, arm: Arm, tip_angle: float = 0.0) -> float:
    """Bound the change of any scaled Jacobian column between two chains of the same joints.

    With e_k the angle and d_k the length by which C_k differs, all of joint i's column
    (z x p, z) turns by at most the sum E_i of e_k, k <= i. Seen from the joint, the tip p moves
    by at most D_i: the sum over k > i of d_k plus |t_k| (e_{i+1} + ... + e_{k-1}), the slide
    before C_k counted to its length. The column then changes by at most
    D_i + E_i reach (over the length scale) and E_i. In the tip's axes it turns, besides, with
    these: by no more than all angles together.

    Parameters
    ----------
    one, other : Chain
        Chains with the same joints.
    arm : Arm
        For the limits of prismatic joints, the length scale, and whether the task is in the
        tip's axes.
    tip_angle : float
        Radians; by how much the tip frame's own orientation differs.

    Returns
    -------
    float
        Bound of the Euclidean norm of the change of a column, over the limits.
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
    sine = math.hypot(zy - yz, xz - zx, yx - xy) / 2
    return math.atan2(sine, (xx + yy + zz - 1) / 2)
