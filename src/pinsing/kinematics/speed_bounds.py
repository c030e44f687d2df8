"""Joint speeds that tip motions take anywhere in a box of configurations, bounded with proof.

With the Jacobian J(q) = J + D, and A a right inverse of J, of a square one the inverse, joint
velocities ``z = A X x - A D z`` make the twist x, which X(q) takes to the point that J(q) is for:
those of a redundant arm are no others than ``A (J(q) A)^(-1) X x``, so that limits which they keep
can be kept. With ``A D = E = E1 + E2 + E3`` (the first order, the second, the rest), put into
itself twice this is ``z = b - E1 b + P b - P E z + E1 (E2 + E3) z - E3 z`` where ``b = A X x`` and
``P = E1^2 - E2``, of size Q. Its first and second order are looked at, and where ``F + T y <= y``
for a bound F of what is known and T the sizes of the others, all z are at most y, and J(q) A is
nowhere singular (the theorem of Perron and Frobenius, as in Krawczyk's method).
J is written in the axes of a link in the middle and, where the task has all rotations that the arm
makes, of twists at a point of that link: columns then change by the joints between alone.
Each product of floats is charged with ``NOISE`` times the sum of the sizes of its terms, which
covers a thousand operations, and A with twice what J A misses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinsing._batch import engine
from pinsing.errors import EngineError, OptionError
from pinsing.kinematics.batch import random_turns, tip_rotations
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.kinematics.tip_speed import SpeedJudge
from pinsing.measures import NOISE, Array, Bool
from pinsing.robot.chain import flatten

_ROUNDS, _MORE_ROUNDS, _CLOSE = 2, 13, 0.9
"""Choices of a right inverse that are looked at, and how many where a share is above the last; of
one joint to spare the best one is known there."""


@dataclass(frozen=True, eq=False)
class BoxSpeeds:
    """Shares of the joint speed limits in boxes."""

    center: Array  # (N,), above 1 a limit is exceeded
    first: Array  # (N,), in all of the box by the first order
    most: Array  # (N,), proven for all of the box; infinite where not, or over 1
    pull: Array  # (N, n), how much of the bound is due to the width of each joint


class SpeedBounds:
    """Bounds the joint speeds that tip motions (m/s and rad/s, any directions) of one arm take.

    ``travel`` (n,): half the range of prismatic joints, metres. ``moving`` (n,): joints that the
    shares depend on.
    """

    def __init__(
        self, judge: SpeedJudge, tip_speed: float, turn_speed: float, travel: Array
    ) -> None:
        EngineError.refuse_if(
            not engine.available(), f"zones need the compiled kernel: {engine.unavailable_reason()}"
        )
        self.judge, arm = judge, judge.arm
        self.v, self.w = tip_speed, turn_speed
        chain, task = flatten(arm), arm.task
        OptionError.refuse_if(
            arm.coupling is not None, f"{arm.name} has mimic joints: their speeds are not judged"
        )
        self.axis = task.tool_axis if task.at_tip else None
        OptionError.refuse_if(
            task.at_tip and (self.axis is None or len(task.translation) != 3),
            f"task {task}: give one with rows in base axes, or tool-axis",
        )
        # Rows in base axes; a turn about the tool's axis is a joint of its own, without a limit.
        rows = np.zeros((6, len(task.rows)))
        rows[list(task.rows), range(len(task.rows))] = 1.0
        self.rows = (
            np.eye(6) if self.axis is not None else np.ascontiguousarray((rows @ judge.basis).T)
        )
        self.linear: Bool = np.asarray(self.rows[:, :3].any(axis=1))
        axes = frame_jacobians(arm, random_turns(arm, 4))[:, 3:]
        self._require_turnable(task.name, axes)
        angular = self.rows[~self.linear, 3:]
        self.still = bool(np.abs(axes - angular.T @ (angular @ axes)).max(initial=0.0) <= NOISE)
        steps = np.linalg.norm(chain.t, axis=1) + np.append(0.0, np.where(arm.prismatic, travel, 0))
        reach = np.cumsum(steps[::-1])[::-1][1:]  # from each joint to the tip
        across = np.linalg.norm(chain.t[1:, :2], axis=1) + reach - steps[1:]
        self.far = np.append(np.where(arm.prismatic, 1.0, across), [0.0] * (self.axis is not None))
        count, most = len(self.far), engine.module().SPEED_COLUMNS
        OptionError.refuse_if(count > most, f"zones: an arm may have {most} joints, not {count}")
        self.turns: Bool = np.append(~arm.prismatic, np.ones(int(self.axis is not None), bool))
        self.middle = (count - 1) // 2
        self.moving: Bool = np.ones(arm.n, dtype=bool)
        self.moving[0] = False
        alone = self.axis is None and (arm.prismatic[-1] or self.far[-1] <= NOISE / 10)
        self.moving[-1] &= not alone or count == 1

    def _require_turnable(self, task: str, axes: Array) -> None:
        """Raise unless rotations by the joints leave the rows of the task among themselves."""
        for block in (self.rows[self.linear, :3], self.rows[~self.linear, 3:]):
            turned = np.cross(np.swapaxes(axes, 1, 2)[:, :, None], block)
            OptionError.refuse_if(
                np.abs(turned - turned @ block.T @ block).max(initial=0.0) > NOISE,
                f"the rows of the task {task} turn with the arm: give pose",
            )

    def jacobians(self, Q: Array) -> Array:
        """Jacobians (N, 6, k), the turn about the tool's axis as the last column."""
        J = frame_jacobians(self.judge.arm, Q)
        if self.axis is None:
            return J
        spin = tip_rotations(self.judge.arm, Q)[:, :, self.axis]
        return np.concatenate([J, np.concatenate([0 * spin, spin], axis=1)[:, :, None]], axis=2)

    def of(self, C: Array, R: Array) -> BoxSpeeds:
        """Shares in boxes of centres C (N, n) and half widths R (N, n)."""
        found = self._of(C, R, _ROUNDS)
        # Speeds that are least at the centre change more than others do in all of a wide box.
        close = np.flatnonzero((found.most > 1) & (found.center > _CLOSE))
        spare = len(self.far) - len(self.rows)
        if spare and len(close):
            closer = self._of(C[close], R[close], _MORE_ROUNDS if spare > 1 else 0)
            for was, now in zip(vars(found).values(), vars(closer).values(), strict=True):
                was[close] = now
        return found

    def _of(self, C: Array, R: Array, rounds: int) -> BoxSpeeds:
        out, speeds = np.empty((len(C), 3 + C.shape[1])), [self.v, self.w]
        engine.module().joint_speeds(
            *(self.rows, self.linear, self.judge.limits, self.far, self.turns, self.moving),
            *(speeds, self.middle, rounds, self.still, self.jacobians(C), R, out),
            *(engine.isa_names()[-1], engine.cpu_count()),
        )
        return BoxSpeeds(out[:, 0], out[:, 1], out[:, 2], out[:, 3:])


def sums_behind(x: Array) -> Array:
    """Sums (N, k) of what stands behind each place of x (N, k)."""
    return np.asarray(np.cumsum(x[:, ::-1], axis=1)[:, ::-1] - x)
