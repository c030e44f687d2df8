"""From a configuration that is nearly singular to one that is so to machine accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from pinsing._batch import engine
from pinsing.errors import OptionError
from pinsing.interface import JsonResult, checked
from pinsing.kinematics.jacobian import (
    NEAR_RTOL,
    PINOCCHIO,
    SINGULAR_RTOL,
    Batch,
    Status,
    batch,
    frame_jacobian,
    frame_jacobians,
    generic_rank,
    measure,
    own_jacobians_and_derivatives,
    own_scale,
    rank_of,
    ratio_of,
    scale_rows,
    singular_values,
    status_of,
    task_rows,
    task_size,
    tip_poses,
    turn_left,
)
from pinsing.measures import ALIKE, NOISE, SEED, Array, ArrayLike, Bool, NDArray
from pinsing.robot.arm import Arm

Kind = Literal["boundary", "interior", "undecided"]

ZERO = 1e-7
"""Entries of second order, relative to the largest of dJ/dq, that count as zero."""
_ROUNDING = 1e-12
"""The same at points exact to rounding: of the arms by name, entries that are zero come out below
4e-15, and those that are not above 1e-9, as where a folded elbow brings the wrist near axis 2."""
UNDECIDED: Kind = "undecided"


def clear_kinds(arm: Arm, Q: Array) -> list[Kind | None]:
    """Return kinds at singular Q (N, n) where one motion is lost, and clear; else None.

    Of arms whose generic rank is the number m of rows, which miss no motion elsewhere.
    """
    J, H = own_jacobians_and_derivatives(Batch(arm, PINOCCHIO), Q)
    count, m, n = J.shape
    U, sigma, Vt = np.linalg.svd(J)
    lost, still = U[:, None, :, -1], Vt[:, m - 1 :]
    B = (lost @ H.reshape(count, m, n * n)).reshape(count, n, n)
    largest = np.abs(H).max(axis=(1, 2, 3), initial=0.0)
    zero = SINGULAR_RTOL * np.maximum(sigma[:, :1], task_size(arm))
    once = (sigma > zero).sum(axis=1) == m - 1
    # With u the lost direction, N the motions that leave the task at rest, and B_ij = u . dJ_i /
    # dq_j: sym(N^T B N).
    BN = B @ still.transpose(0, 2, 1)
    form = still @ BN
    form = (form + form.transpose(0, 2, 1)) / 2
    values = np.linalg.eigvalsh(form)
    tol = _ROUNDING * largest
    flat = np.abs(form).max(axis=(1, 2), initial=0.0) <= tol
    reached = np.linalg.norm(BN, axis=(1, 2)) > tol
    definite = np.maximum(values[:, 0], -values[:, -1])
    found = np.select(
        [~once, flat & reached, flat, definite > tol, definite < -tol],
        ["", "interior", UNDECIDED, "boundary", "interior"],
        "",
    )
    return [kind or None for kind in found.tolist()]


_SLIDE = 0.05  # length of the self-motion tried along a degenerate direction, as above


def kinds_many(arm: Arm, Q: Array) -> list[Kind]:
    """Return the ``kind`` of ``describe_many`` for each row of Q (N, n), and nothing else.

    One lost direction needs no search for a definite combination: what is clear is decided for all
    rows at once. Where some rows of the task are missing everywhere, nothing is clear.
    """
    full = generic_rank(arm) == len(arm.task.rows)
    found: list[Any] = clear_kinds(arm, Q) if full else [None] * len(Q)
    if left := [i for i, kind in enumerate(found) if kind is None]:
        rows = zip(
            Q[left], *own_jacobians_and_derivatives(Batch(arm, PINOCCHIO), Q[left]), strict=True
        )
        decided = _decided(arm, [_Spaces(arm, *row) for row in rows])
        for i, kind in zip(left, decided, strict=True):
            found[i] = kind
    return found


class _Spaces:
    """Null spaces of one task Jacobian at the own scale, and what they say of the kind."""

    def __init__(self, arm: Arm, q: Array, J: Array, H: Array) -> None:
        U, sigma, Vt = np.linalg.svd(J)
        self.rank, self.ratio = rank_of(arm, sigma), float(ratio_of(arm, sigma))
        self.still, self.lost = Vt[self.rank :].T, np.zeros((len(J), 0))
        self.kind: Kind = UNDECIDED
        # q, u (m,) and directions (n, p): a boundary if u stays lost along all of these.
        self.way: tuple[Array, Array, Array] | None = None
        if self.rank < generic_rank(arm):
            self.lost = _lost(arm, q, U[:, self.rank :], self.still, H, self.rank)
            self.kind, along = _kind(self.lost, self.still, H)
            self.way = None if along is None else (q, *along)


def _decided(arm: Arm, spaces: Sequence[_Spaces]) -> list[Kind]:
    """The kinds; what has to be followed for a way is followed all at once."""
    ways = [s.way for s in spaces if s.way is not None]
    critical = iter(_critical_along(arm, ways) if ways else ())
    return ["boundary" if s.way is not None and next(critical) else s.kind for s in spaces]


def _turned(basis: Array, factors: Array) -> Array:
    """Orthonormal basis of a space (k, d) whose coordinates are multiplied by ``factors`` (k,)."""
    if (factors == factors[0]).all():
        return basis
    return np.asarray(np.linalg.qr(factors[:, None] * basis)[0])


def _kind(lost: Array, N: Array, H: Array) -> tuple[Kind, tuple[Array, Array] | None]:
    """Kind; if undecided perhaps with the direction and the kernel that it depends on."""
    B = np.tensordot(lost, H, (0, 0))  # [a, i, j]
    tol = ZERO * float(np.abs(H).max())
    Q = N.T @ B @ N
    Q = (Q + np.swapaxes(Q, 1, 2)) / 2
    if np.abs(Q).max() <= tol:
        # No second order at all: every lost u must become attainable along some self-motion.
        reach = np.linalg.svd((B @ N).reshape(len(B), -1), compute_uv=False)
        return "interior" if reach[-1] > tol else UNDECIDED, None
    if Q.shape[1] == 1:
        return "boundary", None  # some combination of numbers that are not all zero is positive
    best, directions = _most_definite(Q)
    if abs(best) > tol:
        return "boundary" if best > 0 else "interior", None
    for u in directions:
        eigenvalues, Z = np.linalg.eigh(np.tensordot(u, Q, 1))
        kernel = N @ Z[:, np.abs(eigenvalues) <= 10 * tol]
        if np.abs(np.tensordot(u, B, 1) @ kernel).max(initial=0.0) <= tol:
            return UNDECIDED, (lost @ u, kernel)
    return "interior", None


def _lost(arm: Arm, q: Array, left: Array, N: Array, H: Array, rank: int) -> Array:
    """Return the part of the left null space (m, m - rank) that generic configurations lack."""
    # It is what a small move makes attainable again: the range of U0^T dJ N over all moves.
    r = generic_rank(arm)
    if r == len(left):
        return left
    moves = np.einsum("ra,rij,ip->apj", left, H, N).reshape(left.shape[1], -1)
    W, size, _ = np.linalg.svd(moves, full_matrices=False)
    count = int((size > ZERO * np.abs(H).max()).sum())
    if count < r - rank:  # a first derivative misses some: what is attainable a little beside q
        scale, count = own_scale(arm), r - rank
        move = np.random.default_rng(SEED).standard_normal(arm.n)
        beside = q + 1e-3 * move / np.linalg.norm(move) * scale.columns
        U, _, _ = np.linalg.svd(scale_rows(arm, frame_jacobian(arm, beside), beside, own=True))
        W, _, _ = np.linalg.svd(left.T @ U[:, rank:r], full_matrices=False)
    return np.asarray(left @ W[:, :count])


def _most_definite(Q: Array) -> tuple[float, Array]:
    """Greatest smallest eigenvalue of sum_a u_a Q_a over unit u, and the u that reach it."""
    k = len(Q)
    if k == 1:
        u = np.array([[1.0], [-1.0]])
        value = np.linalg.eigvalsh(u[:, :, None] * Q)[:, 0]
        return float(value.max()), u[value >= value.max() - 1e-9 * np.abs(Q).max()]
    # The function is concave and of degree one: its ascent has no false maxima above zero.
    rng = np.random.default_rng(SEED)
    u = np.concatenate([np.eye(k), -np.eye(k), rng.standard_normal((4 * k, k))])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    best_value = np.full(len(u), -np.inf)
    best_u = u.copy()
    for step in 0.5 * 0.93 ** np.arange(120):
        value, Z = np.linalg.eigh(np.einsum("sa,apq->spq", u, Q))
        better = value[:, 0] > best_value
        best_value = np.where(better, value[:, 0], best_value)
        best_u = np.where(better[:, None], u, best_u)
        z = Z[:, :, 0]
        slope = np.einsum("sp,apq,sq->sa", z, Q, z)
        slope -= (slope * u).sum(axis=1, keepdims=True) * u
        u = u + step * slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
        u /= np.linalg.norm(u, axis=1, keepdims=True)
    top = float(best_value.max())
    return top, best_u[best_value >= top - 1e-6 * np.abs(Q).max()]


def _critical_along(arm: Arm, ways: Sequence[tuple[Array, Array, Array]]) -> list[bool]:
    """Tell if the tip can stay still, and u lost, along every direction of each kernel."""
    # A way is its configuration (n,), u (m,), and the kernel (n, p).
    columns = own_scale(arm).columns
    parts = []
    for _, _, kernel in ways:
        rng = np.random.default_rng(SEED)
        mixed = kernel @ rng.standard_normal((kernel.shape[1], kernel.shape[1]))
        parts.append(np.concatenate([kernel, mixed / np.linalg.norm(mixed, axis=0)], axis=1).T)
    of = np.repeat(np.arange(len(ways)), [len(part) for part in parts])
    at = np.array([q for q, _, _ in ways])[of]
    along = np.concatenate(parts)
    u = np.array([u for _, u, _ in ways])[of]
    ends, arrived = _slide(arm, at, u, at + _SLIDE * along * columns)
    far = np.abs((((ends - at) / columns) * along).sum(axis=1)) >= _SLIDE / 2
    return [bool((arrived & far)[of == i].all()) for i in range(len(ways))]


def _slide(arm: Arm, at: Array, u: Array, starts: Array) -> tuple[Array, Bool]:
    """Return configurations near ``starts`` (N, n), J^T u = 0, tip as ``at``; and which arrived."""
    scale = own_scale(arm)
    place, turned = tip_poses(arm, at)
    now = starts.copy()
    moving = np.arange(len(starts))  # those that have not arrived
    for _ in range(20):
        Q = now[moving]
        position, R = tip_poses(arm, Q)
        turn = -turn_left(arm.task, R, turned[moving])
        apart = np.concatenate([position - place[moving], turn], axis=1)
        error = task_rows(arm, apart[:, :, None], Q, R)[:, :, 0] * scale.rows
        J, H = own_jacobians_and_derivatives(batch(arm), Q)
        F = np.concatenate([error, np.einsum("krj,kr->kj", J, u[moving])], axis=1)
        left = np.abs(F).max(axis=1) > 1e-10
        moving = moving[left]
        if not len(moving):
            break
        slope = np.concatenate([J[left], np.einsum("kr,krij->kij", u[moving], H[left])], axis=1)
        step = np.linalg.pinv(slope, rcond=1e-6) @ F[left, :, None]
        now[moving] = Q[left] - step[:, :, 0] * scale.columns
    return now, ~np.isin(np.arange(len(starts)), moving)


_RULES = engine.WalkRules(
    floor=4e-16,  # sigma_r / sigma_1 that only rounding is left of
    good=NOISE,  # from here on, a step that does not improve is the end and no reason to damp
    stationary=ALIKE,  # |grad sigma_r|^2 / (sigma_1 sigma_r) that counts as zero
    no_minimum=1e-5,  # sigma_r / sigma_1 below which a small slope alone is no reason to stop
    longest=0.5,  # radians, or lengths of the arm
    most_damping=1e10,
    stretch=2.0,  # the step that is exact where sigma_r touches zero with the order two
)


@dataclass(frozen=True, eq=False)
class RankDrops:
    """Where N walks ended."""

    q: Array  # (N, n), radians or metres
    sigma: Array  # (N, r), of the task Jacobian, largest first
    ratio: Array  # (N,), verdicts stand on it (`pinsing.kinematics.jacobian`)
    iterations: NDArray[np.intp]  # (N,), Jacobian derivatives evaluated
    # (N,), at rank below r to ``SINGULAR_RTOL``, or at a minimum of sigma_r that is not zero
    converged: Bool

    @property
    def singular(self) -> Bool:
        """Rank below r to ``SINGULAR_RTOL``, (N,)."""
        return np.asarray(self.ratio <= SINGULAR_RTOL)


def approach(
    arm: Arm,
    Q: ArrayLike,
    free: ArrayLike | None = None,
    bounded: bool = False,
    max_iterations: int = 60,
) -> RankDrops:
    """Walk from each row of Q (N, n) to a near zero, or failing that a minimum, of sigma_r."""
    # ``free`` joints, (n,) or (N, n), move; ``bounded``: within the limits, where starts have to
    # be. Each takes up to ``max_iterations`` derivatives. The result does not depend on batches.
    Q = np.atleast_2d(arm.check(Q)).copy()
    N, n = Q.shape
    mask = np.broadcast_to(True if free is None else np.asarray(free, dtype=bool), (N, n))
    low, high = (arm.lower, arm.upper) if bounded else (np.full(n, -np.inf), np.full(n, np.inf))
    on, rank, metric = batch(arm), generic_rank(arm), own_scale(arm).columns
    iterations, stationary = np.full(N, -1, dtype=np.intp), np.zeros(N, dtype=bool)
    own = arm.coupling is None and not arm.task.at_tip and on.engine != PINOCCHIO
    if own and engine.walks_covered(n, len(arm.task.rows), rank):
        ends, iterations, stationary = engine.walks(
            on.own_chain(),
            Q / metric,
            mask,
            (low / metric, high / metric),
            rows=arm.task.rows,
            rank=rank,
            size=task_size(arm),
            rules=_RULES,
            max_iterations=max_iterations,
            isa=on.engine,
        )
        # Neither by rounding: what is held stays, and limits are kept.
        ends = np.clip(np.where(mask, ends * metric, Q), low, high)
        Q = np.where((iterations < 0)[:, None], Q, ends)
    left = iterations < 0  # what the kernel does not cover, or where a Jacobian overflows
    if left.any():
        Q[left], iterations[left], stationary[left] = _in_numpy(
            arm, Q[left], mask[left], (low, high), max_iterations
        )
    sigma, ratio = measure(arm, Q)
    return RankDrops(Q, sigma, ratio, iterations, (ratio <= SINGULAR_RTOL) | stationary)


def _in_numpy(
    arm: Arm, Q: Array, mask: Bool, limits: tuple[Array, Array], max_iterations: int
) -> tuple[Array, NDArray[np.intp], Bool]:
    """The same walks step by step, with or without the kernel; Q changes."""
    (low, high), on, rank = limits, batch(arm), generic_rank(arm)
    sigma = on.own_sigma(Q)[:, :rank]
    damping = np.ones(len(Q))
    iterations = np.zeros(len(Q), dtype=np.intp)
    stationary = np.zeros(len(Q), dtype=bool)
    active = np.flatnonzero((ratio_of(arm, sigma) > _RULES.floor) & mask.any(axis=1))
    for _ in range(max_iterations):
        if not len(active):
            break
        iterations[active] += 1
        step, flat = _steps(arm, Q[active], mask[active], damping[active], low, high)
        # Of the full and the stretched step, the one that ends at the smaller sigma_r.
        once, twice = (np.clip(Q[active] + k * step, low, high) for k in (1.0, _RULES.stretch))
        first, second = np.split(on.own_sigma(np.concatenate([once, twice]))[:, :rank], 2)
        stretch = (second[:, -1] < first[:, -1])[:, None]
        trial, trial_sigma = np.where(stretch, twice, once), np.where(stretch, second, first)
        improved = trial_sigma[:, -1] < sigma[active, -1]
        moved = active[improved]
        Q[moved], sigma[moved] = trial[improved], trial_sigma[improved]
        damping[active] = np.maximum(damping[active] * np.where(improved, 0.25, 16.0), 1.0)
        ratio = ratio_of(arm, sigma[active])
        stationary[active] = flat | (damping[active] > _RULES.most_damping)
        done = (ratio <= _RULES.floor) | stationary[active]
        done |= (ratio <= _RULES.good) & ~improved
        active = active[~done]
    return Q, iterations, stationary


def constraint_gradient(arm: Arm, Q: Array) -> tuple[Array, Array]:
    """Return equations U0^T dJ V0 of the rank drop in dq / columns, (N, K, n), and sigma (N, r)."""
    # At the arm's own scale. K = (m-r+1)(n-r+1); the first row is the gradient of sigma_r where
    # that is simple: d sigma_r / d q_j = u_r^T (dJ/dq_j) v_r.
    r = generic_rank(arm)
    J, H = own_jacobians_and_derivatives(batch(arm), np.atleast_2d(Q))
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
    # Where sigma_r only touches zero its slope vanishes too, as the root of sigma_r; a slope
    # that is small even against that root means a minimum above zero.
    flat = np.linalg.norm(B[:, 0], axis=1) ** 2 <= _RULES.stationary * last * sigma[:, 0]
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
    made_by: ClassVar[str] = "pinsing.kinematics.refine(arm, q)"

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
    q0: ArrayLike,
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
    >>> found = pinsing.kinematics.refine(pinsing.load("planar3r"), [0.3, 0.1, 1])
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
    Q0: ArrayLike,
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
    >>> found = pinsing.kinematics.refine_many(arm, [[0.3, 0.1, 1], [0, 3, 1]])
    >>> [c.q[1].round(3).item() + 0 for c in found]
    [0.0, 3.142]
    """
    Q0, free = arm.check_many(Q0, "Q0"), None
    if fixed is not None:
        array = np.asarray([fixed] if isinstance(fixed, str) else fixed)
        if array.dtype.kind == "U":
            free = ~arm.space.mask(array.ravel().tolist())
        elif array.dtype == bool and array.shape in ((arm.n,), (1, arm.n), Q0.shape):
            free = np.asarray(~array)
        elif array.shape != (0,):
            raise OptionError(f"fixed must be joint names or a mask of {arm.n} booleans")
    return _describe(arm, walk(arm, Q0, free, ignore_limits, max_iterations))


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


