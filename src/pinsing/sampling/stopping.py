"""What ends a run or an analysis early: Ctrl-C, and the time it may take.

While a run is on, Ctrl-C raises nothing: an exception in the middle of a locked region of
``concurrent.futures`` would leave the lock taken, and every thread that needs it waiting for
ever. Instead it leaves a word in the queue that the run waits at.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from queue import SimpleQueue
from types import FrameType
from typing import Any, TypeVar

_AT_ONCE = b"\npinsing: ended at once; what is in a folder is kept\n"

_ends_process = False
_outer: Inbox | None = None


class Inbox:
    """Futures as they are done, and whether the run is to stop.

    Attributes
    ----------
    asked : int
        How often Ctrl-C was pressed: once, to stop when what has begun is done and kept; twice,
        without waiting for it.
    heeded : bool
        Whether the run has stopped for that; one that was about to end has not.
    """

    def __init__(self) -> None:
        self.asked = 0
        self.heeded = False
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

    Blocks may be nested: an inner inbox is told of what the outer one has heard, and the outer one
    of what came too late to stop the inner run. Nothing is changed outside of the main thread,
    which alone hears of Ctrl-C, nor where the program has put it off (as ``nohup`` does) or
    handles it outside of Python.
    """
    global _outer
    before, outer = signal.getsignal(signal.SIGINT), _outer
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def heard(number: int, frame: FrameType | None) -> None:
        inbox.stop()
        if inbox.asked >= 2 and _ends_process:
            with contextlib.suppress(OSError):
                os.write(2, _AT_ONCE)
            os._exit(130)
        if inbox.asked >= 3:
            before(number, frame)

    signal.signal(signal.SIGINT, heard)
    _outer = inbox
    try:
        # Only now, when nothing can be heard by the outer one alone.
        for _ in range(0 if outer is None else outer.asked):
            inbox.stop()
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _outer = outer
        if outer is not None and inbox.asked and not (inbox.heeded or outer.asked):
            outer.stop()


@contextlib.contextmanager
def ctrl_c_afterwards() -> Iterator[None]:
    """Put Ctrl-C off to the end of the block: what is computed and written there is kept.

    A run within the block stops for it as ever.

    Raises
    ------
    KeyboardInterrupt
        At the end, if Ctrl-C was pressed and no run has stopped for it.
    """
    inbox = Inbox()
    with ctrl_c_to(inbox):
        yield
    if inbox.asked:
        raise KeyboardInterrupt


@contextlib.contextmanager
def second_ctrl_c_ends_process() -> Iterator[None]:
    """For programs of their own: a second Ctrl-C waits for nothing, not even for threads."""
    global _ends_process
    _ends_process, before = True, _ends_process
    try:
        yield
    finally:
        _ends_process = before


T = TypeVar("T")


class Stages:
    """Runs stages until the time is up, or Ctrl-C; what is missing then is listed.

    Parameters
    ----------
    seconds : float or None
        Time from now on; None: as long as it takes.
    """

    def __init__(self, seconds: float | None) -> None:
        self.seconds = math.inf if seconds is None else seconds
        self.until = time.monotonic() + self.seconds
        self.missing: list[str] = []
        self.interrupted = False

    @property
    def over(self) -> bool:
        """Whether nothing more should be begun."""
        return self.interrupted or time.monotonic() > self.until

    @property
    def why(self) -> str:
        """What ended it."""
        return "stopped" if self.interrupted else f"the time of {self.seconds:g} s was up"

    def run(self, name: str, stage: Callable[[], T], otherwise: T, whole: bool = False) -> T:
        """The result of a stage; ``otherwise``, and a line for what is missing, without it.

        A ``whole`` stage looks at no clock: its result has all of it, however late.
        """
        if self.over:
            self.missing.append(f"{name}: not begun, {self.why}")
            return otherwise
        try:
            result = stage()
        except KeyboardInterrupt:
            self.interrupted = True
            self.missing.append(f"{name}: stopped before its end")
            return otherwise
        if self.over and not whole:
            self.missing.append(f"{name}: perhaps not all of it, {self.why}")
        return result

    def watched(self, progress: Callable[[int, int], None] | None) -> Callable[[int, int], None]:
        """A callback for a sweep that ends it, as Ctrl-C would, when the time is up."""

        def tell(done: int, count: int) -> None:
            if progress is not None:
                progress(done, count)
            if time.monotonic() > self.until and done < count:
                raise KeyboardInterrupt

        return tell
