"""Poses of the output as a table for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pinsing.mechanism.pose import Pose

_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
_ROUND = 5e-10


def pose_table(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool = False,
    width: int = 100,
) -> list[str]:
    """Lines of a table with a number, the coordinates that are not zero throughout, and more.

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
    """
    for digits in (5, 4, 3):
        lines = _lines(poses, more, titles, degrees, digits)
        if max(map(len, lines), default=0) <= width:
            # Spaces that do not break keep a row on its line.
            return [line.replace(" ", "\u00a0") for line in lines]
    return lines


def _lines(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool,
    digits: int,
) -> list[str]:
    if not poses:
        return []
    values = [(*p.position, *p.angles) for p in poses]
    shown = [k for k in range(6) if any(abs(v[k]) > _ROUND for v in values)] or [0, 1, 2]
    unit = 180 / math.pi if degrees else 1.0
    rows = [["", *(_NAMES[k] for k in shown), *titles]]
    for i, (row, extra) in enumerate(zip(values, more, strict=True), 1):
        cells = [row[k] * (unit if k > 2 else 1.0) for k in shown]
        rows.append([str(i), *(_number(v, digits) for v in cells), *extra])
    count = len(shown) + 1
    widths = [max(len(r[c]) for r in rows) for c in range(len(rows[0]))]
    lines = []
    for r in rows:
        cells_ = [r[c].rjust(widths[c]) if c <= count else r[c] for c in range(len(r))]
        lines.append("  ".join(cells_).rstrip())
    return lines


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
