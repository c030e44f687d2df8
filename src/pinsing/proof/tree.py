"""Case splits that end in families: found by factoring, for the checker to follow without.

A place is some joints at values and some polynomials that vanish. It is closed where it lies in
a family, where it is too small for a component, or where it has no real point; else a polynomial
that vanishes on all its components is factored, and every factor leads to another place.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from flint import fmpq

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.surd_ring import SurdRing
from pinsing.proof.checker import Certificate, Rejected
from pinsing.proof.skeleton import form_text
from pinsing.proof.squares import Squares, squares

Values = dict[int, tuple[Poly, Poly]]
"""Joints at points (x : y)."""

_MANY = 3
"""Relations beyond which no more are made of them."""
_MOST = 5
"""Relations beyond which a place is not split: splits that say nothing new go on for ever."""
_SHORT = 200
"""Terms of all relations beyond which they are not divided by each other."""
_LONG = 2000
"""Product of terms beyond which two relations are not combined."""
_TRIED = 8
"""Polynomials to split by that are tried at a place before it is given up."""
_DENSE = 400
"""Terms of all relations beyond which nothing long is tried with them."""
_CHOICES = 16
"""Points of free joints that a minor is looked at."""


class NotFound(Exception):
    """No tree of cases was found; says where."""


@dataclass(eq=False)
class Place:
    """One place of the tree, with how it is closed or split.

    Attributes
    ----------
    forms : list of Poly
        What vanishes: first a linear form for each joint that is at a value, then relations.
    values : dict of joint to (x, y)
        Constants.
    relations : list of Poly
        What else vanishes, with these values put in.
    points : bool
        Whether only real points are followed from here on, not whole components.
    entry : dict
        Keys of the place in the certificate, its cases and its own place aside.
    cases : list of (Poly, times, Place or None)
        Factors, how often each is there, and where it leads; None where that is empty.
    squares : list of (Fraction, Poly)
        Instead of cases: factors and forms that are squared.
    then : Place or None
        Where squares lead to.
    """

    forms: list[Poly]
    values: Values
    relations: list[Poly]
    points: bool = False
    entry: dict[str, Any] = field(default_factory=dict)
    cases: list[tuple[Poly, int, Place | None]] = field(default_factory=list)
    squares: Squares = field(default_factory=list)
    then: Place | None = None


@dataclass(frozen=True)
class Split:
    """A form that vanishes on all components of a place, as a sum of multiples of sources."""

    sum: list[tuple[Poly, Any]]
    form: Poly


class Tree:
    """Finds the tree, over a certificate that states chain, rank, reduction and families."""

    def __init__(
        self,
        certificate: Certificate,
        seconds: float,
        progress: Callable[[str], None] | None = None,
    ) -> None:
        self.certificate, self.ring, self._progress = certificate, certificate.ring, progress
        self._until = time.monotonic() + seconds
        self._budget = Budget(seconds)
        self.families = [certificate.forms(f) for f in certificate.data["families"]]
        self._places: dict[tuple[Any, ...], Place | NotFound | None] = {}
        self._factors: dict[str, list[tuple[Poly, int]]] = {}
        self._algebra = self._ring_to_factor_in(seconds)

    def root(self) -> Place:
        """The place that is everywhere.

        Raises
        ------
        NotFound
            If some place could not be closed, or time was over.
        """
        place = self._place([])
        assert place is not None
        return place

    def _check_time(self) -> None:
        if time.monotonic() > self._until:
            raise NotFound("time was over")
        self.ring.work = 0  # what is counted is one step here, the whole check there

    def _ring_to_factor_in(self, seconds: float) -> Ring:
        ring, slides = self.ring, self.certificate.slides
        flat = tuple(False for _ in slides)
        start = tuple(range(0, 2 * len(slides), 2))
        norms = tuple(None if s else u for s, u in zip(slides, ring.unit, strict=True))
        roots = tuple(self.certificate.data["square_roots"])
        if not roots:
            return Ring(ring.context, flat, start, norms)
        return SurdRing(ring.context, flat, start, norms, roots, Budget(seconds))

    # Places -------------------------------------------------------------------------

    def place_of(self, forms: Sequence[Poly], points: bool = False) -> Place:
        """A place by its forms, in the one way that it is written."""
        values, left = self.ring.where(list(forms))
        linear = [self._linear(j, point) for j, point in sorted(values.items())]
        relations: list[Poly] = []
        for p in sorted(map(self.tidy, left), key=lambda p: (len(p), str(p))):
            if not any(self.ring.divides(r, p) for r in relations):
                relations.append(p)
        values, relations_left = self.ring.where([*linear, *relations])
        return Place([*linear, *relations], values, relations_left, points)

    def _linear(self, j: int, point: tuple[Poly, Poly]) -> Poly:
        (x, y), (a, b) = self.ring.pairs[j], point
        return self.tidy(self.ring.reduced(b * x - a * y))

    def _place(self, forms: Sequence[Poly], points: bool = False) -> Place | None:
        """The place where forms vanish, closed or split; None where it is empty."""
        place = self.place_of(forms, points)
        if self.ring.empty(place.relations):
            return None
        texts = [form_text(f) for f in place.forms]
        key = (points, *texts)
        if key in self._places:
            known = self._places[key]
            if known is None:
                raise NotFound("a place leads to itself")
            if isinstance(known, NotFound):
                raise known
            return known
        wider = self._closed_around({*texts}, points)
        if wider is not None:
            return wider
        self._places[key] = None
        try:
            self._check_time()
            if self._progress is not None:
                self._progress(f"{len(self._places)} places looked at")
            self._close(place)
        except (NotFound, BudgetExceeded, Rejected) as reason:
            self._places[key] = failure = NotFound(str(reason))
            raise failure from None
        self._places[key] = place
        return place

    def _closed_around(self, forms: set[str], points: bool) -> Place | None:
        """A place that is closed and has some of these forms only: it holds this one."""
        return next(
            (
                place
                for key, place in self._places.items()
                if isinstance(place, Place) and place.points == points and forms.issuperset(key[1:])
            ),
            None,
        )

    def _close(self, place: Place) -> None:
        relations = place.relations
        for k, family in enumerate(self.families):
            if self._lies_in(place.values, relations, family):
                place.entry = {"family": k}
                return
            if self._after_forgetting(place, k, family):
                return
        least = self.certificate.bound + 1 - len(place.values)
        enough = not place.points and least <= len(relations)
        enough = enough and sum(map(len, relations)) <= _DENSE
        if enough and self.ring.codimension_at_least(least, relations):
            place.entry = {"too_small": True}
            return
        for k, p in enumerate(relations):
            if [times for _, times in self.factors(p)] != [1]:
                self._split(place, Split([(self.ring.one, len(place.values) + k)], p))
                return
        if self._by_squares(place):
            return
        if len(relations) > _MOST:
            raise NotFound(f"more and more relations at {place_text(place)}")
        failure = NotFound(f"nothing to split {place_text(place)} by")
        for split in itertools.islice(self._splits(place), _TRIED):
            try:
                self._split(place, split)
            except NotFound as reason:
                failure = reason
                continue
            return
        raise failure

    def _lies_in(self, values: Values, relations: list[Poly], family: list[Poly]) -> bool:
        """Whether a place lies in a family; for long relations only where that is plain."""
        images = [f for p in family for f in self.ring.stripped(self.ring.put(p, values))]
        plain = all(f == 0 or any(self.ring.divides(p, f) for p in relations) for f in images)
        if plain or sum(map(len, relations)) > _DENSE:
            return plain
        return self.certificate.lies_in((values, relations), family)

    def _split(self, place: Place, split: Split) -> None:
        """Follow each factor of a form that vanishes."""
        factors = self.factors(split.form)
        place.cases = [
            (f, times, self._place([*place.forms, f], place.points)) for f, times in factors
        ]
        product = self.ring.one
        for f, times in factors:
            product = self.ring.reduced(product * f**times)
        place.entry = self._sum(split.sum, split.form, product)

    def _sum(self, terms: list[tuple[Poly, Any]], form: Poly, product: Poly) -> dict[str, Any]:
        """A sum as it is written: scaled so that it is the product, units aside."""
        (form,) = self.ring.stripped(form)
        scale = self._leading(product) * self._inverse(self._leading(form))
        scaled = [(form_text(self.ring.reduced(c * scale)), source) for c, source in terms]
        return {"sum": [list(term) for term in scaled]}

    def _leading(self, form: Poly) -> Poly:
        """The number before the first monomial in joints."""
        count = 2 * len(self.ring.pairs)
        first = form.monomial(0)[:count]
        return self.ring.context.from_dict(
            {(*[0] * count, *m[count:]): c for m, c in form.to_dict().items() if m[:count] == first}
        )

    def _by_squares(self, place: Place) -> bool:
        """Close a place where a relation is a sum of squares, and where all of these vanish."""
        for k, p in enumerate(place.relations):
            if self._fixes(p):
                continue
            found = squares(self.ring, p)
            if found is None:
                continue
            times, parts = found
            try:
                place.then = self._place([*place.forms, *(g for _, g in parts)], True)
            except NotFound:
                continue
            place.squares = parts
            total = self.ring.times(times, p)
            place.entry = self._sum([(times, len(place.values) + k)], total, total)
            return True
        return False

    def _after_forgetting(self, place: Place, number: int, family: list[Poly]) -> bool:
        """Close a place where two of its relations alone lie in a family, if they do."""
        if len(place.relations) < 3:
            return False
        for pair in itertools.combinations(place.relations, 2):
            if self._lies_in(place.values, list(pair), family):
                linear = place.forms[: len(place.values)]
                then = self.place_of([*linear, *pair], place.points)
                then.entry = {"family": number}
                at = next(i for i, p in enumerate(place.relations) if p is pair[0])
                place.entry = {"sum": [["1", len(place.values) + at]]}
                place.cases = [(pair[0], 1, then)]
                return True
        return False

    def _inverse(self, number: Poly) -> Poly:
        terms = self._algebra.terms(number)
        (value,) = terms.values()
        return self._algebra.number(1 / value)

    def tidy(self, poly: Poly) -> Poly:
        """A multiple by a constant: whole coefficients without a common factor, or monic."""
        if poly == 0:
            return poly
        if isinstance(self._algebra, SurdRing):
            return self._algebra.monic(poly)
        return poly / _content(poly)

    def parts(self, forms: Sequence[Poly]) -> list[Place]:
        """Common zeros of forms as the union of simpler ones: reduced by each other, factored.

        Where the longer of two relations is the sum of a multiple of the shorter one and a
        product, each factor of that makes a part.
        """
        place = self.place_of(forms)
        if self.ring.empty(place.relations):
            return []
        linear, relations = place.forms[: len(place.values)], place.relations
        for k, p in enumerate(relations):
            others = [*linear, *relations[:k], *relations[k + 1 :]]
            for r in relations[:k]:
                quotient, rest = divmod(p, r)
                (rest,) = self.ring.stripped(self.ring.reduced(rest))
                if quotient != 0 and self._is_simpler(rest, p):
                    return self.parts([*others, rest])
            factors = [f for f, _ in self.factors(p)]
            if len(factors) > 1 or self._fixes(p):
                return [part for f in factors for part in self.parts([*others, f])]
        return [place]

    def _is_simpler(self, rest: Poly, p: Poly) -> bool:
        return bool(rest == 0 or len(rest) < len(p) or len(self.factors(rest)) > 1)

    # What to split by ---------------------------------------------------------------

    def _splits(self, place: Place) -> Iterator[Split]:
        """Polynomials that vanish on all components of a place, the simplest first."""
        values, relations = place.values, place.relations
        minors = list(self._minors(place))
        alone, minors = minors, [*minors, *self._without_a_turn(place, minors)]
        toward = {form_text(self.tidy(p)) for family in self.families for p in family}
        minors.sort(key=lambda m: self._effort(self.factors(m.form), toward))
        easy = [m for m in minors if self._effort(self.factors(m.form), toward)[0] == 0]
        yield from easy
        whole = self.certificate.bound - len(values)
        if relations and whole <= len(relations):
            if not place.points and self.ring.codimension_at_least(whole, relations):
                yield from self._at_points(place, alone)
            short = sum(map(len, relations)) <= _SHORT
            if 1 < len(relations) <= _MANY + 1 and short:
                yield from self._remainders(place)
                yield from self._toward_families(place)
            if len(relations) <= _MANY:
                yield from self._resultants(place)
                yield from self._sums(place)
        yield from (m for m in minors if m not in easy)

    def _minors(self, place: Place) -> Iterator[Split]:
        sides, size = self.certificate.sides, self.certificate.rank
        minor = self.certificate.at(place.values)
        for rows in itertools.combinations(range(sides[0]), size):
            for columns in itertools.combinations(range(sides[1]), size):
                self._check_time()
                poly = minor(rows, columns)
                if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                    source = {"minor": [list(rows), list(columns)]}
                    yield Split([(self.ring.one, source)], self.ring.stripped(poly)[0])

    def _without_a_turn(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Of minors g cos a and g sin a, of the same columns, the sum that is g but for units.

        Where some axes are parallel, rows of what the other joints do turn with the frame.
        """
        ring, minor = self.ring, self.certificate.at(place.values)
        for first, second in itertools.combinations(minors, 2):
            f, g = first.form, second.form
            ((_, a),), ((_, b),) = first.sum, second.sum
            if a["minor"][1] != b["minor"][1] or ring.squares or len(f) * len(g) > _LONG:
                continue
            common = f.gcd(g)
            p, q = divmod(f, common)[0], divmod(g, common)[0]
            (ones,) = ring.stripped(p * p + q * q)
            if ring.joints(p) and not ring.joints(ones):
                u, v = (
                    divmod(minor(*map(tuple, source["minor"])), form)[0]
                    for source, form in ((a, f), (b, g))
                )
                yield Split([(p * v, a), (q * u, b)], common)

    def _effort(self, factors: list[tuple[Poly, int]], toward: set[str]) -> tuple[int, int]:
        long = [len(f) for f, _ in factors if not self._fixes(f) and form_text(f) not in toward]
        return sum(long), len(factors)

    def _fixes(self, f: Poly) -> bool:
        joints = self.ring.joints(f)
        return len(joints) == 1 and self.ring.degree(f, joints[0]) == 1

    def _at_points(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Minors with joints that occur in no relation at points: a component has all of these."""
        bound = {j for p in place.relations for j in self.ring.joints(p)}
        found: dict[str, Split] = {}
        for split in minors:
            free = [j for j in self.ring.joints(split.form) if j not in bound]
            ((_, source),) = split.sum
            choices = itertools.product(range(4), repeat=len(free)) if free else ()
            for choice in itertools.islice(choices, _CHOICES):
                self._check_time()
                at = [self._linear(j, self._point(k)) for j, k in zip(free, choice, strict=True)]
                poly = self.ring.put(split.form, self.ring.where(at)[0])
                if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                    (poly,) = self.ring.stripped(poly)
                    found.setdefault(
                        form_text(self.tidy(poly)),
                        Split([(self.ring.one, {**source, "at": at})], poly),
                    )
        for split in sorted(found.values(), key=lambda s: len(s.form)):
            if not self.ring.vanishes(split.form, place.relations):
                yield split

    def _point(self, k: int) -> tuple[Poly, Poly]:
        zero, one = self.ring.zero, self.ring.one
        return ((one, zero), (zero, one), (one, one), (one, -one))[k]

    def _resultants(self, place: Place) -> Iterator[Split]:
        ring, first = self.ring, len(place.values)
        for (a, p), (b, g) in itertools.combinations(enumerate(place.relations), 2):
            if len(p) * len(g) > _LONG:
                continue
            for j in set(ring.joints(p)) & set(ring.joints(g)):
                (poly,) = ring.stripped(ring.resultant(p, g, j))
                if poly != 0:
                    yield Split([(ring.one, {"resultant": [first + a, first + b, j]})], poly)

    def _remainders(self, place: Place) -> Iterator[Split]:
        """A relation less a multiple of a shorter one, if that is shorter or a product."""
        ring, first = self.ring, len(place.values)
        for b, p in enumerate(place.relations):
            for a, r in enumerate(place.relations[:b]):
                quotient, rest = divmod(p, r)
                (rest,) = ring.stripped(ring.reduced(rest))
                if rest != 0 and quotient != 0 and self._is_simpler(rest, p):
                    yield Split([(ring.one, first + b), (ring.reduced(-quotient), first + a)], rest)

    def _toward_families(self, place: Place) -> Iterator[Split]:
        """A relation that is, but for a multiple of another one, that of a family times others."""
        ring, relations = self.ring, place.relations
        wanted = {
            str(f): f
            for family in self.families
            for p in family
            for f in ring.stripped(ring.put(p, place.values))
            if f != 0 and ring.joints(f) and not ring.vanishes(f, relations)
        }
        for f in wanted.values():
            for a, p in enumerate(relations):
                for j in set(ring.joints(p)) & set(ring.joints(f)):
                    if len(p) * len(f) <= _LONG and ring.degree(p, j) >= ring.degree(f, j):
                        yield from self._as_sum(*self._divided(p, f, j), a, place)

    def _as_sum(
        self, times: Poly, product: Poly, rest: Poly, a: int, place: Place
    ) -> Iterator[Split]:
        if product == 0:
            return
        first = len(place.values)
        for b, g in enumerate(place.relations):
            if b == a or not self.ring.divides(g, rest):
                continue
            more = -self.ring.reduced(divmod(rest, g)[0])
            if self.ring.reduced(more * g + rest) == 0:
                terms = [(times, first + a)] + ([(more, first + b)] if more != 0 else [])
                yield Split(terms, self.ring.stripped(product)[0])
            return

    def _divided(self, p: Poly, f: Poly, j: int) -> tuple[Poly, Poly, Poly]:
        """Division of forms by y of a joint: times p = product + rest, product a multiple of f."""
        y, low, lead = self.ring.pairs[j][1], self.ring.degree(f, j), self.ring.top(f, j)
        times, product, rest = self.ring.one, self.ring.zero, p
        if lead == 0:
            return times, product, rest
        for power in range(self.ring.degree(p, j), low - 1, -1):
            terms = {m: c for m, c in rest.to_dict().items() if m[2 * j + 1] == power}
            if not terms:
                continue
            more = divmod(self.ring.context.from_dict(terms), y**low)[0] * f
            times = self.ring.reduced(times * lead)
            product = self.ring.reduced(product * lead + more)
            rest = self.ring.reduced(rest * lead - more)
        return times, product, rest

    def _sums(self, place: Place) -> Iterator[Split]:
        """Two relations times polynomials, so that the highest powers of some y cancel."""
        ring, first = self.ring, len(place.values)
        for (a, p), (b, g) in itertools.permutations(enumerate(place.relations), 2):
            if len(p) * len(g) > _LONG:
                continue
            for j in set(ring.joints(p)) & set(ring.joints(g)):
                more, tops = ring.degree(p, j) - ring.degree(g, j), (ring.top(p, j), ring.top(g, j))
                if more < 0 or not all(tops):
                    continue
                factors = tops[1], -tops[0] * ring.pairs[j][1] ** more
                (poly,) = ring.stripped(ring.reduced(p * factors[0] + g * factors[1]))
                if poly != 0 and not any(ring.divides(q, poly) for q in place.relations):
                    yield Split([(factors[0], first + a), (factors[1], first + b)], poly)

    # Pieces -------------------------------------------------------------------------

    def factors(self, poly: Poly) -> list[tuple[Poly, int]]:
        """Irreducible factors that are no units, and how often each is there."""
        key = str(poly)
        if key not in self._factors:
            (left,) = self.ring.stripped(poly)
            self._budget.check_factor(len(left))
            if isinstance(self._algebra, SurdRing):
                self._factors[key] = self._with_roots(left)
            else:
                self._factors[key] = [(self.tidy(f), int(k)) for f, k in left.factor()[1]]
        return self._factors[key]

    def _with_roots(self, poly: Poly) -> list[tuple[Poly, int]]:
        found = []
        for f in self._algebra.factors(poly):
            times = 0
            while self.ring.divides(f, poly):
                poly = self._algebra.quotient(poly, f)
                times += 1
            found.append((f, times))
        return found


def place_text(place: Place) -> str:
    """A place in a few words, for messages."""
    values = ", ".join(f"joint {j + 1} at {x}:{y}" for j, (x, y) in sorted(place.values.items()))
    relations = ", ".join(f"{len(p)} terms" for p in place.relations)
    return f"[{values or 'anywhere'}; {relations or 'no relations'}]"


def _content(poly: Poly) -> Any:
    """What all coefficients share, with the sign of the first."""
    numbers = list(poly.to_dict().values())
    above = math.gcd(*(int(c.p) for c in numbers))
    below = math.lcm(*(int(c.q) for c in numbers))
    sign = -1 if poly.leading_coefficient() < 0 else 1
    return fmpq(sign * above, below)
