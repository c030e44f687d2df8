"""A robot description file, read, checked, and rewritten as Pinocchio may read it.

Pinocchio reports every bad file by the same ValueError, takes some silently (a zero axis, a limit
without bounds) and crashes on others. So each file is checked here first, with the line and the
joint in every message, and what is not kinematics is mended or left out with a note.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pinsing.description.ros_packages import PackageIndex, Shapes
from pinsing.description.urdf_elements import (
    JointEntry,
    Mimic,
    check_joint,
    check_link,
    check_material,
    check_mimics,
)
from pinsing.description.xacro import expand_xacro, is_xacro
from pinsing.description.xml_tree import (
    Node,
    UrdfSource,
    parse_text,
    parse_xml,
    read_bytes,
    show,
    to_text,
)
from pinsing.errors import RobotFileError, UnknownNameError

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
                close = difflib.get_close_matches(link, links, n=1) if len(links) <= 500 else []
                hint = f": did you mean {show(close[0])}?" if close else ": no link has that name"
                raise source.error(
                    f"joint {show(joint.name)}: unknown {end} link {show(link)}{hint}", node
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
    depth: dict[str, int] = {}
    for link in links:
        above = [link]
        while above[-1] in parent_joint and above[-1] not in depth:
            above.append(parent_joint[above[-1]].parent)
            if (last := above[-1]) in above[:-1]:
                loop = [parent_joint[name] for name in reversed(above[above.index(last) : -1])]
                named = ", ".join(show(j.name) for j in loop[:6]) + ", ..." * bool(loop[6:])
                raise source.error(
                    f"joints {named} form a loop: a URDF is a tree, so take one out (a closed loop "
                    "is declared in a loop file beside it)",
                    nodes[joints.index(loop[0])],
                )
        start = depth.get(above[-1], 0)
        depth |= {name: start + k for k, name in enumerate(reversed(above))}
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
