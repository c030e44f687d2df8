"""Options that commands share, in groups, and the numbers that people type."""

from __future__ import annotations

import functools
import inspect
import itertools
import math
import re
import shlex
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pinsing.atomic_write import check_writable
from pinsing.cli import completion
from pinsing.cli.output import STDOUT, in_radians, read_result, say
from pinsing.errors import ConfigurationError, OptionError, OutputError, PinsingError

if TYPE_CHECKING:
    from pinsing.measures import Array
    from pinsing.proximity.zones import Zones
    from pinsing.robot.arm import Arm


def loops_beside(robot: str) -> Path:
    """The loop file that ``--loops`` alone means."""
    from pinsing.description.catalog import locate_robot

    where = ""
    if not robot.lstrip().startswith("<"):
        found = locate_robot(robot)
        path = _beside(found if isinstance(found, Path) else found.path)
        if path.is_file():
            return path
        where = f": there is no {path}"
    raise OptionError(f"--loops needs the name of a loop file{where}; give --loops FILE.yaml")


def loops_at_hand(robot: str) -> Path | None:
    """Return the loop file of a robot's file, or of a name of our own; None if there is none."""
    # Every command asks: looking names up in other packages, which have none, takes 20 ms.
    from pinsing.description.catalog import urdf_folder

    if robot.lstrip().startswith("<"):
        return None
    try:
        file = Path(robot)
        if file.is_file():
            path = _beside(file)
        elif "/" in robot or "\\" in robot:
            return None
        else:
            path = urdf_folder() / f"{robot.strip().lower().replace('-', '_')}.loops.yaml"
        return path if path.is_file() else None
    except (PinsingError, OSError, ValueError):
        return None  # the command says what is wrong


def _beside(file: Path) -> Path:
    return file.parent / f"{file.name.partition('.')[0]}.loops.yaml"


_PI = re.compile(r"([+-]?)(?:(\d+(?:\.\d+)?)\s*\*?\s*)?pi(?:\s*/\s*(\d+(?:\.\d+)?))?")


