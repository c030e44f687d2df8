"""Where a search for inverse solutions starts: at random, and at mirror images of those found."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.postures.exact_chain import turns
from pinsing.postures.newton import Solver
from pinsing.robot.arm import Arm

_WIDE = 4
_FREE = 1e-9


def drawn(
    arm: Arm, held: Array, count: int, rng: np.random.Generator, solver: Solver, lacking: int
) -> Array:
    """Random configurations (count, n) over whole circles: limits are judged after.

    Where solutions with one sign of the determinant lack, all starts have that sign, if it can be.
    """
    Q = arm.space.sample(count * (_WIDE if lacking else 1), rng, True)
    Q = np.where(np.isnan(held), Q, held)
    if lacking:
        other = solver.signs(Q) * lacking <= 0
        Q = Q[np.argsort(other, kind="stable")][:count]
    return Q


def mirrored(solver: Solver, Q: Array) -> Array:
    """Mirror images (K, n) of configurations (N, n), near which other solutions often are.

    A wrist: of three axes the middle one takes the other value that leaves the angle of the outer
    ones, and these follow, so that the rotation stays. An elbow: a joint takes the other value
    that leaves the distance of its neighbours; the one before brings the farther one back into
    its direction, and the one after takes the turn back.
    """
    n, free = Q.shape[1], set(solver.free.tolist())
    turning = [j in free and not solver.chain.prismatic[j] for j in range(n)]
    out = [Q[:0]]
    for j in range(1, n - 1):
        if all(turning[j - 1 : j + 2]):
            out += [f(solver, Q, j) for f in (_wrist, _elbow)]
    return np.concatenate(out)


def _angle(v: Array) -> Array:
    return np.asarray(np.arctan2(v[..., 1], v[..., 0]))


def _wrist(solver: Solver, Q: Array, j: int) -> Array:
    A, B = solver.chain.R[j], solver.chain.R[j + 1]
    a = A[2, 0] * B[0, 2] + A[2, 1] * B[1, 2]
    b = A[2, 1] * B[0, 2] - A[2, 0] * B[1, 2]
    if np.hypot(a, b) < _FREE:
        return Q[:0]
    X = Q.copy()
    X[:, j] = 2 * np.arctan2(b, a) - Q[:, j]
    was, now = (A @ turns(x[:, j]) @ B for x in (Q, X))
    X[:, j - 1] += _angle(was[:, :2, 2]) - _angle(now[:, :2, 2])
    X[:, j + 1] += _angle(now[:, 2, :2]) - _angle(was[:, 2, :2])
    return X


def _elbow(solver: Solver, Q: Array, j: int) -> Array:
    C, inner, outer = solver.chain.R[j], solver.chain.t[j], solver.chain.t[j + 1]
    r = C.T @ inner
    a, b = r[:2] @ outer[:2], r[1] * outer[0] - r[0] * outer[1]
    if np.hypot(a, b) < _FREE * solver.scale**2:
        return Q[:0]
    X = Q.copy()
    X[:, j] = 2 * np.arctan2(b, a) - Q[:, j]
    was, now = (inner + turns(x[:, j]) @ outer @ C.T for x in (Q, X))
    X[:, j - 1] += _angle(was) - _angle(now)
    before, after = (np.sign(solver.chain.R[k][2, 2]) for k in (j, j + 1))
    bent = before * (X[:, j - 1] - Q[:, j - 1]) + X[:, j] - Q[:, j]
    X[:, j + 1] -= after * bent
    return X
