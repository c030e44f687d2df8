"""Joints that follow a straight line of the tip, and the point at which it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import Branch
from pinsing.kinematics.batch import task_rows, turn_left
from pinsing.kinematics.jacobian import frame_jacobian
from pinsing.robot.arm import Arm

_LONGEST, _FIRST, _SHORTEST = 0.02, 1e-3, 1e-10
_ON = 1e-13


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line of the tip, from 0 to 1.

    Attributes
    ----------
    start : (3,) array
        Position of the tip at 0, base frame.
    turn : (3, 3) array
        Its rotation at 0.
    along : (3,) array
        From the first position to the last.
    axis : (3,) array
        Rotation vector of the whole turn, base axes.
    """

    start: Array
    turn: Array
    along: Array
    axis: Array

    @classmethod
    def to(cls, arm: Arm, q: Array, target: tuple[Array, Array | None]) -> Line:
        """The line from the tip at q to a target; what the task leaves out is as at q."""
        here = tip(arm, q)
        position, rotation = target
        axis, task = np.zeros(3), arm.task
        if not task.places:
            raise OptionError(
                f"task {task} only says how the tip moves, not where it is: a line needs all "
                "rows of a translation or rotation, or base axes, or tool-axis"
            )
        along = position - here.translation
        if rotation is not None:
            R = np.array(here.rotation)
            axis = turn_left(task, R[None], np.asarray(rotation, dtype=float))[0]
        if task.at_tip:  # it turns about no free axis, and by nothing that is not wanted
            turns = any(r >= 3 for r in task.rows)
            moves = any(r < 3 for r in task.rows)
            return cls(
                np.array(here.translation),
                np.array(here.rotation),
                along if moves else np.zeros(3),
                axis if turns else np.zeros(3),
            )
        rows = set(task.rows)
        along = np.where([r in rows for r in range(3)], along, 0.0)
        axis = np.where([r in rows for r in range(3, 6)], axis, 0.0)
        return cls(np.array(here.translation), np.array(here.rotation), along, axis)

    @property
    def length(self) -> float:
        """Metres; radians where the tip only turns."""
        moved = float(np.linalg.norm(self.along))
        return moved if moved > 1e-12 else float(np.linalg.norm(self.axis))

    @property
    def twist(self) -> Array:
        """Velocity (6,) over the parameter."""
        return np.concatenate([self.along, self.axis])

    def error(self, arm: Arm, q: Array, s: float) -> Array:
        """What is missing (6,) from the tip at q to the line at s."""
        here = tip(arm, q)
        wanted = pin.exp3(self.axis * s) @ self.turn
        R = np.array(here.rotation)
        if arm.task.at_tip:
            off = turn_left(arm.task, R[None], wanted)[0]
        else:
            off = R @ pin.log3(R.T @ wanted)
        return np.concatenate([self.start + s * self.along - here.translation, off])


@dataclass(frozen=True, eq=False)
class Tracked:
    """Places s (N,) of a line, configurations (N, n), and their rates dq/ds (N, n)."""

    s: Array
    q: Array
    rate: Array

    def ended(self, q: Array, s: float) -> Tracked:
        """The same with an end at which the rate is infinite, of those joints that turn back.

        They move as the root of what is left of the line, the others in proportion to it.
        """
        left = np.abs(q - self.q[-1])
        folds = (left > 1e-15) & (left > 1e-3 * left.max())
        rate = np.where(folds, np.inf, self.rate[-1])
        if s <= self.s[-1]:
            keep = self.s < s
            base = Tracked(self.s[keep], self.q[keep], self.rate[keep])
        else:
            base = self
        return Tracked(np.append(base.s, s), np.vstack([base.q, q]), np.vstack([base.rate, rate]))


