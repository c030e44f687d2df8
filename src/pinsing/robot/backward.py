"""Chains from anywhere to anywhere in a tree: up from the base to a common link, down to the tip.

From child to parent a joint's motion is the inverse one: with the same value about the opposite
axis. So joints on the way up keep their names, values, signs and limits, and only placements and
axes are turned round: what moves is the tip, seen from the base. With X the shift of the base's
motion to the tip, its Jacobian is J_tip - X J_base in the axes of the base.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing.robot.joint_axis import axis_rotation, joint_axis
from pinsing.robot.subchains import LONGEST
from pinsing.robot.tip import joint_path


@dataclass(frozen=True)
class Way:
    """Joints of a tree between two bodies.

    Attributes
    ----------
    up : tuple of int
        Those from the base towards the root, up to the body that the ways to both share.
    down : tuple of int
        Those from there to the tip.
    before : tuple of int
        Those from the root to that body.
    """

    up: tuple[int, ...]
    down: tuple[int, ...]
    before: tuple[int, ...]

    @property
    def path(self) -> tuple[int, ...]:
        """All joints from the base to the tip."""
        return (*self.up, *self.down)

    def told(self, model: pin.Model) -> Iterator[str]:
        """What is said of joints before the chain, and of those that are traversed backwards."""

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
    """The joints of a model, with one of its frames, fixed to any joint, as the world.

    Parameters
    ----------
    model : pin.Model
        All its joints have one degree of freedom, and lie between base and tip.
    base : int
        Index of the frame that becomes the world.
    tip : int, optional
        Index of a frame that is taken over.

    Returns
    -------
    turned : pin.Model
        With the joints from the base to the tip, in this order.
    carried : dict of int to (int, pin.SE3)
        Which joint of it carries the body of each joint of ``model``, and where.
    """
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
    out: pin.Model,
    parent: int,
    joint: pin.JointModel,
    place: pin.SE3,
    model: pin.Model,
    index: int,
) -> int:
    """Add a joint with the name and limits that one of ``model`` has."""
    here = model.joints[index]
    q, v = slice(here.idx_q, here.idx_q + here.nq), slice(here.idx_v, here.idx_v + here.nv)
    effort, speed = model.effortLimit[v], model.velocityLimit[v]
    low, high = model.lowerPositionLimit[q], model.upperPositionLimit[q]
    name = model.names[index]
    number = int(out.addJoint(parent, joint, place, name, effort, speed, low, high))
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
