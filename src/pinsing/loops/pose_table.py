"""Poses of the output as a table for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pinsing._dataclass import dataclass
from pinsing.loops.pose import Pose

_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
_ROUND = 5e-10
_SAME = 1e-7


@dataclass(frozen=True)
class Column:
    """Numbers of a table, one for each row: metres, or radians where it ``turns``."""

    title: str
    values: Sequence[float]
    turns: bool

    def shown(self, degrees: bool) -> list[float]:
        """As they are printed."""
        unit = 180 / math.pi if degrees and self.turns else 1.0
        return [unit * v for v in self.values]


def pose_table(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool = False,
    width: int = 100,
    columns: Sequence[Column] = (),
) -> list[str]:
    """Lines of a table with a number, the coordinates that are not zero throughout, and more.

    Where it would be wider than ``width`` with columns of numbers, coordinates that are the same
    in all rows are in a line above it.

    Parameters
    ----------
    poses : sequence of Pose
        One a row; metres, and radians or degrees.
    more : sequence of sequence of str
        Further cells of each row.
    titles : sequence of str
        Their titles.
    degrees : bool
        Angles in degrees.
    width : int
        Columns there are: numbers have fewer digits where they must, and lines that are still
        too long may be broken.
    columns : sequence of Column
        Further numbers of each row, behind the pose.
    """
    if not poses:
        return []
    values = [[*p.position, *(_half_turn(v) for v in p.angles)] for p in poses]
    shown = [k for k in range(6) if any(abs(v[k]) > _ROUND for v in values)] or [0, 1, 2]
    pose = [Column(_NAMES[k], [v[k] for v in values], k > 2) for k in shown]
    changing = [c for c in pose if max(c.values) - min(c.values) > _SAME]
    alike = [c for c in pose if c not in changing] if columns and len(poses) > 1 else []
    for left in ([], alike) if alike else ([],):
        head = _said(left, degrees)
        for digits in (5, 4, 3):
            numbers = [*(c for c in pose if c not in left), *columns]
            lines = _lines(numbers, more, titles, degrees, digits)
            if max(map(len, lines)) <= width:
                # Spaces that do not break keep a row on its line.
                return [*head, *(line.replace(" ", "\u00a0") for line in lines)]
    return [*head, *lines]


def _half_turn(angle: float) -> float:
    """An angle, a half turn always the positive one."""
    return math.pi if angle < _ROUND - math.pi else angle


def _said(columns: Sequence[Column], degrees: bool) -> list[str]:
    """One line with what is the same in all rows."""
    if not columns:
        return []
    said = (f"{c.title} = {_number(c.shown(degrees)[0], 5)}" for c in columns)
    return [f"each at {', '.join(said)}"]


def _lines(
    numbers: Sequence[Column],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool,
    digits: int,
) -> list[str]:
    values = zip(*(c.shown(degrees) for c in numbers), strict=True)
    rows = [["", *(c.title for c in numbers), *titles]]
    for i, (row, extra) in enumerate(zip(values, more, strict=True), 1):
        rows.append([str(i), *(_number(v, digits) for v in row), *extra])
    count = len(numbers) + 1
    widths = [max(len(r[c]) for r in rows) for c in range(len(rows[0]))]
    lines = []
    for r in rows:
        cells_ = [r[c].rjust(widths[c]) if c <= count else r[c] for c in range(len(r))]
        lines.append("  ".join(cells_).rstrip())
    return lines


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
