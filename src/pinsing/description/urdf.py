"""A robot description file, read, checked, and rewritten as Pinocchio may read it.

Pinocchio reports every bad file by the same ValueError, takes some silently (a zero axis, a limit
without bounds) and crashes on others. So each file is checked here first, with the line and the
joint in every message, and what is not kinematics is mended or left out with a note.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Literal, NamedTuple, cast, get_args

from pinsing.description.files import PackageIndex, Shapes, expand_xacro, is_xacro
from pinsing.description.xml_tree import (
    LARGEST,
    LARGEST_INERTIA,
    NUMBERS,
    SOLIDS,
    Node,
    UrdfSource,
    parse_text,
    parse_xml,
    read_bytes,
    show,
    suggestion,
    to_text,
)
from pinsing.errors import RobotFileError, UnknownNameError

JointKind = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar"]
KINDS: tuple[str, ...] = get_args(JointKind)
_FOLLOWED = ("revolute", "continuous", "prismatic")
_LARGEST_EVER = 1e100


class Mimic(NamedTuple):
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


def _named(node: Node, source: UrdfSource) -> tuple[str, str]:
    """Return the name of a link or joint, and what messages call it."""
    name = node.attributes.get("name", "")
    source.refuse_if(not name.strip(), f"a <{node.tag}> has no name", node)
    what = f"{node.tag} {show(name)}"
    source.check_name(name, what, node)
    return name, what


def check_joint(node: Node, source: UrdfSource) -> tuple[JointEntry, Node]:
    """Return a joint's entry, and the element that Pinocchio shall read."""
    name, what = _named(node, source)
    source.refuse_if(
        name == "universe", f"{what}: the name is Pinocchio's own: rename the joint", node
    )
    kind = source.attribute(node, "type", what)
    if kind not in KINDS:
        hint = suggestion(kind.strip().lower(), KINDS)
        raise source.error(f"{what}: unknown type {show(kind)}: {hint}", node)
    _check_spelling(node, source, what)
    ends: dict[str, str] = {}
    for tag in ("parent", "child"):
        if (element := source.one(node, tag, what)) is None:
            raise source.error(f'{what} has no <{tag} link="..."/>', node)
        ends[tag] = source.attribute(element, "link", what)
    clean = Node("joint", {"name": name, "type": kind}, node.line)
    clean.children += source.origin(node, what)
    clean.children += [Node(tag, {"link": link}, 0) for tag, link in ends.items()]
    entry = JointEntry(
        name, cast(JointKind, kind), ends["parent"], ends["child"], line=source.line(node)
    )
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
        values = source.values(clean, what, _LARGEST_EVER)
        source.refuse_if(any(min(of) < 0 for of in values.values()), "negative", element)
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
    places = dict(zip(by_name, elements, strict=True))
    follows = {entry.name: [entry.mimic.joint] for entry in entries if entry.mimic is not None}
    try:
        TopologicalSorter(follows).prepare()
    except CycleError as error:
        ring = error.args[1][::-1]
        said = f"<mimic> without end: joint {' follows '.join(map(show, ring))}"
        raise source.error(said, places[ring[0]]) from None
    for entry in entries:
        followed = None if entry.mimic is None else by_name.get(entry.mimic.joint)
        if entry.mimic is None or (followed is not None and followed.kind in _FOLLOWED):
            continue
        # Two of the robots in example-robot-data have such fingers.
        known = [e.name for e in entries] if followed is None else []
        which = "does not exist" if followed is None else f"is {followed.kind}"
        cure = _meant(entry.mimic.joint, known, "correct the name")
        reason = f"mimics joint {show(entry.mimic.joint)}, which {which}: {cure}"
        source.note("mimics a joint that does not exist or move: joint", show(entry.name))
        element = places[entry.name]
        element.children[:] = [c for c in element.children if c.tag != "mimic"]
        by_name[entry.name] = replace(entry, mimic=None, problem=entry.problem or reason)
    return tuple(by_name.values())


