"""The one place that writes files: checked before the work is done, and never half a file.

A file is written under another name in the same folder, flushed to the disk, renamed, and the
folder flushed: after any failure, kill or loss of power the old file is whole or the new one is.
"""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path

from pinsing.errors import OutputError, shown_path, why

MEBIBYTE = 1 << 20

TEMPORARY = ".part"
"""End of the name of a file that is being written; it begins with a dot."""

_LONGEST = 40  # letters of a name that its temporary one keeps: names end at 255 bytes
_NO_SYNC = frozenset({errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EPERM})


def check_writable(path: str | os.PathLike[str], *, inputs: tuple[str | Path, ...] = ()) -> Path:
    """Return ``path`` if a file can be written there, before anything is computed."""
    # OutputError if not, or if it is one of ``inputs``.
    path = Path(path)
    shown = shown_path(path)
    try:
        folder = path.parent
        OutputError.refuse_if(
            not str(path) or "\0" in str(path),
            "the name of the output file is empty or has a null character",
        )
        os.fsencode(path)
        OutputError.refuse_if(
            not folder.is_dir(),
            f"cannot write {shown}: there is no folder {shown_path(folder)}; create it first",
        )
        OutputError.refuse_if(
            path.is_dir(), f"cannot write {shown}: it is a folder; give the name of a file"
        )
        blocked = path if _special(path) else _target(path).parent
        OutputError.refuse_if(
            not blocked.exists(),
            f"cannot write {shown}: it is a link into {shown_path(blocked)}, and "
            "there is no such folder",
        )
        OutputError.refuse_if(
            not os.access(blocked, os.W_OK),
            f"cannot write {shown}: no permission to write to {shown_path(blocked)}",
        )
        OutputError.refuse_if(
            any(Path(p).exists() and path.exists() and path.samefile(p) for p in inputs),
            f"cannot write {shown}: it is the input; give another name",
        )
    except OutputError:
        raise
    except UnicodeEncodeError:
        raise OutputError("the name of the output file holds half a character") from None
    except OSError as error:
        raise OutputError(f"cannot write {shown}: {why(error)}") from None
    return path


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write all of a file or nothing; OutputError leaves what was there before."""
    # What a symbolic link stands for is replaced, not the link, and keeps its permissions. A device
    # or pipe is written to directly.
    path = Path(path)
    try:
        if _special(path):
            handle = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
            try:
                _write_all(handle, data)
            finally:
                os.close(handle)
        else:
            replace_file(_target(path), data)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write {shown_path(path)}: {why(error)}") from None


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write UTF-8 text, all of a file or nothing, as `write_bytes`."""
    # What a file name may hold but UTF-8 may not (a lone surrogate) is written escaped.
    write_bytes(path, text.encode("utf-8", "backslashreplace"))


def replace_file(target: Path, data: bytes) -> None:
    """Put ``data`` in the place of ``target``, be it a link; OSError leaves no temporary file."""
    name = f".{target.name[:_LONGEST]}.{os.urandom(6).hex()}{TEMPORARY}"
    temporary = target.with_name(name)
    try:
        # The system takes away what new files of this process may not have.
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        try:
            handle = os.open(temporary, flags, 0o666)
        except FileNotFoundError as error:
            if target.parent.is_dir():  # as /proc, which root may write to
                raise OSError(error.errno, "its folder takes no new files") from None
            raise
        try:
            _write_all(handle, data)
            with contextlib.suppress(FileNotFoundError):  # a file that is replaced keeps its mode
                if not target.is_symlink():
                    os.fchmod(handle, os.lstat(target).st_mode & 0o777)
            os.fsync(handle)
        finally:
            os.close(handle)
        os.replace(temporary, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Make what was renamed or made in ``folder`` last through a loss of power."""
    # OSError if the disk fails, not where the file system or the permissions know no such thing.
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except PermissionError:  # a folder may be written to but not read
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise
    finally:
        os.close(handle)


def is_temporary(name: str) -> bool:
    """Return True if a file of that name may be what a killed process left of a write."""
    return name.startswith(".") and name.endswith(TEMPORARY)


def _write_all(handle: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(handle, rest) :]


def _target(path: Path) -> Path:
    """Return the file that a symbolic link stands for: it is replaced, not the link."""
    try:
        os.stat(path)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(error.errno, "it is a link that leads to itself") from None
    return Path(os.path.realpath(path))


def _special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()
