"""Pinocchio models: which chains they offer, how one is built, joints taken out, turned round.

A chain is named by its tip and, where it does not start at the root, by its base. Joints before
the base are locked, and so are grippers beyond the tip. Any frame can be made the world: from child
to parent a joint's motion is the inverse one, with the same value about the opposite axis. So
joints from the base towards the root keep their names, values, signs and limits, and only
placements and axes are reversed: what moves is the tip, seen from the base. With X the shift of the
base's motion to the tip, its Jacobian is J_tip - X J_base in the axes of the base.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from shlex import quote

import numpy as np
import pinocchio as pin

from pinsing.description.urdf import Description, Mimic
from pinsing.errors import ChainError, JointError, RobotFileError, UnknownNameError
from pinsing.measures import Array

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
_JOINT = pin.FrameType.JOINT
ARM_JOINTS = 4
"""A chain of this many joints or more counts as an arm when there are several chains."""


@dataclass(frozen=True)
class Subchain:
    """A chain that can be analysed."""

    tip: str
    base: str | None  # None: the root
    joints: tuple[str, ...]  # that turn or slide, base to tip, mimic joints included
    passed_over: tuple[str, ...]  # gripper joints beyond the tip
    path: tuple[int, ...]  # all its joints by index: with those of a floating base

    @property
    def options(self) -> tuple[str, ...]:
        """Words of the command line that choose it."""
        return ("--tip", self.tip, *(() if self.base is None else ("--base", self.base)))

    def beyond(self, model: pin.Model, joint: int) -> Subchain:
        """Return the part of it that lies beyond a joint of its path; 0 is the root."""
        if not joint:
            return self
        path = self.path[self.path.index(joint) + 1 :]
        return replace(self, base=_link_of(model, joint), joints=_moving(model, path), path=path)


def joint_path(model: pin.Model, joint: int, start: int = 0) -> tuple[int, ...]:
    """Return joints after ``start`` up to ``joint``; ChainError if it is not on the way."""
    way = list(model.supports[joint])
    ChainError.refuse_if(start not in way, "the base is not between the root and the tip")
    return tuple(way[way.index(start) + 1 :])


def candidates(model: pin.Model, mimics: Collection[str] = ()) -> list[Subchain]:
    """Return all chains that an arm could be, grippers left to what carries them."""
    in_hand = _hand_joints(model, mimics)
    if len(in_hand) == model.njoints - 1:  # a hand on its own: its fingers are the chains
        in_hand = set()
    frames: dict[int, list[pin.Frame]] = {}
    for frame in model.frames:
        frames.setdefault(int(frame.parentJoint), []).append(frame)
    found = []
    for leaf in range(1, model.njoints):
        if leaf not in in_hand and in_hand.issuperset(model.children[leaf]):
            path = joint_path(model, leaf)
            beyond = tuple(model.names[j] for j in sorted(model.subtrees[leaf])[1:])
            tip = _best_frame(model, leaf, frames.get(leaf, []))
            found.append(Subchain(tip, None, _moving(model, path), beyond, path))
    return found


def _hand_joints(model: pin.Model, mimics: Collection[str]) -> set[int]:
    """Joints that belong to a gripper or hand, with all that hangs on them."""
    bodies: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            bodies.setdefault(int(frame.parentJoint), frame.name)
    jaws: set[int] = set()
    for siblings in model.children:
        # Several leaves side by side of which one follows: jaws. A lone one is the last joint.
        leaves = [j for j in siblings if not len(model.children[j])]
        if len(leaves) > 1 and any(model.names[j] in mimics for j in leaves):
            jaws.update(leaves)
    rank = [len(way) - 1 for way in model.supports]
    hand: set[int] = set()
    for joint in range(1, model.njoints):
        # A link called gripper is often what the last wrist joint carries: links go by fingers.
        named = _HAND.search(model.names[joint]) or _FINGER.search(bodies.get(joint, ""))
        # Something called a hand that no arm carries, and with an arm's worth of joints in a
        # row, is an arm.
        carried = named and (
            rank[joint] > ARM_JOINTS
            or max(rank[j] for j in model.subtrees[joint]) < rank[joint] + 5
        )
        if int(model.parents[joint]) in hand or joint in jaws or carried:
            hand.add(joint)
    return hand


def frame_index(model: pin.Model, name: str) -> int:
    """Return the index of a frame, a link's before a joint's; UnknownNameError if there is none."""
    found = [i for i, f in enumerate(model.frames) if f.name == name]
    if not found:
        raise UnknownNameError("frame", name, [f.name for f in model.frames])
    return next((i for i in found if model.frames[i].type in _LINK_KINDS), found[0])


def tip_frames(model: pin.Model, joint: int) -> list[pin.Frame]:
    """Frames of links that are fixed to the last link of a chain."""
    return [f for f in model.frames if f.parentJoint == joint and f.type in _LINK_KINDS]


def choose_tip(model: pin.Model, joint: int) -> str:
    """Return the frame of the last link with a usual tool name, else the farthest one."""
    return _best_frame(model, joint, [f for f in model.frames if f.parentJoint == joint])


def _best_frame(model: pin.Model, joint: int, frames: list[pin.Frame]) -> str:
    """Name of the frame to take of all that are fixed to a link."""
    frames = [f for f in frames if f.type in _LINK_KINDS] or frames
    ChainError.refuse_if(
        not frames, f"joint {model.names[joint]!r} carries no frame: add one and name it"
    )
    ways = ([f for f in frames if re.search(p, f.name, re.IGNORECASE)] for p in _TOOL_NAMES)
    frames = next(filter(None, ways), frames)
    distance = [float(np.linalg.norm(f.placement.translation)) for f in frames]
    best = max(range(len(frames)), key=lambda i: (round(distance[i], 9), -i))
    return str(frames[best].name)


def choose_chain(
    found: Sequence[Subchain], label: str, model: pin.Model, mimics: Collection[str], task: str
) -> tuple[Subchain, list[str]]:
    """Return the only arm among candidates, and notes; ChainError with commands if not one."""
    ChainError.refuse_if(
        not found, f"{label}: the robot has no movable joint, so there is nothing to analyse"
    )
    arms = [c for c in found if len(c.joints) >= ARM_JOINTS] or list(found)
    if len(arms) > 1:
        lines = _first([f"--tip {quote(c.tip)} ({len(c.joints)} joints)" for c in arms], 8)
        raise ChainError(
            f"{label}: {len(arms)} chains could be the arm; choose one: {lines}; "
            f"in Python load(..., tip={arms[0].tip!r})",
            tips=tuple(c.tip for c in arms),
            lengths=tuple(len(c.joints) for c in arms),
            chains=arm_chains(model, mimics),
        )
    chosen = arms[0]
    notes = []
    others = [f"{c.tip} ({len(c.joints)})" for c in found if c is not chosen]
    if others:
        notes.append(f"chains with fewer joints were passed over: {_first(others, 6)}")
    if chosen.passed_over:
        notes.append(f"locked beyond the tip: {_first(chosen.passed_over, 4)}")
    same_link = [f.name for f in tip_frames(model, chosen.path[-1]) if f.name != chosen.tip]
    if same_link:
        same = f"does not affect {task} singularities"
        effect = same if task in ("pose", "orientation") else f"may matter for the task {task}"
        notes.append(
            f"tip {chosen.tip} (on the same link: {', '.join(same_link[:3])}"
            f"{', ...' * (len(same_link) > 3)}): the choice {effect}"
        )
    return chosen, notes


def _first(words: Sequence[str], most: int) -> str:
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more


LONGEST = 9
"""More joints than this are offered as sub-chains: an arm without the torso that carries it."""
SHORTEST = 2


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
    shared = len({*before} & {*after})
    return Way(before[shared:][::-1], after[shared:], before[:shared])


def arm_chains(model: pin.Model, mimics: Collection[str] = ()) -> tuple[Subchain, ...]:
    """Return the chains to offer to a user: arms, legs and heads, without fingers."""
    # Each from the root; and without joints shared with others.
    found: list[Subchain] = []
    for whole in candidates(model, mimics):
        parts = [whole.beyond(model, joint) for joint in branchings(model, whole.path)[-1:]]
        found += [whole, *(part for part in parts if len(part.joints) >= SHORTEST)]
    return tuple(found)


def long_chain_note(model: pin.Model, end: int, start: int = 0) -> str:
    """Return a note on a chain of more than ``LONGEST`` joints, with shorter ones; else ""."""
    path = joint_path(model, end, start)
    count = len(_moving(model, path))
    if count <= LONGEST:
        return ""
    left = {j: len(_moving(model, joint_path(model, end, j))) for j in branchings(model, path)}
    shorter = [
        f"--base {_link_of(model, joint)} ({n} joints)"
        for joint, n in left.items()
        if SHORTEST <= n < count
    ]
    offer = f"; without joints shared with other chains: {', '.join(shorter)}" if shorter else ""
    return f"{count} joints are many: the closed forms may not be complete in time{offer}"


def chains_text(chains: Sequence[Subchain], robot: str) -> str:
    """Return chains as a tree, with commands; ``robot``: as it is typed, with common options."""
    whole = [c for c in chains if c.base is None]
    parts = {c.tip: c for c in chains if c.base is not None}
    return "\n".join(["(root)", *_branches(whole, parts, 0, "", robot)])


def _branches(
    chains: Sequence[Subchain], parts: dict[str, Subchain], depth: int, indent: str, robot: str
) -> Iterator[str]:
    """Yield what hangs below the first ``depth`` joints, which the chains share."""
    groups: dict[str, list[Subchain]] = {}
    for chain in chains:
        groups.setdefault("".join(chain.joints[depth : depth + 1]), []).append(chain)
    for number, group in enumerate(groups.values(), 1):
        bar, below = ("└─ ", "   ") if number == len(groups) else ("├─ ", "│  ")
        first, deeper = group[0], indent + below
        if len(group) > 1:
            alike = (
                len(set(names)) == 1 for names in zip(*(c.joints for c in group), strict=False)
            )
            shared = sum(itertools.takewhile(bool, alike))
            yield f"{indent}{bar}{_run(first.joints[depth:shared])}"
            yield from _branches(group, parts, shared, deeper, robot)
            continue
        yield f"{indent}{bar}{_run(first.joints[depth:])} -> {first.tip}"
        for one in filter(None, (first, parts.get(first.tip))):
            count, options = len(one.joints), " ".join(map(quote, one.options))
            long = (
                f"  (more than {LONGEST}: closed forms may not end in time; "
                "rather without the shared joints)"
            ) * (one is first and count > LONGEST)
            many = "s" * (count != 1)
            yield f"{deeper}{count} joint{many}: pinsing analyze {robot} {options}{long}"
        if first.passed_over:
            yield f"{deeper}locked beyond it: {_run(first.passed_over)}"


def _run(names: Sequence[str]) -> str:
    """Names of joints in a row, the middle ones left out."""
    if not names:
        return "(here)"
    return ", ".join(names) if len(names) <= 2 else f"{names[0]} ... {names[-1]} ({len(names)})"


def branchings(model: pin.Model, path: Sequence[int]) -> list[int]:
    """Return the joints of a path, but for its last, that carry more than one joint."""
    return [j for j in path[:-1] if len(model.children[j]) > 1]


def _moving(model: pin.Model, path: Sequence[int]) -> tuple[str, ...]:
    return tuple(model.names[j] for j in path if model.joints[j].nv == 1)


def _link_of(model: pin.Model, joint: int) -> str:
    """Name of the frame that stands for the link that a joint moves: the body nearest to it."""
    frames = tip_frames(model, joint) or [f for f in model.frames if f.parentJoint == joint]
    bodies = [f for f in frames if f.type == pin.FrameType.BODY] or frames
    return str(min(bodies, key=lambda f: float(abs(f.placement.translation).max())).name)


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


def leader_of(name: str, mimics: Mapping[str, Mimic]) -> Mimic:
    """Follow mimics of mimics to the joint that moves by itself."""
    leader, multiplier, offset = mimics[name]
    while leader in mimics:
        further, m, o = mimics[leader]
        leader, multiplier, offset = further, multiplier * m, multiplier * o + offset
    return Mimic(leader, multiplier, offset)


@dataclass(frozen=True, eq=False)
class Coupling:
    """Mimic joints inside the chain: model joints = ``matrix @ q + offset``."""

    matrix: Array  # (nv, n)
    offset: Array  # (nv,), radians or metres

    def values(self, q: Array) -> Array:
        """Values (..., nv) of the model's joints, of those (..., n) of the free ones."""
        return np.asarray(q @ self.matrix.T + self.offset)


