"""Errors that pinsing raises: one base, each kin carrying its data.

Every message is one line that says what is wrong, where, and what to do.
The command line prints it and ends with exit code 2.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

__all__ = [
    "ArgumentError",
    "ChainError",
    "ConfigurationError",
    "EngineError",
    "JointError",
    "OptionError",
    "OutputError",
    "PinsingError",
    "ResultError",
    "RobotFileError",
    "UnknownNameError",
    "WorkerError",
]

_LONGEST_NAME, _LONGEST_PATH, _LONGEST_MESSAGE = 100, 1000, 4000
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_PATH},}}")


def _cut(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else name[: _LONGEST_NAME - 3] + "..."


def shown_path(path: object) -> str:
    """A path within one line of a terminal: its end, if it is longer than any that exist."""
    path = str(path)
    path = path if len(path) <= _LONGEST_PATH else "..." + path[-_LONGEST_NAME:]
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in path)


def why(error: Exception) -> str:
    """Return what the system says of a failure, without numbers and paths."""
    if isinstance(error, UnicodeEncodeError):
        return "the name holds half a character"
    return str(getattr(error, "strerror", None) or error)


def _one_line(message: str) -> str:
    """A message in one line that any terminal and file can hold, whatever a parser had to say."""
    if len(message) > _LONGEST_PATH:
        message = _LONG_WORD.sub(lambda word: "..." + word[0][-_LONGEST_NAME:], message)
    if len(message) > _LONGEST_MESSAGE:
        message = message[: _LONGEST_MESSAGE - _LONGEST_NAME] + "..." + message[-_LONGEST_NAME:]
    if message.isprintable():
        return message
    line = " ".join(part.strip() for part in message.splitlines() if part.strip())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


class Refusal(Exception):
    """An error that is raised in one line, where something is wrong."""

    @classmethod
    def refuse_if(cls, wrong: object, *problem: Any, **data: Any) -> None:
        """Raise the error that says what the problem is, if something is wrong.

        Parameters
        ----------
        wrong : object
            Anything that counts as true where there is something wrong.
        problem : tuple
            What the class takes.
        data : dict
            What the class takes by name.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.errors.OptionError.refuse_if(4 > 3, "four are too many")
        Traceback (most recent call last):
        pinsing.errors.OptionError: four are too many
        """
        if wrong:
            raise cls(*problem, **data)


class PinsingError(Refusal):
    """Base of every error that pinsing raises on purpose; its message is one line."""

    def __init__(self, message: str = "") -> None:
        super().__init__(_one_line(message))

    def __reduce__(self) -> tuple[Any, ...]:
        # With message and data, whatever the constructor takes: workers send errors home.
        return _restore, (type(self), self.args, self.__dict__)


def _restore(kind: type[PinsingError], args: tuple[Any, ...], data: dict[str, Any]) -> PinsingError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(data)
    return error


class RobotFileError(PinsingError, ValueError):
    """A robot description (URDF, xacro, DH table, loop file) that cannot be used.

    Attributes
    ----------
    path : Path or None
        The file, where there is one.
    line : int or None
        Line of the file, counted from 1, where it is known.
    """

    def __init__(
        self, problem: str, path: str | Path | None = None, line: int | None = None
    ) -> None:
        self.path = None if path is None else Path(path)
        self.line = line
        place = "" if path is None else shown_path(path)
        where = "" if path is None else f"{place}:{line}: " if line is not None else f"{place}: "
        super().__init__(where + problem)


class UnknownNameError(PinsingError, LookupError):
    """A robot, joint, frame or option name that does not exist.

    Attributes
    ----------
    kind : str
        What was looked for: "robot", "joint", "frame", ...
    name : str
        The name as given.
    known : tuple of str
        All the names that exist.
    close : tuple of str
        Those of them that resemble the given one, or may be meant by it.
    """

    def __init__(
        self,
        kind: str,
        name: str,
        known: Iterable[str],
        hint: str = "",
        *,
        meant: Iterable[str] = (),
        families: str = "",
    ) -> None:
        self.kind, self.name, self.known = kind, name, tuple(known)
        # Nothing of that length was mistyped, and comparing it takes minutes.
        alike = [k for k in self.known if len(k) <= _LONGEST_NAME]
        near = difflib.get_close_matches(name[:_LONGEST_NAME], alike, n=4, cutoff=0.5)
        self.close = tuple(dict.fromkeys((*meant, *near)))[:4]
        if self.close:
            help_ = "did you mean " + " or ".join(repr(c) for c in self.close) + "?"
        elif len(self.known) <= 12:
            help_ = "known: " + (", ".join(_cut(k) for k in self.known) or "none")
        else:
            help_ = f"{len(self.known)} names are known" + (
                f", such as {families}" if families else ""
            )
        super().__init__(f"unknown {kind} {_cut(name)!r}: {help_}" + (f" ({hint})" if hint else ""))


class ChainError(PinsingError, ValueError):
    """No serial chain can be taken as asked (no joint, several arms, joints not on one path).

    Attributes
    ----------
    tips : tuple of str
        Where several chains could be the arm: the tip of each, as ``load`` takes it.
    lengths : tuple of int
        The number of joints of each of these chains.
    joint : str or None
        The joint that is not on the chain, or is named twice, where it is one.
    joints : tuple of str
        The joints of the chain, where one was asked for that is not among them.
    base, tip : str or None
        The frames between which there is no chain, where they are the reason.
    chains : tuple of Subchain
        Where several could be the arm: all chains of the robot, with their joints.
    """

    def __init__(
        self,
        message: str,
        *,
        tips: tuple[str, ...] = (),
        lengths: tuple[int, ...] = (),
        joint: str | None = None,
        joints: tuple[str, ...] = (),
        base: str | None = None,
        tip: str | None = None,
        chains: tuple[Any, ...] = (),
    ) -> None:
        self.tips, self.lengths, self.chains = tips, lengths, chains
        self.joint, self.joints, self.base, self.tip = joint, joints, base, tip
        super().__init__(message)


class JointError(PinsingError, ValueError):
    """A joint of a kind, with limits, or in a place that pinsing cannot analyse.

    Attributes
    ----------
    joint : str
        Name of the joint.
    value : float or None
        The value at fault, radians or metres, where it is one.
    limits : (float, float) or None
        Its limits, where they matter.
    """

    def __init__(
        self,
        joint: str,
        problem: str,
        *,
        value: float | None = None,
        limits: tuple[float, float] | None = None,
    ) -> None:
        self.joint, self.value, self.limits = joint, value, limits
        super().__init__(f"joint {joint!r}: {problem}")


class ConfigurationError(PinsingError, ValueError):
    """A joint vector of the wrong length, not finite, or outside the limits.

    Attributes
    ----------
    joint : str or None
        The joint at fault, where it is one.
    value : float or None
        Its value, radians or metres.
    limits : (float, float) or None
        What it should lie between.
    lengths : tuple of int
        The lengths that would do, where the length is wrong.
    """

    def __init__(
        self,
        problem: str,
        *,
        joint: str | None = None,
        value: float | None = None,
        limits: tuple[float, float] | None = None,
        lengths: tuple[int, ...] = (),
    ) -> None:
        self.joint, self.value, self.limits, self.lengths = joint, value, limits, lengths
        super().__init__(problem)


class OptionError(PinsingError, ValueError):
    """An argument whose value makes no sense (task, length scale, tolerance, levels, ...)."""


class ArgumentError(OptionError, TypeError):
    """An argument of the wrong type: a name where a loaded arm belongs, text for a number, ...

    Attributes
    ----------
    argument : str
        Name of the argument.
    expected : str
        What belongs there.
    """

    def __init__(self, argument: str, expected: str, got: str, hint: str = "") -> None:
        self.argument, self.expected = argument, expected
        super().__init__(
            f"{argument} must be {expected}, got {got}" + (f": {hint}" if hint else "")
        )


class ResultError(PinsingError, ValueError):
    """A saved result that is damaged, or of another kind or version."""


class OutputError(PinsingError, OSError):
    """A result that cannot be written where it was asked for."""


class EngineError(PinsingError, RuntimeError):
    """A batch engine that is not available or that disagrees with Pinocchio."""


class WorkerError(PinsingError, RuntimeError):
    """A process or machine of a run in chunks that died, failed, or cannot be reached."""
