"""Boundary or interior where one motion is lost and the form of second order is clear, at once.

What these mean is in ``second_order``. With u the lost direction, N the self-motions and
B_ij = u . dJ_i / dq_j, the form Q = sym(N^T B N) is clear where its extreme eigenvalues, or for
a vanishing Q the norm of B N, are no rounding.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from pinsing._batch import second_orders
from pinsing._types import Array
from pinsing.kinematics.batch import batch
from pinsing.kinematics.engine import PINOCCHIO
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.own_scale import own_scale
from pinsing.kinematics.verdict import SINGULAR_RTOL, generic_rank, task_size
from pinsing.robot.arm import Arm

Kind = Literal["boundary", "interior", "undecided"]

ZERO = 1e-7
"""Entries of second order, relative to the largest of dJ/dq, that count as zero."""
UNDECIDED: Kind = "undecided"
_SHARED = 1_000
"""Configurations from which on they are shared out among threads."""


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
    if alone or not second_orders.covered(arm.n, len(rows)):
        return None
    return second_orders.second_orders(
        on.own_chain(),
        Q / own_scale(arm).columns,
        rows=rows,
        zero=SINGULAR_RTOL,
        size=task_size(arm),
        threads=1 if len(Q) < _SHARED else None,
        isa=on.engine,
    )


def _told(arm: Arm, Q: Array) -> Array:
    """What `pinsing._batch.second_orders` tells of Q (N, n), all rows being reached in general."""
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