def couple(
    names: Sequence[str], leaders: Mapping[str, Mimic], lower: Array, upper: Array
) -> tuple[Coupling, Array, Array]:
    """Return how joints follow others, and limits of the rest that keep all in theirs.

    JointError if there are none.
    """
    free = [name for name in names if name not in leaders]
    matrix, offset = np.zeros((len(names), len(free))), np.zeros(len(names))
    low, high = np.full(len(free), -np.inf), np.full(len(free), np.inf)
    for row, name in enumerate(names):
        leader, m, o = leaders.get(name, Mimic(name, 1.0, 0.0))
        column = free.index(leader)
        matrix[row, column], offset[row] = m, o
        if m == 0.0:  # it stands still
            continue
        ends = sorted(((lower[row] - o) / m, (upper[row] - o) / m))
        low[column], high[column] = max(low[column], ends[0]), min(high[column], ends[1])
        apart = low[column] > high[column]
        JointError.refuse_if(apart, name, f"cannot follow {leader!r} within its own limits")
    return Coupling(matrix, offset), low, high


def joint_value(model: pin.Model, joint: int, q: Array) -> Array:
    """Return a joint's value (...), radians or metres, in configurations (..., nq)."""
    i = model.idx_qs[joint]
    single = model.nqs[joint] == 1
    return np.asarray(q[..., i] if single else np.arctan2(q[..., i + 1], q[..., i]))


