"""A time budget for algebra whose single steps cannot be interrupted."""

from __future__ import annotations

import time

_TERM_PRODUCTS_PER_SECOND = 1e7
"""About what sparse multiplication manages; a step that would outlast the budget is not begun."""
_LARGEST_TO_FACTOR = 30_000


class BudgetExceeded(Exception):
    """The time that was allowed is over, or the next step would outlast it."""


class Budget:
    """Time left, asked before every step that can be long.

    Parameters
    ----------
    seconds : float
        Time allowed from now on.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._deadline = time.monotonic() + seconds

    @property
    def over(self) -> bool:
        """Whether the time has run out."""
        return time.monotonic() > self._deadline

    def at_least(self, share: float) -> Budget:
        """What is left, or a share of the whole if that is more."""
        return Budget(max(self._deadline - time.monotonic(), share * self.seconds))

    def check(self, term_products: float = 0.0) -> None:
        """Raise BudgetExceeded unless a step of about so many term products fits in."""
        expected = term_products / _TERM_PRODUCTS_PER_SECOND
        if time.monotonic() + expected > self._deadline:
            raise BudgetExceeded(f"the time budget of {self.seconds:.3g} s ran out")

    def check_factor(self, terms: int) -> None:
        """Raise BudgetExceeded if a polynomial is too long to factor or to take a gcd of."""
        self.check()
        if terms > _LARGEST_TO_FACTOR:
            raise BudgetExceeded(f"a polynomial of {terms} terms was too long to factor")
