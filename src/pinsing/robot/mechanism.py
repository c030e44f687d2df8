"""Mechanism: a spanning tree with closed loops, actuated and passive joints, and an output.

It is read from a URDF of the spanning tree and a side-car file, YAML in the style of
gepetto/example-parallel-robots: ``closed_loop`` (pairs of frames that coincide), ``type`` (how they
do) and ``name_mot`` (the actuated joints); to which pinsing adds ``output`` (whose motion counts)
and ``home`` (where to start closing the loops).

A URDF has no balls and no universal joints: ``joint_name`` lists joints of the URDF, ``joint_type``
what they really are (SPHERICAL, UJOINT_XY, ..., FIXED), and they are made others in a new model of
single turns. A ball becomes turns about x, y and z of the joint's frame, named NAME_X, NAME_Y and
NAME_Z; a universal joint two of them.

A leg between two balls (S-P-S, S-S) turns about the line of their centres, and so does one whose
own hinge lies on a line through a ball. That moves nothing else and no actuator holds it: it is no
freedom of the mechanism. One passive hinge is held where it is at home, and that is said.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing.description.urdf import NO_LIMITS
from pinsing.description.xml_tree import suggestion
from pinsing.description.yaml_tree import YamlNode, compose
from pinsing.errors import JointError, OptionError, PinsingError
from pinsing.interface import checked, columns_of, real_numbers
from pinsing.measures import ALIKE, ROUNDING, Array, ArrayLike, Bool
from pinsing.prose import one_line
from pinsing.robot.arm import (
    HasModel,
    JointSpace,
    Memory,
    Source,
    given_file,
    given_model,
    kept,
    model_q,
    require_scale,
    require_values,
)
from pinsing.robot.models import chain_limits, cut_out, frame_index, joint_axis
from pinsing.robot.task import ROW_NAMES, Task, parse_task

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


def without_idle_spins(mechanism: Mechanism, keep_output: bool = True) -> Mechanism:
    """Hold one hinge of each link that spins idly, except the output's if ``keep_output``."""
    held: list[str] = []
    while (found := _idle(mechanism, keep_output)) is not None:
        held.append(mechanism.joints[found])
        # Fixed where it is at home.
        kept = np.arange(mechanism.n) != found
        at = mechanism.model_q(np.where(kept, 0.0, mechanism.home))
        model, _ = cut_out(mechanism.model, (np.flatnonzero(kept) + 1).tolist(), at)
        number = np.cumsum(kept) - 1
        mechanism = replace(
            mechanism,
            model=model,
            joints=tuple(model.names)[1:],
            prismatic=mechanism.prismatic[kept],
            lower=mechanism.lower[kept],
            upper=mechanism.upper[kept],
            actuated=tuple(int(number[j]) for j in mechanism.actuated),
            home=mechanism.home[kept],
        )
    if not held:
        return mechanism
    spins = "link spins" if len(held) == 1 else "links spin"
    note = (
        f"{len(held)} {spins} about the own line, which moves nothing else: held at home is "
        f"{', '.join(held)}"
    )
    return replace(mechanism, notes=(*mechanism.notes, note))


@dataclass(frozen=True, eq=False)
class _Run:
    """Joints that nothing else is fixed between; behind a weld those of its other side."""

    joints: list[int]
    own: int  # how many of them are before the weld
    axes: Array  # (S, k, 3): at the samples, as seen from this side
    points: Array  # (S, k, 3): on the axes
    end: Array | None  # (S, 3): where a loop holds the last link at a point

    def through(self, k: int, points: Array) -> bool:
        """Whether the axis of joint k passes through points (S, 3)."""
        off = np.linalg.norm(np.cross(points - self.points[:, k], self.axes[:, k]), axis=1)
        return bool((off <= ROUNDING * np.maximum(1.0, np.abs(points).max(axis=1))).all())


