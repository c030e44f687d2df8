"""Tasks: which rows of the 6-row frame Jacobian the arm has to serve, and in whose axes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pinsing.errors import OptionError

ROW_NAMES = ("vx", "vy", "vz", "wx", "wy", "wz")
AT_TIP = "@tip"
TOOL_AXIS = "tool-axis"
TOOL_AXES = ("x", "y", "z")
POSITION, _ORIENTATION = tuple(range(3)), tuple(range(3, 6))
POSE = POSITION + _ORIENTATION
_NAMED = {"pose": POSE, "position": POSITION, "orientation": _ORIENTATION}


@dataclass(frozen=True)
class Task:
    """Rows of the frame Jacobian at the tip, each in base axes or in the tip's own.

    Attributes
    ----------
    name : str
        ``pose``, ``position``, ``orientation``, ``tool-axis``, ``tool-axis-x``, ``tool-axis-y``,
        or the row names joined by commas.
    rows : tuple of int
        Indices into (vx, vy, vz, wx, wy, wz), ascending.
    at_tip : tuple of bool
        For each row whether it is along the tip's axes (base axes, LOCAL_WORLD_ALIGNED, where
        not); empty if none is. All of vx, vy, vz, or of wx, wy, wz, say the same in both: they
        go with the other rows.
    """

    name: str
    rows: tuple[int, ...]
    at_tip: tuple[bool, ...] = ()

    @property
    def translation(self) -> tuple[int, ...]:
        """Positions, within the task, of the rows that are translations."""
        return tuple(i for i, r in enumerate(self.rows) if r < 3)

    @property
    def tip_rows(self) -> tuple[bool, ...]:
        """For each row whether it is along the tip's axes."""
        return self.at_tip or (False,) * len(self.rows)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the rows, e.g. ``("vx", "vy", "wz")`` or ``("vz", "wx@tip")``."""
        return tuple(_row_name(r, tip, self.rows) for r, tip in self._marked)

    @property
    def tool_axis(self) -> int | None:
        """Free rotation axis of the tip: 0, 1 or 2 with two rotations at the tip, or None."""
        free = [r for r in _ORIENTATION if r not in self.rows]
        turns = [tip for r, tip in self._marked if r >= 3]
        return free[0] - 3 if len(free) == 1 and all(turns) else None

    @property
    def places(self) -> bool:
        """Return True if its rows say where the tip is, so that a pose can be a goal."""
        # Rows in the tip's axes turn with it: of translations all or none must be there, and of
        # rotations all, none, or all but one about an axis of the tip.
        partly = [t for t in (POSITION, _ORIENTATION) if 0 < len(set(t) & set(self.rows)) < 3]
        tip = [r for r, at in self._marked if at and any(r in t for t in partly)]
        return not tip or (self.tool_axis is not None and all(r >= 3 for r in tip))

    @property
    def _marked(self) -> tuple[tuple[int, bool], ...]:
        return tuple(zip(self.rows, self.tip_rows, strict=True))

    def __str__(self) -> str:
        return self.name


def parse_task(task: str | Iterable[str] | Task, tool_axis: str | None = None) -> Task:
    """Return the Task of a name or rows; ``tool_axis``: which of the tip's turns freely."""
    if tool_axis is not None:
        wrong = f"unknown tool axis {tool_axis!r}: use x, y or z"
        OptionError.refuse_if(tool_axis not in TOOL_AXES, wrong)
        name = task.name if isinstance(task, Task) else task
        wrong = f"a tool axis is for task {TOOL_AXIS}, and the task is {task}"
        OptionError.refuse_if(name != TOOL_AXIS, wrong)
        return _tool_axis(tool_axis)
    if isinstance(task, Task):
        return task
    if isinstance(task, str):
        name = task.strip()
        if name in _NAMED:
            return Task(name, _NAMED[name])
        about = {TOOL_AXIS: "z"} | {f"{TOOL_AXIS}-{axis}": axis for axis in TOOL_AXES}
        if name in about:
            return _tool_axis(about[name])
        names = [part.strip() for part in task.split(",")]
    else:
        names = [str(part).strip() for part in task]
    plain = [name.removesuffix(AT_TIP).strip() for name in names]
    OptionError.refuse_if(
        not names or any(name not in ROW_NAMES for name in plain),
        f"unknown task {task!r}: use pose, position, orientation, {TOOL_AXIS}, "
        f"or rows out of {', '.join(ROW_NAMES)}, such as vx,vy,wz, in the tip's axes with "
        f"{AT_TIP}, such as vx{AT_TIP},wy{AT_TIP}",
    )
    OptionError.refuse_if(len(set(plain)) < len(plain), f"task {task!r} names a row twice")
    tip = {ROW_NAMES.index(p): n.endswith(AT_TIP) for n, p in zip(names, plain, strict=True)}
    return _task(tip)


def _tool_axis(axis: str) -> Task:
    free = 3 + TOOL_AXES.index(axis)
    return _task({r: True for r in range(6) if r != free})


def _task(tip: dict[int, bool]) -> Task:
    """Task of the rows that are the keys, at the tip where that is said."""
    rows = tuple(sorted(tip))
    partly = [r for t in (POSITION, _ORIENTATION) if not set(t) <= set(rows) for r in t if r in tip]
    # Three translations, or rotations, serve the same in any axes: in those of the others.
    together = any(tip[r] for r in partly) and all(tip[r] for r in partly)
    flags = tuple(tip[r] if r in partly else together for r in rows)
    at_tip = flags if any(flags) else ()
    plain = {named: name for name, named in _NAMED.items()}
    if rows in plain and not at_tip:
        return Task(plain[rows], rows)
    task = Task("", rows, at_tip)
    if len(rows) == 5 and task.tool_axis is not None:
        axis = TOOL_AXES[task.tool_axis]
        return Task(TOOL_AXIS if axis == "z" else f"{TOOL_AXIS}-{axis}", rows, at_tip)
    return Task(",".join(task.row_names), rows, at_tip)


def _row_name(row: int, at_tip: bool, rows: tuple[int, ...]) -> str:
    whole = set((POSITION, _ORIENTATION)[row // 3]) <= set(rows)
    return ROW_NAMES[row] + (AT_TIP if at_tip and not whole else "")
