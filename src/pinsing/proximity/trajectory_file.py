"""Trajectories out of files: CSV, NPY, NPZ."""

from __future__ import annotations

import io
import os
import re
import tokenize
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.chunk_file import DamagedError, read_arrays, read_bounded
from pinsing.errors import ConfigurationError
from pinsing.robot.arm import Arm

_TIME = re.compile(r"(?i)(t|time|times|timestamp|seconds|secs?)(\s*[\[(_]?\s*s(ec(onds)?)?[\])]?)?")
_HANDED = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")  # pipes that the shell has set up
_LARGEST = 4 << 30  # bytes
_CELL = re.compile(r"could not convert string ('.*') to float64 at row (\d+), column (\d+)\.")
_SAMPLES = ("q", "Q", "positions", "position", "samples")
_TIMES = ("t", "time", "times")


@dataclass(frozen=True, eq=False)
class TrajectoryFile:
    """What a file says.

    Attributes
    ----------
    Q : (N, n) array
        Samples in the order of the arm's joints, radians and metres.
    t : (N,) array or None
        Times, as they are in the file.
    notes : tuple of str
        How its columns were read.
    others : mapping of str to (N,) array
        Columns of joints of the whole model that the arm leaves out, as they are in the file.
    """

    Q: Array
    t: Array | None
    notes: tuple[str, ...]
    others: Mapping[str, Array] = field(default_factory=dict)


def read_trajectory(path: Path, arm: Arm, degrees: bool = False) -> TrajectoryFile:
    """Read a trajectory for an arm.

    A CSV file has a header with the names of all joints, in any order, and perhaps a column of
    times (t, time, ...); columns of joints of the whole model that the chain leaves out are
    passed over, which is said, unless one is locked on the chain and moves. Or it has none, and
    then one column a joint, base to tip, perhaps after one of times. An NPY file has an array like
    that; an NPZ file arrays ``q`` (N, n) and perhaps ``t``.

    Parameters
    ----------
    path : Path
        The file; its name ends in .npy, .npz, or in anything else for text.
    arm : Arm
        The arm.
    degrees : bool
        Whether angles are in degrees.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, its columns do not fit the arm, or it holds no sample.
    """
    try:
        kind = path.suffix.lower()
        if path.is_char_device() or path.is_block_device():
            raise ConfigurationError(f"{path}: is a device: give a file")
        if path.is_fifo() and not os.fspath(path).startswith(_HANDED):
            raise ConfigurationError(f"{path}: is a pipe, which nobody may write to: give a file")
        if kind == ".npy":
            found = _npy(path, arm)
        elif kind == ".npz":
            found = _npz(path, arm)
        else:
            found = _text(path, arm)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ConfigurationError(f"cannot read {path}: {reason}") from None
    except DamagedError as error:
        raise ConfigurationError(f"cannot read {path}: {error}") from None
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        if isinstance(error, ConfigurationError):
            raise
        reason = " ".join(str(error).split())
        raise ConfigurationError(f"cannot read {path}: {reason:.200}") from None
    if not len(found.Q):
        raise ConfigurationError(f"{path}: no sample in it")
    if degrees:
        found = replace(found, Q=np.where(arm.prismatic, found.Q, np.radians(found.Q)))
    if found.others:
        _require_others(path, arm, found, degrees)
    return found


def _others(arm: Arm) -> tuple[str, ...]:
    """Joints of the whole model, of one value each, that the arm does not list."""
    whole = arm.source.full_model
    names = (str(whole.names[j]) for j in range(1, whole.njoints) if whole.joints[j].nv == 1)
    return tuple(name for name in names if name not in arm.joints)


def _require_others(path: Path, arm: Arm, found: TrajectoryFile, degrees: bool) -> None:
    """Refuse what the whole model's configuration would be refused for: see ``Arm.q_of``."""
    whole = arm.source.full_model
    full = arm.full_q(found.Q)
    for name, column in found.others.items():
        joint = whole.joints[whole.getJointId(name)]
        slides = "P" in joint.shortname().removeprefix("JointModel")[:1]
        value = np.radians(column) if degrees and not slides else column
        if joint.nq == 2:
            full[:, joint.idx_q], full[:, joint.idx_q + 1] = np.cos(value), np.sin(value)
        else:
            full[:, joint.idx_q] = value
    try:
        arm.q_of(full)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def _columns(path: Path, arm: Arm, array: npt.NDArray[Any]) -> TrajectoryFile:
    """Columns without names: one a joint, perhaps after one of times."""
    if array.dtype.names is not None or array.dtype.kind not in "fiu":
        raise ConfigurationError(f"{path}: an array of numbers is needed, got {array.dtype}")
    if array.ndim == 1 and len(array):
        array = array[None]
    if array.ndim != 2 or array.shape[1] not in (arm.n, arm.n + 1):
        raise ConfigurationError(
            f"{path}: {arm.n} columns are needed, one a joint ({', '.join(arm.joints)}), or one "
            f"more with times first; got shape {array.shape}"
        )
    if array.shape[1] == arm.n:
        notes = ("columns are the joints, base to tip; no times",)
        return TrajectoryFile(_floats(array), None, notes)
    notes = ("the first column is time, the others the joints, base to tip",)
    return TrajectoryFile(_floats(array[:, 1:]), _floats(array[:, 0]), notes)


def _floats(array: npt.NDArray[Any]) -> Array:
    with np.errstate(all="ignore"):  # what longer floats hold may be infinite, which is told later
        return np.asarray(array, dtype=float)