def _meant(name: str, known: Sequence[str], otherwise: str) -> str:
    close = difflib.get_close_matches(name[:60], known, n=1) if len(known) <= 500 else []
    return f"did you mean {show(close[0])}?" if close else otherwise


def check_link(node: Node, source: UrdfSource) -> tuple[str, Node]:
    """Return a link's name, and the element that Pinocchio shall read."""
    name, what = _named(node, source)
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
    every = (*NUMBERS["mass"], *NUMBERS["inertia"])
    given = {part.tag: [*source.values(part, what, LARGEST_INERTIA, every)] for part in parts}
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
        (radius,), (length,) = values["radius"], values["length"]
        at = origin[0] if origin else Node("origin", {}, shape.line)
        placed = _capsule(radius, length, at, source.values(at, what))
    materials = node.all("material")[:1] if node.tag == "visual" else []
    extra = [kept for material in materials for kept in check_material(material, source)]
    named = {k: v for k, v in node.attributes.items() if k == "name" and shape.tag != "capsule"}
    return [
        Node(node.tag, named, node.line, [*at, Node("geometry", {}, 0, [made]), *extra])
        for made, at in placed
    ]


def _capsule(
    radius: float, length: float, at: Node, pose: Mapping[str, tuple[float, ...]]
) -> list[tuple[Node, list[Node]]]:
    """Return a capsule as a cylinder of ``length`` and two spheres: some readers lack the shape."""
    xyz, rpy = (pose.get(name, (0.0, 0.0, 0.0)) for name in ("xyz", "rpy"))
    (cr, cp, cy), (sr, sp, sy) = ([f(a) for a in rpy] for f in (math.cos, math.sin))
    z = (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)  # third column of Rz Ry Rx
    if "quat_xyzw" in pose:
        a, b, c, d = (x / math.hypot(*pose["quat_xyzw"]) for x in pose["quat_xyzw"])
        z = 2 * (a * c + b * d), 2 * (b * c - a * d), 1 - 2 * (a * a + b * b)

    def origin(along: float) -> list[Node]:
        moved = " ".join(repr(x + along * d) for x, d in zip(xyz, z, strict=True))
        return [Node("origin", {**at.attributes, "xyz": moved}, at.line)]

    size, half = {"radius": repr(radius)}, length / 2
    rod = Node("cylinder", size | {"length": repr(length)}, at.line)
    ends = [(Node("sphere", size, at.line), origin(side)) for side in (half, -half)]
    return [(rod, origin(0.0)), *ends]


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


__all__ = ["Description", "JointEntry", "Mimic", "parse_description", "read_description"]


MAX_IN_A_TREE = 5000
# Pinocchio builds the tree by recursion: 10,000 joints in a row overflow its stack.
MAX_DEPTH = 1000


def check_unique(
    kind: str, names: Sequence[str], nodes: Sequence[Node], source: UrdfSource
) -> None:
    """Refuse a name that two links, or two joints, share."""
    first: dict[str, Node] = {}
    for name, node in zip(names, nodes, strict=True):
        if name in first:
            other = "" if source.expanded else f" (the first is on line {first[name].line})"
            raise source.error(f"two {kind}s are named {show(name)}{other}: rename one", node)
        first[name] = node


