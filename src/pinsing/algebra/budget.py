"""A budget for algebra, counted in work: the same input gives the same answer on any machine.

Work is counted in products of terms, which every step says before it begins, and the time on the
clock is a cap beyond that: it strikes on slow or busy machines only, and for what was not foreseen.
"""

from __future__ import annotations

import time
from collections.abc import Callable

PER_SECOND = 1e7
"""Products of terms that one second of a budget stands for. A machine that has nothing else to do
takes about 0.6 s for them: a busy one does the same work before the clock strikes."""
_QUESTION = 6_000.0
"""Work that a question stands for besides: what lies between two of them takes some 0.4 ms."""
_CLOCK = 1.25
"""Seconds on the clock for a second of work."""
_END = 1.4
"""The same for all parts together, those included that have a least share of the whole."""
_LARGEST_TO_FACTOR = 30_000
_LONG = 0.5
"""Seconds after which, or for a step of which, a computation counts as long."""
_LONG_TO_FACTOR = 150
"""Terms from which on factoring may take long."""
_OF_A_TERM = 5.0
"""Work that factoring, or a gcd, takes per term and its logarithm."""


class BudgetExceeded(Exception):
    """What was allowed is over, or the next step would outlast it."""


class _Meter:
    """Work done by all parts of a budget together, and what to do when it becomes long."""

    def __init__(self) -> None:
        self.done = 0.0
        self.when_long: Callable[[], None] | None = None


class Budget:
    """Work left, asked before every step that can be long.

    Parameters
    ----------
    seconds : float
        Time on the clock, and the work that is done in it.
    work : float
        Seconds' worth of work, where it is not that.
    long_to_factor : int
        Terms of a polynomial from which on factoring it may take long.
    """

    def __init__(
        self, seconds: float, work: float | None = None, long_to_factor: int = _LONG_TO_FACTOR
    ) -> None:
        self.seconds, self._long_to_factor = seconds if work is None else work, long_to_factor
        self._began = time.monotonic()
        self._deadline = self._began + (_CLOCK * seconds if work is None else seconds)
        self._end = self._began + (_END * seconds if work is None else seconds)
        self._meter = _Meter()
        self._most = PER_SECOND * self.seconds

    @property
    def when_long(self) -> Callable[[], None] | None:
        """Called before a step when the computation has become long, or is about to."""
        return self._meter.when_long

    @when_long.setter
    def when_long(self, call: Callable[[], None] | None) -> None:
        self._meter.when_long = call

    @property
    def left(self) -> float:
        """Seconds' worth of work left, 0 if there is none."""
        return max(0.0, self._most - self._meter.done) / PER_SECOND

    @property
    def on_clock(self) -> float:
        """Seconds left on the clock."""
        return max(0.0, self._deadline - time.monotonic())

    @property
    def done(self) -> float:
        """Work done so far, by all parts together."""
        return self._meter.done

    @property
    def over(self) -> bool:
        """Whether work or time has run out."""
        return self._meter.done > self._most or time.monotonic() > self._deadline

    @property
    def allowed(self) -> str:
        """What was allowed, in words: the work, or the time if that has struck."""
        if time.monotonic() > self._deadline:
            return f"{self._deadline - self._began:.3g} s on the clock"
        return f"{self.seconds:.3g} s of work"

    def part(self, share: float, least: float = 0.0) -> Budget:
        """A share of what is left, or one of the whole if that is more; its work counts here."""
        found = Budget(
            max(share * self.left, least * self.seconds), long_to_factor=self._long_to_factor
        )
        found._meter, found._most = self._meter, self._meter.done + PER_SECOND * found.seconds
        clock = max(share * self.on_clock, _CLOCK * least * self.seconds)
        found._end, found._deadline = self._end, min(found._began + clock, self._end)
        return found

    def at_most(self, seconds: float) -> Budget:
        """What is left, if no more than some seconds' worth."""
        found = self.part(1.0)
        found._most = min(found._most, self._meter.done + PER_SECOND * seconds)
        return found

    def spend(self, work: float) -> None:
        """Count work that was done."""
        self._meter.done += work

    def stop(self, work: float = 0.0) -> bool:
        """Count a step of so much work, and say whether the budget is over."""
        self.spend(_QUESTION + work)
        return self.over

    def check(self, term_products: float = 0.0) -> None:
        """Count a step of about so many term products; BudgetExceeded unless it fits in."""
        now = time.monotonic()
        if now > self._deadline:
            raise BudgetExceeded(f"the time budget of {self._deadline - self._began:.3g} s ran out")
        self.spend(_QUESTION + term_products)
        if self._meter.done > self._most:
            self._meter.done -= term_products  # it is not begun
            raise BudgetExceeded(f"the work budget of {self.seconds:.3g} s ran out")
        expected = term_products / PER_SECOND
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
        self.check(_OF_A_TERM * terms * max(terms, 1).bit_length())
        if self.when_long is not None and terms > (long or self._long_to_factor):
            self.when_long()
        if terms > _LARGEST_TO_FACTOR:
            raise BudgetExceeded(f"a polynomial of {terms} terms was too long to factor")
