"""Tasks: which rows of the 6-row frame Jacobian the arm has to serve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pinsing.errors import OptionError

ROW_NAMES = ("vx", "vy", "vz", "wx", "wy", "wz")
_NAMED = {"pose": (0, 1, 2, 3, 4, 5), "position": (0, 1, 2), "orientation": (3, 4, 5)}


@dataclass(frozen=True)
class Task:
    """Rows of the frame Jacobian (LOCAL_WORLD_ALIGNED at the tip, base axes).

    Attributes
    ----------
    name : str
        ``pose``, ``position``, ``orientation``, or the row names joined by commas.
    rows : tuple of int
        Indices into (vx, vy, vz, wx, wy, wz), ascending.
    """

    name: str
    rows: tuple[int, ...]

    @property
    def translation(self) -> tuple[int, ...]:
        """Positions, within the task, of the rows that are translations."""
        return tuple(i for i, r in enumerate(self.rows) if r < 3)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the rows, e.g. ``("vx", "vy", "wz")``."""
        return tuple(ROW_NAMES[r] for r in self.rows)

    def __str__(self) -> str:
        return self.name


def parse_task(task: str | Iterable[str] | Task) -> Task:
    """Turn ``"pose"``, ``"position"``, ``"orientation"``, ``"vx,vy,wz"`` or names into a Task.

    Raises
    ------
    OptionError
        If a row name is unknown or given twice, or none is given.
    """
    if isinstance(task, Task):
        return task
    if isinstance(task, str):
        if task in _NAMED:
            return Task(task, _NAMED[task])
        names = [part.strip() for part in task.split(",")]
    else:
        names = list(task)
    unknown = [name for name in names if name not in ROW_NAMES]
    if unknown or not names:
        raise OptionError(
            f"unknown task {task!r}: use pose, position, orientation, "
            f"or rows out of {', '.join(ROW_NAMES)}, such as vx,vy,wz"
        )
    if len(set(names)) < len(names):
        raise OptionError(f"task {task!r} names a row twice")
    rows = tuple(sorted(ROW_NAMES.index(name) for name in names))
    for name, named_rows in _NAMED.items():
        if rows == named_rows:
            return Task(name, rows)
    return Task(",".join(ROW_NAMES[r] for r in rows), rows)
