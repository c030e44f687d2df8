"""Walk from many configurations to nearby ones where the task Jacobian loses rank.

sigma_r has a kink at its zeros, so it is not minimised itself. The smooth system is
J(q)^T u = 0, |u| = 1 (or J v = 0 where that is the smaller one). Eliminating the change of
u exactly, by the singular value decomposition at hand, leaves equations in q alone::

    U0^T (J + sum_j dJ/dq_j dq_j) V0 = 0

with U0 = [u_r, ..., u_m] and V0 = [v_r, ..., v_n]: the block of the Jacobian on the last
singular triplet and the null spaces that every configuration has. It is the first-order
condition for rank < r, whatever m, n and r: (m-r+1)(n-r+1) equations, all zero on the right
but the first, which is sigma_r.

These equations are rank-deficient on S-R-S arms and where families meet, and vanish
altogether where sigma_r only touches zero. So they are solved by a Levenberg-Marquardt
method whose damping goes to zero with the square of the residual, which keeps its fast
convergence without a full-rank Jacobian (Yamashita and Fukushima, "On the rate of
convergence of the Levenberg-Marquardt method", 2001).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._batch import walks
from pinsing._types import Array, Bool
from pinsing.kinematics.batch import batch, own_scale
from pinsing.kinematics.engine import PINOCCHIO
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.verdict import SINGULAR_RTOL, generic_rank, measure, ratio_of, task_size
from pinsing.robot.arm import Arm

_RULES = walks.WalkRules(
    floor=4e-16,  # sigma_r / sigma_1 that only rounding is left of
    good=1e-12,  # from here on, a step that does not improve is the end and no reason to damp
    stationary=1e-6,  # |grad sigma_r|^2 / (sigma_1 sigma_r) that counts as zero
    no_minimum=1e-5,  # sigma_r / sigma_1 below which a small slope alone is no reason to stop
    longest=0.5,  # radians, or lengths of the arm
    most_damping=1e10,
    stretch=2.0,  # the step that is exact where sigma_r touches zero with the order two
)


_Ends = tuple[Array, npt.NDArray[np.intp], Bool]  # configurations, derivatives taken, stationary


@dataclass(frozen=True, eq=False)
class RankDrops:
    """Where N walks ended.

    Attributes
    ----------
    q : (N, n) array
        Radians or metres.
    sigma : (N, r) array
        Singular values of the task Jacobian there, largest first.
    ratio : (N,) array
        What verdicts stand on (`pinsing.kinematics.verdict`).
    iterations : (N,) array of int
        Jacobian derivatives evaluated.
    converged : (N,) array of bool
        At rank below r to ``SINGULAR_RTOL``, or at a minimum of sigma_r that is not zero.
    """

    q: Array
    sigma: Array
    ratio: Array
    iterations: npt.NDArray[np.intp]
    converged: Bool

    @property
    def singular(self) -> Bool:
        """Rank below r to ``SINGULAR_RTOL``, (N,)."""
        return np.asarray(self.ratio <= SINGULAR_RTOL)


def approach(
    arm: Arm,
    Q: npt.ArrayLike,
    free: npt.ArrayLike | None = None,
    bounded: bool = False,
    max_iterations: int = 60,
) -> RankDrops:
    """Walk from each row of Q to a near zero, or failing that a minimum, of sigma_r.

    Parameters
    ----------
    arm : Arm
        Any arm.
    Q : (N, n) or (N, nq) array_like
        Starts, radians or metres.
    free : (n,) or (N, n) array_like of bool, optional
        Joints that may move; all by default.
    bounded : bool
        Keep within the joint limits; starts have to be inside.
    max_iterations : int
        Bound on the derivative evaluations per start.

    Returns
    -------
    RankDrops
        Independent of how the starts are batched.
    """
    Q = np.atleast_2d(arm.check(Q)).copy()
    N, n = Q.shape
    mask = np.broadcast_to(True if free is None else np.asarray(free, dtype=bool), (N, n))
    low, high = (arm.lower, arm.upper) if bounded else (np.full(n, -np.inf), np.full(n, np.inf))
    found = _compiled(arm, Q, mask, (low, high), max_iterations)
    if found is None:
        found = _in_numpy(arm, Q, mask, (low, high), max_iterations)
    Q, iterations, stationary = found
    sigma, ratio = measure(arm, Q)
    converged = (ratio <= SINGULAR_RTOL) | stationary
    return RankDrops(Q, sigma, ratio, iterations, converged)


def _compiled(
    arm: Arm, Q: Array, mask: Bool, limits: tuple[Array, Array], max_iterations: int
) -> _Ends | None:
    """The walks in the compiled kernel; None where it does not cover the arm."""
    on, rank = batch(arm), generic_rank(arm)
    if (
        on.engine == PINOCCHIO
        or arm.coupling is not None
        or arm.task.at_tip
        or not walks.covered(arm.n, len(arm.task.rows), rank)
    ):
        return None
    metric = own_scale(arm).columns
    ends, iterations, stationary = walks.walks(
        on.own_chain(),
        Q / metric,
        mask,
        (limits[0] / metric, limits[1] / metric),
        rows=arm.task.rows,
        rank=rank,
        size=task_size(arm),
        rules=_RULES,
        max_iterations=max_iterations,
        isa=on.engine,
    )
    # Neither by rounding: what is held stays, and limits are kept.
    ends = np.clip(np.where(mask, ends * metric, Q), *limits)
    left = iterations < 0
    if left.any():
        ends[left], iterations[left], stationary[left] = _in_numpy(
            arm, Q[left], mask[left], limits, max_iterations
        )
    return ends, iterations, stationary


def _in_numpy(
    arm: Arm, Q: Array, mask: Bool, limits: tuple[Array, Array], max_iterations: int
) -> _Ends:
    """The same walks step by step, with or without the kernel."""
    low, high = limits
    Q = Q.copy()
    sigma = _own_sigma(arm, Q)
    damping = np.ones(len(Q))
    iterations = np.zeros(len(Q), dtype=np.intp)
    stationary = np.zeros(len(Q), dtype=bool)
    active = np.flatnonzero((ratio_of(arm, sigma) > _RULES.floor) & mask.any(axis=1))
    for _ in range(max_iterations):
        if not len(active):
            break
        iterations[active] += 1
        step, flat = _steps(arm, Q[active], mask[active], damping[active], low, high)
        trial, trial_sigma = _better_of(arm, Q[active], step, low, high)
        improved = trial_sigma[:, -1] < sigma[active, -1]
        moved = active[improved]
        Q[moved], sigma[moved] = trial[improved], trial_sigma[improved]
        damping[active] *= np.where(improved, 0.25, 16.0)
        damping[active] = np.maximum(damping[active], 1.0)
        ratio = ratio_of(arm, sigma[active])
        stationary[active] = flat | (damping[active] > _RULES.most_damping)
        done = (ratio <= _RULES.floor) | stationary[active]
        done |= (ratio <= _RULES.good) & ~improved
        active = active[~done]
    return Q, iterations, stationary


def constraint_gradient(arm: Arm, Q: npt.ArrayLike) -> tuple[Array, Array]:
    """Equations U0^T dJ V0 of the rank drop, linear in dq / columns: (N, K, n), and sigma (N, r).

    J and dq at the arm's own scale (`pinsing.kinematics.batch`), free of units.
    K = (m-r+1)(n-r+1); the first row is the gradient of sigma_r where that is simple:
    d sigma_r / d q_j = u_r^T (dJ/dq_j) v_r.
    """
    r = generic_rank(arm)
    J, H = own_jacobians_and_derivatives(arm, Q)
    U, sigma, Vt = np.linalg.svd(J, full_matrices=True)
    U0, V0 = U[:, :, r - 1 :], np.swapaxes(Vt[:, r - 1 :, :], 1, 2)
    N, n = J.shape[0], J.shape[2]
    left = np.matmul(np.swapaxes(U0, 1, 2), H.reshape(N, J.shape[1], n * n))
    left = left.reshape(N, -1, n, n)  # [a, i, j]
    B = np.matmul(np.swapaxes(left, 2, 3), V0[:, None])  # [a, j, b]
    return np.swapaxes(B, 2, 3).reshape(N, -1, n), sigma[:, :r]


def _steps(
    arm: Arm, Q: Array, mask: Bool, damping: Array, low: Array, high: Array
) -> tuple[Array, Bool]:
    """Damped minimum-norm steps (N, n), and whether sigma_r is at a minimum that is not zero."""
    metric = own_scale(arm).columns
    B, sigma = constraint_gradient(arm, Q)
    B = B * mask[:, None, :]
    last = sigma[:, -1]
    step = _damped(B, last, damping) * metric
    # A joint at its limit that would leave it stays; the others do without it.
    blocked = ((low >= Q) & (step < 0)) | ((high <= Q) & (step > 0))
    if blocked.any():
        B = np.where(blocked[:, None, :], 0.0, B)
        step = _damped(B, last, damping) * metric
    step = np.where(mask, step, 0.0)  # not even by rounding
    size = np.linalg.norm(step / metric, axis=1, keepdims=True)
    step *= np.minimum(1.0, _RULES.longest / np.maximum(size, 1e-300))
    slope = np.linalg.norm(B[:, 0], axis=1)
    # Where sigma_r only touches zero its slope vanishes too, as the root of sigma_r; a slope
    # that is small even against that root means a minimum above zero.
    flat = slope**2 <= _RULES.stationary * last * sigma[:, 0]
    flat &= last > _RULES.no_minimum * sigma[:, 0]
    return step, np.asarray(flat)


def _damped(B: Array, last: Array, damping: Array) -> Array:
    """-B^T (B B^T + damping sigma_r^2 I)^-1 (sigma_r, 0, ..., 0)^T for each of N."""
    W, s, Zt = np.linalg.svd(B, full_matrices=False)
    shift = (damping * last**2)[:, None] + np.finfo(float).eps ** 2 * s[:, :1] ** 2
    gain = s / (s**2 + shift + np.finfo(float).tiny)
    # Singular value of the equations, over their largest one, that is none
    gain[s <= 1e-14 * s[:, :1]] = 0.0  # what is made up of rounding alone leads nowhere
    return np.asarray(-np.matmul((gain * W[:, 0, :] * last[:, None])[:, None, :], Zt)[:, 0])


def _better_of(arm: Arm, Q: Array, step: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Of the full and the stretched step, the one that ends at the smaller sigma_r."""
    once = np.clip(Q + step, low, high)
    twice = np.clip(Q + _RULES.stretch * step, low, high)
    both = _own_sigma(arm, np.concatenate([once, twice]))
    first, second = both[: len(Q)], both[len(Q) :]
    stretch = (second[:, -1] < first[:, -1])[:, None]
    return np.where(stretch, twice, once), np.where(stretch, second, first)


def _own_sigma(arm: Arm, Q: Array) -> Array:
    return batch(arm).own_sigma(Q)[:, : generic_rank(arm)]
