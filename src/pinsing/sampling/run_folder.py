"""A folder that a long run leaves its finished chunks in, and goes on from after any stop.

``plan.json`` says what is being computed; ``chunks/000000.npz``, ... are the chunks. A chunk is
there whole or not at all (`pinsing.atomic_write`). What is in the folder is not believed: only
the names that a run gives count, links, devices and pipes are no chunks, and what a chunk holds
is judged before it is used.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pinsing.atomic_write import is_temporary, replace_file, sync_folder, why
from pinsing.chunk_file import DamagedError, Record, pack, read_bounded, unpack
from pinsing.errors import OutputError

_SCHEMA = "pinsing/run/1"
_PLAN, _CHUNKS, _LOCK = "plan.json", "chunks", "lock"
_ROBOT = "robot"
_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


class RunFolder:
    """One run on disk. Made by `open_run`.

    Attributes
    ----------
    path : Path
        The folder.
    identity : mapping
        What decides the numbers of the run: plain JSON values.
    chunks : int
        How many chunks the run has.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], chunks: int) -> None:
        self.path, self.identity, self.chunks = path, dict(identity), chunks
        self.digest = _identity_digest(self.identity)

    def chunk_path(self, index: int) -> Path:
        """File of one chunk."""
        return self.path / _CHUNKS / _chunk_name(index)

    def save(self, index: int, record: Record) -> None:
        """Put a finished chunk on the disk, all of it or nothing.

        Raises
        ------
        OutputError
            If it cannot be written, as when the disk is full. What was there before stays.
        """
        path, data = self.chunk_path(index), pack(record, self.digest, index)
        if not path.parent.exists():  # somebody has tidied up
            make_chunks(self.path)
        self._write(path, data)

    def read(
        # bytes that the arrays of a chunk take, unless the run says
        self,
        index: int,
        check: Callable[[Record], None] | None = None,
        room: int = 256 << 20,
    ) -> Record:
        """Record of a chunk.

        Parameters
        ----------
        check : callable, optional
            Raises a ValueError that says what a record must not hold.
        room : int
            Bytes that its arrays take at most.

        Raises
        ------
        DamagedError
            If it is damaged, of another run or place, or not what it must be.
        FileNotFoundError
            If it is not there.
        OutputError
            If it cannot be read.
        """
        path = self.chunk_path(index)
        try:
            # Arrays that cannot be compressed grow by less than a thousandth.
            data = read_bounded(path, room + room // 512 + (64 << 10))
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise OutputError(f"cannot read {path}: {why(error)}") from None
        record = unpack(data, self.digest, index, room)
        if check is not None:
            try:
                check(record)
            except ValueError as error:
                raise DamagedError(str(error)) from None
        return record

    def kept(self) -> tuple[int, ...]:
        """Return the numbers of the chunks that have a file, damaged or not."""
        numbers = []
        with contextlib.suppress(FileNotFoundError), os.scandir(self.path / _CHUNKS) as entries:
            for entry in entries:
                number = _chunk_number(entry.name)
                if number is not None and number < self.chunks:
                    numbers.append(number)
        return tuple(sorted(numbers))

    def write_bytes(self, name: str, data: bytes) -> Path:
        """Write a further file of the run, such as its result, as safely as a chunk."""
        self._write(self.path / name, data)
        return self.path / name

    def write_text(self, name: str, text: str) -> Path:
        """As `write_bytes`."""
        return self.write_bytes(name, text.encode("utf-8", "backslashreplace"))

    def _write(self, target: Path, data: bytes) -> None:
        try:
            replace_file(target, data)
        except OSError as error:
            done, advice = len(self.kept()), "run the same command again when that is mended"
            if error.errno in _FULL:
                advice = "make room and run the same command again"
            raise OutputError(
                f"cannot write {target}: {why(error)}; the {done} of {self.chunks} chunks on the "
                f"disk are safe: {advice}"
            ) from None


def recorded(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Identity of the run in folder ``path``; None if there is no run yet.

    Raises
    ------
    OutputError
        If there is a plan that cannot be read.
    """
    plan = Path(path) / _PLAN
    advice = f"give another folder, or delete {path} to start anew"
    try:
        text = read_bounded(plan, 16 << 20).decode()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except DamagedError as error:
        raise OutputError(f"cannot use {plan}: {error}; {advice}") from None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot read {plan}: {why(error)}") from None
    damaged = OutputError(f"{plan} is damaged; {advice}")
    try:
        data = json.loads(text)
        identity, digest = data["identity"], data["sha256"]
        if data.get("schema") != _SCHEMA or not isinstance(identity, dict):
            raise damaged
        if digest != _identity_digest(identity):
            raise damaged
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise damaged from None
    return identity


@contextlib.contextmanager
def open_run(
    path: str | os.PathLike[str], identity: Mapping[str, Any], chunks: int
) -> Iterator[RunFolder]:
    """Start a run in a new or empty folder, or go on with the same one.

    No other process can open the folder meanwhile; the lock ends with the process, however
    it ends.

    Parameters
    ----------
    identity : mapping
        What decides the numbers: plain JSON values, compared with what the folder has.
    chunks : int
        How many chunks there are.

    Raises
    ------
    OutputError
        If the folder is in use, holds another run or something else, or cannot be written.
    """
    root = Path(path)
    identity = json.loads(json.dumps(identity))  # as it will be read back
    with _locked(root):
        folder = RunFolder(root, identity, chunks)
        known = recorded(root)
        if known is None:
            make_chunks(root)
            plan = {"schema": _SCHEMA, "identity": folder.identity, "sha256": folder.digest}
            folder.write_text(_PLAN, json.dumps(plan, indent=2) + "\n")
        elif known != identity:
            raise OutputError(f"{root} holds another run: {_difference(known, identity)}")
        else:
            make_chunks(root)
        _tidy(folder)
        yield folder


def make_chunks(root: Path) -> None:
    """Make the folder of the chunks if there is none.

    Raises
    ------
    OutputError
        If it cannot be made, or is a link or a file.
    """
    chunks = root / _CHUNKS
    with _reported(f"cannot make {chunks}"):
        with contextlib.suppress(FileExistsError):
            os.mkdir(chunks)
            sync_folder(root)
        if not stat.S_ISDIR(os.lstat(chunks).st_mode):
            raise OutputError(f"cannot use {chunks}: it is no folder; remove it, or give another")


@contextlib.contextmanager
def _reported(what: str) -> Iterator[None]:
    """Say of a failure of the system what could not be done."""
    try:
        yield
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"{what}: {why(error)}") from None


@contextlib.contextmanager
def _locked(root: Path) -> Iterator[None]:
    """Lock a folder, which is made if it is not there."""
    try:
        import fcntl
    except ImportError:
        raise OutputError(
            f"cannot lock {root}: runs in folders need Linux or macOS (on Windows: WSL)"
        ) from None
    with _reported(f"cannot use {root}"):
        if not root.is_dir():
            if root.is_symlink() and not root.exists():
                raise OutputError(f"cannot use {root}: it is a link to what is not there")
            if root.exists():
                kind = "a file" if root.is_file() else "a device or pipe"
                raise OutputError(f"cannot use {root}: it is {kind}; give a folder")
            try:
                os.mkdir(root)
            except FileNotFoundError:
                raise OutputError(f"cannot make {root}: there is no folder {root.parent}") from None
            sync_folder(root.parent)
        elif not (root / _PLAN).exists() and not all(map(_is_ours, root.iterdir())):
            raise OutputError(
                f"{root} is not empty and holds no run of pinsing; give a new or empty folder"
            )
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        handle = os.open(root / _LOCK, flags, 0o666)
    with open(handle, "rb"):
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OutputError(f"cannot use {root / _LOCK}: it is no file; remove it")
        with _reported(f"cannot lock {root}"):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputError(
                    f"another process is at work in {root}; wait for it, or give another folder"
                ) from None
        yield


def _is_ours(path: Path) -> bool:
    """Return True of what an interrupted start can leave in a folder."""
    return path.name in (_LOCK, _CHUNKS) or is_temporary(path.name)


def _tidy(folder: RunFolder) -> None:
    """Remove what killed processes were writing; refuse what no chunk can be written over."""
    with _reported(f"cannot use {folder.path}"):
        for place in (folder.path, folder.path / _CHUNKS):
            with os.scandir(place) as entries:
                for entry in list(entries):
                    if is_temporary(entry.name) and entry.is_file(follow_symlinks=False):
                        os.unlink(entry.path)
        for index in folder.kept():
            path = folder.chunk_path(index)
            if stat.S_ISDIR(os.lstat(path).st_mode):
                raise OutputError(f"cannot use {path}: it is a folder; remove it")


def _chunk_name(index: int) -> str:
    return f"{index:06d}.npz"


def _chunk_number(name: str) -> int | None:
    """Number of a chunk by the name of its file; None of any other name."""
    stem = name.removesuffix(".npz")
    if not (stem.isascii() and stem.isdigit()) or len(stem) > 18:
        return None
    return int(stem) if _chunk_name(int(stem)) == name else None


def _difference(known: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    names = [n for n in {**known, **asked} if known.get(n) != asked.get(n)]
    if _ROBOT in names:
        return (
            "the robot's geometry, task or length scale has changed; give another folder, or "
            "put the robot back as it was"
        )
    parts = []
    for name in names[:4]:
        there, here = (json.dumps(x.get(name)) for x in (known, asked))
        long = max(len(there), len(here)) > 60
        parts.append(f"{name} differs" if long else f"{name} is {there} there and {here} here")
    return ", ".join(parts) + "; give the same options as then, or another folder"


def _identity_digest(identity: Mapping[str, Any]) -> str:
    text = json.dumps(identity, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
