"""Denavit-Hartenberg tables as data, their YAML files, and fixed transforms."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal, cast

from pinsing.description.catalog import known_arms
from pinsing.description.yaml_tree import Number, YamlNode, compose

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """A fixed transform: a translation, then the rotation ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Attributes
    ----------
    xyz : tuple of 3 floats
        Translation [m].
    rpy : tuple of 3 floats
        Roll, pitch and yaw [rad], as in the ``<origin>`` of a URDF.
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


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

    With ``beyond`` = 0 this is a row of a standard Denavit-Hartenberg table. Its rotation is
    roll = alpha, yaw = theta, as given and without rounding, which no row of a modified table
    (``Rx Tx Rz Tz``) offers.
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
    """Return the roll, pitch and yaw [rad] of a rotation matrix, given by rows.

    Accurate to rounding everywhere, gimbal lock (pitch = ±pi/2) included: yaw is taken of the
    matrix with the roll undone, so that an ill-determined roll cancels against it.
    """
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
    """One row: one joint.

    Attributes
    ----------
    alpha, theta : float
        Twist, and the fixed part of the joint angle [rad].
    a, d : float
        Length, and the fixed part of the offset [m].
    type : {"revolute", "prismatic", "continuous"}
        What moves: theta, d, or theta without end.
    name : str
        Name of the joint.
    lower, upper : float or None
        Limits of the joint's value [rad or m]; None for a continuous joint.
    velocity, effort : float or None
        Greatest speed [rad/s or m/s] and torque or force [N·m or N]; None where not given.
    """

    alpha: float
    a: float
    d: float
    theta: float
    type: JointType
    name: str
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class DHTable:
    """An arm as a Denavit-Hartenberg table.

    Attributes
    ----------
    name : str
        Name of the robot.
    convention : {"standard", "modified"}
        What a row means (see the module).
    rows : tuple of DHRow
        One per joint, base to tip.
    tool : Placement or None
        ``tool0`` in the frame n; None if it is that frame.
    source : str
        Where the numbers come from.
    """

    name: str
    convention: Convention
    rows: tuple[DHRow, ...]
    tool: Placement | None = None
    source: str = ""


@dataclass(frozen=True)
class _Units:
    """Factors of a table's units; ``pi`` is the power of pi in the unit of an angle."""

    angle: Fraction
    pi: int
    length: Fraction

    def value(self, node: YamlNode, quantity: str) -> float:
        if quantity == "angle":
            return node.number(self.angle, self.pi)
        return node.number(self.length)


def read_dh(path: str | Path) -> DHTable:
    """Read a DH table.

    Angles and lengths are taken in the units that the table states. An angle in radians may be
    written with pi: ``pi/2``, ``-pi/2``, ``2*pi/3``.

    Parameters
    ----------
    path : str or Path
        YAML file with the keys ``name``, ``convention``, ``units`` (``angle``: rad or deg,
        ``length``: m or mm), ``rows``, and optionally ``source`` and ``tool`` (``xyz`` and
        ``rpy``, or ``alpha``, ``a``, ``d``, ``theta``). Each row has ``alpha``, ``a``, ``d``,
        ``theta``, ``type``, ``limits`` (``[lower, upper]``; not for a continuous joint), and
        optionally ``name`` (q or d with the row's number), ``velocity``, ``effort``.

    Returns
    -------
    DHTable
        In radians and metres.

    Raises
    ------
    RobotFileError
        If the file cannot be read or anything in it is missing, unknown, doubled, or no finite
        number; with the file, the line and the key.
    """
    top = compose(path).mapping(("name", "convention", "units", "rows"), ("source", "tool"))
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
        limits = [None if value is None else unit(value) for value in rest[:3]]
        frame = radians(alpha), metres(a), metres(d), radians(theta)
        rows.append(DHRow(*frame, kind, joint, *limits))
    return DHTable(name, "standard", tuple(rows), source=entry["source"])


def _read_units(node: YamlNode) -> _Units:
    keys = node.mapping(("angle", "length"))
    radians = keys["angle"].choice(("rad", "deg")) == "rad"
    metres = keys["length"].choice(("m", "mm")) == "m"
    return _Units(
        angle=Fraction(1) if radians else Fraction(1, 180),
        pi=0 if radians else 1,
        length=Fraction(1) if metres else Fraction(1, 1000),
    )


def _read_name(node: YamlNode) -> str:
    name = node.text()
    if not _NAME.fullmatch(name):
        raise node.error(f"{name[:60]!r} is no name: use letters, digits, '_', '-' and '.'")
    return name


def _read_dh(keys: dict[str, YamlNode], units: _Units) -> tuple[float, float, float, float]:
    """Return alpha [rad], a [m], d [m], theta [rad]."""
    return (
        units.value(keys["alpha"], "angle"),
        units.value(keys["a"], "length"),
        units.value(keys["d"], "length"),
        units.value(keys["theta"], "angle"),
    )


def _read_row(node: YamlNode, number: int, units: _Units) -> DHRow:
    keys = node.mapping((*_DH_KEYS, "type"), ("limits", "name", "velocity", "effort"))
    kind = cast(JointType, keys["type"].choice(("revolute", "prismatic", "continuous")))
    quantity = "length" if kind == "prismatic" else "angle"
    lower = upper = None
    if kind != "continuous":
        node.refuse_if(
            "limits" not in keys,
            f"missing key 'limits': add limits: [lower, upper] (a {kind} joint needs them)",
        )
        low, high = keys["limits"].items("value", length=2)
        lower, upper = units.value(low, quantity), units.value(high, quantity)
        keys["limits"].refuse_if(lower > upper, "the lower limit is above the upper one: swap them")
    elif "limits" in keys:
        raise keys["limits"].error(
            "a continuous joint has none: remove them, or make the joint revolute"
        )
    velocity = units.value(keys["velocity"], quantity) if "velocity" in keys else None
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
        key: tuple(units.value(item, quantity) for item in keys[key].items("value", length=3))
        for key, quantity in (("xyz", "length"), ("rpy", "angle"))
        if key in keys
    }
    return Placement(**cast(dict[str, Vector], vectors))