class Typed(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """What people type for an option, and ``read``, which makes a value of it.

    ``read`` takes the text, the option, and what is said of angles: True for degrees, False for
    radians, None where neither ``--deg`` nor ``--rad`` was typed; ``degrees`` says it instead.
    """

    def __init__(
        self,
        name: str,
        read: Callable[[str, str, bool | None], Any],
        degrees: bool | None = None,
    ) -> None:
        self.name, self.read, self.degrees = name, read, degrees

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """The name as it is."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a text; a default may be a value already."""
        if not isinstance(value, str) or param is None or ctx is None:
            return value
        degrees = told_degrees(ctx) if self.degrees is None else self.degrees
        return self.read(value, param.opts[0], degrees)


def _pair(separator: str, example: str) -> Typed:
    """``NAME=VALUE`` with some separator."""

    def read(text: str, option: str, degrees: bool | None) -> tuple[str, str]:
        name, found, rest = text.partition(separator)
        if not found or not name.strip():
            raise click.BadParameter(f"{text!r} is not of the form {example}")
        return name.strip(), rest

    return Typed(example, read)


def _names(text: str, option: str, degrees: bool | None) -> tuple[str, ...]:
    """Words between commas."""
    names = tuple(word.strip() for word in text.split(",") if word.strip())
    OptionError.refuse_if(not names, f"{option} names no joint")
    return names


NAMES = Typed("A,B,...", _names)
"""Joints, by name or place: see `joint_names`."""


def _dict(ctx: click.Context, param: click.Parameter, pairs: Any) -> dict[str, Any]:
    return dict(pairs)


_USUAL: dict[str, dict[str, Any]] = {
    "bool": {"is_flag": True},
    "float": {"type": float},
    "int": {"type": int},
}
"""What the annotation of a parameter tells of its option."""


@dataclass(frozen=True, eq=False)
class Option:
    """How a parameter of a command is typed: what it has for its default."""

    flags: tuple[str, ...] | None  # of an argument none
    attributes: dict[str, Any]

    def made(self, name: str, annotation: Any) -> click.Parameter:
        """Return the option or argument of that name."""
        if self.flags is None:
            return click.Argument([name], **self.attributes)
        plain = str(annotation).removesuffix(" | None")
        flags = self.flags or (f"--{name.replace('_', '-')}",)
        shown = self.attributes.get("default") is not None and plain != "bool"
        usual = {"show_default": shown, **_USUAL.get(plain, {})}
        return click.Option([*flags, name], **usual | self.attributes)


def option(help: str | None = None, *flags: str, **attributes: Any) -> Any:
    """Return the default of a parameter that is an option, ``--name`` but for other ``flags``.

    The annotation tells flags and numbers; a default is shown. All else is as of `click.Option`.
    """
    return Option(flags, {"help": help, **attributes})


def argument(**attributes: Any) -> Any:
    """Return the default of a parameter that is an argument, as of `click.Argument`."""
    return Option(None, attributes)


def group(make: Callable[..., Any]) -> Any:
    """Make of a function the default of a parameter: its own parameters are typed, too."""
    return make


def written(endings: str) -> Any:
    """Return the default of a parameter that is the file of ``-o`` with one of these endings."""
    return endings


def _asked(function: Callable[..., Any], needs_output: bool) -> Iterator[click.Parameter]:
    """What is typed for a function whose parameters have it for their defaults."""
    parameters = inspect.signature(function).parameters.values()
    files = {p.name: p.default.split() for p in parameters if isinstance(p.default, str)}
    for p in parameters:
        if isinstance(p.default, Option):
            yield p.default.made(p.name, p.annotation)
        elif p.name not in files:
            yield from _asked(p.default, needs_output)
        elif p.name == next(iter(files)):
            kinds = {ending: name for name, endings in files.items() for ending in endings}
            yield _OutputOption(kinds, needs_output)


def _called(function: Callable[..., Any], typed: Mapping[str, Any]) -> Any:
    """What a function makes of what was typed for it."""
    parameters = inspect.signature(function).parameters.items()
    return function(
        **{n: typed[n] if n in typed else _called(p.default, typed) for n, p in parameters}
    )


@dataclass(frozen=True)
class RobotRequest:
    """Which arm the user means."""

    robot: str = argument(shell_complete=completion.robots)
    tip: str | None = option(
        "Frame whose motion counts: the end effector.",
        metavar="FRAME",
        shell_complete=completion.frames,
    )
    base: str | None = option(
        "Frame that the chain starts from.", metavar="FRAME", shell_complete=completion.frames
    )
    joints: tuple[str, ...] | None = option(
        "Joints to keep free; the others are locked.", type=NAMES, shell_complete=completion.joints
    )
    task: str = option(
        "pose, position, orientation, tool-axis, or rows such as vx,vy,wz or vx@tip,wy@tip.",
        default="pose",
        shell_complete=completion.tasks,
    )
    tool_axis: str | None = option(
        "Axis of the tip that is free to rotate: task tool-axis (drilling, welding).  [default: z]",
        type=click.Choice(["x", "y", "z"]),
    )
    length_scale: float = option(
        "Translations are divided by it before singular values are taken.",
        default=1.0,
        metavar="METRES",
    )
    packages: dict[str, str] = option(
        "Folder of a ROS package; repeatable.",
        "--package",
        type=_pair("=", "NAME=DIR"),
        multiple=True,
        callback=_dict,
    )
    xacro_args: dict[str, str] = option(
        "Argument of a xacro file; repeatable.",
        "--xacro-arg",
        type=_pair(":=", "K:=V"),
        multiple=True,
        callback=_dict,
    )
    design: str | None = option(
        "What ROBOT is an imperfect copy of: families are of the design, distances of ROBOT; "
        "none: all is of the numbers of the file.",
        metavar="auto|none|ROBOT",
        shell_complete=completion.robots,
    )
    calibration: str | None = option(
        "Calibration of a UR robot, as ur_calibration writes it; ROBOT is its design.",
        metavar="FILE.yaml",
    )

    def __post_init__(self) -> None:
        source = click.get_current_context().get_parameter_source
        if self.tool_axis is not None and source("task") is ParameterSource.DEFAULT:
            object.__setattr__(self, "task", "tool-axis")

    @property
    def words(self) -> str:
        """The robot and the options that choose the arm, as they are typed."""
        joints = None if self.joints is None else ",".join(self.joints)
        task = None if self.task == "pose" else self.task
        scale = None if self.length_scale == 1 else f"{self.length_scale:g}"
        given = [("--tip", self.tip), ("--base", self.base), ("--joints", joints), ("--task", task)]
        given += [("--tool-axis", self.tool_axis), ("--length-scale", scale)]
        given += [("--design", self.design), ("--calibration", self.calibration)]
        given += [("--package", f"{name}={folder}") for name, folder in self.packages.items()]
        given += [("--xacro-arg", f"{name}:={x}") for name, x in self.xacro_args.items()]
        options = [word for option, value in given if value is not None for word in (option, value)]
        return shlex.join([self.robot, *options])

    def load(self, quiet: bool = False) -> Arm:
        """Load the arm, and tell on stderr what was assumed."""
        from pinsing.robot.load import ASSUMED, load
        from pinsing.robot.nominal import (
            ANGLE,
            USUAL,
            design_of,
            differences,
            flatten,
            is_odd,
            nominal,
        )

        arm = load(
            self.robot,
            tip=self.tip,
            base=self.base,
            joints=self.joints,
            task=self.task,
            length_scale=self.length_scale,
            packages=self.packages,
            xacro_args=self.xacro_args,
            tool_axis=self.tool_axis,
            units=None if told_degrees() is None else "rad",
        )
        if self.calibration is not None:
            from pinsing.robot.calibration import calibrated

            arm = calibrated(arm, self.calibration)
        if self.calibration is not None and self.design == "none":
            said = "the design of the calibration is ignored: families are of its own numbers"
            arm = replace(arm, notes=(*arm.notes, said))
        if self.design is not None:
            given = self.design == "auto" or (self.design != "none" and load(self.design))
            notes = tuple(n for n in arm.notes if n != ASSUMED)
            arm = replace(arm, design=design_of(arm, given) if given else None, notes=notes)
        odd = (self.design or self.calibration) is None and is_odd(arm)
        if odd or arm.design is not None:
            from pinsing.robot.calibration import known_like  # only here the known arms are read
        if arm.design is not None:
            # A length counts from half a percent of all links on.
            size = sum(map(math.hypot, *flatten(arm).t.T))
            off = [(max(d.angle, 2 * d.length / size), d) for d in differences(arm, arm.design)]
            much, worst = max(off, key=lambda o: o[0])
            if much > ANGLE:
                far = f"the design may be of another robot: the axis of {worst} away"
                like = known_like(arm)
                if like is not None and 2 * like[1].length < worst.length:
                    far += f"; {like[0]} fits better, {like[1]}"
                arm = replace(arm, notes=(*arm.notes, far))
            said = (
                "families, aspects and paths are of the design, distances from them of this robot"
            )
            arm = replace(arm, notes=(*arm.notes, said))
        like = known_like(arm) if odd else None
        if like is not None:
            why = "the design keeps offsets below 10 mm" if arm.design else "no design was found"
            fits = f"--design {like[0]} fits, the axis of {like[1]} away at most"
            arm = replace(arm, notes=(*arm.notes, f"{why}: {fits}"))
        if self.design == "none":
            # The exact geometry of all that follows is of the numbers of the file.
            arm.once(f"nominal {USUAL}", lambda: nominal(arm, 0.0))
        if not quiet:
            for note in arm.notes:
                say(f"note: {note}")
        return arm


arm_options = group(RobotRequest)


deg_option = option(
    "Angles in degrees, typed and printed; or in radians, even where they only make sense in "
    "degrees.",
    "--deg/--rad",
    is_eager=True,  # it says what the numbers of other options are
)


def in_degrees(deg: bool) -> bool:
    """Return True if angles are printed in degrees: unless ``--rad`` was typed."""
    return deg or not in_radians()


_STDOUT_TOO = ("json_target", "csv", "c", "python", "urdf")
"""Arguments of commands that are text, which may go to stdout."""


class _OutputOption(click.Option):
    """``-o FILE``, repeatable; the ending tells which parameter of the command gets the file.

    ``kinds`` is that parameter for each ending; ``/`` is a folder. Each file is checked first.
    """

    def __init__(self, kinds: dict[str, str], required: bool) -> None:
        self.kinds = kinds
        self.texts = [ending for ending, name in kinds.items() if name in _STDOUT_TOO]
        self.shown = ", ".join("a folder" if ending == "/" else ending for ending in kinds)
        texts = self.texts
        dash = f"; -{texts[0] if texts[1:] else ''} for {texts[0]} on stdout" if texts else ""
        super().__init__(
            ["-o", "--output"],
            multiple=True,
            required=required,
            expose_value=False,
            callback=self.sort,
            metavar="FILE",
            shell_complete=completion.files,
            help=f"Write a file, by its ending: {self.shown}{dash}. Repeatable.",
        )

    def _parameter(self, value: str) -> str:
        """The parameter of the command that gets a file."""
        kinds, texts = self.kinds, self.texts
        longest = sorted(kinds, key=len, reverse=True)
        found = next((kinds[end] for end in longest if value.lower().endswith(end)), None)
        if found is None and len(texts) == 1 and (value == STDOUT or value.startswith("/dev/")):
            found = kinds[texts[0]]
        if found is None and value == STDOUT:
            meant = " or ".join(f"-o -{end}" for end in texts) or "the name of a file"
            raise OptionError(f"-o -: give {meant}")
        if found is None and "/" in kinds and (not Path(value).suffix or Path(value).is_dir()):
            found = kinds["/"]
        if found is None:
            raise OptionError(
                f"-o {value}: the name says what to write, by its ending: {self.shown}"
            )
        return found

    def sort(self, ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> None:
        """Give each file to its parameter; the others are None."""
        files: dict[str, str | Path | None] = dict.fromkeys(self.kinds.values())
        for value in values:
            name = self._parameter(value)
            OptionError.refuse_if(
                files[name] is not None,
                f"-o {files[name]} and -o {value} are files of one kind: give one of them",
            )
            if value in (STDOUT, *(STDOUT + end for end in self.texts)):
                files[name] = STDOUT
            else:
                folder = self.kinds.get("/") == name
                files[name] = Path(value) if folder else check_writable(value)
        ctx.params.update(files)


json_option = written(".json")

verbose_option = option(
    "Print the evidence too: equations, proofs, motions lost.", "-v", "--verbose"
)
fail_option = option("Exit with code 1 if a singularity is found.")
only_option = option("Only this family; repeatable.", "--family", multiple=True, metavar="NAME")
ignore_limits_option = option("Ignore joint limits.")


tip_speed_option = option("Tip speed in any direction.", default=0.25, metavar="M/S")
turn_speed_option = option("At the same time, in any.", default=0.5, metavar="RAD/S")
joint_speeds_option = option(
    "Speed limits of the joints, m/s and rad/s, with --deg deg/s.  [default: those of the file]",
    metavar="S1,S2,...",
)


def typed_speeds(arm: Arm, text: str | None, turn_speed: float, deg: bool) -> Array | None:
    """Return what ``--joint-speeds`` says, rad/s and m/s; refuse what must be another unit."""
    import numpy as np

    fast = 4 * math.pi  # twice round in a second: more than all joints of an arm, or its tip, make
    if turn_speed > fast:
        as_degrees = f"{math.radians(turn_speed):.4g}"
        raise OptionError(f"--turn-speed {turn_speed:g} is in rad/s: for deg/s type {as_degrees}")
    if text is None:
        return None
    speeds = np.array(parse_numbers(text, "--joint-speeds", deg))
    turning = speeds[~arm.prismatic] if len(speeds) == arm.n else speeds[:0]
    other = np.degrees if deg else np.radians
    slow = deg and turning.size and turning.max() < 2 * math.pi
    if slow or (turning.size and turning.min() > fast and told_degrees() is None):
        units = ("deg/s with --deg", "rad/s") if deg else ("rad/s without --deg", "deg/s")
        typed = ",".join(f"{x:.4g}" for x in np.where(arm.prismatic, speeds, other(speeds)))
        raise OptionError(f"--joint-speeds are in {units[0]}: for {units[1]} type {typed}")
    return np.where(arm.prismatic, speeds, np.radians(speeds)) if deg and turning.size else speeds


def _read_zones(ctx: click.Context, param: click.Parameter, file: Path | None) -> Zones | None:
    if file is None:
        return None
    from pinsing.proximity.zones import Zones

    found: Zones = read_result(file, Zones)
    return found


zones_option = option(
    "With the zones that `pinsing zones ROBOT -o FILE.json` wrote.",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.json",
    callback=_read_zones,
)
"""The command gets the `Zones` of the file, or None."""


def follow_option(what: str) -> Any:
    """Return ``--follow STREAM``: configurations of a running robot."""
    return option(
        f"{what}: - for standard input, or a pipe; JSON by joint name or CSV with a head.",
        type=click.Path(exists=True, dir_okay=False, path_type=Path, allow_dash=True),
        metavar="STREAM",
    )


def parse_numbers(text: str, what: str, degrees: bool | None = False) -> list[float]:
    """Return numbers between commas or spaces; without ``degrees`` also ``pi/2``, ``3pi/4``."""
    words = [word for word in re.split(r"[,\s]+", text.strip().strip("[]()")) if word]
    ConfigurationError.refuse_if(not words, f"{what} has no number in it: {text!r}")
    return [_number(word, what, bool(degrees)) for word in words]


def _number(word: str, what: str, degrees: bool) -> float:
    if match := _PI.fullmatch(word.lower()):
        ConfigurationError.refuse_if(degrees, f"{what}: {word!r} is in radians, but --deg is given")
        sign, factor, divisor = match.groups()
        ConfigurationError.refuse_if(
            divisor is not None and float(divisor) == 0, f"{what}: {word!r} divides by zero"
        )
        value = float(factor or 1) * math.pi / float(divisor or 1)
        return -value if sign == "-" else value
    try:
        return float(word)
    except ValueError:
        said = f"{what}: {word!r} is not a number"
        fix = "write 1.5,-90 with commas between numbers, and --deg where angles are in degrees"
        raise ConfigurationError(f"{said}: {fix}") from None


@dataclass(frozen=True)
class JointValues:
    """Joint values as they were typed; called with an arm, its joint vector."""

    numbers: list[float]
    option: str
    degrees: bool  # of those that turn

    def __call__(self, arm: Arm) -> Array:
        """Return the joint vector (n,), radians and metres."""
        import numpy as np

        from pinsing.proximity.crossings import FARTHEST

        q = arm.check(self.numbers, self.option)
        if (np.abs(q) > FARTHEST).any():
            j = int(np.abs(q).argmax())
            raise OptionError(
                f"{self.option}: {arm.joints[j]} is {q[j]:g}; values beyond {FARTHEST:g} are no "
                "positions of a joint"
            )
        if not self.degrees:
            return q
        doubt_degrees(q[~arm.prismatic].tolist(), self.option)
        return np.where(arm.prismatic, q, np.radians(q))


def joint_values(text: str, option: str, degrees: bool | None) -> JointValues:
    """Read joint values, base to tip."""
    return JointValues(parse_numbers(text, option, degrees), option, bool(degrees))


VECTOR = Typed("Q1,Q2,...", joint_values)
"""A configuration: the command gets `JointValues`."""


def at_joint(form: str, count: int = 0) -> Typed:
    """``JOINT=V1,V2``, as ``form`` says, ``count`` values if not any number.

    The command gets a function: of an arm, the joint and its values, radians or metres.
    """

    def read(text: str, option: str, degrees: bool | None) -> Callable[[Arm], Any]:
        name, equals, values = text.rpartition("=")
        OptionError.refuse_if(
            not equals or not name.strip(), f"{option} {text!r} is not of the form {form}"
        )
        numbers = parse_numbers(values, option, degrees)
        needed = "one value" if count == 1 else "two values"
        OptionError.refuse_if(
            count and len(numbers) != count, f"{option} {text!r} needs {needed}: {form}"
        )
        return functools.partial(_joint_at, name.strip(), numbers, bool(degrees))

    return Typed(form, read)


def _joint_at(
    name: str, numbers: Sequence[float], degrees: bool, arm: Arm
) -> tuple[str, tuple[float, ...]]:
    j = arm.space.index(name)
    turns = degrees and not arm.prismatic[j]
    return arm.joints[j], tuple(map(math.radians, numbers) if turns else numbers)


def by_joint(arm: Arm, typed: Iterable[Callable[[Arm], Any]], option: str) -> dict[str, Any]:
    """Return what was typed for an option `at_joint`, by joint; refuse two of one joint."""
    found = [at(arm) for at in typed]
    OptionError.refuse_if(len(dict(found)) < len(found), f"{option} is given twice for one joint")
    return dict(found)


def chosen_for(arm: Arm, **options: Any) -> dict[str, Any]:
    """Return the options that were given, those that need the arm called with it."""
    given = ((name, value) for name, value in options.items() if value is not None)
    return {name: value(arm) if callable(value) else value for name, value in given}


def doubt_degrees(angles: Sequence[float], what: str) -> None:
    """Say so if angles typed with ``--deg`` may be in radians."""
    if 0 < max(map(abs, angles), default=0.0) <= math.tau:
        say(f"note: no angle of {what} exceeds 6.3°: if they are in radians, leave out --deg")


def joint_names(arm: Arm, words: Iterable[str]) -> tuple[str, ...]:
    """Names of joints that are typed by name or place: ``q2`` is the second joint."""
    return tuple(arm.joints[arm.space.index(word)] for word in words)


def whole_number(text: str, what: str, degrees: bool | None = None) -> int:
    """``100000``, ``1e8``, ``2**20``."""
    base, power, exponent = text.replace("_", "").partition("**")
    try:
        if power:
            if int(exponent) > 64:
                raise ValueError
            return int(int(base) ** int(exponent))
        value = float(base)
        if not value.is_integer():
            raise ValueError
        return int(value)
    except (ValueError, OverflowError):
        raise OptionError(f"{what} {text!r} is not a whole number such as 1e8 or 2**20") from None


WHOLE = Typed("N", whole_number)


def told_degrees(context: click.Context | None = None) -> bool | None:
    """Return what --deg or --rad says of angles; None where neither was typed."""
    context = context or click.get_current_context()
    typed = context.get_parameter_source("deg") is ParameterSource.COMMANDLINE
    return context.params["deg"] if typed else None


ROBOT = (
    *("loops", "no_loops", "tip", "base", "joints", "task", "tool_axis", "length_scale"),
    *("packages", "xacro_args", "design", "calibration"),
)
OUTPUT = (
    *("output", "verbose", "deg", "latex", "exact", "live", "no_open", "page", "skeleton", "keep"),
    *("keep_values", "size", "panel", "fail_if_singular", "fail_within"),
)
RARE = (
    *("length_scale", "packages", "xacro_args", "angle_tol", "snap_length", "engine", "threads"),
    *("workers", "dask", "chunk", "keep", "keep_values", "seed", "rtol", "near_rtol", "host"),
    *("port", "panel", "size", "no_open", "chosen", "prefix", "special", "levels"),
    *("samples", "sweep_joints", "no_prune", "nominal_q", "random_starts", "no_loops"),
)
"""Options that ``--help-all`` shows, and ``--help`` does not."""

REPLACED = {
    "--json": ".json", "--html": ".html", "--png": ".png", "--plot": ".png", "--pdf": ".pdf",
    "--c": ".h", "--python": ".py", "--certificate": ".cert.json", "--system": ".sing", "--out": "",
}  # fmt: skip
"""Options that ``-o FILE`` replaces, and an ending that it takes."""

_OTHERS = {
    "--tool": "--tool is an option of path: the task pose has the same singularities with any "
    "tool; for other tasks name a frame of the robot's file with --tip",
    "--trajectory": "--trajectory is an option of report; pinsing check ROBOT FILE judges one, and "
    "with --view shows it",
}
"""Options that people give to other commands, and what to do instead."""

_VECTORS = ("--q", "--near", "--nominal-q", "--to")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)


def placeholder(param: click.Parameter, ctx: click.Context) -> str:
    """Return what stands for a value in a line of usage, in all versions of click alike."""
    if isinstance(param, click.Argument):
        return param.get_usage_pieces(ctx)[0]
    return param.metavar or param.type.name.upper()


class GroupedCommand(click.Command):
    """What `command` makes."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take ``--q 0 -80 60``, point to ``-o``, show all options on demand."""
        ctx.meta["all options"] = "--help-all" in args
        args = ["--help" if word == "--help-all" else word for word in args]
        for word, following in itertools.zip_longest(args, args[1:], fillvalue=""):
            option, _, file = word.partition("=")
            if option in REPLACED:
                ending = REPLACED[option]
                file = file or following
                meant = file if file == "-" or file.endswith(ending) else f"FILE{ending}"
                raise OptionError(f"there is no {option}: did you mean -o {meant}?")
            if option in _OTHERS and not any(option in p.opts for p in self.params):
                raise OptionError(_OTHERS[option])
        for p in self.params:
            times = sum(word.partition("=")[0] in p.opts for word in args)
            OptionError.refuse_if(
                # Of two configurations none is dropped silently; of other values the last counts.
                {"--q", "--to", "--nominal-q"} & {*p.opts}
                and not (p.multiple or ctx.resilient_parsing)
                and times > 1,
                f"{' or '.join(p.opts)} was given {times} times; {ctx.info_name} takes one",
            )
            if {*p.opts} & {*args} and {*p.secondary_opts} & {*args}:
                raise OptionError(f"{p.opts[0]} and {p.secondary_opts[0]} exclude each other")
        return super().parse_args(ctx, _joined(args))

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Name the options that have to be given too."""
        needed = [
            f"{p.opts[0]} {placeholder(p, ctx)}"
            for p in self.params
            if isinstance(p, click.Option) and p.required
        ]
        return [*super().collect_usage_pieces(ctx), *needed]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List what to do, which robot, and what to write; rare options on demand."""
        every = ctx.meta.get("all options", False)
        groups: dict[str, list[tuple[str, str]]] = {"Options": [], "Robot": [], "Output": []}
        hidden = 0
        for p in self.get_params(ctx):
            record = p.get_help_record(ctx)
            if record is None or not isinstance(p, click.Option):
                continue
            if p.name in RARE and not every:
                hidden += 1
                continue
            group = "Robot" if p.name in ROBOT else "Output" if p.name in OUTPUT else "Options"
            groups[group].append(record)
        if hidden:
            groups["Options"].append(("--help-all", f"Show {hidden} more options."))
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


_LOOPS = (
    click.Option(
        ["--loops"],
        type=click.Path(dir_okay=False, path_type=Path),
        is_flag=False,
        flag_value="",  # --loops alone
        metavar="FILE.yaml",
        help="Closed loops of a mechanism; ROBOT is its spanning tree.  [default: the file "
        "NAME.loops.yaml beside it, if there is one]",
    ),
    click.Option(["--no-loops"], is_flag=True, help="Take a serial chain of a mechanism."),
)


_CHAIN = ("tip", "base", "joints", "task", "tool_axis", "zones", "design", "calibration")
"""Options that choose a serial chain or its task."""


def _given(names: Container[str | None]) -> list[str]:
    """Return which options of these names were typed, and say something else than is usual."""
    context = click.get_current_context()
    return [
        p.opts[0]
        for p in context.command.params
        if p.name in names
        and context.get_parameter_source(str(p.name)) is ParameterSource.COMMANDLINE
        and context.params[str(p.name)] != p.default
    ]


def _made_of(function: Callable[..., Any], loops: Path, typed: Mapping[str, Any]) -> Any:
    """What a command makes of a mechanism: options that its function does not take are refused."""
    from pinsing.robot.mechanism import load_mechanism

    takes = inspect.signature(function).parameters
    passed = {*takes, "robot", "packages", "length_scale", "deg", "loops", "no_loops"}
    options = {p.name for p in click.get_current_context().command.params if p.expose_value}
    other = _given(options - passed)
    other += [f"-o {file}" for name, file in typed.items() if file and name not in options | passed]
    does, it = ("does", "it") if len(other) == 1 else ("do", "them")
    OptionError.refuse_if(
        other,
        f"{' and '.join(other)} {does} not go with --loops: leave {it} out, or take a serial chain "
        "with --no-loops",
    )
    made = load_mechanism(
        typed["robot"], loops, typed.get("packages"), length_scale=typed.get("length_scale", 1.0)
    )
    for note in made.notes:
        say(f"note: {note}")
    return function(made, **{name: typed[name] for name in takes if name in typed})


def command(
    name: str, mechanism: Callable[..., Any] | None = None, needs_output: bool = False
) -> Callable[[Callable[..., Any]], GroupedCommand]:
    """Make a `GroupedCommand` of a function whose parameters have for defaults how they are typed.

    With ``--loops``, ``mechanism`` is called instead, with the mechanism and what it takes of all
    that was typed.
    """

    def decorate(function: Callable[..., Any]) -> GroupedCommand:
        def run(loops: Path | None = None, no_loops: bool = False, **typed: Any) -> Any:
            if mechanism is not None and (file := _loops_of(loops, no_loops, typed)) is not None:
                return _made_of(mechanism, file, typed)
            for value in typed.values():
                OutputError.refuse_if(
                    isinstance(value, Path) and _is_robot(value, typed.get("robot")),
                    f"cannot write {value}: it is the robot itself",
                )
            return _called(function, typed)

        params = [*(_LOOPS if mechanism else ()), *_asked(function, needs_output)]
        run.__doc__ = function.__doc__
        return click.command(name, cls=GroupedCommand, params=params)(run)

    return decorate


def _is_robot(path: Path, robot: str | None) -> bool:
    try:
        return robot is not None and path.exists() and path.samefile(robot)
    except (OSError, ValueError):  # a name, not a file
        return False


def _loops_of(loops: Path | None, no_loops: bool, typed: dict[str, Any]) -> Path | None:
    """The loop file that was typed, or that is beside the robot where a mechanism may be meant."""
    if loops == Path():
        return loops_beside(typed["robot"])
    if loops is None and not no_loops and not _given(_CHAIN):
        loops = loops_at_hand(typed["robot"])
        if loops is not None:
            say(f"note: closed loops are those of {loops}; --no-loops takes a serial chain")
    return loops


def values_named(found: click.Command | None, words: list[str]) -> list[str]:
    """Put ``--q`` before joint values that follow the robot without it: ``at ur5 0 -80 60``."""
    options = [p for p in found.params if isinstance(p, click.Option)] if found else []
    if not any("--q" in p.opts for p in options) or any(w.startswith("--q") for w in words):
        return words
    flags = {name for p in options if p.is_flag for name in (*p.opts, *p.secondary_opts)}
    for k, (before, word) in enumerate(itertools.pairwise(words), 1):
        if (before in flags or not before.startswith("-")) and _vector(word):
            return [*words[:k], "--q", *words[k:]]
    return words


def _joined(args: list[str]) -> list[str]:
    """Numbers after ``--q`` that stand apart as one word."""
    out: list[str] = []
    taking = False
    for word in args:
        if taking and _NUMBER.fullmatch(word) and _vector(out[-1]):
            out[-1] += f",{word}"
        else:
            out.append(word)
            taking = len(out) > 1 and out[-2] in _VECTORS
    return out


def _vector(word: str) -> bool:
    return all(_NUMBER.fullmatch(part) for part in word.split(","))
