"""Pinocchio models: their joints, how one is built, joints taken out, any frame made the world.

From child to parent a joint's motion is the inverse one: with the same value about the opposite
axis. So joints from the base towards the root keep their names, values, signs and limits, and only
placements and axes are reversed: what moves is the tip, seen from the base. With X the shift of the
base's motion to the tip, its Jacobian is J_tip - X J_base in the axes of the base.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import BinaryIO, cast

import numpy as np
import pinocchio as pin

from pinsing.description.urdf import Description
from pinsing.errors import JointError, RobotFileError
from pinsing.measures import Array
from pinsing.robot.arm import Coupling
from pinsing.robot.chains import frame_index

_Z = np.eye(3)[2]


def joint_axis(joint: pin.JointModel, name: str = "") -> tuple[Array, bool]:
    """Return a joint's unit axis (3,) and if it slides; JointError for screws and compounds."""
    JointError.refuse_if(
        "Composite" in joint.shortname(), name, "is several joints in one; write one joint for each"
    )
    data = joint.createData()
    q = np.zeros(joint.idx_q + joint.nq)  # of the whole model up to it: calc reads from idx_q on
    q[joint.idx_q] = 1.0 if joint.nq == 2 else 0.0
    joint.calc(data, q)
    motion = np.array(data.S).ravel()
    slide, turn = np.abs(motion[:3]).max(), np.abs(motion[3:]).max()
    JointError.refuse_if(
        min(slide, turn) > 0, name, "is a screw; only revolute and prismatic joints can be analysed"
    )
    prismatic = bool(slide > turn)
    return (motion[:3] if prismatic else motion[3:]), prismatic


def axis_rotation(axis: Array) -> Array:
    """Rotation (3, 3) that takes z to the unit ``axis``; a signed permutation where it is one."""
    sizes = [abs(x) for x in axis.tolist()]
    k = sizes.index(max(sizes))
    if max(sizes[k - 1], sizes[k - 2]) < 1e-12:
        out = np.zeros((3, 3))  # columns: axes k+1, k+2, k; the last two turned over
        sign = 1.0 if axis[k] > 0 else -1.0
        out[(k + 1) % 3, 0], out[(k + 2) % 3, 1], out[k, 2] = 1.0, sign, sign
        return out
    if axis[2] > -0.9:
        return np.array(pin.Quaternion.FromTwoVectors(_Z, axis).matrix())
    # Near -z that loses half of the digits: half a turn about x first.
    over = np.array([1.0, -1.0, -1.0])
    turned = np.array(pin.Quaternion.FromTwoVectors(_Z, over * axis).matrix())
    return np.asarray(over[:, None] * turned)


Follow = tuple[str, float, float]
"""Name of the joint that is followed, multiplier, offset (radians or metres)."""


def leader_of(name: str, mimics: Mapping[str, Follow]) -> Follow:
    """Follow mimics of mimics to the joint that moves by itself."""
    leader, multiplier, offset = mimics[name]
    while leader in mimics:
        further, m, o = mimics[leader]
        leader, multiplier, offset = further, multiplier * m, multiplier * o + offset
    return leader, multiplier, offset


def couple(
    names: Sequence[str], independent: Sequence[str], leaders: Mapping[str, Follow]
) -> Coupling:
    """Coupling of the joints ``names`` of a model, of which ``independent`` move by themselves."""
    matrix = np.zeros((len(names), len(independent)))
    offset = np.zeros(len(names))
    for row, name in enumerate(names):
        leader, multiplier, shift = leaders.get(name, (name, 1.0, 0.0))
        matrix[row, independent.index(leader)] = multiplier
        offset[row] = shift
    return Coupling(matrix, offset)


def coupled_limits(
    lower: Array, upper: Array, coupling: Coupling, names: Sequence[str], independent: Sequence[str]
) -> tuple[Array, Array]:
    """Return limits of free joints that keep their followers in theirs; JointError if none do."""
    low = np.full(len(independent), -np.inf)
    high = np.full(len(independent), np.inf)
    for row, name in enumerate(names):
        moved = np.flatnonzero(coupling.matrix[row])
        if len(moved) == 0:  # multiplier zero: it stands still
            continue
        column = int(moved[0])
        m, o = coupling.matrix[row, column], coupling.offset[row]
        ends = sorted(((lower[row] - o) / m, (upper[row] - o) / m))
        low[column], high[column] = max(low[column], ends[0]), min(high[column], ends[1])
        JointError.refuse_if(
            low[column] > high[column],
            name,
            f"cannot follow {independent[column]!r} within its own limits",
        )
    return low, high


