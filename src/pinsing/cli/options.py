"""Options that commands share, in groups, and the numbers that people type."""

from __future__ import annotations

import functools
import itertools
import math
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pinsing.atomic_write import check_writable
from pinsing.cli import completion
from pinsing.cli.output import STDOUT, F, in_radians, read_json, say
from pinsing.errors import ConfigurationError, OptionError, OutputError, PinsingError, ResultError

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


@dataclass(frozen=True)
class RobotRequest:
    """Which arm the user means: the options of the same names."""

    robot: str
    tip: str | None
    base: str | None
    joints: tuple[str, ...] | None
    task: str
    length_scale: float
    packages: dict[str, str]
    xacro_args: dict[str, str]
    tool_axis: str | None = None
    design: str | None = None
    calibration: str | None = None

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


def _same_file(path: Path, robot: str) -> bool:
    try:
        return path.exists() and path.samefile(robot)
    except (OSError, ValueError):  # a name, not a file
        return False


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


def arm_options(command: F) -> F:
    """Add the ROBOT argument and the options that choose an arm; pass them as a RobotRequest."""

    @click.argument("robot", shell_complete=completion.robots)
    @click.option(
        "--tip",
        metavar="FRAME",
        shell_complete=completion.frames,
        help="Frame whose motion counts: the end effector.",
    )
    @click.option(
        "--base",
        metavar="FRAME",
        shell_complete=completion.frames,
        help="Frame that the chain starts from.",
    )
    @click.option(
        "--joints",
        type=NAMES,
        shell_complete=completion.joints,
        help="Joints to keep free; the others are locked.",
    )
    @click.option(
        "--task",
        default="pose",
        show_default=True,
        shell_complete=completion.tasks,
        help="pose, position, orientation, tool-axis, or rows such as vx,vy,wz or vx@tip,wy@tip.",
    )
    @click.option(
        "--tool-axis",
        type=click.Choice(["x", "y", "z"]),
        help="Axis of the tip that is free to rotate: task tool-axis (drilling, welding).  "
        "[default: z]",
    )
    @click.option(
        "--length-scale",
        type=float,
        default=1.0,
        show_default=True,
        metavar="METRES",
        help="Translations are divided by it before singular values are taken.",
    )
    @click.option(
        "--package",
        "packages",
        type=_pair("=", "NAME=DIR"),
        multiple=True,
        callback=_dict,
        help="Folder of a ROS package; repeatable.",
    )
    @click.option(
        "--xacro-arg",
        "xacro_args",
        type=_pair(":=", "K:=V"),
        multiple=True,
        callback=_dict,
        help="Argument of a xacro file; repeatable.",
    )
    @click.option(
        "--design",
        metavar="auto|none|ROBOT",
        shell_complete=completion.robots,
        help="What ROBOT is an imperfect copy of: families are of the design, distances of ROBOT; "
        "none: all is of the numbers of the file.",
    )
    @click.option(
        "--calibration",
        metavar="FILE.yaml",
        help="Calibration of a UR robot, as ur_calibration writes it; ROBOT is its design.",
    )
    @functools.wraps(command)
    def wrapper(**options: Any) -> Any:
        asked = {f.name: options.pop(f.name) for f in fields(RobotRequest) if f.name in options}
        for value in options.values():
            OutputError.refuse_if(
                isinstance(value, Path) and _same_file(value, asked["robot"]),
                f"cannot write {value}: it is the robot itself",
            )
        source = click.get_current_context().get_parameter_source
        if asked["tool_axis"] is not None and source("task") is ParameterSource.DEFAULT:
            asked["task"] = "tool-axis"
        return command(RobotRequest(**asked), **options)

    return wrapper  # type: ignore[return-value]


deg_option = click.option(
    "--deg/--rad",
    is_eager=True,  # it says what the numbers of other options are
    help="Angles in degrees, typed and printed; or in radians, even where they only make sense in "
    "degrees.",
)


def in_degrees(deg: bool) -> bool:
    """Return True if angles are printed in degrees: unless ``--rad`` was typed."""
    return deg or not in_radians()


