"""Forms as a proof writes them: one multiple of each, factors, places by their forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from flint import fmpq

from pinsing.algebra.budget import Budget
from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.surd_ring import SurdRing
from pinsing.proof.checker import Certificate
from pinsing.proof.division import empty, vanishes
from pinsing.proof.place import Place
from pinsing.proof.skeleton import form_text

Term = tuple[str, Any]
"""A form as text, and the source that it is times."""
_MANY = 3
"""Relations up to which none is looked at for saying nothing new."""
_FACTORED = 30
"""Products of terms that take as long as factoring a short form does, for each of its terms."""
_SHORTEST, _SHORT = 8, 40
"""Terms of relations that others may follow from, and of these others."""


class Forms:
    """Forms of a certificate's ring.

    Parameters
    ----------
    certificate : Certificate
        Its ring, and which roots of numbers are in it.
    budget : Budget
        Time for what is factored, and for what asks `require_time`.
    """

    def __init__(self, certificate: Certificate, budget: Budget) -> None:
        self.certificate, self.ring = certificate, certificate.ring
        self._budget = budget
        self._factors: dict[str, list[tuple[Poly, int]]] = {}
        self._algebra = self._ring_to_factor_in()

    def _ring_to_factor_in(self) -> Ring:
        ring, slides = self.ring, self.certificate.slides
        flat = tuple(False for _ in slides)
        start = tuple(range(0, 2 * len(slides), 2))
        norms = tuple(None if s else u for s, u in zip(slides, ring.unit, strict=True))
        roots = tuple(self.certificate.data["square_roots"])
        if not roots:
            return Ring(ring.context, flat, start, norms)
        return SurdRing(ring.context, flat, start, norms, roots, self._budget)

    def require_time(self) -> None:
        """Raise BudgetExceeded once the time is over."""
        self._budget.check()

    def place_of(self, forms: Sequence[Poly], points: bool = False) -> Place:
        """A place by its forms, in the one way that it is written."""
        values, left = self.ring.where(list(forms))
        linear = [self.linear(j, point) for j, point in sorted(values.items())]
        relations: list[Poly] = []
        for p in sorted(map(self.tidy, left), key=lambda p: (len(p), str(p))):
            if not any(self.ring.divides(r, p) for r in relations):
                relations.append(p)
        return Place([*linear, *relations], self.ring.where(linear)[0], relations, points)

    def without_implied(self, place: Place) -> Place:
        """A place without short relations that vanish where two of the shortest ones do.

        They say nothing new, and with many relations little can be tried.
        """
        if len(place.relations) <= _MANY:
            return place
        kept: list[Poly] = []
        for p in place.relations:
            two = [r for r in kept if len(r) <= _SHORTEST][:2]
            if len(two) < 2 or len(p) > _SHORT or not vanishes(self.ring, p, two):
                kept.append(p)
        if len(kept) == len(place.relations):
            return place
        return self.place_of([*place.forms[: len(place.values)], *kept], place.points)

    def linear(self, j: int, point: tuple[Poly, Poly]) -> Poly:
        """The form that puts joint ``j`` at a point."""
        (x, y), (a, b) = self.ring.pairs[j], point
        return self.tidy(self.ring.reduced(b * x - a * y))

    def tidy(self, poly: Poly) -> Poly:
        """A multiple by a constant: whole coefficients without a common factor, or monic."""
        if poly == 0:
            return poly
        if isinstance(self._algebra, SurdRing):
            return self._algebra.monic(poly)
        return poly / content(poly)

    def parts(self, forms: Sequence[Poly]) -> list[Place]:
        """Common zeros of forms as the union of simpler ones: reduced by each other, factored.

        Where the longer of two relations is the sum of a multiple of the shorter one and a
        product, each factor of that makes a part.
        """
        place = self.place_of(forms)
        if empty(self.ring, place.relations):
            return []
        linear, relations = place.forms[: len(place.values)], place.relations
        for k, p in enumerate(relations):
            others = [*linear, *relations[:k], *relations[k + 1 :]]
            for r in relations[:k]:
                quotient, rest = divmod(p, r)
                (rest,) = self.ring.stripped(self.ring.reduced(rest))
                if quotient != 0 and self.is_simpler(rest, p):
                    return self.parts([*others, rest])
            factors = [f for f, _ in self.factors(p)]
            if len(factors) > 1 or self.fixes(p):
                return [part for f in factors for part in self.parts([*others, f])]
        return [place]

    def is_simpler(self, rest: Poly, p: Poly) -> bool:
        """Whether a remainder is zero, shorter than ``p``, or a product."""
        return bool(rest == 0 or len(rest) < len(p) or len(self.factors(rest)) > 1)

    def fixes(self, f: Poly) -> bool:
        """Whether a form puts one joint at a value."""
        joints = self.ring.joints(f)
        return len(joints) == 1 and self.ring.degree(f, joints[0]) == 1

    def factors(self, poly: Poly) -> list[tuple[Poly, int]]:
        """Irreducible factors that are no units, and how often each is there."""
        key = str(poly)
        if key not in self._factors:
            (left,) = self.ring.stripped(poly)
            self._budget.check_factor(len(left))
            self._budget.spend(_FACTORED * len(left) + len(left) ** 2)
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

    def sum(self, terms: list[tuple[Poly, Any]], form: Poly, product: Poly) -> list[Term]:
        """A sum as it is written: scaled so that it is the product, units aside."""
        (form,) = self.ring.stripped(form)
        scale = self._leading(product) * self._inverse(self._leading(form))
        return [(form_text(self.ring.reduced(c * scale)), source) for c, source in terms]

    def _leading(self, form: Poly) -> Poly:
        """The number before the first monomial in joints."""
        count = 2 * len(self.ring.pairs)
        first = form.monomial(0)[:count]
        return self.ring.context.from_dict(
            {(*[0] * count, *m[count:]): c for m, c in form.to_dict().items() if m[:count] == first}
        )

    def _inverse(self, number: Poly) -> Poly:
        terms = self._algebra.terms(number)
        (value,) = terms.values()
        return self._algebra.number(1 / value)


def content(*polys: Poly) -> Any:
    """What all coefficients of some forms share, with the sign of the first."""
    numbers = [c for p in polys for c in p.coeffs()]
    above = math.gcd(*(int(c.p) for c in numbers))
    below = math.lcm(*(int(c.q) for c in numbers))
    sign = -1 if polys[0].leading_coefficient() < 0 else 1
    return fmpq(sign * above, below)
