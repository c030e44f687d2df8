"""Damped Newton steps to a pose, from many starts at once."""

from __future__ import annotations

import numpy as np

from pinsing._batch.chain import FlatChain
from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
from pinsing.errors import OptionError
from pinsing.kinematics.task_rows import picked, turn_left
from pinsing.postures.stalled import Stalled
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.task import Task

_ITERATIONS = 60
_STEP = 0.7
_CLOSE = 1e-11
_FLOOR = 1e-13
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Solver:
    """Damped Newton steps for many configurations at once."""

    chain: FlatChain
    position: Array
    rotation: Array | None
    task: Task
    free: Ints
    scale: float
    weight: Array

    @classmethod
    def of(
        cls, arm: Arm, position: Array, rotation: Array | None, held: Array, free: Ints
    ) -> Solver:
        """The solver of one pose, some joints of which are held.

        Raises
        ------
        OptionError
            If joints of the arm follow others.
        """
        if arm.coupling is not None:
            raise OptionError(
                f"{arm.name}: inverse solutions are found for arms whose joints are all "
                "independent turns and slides"
            )
        plain = flatten(arm)
        chain = FlatChain(plain.R, plain.t, plain.prismatic)
        scale = arm.length_scale
        weight = np.where(arm.prismatic, 1 / scale, 1.0)[free]
        return cls(chain, position, rotation, arm.task, free, scale, weight)

    def solve(
        self, Q: Array, steps: int = _ITERATIONS, stalled: Stalled | None = None
    ) -> tuple[Array, Array]:
        """Where starts Q (N, n) lead: those that reach the pose (K, n), and what is left (K,).

        Those that do not are told to ``stalled``. A pose too far away for its squares to be
        numbers is reached by none.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            Q, left = self._descend(Q.copy(), steps)
        good = left < _CLOSE
        if stalled is not None:
            stalled.add(Q[~good], left[~good])
        return Q[good], left[good]

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
            long = np.abs(step).max(axis=1)
            step *= np.minimum(1.0, _STEP / np.maximum(long, 1e-300))[:, None]
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
        """What is left of the pose (N, m), and its derivatives by the weighted free joints."""
        N, n = Q.shape
        C, t = self.chain.R, self.chain.t
        R, p = np.broadcast_to(C[0], (N, 3, 3)), np.broadcast_to(t[0], (N, 3))
        z, o = np.empty((n, N, 3)), np.empty((n, N, 3))
        for j in range(n):
            z[j], o[j] = R[:, :, 2], p
            if self.chain.prismatic[j]:
                p = p + R[:, :, 2] * Q[:, j, None]
            else:
                c, s = np.cos(Q[:, j])[:, None], np.sin(Q[:, j])[:, None]
                x, y = R[:, :, 0], R[:, :, 1]
                R = np.stack([x * c + y * s, y * c - x * s, R[:, :, 2]], axis=2)
            p = p + R @ t[j + 1]
            R = R @ C[j + 1]
        J = np.zeros((N, 6, n))
        # By components: np.cross costs more than all else here.
        (a, b, c), (d, e, f) = np.moveaxis(z, 2, 0), np.moveaxis(p - o, 2, 0)
        moved = np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=2)
        slides = np.asarray(self.chain.prismatic, dtype=bool)[:, None, None]
        J[:, :3] = np.where(slides, z, moved).transpose(1, 2, 0)
        J[:, 3:] = np.where(slides, 0.0, z).transpose(1, 2, 0)
        error = np.zeros((N, 6))
        error[:, :3] = (self.position - p) / self.scale
        if self.rotation is not None:
            error[:, 3:] = turn_left(self.task, R, self.rotation)
        J[:, :3] /= self.scale
        wanted = picked(self.task, error[:, :, None], R)[:, :, 0]
        return wanted, picked(self.task, J, R)[:, :, self.free] / self.weight


def _damped(J: Array, e: Array, damping: Array) -> Array:
    """Steps (N, k) that solve (J'J + damping) step = J'e, for J (N, m, k) and e (N, m).

    J'J is known to rounding of its trace. With less damping than that it may have no inverse
    where J is singular: there J is taken apart itself.
    """
    transposed = J.transpose(0, 2, 1)
    step = (transposed @ e[..., None])[..., 0]
    gram = transposed @ J
    little = damping <= _FLOOR * np.trace(gram, axis1=1, axis2=2)
    much = np.flatnonzero(~little)
    if len(much):
        added = gram[much] + damping[much][:, None, None] * np.eye(J.shape[2])
        step[much] = np.linalg.solve(added, step[much][..., None])[..., 0]
    rest = np.flatnonzero(little)
    if len(rest):
        u, s, v = np.linalg.svd(J[rest], full_matrices=False)
        along = (u.transpose(0, 2, 1) @ e[rest][..., None])[..., 0]
        along *= s / np.maximum(s * s + damping[rest][:, None], _TINY)
        step[rest] = (v.transpose(0, 2, 1) @ along[..., None])[..., 0]
    return step
