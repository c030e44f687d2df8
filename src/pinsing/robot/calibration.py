"""Calibrations of Universal Robots: the chain of this very robot, as its controller knows it.

``ur_calibration`` of Universal_Robots_ROS2_Driver writes the block ``kinematics``: the placement of
each link in the one before, a translation in metres and a rotation Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from pinsing.description.catalog import known_arms
from pinsing.description.dh_table import known_table, with_turns
from pinsing.description.yaml_tree import YamlNode, compose
from pinsing.errors import OptionError, RobotFileError
from pinsing.measures import Chain
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import (
    AxisDifference,
    alignment,
    axes,
    differences,
    flatten,
    on_chain,
    require_same,
)

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
_LENGTHS, _ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")


def calibrated(arm: Arm, file: str | os.PathLike[str]) -> Arm:
    """Return a UR arm with the placements of a calibration; its design is the arm as it was."""
    # The YAML ``file`` has ``kinematics``, and there a link a key: ``{x, y, z, roll, pitch, yaw}``,
    # metres and radians. The axes of the base are those of the arm; the tip is the flange.
    OptionError.refuse_if(
        arm.n != len(LINKS) or arm.prismatic.any() or arm.coupling is not None,
        f"--calibration is for a UR robot, and {arm.name!r} is none: give the calibrated robot's "
        "own URDF, and its design with --design",
    )
    OptionError.refuse_if(
        arm.design is not None,
        f"--calibration is of a design, and {arm.name!r} is itself off one, as after a "
        "calibration: give the file alone, or the design by its name, such as ur5e",
    )
    root = compose(Path(file))
    top = root.mapping(("kinematics",), root.keys())
    links = top["kinematics"].mapping(LINKS, ("hash",))
    placed = [_placement(links[name]) for name in LINKS]
    R, t = np.array([m.rotation for m in placed]), np.array([m.translation for m in placed])
    raw = Chain(np.append(R, np.eye(3)[None], 0), np.append(t, np.zeros((1, 3)), 0), arm.prismatic)
    design, start = flatten(arm), pin.SE3.Identity()
    # Frames of the two differ by right angles at the base and at the tip.
    turn = np.rint(alignment(axes(design), axes(raw))[0])
    own = math.prod(map(pin.SE3, design.R, design.t), start=start)
    flange = math.prod(placed, start=start)
    R, t = raw.R.copy(), raw.t.copy()
    R[0], t[0] = turn @ R[0], turn @ t[0]
    R[-1] = np.rint((turn @ flange.rotation).T @ own.rotation)
    chain = Chain(R, t, raw.prismatic)
    source = replace(arm.source, calibration=os.fspath(file))
    made = on_chain(arm, chain, design=arm, source=source)
    require_same(made, arm, f"{os.fspath(file)}: {arm.name!r}")
    return made


def known_like(robot: Arm) -> tuple[str, AxisDifference] | None:
    """Return the known arm with the nearest axes at zero, and the worst of these axes."""
    # None where each has an axis farther away than 0.05 rad, or a hundredth of the links' length.
    near, size = [], float(np.linalg.norm(flatten(robot).t, axis=1).sum())
    for name, entry in known_arms().items():
        if len(entry.get("rows", flatten(robot).t[1:])) != robot.n:
            continue
        try:
            made = _table_chain(name) if "rows" in entry else flatten(load(name))
        except RobotFileError:  # its package is not installed
            continue
        if list(made.prismatic) != list(robot.prismatic):
            continue
        found = differences(robot, made)
        worst = max(found, key=lambda d: d.length)
        if max(d.angle for d in found) < 0.05 and worst.length < 0.01 * size:
            near.append((worst.length, name, worst))
    return min(near)[1:] if near else None


def _table_chain(name: str) -> Chain:
    table = known_table(name)
    placed = [place for _, _, place in with_turns(table)]
    R = np.array([pin.rpy.rpyToMatrix(*place.rpy) for place in placed])
    slides = np.array([row.type == "prismatic" for row in table.rows])
    return Chain(R, np.array([place.xyz for place in placed]), slides)


def _placement(node: YamlNode) -> pin.SE3:
    values = node.mapping((*_LENGTHS, *_ANGLES))
    x = np.array([values[k].number() for k in _LENGTHS])
    rpy = np.array([values[k].number(pi=0) for k in _ANGLES])
    for key, value in zip(_ANGLES, rpy, strict=True):
        values[key].refuse_if(abs(value) > 7, f"{value:g} is no angle in radians: degrees?")
    for key, value in zip(_LENGTHS, x, strict=True):
        values[key].refuse_if(abs(value) > 3, f"{value:g} m is no length of a UR: millimetres?")
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), x)
