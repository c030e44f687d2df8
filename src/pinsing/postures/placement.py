"""Poses of a toolpath: files of them, motions of all (where to put the workpiece), and the search.

The search compares placements that are spread evenly over the ranges (Sobol's sequence), and
follows the best of them by random steps that grow shorter. The seed is fixed, so that the same
ranges give the same placement. That no placement is better is not proven.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError, RobotFileError
from pinsing.interface import checked
from pinsing.measures import SEED, Array
from pinsing.proximity.trajectory_file import (
    ANGLES as TURNS,
    LARGEST_TEXT,
    LENGTHS,
    SCALES,
    TIME,
    second_columns,
    split_unit,
)

RANGES = ("x", "y", "z", "roll", "pitch", "yaw")
"""What may be placed: metres along the axes of the base, radians about them."""
ANGLES = RANGES[3:]
TRIED = 300
"""Placements that are compared, 128 of them spread over the ranges."""


@dataclass(frozen=True, eq=False)
class WorkpiecePlacement:
    """How a workpiece was moved from where it was given.

    Attributes
    ----------
    x, y, z : float
        Metres along the axes of the base.
    roll, pitch, yaw : float
        Radians about the fixed axes x, y, z of the base, in this order, through ``about``.
    about : (3,) array
        The middle of the path as given (of the least box around its positions), metres.
    transform : (4, 4) array
        All of it, in the base frame: a pose T of the tool becomes ``transform @ T``.
    before : float
        Proven clearance of the path with the workpiece as given, radians; 0 if there is none.
    tried : int
        Placements that were compared.
    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    about: Array
    transform: Array
    before: float
    tried: int

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return what to do in words, empty if nothing.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import numpy as np
        >>> from pinsing.postures.placement import place_at
        >>> place_at({"x": 0.05, "yaw": 0.1}, about=np.zeros(3)).text()
        'x = +0.050 m, yaw = +5.73° about (0.000, 0.000, 0.000) m'
        """
        factor, unit = (180 / np.pi, "°") if degrees else (1.0, " rad")
        moved = [f"{name} = {getattr(self, name):+.3f} m" for name in RANGES[:3]]
        moved += [f"{name} = {factor * getattr(self, name):+.3g}{unit}" for name in ANGLES]
        said = [text for name, text in zip(RANGES, moved, strict=True) if getattr(self, name)]
        if any(getattr(self, name) for name in ANGLES):
            said[-1] += f" about ({', '.join(f'{x:.3f}' for x in self.about)}) m"
        return ", ".join(said)


def check_ranges(place: Mapping[str, tuple[float, float]]) -> None:
    """Refuse ranges that make no sense."""
    OptionError.refuse_if(not place, f"place needs a range of {', '.join(RANGES)}")
    for name, ends in place.items():
        OptionError.refuse_if(name not in RANGES, f"place: {name!r} is none of {', '.join(RANGES)}")
        OptionError.refuse_if(
            not (np.isfinite(ends).all() and ends[0] < ends[1]),
            f"place: {name} needs two ascending values, got {ends[0]:g} and {ends[1]:g}",
        )
        OptionError.refuse_if(
            name in ANGLES and ends[1] - ends[0] > 2 * np.pi + 1e-9,
            f"place: {name} from {ends[0]:g} to {ends[1]:g} rad is over a turn",
        )


def place_at(
    values: Mapping[str, float], about: Array, before: float = 0.0, tried: int = 0
) -> WorkpiecePlacement:
    """Return the placement with these values, rotated about a point (3,); others are zero."""
    turn = [values.get(name, 0.0) for name in ANGLES]
    shift = [values.get(name, 0.0) for name in RANGES[:3]]
    moved = np.eye(4)
    moved[:3, :3] = pin.rpy.rpyToMatrix(*turn)
    moved[:3, 3] = about + shift - moved[:3, :3] @ about
    x, y, z = shift
    roll, pitch, yaw = turn
    return WorkpiecePlacement(x, y, z, roll, pitch, yaw, about, moved, before, tried)


def search(
    value: Callable[[dict[str, float]], float], ranges: Mapping[str, tuple[float, float]]
) -> tuple[dict[str, float], int]:
    """Return the best placement found by ``value``, and how many were tried."""
    # It is rounded to a millimetre and a tenth of a degree, as a workpiece is put.
    from scipy.stats import qmc

    low, high = np.array(list(ranges.values())).T
    unit = np.array([np.pi / 1800 if name in ANGLES else 1e-3 for name in ranges])

    def put(X: Array) -> tuple[Array, Array]:
        """Placements as they are put, and their values."""
        X = np.clip(np.round(X / unit) * unit, low, high)
        return X, np.array([value(dict(zip(ranges, x.tolist(), strict=True))) for x in X])

    X, known = put(low + (high - low) * qmc.Sobol(len(ranges), seed=SEED).random(min(128, TRIED)))
    tried, step, best = len(X), 0.15, np.argsort(-known, kind="stable")[:4]
    X, known, rng = X[best], known[best], np.random.default_rng(SEED)
    while tried + len(X) <= TRIED:
        moved, new = put(X + rng.normal(size=X.shape) * (high - low) * step)
        tried, step, better = tried + len(X), step * 0.92, new > known
        X[better], known[better] = moved[better], new[better]
    return dict(zip(ranges, X[known.argmax()].tolist(), strict=True)), tried


QUATERNION, AXIS = ("qx", "qy", "qz", "qw"), ("i", "j", "k")
_OTHER = {
    "wpr": "FANUC's w, p, r are roll, pitch, yaw: rename them",
    "abc": "KUKA's a, b, c are yaw, pitch, roll: rename them",
    ("rx", "ry", "rz"): "rx, ry, rz may be a rotation vector (UR) or angles: write one of these",
}
"""Rotations as controllers write them: W, P, R about fixed x, y, z; A, B, C about moved z, y, x."""
_FAR = 20.0
"""Metres beyond which a pose is taken for one in millimetres."""


@dataclass(frozen=True)
class PoseFile:
    """Poses of a tool: ``poses`` (N, 4, 4), metres, and times ``t`` (N,), seconds, or None."""

    poses: Array
    t: Array | None
    has_roll: bool


def read_poses(path: Path, *, degrees: bool = False, millimetres: bool = False) -> PoseFile:
    """Return the poses of a text file with a header; radians and metres unless asked otherwise.

    Columns x, y, z and one of: qx, qy, qz, qw; roll, pitch, yaw (about fixed axes x, y, z); or i,
    j, k, the direction from the cutter into the tool (its -z) as CAM systems write it, which leaves
    the rotation about it open. A column t, time, timestamp or the like gives seconds. Heads may
    end in a unit, as ``x (mm)``. Separators are commas, semicolons or tabs.
    """
    try:
        RobotFileError.refuse_if(
            path.stat().st_size > LARGEST_TEXT, f"larger than {LARGEST_TEXT >> 20} MiB", path
        )
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RobotFileError(f"cannot be read: {error}", path) from None
    lines = text.splitlines()
    first = lines[0] if lines else ""
    separator = max(",;\t", key=first.count)
    heads = [split_unit(word.strip().lower()) for word in first.split(separator)]
    names, units = [name for name, _ in heads], dict(heads)
    kinds = [k for k in (QUATERNION, ANGLES, AXIS) if set(k) <= set(names)]
    if len(kinds) > 1:
        both = " and also ".join(", ".join(k) for k in kinds)
        raise RobotFileError(f"the tool's rotation is given twice: {both}; drop one", path)
    kind = kinds[0] if kinds else None
    if kind is None or not {"x", "y", "z"} <= set(names):
        other = next((f": {how}" for kind, how in _OTHER.items() if set(kind) <= set(names)), "")
        raise RobotFileError(
            "the first line names the columns: x, y, z and qx, qy, qz, qw, or roll, pitch, yaw, or "
            f"i, j, k (the tool's direction); it reads {first[:60]!r}{other}",
            path,
        )
    if odd := [name for name in names if re.match(TIME.pattern + r"\W", name)]:
        raise RobotFileError(f"the unit of times {odd[0]!r} has to be s, ms, us or ns", path)
    RobotFileError.refuse_if(
        len(set(names)) < len(names), f"a column is named twice in {first[:60]!r}", path
    )
    rows = []
    for number, row in enumerate(csv.reader(lines[1:], delimiter=separator), 2):
        if not any(word.strip() for word in row):
            continue
        values, which = [], ""
        try:
            for word in row:
                values.append(float(word.replace(",", ".")))
        except ValueError:
            if len(row) == len(names) and (extra := names[len(values)]) not in ("t", *"xyz", *kind):
                which = f" (drop column {extra!r}, which is not needed)"
        if not len(row) == len(values) == len(names) or not all(map(math.isfinite, values)):
            raise RobotFileError(
                f"line {number}: {len(names)} numbers are needed, got {separator.join(row)[:60]!r}"
                + which,
                path,
            )
        rows.append(values)
    RobotFileError.refuse_if(len(rows) < 2, "a path has two poses at least", path)
    column = dict(zip(names, np.array(rows).T, strict=True))
    place = np.stack([column[k] for k in "xyz"], axis=1)
    place *= _factors(path, units, "xyz", LENGTHS, 1e-3 if millimetres else 1.0)
    RobotFileError.refuse_if(
        np.abs(place).max() > _FAR,
        f"x, y, z reach {np.abs(place).max():g} m: for millimetres add --mm",
        path,
    )
    poses = np.zeros((len(rows), 4, 4))
    poses[:, :3, 3], poses[:, 3, 3] = place, 1.0
    how = np.stack([column[k] for k in kind], axis=1)
    turned = kind == ANGLES
    asked = math.radians(1) if degrees and turned else 1.0
    how *= _factors(path, units, kind, tuple(TURNS) if turned else (), asked)
    RobotFileError.refuse_if(
        turned and np.abs(how).max() > 2 * math.pi,
        "roll, pitch, yaw exceed a turn: for degrees add --deg",
        path,
    )
    poses[:, :3, :3] = _rotations(how, kind, path)
    times = next(filter(TIME.fullmatch, names), None)
    t = None if times is None else column[times] * SCALES.get(units[times], 1.0)
    if t is not None and (nano := second_columns(names).get(names.index(str(times)))) is not None:
        t = t + 1e-9 * column[names[nano]]
    return PoseFile(poses, t, kind != AXIS)


def _factors(
    path: Path, units: Mapping[str, str], names: Sequence[str], known: Sequence[str], asked: float
) -> Array:
    """What columns are multiplied by: for the units in their heads, or as asked."""
    said = [units[name] for name in names]
    if any(said) and not all(unit in known for unit in said):
        heads = ", ".join(f"{n} ({u})" if u else n for n, u in zip(names, said, strict=True))
        raise RobotFileError(f"the heads read {heads}: give each a unit of its kind, or none", path)
    factors = np.array([SCALES[unit] if unit else asked for unit in said])
    if asked != 1 and (factors != asked).any():
        option = "--mm" if names == "xyz" else "--deg"
        raise RobotFileError(f"the head of {names[0]} says {said[0]}: leave out {option}", path)
    return factors


def _rotations(values: Array, kind: tuple[str, ...], path: Path) -> Array:
    if kind == ANGLES:
        return np.array([pin.rpy.rpyToMatrix(*turns) for turns in values])
    size = np.linalg.norm(values, axis=1)
    bad = np.abs(size - 1) > 1e-2
    if bad.any():
        raise RobotFileError(
            f"pose {int(bad.argmax())}: {', '.join(kind)} have length {size[bad][0]:.3g}, not 1",
            path,
        )
    if kind == QUATERNION:
        return np.array(
            [pin.Quaternion(*q).matrix() for q in np.roll(values, 1, 1) / size[:, None]]
        )
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
