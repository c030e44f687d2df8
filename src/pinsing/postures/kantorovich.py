"""That a true solution is near a computed one, and only one: by the theorem of Kantorovich (1948).

F(q) is what is left of the pose: the position over the length scale, and half the difference of
R and its transpose as a vector, R the rotation that is left. F = 0 there means that the pose is
reached, since R is near the identity. With b at least the norm of the inverse of F', e at least
the length of the Newton step, and K a bound of all second derivatives: where 2 b K e < 1 there is
one zero of F within 2 e, and F' is regular there.

Second derivatives: by two turns the position changes by no more than its distance from the outer
axis, R by no more than one; by a turn and a slide the position by no more than one.
"""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.postures.newton import Solver

_ROUNDING = 1e-13
"""Of F and F', relative to the size of the chain over the length scale; with room."""

POSE = (0, 1, 2, 3, 4, 5)
POSITION = (0, 1, 2)


def radii(solver: Solver, Q: Array) -> Array:
    """Distance (K,) within which a true solution is, in joint space; infinite where not proven.

    Parameters
    ----------
    solver : Solver
        Of the pose.
    Q : (K, n) array
        Computed solutions.
    """
    rows = solver.task.rows
    out = np.full(len(Q), np.inf)
    if not len(Q) or rows not in (POSE, POSITION) or len(rows) != len(solver.free):
        return out
    error, J = solver.linear(Q)
    reach = _reach(solver, Q)
    rounding = _ROUNDING * (1 + reach.max(axis=1) / solver.scale)
    left = np.linalg.norm(error, axis=1) + rounding
    least = np.linalg.svd(J, compute_uv=False)[:, -1] - 4 * left
    bend = _bend(solver, reach)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / least
        step = inverse * left
        good = (least > 0) & (2 * inverse * bend * step < 0.5)
    # The weight of a slide is at most what makes its length one radian: in joint space, over it.
    out[good] = (2 * step / min(1.0, float(solver.weight.min())))[good]
    return out


def bend(solver: Solver, Q: Array) -> Array:
    """Bound (K,) of the second derivatives of the pose by weighted joints.

    It holds near Q (K, n), and wherever joints turn; slides by less than 0.1 m more.
    """
    return _bend(solver, _reach(solver, Q))


def _reach(solver: Solver, Q: Array) -> Array:
    """How far the tip can be from each joint, (K, n)."""
    step = np.linalg.norm(solver.chain.t, axis=1)[1:]
    slide = np.where(solver.chain.prismatic, np.abs(Q) + 0.1, 0.0)
    return np.asarray(np.cumsum((step + slide)[:, ::-1], axis=1)[:, ::-1])


def _bend(solver: Solver, reach: Array) -> Array:
    """Bound (K,) of the second derivative of F by weighted joints."""
    turns = ~np.asarray(solver.chain.prismatic)[solver.free]
    far = reach[:, solver.free] / solver.scale
    n = len(solver.free)
    outer = np.maximum.outer(np.arange(n), np.arange(n))
    both = turns[:, None] & turns[None, :]
    one = turns[:, None] ^ turns[None, :]
    spin = 1.0 if max(solver.task.rows) >= len(POSITION) else 0.0
    if solver.task.at_tip:
        # In the tip's axes a column v_i changes by w_i x v_j - w_j x v_i, with joint j behind it.
        lever = far[:, :, None] + far[:, None, :]
    else:
        lever = far[:, outer]
    size = np.where(both, np.hypot(lever, spin), np.where(one, 1 / solver.scale, 0.0))
    if solver.task.at_tip and not all(solver.task.at_tip):
        size *= np.sqrt(2.0)  # some rows of each
    weight = np.outer(solver.weight, solver.weight)
    return np.asarray(np.linalg.norm(size / weight, axis=(1, 2)))
