"""Arm: the serial chain that is analysed, with its tip, task, limits and length scale.

An arm, a family of its singular configurations and a mechanism each have a `JointSpace`: names,
limits, what counts as far, what is outside, values at random.

A user may give a robot as a path, a name, the text of a URDF, a model, or an object that has one as
``.model``, such as Pinocchio's ``RobotWrapper`` (``example_robot_data.load`` and
``robot_descriptions`` return one).
"""

from __future__ import annotations

import functools
import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar, cast

import numpy as np
import pinocchio as pin

from pinsing._package import Advised
from pinsing.description.catalog import CatalogEntry, known_arms, locate_robot, urdf_folder
from pinsing.description.files import Shapes
from pinsing.description.urdf import Description, Mimic, parse_description, read_description
from pinsing.description.xml_tree import has_control
from pinsing.errors import (
    ArgumentError,
    ConfigurationError,
    OptionError,
    PinsingError,
    RobotFileError,
    UnknownNameError,
)
from pinsing.interface import checked, columns_of, real_numbers
from pinsing.measures import ALIKE, ROUNDING, Array, ArrayLike, Bool
from pinsing.prose import html_text, one_line
from pinsing.robot.models import (
    Coupling as Coupling,
    build_model,
    frame_index,
    joint_value,
    leader_of,
    put_values,
    way_between,
)
from pinsing.robot.task import Task, parse_task


def named(word: str, names: Sequence[str]) -> str:
    """Return the joint that ``q2`` stands for, the second, unless one is called so."""
    place = re.fullmatch(r"[qQ]([1-9]\d{0,3})", word)
    if word not in names and place and int(place[1]) <= len(names):
        return names[int(place[1]) - 1]
    return word


