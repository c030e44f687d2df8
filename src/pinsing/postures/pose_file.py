"""Files of poses: a header that names the columns, one pose a line."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pinsing._types import Array
from pinsing.errors import RobotFileError

QUATERNION, ANGLES, AXIS = ("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw"), ("i", "j", "k")
_LARGEST = 64 << 20
_FAR = 20.0
"""Metres beyond which a pose is taken for one in millimetres."""


@dataclass(frozen=True)
class PoseFile:
    """Poses of a tool: ``poses`` (N, 4, 4), metres, and times ``t`` (N,), seconds, or None."""

    poses: Array
    t: Array | None
    has_roll: bool


def read_poses(path: Path, *, degrees: bool = False, millimetres: bool = False) -> PoseFile:
    """Read poses from a text file with a header.

    Columns x, y, z and one of: qx, qy, qz, qw; roll, pitch, yaw (about fixed axes x, y, z); or i,
    j, k, the direction from the cutter into the tool (its -z) as CAM systems write it, which leaves
    the rotation about it open. A column t gives seconds. Separators are commas, semicolons or tabs.

    Parameters
    ----------
    path : Path
        The file.
    degrees, millimetres : bool
        Units of roll, pitch, yaw and of x, y, z; radians and metres otherwise.

    Raises
    ------
    RobotFileError
        With the line, if a column is missing or a number makes no sense.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise RobotFileError(f"larger than {_LARGEST >> 20} MiB", path)
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RobotFileError(f"cannot be read: {error}", path) from None
    lines = text.splitlines()
    first = lines[0] if lines else ""
    separator = max(",;\t", key=first.count)
    names = [word.strip().lower() for word in first.split(separator)]
    kind = next((k for k in (QUATERNION, ANGLES, AXIS) if set(k) <= set(names)), None)
    if kind is None or not {"x", "y", "z"} <= set(names):
        raise RobotFileError(
            "the first line names the columns: x, y, z and qx, qy, qz, qw, or roll, pitch, yaw, or "
            f"i, j, k (the tool's direction); it reads {first[:60]!r}",
            path,
        )
    if len(set(names)) < len(names):
        raise RobotFileError(f"a column is named twice in {first[:60]!r}", path)
    rows = []
    for number, row in enumerate(csv.reader(lines[1:], delimiter=separator), 2):
        if not any(word.strip() for word in row):
            continue
        try:
            values = [float(word.replace(",", ".")) for word in row]
        except ValueError:
            values = []
        if len(values) != len(names) or not all(map(math.isfinite, values)):
            raise RobotFileError(
                f"line {number}: {len(names)} numbers are needed, got {separator.join(row)[:60]!r}",
                path,
            )
        rows.append(values)
    if len(rows) < 2:
        raise RobotFileError("a path has two poses at least", path)
    column = dict(zip(names, np.array(rows).T, strict=True))
    place = np.stack([column[k] for k in "xyz"], axis=1) * (1e-3 if millimetres else 1.0)
    if np.abs(place).max() > _FAR:
        raise RobotFileError(
            f"x, y, z reach {np.abs(place).max():g} m: for millimetres add --mm", path
        )
    poses = np.zeros((len(rows), 4, 4))
    poses[:, :3, 3], poses[:, 3, 3] = place, 1.0
    how = np.stack([column[k] for k in kind], axis=1)
    if kind == ANGLES:
        how = np.radians(how) if degrees else how
        if np.abs(how).max() > 2 * math.pi:
            raise RobotFileError("roll, pitch, yaw exceed a turn: for degrees add --deg", path)
    poses[:, :3, :3] = _rotations(how, kind, path)
    return PoseFile(poses, column.get("t"), kind != AXIS)


def _rotations(values: Array, kind: tuple[str, ...], path: Path) -> Array:
    from scipy.spatial.transform import Rotation

    if kind == ANGLES:
        return np.asarray(Rotation.from_euler("xyz", values).as_matrix())
    size = np.linalg.norm(values, axis=1)
    bad = np.abs(size - 1) > 1e-2
    if bad.any():
        raise RobotFileError(
            f"pose {int(bad.argmax())}: {', '.join(kind)} have length {size[bad][0]:.3g}, not 1",
            path,
        )
    if kind == QUATERNION:
        return np.asarray(Rotation.from_quat(values).as_matrix())
    z = -values / size[:, None]
    # Any rotation about the tool will do, changing little: x is carried on from pose to pose.
    out, x = np.empty((len(z), 3, 3)), np.eye(3)[np.abs(z[0]).argmin()]
    for k, axis in enumerate(z):
        if abs(x @ axis) > 0.9:
            x = np.eye(3)[np.abs(axis).argmin()]
        x = x - (x @ axis) * axis
        x /= np.linalg.norm(x)
        out[k] = np.stack([x, np.cross(axis, x), axis], axis=-1)
    return out
