"""A checked description made into a Pinocchio model."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from typing import BinaryIO, cast

import pinocchio as pin

from pinsing.description.urdf import Description
from pinsing.errors import RobotFileError

# File descriptor 2 belongs to the whole process: one capture at a time.
_CAPTURE = threading.Lock()


def build_model(description: Description) -> pin.Model:
    """Return the Pinocchio model of a description: root fixed, mimic joints as joints of their own.

    Raises
    ------
    RobotFileError
        If Pinocchio refuses it nevertheless; the reason is what Pinocchio printed.
    """
    reason = ""
    with _stderr_of_c() as captured:
        try:
            return pin.buildModelFromXML(description.kinematics)
        except (ValueError, RuntimeError, IndexError) as error:
            reason = str(error)
        finally:
            printed = captured()
    said = " ".join(
        word for line in printed.splitlines() if " at line " not in line for word in line.split()
    )
    raise RobotFileError(f"Pinocchio cannot build it: {said or reason}", description.path)


@contextlib.contextmanager
def _stderr_of_c() -> Iterator[_Captured]:
    """Catch what C++ prints to file descriptor 2; a process without one is left as it is."""
    with _CAPTURE, _store() as store:
        sys.stderr.flush()
        try:
            saved = os.dup(2)
        except OSError:
            yield _Captured(store)
            return
        try:
            os.dup2(store.fileno(), 2)
            yield _Captured(store)
        finally:
            os.dup2(saved, 2)
            os.close(saved)


def _store() -> BinaryIO:
    """A file without a name, in memory where there is such a thing."""
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # some sandboxes refuse it
            return os.fdopen(os.memfd_create("stderr of pinsing"), "w+b")
    import tempfile  # with shutil and its archives: a start of half a second can do without

    return cast("BinaryIO", tempfile.TemporaryFile())


class _Captured:
    """What has been caught so far."""

    def __init__(self, store: BinaryIO) -> None:
        self._store = store

    def __call__(self) -> str:
        self._store.seek(0)
        return self._store.read(20_000).decode(errors="replace")
