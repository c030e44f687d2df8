"""The loop file of a robot, where it lies beside the robot's own."""

from __future__ import annotations

import shlex
from pathlib import Path

from pinsing.cli.output import say
from pinsing.errors import OptionError, PinsingError


def _loop_file(robot: str) -> Path:
    """``NAME.loops.yaml`` beside the file of a robot, whether it exists or not."""
    from pinsing.description.catalog import locate_robot

    found = locate_robot(robot)
    return _beside(found if isinstance(found, Path) else found.path)


def loops_beside(robot: str) -> Path:
    """The loop file that ``--loops`` alone means."""
    path = None if robot.lstrip().startswith("<") else _loop_file(robot)
    if path is None or not path.is_file():
        where = "" if path is None else f": there is no {path}"
        raise OptionError(f"--loops needs the name of a loop file{where}; give --loops FILE.yaml")
    return path


def tell_of_loops(robot: str) -> None:
    """Say that a robot that is taken as an arm has closed loops, which are left out."""
    path = loops_at_hand(robot)
    if path is not None:
        say(
            f"note: {robot} has closed loops, in {path}: they are left out and a serial chain is "
            f"taken. With them: pinsing analyze {shlex.quote(robot)}"
        )


def loops_at_hand(robot: str) -> Path | None:
    """Return the loop file of a robot's file, or of a name of our own; None if there is none.

    Every command of an arm asks for it, and no other package has loop files: so names are not
    looked up in all of them, which takes 20 ms.
    """
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
