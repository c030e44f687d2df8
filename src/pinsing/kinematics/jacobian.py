"""Jacobians of an arm: one straight from Pinocchio, or millions checked against it.

Every Jacobian here is the frame Jacobian of the tip: (6, n), translation rows first,
LOCAL_WORLD_ALIGNED, in the axes of the arm's base, metres and radians. The *task*
Jacobian has the rows of the arm's task, translation rows divided by its length scale.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._batch import engine as kernel
from pinsing._types import Array
from pinsing.errors import ConfigurationError, OptionError
from pinsing.geometry.nominal import nominal
from pinsing.kinematics.engine import batch_chain, check_threads, model_values, pinocchio_jacobians
from pinsing.measures import SINGULAR_RTOL, sigma_ratio
from pinsing.robot.arm import Arm

_RANK_SEED = 20231


def tip_placement(arm: Arm, q: npt.ArrayLike) -> pin.SE3:
    """Placement of the tip in the base at q (n,)."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, arm.model_q(_one(arm, q)))
    return pin.SE3(pin.updateFramePlacement(arm.model, data, arm.tip_id))


def frame_jacobian(arm: Arm, q: npt.ArrayLike) -> Array:
    """Frame Jacobian of the tip at one configuration.

    Parameters
    ----------
    q : (n,) array_like
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
    """
    return np.array(frame_jacobians(arm, _one(arm, q), engine="pinocchio")[0])


