"""What the kinds of mechanism share: numbers of a table, platforms and balls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from urdf.tree import Link, Tree

from pinsing.description.yaml_tree import YamlNode

Vector = np.ndarray
Z = (0.0, 0.0, 1.0)


def numbers(node: YamlNode, count: int | None = None) -> list[float]:
    """Numbers of a list."""
    return [x.number() for x in node.items("value", count)]


def points(node: YamlNode) -> list[Vector]:
    """Points, as ``[x, y, z]`` each or as ``{radius, angles}`` in degrees, about z."""
    if "radius" in node.keys():  # noqa: SIM118  (a method of the YAML node)
        polar = node.mapping(("radius", "angles"), ("height",))
        height = polar["height"].number() if "height" in polar else 0.0
        radius = polar["radius"].number()
        angles = [x.number(Fraction(1, 180), pi=1) for x in polar["angles"].items("angle")]
        return [np.array([radius * math.cos(a), radius * math.sin(a), height]) for a in angles]
    return [np.array(numbers(x, 3)) for x in node.items("point")]


def limits(keys: dict[str, YamlNode], name: str) -> tuple[float, float] | None:
    """Two limits; none where the table has none."""
    if name not in keys:
        return None
    low, high = numbers(keys[name], 2)
    return low, high


def pose(keys: dict[str, YamlNode]) -> tuple[Vector, Vector]:
    """Home of the platform: position, and rotation by roll, pitch and yaw in degrees."""
    home = keys["home"].mapping(("position",), ("turn",))
    at = np.array(numbers(home["position"], 3))
    turn = (
        [x.number(Fraction(1, 180), pi=1) for x in home["turn"].items("angle", 3)]
        if ("turn" in home)
        else [0.0, 0.0, 0.0]
    )
    r, p, y = turn
    return at, about(Z, y) @ about((0, 1, 0), p) @ about((1, 0, 0), r)


def about(axis: Sequence[float], angle: float) -> Vector:
    """Rotation about an axis, radians."""
    x, y, z = np.array(axis, dtype=float) / np.linalg.norm(axis)
    c, s = math.cos(angle), math.sin(angle)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) * c + s * cross + (1 - c) * np.outer([x, y, z], [x, y, z])


def xyz(rotation: Vector) -> tuple[float, float, float]:
    """Angles of turns about x, then y, then z, of the moved frame; of two ways the shorter."""
    R = np.where(np.abs(rotation) < 1e-12, 0.0, rotation)
    b = math.asin(float(np.clip(R[0, 2], -1, 1)))
    a, c = math.atan2(-R[1, 2], R[2, 2]), math.atan2(-R[0, 1], R[0, 0])
    other = (a - math.copysign(math.pi, a), math.copysign(math.pi, b) - b,
             c - math.copysign(math.pi, c))  # fmt: skip
    return min((a, b, c), other, key=lambda x: abs(x[0]) + abs(x[2]))


def outline(link: Link, corners: Sequence[Vector], radius: float, color: str) -> None:
    """Bars from corner to corner."""
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        link.bar(a, b, radius, color)


def platform_frames(
    tree: Tree, parent: str, corners: Sequence[Vector], rows: Sequence[str], size: float
) -> None:
    """The frames at the joints of the platform (from the second on) and at its origin."""
    first = corners[0]
    for k, b in enumerate(corners[1:], 2):
        tree.frame(f"b{k}", parent, b - first)
    tree.frame("platform_center", parent, -first)
    outline(tree.links[parent], [b - first for b in corners], size, "tool")
    tree.output, tree.rows = "platform_center", tuple(rows)


def ball(
    tree: Tree, parent: str, at: Sequence[float], turned: Vector, turn: tuple[float, float] | None
) -> None:
    """Three turning joints that carry the platform."""
    kind = "continuous" if turn is None else "revolute"
    links = ("ball_a", "ball_b", "platform")
    for axis, name, link, value in zip(np.eye(3), "xyz", links, xyz(turned), strict=True):
        tree.add(f"s1{name}", kind, parent, link, at, axis, turn, value)
        parent, at = link, (0, 0, 0)
