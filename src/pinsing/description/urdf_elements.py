"""Joints, links and materials of a URDF, checked and rewritten as Pinocchio may read them.

What kinematics needs is checked. A shape never stops anything: one that cannot be drawn is left out
and noted; whether its mesh is there is seen when the robot is drawn (`ros_packages`).
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast, get_args

from pinsing.description.xml_tree import (
    LARGEST,
    LARGEST_INERTIA,
    NUMBERS,
    SOLIDS,
    Node,
    UrdfSource,
    show,
    suggestion,
)
from pinsing.errors import RobotFileError

JointKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]
KINDS: tuple[str, ...] = get_args(JointKind)
_FOLLOWED = ("revolute", "continuous", "prismatic")
_LARGEST_EVER = 1e100


@dataclass(frozen=True)
class Mimic:
    """A joint value that follows another: ``q = multiplier * q_joint + offset``."""

    joint: str
    multiplier: float
    offset: float


# A URDF demands a speed and an effort; where a DH table is silent, these stand in.
DEFAULT_VELOCITY, DEFAULT_EFFORT = 1.0, 100.0
NO_LIMITS = "no usable limits"
"""How the note on such joints begins."""


@dataclass(frozen=True)
class JointEntry:
    """A joint as the file describes it."""

    # name, parent and child: the joint, the link it hangs on, the link it moves
    name: str
    kind: JointKind  # revolute, continuous, prismatic, fixed, floating or planar
    parent: str
    child: str
    # unit axis in the joint's frame; None for fixed and floating joints
    axis: tuple[float, float, float] | None = None
    # lower and upper: limits [rad] or [m]; None where the kind has none or ``problem`` says that
    # they are missing
    lower: float | None = None
    upper: float | None = None
    mimic: Mimic | None = None  # the joint that it follows
    line: int | None = None  # line in the file; None in the output of xacro
    # why this joint can be locked but not analysed (no usable limits, say). Pinocchio gets limits
    # [0, 0] for it, so nobody may take it into a chain
    problem: str | None = None
    # whether the problem is that it has no limits, or none that limit: a mechanism may move it
    # without end
    endless: bool = False


def check_joint(node: Node, source: UrdfSource) -> tuple[JointEntry, Node]:
    """Return a joint's entry, and the element that Pinocchio shall read."""
    name = node.attributes.get("name", "")
    source.refuse_if(not name.strip(), "a <joint> has no name", node)
    what = f"joint {show(name)}"
    source.check_name(name, what, node)
    source.refuse_if(
        name == "universe", f"{what}: the name is Pinocchio's own: rename the joint", node
    )
    kind = _kind(node, source, what)
    _check_spelling(node, source, what)
    parent, child = (_end(node, source, what, tag) for tag in ("parent", "child"))
    clean = Node("joint", {"name": name, "type": kind}, node.line)
    clean.children += source.origin(node, what)
    clean.children += [Node("parent", {"link": parent}, 0), Node("child", {"link": child}, 0)]
    entry = JointEntry(name, kind, parent, child, line=source.line(node))
    if kind in ("fixed", "floating"):
        return entry, clean

    axis, element = _axis(node, source, what, name)
    clean.children.append(element)
    entry = replace(entry, axis=axis)
    if kind != "planar":
        entry, limit = _limit(node, source, what, entry)
        clean.children += limit
    clean.children += _dynamics(node, source, what, name)
    if (mimic := source.one(node, "mimic", what)) is not None:
        entry = replace(entry, mimic=_mimic(mimic, source, what))
        clean.children.append(mimic)
    return entry, clean


_PARTS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("joint", "multiplier", "offset"),
    "parent": ("link",),
    "child": ("link",),
}
"""Elements of a joint that move it, with their attributes."""


