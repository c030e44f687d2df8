"""The loop file of a robot, where it lies beside the robot's own."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from pinsing.cli.output import say
from pinsing.errors import OptionError, PinsingError


def _loop_file(robot: str) -> Path:
    """``NAME.loops.yaml`` beside the file of a robot, whether it exists or not."""
    from pinsing.description.catalog import locate_robot

    found = locate_robot(robot)
    path = found if isinstance(found, Path) else found.path
    return path.parent / f"{path.name.partition('.')[0]}.loops.yaml"


def loops_beside(robot: str) -> Path:
    """The loop file that ``--loops`` alone means."""
    path = None if robot.lstrip().startswith("<") else _loop_file(robot)
    if path is None or not path.is_file():
        where = "" if path is None else f": there is no {path}"
        raise OptionError(f"--loops needs the name of a loop file{where}; give --loops FILE.yaml")
    return path


def tell_of_loops(robot: str) -> None:
    """Say that a robot that is taken as an arm has closed loops, which are left out."""
    try:
        path = None if robot.lstrip().startswith("<") else _loop_file(robot)
    except (PinsingError, OSError, ValueError):
        return  # the command says what is wrong
    if path is not None and path.is_file():
        command = click.get_current_context().info_name
        say(
            f"note: {robot} has closed loops, in {path}; without --loops they are left out and a "
            f"serial chain is taken. With them: pinsing {command} {shlex.quote(robot)} --loops"
        )
