"""A folder that a long run leaves its finished chunks in, and goes on from after any stop.

``plan.json`` says what is being computed; ``chunks/000000.npz``, ... are the chunks, each
readable with ``numpy.load``. A chunk is there whole or not at all: it is written to a temporary
file, flushed to the disk and renamed. Its last bytes are the SHA-256 of all before them.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import json
import os
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing.errors import OutputError

Record = dict[str, npt.NDArray[np.generic]]

_SCHEMA = "pinsing/run/1"
_DIGEST = 64  # hexadecimal digits
_MARK = b"sha256:"
_PLAN, _CHUNKS, _LOCK = "plan.json", "chunks", "lock"
_TEMPORARY = ".part"
_ROBOT = "robot"


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
        return self.path / _CHUNKS / f"{index:06d}.npz"

    def save(self, index: int, record: Record) -> None:
        """Put a finished chunk on the disk, all of it or nothing.

        Raises
        ------
        OutputError
            If it cannot be written, as when the disk is full. What was there before stays.
        """
        self._write(self.chunk_path(index), _packed(record, self.digest, index))

    def load(self, index: int) -> Record | None:
        """Read a chunk; None if it is not there, damaged, or of another run or place."""
        try:
            data = self.chunk_path(index).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise OutputError(f"cannot read {self.chunk_path(index)}: {_why(error)}") from None
        return _unpacked(data, self.digest, index)

    def kept(self) -> tuple[int, ...]:
        """Return the numbers of the chunks that have a file, damaged or not."""
        folder = self.path / _CHUNKS
        names = {p.stem for p in folder.glob("*.npz")} if folder.is_dir() else set()
        return tuple(sorted(int(n) for n in names if n.isdigit() and int(n) < self.chunks))

    def write_text(self, name: str, text: str) -> Path:
        """Write a further file of the run, such as its result, as safely as a chunk."""
        target = self.path / name
        self._write(target, text.encode("utf-8", "backslashreplace"))
        return target

    def _write(self, target: Path, data: bytes) -> None:
        temporary = target.with_name(target.name + _TEMPORARY)
        try:
            try:
                with open(temporary, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(temporary, target)
                _sync_folder(target.parent)
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot write {target}: {_why(error)}; the {len(self.kept())} of {self.chunks} "
                "chunks on the disk are safe: make room and run the same command again"
            ) from None


def recorded(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Identity of the run in folder ``path``; None if there is no run yet.

    Raises
    ------
    OutputError
        If there is a plan that cannot be read.
    """
    plan = Path(path) / _PLAN
    try:
        text = plan.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot read {plan}: {error}") from None
    damaged = OutputError(f"{plan} is damaged; give another folder, or delete {path} to start anew")
    try:
        data = json.loads(text)
        identity, digest = data["identity"], data["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise damaged from None
    if data.get("schema") != _SCHEMA or not isinstance(identity, dict):
        raise damaged
    if digest != _identity_digest(identity):
        raise damaged
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
    try:
        if not root.is_dir():
            if root.exists():
                raise OutputError(f"cannot use {root}: it is a file; give a folder")
            root.mkdir()
        elif not (root / _PLAN).exists() and _foreign(root):
            raise OutputError(
                f"{root} is not empty and holds no run of pinsing; give a new or empty folder"
            )
        lock = open(root / _LOCK, "ab")  # noqa: SIM115 - closed below
    except OutputError:
        raise
    except FileNotFoundError:
        raise OutputError(f"cannot make {root}: there is no folder {root.parent}") from None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot use {root}: {_why(error)}") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OutputError(
                f"another process is at work in {root}; wait for it, or give another folder"
            ) from None
        folder = RunFolder(root, identity, chunks)
        known = recorded(root)
        if known is None:
            _start(folder)
        elif known != identity:
            raise OutputError(f"{root} holds another run: {_difference(known, identity)}")
        for stray in [*root.glob(f"*{_TEMPORARY}"), *(root / _CHUNKS).glob(f"*{_TEMPORARY}")]:
            stray.unlink(missing_ok=True)
        yield folder


def _start(folder: RunFolder) -> None:
    try:
        (folder.path / _CHUNKS).mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make {folder.path / _CHUNKS}: {_why(error)}") from None
    plan = {"schema": _SCHEMA, "identity": folder.identity, "sha256": folder.digest}
    folder.write_text(_PLAN, json.dumps(plan, indent=2) + "\n")


def _foreign(root: Path) -> bool:
    """Whether an interrupted start cannot be all that the folder holds."""
    ours = {_LOCK, _CHUNKS, _PLAN + _TEMPORARY}
    return any(p.name not in ours for p in root.iterdir())


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


def _packed(record: Record, run: str, index: int) -> bytes:
    """Bytes of an .npz file whose comment ends in the SHA-256 of all bytes before it."""
    buffer = io.BytesIO()
    arrays = {**record, "_run": np.array(run), "_chunk": np.array(index)}
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = _MARK + b"0" * _DIGEST
    body = buffer.getvalue()[:-_DIGEST]
    return body + hashlib.sha256(body).hexdigest().encode()


def _unpacked(data: bytes, run: str, index: int) -> Record | None:
    body, digest = data[:-_DIGEST], data[-_DIGEST:]
    if not body.endswith(_MARK) or hashlib.sha256(body).hexdigest().encode() != digest:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        record: Record = {name: archive[name] for name in archive.files}
    if str(record.pop("_run", "")) != run or int(record.pop("_chunk", -1)) != index:
        return None
    return record


def _sync_folder(folder: Path) -> None:
    """Make a rename in ``folder`` last through a loss of power."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