def _check_spelling(node: Node, source: UrdfSource, what: str) -> None:
    """Refuse what looks like a part of a joint and is none: without it the arm is another."""
    for child in node.children:
        known = _PARTS.get(child.tag)
        names = [child.tag] if known is None else [*child.attributes]
        for name in (n for n in names if n not in (known or _PARTS)):
            meant = difflib.get_close_matches(name[:50].lower(), known or _PARTS, 1, 0.66)
            near = meant and abs(len(meant[0]) - len(name)) <= 2  # "gear_velocity" is no slip
            if near:
                sort = "element" if known is None else f"attribute of <{child.tag}>"
                said = f"{what}: unknown {sort} {show(name)}: did you mean {show(meant[0])}?"
                raise source.error(said, child)


def _kind(node: Node, source: UrdfSource, what: str) -> JointKind:
    kind = source.attribute(node, "type", what)
    if kind not in KINDS:
        hint = suggestion(kind.strip().lower(), KINDS)
        raise source.error(f"{what}: unknown type {show(kind)}: {hint}", node)
    return cast(JointKind, kind)


def _end(node: Node, source: UrdfSource, what: str, tag: str) -> str:
    if (element := source.one(node, tag, what)) is None:
        raise source.error(f'{what} has no <{tag} link="..."/>', node)
    return source.attribute(element, "link", what)


def _axis(
    node: Node, source: UrdfSource, what: str, name: str
) -> tuple[tuple[float, float, float], Node]:
    if (element := source.one(node, "axis", what)) is None:  # the default of URDF
        return (1.0, 0.0, 0.0), Node("axis", {"xyz": "1 0 0"}, 0)
    source.attribute(element, "xyz", what)
    x, y, z = source.numbers(element, "xyz", 3, what)
    norm = math.hypot(x, y, z)
    source.refuse_if(
        norm < 1e-6, f'{what}: the axis is zero: give a direction, as xyz="0 0 1"', element
    )
    if norm == 1.0:
        return (x, y, z), Node("axis", {"xyz": element.attributes["xyz"]}, 0)
    # Pinocchio normalises too, but then no longer sees that the axis is x, y or z.
    if abs(norm - 1.0) > 1e-3:
        source.note("axis not of unit length, normalised, in joint", show(name))
    x, y, z = x / norm, y / norm, z / norm
    return (x, y, z), Node("axis", {"xyz": f"{x!r} {y!r} {z!r}"}, 0)


def _limit(
    node: Node, source: UrdfSource, what: str, entry: JointEntry
) -> tuple[JointEntry, list[Node]]:
    element = source.one(node, "limit", what)
    bounded = entry.kind != "continuous"
    if element is None:
        if not bounded:
            return entry, []
        return _without_limits(source, entry, "has no <limit>")
    values = {k: v[0] for k, v in source.values(element, what, _LARGEST_EVER).items()}
    clean = Node("limit", _effort_and_velocity(element, source, what, entry.name), 0)
    if not bounded:
        if values:
            source.note("continuous, so its limits are ignored: joint", show(entry.name))
        return entry, [clean]
    if not values:
        return _without_limits(source, entry, "has a <limit> without lower and upper")
    if len(values) == 1:
        source.note("only one limit given, the other taken as 0, in joint", show(entry.name))
    lower, upper = values.get("lower", 0.0), values.get("upper", 0.0)
    source.refuse_if(
        lower > upper,
        f"{what}: lower limit {lower:g} is above upper limit {upper:g}: exchange them",
        element,
    )
    if max(-lower, upper) > LARGEST:
        return _without_limits(source, entry, f"has limits {lower:g} to {upper:g}, which are none")
    clean.attributes.update(lower=repr(lower), upper=repr(upper))
    return replace(entry, lower=lower, upper=upper), [clean]


def _without_limits(
    source: UrdfSource, entry: JointEntry, reason: str
) -> tuple[JointEntry, list[Node]]:
    cure = (
        'give it lower and upper, or make it type="continuous"'
        if entry.kind == "revolute"
        else "give it lower and upper"
    )
    source.note(f"{NO_LIMITS}, so it can be locked but not analysed: joint", show(entry.name))
    nothing = {"lower": "0", "upper": "0", "effort": "0", "velocity": "0"}
    return replace(entry, problem=f"{reason}: {cure}", endless=True), [Node("limit", nothing, 0)]


