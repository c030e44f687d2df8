"""The pose of the output as numbers: position and unit quaternion, and what people type."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.arguments import real_numbers
from pinsing.errors import ConfigurationError
from pinsing.loops.closure import BatchLoops, random_closed, ranks
from pinsing.loops.modes import home
from pinsing.loops.motion import motions
from pinsing.loops.structure import output_pose
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.task import ROW_NAMES

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
_UNIT = 1e-6


@dataclass(frozen=True)
class Pose:
    """A pose of the output in the axes of the base.

    Attributes
    ----------
    position : tuple of 3 floats
        Metres.
    quaternion : tuple of 4 floats
        Unit quaternion (e0, e1, e2, e3), the scalar e0 first and not negative.
    """

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, radians: the rotation is Rz(yaw) Ry(pitch) Rx(roll)."""
        r, p, y = pin.rpy.matrixToRpy(self.se3.rotation)
        return float(r), float(p), float(y)

    @property
    def se3(self) -> pin.SE3:
        """As Pinocchio's placement."""
        e0, e1, e2, e3 = self.quaternion
        return pin.SE3(pin.Quaternion(e0, e1, e2, e3).matrix(), np.array(self.position))

    def __str__(self) -> str:
        x = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.position, 12))
        r = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.angles, 12))
        return f"({x}) m, roll, pitch, yaw ({r})"


def pose_of(placement: pin.SE3) -> Pose:
    """The pose of a placement."""
    turn = pin.Quaternion(np.array(placement.rotation))
    e = np.array([turn.w, turn.x, turn.y, turn.z])
    e /= np.linalg.norm(e)
    lead = e[int(np.argmax(np.abs(e) > 1e-9))]
    e = e * np.sign(lead) + 0.0
    x, y, z = (float(v) for v in placement.translation)
    return Pose((x, y, z), (float(e[0]), float(e[1]), float(e[2]), float(e[3])))


def read_pose(mechanism: Mechanism, pose: npt.ArrayLike | None) -> pin.SE3:
    """What a user means by a pose (see `working_modes`).

    Raises
    ------
    ConfigurationError
        If it has another shape, or is no pose.
    """
    at_home = output_pose(mechanism, home(mechanism))
    if pose is None:
        return at_home
    if isinstance(pose, pin.SE3):
        return pin.SE3(pose)
    values = real_numbers(pose, "pose")
    rows = mechanism.task.rows
    if not np.isfinite(values).all():
        raise ConfigurationError("pose holds a value that is not finite")
    if values.shape == (4, 4):
        return _matrix(values)
    if values.shape == (7,):
        e = values[3:]
        size = float(np.linalg.norm(e))
        if size <= _UNIT:
            raise ConfigurationError("the quaternion of the pose is zero: give e0, e1, e2, e3")
        return pin.SE3(pin.Quaternion(*(e / size)).matrix(), values[:3])
    if values.shape == (6,):
        return pin.SE3(pin.rpy.rpyToMatrix(*values[3:]), values[:3])
    if values.shape == (len(rows),):
        full = np.concatenate([at_home.translation, pin.rpy.matrixToRpy(at_home.rotation)])
        full[list(rows)] = values
        return pin.SE3(pin.rpy.rpyToMatrix(*full[3:]), full[:3])
    named = {"v": "", "w": "turn about "}
    names = ", ".join(named[ROW_NAMES[r][0]] + ROW_NAMES[r][1] for r in rows)
    shapes = {0: "a single number", 1: f"{values.size} numbers"}
    got = shapes.get(values.ndim, f"an array {values.shape}")
    raise ConfigurationError(
        f"a pose of {mechanism.output} has {len(rows)} numbers ({names}), 6 (x, y, z, roll, pitch, "
        f"yaw), 7 (x, y, z and a quaternion) or is a matrix (4, 4); got {got}"
    )


def _matrix(values: Array) -> pin.SE3:
    R = values[:3, :3]
    if (
        np.abs(R @ R.T - np.eye(3)).max() > _UNIT
        or np.linalg.det(R) < 0
        or not np.allclose(values[3], [0, 0, 0, 1], atol=_UNIT)
    ):
        raise ConfigurationError("the matrix (4, 4) is no pose: its rotation is not orthogonal")
    U, _, Vt = np.linalg.svd(R)
    return pin.SE3(U @ Vt, values[:3, 3])


