"""Rows of a task out of frame Jacobians, in base axes or in those of the tip.

With the rotation R of the tip in the base, the rows in the tip's axes are R^T v and R^T w.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from pinsing._batch import engine as kernel
from pinsing._batch.chain import FlatChain
from pinsing._types import Array
from pinsing.kinematics.engine import PINOCCHIO, batch_chain, fixed_engine, model_values
from pinsing.robot.arm import Arm
from pinsing.robot.task import Task


def tip_rotations(arm: Arm, Q: Array, engine: str = "auto", threads: int | None = None) -> Array:
    """Rotations (N, 3, 3) of the tip in the base at Q (N, n): columns are its axes."""
    engine = fixed_engine(arm, engine)
    if engine == PINOCCHIO:
        return _by_pinocchio(arm, Q)
    # Three slides along the tip's axes, behind it: their columns are those axes.
    chain = arm.once("chain_with_tip_axes", lambda: _with_tip_axes(arm))
    values = np.concatenate([model_values(arm, Q), np.zeros((len(Q), 3))], axis=1)
    J = kernel.jacobians(chain, values, threads=threads, isa=engine)
    return J[:, :3, -3:]


def task_rows(arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
    """Rows of the arm's task (..., m, k) of columns J (..., 6, k), metres and radians.

    Parameters
    ----------
    arm : Arm
        Any arm.
    J : (..., 6, k) array
        Translations, then rotations, in base axes.
    Q : (..., n) array
        Where the tip's axes are taken, if they matter.
    R : (..., 3, 3) array, optional
        The tip's rotation there, where it is known already.
    """
    rows = list(arm.task.rows)
    if not arm.task.at_tip:
        return np.asarray(J[..., rows, :])
    if R is None:
        flat = np.asarray(Q, dtype=float).reshape(-1, arm.n)
        R = tip_rotations(arm, flat).reshape(*np.shape(Q)[:-1], 3, 3)
    return picked(arm.task, J, R)


def picked(task: Task, J: Array, R: Array) -> Array:
    """The same of a task alone, with the tip's rotation R (..., 3, 3)."""
    rows = list(task.rows)
    if not task.at_tip:
        return np.asarray(J[..., rows, :])
    back = np.swapaxes(R, -1, -2)
    turned = np.concatenate([back @ J[..., :3, :], back @ J[..., 3:, :]], axis=-2)
    if all(task.at_tip):
        return np.asarray(turned[..., rows, :])
    return np.where(np.array(task.at_tip)[:, None], turned[..., rows, :], J[..., rows, :])


def in_base(arm: Arm, U: Array, q: Array) -> Array:
    """Wrenches (6, d) in base axes that the task rows U (m, d) at q (n,) are components of."""
    task = arm.task
    return np.asarray(task_rows(arm, np.eye(6), q).T @ U) if task.at_tip else _spread(task, U)


def turned_slopes(arm: Arm, J: Array, H: Array, Q: Array) -> Array:
    """Derivatives (N, m, n, n) of task rows, from J (N, 6, n) and H (N, 6, n, n) in base axes.

    With dR/dq_j = [w_j] R the rows R^T v_i change by R^T (dv_i/dq_j - w_j x v_i).
    """
    task = arm.task
    rows = list(task.rows)
    if not task.at_tip:
        return np.asarray(H[..., rows, :, :])
    back = np.swapaxes(tip_rotations(arm, Q), -1, -2)
    w = J[..., 3:, :]
    parts = []
    for first in (0, 3):
        carried = H[..., first : first + 3, :, :] - each_cross(w, J[..., first : first + 3, :])
        parts.append(np.einsum("...ab,...bij->...aij", back, carried))
    turned = np.concatenate(parts, axis=-3)[..., rows, :, :]
    at_tip = np.array(task.at_tip)[:, None, None]
    return np.where(at_tip, turned, H[..., rows, :, :])


def turn_left(task: Task, R: Array, goal: Array) -> Array:
    """Rotation vectors (N, 3), base axes, from tips R (N, 3, 3) to what a task wants of ``goal``.

    Where the turn about an axis of the tip is free: the shortest that brings this axis there.
    """
    axis = task.tool_axis
    if axis is None or not task.at_tip:
        return rotation_vectors(np.broadcast_to(goal, R.shape) @ np.swapaxes(R, -1, -2))
    here, there = R[..., :, axis], np.broadcast_to(goal, R.shape)[..., :, axis]
    across = np.cross(here, there)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, (here * there).sum(axis=-1))
    factor = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-300), 1.0)
    out = across * factor[..., None]
    half = (sine <= 1e-9) & (angle > 1)  # any way out will do
    out[half] = math.pi * R[half][..., :, (axis + 1) % 3]
    return np.asarray(out)


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors (N, 3) of rotations (N, 3, 3)."""
    v = np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
    )
    sine = np.linalg.norm(v, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    factor = np.where(sine > 1e-9, angle / np.maximum(2 * sine, 1e-300), 0.5)
    # At half a turn the axis is lost; any way out will do.
    half = (sine <= 1e-9) & (angle > 1)
    out = v * factor[:, None]
    out[half] = [math.pi, 0.0, 0.0]
    return np.asarray(out)


def _spread(task: Task, U: Array) -> Array:
    out = np.zeros((6, U.shape[1]))
    out[list(task.rows)] = U
    return out


def each_cross(a: Array, b: Array) -> Array:
    """Products a_j x b_i (..., 3, n, n), entry [:, i, j], of columns of a and b (..., 3, n)."""
    ax, ay, az = (a[..., k, None, :] for k in range(3))
    bx, by, bz = (b[..., k, :, None] for k in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-3)


def _with_tip_axes(arm: Arm) -> FlatChain:
    chain = batch_chain(arm, "batch")
    assert chain is not None  # an engine of the kernel was fixed
    cycle = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # its z axis is the x axis before it
    steps = [chain.R[-1] @ cycle, cycle, cycle, np.eye(3)]
    return FlatChain(
        np.concatenate([chain.R[:-1], np.array(steps)]),
        np.concatenate([chain.t, np.zeros((3, 3))]),
        np.concatenate([chain.prismatic, np.ones(3, dtype=bool)]),
    )


def _by_pinocchio(arm: Arm, Q: Array) -> Array:
    data = arm.model.createData()
    found = np.empty((len(Q), 3, 3))
    for i, q in enumerate(arm.model_q(Q)):
        pin.forwardKinematics(arm.model, data, q)
        found[i] = pin.updateFramePlacement(arm.model, data, arm.tip_id).rotation
    return found