def put_values(model: pin.Model, joints: Iterable[int], values: Array, out: Array) -> None:
    """Write values (..., k) of k joints into configurations (..., nq)."""
    for column, joint in enumerate(joints):
        i, value = model.idx_qs[joint], values[..., column]
        if model.nqs[joint] == 2:  # a continuous joint is its cosine and sine
            out[..., i], out[..., i + 1] = np.cos(value), np.sin(value)
        else:
            out[..., i] = value


def locked_at(model: pin.Model, leaders: Mapping[str, Mimic]) -> Array:
    """Return the values of locked joints: neutral, within limits; followers follow."""
    q = np.array(pin.neutral(model))
    single = [joint.idx_q for joint in model.joints[1:] if joint.nq == 1]
    low, high = model.lowerPositionLimit[single], model.upperPositionLimit[single]
    q[single] = np.where(low <= high, np.clip(q[single], low, high), q[single])
    for name, (leader, multiplier, shift) in leaders.items():
        value = multiplier * joint_value(model, model.getJointId(leader), q) + shift
        put_values(model, [model.getJointId(name)], value[None], q)
    return q


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


def build_model(description: Description) -> pin.Model:
    """Return the Pinocchio model of a description: its root fixed, its mimic joints free."""
    try:
        return pin.buildModelFromXML(description.kinematics)
    except (ValueError, RuntimeError, IndexError) as error:
        raise RobotFileError(f"Pinocchio cannot build it: {error}", description.path) from None


