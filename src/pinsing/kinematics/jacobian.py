"""Jacobians of an arm: one straight from Pinocchio, or millions checked against it.

Every Jacobian here is the frame Jacobian of the tip: (6, n), translation rows first,
LOCAL_WORLD_ALIGNED, in the axes of the arm's base, metres and radians. The *task*
Jacobian has the rows of the arm's task, translation rows divided by its length scale.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing.arguments import checked
from pinsing.errors import ConfigurationError
from pinsing.kinematics.batch import (
    batch,
    each_cross,
    joint_frames,
    model_values,
    own_scale,
    random_turns,
    scale_rows as scale_rows,
    turned_slopes,
)
from pinsing.kinematics.verdict import generic_rank as generic_rank
from pinsing.measures import Array, ArrayLike
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.nominal import nominal
from pinsing.robot.source import kept


@checked
def tip_placement(arm: Arm, q: ArrayLike) -> pin.SE3:
    """Placement of the tip in the base at q (n,)."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, arm.model_q(arm.check_one(q)))
    return pin.SE3(pin.updateFramePlacement(arm.model, data, arm.tip_id))


def tip_and_jacobian(arm: Arm, q: Array) -> tuple[Array, Array, Array]:
    """Return position (3,), rotation (3, 3) and `frame_jacobian` of a checked q (n,), in one go."""
    model, tip = arm.model, arm.tip_id
    data = model.createData()
    found = pin.computeFrameJacobian(model, data, arm.model_q(q), tip, pin.LOCAL_WORLD_ALIGNED)
    J = np.array(found).reshape(6, model.nv)  # Pinocchio drops the second axis of a single column
    place = pin.updateFramePlacement(model, data, tip)
    J = J if arm.coupling is None else J @ arm.coupling.matrix
    return np.array(place.translation), np.array(place.rotation), J


def tip_poses(arm: Arm, Q: Array) -> tuple[Array, Array]:
    """Positions (N, 3), metres, and rotations (N, 3, 3) of the tip in the base at Q (N, n)."""
    rotations, origins = joint_frames(flatten(arm), model_values(arm, Q))
    return origins[:, -1], rotations[:, -1]


@checked
def frame_jacobian(arm: Arm, q: ArrayLike) -> Array:
    """Return the frame Jacobian of the tip at one configuration.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    q : (n,) or (nq,) array_like
        Radians or metres.

    Returns
    -------
    (6, n) array
        Rows vx, vy, vz (m/s), wx, wy, wz (rad/s) per unit joint speed, base axes
        (``pin.computeFrameJacobian``, LOCAL_WORLD_ALIGNED).

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.

    Examples
    --------
    >>> import pinsing
    >>> J = pinsing.frame_jacobian(pinsing.load("planar3r"), [0, 0.5, 1])
    >>> J[[0, 1, 5]].round(3)  # vx, vy, wz
    array([[-0.343, -0.343, -0.199],
           [ 0.677,  0.277,  0.014],
           [ 1.   ,  1.   ,  1.   ]])
    """
    return np.array(frame_jacobians(arm, arm.check_one(q), engine="pinocchio")[0])


