"""Closed loops: a URDF of the spanning tree and a side-car file -> Mechanism.

The side-car is YAML in the style of gepetto/example-parallel-robots: ``closed_loop`` (pairs of
frames that coincide), ``type`` (how they do) and ``name_mot`` (the actuated joints); to which
pinsing adds ``output`` (whose motion counts) and ``home`` (where to start closing the loops). Its
``joint_name`` and ``joint_type`` (SPHERICAL, UJOINT_XY, ..., FIXED) make other joints of some.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.description.urdf_elements import NO_LIMITS
from pinsing.description.xml_tree import suggestion
from pinsing.description.yaml_tree import YamlNode, compose
from pinsing.errors import JointError, OptionError, PinsingError
from pinsing.robot.chains import frame_index
from pinsing.robot.idle_spins import without_idle_spins
from pinsing.robot.joints import joint_axis
from pinsing.robot.loop_joints import replaced_joints
from pinsing.robot.mechanism import LOOP_KINDS, Loop, Mechanism
from pinsing.robot.source import HasModel, Source, given_file, given_model
from pinsing.robot.task import ROW_NAMES, Task, parse_task

__all__ = ["LOOP_KINDS", "Loop", "Mechanism", "load_mechanism"]


@checked
def load_mechanism(
    robot: str | os.PathLike[str] | pin.Model | HasModel,
    loops: str | os.PathLike[str] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    *,
    length_scale: float = 1.0,
) -> Mechanism:
    """Read a spanning tree and the loops that close it.

    Parameters
    ----------
    robot : str, path, pin.Model or object with ``.model``
        A URDF or xacro file, the name of a known robot, the text of a URDF, or a model.
    loops : path, optional
        The side-car file; by default ``NAME.loops.yaml`` beside ``NAME.urdf``.
    packages : mapping of str to path, optional
        Folders of ROS packages by name.
    length_scale : float
        Metres; lengths are divided by it before singular values are taken.

    Returns
    -------
    Mechanism
        With everything that was assumed in ``mechanism.notes``.

    Raises
    ------
    PinsingError
        RobotFileError with file and line where the side-car or the tree is wrong, UnknownNameError,
        JointError or OptionError: one line that says what is wrong, where, and what to do.

    Examples
    --------
    >>> import pinsing
    >>> mechanism = pinsing.load_mechanism("five_bar")
    >>> mechanism.n, mechanism.inputs
    (4, ('q1', 'q2'))
    """
    tree = _tree(robot, packages)
    model, source = tree.model, tree.source
    if loops is None:
        if source.path is None:
            raise OptionError("a loop file is needed: give the path of a .loops.yaml file")
        loops = source.path.with_name(source.path.name.partition(".")[0] + ".loops.yaml")
    path = Path(loops)
    keys = compose(path).mapping(
        ("closed_loop", "type", "name_mot"),
        ("output", "home", "name", "source", "joint_name", "joint_type"),
    )
    if "joint_name" in keys or "joint_type" in keys:
        model = replaced_joints(model, keys)
    lower, upper, prismatic = _limits(model)
    joints = tuple(model.names)[1:]
    frame, rows, said = _output(keys, model)
    closed = _loops(keys["closed_loop"], keys["type"], model)
    _check_on_loop(model, frame, closed, keys.get("output", keys["closed_loop"]))
    actuated = _actuated(keys["name_mot"], joints)
    _check_mimics(tree.follow, [joints[k] for k in actuated])
    made = Mechanism(
        name=keys["name"].text() if "name" in keys else tree.name,
        model=model,
        joints=joints,
        prismatic=prismatic,
        lower=lower,
        upper=upper,
        actuated=actuated,
        loops=closed,
        output=frame,
        task=rows,
        length_scale=float(length_scale),
        home=_home(keys.get("home"), joints),
        notes=(*tree.notes, *said),
        source=source,
        loop_file=path,
    )
    # An output that nobody named may be on a link that spins.
    return without_idle_spins(made, keep_output="output" in keys)


def _output(keys: dict[str, YamlNode], model: pin.Model) -> tuple[str, Task, tuple[str, ...]]:
    """Frame and rows of the output; files made for other programs name none."""
    if "output" in keys:
        output = keys["output"].mapping(("frame", "rows"))
        return _frame(output["frame"], model), _rows(output["rows"]), ()
    first = keys["closed_loop"].items("loop")[0].items("frame", 2)[0]
    name = _frame(first, model)
    note = (
        f"the loop file names no output: taken is {name}, the first frame of the first loop, with "
        "all six rows; add output: {frame: NAME, rows: [vx, vy, ...]}"
    )
    return name, parse_task("pose"), (note,)


def _check_on_loop(model: pin.Model, output: str, loops: tuple[Loop, ...], node: YamlNode) -> None:
    """Raise unless a joint of some loop carries the output."""

    def path(frame: str) -> set[int]:
        joint, found = int(model.frames[frame_index(model, frame)].parentJoint), set()
        while joint:
            found.add(joint)
            joint = int(model.parents[joint])
        return found

    carried = path(output)
    if not carried:
        raise node.error(f"the output {output!r} is fixed to the base: name a frame that moves")
    if not any(carried & (path(x.frame_a) ^ path(x.frame_b)) for x in loops):
        raise node.error(
            f"the output {output!r} is on no loop: no joint that the loops hold carries it; name a "
            "frame of a link between two ends of a loop"
        )


@dataclass(frozen=True, eq=False)
class _Described:
    """What a robot's own description says; ``follow``: joints that mimic others there."""

    model: pin.Model
    source: Source
    name: str
    notes: tuple[str, ...]
    follow: tuple[str, ...]


