"""Poses of the output as two of their coordinates move, the others as they are at a start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array, Bool
from pinsing.errors import OptionError
from pinsing.loops.batch import BatchLoops, newton
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.led_pose import led_pose
from pinsing.loops.likeness import output_pose
from pinsing.loops.modes import home
from pinsing.robot.mechanism import Mechanism

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
CLOSED_LOOPS = 1e-9
_QUARTER = np.radians(89.5)
_SAME_TURN = 1e-9
_NEARBY = 1e-3
_MORE = 0.15


class PoseWay:
    """Poses of the output as two of their coordinates move."""

    def __init__(self, mechanism: Mechanism, over: Sequence[str], start: Array) -> None:
        self.mechanism = mechanism
        self.loops = BatchLoops(mechanism)
        self.led = led_pose(mechanism)
        led = list(self.led["rows"])
        free = tuple(COORDINATES[row] for row in led)
        names = ["yaw" if n in ("phi", "φ") else n for n in over]
        if len(names) != 2 or names[0] == names[1] or not set(names) <= set(free):
            raise OptionError(
                f"a map over the pose goes over two of {', '.join(free)}; got {', '.join(over)}"
            )
        self.rows = (COORDINATES.index(names[0]), COORDINATES.index(names[1]))
        turn = self.led["turn"]
        if turn is not None and turn["kind"] == "angles" and {3, 4} - set(led):
            raise OptionError(
                f"{mechanism.name}: its turns are tied to each other, so that a slice through its "
                "poses is none; take pinsing map --loops --over poses"
            )
        self.targets_rows = tuple(led)
        self.place = output_pose(mechanism, start)
        self.angles = pin.rpy.matrixToRpy(np.array(self.place.rotation))
        self.free = np.ones(mechanism.n, dtype=bool)
        forms = joint_forms(mechanism)
        slides = {n for n, p in zip(mechanism.joints, mechanism.prismatic, strict=True) if p}
        self.ones = [
            x
            for x in (forms.loci if forms.complete else ())
            if (x.kind == "type 1" or (x.kind == "passive" and set(x.joints) <= slides))
            and (x.equation is not None or len(x.matrix) == len(x.matrix[0]))
        ]
        self.forms = forms

    def keep_turn(self, starts: Sequence[Array]) -> bool:
        """Demand the rotation of the starts from now on, if poses around them have it.

        An output that keeps its axes while it is led over an open set of positions does so in all
        of that mode, beyond the constraint singularities too, where it could turn instead and pass
        into another mode. With its turn fixed these are no singular points of the equations.
        """
        if set(self.targets_rows) & {3, 4, 5}:
            return False
        around = _NEARBY * self._size() * np.array([[1.0, 0.3], [-0.3, 1.0], [-1.0, -0.7]])
        first, second = (np.tile(self.start(k) + around[:, k], len(starts)) for k in (0, 1))
        R, p = self.targets(first, second)
        Q, error = newton(
            self.loops,
            np.repeat(np.array(starts), len(around), axis=0),
            self.free,
            target=(R, p, self.targets_rows),
        )
        turned = np.abs(self.loops.output(Q)[0] - np.array(self.place.rotation)).max()
        kept = bool(error.max() <= CLOSED_LOOPS and turned <= _SAME_TURN)
        if kept:
            self.targets_rows = (*self.targets_rows, 3, 4, 5)
        return kept

    def start(self, k: int) -> float:
        """Value of a coordinate (0 or 1) at the start."""
        row = self.rows[k]
        if row < 3:
            return float(self.place.translation[row])
        turn = self.led["turn"]
        return float(turn["at"] if turn["kind"] == "axis" else self.angles[row - 3])

    def side(self, k: int, samples: int, times: float) -> Array:
        """Values of a coordinate: a whole turn, or about as far as the linkage is large."""
        if self.rows[k] > 2:
            return self._turn(k, samples)
        size = times * self._size()
        return self.start(k) + np.linspace(-size, size, samples)

    def _size(self) -> float:
        """The greatest distance of two joints at home, or of a joint and an end of a link."""
        q = home(self.mechanism)
        model, data = self.mechanism.model, self.mechanism.model.createData()
        pin.framesForwardKinematics(model, data, self.mechanism.model_q(q))
        ends = {self.mechanism.output}
        ends |= {name for x in self.mechanism.loops for name in (x.frame_a, x.frame_b)}
        points = np.concatenate(
            [
                self.loops.place(q[None]).position[:, 0],
                [np.array(data.oMf[k].translation) for k, f in enumerate(model.frames)
                 if f.name in ends],
            ]
        )  # fmt: skip
        gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
        return max(float(gaps.max()), 1e-3)

    def _turn(self, k: int, samples: int) -> Array:
        # Where yaw follows, pitch beyond a quarter of a turn is a pose that has been before.
        tied = self.rows[k] == 4 and self.led["turn"]["kind"] == "angles"
        most = _QUARTER if tied else np.pi
        return np.linspace(-most, most, samples)

    def cropped(self, k: int, side: Array, there: npt.ArrayLike, samples: int) -> Array:
        """From a little before the first value that is reached to a little after the last."""
        if self.rows[k] > 2:
            return self._turn(k, samples)
        places = np.flatnonzero(there)
        if not len(places):
            return np.linspace(side[0], side[-1], samples)
        step = float(side[1] - side[0])
        low, high = float(side[places[0]]) - 1.5 * step, float(side[places[-1]]) + 1.5 * step
        return np.linspace(low, high, samples)

    def widened(self, sides: list[Array], there: Bool) -> tuple[list[Array], bool]:
        """Sides that go on where what is ``there`` (ny, nx) meets the border; or the same."""
        out, more = [], False
        for k, side in enumerate(sides):
            ends = np.asarray(np.take(there, (0, -1), axis=1 - k).any(axis=k))
            low, high = float(side[0]), float(side[-1])
            if self.rows[k] < 3 and ends.any():
                more = True
                size = _MORE * (high - low)
                side = np.linspace(low - size * ends[0], high + size * ends[1], len(side))
            out.append(side)
        return out, more

    def targets(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and positions (N, 3) where the coordinates have these values."""
        count = len(first)
        p = np.repeat(np.array(self.place.translation)[None], count, axis=0)
        angles = np.repeat(self.angles[None], count, axis=0)
        R = np.repeat(np.array(self.place.rotation)[None], count, axis=0)
        turned = False
        for row, value in zip(self.rows, (first, second), strict=True):
            if row < 3:
                p[:, row] = value
                continue
            turn = self.led["turn"]
            if turn["kind"] == "axis":
                about = np.eye(3)[row - 3]
                R = np.array([pin.exp3(about * (v - turn["at"])) for v in value]) @ np.array(
                    turn["zero"]
                )
                continue
            angles[:, row - 3] = value
            turned = True
        if turned:
            R = np.array([pin.rpy.rpyToMatrix(*a) for a in angles])
        return R, p

    def signs(self, Q: Array) -> Array:
        """Signs (N, k) that the configurations of one working mode have.

        Of the type 1 equations, and of the lengths of legs: beyond zero a leg is turned round.
        """
        out = [np.zeros((len(Q), 0))]
        for locus in self.ones:
            if locus.equation is not None:
                value = locus.equation(Q)
            else:
                value = np.linalg.det(locus.scaled(locus.entries(Q, self.forms.joints)))
            out.append(np.sign(value)[:, None])
        return np.concatenate(out, axis=1)
