"""Tables of parallel mechanisms (``*.mechanism.yaml``) as spanning trees, by kind of leg."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from urdf.parts import (
    Vector,
    Z,
    about,
    ball,
    limits,
    numbers,
    outline,
    platform_frames,
    points,
    pose,
)
from urdf.rods import rods_on_carriages, rods_on_cranks
from urdf.tree import Tree

from pinsing.description.yaml_tree import YamlNode, compose


def read_table(path: Path) -> tuple[str, str]:
    """The URDF and the loop file that a table means."""
    root = compose(path)
    kind = _peek(root)
    keys = root.mapping(("name", "source", "kind", *KINDS[kind][0]), KINDS[kind][1])
    name = keys["name"].text()
    if path.name != f"{name}.mechanism.yaml":
        raise keys["name"].error(f"the file of {name} is {name}.mechanism.yaml: rename one")
    source = keys["source"].text()
    tree = KINDS[kind][2](Tree(name, source), keys)
    return tree.urdf(), tree.loops(source)


def _peek(root: YamlNode) -> str:
    for key, value in root.node.value:
        if key.value == "kind":
            if value.value in KINDS:
                return str(value.value)
            raise root.error(f"unknown kind {value.value!r}: it is one of {', '.join(KINDS)}")
    raise root.error("missing key 'kind': add it")


# -- kinds of mechanism ---------------------------------------------------------------------------


def _ups(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Six legs: universal joint, driven slide, ball."""
    base, platform = points(keys["base"]), points(keys["platform"])
    at, R = pose(keys)
    slide, turn = limits(keys, "length"), limits(keys, "turn")
    kind = "continuous" if turn is None else "revolute"
    size = float(np.abs(base[0]).max()) * 0.02
    outline(tree.links["base_link"], base, size, "dark")
    for k, (a, b) in enumerate(zip(base, platform, strict=True), 1):
        reach = at + R @ b - a
        length = float(np.linalg.norm(reach))
        d = reach / length
        first, second = math.atan2(-d[1], d[2]), math.asin(float(d[0]))
        tree.add(f"u{k}x", kind, "base_link", f"cross{k}", a, (1, 0, 0), turn, first)
        low = tree.add(
            f"u{k}y", kind, f"cross{k}", f"cylinder{k}", (0, 0, 0), (0, 1, 0), turn, second
        )
        low.bar((0, 0, 0), (0, 0, 0.5 * length), 1.4 * size, "blue")
        rod = tree.add(f"p{k}", "prismatic", f"cylinder{k}", f"rod{k}", (0, 0, 0), Z, slide, length)
        rod.bar((0, 0, -0.8 * length), (0, 0, 0), size, "light")
        tree.driven.append(f"p{k}")
        if k == 1:
            leg = about((1, 0, 0), first) @ about((0, 1, 0), second)
            ball(tree, "rod1", (0, 0, 0), leg.T @ R, turn)
        else:
            tree.frame(f"e{k}", f"rod{k}", (0, 0, 0))
            tree.close(f"e{k}", f"b{k}")
    platform_frames(tree, "platform", platform, ("vx", "vy", "vz", "wx", "wy", "wz"), size)
    return tree