def _tree(robot: Any, packages: Mapping[str, str | Path] | None) -> _Described:
    model = given_model(robot)
    follows: tuple[str, ...] = ()
    if model is not None:
        label, path, shapes, name = "pin.Model", None, None, model.name or "mechanism"
        notes: tuple[str, ...] = ()
    else:
        from pinsing.robot.models import build_model

        given = given_file(robot, packages)
        description = given.description
        moving = [j for j in description.joints if j.kind != "fixed"]
        description.require_usable(j.name for j in moving if not j.endless)
        model = build_model(description)
        endless = tuple(j.name for j in moving if j.endless)
        _without_end(model, endless)
        follows = tuple(j.name for j in moving if j.mimic is not None)
        label, path, shapes = given.label, given.path, description.shapes
        name = description.name
        # What the description says of such joints holds for arms, which need limits.
        notes = tuple(x for x in description.assumed if not (endless and x.startswith(NO_LIMITS)))
        if endless:
            notes = (*notes, f"no usable limits, so they move without end: {', '.join(endless)}")
    source = Source(
        label=label,
        path=path,
        shapes=shapes,
        full_model=model,
        locked=(),
        kept=tuple(range(1, model.njoints)),
        reference=np.array(pin.neutral(model)),
        base="universe",
    )
    return _Described(model, source, name, notes, follows)


def _without_end(model: pin.Model, names: tuple[str, ...]) -> None:
    """Take away the limits [0, 0] that Pinocchio was given for joints without any."""
    for name in names:
        index = model.joints[model.getJointId(name)].idx_q
        model.lowerPositionLimit[index], model.upperPositionLimit[index] = -np.inf, np.inf


def _check_mimics(follow: tuple[str, ...], inputs: list[str]) -> None:
    """Raise unless each joint that mimics another is driven by itself here."""
    for name in follow:
        if name not in inputs:
            raise JointError(
                name, "mimics another joint, which loops do not support: model it as a loop, or "
                "drive it (name_mot)"
            )  # fmt: skip


def _limits(model: pin.Model) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    lower, upper, prismatic = [], [], []
    for index in range(1, model.njoints):
        joint, name = model.joints[index], model.names[index]
        if joint.nv != 1:
            raise JointError(
                name, f"is a {joint.shortname()}: the joints of a mechanism turn or slide"
            )
        _, slides = joint_axis(joint, name)
        low, high = -np.inf, np.inf
        if joint.nq == 1:
            low = float(model.lowerPositionLimit[joint.idx_q])
            high = float(model.upperPositionLimit[joint.idx_q])
        # Pinocchio writes the largest double for "no limit".
        lower.append(low if abs(low) < 1e300 else -np.inf)
        upper.append(high if abs(high) < 1e300 else np.inf)
        prismatic.append(slides)
    return np.array(lower), np.array(upper), np.array(prismatic, dtype=bool)


def _frame(node: YamlNode, model: pin.Model) -> str:
    name = node.text()
    names = [frame.name for frame in model.frames if frame.name != "universe"]
    if name not in names:
        raise node.error(f"unknown frame {name[:60]!r}: {suggestion(name, names)}")
    return name


def _loops(pairs: YamlNode, kinds: YamlNode, model: pin.Model) -> tuple[Loop, ...]:
    frames = [entry.items("frame", 2) for entry in pairs.items("loop")]
    names = tuple(LOOP_KINDS)
    words = []
    for kind in kinds.items("type"):
        word = kind.text().lower()
        if word not in names:
            raise kind.error(f"unknown value {kind.text()[:60]!r}: {suggestion(word, names)}")
        words.append(word)
    if len(words) != len(frames):
        raise kinds.error(f"{len(frames)} loops need {len(frames)} types, found {len(words)}")
    found = []
    for (a, b), word in zip(frames, words, strict=True):
        loop = Loop(_frame(a, model), _frame(b, model), word)
        ids = [frame_index(model, name) for name in (loop.frame_a, loop.frame_b)]
        if model.frames[ids[0]].parentJoint == model.frames[ids[1]].parentJoint:
            raise a.error(f"{loop.frame_a!r} and {loop.frame_b!r} are fixed to the same link")
        found.append(loop)
    return tuple(found)


def _actuated(node: YamlNode, joints: tuple[str, ...]) -> tuple[int, ...]:
    found: list[int] = []
    for entry in node.items("joint"):
        name = entry.text()
        if name not in joints:
            raise entry.error(f"unknown joint {name[:60]!r}: {suggestion(name, joints)}")
        if joints.index(name) in found:
            raise entry.error(f"joint {name!r} is given twice: remove one")
        found.append(joints.index(name))
    if len(found) == len(joints):
        raise node.error("every joint is actuated: a closed loop needs passive joints")
    return tuple(found)


def _rows(node: YamlNode) -> Task:
    names = []
    for entry in node.items("row"):
        names.append(entry.choice(ROW_NAMES))
    try:
        return parse_task(names)
    except PinsingError as error:
        raise node.error(str(error)) from None


def _home(node: YamlNode | None, joints: tuple[str, ...]) -> Array:
    home = np.zeros(len(joints))
    if node is not None:
        for name, value in node.mapping((), joints).items():
            home[joints.index(name)] = value.number(pi=0)
    return home
