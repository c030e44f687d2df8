"""Which lines of the readers an input reaches: the feedback that tells inputs worth going on from.

Python's trace function marks lines in memory that forked processes share, so that what a child
process reaches (xacro, meshes) counts too. A function whose lines are all marked is left alone.
"""

from __future__ import annotations

import mmap
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

# Below src/pinsing; what reads files, messages and data of strangers.
_READERS = (
    "description", "proof/checker.py", "sampling", "interface.py", "chunk_file.py",
    "proximity/trajectory_file.py", "robot/load.py", "robot/mechanism.py",
    "view/meshes.py", "view/mesh_worker.py",
)  # fmt: skip


def readers() -> list[Path]:
    """Files whose lines are watched: pinsing's readers, and xacro itself."""
    import xacro

    import pinsing

    root = Path(pinsing.__file__).parent
    found = [root / name for name in _READERS]
    found += [Path(xacro.__file__), Path(xacro.__file__).with_name("substitution_args.py")]
    files = [f for p in found for f in (sorted(p.glob("*.py")) if p.is_dir() else [p])]
    missing = [str(f) for f in files if not f.is_file()]
    if missing:
        raise FileNotFoundError(f"no such modules: {', '.join(missing)}")
    return files


class Lines:
    """Lines of some files that were reached, from `watch` on."""

    def __init__(self, files: Iterable[Path]) -> None:
        self._names: list[str] = []
        self._base: dict[str, int] = {}
        size = 0
        for file in files:
            source = file.read_text(encoding="utf-8")
            self._base[str(file)] = size
            count = source.count("\n") + 2
            self._names += [f"{file.parent.name}/{file.name}:{i}" for i in range(count)]
            size += count
        self._marks = mmap.mmap(-1, max(size, 1))
        self._known = bytes(self._marks)
        self._whole: set[CodeType] = set()
        self._marking = {base: self._marker(base) for base in self._base.values()}

    def watch(self) -> None:
        """Begin, in this thread and in the processes that it forks."""
        sys.settrace(self._called)

    def fresh(self) -> list[str]:
        """Lines (folder/file:line) that were reached for the first time since the last call."""
        now = bytes(self._marks)
        if now == self._known:
            return []
        found = [self._names[i] for i, (a, b) in enumerate(zip(now, self._known)) if a != b]  # noqa: B905
        self._known = now
        return found

    def _called(self, frame: FrameType, _event: str, _details: Any) -> Any:
        code = frame.f_code
        base = self._base.get(code.co_filename)
        if base is None or code in self._whole:
            return None
        lines = {line for _, _, line in code.co_lines() if line}
        self._marks[base + code.co_firstlineno] = 1
        if all(self._marks[base + line] for line in lines):
            self._whole.add(code)
            return None
        return self._marking[base]

    def _marker(self, base: int) -> Callable[..., Any]:
        marks = self._marks

        def mark(frame: FrameType, event: str, _details: Any) -> Any:
            if event == "line":
                marks[base + frame.f_lineno] = 1
            return mark

        return mark


def executable_lines(files: Iterable[Path]) -> int:
    """How many lines of functions some files have."""
    total = 0
    for file in files:
        todo = [compile(file.read_text(encoding="utf-8"), str(file), "exec")]
        lines: set[int] = set()
        for code in todo:  # grows on the way
            inner = [c for c in code.co_consts if isinstance(c, CodeType)]
            todo += inner
            if code.co_name != "<module>":
                lines |= {line for _, _, line in code.co_lines() if line}
        total += len(lines)
    return total
