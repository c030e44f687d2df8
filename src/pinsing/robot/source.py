"""Where a robot comes from, and what follows from the fields of a frozen object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.description.urdf_meshes import Shapes

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Memory:
    """Mixin of frozen dataclasses: one place for what other modules have computed of them.

    Attributes
    ----------
    known : dict
        By name; no part of what `dataclasses.replace` copies.
    """

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


@dataclass(frozen=True, eq=False)
class Coupling:
    """Mimic joints inside the chain: model joints = ``matrix @ q + offset``.

    Attributes
    ----------
    matrix : (nv, n) array
        One row a joint of the model, one column a free joint of the arm.
    offset : (nv,) array
        Radians or metres.
    """

    matrix: Array
    offset: Array

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
    """

    label: str
    path: Path | None
    shapes: Shapes | None
    full_model: pin.Model
    locked: tuple[int, ...]
    kept: tuple[int, ...]
    reference: Array
    base: str

    @property
    def xml(self) -> str | None:
        """The URDF (after xacro) with the meshes that there are, as file:// addresses."""
        return None if self.shapes is None else self.shapes.found.xml

    @property
    def mesh_notes(self) -> tuple[str, ...]:
        """Meshes that are not there or may not be opened, and so are not drawn."""
        return () if self.shapes is None else self.shapes.found.notes
