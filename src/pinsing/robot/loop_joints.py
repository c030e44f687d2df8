"""Joints that a loop file makes balls, universal joints or fixed: a new model of single turns.

A URDF has none of the first two. As in gepetto/example-parallel-robots: ``joint_name`` lists joints
of the URDF, ``joint_type`` what they really are. A ball becomes turns about x, y and z of the
joint's frame, named NAME_X, NAME_Y and NAME_Z; a universal joint two of them.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing.description.xml_tree import suggestion
from pinsing.description.yaml_tree import YamlNode
from pinsing.errors import PinsingError
from pinsing.robot.joint_space import model_q

_TURNS = {
    "SPHERICAL": "XYZ",
    "CARDAN": "XY",
    **{f"UJOINT_{a}{b}": a + b for a in "XYZ" for b in "XYZ" if a != b},
    "FIXED": "",
}


def replaced_joints(model: pin.Model, keys: dict[str, YamlNode]) -> pin.Model:
    """The model with the joints that ``joint_name`` lists replaced by those of ``joint_type``.

    Raises
    ------
    RobotFileError
        If one of the two lists is missing, they differ in length, or name what is not there.
    """
    for one, other in (("joint_name", "joint_type"), ("joint_type", "joint_name")):
        if one not in keys:
            raise keys[other].error(f"missing key {one!r}: {other} needs it beside it")
    names, kinds = (_entries(keys[k]) for k in ("joint_name", "joint_type"))
    if len(names) != len(kinds):
        raise keys["joint_type"].error(
            f"{len(names)} joints need {len(names)} types, found {len(kinds)}"
        )
    wanted: dict[str, str] = {}
    known = tuple(model.names)[1:]
    for name, kind in zip(names, kinds, strict=True):
        text, word = name.text(), kind.text().upper()
        if text not in known:
            raise name.error(f"unknown joint {text[:60]!r}: {suggestion(text, known)}")
        if text in wanted:
            raise name.error(f"joint {text!r} is given twice: remove one")
        if word not in _TURNS:
            raise kind.error(f"unknown value {word[:60]!r}: {suggestion(word, tuple(_TURNS))}")
        wanted[text] = _TURNS[word]
    return _rebuilt(model, wanted) if wanted else model


def _entries(node: YamlNode) -> list[YamlNode]:
    """Entries of a list that may be empty."""
    return [] if node.empty_list else node.items("joint")


def without_joint(model: pin.Model, index: int, value: float) -> pin.Model:
    """The model with a joint fixed at a value, radians or metres."""
    data, q = model.createData(), np.zeros(model.nv)
    q[model.joints[index].idx_v] = value
    pin.forwardKinematics(model, data, model_q(model, q))
    moved = model.jointPlacements[index].inverse() * data.liMi[index]
    return _rebuilt(model, {model.names[index]: ""}, moved)


def _rebuilt(model: pin.Model, wanted: dict[str, str], moved: pin.SE3 | None = None) -> pin.Model:
    """Joints made others; one that is fixed stays ``moved`` from its place."""
    out = pin.Model()
    out.name = model.name
    # Where a joint of the old model is carried now: joint, and the place of its frame there.
    where: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
    for k in range(1, model.njoints):
        name, joint = model.names[k], model.joints[k]
        parent, at = where[int(model.parents[k])]
        place = at * model.jointPlacements[k]
        if name not in wanted:
            low, high = (
                np.array(x[joint.idx_q : joint.idx_q + joint.nq])
                for x in (model.lowerPositionLimit, model.upperPositionLimit)
            )
            speed = np.array(model.velocityLimit[joint.idx_v : joint.idx_v + joint.nv])
            effort = np.array(model.effortLimit[joint.idx_v : joint.idx_v + joint.nv])
            index = out.addJoint(parent, joint, place, name, effort, speed, low, high)
            where.append((index, pin.SE3.Identity()))
            continue
        for axis in wanted[name]:
            turn = getattr(pin, f"JointModelRUB{axis}")()
            parent = out.addJoint(parent, turn, place, f"{name}_{axis}")
            place = pin.SE3.Identity()
        # A fixed joint leaves its place to what it carries.
        where.append((parent, place if moved is None else place * moved))
    for frame in list(model.frames)[1:]:
        parent, at = where[int(frame.parentJoint)]
        out.addFrame(pin.Frame(frame.name, parent, 0, at * frame.placement, frame.type), False)
    if out.njoints == 1:
        raise PinsingError(f"{model.name}: all joints are FIXED in the loop file: nothing moves")
    return out
