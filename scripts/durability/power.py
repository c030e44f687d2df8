"""Loss of power at any moment: what was not flushed to the disk may be there or not.

From the operations of an undisturbed run the states are made that a file system may come up
with: of a file that was not flushed, nothing, a part, or zeros of the right length; of a folder
that was not flushed, any of its new names, whatever their order was. The run goes on from there.
"""

from __future__ import annotations

import random
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from durability.commands import COMMANDS
from durability.disk import Disk, Operation
from durability.failures import _contents, call

RUNS = ("map FOLDER", "sweep FOLDER")


@dataclass
class _File:
    data: bytes = b""
    flushed: bytes = b""


class _System:
    """Files as they are now, and what of that is on the disk for sure."""

    def __init__(self) -> None:
        self.now: dict[str, _File | None] = {".": None}  # None stands for a folder
        self.sure: dict[str, _File | None] = {".": None}
        self.pending: list[tuple[str, str, _File | None]] = []  # folder, name, what it is now

    def run(self, operation: Operation, flushing: bool = True) -> None:
        """Take one operation; without ``flushing`` as if nothing were ever flushed."""
        name, path = operation.name, operation.path
        file = self.now.get(path)
        if name == "mkdir" or (name == "open" and path not in self.now):
            self._set(path, None if name == "mkdir" else _File())
        elif name == "write" and file is not None:
            file.data += operation.data
        elif name == "fsync" and flushing and file is not None:
            file.flushed = file.data
        elif name == "fsync" and flushing:
            for folder, entry, what in self.pending:
                if folder == path:
                    _put(self.sure, entry, what)
            self.pending = [p for p in self.pending if p[0] != path]
        elif name == "replace":
            self._remove(path)
            self._set(operation.to, file)
        elif name == "unlink":
            self._remove(path)

    def after_cut(self, rng: random.Random) -> dict[str, bytes | None]:
        """A state that the disk may be in; folders are None."""
        found = dict(self.sure)
        for _, entry, what in self.pending:
            if rng.random() < 0.5:
                _put(found, entry, what)
        state: dict[str, bytes | None] = {}
        for path, file in sorted(found.items()):
            parents = [str(p) for p in Path(path).parents if str(p) != "."]
            if path != "." and all(p in found and found[p] is None for p in parents):
                state[path] = None if file is None else _survives(file, rng)
        return state

    def _set(self, path: str, what: _File | None) -> None:
        self.now[path] = what
        self.pending.append((str(Path(path).parent), path, what))

    def _remove(self, path: str) -> None:
        self.now.pop(path, None)
        self.pending.append((str(Path(path).parent), path, _GONE))


_GONE = _File()


def _put(names: dict[str, _File | None], path: str, what: _File | None) -> None:
    if what is _GONE:
        names.pop(path, None)
    else:
        names[path] = what


def _survives(file: _File, rng: random.Random) -> bytes:
    if file.flushed == file.data:
        return file.data
    part = file.data[: rng.randrange(len(file.data) + 1)]
    return rng.choice([file.flushed, part, bytes(len(file.data)), b""])


def cuts(
    command: str, count: int, seed: int, folder: Path, flushing: bool = True
) -> tuple[dict[str, Any], list[str]]:
    """Cut the power so often during one run; how often it went on, and what went wrong.

    Without ``flushing`` the disk ignores what it is told to flush: that must be noticed.
    """
    place = folder / "disk"
    words = COMMANDS[command].placed(place)
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    disk = Disk(place)
    with disk.watched():
        code, err = call(words)
    if code:
        raise RuntimeError(f"{command} fails by itself: {err}")
    expected = _contents(place)
    rng = random.Random(f"{command} {seed}")
    row = {"command": command, "operations": len(disk.log), "cuts": count, "good": 0, "damaged": 0}
    wrong = []
    for _ in range(count):
        system = _System()
        at = rng.randrange(len(disk.log) + 1)
        for operation in disk.log[:at]:
            system.run(operation, flushing)
        state = system.after_cut(rng)
        shutil.rmtree(place)
        place.mkdir()
        for path, data in state.items():
            if data is None:
                (place / path).mkdir()
            else:
                (place / path).write_bytes(data)
        code, err = call(words)
        row["damaged"] += "damaged and done again" in err
        if code == 0 and _contents(place) == expected:
            row["good"] += 1
        else:
            wrong.append(f"{command}, cut after {at} operations: exit code {code}, {err[-300:]!r}")
    return row, wrong
