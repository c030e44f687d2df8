"""A spanning tree of a mechanism as links and joints, and its texts: a URDF and a loop file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

_COLORS = {
    "blue": "0.27 0.48 0.71 1",
    "light": "0.55 0.62 0.68 1",
    "dark": "0.22 0.24 0.28 1",
    "tool": "0.80 0.20 0.24 1",
}


@dataclass
class Link:
    """A link: bars from point to point, metres, in the frame of the joint that carries it."""

    bars: list[tuple[np.ndarray, np.ndarray, float, str]] = field(default_factory=list)

    def bar(self, start: Sequence[float], end: Sequence[float], radius: float, color: str) -> None:
        """Draw a bar, if it has a length."""
        a, b = np.array(start, dtype=float), np.array(end, dtype=float)
        if np.linalg.norm(b - a) > 1e-9:
            self.bars.append((a, b, radius, color))


@dataclass(frozen=True)
class Joint:
    """A joint: its kind, place, axis and limits (None for continuous)."""

    name: str
    kind: str
    parent: str
    child: str
    at: tuple[float, ...]
    axis: tuple[float, ...]
    limits: tuple[float, float] | None
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)


class Tree:
    """The links and joints of one mechanism, its loops and where it is at home."""

    def __init__(self, name: str, words: str) -> None:
        self.name, self.words = name, words
        self.links: dict[str, Link] = {"base_link": Link()}
        self.joints: list[Joint] = []
        self.home: dict[str, float] = {}
        self.closed: list[tuple[str, str, str]] = []
        self.driven: list[str] = []
        self.output = ""
        self.rows: tuple[str, ...] = ()

    def add(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        at: Sequence[float],
        axis: Sequence[float],
        limits: tuple[float, float] | None = None,
        home: float = 0.0,
    ) -> Link:
        """A joint and the link that it carries; returns the link."""
        at_, axis_ = tuple(map(float, at)), tuple(map(float, axis))
        self.joints.append(Joint(name, kind, parent, child, at_, axis_, limits))
        self.links[child] = Link()
        if kind != "fixed" and abs(home) > 1e-15:
            self.home[name] = home
        return self.links[child]

    def frame(self, name: str, parent: str, at: Sequence[float]) -> None:
        """A frame fixed to a link."""
        self.add(f"{name}_mount", "fixed", parent, name, at, (1, 0, 0))

    def close(self, a: str, b: str, kind: str = "3d") -> None:
        """Hold two frames together."""
        self.closed.append((a, b, kind))

    def urdf(self) -> str:
        """The spanning tree as a URDF."""
        lines = ['<?xml version="1.0"?>', "<!--"]
        lines += [f"  {line}" for line in _wrapped(self.words)]
        lines += [
            f"  Made from {self.name}.mechanism.yaml by scripts/urdf: change that and run this.",
            f"  This is its spanning tree; {self.name}.loops.yaml closes it.",
            "-->",
            f'<robot name="{self.name}">',
        ]
        used = {c for link in self.links.values() for *_, c in link.bars}
        lines += [
            f'  <material name="{c}"><color rgba="{_COLORS[c]}"/></material>' for c in sorted(used)
        ]
        for name, link in self.links.items():
            lines += _link(name, link)
        for joint in self.joints:
            lines += _joint(joint)
        return "\n".join([*lines, "</robot>", ""])

    def loops(self, source: str) -> str:
        """The loop file."""
        home = ", ".join(f"{k}: {_number(v)}" for k, v in self.home.items())
        lines = [
            f"# Loops of {self.name}.urdf, made from {self.name}.mechanism.yaml by scripts/urdf.",
            "source: >-",
            *(f"  {line}" for line in _wrapped(source)),
            "closed_loop:",
            *(f"  - [{a}, {b}]" for a, b, _ in self.closed),
            f"type: [{', '.join(k for *_, k in self.closed)}]",
            f"name_mot: [{', '.join(self.driven)}]",
            f"output: {{frame: {self.output}, rows: [{', '.join(self.rows)}]}}",
            *([f"home: {{{home}}}"] if home else []),
        ]
        return "\n".join([*lines, ""])


def _wrapped(text: str) -> list[str]:
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > 94:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
    return [*lines, line]


def _number(value: float) -> str:
    """All digits of a double; what is zero but for rounding is zero."""
    return repr(0.0 if abs(value) < 1e-15 else float(value))


def _triple(values: Sequence[float]) -> str:
    return " ".join(_number(v) for v in values)


def _link(name: str, link: Link) -> list[str]:
    if not link.bars:
        return [f'  <link name="{name}"/>']
    out = [f'  <link name="{name}">']
    for start, end, radius, color in link.bars:
        along = end - start
        length = float(np.linalg.norm(along))
        x, y, z = along / length
        # A cylinder lies along z: turn it by pitch, then yaw.
        pitch, yaw = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
        middle = " ".join(f"{v + 0.0:.6g}" for v in ((start + end) / 2).round(9))
        out += [
            "    <visual>",
            f'      <origin xyz="{middle}" rpy="0 {pitch:.6g} {yaw:.6g}"/>',
            f'      <geometry><cylinder radius="{radius:.4g}" length="{length:.6g}"/></geometry>',
            f'      <material name="{color}"/>',
            "    </visual>",
        ]
    return [*out, "  </link>"]


def _joint(joint: Joint) -> list[str]:
    out = [
        f'  <joint name="{joint.name}" type="{joint.kind}">',
        f'    <origin xyz="{_triple(joint.at)}"/>',
        f'    <parent link="{joint.parent}"/>',
        f'    <child link="{joint.child}"/>',
    ]
    if joint.kind != "fixed":
        out.append(f'    <axis xyz="{_triple(joint.axis)}"/>')
        ends = ""
        if joint.limits is not None:
            ends = f'lower="{_number(joint.limits[0])}" upper="{_number(joint.limits[1])}" '
        out.append(f'    <limit {ends}effort="100" velocity="10"/>')
    return [*out, "  </joint>"]
