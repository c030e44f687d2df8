"""Joint speeds, accelerations, jumps and limits along a trajectory, and what tip speeds cost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinsing._types import Array, Bool
from pinsing.kinematics.jacobian import generic_rank, singular_values, task_jacobians
from pinsing.robot.arm import Arm

_MOST = 200
_LONG_JUMP, _SHORT_JUMP = np.pi, 0.2
_SLACK = 1e-9


@dataclass(frozen=True)
class Excess:
    """A stretch of time in which a joint exceeds something.

    Attributes
    ----------
    joint : str
        Name of the joint.
    t, t_end : float
        From the first to the last sample (step) at which it does.
    worst : float
        The largest value, of magnitude; of a position outside its limits the value itself.
    t_worst : float
        When.
    limit : float
        What it exceeds.
    """

    joint: str
    t: float
    t_end: float
    worst: float
    t_worst: float
    limit: float


class Speeds:
    """Gathers what a trajectory, fed in pieces, asks of the joints."""

    def __init__(
        self, arm: Arm, tip_speed: float, accelerations: Array | None, timed: bool
    ) -> None:
        self.arm, self.timed, self.accelerations = arm, timed, accelerations
        self.limits = limits_of(arm)
        self.tip_speed = tip_speed
        self.rank = generic_rank(arm)
        self._found: dict[str, list[Excess]] = {}
        self._open: dict[tuple[str, int], int] = {}

    def found(self, kind: str) -> tuple[Excess, ...]:
        """Excesses of a kind, in the order of time."""
        return tuple(sorted(self._found.get(kind, []), key=lambda e: (e.t, e.joint)))

    def feed(self, t: Array, Q: Array, first: int, last: int) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        own = slice(first, last)
        low, high = self.arm.lower - _SLACK, self.arm.upper + _SLACK
        out = np.maximum(Q[own] - high, low - Q[own])
        limit = np.where(Q[own] > high, self.arm.upper, self.arm.lower)
        self._keep("outside", t[own], t[own], out, Q[own], limit, out > 0)
        self._cost(t[own], Q[own])
        begin = max(first, 1)  # steps belong to the sample at which they end
        if last <= begin:
            return
        step = np.diff(Q, axis=0)[begin - 1 : last - 1]
        before, after = t[begin - 1 : last - 1], t[begin:last]
        usual = np.median(np.abs(step), axis=0)
        far = np.where(self.arm.prismatic, self.arm.length_scale, 1.0)
        bound = np.maximum(_SHORT_JUMP * far, 20.0 * usual) if len(step) > 8 else np.inf * far
        bound = np.minimum(bound, np.where(self.arm.prismatic, np.inf, _LONG_JUMP))
        jump = np.abs(step) > bound
        limits = np.broadcast_to(bound, step.shape)
        self._keep("jump", before, after, np.abs(step), np.abs(step), limits, jump)
        if not self.timed:
            return
        speed = np.abs(step) / (after - before)[:, None]
        limits = np.broadcast_to(self.limits, speed.shape)
        over = speed > limits * (1 + 1e-9)
        self._keep("speed", before, after, speed / limits, speed, limits, over)
        if self.accelerations is not None and begin >= 1 and last - begin >= 1:
            self._bend(t, Q, begin, last)

    def _bend(self, t: Array, Q: Array, begin: int, last: int) -> None:
        assert self.accelerations is not None
        begin = max(begin, 2)
        if last <= begin:
            return
        rate = np.diff(Q, axis=0) / np.diff(t)[:, None]
        middle = (t[1:] + t[:-1]) / 2
        bend = np.abs(np.diff(rate, axis=0) / np.diff(middle)[:, None])[begin - 2 : last - 2]
        limits = np.broadcast_to(self.accelerations, bend.shape)
        at = t[begin - 1 : last - 1]
        self._keep("acceleration", at, at, bend / limits, bend, limits, bend > limits * (1 + 1e-9))

    def _cost(self, t: Array, Q: Array) -> None:
        """Where the worst tip velocity of the given size needs more than a joint's limit.

        Joint speeds for it are those of the pseudoinverse, the smallest there are; joint j needs
        at most the length of row j of J^+ for a unit velocity.
        """
        if not np.isfinite(self.limits).any() or self.rank == 0:
            return
        sigma = np.asarray(singular_values(self.arm, Q))[:, self.rank - 1]
        hard = np.flatnonzero(self.tip_speed > sigma * self.limits.min() * (1 - 1e-9))
        worst = np.zeros(Q.shape)
        for part in np.array_split(hard, max(1, len(hard) // 4096)):
            if len(part):
                J = task_jacobians(self.arm, Q[part])
                rows = np.linalg.norm(np.linalg.pinv(J, rcond=1e-9), axis=2)
                worst[part] = rows * self.tip_speed
                # At a singularity some velocity cannot be had at any speed.
                lost = sigma[part] <= 1e-9 * np.linalg.norm(J, axis=(1, 2))
                u = np.linalg.svd(J[lost])[2][:, self.rank - 1] if lost.any() else None
                if u is not None:
                    worst[part[lost]] = np.where(np.abs(u) > 1e-9, np.inf, worst[part[lost]])
        limits = np.broadcast_to(self.limits, worst.shape)
        with np.errstate(invalid="ignore"):
            share = np.nan_to_num(worst / limits, nan=0.0, posinf=np.inf)
        self._keep("cost", t, t, share, worst, limits, worst > limits)

    def _keep(
        self, kind: str, t: Array, t_end: Array, size: Array, value: Array, limit: Array, bad: Bool
    ) -> None:
        """Turn runs of bad entries (K, n) into excesses, joined with those of the piece before."""
        listed = self._found.setdefault(kind, [])
        for j in range(self.arm.n):
            was = self._open.pop((kind, j), None)
            rows = np.flatnonzero(bad[:, j])
            if not len(rows):
                continue
            for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
                k = int(run[np.argmax(size[run, j])])
                new = Excess(
                    self.arm.joints[j],
                    float(t[run[0]]),
                    float(t_end[run[-1]]),
                    float(value[k, j]),
                    float(t[k]),
                    float(limit[k, j]),
                )
                if run[0] == 0 and was is not None:
                    old = listed[was]
                    larger = abs(new.worst - new.limit) > abs(old.worst - old.limit)
                    listed[was] = replace(new if larger else old, t=old.t, t_end=new.t_end)
                    index = was
                elif len(listed) < _MOST:
                    listed.append(new)
                    index = len(listed) - 1
                else:
                    continue
                if run[-1] == len(bad) - 1:
                    self._open[kind, j] = index


def limits_of(arm: Arm) -> Array:
    """Speed limits (n,) of the joints, radians or metres per second; infinite where none are known.

    A description writes no limit as zero or as a very large number; of arms with mimic joints,
    whose limits belong to other joints too, none are taken.
    """
    limits = np.asarray(arm.model.velocityLimit, dtype=float)
    if arm.coupling is not None or limits.shape != (arm.n,):
        return np.full(arm.n, np.inf)
    return np.where((limits > 0) & (limits < 1e6), limits, np.inf)
