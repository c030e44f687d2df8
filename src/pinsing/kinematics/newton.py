"""Starts that came near to a pose and did not reach it: what they say about a search.

Damped Newton steps to a pose, from many starts at once.

That a true solution is near a computed one, and only one: by the theorem of Kantorovich (1948).

F(q) is what is left of the pose: the position over the length scale, and half the difference of
R and its transpose as a vector, R the rotation that is left. F = 0 there means that the pose is
reached, since R is near the identity. With b at least the norm of the inverse of F', e at least
the length of the Newton step, and K a bound of all second derivatives: where 2 b K e < 1 there is
one zero of F within 2 e, and F' is regular there.

Second derivatives: by two turns the position changes by no more than its distance from the outer
axis, R by no more than one; by a turn and a slide the position by no more than one.

That no configuration on a way is singular: proven from the Jacobian of the arm itself.

The singular values of a matrix change by no more than its norm does (Weyl, 1912). With K a bound
of the second derivatives (`pinsing.kinematics.newton`), the Jacobian has rank r within h of a
configuration where ``sigma_r > K h``. Straight pieces are halved until that holds for each from
its middle. No closed form is needed, and families of every codimension count.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pinsing.errors import OptionError
from pinsing.kinematics.jacobian import generic_rank, joint_frames, picked, turn_left
from pinsing.measures import FLOAT_NOISE, SOLVED, Array
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import flatten
from pinsing.robot.task import POSE, POSITION

_BESIDE = 0.1
"""Joint distance within which a start that stalled says nothing more than the solution there."""
_ITERATIONS = 60
_STEP = 0.7


class Solver:
    """Damped Newton steps to one pose for many configurations at once.

    ``held`` (n,) is NaN for joints that are free, ``rotation`` None where it does not count.

    Newton's steps stall where J is nearly singular: what is left of the pose is small along a
    valley. So a small rest means that a solution may be near, not that the pose is out of reach.
    """

    def __init__(
        self,
        arm: Arm,
        position: Array,
        rotation: Array | None = None,
        held: Array | None = None,
    ) -> None:
        OptionError.refuse_if(
            arm.coupling is not None,
            f"{arm.name}: inverse solutions are found for arms whose joints are all "
            "revolute or prismatic, none a mimic",
        )
        self.arm, self.position, self.rotation = arm, position, rotation
        self.chain, self.task, self.scale = flatten(arm), arm.task, arm.length_scale
        self.held = np.full(arm.n, np.nan) if held is None else held
        self.free = np.flatnonzero(np.isnan(self.held))
        self.weight = np.where(arm.prismatic, 1 / self.scale, 1.0)[self.free]
        self._stalled = np.empty((0, arm.n + 1))  # ends (K, n) of starts, and what was left there

    def solve(
        self, Q: Array, steps: int = _ITERATIONS, remember: bool = False
    ) -> tuple[Array, Array]:
        """Return solutions (K, n) reached from starts Q (N, n), and residuals (K,)."""
        # Of others ``doubt`` knows if asked to. A pose whose squares overflow is reached by none.
        with np.errstate(over="ignore", invalid="ignore"):
            Q, left = self._descend(Q.copy(), steps)
        good = left < SOLVED
        if remember:
            # What is left of the pose below which a start all but reached it: radians, or length
            # scales.
            ends = np.column_stack([Q, left])[~good & (left < 1e-5)]
            self._stalled = np.concatenate([self._stalled, ends])[:512]
        return Q[good], left[good]

    def doubt(self, solutions: Array) -> str:
        """Return the doubts that solutions (K, n) are all; empty if there are none."""
        gaps = self.arm.space.wrap(self._stalled[:, None, :-1] - solutions)
        left = self._stalled[(np.abs(gaps).max(axis=2) > _BESIDE).all(axis=1), -1]
        if not len(left):
            return ""
        count = f"{len(left)} start{'s' * (len(left) != 1)}"
        return (
            f"{count} came within {left.min():.1g} of the pose and stalled, as happens next to "
            "singular configurations: there may be a solution there"
        )

    def _descend(self, Q: Array, steps: int) -> tuple[Array, Array]:
        damping = np.full(len(Q), 1e-2)
        error, J = self.linear(Q)
        cost = (error**2).sum(axis=1)
        alive = np.isfinite(cost)
        for _ in range(steps):
            live = np.flatnonzero(alive)
            if not len(live):
                break
            e, A = error[live], J[live]
            step = _damped(A, e, damping[live])
            step *= np.minimum(1.0, _STEP / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
            trial = Q[live].copy()
            trial[:, self.free] += step / self.weight
            new_error, new_J = self.linear(trial)
            new_cost = (new_error**2).sum(axis=1)
            better = new_cost < cost[live]
            rows = live[better]
            Q[rows], error[rows], J[rows] = trial[better], new_error[better], new_J[better]
            cost[rows] = new_cost[better]
            tiny = np.where(cost[live] > 1e-8, 1e-14, 1e-300)
            damping[live] = np.where(
                better, np.maximum(damping[live] * 0.2, tiny), np.maximum(damping[live], 1e-6) * 5
            )
            done = (cost[live] < 1e-28) | (damping[live] > 10.0) | (~better & (cost[live] < 1e-22))
            alive[live[done]] = False
        return Q, np.sqrt(cost)

    def signs(self, Q: Array) -> Array:
        """Signs (N,) of the determinant at configurations (N, n), of a square task."""
        return np.asarray(np.sign(np.linalg.det(self.linear(Q)[1])))

    def linear(self, Q: Array) -> tuple[Array, Array]:
        """Return the residual of the pose (N, m), and its derivatives by the free joints."""
        R, p = joint_frames(self.chain, Q)
        z, R, tip, slides = R[:, :-1, :, 2], R[:, -1], p[:, -1], self.chain.prismatic[:, None]
        # By components: np.cross costs more than all else here.
        (a, b, c), (d, e, f) = (np.moveaxis(x, 2, 0) for x in (z, tip[:, None] - p[:, :-1]))
        moved = np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=2)
        columns = np.where(slides, z, moved) / self.scale, np.where(slides, 0.0, z)
        J = np.concatenate(columns, axis=2).transpose(0, 2, 1)
        error = np.zeros((len(Q), 6))
        error[:, :3] = (self.position - tip) / self.scale
        if self.rotation is not None:
            error[:, 3:] = turn_left(self.task, R, self.rotation)
        wanted = picked(self.task, error[:, :, None], R)[:, :, 0]
        return wanted, picked(self.task, J, R)[:, :, self.free] / self.weight


def _damped(J: Array, e: Array, damping: Array) -> Array:
    """Return steps (N, k) that solve (J'J + damping) step = J'e, for J (N, m, k) and e (N, m)."""
    # J'J is known to rounding of its trace: with less damping J is decomposed itself where
    # singular.
    transposed = J.transpose(0, 2, 1)
    step = (transposed @ e[..., None])[..., 0]
    gram = transposed @ J
    little = damping <= FLOAT_NOISE * np.trace(gram, axis1=1, axis2=2)
    much = np.flatnonzero(~little)
    if len(much):
        added = gram[much] + damping[much][:, None, None] * np.eye(J.shape[2])
        step[much] = np.linalg.solve(added, step[much][..., None])[..., 0]
    rest = np.flatnonzero(little)
    if len(rest):
        u, s, v = np.linalg.svd(J[rest], full_matrices=False)
        along = (u.transpose(0, 2, 1) @ e[rest][..., None])[..., 0]
        along *= s / np.maximum(s * s + damping[rest][:, None], 1e-300)
        step[rest] = (v.transpose(0, 2, 1) @ along[..., None])[..., 0]
    return step


def radii(solver: Solver, Q: Array) -> Array:
    """Distance (K,) in joint space to a true solution near Q (K, n); infinite where not proven."""
    rows = solver.task.rows
    out = np.full(len(Q), np.inf)
    if not len(Q) or rows not in (POSE, POSITION) or len(rows) != len(solver.free):
        return out
    error, J = solver.linear(Q)
    reach = _reach(solver, Q)
    # Of F and F', relative to the size of the chain over the length scale; with room.
    left = np.linalg.norm(error, axis=1) + 1e-13 * (1 + reach.max(axis=1) / solver.scale)
    least = np.linalg.svd(J, compute_uv=False)[:, -1] - 4 * left
    bend = _bend(solver, reach)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / least
        step = inverse * left
        good = (least > 0) & (2 * inverse * bend * step < 0.5)
    # The weight of a slide is at most what makes its length one radian: in joint space, over it.
    out[good] = (2 * step / min(1.0, float(solver.weight.min())))[good]
    return out


def _reach(solver: Solver, Q: Array) -> Array:
    """Return how far the tip can be from each joint, (K, n)."""
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
    return np.asarray(np.linalg.norm(size / np.outer(solver.weight, solver.weight), axis=(1, 2)))


_MOST = 200_000


def regular_way(arm: Arm, path: Array, most: int = _MOST) -> bool:
    """Return True if a polyline (K, n) has the generic rank, proven by ``most`` pieces at most."""
    solver, rank = Solver(arm, np.zeros(3)), generic_rank(arm)
    # Of second derivatives wherever joints turn, and slides by less than 0.1 m more.
    steep = float(_bend(solver, _reach(solver, path)).max())
    ends = np.array(list(pairwise(path)))
    done = 0
    while len(ends):
        done += len(ends)
        a, b = ends[:, 0], ends[:, 1]
        middle = (a + b) / 2
        half = np.linalg.norm((b - a) * solver.weight, axis=1) / 2
        sizes = np.linalg.svd(solver.linear(middle)[1], compute_uv=False)
        open_ = sizes[:, rank - 1] - 1e-12 * sizes[:, 0] <= steep * half
        # Half a piece, radians: where that is not short enough a configuration is as good as
        # singular.
        if done > most or (half[open_] < 1e-8).any():
            return False
        a, b, middle = a[open_], b[open_], middle[open_]
        ends = np.concatenate([np.stack([a, middle], 1), np.stack([middle, b], 1)])
    return True


def one_sheet(arm: Arm, a: Array, b: Array) -> bool:
    """Return True if the tip can leave a pose in the same directions from two configurations."""
    # An arm with fewer joints than pose conditions reaches a surface; where two sheets of it cross,
    # poses near by have only one of the two.
    J = columns(arm, np.stack([a, b]))
    if J.shape[1] <= generic_rank(arm):
        return True
    u, v = (np.linalg.svd(A)[0][:, : generic_rank(arm)] for A in J)
    return bool(np.abs(v - u @ (u.T @ v)).max() < 1e-6)


def columns(arm: Arm, Q: Array) -> Array:
    """Task Jacobians (N, m, n) of a serial arm whose joints are independent; joints weighted."""
    return Solver(arm, np.zeros(3)).linear(Q)[1]
