"""Second order at a singular configuration: what is lost, and whether the tip is at a boundary.

Along a lost direction u (J^T u = 0) the tip cannot move to first order. To second order
u^T d2x = n^T Q n over the self-motions n (J n = 0), with Q = sym(N^T (u . H) N),
H[r, i, j] = dJ[r, i]/dq_j and N a basis of the null space. If Q is definite for some lost u,
the tip moves to one side only: a *boundary* singularity; otherwise an *interior* one
(paper Section 1; for the second-order test see Bedrossian, "Classification of singular
configurations for redundant manipulators", ICRA 1990).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pinsing._batch import walks
from pinsing._types import Array
from pinsing.kinematics.batch import PINOCCHIO, batch, own_scale, task_rows, turn_left
from pinsing.kinematics.jacobian import (
    frame_jacobian,
    frame_jacobians,
    own_jacobians_and_derivatives,
    scale_rows,
    singular_values,
    tip_poses,
)
from pinsing.kinematics.verdict import (
    SINGULAR_RTOL,
    generic_rank,
    rank_of,
    ratio_of,
    task_size,
)
from pinsing.robot.arm import Arm

Kind = Literal["boundary", "interior", "undecided"]

ZERO = 1e-7
"""Entries of second order, relative to the largest of dJ/dq, that count as zero."""
UNDECIDED: Kind = "undecided"


def clear_kinds(arm: Arm, Q: Array, compiled: bool = True) -> list[Kind | None]:
    """The kinds at Q (N, n), radians and metres, where one motion is lost.

    None where more than one is lost, or none, and where this does not tell.
    """
    if generic_rank(arm) < len(arm.task.rows):
        told = _told_of_fewer(arm, Q)
    else:
        found = _told_compiled(arm, Q) if compiled else None
        told = _told(arm, Q) if found is None else found
    above, least, greatest, entry, reached, largest = told.T
    tol = ZERO * largest
    best = np.maximum(least, -greatest)
    kinds: dict[int, Kind | None] = {0: None, 1: UNDECIDED, 2: "interior", 3: "boundary"}
    clear = np.where(np.abs(best) > tol, np.where(best > 0, 3, 2), 0)
    flat = np.where(reached > tol, 2, 1)
    once = above == generic_rank(arm) - 1
    return [kinds[k] for k in np.where(once, np.where(entry <= tol, flat, clear), 0).tolist()]


def _told_compiled(arm: Arm, Q: Array) -> Array | None:
    """As ``_told``, in the compiled kernel; None where it does not cover the arm."""
    on, rows = batch(arm), arm.task.rows
    alone = arm.coupling is not None or arm.task.at_tip or on.engine == PINOCCHIO
    if alone or not walks.second_orders_covered(arm.n, len(rows)):
        return None
    return walks.second_orders(
        on.own_chain(),
        Q / own_scale(arm).columns,
        rows=rows,
        zero=SINGULAR_RTOL,
        size=task_size(arm),
        # Configurations from which on they are shared out among threads
        threads=1 if len(Q) < 1_000 else None,
        isa=on.engine,
    )


def _told(arm: Arm, Q: Array) -> Array:
    """What `pinsing._batch.walks` tells of Q (N, n), all rows being reached in general."""
    J, H = own_jacobians_and_derivatives(arm, Q)
    U, sigma, Vt = np.linalg.svd(J)
    B = np.einsum("kr,krij->kij", U[:, :, -1], H)
    return _of_form(_above(arm, sigma), B, Vt[:, J.shape[1] - 1 :], H)


def _told_of_fewer(arm: Arm, Q: Array) -> Array:
    """The same where the generic rank r is less than the rows: some motions are never there.

    Of the m - r + 1 directions that are missing, the one that a small move makes attainable again
    is lost: the range of U0^T dJ N over all moves. Where that is not one, the rank is -1.
    """
    J, H = own_jacobians_and_derivatives(arm, Q)
    count, m, n = J.shape
    U, sigma, Vt = np.linalg.svd(J)
    r = generic_rank(arm)
    missing, still = U[:, :, r - 1 :].transpose(0, 2, 1), Vt[:, r - 1 :]
    B = (missing @ H.reshape(count, m, n * n)).reshape(count, -1, n, n)
    moves = (still[:, None] @ B).reshape(count, m - r + 1, -1)
    W, size, _ = np.linalg.svd(moves, full_matrices=False)
    one = (size > ZERO * np.abs(H).max(axis=(1, 2, 3))[:, None]).sum(axis=1) == 1
    form = np.einsum("ka,kaij->kij", W[:, :, 0], B)
    return _of_form(np.where(one, _above(arm, sigma), -1), form, still, H)


def _above(arm: Arm, sigma: Array) -> npt.NDArray[np.intp]:
    """How many singular values (N, k) at the own scale are not zero, (N,)."""
    zero = SINGULAR_RTOL * np.maximum(sigma[:, :1], task_size(arm))
    return np.asarray((sigma > zero).sum(axis=1))


def _of_form(above: npt.NDArray[np.intp], B: Array, still: Array, H: Array) -> Array:
    """The columns (N, 6) of B (N, n, n), self-motions (N, p, n) and dJ (N, m, n, n)."""
    BN = B @ still.transpose(0, 2, 1)
    form = still @ BN
    form = (form + form.transpose(0, 2, 1)) / 2
    values = np.linalg.eigvalsh(form)
    return np.stack(
        [
            above,
            values[:, 0],
            values[:, -1],
            np.abs(form).max(axis=(1, 2), initial=0.0),
            np.linalg.norm(BN, axis=(1, 2)),
            np.abs(H).max(axis=(1, 2, 3), initial=0.0),
        ],
        axis=1,
    )


_SLIDE = 0.05  # length of the self-motion tried along a degenerate direction, as above
_SEED = 90210


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """What the task Jacobian and its derivative say about one configuration.

    Attributes
    ----------
    sigma : (r,) array
        Singular values of the task Jacobian, largest first.
    ratio : float
        sigma_r / sigma_1 at the arm's own scale, which verdicts stand on.
    rank : int
        Number of singular values above ``SINGULAR_RTOL`` times the largest, at that scale.
    lost : (m, k) array
        Orthonormal task directions (translation rows over the length scale) that are lost
        here but not at generic configurations; k = 0 where the rank is generic.
    self_motion : (n, n - rank) array
        Orthonormal joint velocities that leave the tip still.
    residual : float
        Largest norm of J^T u over the lost directions u; sigma_r where none is lost.
    kind : str
        ``boundary``, ``interior`` or ``undecided``; the last also where the rank is generic.
    """

    sigma: Array
    ratio: float
    rank: int
    lost: Array
    self_motion: Array
    residual: float
    kind: Kind


def second_order_many(arm: Arm, Q: npt.ArrayLike) -> tuple[SecondOrder, ...]:
    """Null spaces, lost directions and kind at each row of Q (N, n).

    Where the form is only semidefinite, a kernel direction n along which (u . H) n is not zero
    makes the answer ``interior``: moving along that self-motion makes u attainable to first order.
    If it is zero, but the arm can slide along n for a finite way with the tip still and u
    lost all along, Q counts transversally to that way (Morse-Bott) and the answer is
    ``boundary``. What is left, such as a vanishing Q, is ``undecided``.
    """
    Q = np.atleast_2d(arm.check(Q))
    J, H = own_jacobians_and_derivatives(arm, Q)
    # What is printed of it is at the length scale of the arm, and by its own joint speeds.
    at_scale = scale_rows(arm, frame_jacobians(arm, Q), Q)
    sigma = singular_values(arm, Q)
    spaces = [_spaces(arm, *row) for row in zip(Q, J, H, strict=True)]
    kinds = _decided(arm, Q, spaces)
    return tuple(_printed(arm, *row) for row in zip(spaces, kinds, at_scale, sigma, strict=True))


def kinds_many(arm: Arm, Q: npt.ArrayLike, most: int | None = None) -> list[Kind | None]:
    """The ``kind`` of ``second_order_many`` for each row of Q (N, n), and nothing else.

    One lost direction alone needs no search for a definite combination: what is clearly definite
    or indefinite there is decided for all rows at once. Of the others the first ``most`` are
    decided one by one, wherever they stand: they may be of another kind than all that is clear.
    None for those beyond. Where some rows of the task are missing everywhere, the first ``most``
    are all that is looked at.
    """
    Q = np.atleast_2d(arm.check(Q))
    count = len(Q) if generic_rank(arm) == len(arm.task.rows) else len(Q[:most])
    found = [*clear_kinds(arm, Q[:count]), *[None] * (len(Q) - count)]
    rest = [i for i, kind in enumerate(found[:count]) if kind is None][:most]
    if rest:
        J, H = own_jacobians_and_derivatives(arm, Q[rest])
        spaces = [_spaces(arm, *row) for row in zip(Q[rest], J, H, strict=True)]
        for i, kind in zip(rest, _decided(arm, Q[rest], spaces), strict=True):
            found[i] = kind
    return found


@dataclass(frozen=True, eq=False)
class _Spaces:
    """Null spaces of one task Jacobian at the own scale, and what they say of the kind.

    ``kind`` is None where it is a boundary if u (m,) stays lost along the kernel (n, p).
    """

    rank: int
    ratio: float
    lost: Array
    still: Array
    kind: Kind | None
    u: Array
    kernel: Array


def _spaces(arm: Arm, q: Array, J: Array, H: Array) -> _Spaces:
    U, sigma, Vt = np.linalg.svd(J)
    r = generic_rank(arm)
    rank, ratio = rank_of(arm, sigma), float(ratio_of(arm, sigma))
    N = Vt[rank:].T
    if rank >= r:
        none = np.zeros((len(J), 0))
        return _Spaces(rank, ratio, none, N, UNDECIDED, none, none)
    lost = _lost(arm, q, U[:, rank:], N, H, rank)
    return _Spaces(rank, ratio, lost, N, *_kind(lost, N, H))


def _decided(arm: Arm, Q: Array, spaces: Sequence[_Spaces]) -> list[Kind]:
    """The kinds at Q (N, n); what has to be followed for a way is followed all at once."""
    kinds = [s.kind or UNDECIDED for s in spaces]
    open_ = [i for i, s in enumerate(spaces) if s.kind is None]
    if open_:
        ways = [(Q[i], spaces[i].u, spaces[i].kernel) for i in open_]
        for i, critical in zip(open_, _critical_along(arm, ways), strict=True):
            kinds[i] = "boundary" if critical else UNDECIDED
    return kinds


def _printed(arm: Arm, found: _Spaces, kind: Kind, at_scale: Array, printed: Array) -> SecondOrder:
    scale = own_scale(arm)
    lengths = np.where(np.array(arm.task.rows) < 3, arm.length_scale, 1.0)
    lost = _turned(found.lost, scale.rows * lengths)
    residual = float(np.linalg.norm(at_scale.T @ lost, axis=0).max(initial=0.0))
    residual = residual if found.rank < generic_rank(arm) else float(printed[-1])
    still = _turned(found.still, scale.columns)
    return SecondOrder(printed, found.ratio, found.rank, lost, still, residual, kind)


def _turned(basis: Array, factors: Array) -> Array:
    """Orthonormal basis of a space (k, d) whose coordinates are multiplied by ``factors`` (k,)."""
    if (factors == factors[0]).all():
        return basis
    return np.asarray(np.linalg.qr(factors[:, None] * basis)[0])


def _kind(lost: Array, N: Array, H: Array) -> tuple[Kind | None, Array, Array]:
    """Kind, or None with the direction and the kernel that it depends on."""
    none = np.zeros(0)
    B = np.tensordot(lost, H, (0, 0))  # [a, i, j]
    tol = ZERO * float(np.abs(H).max())
    Q = N.T @ B @ N
    Q = (Q + np.swapaxes(Q, 1, 2)) / 2
    if np.abs(Q).max() <= tol:
        # No second order at all: every lost u must become attainable along some self-motion.
        reach = np.linalg.svd((B @ N).reshape(len(B), -1), compute_uv=False)
        return "interior" if reach[-1] > tol else UNDECIDED, none, none
    best, directions = _most_definite(Q)
    if best > tol:
        return "boundary", none, none
    if best < -tol:
        return "interior", none, none
    for u in directions:
        eigenvalues, Z = np.linalg.eigh(np.tensordot(u, Q, 1))
        kernel = N @ Z[:, np.abs(eigenvalues) <= 10 * tol]
        if np.abs(np.tensordot(u, B, 1) @ kernel).max(initial=0.0) > tol:
            continue
        return None, lost @ u, kernel
    return "interior", none, none


def _lost(arm: Arm, q: Array, left: Array, N: Array, H: Array, rank: int) -> Array:
    """Of the left null space (m, m - rank), the part that generic configurations do not have.

    Some directions may be unattainable at every configuration. Those lost here are the ones
    that a small move makes attainable again: the range of U0^T dJ N over all moves.
    """
    r, m = generic_rank(arm), len(left)
    if r == m:
        return left
    moves = np.einsum("ra,rij,ip->apj", left, H, N).reshape(left.shape[1], -1)
    W, size, _ = np.linalg.svd(moves, full_matrices=False)
    count = int((size > ZERO * np.abs(H).max()).sum())
    if count < r - rank:
        W, count = _range_nearby(arm, q, left, rank, r), r - rank
    return np.asarray(left @ W[:, :count])


def _range_nearby(arm: Arm, q: Array, left: Array, rank: int, r: int) -> Array:
    """Directions, in the basis ``left``, that are attainable a little beside q."""
    scale = own_scale(arm)
    move = np.random.default_rng(_SEED).standard_normal(arm.n)
    # radians or lengths of the arm, for directions that a first derivative misses
    move *= 1e-3 / np.linalg.norm(move)
    beside = q + move * scale.columns
    U, _, _ = np.linalg.svd(scale.apply(arm, frame_jacobian(arm, beside), beside))
    W, _, _ = np.linalg.svd(left.T @ U[:, rank:r], full_matrices=False)
    return np.asarray(W)


def _most_definite(Q: Array) -> tuple[float, Array]:
    """Greatest smallest eigenvalue of sum_a u_a Q_a over unit u, and the u that reach it."""
    k, p = Q.shape[0], Q.shape[1]
    if k == 1:
        u = np.array([[1.0], [-1.0]])
        value = np.linalg.eigvalsh(u[:, :, None] * Q)[:, 0]
        return float(value.max()), u[value >= value.max() - 1e-9 * np.abs(Q).max()]
    if p == 1:
        vector = Q[:, 0, 0]
        size = float(np.linalg.norm(vector))
        return size, vector[None] / size
    # The function is concave and of degree one: its ascent has no false maxima above zero.
    rng = np.random.default_rng(_SEED)
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
    """Tell if the tip can stay still, and u lost, along every direction of a kernel.

    Of each way: its configuration (n,), u (m,), and the kernel (n, p).
    """
    columns = own_scale(arm).columns
    parts = []
    for _, _, kernel in ways:
        rng = np.random.default_rng(_SEED)
        mixed = kernel @ rng.standard_normal((kernel.shape[1], kernel.shape[1]))
        parts.append(np.concatenate([kernel, mixed / np.linalg.norm(mixed, axis=0)], axis=1).T)
    of = np.repeat(np.arange(len(ways)), [len(part) for part in parts])
    at = np.array([q for q, _, _ in ways])[of]
    along = np.concatenate(parts)
    u = np.array([u for _, u, _ in ways])[of]
    ends, arrived = _slide(arm, at, u, at + _SLIDE * along * columns)
    far = np.abs((((ends - at) / columns) * along).sum(axis=1)) >= _SLIDE / 2
    return [bool((arrived & far)[of == i].all()) for i in range(len(ways))]


def _slide(arm: Arm, at: Array, u: Array, starts: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Configurations near ``starts`` (N, n) with the tip as at ``at`` (N, n) and J^T u = 0.

    With which of them arrived.
    """
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
        J, H = own_jacobians_and_derivatives(arm, Q)
        F = np.concatenate([error, np.einsum("krj,kr->kj", J, u[moving])], axis=1)
        left = np.abs(F).max(axis=1) > 1e-10
        moving = moving[left]
        if not len(moving):
            break
        curved = np.einsum("kr,krij->kij", u[moving], H[left])
        slope = np.concatenate([J[left], curved], axis=1)
        step = np.linalg.pinv(slope, rcond=1e-6) @ F[left, :, None]
        now[moving] = Q[left] - step[:, :, 0] * scale.columns
    arrived = np.ones(len(starts), dtype=bool)
    arrived[moving] = False
    return now, arrived
