"""Each operation on a file fails in turn, in each command that writes.

Afterwards the old file is whole or the new one is, nothing else lies about, the message is one
line, and the exit code 2. A run in a folder is then gone on with, to identical bytes.
"""

from __future__ import annotations

import contextlib
import errno
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from durability.disk import Disk, Failure

_OLD = b"what was there before\n"
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

# Command line, the file that it writes, and whether that is a folder of a run.
COMMANDS: dict[str, tuple[tuple[str, ...], str, bool]] = {
    "map --out DIR": (
        ("map", "planar3r", "--count", "9000", "--chunk", "4096", "--threads", "1", "--out", "OUT"),
        "run",
        True,
    ),
    "sweep --out DIR": (
        (
            *("sweep", "planar3r", "--levels", "1", "--samples", "2001", "--chunk", "1"),
            *("--threads", "1", "--out", "OUT"),
        ),
        "run",
        True,
    ),
    "sweep --out FILE.npz": (
        ("sweep", "planar3r", "--levels", "1", "--samples", "21", "--out", "OUT"),
        "curves.npz",
        False,
    ),
    "map --json": (("map", "planar3r", "--count", "5000", "--json", "OUT"), "map.json", False),
    "at --json": (("at", "planar3r", "--q", "0,1,0", "--json", "OUT"), "at.json", False),
    "families --certificate": (
        ("families", "planar3r", "--certificate", "OUT"),
        "certificate.json",
        False,
    ),
    "view --html": (("view", "planar3r", "--html", "OUT"), "page.html", False),
    "plot .png": (
        ("plot", "ellipsoids", "planar3r", "--q", "0,1,0", "--dpi", "30", "--out", "OUT"),
        "figure.png",
        False,
    ),
    "dh": (("dh", "TABLE", "-o", "OUT"), "arm.urdf", False),
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


def failures(command: str, folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of the table for one command, and what went wrong."""
    words, name, is_run = COMMANDS[command]
    place = folder / "disk"
    words = tuple(_word(w, place / name) for w in words)
    expected, operations = _undisturbed(words, place, name, is_run)
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    wrong = []
    for at, (kind, said) in enumerate(operations):
        for number in _ERRORS[kind]:
            for half in (False, True) if kind == "write" else (False,):
                disk = Disk(place, Failure(at, number, half))
                _fresh(place, name, is_run)
                with disk.watched():
                    code, err = call(list(words))
                found = _contents(place)
                new = set(found) == set(expected) and all(
                    _same(path, found[path], expected[path]) for path in expected
                )
                unread = kind == "open of a folder" and number == errno.EACCES
                problems = list(_problems(disk, place, name, is_run, expected, code, err))
                if unread and code == 0:
                    problems = [] if new else ["it says that all is well"]
                if is_run:
                    problems += _resumed(words, place / name, expected)
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
    words: tuple[str, ...], place: Path, name: str, is_run: bool
) -> tuple[dict[str, bytes], list[tuple[str, str]]]:
    _fresh(place, name, is_run)
    disk = Disk(place)
    with disk.watched():
        code, err = call(list(words))
    if code:
        raise RuntimeError(f"{words} fails by itself: {err}")
    named = []
    for o in disk.log:
        folder = o.name in ("open", "fsync") and (place / o.path).is_dir()
        named.append((f"{o.name} of a folder" if folder else o.name, f"{o.name} of {o.path}"))
    return _contents(place), named


def _problems(
    disk: Disk,
    place: Path,
    name: str,
    is_run: bool,
    expected: dict[str, bytes],
    code: int,
    err: str,
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
    if not is_run and name not in found:
        yield "the old file has gone"
    lines = [x for x in err.splitlines() if x.startswith("pinsing: error: ")]
    other = [x for x in err.splitlines() if not x.startswith("pinsing: ")]
    if code != 2 or len(lines) != 1 or other:
        yield f"exit code {code}: {err[-300:]!r}"


def _resumed(words: tuple[str, ...], run: Path, expected: dict[str, bytes]) -> list[str]:
    code, err = call(list(words))
    if code or _contents(run.parent) != expected:
        return [f"it does not go on to the same bytes: exit code {code}, {err[-300:]!r}"]
    return []


def _fresh(place: Path, name: str, is_run: bool) -> None:
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    if not is_run:
        (place / name).write_bytes(_OLD)


def _contents(place: Path) -> dict[str, bytes]:
    paths = [p for p in place.rglob("*") if p.is_file() and p.name != "lock"]
    return {str(p.relative_to(place)): p.read_bytes() for p in paths}


def _same(path: str, data: bytes, expected: bytes) -> bool:
    """Whether a file is whole; a page is not the same twice, but begins and ends so."""
    if not path.endswith(".html"):
        return data == expected
    alike = abs(len(data) - len(expected)) < len(expected) // 20
    return alike and data[:2000] == expected[:2000] and data[-500:] == expected[-500:]


def _word(word: str, out: Path) -> str:
    if word == "TABLE":
        from pinsing.description.dh_urdf import urdf_folder

        return str(urdf_folder() / "stanford.dh.yaml")
    return str(out) if word == "OUT" else word
