"""Tip speeds that the joint speed limits allow in every direction at a configuration.

Joint velocities within their limits ``|dq_j| <= c_j`` give the twists of a zonotope: the x with
``|y . x| <= h(y) = sum_j c_j |y . J_j|`` for the normals y of its facets, each orthogonal to m - 1
columns of J (P. McMullen, "On zonotopes", Trans. AMS 159 (1971)). A twist with a linear part of
length v and an angular part of length w in any directions stays inside exactly if
``v |y_v| + w |y_w| <= h(y)`` for all of them. Of a square J the normals are the rows of its
inverse, one for each joint; of a redundant arm a facet belongs to the joints that are at their
limits on it.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from pinsing.description.urdf import DEFAULT_EFFORT, DEFAULT_VELOCITY
from pinsing.errors import OptionError
from pinsing.interface import checked
from pinsing.kinematics.jacobian import (
    SINGULAR_RTOL,
    frame_jacobians,
    generic_rank,
    generic_task,
    own_scale,
    task_rows,
)
from pinsing.measures import Array, ArrayLike, Bool
from pinsing.robot.arm import Arm

TIP_SPEED, TURN_SPEED = 0.25, 0.5
"""Tip speeds that are judged by default, m/s and rad/s: the first is the reduced speed of
ISO 10218-1."""


@dataclass(frozen=True, eq=False)
class TipSpeeds:
    """Tip speeds that the joint speed limits allow in every direction at one configuration.

    Attributes
    ----------
    linear : float
        m/s, with the orientation held if the task has rows of it; infinite if the task has no
        translation.
    linear_joints : tuple of str
        The limiting joint; of a redundant arm those that are at their limits together; none
        where the speed is infinite.
    linear_direction : (3,) array
        The direction in which no more is possible, base axes (tip axes for a task in these).
    angular, angular_joints, angular_direction
        The same for rotations, rad/s, with the position held.
    tip_speed, turn_speed : float
        m/s and rad/s, at once and in any directions ...
    share : float
        ... take this share of the speed limits: above 1 a limit is exceeded.
    share_joints : tuple of str
        Those of ``joints`` that need it.
    unlimited : tuple of str
        Joints without a known speed limit, which do not count.
    """

    linear: float
    linear_joints: tuple[str, ...]
    linear_direction: Array
    angular: float
    angular_joints: tuple[str, ...]
    angular_direction: Array
    tip_speed: float
    turn_speed: float
    share: float
    share_joints: tuple[str, ...]
    unlimited: tuple[str, ...]


def limits_of(arm: Arm) -> Array:
    """Return speed limits (n,), radians or metres per second; infinite where not known."""
    # Descriptions write none as zero or a very large number, a DH table's URDF as the pair that
    # stands in. A joint is as fast as those that follow it let it be.
    limits = np.array(arm.model.velocityLimit, dtype=float)
    limits[(limits == DEFAULT_VELOCITY) & (arm.model.effortLimit == DEFAULT_EFFORT)] = np.inf
    limits[(limits <= 0) | (limits >= 1e6)] = np.inf
    if arm.coupling is None:
        return limits
    with np.errstate(divide="ignore"):
        return np.asarray((limits[:, None] / np.abs(arm.coupling.matrix)).min(axis=0))


def check_speeds(tip_speed: float, turn_speed: float) -> None:
    """Raise OptionError unless speeds are from 0 to a million, not both zero, and none in mm/s."""
    OptionError.refuse_if(
        50.0 < tip_speed <= 1e6,  # parallel robots reach 10 m/s
        f"tip speeds are in m/s, and {tip_speed:g} m/s is faster than any arm: "
        f"{tip_speed:g} mm/s are {tip_speed / 1000:g}",
    )
    OptionError.refuse_if(
        not (0 <= tip_speed <= 1e6 and 0 <= turn_speed <= 1e6 and tip_speed + turn_speed),
        "tip_speed and turn_speed must be from 0 to 1e6, and not both zero: got "
        f"{tip_speed:g} m/s and {turn_speed:g} rad/s",
    )


class SpeedJudge:
    """Judges tip speeds of one arm at many configurations.

    ``reason`` tells why it cannot. ``basis`` (m, r) are task directions that the arm can produce,
    translations (``linear``, (r,)) and rotations apart.
    """

    def __init__(self, arm: Arm, joint_speeds: ArrayLike | None = None) -> None:
        self.arm, self.limits = arm, limits_of(arm)
        if joint_speeds is not None:  # 1e-6 to 1e6, or infinite
            self.limits = np.array(joint_speeds, dtype=float)
            real = (self.limits >= 1e-6) & ((self.limits <= 1e6) | np.isinf(self.limits))
            OptionError.refuse_if(
                self.limits.shape != (arm.n,) or not real.all(),
                f"joint_speeds needs {arm.n} positive numbers ({', '.join(arm.joints)}), rad/s or "
                "m/s, each from 1e-6 to 1e6",
            )
        self.basis, self.linear = arm.once("tip_speed_rows", lambda: _produced(arm))
        self.rank = generic_rank(arm)
        self._scale = own_scale(arm).rows
        self._of_metre = 1 / own_scale(arm).length
        self.reason = ""
        if not np.isfinite(self.limits).any():
            self.reason = (
                "the description has no joint speed limits (1 rad/s with 100 N m only stands in): "
                "give joint_speeds, --joint-speeds in a terminal"
            )
        elif self.basis.shape[1] != self.rank:
            fewer = "position" if arm.task.name == "tool-axis" else "tool-axis"
            self.reason = (
                f"the arm cannot move its tip in every direction of the task {arm.task} "
                f"({self.rank} of {self.basis.shape[1]}): choose one that it can, such as {fewer}"
            )
        elif math.comb(arm.n, max(self.rank - 1, 0)) > 100_000:  # facets, a second
            self.reason = f"{arm.n} joints are too many"

    def rows(self, J: Array, Q: Array) -> Array:
        """Return rows (..., r, n) of J (..., 6, n) at Q, without units but of prismatic columns."""
        return np.asarray(self.basis.T @ (task_rows(self.arm, J, Q) * self._scale[:, None]))

    def facets(self, A: Array) -> tuple[Array, Array, Array]:
        """Return normals y (F, r) of the twists at rows A (r, n), their h (F,), |y . A| (F, n)."""
        # Where the rank is lower, the lost directions are normals with h = 0.
        U, sigma, _ = np.linalg.svd(A)
        r = int((sigma > SINGULAR_RTOL * sigma[0]).sum())
        y = U[:, r:].T
        if r:
            chosen = np.array(list(itertools.combinations(range(A.shape[1]), r - 1)), dtype=int)
            columns = np.moveaxis((U[:, :r].T @ A)[:, chosen], 0, 1)  # (F, r, r - 1)
            y = np.concatenate([np.linalg.svd(columns)[0][..., -1] @ U[:, :r].T, y])
        y[np.abs(y) < SINGULAR_RTOL] = 0.0
        through = np.abs(y @ A)
        through[through < SINGULAR_RTOL * sigma[0]] = 0.0
        return y, (np.where(through > 0, self.limits, 0.0) * through).sum(axis=1), through

    def shares(self, Q: Array, tip_speed: float, turn_speed: float) -> Array:
        """Shares (N, n) of the speed limits that the worst twists at Q (N, n) take of joints."""
        A = self.rows(frame_jacobians(self.arm, Q), Q)
        out = np.zeros(Q.shape)
        sigma = np.linalg.svd(A, compute_uv=False)
        spare = A.shape[2] - A.shape[1]
        plain = (sigma[:, -1] > SINGULAR_RTOL * sigma[:, 0]) & (spare in (0, 1))
        if spare == 0 and plain.any():
            out[plain] = (
                self._needed(np.asarray(np.linalg.inv(A[plain]), np.float64), tip_speed, turn_speed)
                / self.limits
            )
        elif plain.any():
            out[plain] = self._one_spare(A[plain], tip_speed, turn_speed)
        for i in np.flatnonzero(~plain):
            y, h, through = self.facets(A[i])
            share = _over(self._needed(y, tip_speed, turn_speed), h)
            at_limit = np.where((h > 0)[:, None], through > 0, _idle(A[i]))
            out[i] = np.where(at_limit, share[:, None], 0.0).max(axis=0)
        return out

    def _one_spare(self, A: Array, tip_speed: float, turn_speed: float) -> Array:
        """Return `shares` of A (N, n - 1, n) of full rank."""
        # A facet belongs to two joints i and j: with the self-motion s and rows b of a right
        # inverse its normal is ``s_j b_i - s_i b_j``, and h is ``c_i |s_j| + c_j |s_i|``.
        right: Array = np.asarray(np.linalg.pinv(A), dtype=np.float64)
        s = np.linalg.svd(A)[2][:, -1]
        still = np.abs(s) < SINGULAR_RTOL
        s = np.where(still, 0.0, s)
        # What a limit adds to the h of all facets of another joint; 0, not infinity, times 0.
        room = np.where(
            still[:, None], 0.0, self.limits[:, None] * np.maximum(np.abs(s), 1e-300)[:, None]
        )
        out = np.zeros(s.shape)
        for i, j in itertools.combinations(range(s.shape[1]), 2):
            y = s[:, j, None] * right[:, i] - s[:, i, None] * right[:, j]
            share = _over(self._needed(y, tip_speed, turn_speed), room[:, i, j] + room[:, j, i])
            out[:, i] = np.maximum(out[:, i], np.where(still[:, j], 0.0, share))
            out[:, j] = np.maximum(out[:, j], np.where(still[:, i], 0.0, share))
        return out

    def _needed(self, y: Array, tip_speed: float, turn_speed: float) -> Array:
        """Support (...) of the twists asked for, along normals y (..., r)."""
        v, w = y[..., self.linear], y[..., ~self.linear]
        linear = tip_speed * self._of_metre * np.linalg.norm(v, axis=-1)
        return np.asarray(linear + turn_speed * np.linalg.norm(w, axis=-1))

    def at(self, J: Array, q: Array, tip_speed: float, turn_speed: float) -> TipSpeeds:
        """Tip speeds at frame Jacobian J (6, n), joint vector q (n,)."""
        A = self.rows(J, q)
        y, h, through = self.facets(A)

        def worst(v: float, w: float) -> tuple[float, tuple[str, ...], Array]:
            share = _over(self._needed(y, v, w), h)
            k = int(share.argmax())
            at_limit = through[k] > 0 if h[k] else _idle(A)
            pairs = zip(self.arm.joints, at_limit & (share[k] > 0), strict=True)
            joints = tuple(name for name, far in pairs if far)
            return float(share[k]), joints, self._direction(y[k], v > 0)

        linear, linear_joints, along = worst(1.0, 0.0)
        angular, angular_joints, about = worst(0.0, 1.0)
        share, share_joints, _ = worst(tip_speed, turn_speed)
        return TipSpeeds(
            linear=1 / linear if linear else math.inf,
            linear_joints=linear_joints,
            linear_direction=along,
            angular=1 / angular if angular else math.inf,
            angular_joints=angular_joints,
            angular_direction=about,
            tip_speed=tip_speed,
            turn_speed=turn_speed,
            share=share,
            share_joints=share_joints,
            unlimited=tuple(np.array(self.arm.joints)[np.isinf(self.limits)].tolist()),
        )

    def _direction(self, y: Array, linear: bool) -> Array:
        """Unit direction (3,) of one of its parts."""
        task = np.where(self.linear == linear, y, 0.0) @ self.basis.T
        rows = np.array(self.arm.task.rows)
        out: Array = np.zeros(3)
        own = (rows < 3) == linear
        out[rows[own] % 3] = task[own]
        length = float(np.linalg.norm(out))
        return out / length if length else out


def speed_judge(
    arm: Arm | None, tip_speed: float, turn_speed: float, joint_speeds: ArrayLike | None
) -> SpeedJudge:
    """Return a judge of an arm; OptionError for bad speeds, or if nothing can be said of it."""
    check_speeds(tip_speed, turn_speed)
    if arm is None:
        raise OptionError("a form that was read from JSON has no robot: make it with closed_form")
    judge = SpeedJudge(arm, joint_speeds)
    OptionError.refuse_if(judge.reason, f"{arm.name}: {judge.reason}")
    return judge


def _idle(A: Array) -> Bool:
    """Joints (n,) that would be infinitely fast for a lost direction: those of the self-motion."""
    _, sigma, Vt = np.linalg.svd(A)
    rank = int((sigma > SINGULAR_RTOL * sigma[0]).sum())
    return np.asarray(np.abs(Vt[rank:]).max(axis=0, initial=0.0) > SINGULAR_RTOL)


def _over(taken: Array, h: Array) -> Array:
    """Return taken / h, 0 where nothing is taken."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(taken > 0, taken / h, 0.0))


