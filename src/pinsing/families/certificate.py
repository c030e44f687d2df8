"""Makes certificates: of an arm's chain and families, with the tree of cases that closes them.

Case splits that end in families: found by factoring, for the checker to follow without.

A place is some joints at values and some polynomials that vanish. It is closed where it lies in
a family, where it is too small for a component, or where it has no real point; else a polynomial
that vanishes on all its components is factored, and every factor leads to another place.

Why a family is singular: minors that are multiples of its forms, and others by these.

The search is begun with every closed form unless none is wanted, ends with a budget, and says
what became of it.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import operator
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from flint import fmpq_mat

from pinsing.algebra.budget import Apart, Budget, BudgetExceeded
from pinsing.algebra.jacobian_matrix import Lines, constants
from pinsing.algebra.ring import MadeOfEqual, make_ring
from pinsing.families.faithful import disagreements
from pinsing.families.form import ClosedForm, Proof
from pinsing.families.proof_forms import (
    Draft,
    NotFound,
    Place,
    Source,
    Split,
    content,
    division,
    divisions,
    form_of,
    form_text,
    place_text,
    roots_in,
    skeleton,
    squares,
    vanishes,
)
from pinsing.proof.checker import MOST_WORK, Matrix, Poly, Rejected, Ring, verify
from pinsing.robot.mimic import NotFollowed
from pinsing.robot.surd import Surd


def combination(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    """Return factors of others whose sum is a form times units; None if none was found."""
    # Unlike division it needs no order of the joints: the others may all have the same ones.
    if ring.squares:
        return None
    joints = sorted({j for p in others for j in ring.joints(p)})
    # Powers of units that a form is multiplied by, less one: they are zero at no configuration.
    for _ in range(3):
        if (found := _solved(ring, form, others)) is not None:
            return found
        for j in joints:
            form = form * ring.unit[j]
    return None


def _solved(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    terms = [(k, m) for k, p in enumerate(others) for m in _monomials(ring, form, p)]
    # Unknown coefficients beyond which nothing is solved.
    if not terms or len(terms) > 600:
        return None
    columns = [*((others[k] * m).to_dict() for k, m in terms), form.to_dict()]
    rows = sorted({*itertools.chain(*columns)})
    every = [column.get(m, 0) for m in rows for column in columns]
    ring.spend(len(every))
    reduced, rank = fmpq_mat(len(rows), len(columns), every).rref()
    found = [ring.zero for _ in others]
    for i in range(rank):
        lead = next(at for at in range(len(columns)) if reduced[i, at] != 0)
        if lead == len(terms):
            return None
        k, m = terms[lead]
        found[k] += reduced[i, len(terms)] * m
    return found


def _monomials(ring: Ring, form: Poly, p: Poly) -> Iterator[Poly]:
    """Return what a form of the degree of ``form`` over ``p`` may consist of."""
    parts = []
    for j, (x, y) in enumerate(ring.pairs):
        if (left := ring.degree(form, j) - ring.degree(p, j)) < 0:
            return
        parts.append([x ** (left - e) * y**e for e in range(left + 1)])
    for factors in itertools.product(*parts):
        yield math.prod(factors, start=ring.one)


Sum = list[list[Any]]
"""Terms: a polynomial as text, and the number of the form of a family that it is times."""


@dataclass(frozen=True)
class _Known:
    """Why a minor vanishes on a family: times units it is a sum of multiples of its relations."""

    multiples: list[Poly]  # of each relation
    units: Poly  # what the minor is multiplied by: units and a number
    depth: int  # over how many other minors: 0 for a multiple of one relation


def _sums(
    draft: Draft, family: Place, minors: Mapping[Lines, Poly]
) -> tuple[list[Sum], list[Poly]]:
    """One sum for each minor that is no multiple of a form, where there is one; its value.

    A row of the matrix with one more column than a minor has gives a sum that is zero: its entries
    times the minors without their columns, with signs (Laplace). Where all but one of these are
    known to be sums of multiples of a family's forms, but for units, or their entry is zero, and
    that one's entry is a unit, so is the last one.
    """
    ring, relations, known = draft.ring, family.relations, dict[Lines, _Known]()
    if draft.sides[1] <= draft.rank or not relations:
        return [], []
    entries = [[ring.put(x, family.values) for x in row] for row in draft.matrix]
    units = {
        (i, j): x
        for i, row in enumerate(entries)
        for j, x in enumerate(row)
        if x != 0 and not ring.joints(ring.stripped(x)[0])
    }
    for lines, minor in minors.items():
        at = next((at for at, p in enumerate(relations) if ring.divides(p, minor)), None)
        if at is not None:
            multiples = [ring.zero] * len(relations)
            multiples[at] = ring.reduced(divmod(minor, relations[at])[0])
            known[lines] = _Known(multiples, ring.one, 0)
    while more := {
        lines: one
        for lines in minors
        if lines not in known and (one := _sum(draft, entries, units, known, lines))
    }:
        known |= more
    found: list[Sum] = []
    totals: list[Poly] = []
    for lines, way in sorted(known.items(), key=lambda item: item[1].depth):
        draft.require_time()
        if way.depth == 0 or any(ring.divides(p, minors[lines]) for p in totals):
            continue
        # Without units and in small numbers: it is compared without them.
        short = ring.stripped(*way.multiples)
        found.append(sum_of(len(family.values), dict(enumerate(short))))
        put = ring.put(draft.sum(found[-1], family.forms), family.values)
        totals += ring.stripped(put)
    return found, totals


def _sum(
    draft: Draft,
    entries: Matrix,
    units: Mapping[tuple[int, int], Poly],
    known: Mapping[Lines, _Known],
    lines: Lines,
) -> _Known | None:
    """The shortest of the sums that a minor is by what is known."""
    draft.require_time()
    ring, (rows, columns) = draft.ring, lines
    ways = []
    for i, extra in itertools.product(rows, range(draft.sides[1])):
        if extra in columns or (i, extra) not in units:
            continue
        # The unit times the minor is minus the others' sum, with the unit's own sign.
        every = tuple(sorted({*columns, extra}))
        own = -((-1) ** every.index(extra))
        others = [
            (entry * (-1) ** k * own, known.get((rows, every[:k] + every[k + 1 :])))
            for k, j in enumerate(every)
            if j != extra and (entry := entries[i][j]) != 0
        ]
        terms = [(factor, way) for factor, way in others if way is not None]
        if len(terms) == len(others):
            ways.append((units[i, extra], terms))
    if not ways:
        return None
    unit, terms = min(ways, key=lambda w: sum(len(c) for _, way in w[1] for c in way.multiples))
    common = ring.one
    for _, way in terms:
        common = common * divmod(way.units, common.gcd(way.units))[0]
    factors = [factor * divmod(common, way.units)[0] for factor, way in terms]
    total = [
        ring.reduced(sum(map(operator.mul, factors, of_relation), ring.zero))
        for of_relation in zip(*(way.multiples for _, way in terms), strict=True)
    ]
    *total, common = ring.stripped(*total, ring.reduced(common * unit))
    return _Known(total, common, 1 + max((way.depth for _, way in terms), default=0))


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


def soundness(draft: Draft, family: Place, codimension: int) -> Soundness:
    """Why all minors vanish on a family, of a codimension; NotFound if that was not seen."""
    ring, at = draft.ring, draft.at(family.values)
    minors, plain, tried = dict[Lines, Poly](), set[Lines](), set[Lines]()
    for lines in _lines(draft, draft.rank):
        draft.require_time()
        minors[lines] = minor = at(*lines)
        if ring.vanishes(minor, (family.values, family.relations)):
            plain.add(lines)
    found = Soundness()
    if len(plain) == len(minors):
        return found
    # Only of as many forms as its codimension is a family known to have nothing smaller.
    if codimension == len(family.forms):
        pivot = _pivot(draft, family, plain, tried)
        for lines, minor in sorted(minors.items(), key=lambda item: len(item[1])):
            if pivot is not None:
                break
            if lines not in plain and _by_division(draft, family, minor, found):
                plain.add(lines)
                pivot = _pivot(draft, family, plain, tried)
        if pivot is not None:
            return replace(found, pivot=pivot)
    multiples, totals = _sums(draft, family, minors)
    for minor in minors.values():
        draft.require_time()
        if ring.vanishes(minor, (family.values, [*family.relations, *totals])):
            continue
        combined = combination(ring, ring.stripped(minor)[0], family.relations)
        if combined is None:
            raise NotFound(f"{place_text(family)} is not shown to be singular")
        multiples.append(sum_of(len(family.values), dict(enumerate(combined))))
        totals += ring.stripped(minor)
    return Soundness(multiples=multiples)


def _by_division(draft: Draft, family: Place, minor: Poly, found: Soundness) -> bool:
    """Add a sum that a minor is a multiple of, but for what is zero on no component."""
    ring = draft.ring
    for f, _ in draft.factors(minor):
        for tops, times, multiples in divisions(ring, f, family.relations):
            if not _is_apart(draft, family, tops):
                continue
            found.multiples.append(sum_of(len(family.values), dict(enumerate(multiples))))
            for factor, power in draft.factors(times):
                found.apart += [factor] * (power - found.apart.count(factor))
            return True
    return False


def _is_apart(draft: Draft, family: Place, form: Poly) -> bool:
    """Return True if a form is seen to be zero on no component of a family."""
    count = len(family.relations) + 1
    forms = [*family.relations, *draft.ring.stripped(form)]
    return draft.shown(lambda: draft.ring.codimension_at_least(count, forms), most=MOST_WORK)


def _lines(draft: Draft, size: int) -> Iterable[Lines]:
    """Rows and columns of all minors of a size."""
    rows, columns = (itertools.combinations(range(side), size) for side in draft.sides)
    return itertools.product(rows, columns)


def _pivot(draft: Draft, family: Place, plain: set[Lines], tried: set[Lines]) -> Lines | None:
    """Return the shortest minor of one line less, zero on no component, that only plain ones have.

    Without lines where all are plain.
    """
    if len(plain) == math.prod(math.comb(side, draft.rank) for side in draft.sides):
        return (), ()
    found: list[tuple[int, Lines]] = []
    minor = draft.at(family.values)
    for lines in _lines(draft, draft.rank - 1):
        draft.require_time()
        wider = (
            [tuple(sorted((*part, k))) for k in range(count) if k not in part]
            for part, count in zip(lines, draft.sides, strict=True)
        )
        if lines in tried or not plain.issuperset(itertools.product(*wider)):
            continue
        if (form := minor(*lines)) != 0:
            found.append((len(draft.ring.stripped(form)[0]), lines))
    # Pivots that are tried, the shortest first, but for those that division shows to be zero there.
    for _, lines in sorted(found)[:12]:
        tried.add(lines)
        form = minor(*lines)
        ways = divisions(draft.ring, form, family.relations)
        zero = any(_is_apart(draft, family, tops) for tops, _, _ in ways)
        if not zero and _is_apart(draft, family, form):
            return lines
    return None


_MANY = 3
"""Relations beyond which no more are made of them."""
_LONG = 2000
"""Product of terms beyond which two relations are not combined."""
_DENSE = 400
"""Terms of all relations beyond which nothing long is tried with them."""


class Tree:
    """Finds the tree, over a certificate that states chain, rank, reduction and families."""

    def __init__(self, draft: Draft, progress: Callable[[str], None] | None = None) -> None:
        self.draft, self.ring = draft, draft.ring
        self._progress = progress or (lambda text: None)
        self.families = [draft.forms(f) for f in draft.data["families"]]
        # Relations, if no family has more, beyond which a place is not split: splits that say
        # nothing new go on for ever.
        self._most = max([8, *map(len, self.families)])
        self._fixed = [{*self.ring.where(family)[0]} for family in self.families]
        self._ids = MadeOfEqual()  # the same number for equal forms
        self._toward = {self._ids.of(draft.tidy(p), id) for family in self.families for p in family}
        self._places: dict[tuple[bool, frozenset[int]], Place | NotFound] = {}

    def place(self, forms: Sequence[Poly], points: bool = False) -> Place | None:
        """The place where forms vanish, closed or split; None where it is empty.

        NotFound if one could not be closed, or time was over.
        """
        place = self.draft.place_of(forms, points)
        if len(place.relations) > _MANY:  # what says nothing new leaves little to be tried
            place = self.draft.without_implied(place)
        if not all(map(self.ring.joints, place.relations)):
            return None  # one of them is a number
        key = points, frozenset(self._ids.of(p, id) for p in place.forms)
        if key in self._places:
            if isinstance(known := self._places[key], NotFound):
                raise known
            return known
        # One that is closed and has some of these forms only holds this one.
        wider = next(
            (
                other
                for known, other in self._places.items()
                if isinstance(other, Place) and known[0] == points and known[1] <= key[1]
            ),
            None,
        )
        if wider is not None:
            return wider
        self._places[key] = NotFound("a place leads to itself")
        try:
            self.draft.require_time()
            self._progress(f"{len(self._places)} places looked at")
            self._close(place)
        except (NotFound, BudgetExceeded, Rejected) as reason:
            self._places[key] = failure = NotFound(str(reason))
            raise failure from None
        self._places[key] = place
        return place

    def _close(self, place: Place) -> None:
        relations = place.relations
        for k, family in enumerate(self.families):
            if self._fixed[k] <= place.values.keys() and all(
                self.ring.vanishes(f, (place.values, place.relations)) for f in family
            ):
                place.family = k
                return
        short = sum(map(len, relations)) <= _DENSE
        several, every = short and len(relations) > 1, range(len(self.families))
        if several and any(self._by_division(place, k) for k in every):
            return
        least = self.draft.bound + 1 - len(place.values)
        enough = not place.points and least <= len(relations)
        if (
            enough
            and short
            and self.draft.shown(lambda: self.ring.codimension_at_least(least, relations))
        ):
            place.sum, place.cases = [("1", ("of_forms", 0))], [([place.forms[0]], [], 1, None)]
            return
        for k, p in enumerate(relations):
            if [times for _, times in self.draft.factors(p)] != [1]:
                source = "of_forms", len(place.values) + k
                self._split(place, Split([(self.ring.one, source)], p))
                return
        if self._by_squares(place):
            return
        if len(relations) > self._most:
            raise NotFound(f"more and more relations at {place_text(place)}")
        failure = ""
        # Polynomials to split by that are tried at a place before it is given up, and how many
        # relations are so many that fewer are tried.
        tried = 8 if len(relations) <= 5 else 3
        for split in itertools.islice(self._splits(place), tried):
            try:
                self._split(place, split)
            except NotFound as reason:
                failure = str(reason)
                continue
            return
        raise NotFound(failure or f"nothing to split {place_text(place)} by")

    def _by_division(self, place: Place, number: int) -> bool:
        """Split a place that lies in a family by a multiple of one of its forms, if it does."""
        # Two equations leave what is too large for some families (Krull).
        ring, relations, family = self.ring, place.relations, self.families[number]
        least = self.draft.data["families"][number]["least_codimension"]
        if len(place.values) + 2 < least:
            return False
        # Relations, the shortest, of which two are tried alone.
        few = [relations] if len(relations) == 2 else itertools.combinations(relations[:4], 2)
        images = [f for p in family for f in ring.stripped(ring.put(p, place.values))]
        for some in map(list, few):
            if self.draft.shown(lambda some=some: all(vanishes(ring, f, some) for f in images)):  # type: ignore[misc]
                f = next(f for f in images if not ring.vanishes(f, ({}, relations)))
                at = [next(i for i, p in enumerate(relations) if p is r) for r in some]
                sources = [("of_forms", len(place.values) + i) for i in at]
                for _, times, multiples in divisions(ring, f, some):
                    terms = [(c, k) for c, k in zip(multiples, sources, strict=True) if c != 0]
                    try:
                        self._split(place, Split(terms, ring.times(times, f)))
                    except NotFound:
                        continue
                    return True
        return False

    def _split(self, place: Place, split: Split) -> None:
        """Follow each factor of a form that vanishes."""
        factors = self.draft.factors(split.form)
        place.cases = [
            ([f], [], times, self.place([*place.forms, f], place.points)) for f, times in factors
        ]
        product = self.ring.one
        for f, times in factors:
            product = self.ring.reduced(product * f**times)
        place.sum = self.draft.scaled(split.sum, split.form, product)

    def _by_squares(self, place: Place) -> bool:
        """Close a place where a relation is a sum of squares, and where all of these vanish."""
        for k, p in enumerate(place.relations):
            if self.draft.fixes(p):
                continue
            found = squares(self.ring, p)
            if found is None:
                continue
            times, parts = found
            try:
                then = self.place([*place.forms, *(g for _, g in parts)], True)
            except NotFound:
                continue
            place.cases = [([g for _, g in parts], [w for w, _ in parts], 1, then)]
            total, source = self.ring.times(times, p), ("of_forms", len(place.values) + k)
            place.sum = self.draft.scaled([(times, source)], total, total)
            return True
        return False

    # Splits ---------------------------------------------------------------------------

    def _splits(self, place: Place) -> Iterator[Split]:
        """Polynomials that vanish on all components of a place, the simplest first.

        Factors of what is to be shown, the families', cost nothing.
        """
        values, relations = place.values, place.relations
        if len(relations) > _MANY:
            # Product of terms of two relations whose resultant is looked at among many, and how
            # many of the simplest are tried.
            yield from self._plain_resultants(place)[:2]
        minors = list(self._minors(place))
        alone, minors = minors, [*minors, *self._without_a_turn(place, minors)]
        minors.sort(key=self._effort)
        easy = [m for m in minors if self._effort(m)[0] == 0]
        yield from easy
        whole = self.draft.bound - len(values)
        if relations and whole <= len(relations):
            if not place.points and self.ring.codimension_at_least(whole, relations):
                yield from self._at_points(place, alone)
            # Terms of all relations beyond which they are not divided by each other.
            short = sum(map(len, relations)) <= 200
            if 1 < len(relations) <= _MANY + 1 and short:
                yield from self._remainders(place)
                yield from self._toward_families(place)
            if len(relations) <= _MANY:
                yield from self._resultants(place)
        yield from (m for m in minors if m not in easy)
        if 1 < len(relations) < min(whole, _MANY + 1):
            yield from self._remainders(place)
            yield from self._resultants(place)

    def _minors(self, place: Place) -> Iterator[Split]:
        minor = self.draft.at(place.values)
        for lines in _lines(self.draft, self.draft.rank):
            self.draft.require_time()
            poly = minor(*lines)
            if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                source: Source = ("of_minors", list(map(list, lines)), [])
                yield Split([(self.ring.one, source)], self.ring.stripped(poly)[0])

    def _without_a_turn(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Yield, of minors g cos a and g sin a, the sum that is g but for units."""
        # They are of the same columns. Where some axes are parallel, rows of what the other joints
        # do turn with the frame.
        ring, minor = self.ring, self.draft.at(place.values)
        for first, second in itertools.combinations(minors, 2):
            f, g = first.form, second.form
            ((_, a),), ((_, b),) = first.sum, second.sum
            if a[1][1] != b[1][1] or ring.squares or len(f) * len(g) > _LONG:
                continue
            common = f.gcd(g)
            p, q = divmod(f, common)[0], divmod(g, common)[0]
            (ones,) = ring.stripped(p * p + q * q)
            if ring.joints(p) and not ring.joints(ones):
                u, v = (
                    divmod(minor(*map(tuple, lines)), form)[0]
                    for (_, lines, _), form in ((a, f), (b, g))
                )
                yield Split([(p * v, a), (q * u, b)], ring.times(ones, common))

    def _effort(self, split: Split) -> tuple[int, int]:
        """Return the terms of factors that lead to what is not wanted, and how many there are."""
        factors, near = [f for f, _ in self.draft.factors(split.form)], self._toward
        long = [f for f in factors if not self.draft.fixes(f) and self._ids.of(f, id) not in near]
        return sum(map(len, long)), len(factors)

    def _at_points(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Minors with joints that occur in no relation at points: a component has all of these."""
        bound = {j for p in place.relations for j in self.ring.joints(p)}
        zero, one = self.ring.zero, self.ring.one
        points = (one, zero), (zero, one), (one, one), (one, -one)
        found: dict[int, Split] = {}
        for split in minors:
            free = [j for j in self.ring.joints(split.form) if j not in bound]
            ((_, (_, lines, _)),) = split.sum
            minor = self.draft.at(place.values)(*map(tuple, lines))
            choices = itertools.product(points, repeat=len(free)) if free else ()
            # Points of free joints that a minor is looked at.
            for choice in itertools.islice(choices, 16):
                self.draft.require_time()
                at = [self.draft.linear(j, p) for j, p in zip(free, choice, strict=True)]
                # Units are numbers where free joints are at points: the checker has them, too.
                poly = self.ring.put(minor, self.ring.where(at)[0])
                if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                    (poly,) = self.ring.stripped(poly)
                    found.setdefault(
                        self._ids.of(self.draft.tidy(poly), id),
                        Split([(self.ring.one, ("of_minors", lines, at))], poly),
                    )
        for split in sorted(found.values(), key=lambda s: len(s.form)):
            vanish = functools.partial(vanishes, self.ring, split.form, place.relations)
            # No more than trying the form would take.
            if not self.draft.shown(vanish, most=300_000):
                yield split

    def _resultants(self, place: Place, longest: int = _LONG) -> Iterator[Split]:
        ring, first = self.ring, len(place.values)
        for (a, p), (b, g) in itertools.combinations(enumerate(place.relations), 2):
            if len(p) * len(g) > longest:
                continue
            for j in set(ring.joints(p)) & set(ring.joints(g)):
                (poly,) = ring.stripped(ring.resultant(p, g, j))
                if poly != 0:
                    source = "of_resultants", first + a, first + b, j
                    yield Split([(ring.one, source)], poly)

    def _plain_resultants(self, place: Place) -> list[Split]:
        """Resultants of short relations that fall apart into forms shorter than both."""
        found: list[tuple[int, int, Split]] = []
        # Product of terms of two relations whose resultant is looked at among many, and how many of
        # the simplest are tried.
        for split in self._resultants(place, 1000):
            self.draft.require_time()
            ((_, (_, a, b, _)),) = split.sum
            both = [len(place.forms[k]) for k in (a, b)]
            lengths = [len(f) for f, _ in self.draft.factors(split.form)]
            known = any(self.ring.divides(p, split.form) for p in place.relations)
            if not known and max(lengths, default=0) < min(both):
                found.append((sum(lengths), len(found), split))
        return [split for *_, split in sorted(found, key=lambda f: f[:2])]

    def _remainders(self, place: Place) -> Iterator[Split]:
        """A relation less a multiple of a shorter one, if that is shorter or a product."""
        ring, first = self.ring, len(place.values)
        for b, p in enumerate(place.relations):
            for a, r in enumerate(place.relations[:b]):
                quotient, rest = divmod(p, r)
                (rest,) = ring.stripped(ring.reduced(rest))
                if rest != 0 and quotient != 0 and self.draft.is_simpler(rest, p):
                    terms = [(ring.one, first + b), (ring.reduced(-quotient), first + a)]
                    yield Split([(c, ("of_forms", k)) for c, k in terms], rest)

    def _toward_families(self, place: Place) -> Iterator[Split]:
        """A relation that is, but for a multiple of another one, that of a family times others."""
        ring, relations, first = self.ring, place.relations, len(place.values)
        wanted = {
            self._ids.of(f, id): f
            for family in self.families
            for p in family
            for f in ring.stripped(ring.put(p, place.values))
            if f != 0 and ring.joints(f) and not ring.vanishes(f, ({}, relations))
        }
        for f, (a, p) in itertools.product(wanted.values(), enumerate(relations)):
            for j in set(ring.joints(p)) & set(ring.joints(f)):
                if len(p) * len(f) > _LONG or ring.degree(p, j) < ring.degree(f, j):
                    continue
                times, quotient, rest, xs = division(ring, p, f, j)
                (product,) = ring.stripped(ring.times(quotient, f))
                rest = ring.times(rest, xs)
                for b, g in enumerate(relations):
                    if product == 0 or b == a or not ring.divides(g, rest):
                        continue
                    more = -ring.reduced(divmod(rest, g)[0])
                    if ring.reduced(more * g + rest) == 0:
                        terms = [(times, first + a), *[(more, first + b)] * (more != 0)]
                        yield Split([(c, ("of_forms", k)) for c, k in terms], product)
                    break


def certificate(
    form: ClosedForm, budget: Budget, progress: Callable[[str], None], in_parts: bool
) -> dict[str, Any]:
    """Return a certificate that the singular set is the union of families, or raise NotFound."""
    # ``in_parts`` states each component as the union of simpler ones where its equations fall
    # apart: that finds proofs where the equations as they are do not, and the other way round.
    if (geometry := form.geometry) is None:
        raise NotFound("the closed form was read from a file: without its exact polynomials")
    try:
        numbers = constants(geometry, geometry.arm.task)
    except NotFollowed as reason:
        raise NotFound(f"the algebra does not follow a mimic joint: {reason}") from None
    ring = make_ring(tuple(bool(p) for p in geometry.arm.prismatic), numbers, budget)
    # It is of the polynomials, not of what is stated: unless these are known to agree.
    if form.families is not form.faithful:
        for off in disagreements(form.families, (), ring, geometry, form.symbols):
            raise NotFound(off)
    roots = roots_in(geometry)
    try:
        data = skeleton(geometry, form.generic_rank, roots)
        draft = Draft(data, budget)
        for name, c in [(f.name, c) for f in form.families for c in f.components]:
            draft.require_time()
            points = {j: v if len(v) == 2 else (1, *v) for j, v in c.values.items()}
            number = draft.algebra.number
            forms = [draft.linear(j, (number(a), number(b))) for j, (a, b) in points.items()]
            forms += [form_of(p, ring, draft.ring.context, roots) for p in c.relations]
            whole = draft.place_of(forms)
            forms = _without_implied(draft, whole) if len(whole.relations) > 1 else whole.forms
            for part in draft.parts(forms) if in_parts else [draft.place_of(forms)]:
                # The search divided all minors by what it calls proven, or saw them vanish.
                plain = c.proven and len(part.relations) < 2
                why = Soundness() if plain else soundness(draft, part, c.codimension)
                data["families"].append(
                    {
                        "name": name,
                        "forms": [draft.number(f) for f in part.forms],
                        "least_codimension": c.codimension,
                        "pivot": [list(lines) for lines in why.pivot],
                        "apart": [draft.number(f) for f in why.apart],
                        "multiples": why.multiples,
                    }
                )
        root = Tree(draft, progress).place([])
    except Rejected as reason:
        raise NotFound(str(reason)) from None
    places = _written(root, draft)
    return data | {"polynomials": [form_text(p) for p in draft.polys], "places": places}


def _without_implied(draft: Draft, family: Place) -> list[Any]:
    """Return forms of a family without those that vanish wherever the shorter ones do."""
    # Soundness is shown by division, a form and a joint at a time: more forms than needed hinder
    # it.
    linear, rest = family.forms[: len(family.values)], family.relations
    kept: list[Any] = []
    for p in rest:
        implied = functools.partial(vanishes, draft.ring, p, kept)
        if not kept or not draft.shown(implied, most=MOST_WORK):
            kept.append(p)
    return [*linear, *kept]


def _written(root: Place | None, draft: Draft) -> list[dict[str, Any]]:
    """Places as they stand in the certificate, each before those that it leads to."""
    order: dict[Place, int] = {}

    def visit(place: Place | None) -> None:
        if place is not None and place.family is None and place not in order:
            for *_, then in place.cases:
                visit(then)
            order[place] = len(order)

    visit(root)
    entries = []
    for place in reversed(order):
        entry: dict[str, Any] = {
            "forms": [draft.number(p) for p in place.forms],
            **{key: [] for key in ("of_forms", "of_minors", "of_resultants", "cases")},
        }
        for text, (key, *source) in place.sum:
            if key == "of_minors":
                source[1] = [draft.number(p) for p in source[1]]
            entry[key].append([text, *source])
        for forms, weights, times, then in place.cases:
            leads: tuple[str, int] = ("nowhere", 0)
            if then is not None and then.family is not None:
                leads = "family", then.family
            elif then is not None:
                leads = "place", len(order) - 1 - order[then]
            zeros = [draft.number(f) for f in forms]
            entry["cases"].append([zeros, list(map(str, weights)), times, *leads])
        entries.append(entry)
    return entries


def text_of(data: Mapping[str, Any]) -> str:
    """A certificate as the text that is written and checked."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"))


