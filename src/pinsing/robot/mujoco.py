"""A serial arm out of a MuJoCo model, as far as Pinocchio reads it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.description.catalog import CatalogEntry, locate_robot
from pinsing.description.xml_tree import parse_xml, read_bytes
from pinsing.errors import RobotFileError
from pinsing.robot.given import given_model

SUFFIXES = (".xml", ".mjcf")


def given_mujoco(robot: Any) -> tuple[pin.Model, Path, tuple[str, ...]] | None:
    """Return the model of a MuJoCo file, the file, and notes; None for everything else.

    Raises
    ------
    RobotFileError
        If Pinocchio does not read it.
    """
    if not isinstance(robot, str | os.PathLike) or str(robot).lstrip().startswith("<"):
        return None
    if not str(robot).lower().endswith(SUFFIXES) and not str(robot).startswith("rd:"):
        return None
    found = locate_robot(robot if isinstance(robot, str) else Path(robot))
    path = found.path if isinstance(found, CatalogEntry) else found
    if path.suffix.lower() not in SUFFIXES:
        return None
    root = parse_xml(read_bytes(path), path)
    if root.tag != "mujoco":
        return None
    try:
        model = pin.buildModelFromMJCF(os.fspath(path))
    except Exception as error:  # Pinocchio's own, of several kinds
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reason = lines[-1].removeprefix("message: ")[:200] if lines else type(error).__name__
        raise RobotFileError(f"is a MuJoCo model that Pinocchio refuses: {reason}", path) from None
    placements = [placement.homogeneous for placement in model.jointPlacements]
    if not np.isfinite(placements).all():
        raise RobotFileError("is a MuJoCo model with a placement that is not finite", path)
    notes = ["read by Pinocchio from a MuJoCo model; its meshes are not drawn"]
    if any(node.tag == "equality" and node.children for node in root.children):
        notes.append(
            "equality constraints of the MuJoCo model (coupled joints, closed loops) are left out"
        )
    return given_model(model), path, tuple(notes)
