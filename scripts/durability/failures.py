"""Each operation on a file fails in turn, in each command that writes.

Afterwards the old file is whole or the new one is, nothing else lies about, the message is one
line, and the exit code 2. A run in a folder is then gone on with, to identical bytes.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import io
import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from durability.commands import COMMANDS, Command
from durability.disk import Disk, Failure

_OLD = b"what was there before\n"
_SLOW = (
    ("pinsing.view.picture", "_taken"),
    ("pinsing.view.picture", "printed"),
    ("pinsing.report.arm_report", "arm_report"),
)
_ENDS = {
    ".pdf": (b"%PDF", b"%%EOF"),
    ".png": (b"\x89PNG", b"IEND\xaeB`\x82"),
    ".svg": (b"<?xml", b"</svg>"),
}
"""How whole files of a kind begin and end."""
_PACKED = re.compile(rb'(type="application/octet-stream">)[^<]*')
"""Parts of a page that are packed."""
_ERRORS = {
    # A folder may be written to but not read; then it is not flushed, and all else is well.
    "open of a folder": (errno.EACCES, errno.EIO),
    "fsync of a folder": (errno.EIO,),
    "open": (errno.EACCES, errno.ENOSPC),
    "mkdir": (errno.EACCES, errno.ENOSPC),
    "write": (errno.ENOSPC, errno.EIO),
    "fchmod": (errno.EPERM,),
    "fsync": (errno.EIO, errno.ENOSPC),
    "replace": (errno.EACCES, errno.ENOSPC),
    "unlink": (errno.EACCES,),
}


def call(words: list[str]) -> tuple[int, str]:
    """Run a command line in this process: exit code, and stderr."""
    from pinsing.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as ended:
            return (ended.code if isinstance(ended.code, int) else 0), err.getvalue()
        except Exception as error:
            return 1, f"Traceback: {error!r}"
    return 0, err.getvalue()


@contextlib.contextmanager
def _made_once() -> Iterator[None]:
    """What takes seconds to make, and touches no file of ours, is made once and kept."""
    before = []
    for module, name in _SLOW:
        home = importlib.import_module(module)
        real = getattr(home, name)
        before.append((home, name, real))
        setattr(home, name, _once(real))
    try:
        yield
    finally:
        for home, name, real in before:
            setattr(home, name, real)


def _once(real: Callable[..., Any]) -> Callable[..., Any]:
    made: list[Any] = []

    def call(*args: Any, **kwargs: Any) -> Any:
        if not made:
            made.append(real(*args, **kwargs))
        return made[0]

    return call


def failures(command: str, folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of the table for one command, and what went wrong."""
    with _made_once():
        return _failures(command, folder)


def _failures(command: str, folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    meant = COMMANDS[command]
    place = folder / "disk"
    words = meant.placed(place)
    expected, operations = _undisturbed(words, place, meant)
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    wrong = []
    for at, (kind, said) in enumerate(operations):
        for number in _ERRORS[kind]:
            for half in (False, True) if kind == "write" else (False,):
                disk = Disk(place, Failure(at, number, half))
                _fresh(place, meant)
                with disk.watched():
                    code, err = call(words)
                found = _contents(place)
                new = set(found) == set(expected) and all(
                    _same(path, found[path], expected[path]) for path in expected
                )
                unread = kind == "open of a folder" and number == errno.EACCES
                problems = list(_problems(disk, place, meant, expected, code, err))
                if unread and code == 0:
                    problems = [] if new else ["it says that all is well"]
                if meant.is_run:
                    problems += _resumed(words, place / meant.out, expected)
                label = f"{kind}, half of it written" if half else kind
                key = (label, errno.errorcode[number])
                row = rows.setdefault(
                    key,
                    {"command": command, "operation": key[0], "error": key[1], "cases": 0}
                    | {"good": 0, "new": 0, "exit": []},
                )
                row["cases"] += 1
                row["good"] += not problems
                row["new"] += new
                row["exit"] = sorted({*row["exit"], code})
                wrong += [f"{command}: {said} fails with {key[1]}: {p}" for p in problems]
    return list(rows.values()), wrong


def _undisturbed(
    words: list[str], place: Path, meant: Command
) -> tuple[dict[str, bytes], list[tuple[str, str]]]:
    _fresh(place, meant)
    disk = Disk(place)
    with disk.watched():
        code, err = call(words)
    if code:
        raise RuntimeError(f"{words} fails by itself: {err}")
    named = []
    for o in disk.log:
        folder = o.name in ("open", "fsync") and (place / o.path).is_dir()
        named.append((f"{o.name} of a folder" if folder else o.name, f"{o.name} of {o.path}"))
    return _contents(place), named


def _problems(
    disk: Disk, place: Path, meant: Command, expected: dict[str, bytes], code: int, err: str
) -> Iterator[str]:
    if disk.failed is None:
        yield "nothing failed"
    found = _contents(place)
    litter = sorted(set(found) - set(expected))
    if litter:
        yield f"it leaves {', '.join(litter)}"
    for path, data in found.items():
        if data != _OLD and not _same(path, data, expected.get(path, b"")):
            yield f"{path} is neither old nor new"
    if not meant.is_run and not {meant.out, *meant.beside} <= set(found):
        yield "an old file has gone"
    lines = [x for x in err.splitlines() if x.startswith("pinsing: error: ")]
    other = [x for x in err.splitlines() if not x.startswith("pinsing: ")]
    if code != 2 or len(lines) != 1 or other:
        yield f"exit code {code}: {err[-300:]!r}"


def _resumed(words: list[str], run: Path, expected: dict[str, bytes]) -> list[str]:
    code, err = call(words)
    if code or _contents(run.parent) != expected:
        return [f"it does not go on to the same bytes: exit code {code}, {err[-300:]!r}"]
    return []


def _fresh(place: Path, meant: Command) -> None:
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for name in () if meant.is_run else (meant.out, *meant.beside):
        (place / name).write_bytes(_OLD)


def _contents(place: Path) -> dict[str, bytes]:
    paths = [p for p in place.rglob("*") if p.is_file() and p.name != "lock"]
    return {str(p.relative_to(place)): p.read_bytes() for p in paths}


def _same(path: str, data: bytes, expected: bytes) -> bool:
    """Whether a file is whole; where times and random names are in it, it is not the same twice."""
    if data == expected:
        return True
    kind = Path(path).suffix
    if kind == ".html":
        alike = abs(len(data) - len(expected)) < len(expected) // 20
        # What is packed holds random names of the drawing, and may stand near the end.
        a, b = (_PACKED.sub(rb"\1", text) for text in (data, expected))
        return alike and a[:2000] == b[:2000] and a[-500:] == b[-500:]
    if kind == ".json":
        return _keys(data) == _keys(expected) is not None
    begin, end = _ENDS.get(kind, (b"", b""))
    return bool(begin) and data.startswith(begin) and data.rstrip().endswith(end)


def _keys(data: bytes) -> list[str] | None:
    try:
        return sorted(json.loads(data))
    except ValueError:
        return None
