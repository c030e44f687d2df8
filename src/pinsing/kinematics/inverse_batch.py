"""Inverse solutions of many poses at once: by EAIK where it knows the arm, else by continuation.

Each solution is brought to the arm itself by Newton steps, and kept only if forward kinematics
gives the pose.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pinsing._batch import engine
from pinsing._types import Array, Ints
from pinsing.errors import EngineError, OptionError
from pinsing.kinematics.inverse import decomposed, inverse
from pinsing.kinematics.jacobian import generic_rank, task_jacobian
from pinsing.kinematics.verdict import ROWS
from pinsing.measures import PRACTICAL, ROUNDING
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten

_NEAR = 1e-2
"""Residual from which a few Newton steps lead to a solution, if there is one."""
_BESIDE = 0.05
"""Radians within which a solution continues that of a neighbouring pose."""
_ROWS = 5_000
"""Poses in one call of EAIK: some megabytes."""
Progress = Callable[[int, int], None]


class InverseMany:
    """All inverse solutions on a grid: poses times values of the ``held`` joint, if any."""

    def __init__(self, arm: Arm, held: int | None = None) -> None:
        EngineError.refuse_if(
            not engine.available(),
            f"toolpaths need the compiled kernel: {engine.unavailable_reason()}",
        )
        spare, reaches = arm.n - (held is not None), arm.task.name == "pose"
        reaches = reaches and generic_rank(arm) == 6
        names = _redundant(arm) if reaches and arm.n == 7 else list(arm.joints)
        with_it = "" if held is None else f" with {arm.joints[held]} held"
        free = f"; free (--free) may be one of {', '.join(names)}" * (reaches and arm.n == 7)
        OptionError.refuse_if(
            not reaches or spare != 6,
            f"{arm.name}{with_it} has {spare} free joints for the task {arm.task}: a path of "
            f"poses needs six and the task pose{free}",
        )
        OptionError.refuse_if(
            held is not None and arm.joints[held] not in names,
            f"the other joints of {arm.name}{with_it} do not move the tip in all directions{free}",
        )
        self.arm, self.held = arm, held
        self.free = np.array([j for j in range(arm.n) if j != held])
        self.exact = decomposed(arm, held) is not None

    def solve(
        self,
        position: Array,
        rotation: Array,
        values: Array | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """Return solutions (N, G, S, n) at a grid of poses, NaN where there are fewer than S."""
        # Positions (N, G, 3) and rotations (N, G, 3, 3) in the base frame; ``values`` (G,) of the
        # held joint. ``progress`` counts rows or columns.
        solve = self._decomposed if self.exact else self._continued
        return np.ascontiguousarray(_filled(solve(position, rotation, values, progress)))

    def continued(self, Q: Array, position: Array, rotation: Array) -> Array:
        """Return the solutions at poses (M) beside configurations Q (M, n), all joints free."""
        # NaN where Newton's steps lead to none.
        return self._polished(Q.copy(), position, rotation, 1.0, np.arange(self.arm.n))

    def _verified(self, Q: Array, position: Array, rotation: Array) -> Array:
        """Solutions Q (M, S, n) brought to the poses (M), each once; NaN behind them."""
        flat = self._polished(Q.reshape(-1, self.arm.n), position, rotation)
        return _distinct(flat.reshape(Q.shape), self.arm)

    def _decomposed(
        self, position: Array, rotation: Array, values: Array | None, progress: Progress | None
    ) -> Array:
        N, G = position.shape[:2]
        position, rotation = position.reshape(-1, 3), rotation.reshape(-1, 3, 3)
        nodes = np.arange(N * G).reshape(N, G)
        parts = list(nodes.T)  # another robot for each value of the held joint
        if values is None:
            parts = np.array_split(nodes.ravel(), -(-nodes.size // ROWS))

        def solutions(part: Ints, value: float) -> Array:
            robot = decomposed(self.arm, self.held, value)
            T = np.tile(np.eye(4), (len(part), 1, 1))
            T[:, :3, :3], T[:, :3, 3] = rotation[part], position[part]
            if robot is None:
                return np.full((len(part), 1, self.arm.n), np.nan)
            # Solutions in the sense of least squares are among them: forward kinematics tells.
            counts, every, _ = robot(T)
            Q = np.full((len(part), max(1, counts.max()), self.arm.n), np.nan)
            Q[np.arange(Q.shape[1]) < counts[:, None]] = every
            return self._verified(Q, position[part], rotation[part])

        done, whole = 0, np.empty((nodes.size, 0, self.arm.n))
        with ThreadPoolExecutor(engine.cpu_count()) as pool:
            every = [0.0] * len(parts) if values is None else values
            for part, q in zip(parts, pool.map(solutions, parts, every), strict=True):
                if (slots := q.shape[1]) > whole.shape[1]:
                    wider = np.full((nodes.size, slots, self.arm.n), np.nan)
                    wider[:, : whole.shape[1]], whole = whole, wider
                whole[part, :slots] = q
                done += 1
                if progress is not None:
                    progress(done, len(parts))
        return whole.reshape(N, G, *whole.shape[1:])

    def _continued(
        self, position: Array, rotation: Array, values: Array | None, progress: Progress | None
    ) -> Array:
        """Solve some nodes one by one, and follow their solutions over the grid, both ways."""
        N, G = position.shape[:2]
        T = np.zeros((N, G, 4, 4))
        T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = rotation, position, 1.0
        rows = np.unique(np.linspace(0, N - 1, min(N, 5)).astype(int))
        columns = np.unique(np.linspace(0, G - 1, min(G, 9)).astype(int))
        nodes: list[list[Array]] = [[np.empty((0, self.arm.n))] * G for _ in range(N)]
        for k in rows:
            for i in columns:
                fixed = {} if values is None else {self.arm.joints[self.held or 0]: values[i]}
                nodes[k][i] = np.array(
                    [s.q for s in inverse(self.arm, T[k, i], fixed=fixed) if s.regular]
                ).reshape(-1, self.arm.n)
        slots = 2 * max(1, max(len(q) for row in nodes for q in row))
        Q = np.full((N, G, slots, self.arm.n), np.nan)
        for k, row in enumerate(nodes):
            for i, q in enumerate(row):
                Q[k, i, : len(q)] = q

        def follow(to: tuple[Any, ...], source: Array) -> None:
            """Continue solutions (M, S, n) of neighbours to the nodes ``to`` that lack them."""
            source, there = _filled(source).copy(), _filled(Q[to])
            known = _gaps(source[:, :, None], there[:, None], self.arm).min(axis=2) < _BESIDE
            source[known] = np.nan
            lacking = np.isfinite(source[..., 0]).any(axis=1)
            to, source = tuple(x[lacking] for x in to), source[lacking]
            if values is not None:
                here = np.broadcast_to(values, (N, G))[to]
                source[..., self.held] = np.where(
                    np.isfinite(source[..., 0]), here[:, None], np.nan
                )
            flat = source.reshape(-1, self.arm.n)
            moved = self._polished(flat, position[to], rotation[to], near=1.0)
            both = np.concatenate([Q[to], moved.reshape(source.shape)], axis=1)
            Q[to] = _distinct(both, self.arm)[..., :slots, :]

        for sweep in (range(1, 2 * G), range(2 * G, 0, -1)):  # round the circle, both ways
            for i in sweep:
                to = i % G
                near = (i - 1) % G if sweep.step > 0 else (i + 1) % G
                if values is None or abs(to - near) == 1:
                    follow((rows, np.full(len(rows), to)), Q[rows, near])
        every = np.arange(G)
        for sweep in (range(1, N), range(N - 2, -1, -1)):
            for k in sweep:
                follow((np.full(G, k), every), Q[k - sweep.step])
                if progress is not None:
                    progress(k, N)
        flat = Q.reshape(-1, slots, self.arm.n)
        return self._verified(flat, position.reshape(-1, 3), rotation.reshape(-1, 3, 3)).reshape(
            Q.shape
        )

    def _polished(
        self,
        Q: Array,
        position: Array,
        rotation: Array,
        near: float = _NEAR,
        free: Ints | None = None,
    ) -> Array:
        """Move Q (M S, n) to the poses (M), in place, by Newton steps; NaN where that fails."""
        # Least squares near no solution stay where they are, and are none.
        arm, free, slower = self.arm, self.free if free is None else free, near / _NEAR
        chain, moving = flatten(arm), np.isin(np.arange(arm.n), free)
        poses = map(np.ascontiguousarray, (position, rotation))
        how = arm.length_scale, ROUNDING, near, slower, Q, engine.cpu_count()
        engine.module().to_poses(chain.R, chain.t, chain.prismatic, moving, *poses, *how)
        return Q


def _filled(Q: Array) -> Array:
    """Return nodes (..., S, n) without the slots at the end that none of them needs."""
    return Q[..., : max(1, int(np.isfinite(Q[..., 0]).sum(axis=-1).max(initial=0))), :]


def _redundant(arm: Arm) -> list[str]:
    """Return the joints that may be held while the others move the tip in all directions."""
    J = task_jacobian(arm, np.cos(1.0 + np.arange(arm.n)))
    others = [np.linalg.svd(np.delete(J, j, axis=1), compute_uv=False) for j in range(arm.n)]
    return [j for j, sigma in zip(arm.joints, others, strict=True) if sigma[-1] > PRACTICAL]


def _distinct(Q: Array, arm: Arm) -> Array:
    """Solutions Q (M, S, n), in place, within limits where whole turns allow it, each once."""
    how = *arm.space.span, ROUNDING, PRACTICAL, engine.cpu_count()
    engine.module().distinct(Q, arm.space.prismatic, *how)
    return Q


def _gaps(a: Array, b: Array, arm: Arm) -> Array:
    """Largest difference of joint values a and b (..., n), whole turns aside; inf beside NaN."""
    gap = a - b
    turns = np.where(arm.prismatic, 0.0, np.rint(gap / (2 * np.pi)))
    return np.asarray(np.nan_to_num(np.abs(gap - 2 * np.pi * turns).max(axis=-1), nan=np.inf))
