"""The stages of an analysis under one clock: what is cut short is said, and nothing is lost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TypeVar

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