SHORT = 10.0
"""Seconds of work for a search where nobody asked for one; as a rule they take three."""
LONG = 60.0
"""Seconds of work for one that was asked for."""


def prove(
    form: ClosedForm, seconds: float = LONG, progress: Callable[[str], None] | None = None
) -> ClosedForm:
    """Look for a certificate that a closed form is the whole singular set, and have it checked.

    Parameters
    ----------
    form : ClosedForm
        As `closed_form` gave it.
    seconds : float
        Time for the search; the check comes on top.
    progress : callable
        Told now and then how far the search is.

    Returns
    -------
    ClosedForm
        The same, with ``proof``; complete and without gaps if the certificate was accepted.
    """
    return within(form, Budget(seconds), progress)


def prove_briefly(
    form: ClosedForm, seconds: float, progress: Callable[[str], None] | None = None
) -> ClosedForm:
    """The same where nobody asked for it: for `SHORT` seconds of work, and so many on the clock."""
    found = within(form, Budget(max(seconds, 0.0), SHORT), progress)
    if found.proof is None or found.proof.accepted or not found.proof.out_of_time:
        return found
    said = f"{found.proof.reason}; --prove, or prove=True, looks for one for {LONG:g} s"
    return replace(found, proof=replace(found.proof, reason=said))


def within(form: ClosedForm, budget: Budget, progress: Callable[[str], None] | None) -> ClosedForm:
    """The same, within a budget; what becomes long goes on in a child, which can be stopped."""
    search = Apart(budget, budget.on_clock, progress or (lambda text: None))
    started = time.monotonic()
    # With square roots one resultant of few terms may take minutes, of which no count warns.
    roots = form.geometry is not None and any(
        isinstance(x, Surd) for turn in form.geometry.rotation for row in turn for x in row
    )
    ended = search.run(lambda: _proof(form, budget, search.tell), at_once=roots)
    if (proof := ended.result) is None:
        reason = f"none was found: {ended.reason}"
        proof = _none(form, reason, True, time.monotonic() - started)
    if not proof.accepted:
        return replace(form, proof=proof)
    return replace(form, proof=proof, complete=True, gaps=())


