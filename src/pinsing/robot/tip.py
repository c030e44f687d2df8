"""Choosing which chain of a model is the arm, and which of its frames is the tip."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from shlex import quote

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing.errors import ChainError, UnknownNameError

# Names in use for the working frame of an arm, the usual first.
_TOOL_NAMES = (
    r"(^|_)tool0$",
    r"(^|_)tcp$",
    r"(^|_)tool(_?(frame|link))?$",
    r"(^|_)eef?(_?(frame|link))?$",
    r"end_?effector(_?link)?$",
    r"(^|_)flange$",
    r"gripper_frame(_link)?$",
    r"gripper_?(base_?)?link$|gripper_base_link$|palm_link$",
    r"(^|_)gripper$",
    r"(^|_)hand$",
)
_HAND = re.compile(
    r"finger|thumb|(^|_)(index|ring|pinky|little)(_|\d|$)|(^|_)middle(_?q?\d|_abd|_flex|_mcp|$)"
    r"|knuckle|jaw|grip(per)?|inner_?link"
    r"|(^|_)hand_|^[lr]?hand$|fingertip",
    re.IGNORECASE,
)
_FINGER = re.compile(r"finger|thumb|knuckle|jaw", re.IGNORECASE)
_LINK_KINDS = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
ARM_JOINTS = 4
"""A chain of this many joints or more counts as an arm when there are several chains."""


@dataclass(frozen=True)
class Candidate:
    """A chain that ends at some last joint.

    Attributes
    ----------
    last : int
        Index of the last joint in the model.
    path : tuple of int
        Indices of the movable joints from the root, or the base asked for, to it.
    tip : str
        The frame that would be chosen on it.
    passed_over : tuple of str
        Names of gripper joints beyond it.
    """

    last: int
    path: tuple[int, ...]
    tip: str
    passed_over: tuple[str, ...]

    def length(self, model: pin.Model) -> int:
        """Number of its joints that turn or slide: a floating base does not count."""
        return sum(model.joints[j].nv == 1 for j in self.path)

    def beyond(self, base: int) -> Candidate:
        """Return the part of it that lies beyond a joint of its path; 0 is the root."""
        return replace(self, path=self.path[self.path.index(base) + 1 :]) if base else self


def joint_path(model: pin.Model, joint: int, start: int = 0) -> tuple[int, ...]:
    """Joints after ``start`` on the way from it to ``joint`` (included), root side first.

    Raises
    ------
    ChainError
        If ``start`` is not on the way from the root to ``joint``.
    """
    path = []
    while joint not in (0, start):
        path.append(joint)
        joint = int(model.parents[joint])
    if joint != start:
        raise ChainError("the base is not on the way from the root to the tip")
    return tuple(reversed(path))


def candidates(model: pin.Model, mimics: Collection[str] = ()) -> list[Candidate]:
    """All chains that an arm could be, grippers passed over in favour of what carries them.

    Parameters
    ----------
    model : pin.Model
        The whole model.
    mimics : collection of str
        Names of joints that follow another one.
    """
    children: list[list[int]] = [[] for _ in range(model.njoints)]
    for joint in range(1, model.njoints):
        children[model.parents[joint]].append(joint)
    in_hand = _hand_joints(model, children, mimics)
    if len(in_hand) == model.njoints - 1:  # a hand on its own: its fingers are the chains
        in_hand = set()
    leaves = [
        j
        for j in range(1, model.njoints)
        if j not in in_hand and all(c in in_hand for c in children[j])
    ]
    frames: dict[int, list[pin.Frame]] = {}
    for frame in model.frames:
        frames.setdefault(int(frame.parentJoint), []).append(frame)
    found = []
    for leaf in leaves:
        beyond = [model.names[j] for j in _below(leaf, children)]
        path = joint_path(model, leaf)
        tip = _best_frame(model, leaf, frames.get(leaf, []))
        found.append(Candidate(leaf, path, tip, tuple(beyond)))
    return found


def _hand_joints(model: pin.Model, children: list[list[int]], mimics: Collection[str]) -> set[int]:
    """Joints that belong to a gripper or hand, with all that hangs on them."""
    bodies: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            bodies.setdefault(int(frame.parentJoint), frame.name)
    jaws: set[int] = set()
    for siblings in children:
        # Several leaves side by side of which one follows: jaws. A lone one is the last joint.
        leaves = [j for j in siblings if not children[j]]
        if len(leaves) > 1 and any(model.names[j] in mimics for j in leaves):
            jaws.update(leaves)
    depth = _depths(children)
    rank = [0] * model.njoints
    hand: set[int] = set()
    for joint in range(1, model.njoints):
        name = model.names[joint]
        parent = int(model.parents[joint])
        rank[joint] = rank[parent] + 1
        inherited = parent in hand
        # A link called gripper is often what the last wrist joint carries: links go by fingers.
        named = bool(_HAND.search(name) or _FINGER.search(bodies.get(joint, "")))
        # Something called a hand that no arm carries, and with an arm's worth of joints in a
        # row, is an arm.
        carried = rank[joint] > ARM_JOINTS
        if inherited or joint in jaws or (named and (carried or depth[joint] < 6)):
            hand.add(joint)
    return hand


def _below(joint: int, children: list[list[int]]) -> list[int]:
    below = []
    todo = list(children[joint])
    while todo:
        j = todo.pop()
        below.append(j)
        todo.extend(children[j])
    return sorted(below)


def _depths(children: list[list[int]]) -> list[int]:
    """Joints in a row from each one outwards, itself included; parents come before children."""
    depth = [1] * len(children)
    for joint in reversed(range(len(children))):
        depth[joint] = 1 + max((depth[c] for c in children[joint]), default=0)
    return depth


def frame_index(model: pin.Model, name: str) -> int:
    """Index of the frame called ``name``; a link's or tool's before a joint's of the same name.

    Raises
    ------
    UnknownNameError
        If there is none, with those that resemble it.
    """
    found = [i for i, f in enumerate(model.frames) if f.name == name]
    if not found:
        raise UnknownNameError("frame", name, [f.name for f in model.frames])
    return next((i for i in found if model.frames[i].type in _LINK_KINDS), found[0])


def tip_frames(model: pin.Model, joint: int) -> list[pin.Frame]:
    """Frames of links that are fixed to the last link of a chain."""
    return [f for f in model.frames if f.parentJoint == joint and f.type in _LINK_KINDS]


def choose_tip(model: pin.Model, joint: int) -> str:
    """Of the frames fixed to the last link: the usual tool names first, then the farthest.

    Raises
    ------
    ChainError
        If no frame is fixed to that link.
    """
    return _best_frame(model, joint, [f for f in model.frames if f.parentJoint == joint])


def _best_frame(model: pin.Model, joint: int, frames: list[pin.Frame]) -> str:
    """Name of the frame to take of all that are fixed to a link."""
    frames = [f for f in frames if f.type in _LINK_KINDS] or frames
    if not frames:
        raise ChainError(f"joint {model.names[joint]!r} carries no frame: add one and name it")
    for pattern in _TOOL_NAMES:
        named = [f for f in frames if re.search(pattern, f.name, re.IGNORECASE)]
        if named:
            frames = named
            break
    distance = [float(np.linalg.norm(f.placement.translation)) for f in frames]
    best = max(range(len(frames)), key=lambda i: (round(distance[i], 9), -i))
    return str(frames[best].name)


def choose_chain(
    found: Sequence[Candidate], label: str, model: pin.Model
) -> tuple[Candidate, list[str]]:
    """Take the only arm among the candidates, with notes, or refuse with the list of them.

    Raises
    ------
    ChainError
        If there are several arms (or no joint at all); the message has the command for each.
    """
    if not found:
        raise ChainError(f"{label}: the robot has no movable joint, so there is nothing to analyse")
    arms = [c for c in found if c.length(model) >= ARM_JOINTS] or list(found)
    if len(arms) > 1:
        lines = ", ".join(f"--tip {quote(c.tip)} ({c.length(model)} joints)" for c in arms[:8])
        more = f" and {len(arms) - 8} more" if len(arms) > 8 else ""
        raise ChainError(
            f"{label}: {len(arms)} chains could be the arm; choose one: {lines}{more}; "
            f"in Python load(..., tip={arms[0].tip!r})",
            tips=tuple(c.tip for c in arms),
            lengths=tuple(c.length(model) for c in arms),
        )
    chosen = arms[0]
    notes = []
    others = [c for c in found if c is not chosen]
    if others:
        names = ", ".join(f"{c.tip} ({c.length(model)})" for c in others[:6])
        more = f" and {len(others) - 6} more" if len(others) > 6 else ""
        notes.append(f"chains with fewer joints were passed over: {names}{more}")
    if chosen.passed_over:
        beyond = chosen.passed_over
        more = f" and {len(beyond) - 4} more" if len(beyond) > 4 else ""
        notes.append(f"gripper joints beyond the tip are locked: {', '.join(beyond[:4])}{more}")
    same_link = [f.name for f in tip_frames(model, chosen.last) if f.name != chosen.tip]
    if same_link:
        notes.append(
            f"tip {chosen.tip} was chosen among the frames of the last link "
            f"(others: {', '.join(same_link[:6])}{', ...' if len(same_link) > 6 else ''})"
        )
    return chosen, notes