def frame_jacobians(
    arm: Arm, Q: npt.ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Frame Jacobians of the tip at many configurations.

    Parameters
    ----------
    Q : (N, n) array_like
        Radians or metres.
    engine : str
        "auto", "batch" (the compiled kernel) or "pinocchio"; see ``pinsing.kinematics.engine``.
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
    """
    out = _model_jacobians(arm, _many(arm, Q), engine, threads)
    return out if arm.coupling is None else out @ arm.coupling.matrix


def scale_rows(arm: Arm, J: Array) -> Array:
    """Task rows (..., m, n) of frame Jacobians J (..., 6, n), translations over length scale."""
    rows = np.array(arm.task.rows)
    factor = np.where(rows < 3, 1.0 / arm.length_scale, 1.0)
    return np.asarray(J[..., rows, :] * factor[:, None])


def task_jacobian(arm: Arm, q: npt.ArrayLike) -> Array:
    """Task Jacobian at q (n,): (m, n), translation rows over the length scale."""
    return scale_rows(arm, frame_jacobian(arm, q))


def task_jacobians(
    arm: Arm, Q: npt.ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Task Jacobians at Q (N, n): (N, m, n). Options as for ``frame_jacobians``."""
    return scale_rows(arm, frame_jacobians(arm, Q, engine=engine, threads=threads))


def singular_values(
    arm: Arm, Q: npt.ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Singular values of the task Jacobian at Q (N, n), largest first: (N, r).

    ``r`` is the generic rank: the last column is the measure sigma_r that vanishes
    at singular configurations (sigma_min in the paper). Options as for ``frame_jacobians``.
    """
    Q, threads = _many(arm, Q), check_threads(threads)
    chain = batch_chain(arm, engine)
    if chain is None:
        sigma = np.linalg.svd(task_jacobians(arm, Q, engine="pinocchio"), compute_uv=False)
    elif arm.coupling is not None:
        sigma = kernel.svdvals(task_jacobians(arm, Q, threads=threads), threads=threads)
    else:
        sigma = kernel.singular_values(
            chain, Q, rows=arm.task.rows, length_scale=arm.length_scale, threads=threads
        )
    return np.asarray(sigma[:, : generic_rank(arm)])


def generic_rank(arm: Arm) -> int:
    """Rank of the task Jacobian at almost every configuration.

    Taken on the nominal geometry, at random configurations: the greatest rank found there
    is the generic one, since a lower rank has probability zero. On the raw geometry a
    rounded angle could pretend a motion of relative size 1e-6.

    Raises
    ------
    OptionError
        If it is zero: no joint moves the tip in any row of the task.
    """
    found = arm.__dict__.get("_generic_rank")
    if found is None:
        exact = nominal(arm).arm
        rng = np.random.default_rng(_RANK_SEED)
        # Whole circles, not the limits: a joint that hardly moves still has a generic rank.
        reach = np.where(arm.prismatic, arm.length_scale, np.pi)
        J = frame_jacobians(exact, rng.uniform(-1, 1, (6, arm.n)) * reach)
        sigma = np.linalg.svd(scale_rows(exact, J), compute_uv=False)
        if sigma.max() <= SINGULAR_RTOL * np.abs(J).max() / max(arm.length_scale, 1.0):
            raise OptionError(
                f"task {arm.task}: no joint of {arm.name} moves tip {arm.tip!r} in any of its "
                "rows; choose other rows"
            )
        found = int((sigma > SINGULAR_RTOL * sigma[:, :1]).sum(axis=1).max())
        arm.__dict__["_generic_rank"] = found  # follows from the frozen fields: kept with them
    return int(found)


def task_size(arm: Arm) -> float:
    """What sigma_1 is compared with where the whole task Jacobian can vanish.

    Zero for ``pose``, whose columns are never zero; else the median of sigma_1 at random
    configurations.
    """
    if arm.task.name == "pose":
        return 0.0
    found = arm.__dict__.get("_task_size")
    if found is None:
        rng = np.random.default_rng(_RANK_SEED)
        reach = np.where(arm.prismatic, arm.length_scale, np.pi)
        J = task_jacobians(arm, rng.uniform(-1, 1, (15, arm.n)) * reach, engine="pinocchio")
        found = float(np.median(np.linalg.norm(J, ord=2, axis=(1, 2))))
        arm.__dict__["_task_size"] = found  # follows from the frozen fields: kept with them
    return float(found)


def sigma_ratios(arm: Arm, sigma: npt.ArrayLike) -> Array:
    """sigma_r / sigma_1 of an arm from singular values (..., k >= r), largest first.

    The measure that "singular" is judged by; see ``measures.sigma_ratio`` and ``task_size``.
    """
    return sigma_ratio(sigma, generic_rank(arm), task_size(arm))


def jacobian_derivative(J: npt.ArrayLike) -> Array:
    """Derivative of frame Jacobians by the joints, from their own columns.

    With columns (v_i, w_i) of a serial chain, joints ordered base to tip, at a point
    carried by the tip and in base axes::

        d v_i / d q_j = w_j x v_i  and  d w_i / d q_j = w_j x w_i   if j <= i,
        d v_i / d q_j = w_i x v_j  and  d w_i / d q_j = 0           if j > i

    (Bruyninckx and De Schutter, "Symbolic differentiation of the velocity mapping for a
    serial kinematic chain", 1996). The same as Pinocchio's frame kinematic Hessian.

    Parameters
    ----------
    J : (..., 6, n) array_like
        Frame Jacobians, LOCAL_WORLD_ALIGNED.

    Returns
    -------
    (..., 6, n, n) array
        Entry [row, i, j] is dJ[row, i] / dq_j.
    """
    J = np.asarray(J, dtype=float)
    n = J.shape[-1]
    v, w = np.swapaxes(J[..., :3, :], -1, -2), np.swapaxes(J[..., 3:, :], -1, -2)
    later = np.arange(n)[:, None] >= np.arange(n)[None, :]  # [i, j]: j <= i
    w_j_v_i = np.cross(w[..., None, :, :], v[..., :, None, :])
    w_i_v_j = np.cross(w[..., :, None, :], v[..., None, :, :])
    dv = np.where(later[..., None], w_j_v_i, w_i_v_j)
    dw = np.where(later[..., None], np.cross(w[..., None, :, :], w[..., :, None, :]), 0.0)
    return np.moveaxis(np.concatenate([dv, dw], axis=-1), -1, -3)


def task_jacobians_and_derivatives(arm: Arm, Q: npt.ArrayLike) -> tuple[Array, Array]:
    """Task Jacobians (N, m, n) and their derivatives (N, m, n, n) by the joints at Q (N, n)."""
    Q = _many(arm, Q)
    J = _model_jacobians(arm, Q)
    H = jacobian_derivative(J)
    if arm.coupling is not None:
        matrix = arm.coupling.matrix
        J = J @ matrix
        H = np.einsum("...rij,ia,jb->...rab", H, matrix, matrix)
    rows = np.array(arm.task.rows)
    factor = np.where(rows < 3, 1.0 / arm.length_scale, 1.0)
    return scale_rows(arm, J), H[..., rows, :, :] * factor[:, None, None]


def _one(arm: Arm, q: npt.ArrayLike) -> Array:
    q = arm.check(q)
    if q.ndim != 1:
        raise ConfigurationError(f"q must be one joint vector ({arm.n},), got shape {q.shape}")
    return q


def _many(arm: Arm, Q: npt.ArrayLike) -> Array:
    Q = np.atleast_2d(arm.check(Q))
    if Q.ndim != 2:
        raise ConfigurationError(f"Q must be joint vectors (N, {arm.n}), got shape {Q.shape}")
    return Q


def _model_jacobians(arm: Arm, Q: Array, engine: str = "auto", threads: int | None = None) -> Array:
    """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
    chain = batch_chain(arm, engine)
    if chain is None:
        return pinocchio_jacobians(arm, Q)
    return kernel.jacobians(chain, model_values(arm, Q), threads=check_threads(threads))