def _npy(path: Path, arm: Arm) -> TrajectoryFile:
    if path.stat().st_size > _LARGEST:
        raise ConfigurationError(f"{path}: has more than {_LARGEST >> 30} GiB: give a part of it")
    if not path.is_file():
        raise ConfigurationError(f"{path}: is not a plain file")
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (EOFError, ValueError, SyntaxError, tokenize.TokenError, RecursionError) as error:
        reason = type(error).__name__
        raise ConfigurationError(f"cannot read {path}: it is no NPY file ({reason})") from None
    if not isinstance(array, np.ndarray):  # an NPZ file under another name
        array.close()
        raise ConfigurationError(
            f"cannot read {path}: it is no NPY file; name it .npz if it is one"
        )
    return _columns(path, arm, array)


def _npz(path: Path, arm: Arm) -> TrajectoryFile:
    arrays = read_arrays(read_bounded(path, _LARGEST, follow=True), _LARGEST)
    samples = next((name for name in _SAMPLES if name in arrays), None)
    times = next((name for name in _TIMES if name in arrays), None)
    if samples is None:
        held = ", ".join(arrays) or "nothing"
        raise ConfigurationError(f"{path}: an array 'q' of samples is needed; found {held:.200}")
    found = _columns(path, arm, np.asarray(arrays[samples]))
    if times is None:
        return found
    if arrays[times].dtype.kind not in "fiu":
        kind = arrays[times].dtype
        raise ConfigurationError(f"{path}: times must be numbers, got an array of {kind}")
    return TrajectoryFile(found.Q, np.asarray(arrays[times], dtype=float), ())


def _text(path: Path, arm: Arm) -> TrajectoryFile:
    # Marks of byte order come from spreadsheets.
    with (
        path.open("rb") as raw,
        io.TextIOWrapper(raw, encoding="utf-8-sig", errors="replace") as file,
    ):
        if b"\0" in raw.peek(4)[:4] or raw.peek(2)[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ConfigurationError(f"{path}: is no UTF-8 but UTF-16 or binary: save it as UTF-8")
        number, line = 1, ""
        for number, words_of_it in enumerate(file, 1):  # noqa: B007
            line = words_of_it.strip()
            if line and not line.startswith("#"):
                break
            line = ""
        if not line:
            raise ConfigurationError(f"{path}: no sample in it")
        separator = next((s for s in (",", ";", "\t") if s in line), None)
        words = [w.strip().strip("\"'") for w in line.split(separator)]
        named = any(_number(w) is None for w in words)
        order, time = _order(path, arm, words) if named else ([], None)
        parts = [] if named else [_rows(path, io.StringIO(line), separator, len(words), number)]
        done = number
        while True:
            part = _rows(path, file, separator, len(words), done + 1)
            if not len(part):
                break
            parts.append(part)
            done += len(part)
    table = np.concatenate(parts) if parts else np.zeros((0, len(words)))
    if not named:
        return _columns(path, arm, table)
    notes: tuple[str, ...] = () if time is not None else ("no column of times",)
    others = {w: table[:, words.index(w)] for w in _others(arm) if w in words}
    if others:
        left = ", ".join(f"{name!r:.80}" for name in others)
        notes += (f"the chain leaves out {left}: not used",)
    t = None if time is None else table[:, time]
    return TrajectoryFile(table[:, order], t, notes, others)


def _rows(path: Path, file: io.TextIOBase, separator: str | None, width: int, first: int) -> Array:
    """The next rows of a table, (K, width); ``first`` is the line they begin at."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an end of file is no surprise
        try:
            table = np.loadtxt(file, delimiter=separator, max_rows=100_000, ndmin=2, comments="#")
        except ValueError as error:
            words = " ".join(str(error).split())
            cell = _CELL.fullmatch(words)
            if cell and separator is not None and not re.fullmatch(r"'-?\d*,\d+'", cell[1]):
                line = _line_of(path, first, int(cell[2]))
                raise ConfigurationError(
                    f"{path}:{line}: column {cell[3]}: {cell[1]:.80} is no number"
                ) from None
            if separator != "," and re.search(r"'-?\d*,\d", words):
                words = "a number has a decimal comma: write points"
            raise ConfigurationError(f"{path}: after line {first}: {words:.200}") from None
    if table.size and table.shape[1] != width:
        raise ConfigurationError(
            f"{path}: {width} columns at first, {table.shape[1]} from line {first} on"
        )
    return np.asarray(table, dtype=float).reshape(-1, width)


def _line_of(path: Path, first: int, row: int) -> int:
    """Line of the ``row``-th sample from line ``first`` on; lines may be empty or comments."""
    if not path.is_file():  # it cannot be read again
        return first + row
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if number >= first and line.split(b"#")[0].strip():
                if row == 0:
                    return number
                row -= 1
    return first


def _order(path: Path, arm: Arm, words: Sequence[str]) -> tuple[list[int], int | None]:
    """Column of each joint, and that of times."""
    known = {*arm.joints, *_others(arm)}
    time = [i for i, w in enumerate(words) if w not in known and _TIME.fullmatch(w)]
    unknown = [w for i, w in enumerate(words) if w not in known and i not in time]
    if unknown:
        raise ConfigurationError(
            f"{path}: unknown column {unknown[0]!r:.80}: the joints are {', '.join(arm.joints)}, "
            "and times are in a column 't' or 'time'"
        )
    twice = [w for w in words if list(words).count(w) > 1]
    if twice or len(time) > 1:
        if not twice:
            pair = f"{words[time[0]]!r:.80} and {words[time[1]]!r:.80}"
            raise ConfigurationError(f"{path}: columns {pair} are both times")
        name = twice[0]
        raise ConfigurationError(f"{path}: column {name!r:.80} is there twice")
    missing = [j for j in arm.joints if j not in words]
    if missing:
        raise ConfigurationError(f"{path}: no column for joint {missing[0]!r}")
    return [list(words).index(j) for j in arm.joints], time[0] if time else None


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None