def check_tree(
    links: Sequence[str], joints: Sequence[JointEntry], nodes: Sequence[Node], source: UrdfSource
) -> str:
    """Return the root link of the tree that the joints make of the links."""
    known = set(links)
    parent_joint: dict[str, JointEntry] = {}
    for joint, node in zip(joints, nodes, strict=True):
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                hint = _meant(link, links, "no link has that name")
                raise source.error(
                    f"joint {show(joint.name)}: unknown {end} link {show(link)}: {hint}", node
                )
        source.refuse_if(
            joint.parent == joint.child,
            f"joint {show(joint.name)} joins link {show(joint.child)} to itself",
            node,
        )
        if (other := parent_joint.get(joint.child)) is not None:
            raise source.error(
                f"link {show(joint.child)} has two parents, by joints {show(other.name)} and "
                f"{show(joint.name)}: a URDF is a tree, so take one joint out (a closed loop is "
                "declared in a loop file beside it)",
                node,
            )
        parent_joint[joint.child] = joint
    above = {joint.child: [joint.parent] for joint in joints}
    depth = dict.fromkeys(links, 0)
    try:
        for link in TopologicalSorter(above).static_order():
            depth[link] = max([depth[parent] + 1 for parent in above.get(link, ())], default=0)
    except CycleError as error:
        ring = error.args[1][1:]
        start = ring.index(min(ring, key=links.index)) + 1
        loop = [parent_joint[link] for link in ring[start:] + ring[:start]]
        named = ", ".join(show(j.name) for j in loop[:6]) + ", ..." * bool(loop[6:])
        raise source.error(
            f"joints {named} form a loop: a URDF is a tree, so take one out (a closed loop "
            "is declared in a loop file beside it)",
            nodes[joints.index(loop[0])],
        ) from None
    roots = [link for link in links if link not in parent_joint]
    named = ", ".join(show(link) for link in roots[:5]) + ", ..." * bool(roots[5:])
    source.refuse_if(
        len(roots) > 1,
        f"{len(roots)} links have no parent ({named}): a URDF has one root, so join the others "
        "to it by joints, or remove them",
    )
    source.refuse_if(
        max(depth.values()) > MAX_DEPTH,
        f"{max(depth.values())} joints in a row: at most {MAX_DEPTH} are supported",
    )
    return roots[0]


_TEXT = Path("URDF text")  # what messages call text that came without a file
_OTHER_FORMATS = {
    "sdf": "an SDF file",
    "mujoco": "a MuJoCo model",
    "COLLADA": "a Collada mesh",
    "model": "an SDF or VRML model",
    "launch": "a ROS launch file",
    "package": "a package.xml",
    "html": "a web page",
}


