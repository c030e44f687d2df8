"""Rows and columns of a certificate's matrix that others make up: they are left out."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.geometry.surd import Exact, surd
from pinsing.proof.checker import Certificate, Matrix, Poly, flipped
from pinsing.proof.skeleton import number_text

_POSITION = {(0, 0): 0, (1, 0): 1, (0, 1): 2, (1, 1): 3}

_ASKED_AFTER = 1000
"""Products of terms, some tenths of a millisecond, between two looks at the clock."""

_KEPT = 1_000_000
"""Terms of resultants that are kept: some hundred megabytes."""


class Draft(Certificate):
    """A certificate in the making: the Jacobian of its chain is found once for all drafts.

    Finding it, which takes long for many joints, ends with the time of a budget.
    """

    def __init__(
        self, data: dict[str, Any], jacobian: Matrix | None = None, budget: Budget | None = None
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
        if self.known_jacobian is None:
            spend = self.ring.spend
            self.ring.spend = self._in_time  # type: ignore[method-assign]
            self.known_jacobian = super().jacobian()
            self.ring.spend = spend  # type: ignore[method-assign]
        return self.known_jacobian

    def _in_time(self, work: int) -> None:
        """Count as the checker does, unless so many products of terms would outlast the time."""
        self._unasked += work + 1
        if self._budget is not None and self._unasked > _ASKED_AFTER:
            self._budget.check(self._unasked)
            self._unasked = 0
        type(self.ring).spend(self.ring, work)


def without_dependent_lines(
    data: Mapping[str, Any], budget: Budget
) -> tuple[dict[str, Any], Matrix]:
    """The certificate with the steps that make dependent lines zero, and its whole Jacobian.

    Raises
    ------
    BudgetExceeded
        If there is no time for it.
    """
    whole = Draft({**data, "rank": 1, "row_steps": [], "column_steps": []}, budget=budget)
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
    return [[i, k, number_text(c)] for i, terms in found.items() for k, c in terms.items()]


def _vector(certificate: Certificate, line: list[Any]) -> dict[Any, Exact]:
    """Coefficients of a row or column, by entry and monomial."""
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


def _dependent(lines: list[dict[Any, Exact]], budget: Budget) -> dict[int, dict[int, Exact]]:
    """Lines that are sums of multiples of earlier ones that stay, and these multiples."""
    basis: list[tuple[Any, dict[Any, Exact], dict[int, Exact]]] = []
    found: dict[int, dict[int, Exact]] = {}
    for i, line in enumerate(lines):
        vector, terms = dict(line), dict[int, Exact]({i: Fraction(1)})
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


def _less(a: Mapping[Any, Exact], ratio: Exact, b: Mapping[Any, Exact]) -> dict[Any, Exact]:
    """Return a - ratio b, without zeros."""
    out = dict(a)
    for key, c in b.items():
        out[key] = out.get(key, Fraction(0)) - ratio * c
    return {k: c for k, c in out.items() if c != 0}