def _proof(form: ClosedForm, budget: Budget, progress: Callable[[str], None]) -> Proof:
    """Return what becomes of the search: first of families as stated, then of these in parts."""
    started = time.monotonic()
    reason, stopped = "", False
    for in_parts in (False, True):
        if budget.over:
            stopped = True
            break
        try:
            # Half of the work for the first way, so that some is left for the second.
            share = budget.part(1.0 if in_parts else 0.5)
            data = certificate(form, share, progress, in_parts)
            found = time.monotonic()
            text = text_of(data)
            _checked(text, budget)
        except NotFound as problem:
            reason, stopped = str(problem), stopped or share.over
        except Rejected as problem:
            reason = f"the checker says: {problem}"
        except BudgetExceeded:
            stopped = True
        except (OverflowError, RecursionError) as problem:
            reason = f"the search for one was given up: {problem}"
        else:
            return Proof(
                accepted=True,
                reason="",
                size=len(text),
                places=len(data["places"]),
                seconds=found - started,
                check_seconds=time.monotonic() - found,
                primes=(),
                certificate=data,
            )
    if stopped:
        reason = f"none was found in the {budget.allowed} allowed"
    return _none(form, reason, stopped, time.monotonic() - started)


def _checked(text: str, budget: Budget) -> None:
    """Have it checked; if that is long, in a child: a resultant of few terms may take hours."""
    try:
        verify(text, 1_000_000)  # products of terms: a tenth of a second as a rule
    except Rejected:
        if budget.meter.when_long is not None:
            budget.meter.when_long()
        verify(text)


def _none(form: ClosedForm, reason: str, stopped: bool, seconds: float) -> Proof:
    primes = () if form.random_steps is None else form.random_steps.primes
    return Proof(False, reason, 0, 0, seconds, 0.0, primes, out_of_time=stopped)
