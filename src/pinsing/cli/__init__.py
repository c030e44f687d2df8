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

__all__ = ["main", "program"]

_STOPPED = 130
_SAID = b"pinsing: stopped\n"
_YOUNG = 200_000
"""Objects made before a look for cycles among them: imports alone make some hundred thousand."""


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and exit."""
    from pinsing.cli.app import main as run

    run(args)


def program() -> NoReturn:
    """Run the command line of this process and exit: the ``pinsing`` program.

    Ctrl-C says "stopped" and ends with 130 from the first import on. When the work is done it is
    no longer heard, so that the exit code tells what was done.
    """
    gc.set_threshold(_YOUNG)
    code: list[int] = []
    atexit.register(_leave, code)  # first in, last out: whoever cleans up has done so by then
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heard:  # else it is put off, as by nohup
        signal.signal(signal.SIGINT, _at_once)
    from pinsing.cli.app import main as run

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
        sys.exit(_STOPPED)


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
        os._exit(_STOPPED)
