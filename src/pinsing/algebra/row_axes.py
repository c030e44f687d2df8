"""The axes that task rows are written in: of the base, of the tip, or any, where that is no matter.

Three translations, or three rotations, span the same in any axes. Fewer do not: but where they
stay the same set under turns about the axis of the first joint (in base axes) or of the last (in
the tip's), the turn of that joint drops out.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from pinsing.robot.exact_placements import Matrix as Rotation
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import Exact
from pinsing.robot.task import Task


def in_axes(task: Task, at_tip: bool) -> tuple[int, ...]:
    """Rows whose set depends on axes, of those in base axes or those in the tip's."""
    return tuple(
        r
        for r, tip in zip(task.rows, task.tip_rows, strict=True)
        if tip is at_tip and not set(range(r - r % 3, r - r % 3 + 3)) <= set(task.rows)
    )


def round_about(rows: Sequence[int]) -> tuple[int, ...]:
    """Axes, out of 0, 1, 2, under turns about which a set of rows stays the same."""
    return tuple(k for k in range(3) if all(_closed(rows, first, k) for first in (0, 3)))


def _closed(rows: Sequence[int], first: int, axis: int) -> bool:
    others = {first, first + 1, first + 2} - {first + axis}
    return others <= set(rows) or not others & set(rows)


def turns_with_first(geometry: Nominal, task: Task) -> bool:
    """Whether the first joint's turn leaves the rows in base axes the same set."""
    return any(
        _along_z(geometry.rotation[0], k, row=True) for k in round_about(in_axes(task, False))
    )


def tip_axes(geometry: Nominal, task: Task) -> tuple[Rotation, bool]:
    """Rotation of the tip's axes behind the last joint, and whether its turn is no matter.

    Where only the direction of one axis counts, and it is the joint's, the others are as simple
    as can be.
    """
    rotation = geometry.tip_rotation
    for k in round_about(in_axes(task, True)):
        sign = _along_z(rotation, k, row=False)
        if sign:
            return _simple(k, sign), True
    return rotation, False


def _along_z(rotation: Rotation, k: int, row: bool) -> int:
    """1 or -1 if axis k of the rotation's outer (or inner) frame is the joint's, else 0."""
    line: list[Exact] = [rotation[k][i] if row else rotation[i][k] for i in range(3)]
    if line[0] != 0 or line[1] != 0:
        return 0
    return 1 if line[2] == 1 else -1


def _simple(k: int, sign: int) -> Rotation:
    """A rotation whose column k is z, or minus z."""
    one, zero = Fraction(1), Fraction(0)
    columns: list[list[Exact]] = [[zero] * 3 for _ in range(3)]
    columns[k] = [zero, zero, one * sign]
    columns[(k + 1) % 3] = [one, zero, zero]
    columns[(k + 2) % 3] = [zero, one * sign, zero]
    rows = [tuple(c[i] for c in columns) for i in range(3)]
    return rows[0], rows[1], rows[2]  # type: ignore[return-value]