def _runs(mechanism: Mechanism, keep_output: bool) -> Iterator[_Run]:
    """Yield all joints in chains."""
    model, n = mechanism.model, mechanism.n
    output = int(model.frames[mechanism.output_id].parentJoint) if keep_output else -1
    after = [[int(child) - 1 for child in children] for children in model.children]
    # Of each body the frames that loops hold there, those they hold them to, and how.
    cuts: list[list[tuple[int, int, str]]] = [[] for _ in range(n + 1)]
    for loop, a, b in zip(mechanism.loops, *closing(mechanism), strict=True):
        for one, two in ((a, b), (b, a)):
            cuts[int(model.frames[one].parentJoint)].append((one, two, loop.kind))
    behind = [
        after[j + 1][0] if j + 1 != output and not cuts[j + 1] and len(after[j + 1]) == 1 else None
        for j in range(n)
    ]
    runs = [[j] for j in range(n) if j not in behind]
    for run in runs:
        while (following := behind[run[-1]]) is not None:
            run.append(following)
    # By their last links those that end in one loop and nothing else.
    ends = {x[-1] + 1: x for x in runs if not after[x[-1] + 1] and len(cuts[x[-1] + 1]) == 1}
    rng = np.random.default_rng(2203)
    # At home a slide may have no length yet.
    home = np.where(mechanism.prismatic & (mechanism.home == 0), 1.0, mechanism.home)
    samples = [Sample(mechanism, q) for q in (*rng.uniform(0.3, 1.2, (2, n)), home)]
    for run in runs:
        joints, end, seen = run, None, [(s.axis[run], s.origins[run]) for s in samples]
        a, b, kind = cuts[run[-1] + 1][0] if run[-1] + 1 in ends.keys() - {output} else (0, 0, "")
        if kind == "3d":
            end = np.array([s.frames[a].translation for s in samples])
        elif kind == "6d" and (other := int(model.frames[b].parentJoint)) in ends:
            # Of those to the output only the last may be of interest: this one, written twice.
            back = ends[other][::-1] if other != output else ends[other][-1:]
            joints = run + back
            for k, s in enumerate(samples):
                over = s.frames[a] * s.frames[b].inverse()
                axes = s.axis[back] @ over.rotation.T
                points = s.origins[back] @ over.rotation.T + over.translation
                seen[k] = np.vstack([seen[k][0], axes]), np.vstack([seen[k][1], points])
        axes, points = map(np.array, zip(*seen, strict=True))
        yield _Run(joints, len(run), axes, points, end)


def _idle(mechanism: Mechanism, keep_output: bool) -> int | None:
    """A hinge to hold, or None where no link spins idly."""
    # Links between two balls first, then hinges, in the order of the joints.
    chains = _runs(mechanism, keep_output)
    found = [x for chain in chains for x in _spins(mechanism, chain)]
    return min(found)[-1] if found else None


def _spins(mechanism: Mechanism, chain: _Run) -> Iterator[tuple[bool, int, int]]:
    """Yield what spins idly: whether it is a hinge, its joint, and the joint to hold."""
    hinge = [j in mechanism.passive and not mechanism.prismatic[j] for j in chain.joints]
    # By the places of their first hinges, points (S, 3) where three passive axes meet.
    balls: dict[int, Array] = {}
    for k in range(len(hinge) - 2):
        axes, points = (x[:, k : k + 3] for x in (chain.axes, chain.points))
        if all(hinge[k : k + 3]) and not k < chain.own < k + 3:
            met = [p for p in map(meeting_point, axes, points) if p is not None]
            if len(met) == len(axes) and np.abs(np.linalg.det(axes)).max() > ALIKE:
                balls[k] = np.array(met)
    for k in (k for k in range(chain.own) if hinge[k]):
        joint = chain.joints[k]
        inner = [balls[i] for i in balls if i <= k - 3][-1:]
        outer, beyond = (
            [*(balls[i] for i in balls if i > least), chain.end][0] for least in (k, k + 2)
        )
        if k in balls and beyond is not None:
            yield False, joint, chain.joints[k + _held(chain.axes[:, k : k + 3], beyond - balls[k])]
        if any(chain.through(k, x) for x in (*inner, outer) if x is not None):
            yield True, joint, joint
        # Written twice: a weld holds its link to that of another hinge on the same axis.
        two = k + 1
        if two == chain.own < len(hinge) and hinge[two] and chain.through(k, chain.points[:, two]):
            across = np.cross(chain.axes[:, k], chain.axes[:, two])
            if np.abs(across).max() <= ROUNDING:
                yield True, joint, joint


def _held(axes: Array, away: Array) -> int:
    """Return the hinge of a ball to hold, of axes (S, 3, 3), with another ball ``away`` (S, 3)."""
    # The others point the link, everywhere if it is across the second and that across the first,
    # and at home, the last sample, they should move it two ways.
    along = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), ROUNDING)
    scores = []
    for k in range(3):
        a, b = np.delete(axes, k, axis=1).swapaxes(0, 1)
        off = max(np.abs((b * along).sum(axis=1)).max(), np.abs((a * b).sum(axis=1)).max())
        spread = abs(float(np.linalg.det([a[-1], b[-1], along[-1]])))
        scores.append((bool(off <= ALIKE), round(spread, 6), k))
    return max(scores)[2]


_TURNS = {
    "SPHERICAL": "XYZ",
    "CARDAN": "XY",
    **{f"UJOINT_{a}{b}": a + b for a in "XYZ" for b in "XYZ" if a != b},
    "FIXED": "",
}


