"""What a run waits for: chunks that are done, and Ctrl-C, in one queue without locks of its own.

While a run is on, Ctrl-C raises nothing: an exception in the middle of a locked region of
``concurrent.futures`` would leave the lock taken, and every thread that needs it waiting for
ever. Instead it leaves a word in the queue that the run waits at.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from queue import SimpleQueue
from types import FrameType
from typing import Any

_STOPPED = 130
_AT_ONCE = b"\npinsing: ended at once; what is in a folder is kept\n"

_ends_process = False


class Inbox:
    """Futures as they are done, and whether the run is to stop.

    Attributes
    ----------
    asked : int
        How often Ctrl-C was pressed: once, to stop when what has begun is done and kept; twice,
        without waiting for it.
    """

    def __init__(self) -> None:
        self.asked = 0
        # Its ``put`` may be called from a signal handler, whatever it interrupts.
        self._queue: SimpleQueue[Future[Any] | None] = SimpleQueue()

    def follow(self, future: Future[Any]) -> None:
        """Have ``next`` return ``future`` when it is done, cancelled, or has failed."""
        future.add_done_callback(self._queue.put)

    def next(self) -> Future[Any] | None:
        """Wait for a future that is done, or None: something else has happened."""
        return self._queue.get()

    def stop(self) -> None:
        """Ask the run to stop."""
        self.asked += 1
        self._queue.put(None)


@contextlib.contextmanager
def ctrl_c_to(inbox: Inbox) -> Iterator[None]:
    """Have Ctrl-C speak to ``inbox`` as long as the block lasts; the third one raises again.

    Nothing is changed outside of the main thread, which alone hears of Ctrl-C, nor where the
    program has put it off (as ``nohup`` does) or handles it outside of Python.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def heard(number: int, frame: FrameType | None) -> None:
        inbox.stop()
        if inbox.asked >= 2 and _ends_process:
            with contextlib.suppress(OSError):
                os.write(2, _AT_ONCE)
            os._exit(_STOPPED)
        if inbox.asked >= 3:
            before(number, frame)

    signal.signal(signal.SIGINT, heard)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def second_ctrl_c_ends_process() -> Iterator[None]:
    """For programs of their own: a second Ctrl-C waits for nothing, not even for threads."""
    global _ends_process
    _ends_process, before = True, _ends_process
    try:
        yield
    finally:
        _ends_process = before
