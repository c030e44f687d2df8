"""Denavit-Hartenberg tables, standard and modified, and the URDF made of them.

A table is a YAML file (``urdf/*.dh.yaml``), of which a URDF with simple shapes is made. Row i of a
table is, with Rz, Tz, Tx, Rx the rotation and translation about and along an axis,

- standard (Denavit and Hartenberg 1955; Paul 1981):
  ``A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)``;
- modified (Craig 1986), where a_i and alpha_i are those that Craig writes a_{i-1}, alpha_{i-1}:
  ``A_i = Rx(alpha_i) Tx(a_i) Rz(theta_i) Tz(d_i)``.

The joint's value adds to theta (revolute, continuous) or to d (prismatic). The product of all A_i
is the frame n; ``tool0`` is that frame, or the tool fixed to it (and then ``flange`` is frame n).
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal, cast

from pinsing.description.catalog import known_arms, urdf_folder
from pinsing.description.urdf import DEFAULT_EFFORT, DEFAULT_VELOCITY
from pinsing.description.xml_tree import Node, to_text
from pinsing.description.yaml_tree import Number, YamlNode, compose

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """A fixed transform: a translation, then the rotation ``Rz(yaw) Ry(pitch) Rx(roll)``."""

    xyz: Vector = (0.0, 0.0, 0.0)  # translation [m]
    rpy: Vector = (0.0, 0.0, 0.0)  # roll, pitch and yaw [rad], as in the ``<origin>`` of a URDF


def cos_sin(angle: float) -> tuple[float, float]:
    """Return cosine and sine, exactly 0 or ±1 where the angle [rad] is a double of k·pi/2."""
    quarters = round(angle / (math.pi / 2))
    if angle == quarters * (math.pi / 2):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
    return math.cos(angle), math.sin(angle)


def screw(
    theta: float = 0.0, d: float = 0.0, a: float = 0.0, alpha: float = 0.0, beyond: float = 0.0
) -> Placement:
    """Return ``Rz(theta) Tz(d) Tx(a) Rx(alpha) Tz(beyond)``; angles [rad], lengths [m].

    A row of a standard Denavit-Hartenberg table, for ``beyond`` = 0. Its rotation is roll = alpha,
    yaw = theta without rounding, which no row of a modified table (``Rx Tx Rz Tz``) offers.
    """
    c, s = cos_sin(theta)
    ca, sa = cos_sin(alpha)
    # "+ 0.0" turns -0.0 into 0.0.
    xyz = (a * c + beyond * sa * s + 0.0, a * s - beyond * sa * c + 0.0, d + beyond * ca + 0.0)
    return Placement(xyz, (alpha, 0.0, theta))


def modified_row(alpha: float, a: float, d: float, theta: float) -> Placement:
    """Return ``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` (Craig 1986, Eq. 3.6)."""
    c, s = cos_sin(theta)
    ca, sa = cos_sin(alpha)
    rpy = roll_pitch_yaw(((c, -s, 0.0), (ca * s, ca * c, -sa), (sa * s, sa * c, ca)))
    return Placement((a + 0.0, -d * sa + 0.0, d * ca + 0.0), rpy)


def roll_pitch_yaw(R: tuple[Vector, Vector, Vector]) -> Vector:
    """Return the roll, pitch and yaw [rad] of a rotation matrix, given by rows."""
    # To rounding, gimbal lock (pitch = ±pi/2) included: yaw is taken of the matrix with the roll
    # undone, so that an ill-determined roll cancels against it.
    pitch = math.atan2(-R[2][0], math.hypot(R[0][0], R[1][0]))
    roll = math.atan2(R[2][1], R[2][2])
    c, s = cos_sin(roll)
    yaw = math.atan2(s * R[0][2] - c * R[0][1], c * R[1][1] - s * R[1][2])
    return roll + 0.0, pitch + 0.0, yaw + 0.0


def pointing(direction: Vector) -> Vector:
    """Return the roll, pitch and yaw [rad] that turn the z axis into a direction."""
    x, y, z = direction
    return 0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)


Convention = Literal["standard", "modified"]
JointType = Literal["revolute", "prismatic", "continuous"]

BASE = "base_link"
FLANGE = "flange"
TIP = "tool0"

_DH_KEYS = ("alpha", "a", "d", "theta")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")


@dataclass(frozen=True)
class DHRow:
    """One row: one joint."""

    # alpha and theta: twist, and the fixed part of the joint angle [rad]
    alpha: float
    # a and d: length, and the fixed part of the offset [m]
    a: float
    d: float
    theta: float
    type: JointType  # what moves: theta, d, or theta without end
    name: str  # name of the joint
    # lower and upper: limits of the joint's value [rad or m]; None for a continuous joint
    lower: float | None = None
    upper: float | None = None
    # velocity and effort: greatest speed [rad/s or m/s] and torque or force [N·m or N]; None where
    # not given
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class DHTable:
    """An arm as a Denavit-Hartenberg table."""

    name: str  # name of the robot
    convention: Convention  # what a row means (see the module)
    rows: tuple[DHRow, ...]  # one per joint, base to tip
    tool: Placement | None = None  # ``tool0`` in the frame n; None if it is that frame
    source: str = ""  # where the numbers come from
    base: Placement = Placement()  # frame 0 in ``base_link``, of a standard table


_Units = dict[str, tuple[Fraction, int | None]]
"""Of an angle and a length: its size in SI units, and the power of pi in it."""


def read_dh(path: str | Path) -> DHTable:
    """Read a DH table of YAML, in its units, into radians and metres; angles may hold pi.

    Keys: ``name``, ``convention``, ``units`` (``angle``: rad or deg, ``length``: m or mm),
    ``rows``, and optionally ``source`` and ``tool`` (``xyz`` and ``rpy``, or ``alpha``, ``a``,
    ``d``, ``theta``). Each row has ``alpha``, ``a``, ``d``, ``theta``, ``type``, ``limits``
    (``[lower, upper]``; not for a continuous joint), and optionally ``name`` (q or d with the row's
    number), ``velocity``, ``effort``. RobotFileError, with line and key, if anything is missing,
    unknown, doubled, or not finite.
    """
    keys = "name", "convention", "units", "rows"
    table = compose(path)
    top = table.mapping((), (*keys, "source", "tool"))
    table.require(
        top, keys, convention="standard or modified", units="{angle: deg or rad, length: mm or m}"
    )
    units = _read_units(top["units"])
    convention = cast(Convention, top["convention"].choice(("standard", "modified")))
    rows: list[DHRow] = []
    row_nodes = top["rows"].items("row")
    taken = {TIP, FLANGE, BASE} | {f"link{i}" for i in range(1, len(row_nodes) + 1)}
    for number, node in enumerate(row_nodes, start=1):
        row = _read_row(YamlNode(node.node, node.path, f"row {number}"), number, units)
        node.refuse_if(
            row.name in taken, f"the name {row.name!r} is taken: give each joint a different name"
        )
        taken.add(row.name)
        rows.append(row)
    return DHTable(
        name=_read_name(top["name"]),
        convention=convention,
        rows=tuple(rows),
        tool=_read_tool(top["tool"], units, convention) if "tool" in top else None,
        source=" ".join(top["source"].text().split()) if "source" in top else "",
    )


def known_table(name: str) -> DHTable:
    """Return the table of an arm of ``urdf/arms.yaml`` that has rows."""

    def metres(value: float) -> float:
        return float(Fraction(str(value)) / 1000)

    def radians(value: float) -> float:
        return Number(Fraction(str(value)), True).times(Fraction(1, 180))

    entry, rows = known_arms()[name], []
    for number, row in enumerate(entry["rows"], start=1):
        alpha, a, d, theta, *rest = row
        kind: JointType = "continuous" if rest[:2] in ([], [None, None]) else "revolute"
        unit, joint = radians, f"q{number}"
        if "prismatic" in rest:
            kind, unit, joint = "prismatic", metres, f"d{number}"
        joint = entry["names"][number - 1] if "names" in entry else joint
        limits = [None if value is None else unit(value) for value in rest[:3]]
        frame = radians(alpha), metres(a), metres(d), radians(theta)
        rows.append(DHRow(*frame, kind, joint, *limits))
    # Where axis 1 points down, z of the base points up all the same.
    base = Placement(rpy=(math.pi, 0.0, 0.0)) if entry.get("down") else Placement()
    return DHTable(name, "standard", tuple(rows), source=entry["source"], base=base)


def _read_units(node: YamlNode) -> _Units:
    keys = node.mapping(("angle", "length"))
    radians = keys["angle"].choice(("rad", "deg")) == "rad"
    metres = keys["length"].choice(("m", "mm")) == "m"
    return {
        "angle": (Fraction(1), 0) if radians else (Fraction(1, 180), 1),
        "length": (Fraction(1) if metres else Fraction(1, 1000), None),
    }


def _read_name(node: YamlNode) -> str:
    name = node.text()
    node.refuse_if(
        not _NAME.fullmatch(name),
        f"{name[:60]!r} is no name: use letters, digits, '_', '-' and '.'",
    )
    return name


def _read_dh(keys: dict[str, YamlNode], units: _Units) -> tuple[float, float, float, float]:
    """Return alpha [rad], a [m], d [m], theta [rad]."""
    alpha, theta = (keys[key].number(*units["angle"]) for key in ("alpha", "theta"))
    a, d = (keys[key].number(*units["length"]) for key in ("a", "d"))
    return alpha, a, d, theta


def _read_row(node: YamlNode, number: int, units: _Units) -> DHRow:
    keys = node.mapping((), (*_DH_KEYS, "type", "limits", "name", "velocity", "effort"))
    kinds = "revolute", "prismatic", "continuous"
    kind = cast(JointType, keys["type"].choice(kinds) if "type" in keys else " or ".join(kinds[:2]))
    node.require(
        keys, (*_DH_KEYS, "type", *["limits"] * (kind != "continuous")), type=" or ".join(kinds),
        limits=f"[lower, upper] (a {kind} joint needs them)",
    )  # fmt: skip
    unit = units["length" if kind == "prismatic" else "angle"]
    lower = upper = None
    if kind != "continuous":
        lower, upper = (end.number(*unit) for end in keys["limits"].items("value", length=2))
        keys["limits"].refuse_if(lower > upper, "the lower limit is above the upper one: swap them")
    elif "limits" in keys:
        raise keys["limits"].error(
            "a continuous joint has none: remove them, or make the joint revolute"
        )
    velocity = keys["velocity"].number(*unit) if "velocity" in keys else None
    effort = keys["effort"].number() if "effort" in keys else None
    for key, value in (("velocity", velocity), ("effort", effort)):
        if value is not None and value < 0:
            raise keys[key].error("is negative: give its size")
    alpha, a, d, theta = _read_dh(keys, units)
    default = f"{'d' if kind == 'prismatic' else 'q'}{number}"
    name = _read_name(keys["name"]) if "name" in keys else default
    return DHRow(alpha, a, d, theta, kind, name, lower, upper, velocity, effort)


def _read_tool(node: YamlNode, units: _Units, convention: Convention) -> Placement:
    if not {"xyz", "rpy"} & set(node.keys()):
        alpha, a, d, theta = _read_dh(node.mapping(_DH_KEYS), units)
        if convention == "standard":
            return screw(theta, d, a, alpha)
        return modified_row(alpha, a, d, theta)
    keys = node.mapping((), ("xyz", "rpy"))
    vectors = {
        key: tuple(item.number(*units[quantity]) for item in keys[key].items("value", length=3))
        for key, quantity in (("xyz", "length"), ("rpy", "angle"))
        if key in keys
    }
    return Placement(**cast(dict[str, Vector], vectors))


__all__ = [
    "DHRow",
    "DHTable",
    "bare_urdf",
    "dh_to_urdf",
    "read_dh",
    "urdf_folder",
    "with_turns",
]


def dh_to_urdf(table: DHTable) -> str:
    """Return the URDF of a table, with simple shapes.

    Links are ``base_link``, ``link1``, ... and ``tool0`` (after ``flange``, frame n, where the
    table has a tool); joints have the names of the rows. Without a ``velocity`` or an ``effort`` in
    the table a joint gets 1 rad/s or m/s and 100 N·m or N, since a URDF must have them.
    """
    words = f" Made by pinsing from the {table.convention} DH table of {table.name}; do not edit. "
    words += f"{table.source} " if table.source else ""
    while "--" in words:  # which no XML comment may hold
        words = words.replace("--", "- -")
    _, _, robot = to_text(_robot(table, (), False)).partition("\n")
    return f'<?xml version="1.0" ?>\n<!--{words}-->\n{robot}'


def bare_urdf(table: DHTable, turning: Collection[int] = ()) -> str:
    """Return the URDF of a table without shapes, for chains that nobody looks at."""
    # Twists of rows ``turning`` are joints, as in `with_turns`.
    return to_text(_robot(table, turning, True))


def with_turns(table: DHTable, turning: Collection[int] = ()) -> list[tuple[str, str, Placement]]:
    """Return joints base to tip with the axis of each, x, z or none, and where it sits.

    Twists of the rows ``turning``, counted from 1, are joints of their own, about x; their names
    begin with a digit, which those of rows never do. What ends the chain has no axis: frame n, and
    the tool.

    Each joint turns about, or slides along, the z axis of its placement. In a standard table that
    is z of the frame before, so joint i takes the fixed part of row i - 1. In a modified table it
    is z of frame i itself; only the fixed theta, which commutes with the joint, is handed on to the
    next placement, so that every rotation is ``Rz(theta) Rx(alpha)``: roll and yaw of a URDF, digit
    for digit.
    """
    rows, standard = table.rows, table.convention == "standard"
    thetas = (0.0, *(row.theta for row in rows))
    if standard:
        places = [table.base, *(screw(row.theta, row.d, row.a, row.alpha) for row in rows)]
    else:
        places = [
            screw(theta, 0.0, row.a, row.alpha, beyond=row.d)
            for theta, row in zip(thetas, rows, strict=False)
        ]
        places.append(screw(thetas[-1]))
    *joints, last = places
    ends = [(row.name, "z", place) for row, place in zip(rows, joints, strict=True)]
    ends += [("", "", place) for place in (last, table.tool) if place is not None]
    for i in sorted(turning, reverse=True):
        row, k = table.rows[i - 1], i if standard else i - 1
        theta = row.theta if standard else thetas[i - 1]
        beyond = 0.0 if standard else row.d
        before = screw(theta, row.d if standard else 0.0, row.a)
        ends[k : k + 1] = [
            (f"{i}_twist", "x", before),
            (*ends[k][:2], Placement((0.0, 0.0, beyond))),
        ]
    return ends


_COLOURS = {
    "light": "0.87 0.89 0.91 1",
    "blue": "0.27 0.48 0.71 1",
    "axis": "0.96 0.62 0.17 1",
    "metal": "0.55 0.58 0.62 1",
    "dark": "0.22 0.24 0.28 1",
    "tool": "0.80 0.20 0.24 1",
}


def _node(tag: str, *children: Node, **attributes: object) -> Node:
    return Node(tag, {k: str(v) for k, v in sorted(attributes.items())}, 0, list(children))


def _robot(table: DHTable, turning: Collection[int], bare: bool) -> Node:
    """The robot, base to tip; placements are written in full (repr)."""
    ends = with_turns(table, turning)
    looks = [[] for _ in range(len(ends) + 1)] if bare else _looks(table, [e[2] for e in ends])
    rows, fixed = iter(table.rows), iter((TIP,) if table.tool is None else (FLANGE, TIP))
    robot = _node("robot", name=table.name)
    if not bare:
        colours = ((name, _node("color", rgba=rgba)) for name, rgba in _COLOURS.items())
        robot.children += [_node("material", color, name=name) for name, color in colours]
    parent, count = BASE, 0
    robot.children.append(_node("link", *looks[0], name=parent))
    for shapes, (name, axis, place) in zip(looks[1:], ends, strict=True):
        if axis == "z":
            row, count = next(rows), count + 1
            child, kind, limits = f"link{count}", str(row.type), _limits(row)
        elif axis == "x":
            child, kind = f"{name}_link", "revolute"
            limits = {"lower": "-4", "upper": "4", "velocity": "1", "effort": "1"}
        else:
            child, kind, limits = next(fixed), "fixed", {}
        ends_of = _node("parent", link=parent), _node("child", link=child)
        joint = _node("joint", _origin(place), *ends_of, name=name or f"{child}_fixed", type=kind)
        if axis:
            along = "0 0 1" if axis == "z" else "1 0 0"
            joint.children += [_node("axis", xyz=along), _node("limit", **limits)]
        robot.children += [joint, _node("link", *shapes, name=child)]
        parent = child
    return robot


def _origin(placement: Placement) -> Node:
    xyz, rpy = (" ".join(map(repr, map(float, v))) for v in (placement.xyz, placement.rpy))
    return _node("origin", xyz=xyz, rpy=rpy)


def _limits(row: DHRow) -> dict[str, object]:
    limits: dict[str, object] = {
        "velocity": repr(DEFAULT_VELOCITY if row.velocity is None else row.velocity),
        "effort": repr(DEFAULT_EFFORT if row.effort is None else row.effort),
    }
    if row.lower is not None and row.upper is not None:
        limits.update(lower=repr(row.lower), upper=repr(row.upper))
    return limits


def _travel(row: DHRow) -> tuple[float, float]:
    """Return the ends of the sliding of a joint, 0 included [m]."""
    if row.type != "prismatic" or row.lower is None or row.upper is None:
        return 0.0, 0.0
    return min(row.lower, 0.0), max(row.upper, 0.0)


def _looks(table: DHTable, ends: list[Placement]) -> list[list[Node]]:
    """Return the shapes of each link, rounded to a nanometre so that no libm shows in the file."""
    rows, last = table.rows, len(ends)
    size = sum(math.hypot(*end.xyz) for end in ends)
    size += sum(max(map(abs, _travel(row))) for row in rows)
    size = round(size, 9) or 0.1
    out: list[list[Node]] = [[] for _ in range(last + 1)]
    out[0].append(_round("dark", 0.09 * size, 0.02 * size, f"0 0 {round(-0.01 * size, 9)}"))
    # Links taper from 3.5 % of the arm's size at the base to 1.8 % at the tip.
    radii = [size * (0.035 - 0.017 * i / (len(rows) + 1)) for i in range(last + 1)]
    for i, end in enumerate(ends):
        knee = _knee(table, i, end) if i <= len(rows) else end.xyz
        out[i] += _bones("blue" if i % 2 else "light", radii[i], knee, end.xyz)
    for i, row in enumerate(rows, 1):
        radius, travel = radii[i], _travel(row)
        if row.type != "prismatic":  # a hub, about the link's own axis
            hub = _round("dark", 1.35 * radius, 2.6 * radius)
            out[i] += [hub, _round("axis", 0.4 * radius, 5.2 * radius)]
            continue
        sleeve = _bar("dark", 2.2 * radii[i - 1], 3.2 * radii[i - 1], _origin(ends[i - 1]))
        out[i - 1].append(sleeve)
        if travel != (0.0, 0.0):  # a rod long enough to stay in its sleeve at every value
            middle = round(-sum(travel) / 2, 9) + 0.0
            at = _node("origin", xyz=f"0.0 0.0 {middle!r}", rpy="0 0 0")
            out[i].append(_bar("metal", radius, travel[1] - travel[0], at))
    out[last].append(_round("tool", 1.45 * radii[last]))
    tip = f"0 0 {round(0.02 * size, 9)}"
    out[last].append(_round("tool", 0.4 * radii[last], 0.04 * size, tip))
    return out


def _visual(colour: str, at: Node, shape: Node) -> Node:
    return _node("visual", at, _node("geometry", shape), _node("material", name=colour))


def _round(
    colour: str, radius: float, length: float = 0.0, xyz: str = "0 0 0", rpy: str = "0 0 0"
) -> Node:
    """A cylinder, or a ball."""
    sizes = {"radius": round(radius, 6)} | ({"length": round(length, 9)} if length else {})
    shape = _node("cylinder" if length else "sphere", **sizes)
    return _visual(colour, _node("origin", xyz=xyz, rpy=rpy), shape)


def _bar(colour: str, width: float, length: float, at: Node) -> Node:
    size = f"{round(width, 6)} {round(width, 6)} {round(length, 9)}"
    return _visual(colour, at, _node("box", size=size))


def _knee(table: DHTable, i: int, end: Placement) -> Vector:
    """Return the point of link i between its two straight parts, along d and along a."""
    if table.convention == "standard":
        return 0.0, 0.0, end.xyz[2]
    c, s = cos_sin(end.rpy[2])
    a = table.rows[i].a if i < len(table.rows) else 0.0
    return a * c, a * s, 0.0


def _bones(colour: str, radius: float, knee: Vector, end: Vector) -> list[Node]:
    """Return the cylinders of a link, from its own joint to the next, and a ball between two."""

    def text(values: Iterable[float]) -> str:
        return " ".join(repr(round(x, 9) + 0.0) for x in values)

    bones: list[Node] = []
    start = (0.0, 0.0, 0.0)
    for stop in (knee, end):
        x, y, z = (q - p for p, q in zip(start, stop, strict=True))
        if (length := round(math.hypot(x, y, z), 9)) > 0:
            if bones:
                bones.append(_round(colour, radius, xyz=text(start)))
            middle = text((p + q) / 2 for p, q in zip(start, stop, strict=True))
            bones.append(_round(colour, radius, length, middle, text(pointing((x, y, z)))))
        start = stop
    return bones