def cut_out(
    model: pin.Model,
    keep: Collection[int],
    reference: Array,
    base: int = 0,
    hinges: Mapping[int, str] | None = None,
) -> tuple[pin.Model, dict[int, tuple[int, pin.SE3]]]:
    """Return the model of the joints ``keep`` with frame ``base`` as the world, and what carries.

    The other joints are locked as in ``reference`` (nq,). Joints from the base towards the root,
    which have one degree of freedom each, are turned round. ``hinges``: axes, such as "XZ", of
    endless ones that take the place of a joint. The dictionary has, for each joint of
    ``model``, the joint of the new model that carries its body, and where.
    """
    out = pin.Model()
    out.name = model.name
    parents = list(model.parents)
    carried: dict[int, tuple[int, pin.SE3]] = {}
    frame, turned = model.frames[base], False
    carrier, place, joint = 0, frame.placement.inverse(), int(frame.parentJoint)
    while joint:
        carried[joint] = carrier, place
        if joint in keep:
            back, turn = _opposite(model, joint)
            carrier, turned = add_joint(out, carrier, back, place * turn, model, joint), True
            place = (model.jointPlacements[joint] * turn).inverse()
        else:
            place = place * _locked_place(model, joint, reference).inverse()
        joint = parents[joint]
    carried[0] = carrier, place
    for joint in range(1, model.njoints):
        if joint in carried:
            continue
        carrier, place = carried[parents[joint]]
        if joint in keep:
            place = place * model.jointPlacements[joint]
            number = add_joint(out, carrier, model.joints[joint], place, model, joint)
            carried[joint] = number, pin.SE3.Identity()
            continue
        place = place * _locked_place(model, joint, reference)
        for axis in (hinges or {}).get(joint, ""):
            turn = getattr(pin, f"JointModelRUB{axis}")()
            carrier = out.addJoint(carrier, turn, place, f"{model.names[joint]}_{axis}")
            place = pin.SE3.Identity()
        carried[joint] = carrier, place
    for joint, (carrier, place) in carried.items():
        out.appendBodyToJoint(carrier, model.inertias[joint], place)
    _carry_frames(model, out, carried, keep, not turned)
    return out, carried


