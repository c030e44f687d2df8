"""Makes certificates: of an arm's chain and families, with the tree of cases that closes them.

Case splits that end in families: found by factoring, for the checker to follow without.

A place is some joints at values and some polynomials that vanish. It is closed where it lies in
a family, where it is too small for a component, or where it has no real point; else a polynomial
that vanishes on all its components is factored, and every factor leads to another place.
"""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pinsing.algebra import ring as algebra_ring
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Value
from pinsing.proof.checker import MOST_WORK, Certificate, Poly, Rejected
from pinsing.proof.forms import (
    Forms,
    NotFound,
    Place,
    Split,
    divisions,
    empty,
    place_text,
    shown,
    squares,
    top_of,
    vanishes,
)
from pinsing.proof.minors import soundness
from pinsing.proof.skeleton import (
    Draft,
    NotStated,
    form_of,
    form_text,
    number_text,
    roots_in,
    skeleton,
    without_dependent_lines,
)
from pinsing.robot.nominal import Nominal

_MANY = 3
"""Relations beyond which no more are made of them."""
_LONG = 2000
"""Product of terms beyond which two relations are not combined."""


class Splits:
    """Finds them, the simplest first; factors of what is to be shown, the families', cost nothing.

    ``tick`` is called at every step; it raises where time is over.
    """

    def __init__(
        self, forms: Forms, families: Sequence[list[Poly]], tick: Callable[[], None]
    ) -> None:
        self.forms, self.families, self._tick = forms, families, tick
        self.certificate, self.ring = forms.certificate, forms.ring

    def of(self, place: Place) -> Iterator[Split]:
        """Polynomials that vanish on all components of a place, the simplest first."""
        values, relations = place.values, place.relations
        if len(relations) > _MANY:
            # Product of terms of two relations whose resultant is looked at among many, and how
            # many of the simplest are tried.
            yield from self._plain_resultants(place)[:2]
        minors = list(self._minors(place))
        alone, minors = minors, [*minors, *self._without_a_turn(place, minors)]
        toward = {str(self.forms.tidy(p)) for family in self.families for p in family}
        minors.sort(key=lambda m: self._effort(self.forms.factors(m.form), toward))
        easy = [m for m in minors if self._effort(self.forms.factors(m.form), toward)[0] == 0]
        yield from easy
        whole = self.certificate.bound - len(values)
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
                yield from self._sums(place)
        yield from (m for m in minors if m not in easy)
        if 1 < len(relations) < min(whole, _MANY + 1):
            yield from self._remainders(place)
            yield from self._resultants(place)

    def _minors(self, place: Place) -> Iterator[Split]:
        sides, size = self.certificate.sides, self.certificate.rank
        minor = self.certificate.at(place.values)
        for rows in itertools.combinations(range(sides[0]), size):
            for columns in itertools.combinations(range(sides[1]), size):
                self._tick()
                poly = minor(rows, columns)
                if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                    source = {"minor": [list(rows), list(columns)]}
                    yield Split([(self.ring.one, source)], self.ring.stripped(poly)[0])

    def _without_a_turn(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Yield, of minors g cos a and g sin a, the sum that is g but for units."""
        # They are of the same columns. Where some axes are parallel, rows of what the other joints
        # do turn with the frame.
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
                yield Split([(p * v, a), (q * u, b)], ring.times(ones, common))

    def _effort(self, factors: list[tuple[Poly, int]], toward: set[str]) -> tuple[int, int]:
        long = [len(f) for f, _ in factors if not self.forms.fixes(f) and str(f) not in toward]
        return sum(long), len(factors)

    def _at_points(self, place: Place, minors: list[Split]) -> Iterator[Split]:
        """Minors with joints that occur in no relation at points: a component has all of these."""
        bound = {j for p in place.relations for j in self.ring.joints(p)}
        found: dict[str, Split] = {}
        for split in minors:
            free = [j for j in self.ring.joints(split.form) if j not in bound]
            ((_, source),) = split.sum
            choices = itertools.product(range(4), repeat=len(free)) if free else ()
            # Points of free joints that a minor is looked at.
            for choice in itertools.islice(choices, 16):
                self._tick()
                at = [
                    self.forms.linear(j, self._point(k)) for j, k in zip(free, choice, strict=True)
                ]
                poly = self.ring.put(split.form, self.ring.where(at)[0])
                if poly != 0 and not any(self.ring.divides(p, poly) for p in place.relations):
                    (poly,) = self.ring.stripped(poly)
                    found.setdefault(
                        str(self.forms.tidy(poly)),
                        Split([(self.ring.one, {**source, "at": at})], poly),
                    )
        for split in sorted(found.values(), key=lambda s: len(s.form)):
            if not self._vanishes(split.form, place.relations):
                # Units are numbers where free joints are at points: the checker has them, too.
                ((_, source),) = split.sum
                minor = self.certificate.at(place.values)(*map(tuple, source["minor"]))
                poly = self.ring.put(minor, self.ring.where(source["at"])[0])
                yield Split(split.sum, self.ring.stripped(poly)[0])

    def _vanishes(self, form: Poly, relations: Sequence[Poly]) -> bool:
        """Return True if a form is soon seen to vanish where relations do."""
        self._tick()
        return shown(self.ring, functools.partial(vanishes, self.ring, form, relations))

    def _point(self, k: int) -> tuple[Poly, Poly]:
        zero, one = self.ring.zero, self.ring.one
        return ((one, zero), (zero, one), (one, one), (one, -one))[k]

    def _resultants(self, place: Place, longest: int = _LONG) -> Iterator[Split]:
        ring, first = self.ring, len(place.values)
        for (a, p), (b, g) in itertools.combinations(enumerate(place.relations), 2):
            if len(p) * len(g) > longest:
                continue
            for j in set(ring.joints(p)) & set(ring.joints(g)):
                (poly,) = ring.stripped(ring.resultant(p, g, j))
                if poly != 0:
                    yield Split([(ring.one, {"resultant": [first + a, first + b, j]})], poly)

    def _plain_resultants(self, place: Place) -> list[Split]:
        """Resultants of short relations that fall apart into forms shorter than both."""
        found: list[tuple[int, int, Split]] = []
        # Product of terms of two relations whose resultant is looked at among many, and how many of
        # the simplest are tried.
        for split in self._resultants(place, 1000):
            self._tick()
            ((_, source),) = split.sum
            first = len(place.values)
            both = [len(place.relations[k - first]) for k in source["resultant"][:2]]
            lengths = [len(f) for f, _ in self.forms.factors(split.form)]
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
                if rest != 0 and quotient != 0 and self.forms.is_simpler(rest, p):
                    yield Split([(ring.one, first + b), (ring.reduced(-quotient), first + a)], rest)

    def _toward_families(self, place: Place) -> Iterator[Split]:
        """A relation that is, but for a multiple of another one, that of a family times others."""
        ring, relations = self.ring, place.relations
        wanted = {
            str(f): f
            for family in self.families
            for p in family
            for f in ring.stripped(ring.put(p, place.values))
            if f != 0 and ring.joints(f) and not ring.vanishes(f, ({}, relations))
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
        y, low, lead = self.ring.pairs[j][1], self.ring.degree(f, j), top_of(self.ring, f, j)
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
                more, tops = (
                    ring.degree(p, j) - ring.degree(g, j),
                    (top_of(ring, p, j), top_of(ring, g, j)),
                )
                if more < 0 or not all(tops):
                    continue
                factors = tops[1], -tops[0] * ring.pairs[j][1] ** more
                (poly,) = ring.stripped(ring.reduced(p * factors[0] + g * factors[1]))
                if poly != 0 and not any(ring.divides(q, poly) for q in place.relations):
                    yield Split([(factors[0], first + a), (factors[1], first + b)], poly)


_DENSE = 400
"""Terms of all relations beyond which nothing long is tried with them."""


class Tree:
    """Finds the tree, over a certificate that states chain, rank, reduction and families."""

    def __init__(self, forms: Forms, progress: Callable[[str], None] | None = None) -> None:
        self.forms, self.certificate, self.ring = forms, forms.certificate, forms.ring
        self._progress = progress
        certificate = self.certificate
        self.families = [certificate.forms(f) for f in certificate.data["families"]]
        # Relations, if no family has more, beyond which a place is not split: splits that say
        # nothing new go on for ever.
        self._most = max([8, *map(len, self.families)])
        self._splits = Splits(self.forms, self.families, forms.require_time)
        self._places: dict[tuple[Any, ...], Place | NotFound | None] = {}

    def root(self) -> Place:
        """The place that is everywhere; NotFound if one could not be closed, or time was over."""
        place = self._place([])
        assert place is not None
        return place

    def _place(self, forms: Sequence[Poly], points: bool = False) -> Place | None:
        """The place where forms vanish, closed or split; None where it is empty."""
        place = self.forms.without_implied(self.forms.place_of(forms, points))
        if empty(self.ring, place.relations):
            return None
        texts = [str(f) for f in place.forms]
        key = (points, *texts)
        if key in self._places:
            known = self._places[key]
            if known is None:
                raise NotFound("a place leads to itself")
            if isinstance(known, NotFound):
                raise known
            return known
        # One that is closed and has some of these forms only holds this one.
        wider = next(
            (
                other
                for known, other in self._places.items()
                if isinstance(other, Place)
                and other.points == points
                and {*texts}.issuperset(known[1:])
            ),
            None,
        )
        if wider is not None:
            return wider
        self._places[key] = None
        try:
            self.forms.require_time()
            if self._progress is not None:
                self._progress(f"{len(self._places)} places looked at")
            self._close(place)
        except (NotFound, BudgetExceeded, Rejected) as reason:
            self._places[key] = failure = NotFound(str(reason))
            raise failure from None
        self._places[key] = place
        return place

    def _shown(self, question: Callable[[], bool]) -> bool:
        """Return True if something is seen, and not only after long."""
        self.forms.require_time()
        return shown(self.ring, question)

    def _close(self, place: Place) -> None:
        relations = place.relations
        for k, family in enumerate(self.families):
            if all(self.ring.vanishes(f, (place.values, place.relations)) for f in family):
                place.family = k
                return
        if any(self._by_division(place, k) for k in range(len(self.families))):
            return
        least = self.certificate.bound + 1 - len(place.values)
        enough = not place.points and least <= len(relations)
        enough = enough and sum(map(len, relations)) <= _DENSE
        if enough and self._shown(lambda: self.ring.codimension_at_least(least, relations)):
            self._leave(place)
            return
        for k, p in enumerate(relations):
            if [times for _, times in self.forms.factors(p)] != [1]:
                self._split(place, Split([(self.ring.one, len(place.values) + k)], p))
                return
        if self._by_squares(place) or self._too_small_in_part(place, least):
            return
        if len(relations) > self._most:
            raise NotFound(f"more and more relations at {place_text(place)}")
        failure = NotFound(f"nothing to split {place_text(place)} by")
        # Polynomials to split by that are tried at a place before it is given up, and how many
        # relations are so many that fewer are tried.
        tried = 8 if len(relations) <= 5 else 3
        for split in itertools.islice(self._splits.of(place), tried):
            try:
                self._split(place, split)
            except NotFound as reason:
                failure = reason
                continue
            return
        raise failure

    def _by_division(self, place: Place, number: int) -> bool:
        """Split a place that lies in a family by a multiple of one of its forms, if it does."""
        # Two equations leave what is too large for some families (Krull).
        ring, relations, family = self.ring, place.relations, self.families[number]
        least = self.certificate.data["families"][number]["least_codimension"]
        if len(relations) < 2 or len(place.values) + 2 < least:
            return False
        if sum(map(len, relations)) > _DENSE:
            return False
        # Relations, the shortest, of which two are tried alone.
        few = [relations] if len(relations) == 2 else itertools.combinations(relations[:4], 2)
        images = [f for p in family for f in ring.stripped(ring.put(p, place.values))]
        for some in map(list, few):
            if self._shown(lambda some=some: all(vanishes(ring, f, some) for f in images)):  # type: ignore[misc]
                f = next(f for f in images if not ring.vanishes(f, ({}, relations)))
                sources = [
                    len(place.values) + next(i for i, p in enumerate(relations) if p is r)
                    for r in some
                ]
                for _, times, multiples in divisions(ring, f, some):
                    terms = [(c, k) for c, k in zip(multiples, sources, strict=True) if c != 0]
                    try:
                        self._split(place, Split(list(terms), ring.times(times, f)))
                    except NotFound:
                        continue
                    return True
        return False

    def _split(self, place: Place, split: Split) -> None:
        """Follow each factor of a form that vanishes."""
        factors = self.forms.factors(split.form)
        place.cases = [
            (f, times, self._place([*place.forms, f], place.points)) for f, times in factors
        ]
        product = self.ring.one
        for f, times in factors:
            product = self.ring.reduced(product * f**times)
        place.sum = self.forms.sum(split.sum, split.form, product)

    def _by_squares(self, place: Place) -> bool:
        """Close a place where a relation is a sum of squares, and where all of these vanish."""
        for k, p in enumerate(place.relations):
            if self.forms.fixes(p):
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
            place.sum = self.forms.sum([(times, len(place.values) + k)], total, total)
            return True
        return False

    def _too_small_in_part(self, place: Place, least: int) -> bool:
        """Close a place where the shortest of its relations are too many alone, if they are."""
        relations = place.relations
        if place.points:
            return False
        for count in range(max(least, 1), min(least + 2, len(relations))):
            part = relations[:count]
            # Terms of the shortest relations that are tried alone for being too many.
            if sum(map(len, part)) > 60:
                return False
            if self._shown(functools.partial(self.ring.codimension_at_least, least, part)):
                linear = place.forms[: len(place.values)]
                then = self.forms.place_of([*linear, *part])
                self._leave(then)
                place.sum = [("1", len(place.values))]
                place.cases = [(part[0], 1, then)]
                return True
        return False

    def _leave(self, place: Place) -> None:
        """Close a place that is too small for a component."""
        place.sum, place.cases = [("1", 0)], [(place.forms[0], 1, None)]


@dataclass(frozen=True)
class Stated:
    """A component that is stated, and the name of the family it is a part of."""

    name: str
    component: Component


def certificate(
    geometry: Nominal,
    ring: algebra_ring.Ring,
    rank: int,
    stated: Sequence[Stated],
    budget: Budget,
    progress: Callable[[str], None] | None = None,
    in_parts: bool = False,
) -> dict[str, Any]:
    """Return a certificate that the singular set is the union of components, or raise NotFound."""
    # ``in_parts`` states each component as the union of simpler ones where its equations fall
    # apart: that finds proofs where the equations as they are do not, and the other way round.
    roots = roots_in(geometry)
    try:
        data = skeleton(geometry, rank, roots)
    except NotStated as reason:
        raise NotFound(str(reason)) from None
    try:
        data, jacobian = without_dependent_lines(data, budget)
        budget.check()
        draft = Draft(data, budget, jacobian)
        polynomials, tidy = _Table(), Forms(draft, budget)
        for s in stated:
            tidy.require_time()
            forms = [*_linear(draft, s.component.values)]
            forms += [form_of(p, ring, draft.ring.context, roots) for p in s.component.relations]
            forms = _without_implied(draft, tidy.place_of(forms))
            for part in tidy.parts(forms) if in_parts else [tidy.place_of(forms)]:
                why = soundness(draft, tidy, part, s.component.codimension)
                data["families"].append(
                    {
                        "name": s.name,
                        "forms": [polynomials.index(f) for f in part.forms],
                        "least_codimension": s.component.codimension,
                        "pivot": [list(lines) for lines in why.pivot],
                        "apart": [polynomials.index(f) for f in why.apart],
                        "multiples": why.multiples,
                    }
                )
        draft.polys = [draft.ring.parse(text) for text in polynomials.texts]
        data["polynomials"] = polynomials.texts
        root = Tree(tidy, progress).root()
    except Rejected as reason:
        raise NotFound(str(reason)) from None
    order = _ordered(root)
    number = {id(place): k for k, place in enumerate(order)}
    data["places"] = [_written(place, polynomials, number) for place in order]
    return data


def _linear(draft: Certificate, values: Mapping[int, Value]) -> Iterator[Any]:
    """Joint values as forms."""
    for j, v in values.items():
        (x, y), point = draft.ring.pairs[j], v if len(v) == 2 else (1, v[0])
        a, b = (draft.ring.number(number_text(c)) for c in point)
        yield draft.ring.reduced(b * x - a * y)


def _without_implied(draft: Certificate, family: Place) -> list[Any]:
    """Return forms of a family without those that vanish wherever the shorter ones do."""
    # Soundness is shown by division, a form and a joint at a time: more forms than needed hinder
    # it.
    linear, rest = family.forms[: len(family.values)], family.relations
    kept: list[Any] = []
    for p in rest:
        implied = functools.partial(vanishes, draft.ring, p, kept)
        if not kept or not shown(draft.ring, implied, most=MOST_WORK):
            kept.append(p)
    return [*linear, *kept]


def _written(place: Place, polynomials: _Table, number: Mapping[int, int]) -> dict[str, Any]:
    """A place as it stands in the certificate."""
    entry: dict[str, Any] = {
        "forms": [polynomials.index(p) for p in place.forms],
        **{key: [] for key in ("of_forms", "of_minors", "of_resultants", "cases")},
    }
    for text, source in place.sum:
        if isinstance(source, int):
            entry["of_forms"].append([text, source])
        elif "resultant" in source:
            entry["of_resultants"].append([text, *source["resultant"]])
        else:
            free = [polynomials.index(p) for p in source.get("at", [])]
            entry["of_minors"].append([text, source["minor"], free])
    for f, times, then in place.cases:
        entry["cases"].append([[polynomials.index(f)], [], times, *_leads(then, number)])
    if place.squares:
        zeros = [polynomials.index(g) for _, g in place.squares]
        weights = [str(c) for c, _ in place.squares]
        entry["cases"].append([zeros, weights, 1, *_leads(place.then, number)])
    return entry


def _leads(then: Place | None, number: Mapping[int, int]) -> tuple[str, int]:
    """Return where a case leads."""
    if then is None:
        return "nowhere", 0
    if then.family is not None:
        return "family", then.family
    return "place", number[id(then)]


class _Table:
    """Polynomials as texts, each once."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._known: dict[str, int] = {}

    def index(self, poly: Any) -> int:
        text = form_text(poly)
        if text not in self._known:
            self._known[text] = len(self.texts)
            self.texts.append(text)
        return self._known[text]


def _ordered(root: Place) -> list[Place]:
    """Places so that each stands before those that it leads to."""
    seen: set[int] = set()
    order: list[Place] = []

    def visit(place: Place) -> None:
        if id(place) in seen or place.family is not None:
            return
        seen.add(id(place))
        for then in [*(then for _, _, then in place.cases), place.then]:
            if then is not None:
                visit(then)
        order.append(place)

    visit(root)
    return order[::-1]


def text_of(data: Mapping[str, Any]) -> str:
    """A certificate as the text that is written and checked."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"))
