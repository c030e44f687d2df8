"""Mechanism: a spanning tree with closed loops, actuated and passive joints, and an output."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
import pinocchio as pin

from pinsing.arguments import checked, columns_of, real_numbers
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool
from pinsing.notebook import one_line
from pinsing.robot.chains import frame_index
from pinsing.robot.joint_space import JointSpace, model_q, require_scale, require_values
from pinsing.robot.models import joint_axis
from pinsing.robot.source import Memory, Source, kept
from pinsing.robot.task import Task

LOOP_KINDS = {"planar": 2, "3d": 3, "6d": 6}
"""Kinds of closure and how many equations each has."""


@dataclass(frozen=True)
class Loop:
    """Two frames of the spanning tree that the mechanism holds together.

    Attributes
    ----------
    frame_a, frame_b : str
        Their names.
    kind : str
        ``3d``: the origins coincide; ``6d``: the frames do; ``planar``: the origins coincide
        in the x-y plane of the first frame.
    """

    frame_a: str
    frame_b: str
    kind: str

    @property
    def rows(self) -> int:
        """Number of its closure equations."""
        return LOOP_KINDS[self.kind]

    def __str__(self) -> str:
        return f"{self.frame_a} = {self.frame_b} ({self.kind})"


@dataclass(frozen=True, eq=False)
class Mechanism(Memory):
    """A spanning tree with closed loops, actuated and passive joints, and an output.

    Configurations are joint vectors ``q`` (n,) of *all* joints of the tree, radians and
    metres; inputs are the values of the actuated joints, in the order of ``inputs``.

    Attributes
    ----------
    name : str
        Name of the robot.
    model : pin.Model
        The spanning tree.
    joints : tuple of str
        Names of all joints, in the model's order.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite for continuous joints.
    actuated : tuple of int
        Indices of the actuated joints, in the order of the loop file.
    loops : tuple of Loop
        What holds together.
    output : str
        Name of the frame whose motion counts.
    task : Task
        Rows of its motion that count (LOCAL_WORLD_ALIGNED, axes of the root).
    length_scale : float
        Metres; lengths are divided by it before singular values are taken.
    home : (n,) array
        A configuration near which the loops close.
    notes : tuple of str
        What was assumed while loading.
    source : Source
        Where the tree comes from.
    loop_file : Path or None
        Where the loops come from.
    """

    name: str
    model: pin.Model
    joints: tuple[str, ...]
    prismatic: Bool
    lower: Array
    upper: Array
    actuated: tuple[int, ...]
    loops: tuple[Loop, ...]
    output: str
    task: Task
    length_scale: float
    home: Array
    notes: tuple[str, ...]
    source: Source = field(repr=False)
    loop_file: Path | None = None

    made_by: ClassVar[str] = 'pinsing.load_mechanism("five_bar.urdf")'

    def __post_init__(self) -> None:
        require_scale(self.length_scale)
        for array in (self.lower, self.upper, self.prismatic, self.home):
            array.setflags(write=False)

    @cached_property
    def space(self) -> JointSpace:
        """All its joints: limits, metric, what is outside, values at random."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, self.length_scale)

    @property
    def n(self) -> int:
        """Number of joints of the tree."""
        return len(self.joints)

    @property
    def passive(self) -> tuple[int, ...]:
        """Indices of the joints that are not actuated."""
        return tuple(i for i in range(self.n) if i not in self.actuated)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the actuated joints."""
        return tuple(self.joints[i] for i in self.actuated)

    @property
    def rows(self) -> int:
        """Number of closure equations of all loops."""
        return sum(loop.rows for loop in self.loops)

    @property
    def output_id(self) -> int:
        """Index of the output frame in ``model.frames``."""
        return self.once("output_id", lambda: frame_index(self.model, self.output))

    @checked
    def with_actuated(self, names: tuple[str, ...] | list[str]) -> Mechanism:
        """Return the same mechanism driven by other joints.

        Parameters
        ----------
        names : sequence of str
            The joints that drive it.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load_mechanism("four_bar").with_actuated(["rocker"]).inputs
        ('rocker',)
        """
        return replace(self, actuated=tuple(self.space.index(name) for name in names))

    def without_limits(self) -> Mechanism:
        """Return the same mechanism with joints that turn and slide without end.

        Examples
        --------
        >>> import pinsing
        >>> free = pinsing.load_mechanism("gough_stewart").without_limits()
        >>> float(free.upper.min())
        inf
        """
        endless = np.full(self.n, np.inf)
        return replace(self, lower=-endless, upper=endless)

    def check(self, q: ArrayLike, name: str = "q") -> Array:
        """Return ``q`` as a float array of shape (..., n), or say what is wrong with it.

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.
        name : str
            What messages call it.

        Raises
        ------
        ConfigurationError
            If the last axis is not n long, or a number is not finite.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load_mechanism("four_bar").check([0, 1, 2])
        array([0., 1., 2.])
        """
        return _numbers(q, self.joints, name)

    def check_inputs(self, inputs: ArrayLike) -> Array:
        """Return values of the actuated joints as a float array (..., n_a).

        Parameters
        ----------
        inputs : (..., n_a) array_like
            Radians and metres.

        Raises
        ------
        ConfigurationError
            If the last axis is not n_a long, or a number is not finite.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load_mechanism("five_bar").check_inputs([1, 2])
        array([1., 2.])
        """
        return _numbers(inputs, self.inputs, "inputs")

    def model_q(self, q: ArrayLike) -> Array:
        """Return Pinocchio's configuration(s) for joint vector(s) q.

        Parameters
        ----------
        q : (..., n) array_like
            All joints of the tree, radians and metres.

        Returns
        -------
        (..., model.nq) array
            For ``model``: a continuous joint is its cosine and sine.

        Raises
        ------
        ConfigurationError
            As ``check``.

        Examples
        --------
        >>> import pinsing
        >>> mechanism = pinsing.load_mechanism("four_bar")  # its three joints turn without limits
        >>> mechanism.model_q(mechanism.home).shape
        (6,)
        """
        return model_q(self.model, self.check(q))

    def fold(self, q: ArrayLike) -> Array:
        """Move revolute values of q (..., n) by whole turns to within half a turn of zero.

        Parameters
        ----------
        q : (..., n) array_like
            All joints of the tree, radians and metres.

        Returns
        -------
        (..., n) array
            Radians and metres.

        Raises
        ------
        ConfigurationError
            As ``check``.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load_mechanism("four_bar").fold([7, 0.5, 1.8]).round(4)
        array([0.7168, 0.5   , 1.8   ])
        """
        return self.space.wrap(self.check(q))

    def __repr__(self) -> str:
        return one_line("Mechanism", str(self))

    def __str__(self) -> str:
        loops = ", ".join(str(loop) for loop in self.loops)
        return (
            f"{self.name}: {self.n} joints, driven by {', '.join(self.inputs)}; "
            f"output {self.output} ({self.task}); loops: {loops}"
        )


def _numbers(values: ArrayLike, names: tuple[str, ...], what: str) -> Array:
    array = real_numbers(columns_of(values, names, what), what)
    require_values(array, names, what)
    return array


@kept
def joint_axes(mechanism: Mechanism) -> Array:
    """Axis (n, 3) of each joint in its own frame."""
    pairs = zip(list(mechanism.model.joints)[1:], mechanism.joints, strict=True)
    return np.array([joint_axis(joint, name)[0] for joint, name in pairs])


class Sample:
    """Placements at q (n,) of the tree, closed or not, in axes (rows) of the base.

    ``joints`` and ``frames`` are as in Pinocchio's data, ``output`` in axes ``own`` (columns) of
    it; ``axis`` and ``origins`` (n, 3): the joints' axes, and points on them, metres.
    """

    def __init__(
        self, mechanism: Mechanism, q: Array, axes: Array | None = None, own: Array | None = None
    ) -> None:
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, mechanism.model_q(q))
        pin.updateFramePlacements(mechanism.model, data)
        self.q, self.joints, self.frames = q, list(data.oMi), list(data.oMf)
        if axes is not None:
            turn = pin.SE3(axes, np.zeros(3))
            self.joints, self.frames = ([turn * m for m in x] for x in (self.joints, self.frames))
        output = self.frames[mechanism.output_id]
        self.output = output if own is None else output * pin.SE3(own, np.zeros(3))
        along = zip(self.joints[1:], joint_axes(mechanism), strict=True)
        self.axis = np.array([place.rotation @ axis for place, axis in along])
        self.origins = np.array([place.translation for place in self.joints[1:]])


def meeting_point(axes: Array, points: Array) -> Array | None:
    """Return where lines along ``axes`` (k, 3) through ``points`` (k, 3) meet; None if nowhere."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    rows, right = across.reshape(-1, 3), (across @ points[:, :, None]).ravel()
    point, _, rank, _ = np.linalg.lstsq(rows, right, rcond=None)
    off = np.abs(rows @ point - right).max() / max(1.0, float(np.abs(points).max()))
    return np.asarray(point) if rank == 3 and off <= ROUNDING else None


def path_to(mechanism: Mechanism, body: int) -> list[int]:
    """The joints on the tree's way from the base to a body (a joint of the model)."""
    return [int(j) - 1 for j in mechanism.model.supports[body] if j]


@kept
def closing(mechanism: Mechanism) -> tuple[list[int], list[int]]:
    """Indices of the first frames of all loops, and of the second ones."""
    numbers = {f.name: k for k, f in enumerate(mechanism.model.frames)}
    first = [numbers[x.frame_a] for x in mechanism.loops]
    return first, [numbers[x.frame_b] for x in mechanism.loops]