@dataclass(frozen=True)
class Description:
    """A checked robot description.

    Meshes are looked for when first asked for: by ``xml``, ``missing_meshes`` or ``notes``. What
    these say holds from then on, whatever becomes of the folder; see `Shapes`.
    """

    path: Path  # the file as given; ``URDF text`` where there is none
    name: str  # name of the robot
    links: tuple[str, ...]  # names of the links, in the order of the file
    joints: tuple[JointEntry, ...]  # the joints, in the order of the file
    root: str  # the link without parent
    assumed: tuple[str, ...]  # what was assumed, mended or left out, meshes aside
    shapes: Shapes = field(repr=False)  # the URDF as text, and its meshes once they are looked for

    @property
    def kinematics(self) -> str:
        """Plain URDF: links, joints, materials, with the addresses of meshes as in the file."""
        return self.shapes.text

    @property
    def xml(self) -> str:
        """Plain URDF whose meshes exist, as file:// addresses; shapes of others are left out."""
        return self.shapes.found.xml

    @property
    def missing_meshes(self) -> tuple[str, ...]:
        """Mesh and texture addresses, as in the file, that do not exist or may not be opened."""
        return self.shapes.found.missing

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes: assumptions, repairs and omissions, with the meshes that are not drawn."""
        return (*self.assumed, *self.shapes.found.notes)

    def joint(self, name: str) -> JointEntry:
        """Return a joint by name."""
        for entry in self.joints:
            if entry.name == name:
                return entry
        raise UnknownNameError("joint", name, (entry.name for entry in self.joints))

    def require_usable(self, names: Iterable[str]) -> None:
        """Make sure that joints can be part of a chain that is analysed."""
        for name in names:
            entry = self.joint(name)
            if entry.problem is not None:
                raise RobotFileError(
                    f"joint {show(name)} ({entry.kind}) {entry.problem}", self.path, entry.line
                )


def read_description(
    path: str | Path,
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> Description:
    """Read and check a URDF or xacro file; errors have file, line and joint."""
    # Whatever Pinocchio would refuse, crash on, or misread is one. Joints that merely lack limits
    # are left to `Description.require_usable`.
    path = Path(path)
    _check_packages(packages)
    root = parse_xml(read_bytes(path), path)
    source = UrdfSource(path)
    roots: tuple[Path, ...] = ()
    if is_xacro(path, root):
        expansion = expand_xacro(path, packages, xacro_args)
        root = parse_xml(expansion.xml.encode(), path)
        source.expanded = True
        roots = expansion.package_folders
        for warning in expansion.warnings:
            source.note(f"xacro warns: {warning}")
    elif xacro_args:
        raise RobotFileError("is no xacro file, so it takes no xacro arguments", path)
    return _describe(root, source, PackageIndex(path, packages, roots))


def parse_description(text: str, packages: Mapping[str, str | Path] | None = None) -> Description:
    """Check the text of a URDF, as it comes from ``/robot_description``."""
    # Meshes are those of ``packages`` and the environment; relative addresses have no folder.
    _check_packages(packages)
    try:
        root = parse_text(text, _TEXT)
        RobotFileError.refuse_if(
            is_xacro(_TEXT, root), "is xacro: give the path of the file, or expand it first", _TEXT
        )
        return _describe(root, UrdfSource(_TEXT), PackageIndex(None, packages))
    except RobotFileError as error:
        error.path = None
        raise


def _check_packages(packages: Mapping[str, str | Path] | None) -> None:
    for name, folder in (packages or {}).items():
        RobotFileError.refuse_if(
            not Path(folder).is_dir(),
            f"the folder given for package {name!r} does not exist",
            folder,
        )


def _describe(root: Node, source: UrdfSource, index: PackageIndex) -> Description:
    if root.tag != "robot":
        kind = _OTHER_FORMATS.get(root.tag)
        found = f"is {kind}" if kind else f"has the root element <{root.tag[:40]}>"
        raise source.error(f"{found}, not a URDF, whose root is <robot>", root)
    joint_nodes, link_nodes = root.all("joint"), root.all("link")
    source.refuse_if(not link_nodes, "the robot has no links, so there is nothing to analyse", root)
    source.refuse_if(
        not joint_nodes, "the robot has no joints, so there is nothing to analyse", root
    )
    source.refuse_if(
        len(joint_nodes) > MAX_IN_A_TREE,
        f"{len(joint_nodes)} joints: at most {MAX_IN_A_TREE} are supported",
        root,
    )
    if not (name := root.attributes.get("name", "").strip()):
        name = "robot" if source.path == _TEXT else source.path.name.partition(".")[0] or "robot"
        after = "" if source.path == _TEXT else " after its file"
        source.note(f"the robot has no name: called {name!r}{after}")

    source.check_name(name, f"robot {show(name)}", root)

    source.version = root.attributes.get("version", source.version)
    checked_links = [check_link(node, source) for node in link_nodes]
    links = tuple(link for link, _ in checked_links)
    check_unique("link", links, link_nodes, source)
    checked_joints = [check_joint(node, source) for node in joint_nodes]
    elements = [element for _, element in checked_joints]
    check_unique("joint", [entry.name for entry, _ in checked_joints], joint_nodes, source)
    joints = check_mimics([entry for entry, _ in checked_joints], elements, source)
    base = check_tree(links, joints, joint_nodes, source)
    source.refuse_if(
        "universe" in links and base != "universe",
        "link 'universe': the name is Pinocchio's own: rename the link",
    )

    robot = Node("robot", {"name": name}, root.line)
    if source.version in ("1.1", "1.2"):  # quat_xyzw counts from there on
        robot.attributes["version"] = "1.1"
    robot.children += _materials(root, source)
    robot.children += [element for _, element in checked_links]
    robot.children += elements
    return Description(
        path=source.path,
        name=name,
        links=links,
        joints=joints,
        root=base,
        assumed=source.notes(),
        shapes=Shapes(to_text(robot), index),
    )


def _materials(root: Node, source: UrdfSource) -> list[Node]:
    """Return the materials of the robot, the first of each name, if they say anything."""
    kept: dict[str, Node] = {}
    for node in root.all("material"):
        for material in check_material(node, source):
            if material.children:
                kept.setdefault(material.attributes["name"], material)
    return list(kept.values())