def _locked_place(model: pin.Model, joint: int, reference: Array) -> pin.SE3:
    """Where a joint puts its body in the one before, in a configuration (nq,)."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, reference)
    return model.jointPlacements[joint] * data.M


def _carry_frames(
    model: pin.Model,
    out: pin.Model,
    carried: Mapping[int, tuple[int, pin.SE3]],
    keep: Collection[int],
    with_parents: bool,
) -> None:
    """Give a model that was cut out the frames of the other, after those of its joints."""
    numbers = [0]
    for frame in list(model.frames)[1:]:
        joint = int(frame.parentJoint)
        carrier, place = carried[joint]
        moves = frame.type == _JOINT and joint in keep
        if moves and frame.name == model.names[joint]:
            numbers.append(out.getFrameId(frame.name, _JOINT))
            continue
        kind = pin.FrameType.FIXED_JOINT if frame.type == _JOINT and not moves else frame.type
        # As no frame is named, first: of two that now have one name and type, both are kept.
        made = pin.Frame(f"\n{len(numbers)}", carrier, 0, place * frame.placement, kind)
        numbers.append(out.addFrame(made, False))
        out.frames[numbers[-1]].name = frame.name
    for k, (frame, number) in enumerate(zip(model.frames, numbers, strict=True)):
        # What is fixed to a locked joint begins there; one that Pinocchio locked is its own parent.
        begins = frame.type == _JOINT and frame.parentJoint not in keep
        if with_parents and not begins and frame.parentFrame < k:
            out.frames[number].parentFrame = numbers[frame.parentFrame]


def add_joint(
    out: pin.Model, parent: int, joint: pin.JointModel, place: pin.SE3, model: pin.Model, index: int
) -> int:
    """Add a joint with the name and limits that one of ``model`` has."""
    here = model.joints[index]
    q, v = slice(here.idx_q, here.idx_q + here.nq), slice(here.idx_v, here.idx_v + here.nv)
    effort, speed = model.effortLimit[v], model.velocityLimit[v]
    low, high = model.lowerPositionLimit[q], model.upperPositionLimit[q]
    if here.nq != joint.nq:  # an angle in place of its cosine and sine
        low, high = np.full(joint.nq, -np.inf), np.full(joint.nq, np.inf)
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
