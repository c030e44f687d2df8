"""Why a family is singular: minors that are multiples of its forms, and others by these."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from flint import fmpq_mat

from pinsing.proof.checker import MOST_WORK, Certificate, Poly, Ring
from pinsing.proof.forms import Forms, NotFound, Place, content, divisions, place_text, shown
from pinsing.proof.skeleton import form_text


def combination(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    """Return factors of others whose sum is a form times units; None if none was found."""
    # Unlike division it needs no order of the joints: the others may all have the same ones.
    if ring.squares:
        return None
    joints = sorted({j for p in others for j in ring.joints(p)})
    # Powers of units that a form is multiplied by, less one: they are zero at no configuration.
    for _ in range(3):
        found = _solved(ring, form, others)
        if found is not None:
            return found
        for j in joints:
            form = form * ring.unit[j]
    return None


def _solved(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    terms = [(k, m) for k, p in enumerate(others) for m in _monomials(ring, form, p)]
    # Unknown coefficients beyond which nothing is solved.
    if not terms or len(terms) > 600:
        return None
    columns = [(others[k] * m).to_dict() for k, m in terms]
    target = form.to_dict()
    rows = {m: i for i, m in enumerate(sorted({*target, *itertools.chain(*columns)}))}
    matrix = fmpq_mat(len(rows), len(columns) + 1)
    for at, column in enumerate([*columns, target]):
        for m, c in column.items():
            matrix[rows[m], at] = c
    ring.spend(matrix.nrows() * matrix.ncols())
    reduced, rank = matrix.rref()
    found = [ring.zero for _ in others]
    for i in range(rank):
        lead = next(at for at in range(len(columns) + 1) if reduced[i, at] != 0)
        if lead == len(columns):
            return None
        k, m = terms[lead]
        found[k] += reduced[i, len(columns)] * m
    return found


def _monomials(ring: Ring, form: Poly, p: Poly) -> Iterator[Poly]:
    """Return what a form of the degree of ``form`` over ``p`` may consist of."""
    parts = []
    for j, (x, y) in enumerate(ring.pairs):
        left = ring.degree(form, j) - ring.degree(p, j)
        if left < 0:
            return
        parts.append([x ** (left - e) * y**e for e in range(left + 1)])
    for factors in itertools.product(*parts):
        product = ring.one
        for f in factors:
            product = product * f
        yield product


Sum = list[list[Any]]
"""Terms: a polynomial as text, and the number of the form of a family that it is times."""
Lines = tuple[tuple[int, ...], tuple[int, ...]]
"""Rows and columns of a minor."""


@dataclass(frozen=True)
class _Known:
    """Why a minor vanishes on a family: times units it is a sum of multiples of its relations."""

    terms: dict[int, Poly]  # what each relation is multiplied by
    units: Poly  # what the minor is multiplied by: units and a number
    depth: int  # over how many other minors: 0 for a multiple of one relation


class _Minors:
    """Which minors are sums of multiples of a family's forms, but for units.

    A row of the matrix with one more column than a minor has gives a sum that is zero: its entries
    times the minors without their columns, with signs (Laplace). Where all but one of these are
    known to be such sums, or their entry is zero, and that one's entry is a unit, so is the last
    one.
    """

    def __init__(
        self, draft: Certificate, tidy: Forms, family: Place, minors: Mapping[Lines, Poly]
    ) -> None:
        self.tidy, self.minors = tidy, minors
        self.draft, self.ring, self.family = draft, draft.ring, family
        values = family.values
        self.entries = [[self.ring.put(x, values) for x in row] for row in draft.matrix]
        self.constant = [
            [(x != 0 and not self.ring.joints(self.ring.stripped(x)[0])) for x in row]
            for row in self.entries
        ]
        self.known: dict[Lines, _Known] = {}

    def sums(self) -> tuple[list[Sum], list[Poly]]:
        """One sum for each minor that is no multiple of a form, where there is one; its value."""
        if self.draft.sides[1] <= self.draft.rank or not self.family.relations:
            return [], []
        for lines, minor in self.minors.items():
            if (multiple := self._multiple(minor)) is not None:
                self.known[lines] = multiple
        while more := {
            lines: one
            for lines in [lines for lines in self.minors if lines not in self.known]
            if (one := self._sum(lines))
        }:
            self.known |= more
        found: list[Sum] = []
        totals: list[Poly] = []
        for lines, known in sorted(self.known.items(), key=lambda item: item[1].depth):
            self.tidy.require_time()
            minor = self.minors[lines]
            if known.depth == 0 or any(self.ring.divides(p, minor) for p in totals):
                continue
            total = self._written(known)
            found.append(total)
            put = self.ring.put(self.draft.sum(total, self.family.forms), self.family.values)
            totals += self.ring.stripped(put)
        return found, totals

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
            common = common * divmod(known.units, common.gcd(known.units))[0]
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

    def _relations(self, lines: Lines) -> Iterator[tuple[int, int, list[tuple[int, _Known, Poly]]]]:
        """Yield rows and columns by which a minor follows from known ones, with these and factors.

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