def _effort_and_velocity(element: Node, source: UrdfSource, what: str, name: str) -> dict[str, str]:
    """Return both, which Pinocchio demands and kinematics does not need."""
    values = {}
    for attribute in ("effort", "velocity"):
        try:
            source.numbers(element, attribute, 1, what, _LARGEST_EVER)
            values[attribute] = element.attributes[attribute]
        except (KeyError, RobotFileError):
            values[attribute] = "0"
            source.note(f"no usable {attribute} limit (not needed here) in joint", show(name))
    return values


def _dynamics(node: Node, source: UrdfSource, what: str, name: str) -> list[Node]:
    """Return the <dynamics> if it is sound; kinematics does not need it."""
    if (element := node.first("dynamics")) is None:
        return []
    clean = _only_numbers(element)
    try:
        source.values(clean, what, _LARGEST_EVER)
    except RobotFileError:
        source.note("unreadable <dynamics> left out (not needed here) in joint", show(name))
        return []
    return [clean] if clean.attributes else []


def _only_numbers(node: Node) -> Node:
    """A copy of an element with the attributes of `NUMBERS`."""
    kept = {k: v for k, v in node.attributes.items() if k in NUMBERS[node.tag]}
    return Node(node.tag, kept, node.line)


def _mimic(element: Node, source: UrdfSource, what: str) -> Mimic:
    values = {"multiplier": (1.0,), "offset": (0.0,)} | source.values(element, what)
    leader = source.attribute(element, "joint", what)
    return Mimic(leader, values["multiplier"][0], values["offset"][0])


def check_mimics(
    entries: Sequence[JointEntry], elements: Sequence[Node], source: UrdfSource
) -> tuple[JointEntry, ...]:
    """Return the entries with every mimic resolved."""
    # One that follows an unknown or immovable joint keeps a ``problem`` and loses its mimic.
    by_name = {entry.name: entry for entry in entries}
    leader = {entry.name: entry.mimic.joint for entry in entries if entry.mimic is not None}
    resolved = []
    for entry, element in zip(entries, elements, strict=True):
        path = [entry.name]
        while path[-1] in leader and path[-1] not in path[:-1]:
            path.append(leader[path[-1]])
        source.refuse_if(
            path[-1] in path[:-1],
            f"<mimic> without end: joint {' follows '.join(map(show, path))}",
            element,
        )
        followed = None if entry.mimic is None else by_name.get(entry.mimic.joint)
        resolved.append(entry)
        if entry.mimic is None or (followed is not None and followed.kind in _FOLLOWED):
            continue
        # Two of the robots in example-robot-data have such fingers.
        near = list(by_name) if len(by_name) <= 500 and followed is None else []
        close = difflib.get_close_matches(entry.mimic.joint[:60], near, n=1)
        which = "does not exist" if followed is None else f"is {followed.kind}"
        cure = f"did you mean {show(close[0])}?" if close else "correct the name"
        reason = f"mimics joint {show(entry.mimic.joint)}, which {which}: {cure}"
        source.note("mimics a joint that does not exist or move: joint", show(entry.name))
        element.children[:] = [c for c in element.children if c.tag != "mimic"]
        resolved[-1] = replace(entry, mimic=None, problem=entry.problem or reason)
    return tuple(resolved)


def check_link(node: Node, source: UrdfSource) -> tuple[str, Node]:
    """Return a link's name, and the element that Pinocchio shall read."""
    name = node.attributes.get("name", "")
    source.refuse_if(not name.strip(), "a <link> has no name", node)
    what = f"link {show(name)}"
    source.check_name(name, what, node)
    clean = Node("link", {"name": name}, node.line)
    clean.children += _inertial(node, source, what, name)
    for tag in ("visual", "collision"):
        for shape in node.all(tag):
            try:
                clean.children += _shape(shape, source, what)
            except RobotFileError:
                source.note(f"a <{tag}> that cannot be read is left out of link", show(name))
    return name, clean


