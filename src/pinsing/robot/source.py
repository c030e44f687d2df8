"""What a user may give as a robot, what is kept of it, and what follows from it.

A path, a name, the text of a URDF, a model, or an object that has one as ``.model``, such as
Pinocchio's ``RobotWrapper`` (``example_robot_data.load`` and ``robot_descriptions`` return one).
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numpy as np
import pinocchio as pin

from pinsing.description.catalog import CatalogEntry, known_arms, locate_robot, urdf_folder
from pinsing.description.ros_packages import Shapes
from pinsing.description.urdf import Description, parse_description, read_description
from pinsing.description.xml_tree import has_control
from pinsing.errors import ArgumentError, PinsingError, RobotFileError
from pinsing.measures import Array

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Memory:
    """Mixin of frozen dataclasses: one place for what other modules have computed of them."""

    # by name; `dataclasses.replace` copies none
    known: dict[str, Any] = field(
        default_factory=dict, init=False, repr=False, metadata={"json": False}
    )

    def __getstate__(self) -> dict[str, Any]:
        # What was computed may hold functions, and is computed again where it is wanted.
        return {**self.__dict__, "known": {}}

    def once(self, name: str, compute: Callable[[], T]) -> T:
        """Compute what depends on the fields alone the first time; later take it from `known`.

        Parameters
        ----------
        name : str
            What it is kept under.
        compute : callable
            Called without arguments, the first time.
        """
        if name not in self.known:
            self.known[name] = compute()
        return cast("T", self.known[name])


_M = TypeVar("_M", bound=Memory)


def kept(compute: Callable[[_M], T]) -> Callable[[_M], T]:
    """Decorate what depends on one arm or mechanism alone: each keeps it, under its full name."""
    key = f"{compute.__module__}.{compute.__name__}"

    @functools.wraps(compute)
    def once(*args: _M, **named: _M) -> T:
        (of,) = (*args, *named.values())  # by its place, or by its name
        return of.once(key, lambda: compute(of))

    return once


@dataclass(frozen=True, eq=False)
class Coupling:
    """Mimic joints inside the chain: model joints = ``matrix @ q + offset``."""

    matrix: Array  # (nv, n)
    offset: Array  # (nv,), radians or metres

    def values(self, q: Array) -> Array:
        """Values (..., nv) of the model's joints, of those (..., n) of the free ones."""
        return np.asarray(q @ self.matrix.T + self.offset)


@dataclass(frozen=True, eq=False)
class Source:
    """Where an arm comes from; enough to draw it later.

    Attributes
    ----------
    label : str
        The path or name as given, or ``"pin.Model"``.
    path : Path or None
        The description file.
    shapes : Shapes or None
        What the robot looks like; its meshes are looked for when first asked for.
    full_model : pin.Model
        The model before any joint was locked.
    locked : tuple of int
        Indices of its joints that are locked in the arm.
    kept : tuple of int
        Indices of the others, in the order that the arm's own model has them: base to tip.
    reference : (nq,) array
        Its configuration at which they are locked.
    base : str
        Frame of the full model whose axes and origin are the arm's world.
    calibration : str
        The file that placed the joints of this very robot; empty without one.
    """

    label: str
    path: Path | None
    shapes: Shapes | None
    full_model: pin.Model
    locked: tuple[int, ...]
    kept: tuple[int, ...]
    reference: Array
    base: str
    calibration: str = ""

    def is_by(self, maker: str) -> bool:
        """Return True for an arm of a maker by its name in ``urdf/arms.yaml``: not of a file."""
        known = known_arms() if self.path == urdf_folder() / "arms.yaml" else {}
        return known.get(self.full_model.name, {}).get("maker") == maker

    @property
    def xml(self) -> str | None:
        """The URDF (after xacro) with the meshes that there are, as file:// addresses."""
        return None if self.shapes is None else self.shapes.found.xml

    @property
    def mesh_notes(self) -> tuple[str, ...]:
        """Meshes that are not there or may not be opened, and so are not drawn."""
        return () if self.shapes is None else self.shapes.found.notes


_EXPECTED = "a file, the name of a robot, the text of a URDF, a pin.Model or a RobotWrapper"


class HasModel(Protocol):
    """An object with a Pinocchio model, such as ``pin.RobotWrapper``."""

    @property
    def model(self) -> Any:
        """The ``pin.Model``."""


@dataclass(frozen=True)
class GivenFile:
    """A robot that was described by text."""

    description: Description
    label: str  # path or name as given, or "URDF text"
    path: Path | None  # None for text
    entry: CatalogEntry | None


def given_model(robot: Any) -> pin.Model | None:
    """Return a copy of the model that was given, or an object holds; None for text and paths."""
    if isinstance(robot, str | os.PathLike):
        return None
    model = robot if isinstance(robot, pin.Model) else getattr(robot, "model", None)
    if not isinstance(model, pin.Model) or isinstance(robot, type):
        from pinsing.arguments import shown

        raise ArgumentError("robot", _EXPECTED, shown(robot), 'pinsing.load("ur5") loads one')
    PinsingError.refuse_if(
        any("Mimic" in j.shortname() for j in model.joints),
        "the model has Pinocchio mimic joints: build it with mimic=False, "
        "or give the URDF file, where pinsing reads the couplings itself",
    )
    for name in (model.name, *model.names, *(frame.name for frame in model.frames)):
        PinsingError.refuse_if(
            has_control(name),
            f"the model has the name {name[:60]!r} with a control character: rename it",
        )
    return model.copy()


def given_file(
    robot: str | os.PathLike[str],
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> GivenFile:
    """Read a robot given by path (.yaml, .yml: a DH table), by name, or as URDF text."""
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
    from pinsing.description.dh_table import dh_to_urdf, known_table, read_dh

    RobotFileError.refuse_if(xacro_args, "is no xacro file, so it takes no xacro arguments", path)
    table = read_dh(path) if entry is None else known_table(entry.alias_of or entry.name)
    return GivenFile(parse_description(dh_to_urdf(table)), label, path, entry)