@dataclass
class Soundness:
    """What a certificate says for a family: the minors that have the pivot's lines vanish there."""

    # a minor that is zero on no component; without lines it is 1, and all minors are meant
    pivot: Lines = ((), ())
    # forms that are zero on no component: the minors may be multiplied by them
    apart: list[Poly] = field(default_factory=list)
    # sums of multiples of the family's forms that these minors are multiples of
    multiples: list[Sum] = field(default_factory=list)


def soundness(draft: Certificate, tidy: Forms, family: Place, codimension: int) -> Soundness:
    """Why all minors vanish on a family, of a codimension; NotFound if that was not seen."""
    minors, at = dict[Lines, Poly](), draft.at(family.values)
    place = (family.values, family.relations)
    plain: set[Lines] = set()
    for lines in _lines(draft, draft.rank):
        tidy.require_time()
        minors[lines] = minor = at(*lines)
        if draft.ring.vanishes(minor, place):
            plain.add(lines)
    if len(plain) == len(minors):
        return Soundness()
    # Only of as many forms as its codimension is a family known to have nothing smaller.
    exact = codimension == len(family.forms)
    tried: set[Lines] = set()
    pivot = _pivot(draft, tidy, family, plain, tried) if exact else None
    if pivot is not None:
        return Soundness(pivot)
    found = Soundness()
    for lines, minor in sorted(minors.items(), key=lambda item: len(item[1])) if exact else ():
        if lines not in plain and _by_division(draft, tidy, family, minor, found):
            plain.add(lines)
            pivot = _pivot(draft, tidy, family, plain, tried)
            if pivot is not None:
                found.pivot = pivot
                return found
    multiples, totals = _Minors(draft, tidy, family, minors).sums()
    for minor in minors.values():
        tidy.require_time()
        place = (family.values, [*family.relations, *totals])
        if draft.ring.vanishes(minor, place):
            continue
        combined = combination(draft.ring, draft.ring.stripped(minor)[0], family.relations)
        if combined is None:
            break
        multiples.append(sum_of(len(family.values), dict(enumerate(combined))))
        totals += draft.ring.stripped(minor)
    else:
        return Soundness(multiples=multiples)
    raise NotFound(f"{place_text(family)} is not shown to be singular")


def _by_division(
    draft: Certificate, tidy: Forms, family: Place, minor: Poly, found: Soundness
) -> bool:
    """Add a sum that a minor is a multiple of, but for what is zero on no component."""
    ring = draft.ring
    for f, _ in tidy.factors(minor):
        tidy.require_time()
        for tops, times, multiples in divisions(ring, f, family.relations):
            if not _is_apart(draft, family, tops):
                continue
            found.multiples.append(sum_of(len(family.values), dict(enumerate(multiples))))
            for factor, power in tidy.factors(times):
                found.apart += [factor] * (power - found.apart.count(factor))
            return True
    return False


def _is_apart(draft: Certificate, family: Place, form: Poly) -> bool:
    """Return True if a form is seen to be zero on no component of a family."""
    count = len(family.relations) + 1
    forms = [*family.relations, *draft.ring.stripped(form)]
    return shown(draft.ring, lambda: draft.ring.codimension_at_least(count, forms), most=MOST_WORK)


def _lines(draft: Certificate, size: int) -> Iterable[Lines]:
    """Rows and columns of all minors of a size."""
    rows, columns = (itertools.combinations(range(side), size) for side in draft.sides)
    return itertools.product(rows, columns)


def _pivot(
    draft: Certificate, tidy: Forms, family: Place, plain: set[Lines], tried: set[Lines]
) -> Lines | None:
    """Return the shortest minor of one line less, zero on no component, that only plain ones have.

    Without lines where all are plain.
    """
    if len(plain) == math.prod(math.comb(side, draft.rank) for side in draft.sides):
        return (), ()
    found: list[tuple[int, Lines]] = []
    minor = draft.at(family.values)
    for lines in _lines(draft, draft.rank - 1):
        tidy.require_time()
        wider = (
            [tuple(sorted((*part, k))) for k in range(count) if k not in part]
            for part, count in zip(lines, draft.sides, strict=True)
        )
        if lines in tried or not plain.issuperset(itertools.product(*wider)):
            continue
        if (form := minor(*lines)) != 0:
            found.append((len(draft.ring.stripped(form)[0]), lines))
    # Pivots that are tried, the shortest first.
    for _, lines in sorted(found)[:12]:
        tidy.require_time()
        tried.add(lines)
        if _is_apart(draft, family, minor(*lines)):
            return lines
    return None
