"""Taking joints out of a model, and moving its world."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pinocchio as pin

from pinsing._types import Array
from pinsing.robot.tip import frame_index


def lock_joints(model: pin.Model, lock: Sequence[int], reference: Array) -> pin.Model:
    """Copy of ``model`` without the joints to lock, which stand as in ``reference`` (nq,).

    Pinocchio (``buildReducedModel``) looks for the frame of a joint by name alone: it gives up
    where a link or a fixed joint has the same name, where there is none, or where another frame
    comes first. So every joint gets a frame, before all others, and frames that share a name get
    names of their own meanwhile.
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
    """Give frames that share a name, and the joints that are theirs, a name of their own.

    Returns
    -------
    dict of str to str
        The old name of each new one.
    """
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
