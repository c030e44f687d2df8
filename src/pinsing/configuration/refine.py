"""From a configuration that is nearly singular to one that is so to machine accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._batch import walks
from pinsing._types import Array, Bool
from pinsing.arguments import checked
from pinsing.configuration.second_order import Kind, second_order_many
from pinsing.errors import OptionError
from pinsing.kinematics.batch import PINOCCHIO, batch, own_scale
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.verdict import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    Status,
    generic_rank,
    measure,
    ratio_of,
    status_of,
    task_size,
)
from pinsing.robot.arm import Arm
from pinsing.serialization import JsonResult

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


@dataclass(frozen=True, eq=False)
class SingularConfiguration(JsonResult):
    """A configuration and all that is known of its singularity.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, base to tip.
    q : (n,) array
        Joint vector, radians or metres.
    sigma : (r,) array
        Singular values of the task Jacobian (translation rows over the length scale),
        largest first.
    sigma_ratio : float
        sigma_r / sigma_1 at the arm's own scale, which the verdict stands on.
    rank, generic_rank : int
        Rank here (to ``rtol``) and r, the rank at almost every configuration.
    status : str
        ``singular`` (ratio <= ``rtol``), ``near-singular`` (ratio <= ``near_rtol``)
        or ``regular``.
    rtol, near_rtol : float
        Those tolerances.
    lost : (m, k) array
        Orthonormal task directions, translation rows over the length scale, base axes, that
        the tip cannot move in here but can at generic configurations; k = 0 if not singular.
    self_motion : (n, n - rank) array
        Orthonormal joint velocities that leave the tip still.
    residual : float
        Largest norm of J^T u over the lost directions u (sigma_r if not singular).
    iterations : int
        Derivative evaluations of the walk that ended here.
    converged : bool
        At a singularity, or at a minimum of sigma_r that is not zero.
    within_limits : bool
        All joints inside their limits, whole turns aside.
    kind : str
        ``boundary``, ``interior`` or ``undecided``; the last also if not singular.
    """

    schema: ClassVar[str] = "pinsing/singular-configuration/1"
    made_by: ClassVar[str] = "pinsing.configuration.refine(arm, q)"

    joints: tuple[str, ...]
    q: Array
    sigma: Array
    sigma_ratio: float
    rank: int
    generic_rank: int
    status: Status
    rtol: float
    near_rtol: float
    lost: Array
    self_motion: Array
    residual: float
    iterations: int
    converged: bool
    within_limits: bool
    kind: Kind

    @property
    def singular(self) -> bool:
        """True if the rank is below the generic one, to ``rtol``."""
        return self.status == "singular"

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.joints, self.q, strict=True))
        text = f"{self.status} at {values}: sigma_r/sigma_1 = {self.sigma_ratio:.1e}"
        if self.singular:
            text += f", rank {self.rank} of {self.generic_rank}"
            text += "" if self.kind == "undecided" else f", {self.kind}"
        return text + ("" if self.within_limits else ", outside the joint limits")


@checked
def refine(
    arm: Arm,
    q0: npt.ArrayLike,
    *,
    fixed: Sequence[str] | Bool | Sequence[bool] | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> SingularConfiguration:
    """Walk from ``q0`` to a near singular configuration, or to the bottom of its dip.

    Solves J(q)^T u = 0 for a unit u (of a generic rank below m, of the rows that
    count).

    Parameters
    ----------
    arm : Arm
        Any arm.
    q0 : (n,) or (nq,) array_like
        Start, radians or metres.
    fixed : joint names or (n,) mask, optional
        Joints that keep their value.
    ignore_limits : bool
        Walk on whole circles from the start. Otherwise the walk keeps to the limits, and
        leaves them only if it finds no singular configuration inside.
    max_iterations : int
        Bound on the derivative evaluations.

    Returns
    -------
    SingularConfiguration
        Not necessarily singular: see ``status`` and ``converged``.

    Raises
    ------
    ConfigurationError
        If q0 has the wrong length or is not finite.
    UnknownNameError
        If ``fixed`` names a joint that does not exist.
    OptionError
        If ``fixed`` is neither names nor a mask.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.configuration.refine(pinsing.load("planar3r"), [0.3, 0.1, 1])
    >>> found.status, found.kind, bool(abs(found.q[1]) < 1e-9)
    ('singular', 'boundary', True)
    """
    q0 = arm.check_one(q0, "q0").reshape(1, arm.n)
    return refine_many(
        arm, q0, fixed=fixed, ignore_limits=ignore_limits, max_iterations=max_iterations
    )[0]


@checked
def refine_many(
    arm: Arm,
    Q0: npt.ArrayLike,
    *,
    fixed: Sequence[str] | Bool | Sequence[bool] | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> tuple[SingularConfiguration, ...]:
    """Walk from each of many configurations, as `refine` does from one.

    Parameters
    ----------
    arm : Arm
        Any arm.
    Q0 : (N, n) or (N, nq) array_like
        Starts, radians or metres.
    fixed : joint names, (n,) or (N, n) mask, optional
        Joints that keep their value, at all starts or at each.
    ignore_limits, max_iterations
        As in ``refine``.

    Returns
    -------
    tuple of SingularConfiguration
        One for each start.

    Raises
    ------
    ConfigurationError
        If Q0 has the wrong shape or is not finite.
    OptionError
        If ``fixed`` is neither names nor such a mask.
    UnknownNameError
        If ``fixed`` names a joint that does not exist.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r")
    >>> found = pinsing.configuration.refine_many(arm, [[0.3, 0.1, 1], [0, 3, 1]])
    >>> [c.q[1].round(3).item() + 0 for c in found]
    [0.0, 3.142]
    """
    Q0 = arm.check_many(Q0, "Q0")
    return _describe(arm, walk(arm, Q0, _free(arm, fixed), ignore_limits, max_iterations))


def walk(
    arm: Arm,
    Q0: Array,
    free: Bool | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> RankDrops:
    """The walks of ``refine_many``, without a description of where they end."""
    start = np.atleast_2d(arm.space.fold(Q0))
    mask = np.broadcast_to(True if free is None else free, start.shape)
    inside = arm.within_limits(start) & (not ignore_limits)
    start = np.where(inside[:, None], np.clip(start, arm.lower, arm.upper), start)
    q, (sigma, ratio) = start.copy(), measure(arm, start)
    iterations = np.zeros(len(q), dtype=np.intp)
    converged = np.zeros(len(q), dtype=bool)
    rows = np.flatnonzero(inside)
    for bounded in (True, False):
        if len(rows):
            got = approach(arm, start[rows], mask[rows], bounded, max_iterations)
            iterations[rows] += got.iterations
            # From inside the limits, only what is singular is worth leaving them for.
            take = got.singular | bounded | ~inside[rows]
            kept = rows[take]
            q[kept], sigma[kept], ratio[kept] = got.q[take], got.sigma[take], got.ratio[take]
            converged[kept] = got.converged[take]
        rows = np.flatnonzero(~inside | (ratio > SINGULAR_RTOL))
    return RankDrops(arm.space.fold(q), sigma, ratio, iterations, converged)


def describe(arm: Arm, q: npt.ArrayLike) -> SingularConfiguration:
    """All that is known of the configuration q (n,) as it is, without moving it."""
    return describe_many(arm, arm.check_one(q)[None])[0]


def describe_many(arm: Arm, Q: npt.ArrayLike) -> tuple[SingularConfiguration, ...]:
    """The same of each row of Q (N, n)."""
    Q = arm.check_many(Q)
    here = RankDrops(Q, *measure(arm, Q), np.zeros(len(Q), int), np.ones(len(Q), bool))
    return _describe(arm, here)


def _describe(arm: Arm, drops: RankDrops) -> tuple[SingularConfiguration, ...]:
    r, inside = generic_rank(arm), arm.within_limits(drops.q)
    found = []
    for i, second in enumerate(second_order_many(arm, drops.q)):
        found.append(
            SingularConfiguration(
                joints=arm.joints,
                q=drops.q[i],
                sigma=second.sigma,
                sigma_ratio=second.ratio,
                rank=second.rank,
                generic_rank=r,
                status=status_of(second.ratio),
                rtol=SINGULAR_RTOL,
                near_rtol=NEAR_RTOL,
                lost=second.lost,
                self_motion=second.self_motion,
                residual=second.residual,
                iterations=int(drops.iterations[i]),
                converged=bool(drops.converged[i]),
                within_limits=bool(inside[i]),
                kind=second.kind,
            )
        )
    return tuple(found)


def _free(arm: Arm, fixed: Sequence[str] | npt.ArrayLike | None) -> Bool | None:
    """Mask of the joints that may move."""
    if fixed is None:
        return None
    given = [fixed] if isinstance(fixed, str) else fixed
    array = np.asarray(given)
    if array.dtype.kind == "U":
        return ~arm.space.mask(array.ravel().tolist())
    if array.dtype == bool and array.shape[-1:] == (arm.n,):
        return np.asarray(~array)
    if array.size == 0:
        return None
    raise OptionError(f"fixed must be joint names or a mask of {arm.n} booleans")
