"""What a guard is made of, whatever language it is written in."""

from __future__ import annotations

import re
from pathlib import Path

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.prose import visible

PLACE = re.compile("@([a-z_]+)@")
"""Where something is put into a template."""

COMBINED = 12
"""Equations of a branch that are combined into one bound."""


@dataclass(frozen=True, eq=False)
class GuardSource:
    """What goes into the file.

    Attributes
    ----------
    prefix : str
        What names begin with.
    robot, task : str
        In words.
    length_scale : float
        Metres.
    version, robot_hash : str
        Of pinsing, and of the numbers of the arm.
    tolerance : float
        Radians: the most that an angle of the description was moved by.
    change : float
        The most that this changes a column of the Jacobian by.
    joints : tuple of str
        Base to tip.
    lower, upper : (n,) arrays
        Limits, infinite where there are none.
    families : tuple of (str, str)
        Name and text of each.
    conditions : Conditions
        Of these families.
    complete : bool
        Whether nothing is known to be missing.
    word : str
        How sure that is: "proven", "probable" or "not complete".
    notes : tuple of str
        What one should know.
    """

    prefix: str
    robot: str
    task: str
    length_scale: float
    version: str
    robot_hash: str
    tolerance: float
    change: float
    joints: tuple[str, ...]
    lower: Array
    upper: Array
    families: tuple[tuple[str, str], ...]
    conditions: Conditions
    complete: bool
    word: str
    notes: tuple[str, ...]


def template(name: str) -> str:
    """The part of the file that is the same for all robots."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="ascii")


def plain(text: str) -> str:
    """A text in ASCII, on one line."""
    readable = text.replace("°", " deg").replace("±", "+-").replace("π", "pi")
    return visible(readable).encode("ascii", "backslashreplace").decode("ascii")
