"""The links and materials of a URDF: what kinematics needs is checked, the rest is kept if sound.

A shape never stops anything: one that cannot be drawn is left out and noted. Whether its mesh is
there is seen when the robot is drawn (`urdf_meshes`).
"""

from __future__ import annotations

import math

from pinsing.description.urdf_source import LARGEST_INERTIA, UrdfSource, show
from pinsing.description.xml_tree import Node
from pinsing.errors import RobotFileError

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
}


def check_link(node: Node, source: UrdfSource) -> tuple[str, Node]:
    """Return a link's name, and the element that Pinocchio shall read.

    Raises
    ------
    RobotFileError
        If the link has no name, or an inertia that is not of finite numbers.
    """
    name = node.attributes.get("name", "")
    if not name.strip():
        raise source.error("a <link> has no name", node)
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
    inertial = node.first("inertial")
    if inertial is None:
        return []
    mass, inertia = inertial.first("mass"), inertial.first("inertia")
    complete = (
        mass is not None
        and "value" in mass.attributes
        and inertia is not None
        and all(key in inertia.attributes for key in _INERTIA)
    )
    for part in (mass, inertia):
        for key in part.attributes if part is not None else ():
            if key == "value" or key in _INERTIA:
                assert part is not None
                source.numbers(part, key, 1, what, LARGEST_INERTIA)
    origin = source.origin(inertial, what)
    if not complete:
        source.note("incomplete <inertial> left out (not needed here) in link", show(name))
        return []
    assert mass is not None
    assert inertia is not None
    return [Node("inertial", {}, inertial.line, [*origin, mass, inertia])]


def _shape(node: Node, source: UrdfSource, what: str) -> list[Node]:
    """Return a checked visual or collision; a capsule becomes three."""
    origin = source.origin(node, what)
    geometry = node.first("geometry")
    if geometry is None or not geometry.children:
        raise source.error(f"{what}: <{node.tag}> has no geometry", node)
    shape = geometry.children[0]
    clean = Node(shape.tag, {}, shape.line)
    if shape.tag == "mesh":
        if "scale" in shape.attributes:
            source.numbers(shape, "scale", 3, what)
            clean.attributes["scale"] = shape.attributes["scale"]
        clean.attributes["filename"] = shape.attributes.get("filename", "")
    else:
        for key, count in _SHAPES.get(shape.tag, {}).items():
            source.attribute(shape, key, what)
            if min(source.numbers(shape, key, count, what)) < 0:
                raise source.error(f"{what}: <{shape.tag} {key}> is negative", shape)
            clean.attributes[key] = shape.attributes[key]
        if not clean.attributes:
            raise source.error(f"{what}: unknown shape <{shape.tag}>", shape)
    placed = [(clean, origin)]
    if shape.tag == "capsule":
        radius, length = (source.numbers(shape, key, 1, what)[0] for key in ("radius", "length"))
        placed = _capsule(radius, length, _pose(node, source, what), shape.line)
    extra = []
    if node.tag == "visual":
        for material in node.all("material")[:1]:
            extra += check_material(material, source)
    named = {k: v for k, v in node.attributes.items() if k == "name" and shape.tag != "capsule"}
    return [
        Node(node.tag, named, node.line, [*at, Node("geometry", {}, 0, [made]), *extra])
        for made, at in placed
    ]


def _pose(node: Node, source: UrdfSource, what: str) -> tuple[list[float], list[float]]:
    """Translation and roll, pitch, yaw of a shape in its link."""
    origin = node.first("origin")
    zero = [0.0, 0.0, 0.0]
    if origin is None:
        return zero, zero
    xyz, rpy = (
        list(source.numbers(origin, key, 3, what)) if key in origin.attributes else zero
        for key in ("xyz", "rpy")
    )
    return xyz, rpy


def _capsule(
    radius: float, length: float, pose: tuple[list[float], list[float]], line: int
) -> list[tuple[Node, list[Node]]]:
    """A capsule as a cylinder and two spheres: not every reader of URDF knows the shape.

    ``length`` is that of the cylinder, between the centres of the spheres.
    """
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
    name = node.attributes.get("name", "")
    if not name:
        return []
    clean = Node("material", {"name": name}, node.line)
    color, texture = node.first("color"), node.first("texture")
    if color is not None and "rgba" in color.attributes:
        try:
            values = source.numbers(color, "rgba", 4, f"material {show(name)}")
        except RobotFileError:
            source.note("unreadable colour left out of material", show(name))
        else:
            rgba = " ".join(repr(min(max(v, 0.0), 1.0)) for v in values)
            clean.children.append(Node("color", {"rgba": rgba}, 0))
    if texture is not None and "filename" in texture.attributes:
        clean.children.append(Node("texture", {"filename": texture.attributes["filename"]}, 0))
    return [clean]
