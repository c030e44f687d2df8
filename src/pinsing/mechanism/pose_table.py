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
    """
    if not poses:
        return []
    values = [(*p.position, *p.angles) for p in poses]
    shown = [k for k in range(6) if any(abs(v[k]) > _ROUND for v in values)] or [0, 1, 2]
    unit = 180 / math.pi if degrees else 1.0
    rows = [["", *(_NAMES[k] for k in shown), *titles]]
    for i, (row, extra) in enumerate(zip(values, more, strict=True), 1):
        cells = [row[k] * (unit if k > 2 else 1.0) for k in shown]
        rows.append([str(i), *(_number(v) for v in cells), *extra])
    count = len(shown) + 1
    widths = [max(len(r[c]) for r in rows) for c in range(len(rows[0]))]
    lines = []
    for r in rows:
        cells_ = [r[c].rjust(widths[c]) if c <= count else r[c] for c in range(len(r))]
        # A space that does not break keeps a row on its line.
        lines.append("  ".join(cells_).rstrip().replace(" ", "\u00a0"))
    return lines


def _number(value: float) -> str:
    return f"{0.0 if abs(value) <= _ROUND else value:.5f}"
