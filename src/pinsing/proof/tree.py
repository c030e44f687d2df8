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
from pinsing.proof.checker import Certificate, Rejected, Values, Where

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


class NotFound(Exception):
    """No tree of cases was found; says where."""


@dataclass(eq=False)
class Place:
    """One place of the tree, with how it is closed or split.

    Attributes
    ----------
    values : dict of joint to (x, y)
        Constants.
    relations : list of Poly
        What vanishes.
    entry : dict
        Keys of the place in the certificate, its cases and its own place aside.
    cases : list of (Poly, times, Place or None)
        Factors, how often each is there, and where it leads; None where that is empty.
    """

    values: Values
    relations: list[Poly]
    entry: dict[str, Any] = field(default_factory=dict)
    cases: list[tuple[Poly, int, Place | None]] = field(default_factory=list)


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
        self._places: dict[object, Place | NotFound | None] = {}
        self._factors: dict[str, list[tuple[Poly, int]]] = {}
        self._algebra = self._ring_to_factor_in(seconds)

    def root(self) -> Place:
        """The place that is everywhere.

        Raises
        ------
        NotFound
            If some place could not be closed, or time was over.
        """
        return self._place({}, [])

    def _check_time(self) -> None:
        if time.monotonic() > self._until:
            raise NotFound("time was over")

    def _ring_to_factor_in(self, seconds: float) -> Ring:
        ring, slides = self.ring, self.certificate.slides
        flat = tuple(False for _ in slides)
        start = tuple(range(0, 2 * len(slides), 2))
        norms = tuple(None if s else u for s, u in zip(slides, ring.unit, strict=True))
        if not ring.roots:
            return Ring(ring.context, flat, start, norms)
        roots = tuple(d for _, d in ring.roots)
        return SurdRing(ring.context, flat, start, norms, roots, Budget(seconds))

    # Places -------------------------------------------------------------------------

    def _place(self, values: Values, relations: Sequence[Poly]) -> Place:
        relations = sorted(relations, key=lambda p: (len(p), str(p)))
        key = (
            tuple((j, str(x), str(y)) for j, (x, y) in sorted(values.items())),
            tuple(map(str, relations)),
        )
        if key in self._places:
            known = self._places[key]
            if known is None:
                raise NotFound("a place leads to itself")
            if isinstance(known, NotFound):
                raise known
            return known
        self._places[key] = None
        try:
            self._check_time()
            if self._progress is not None:
                self._progress(f"{len(self._places)} places looked at")
            self._places[key] = place = self._closed(values, relations)
        except (NotFound, BudgetExceeded) as reason:
            self._places[key] = failure = NotFound(str(reason))
            raise failure from None
        return place

    def _closed(self, values: Values, relations: list[Poly]) -> Place:
        place = Place(values, relations)
        for k, family in enumerate(self.certificate.families):
            if self.certificate.lies_in(values, relations, family):
                place.entry = {"family": k}
                return place
            if self._after_forgetting(place, k, family):
                return place
        least = self.certificate.bound + 1 - len(values)
        if least <= len(relations) and self.ring.codimension_at_least(least, relations):
            place.entry = {"too_small": True}
            return place
        for k, p in enumerate(relations):
            if self._has_no_real_point(p):
                place.entry = {"no_real_point": {"relation": k}}
                return place
        if len(relations) > _MOST:
            raise NotFound(f"more and more relations at {place_text(place)}")
        failure = NotFound(f"nothing to split {place_text(place)} by")
        for entry, poly in itertools.islice(self._splits(values, relations), _TRIED):
            try:
                place.cases = [
                    (f, times, self._case(values, relations, f)) for f, times in self.factors(poly)
                ]
            except NotFound as reason:
                failure = reason
                continue
            place.entry = entry
            return place
        raise failure

    def _after_forgetting(self, place: Place, number: int, family: Where) -> bool:
        """Close a place where two of its relations alone lie in a family, if they do."""
        if len(place.relations) < 3:
            return False
        for pair in itertools.combinations(place.relations, 2):
            if self.certificate.lies_in(place.values, list(pair), family):
                then = Place(place.values, list(pair), {"family": number})
                at = next(i for i, p in enumerate(place.relations) if p is pair[0])
                place.entry, place.cases = {"relation": at}, [(pair[0], 1, then)]
                return True
        return False

    def _case(self, values: Values, relations: list[Poly], f: Poly) -> Place | None:
        """Where one factor leads to."""
        ring, joints = self.ring, self.ring.joints(f)
        if len(joints) > 1 or ring.degree(f, joints[0]) > 1:
            return self._place(values, [*relations, f])
        at = self._value_of(f)
        left = [ring.stripped(ring.put(p, at)) for p in relations]
        if any(p != 0 and not ring.joints(p) for p in left):
            return None
        distinct = {str(p): p for p in map(self.tidy, left) if p != 0}
        return self._place({**values, **at}, list(distinct.values()))

    def _value_of(self, f: Poly) -> Values:
        """The joint that a factor fixes, its x made 1, or else its y."""
        ring, (j,) = self.ring, self.ring.joints(f)
        x = ring.put(f, {j: (ring.zero, ring.one)})
        y = -ring.put(f, {j: (ring.one, ring.zero)})
        inverse = self._inverse(x if x != 0 else y)
        return {j: (ring.reduced(x * inverse), ring.reduced(y * inverse))}

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

    def parts(self, values: Values, relations: Sequence[Poly]) -> list[Place]:
        """Common zeros of relations as the union of simpler ones: reduced by each other, factored.

        Where the longer of two relations is the sum of a multiple of the shorter one and a
        product, each factor of that makes a part.
        """
        relations = sorted((p for p in map(self.tidy, relations) if p != 0), key=len)
        if any(not self.ring.joints(p) for p in relations):
            return []
        for k, p in enumerate(relations):
            others = relations[:k] + relations[k + 1 :]
            for r in relations[:k]:
                quotient, rest = divmod(p, r)
                rest = self.ring.stripped(self.ring.reduced(rest))
                if quotient != 0 and self._is_simpler(rest, p):
                    return self.parts(values, [*others, rest])
            factors = [f for f, _ in self.factors(p)]
            if len(factors) > 1 or self._fixes(p):
                return [place for f in factors for place in self._part(values, others, f)]
        return [Place(values, relations)]

    def _is_simpler(self, rest: Poly, p: Poly) -> bool:
        return bool(rest == 0 or len(rest) < len(p) or len(self.factors(rest)) > 1)

    def _part(self, values: Values, others: list[Poly], f: Poly) -> list[Place]:
        if not self._fixes(f):
            return self.parts(values, [*others, f])
        at = self._value_of(f)
        left = [self.ring.stripped(self.ring.put(p, at)) for p in others]
        return self.parts({**values, **at}, left)

    # What to split by ---------------------------------------------------------------

    def _splits(
        self, values: Values, relations: list[Poly]
    ) -> Iterator[tuple[dict[str, Any], Poly]]:
        """Polynomials that vanish on all components of a place, the simplest first."""
        for k, p in enumerate(relations):
            if [times for _, times in self.factors(p)] != [1]:
                yield {"relation": k}, p
                return
        minors = list(self._minors(values, relations))
        minors.sort(key=lambda m: self._effort(self.factors(m[1])))
        whole = self.certificate.bound - len(values)
        if relations and whole <= len(relations):
            if self.ring.codimension_at_least(whole, relations):
                yield from self._coefficients(relations, minors)
            short = sum(map(len, relations)) <= _SHORT
            if 1 < len(relations) <= _MANY + 1 and short:
                yield from self._remainders(relations)
                yield from self._toward_families(values, relations)
            if len(relations) <= _MANY:
                yield from self._resultants(relations)
                yield from self._sums(relations)
        yield from minors

    def _minors(
        self, values: Values, relations: list[Poly]
    ) -> Iterator[tuple[dict[str, Any], Poly]]:
        sides, size = self.certificate.sides, self.certificate.left
        minor = self.certificate.at(values)
        for rows in itertools.combinations(range(sides[0]), size):
            for columns in itertools.combinations(range(sides[1]), size):
                self._check_time()
                poly = self.ring.stripped(minor(rows, columns))
                if poly != 0 and not any(self.ring.divides(p, poly) for p in relations):
                    yield {"minor": [list(rows), list(columns)]}, poly

    def _effort(self, factors: list[tuple[Poly, int]]) -> tuple[int, int]:
        long = [len(f) for f, _ in factors if not self._fixes(f)]
        return max(long, default=0), len(factors)

    def _fixes(self, f: Poly) -> bool:
        joints = self.ring.joints(f)
        return len(joints) == 1 and self.ring.degree(f, joints[0]) == 1

    def _resultants(self, relations: list[Poly]) -> Iterator[tuple[dict[str, Any], Poly]]:
        for (a, p), (b, g) in itertools.combinations(enumerate(relations), 2):
            if len(p) * len(g) > _LONG:
                continue
            for j in set(self.ring.joints(p)) & set(self.ring.joints(g)):
                poly = self.ring.stripped(self.ring.resultant(p, g, j))
                if poly != 0:
                    yield {"resultant": [a, b, j]}, poly

    def _remainders(self, relations: list[Poly]) -> Iterator[tuple[dict[str, Any], Poly]]:
        """A relation less a multiple of a shorter one, if that is shorter or a product."""
        for b, p in enumerate(relations):
            for a, r in enumerate(relations[:b]):
                quotient, rest = divmod(p, r)
                rest = self.ring.stripped(self.ring.reduced(rest))
                if rest != 0 and quotient != 0 and self._is_simpler(rest, p):
                    yield {"sum": [["1", b], [str(self.ring.reduced(-quotient)), a]]}, rest

    def _toward_families(
        self, values: Values, relations: list[Poly]
    ) -> Iterator[tuple[dict[str, Any], Poly]]:
        """A relation that is, but for a multiple of another one, that of a family times others."""
        wanted = {
            str(p): p
            for at, equations in self.certificate.families
            if self.certificate.lies_in(values, relations, (at, []))
            for p in (self.ring.put(e, values) for e in equations)
            if not self.ring.vanishes(p, relations)
        }
        for f in wanted.values():
            for a, p in enumerate(relations):
                for j in set(self.ring.joints(p)) & set(self.ring.joints(f)):
                    if len(p) * len(f) <= _LONG and self.ring.degree(p, j) >= self.ring.degree(
                        f, j
                    ):
                        times, product, rest = self._divided(p, f, j)
                        yield from self._as_sum(times, product, rest, a, relations)

    def _as_sum(
        self, times: Poly, product: Poly, rest: Poly, a: int, relations: list[Poly]
    ) -> Iterator[tuple[dict[str, Any], Poly]]:
        if product == 0:
            return
        for b, g in enumerate(relations):
            if b == a or not self.ring.divides(g, rest):
                continue
            more = -self.ring.reduced(divmod(rest, g)[0])
            if self.ring.reduced(more * g + rest) == 0:
                terms = [[str(times), a]] + ([[str(more), b]] if more != 0 else [])
                yield {"sum": terms}, self.ring.stripped(product)
            return

    def _divided(self, p: Poly, f: Poly, j: int) -> tuple[Poly, Poly, Poly]:
        """Division of forms by y of a joint: times p = product + rest, product a multiple of f."""
        (x, y), (low, lead) = self.ring.pairs[j], self.ring.lead(f, j)
        times, product, rest = self.ring.one, self.ring.zero, p
        while rest != 0 and (top := self.ring.lead(rest, j))[0] >= low:
            more = top[1] * f * y ** (top[0] - low) * x ** (self.ring.degree(rest, j) - top[0])
            if low < self.ring.degree(f, j):
                return times, self.ring.zero, rest
            times = self.ring.reduced(times * lead)
            product = self.ring.reduced(product * lead + more)
            rest = self.ring.reduced(rest * lead - more)
        return times, product, rest

    def _sums(self, relations: list[Poly]) -> Iterator[tuple[dict[str, Any], Poly]]:
        """Two relations times polynomials, so that the highest powers of some y cancel."""
        for (a, p), (b, g) in itertools.permutations(enumerate(relations), 2):
            if len(p) * len(g) > _LONG:
                continue
            for j in set(self.ring.joints(p)) & set(self.ring.joints(g)):
                more = self.ring.degree(p, j) - self.ring.degree(g, j)
                if more < 0:
                    continue
                (top_p, lead_p), (top_g, lead_g) = self.ring.lead(p, j), self.ring.lead(g, j)
                _x, y = self.ring.pairs[j]
                if top_p - top_g != more:
                    continue
                factors = lead_g, -lead_p * y**more
                poly = self.ring.reduced(p * factors[0] + g * factors[1])
                poly = self.ring.stripped(poly)
                if poly != 0 and not any(self.ring.divides(q, poly) for q in relations):
                    yield {"sum": [[str(factors[0]), a], [str(factors[1]), b]]}, poly

    def _coefficients(
        self, relations: list[Poly], minors: list[tuple[dict[str, Any], Poly]]
    ) -> Iterator[tuple[dict[str, Any], Poly]]:
        """Coefficients of minors with respect to the joints that occur in no relation."""
        count = len(self.ring.pairs)
        bound = {j for p in relations for j in self.ring.joints(p)}
        free = [e for j in range(count) if j not in bound for e in (2 * j, 2 * j + 1)]
        for entry, minor in minors:
            parts: dict[tuple[int, ...], dict[Any, Any]] = {}
            for m, c in minor.to_dict().items():
                outer = tuple(m[e] for e in free)
                inner = tuple(0 if e in free else k for e, k in enumerate(m))
                parts.setdefault(outer, {})[inner] = c
            for outer, terms in sorted(parts.items(), key=lambda p: len(p[1])):
                poly = self.ring.context.from_dict(terms)
                if self.ring.vanishes(poly, relations):
                    continue
                power = "*".join(
                    f"{self.ring.names[e]}^{k}" for e, k in zip(free, outer, strict=True) if k
                )
                yield {**entry, "coefficient": power or "1"}, poly

    # Pieces -------------------------------------------------------------------------

    def factors(self, poly: Poly) -> list[tuple[Poly, int]]:
        """Irreducible factors that are no units, and how often each is there."""
        key = str(poly)
        if key not in self._factors:
            left = self.ring.stripped(poly)
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

    def _has_no_real_point(self, p: Poly) -> bool:
        if len(self.ring.joints(p)) != 1 or self._fixes(p):
            return False
        try:
            return self.certificate.unreal({"relation": 0}, [p])
        except Rejected:
            return False


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