def _inertial(node: Node, source: UrdfSource, what: str, name: str) -> list[Node]:
    if (inertial := node.first("inertial")) is None:
        return []
    parts = [part for part in map(inertial.first, ("mass", "inertia")) if part is not None]
    given = {part.tag: [*source.values(part, what, LARGEST_INERTIA)] for part in parts}
    origin = source.origin(inertial, what)
    if given != {tag: [*NUMBERS[tag]] for tag in ("mass", "inertia")}:
        source.note("incomplete <inertial> left out (not needed here) in link", show(name))
        return []
    return [Node("inertial", {}, inertial.line, [*origin, *parts])]


def _shape(node: Node, source: UrdfSource, what: str) -> list[Node]:
    """Return a checked visual or collision; a capsule becomes three."""
    origin = source.origin(node, what)
    geometry = node.first("geometry")
    if geometry is None or not geometry.children:
        raise source.error(f"{what}: <{node.tag}> has no geometry", node)
    shape = geometry.children[0]
    source.refuse_if(
        shape.tag != "mesh" and shape.tag not in SOLIDS,
        f"{what}: unknown shape <{shape.tag}>",
        shape,
    )
    for key in SOLIDS.get(shape.tag, ()):
        source.attribute(shape, key, what)
    values = source.values(shape, what)
    clean = _only_numbers(shape)
    placed = [(clean, origin)]
    if shape.tag == "mesh":
        clean.attributes["filename"] = shape.attributes.get("filename", "")
    else:
        for key, numbers in values.items():
            source.refuse_if(min(numbers) < 0, f"{what}: <{shape.tag} {key}> is negative", shape)
    if shape.tag == "capsule":
        pose: dict[str, tuple[float, ...]] = dict.fromkeys(("xyz", "rpy"), (0.0, 0.0, 0.0))
        for at in origin:
            pose |= source.values(at, what)
        (radius,), (length,) = values["radius"], values["length"]
        placed = _capsule(radius, length, (pose["xyz"], pose["rpy"]), shape.line)
    materials = node.all("material")[:1] if node.tag == "visual" else []
    extra = [kept for material in materials for kept in check_material(material, source)]
    named = {k: v for k, v in node.attributes.items() if k == "name" and shape.tag != "capsule"}
    return [
        Node(node.tag, named, node.line, [*at, Node("geometry", {}, 0, [made]), *extra])
        for made, at in placed
    ]


def _capsule(
    radius: float, length: float, pose: tuple[tuple[float, ...], tuple[float, ...]], line: int
) -> list[tuple[Node, list[Node]]]:
    """Return a capsule as a cylinder of ``length`` and two spheres: some readers lack the shape."""
    xyz, rpy = pose
    (cr, cp, cy), (sr, sp, sy) = ([f(a) for a in rpy] for f in (math.cos, math.sin))
    z = (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)  # third column of Rz Ry Rx

    def origin(along: float) -> list[Node]:
        at = " ".join(repr(x + along * d) for x, d in zip(xyz, z, strict=True))
        return [Node("origin", {"xyz": at, "rpy": " ".join(map(repr, rpy))}, line)]

    def ball() -> Node:
        return Node("sphere", {"radius": repr(radius)}, line)

    rod = Node("cylinder", {"radius": repr(radius), "length": repr(length)}, line)
    half = length / 2
    return [(rod, origin(0.0)), (ball(), origin(half)), (ball(), origin(-half))]


def check_material(node: Node, source: UrdfSource) -> list[Node]:
    """Return a material with what is sound of its colour and texture; nothing if unnamed."""
    if not (name := node.attributes.get("name", "")):
        return []
    clean = Node("material", {"name": name}, node.line)
    color, texture = node.first("color"), node.first("texture")
    if color is not None and "rgba" in color.attributes:
        try:
            values = source.values(color, f"material {show(name)}")["rgba"]
        except RobotFileError:
            source.note("unreadable colour left out of material", show(name))
        else:
            rgba = " ".join(repr(min(max(v, 0.0), 1.0)) for v in values)
            clean.children.append(Node("color", {"rgba": rgba}, 0))
    if texture is not None and "filename" in texture.attributes:
        clean.children.append(Node("texture", {"filename": texture.attributes["filename"]}, 0))
    return [clean]