def tip(arm: Arm, q: Array) -> pin.SE3:
    """Placement of the tip at q (n,)."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
    return pin.SE3(data.oMf[arm.tip_id])


def span(arm: Arm) -> float | None:
    """Metres that the tip is from the origin of joint 1 at most; None if that is not known.

    The lengths of all links one after the other, and the strokes of joints that slide.
    """
    if arm.coupling is not None:
        return None
    model = arm.model
    links = [model.jointPlacements[i].translation for i in range(2, model.njoints)]
    links.append(model.frames[arm.tip_id].placement.translation)
    stroke = np.maximum(np.abs(arm.lower), np.abs(arm.upper))[arm.prismatic]
    total = sum(float(np.linalg.norm(v)) for v in links) + float(stroke.sum())
    return total if np.isfinite(total) else None


def track(arm: Arm, line: Line, q: Array) -> Tracked:
    """Follow a line from q as far as it goes, with steps that are sure of their branch.

    Raises
    ------
    ConfigurationError
        If the line starts where a tip velocity along it is not possible.
    """
    scale = np.where(np.array(arm.task.rows) < 3, max(arm.length_scale, 1e-9), 1.0)
    s, step = 0.0, _FIRST
    S, Q = [s], [q]
    rates: list[Array] = []
    while True:
        J, twist = _rows(arm, frame_jacobian(arm, q), q), _rows(arm, line.twist, q)
        rate = np.asarray(np.linalg.lstsq(J, twist, rcond=1e-12)[0], dtype=float)
        missed = np.abs((J @ rate - twist) / scale).max()
        if missed > 1e-6 * max(1.0, float(np.abs(line.twist).max())):
            if len(S) == 1:
                raise ConfigurationError(
                    "the line starts at a configuration at which the tip cannot move along it"
                )
            rates.append(rates[-1])
            break
        rates.append(rate)
        if s >= 1.0 or len(S) >= 200_000:
            break
        fastest = float(np.abs(rate).max())
        step = min(2 * step, _LONGEST / max(fastest, _LONGEST * 20), 1.0 - s)
        found = None
        while step >= _SHORTEST:
            found = _step(arm, line, scale, q, s + step, step * rate)
            if found is not None:
                break
            step /= 2
        if found is None:
            break
        s = 1.0 if 1.0 - (s + step) < 1e-14 else s + step
        q = found
        S.append(s)
        Q.append(q)
    return Tracked(np.array(S), np.array(Q), np.array(rates))


def _step(arm: Arm, line: Line, scale: Array, q: Array, s: float, ahead: Array) -> Array | None:
    """The configuration at s near q + ahead; None if Newton's method strays from it."""
    x = q + ahead
    # Correction over step from which on a step is too long to be sure of the branch.
    allowed = 0.3 * float(np.abs(ahead).max()) + 1e-12
    for _ in range(8):
        error = _rows(arm, line.error(arm, x, s), x)
        if np.abs(error / scale).max() < _ON:
            return x
        J = _rows(arm, frame_jacobian(arm, x), x)
        x = x + np.linalg.lstsq(J, error, rcond=1e-12)[0]
        if not np.isfinite(x).all() or np.abs(x - q - ahead).max() > allowed:
            return None
    return x if np.abs(_rows(arm, line.error(arm, x, s), x) / scale).max() < 100 * _ON else None


def _rows(arm: Arm, columns: Array, q: Array) -> Array:
    """Task rows (m,) or (m, k) of columns (6,) or (6, k) in base axes at q (n,)."""
    if columns.ndim == 1:
        return task_rows(arm, columns[:, None], q)[:, 0]
    return task_rows(arm, columns, q)


def landing(arm: Arm, line: Line, branch: Branch, q: Array, s: float) -> tuple[Array, float] | None:
    """The point of a branch on the line near (q, s): the pose and its conditions, all at once.

    At the end of a line the joints alone turn back (a fold); together with the place on the line
    and the condition of the family they are a regular zero of Newton's method.
    """
    x, at = q.copy(), s
    for _ in range(30):
        missing = _rows(arm, line.error(arm, x, at), x)
        values, slopes = _conditions(branch, x, arm)
        residual = np.concatenate([missing, -values])
        J = _rows(arm, frame_jacobian(arm, x), x)
        top = np.column_stack([J, -_rows(arm, line.twist, x)])
        A = np.vstack([top, np.column_stack([slopes, np.zeros(len(values))])])
        if np.abs(residual).max() < 1e-14:
            break
        delta = np.linalg.lstsq(A, residual, rcond=1e-11)[0]
        size = float(np.abs(delta[:-1]).max())
        delta *= min(1.0, 0.2 / max(size, 1e-300))
        x, at = x + delta[:-1], at + float(delta[-1])
        if not np.isfinite(x).all() or np.abs(x - q).max() > 0.5:
            return None
    good = np.abs(residual).max() < 1e-11 and -1e-9 <= at <= 1 + 1e-9
    near = np.abs(x - q).max() < 0.3 and abs(at - s) < 0.02
    return (x, at) if good and near else None


def _conditions(branch: Branch, q: Array, arm: Arm) -> tuple[Array, Array]:
    """Values (k,) of the conditions of a branch at q and their slopes (k, n)."""
    values, slopes = [], []
    for v in branch.values:
        off = q[v.joint] - v.value
        if not arm.prismatic[v.joint]:
            off -= 2 * np.pi * np.round(off / (2 * np.pi))
        values.append(off)
        slopes.append((np.arange(len(q)) == v.joint).astype(float))
    for e in branch.equations:
        values.append(float(e(q)) / e.size)
        slopes.append(e.gradient(q) / e.size)
    return np.array(values), np.array(slopes)
