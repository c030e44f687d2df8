"""What a user may give as a robot: a path, a name, the text of a URDF, a model, or a holder of one.

Models come as ``pin.Model`` or as any object that has one as ``.model``, such as Pinocchio's
``RobotWrapper`` (which ``example_robot_data.load`` and ``robot_descriptions`` return).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing.description.catalog import CatalogEntry, locate_robot
from pinsing.description.urdf import Description, parse_description, read_description
from pinsing.description.urdf_source import has_control
from pinsing.errors import ArgumentError, PinsingError, RobotFileError

_EXPECTED = "a file, the name of a robot, the text of a URDF, a pin.Model or a RobotWrapper"


class HasModel(Protocol):
    """An object with a Pinocchio model, such as ``pin.RobotWrapper``."""

    @property
    def model(self) -> Any:
        """The ``pin.Model``."""


@dataclass(frozen=True)
class GivenFile:
    """A robot that was described by text.

    Attributes
    ----------
    description : Description
        As read and checked.
    label : str
        The path or name as given, or ``"URDF text"``.
    path : Path or None
        The file; None for text.
    entry : CatalogEntry or None
        The known robot, where it was given by name.
    """

    description: Description
    label: str
    path: Path | None
    entry: CatalogEntry | None


def given_model(robot: Any) -> pin.Model | None:
    """Return a copy of the model that was given, or that the object holds; None for text and paths.

    A copy: what the caller does to the model later is no business of the arm.

    Raises
    ------
    ArgumentError
        If it is nothing that could be a robot.
    PinsingError
        If a name in the model holds a control character, or it has Pinocchio's mimic joints.
    """
    if isinstance(robot, str | os.PathLike):
        return None
    model = robot if isinstance(robot, pin.Model) else getattr(robot, "model", None)
    if not isinstance(model, pin.Model) or isinstance(robot, type):
        from pinsing.arguments import shown

        raise ArgumentError("robot", _EXPECTED, shown(robot), 'pinsing.load("ur5") loads one')
    if any("Mimic" in j.shortname() for j in model.joints):
        raise PinsingError(
            "the model has Pinocchio mimic joints: build it with mimic=False, "
            "or give the URDF file, where pinsing reads the couplings itself"
        )
    for name in (model.name, *model.names, *(frame.name for frame in model.frames)):
        if has_control(name):
            raise PinsingError(
                f"the model has the name {name[:60]!r} with a control character: rename it"
            )
    return model.copy()


def given_file(
    robot: str | os.PathLike[str],
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> GivenFile:
    """Read a robot that was given by path, by name, or as the text of a URDF.

    Text that begins with ``<``, blanks aside, is a URDF: no file or robot is called so. A file
    that ends in .yaml or .yml is a DH table.

    Raises
    ------
    PinsingError
        As `locate_robot`, `read_description` and `parse_description`.
    """
    if isinstance(robot, str) and robot.lstrip("\ufeff \t\r\n").startswith("<"):
        description = parse_description(robot, packages)
        return GivenFile(description, "URDF text", None, None)
    if isinstance(robot, str) and not robot.strip():
        from pinsing.arguments import shown

        raise ArgumentError("robot", _EXPECTED, shown(robot), 'pinsing.load("ur5") loads one')
    found = locate_robot(robot if isinstance(robot, str) else Path(robot))
    entry = found if isinstance(found, CatalogEntry) else None
    path = found if isinstance(found, Path) else found.path
    if path.suffix.lower() in (".yaml", ".yml"):
        return _table(path, os.fspath(robot), xacro_args, entry)
    if entry is not None:  # what the catalog knows of it; what the user says wins
        packages = {**entry.packages, **(packages or {})}
        xacro_args = {**entry.xacro_args, **(xacro_args or {})}
    description = read_description(path, packages, xacro_args)
    return GivenFile(description, os.fspath(robot), description.path, entry)


def _table(
    path: Path, label: str, xacro_args: Mapping[str, str] | None, entry: CatalogEntry | None
) -> GivenFile:
    """A DH table, a file or an entry of ``arms.yaml``, by way of the URDF that is made of it."""
    from pinsing.description.dh_table import known_table
    from pinsing.description.dh_urdf import dh_to_urdf, read_dh

    if xacro_args:
        raise RobotFileError("is no xacro file, so it takes no xacro arguments", path)
    table = read_dh(path) if entry is None else known_table(entry.alias_of or entry.name)
    return GivenFile(parse_description(dh_to_urdf(table)), label, path, entry)
