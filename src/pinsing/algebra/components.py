"""The components that a search found, which of them are parts of others, and their statement.

Where a part of the common zeros of a system does not depend on a joint, every coefficient with
respect to that joint's variables vanishes on it; where a polynomial falls into factors, one of them
does. Stated by these the part is smaller, never larger, than the system: whatever is zero here
makes all of the system's polynomials zero. That nothing of the part is lost its points show.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from flint import Ordering, fmpz_mpoly_ctx, fmpz_mpoly_vec

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.generic_points import Residues, SlicePoint, Slices, Undecided, slice_points
from pinsing.algebra.minors import Minors
from pinsing.algebra.ring import (
    SECOND_PRIME,
    WORD_PRIME,
    Poly,
    Ring,
    Value,
    coefficients_by,
    terms_of,
    whole_terms,
)


@dataclass(frozen=True)
class Component:
    """Where rank drops: joints at exact values, and polynomials that vanish."""

    values: Mapping[int, Value]  # exact joint values
    relations: tuple[Poly, ...]  # polynomials in the other joints; one, or a system of several
    # whether every minor was shown to vanish there by division (else at random points, in exact
    # arithmetic modulo a prime)
    proven: bool
    codimension: int  # complex codimension


Statement = Callable[[list[SlicePoint], list[SlicePoint]], tuple[Poly, ...]]
"""From points that are meant, and points that are not, to equations."""


@dataclass(frozen=True)
class Backing:
    """What a system of equations was made of."""

    points: list[SlicePoint]  # generic points of all its parts
    others: list[SlicePoint]  # points that it had to be told apart from
    state: Statement | None = None  # how to state it once more


class FoundComponents:
    """Components, as a search comes by them: some lie in others that are found later.

    All that the search passes over because it lies in a component is remembered, and every singular
    point in one: what is kept in the end must account for all of it.
    """

    def __init__(self, ring: Ring, tell: Callable[[Component], None]) -> None:
        self.ring, self._tell = ring, tell
        self._found: list[tuple[Component, Backing]] = []
        self._passed: list[Component] = []
        self._held: list[tuple[SlicePoint, Component]] = []

    def add(
        self,
        values: Mapping[int, Value],
        relations: tuple[Poly, ...],
        proven: bool,
        codimension: int | None = None,
        backing: Backing | None = None,
    ) -> None:
        """Take one in; its codimension is the number of its equations unless given."""
        if codimension is None:
            codimension = len(values) + len(relations)
        ordered = tuple(sorted(relations, key=len))
        found = Component(dict(values), ordered, proven, codimension)
        self._found.append((found, backing or Backing([], [])))
        self._tell(found)

    @property
    def all(self) -> list[Component]:
        """All so far, the redundant ones too."""
        return [c for c, _ in self._found]

    def covers(self, values: Mapping[int, Value], relations: tuple[Poly, ...] = ()) -> bool:
        """Return True if a set is part of a component, as far as substitution and division tell."""
        # If it is, it is passed over, and remembered.
        here = Component(dict(values), relations, True, len(values) + len(relations))
        for c in self.all:
            if inside(here, c, self.ring):
                if c != here:
                    self._passed.append(replace(here, proven=c.proven))
                return True
        return False

    def holds(self, point: SlicePoint) -> bool:
        """Return True if a singular point lies on a component, and need not be looked at."""
        for c in self.all:
            if on_any([c], point):
                self._held.append((point, c))
                return True
        return False

    def irredundant(self, time: Budget) -> list[Component]:
        """Return components that lie in no other one, by division or by all of their points."""
        # A system that shares some points is stated again by the rest of them. Only what is kept in
        # the end justifies that another one is dropped.
        kept: list[tuple[Component, list[SlicePoint]]] = []
        for c, backing in sorted(self._found, key=lambda f: by_size(f[0])):
            earlier = [k for k, _ in kept]
            if any(inside(c, k, self.ring) for k in earlier):
                continue
            held = [s for s in backing.points if on_any(earlier, s)]
            own = [s for s in backing.points if s not in held]
            if own or not backing.points:
                if held and backing.state is not None:  # stated by its own points only
                    with contextlib.suppress(BudgetExceeded):
                        c = replace(c, relations=backing.state(own, [*backing.others, *held]))
                kept.append((c, own))
        # What could not be told apart from a part of it may hold one that came earlier.
        for entry in tuple(kept):
            c, own = entry
            rest = [other for other in kept if other is not entry]
            others = [k for k, _ in rest]
            if not own or not any(all(on_any([k], s) for s in own) for k in others):
                continue
            if not self._unaccounted(others):
                kept = rest
        out = [part for c, own in kept for part in self._parts(c, own, time)]
        while left := self._unaccounted(out):
            out.append(left)
        return out

    def _parts(self, c: Component, own: list[SlicePoint], time: Budget) -> list[Component]:
        """A system part by part, and stated by as few equations as its codimension."""
        count = c.codimension - len(c.values)
        if not own:
            return [c]
        relations = divided(c.relations, self.ring)
        if relations == c.relations and len(relations) <= count:
            return [c]
        try:
            parts = restated(relations, own, count, self.ring, time)
        except BudgetExceeded:
            return [c]
        out = []
        for relations, on in parts:
            part = settled(replace(c, relations=relations), self.ring)
            # With fewer joints in them, or fewer points on them, equations fall apart that did not.
            out += [part] if part == c else self._parts(part, on, time)
        return out

    def _unaccounted(self, kept: Sequence[Component]) -> Component | None:
        """Something that was found, or passed over as a part of it, and is in none of these."""

        def lies_in_one(c: Component) -> bool:
            return any(inside(c, k, self.ring) for k in kept)

        for c, backing in self._found:
            held = backing.points and all(on_any(kept, s) for s in backing.points)
            if not held and not lies_in_one(c):
                return c
        passed = (c for c in self._passed if not lies_in_one(c))
        left = (c for s, c in self._held if not on_any(kept, s))
        return next(itertools.chain(passed, left), None)


def by_size(c: Component) -> tuple[int, int]:
    """What is larger comes first, and of that what is said in fewer equations."""
    return c.codimension, len(c.relations)


def inside(a: Component, b: Component, ring: Ring) -> bool:
    """Return True if a component lies in another one, as far as substitution and division tell."""
    if any(a.values.get(j) != v for j, v in b.values.items()):
        return False
    rests = (ring.substitute(r, a.values) for r in b.relations)
    return all(rest == 0 or any(ring.divides(p, rest) for p in a.relations) for rest in rests)


def merged(known: Sequence[Component], found: Sequence[Component], ring: Ring) -> list[Component]:
    """Known components and those found that lie in none of them, without what lies in these."""
    out = list(known)
    for c in found:
        if not any(inside(c, k, ring) for k in out):
            out = [*(k for k in out if not inside(k, c, ring)), c]
    return out


def settled(c: Component, ring: Ring) -> Component:
    """Return the component with relations that fix one joint put into the others, repeatedly."""
    values, left = dict(c.values), list(c.relations)
    while fixed := dict(f for r in left if (f := ring.joint_value(r))):
        values |= fixed
        put = ring.putting(fixed)
        left = [r for r in (ring.strip(put(r)) for r in left) if r != 0]
    return replace(c, values=values, relations=tuple(sorted(left, key=len)))


def on_any(components: Iterable[Component], point: SlicePoint) -> bool:
    """Return True if a point lies on one of some components."""
    return any(
        all(point.has(j, value) for j, value in c.values.items())
        and all(point.is_zero(r) for r in c.relations)
        for c in components
    )


FIRST_SEED = 7
SECOND_SEED = 11


@dataclass(frozen=True, eq=False)
class Question:
    """A system of equations at a place, whose points were judged."""

    relations: tuple[Poly, ...]  # the equations
    values: Mapping[int, Value]  # joints at values
    minors: Minors  # of what becomes of the Jacobian there; singular means: all vanish
    count: int  # the codimension of the equations' common zeros


@dataclass(frozen=True)
class RandomSteps:
    """What of an answer rests on random points of finite fields."""

    systems: int  # judged by random points; 0: nothing rests on them
    primes: tuple[int, ...]
    seeds: tuple[int, ...]
    gaps: tuple[str, ...] = ()  # what the second prime contradicted, or had no time for


def together(steps: Iterable[RandomSteps]) -> RandomSteps:
    """The random steps of several searches as one."""
    some = [s for s in steps if s.systems]
    return RandomSteps(
        sum(s.systems for s in some),
        tuple(dict.fromkeys(p for s in some for p in s.primes)),
        tuple(dict.fromkeys(seed for s in some for seed in s.seeds)),
        tuple(dict.fromkeys(g for s in some for g in s.gaps)),
    )


def ask_again(
    asked: Sequence[Question], components: Sequence[Component], ring: Ring, time: Budget
) -> RandomSteps:
    """Put all questions of a search to a second prime, and hold its components against it."""
    if not asked:
        return RandomSteps(0, (), ())
    residues = Residues(ring, SECOND_PRIME)
    rng, slices = np.random.default_rng(SECOND_SEED), Slices()
    once = RandomSteps(len(asked), (WORD_PRIME,), (FIRST_SEED,))
    both = RandomSteps(len(asked), (WORD_PRIME, SECOND_PRIME), (FIRST_SEED, SECOND_SEED))
    told = f"random points modulo a second prime, {SECOND_PRIME},"
    try:
        for q in asked:
            asked_at = q.relations, residues, rng, q.values, time.check, q.count
            for s in slice_points(*asked_at, slices=slices):
                time.check()
                singular = s.rank(q.minors.matrix) < q.minors.size
                if singular != on_any(components, s):
                    what = "are singular on no family" if singular else "are regular on a family"
                    return replace(both, gaps=(f"{told} {what}",))
    except BudgetExceeded as reason:
        return replace(once, gaps=(f"{told} were not asked: {reason}",))
    except Undecided:
        return replace(once, gaps=(f"{told} were not told apart",))
    return both


Part = tuple[tuple[Poly, ...], list[SlicePoint]]


def restated(
    relations: Sequence[Poly], points: list[SlicePoint], count: int, ring: Ring, time: Budget
) -> list[Part]:
    """Return the parts of a system, each with equations and the points that are on it."""
    # ``points`` are generic ones of all parts that are meant, ``count`` its independent equations.
    polys = _distinct(_expanded(relations, points, ring), ring)
    chosen: list[Poly] = []
    for p in polys:
        # Terms up to which a polynomial is factored however late it is: the statement must not
        # depend on the load of a machine where it costs nothing.
        factors = ring.factors(p, time if len(p) > 100 else None)
        whole = [f for f in factors if all(s.is_zero(f) for s in points)]
        if whole:
            chosen.append(min(whole, key=len))
            continue
        for f in factors:
            on = [s for s in points if s.is_zero(f)]
            if on and len(on) < len(points):
                off = [s for s in points if s not in on]
                return [
                    *restated(relations, on, count, ring, time),
                    *restated(relations, off, count, ring, time),
                ]
        return [(tuple(relations), points)]  # a point on none of the factors: leave it
    return [(_fewest(_distinct(chosen, ring), count, ring), points)]


def divided(relations: tuple[Poly, ...], ring: Ring) -> tuple[Poly, ...]:
    """Return the system with products for relations, up to multiples of shorter ones."""
    # The common zeros are the same, and fall into parts. Only products of what has fewer joints are
    # made: others are no simpler, and may have zeros more where x^2 + y^2 of a joint is zero.
    if not ring.rational or len(relations) < 2:
        return relations
    kept = list(relations)
    for k in range(1, len(kept)):
        for r in kept[:k]:
            quotient, rest = divmod(kept[k], r)
            if quotient == 0 or rest == 0 or len(rest) > len(kept[k]):
                continue
            rest = ring.strip(rest)
            many = len(ring.joints_of(kept[k]))
            if all(len(ring.joints_of(f)) < many for f in ring.factors(rest)):
                kept[k] = rest
    return tuple(kept)


def _expanded(relations: Sequence[Poly], points: Sequence[SlicePoint], ring: Ring) -> list[Poly]:
    """Coefficients with respect to all joints that no part of the points depends on."""
    polys = list(relations)
    for j in sorted({j for p in polys for j in ring.joints_of(p)}):
        together = _coefficients_on(polys, j, points, ring)
        if together is not None:
            polys = together
    return polys


def _coefficients_on(
    polys: Sequence[Poly], joint: int, points: Sequence[SlicePoint], ring: Ring
) -> list[Poly] | None:
    """All coefficients with respect to a joint, if they are not too many and zero at all points."""
    variables = ring.variables(joint)
    out: list[Poly] = []
    for p in polys:
        free = not any(p.degrees()[v] for v in variables)
        mine = [p] if free else list(coefficients_by(p, variables).values())
        mine = [ring.strip(c) for c in mine]
        out += mine
        # Equations after which expanding is given up.
        if len(out) > 60 or not all(s.is_zero(c) for c in mine for s in points):
            return None
    return out


def _distinct(polys: Sequence[Poly], ring: Ring) -> list[Poly]:
    """The polynomials, the short ones first, without multiples of earlier ones."""
    kept: list[Poly] = []
    for p in sorted(polys, key=len):
        if not any(divmod(p, k)[1] == 0 if ring.rational else p == k for k in kept):
            kept.append(p)
    return kept


def _fewest(polys: list[Poly], count: int, ring: Ring) -> tuple[Poly, ...]:
    """The first ``count`` polynomials, if all others lie in their ideal; else all."""
    if len(polys) <= count or not ring.rational:
        return tuple(polys)
    context = fmpz_mpoly_ctx.get(list(polys[0].context().names()), Ordering.degrevlex)

    few = fmpz_mpoly_vec([context.from_dict(whole_terms(p)) for p in polys[:count]], context)
    # Of a Groebner basis: polynomials, terms, bits of coefficients.
    basis, done = few.buchberger_naive(limits=(60, 200, 5_000))
    if not done:
        return tuple(polys)
    over_q = [polys[0].context().from_dict(dict(terms_of(g))) for g in basis]
    return tuple(polys[:count] if all(_reduced(p, over_q) == 0 for p in polys[count:]) else polys)


def _reduced(poly: Poly, basis: Sequence[Poly]) -> Poly:
    """Remainder of division by all of a basis."""
    before = None
    while poly != 0 and poly != before:
        before = poly
        for g in basis:
            poly = divmod(poly, g)[1]
    return poly
