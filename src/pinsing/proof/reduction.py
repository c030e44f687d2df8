"""Rows and columns of a certificate's matrix that others make up: they are left out."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, TypeAlias

from pinsing.algebra.budget import Budget
from pinsing.proof.checker import Certificate, Matrix, Poly, Ring, flipped
from pinsing.proof.skeleton import number_text
from pinsing.robot.surd import surd

Number: TypeAlias = Any
"""An exact number: fmpq over the rationals, `Exact` where there are square roots."""

_POSITION = {(0, 0): 0, (1, 0): 1, (0, 1): 2, (1, 1): 3}

_ASKED_AFTER = 100_000
"""Products of terms, some milliseconds, between two questions to the budget."""

_STEP = 30
"""Products of terms that take as long as what else a step does, some microseconds."""

_KEPT = 1_000_000
"""Terms of resultants that are kept: some hundred megabytes."""


class Draft(Certificate):
    """A certificate in the making: the Jacobian of its chain is found once for all drafts.

    All that its ring does is counted, and ends with a budget.
    """

    def __init__(
        self, data: dict[str, Any], budget: Budget, jacobian: Matrix | None = None
    ) -> None:
        self.known_jacobian = jacobian
        self._budget = budget
        self._unasked = _ASKED_AFTER  # the first product asks: there may be no time at all
        super().__init__(data)
        self._resultants: dict[tuple[str, str, int], Poly] = {}
        self._kept = 0
        self._resultant, self.ring.resultant = self.ring.resultant, self._known_resultant  # type: ignore[method-assign]

    def _known_resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """As the checker finds it; a search asks for the same ones again and again."""
        if self._kept > _KEPT:
            return self._resultant(p, g, joint)
        key = (str(p), str(g), joint)
        self.ring.spend(1000)  # finding it again takes time, too
        if key not in self._resultants:
            self._resultants[key] = self._resultant(p, g, joint)
            self._kept += len(p) + len(g) + len(self._resultants[key])
        return self._resultants[key]

    def jacobian(self) -> Matrix:
        """As the checker finds it, which does so by itself in the end."""
        self.ring.spend = self._in_time  # type: ignore[method-assign]
        if self.known_jacobian is None:
            self.known_jacobian = super().jacobian()
        return self.known_jacobian

    def _in_time(self, work: int) -> None:
        """Count as the checker does, unless the budget has no room for so many products."""
        self._unasked += work + _STEP
        if self._unasked > _ASKED_AFTER:
            self._budget.check(self._unasked)
            self._unasked = 0
        Ring.spend(self.ring, work)


def without_dependent_lines(
    data: Mapping[str, Any], budget: Budget
) -> tuple[dict[str, Any], Matrix]:
    """The certificate with the steps that make dependent lines zero, and its whole Jacobian.

    Raises
    ------
    BudgetExceeded
        If there is no time for it.
    """
    whole = Draft({**data, "rank": 1, "row_steps": [], "column_steps": []}, budget)
    rows = _steps(whole, whole.jacobian(), budget)
    columns = _steps(whole, flipped(whole.without_dependent(whole.jacobian(), rows)), budget)
    return {**data, "row_steps": rows, "column_steps": columns}, whole.jacobian()


def _steps(certificate: Certificate, lines: Matrix, budget: Budget) -> list[list[Any]]:
    """Which multiple of which line is taken from which."""
    vectors = []
    for line in lines:
        budget.check()
        vectors.append(_vector(certificate, line))
    found = _dependent(vectors, budget)
    text = number_text if certificate.data["square_roots"] else str
    return [[i, k, text(c)] for i, terms in found.items() for k, c in terms.items()]


def _vector(certificate: Certificate, line: list[Any]) -> dict[Any, Number]:
    """Coefficients of a row or column, by entry and monomial."""
    if not certificate.data["square_roots"]:
        return {(k, m): c for k, x in enumerate(line) for m, c in x.to_dict().items()}
    count = 2 * len(certificate.ring.pairs)
    roots = certificate.data["square_roots"]
    parts: dict[Any, list[Fraction]] = {}
    for k, x in enumerate(line):
        for m, c in x.to_dict().items():
            at = dict(zip(roots, m[count:], strict=True))
            place = _POSITION[at.get(2, 0), at.get(3, 0)]
            four = parts.setdefault((k, tuple(m[:count])), [Fraction(0)] * 4)
            four[place] += Fraction(int(c.p), int(c.q))
    return {key: surd(*four) for key, four in parts.items()}


def _dependent(lines: list[dict[Any, Number]], budget: Budget) -> dict[int, dict[int, Number]]:
    """Lines that are sums of multiples of earlier ones that stay, and these multiples."""
    basis: list[tuple[Any, dict[Any, Number], dict[int, Number]]] = []
    found: dict[int, dict[int, Number]] = {}
    for i, line in enumerate(lines):
        # One as a number of the line's kind; a line of zeros stands for itself.
        one = next((c / c for c in line.values()), Fraction(1))
        vector, terms = dict(line), dict[int, Number]({i: one})
        for lead, other, other_terms in basis:
            if lead in vector:
                budget.check()
                ratio = vector[lead] / other[lead]
                vector = _less(vector, ratio, other)
                terms = _less(terms, ratio, other_terms)
        if vector:
            basis.append((next(iter(vector)), vector, terms))
        else:
            found[i] = {k: -c for k, c in terms.items() if k != i}
    return found


def _less(a: Mapping[Any, Number], ratio: Number, b: Mapping[Any, Number]) -> dict[Any, Number]:
    """Return a - ratio b, without zeros."""
    out = dict(a)
    for key, c in b.items():
        out[key] = out[key] - ratio * c if key in out else -(ratio * c)
    return {k: c for k, c in out.items() if c != 0}
