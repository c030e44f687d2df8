"""A line that says what a command does, where that takes longer than a second."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator

from pinsing.cli.output import say
from pinsing.prose import Page, is_terminal

AFTER = 1.0
"""Seconds that pass in silence."""

_AGAIN = 0.25


@contextlib.contextmanager
def waiting(after: float = AFTER) -> Iterator[Callable[..., None]]:
    """Callback that takes the step a command is at, as ``reading meshes``, and how far that is.

    A step that takes longer than ``after`` seconds shows: on a terminal as one line with the
    seconds so far, drawn over again and gone at the end; elsewhere as one line on stderr.
    """
    line = _Line(after)
    line.thread.start()
    try:
        yield line.step
    finally:
        line.end()


@contextlib.contextmanager
def doing(text: str) -> Iterator[None]:
    """Show on a terminal what is being done, as `waiting` does; elsewhere nothing."""
    if not is_terminal(sys.stderr):
        yield
        return
    with waiting() as step:
        step(text)
        yield


class _Line:
    def __init__(self, after: float) -> None:
        self._after, self._drawn = after, False
        self._step = self._text = self._far = ""
        self._began = time.monotonic()
        self._redraws = is_terminal(sys.stderr)
        self._lock, self._ended = threading.Lock(), threading.Event()
        self.thread = threading.Thread(target=self._run, name="pinsing progress", daemon=True)

    def step(self, text: str, far: str = "") -> None:
        """The command is at a new step, or farther in the one it was at; an empty text is none."""
        with self._lock:
            if text != self._step:
                self._clear()
                self._step = self._text = text
                self._began = time.monotonic()
            self._far = far

    def end(self) -> None:
        self._ended.set()
        self.thread.join()
        self._clear()

    def _run(self) -> None:
        while not self._ended.wait(min(_AGAIN, self._after)):
            with self._lock:
                taken = time.monotonic() - self._began
                if self._text and taken >= self._after:
                    self._show(taken)

    def _show(self, taken: float) -> None:
        if self._redraws:
            text = f"pinsing: {self._text} \u2026 {taken:.0f} s {self._far}".rstrip()
            sys.stderr.write(f"\r\x1b[K{text[: Page.of(sys.stderr).width - 1]}")
            sys.stderr.flush()
            self._drawn = True
        else:
            say(f"{self._text} \u2026")
            self._text = ""  # once is enough

    def _clear(self) -> None:
        if self._drawn:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._drawn = False
