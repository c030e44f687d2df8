"""A time budget for algebra whose single steps cannot be interrupted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

_TERM_PRODUCTS_PER_SECOND = 1e7
"""About what sparse multiplication manages; a step that would outlast the budget is not begun."""
_LARGEST_TO_FACTOR = 30_000
_LONG = 0.5
"""Seconds after which, or for a step of which, a computation counts as long."""
_LONG_TO_FACTOR = 150
"""Terms from which on factoring may take long."""


class BudgetExceeded(Exception):
    """The time that was allowed is over, or the next step would outlast it."""


class Budget:
    """Time left, asked before every step that can be long.

    Parameters
    ----------
    seconds : float
        Time allowed from now on, on the clock.
    processor : float
        Besides, processor time of this process: the answer does not depend, then, on what else
        the machine does, unless the clock runs out first.
    long_to_factor : int
        Terms of a polynomial from which on factoring it may take long.
    """

    def __init__(
        self, seconds: float, processor: float = math.inf, long_to_factor: int = _LONG_TO_FACTOR
    ) -> None:
        self.seconds, self.processor, self._long_to_factor = seconds, processor, long_to_factor
        self.when_long: Callable[[], None] | None = None
        """Called before a step when the computation has become long, or is about to."""
        self._began = time.monotonic()
        self._deadline = self._began + seconds
        # To ask for processor time is a call into the system: not where any will do.
        self._last = time.process_time() + processor if processor < math.inf else math.inf

    @property
    def left(self) -> float:
        """Seconds left, 0 if there are none."""
        return max(0.0, min(self._deadline - time.monotonic(), self._processor_left))

    @property
    def over(self) -> bool:
        """Whether the time has run out."""
        return time.monotonic() > self._deadline or self._processor_left < 0.0

    @property
    def _processor_left(self) -> float:
        """Seconds of processor time left, negative once they are over."""
        return math.inf if self._last == math.inf else self._last - time.process_time()

    @property
    def allowed(self) -> str:
        """The time that was allowed, in words: that which is used up, or nearer to it."""
        clock = (self._deadline - time.monotonic()) / max(self.seconds, 1e-300)
        used = self._processor_left / max(self.processor, 1e-300)
        if math.isfinite(self.processor) and used <= clock:
            return f"{self.processor:.3g} s of processor time"
        return f"{self.seconds:.3g} s"

    def part(self, share: float) -> Budget:
        """A share of what is left."""
        on_clock, used = self._deadline - time.monotonic(), self._processor_left
        return Budget(share * max(0.0, on_clock), share * max(0.0, used))

    def at_least(self, share: float) -> Budget:
        """What is left, or a share of the whole if that is more."""
        return Budget(max(self._deadline - time.monotonic(), share * self.seconds))

    def check(self, term_products: float = 0.0) -> None:
        """Raise BudgetExceeded unless a step of about so many term products fits in."""
        expected = term_products / _TERM_PRODUCTS_PER_SECOND
        now = time.monotonic()
        if now + expected > self._deadline:
            raise BudgetExceeded(f"the time budget of {self.seconds:.3g} s ran out")
        if expected > self._processor_left:
            raise BudgetExceeded(f"the budget of {self.processor:.3g} s of processor time ran out")
        if self.when_long is not None and max(now - self._began, expected) > _LONG:
            self.when_long()

    def check_factor(self, terms: int, long: int | None = None) -> None:
        """Raise BudgetExceeded if a polynomial is too long to factor or to take a gcd of.

        Parameters
        ----------
        terms : int
            Of the polynomial.
        long : int
            Terms from which on that may take long; as the budget says if not given.
        """
        self.check()
        if self.when_long is not None and terms > (long or self._long_to_factor):
            self.when_long()
        if terms > _LARGEST_TO_FACTOR:
            raise BudgetExceeded(f"a polynomial of {terms} terms was too long to factor")
