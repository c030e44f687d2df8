"""Minors that vanish on a family because others do, by the relations between minors (Laplace)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pinsing._dataclass import dataclass
from pinsing.proof.checker import Certificate, Poly
from pinsing.proof.forms import Forms, content
from pinsing.proof.place import Place
from pinsing.proof.skeleton import form_text

Sum = list[list[Any]]
"""Terms: a polynomial as text, and the number of the form of a family that it is times."""
Lines = tuple[tuple[int, ...], tuple[int, ...]]
"""Rows and columns of a minor."""


@dataclass(frozen=True)
class _Known:
    """Why a minor vanishes on a family: times units it is a sum of multiples of its relations.

    Attributes
    ----------
    terms : dict of int to Poly
        What each relation is multiplied by.
    units : Poly
        What the minor is multiplied by: units and a number.
    depth : int
        Over how many other minors: 0 for a multiple of one relation.
    """

    terms: dict[int, Poly]
    units: Poly
    depth: int


def sums_to_minors(draft: Certificate, tidy: Forms, family: Place) -> tuple[list[Sum], list[Poly]]:
    """Sums of multiples of a family's forms that are minors, but for units; and what they are.

    A row of the matrix with one more column than a minor has gives a sum that is zero: its
    entries times the minors without their columns, with signs (Laplace). Where all but one of
    these are known to be such sums, or their entry is zero, and that one's entry is a unit, so
    is the last one.
    """
    if draft.sides[1] <= draft.rank or not family.relations:
        return [], []
    return _Minors(draft, tidy, family).sums()


class _Minors:
    """The minors of a certificate's matrix on one family."""

    def __init__(self, draft: Certificate, tidy: Forms, family: Place) -> None:
        self.tidy = tidy
        self.draft, self.ring, self.family = draft, draft.ring, family
        values = family.values
        self.entries = [[self.ring.put(x, values) for x in row] for row in draft.matrix]
        self.constant = [[self._is_unit(x) for x in row] for row in self.entries]
        chosen = (itertools.combinations(range(side), draft.rank) for side in draft.sides)
        minor: Callable[..., Poly] = draft.at(values)
        self.minors: dict[Lines, Poly] = {}
        for lines in itertools.product(*chosen):
            tidy.require_time()
            self.ring.work = 0  # what is counted is one step here, the whole check there
            self.minors[lines] = minor(*lines)
        self.known: dict[Lines, _Known] = {}

    def sums(self) -> tuple[list[Sum], list[Poly]]:
        """One sum for each minor that is no multiple of a form, where there is one."""
        for lines, minor in self.minors.items():
            if (multiple := self._multiple(minor)) is not None:
                self.known[lines] = multiple
        while more := {lines: one for lines in self._unknown() if (one := self._sum(lines))}:
            self.known |= more
        found: list[Sum] = []
        totals: list[Poly] = []
        for lines, known in sorted(self.known.items(), key=lambda item: item[1].depth):
            self.tidy.require_time()
            minor = self.minors[lines]
            self.ring.work = 0
            if known.depth == 0 or any(self.ring.divides(p, minor) for p in totals):
                continue
            total = self._written(known)
            found.append(total)
            put = self.ring.put(self.draft.sum(total, self.family.forms), self.family.values)
            totals += self.ring.stripped(put)
        return found, totals

    def _unknown(self) -> list[Lines]:
        return [lines for lines in self.minors if lines not in self.known]

    def _is_unit(self, entry: Poly) -> bool:
        return entry != 0 and not self.ring.joints(self.ring.stripped(entry)[0])

    def _multiple(self, minor: Poly) -> _Known | None:
        """A minor that is a multiple of one relation, or zero."""
        if minor == 0:
            return _Known({}, self.ring.one, 0)
        for at, p in enumerate(self.family.relations):
            if self.ring.divides(p, minor):
                return _Known({at: self.ring.reduced(divmod(minor, p)[0])}, self.ring.one, 0)
        return None

    def _sum(self, lines: Lines) -> _Known | None:
        """The shortest of the sums that a minor is by what is known."""
        self.tidy.require_time()
        self.ring.work = 0
        ways = [
            (sum(len(c) for _, known, _ in terms for c in known.terms.values()), n, i, extra, terms)
            for n, (i, extra, terms) in enumerate(self._relations(lines))
        ]
        if not ways:
            return None
        *_, i, extra, terms = min(ways, key=lambda way: way[:2])
        unit = self.entries[i][extra]
        common = self.ring.one
        for _, known, _ in terms:
            common = self._multiple_of_both(common, known.units)
        total: dict[int, Poly] = {}
        for sign, known, entry in terms:
            factor = entry * divmod(common, known.units)[0] * sign
            for at, c in known.terms.items():
                total[at] = self.ring.reduced(total.get(at, self.ring.zero) + c * factor)
        total = {at: c for at, c in total.items() if c != 0}
        units = self.ring.reduced(common * unit)
        *left, units = self.ring.stripped(*total.values(), units)
        depth = 1 + max((known.depth for _, known, _ in terms), default=0)
        return _Known(dict(zip(total, left, strict=True)), units, depth)

    def _multiple_of_both(self, a: Poly, b: Poly) -> Poly:
        return a * divmod(b, a.gcd(b))[0]

    def _relations(self, lines: Lines) -> Iterator[tuple[int, int, list[tuple[int, _Known, Poly]]]]:
        """Rows and columns by which a minor follows from known ones, with these and their factors.

        As the entry there times the minor is minus the others' sum, with the entry's own sign.
        """
        rows, columns = lines
        for i, extra in itertools.product(rows, range(self.draft.sides[1])):
            if extra in columns or not self.constant[i][extra]:
                continue
            every = tuple(sorted({*columns, extra}))
            own = -((-1) ** every.index(extra))
            others = [
                ((-1) ** k * own, self.known.get((rows, every[:k] + every[k + 1 :])), entry)
                for k, j in enumerate(every)
                if j != extra and (entry := self.entries[i][j]) != 0
            ]
            terms = [(sign, known, entry) for sign, known, entry in others if known is not None]
            if len(terms) == len(others):
                yield i, extra, terms

    def _written(self, known: _Known) -> Sum:
        """A sum as text, without units and in small numbers: it is compared without them."""
        short = self.ring.stripped(*known.terms.values())
        return sum_of(len(self.family.values), dict(zip(known.terms, short, strict=True)))


def sum_of(first: int, multiples: Mapping[int, Poly]) -> Sum:
    """A sum as text: what each form is multiplied by, which are counted from ``first``."""
    terms = {k: c for k, c in multiples.items() if c != 0}
    number = content(*terms.values())
    return [[form_text(c / number), first + k] for k, c in terms.items()]
