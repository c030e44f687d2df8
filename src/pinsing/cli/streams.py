"""Standard output and error of the program: what happens when nobody can take what it says."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import select
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pinsing.atomic_write import why
from pinsing.errors import ConfigurationError, OutputError

if TYPE_CHECKING:
    from typing_extensions import Buffer

READER_GONE = 141
"""Exit code when the reader of a pipe has gone, as shells have it (128 + SIGPIPE)."""


class StdoutError(OutputError):
    """Standard output that is closed, full, or a pipe that nobody reads any more.

    Attributes
    ----------
    reader_gone : bool
        It is the latter, as after ``| head``: no failure that anybody wants to hear of.
    """

    def __init__(self, error: OSError) -> None:
        self.reader_gone = error.errno == errno.EPIPE
        closed = error.errno == errno.EBADF
        said = "it is closed" if closed else why(error)
        super().__init__(f"cannot write to standard output: {said}")


def guard_streams() -> None:
    """Take over the streams of this process; not where something else stands in for them."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # The next file that is opened would get the number, and all that is printed. Of
            # standard output it is noticed that nothing can be written there.
            null = os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
            if null != number:
                os.dup2(null, number)
                os.close(null)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _stream(_Stdout(1, "wb", closefd=False))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _stream(_Stderr(2, "wb", closefd=False), always=True)


@contextlib.contextmanager
def followed(file: Path) -> Iterator[tuple[Iterator[str], bool]]:
    """Open a stream of lines, - for standard input; with it, whether it is one that goes on.

    Raises
    ------
    ConfigurationError
        If it cannot be read.
    """
    from pinsing.proximity.follow import lines_of

    typed = str(file) == "-"
    try:
        with io.FileIO(0 if typed else str(file), closefd=not typed) as stream:
            yield lines_of(stream), not stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise ConfigurationError(f"cannot read {file}: {error.strerror or error}") from None


def give_up_stdout() -> None:
    """Lose what is still to be written, and all that will be."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()


def _stream(raw: io.FileIO, always: bool = False) -> io.TextIOWrapper:
    # A name that the terminal cannot show is no reason to fail.
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=getattr(sys.__stdout__ or sys.__stderr__, "encoding", "utf-8"),
        errors="backslashreplace",
        line_buffering=always or raw.isatty(),
    )


class _Stdout(io.FileIO):
    def write(self, data: Buffer, /) -> int:
        while True:
            try:
                written = super().write(data)
            except OSError as error:
                raise StdoutError(error) from None
            if written is not None:
                return written
            select.select([], [self.fileno()], [])  # set not to wait by someone who shares it


class _Stderr(io.FileIO):
    def write(self, data: Buffer, /) -> int:
        with contextlib.suppress(OSError):
            super().write(data)
        return len(memoryview(data))
