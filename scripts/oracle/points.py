"""Singular configurations of a chain by Newton's method alone: nothing of pinsing's search is used.

A configuration q is singular where some U of orthonormal columns, one more than the directions
that are always missing, has J(q)^T U = 0. That is solved for q and U from random starts, and from
starts with joints at multiples of 90 degrees that stay there or not.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from oracle.chains import Spec

Array = npt.NDArray[np.float64]

_ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")
_NAMED = {"pose": range(6), "position": range(3), "orientation": range(3, 6)}
_STEPS, _FLAT, _LONGEST = 40, 1e-9, 0.7
_SINGULAR = 1e-11
"""Ratio of a singular configuration."""


def jacobians(spec: Spec, q: npt.NDArray) -> npt.NDArray:
    """Task Jacobians (N, rows, n) at q (N, n), from the table; complex numbers pass through."""
    count, n = q.shape
    R = np.broadcast_to(np.eye(3, dtype=q.dtype), (count, 3, 3))
    p = np.zeros((count, 3), dtype=q.dtype)
    axes, places = [], []
    for i, row in enumerate(spec.rows):
        turn = np.radians(row.theta) + (0.0 * q[:, i] if row.slides else q[:, i])
        c, s, zero = np.cos(turn), np.sin(turn), np.zeros_like(turn)
        axes.append(R[:, :, 2])
        places.append(p)
        Rz = np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1], axis=-1)
        R = R @ Rz.reshape(count, 3, 3)
        p = p + row.a * R[:, :, 0] + row.d * R[:, :, 2]
        if row.slides:
            p = p + q[:, i, None] * R[:, :, 2]
        ca, sa = np.cos(np.radians(row.alpha)), np.sin(np.radians(row.alpha))
        R = R @ np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    J = np.zeros((count, 6, n), dtype=q.dtype)
    for i, row in enumerate(spec.rows):
        if row.slides:
            J[:, :3, i] = axes[i]
        else:
            J[:, :3, i], J[:, 3:, i] = np.cross(axes[i], p - places[i]), axes[i]
    if spec.task == "tool-axis":  # turns about the tip's x and y
        return np.concatenate([J[:, :3], np.swapaxes(R[:, :, :2], 1, 2) @ J[:, 3:]], axis=1)
    rows = _NAMED.get(spec.task) or [_ROWS.index(name) for name in spec.task.split(",")]
    return J[:, list(rows)]


def ratios(spec: Spec, q: Array, rank: int) -> Array:
    """sigma_rank at q (N, n), over what sigma_1 is at random configurations."""
    sizes = np.linalg.svd(jacobians(spec, q), compute_uv=False)[:, rank - 1]
    return np.asarray(sizes / _at_random(spec)[:, 0].max())


def generic_rank(spec: Spec) -> int:
    """Largest rank at random configurations."""
    sizes = _at_random(spec)
    return int((sizes > 1e-9 * sizes[:, :1]).sum(axis=-1).max())


def _at_random(spec: Spec) -> Array:
    """Singular values (6, k) at random configurations."""
    q = np.random.default_rng(5).uniform(-3, 3, (6, len(spec.rows)))
    return np.asarray(np.linalg.svd(jacobians(spec, q), compute_uv=False))


def singular_points(spec: Spec, seed: int, starts: int = 90) -> Array:
    """Singular configurations (k, n) that random starts, and such at right angles, lead to."""
    rng = np.random.default_rng([7, seed])
    n, rank = len(spec.rows), generic_rank(spec)
    if rank == 0:
        return np.zeros((0, n))
    slides = np.array([row.slides for row in spec.rows])
    q = rng.uniform(-np.pi, np.pi, (3 * starts, n))
    q[:, slides] /= 5
    right = rng.integers(0, 4, q.shape) * (np.pi / 2)
    right[:, slides] = 0.0
    special = rng.random(q.shape) < rng.uniform(0.15, 0.8, (len(q), 1))
    special[:starts] = False
    q = np.where(special, right, q)
    held = special.copy()
    held[starts : 2 * starts] = False
    q = _newton(spec, q, ~held, rank)
    q = np.concatenate([q, np.where(special, right, rng.uniform(-np.pi, np.pi, q.shape))[starts:]])
    q = q[np.isfinite(q).all(axis=-1) & (np.abs(q) < 50).all(axis=-1)]
    return np.asarray(q[ratios(spec, q, rank) < _SINGULAR])


def _newton(spec: Spec, q: Array, free: npt.NDArray[np.bool_], rank: int) -> Array:
    """Solve J(q)^T U = 0 and U^T U = 1, by steps of least norm with a limited length."""
    count, n = q.shape
    J = jacobians(spec, q)
    rows = J.shape[1]
    k = rows - rank + 1
    U = np.linalg.svd(J)[0][:, :, rows - k :]
    pairs = [(a, b) for a in range(k) for b in range(a, k)]
    for _ in range(_STEPS):
        H = np.empty((count, n, rows, n))  # by the complex step: all digits
        for j in range(n):
            step = q.astype(complex)
            step[:, j] += 1e-30j
            H[:, j] = jacobians(spec, step).imag / 1e-30
        F = np.concatenate(
            [
                np.einsum("krj,krc->kcj", J, U).reshape(count, -1),
                np.stack([(U[:, :, a] * U[:, :, b]).sum(-1) - (a == b) for a, b in pairs], axis=-1),
            ],
            axis=-1,
        )
        A = np.zeros((count, k * n + len(pairs), n + k * rows))
        A[:, : k * n, :n] = np.einsum("kirj,krc->kcji", H, U).reshape(count, k * n, n)
        A[:, : k * n, :n] *= free[:, None, :]
        for c in range(k):
            A[:, c * n : (c + 1) * n, n + c * rows : n + (c + 1) * rows] = np.swapaxes(J, 1, 2)
        for at, (a, b) in enumerate(pairs, k * n):
            A[:, at, n + a * rows : n + (a + 1) * rows] += U[:, :, b]
            A[:, at, n + b * rows : n + (b + 1) * rows] += U[:, :, a]
        bad = ~np.isfinite(A).all(axis=(1, 2))
        A[bad], F[bad] = 0.0, 0.0
        move = -np.einsum("kij,kj->ki", np.linalg.pinv(A, rcond=_FLAT), F)
        size = np.linalg.norm(move[:, :n], axis=-1, keepdims=True)
        move *= np.minimum(1.0, _LONGEST / np.maximum(size, 1e-300))
        q = q + np.where(free, move[:, :n], 0.0)
        U = U + np.swapaxes(move[:, n:].reshape(count, k, rows), 1, 2)
        J = jacobians(spec, q)
    return q
