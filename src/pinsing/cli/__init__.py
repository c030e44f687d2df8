"""The command line: reads words, calls functions, prints. Heavy imports wait in the commands."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

__all__ = ["main", "memory_problem", "memory_refusal", "program"]

_NO_MEMORY = (
    "failed to map segment",  # of a shared library
    "annot allocate memory",
    "nable to allocate",
    "can't start new thread",
    "bad_alloc",
)
_LEAST_MEMORY = 512 << 20
"""Address space that NumPy and Pinocchio need. Below that OpenBLAS ends the process by itself."""

STOPPED = 130
_SAID = b"pinsing: stopped\n"
_YOUNG = 200_000
"""Objects made before a look for cycles among them: imports alone make some hundred thousand."""


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and exit."""
    from pinsing.cli.app import main as run

    run(args)


def program() -> NoReturn:
    """Run the command line of this process and exit: the ``pinsing`` program."""
    # Ctrl-C says "stopped" and ends with 130 from the first import on. When the work is done it is
    # no longer heard, so that the exit code tells what was done.
    gc.set_threshold(_YOUNG)
    code: list[int] = []
    atexit.register(_leave, code)  # first in, last out: whoever cleans up has done so by then
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heard:  # else it is put off, as by nohup
        signal.signal(signal.SIGINT, _at_once)
    try:
        from pinsing.cli.app import main as run
    except (MemoryError, ImportError) as error:
        if not (said := memory_problem(error)):
            raise
        os.write(2, f"pinsing: error: {said}\n".encode())
        os._exit(2)

    try:
        try:
            if heard:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            run()
        finally:
            if heard:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
    except SystemExit as end:
        if type(end.code) is int:
            code.append(end.code)
        raise
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        os.write(2, _SAID)
        sys.exit(STOPPED)


def memory_problem(error: BaseException) -> str:
    """Return a sentence for an error that means too little memory, "" for any other."""
    if not isinstance(error, MemoryError) and not any(x in str(error) for x in _NO_MEMORY):
        return ""
    limit = _memory_limit()
    return (
        "out of memory: ask for less, or close other programs"
        if limit is None
        else f"out of memory, which is limited to {limit >> 20} MiB: raise the limit (ulimit -v)"
    )


def memory_refusal() -> str:
    """Return a sentence where a limit leaves too little memory to begin, "" otherwise."""
    limit = _memory_limit()
    if limit is None or limit >= _LEAST_MEMORY:
        return ""
    return (
        f"memory is limited to {limit >> 20} MiB, and {_LEAST_MEMORY >> 20} MiB are needed: raise "
        "the limit (ulimit -v)"
    )


def _memory_limit() -> int | None:
    """Address space of this process in bytes; None where it is not limited."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _leave(code: Sequence[int]) -> None:
    """End without taking the modules apart: that takes a tenth of a short command's time."""
    if not code:
        return  # not by itself: the interpreter has more to say
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):  # closed, or never there
        return
    os._exit(code[0])


def _at_once(number: int, frame: FrameType | None) -> None:
    """Nothing has begun: an exception in the middle of imports could be taken for another."""
    try:
        os.write(2, _SAID)
    finally:
        os._exit(STOPPED)
