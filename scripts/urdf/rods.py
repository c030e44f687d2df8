"""Platforms on six rods of fixed length, whose feet are carriages (6-PUS) or cranks (6-RUS)."""

from __future__ import annotations

import math

import numpy as np
from urdf.parts import about, ball, limits, numbers, outline, platform_frames, points, pose
from urdf.tree import Tree

from pinsing.description.yaml_tree import YamlNode

Vector = np.ndarray


def rods_on_carriages(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Six rails along one direction, a carriage on each, a universal joint, a rod, a ball."""
    base, platform = points(keys["base"]), points(keys["platform"])
    at, R = pose(keys)
    along = np.array(numbers(keys["rail"], 3))
    along /= np.linalg.norm(along)
    length, slide, turn = keys["rod"].number(), limits(keys, "slide"), limits(keys, "turn")
    leans = numbers(keys["leans"], 6)
    size = 0.015 * length
    low, high = slide if slide is not None else (-length, length)
    for k, (a, b, lean) in enumerate(zip(base, platform, leans, strict=True), 1):
        reach = at + R @ b - a
        middle = float(reach @ along)
        rest = length**2 - float(reach @ reach) + middle**2
        value = middle - math.copysign(math.sqrt(rest), lean)
        tree.links["base_link"].bar(a + low * along, a + high * along, size, "dark")
        car = tree.add(f"p{k}", "prismatic", "base_link", f"carriage{k}", a, along, slide, value)
        car.bar(-3 * size * along, 3 * size * along, 2.5 * size, "blue")
        tree.driven.append(f"p{k}")
        _rod(tree, k, (0, 0, 0), reach - value * along, np.eye(3), R, length, turn, size)
    platform_frames(tree, "platform", platform, ("vx", "vy", "vz", "wx", "wy", "wz"), size)
    return tree


def rods_on_cranks(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Six cranks with level axes, a universal joint, a rod, a ball."""
    base, platform = points(keys["base"]), points(keys["platform"])
    at, R = pose(keys)
    crank, length = keys["crank"].number(), keys["rod"].number()
    turn = limits(keys, "turn")
    headings = np.radians(numbers(keys["crank_headings"], 6))
    size = 0.02 * length
    outline(tree.links["base_link"], base, size, "dark")
    for k, (a, b, heading) in enumerate(zip(base, platform, headings, strict=True), 1):
        # At zero the crank is level, along its heading; positive turns raise it.
        out = np.array([math.cos(heading), math.sin(heading), 0.0])
        axis = np.cross(out, (0, 0, 1))
        reach = at + R @ b - a
        x, y = float(reach @ out), float(reach[2])
        known = (float(reach @ reach) + crank**2 - length**2) / (2 * crank)
        value = math.atan2(y, x) - math.acos(known / math.hypot(x, y))
        arm = tree.add(f"a{k}", "continuous", "base_link", f"crank{k}", a, axis, None, value)
        arm.bar((0, 0, 0), crank * out, 1.4 * size, "blue")
        tree.driven.append(f"a{k}")
        turned = about(axis, value)
        rod = reach - turned @ (crank * out)
        _rod(tree, k, crank * out, rod, turned, R, length, turn, size)
    platform_frames(tree, "platform", platform, ("vx", "vy", "vz", "wx", "wy", "wz"), size)
    return tree


def _rod(
    tree: Tree, k: int, foot: Vector, reach: Vector, carried: Vector, R: Vector, length: float,
    turn: tuple[float, float] | None, size: float,
) -> None:  # fmt: skip
    """Universal joint at the foot, rod, and the ball or the frame that closes a loop."""
    parent = tree.joints[-1].child
    kind = "continuous" if turn is None else "revolute"
    d = carried.T @ reach / length
    first, second = math.atan2(-d[1], d[2]), math.asin(float(d[0]))
    tree.add(f"u{k}x", kind, parent, f"cross{k}", foot, (1, 0, 0), turn, first)
    rod = tree.add(f"u{k}y", kind, f"cross{k}", f"rod{k}", (0, 0, 0), (0, 1, 0), turn, second)
    rod.bar((0, 0, 0), (0, 0, length), 0.7 * size, "light")
    if k == 1:
        here = carried @ about((1, 0, 0), first) @ about((0, 1, 0), second)
        ball(tree, "rod1", (0, 0, length), here.T @ R, turn)
    else:
        tree.frame(f"e{k}", f"rod{k}", (0, 0, length))
        tree.close(f"e{k}", f"b{k}")
