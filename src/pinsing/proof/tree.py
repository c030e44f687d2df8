"""Case splits that end in families: found by factoring, for the checker to follow without.

A place is some joints at values and some polynomials that vanish. It is closed where it lies in
a family, where it is too small for a component, or where it has no real point; else a polynomial
that vanishes on all its components is factored, and every factor leads to another place.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.ring import Poly
from pinsing.proof.checker import Rejected, Ring
from pinsing.proof.division import divisions, empty, shown, vanishes
from pinsing.proof.forms import Forms
from pinsing.proof.place import NotFound, Place, Split, place_text
from pinsing.proof.splits import Splits
from pinsing.proof.squares import squares

_MOST = 8
"""Relations, if no family has more, beyond which a place is not split: splits that say nothing new
go on for ever."""
_FEW = 4
"""Relations, the shortest, of which two are tried alone."""
_PART = 60
"""Terms of the shortest relations that are tried alone for being too many."""
_TRIED, _MANY, _TRIED_THERE = 8, 5, 3
"""Polynomials to split by that are tried at a place before it is given up, and how many relations
are so many that fewer are tried."""
_DENSE = 400
"""Terms of all relations beyond which nothing long is tried with them."""


class Tree:
    """Finds the tree, over a certificate that states chain, rank, reduction and families."""

    def __init__(
        self,
        forms: Forms,
        budget: Budget,
        progress: Callable[[str], None] | None = None,
    ) -> None:
        self.forms, self.certificate, self.ring = forms, forms.certificate, forms.ring
        self._budget, self._progress = budget, progress
        certificate = self.certificate
        self.families = [certificate.forms(f) for f in certificate.data["families"]]
        self._most = max([_MOST, *map(len, self.families)])
        self._splits = Splits(self.forms, self.families, self._check_time)
        self._places: dict[tuple[Any, ...], Place | NotFound | None] = {}

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
        self._budget.check()
        self.ring.work = 0  # what is counted is one step here, the whole check there

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

    def _shown(self, question: Callable[[], bool]) -> bool:
        """Whether something is seen, and not only after long."""
        self._check_time()
        return shown(self.ring, question)

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
            if self._lies_in(place, family):
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
        tried = _TRIED if len(relations) <= _MANY else _TRIED_THERE
        for split in itertools.islice(self._splits.of(place), tried):
            try:
                self._split(place, split)
            except NotFound as reason:
                failure = reason
                continue
            return
        raise failure

    def _lies_in(self, place: Place, family: list[Poly]) -> bool:
        """Whether a place is seen to lie in a family."""
        return all(self.ring.vanishes(f, (place.values, place.relations)) for f in family)

    def _by_division(self, place: Place, number: int) -> bool:
        """Split a place that lies in a family by a multiple of one of its forms, if it does.

        Two equations leave what is too large for some families (Krull).
        """
        ring, relations, family = self.ring, place.relations, self.families[number]
        least = self.certificate.data["families"][number]["least_codimension"]
        if len(relations) < 2 or len(place.values) + 2 < least:
            return False
        if sum(map(len, relations)) > _DENSE:
            return False
        few = [relations] if len(relations) == 2 else itertools.combinations(relations[:_FEW], 2)
        for some in map(list, few):
            images = [f for p in family for f in ring.stripped(ring.put(p, place.values))]
            if self._shown(functools.partial(_all_vanish, ring, images, some)):
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
            if sum(map(len, part)) > _PART:
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


def _all_vanish(ring: Ring, images: Sequence[Poly], some: Sequence[Poly]) -> bool:
    """Whether forms are shown to be zero wherever some others all are."""
    return all(vanishes(ring, f, some) for f in images)
