"""Trajectories out of files: tables as text, NPY, NPZ, YAML of ROS, robot programs."""

from __future__ import annotations

import datetime
import io
import itertools
import json
import math
import os
import re
import tokenize
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pinsing.atomic_write import MEBIBYTE
from pinsing.chunk_file import DamagedError, read_arrays, read_bounded
from pinsing.errors import ConfigurationError
from pinsing.measures import Array, NDArray
from pinsing.robot.arm import Arm, held_joints

_UNIT = re.compile(
    r"(?i)[\s_]*[\[(]\s*([^\W\d_][^\[\]()]*?|°)\s*[\])]\s*$"
    r"|(?:[\s_]in)?[\s_](deg(?:rees?)?|[mu]?rad|radians|mdeg|revs?|turns|gon|mm|cm|ms|us|ns"
    r"|(?<=\sin\s)grad)$|\s*(°)$"
)
_DEGREE = ("deg", "degree", "degrees", "°", "grad", "degré", "degrés", "grados", "gradi")
ANGLES = {
    **dict.fromkeys(_DEGREE, math.radians(1)),
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
}
LENGTHS = ("m", "meter", "metre", "mm")
SCALES = {
    **ANGLES, **dict.fromkeys((*LENGTHS, "s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("mm", "ms"), 1e-3), "us": 1e-6, "ns": 1e-9,
}  # fmt: skip
"""What a unit in the head of a column is multiplied by: radians, metres, seconds."""
TIME = re.compile(
    r"(?i)[%_]*(t|times?|zeit|temps|tiempo|tempo|timestamp|seconds|secs?|time_from_start|elapsed)"
)
_STAMP = re.compile(r"(?i)(|.*[\W_])(n|nano)?sec(?:s|onds)?")
_NUMBERED = re.compile(
    r"(?i)(?:(?:axis)?act(?:ual)?_|field_|joint_)?(?:q|jt?|a|rax|joint|gelenk|axis|achse|axe|eje|"
    r"asse|theta|θ|pos|(?:joint[_ ]?)?(?:angle|position)s?)[_ ]?(\d+)"
    r"(?:[_ ](?:pos|position|angle|winkel|value|actual))*"
)
_PLACES = {"joint_states", "joint_state", "pos", "position", "positions", "actual", "field", "data"}
"""Parts of a column's name that tell where a position was written down, not of which joint."""
_NO_POSITION = re.compile(
    r"(?i)(?:unnamed: \d+)?|.*[\W_](?:secs|nsecs|nanosec)|"
    r"(.*[\W_])?(velocity|velocities|vel|qd|qdd|dq|speeds?|accelerations?|acc|efforts?|torques?|"
    r"tau|currents?|target|header|frame_id|seq|stamp|name|mode|status|bits|tcp|"
    r"temperatures?|voltage|forces?|wrench|moment|momentum|scaling|ratio|payload|accelerometer|"
    r"registers?|(?:analog|digital|bit)_\w+|runtime_state|execution_time|control_output|"
    r"elbow_position|script_control_line|time_scale_source)([\W_]?\d*|[\W_].*)"
)
"""Names of what logs and UR's recordings (RTDE) hold beside positions of joints; pandas' index."""
_CLOCK = re.compile(
    r"(?:(\d{4}-\d\d-\d\d)[T ]\s*)?(\d\d?):([0-5]\d):([0-5]\d(?:[.,]\d+)?)(Z|[+-]\d\d:?\d\d)?"
)
"""A time of day, perhaps of a date; which of 3/4/2026 is the month is not said."""
_NAME = re.compile(r"(?i)(?:.*[\W_])?(?:names?[\W_]*(\d+)|[a-z]*[\W_]*(\d+)[\W_]+name)\W*")
"""A column of the names of the joint whose position has the same number."""
_NAMES = re.compile(r"[A-Za-z][\w-]*")
_LETTERS = {6: "SLURBT", 7: "SLEURBT"}
"""Yaskawa's names of the joints, base to tip."""
_PROGRAM = re.compile(r"(?i)(%%%|module\s|&[a-z]+\s|(global\s+)?def(fct|dat)?\s|/(job|prog)(\s|$))")
"""How programs begin: RAPID, KRL, INFORM, and those of FANUC and UR under other names."""
_HANDED = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")  # pipes that the shell has set up
_LARGEST = 4096 * MEBIBYTE  # bytes
NO_TIMES = "no column of times"
_EPOCH = 1e8  # seconds: later times are dates, of which three years are left out
_SPOKEN = re.compile(r"(?i)(?:((?:\b|_)(?:deg(?:rees?)?|grad)\b|°)|(?:\b|_)rad(?:ians?)?\b)(?!/)")
"""A unit of angles in a comment, degrees as its first group."""
_UNITS_LINE = re.compile(r"(?i)\s*[#%]\s*(?:angle[\s_]+)?units?\s*[:=]\s*(.*)")
AROUND = " \t\r\n\"'[]()"
_QUOTED = re.compile(r'"\s*([-+.\w]+)\s*"')
_SAMPLES = ("q", "Q", "positions", "position", "samples")
_TIMES = ("t", "time", "times")
_NAMED = ("joint_names", "names", "name", "joints")


@dataclass(frozen=True, eq=False)
class TrajectoryFile:
    """The samples of a file, and how it was read."""

    Q: Array  # (N, n), in the arm's order, radians and metres
    t: Array | None  # (N,), as in the file
    notes: tuple[str, ...]  # how columns were read
    # joints of the whole model that the arm does not list, with factors
    others: Mapping[str, tuple[Array, float | None]] = field(default_factory=dict)
    scales: Sequence[float | None] = ()  # factors of joints, where the file names a unit
    degrees: bool | None = None  # what a comment says of all angles
    seconds: bool = False  # the file says that times are in seconds


def read_trajectory(
    path: Path, arm: Arm, degrees: bool | None = None, columns: Sequence[str] = ()
) -> TrajectoryFile:
    """Return the trajectory of a file for an arm, with ``notes`` on what was read as what.

    A table as text has a head with the names of all joints, in any order, and perhaps a column of
    times. Names may lack the prefix of the robot's or have another's, be numbers (q1, J1, joint_1,
    actual_q_0) or Yaskawa's (S, L, U, R, B, T), stand in a path (/joint_states/NAME/position), and
    end in a unit (deg, rad, m, mm; s, ms, ns), or a line of units follows. Columns ``sec`` and
    ``nanosec`` are one time. Times of day count from the first. Velocities, modes and the like are
    passed over, as are joints of the whole model that the chain leaves out, unless one is locked on
    it and moves. Without a head there is one column a joint, base to tip, perhaps after one of
    times, which must be the first and strictly ascending while the last is not. A comment
    ``# units: degrees`` holds for all angles; ``degrees`` overrides the file. Commas, semicolons,
    tabs or blanks separate; decimal commas are read where the comma does not separate. ``columns``
    name, or number from 1, those of joints, and ``t=NAME`` of times.

    YAML or JSON holds a trajectory of ROS or MoveIt, or what ``ros2 topic echo`` prints of joint
    states; ``.ls`` the points of a Fanuc program, J3 as written, or J2 + J3 for a Fanuc arm of
    `pinsing list`, whose controller counts J3 from the horizontal; ``.script`` the moves to joint
    angles of a UR program; an NPY file an array; an NPZ file ``q`` (N, n) and perhaps ``t``.
    """
    kind = path.suffix.lower()
    try:
        ConfigurationError.refuse_if(
            path.is_char_device() or path.is_block_device(), f"{path}: is a device: give a file"
        )
        ConfigurationError.refuse_if(
            path.is_fifo() and not os.fspath(path).startswith(_HANDED),
            f"{path}: is a pipe, which nobody may write to: give a file",
        )
        found = _READERS.get(kind, _text)(path, arm, columns, degrees is not None)
    except ConfigurationError:
        raise
    except (
        OSError, DamagedError, ValueError, TypeError, OverflowError, MemoryError, RecursionError,
    ) as error:  # fmt: skip
        reason = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise ConfigurationError(f"cannot read {path}: {reason:.200}") from None
    ConfigurationError.refuse_if(not len(found.Q), f"{path}: no sample in it")
    notes, t, leave_out = list(found.notes), found.t, "leave out --units, --deg and --rad"
    if found.degrees is not None:
        unit = "degrees" if found.degrees else "radians"
        ConfigurationError.refuse_if(
            degrees not in (None, found.degrees),
            f"{path}: a comment says units: {unit}, the option the other: correct the comment, "
            f"or {leave_out}",
        )
        degrees = found.degrees
        leave_out = "a comment says otherwise: correct one of them"
        notes.append(f"a comment says that angles are in {unit}")
    angle, given = math.radians(1) if degrees else 1.0, found.scales or [None] * arm.n
    for joint, scale, slides in zip(arm.joints, given, arm.prismatic, strict=True):
        if degrees is not None and not slides and scale not in (None, angle):
            unit = "degrees" if scale != 1 else "radians"
            raise ConfigurationError(f"{path}: it says {unit} of {joint!r}: {leave_out}")
    usual = np.where(arm.prismatic, 1.0, angle).tolist()
    scales = [u if scale is None else scale for u, scale in zip(usual, given, strict=True)]
    unknown = [s is None and not slides for s, slides in zip(given, arm.prismatic, strict=True)]
    if degrees is None and any(unknown):
        notes.append("no unit is named: angles are in radians")
    told = bool(degrees) and found.degrees is None and any(unknown)
    if told and np.max(np.abs(found.Q[:, unknown])) <= math.tau:
        notes.append("no angle exceeds 6.3°: if the file is in radians, say --units rad")
    if t is not None and len(t):
        require_seconds(str(path), float(t[0]))
        steps, long = np.diff(t), abs(t[-1] - t[0])
        odd = long > 1e3 or (len(t) > 1 and np.median(steps) >= 2 and not np.any(steps % 1))
        if odd and not found.seconds:
            note = f"no unit of time is named: t is taken as seconds ({long:.6g} s in all)"
            notes.append(f"{note}; if it is in milliseconds, name its column 't (ms)'")
        if abs(t[0]) > _EPOCH:
            notes.append(f"times are counted from the first, {t[0]:.3f} s")
            t = t - t[0]
    Q = found.Q * scales
    if kind == ".ls" and arm.n == 6 and arm.source.is_by("Fanuc"):
        Q[:, 2] += Q[:, 1]
        notes.insert(0, _FANUC_SUM)
    elif arm.n > 2 and (kind == ".ls" or (kind not in _READERS and arm.source.is_by("Fanuc"))):
        notes.append(_FANUC_J3)
    found = replace(found, Q=Q, t=t, notes=tuple(notes))
    if found.others:
        _require_others(path, arm, found, bool(degrees))
    return found


def require_seconds(name: str, t: float) -> None:
    """Refuse a time that is thousands of years in seconds."""
    if abs(t) > 1e3 * _EPOCH:
        said = f"{name}: the time {t:.3g} is not in seconds: name its unit, as 'time (ns)'"
        raise ConfigurationError(said)


def _others(arm: Arm) -> tuple[str, ...]:
    """Joints of the whole model, of one value each, that the arm does not list."""
    whole = arm.source.full_model
    names = (str(whole.names[j]) for j in range(1, whole.njoints) if whole.joints[j].nv == 1)
    return tuple(name for name in names if name not in arm.joints)


def _require_others(path: Path, arm: Arm, found: TrajectoryFile, degrees: bool) -> None:
    """Refuse what the whole model's configuration would be refused for: see ``Arm.q_of``."""
    whole = arm.source.full_model
    full = arm.full_q(found.Q)
    for name, (column, scale) in found.others.items():
        joint = whole.joints[whole.getJointId(name)]
        slides = "P" in joint.shortname().removeprefix("JointModel")[:1]
        value = column * (scale or (math.pi / 180 if degrees and not slides else 1.0))
        if joint.nq == 2:
            full[:, joint.idx_q], full[:, joint.idx_q + 1] = np.cos(value), np.sin(value)
        else:
            full[:, joint.idx_q] = value
    try:
        arm.q_of(full)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def _columns(
    path: Path,
    arm: Arm,
    array: NDArray[Any],
    columns: Sequence[str] = (),
    heads: Sequence[str] = (),
    united: bool = False,
) -> TrajectoryFile:
    """Columns by their heads, or by number; without either one a joint, perhaps after times."""
    ConfigurationError.refuse_if(
        array.dtype.names is not None or array.dtype.kind not in "fiu",
        f"{path}: an array of numbers is needed, got {array.dtype}",
    )
    if array.ndim == 1 and len(array):
        array = array[None]
    if (columns or heads) and array.ndim == 2:
        heads = heads or [str(k + 1) for k in range(array.shape[1])]
        read = ColumnHeads(path, arm, heads, columns, angles_said=united)
        used = sorted(read.used)
        return read.samples(_floats(array[:, used]), used)
    ConfigurationError.refuse_if(
        array.ndim != 2 or array.shape[1] not in (arm.n, arm.n + 1),
        f"{path}: {arm.n} columns are needed, one a joint ({', '.join(arm.joints)}), or one "
        f"more with times first; got shape {array.shape}",
    )
    if array.shape[1] == arm.n:
        return TrajectoryFile(
            _floats(array), None, ("columns are the joints, base to tip; no times",)
        )
    ascending = [len(array) > 1 and bool(np.all(x[1:] > x[:-1])) for x in array[:, [0, -1]].T]
    if ascending != [True, False]:
        last = ",".join(str(k + 2) for k in range(arm.n))
        first = ",".join(str(k + 1) for k in range(arm.n))
        why = (
            "more than one sample is needed to tell"
            if len(array) < 2
            else (
                "the first and the last ascend" if all(ascending) else "the first does not ascend"
            )
        )
        raise ConfigurationError(
            f"{path}: {arm.n + 1} columns without names for {arm.n} joints, and which is time is "
            f"unclear ({why}): say it as in 'pinsing check ROBOT "
            f"{path.name} --columns t=1,{last}', or leave the last column out with "
            f"--columns {first}"
        )
    notes = ("the first column is time, the others the joints, base to tip",)
    return TrajectoryFile(_floats(array[:, 1:]), _floats(array[:, 0]), notes)


def _floats(array: NDArray[Any]) -> Array:
    with np.errstate(all="ignore"):  # what longer floats hold may be infinite, which is told later
        return np.asarray(array, dtype=float)


def _npy(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    ConfigurationError.refuse_if(
        path.stat().st_size > _LARGEST,
        f"{path}: has more than {_LARGEST >> 30} GiB: give a part of it",
    )
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
    return _columns(path, arm, array, columns)


def _npz(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    arrays = read_arrays(read_bounded(path, _LARGEST, follow=True), _LARGEST)
    samples, times, names = (
        next((name for name in known if name in arrays), None)
        for known in (_SAMPLES, _TIMES, _NAMED)
    )
    if samples is None:
        held = ", ".join(arrays) or "nothing"
        raise ConfigurationError(f"{path}: an array 'q' of samples is needed; found {held:.200}")
    array, heads = np.asarray(arrays[samples]), []
    if names is not None and not columns:
        heads = [str(name) for name in np.ravel(arrays[names])]
        ConfigurationError.refuse_if(
            array.ndim != 2 or array.shape[1] != len(heads),
            f"{path}: {samples!r} needs a column for each of the {len(heads)} names in "
            f"{names!r}; got shape {array.shape}",
        )
    found = _columns(path, arm, array, columns, heads, united)
    if times is None:
        return found
    ConfigurationError.refuse_if(
        found.t is not None and not heads,
        f"{path}: times are in {times!r} and in a column of {samples!r}: leave one out",
    )
    t, count = arrays[times], len(found.Q)
    ConfigurationError.refuse_if(
        t.dtype.kind not in "fiu", f"{path}: times must be numbers, got an array of {t.dtype}"
    )
    ConfigurationError.refuse_if(
        t.shape != (count,), f"{path}: {times!r} needs {count} times, one a sample; got {t.shape}"
    )
    notes = [note for note in found.notes if heads and note != NO_TIMES]
    twice = f"times are those of {times!r}, not of the column of {samples!r}"
    notes += [twice] * (found.t is not None)
    return replace(found, t=np.asarray(t, dtype=float), notes=tuple(notes), seconds=False)


LARGEST_TEXT = 64 * MEBIBYTE  # bytes: a minute of reading
_FANUC_JOINT = re.compile(r"J(\d)\s*=\s*([-+]?[\d.]+)\s*(deg|mm)", re.I)
_FANUC_MOVE = re.compile(r"\s*\d+:\s*([JLCA])\s+(\S+?)\[(\d+)[^\]]*\]([^;]*)")
_FANUC_OTHER = re.compile(r"\s*\d+:\s*(CALL|RUN|JMP|LBL|IF|FOR|SELECT|UFRAME|UTOOL|OFFSET)\b", re.I)
_FANUC_J3 = (  # as ROS-Industrial's fanuc_driver has it, by its J23_factor
    "J3 is taken as the robot's description counts it; controllers of FANUC count it from the "
    "horizontal: where the description counts it from the upper arm, as DH tables and descriptions "
    "of ROS do, the verdict is of another motion: give a table with J2 + J3 in place of J3"
)
_FANUC_SUM = (
    "J3 of a FANUC program is counted from the horizontal: J2 + J3 is taken as the third joint's "
    "angle from the upper arm"
)
_POSES_TABLE = "'pinsing path ROBOT FILE' reads them; say --mm and --deg where they are"
_POSES = "export the program with joint positions, or give the poses as a table to 'pinsing path'"
_LINEAR = (
    "give samples of the joints, or check one linear move with 'pinsing line ROBOT --q START --to "
    "X,Y,Z'"
)
_UR_MOVE = re.compile(r"\b(move[a-z]|servo[a-z]+|speed[a-z])\s*\(\s*(\[[^\]]*\])?")
_UR_OTHER = re.compile(r"(?m)^\s*(if|elif|else|while|for|thread|call)\b|\bdef\b[\s\S]*\bdef\b")


def _program(path: Path) -> str:
    return read_bounded(path, LARGEST_TEXT, follow=True).decode("utf-8", "replace")


def _fanuc(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    """Joint moves of a listing in the order of its program, to positions of its /POS."""
    program, _, positions = _program(path).partition("/POS")
    points: dict[str, list[tuple[str, str, str]]] = {}
    for number, body in re.findall(r"P\[(\d+)[^\]]*\]\s*\{(.*?)\}", positions, re.S):
        ConfigurationError.refuse_if(number in points, f"{path}: P[{number}] is there twice")
        groups = re.split(r"(?=GP\d)", body)[1:] or [body]
        ConfigurationError.refuse_if(
            len(groups) > 1 or not re.match(r"GP1\b", groups[0]),
            f"{path}: P[{number}] is of other groups than GP1 alone",
        )
        points[number] = _FANUC_JOINT.findall(body)
        if len(points[number]) != arm.n or re.search(r"\bE\d\s*=", body):
            ConfigurationError.refuse_if(
                not points[number] and re.search(r"\bX\s*=", body),
                f"{path}: P[{number}] is a pose of the tool: {_POSES}",
            )
            raise ConfigurationError(
                f"{path}: P[{number}] has {len(points[number])} joint values, and the arm has "
                f"{arm.n}: give positions as joint angles, without more axes"
            )
    order = []
    for number, line in enumerate(program.splitlines(), 1):
        if _FANUC_OTHER.match(line):
            raise ConfigurationError(f"{path}:{number}: {line.strip():.60} is not followed")
        if (move := _FANUC_MOVE.match(line)) is None:
            continue
        if move[1] != "J" or move[2] != "P" or "offset" in move[4].lower():
            raise ConfigurationError(
                f"{path}:{number}: only joint moves to positions are followed, not "
                f"{line.strip():.60}: {_LINEAR}"
            )
        if move[3] not in points:
            raise ConfigurationError(f"{path}:{number}: there is no position P[{move[3]}]")
        order.append(points[move[3]])
    units = [unit.lower() for _, _, unit in order[0]] if order else [""] * arm.n
    _require_kinds(path, arm, [f"J{k + 1}" for k in range(arm.n)], units)
    rows = [[float(x) for _, x, _ in cells] for cells in order]
    return _moves(path, arm, rows, [SCALES.get(unit) for unit in units])


def _require_kinds(path: Path | str, arm: Arm, heads: Sequence[str], units: Sequence[str]) -> None:
    """Refuse angles of a joint that slides, and lengths of one that turns."""
    for head, unit, joint, slides in zip(heads, units, arm.joints, arm.prismatic, strict=True):
        if unit in (ANGLES if slides else LENGTHS):
            raise ConfigurationError(
                f"{path}: {head!r:.80} is in {unit}, but is taken for joint {joint!r}, which "
                f"{'slides' if slides else 'turns'}: correct the unit, or say with --columns "
                "A,B,... which columns of a table are the joints, base to tip"
            )


def _ur(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    """Joint moves of a program without branches."""
    text = re.sub(r"#.*", "", _program(path))
    number = r"d2r\(\s*([-+.\deE]+)\s*\)"
    text = re.sub(number, lambda angle: repr(math.radians(float(angle[1]))), text)
    if other := _UR_OTHER.search(text):
        word = other[1] or "a second def"
        raise ConfigurationError(f"{path}: {word}: only programs without branches are followed")
    rows = []
    for move in _UR_MOVE.finditer(text):
        if re.match(r"\w+\s*\(\s*p\[", move[0] + text[move.end() : move.end() + 2]):
            raise ConfigurationError(f"{path}: {move[1]} goes to a pose of the tool: {_POSES}")
        if move[1] not in ("movej", "servoj") or move[2] is None:
            raise ConfigurationError(
                f"{path}: only movej and servoj to joint angles are followed, not "
                f"{text[move.start() : move.end() + 20].split(chr(10))[0]:.60}: {_LINEAR}"
            )
        rows.append([float(x) for x in move[2].strip("[]").split(",")])
    return _moves(path, arm, rows, [1.0] * arm.n)


def _moves(
    path: Path, arm: Arm, rows: list[list[float]], scales: Sequence[float | None]
) -> TrajectoryFile:
    for number, row in enumerate(rows, 1):
        ConfigurationError.refuse_if(
            len(row) != arm.n,
            f"{path}: move {number} has {len(row)} joint values, and the arm has {arm.n}",
        )
    notes = (f"{len(rows)} joint moves, joints base to tip; no times",)
    return TrajectoryFile(np.array(rows).reshape(-1, arm.n), None, notes, scales=scales)


def _yaml(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    """A trajectory of ROS or MoveIt, or joint states as ``ros2 topic echo`` prints them."""
    import yaml

    from pinsing.description.yaml_tree import QuickLoader, yaml_problem

    raw = read_bounded(path, LARGEST_TEXT, follow=True)
    text = raw.decode("utf-8", "replace")
    try:
        is_json = path.suffix.lower() == ".json"  # YAML takes 1e-05 for text
        every = [json.loads(raw)] if is_json else yaml.load_all(raw, Loader=QuickLoader)
        documents = [d for d in every if d is not None]
    except yaml.YAMLError as error:
        reason, _, line = yaml_problem(error, text, path)
        where = path if line is None else f"{path}:{line}"
        raise ConfigurationError(f"cannot read {where}: {reason:.200}") from None
    rows: list[tuple[Any, Any, Any]] = []
    for data in documents:
        while isinstance(data, Mapping) and "points" not in data and "position" not in data:
            keys = [k for k in ("joint_trajectory", "trajectory", "goal") if k in data]
            data = data[keys[0]] if keys else None
            data = data[0] if isinstance(data, list) and len(data) == 1 else data
        ConfigurationError.refuse_if(
            not isinstance(data, Mapping),
            f"{path}: neither a trajectory (joint_names, points) nor joint states (name, position)",
        )
        if "points" in data:
            points = data["points"] if isinstance(data["points"], list) else []
            rows += [
                (data.get("joint_names"), p.get("positions"), p.get("time_from_start"))
                for p in points
                if isinstance(p, Mapping)
            ]
        else:
            header = data.get("header")
            stamp = header.get("stamp") if isinstance(header, Mapping) else None
            rows.append((data.get("name"), data["position"], stamp))
    ConfigurationError.refuse_if(not rows, f"{path}: no sample in it")
    samples, names = [], None
    heads: list[ColumnHeads] = []
    for number, (joints, positions, _) in enumerate(rows, 1):
        ConfigurationError.refuse_if(
            not (isinstance(joints, list) and isinstance(positions, list)),
            f"{path}: sample {number} lacks names or positions of joints",
        )
        ConfigurationError.refuse_if(
            len(joints) != len(positions) or any(type(x) not in (int, float) for x in positions),
            f"{path}: sample {number} needs a number for each of its {len(joints)} joints",
        )
        if joints != names:
            names = joints
            heads.append(ColumnHeads(path, arm, [str(j) for j in joints]))
            ConfigurationError.refuse_if(
                heads[-1].scales != heads[0].scales,
                f"{path}: sample {number} names other units of joints than the one before",
            )
        samples.append([float(positions[i]) for i in heads[-1].order])
    times = [_seconds(time) for _, _, time in rows]
    t = None if None in times else np.array(times, dtype=float)
    notes = (*(n for n in heads[-1].notes if n != NO_TIMES), *[NO_TIMES] * (t is None))
    degrees = None
    for number, words in enumerate(text.splitlines(), 1):
        degrees = stated_unit(f"{path}:{number}", words, degrees)
    Q = np.array(samples)
    return TrajectoryFile(Q, t, notes, scales=heads[-1].scales, degrees=degrees, seconds=True)


_READERS: Mapping[str, Callable[[Path, Arm, Sequence[str], bool], TrajectoryFile]] = {
    ".npy": _npy,
    ".npz": _npz,
    ".ls": _fanuc,
    ".script": _ur,
    **dict.fromkeys((".yaml", ".yml", ".json"), _yaml),
}
"""By the end of a file's name; others are tables as text."""


def stated_unit(where: str, line: str, before: bool | None) -> bool | None:
    """Return True for degrees, False for radians, where a comment says so, else ``before``."""
    if (said := _UNITS_LINE.match(line)) is None:
        return before
    units = {w: SCALES.get(w) for w in re.findall(r"[a-z°]+", said[1].lower()) if w != "and"}
    angles = {s for w, s in units.items() if w[:3] in ("deg", "rad", "°")}
    if len(angles) != 1 or any(s != 1 for w, s in units.items() if s not in angles):
        raise ConfigurationError(
            f"{where}: units {said[1]!r:.60} are not understood: write '# units: degrees' "
            "or '# units: radians', or name units in the head, as 'J1 (deg)'"
        )
    degrees = angles != {1.0}
    ConfigurationError.refuse_if(
        before not in (None, degrees),
        f"{where}: a comment says other units than one before, or --deg or --rad",
    )
    return degrees


def _seconds(time: Any) -> float | None:
    """Seconds of a number, or of a time of ROS 1 or 2."""
    if isinstance(time, Mapping):
        whole, part = time.get("sec", time.get("secs")), time.get("nanosec", time.get("nsecs", 0))
        time = whole + 1e-9 * part if type(whole) is int and type(part) is int else None
    return float(time) if type(time) in (int, float) else None


def _text(path: Path, arm: Arm, columns: Sequence[str], united: bool) -> TrajectoryFile:
    with _opened(path) as file:
        number, line, degrees, comments = 0, "", None, ""
        for number, line in enumerate(map(str.strip, file), 1):
            if line and not line.startswith(("#", "% ", "sep=")):  # MATLAB, spreadsheets
                break
            degrees = stated_unit(f"{path}:{number}", line, degrees)
            comments = f"{comments} {line}"
        else:
            raise ConfigurationError(f"{path}: no sample in it")
        yaml = r"(header|joint_names|joint_trajectory|points):.*"
        for wrong, said in (
            (
                _PROGRAM.match(line),
                "is a robot program, of which only .ls of FANUC and .script of UR are read: give "
                "a table of the joints' positions",
            ),
            (line.startswith(("{", "[")), "is no table: if it is JSON, name it .json"),
            (
                line == "---" or re.fullmatch(yaml, line),
                "is no table: if it is YAML, name it .yaml",
            ),
        ):
            ConfigurationError.refuse_if(wrong, f"{path}:{number}: {said}")
        separator = next((s for s in (";", "\t", ",") if s in line), None)
        words = [w.strip().strip("\"'") for w in line.split(separator)]
        numbers = [w for w in words if is_number(w.replace(",", ".")) or _CLOCK.fullmatch(w)]
        named = len(numbers) < len(words) and all(w.isdecimal() for w in numbers)
        ConfigurationError.refuse_if(
            len(numbers) < len(words) and not (named or columns),
            f"{path}:{number}: there is no line of names before the first sample: add one, or "
            "say with --columns the numbers of the joints' columns",
        )
        lines = [] if named else [line]
        cells: Sequence[str] = ()
        units: Sequence[str] = ()
        for below in file if named else ():
            lines.append(below)
            if not below.strip() or below.lstrip().startswith("#"):
                comments += "" if _UNITS_LINE.match(below) else below
                continue
            cells = [w.strip(AROUND) for w in below.split(separator)]
            if units or any(map(is_number, cells)) or not any(c.lower() in SCALES for c in cells):
                break
            units, cells, lines[-1] = cells, (), "\n"
        order = [j for w in _NAMES.findall(comments) if (j := _named(w, arm.joints))]
        ConfigurationError.refuse_if(
            not (named or columns) and {*order} == {*arm.joints} and order != list(arm.joints),
            f"{path}: a comment names the joints in another order than base to tip: write them "
            f"as the line of names, without '#', or say which column is which with --columns",
        )
        read = None
        if named or columns:
            heads = words if named else [str(k + 1) for k in range(len(words))]
            read = ColumnHeads(path, arm, heads, columns, units, cells, united)
        if degrees is None and not united:
            angles = itertools.compress(read.scales, ~arm.prismatic) if read else [None]
            _require_spoken(path, comments, {*angles})
        ConfigurationError.refuse_if(
            len(cells) > len(words) and all(map(is_number, cells)),
            f"{path}: {len(cells)} numbers in the first sample, and {len(words)} names: where "
            "commas are decimal, save it with semicolons between columns",
        )
        used = sorted(read.used) if read and len(read.used) < len(words) else None
        table = _NumberTable(path, separator, used, len(words), number - (not named), degrees)
        table.labels = read.labels if read else {}
        time, first = read.time if read else 0, cells if named else words
        if time is not None and ":" in "".join(first[time : time + 1]):
            table.time = time
        values = table.read(itertools.chain(lines, file))
    ConfigurationError.refuse_if(
        table.clock and read and read.time_scale != 1,
        f"{path}: times of day have no unit: take it from the head",
    )
    more = [
        *["decimal commas"] * table.commas,
        *[f"times are counted from the first, {table.clock}"] * bool(table.clock),
        *["times of day that start anew are of the next day"] * bool(table.days),
    ]
    found = read.samples(values, used) if read else _columns(path, arm, values)
    timed = found.seconds or bool(table.clock)
    return replace(found, notes=(*found.notes, *more), degrees=table.degrees, seconds=timed)


def _require_spoken(path: Path, comments: str, heads: set[float | None]) -> None:
    """Refuse comments that speak of another unit of angles than the heads; None names none."""
    spoken = {math.radians(1) if m[1] else 1.0 for m in _SPOKEN.finditer(comments)}
    if None in heads and spoken - {1.0}:
        said = "degrees: say '--units deg' or '--units rad', or write '# units: degrees'"
        raise ConfigurationError(f"{path}: a comment speaks of {said}")
    if spoken and heads - {None} and not spoken & heads:
        unit = "radians" if 1.0 in spoken else "degrees"
        said = "the heads do not: correct one of them, or say '--units deg' or '--units rad'"
        raise ConfigurationError(f"{path}: a comment speaks of {unit}, {said}")


def _opened(path: Path) -> io.TextIOWrapper:
    """Return a text as UTF-8, or UTF-16 where its mark says so; spreadsheets write marks."""
    raw = path.open("rb")
    head, encoding = raw.peek()[:MEBIBYTE], "utf-8-sig"
    utf_16 = head[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        archive, binary = head[:4] == b"PK\x03\x04", b"\0" in head[:4] and not utf_16
        ConfigurationError.refuse_if(
            archive, f"{path}: is a workbook or an archive: save its table as CSV"
        )
        ConfigurationError.refuse_if(
            binary, f"{path}: is no UTF-8 but UTF-16 or binary: save it as UTF-8"
        )
        head.rstrip(bytes(range(128, 256))).decode()  # a letter may be cut at its end
    except ConfigurationError:
        raw.close()
        raise
    except UnicodeDecodeError:  # spreadsheets of Windows; names are compared, whatever they read
        encoding = "utf-16" if utf_16 else "cp1252"
    return io.TextIOWrapper(raw, encoding=encoding, errors="replace")


class ColumnHeads:
    """Which column is which, by the words at their heads.

    By joint: ``order`` (columns), ``scales`` (factors of units, or None), ``called`` (names without
    unit and place). By column: ``units``, ``labels`` (those that name the joint of a numbered
    position), and ``used``. ``time`` is a column in ``time_scale`` seconds, ``parts`` that of
    nanoseconds beside it, or None. ``others`` are joints of the whole model that the arm does not
    list, ``held`` those of them between base and tip.
    """

    def __init__(
        self,
        path: Path | str,
        arm: Arm,
        words: Sequence[str],
        columns: Sequence[str] = (),
        below: Sequence[str] = (),
        first: Sequence[str] = (),
        angles_said: bool = False,
    ) -> None:
        words = [str(w).strip().strip("\"'") for w in words]
        self.path, self.words, self.first = path, words, first
        if any(len(w) > 300 for w in words):  # patterns take the square of it
            raise self._error("a column's name has more than 300 characters")
        if twice := [w for w in words if w and words.count(w) > 1 and not columns]:
            raise self._error(f"column {twice[0]!r:.80} is there twice")
        known = _others(arm)
        names, marks = ([split_unit(word)[k] for word in words] for k in (0, 1))
        named = {} if columns else {i: m for i, w in enumerate(words) if (m := _NAME.fullmatch(w))}
        cells = {i: word.strip(AROUND) for i, word in enumerate(first) if i in named}
        self.labels = {i: c for i, c in cells.items() if not is_number(c)}
        label = {int(m[1] or m[2]): self.labels.get(i) for i, m in named.items()}
        numbers = [_NUMBERED.fullmatch(_without_places(name)) for name in names]
        names = [(m and label.get(int(m[1]))) or n for m, n in zip(numbers, names, strict=True)]
        exact, letters = {*arm.joints, *known}, _LETTERS.get(arm.n, "")
        if yaskawa := bool(letters) and {*letters} <= {*names} - exact and not columns:
            names = [arm.joints[letters.index(n)] if n in {*letters} else n for n in names]
        self.others = {n: i for i, n in enumerate(map(_without_places, names)) if n in known}
        for i, unit in enumerate(below[: len(words)]):
            if marks[i] and unit.lower() not in ("", marks[i]):
                raise self._error(f"column {words[i]!r:.80} says another unit than {unit!r:.40}")
            marks[i] = unit.lower().strip("-") or marks[i]
        scales, stamps = [SCALES.get(m) for m in marks], second_columns(names)
        times = [i for i, w in enumerate(names) if w not in exact and TIME.fullmatch(w)]
        passed: list[int] = []
        if columns:
            times = [self._column(c[2:]) for c in columns if c.startswith("t=")]
            self.order = [self._column(c) for c in columns if not c.startswith("t=")]
            if len(self.order) != arm.n:
                raise self._error(
                    f"{arm.n} columns are needed, one a joint ({', '.join(arm.joints)}); "
                    f"--columns has {len(self.order)}"
                )
            self.others = {}
            united = {*times, *(() if angles_said else self.order)}
        else:
            parts = {*stamps, *stamps.values()}
            times = [i for i in times if i not in parts] or [*stamps] * (len(stamps) == 1)
            taken = {*times, *(stamps[i] for i in times if i in stamps), *self.others.values()}
            rest = {i: n for i, n in enumerate(names) if i not in taken}
            aside = {i for i, n in rest.items() if n not in exact and _NO_POSITION.fullmatch(n)}
            passed = sorted(aside | parts - taken)
            rest = {i: n for i, n in rest.items() if i not in passed}
            stems = {i: _without_places(_UNIT.sub("", words[i])) for i in rest}
            united = {*times, *(i for i, n in stems.items() if _named(n, arm.joints))}
            united |= {i for i, n in stems.items() if TIME.fullmatch(n) or _NUMBERED.fullmatch(n)}
        for i in sorted(united):
            if marks[i] and not scales[i] and not _named(marks[i], arm.joints):
                raise self._error(
                    f"column {words[i]!r:.80} is in {marks[i]!r:.40}, which is not known: give "
                    "angles in deg or rad, lengths in m or mm, times in s, ms, us or ns"
                )
        if not columns:
            self.order = self._joints(arm, rest)
        if len(times) > 1:
            pair = " and ".join(f"{words[i]!r:.80}" for i in times[:2])
            raise self._error(f"columns {pair} are both times")
        self.time, self.parts, self.time_scale = None, None, 1.0
        for i in times:
            self.time, self.parts = i, stamps.get(i)
            # As rostopic writes it.
            self.time_scale = scales[i] or (1e-9 if words[i] == "%time" else 1.0)
        self.units, self.scales = scales, [scales[i] for i in self.order]
        self.called = [_without_places(names[i]) for i in self.order]
        heads, kinds = [words[i] for i in self.order], [marks[i] for i in self.order]
        _require_kinds(path, arm, heads, kinds)
        if len({s is None for s, p in zip(self.scales, arm.prismatic, strict=True) if not p}) > 1:
            raise self._error("some angles have a unit in their head, others none")
        self.used = {*self.order, *times, *self.others.values()}
        self.used |= {stamps[i] for i in times if i in stamps}
        alone = (rf"(?<!\w){re.escape(j)}(?!\w)" for j in arm.joints)  # no guess where it is there
        guessed = not all(re.search(j, head) for j, head in zip(alone, heads, strict=True))
        pairs = (f"{j} = {head!r:.80}" for j, head in zip(arm.joints, heads, strict=True))
        self.held = [held for held in held_joints(arm) if held.name in self.others]
        beside = [n for n in self.others if n not in {held.name for held in self.held}]
        unknown = [i for i in range(len(words)) if not columns and i not in {*self.used, *passed}]
        idle = [i for i in (*passed, *unknown) if i not in named]
        left = [*beside, *(words[i] or f"column {i + 1}" for i in idle)]
        shown = ", ".join(f"{w!r:.80}" for w in left[:6])
        more = f" and {len(left) - 6} more" * (len(left) > 6)
        what = "the chain leaves out" if beside else "no positions in"
        self.notes = (
            *[NO_TIMES] * (not times),
            *["units are of the line below the head"] * bool(below),
            *[
                f"{', '.join(letters)} are taken for the joints base to tip, with the signs and "
                "zeros of the robot's description"
            ]
            * yaskawa,
            *["Grad is taken for degrees, not for gon"] * ("grad" in kinds),
            *["columns: " + ", ".join(pairs)] * guessed,
            *[f"{what} {shown}{more}: not used"] * bool(left),
        )

    def samples(self, values: Array, used: Sequence[int] | None) -> TrajectoryFile:
        """What an array (N, ...) of these columns, or of those that are used, holds."""
        at = {column: k for k, column in enumerate(used or range(len(self.words)))}
        others = {w: (values[:, at[i]], self.units[i]) for w, i in self.others.items()}
        t = None if self.time is None else values[:, at[self.time]] * self.time_scale
        if t is not None and self.parts is not None:
            part = values[:, at[self.parts]]
            if (t % 1).any() or (part < 0).any() or (part >= 1e9).any():
                two = f"{self.words[self.parts]!r:.80} and the column of seconds"
                raise self._error(f"{two} are not whole seconds and nanoseconds of them")
            t = t + 1e-9 * part
        Q = values[:, [at[i] for i in self.order]]
        scale = None if self.time is None else self.units[self.time]
        known = bool(scale or self.time_scale != 1 or self.parts is not None)
        return TrajectoryFile(Q, t, self.notes, others, self.scales, seconds=known)

    def _error(self, words: str) -> ConfigurationError:
        return ConfigurationError(f"{self.path}: {words}")

    def _column(self, word: str) -> int:
        """Column by its name, or by its number from 1."""
        if word in self.words:
            return list(self.words).index(word)
        if word.isdecimal() and 1 <= int(word) <= len(self.words):
            return int(word) - 1
        raise self._error(f"--columns: no column {word!r:.80}; there are {', '.join(self.words)}")

    def _joints(self, arm: Arm, names: Mapping[int, str]) -> list[int]:
        """The column of each joint: by name, by the end of a name, or by number."""
        short = {i: _without_places(name) for i, name in names.items()}
        count = {i: int(m[1]) for i, n in short.items() if (m := _NUMBERED.fullmatch(n))}
        found = {i: _named(short[i], arm.joints) for i in names}
        first = min(count.values(), default=0)
        all_of_them = sorted(count.values()) == list(range(first, first + arm.n))
        if all_of_them and first in (0, 1) and not all(found[i] for i in count):
            found.update({i: arm.joints[k - first] for i, k in count.items()})
            said = {_named(w, arm.joints) for w in _NAMES.findall(" ".join(self.first))}
            if len(said - {None}) > 1 or "" in self.labels.values():
                raise self._error(
                    f"{self.words[min(count)]!r:.80} is numbered, and the first sample names "
                    "joints, or leaves names empty: say with --columns A,B,... which columns "
                    "are the joints, base to tip"
                )
        for i, joint in found.items():
            same = [self.words[k] for k in names if found[k] == joint]
            if joint and len(same) > 1:
                pair = " and ".join(f"{w!r:.80}" for w in same[:2])
                raise self._error(f"columns {pair} could both be joint {joint!r}")
            if not joint and isinstance(self.path, Path):  # a stream has what else the robot tells
                if {"x", "y", "z"} <= {*map(str.lower, short.values())} and not any(found.values()):
                    raise self._error(f"has poses of the tool (x, y, z): {_POSES_TABLE}")
                beside = f" of {names[i]!r:.80}" if names[i] in self.labels.values() else ""
                if i in count and len(count) > arm.n:
                    beside = f" ({len(count)} are numbered, for {arm.n} joints)"
                raise self._error(
                    f"unknown column {self.words[i]!r:.80}{beside}: the joints are "
                    f"{', '.join(arm.joints)}, and times are in a column 't' or 'time' "
                    "(--columns A,B,... says which columns are the joints)"
                )
        column = {joint: i for i, joint in found.items()}
        for joint in arm.joints:
            if joint not in column:
                unknown = [self.words[i] for i in names if not found[i]]
                close = [w for w in unknown if joint in w]
                other = f"; {(close or unknown)[0]!r:.80} is none" if unknown else ""
                other += ": after a joint's name stands a unit, as _deg or (rad)" * bool(close)
                raise self._error(f"no column for joint {joint!r}{other}")
        return [column[j] for j in arm.joints]


def split_unit(word: str) -> tuple[str, str]:
    """Return the name in a column's head and its unit, or all of the head if that is not known."""
    found = _UNIT.search(word)
    unit = next(filter(None, found.groups())).lower() if found else ""
    return (word[: found.start()] if found and unit in SCALES else word), unit


def second_columns(names: Sequence[str]) -> dict[int, int]:
    """Columns of whole seconds, as ROS writes them, each with that of its nanoseconds."""
    found: dict[str, dict[bool, int]] = {}
    for i, name in enumerate(names):
        if said := _STAMP.fullmatch(name):
            found.setdefault(said[1].lower(), {})[bool(said[2])] = i
    return {two[False]: two[True] for two in found.values() if len(two) == 2}


def _without_places(name: str) -> str:
    """What is left of ``/joint_states/NAME/position``: NAME; of ``position[0]``: position_0."""
    parts = [p for p in re.split(r"[/.\[\]]+", name) if p]
    kept = [p for p in parts if p.lower() not in _PLACES]
    if kept and all(p.isdecimal() for p in kept):
        return f"position_{kept[-1]}"
    return kept[-1] if kept else name


def _named(name: str, joints: Sequence[str]) -> str | None:
    """The one joint of that name, or with another prefix, "_joint", "_pos", "_angle" or case."""
    if name in joints:
        return name

    def plain(word: str) -> str:
        return re.sub(r"([_-]joint)?([_ ](pos(ition)?|angle))?$", "", word.lower())

    low = plain(name)
    close = [
        j
        for j in joints
        if low == plain(j) or low.endswith(f"_{plain(j)}") or plain(j).endswith(f"_{low}")
    ]
    return close[0] if len(close) == 1 else None


@dataclass(eq=False)
class _NumberTable:
    """Reads numbers."""

    path: Path
    separator: str | None
    used: Sequence[int] | None
    width: int
    line: int  # the number of the line that was read last
    degrees: bool | None = None  # what a comment says of units
    commas: bool = False  # decimal commas were found
    time: int | None = None  # the column of times of day
    clock: str = ""  # the first of them
    days: int = 0  # how often these passed midnight
    labels: Mapping[int, str] = field(default_factory=dict)
    _row: str = ""  # of that line
    _start: float = 0.0
    _last: float = -math.inf

    def read(self, source: Iterable[str]) -> Array:
        """Rows (N, used), from the line after ``line`` on."""
        import warnings

        clocks: dict[int | str, Callable[[str], float]] = {}
        if self.time is not None:
            clocks[self.time] = self._seconds
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a table without a row is no surprise
            try:
                table = np.loadtxt(
                    self._rows(source), delimiter=self.separator, ndmin=2, comments=None,
                    usecols=self.used, converters=clocks, encoding=None,
                )  # fmt: skip
            except ValueError as error:
                cause = (clocks and error.__cause__) or error  # what `_seconds` raised
                if not isinstance(cause, ConfigurationError):
                    cause = self._fault(" ".join(str(cause).split()))
                raise cause from None
        return np.asarray(table, dtype=float).reshape(-1, len(self.used or range(self.width)))

    def _rows(self, source: Iterable[str]) -> Iterator[str]:
        """Lines of numbers alone, one by one, so that faults are of the last one."""
        for line in source:
            self.line += 1
            if "#" in line:
                self.degrees = stated_unit(f"{self.path}:{self.line}", line, self.degrees)
                line = line.partition("#")[0]
            if not line.strip():
                continue
            if self.labels:
                self._require_labels(line.split(self.separator))
            if self.separator != "," and "," in line:
                self.commas, line = True, line.replace(",", ".")
            if '"' in line:  # one that nothing ends would take all that follows as one cell
                line = _QUOTED.sub(r"\1", line)
            first, self._row = not self._row, line
            if first and self.used is None and len(line.split(self.separator)) != self.width:
                raise self._fault("")
            yield line

    def _require_labels(self, cells: Sequence[str]) -> None:
        """Refuse cells that name another joint than in the first sample."""
        for i, name in self.labels.items():
            if i < len(cells) > 1 and (other := cells[i].strip(AROUND)) != name:
                raise ConfigurationError(
                    f"{self.path}:{self.line}: column {i + 1} names {other!r:.80}, not "
                    f"{name!r:.80} as before: say with --columns A,B,... which columns "
                    "are the joints, base to tip"
                )

    def _seconds(self, word: str) -> float:
        """Seconds of a time of day, perhaps of a date, from the first one."""
        word = word.strip(" \t\r\n\"'")
        self.clock, begin = self.clock or word, not self.clock
        said, first = (_CLOCK.fullmatch(w) for w in (word, self.clock))
        if said is None or first is None or (said[1] is None) != (first[1] is None):
            raise ConfigurationError(
                f"{self.path}:{self.line}: time {word!r:.40}: give all in seconds, all as "
                "HH:MM:SS, or all as YYYY-MM-DD HH:MM:SS"
            )
        day = datetime.date.fromisoformat(said[1]).toordinal() if said[1] else 0
        zone = re.findall(r"[-+]?\d\d", said[5] or "")
        away = 60 * int(zone[0]) + math.copysign(int(zone[1]), int(zone[0])) if zone else 0
        seconds = 60 * (60 * int(said[2]) + int(said[3]) - away) + float(said[4].replace(",", "."))
        self.days += not said[1] and seconds < self._last - 43200  # by half a day and more
        self._last = seconds
        seconds += (day + self.days) * 86400
        self._start = seconds if begin else self._start
        return seconds - self._start

    def _fault(self, words: str) -> ConfigurationError:
        """Say why the last line is no row of numbers, or else ``words``."""
        cells = [cell.strip() for cell in self._row.split(self.separator)]
        used, count = self.used or range(self.width), len(cells)
        if count <= used[-1] or (count > self.width and self.used is None):
            words = f"{count} columns, and {self.width} in the first line: give each line the same"
            return ConfigurationError(f"{self.path}:{self.line}: {words} columns")
        numbers = [i for i in used if i != self.time]
        odd = [i for i in numbers if "_" in cells[i] or not is_number(cells[i])]
        if odd:
            words = f"column {odd[0] + 1}: {cells[odd[0]]!r:.80} is no number"
            if re.search('["°]', cells[odd[0]]):
                words += ": write numbers alone, and units in the head, as 'J1 (deg)'"
        return ConfigurationError(f"{self.path}:{self.line}: {words:.300}")


def is_number(word: str) -> bool:
    """Return True where ``word`` is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True