def _rps(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Three legs: turning joint across the radius, driven slide, ball."""
    base, platform = points(keys["base"]), points(keys["platform"])
    at, R = pose(keys)
    slide, turn = limits(keys, "length"), limits(keys, "turn")
    size = float(np.abs(base[0]).max()) * 0.025
    kind = "continuous" if turn is None else "revolute"
    outline(tree.links["base_link"], base, size, "dark")
    for k, (a, b) in enumerate(zip(base, platform, strict=True), 1):
        axis = np.cross(Z, a / np.linalg.norm(a))
        reach = at + R @ b - a
        length = float(np.linalg.norm(reach))
        value = math.atan2(float(np.cross(Z, reach) @ axis), float(reach @ Z))
        low = tree.add(f"r{k}", kind, "base_link", f"cylinder{k}", a, axis, turn, value)
        low.bar((0, 0, 0), (0, 0, 0.5 * length), 1.4 * size, "blue")
        rod = tree.add(f"p{k}", "prismatic", f"cylinder{k}", f"rod{k}", (0, 0, 0), Z, slide, length)
        rod.bar((0, 0, -0.8 * length), (0, 0, 0), size, "light")
        tree.driven.append(f"p{k}")
        if k == 1:
            ball(tree, "rod1", (0, 0, 0), about(axis, value).T @ R, turn)
        else:
            tree.frame(f"e{k}", f"rod{k}", (0, 0, 0))
            tree.close(f"e{k}", f"b{k}")
    platform_frames(tree, "platform", platform, ("vz", "wx", "wy"), size)
    return tree


def _rpr(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Three planar legs: turning joint, driven slide, turning joint."""
    base, platform = points(keys["base"]), points(keys["platform"])
    at, R = pose(keys)
    slide = limits(keys, "length")
    size = float(np.abs(base).max()) * 0.012
    outline(tree.links["base_link"], base, size, "dark")
    for k, (a, b) in enumerate(zip(base, platform, strict=True), 1):
        reach = at + R @ b - a
        length, value = float(np.linalg.norm(reach)), math.atan2(reach[1], reach[0])
        low = tree.add(f"r{k}", "continuous", "base_link", f"cylinder{k}", a, Z, None, value)
        low.bar((0, 0, 0), (0.5 * length, 0, 0), 1.4 * size, "blue")
        rod = tree.add(
            f"p{k}", "prismatic", f"cylinder{k}", f"rod{k}", (0, 0, 0), (1, 0, 0), slide, length
        )
        rod.bar((-0.8 * length, 0, 0), (0, 0, 0), size, "light")
        tree.driven.append(f"p{k}")
        if k == 1:
            turned = math.atan2(R[1, 0], R[0, 0]) - value
            tree.add("c1", "continuous", "rod1", "platform", (0, 0, 0), Z, None, turned)
        else:
            tree.frame(f"e{k}", f"rod{k}", (0, 0, 0))
            tree.close(f"e{k}", f"b{k}")
    platform_frames(tree, "platform", platform, ("vx", "vy", "wz"), size)
    return tree


def _delta(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Three cranks, each with two parallel rods (universal joint, ball) to the platform."""
    base, crank, rod = (keys[k].number() for k in ("base_radius", "crank", "rod"))
    platform, apart = keys["platform_radius"].number(), keys["rods_apart"].number()
    height = keys["home_height"].number()
    turn = limits(keys, "turn")
    kind = "continuous" if turn is None else "revolute"
    ends: list[Vector] = []
    size = 0.03 * crank
    corners = []
    for k, angle in enumerate(np.radians([0.0, 120.0, 240.0]), 1):
        radial = np.array([math.cos(angle), math.sin(angle), 0.0])
        across = np.cross(Z, radial)
        pivot = base * radial
        corners.append(pivot)
        # The rod reaches the platform, level and centred: crank angle from the cosine rule.
        out, down = platform - base, height
        far = math.hypot(out, down)
        bend = math.acos((crank**2 + far**2 - rod**2) / (2 * crank * far))
        value = math.atan2(-down, out) + bend
        # Positive turns of the crank raise it: about the axis radial x z.
        axis = np.cross(radial, Z)
        arm = tree.add(f"a{k}", kind, "base_link", f"crank{k}", pivot, axis, turn, value)
        arm.bar((0, 0, 0), crank * radial, 1.5 * size, "blue")
        arm.bar(crank * radial - apart / 2 * across, crank * radial + apart / 2 * across,
                size, "blue")  # fmt: skip
        tree.driven.append(f"a{k}")
        direction = (platform * radial + np.array([0, 0, -height])) - (
            pivot + crank * (math.cos(value) * radial + math.sin(value) * np.array(Z))
        )
        direction /= np.linalg.norm(direction)
        swing = math.atan2(float(direction[2]), float(direction @ radial)) - value
        for side, sign in (("l", 1), ("r", -1)):
            name = f"{k}{side}"
            at = crank * radial + sign * apart / 2 * across
            tree.add(f"u{name}", kind, f"crank{k}", f"cross{name}", at, axis, turn, swing)
            bar = tree.add(
                f"v{name}", kind, f"cross{name}", f"rod{name}", (0, 0, 0),
                np.cross(radial, axis), turn,
            )  # fmt: skip
            bar.bar((0, 0, 0), rod * radial, 0.7 * size, "light")
            ends.append(platform * radial + sign * apart / 2 * across)
            if len(ends) == 1:
                R = about(axis, value + swing)
                ball(tree, f"rod{name}", rod * radial, R.T, None)
            else:
                tree.frame(f"e{len(ends)}", f"rod{name}", rod * radial)
                tree.close(f"e{len(ends)}", f"b{len(ends)}")
    outline(tree.links["base_link"], corners, 1.5 * size, "dark")
    platform_frames(tree, "platform", ends, ("vx", "vy", "vz"), size)
    return tree


def _spherical(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Three legs of three turning joints whose axes all meet in the origin."""
    base = [v / np.linalg.norm(v) for v in points(keys["base_axes"])]
    platform = [v / np.linalg.norm(v) for v in points(keys["platform_axes"])]
    middle = [v / np.linalg.norm(v) for v in points(keys["middle_axes"])]
    radius = keys["radius"].number()
    size = 0.03 * radius
    first = tree.links["base_link"]
    for k, (u, v, w) in enumerate(zip(base, middle, platform, strict=True), 1):
        first.bar(1.15 * radius * u, 1.3 * radius * u, 1.6 * size, "dark")
        arm = tree.add(f"a{k}", "continuous", "base_link", f"arm{k}", (0, 0, 0), u)
        _arc(arm, 1.15 * radius, u, v, size, "blue")
        bar = tree.add(f"v{k}", "continuous", f"arm{k}", f"bar{k}", (0, 0, 0), v)
        _arc(bar, radius, v, w, size, "light")
        tree.driven.append(f"a{k}")
        if k == 1:
            end = tree.add("w1", "continuous", "bar1", "platform", (0, 0, 0), w)
            for x in platform:
                end.bar((0, 0, 0), radius * x, size, "tool")
        else:
            tree.frame(f"e{k}", f"bar{k}", radius * w)
            tree.close(f"e{k}", f"b{k}")
    for k, w in enumerate(platform[1:], 2):
        tree.frame(f"b{k}", "platform", radius * w)
    tree.frame("platform_center", "platform", (0, 0, 0))
    tree.output, tree.rows = "platform_center", ("wx", "wy", "wz")
    return tree


def _arc(link, radius: float, start: Vector, end: Vector, size: float, color: str) -> None:
    across = np.cross(np.cross(start, end), start)
    across /= np.linalg.norm(across)
    angle = math.atan2(float(end @ across), float(end @ start))
    turns = np.linspace(0, angle, 7)
    points = [radius * (math.cos(t) * start + math.sin(t) * across) for t in turns]
    for a, b in itertools.pairwise(points):
        link.bar(a, b, size, color)


def _rssr(tree: Tree, keys: dict[str, YamlNode]) -> Tree:
    """Crank, coupler between two balls, rocker; the coupler's idle spin is left out."""
    crank, coupler, rocker = (keys[k].number() for k in ("crank", "coupler", "rocker"))
    far = np.array(numbers(keys["rocker_pivot"], 3))
    axis = np.array(numbers(keys["rocker_axis"], 3))
    arm = np.array(numbers(keys["rocker_arm"], 3))
    arm = rocker * arm / np.linalg.norm(arm)
    guess = numbers(keys["home"], 4)
    size = 0.03 * crank
    tree.add("crank", "continuous", "base_link", "crank_link", (0, 0, 0), Z, None, guess[0]).bar(
        (0, 0, 0), (crank, 0, 0), 1.5 * size, "blue"
    )
    tree.add("ball_x", "continuous", "crank_link", "ball", (crank, 0, 0), (1, 0, 0), None, guess[1])
    tree.add("ball_y", "continuous", "ball", "coupler", (0, 0, 0), (0, 1, 0), None, guess[2]).bar(
        (0, 0, 0), (0, 0, coupler), size, "light"
    )
    tree.frame("coupler_end", "coupler", (0, 0, coupler))
    tree.add("rocker", "continuous", "base_link", "rocker_link", far, axis, None, guess[3]).bar(
        (0, 0, 0), arm, 1.5 * size, "tool"
    )
    tree.frame("rocker_end", "rocker_link", arm)
    tree.links["base_link"].bar((0, 0, 0), far, size, "dark")
    tree.close("coupler_end", "rocker_end")
    names = ("wx", "wy", "wz")
    tree.driven, tree.output = ["crank"], "rocker_link"
    tree.rows = (names[int(np.argmax(np.abs(axis)))],)
    return tree


Build = Callable[[Tree, dict[str, YamlNode]], Tree]
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...], Build]] = {
    "6-UPS": (("base", "platform", "home"), ("length", "turn"), _ups),
    "6-PUS": (
        ("base", "rail", "platform", "rod", "leans", "home"),
        ("slide", "turn"),
        rods_on_carriages,
    ),
    "6-RUS": (
        ("base", "crank", "crank_headings", "platform", "rod", "home"),
        ("turn",),
        rods_on_cranks,
    ),
    "3-RPS": (("base", "platform", "home"), ("length", "turn"), _rps),
    "3-RPR": (("base", "platform", "home"), ("length",), _rpr),
    "Delta": (
        ("base_radius", "crank", "rod", "platform_radius", "rods_apart", "home_height"),
        ("turn",),
        _delta,
    ),
    "spherical 3-RRR": (("base_axes", "middle_axes", "platform_axes", "radius"), (), _spherical),
    "RSSR": (
        ("crank", "coupler", "rocker", "rocker_pivot", "rocker_axis", "rocker_arm", "home"),
        (),
        _rssr,
    ),
}