def replaced_joints(model: pin.Model, keys: dict[str, YamlNode]) -> pin.Model:
    """Return the model with joints replaced as ``joint_name`` and ``joint_type`` list them."""
    for one, other in (("joint_name", "joint_type"), ("joint_type", "joint_name")):
        if one not in keys:
            raise keys[other].error(f"missing key {one!r}: {other} needs it beside it")
    names, kinds = (
        [] if keys[k].empty_list else keys[k].items("joint") for k in ("joint_name", "joint_type")
    )
    keys["joint_type"].refuse_if(
        len(names) != len(kinds), f"{len(names)} joints need {len(names)} types, found {len(kinds)}"
    )
    known = tuple(model.names)[1:]
    turns = [_TURNS[_one_of(kind, "value", tuple(_TURNS), str.upper)] for kind in kinds]
    hinges = dict(zip([k + 1 for k in _numbered(names, known)], turns, strict=True))
    if not hinges:
        return model
    keep = set(range(1, model.njoints)) - hinges.keys()
    out, _ = cut_out(model, keep, pin.neutral(model), hinges=hinges)
    PinsingError.refuse_if(
        out.njoints == 1, f"{model.name}: all joints are FIXED in the loop file: nothing moves"
    )
    return out


@checked
def load_mechanism(
    robot: str | os.PathLike[str] | pin.Model | HasModel,
    loops: str | os.PathLike[str] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    *,
    length_scale: float = 1.0,
) -> Mechanism:
    """Read a spanning tree and the loops that close it.

    Parameters
    ----------
    robot : str, path, pin.Model or object with ``.model``
        A URDF or xacro file, the name of a known robot, the text of a URDF, or a model.
    loops : path, optional
        The side-car file; by default ``NAME.loops.yaml`` beside ``NAME.urdf``.
    packages : mapping of str to path, optional
        Folders of ROS packages by name.
    length_scale : float
        Metres; lengths are divided by it before singular values are taken.

    Returns
    -------
    Mechanism
        With everything that was assumed in ``mechanism.notes``.

    Raises
    ------
    PinsingError
        RobotFileError with file and line where the side-car or the tree is wrong, UnknownNameError,
        JointError or OptionError: one line that says what is wrong, where, and what to do.

    Examples
    --------
    >>> import pinsing
    >>> mechanism = pinsing.load_mechanism("five_bar")
    >>> mechanism.n, mechanism.inputs
    (4, ('q1', 'q2'))
    """
    model, source, name, notes, follow = _tree(robot, packages)
    if loops is None:
        if source.path is None:
            raise OptionError("a loop file is needed: give the path of a .loops.yaml file")
        loops = source.path.with_name(source.path.name.partition(".")[0] + ".loops.yaml")
    path = Path(loops)
    keys = compose(path).mapping(
        ("closed_loop", "type", "name_mot"),
        ("output", "home", "name", "source", "joint_name", "joint_type"),
    )
    if "joint_name" in keys or "joint_type" in keys:
        model = replaced_joints(model, keys)
    lower, upper, prismatic = _limits(model)
    joints = tuple(model.names)[1:]
    frame, rows, said = _output(keys, model)
    closed = _loops(keys["closed_loop"], keys["type"], model)
    _check_on_loop(model, frame, closed, keys.get("output", keys["closed_loop"]))
    actuated = _actuated(keys["name_mot"], joints)
    for j in follow:
        JointError.refuse_if(
            j not in [joints[k] for k in actuated],
            j,
            "mimics another joint, which loops do not support: model it as a loop, or "
            "drive it (name_mot)",
        )
    home = np.zeros(len(joints))
    if "home" in keys:
        for j, value in keys["home"].mapping((), joints).items():
            home[joints.index(j)] = value.number(pi=0)
    made = Mechanism(
        name=keys["name"].text() if "name" in keys else name,
        model=model,
        joints=joints,
        prismatic=prismatic,
        lower=lower,
        upper=upper,
        actuated=actuated,
        loops=closed,
        output=frame,
        task=rows,
        length_scale=float(length_scale),
        home=home,
        notes=(*notes, *said),
        source=source,
        loop_file=path,
    )
    # An output that nobody named may be on a link that spins.
    return without_idle_spins(made, keep_output="output" in keys)


def _output(keys: dict[str, YamlNode], model: pin.Model) -> tuple[str, Task, tuple[str, ...]]:
    """Frame and rows of the output; files made for other programs name none."""
    if "output" in keys:
        output = keys["output"].mapping(("frame", "rows"))
        name = _frame(output["frame"], model)
        rows = [entry.choice(ROW_NAMES) for entry in output["rows"].items("row")]
        try:
            return name, parse_task(rows), ()
        except PinsingError as error:
            raise output["rows"].error(str(error)) from None
    name = _frame(keys["closed_loop"].items("loop")[0].items("frame", 2)[0], model)
    note = (
        f"the loop file names no output: taken is {name}, the first frame of the first loop, with "
        "all six rows; add output: {frame: NAME, rows: [vx, vy, ...]}"
    )
    return name, parse_task("pose"), (note,)


