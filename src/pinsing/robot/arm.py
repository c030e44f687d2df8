"""Arm: the serial chain that is analysed, with its tip, task, limits and length scale."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import ConfigurationError, OptionError
from pinsing.robot.joint_space import JointSpace, model_q
from pinsing.robot.memory import Memory
from pinsing.robot.task import Task, parse_task
from pinsing.robot.tip import frame_index


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


@dataclass(frozen=True, eq=False)
class Source:
    """Where an arm comes from; enough to draw it later.

    Attributes
    ----------
    label : str
        The path or name as given, or ``"pin.Model"``.
    path : Path or None
        The description file.
    xml : str or None
        The URDF text that Pinocchio read (after xacro).
    package_dirs : tuple of Path
        Folders that hold packages, for ``package://`` meshes.
    full_model : pin.Model
        The model before any joint was locked.
    locked : tuple of int
        Indices of its joints that are locked in the arm.
    reference : (nq,) array
        Its configuration at which they are locked.
    base : str
        Frame of the full model whose axes and origin are the arm's world.
    """

    label: str
    path: Path | None
    xml: str | None
    package_dirs: tuple[Path, ...]
    full_model: pin.Model
    locked: tuple[int, ...]
    reference: Array
    base: str


@dataclass(frozen=True, eq=False)
class Arm(Memory):
    """A serial chain of a Pinocchio model, with the frame and the task it is judged by.

    Configurations are plain joint vectors ``q`` of shape (n,), radians and metres,
    whatever Pinocchio's own ``nq`` (a continuous joint has two numbers there).

    Attributes
    ----------
    name : str
        Name of the robot.
    model : pin.Model
        The reduced model: the joints of the chain, base to tip, and no other.
    tip : str
        Name of the frame whose motion is judged.
    base : str
        Name of the frame whose axes the Jacobian is written in.
    joints : tuple of str
        Names of the free joints, base to tip.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite for continuous joints.
    task : Task
        Rows of the frame Jacobian that count.
    length_scale : float
        Metres; translation rows are divided by it before singular values are taken.
    notes : tuple of str
        All that was assumed while loading.
    source : Source
        Where it comes from.
    coupling : Coupling or None
        Mimic joints inside the chain.
    """

    name: str
    model: pin.Model
    tip: str
    base: str
    joints: tuple[str, ...]
    prismatic: npt.NDArray[np.bool_]
    lower: Array
    upper: Array
    task: Task
    length_scale: float
    notes: tuple[str, ...]
    source: Source = field(repr=False)
    coupling: Coupling | None = None

    def __post_init__(self) -> None:
        scale = self.length_scale
        if not (np.isfinite(scale) and scale > 0):
            raise OptionError(f"length_scale must be a positive number of metres, got {scale!r}")
        self._freeze()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._freeze()  # NumPy does not pickle the flag

    def _freeze(self) -> None:
        for array in (self.lower, self.upper, self.prismatic):
            array.setflags(write=False)

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone: limits, metric, what is outside, values at random."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, self.length_scale)

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @property
    def tip_id(self) -> int:
        """Index of the tip frame in ``model.frames``."""
        return frame_index(self.model, self.tip)

    @property
    def span(self) -> tuple[Array, Array]:
        """Range that a joint is swept or drawn at random over; see `JointSpace.span`."""
        return self.space.span

    def with_task(self, task: Any = None, length_scale: float | None = None) -> Arm:
        """Return the same arm judged by another task or length scale."""
        return replace(
            self,
            task=self.task if task is None else parse_task(task),
            length_scale=self.length_scale if length_scale is None else float(length_scale),
        )

    def check(self, q: npt.ArrayLike) -> Array:
        """Return ``q`` as a float array of shape (..., n), or say what is wrong with it.

        Raises
        ------
        ConfigurationError
            If the last axis is not n long, or a number is not finite.
        """
        try:
            array = np.array(q, dtype=float)
        except (TypeError, ValueError) as error:
            raise ConfigurationError(f"q is not an array of numbers: {error}") from None
        if array.ndim == 0 or array.shape[-1] != self.n:
            got = "a single number" if array.ndim == 0 else f"{array.shape[-1]}"
            raise ConfigurationError(
                f"q needs {self.n} values for {', '.join(self.joints)}; got {got}"
            )
        if not np.isfinite(array).all():
            bad = np.argwhere(~np.isfinite(array))[0]
            raise ConfigurationError(
                f"q of joint {self.joints[bad[-1]]!r} is {array[tuple(bad)]}; "
                "every value must be finite"
            )
        return array

    def within_limits(self, q: npt.ArrayLike, slack: float = 1e-9) -> npt.NDArray[np.bool_]:
        """Tell for q (..., n) whether all joints are inside their limits, whole turns aside.

        A revolute value counts as inside when it is so after some whole turns.
        """
        return np.asarray(~self.space.outside(self.check(q), slack).any(axis=-1))

    def fold(self, q: npt.ArrayLike) -> Array:
        """Move revolute values of q (..., n) by whole turns, into the limits where possible.

        A value that cannot be brought inside ends as near to the limits as whole turns allow.
        Values of continuous joints end in [-pi, pi].
        """
        return self.space.fold(q)

    def model_q(self, q: npt.ArrayLike) -> Array:
        """Pinocchio's configuration(s) for joint vector(s) q: (..., n) -> (..., model.nq)."""
        q = self.check(q)
        values = q if self.coupling is None else q @ self.coupling.matrix.T + self.coupling.offset
        return model_q(self.model, values)

    def __str__(self) -> str:
        return (
            f"{self.name}: {self.n} joints, {self.base} -> {self.tip}, "
            f"task {self.task}, length scale {self.length_scale:g} m"
        )