def locked_at(model: pin.Model, mimics: Mapping[str, Follow]) -> Array:
    """Return the values of locked joints: neutral, within limits; followers follow."""
    q = pin.neutral(model)
    for joint in model.joints[1:]:
        if joint.nq == 1:
            i = joint.idx_q
            low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
            if low <= high:
                q[i] = float(np.clip(q[i], low, high))
    for name in mimics:
        leader, multiplier, shift = leader_of(name, mimics)
        here = model.joints[model.getJointId(name)]
        there = model.joints[model.getJointId(leader)]
        angle = np.arctan2(q[there.idx_q + 1], q[there.idx_q]) if there.nq == 2 else q[there.idx_q]
        value = multiplier * angle + shift
        q[here.idx_q : here.idx_q + here.nq] = (
            value if here.nq == 1 else (np.cos(value), np.sin(value))
        )
    return np.array(q)


def chain_limits(model: pin.Model) -> tuple[Array, Array, np.ndarray, list[str]]:
    """Limits of each joint of a chain, which ones slide, and notes."""
    lower, upper, prismatic, notes = [], [], [], []
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        axis, slides = joint_axis(joint, name)
        JointError.refuse_if(
            not np.isfinite(axis).all() or abs(np.linalg.norm(axis) - 1) > 1e-6,
            name,
            f"its axis {axis.tolist()} is not a direction",
        )
        JointError.refuse_if(
            not np.isfinite(model.jointPlacements[index].homogeneous).all(),
            name,
            "its placement is not finite",
        )
        low, high = -np.inf, np.inf
        if joint.nq == 1:
            low = float(model.lowerPositionLimit[joint.idx_q])
            high = float(model.upperPositionLimit[joint.idx_q])
            JointError.refuse_if(
                np.isnan(low) or np.isnan(high),
                name,
                "its limits are not numbers; set lower and upper",
            )
            JointError.refuse_if(
                low > high,
                name,
                f"lower limit {low:g} is above upper limit {high:g}",
                limits=(low, high),
            )
            if abs(low) > 1e300 or abs(high) > 1e300:  # Pinocchio's way of saying "no limit"
                low = -np.inf if abs(low) > 1e300 else low
                high = np.inf if abs(high) > 1e300 else high
                notes.append(f"joint {name} has no limits")
            if low == high:
                notes.append(f"WARNING: joint {name} cannot move: both its limits are {low:g}")
        lower.append(low)
        upper.append(high)
        prismatic.append(slides)
    limits, sliding = np.array([lower, upper]), np.array(prismatic, dtype=bool)
    largest = np.abs(limits).max(axis=0, initial=0.0)
    turning = largest[~sliding & np.isfinite(largest)]
    # More than two turns each way of every joint, and fewer than stand for "no limit".
    if len(turning) > 1 and (turning > 4 * np.pi).all() and turning.max() <= 3600:
        notes.append(
            f"WARNING: joint limits up to {turning.max():g} rad: are they degrees? The file must "
            "have radians"
        )
    reach = sum(float(np.linalg.norm(p.translation)) for p in model.jointPlacements[2:])
    if reach > 50:  # no arm is; the smallest one in millimetres is
        notes.append(
            f"WARNING: links of {reach:.0f} m in a row: are they millimetres? The file must have "
            "metres"
        )
    return limits[0], limits[1], sliding, notes


# File descriptor 2 belongs to the whole process: one capture at a time.
_CAPTURE = threading.Lock()


def build_model(description: Description) -> pin.Model:
    """Return the Pinocchio model of a description: its root fixed, its mimic joints free."""
    with _stderr_of_c() as store:
        try:
            return pin.buildModelFromXML(description.kinematics)
        except (ValueError, RuntimeError, IndexError) as error:
            reason = str(error)
        store.seek(0)
        printed = store.read(20_000).decode(errors="replace")
    said = " ".join(
        word for line in printed.splitlines() if " at line " not in line for word in line.split()
    )
    raise RobotFileError(f"Pinocchio cannot build it: {said or reason}", description.path)


@contextlib.contextmanager
def _stderr_of_c() -> Iterator[BinaryIO]:
    """Catch what C++ prints to file descriptor 2; a process without one is left as it is."""
    with _CAPTURE, _store() as store:
        sys.stderr.flush()
        try:
            saved = os.dup(2)
        except OSError:
            yield store
            return
        try:
            os.dup2(store.fileno(), 2)
            yield store
        finally:
            os.dup2(saved, 2)
            os.close(saved)


def _store() -> BinaryIO:
    """A file without a name, in memory where there is such a thing."""
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # some sandboxes refuse it
            return os.fdopen(os.memfd_create("stderr of pinsing"), "w+b")
    import tempfile  # with shutil and its archives: a start of half a second can do without

    return cast("BinaryIO", tempfile.TemporaryFile())