@dataclass(frozen=True, eq=False)
class JointSpace:
    """What is known of the joints alone, whatever they carry.

    Attributes
    ----------
    names : tuple of str
        One for each joint.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite where there are none.
    length_scale : float
        Metres that count as one radian.
    """

    names: tuple[str, ...]
    prismatic: Bool
    lower: Array
    upper: Array
    length_scale: float

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.names)

    @cached_property
    def metric(self) -> Array:
        """Unit of each joint, (n,): 1 rad, or the length scale of a prismatic joint."""
        return np.where(self.prismatic, self.length_scale, 1.0)

    @cached_property
    def span(self) -> tuple[Array, Array]:
        """Return the range (lower, upper), each (n,), that joints are swept or drawn over."""
        # Without limits: a full turn, or one length scale to both sides; twice that beside one.
        reach = np.where(self.prismatic, self.length_scale, np.pi)
        high = np.where(np.isfinite(self.lower), self.lower + 2 * reach, reach)
        high = np.where(np.isfinite(self.upper), self.upper, high)
        return np.where(np.isfinite(self.lower), self.lower, high - 2 * reach), high

    @cached_property
    def circles(self) -> tuple[Array, Array]:
        """As `span`, with whole circles of all revolute joints, whatever their limits."""
        low, high = self.span
        return np.where(self.prismatic, low, -np.pi), np.where(self.prismatic, high, np.pi)

    def range(self, ignore_limits: bool) -> tuple[Array, Array]:
        """`circles` or `span`."""
        return self.circles if ignore_limits else self.span

    def one_turn(self, ignore_limits: bool) -> Array:
        """`range` as (n, 2), but no more than one turn: from -pi on if that is in the range."""
        low, high = self.range(ignore_limits)
        turn = 2 * np.pi
        long = ~self.prismatic & (high - low > turn * (1 + 1e-6))
        low = np.where(long, np.maximum(low, np.minimum(-np.pi, high - turn)), low)
        return np.stack([low, np.where(long, low + turn, high)], axis=1)

    def index(self, name: str) -> int:
        """Return the index of a joint, by name or as ``q1``; UnknownNameError if there is none."""
        found = named(name, self.names)
        UnknownNameError.refuse_if(found not in self.names, "joint", name, self.names)
        return self.names.index(found)

    def mask(self, names: Iterable[str]) -> Bool:
        """Return which joints (n,) are among ``names``; as `index`."""
        found = np.zeros(self.n, dtype=bool)
        found[[self.index(name) for name in names]] = True
        return found

    def wrap(self, q: ArrayLike) -> Array:
        """Revolute values, or differences of such, (..., n) within half a turn of zero.

        Half a turn is -pi, however it was rounded.
        """
        q = np.asarray(q, dtype=float)
        turns = np.where(self.prismatic, 0.0, np.floor((q + np.pi + ROUNDING) / (2 * np.pi)))
        return np.asarray(q - 2 * np.pi * turns)

    def fold(self, q: ArrayLike) -> Array:
        """Move angles of q (..., n) by whole turns to the limits, without them to [-pi, pi]."""
        q = np.array(q, dtype=float)
        low, high = self.span
        turn = 2 * np.pi
        center = np.where(self.prismatic, 0.0, (low + high) / 2)
        folded = np.where(self.prismatic, q, q - turn * np.round((q - center) / turn))
        return np.where((q >= low) & (q <= high), q, folded)

    def outside(self, q: ArrayLike, slack: float = ROUNDING) -> Bool:
        """Return which values of q (..., n) are beyond a limit as they are, no turn taken off."""
        q = np.asarray(q, dtype=float)
        return np.asarray((q < self.lower - slack) | (q > self.upper + slack))

    def unreachable(self, q: ArrayLike, slack: float = ROUNDING) -> Bool:
        """Return which values of q (..., n) are beyond a limit, whatever whole turns are added."""
        return self.outside(self.fold(q), slack)

    def turns_within(self, Q: Array) -> Array:
        """Return whole turns (n,), as few as bring each joint of a path Q (N, n) into its limits.

        Radians; zero for joints that slide, and where no turns do.
        """
        turn = 2 * np.pi
        fewest = np.ceil((self.lower - 1e-9 - Q.min(axis=0)) / turn)
        most = np.floor((self.upper + 1e-9 - Q.max(axis=0)) / turn)
        usable = ~self.prismatic & (fewest <= most)
        return np.where(usable, np.clip(0.0, fewest, most), 0.0) * turn

    def range_words(self, j: int, degrees: bool = False) -> str:
        """Return the limits of joint j, such as ``-6.283 to 6.283 rad``."""
        turns = not self.prismatic[j]
        factor, unit = (180 / np.pi, "°") if degrees and turns else (1.0, " rad" if turns else " m")
        return f"{factor * self.lower[j]:.4g} to {factor * self.upper[j]:.4g}{unit}"

    def outside_words(self, q: Array, degrees: bool = False) -> list[str]:
        """Return a sentence about each value of q (n,) outside its limits."""
        folded = self.fold(q)
        out = []
        for j in map(int, np.flatnonzero(self.outside(q))):
            factor = 180 / np.pi if degrees and not self.prismatic[j] else 1.0
            unit = "m" if self.prismatic[j] else "°" if degrees else "rad"
            value, near = (f"{factor * x[j]:.6g} {unit}".replace(" °", "°") for x in (q, folded))
            limits = self.range_words(j, degrees)
            hint = "" if self.outside(folded)[j] else f"; {near}, whole turns aside, is within them"
            out.append(f"{self.names[j]} = {value} is outside its limits, {limits}{hint}")
        return out

    def require_radians(
        self,
        q: Array,
        called: str,
        *,
        first: int | None = None,
        rows: int = 1000,
        endless: bool = True,
    ) -> None:
        """Raise ConfigurationError if values of q (..., n) make sense in degrees only.

        One does if it is more than a turn beyond a limit, and as degrees within the limits; a
        joint without limits, if ``endless``, has those of a turn to each side. About ``rows`` rows
        are looked at; messages number them from ``first``.
        """
        if q.ndim == 1 and max(map(abs, q.tolist())) < self._near:  # a microsecond, for loops
            return
        step = max(1, len(q) // rows) if q.ndim > 1 else 1
        looked = (q[::step] if q.ndim > 1 else q).reshape(-1, self.n)
        low, high = self._ends
        over = np.maximum(looked - high, low - looked)
        if not (over > 2 * np.pi).any():
            return
        as_degrees = np.radians(looked)
        odd = (over > 2 * np.pi) & (as_degrees > low - 0.01) & (as_degrees < high + 0.01)
        odd &= ~self.prismatic & (endless | np.isfinite(self.upper))
        if not odd.any():
            return
        i, j = (int(k) for k in np.argwhere(odd)[0])
        value = float(looked[i, j])
        row = "" if q.ndim == 1 else f"[{i * step}]" if first is None else f" {first + i * step}"
        limits = f"limits {self.range_words(j)}" if np.isfinite(self.upper[j]) else "no limits"
        raise ConfigurationError(
            f"{called}{row}: {self.names[j]} = {value:g} rad is {value / (2 * np.pi):.1f} turns "
            f"({limits}). For degrees add --deg (Python: numpy.radians); if radians are meant, "
            'add --rad (Python: load(..., units="rad"))',
            joint=self.names[j],
            value=value,
            limits=(float(self.lower[j]), float(self.upper[j])),
        )

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Limits, a turn to each side for joints without."""
        turn = np.where(self.prismatic, np.inf, 2 * np.pi)
        low = np.where(np.isfinite(self.lower), self.lower, -turn)
        return low, np.where(np.isfinite(self.upper), self.upper, turn)

    @cached_property
    def _near(self) -> float:
        """Magnitude below which no value is more than a turn beyond a limit."""
        low, high = self._ends
        return float(np.minimum(high, -low)[~self.prismatic].min(initial=np.inf)) + 2 * np.pi

    def sample(self, count: int, rng: np.random.Generator, ignore_limits: bool = False) -> Array:
        """Random joint vectors (count, n) in `range`."""
        return rng.uniform(*self.range(ignore_limits), (count, self.n))


def require_values(values: Array, names: Sequence[str], called: str, whole: int = 0) -> None:
    """Raise ConfigurationError unless ``values`` (..., n or ``whole``) are finite numbers."""
    n = len(names)
    if values.ndim == 0 or values.shape[-1] not in (n, whole or n):
        got = "a single number" if values.ndim == 0 else f"{values.shape[-1]}"
        lengths = (n,) if whole in (0, n) else (n, whole)
        also = "" if len(lengths) == 1 else f", or the whole model's {whole}"
        raise ConfigurationError(
            f"{called} needs {n} values for {', '.join(names)}{also}; got {got}", lengths=lengths
        )
    finite = np.isfinite(values)
    if not finite.all():
        bad = np.argwhere(~finite)[0]
        value, i = float(values[tuple(bad)]), int(bad[-1])
        joint = names[i] if values.shape[-1] == n else None
        which = f"entry {i} of the whole model" if joint is None else f"joint {joint!r}"
        raise ConfigurationError(
            f"{called} of {which} is {value}; every value must be finite", joint=joint, value=value
        )


def require_scale(length_scale: float) -> None:
    """Raise an OptionError unless a length scale is a positive number."""
    OptionError.refuse_if(
        not (np.isfinite(length_scale) and length_scale > 0),
        f"length_scale must be a positive number of metres, got {length_scale!r}",
    )


def model_q(model: pin.Model, values: Array) -> Array:
    """Return Pinocchio's configurations (..., nq) for one value of each joint (..., nv)."""
    if model.nq == model.nv:
        return values
    out = np.empty((*values.shape[:-1], model.nq))
    put_values(model, range(1, model.njoints), values, out)
    return out


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
class Given:
    """A robot as a user gave it."""

    model: pin.Model  # all of it
    label: str  # path or name as given, "URDF text" or "pin.Model"
    name: str  # of its own; may be empty
    path: Path | None = None  # None for text and models
    description: Description | None = None
    entry: CatalogEntry | None = None
    notes: tuple[str, ...] = ()

    @cached_property
    def leaders(self) -> dict[str, Mimic]:
        """What joints that follow others follow in the end, by name."""
        joints = () if self.description is None else self.description.joints
        direct = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
        return {name: leader_of(name, direct) for name in direct}


def given_model(robot: Any) -> Given | None:
    """Return a copy of the model that was given, or an object holds; None for text and paths."""
    if isinstance(robot, str | os.PathLike):
        return None
    model = robot if isinstance(robot, pin.Model) else getattr(robot, "model", None)
    if not isinstance(model, pin.Model) or isinstance(robot, type):
        raise _no_robot(robot)
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
    return Given(model.copy(), "pin.Model", model.name)


def _no_robot(robot: Any) -> ArgumentError:
    from pinsing.interface import shown

    return ArgumentError("robot", _EXPECTED, shown(robot), 'pinsing.load("ur5") loads one')


def given_file(
    robot: str | os.PathLike[str],
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> Given:
    """Read a robot given by path (.yaml, .yml: a DH table), by name, or as URDF text."""
    if isinstance(robot, str) and robot.lstrip("\ufeff \t\r\n").startswith("<"):
        description = parse_description(robot, packages)
        return Given(build_model(description), "URDF text", description.name, None, description)
    if isinstance(robot, str) and not robot.strip():
        raise _no_robot(robot)
    found = locate_robot(robot if isinstance(robot, str) else Path(robot))
    entry = found if isinstance(found, CatalogEntry) else None
    path = found if isinstance(found, Path) else found.path
    if path.suffix.lower() in (".yaml", ".yml"):  # a DH table, by way of a URDF made of it
        from pinsing.description.dh_table import dh_to_urdf, known_table, read_dh

        said = "is no xacro file, so it takes no xacro arguments"
        RobotFileError.refuse_if(xacro_args, said, path)
        table = read_dh(path) if entry is None else known_table(entry.alias_of or entry.name)
        description = parse_description(dh_to_urdf(table))
    else:
        if entry is not None:  # what the catalog knows of it; what the user says wins
            packages = {**entry.packages, **(packages or {})}
            xacro_args = {**entry.xacro_args, **(xacro_args or {})}
        description = read_description(path, packages, xacro_args)
    label, model = os.fspath(robot), build_model(description)
    return Given(model, label, description.name, path, description, entry)


_UNIT = 1e-3
"""How far cosine and sine of a continuous joint may be from the unit circle."""


@dataclass(frozen=True, eq=False)
class Held:
    """A joint between base and tip that has no value in q: it follows others, or is locked."""

    name: str
    index: int  # in the whole model
    row: Array  # it is at ``q @ row + offset``, radians or metres
    offset: float
    slides: bool
    endless: bool  # whole turns do not matter to it
    why: str  # for messages: what it follows, or that it is locked

    def off(self, q: Array, value: Array | float) -> Array:
        """How far values (...) of the joint are from where q (..., n) puts it."""
        off = np.asarray(value - (q @ self.row + self.offset))
        return off - 2 * np.pi * np.round(off / (2 * np.pi)) if self.endless else off


@dataclass(frozen=True, eq=False)
class Arm(Advised, Memory):
    """A serial chain of a Pinocchio model, with the frame and the task it is judged by.

    Configurations are plain joint vectors ``q`` of shape (n,), radians and metres,
    whatever Pinocchio's own ``nq`` (a continuous joint has two numbers there). Wherever one is
    taken, the configuration (nq,) of the whole model that the arm is part of does as well.

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
    units : str or None
        "rad": joint values are radians, however large. None: those that make sense in degrees
        only are refused.
    design : Arm or None
        What the arm is an imperfect copy of, as a calibrated robot is.
    """

    name: str
    model: pin.Model
    tip: str
    base: str
    joints: tuple[str, ...]
    prismatic: Bool
    lower: Array
    upper: Array
    task: Task
    length_scale: float
    notes: tuple[str, ...]
    source: Source = field(repr=False)
    coupling: Coupling | None = None
    units: str | None = None
    design: Arm | None = field(default=None, repr=False)

    made_by: ClassVar[str] = 'pinsing.load("ur5")'

    def __post_init__(self) -> None:
        require_scale(self.length_scale)
        for array in (self.lower, self.upper, self.prismatic):
            array.setflags(write=False)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()  # NumPy does not pickle the flag

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone: limits, metric, what is outside, values at random."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, self.length_scale)

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @cached_property
    def tip_id(self) -> int:
        """Index of the tip frame in ``model.frames``."""
        return frame_index(self.model, self.tip)

    @property
    def span(self) -> tuple[Array, Array]:
        """Range that a joint is swept or drawn at random over; see `JointSpace.span`."""
        return self.space.span

    @checked
    def with_task(
        self,
        task: str | Iterable[str] | Task | None = None,
        length_scale: float | None = None,
        *,
        tool_axis: str | None = None,
    ) -> Arm:
        """Return the same arm judged by another task or length scale.

        Parameters
        ----------
        task : str, iterable of str or Task, optional
            As in ``load``; the same one if not given.
        length_scale : float, optional
            Metres; the same one if not given.
        tool_axis : str, optional
            As in ``load``.

        Raises
        ------
        OptionError
            If there is no such task, or the length scale is not positive.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load("planar3r").with_task("vx,vy", length_scale=0.4)
        <Arm: planar3r: 3 joints, base_link -> tool0, task vx,vy, length scale 0.4 m>
        """
        judged = parse_task(self.task if task is None else task, tool_axis)
        return replace(
            self,
            task=judged,
            length_scale=self.length_scale if length_scale is None else float(length_scale),
            design=self.design and self.design.with_task(judged, length_scale),
        )

    def check(self, q: ArrayLike, name: str = "q") -> Array:
        """Return ``q`` as a float array of shape (..., n), or say what is wrong with it.

        Parameters
        ----------
        q : (..., n) or (..., nq) array_like
            Joint vectors, radians and metres, or configurations of the whole model (``q_of``);
            a table's columns (pandas, Polars, Arrow) are found by the joints' names.
        name : str
            What messages call it.

        Raises
        ------
        ConfigurationError
            If the last axis has neither of these lengths, a number is not finite, or values make
            sense in degrees only and the arm was not loaded with ``units="rad"``.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load("planar3r").check([0, 0.5])
        Traceback (most recent call last):
        pinsing.errors.ConfigurationError: q needs 3 values for q1, q2, q3; got 2
        """
        return self._radians(self._as_typed(q, name), name)

    def _as_typed(self, q: ArrayLike, name: str = "q", own: bool = True) -> Array:
        q = real_numbers(columns_of(q, self.joints, name), name, own)
        require_values(q, self.joints, name, int(self.source.full_model.nq))
        return q if q.shape[-1] == self.n else self._of_whole(q)

    def _of_whole(self, full_q: Array) -> Array:
        """Joint vectors (..., n) of configurations (..., nq), where held joints are as in the arm.

        Angles are in (-pi, pi].
        """
        whole = self.source.full_model
        own = [whole.getJointId(name) for name in self.joints]
        q = np.stack([_value(whole, j, full_q) for j in own], axis=-1)
        for held in held_joints(self):
            value = _value(whole, held.index, full_q)
            wrong = np.abs(held.off(q, value)) > ALIKE
            if wrong.any():
                here = float(value[wrong][0])
                there = float(q[wrong][0] @ held.row + held.offset)
                raise ConfigurationError(
                    f"joint {held.name!r} {held.why} and belongs at {there:g}, but the whole "
                    f"model's q has it at {here:g}: give the arm's own {self.n} values, or load "
                    "the arm with that joint as it is",
                    joint=held.name,
                    value=here,
                    limits=(there, there),
                )
        return q

    def _radians(self, q: Array, name: str) -> Array:
        if self.units is None:
            self.space.require_radians(q, name)
        return q

    def check_one(self, q: ArrayLike, name: str = "q") -> Array:
        """Check one joint vector (n,), as `check`.

        Parameters
        ----------
        q : (..., n) or (..., nq) array_like
            As in ``check``.
        name : str
            What messages call it.

        Raises
        ------
        ConfigurationError
            As `check`, and if there are several.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load("planar3r").check_one([0, 1, 2])
        array([0., 1., 2.])
        """
        array = self.check(q, name)
        ConfigurationError.refuse_if(
            array.ndim != 1, f"{name} must be one joint vector ({self.n},), got shape {array.shape}"
        )
        return array

    def check_many(self, q: ArrayLike, name: str = "q", own: bool = True) -> Array:
        """Check joint vectors (N, n), as `check`; one (n,) becomes (1, n).

        Parameters
        ----------
        q : (..., n) or (..., nq) array_like
            As in ``check``.
        name : str
            What messages call it.
        own : bool
            Whether a copy is wanted; without it, ``q`` itself is returned where it will do.

        Raises
        ------
        ConfigurationError
            As `check`, and if there are more axes.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load("planar3r").check_many([0, 1, 2])
        array([[0., 1., 2.]])
        """
        array = self._radians(self._as_typed(q, name, own), name)
        array = array if array.ndim == 2 else np.atleast_2d(array)
        ConfigurationError.refuse_if(
            array.ndim != 2, f"{name} must be joint vectors (N, {self.n}), got shape {array.shape}"
        )
        return array

    def q_of(self, full_q: ArrayLike) -> Array:
        """Return joint vector(s) of the arm in configuration(s) of the whole model.

        All functions that take ``q`` do this by themselves: they tell the two by their lengths. Of
        equal lengths both mean the same, unless joints are traversed backwards: then these
        functions take the chain's order, base to tip, and this one the whole model's.

        Parameters
        ----------
        full_q : (..., nq) array_like
            As Pinocchio has it for ``source.full_model``: a floating base is seven numbers, a
            continuous joint its cosine and sine. The place of the base and joints beside the
            chain do not matter to the arm.

        Returns
        -------
        (..., n) array
            Radians and metres; continuous joints in (-pi, pi].

        Raises
        ------
        ConfigurationError
            If there are not nq finite numbers, or if a joint that the arm has locked between base
            and tip, or that follows another, stands elsewhere than in the arm.

        Examples
        --------
        >>> import pinocchio as pin, pinsing
        >>> model = pinsing.load("panda").source.full_model  # with two fingers
        >>> arm = pinsing.load(model)
        >>> arm.q_of(pin.neutral(model)).shape
        (7,)
        """
        array = real_numbers(full_q, "full_q")
        whole = int(self.source.full_model.nq)
        ConfigurationError.refuse_if(
            array.ndim == 0 or array.shape[-1] != whole,
            f"full_q needs the whole model's {whole} values, got shape {array.shape}",
            lengths=(whole,),
        )
        own = self.check(array, "full_q")
        # Of the same length, it is still in the order of the whole model.
        return self._of_whole(array) if array.shape[-1] == self.n else own

    def full_q(self, q: ArrayLike, others: ArrayLike | None = None) -> Array:
        """Return configuration(s) of the whole model with the arm at q: the inverse of ``q_of``.

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.
        others : (nq,) array_like, optional
            The whole model's configuration that the other joints are taken from; by default the
            one at which they were locked.

        Returns
        -------
        (..., nq) array
            For ``source.full_model``.

        Raises
        ------
        ConfigurationError
            If q or ``others`` has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> arm = pinsing.load("panda")
        >>> arm.full_q([0, 0, 0, -2, 0, 2, 0]).tolist()
        [0.0, 0.0, 0.0, -2.0, 0.0, 2.0, 0.0, 0.0, 0.0]
        """
        rest = self.source.reference if others is None else real_numbers(others, "others")
        whole = int(self.source.full_model.nq)
        ConfigurationError.refuse_if(
            rest.shape != (whole,) or not np.isfinite(rest).all(),
            f"others needs {whole} finite values, got shape {rest.shape}",
            lengths=(whole,),
        )
        values = model_values(self, self.check(q))
        out = np.broadcast_to(rest, (*values.shape[:-1], whole)).copy()
        put_values(self.source.full_model, self.source.kept, values, out)
        return out

    @checked
    def within_limits(self, q: ArrayLike, slack: float = 1e-9) -> Bool:
        """Tell for q (..., n) whether all joints are within their limits.

        Values count as they are; ``fold`` takes off whole turns first.

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.
        slack : float
            How far beyond a limit still counts as inside, radians or metres.

        Returns
        -------
        (...) array of bool
            True where no joint is outside.

        Raises
        ------
        ConfigurationError
            As ``check``.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.load("scara").within_limits([[0, 1, 0.1, 0], [0, 3, 0.1, 0]])
        array([ True, False])
        """
        return np.asarray(~self.space.outside(self._as_typed(q), slack).any(axis=-1))

    @checked
    def fold(self, q: ArrayLike) -> Array:
        """Move revolute values of q (..., n) by whole turns, into the limits where possible.

        A value that cannot be brought inside ends as near to the limits as whole turns allow.
        Values of continuous joints end in [-pi, pi].

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.

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
        >>> pinsing.load("scara").fold([7, 1, 0.1, 0]).round(4)
        array([0.7168, 1.    , 0.1   , 0.    ])
        """
        return self.space.fold(self._as_typed(q))

    @checked
    def model_q(self, q: ArrayLike) -> Array:
        """Return the configuration(s) of ``model``, the chain alone, at q.

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.

        Returns
        -------
        (..., model.nq) array
            As Pinocchio has it: a continuous joint is its cosine and sine.

        Raises
        ------
        ConfigurationError
            As ``check``.

        Examples
        --------
        >>> import pinocchio as pin, pinsing
        >>> arm = pinsing.load("planar3r")
        >>> data = arm.model.createData()
        >>> pin.forwardKinematics(arm.model, data, arm.model_q([0, 0, 0]))
        >>> pin.updateFramePlacement(arm.model, data, arm.tip_id).translation.round(3)[0].item()
        0.9
        """
        return model_q(self.model, model_values(self, self.check(q)))

    def __repr__(self) -> str:
        return one_line("Arm", str(self))

    def __str__(self) -> str:
        return (
            f"{self.name}: {self.n} joints, {self.base} -> {self.tip}, "
            f"task {self.task}, length scale {self.length_scale:g} m"
        )

    def _repr_html_(self) -> str:
        return html_text(str(self), block=True)


def model_values(arm: Arm, q: Array) -> Array:
    """Plain value of every joint of the model, mimic joints included: (..., n) -> (..., nv)."""
    return q if arm.coupling is None else arm.coupling.values(q)


def held_joints(arm: Arm) -> list[Held]:
    """Return the joints between base and tip that have no value in q."""
    whole, joints, found = arm.source.full_model, np.array(arm.joints), []
    for row, j in enumerate(arm.source.kept):
        if arm.coupling is not None and whole.names[j] not in arm.joints:
            share = arm.coupling.matrix[row]
            leaders = " and ".join(map(repr, joints[share != 0].tolist())) or "a locked joint"
            why = f"follows {leaders} in the description"
            found.append((j, share, float(arm.coupling.offset[row]), why))
    for j in _locked_on_the_way(arm):
        at = float(joint_value(whole, j, arm.source.reference))
        found.append((j, np.zeros(arm.n), at, "is locked in this arm"))
    return [
        Held(
            whole.names[j],
            j,
            row,
            offset,
            slides=whole.joints[j].shortname().startswith("JointModelP"),
            endless=whole.nqs[j] == 2,
            why=why,
        )
        for j, row, offset, why in found
    ]


def _locked_on_the_way(arm: Arm) -> list[int]:
    """Joints of one value that are locked between base and tip."""
    whole = arm.source.full_model
    ends = (
        int(whole.frames[frame_index(whole, f)].parentJoint) for f in (arm.source.base, arm.tip)
    )
    # A floating base carries the arm's axes.
    path = way_between(whole, *ends).path
    return [j for j in path if j in arm.source.locked and whole.joints[j].nv == 1]


def _value(whole: pin.Model, joint: int, full_q: Array) -> Array:
    """As `joint_value`; ConfigurationError for what is no cosine and sine."""
    i = whole.idx_qs[joint]
    if whole.nqs[joint] == 2:
        size = np.hypot(full_q[..., i], full_q[..., i + 1])
        ConfigurationError.refuse_if(
            not (np.abs(size - 1) <= _UNIT).all(),
            f"q of continuous joint {whole.names[joint]!r} must be its cosine and sine "
            f"(entries {i} and {i + 1} of the whole model's {whole.nq})",
            joint=whole.names[joint],
        )
    return joint_value(whole, joint, full_q)


def chain_speeds(arm: Arm, dq: Array, called: str) -> Array:
    """Return joint speeds (n,), given such or (nv,); a joint that is locked must not move."""
    whole = arm.source.full_model
    if dq.shape == (arm.n,):
        return dq
    ConfigurationError.refuse_if(
        dq.shape != (whole.nv,),
        f"{called} needs {arm.n} values for {', '.join(arm.joints)}, or the "
        f"whole model's {whole.nv}; got shape {dq.shape}",
        lengths=(arm.n, int(whole.nv)),
    )
    for j in _locked_on_the_way(arm):
        name, speed = whole.names[j], float(dq[whole.idx_vs[j]])
        ConfigurationError.refuse_if(
            abs(speed) > ALIKE,
            f"joint {name!r} is locked in this arm, but the whole model's {called} moves "
            f"it at {speed:g}: load the arm with that joint as it is",
            joint=name,
            value=speed,
        )
    return np.array([dq[whole.idx_vs[whole.getJointId(name)]] for name in arm.joints])


@dataclass(frozen=True, eq=False)
class ArmSummary:
    """Plain data of an Arm, for printing, JSON and loading it again.

    Attributes
    ----------
    name, source, tip, base, task : str
        As on the arm; ``source`` is the path or name it was loaded from.
    joints : tuple of str
        Free joints, base to tip.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite for continuous joints.
    length_scale : float
        Metres.
    notes : tuple of str
        What was assumed while loading.
    calibration : str
        The file that placed the joints of this very robot; empty without one.
    """

    name: str
    source: str
    tip: str
    base: str
    task: str
    joints: tuple[str, ...]
    prismatic: Bool
    lower: Array
    upper: Array
    length_scale: float
    notes: tuple[str, ...]
    calibration: str = field(default="", metadata={"optional": True})

    @property
    def described(self) -> str:
        """Its source, with the calibration if there is one."""
        return self.source + f" with calibration {self.calibration}" * bool(self.calibration)

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @property
    def typed(self) -> str:
        """The arm as commands take it; ROBOT stands for what was not loaded from a file."""
        chosen = any(note.startswith(f"tip {self.tip} ") for note in self.notes)
        options = [] if chosen else ["--tip", self.tip]
        options += ["--task", self.task] if self.task != "pose" else []
        options += ["--calibration", self.calibration] if self.calibration else []
        file = "ROBOT" if self.source.startswith(("<", "pin.")) else self.source
        return shlex.join([file, *options])

    @property
    def space(self) -> JointSpace:
        """Its joints alone: limits, and what is outside of them."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, self.length_scale)


def summarize(arm: Arm) -> ArmSummary:
    """Plain data of ``arm``."""
    return ArmSummary(
        name=arm.name,
        # A name that is no UTF-8 has no place in JSON.
        source=arm.source.label.encode("utf-8", "backslashreplace").decode(),
        calibration=arm.source.calibration.encode("utf-8", "backslashreplace").decode(),
        tip=arm.tip,
        base=arm.base,
        task=arm.task.name,
        joints=arm.joints,
        prismatic=arm.prismatic,
        lower=arm.lower,
        upper=arm.upper,
        length_scale=arm.length_scale,
        notes=arm.notes,
    )