_STDOUT_TOO = ("json_target", "csv", "c", "python", "urdf")
"""Arguments of commands that are text, which may go to stdout."""


class _OutputOption(click.Option):
    """``-o``; ``kinds`` is the argument of the command for each ending."""

    def __init__(self, *names: Any, kinds: dict[str, str], **more: Any) -> None:
        super().__init__(*names, **more)
        self.kinds = kinds


def output_option(required: bool = False, **endings: str) -> Callable[[F], F]:
    """Add ``-o FILE``, repeatable; the ending tells which argument of the command gets the file."""
    # As ``html=".html", plot=".png .svg"``; ``out="/"`` takes a folder. Each file is checked first.
    kinds = {ending: name for name, listed in endings.items() for ending in listed.split()}
    texts = [ending for ending, name in kinds.items() if name in _STDOUT_TOO]
    shown = ", ".join("a folder" if ending == "/" else ending for ending in kinds)

    def argument(value: str) -> str:
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
            raise OptionError(f"-o {value}: the name says what to write, by its ending: {shown}")
        return found

    def sort(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> None:
        files: dict[str, str | Path | None] = dict.fromkeys(endings)
        for value in values:
            name = argument(value)
            OptionError.refuse_if(
                files[name] is not None,
                f"-o {files[name]} and -o {value} are files of one kind: give one of them",
            )
            if value in (STDOUT, *(STDOUT + end for end in texts)):
                files[name] = STDOUT
            else:
                files[name] = Path(value) if kinds.get("/") == name else check_writable(value)
        ctx.params.update(files)

    dash = f"; -{texts[0] if texts[1:] else ''} for {texts[0]} on stdout" if texts else ""
    return click.option(
        "-o",
        "--output",
        cls=_OutputOption,
        kinds=kinds,
        multiple=True,
        required=required,
        expose_value=False,
        callback=sort,
        metavar="FILE",
        shell_complete=completion.files,
        help=f"Write a file, by its ending: {shown}{dash}. Repeatable.",
    )


json_option = output_option(json_target=".json")

verbose_option = click.option(
    "-v", "--verbose", is_flag=True, help="Print the evidence too: equations, proofs, motions lost."
)

fail_option = click.option(
    "--fail-if-singular", is_flag=True, help="Exit with code 1 if a singularity is found."
)


def tip_speed_options(command: F) -> F:
    """Add ``--tip-speed`` and ``--turn-speed``; without them the arguments are the defaults."""
    shown: dict[str, Any] = {"type": float, "show_default": True}
    turn = click.option(
        "--turn-speed", default=0.5, metavar="RAD/S", help="At the same time, in any.", **shown
    )
    tip = click.option(
        "--tip-speed", default=0.25, metavar="M/S", help="Tip speed in any direction.", **shown
    )
    return tip(turn(command))


joint_speeds_option = click.option(
    "--joint-speeds",
    metavar="S1,S2,...",
    help="Speed limits of the joints, m/s and rad/s, with --deg deg/s.  [default: those of the "
    "file]",
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

    try:
        return Zones.from_dict(read_json(file))
    except ResultError as error:
        raise ResultError(f"{file}: {error}") from None


zones_option = click.option(
    "--zones",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.json",
    callback=_read_zones,
    help="With the zones that `pinsing zones ROBOT -o FILE.json` wrote.",
)
"""Adds ``--zones``; the command gets the `Zones` of the file, or None."""


def follow_option(what: str) -> Callable[[F], F]:
    """Add ``--follow STREAM``: configurations of a running robot."""
    return click.option(
        "--follow",
        type=click.Path(exists=True, dir_okay=False, path_type=Path, allow_dash=True),
        metavar="STREAM",
        help=f"{what}: - for standard input, or a pipe; JSON by joint name or CSV with a head.",
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
                p.opts[0] in ("--q", "--to")
                and not (p.multiple or ctx.resilient_parsing)
                and times > 1,
                f"{p.opts[0]} was given {times} times; {ctx.info_name} takes one",
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


def command(name: str) -> Callable[[Callable[..., Any]], GroupedCommand]:
    """As `click.command`, of a `GroupedCommand`."""
    return click.command(name, cls=GroupedCommand)


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