@checked
def frame_jacobians(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the frame Jacobians of the tip at many configurations.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    Q : (N, n) or (N, nq) array_like
        Radians or metres; or (N, nq), the whole model's configurations.
    engine : str
        "auto", "batch" (the compiled kernel), "pinocchio" or an instruction set; see
        `pinsing.kinematics.batch.fixed_engine`.
    threads : int, optional
        Threads of the compiled kernel; as many as the process may use by default. The
        result does not depend on it.

    Returns
    -------
    (N, 6, n) array
        As ``frame_jacobian``.

    Raises
    ------
    ConfigurationError
        If Q is not of that shape or not finite.
    EngineError
        If the engine asked for is not there, or disagrees with Pinocchio.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> Q = np.random.default_rng(0).uniform(-1, 1, (1000, 6))
    >>> pinsing.kinematics.frame_jacobians(pinsing.load("ur5"), Q).shape
    (1000, 6, 6)
    """
    return batch(arm, engine, threads).frame_jacobians(arm.check_many(Q, "Q", own=False))


@checked
def task_jacobian(arm: Arm, q: ArrayLike) -> Array:
    """Return the task Jacobian at one configuration: the rows of the task, translation rows scaled.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    q : (n,) or (nq,) array_like
        Radians or metres; or (nq,), the whole model's configuration.

    Returns
    -------
    (m, n) array
        The m rows of ``arm.task`` out of ``frame_jacobian``, those with ``@tip`` in the tip's
        axes; rows vx, vy, vz divided by ``arm.length_scale``.

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r", task="vx,vy")
    >>> pinsing.kinematics.task_jacobian(arm, [0, 0.5, 1]).round(3)
    array([[-0.343, -0.343, -0.199],
           [ 0.677,  0.277,  0.014]])
    """
    q = arm.check_one(q)
    return scale_rows(arm, frame_jacobian(arm, q), q)


@checked
def task_jacobians(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the task Jacobians at many configurations.

    Parameters
    ----------
    arm, Q, engine, threads
        As in ``frame_jacobians``.

    Returns
    -------
    (N, m, n) array
        As ``task_jacobian``.

    Raises
    ------
    ConfigurationError, EngineError
        As ``frame_jacobians``.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r", task="vx,vy")
    >>> pinsing.kinematics.task_jacobians(arm, [[0, 0.5, 1], [0, 0.1, 1]]).shape
    (2, 2, 3)
    """
    Q = arm.check_many(Q, "Q", own=False)
    return scale_rows(arm, frame_jacobians(arm, Q, engine=engine, threads=threads), Q)


@checked
def singular_values(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the singular values of the task Jacobian at many configurations, largest first.

    Parameters
    ----------
    arm, Q, engine, threads
        As in ``frame_jacobians``.

    Returns
    -------
    (N, r) array
        r is the generic rank: the last column is the measure sigma_r that vanishes at singular
        configurations (sigma_min in the paper).

    Raises
    ------
    ConfigurationError, EngineError
        As ``frame_jacobians``.
    OptionError
        If no joint moves the tip in any row of the task.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r")
    >>> pinsing.singular_values(arm, [[0, 0, 1], [0, 1, 1]])[:, -1].round(3)
    array([0.   , 0.128])
    """
    sigma = batch(arm, engine, threads).sigma(arm.check_many(Q, "Q", own=False))
    return np.asarray(sigma[:, : generic_rank(arm)])


def jacobian_derivative(J: ArrayLike) -> Array:
    """Return derivatives (..., 6, n, n), [row, i, j] by q_j, of frame Jacobians (..., 6, n).

    With columns (v_i, w_i) of a serial chain, base to tip, LOCAL_WORLD_ALIGNED, for j <= i: d v_i /
    d q_j = w_j x v_i and d w_i / d q_j = w_j x w_i; for j > i: d v_i / d q_j = w_i x v_j and d w_i
    / d q_j = 0 (Bruyninckx and De Schutter, "Symbolic differentiation of the velocity mapping for a
    serial kinematic chain", 1996). The same as Pinocchio's frame kinematic Hessian.
    """
    J = np.asarray(J, dtype=float)
    n = J.shape[-1]
    v, w = J[..., :3, :], J[..., 3:, :]
    later = np.arange(n)[:, None] >= np.arange(n)[None, :]  # [i, j]: j <= i
    moved = each_cross(w, v)  # [i, j]: w_j x v_i
    dv = np.where(later, moved, np.swapaxes(moved, -1, -2))
    return np.concatenate([dv, np.where(later, each_cross(w, w), 0.0)], axis=-3)


def jacobians_and_derivatives(arm: Arm, Q: ArrayLike) -> tuple[Array, Array]:
    """Frame Jacobians (N, 6, n) and their derivatives (N, 6, n, n) by the joints at Q (N, n)."""
    J = batch(arm).model_jacobians(arm.check_many(Q, "Q", own=False))
    H = jacobian_derivative(J)
    if arm.coupling is not None:
        matrix = arm.coupling.matrix
        J = J @ matrix
        H = np.einsum("...rij,ia,jb->...rab", H, matrix, matrix)
    return J, H


def own_jacobians_and_derivatives(arm: Arm, Q: ArrayLike) -> tuple[Array, Array]:
    """Return task Jacobians (N, m, n) and derivatives (N, m, n, n) at Q, at `OwnScale`."""
    Q = arm.check_many(Q, "Q", own=False)
    J, H = jacobians_and_derivatives(arm, Q)
    scale = own_scale(arm)
    H = turned_slopes(arm, J, H, Q) * scale.rows[:, None, None]
    return scale.apply(arm, J, Q), H * scale.columns[:, None] * scale.columns


@kept
def generic_task(arm: Arm) -> Array:
    """Task Jacobians (k, m, n) of the nominal geometry at random configurations, without units."""
    exact = nominal(arm).arm
    Q = random_turns(exact, 6)
    return own_scale(exact).apply(exact, frame_jacobians(exact, Q), Q)


def read_pose(pose: ArrayLike) -> tuple[Array, Array | None]:
    """Return position (3,), and rotation (3, 3) if given; ConfigurationError if it is no pose."""
    given = np.array(pose, dtype=float)
    ConfigurationError.refuse_if(
        not np.isfinite(given).all(), "the pose has a value that is not finite"
    )
    # squares of positions have to be floats
    ConfigurationError.refuse_if(
        (np.abs(given) > 1e9).any(),
        "the pose has a value beyond 1e+09 (metres, radians), which no arm reaches",
    )
    if given.shape == (3,):
        return given, None
    if given.shape == (6,):
        return given[:3], np.array(pin.rpy.rpyToMatrix(*given[3:]))
    if given.shape == (4, 4):
        R = given[:3, :3]
        proper = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
        if proper and np.allclose(given[3], [0, 0, 0, 1]):
            u, _, v = np.linalg.svd(R)
            return given[:3, 3], u @ v
        raise ConfigurationError("the 4 x 4 matrix is not a rotation and a translation")
    raise ConfigurationError(
        "one pose is 3 numbers (x, y, z), 6 (and roll, pitch, yaw) or a 4 x 4 matrix; "
        f"got shape {given.shape}"
        + ": for x, y, z and a quaternion give pin.XYZQUATToSE3(pose)"
        * (given.shape == (7,))
    )