def _check_on_loop(model: pin.Model, output: str, loops: tuple[Loop, ...], node: YamlNode) -> None:
    """Raise unless a joint of some loop carries the output."""

    def path(frame: str) -> set[int]:
        return {*model.supports[model.frames[frame_index(model, frame)].parentJoint]} - {0}

    node.refuse_if(
        not (carried := path(output)),
        f"the output {output!r} is fixed to the base: name a frame that moves",
    )
    node.refuse_if(
        not any(carried & (path(x.frame_a) ^ path(x.frame_b)) for x in loops),
        f"the output {output!r} is on no loop: no joint that the loops hold carries it; name a "
        "frame of a link between two ends of a loop",
    )


def _tree(
    robot: Any, packages: Mapping[str, str | Path] | None
) -> tuple[pin.Model, Source, str, tuple[str, ...], tuple[str, ...]]:
    """What a robot's own description says; last its notes, and joints that mimic others there."""
    given = given_model(robot) or given_file(robot, packages)
    model, description = given.model, given.description
    notes: tuple[str, ...] = ()
    if description is not None:
        moving = [j for j in description.joints if j.kind != "fixed"]
        description.require_usable(j.name for j in moving if not j.endless)
        endless = tuple(j.name for j in moving if j.endless)
        for j in endless:  # Pinocchio was given [0, 0] for joints without any limits
            index = model.joints[model.getJointId(j)].idx_q
            model.lowerPositionLimit[index], model.upperPositionLimit[index] = -np.inf, np.inf
        # What the description says of such joints holds for arms, which need limits.
        notes = tuple(x for x in description.assumed if not (endless and x.startswith(NO_LIMITS)))
        if endless:
            notes = (*notes, f"no usable limits, so they move without end: {', '.join(endless)}")
    source = Source(
        label=given.label,
        path=given.path,
        shapes=None if description is None else description.shapes,
        full_model=model,
        locked=(),
        kept=tuple(range(1, model.njoints)),
        reference=np.array(pin.neutral(model)),
        base="universe",
    )
    return model, source, given.name or "mechanism", notes, tuple(given.leaders)


def _limits(model: pin.Model) -> tuple[Array, Array, Bool]:
    for joint, name in zip(list(model.joints)[1:], tuple(model.names)[1:], strict=True):
        JointError.refuse_if(
            joint.nv != 1,
            name,
            f"is a {joint.shortname()}: joints of a mechanism must be revolute or prismatic",
        )
    return chain_limits(model)[:3]


def _one_of(
    node: YamlNode, what: str, known: Sequence[str], change: Callable[[str], str] = str
) -> str:
    """The text of a node, changed, which must be one of the known ones."""
    text = change(node.text())
    if text not in known:
        raise node.error(f"unknown {what} {text[:60]!r}: {suggestion(text, known)}")
    return text


def _frame(node: YamlNode, model: pin.Model) -> str:
    return _one_of(node, "frame", [f.name for f in model.frames if f.name != "universe"])


def _loops(pairs: YamlNode, kinds: YamlNode, model: pin.Model) -> tuple[Loop, ...]:
    frames = [entry.items("frame", 2) for entry in pairs.items("loop")]
    words = [_one_of(kind, "value", tuple(LOOP_KINDS), str.lower) for kind in kinds.items("type")]
    kinds.refuse_if(
        len(words) != len(frames),
        f"{len(frames)} loops need {len(frames)} types, found {len(words)}",
    )
    found = []
    for (a, b), word in zip(frames, words, strict=True):
        loop = Loop(_frame(a, model), _frame(b, model), word)
        ids = [frame_index(model, name) for name in (loop.frame_a, loop.frame_b)]
        a.refuse_if(
            model.frames[ids[0]].parentJoint == model.frames[ids[1]].parentJoint,
            f"{loop.frame_a!r} and {loop.frame_b!r} are fixed to the same link",
        )
        found.append(loop)
    return tuple(found)


def _numbered(nodes: Sequence[YamlNode], joints: tuple[str, ...]) -> tuple[int, ...]:
    """Numbers of joints that are named, each once."""
    found: list[int] = []
    for node in nodes:
        k = joints.index(_one_of(node, "joint", joints))
        node.refuse_if(k in found, f"joint {joints[k]!r} is given twice: remove one")
        found.append(k)
    return tuple(found)


def _actuated(node: YamlNode, joints: tuple[str, ...]) -> tuple[int, ...]:
    found = _numbered(node.items("joint"), joints)
    node.refuse_if(
        len(found) == len(joints), "every joint is actuated: a closed loop needs passive joints"
    )
    return found