def describe(arm: Arm, q: ArrayLike) -> SingularConfiguration:
    """All that is known of the configuration q (n,) as it is, without moving it."""
    return describe_many(arm, arm.check_one(q)[None])[0]


def describe_many(arm: Arm, Q: ArrayLike) -> tuple[SingularConfiguration, ...]:
    """The same of each row of Q (N, n)."""
    Q = arm.check_many(Q)
    here = RankDrops(Q, *measure(arm, Q), np.zeros(len(Q), int), np.ones(len(Q), bool))
    return _describe(arm, here)


def _describe(arm: Arm, drops: RankDrops) -> tuple[SingularConfiguration, ...]:
    """Return null spaces, lost directions and kind at the end of each walk.

    Where the form is only semidefinite, a kernel direction n along which (u . H) n is not zero
    makes the answer ``interior``: moving along that self-motion makes u attainable to first order.
    If it is zero, but the arm can slide along n for a finite way with the tip still and u lost all
    along, Q counts transversally to that way (Morse-Bott) and the answer is ``boundary``. What is
    left, such as a vanishing Q, is ``undecided``.
    """
    Q, r, scale, inside = drops.q, generic_rank(arm), own_scale(arm), arm.within_limits(drops.q)
    J, H = own_jacobians_and_derivatives(batch(arm), Q)
    # What is printed of it is at the length scale of the arm, and by its own joint speeds.
    at_scale, sigma = scale_rows(arm, frame_jacobians(arm, Q), Q), singular_values(arm, Q)
    lengths = np.where(np.array(arm.task.rows) < 3, arm.length_scale, 1.0)
    spaces = [_Spaces(arm, *row) for row in zip(Q, J, H, strict=True)]
    found = []
    for i, (space, kind) in enumerate(zip(spaces, _decided(arm, spaces), strict=True)):
        lost = _turned(space.lost, scale.rows * lengths)
        least = np.linalg.norm(at_scale[i].T @ lost, axis=0).max(initial=0.0)
        found.append(
            SingularConfiguration(
                joints=arm.joints,
                q=Q[i],
                sigma=sigma[i],
                sigma_ratio=space.ratio,
                rank=space.rank,
                generic_rank=r,
                status=status_of(space.ratio),
                rtol=SINGULAR_RTOL,
                near_rtol=NEAR_RTOL,
                lost=lost,
                self_motion=_turned(space.still, scale.columns),
                residual=float(least if space.rank < r else sigma[i, -1]),
                iterations=int(drops.iterations[i]),
                converged=bool(drops.converged[i]),
                within_limits=bool(inside[i]),
                kind=kind,
            )
        )
    return tuple(found)
