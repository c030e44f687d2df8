"""Pinocchio models: built from a description, joints taken out, any frame made the world.

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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO, cast

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.description.urdf import Description
from pinsing.errors import RobotFileError
from pinsing.robot.chains import LONGEST, frame_index, joint_path
from pinsing.robot.joints import axis_rotation, joint_axis

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


@dataclass(frozen=True)
class Way:
    """Joints of a tree between two bodies."""

    up: tuple[int, ...]  # from the base to the body that the ways from the root to both share
    down: tuple[int, ...]  # from there to the tip
    before: tuple[int, ...]  # from the root to there

    @property
    def path(self) -> tuple[int, ...]:
        """All joints from the base to the tip."""
        return (*self.up, *self.down)

    def told(self, model: pin.Model) -> Iterator[str]:
        """Return the notes on joints before the chain, and on those traversed backwards."""

        def names(joints: tuple[int, ...]) -> str:
            return ", ".join(model.names[j] for j in joints)

        if not self.up:
            if self.before:
                yield f"joints before the base are locked: {names(self.before)}"
            return
        then = f", then {names(self.down)}" if self.down else ""
        yield (
            f"from the base towards the root, so traversed backwards: {names(self.up)}{then}; "
            "values, signs and limits are those of the robot, in this order"
        )
        if self.before:
            yield f"joints nearer the root do not matter to this chain: {names(self.before)}"
        if len(self.path) > LONGEST:
            yield f"{len(self.path)} joints are many: the closed forms may not be complete in time"


def way_between(model: pin.Model, start: int, end: int) -> Way:
    """The way between the bodies of two joints, given by index; 0 is the root."""
    before, after = joint_path(model, start), joint_path(model, end)
    shared = 0
    while shared < min(len(before), len(after)) and before[shared] == after[shared]:
        shared += 1
    return Way(before[shared:][::-1], after[shared:], before[:shared])


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
