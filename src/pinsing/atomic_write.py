"""Writing results: checked before the work is done, and never half a file."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pinsing.errors import OutputError


def check_writable(path: str | os.PathLike[str], *, inputs: tuple[str | Path, ...] = ()) -> Path:
    """Return ``path`` if a file can be written there, before anything is computed.

    Parameters
    ----------
    path : path-like
        The file to write.
    inputs : tuple of paths
        Files that it must not replace.

    Raises
    ------
    OutputError
        If its folder does not exist or cannot be written to, it is a folder, or an input.
    """
    path = Path(path)
    try:
        folder = path.parent
        if not str(path) or "\0" in str(path):
            raise OutputError("the name of the output file is empty or has a null character")
        if not folder.is_dir():
            raise OutputError(f"cannot write {path}: there is no folder {folder}; create it first")
        if path.is_dir():
            raise OutputError(f"cannot write {path}: it is a folder; give the name of a file")
        blocked = path if _special(path) else _target(path).parent
        if not os.access(blocked, os.W_OK):
            raise OutputError(f"cannot write {path}: no permission to write to {blocked}")
        if any(Path(p).exists() and path.exists() and path.samefile(p) for p in inputs):
            raise OutputError(f"cannot write {path}: it is the input; give another name")
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
    return path


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file beside ``path``, with its suffix, that takes its place at the end.

    If the block raises, ``path`` is as it was. A device or pipe is written to directly.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    path = Path(path)
    if _special(path):
        yield path
        return
    target = _target(path)
    try:
        handle, name = tempfile.mkstemp(target.suffix, f".{target.stem[:60]}.", target.parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(_mode(target))
        temporary.replace(target)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write UTF-8 text, the whole file or none of it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with replacing(path) as temporary:
        # What a file name may hold but UTF-8 may not (a lone surrogate) is written escaped.
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def _target(path: Path) -> Path:
    """Return the file that a symbolic link stands for: it is replaced, not the link."""
    return Path(os.path.realpath(path))


def _special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


def _mode(target: Path) -> int:
    """Permissions of the file that is replaced, or what the process gives to new files."""
    if target.exists():
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