def _produced(arm: Arm) -> tuple[Array, Bool]:
    """Basis (m, r) of what the arm ever produces, translations first, and which are these."""
    wide = np.concatenate(list(generic_task(arm).J), axis=1)
    linear = np.array(arm.task.rows) < 3
    parts = []
    for own in (linear, ~linear):
        U, sigma, _ = np.linalg.svd(wide[own])
        rank = int((sigma > SINGULAR_RTOL * max(sigma.max(initial=0.0), 1.0)).sum())
        part = np.zeros((len(linear), rank))
        part[own] = np.eye(len(U)) if rank == len(U) else U[:, :rank]
        parts.append(part)
    kinds = np.repeat(np.array([True, False]), [part.shape[1] for part in parts])
    return np.concatenate(parts, axis=1), kinds


@checked
def tip_speeds(
    arm: Arm,
    q: ArrayLike,
    tip_speed: float = TIP_SPEED,
    turn_speed: float = TURN_SPEED,
    *,
    joint_speeds: ArrayLike | None = None,
) -> TipSpeeds:
    """Return the tip speeds that the joint speed limits allow in every direction at q.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    q : (n,) or (nq,) array_like
        Radians and metres.
    tip_speed, turn_speed : float
        m/s and rad/s that are judged together.
    joint_speeds : (n,) array_like, optional
        Speed limits, rad/s and m/s; those of the description if not given.

    Returns
    -------
    TipSpeeds
        m/s and rad/s, with the joints that limit them and the worst directions, in the base frame.

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.
    OptionError
        If speeds make no sense, no limits are known, or the arm cannot move its tip in every
        direction of its task anywhere.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> found = pinsing.kinematics.tip_speeds(arm, [0, -1.2, 1.3, -1, 1.5, 0])
    >>> round(found.linear, 3), found.linear_joints
    (0.768, ('elbow_joint',))
    """
    q = arm.check_one(q)
    judge = speed_judge(arm, tip_speed, turn_speed, joint_speeds)
    return judge.at(frame_jacobians(arm, q)[0], q, tip_speed, turn_speed)