def led_pose(mechanism: Mechanism) -> dict[str, Any]:
    """Rows of the output that can be led independently, and what its turns are; ready for JSON.

    Keys: ``rows``, of the output's rows as many as it has freedoms, those that move most at home;
    ``turn``, None where it does not turn, else ``kind``: ``full`` (all three, led as a rotation),
    ``axis`` (about one axis of the base always: ``at`` is the angle at the rotation ``zero``), or
    ``angles`` (some of roll, pitch and yaw; the others follow).
    """
    start = home(mechanism)
    rows = sorted(_independent(mechanism, start))
    turning = [row for row in rows if row >= 3]
    if not turning:
        return {"rows": rows, "turn": None}
    if len(turning) == 3:
        return {"rows": rows, "turn": {"kind": "full"}}
    others = [row for row in (3, 4, 5) if row not in turning]
    samples = [start, *random_closed(mechanism, 4, np.random.default_rng(673))]
    still = all(np.abs(_moves(mechanism, q)[others]).max() <= 1e-8 for q in samples)
    if len(turning) > 1 or not still:
        return {"rows": rows, "turn": {"kind": "angles"}}
    R = np.array(output_pose(mechanism, start).rotation)
    angle = float(pin.rpy.matrixToRpy(R)[turning[0] - 3])
    return {"rows": rows, "turn": {"kind": "axis", "at": angle, "zero": R.tolist()}}


def _moves(mechanism: Mechanism, q: Array) -> Array:
    """Velocities (6, d) of the output over the motions that the loops allow, without units."""
    _, _, J = BatchLoops(mechanism).output(q[None])
    return np.asarray(J[0] @ motions(mechanism, q).basis)


def _independent(mechanism: Mechanism, q: Array) -> list[int]:
    """Rows of the output that move independently, the one that moves most first."""
    rest = _moves(mechanism, q)[list(mechanism.task.rows)]
    count = min(ranks(mechanism).output, len(rest))
    chosen: list[int] = []
    for _ in range(count):
        # Of rows that move alike the earlier one is taken, whatever rounding says.
        k = int(np.argmax(np.round(np.linalg.norm(rest, axis=1), 9)))
        chosen.append(int(mechanism.task.rows[k]))
        size = float(np.linalg.norm(rest[k]))
        if size > 0:
            rest = rest - np.outer(rest @ rest[k], rest[k]) / size**2
    return list(dict.fromkeys(chosen))


_ROUND = 5e-10


@dataclass(frozen=True)
class Column:
    """Numbers of a table, one for each row: metres, or radians where it ``turns``."""

    title: str
    values: Sequence[float]
    turns: bool

    def shown(self, degrees: bool) -> list[float]:
        """As they are printed."""
        unit = 180 / math.pi if degrees and self.turns else 1.0
        return [unit * v for v in self.values]


def pose_table(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool = False,
    width: int = 100,
    columns: Sequence[Column] = (),
) -> list[str]:
    """Lines of a table with a number, the coordinates that are not zero throughout, and more.

    Where it would be wider than ``width`` with columns of numbers, coordinates that are the same
    in all rows are in a line above it.

    Parameters
    ----------
    poses : sequence of Pose
        One a row; metres, and radians or degrees.
    more : sequence of sequence of str
        Further cells of each row.
    titles : sequence of str
        Their titles.
    degrees : bool
        Angles in degrees.
    width : int
        Columns there are: numbers have fewer digits where they must, and lines that are still
        too long may be broken.
    columns : sequence of Column
        Further numbers of each row, behind the pose.
    """
    if not poses:
        return []
    # A half turn is always the positive one.
    values = [
        [*p.position, *(math.pi if v < _ROUND - math.pi else v for v in p.angles)] for p in poses
    ]
    shown = [k for k in range(6) if any(abs(v[k]) > _ROUND for v in values)] or [0, 1, 2]
    pose = [Column(COORDINATES[k], [v[k] for v in values], k > 2) for k in shown]
    changing = [c for c in pose if max(c.values) - min(c.values) > 1e-7]
    alike = [c for c in pose if c not in changing] if columns and len(poses) > 1 else []
    for left in ([], alike) if alike else ([],):
        said = ", ".join(f"{c.title} = {_number(c.shown(degrees)[0], 5)}" for c in left)
        head = [f"each at {said}"] if left else []
        for digits in (5, 4, 3):
            numbers = [*(c for c in pose if c not in left), *columns]
            lines = _lines(numbers, more, titles, degrees, digits)
            if max(map(len, lines)) <= width:
                # Spaces that do not break keep a row on its line.
                return [*head, *(line.replace(" ", "\u00a0") for line in lines)]
    return [*head, *lines]


def _lines(
    numbers: Sequence[Column],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool,
    digits: int,
) -> list[str]:
    values = zip(*(c.shown(degrees) for c in numbers), strict=True)
    rows = [["", *(c.title for c in numbers), *titles]]
    for i, (row, extra) in enumerate(zip(values, more, strict=True), 1):
        rows.append([str(i), *(_number(v, digits) for v in row), *extra])
    return aligned(rows, len(numbers) + 2)


def aligned(rows: Sequence[Sequence[str]], right: int) -> list[str]:
    """Lines of a table whose first columns, so many, end in line."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    wide = [*widths[:right], *[0] * (len(widths) - right)]
    return ["  ".join(x.rjust(w) for x, w in zip(row, wide, strict=True)).rstrip() for row in rows]


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