def lock_joints(model: pin.Model, lock: Sequence[int], reference: Array) -> pin.Model:
    """Return a copy of ``model`` without the joints to lock, which stand as in ``reference`` (nq,).

    Pinocchio's ``buildReducedModel`` finds a joint's frame by name alone: so each joint gets a
    frame before all others, and meanwhile frames that share a name get unique ones.
    """
    model = model.copy()
    if not lock:
        return model
    _add_missing_joint_frames(model)
    original = make_names_unique(model)
    reduced = pin.buildReducedModel(model, list(lock), reference)
    for joint in range(1, reduced.njoints):
        reduced.names[joint] = original.get(reduced.names[joint], reduced.names[joint])
    for frame in reduced.frames:
        frame.name = original.get(frame.name, frame.name)
    return reduced


def reroot(model: pin.Model, base: str) -> None:
    """Make the frame ``base``, which is fixed to the universe, the world of ``model``."""
    back = model.frames[frame_index(model, base)].placement.inverse()
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = back * model.jointPlacements[joint]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = back * frame.placement


def _add_missing_joint_frames(model: pin.Model) -> None:
    missing = [
        joint
        for joint in range(1, model.njoints)
        if not model.existFrame(model.names[joint], pin.FrameType.JOINT)
    ]
    if not missing:
        return
    for joint in missing:
        model.addJointFrame(joint, 0)
    universe, *others = (pin.Frame(frame) for frame in model.frames)
    others.sort(key=lambda frame: frame.type != pin.FrameType.JOINT)  # stable
    for index, frame in enumerate([universe, *others]):
        frame.parentFrame = 0  # the indices have changed, and nothing here needs them
        model.frames[index] = frame


def make_names_unique(model: pin.Model) -> dict[str, str]:
    """Make names of frames, and of their joints, unique; return the old name of each new one."""
    count = Counter(frame.name for frame in model.frames)
    original: dict[str, str] = {}
    for index, frame in enumerate(model.frames):
        old = frame.name
        if count[old] == 1:
            continue
        new = f"{old} ({index})"
        while new in count or new in original:
            new += "'"
        original[new] = old
        frame.name = new
        if frame.type == pin.FrameType.JOINT and model.names[frame.parentJoint] == old:
            model.names[frame.parentJoint] = new
    return original


def turned_round(
    model: pin.Model, base: int, tip: int | None = None
) -> tuple[pin.Model, dict[int, tuple[int, pin.SE3]]]:
    """Return the model with frame ``base`` as the world, and the joint that carries each body."""
    # Every joint has one degree of freedom and lies between base and ``tip``, a frame to keep. The
    # dictionary has, for each joint of ``model``, the joint that carries its body, and where.
    out = pin.Model()
    out.name = model.name
    frame = model.frames[base]
    carried: dict[int, tuple[int, pin.SE3]] = {}
    carrier, place, joint = 0, frame.placement.inverse(), int(frame.parentJoint)
    while joint:
        carried[joint] = carrier, place
        back, turn = _opposite(model, joint)
        carrier = _add(out, carrier, back, place * turn, model, joint)
        place = (model.jointPlacements[joint] * turn).inverse()
        joint = int(model.parents[joint])
    carried[0] = carrier, place
    for joint in range(1, model.njoints):
        if joint in carried:
            continue
        carrier, place = carried[int(model.parents[joint])]
        place = place * model.jointPlacements[joint]
        number = _add(out, carrier, model.joints[joint], place, model, joint)
        carried[joint] = number, pin.SE3.Identity()
    if tip is not None:
        end = model.frames[tip]
        carrier, place = carried[int(end.parentJoint)]
        out.addFrame(pin.Frame(end.name, carrier, 0, place * end.placement, end.type))
    return out, carried


def _add(
    out: pin.Model, parent: int, joint: pin.JointModel, place: pin.SE3, model: pin.Model, index: int
) -> int:
    """Add a joint with the name and limits that one of ``model`` has."""
    here = model.joints[index]
    q, v = slice(here.idx_q, here.idx_q + here.nq), slice(here.idx_v, here.idx_v + here.nv)
    effort, speed = model.effortLimit[v], model.velocityLimit[v]
    low, high = model.lowerPositionLimit[q], model.upperPositionLimit[q]
    number = int(out.addJoint(parent, joint, place, model.names[index], effort, speed, low, high))
    out.addJointFrame(number)
    return number


def _opposite(model: pin.Model, index: int) -> tuple[pin.JointModel, pin.SE3]:
    """A joint along z that undoes one of ``model``, value by value, and how its frame is turned."""
    joint = model.joints[index]
    axis, slides = joint_axis(joint, model.names[index])
    turn = pin.SE3(axis_rotation(-axis), np.zeros(3))
    if slides:
        return pin.JointModelPZ(), turn
    return (pin.JointModelRUBZ() if joint.nq == 2 else pin.JointModelRZ()), turn
