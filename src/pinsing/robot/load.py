"""From a path, a name or a pin.Model to an Arm."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Literal

import pinocchio as pin

from pinsing.errors import ChainError, JointError, UnknownNameError
from pinsing.interface import checked
from pinsing.robot.arm import Arm, Given, HasModel, Source, given_file, given_model, named
from pinsing.robot.models import (
    Way,
    candidates,
    chain_limits,
    choose_chain,
    choose_tip,
    couple,
    cut_out,
    frame_index,
    joint_path,
    locked_at,
    long_chain_note,
    way_between,
)
from pinsing.robot.mujoco import given_mujoco
from pinsing.robot.nominal import assumed_design
from pinsing.robot.task import Task, parse_task

ASSUMED = (
    "a simpler design is assumed, which most joint axes are a little off, as after a calibration "
    "or an export from CAD"
)
"""Note of an arm whose design was found."""
LOOPS = "closed loops"
"""In the note of an arm that was taken out of a mechanism."""
MAX_IN_A_ROW = 64
"""Joints of an arm; hours and gigabytes, not insight, lie beyond."""


@checked
def load(
    robot: str | os.PathLike[str] | pin.Model | HasModel,
    tip: str | None = None,
    base: str | None = None,
    joints: Sequence[str] | None = None,
    task: str | Iterable[str] | Task = "pose",
    length_scale: float = 1.0,
    packages: Mapping[str, str | Path] | None = None,
    *,
    xacro_args: Mapping[str, str] | None = None,
    tool_axis: str | None = None,
    units: Literal["rad"] | None = None,
) -> Arm:
    """Take the serial chain from ``base`` to ``tip`` out of a robot and lock the rest.

    A floating base is locked as well: the arm is judged in the axes of its base.

    Parameters
    ----------
    robot : str, path, pin.Model or object with ``.model``
        A URDF or xacro file, a MuJoCo model that Pinocchio reads (.xml), a DH table (.yaml), the
        name of a known robot (``pinsing list``; ``rd:NAME`` of the package robot_descriptions),
        the text of a URDF (it begins with ``<``), a model, or a ``RobotWrapper``. Joint vectors of
        the arm are its own (n,) or, everywhere, the whole model's configuration (nq,); see
        ``Arm.q_of``.
    tip : str, optional
        Frame whose motion is judged. By default the only arm's usual tool frame, or its
        farthest; several arms are refused with the list of them.
    base : str, optional
        Frame that the chain starts from and whose axes the Jacobian is written in, by default the
        root. It may be anywhere: from a foot the chain goes up to the link where the way to the
        tip turns off, joints backwards, and down to a hand. Joints off this way are locked.
    joints : sequence of str, optional
        Joints of the chain to keep free; the others between base and tip are locked.
    task : str, iterable of str or Task
        ``pose``, ``position``, ``orientation``, or rows such as ``"vx,vy,wz"``, along the axes
        of the base; with ``@tip`` along those of the tip, such as ``"vx@tip,wy@tip"``.
        ``tool-axis``: position, and where the tool points; the turn about its own axis is free,
        as in drilling, welding and dispensing.
    length_scale : float
        Metres; translation rows are divided by it before singular values are taken.
    packages : mapping of str to path, optional
        Folders of ROS packages by name, for ``package://`` and ``$(find ...)``.
    xacro_args : mapping of str to str, optional
        Arguments of a xacro file.
    tool_axis : str, optional
        ``x``, ``y`` or ``z``: the axis of the tip that the task ``tool-axis`` leaves free; z if
        not given.
    units : "rad", optional
        Take joint values as radians, however large. By default values that make sense in degrees
        only are an error: a revolute joint more than a turn beyond its limits (two turns from 0 if
        it has none) that is within them when read as degrees.

    Returns
    -------
    Arm
        With everything that was assumed in ``arm.notes``. Its meshes are looked for when it is
        drawn; ``arm.source.mesh_notes`` tells which are not there. Where most joint axes are a
        little off a simpler design, as after a calibration, that is ``arm.design``.

    Raises
    ------
    PinsingError
        RobotFileError, UnknownNameError, ChainError, JointError or OptionError: one line
        that says what is wrong, where, and what to do.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> arm.n, arm.tip, arm.task.name
    (6, 'tool0', 'pose')
    >>> pinsing.load("ur5", tip="wrist_3_link", task="position").task.rows
    (0, 1, 2)
    >>> pinsing.load("talos", base="left_sole_link", tip="gripper_left_base_link").n
    15
    """
    parsed_task = parse_task(task, tool_axis)
    if isinstance(joints, str):
        joints = (joints,)
    whole = given_model(robot) or given_mujoco(robot) or given_file(robot, packages, xacro_args)  # type: ignore[arg-type]
    model, entry = whole.model, whole.entry
    notes = [*whole.notes, *_loops_left_out(whole)]
    if whole.description is not None:
        notes += whole.description.assumed
    if entry is not None and tip is None and base is None and joints is None:
        tip, base = entry.tip, entry.base
    base_joint, base_frame = 0, "universe"
    if base is not None:
        base_joint, base_frame = int(model.frames[frame_index(model, base)].parentJoint), base
    tip, last, why = _choose_tip(whole, tip, joints, (base_frame, base_joint), str(parsed_task))
    notes += why
    way = way_between(model, base_joint, last)
    notes += way.told(model)
    free = _free_joints(whole, way, joints, notes)
    many = "" if way.up or joints is not None else long_chain_note(model, last, base_joint)
    notes += [many] if many else []
    ends = (base_frame, tip)
    arm = _build(whole, ends, way, free, parsed_task, float(length_scale), tuple(notes))
    if (design := assumed_design(arm)) is not None:
        arm = replace(arm, design=design, notes=(*arm.notes, ASSUMED))
    return arm if units is None else replace(arm, units=units)


def _loops_left_out(whole: Given) -> list[str]:
    """Say that a robot has a file of closed loops, which an arm does not hold."""
    path = whole.path
    loops = path and path.with_name(f"{path.name.partition('.')[0]}.loops.yaml")
    if loops is None or not loops.is_file():
        return []
    return [
        f"the {LOOPS} of {loops.name} are left out and a serial chain is taken. With them: "
        f"pinsing analyze {quote(whole.label)}, in Python "
        f"pinsing.load_mechanism({whole.label!r})"
    ]


def _choose_tip(
    whole: Given, tip: str | None, joints: Sequence[str] | None, base: tuple[str, int], task: str
) -> tuple[str, int, list[str]]:
    """Name of the tip frame, index of the joint that carries it, and notes."""
    model = whole.model
    base_frame, base_joint = base
    if tip is not None:
        last = int(model.frames[frame_index(model, tip)].parentJoint)
        ChainError.refuse_if(
            tip == "universe" and base_joint,
            f"{whole.label}: 'universe' is Pinocchio's world, which cannot be a tip: name a "
            f"link or frame fixed to it, such as {root_name(model)!r}",
            tip=tip,
        )
        ChainError.refuse_if(
            last == base_joint,
            f"{whole.label}: no joint lies between the base and tip {tip!r}; "
            "choose a tip farther out",
            base=base_frame,
            tip=tip,
        )
        return tip, last, []
    if joints:
        _require_joints(joints, model)
        last = max(map(model.getJointId, joints), key=lambda j: len(joint_path(model, j)))
        chosen = choose_tip(model, last)
        return chosen, last, [f"tip {chosen} was chosen on the link of the last joint given"]
    every = candidates(model, whole.leaders)
    found = [c.beyond(model, base_joint) for c in every if base_joint in (0, *c.path[:-1])]
    if base_joint and not found:
        tips = ", ".join(f"--tip {quote(c.tip)}" for c in every[:8] if base_joint not in c.path)
        other = f", or name a tip that lies elsewhere: {tips}" if tips else ""
        raise ChainError(
            f"{whole.label}: no joint lies beyond the base; take one nearer the root{other}",
            tips=tuple(c.tip for c in every if base_joint not in c.path),
        )
    candidate, notes = choose_chain(found, whole.label, model, whole.leaders, task)
    return candidate.tip, candidate.path[-1], notes


def _free_joints(
    whole: Given, way: Way, joints: Sequence[str] | None, notes: list[str]
) -> list[int]:
    """Return which joints of the path stay: those asked for, or all with one degree of freedom."""
    model, path = whole.model, way.path
    on_path = [model.names[j] for j in path]
    if joints is not None:
        for name in joints:
            many = list(joints).count(name) > 1
            ChainError.refuse_if(many, f"joint {name!r} is named twice in joints", joint=name)
        for name in joints:
            _require_joints([name], model)
            ChainError.refuse_if(
                name not in on_path,
                f"joint {name!r} is not between the base and the tip; "
                f"joints there: {', '.join(on_path)}",
                joint=name,
                joints=tuple(on_path),
            )
            JointError.refuse_if(
                name in whole.leaders,
                name,
                "follows another joint and cannot be chosen; name that one",
            )
        asked = set(joints)
        asked |= {name for name, leads in whole.leaders.items() if leads.joint in asked}
        free = [j for j in path if model.names[j] in asked]
        left = [model.names[j] for j in path if j not in free]
        if left:
            notes.append(f"joints of the chain not asked for are locked: {', '.join(left)}")
    else:
        free = list(path)
    kept = []
    for j in free:
        joint = model.joints[j]
        if joint.nv == 1:
            kept.append(j)
        elif int(model.parents[j]) == 0 and not way.up:
            notes.append(
                f"floating base: joint {model.names[j]} is locked; Jacobians are in the axes of "
                "the body that it carries"
            )
        else:
            raise JointError(
                model.names[j],
                f"is a {joint.shortname()} with {joint.nv} degrees of freedom in the middle of "
                "the chain; choose a base beyond it",
            )
    ChainError.refuse_if(
        not kept, f"{whole.label}: no joint with one degree of freedom on the chain"
    )
    return kept


def _build(
    whole: Given,
    ends: tuple[str, str],
    way: Way,
    free: list[int],
    task: Task,
    length_scale: float,
    notes: tuple[str, ...],
) -> Arm:
    model, (base, tip), path = whole.model, ends, way.path
    in_order = [model.names[j] for j in free]
    on_path = set(in_order)
    # A follower whose leader is locked is locked as well; one whose leader moves, follows.
    leads = whole.leaders
    leaders = {n: leads[n] for n in in_order if n in leads and leads[n].joint in on_path}
    stuck = {name for name in on_path if name in leads and name not in leaders}
    if stuck:
        notes += (
            f"mimic joints whose leading joint is outside the chain are locked: "
            f"{', '.join(sorted(stuck))}",
        )
    kept = [j for j in free if model.names[j] not in stuck]
    ChainError.refuse_if(
        len(kept) > MAX_IN_A_ROW,
        f"{whole.label}: {len(kept)} joints in a row: at most {MAX_IN_A_ROW} can be analysed; "
        "choose a base farther out, or name the joints to keep",
    )
    ChainError.refuse_if(
        not kept, f"{whole.label}: every joint of the chain follows one outside it"
    )
    if whole.description is not None:
        whole.description.require_usable(model.names[j] for j in kept)
    lock = [j for j in range(1, model.njoints) if j not in kept]
    reference = locked_at(model, whole.leaders)
    # Joints beyond the tip are named where it is chosen.
    off_path = [j for j in lock if j not in path and path[-1] not in model.supports[j]]
    if off_path:
        joints = f"{len(off_path)} joint{'s' * (len(off_path) != 1)}"
        notes += (f"locked outside the chain, without effect on it: {joints}",)
    root = 0 if base == "universe" else frame_index(model, base)  # a body may be called that
    reduced, _ = cut_out(model, kept, reference, root)
    names = list(reduced.names)[1:]
    lower, upper, prismatic, said = chain_limits(reduced)
    coupling = None
    if leaders:
        coupling, lower, upper = couple(names, leaders, lower, upper)
        told = [f"{n} = {m:g} * {leader} + {o:g}" for n, (leader, m, o) in leaders.items()]
        notes += (f"mimic joints of the chain follow: {'; '.join(told)}",)
    notes += tuple(said)
    free_names = [name for name in names if name not in leaders]
    return Arm(
        name=whole.entry.name if whole.entry else whole.name or "model",
        model=reduced,
        tip=tip,
        base=root_name(reduced) if base == "universe" else base,
        joints=tuple(free_names),
        prismatic=prismatic[[names.index(name) for name in free_names]],
        lower=lower,
        upper=upper,
        task=task,
        length_scale=length_scale,
        notes=notes,
        source=Source(
            label=whole.label,
            path=whole.path,
            shapes=whole.description.shapes if whole.description else None,
            full_model=model,
            locked=tuple(lock),
            kept=tuple(int(model.getJointId(name)) for name in names),
            reference=reference,
            base=base,
        ),
        coupling=coupling,
    )


def root_name(model: pin.Model) -> str:
    """Name of the root link, which sits where Pinocchio's universe does."""
    bodies = (f for f in model.frames if f.parentJoint == 0 and f.type == pin.FrameType.BODY)
    return next((str(f.name) for f in bodies if f.placement.isIdentity(0.0)), "universe")


def _require_joints(names: Iterable[str], model: pin.Model) -> None:
    known = list(model.names)[1:]
    for name in names:
        meant = [joint for joint in [named(name, known)] if joint != name]
        UnknownNameError.refuse_if(name not in known, "joint", name, known, meant=meant)
