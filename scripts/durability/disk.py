"""Every operation on files below a folder: recorded, or one of them failing on purpose.

All that pinsing writes goes through a handful of functions of ``os``. They are replaced while a
command runs in this process; what is outside of the folder is left alone.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True)
class Operation:
    """One operation: its name, the file (or the two of a rename), and what was written."""

    name: str
    path: str
    to: str = ""
    data: bytes = b""


@dataclass
class Failure:
    """Which operation fails, counted from 0, and how.

    Attributes
    ----------
    at : int
        Number of the operation.
    number : int
        Error number, such as ``errno.ENOSPC``.
    half : bool
        Of a write: whether half of it still gets through, as on a disk that is nearly full.
    """

    at: int
    number: int
    half: bool = False


@dataclass
class Disk:
    """Operations on files below ``folder``, in order; one of them may fail."""

    folder: Path
    failure: Failure | None = None
    log: list[Operation] = field(default_factory=list)
    failed: Operation | None = None
    _files: dict[int, str] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock)
    _broken: int = 0

    @contextlib.contextmanager
    def watched(self) -> Iterator[Disk]:
        """Replace the functions of ``os`` as long as the block lasts."""
        names = ("open", "write", "fsync", "close", "replace", "unlink", "mkdir", "fchmod")
        before = {name: getattr(os, name) for name in names}
        try:
            for name in names:
                setattr(os, name, self._watched(name, before[name]))
            yield self
        finally:
            for name in names:
                setattr(os, name, before[name])

    def _watched(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            with self._lock:
                operation = self._operation(name, args)
                if operation is None:
                    return real(*args, **kwargs)
                if name == "close":
                    self._files.pop(args[0], None)
                    return real(*args, **kwargs)
                if name == "write" and self._broken:
                    raise _error(self._broken)
                number, self.log = len(self.log), [*self.log, operation]
                if self.failure is not None and number == self.failure.at:
                    self.failed = operation
                    if name == "write" and self.failure.half:
                        # Half of it gets through, and nothing after it.
                        self._broken, self.failure = self.failure.number, None
                        return real(args[0], bytes(args[1])[: max(1, len(args[1]) // 2)])
                    raise _error(self.failure.number)
                result = real(*args, **kwargs)
                if name == "open":
                    self._files[result] = operation.path
                return result

        return call

    def _operation(self, name: str, args: tuple[Any, ...]) -> Operation | None:
        if name in ("write", "fsync", "close", "fchmod"):
            path = self._files.get(args[0])
            data = bytes(args[1]) if name == "write" else b""
            return None if path is None else Operation(name, path, data=data)
        path = self._below(args[0])
        if path is None:
            return None
        if name == "open":
            writes = len(args) > 1 and args[1] & _WRITING
            if not writes and not os.path.isdir(args[0]):
                return None
            return Operation("open", path)
        to = self._below(args[1]) if name == "replace" else ""
        return Operation(name, path, to or "")

    def _below(self, path: Any) -> str | None:
        try:
            text = os.path.abspath(os.fspath(path))
        except TypeError:
            return None
        inside = text == str(self.folder) or text.startswith(f"{self.folder}{os.sep}")
        return os.path.relpath(text, self.folder) if inside else None


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))
