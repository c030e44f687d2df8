"""What certificates are written in: the arm's chain in exact numbers, forms, places by their forms.

Sums of squares say why a form is nowhere negative, or has few real zeros.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from flint import acb_poly, ctx, fmpq, fmpq_poly

from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import dependent
from pinsing.algebra.ring import (
    MadeOfEqual,
    Ring as AlgebraRing,
    coefficients_by,
    rational,
)
from pinsing.proof.checker import (
    MOST_WORK,
    SCHEMA,
    Certificate,
    Matrix,
    Poly,
    Rejected,
    Ring,
    flipped,
)
from pinsing.robot.mimic import drives
from pinsing.robot.nominal import IDENTITY, Deviation, Nominal
from pinsing.robot.surd import SQUARES, Exact, parts_of, roots_of

_ROOTS = ("", "s2", "s3", "s2s3")


class NotFound(Exception):
    """No certificate was found, or there are no words for it; says where."""


def number_text(value: Exact | int) -> str:
    """An exact number as certificates write it: ``1/2``, ``-1/4s2 1/4s2s3``."""
    parts = zip(_ROOTS, parts_of(value), strict=True)
    return " ".join(f"{part}{root}" for root, part in parts if part) or "0"


def form_text(form: Poly) -> str:
    """Return a polynomial as certificates write it: ``2 -1/3y1^2y3``."""
    # Powers of x complete the degree in each joint, and are left out but where that of y is
    # highest.
    names, tops = form.context().names(), form.degrees()
    texts = []
    for m, c in zip(form.monoms(), form.coeffs(), strict=True):
        text = str(c)
        for k, power in enumerate(m):
            if power and (names[k][0] != "x" or m[k + 1] == tops[k + 1]):
                text += f"{names[k]}^{power}" if power > 1 else names[k]
        texts.append(text)
    return " ".join(texts) or "0"


def roots_in(geometry: Nominal) -> tuple[int, ...]:
    """Return what the numbers of a chain have square roots of: 2 or 3, both or none."""
    numbers = [x for R in geometry.rotation for row in R for x in row]
    numbers += [x for row in geometry.tip_rotation for x in row]
    numbers += [x for drive in drives(geometry)[0] for x in drive.turn]
    return roots_of(numbers)


def skeleton(geometry: Nominal, rank: int, roots: Sequence[int]) -> dict[str, Any]:
    """A certificate of an arm that states no family, proves nothing and reduces nothing."""
    arm, task = geometry.arm, geometry.arm.task
    if task.at_tip and not all(task.at_tip):
        raise NotFound("certificates have all rows in the base's axes or all in the tip's")
    # Placements and motions; constant motions become part of a placement.
    driven, snaps = drives(geometry)
    chain: list[dict[str, Any]] = []
    placed = _motion()
    for i, drive in enumerate(driven):
        placed = placed @ _motion(geometry.rotation[i], geometry.translation[i])
        c, s = drive.turn
        if geometry.prismatic[i]:
            placed = placed @ _motion(shift=(0, 0, drive.shift))
        elif c != 1 or s != 0:
            placed = placed @ _motion([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        if drive.multiple != 0:
            multiple = number_text(drive.multiple)
            chain.append({**_placement(placed), "joint": drive.leader, "multiple": multiple})
            placed = _motion()
    placed = placed @ _motion(geometry.tip_rotation, geometry.translation[-1])
    links = len(chain)
    invariant = list(task.rows) in ([*range(6)], [0, 1, 2], [3, 4, 5])
    deviation = Deviation.of((*geometry.snaps, *snaps))
    return {
        "schema": SCHEMA,
        "robot": arm.name if deviation is None else f"{arm.name}, {deviation}",
        "base": arm.base,
        "tip_frame": arm.tip,
        "task": str(task),
        "joints": [
            {"name": name, "kind": "prismatic" if slides else "revolute"}
            for name, slides in zip(arm.joints, arm.prismatic, strict=True)
        ],
        "square_roots": list(roots),
        "chain": chain,
        "tip": _placement(placed),
        "rows": list(task.rows),
        "axes": links // 2 if invariant else links + 1 if task.at_tip else 0,
        "rank": rank,
        "row_steps": [],
        "column_steps": [],
        "polynomials": [],
        "families": [],
        "places": [],
    }


def _motion(turn: Sequence[Sequence[Any]] = IDENTITY, shift: Sequence[Any] = (0, 0, 0)) -> Any:
    """A rigid motion in exact numbers, (4, 4)."""
    rows = [[*row, x] for row, x in zip(turn, shift, strict=True)]
    return np.array([*rows, [0, 0, 0, 1]], dtype=object)


def _placement(motion: Any) -> dict[str, Any]:
    """A motion as certificates write it."""
    rows = [[number_text(x) for x in row] for row in motion[:3].tolist()]
    return {"rotation": [row[:3] for row in rows], "translation": [row[3] for row in rows]}


def form_of(poly: Poly, own: AlgebraRing, context: Any, roots: Sequence[int]) -> Poly:
    """A polynomial of an arm's ring as a form of a certificate's, z of sliders as y over x."""
    degrees = poly.degrees()
    found: dict[tuple[int, ...], Any] = {}
    for monomial, c in own.coefficients(poly).items():
        powers: list[int] = []
        for j, slides in enumerate(own.prismatic):
            first = own.start[j]
            if slides:
                powers += [int(degrees[first]) - monomial[first], monomial[first]]
            else:
                powers += monomial[first : first + 2]
        parts = [c] if own.rational else map(rational, parts_of(c))
        for square, part in zip(SQUARES, parts, strict=False):
            if part:
                found[(*powers, *(int(square % d == 0) for d in roots))] = part
    return context.from_dict(found)


Squares = list[tuple[fmpq, Poly]]
"""Positive factors, and forms that are squared."""


def squares(ring: Ring, p: Poly) -> tuple[Poly, Squares] | None:
    """Return a form, a multiple of ``p``, and a sum of squares that are the same."""
    # Where ``p`` is in one joint that is a multiple by 1 or -1; else the square is completed in one
    # joint, and what is left is a sum of squares in the others: with p = a y^2 + b x y + c x^2,
    # 4 a p = (2 a y + b x)^2 + (4 a c - b^2) x^2.
    joints = ring.joints(p)
    if len(joints) == 1:
        both = ((ring.one * sign, _in_one_joint(ring, sign * p)) for sign in (1, -1))
        return next(((sign, parts) for sign, parts in both if parts is not None), None)
    for j in joints:
        if ring.degree(p, j) != 2:
            continue
        x, y = ring.pairs[j]
        parts = coefficients_by(p, (2 * j, 2 * j + 1))
        a, b, c = (parts.get((2 - k, k), ring.zero) for k in (2, 1, 0))
        rest = 4 * a * c - b * b
        if (left := _in_one_joint(ring, rest) if rest != 0 else []) is not None:
            return 4 * a, [(fmpq(1), 2 * a * y + b * x), *((w, g * x) for w, g in left)]
    return None


def _in_one_joint(ring: Ring, p: Poly) -> Squares | None:
    """A number, or a form in one joint, as a sum of squares, if it is nowhere negative."""
    if len(ring.joints(p)) > 1:
        return None
    constant, factors = p.factor()
    if constant < 0 or (factors and ring.squares):
        return None
    found: Squares = [(constant, ring.one)]
    for f, times in factors:
        found = [(w, g * f ** (times // 2)) for w, g in found]
        if times % 2:
            if (one := _positive(ring, f)) is None:
                return None
            found = [(w * u, g * h) for w, g in found for u, h in one]
    return found


def _positive(ring: Ring, f: Poly) -> Squares | None:
    """An irreducible form in one joint as a sum of squares, if it has no real zero."""
    (j,) = ring.joints(f)
    (x, y), degree = ring.pairs[j], ring.degree(f, j)
    by_power = {m[2 * j + 1]: c for m, c in f.to_dict().items()}
    p = fmpq_poly([by_power.get(k, 0) for k in range(degree + 1)])
    # How small a part of a polynomial is set aside for rounding: 2 to the minus these.
    for part in (8, 16, 32, 64, 128) if degree % 2 == 0 and p[0] > 0 and p[degree] > 0 else ():
        if (parts := _of_positive(p, degree // 2, part)) is not None:
            powers = [y**k * x ** (degree // 2 - k) for k in range(degree // 2 + 1)]
            return [(w, sum(g[k] * m for k, m in enumerate(powers))) for w, g in parts]
    return None


def _of_positive(p: fmpq_poly, half: int, part: int) -> list[tuple[fmpq, fmpq_poly]] | None:
    """Return a polynomial in t as squares: A^2 + B^2 from its roots, and what rounding leaves.

    From a p - e (1 + t^2 + ... + t^2m) without real roots, whose roots above the real axis give A +
    iB. The rest is e t^2k and small odd terms, and d t^(2k+1) is half of |d| (t^(k+1) +- t^k)^2
    less that of t^(2k+2) and t^2k.
    """
    t, lead = fmpq_poly([0, 1]), p[2 * half]
    if half == 1:  # complete the square
        rest = p[0] - p[1] ** 2 / (4 * lead)
        return [(lead, t + p[1] / (2 * lead)), (rest, t**0)] if rest > 0 else None
    small = min(p[0], lead) / 2**part
    less = p - fmpq_poly([small, 0] * half + [small])
    if (parts := _from_roots(less, part + 16)) is None:
        return None
    lead -= small
    found = [(lead, g) for g in parts if g != 0]
    left = p - lead * sum(g * g for g in parts)
    for k in range(half):
        if d := left[2 * k + 1]:
            pair = t ** (k + 1) + (t**k if d > 0 else -(t**k))
            found.append((abs(d) / 2, pair))
            left -= abs(d) / 2 * pair * pair
    if any(left[2 * k] < 0 for k in range(half + 1)):
        return None
    return found + [(left[2 * k], t**k) for k in range(half + 1) if left[2 * k] > 0]


def _from_roots(p: fmpq_poly, bits: int) -> list[fmpq_poly] | None:
    """A and B, rounded, of a polynomial that is its first coefficient times A^2 + B^2."""
    # Precision of the roots that a sum of squares is made from.
    with ctx.workprec(200):
        roots = p.numer().complex_roots()
        if any(z.imag.contains(0) for z, _ in roots):
            return None
        above = acb_poly.from_roots([z for z, times in roots for _ in range(times) if z.imag > 0])
        sides = [c.real for c in above.coeffs()], [c.imag for c in above.coeffs()]
        rounded = ([round(float(c.mid() * 2**bits)) for c in side] for side in sides)
        return [fmpq_poly(side, 2**bits) for side in rounded]


def division(ring: Ring, form: Poly, p: Poly, joint: int) -> tuple[Poly, Poly, Poly, Poly]:
    """Divide a form by another one in a joint: times form = quotient p + xs rest."""
    (x, y), top, degree = ring.pairs[joint], top_of(ring, p, joint), ring.degree(p, joint)
    times, quotient, rest, xs = ring.one, ring.zero, form, ring.one
    while top != 0 and rest != 0 and (more := ring.degree(rest, joint) - degree) >= 0:
        if (lead := top_of(ring, rest, joint)) != 0:
            share = ring.times(lead, y**more)
            rest = ring.times(rest, top) - ring.times(share, p)
            quotient = ring.times(quotient, top) + ring.times(xs, share)
            times = ring.times(times, top)
        rest, xs = divmod(rest, x)[0], xs * x
    return times, quotient, rest, xs


def divisions(
    ring: Ring, form: Poly, forms: Sequence[Poly]
) -> Iterator[tuple[Poly, Poly, list[Poly]]]:
    """Yield ways to divide a form by others, from the last to the first, that leave nothing.

    Each form is divided by in a joint that the ones before it do not have. Yielded are the product
    of the forms' leading coefficients, each once; the same to the powers that make it times the
    form a sum of multiples of the forms; and what these are multiplied by.
    """
    order = sorted(range(len(forms)), key=lambda k: len(ring.joints(forms[k])))
    seen = [{*ring.joints(forms[k])} for k in order]
    own = [joints.difference(*seen[:k]) for k, joints in enumerate(seen)]
    for ways in itertools.product(*own):
        left, tops, times, xs = form, ring.one, ring.one, ring.one
        multiples = [ring.zero] * len(forms)
        for k, j in reversed(list(zip(order, ways, strict=True))):
            tops = ring.times(tops, top_of(ring, forms[k], j))
            more, quotient, left, x = division(ring, left, forms[k], j)
            multiples = [ring.times(m, more) for m in multiples]
            multiples[k] += ring.times(xs, quotient)
            times, xs = ring.times(times, more), xs * x
        if left == 0 and tops != 0:
            yield tops, times, multiples


def top_of(ring: Ring, form: Poly, joint: int) -> Poly:
    """Return what the highest power of y of a joint, without its x, is multiplied by."""
    x, y = ring.names[2 * joint : 2 * joint + 2]
    return form.subs({x: 0, y: 1})


def vanishes(ring: Ring, form: Poly, forms: Sequence[Poly]) -> bool:
    """Return True if ``form`` is shown to be zero wherever all of ``forms`` are."""
    if ring.vanishes(form, ({}, list(forms))):
        return True
    outside: list[Poly] = []  # zero where dividing, for some choice of joints, tells nothing
    for tops, _, _ in divisions(ring, form, forms) if len(forms) > 1 else ():
        outside.append(tops)
        # No component of so few forms has a larger codimension: none is in ``outside``.
        if ring.codimension_at_least(len(forms) + 1, [*forms, *outside]):
            return True
    return False


Values = dict[int, tuple[Poly, Poly]]
"""Joints at points (x : y)."""


Source: TypeAlias = tuple[Any, ...]
"""Where certificates list what vanishes, and which of it: ``"of_forms", 0``."""
Term = tuple[str, Source]
"""A form as text, and the source that it is times."""


@dataclass(eq=False)
class Place:
    """One place of the tree, with how it is closed or split."""

    # what vanishes: first a linear form for each joint that is at a value, then relations
    forms: list[Poly]
    values: Values  # constants
    relations: list[Poly]  # what else vanishes, with these values put in
    points: bool = False  # whether only real points are followed from here on, not whole components
    family: int | None = None  # the family that it lies in: then it is closed
    # what is split: forms as text, and the source that each is times
    sum: list[Term] = field(default_factory=list)
    # a factor, or forms that are squared with positive weights; how often that is there; and where
    # it leads, None where that is empty, or too small for a component
    cases: list[tuple[list[Poly], list[fmpq], int, Place | None]] = field(default_factory=list)


@dataclass(frozen=True)
class Split:
    """A form that vanishes on all components of a place, as a sum of multiples of sources."""

    sum: list[tuple[Poly, Source]]
    form: Poly


def place_text(place: Place) -> str:
    """A place in a few words, for messages."""
    values = ", ".join(f"joint {j + 1} at {x}:{y}" for j, (x, y) in sorted(place.values.items()))
    relations = ", ".join(f"{len(p)} terms" for p in place.relations)
    return f"[{values or 'anywhere'}; {relations or 'no relations'}]"


_ASKED_AFTER = 100_000
"""Products of terms, some milliseconds, between two questions to the budget."""


class Draft(Certificate):
    """A certificate in the making: its chain, and forms, in the one way that each is written.

    All that its ring does is counted, and ends with a budget.
    """

    def __init__(self, data: dict[str, Any], budget: Budget) -> None:
        self._budget = budget
        self._unasked = _ASKED_AFTER  # the first product asks: there may be no time at all
        super().__init__(data)
        self._kept = 0
        self._resultants, self._factors, self._numbers = (MadeOfEqual() for _ in range(3))
        self._resultant, self.ring.resultant = self.ring.resultant, self._known_resultant  # type: ignore[method-assign]

    def _known_resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """As the checker finds it; a search asks for the same ones again and again."""
        # Terms of resultants that are kept: some hundred megabytes.
        if self._kept > 1_000_000:
            return self._resultant(p, g, joint)
        self.ring.spend(1000)  # finding it again takes time, too

        def make(g: Poly) -> Poly:
            found = self._resultant(p, g, joint)
            self._kept += len(p) + len(g) + len(found)
            return found

        of_p = self._resultants.of(p, lambda _: [MadeOfEqual() for _ in self.slides])
        return of_p[joint].of(g, make)

    def jacobian(self) -> Matrix:
        """As the checker finds it; the steps that make dependent lines zero are stated with it."""
        self.ring.spend = self._in_time  # type: ignore[method-assign]
        # The forms' own ring once more, to factor in.
        flat = tuple(False for _ in self.slides)
        start = tuple(range(0, 2 * len(self.slides), 2))
        norms = tuple(None if s else u for s, u in zip(self.slides, self.ring.unit, strict=True))
        ring = self.ring.context, flat, start, norms
        roots = tuple(self.data["square_roots"])
        self.algebra = AlgebraRing(*ring, roots, self._budget)
        lines = super().jacobian()
        self.data["row_steps"] = self._steps(lines)
        rows = self.without_dependent(lines, self.data["row_steps"])
        self.data["column_steps"] = self._steps(flipped(rows))
        return lines

    def _steps(self, lines: Matrix) -> list[list[Any]]:
        """Return which multiples of which lines are taken from those that others make up."""
        if len(lines) == self.rank:
            return []
        found = dependent(lines, self.algebra, self._budget.check)
        text = number_text if self.data["square_roots"] else str
        return [[i, k, text(c)] for i, terms in found.items() for k, c in terms.items()]

    def _in_time(self, work: int) -> None:
        """Count as the checker does, unless the budget has no room for so many products."""
        # Products of terms that take as long as what else a step does, some microseconds.
        self._unasked += work + 30
        if self._unasked > _ASKED_AFTER:
            self._budget.check(self._unasked)
            self._unasked = 0
        Ring.spend(self.ring, work)

    def require_time(self) -> None:
        """Raise BudgetExceeded once the time is over; begin to count the work of one step."""
        self._budget.check()
        self.ring.work = 0  # the checker counts that of the whole check

    def shown(self, question: Callable[[], bool], most: int = 10_000_000) -> bool:
        """Return True if something is seen with so many products of terms; they are not counted."""
        # By default these are a small part of what the checker spends in all.
        self.require_time()
        self.ring.work = MOST_WORK - most
        try:
            return question()
        except Rejected:
            return False
        finally:
            self.ring.work = 0

    def place_of(self, forms: Sequence[Poly], points: bool = False) -> Place:
        """A place by its forms, in the one way that it is written."""
        values, left = self.ring.where(list(forms))
        linear = {j: self.linear(j, point) for j, point in sorted(values.items())}
        relations: list[Poly] = []
        for p in sorted(map(self.tidy, left), key=lambda p: (len(p), p.degrees())):
            if not any(self.ring.divides(r, p) for r in relations):
                relations.append(p)
        at = {j: (f.derivative(2 * j + 1), -f.derivative(2 * j)) for j, f in linear.items()}
        return Place([*linear.values(), *relations], at, relations, points)

    def without_implied(self, place: Place) -> Place:
        """Return a place without short relations that vanish where two of the shortest ones do."""
        kept: list[Poly] = []
        for p in place.relations:
            # Terms of relations that others may follow from, and of these others.
            two = [r for r in kept if len(r) <= 8][:2]
            if len(two) < 2 or len(p) > 40 or not vanishes(self.ring, p, two):
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
        if self.algebra.roots:
            return self.algebra.monic(poly)
        return poly / content(poly)

    def parts(self, forms: Sequence[Poly]) -> list[Place]:
        """Return common zeros of forms as a union of simpler ones: reduced by each other, factored.

        Where the longer of two relations is the sum of a multiple of the shorter one and a product,
        each factor of that makes a part.
        """
        place = self.place_of(forms)
        if not all(map(self.ring.joints, place.relations)):
            return []  # one of them is a number
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
        """Return True if a remainder is zero, shorter than ``p``, or a product."""
        return bool(rest == 0 or len(rest) < len(p) or len(self.factors(rest)) > 1)

    def fixes(self, f: Poly) -> bool:
        """Return True if a form puts one joint at a value."""
        joints = self.ring.joints(f)
        return len(joints) == 1 and self.ring.degree(f, joints[0]) == 1

    def factors(self, poly: Poly) -> list[tuple[Poly, int]]:
        """Irreducible factors that are no units, and how often each is there."""
        return self._factors.of(poly, self._factored)  # type: ignore[no-any-return]

    def _factored(self, poly: Poly) -> list[tuple[Poly, int]]:
        (left,) = self.ring.stripped(poly)
        self._budget.check_factor(len(left))
        # Products of terms that take as long as factoring a short form does, for each of its terms.
        self._budget.spend(30 * len(left) + len(left) ** 2)
        if not self.algebra.roots:
            return [(self.tidy(f), int(k)) for f, k in left.factor()[1]]
        found = []
        for f in self.algebra.factors(left):
            times = 0
            while self.ring.divides(f, left):
                left, times = self.algebra.quotient(left, f), times + 1
            found.append((f, times))
        return found

    def number(self, form: Poly) -> int:
        """Return the number of a form among those of the certificate, where each is once."""
        number: int = self._numbers.of(form, lambda _: len(self.polys))
        if number == len(self.polys):
            self.polys.append(form)
        return number

    def scaled(self, terms: list[tuple[Poly, Source]], form: Poly, product: Poly) -> list[Term]:
        """A sum as it is written: scaled so that it is the product, units aside."""
        (form,) = self.ring.stripped(form)
        there, here = (next(iter(self.algebra.terms(f).values())) for f in (product, form))
        scale = self.algebra.number(there / here)  # of the numbers before the first monomials
        return [(form_text(self.ring.reduced(c * scale)), source) for c, source in terms]


def content(*polys: Poly) -> Any:
    """Return what all coefficients of some forms share, with the sign of the first."""
    numbers = [c for p in polys for c in p.coeffs()]
    above = math.gcd(*(int(c.p) for c in numbers))
    below = math.lcm(*(int(c.q) for c in numbers))
    sign = -1 if polys[0].leading_coefficient() < 0 else 1
    return fmpq(sign * above, below)
