"""Where the rank of a polynomial matrix drops: its components, searched branch by branch.

Every component of the complex set {rank M < r} of a rows x columns matrix has codimension
at most (rows - r + 1)(columns - r + 1) (Eagon and Northcott, 1962). So the search branches
on factors of the minors, puts joint values in as soon as a factor fixes one, and leaves a
branch whose codimension has passed the bound: whatever is left there lies on a component
of larger dimension, which another branch finds.

Where several equations are left that fix no joint, generic points of their common zeros say
whether these are singular. If they are, they are a component; if not, a minor that vanishes
on none of them is one equation more. Such sets are small and take long: they come last, those
with the fewest equations first.

The search may go on in a child process, is stopped when time is over, and what it decided at random
points is asked again modulo a second prime.

Where a part of the common zeros of a system does not depend on a joint, every coefficient with
respect to that joint's variables vanishes on it; where a polynomial falls into factors, one of them
does. Stated by these the part is smaller, never larger, than the system: whatever is zero here
makes all of the system's polynomials zero. That nothing of the part is lost its points show.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from flint import Ordering, fmpz_mpoly_ctx, fmpz_mpoly_vec

from pinsing.algebra.budget import Apart, Budget, BudgetExceeded
from pinsing.algebra.generic_points import Residues, SlicePoint, Slices, Undecided, slice_points
from pinsing.algebra.jacobian_matrix import Minors, corner, cost
from pinsing.algebra.ring import (
    SECOND_PRIME,
    WORD_PRIME,
    Matrix,
    Poly,
    Ring,
    Value,
    coefficients_by,
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


Relations = tuple[Poly, ...]


class FoundComponents:
    """Components, as a search comes by them: some lie in others that are found later.

    All that the search passes over because it lies in a component is remembered, and every singular
    point in one: what is kept in the end must account for all of it.
    """

    def __init__(self, ring: Ring, tell: Callable[[Component], None]) -> None:
        self.ring, self._tell = ring, tell
        # the redundant ones too, with generic points of all parts of systems
        self._all: list[tuple[Component, Sequence[SlicePoint]]] = []
        self._passed: list[tuple[Component, Sequence[SlicePoint]]] = []
        self._held: list[tuple[SlicePoint, Component]] = []

    def add(
        self,
        values: Mapping[int, Value],
        relations: tuple[Poly, ...],
        proven: bool,
        codimension: int | None = None,
        points: Sequence[SlicePoint] = (),
    ) -> None:
        """Take one in; its codimension is the number of its equations unless given.

        ``points`` are generic ones of all its parts, where it was judged by these.
        """
        if codimension is None:
            codimension = len(values) + len(relations)
        ordered = tuple(sorted(relations, key=len))
        found = Component(dict(values), ordered, proven, codimension)
        self._all.append((found, points))
        self._tell(found)

    @property
    def all(self) -> list[Component]:
        """All that were taken in, the redundant ones too."""
        return [c for c, _ in self._all]

    def covers(self, values: Mapping[int, Value], relations: tuple[Poly, ...] = ()) -> bool:
        """Return True if a set is part of a component, as far as substitution and division tell."""
        # If it is, it is passed over, and remembered.
        here = Component(dict(values), relations, True, len(values) + len(relations))
        for c in self.all:
            if inside(here, c, self.ring):
                if c != here:
                    self._passed.append((replace(here, proven=c.proven), ()))
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
        # Only what is kept in the end justifies that another one is dropped.
        kept: list[Component] = []
        out: list[Component] = []
        for c, points in sorted(self._all, key=lambda f: by_size(f[0])):
            if any(inside(c, k, self.ring) for k in kept):
                continue
            own = [s for s in points if not on_any(kept, s)]
            if own or not points:
                kept.append(c)
                out += self._parts(c, own, time) if own else [c]
        # What was found, or passed over as a part of it, and is in none of these.
        for c, points in (*self._all, *self._passed):
            there = points and all(on_any(out, s) for s in points)
            if not there and not any(inside(c, k, self.ring) for k in out):
                out.append(c)
        for s, c in self._held:
            out += [] if on_any(out, s) else [c]
        return out

    def _parts(self, c: Component, own: list[SlicePoint], time: Budget) -> list[Component]:
        """A system part by part, and stated by as few equations as its codimension."""
        count = c.codimension - len(c.values)
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
            out += [part] if part == c or not on else self._parts(part, on, time)
        return out


def by_size(c: Component) -> tuple[int, int]:
    """What is larger comes first, and of that what is said in fewer equations."""
    return c.codimension, len(c.relations)


def inside(a: Component, b: Component, ring: Ring) -> bool:
    """Return True if a component lies in another one, as far as substitution and division tell."""
    if any(a.values.get(j) != v for j, v in b.values.items()):
        return False
    rests = map(ring.putting(a.values), b.relations)
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


def vanishing(c: Component, ring: Ring) -> list[Poly]:
    """Polynomials that are all zero at the points of a component, and at no others."""
    return [*itertools.starmap(ring.fixing, c.values.items()), *c.relations]


def on_any(components: Iterable[Component], point: SlicePoint) -> bool:
    """Return True if a point lies on one of some components."""
    ring = point.slice.residues.ring
    return any(all(map(point.is_zero, vanishing(c, ring))) for c in components)


FIRST_SEED = 7
SECOND_SEED = 11


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
    asked: Sequence[tuple[Relations, SearchPlace, int]],
    components: Sequence[Component],
    ring: Ring,
    time: Budget,
) -> RandomSteps:
    """Put all questions of a search to a second prime, and hold its components against it.

    Asked was which points are singular of equations, at a place, whose common zeros have a
    codimension.
    """
    residues = Residues(ring, SECOND_PRIME)
    rng, slices = np.random.default_rng(SECOND_SEED), Slices()
    once = RandomSteps(len(asked), (WORD_PRIME,), (FIRST_SEED,))
    both = RandomSteps(len(asked), (WORD_PRIME, SECOND_PRIME), (FIRST_SEED, SECOND_SEED))
    told = f"random points modulo a second prime, {SECOND_PRIME},"
    try:
        for relations, place, count in asked:
            given = relations, residues, rng, place.values, time.check, count
            for s in slice_points(*given, slices=slices):
                time.check()
                singular = place.singular(s)
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
        coefficients = (c for p in polys for c in coefficients_by(p, ring.variables(j)).values())
        parts = list(map(ring.strip, coefficients))
        # Equations after which expanding is given up.
        if len(parts) <= 60 and all(s.is_zero(c) for c in parts for s in points):
            polys = parts
    return polys


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
    every = [context.from_dict(whole_terms(p)) for p in polys]
    # Of a Groebner basis: polynomials, terms, bits of coefficients.
    few = fmpz_mpoly_vec(every[:count], context)
    basis, done = few.buchberger_naive(limits=(60, 200, 5_000))
    enough = done and basis.is_groebner(fmpz_mpoly_vec(every, context))
    return tuple(polys[:count] if enough else polys)


@dataclass(frozen=True, eq=False)
class SearchPlace:
    """Where the search is: some joints at values."""

    values: Mapping[int, Value]  # these joints
    minors: Minors  # of what the matrix becomes there; singular means: all vanish
    room: int  # how many further equations what is looked for may have
    # the place with the matrix that says what is singular, where ``minors`` are of a part of it
    whole: SearchPlace | None = None

    @property
    def judge(self) -> SearchPlace:
        """The place that says what is singular."""
        return self.whole or self

    def singular(self, point: SlicePoint) -> bool:
        """Return True if a point is singular."""
        return point.rank(self.judge.minors.matrix) < self.judge.minors.size

    def at(self, new: Mapping[int, Value]) -> SearchPlace:
        """The place with some more joints at values."""
        whole = self.judge
        values, room = {**whole.values, **new}, max(0, whole.room - len(new))
        return replace(whole, values=values, minors=whole.minors.at(new), room=room)

    def beside(self, matrix: Matrix, rank: int) -> SearchPlace:
        """The same place, looked at by a part of the matrix."""
        part = Minors(matrix, rank, self.minors.ring, self.minors.time)
        return replace(self, minors=part, whole=self.judge)

    def zeroed(self, relations: Sequence[Poly]) -> SearchPlace:
        """Return the place with entries that are multiples of equations at zero: minors factor."""
        ring, rows = self.minors.ring, self.minors.matrix

        def is_multiple(x: Poly) -> bool:
            return x != 0 and any(len(r) <= len(x) and ring.divides(r, x) for r in relations)

        matrix = [[ring.zero if is_multiple(x) else x for x in row] for row in rows]
        return self if matrix == rows else self.beside(matrix, self.minors.size)


def regular_parts(
    relations: Sequence[Poly],
    singular: Sequence[SlicePoint],
    regular: Sequence[SlicePoint],
    ring: Ring,
    time: Budget,
) -> list[Part]:
    """State the regular part of a system by equations that are nowhere zero on the singular one.

    Points are generic ones of all its parts. What contains the regular part, with its points: the
    system and more equations, or one value of a joint alone, within which the search goes on; none
    if they were not told apart.
    """
    # Factors of the resultants of all two of the equations, by all joints that they share.
    found: dict[str, Poly] = {}
    for p, g in itertools.combinations(relations, 2):
        # Largest product of term counts for which a symbolic resultant is tried.
        if len(p) * len(g) > 4_000:
            continue
        for joint in sorted(set(ring.joints_of(p)) & set(ring.joints_of(g))):
            time.check()
            resultant = ring.strip(ring.eliminated(p, g, joint))
            if resultant != 0:
                found |= {str(f): f for f in ring.factors(resultant, time)}
    factors = sorted(found.values(), key=len)
    telling = [f for f in factors if not all(s.is_zero(f) for s in singular)]
    groups: dict[frozenset[int], list[SlicePoint]] = {}
    for s in regular:
        on = frozenset(i for i, f in enumerate(telling) if s.is_zero(f))
        groups.setdefault(on, []).append(s)
    parts: list[Part] = []
    for on, points in groups.items():
        value = next((telling[i] for i in on if ring.joint_value(telling[i])), None)
        if value is not None:
            parts.append(((value,), points))
            continue
        chosen, left = list(relations), list(singular)
        while left:
            away = {i: sum(not s.is_zero(telling[i]) for s in left) for i in on}
            best = max(on, key=lambda i: (away[i], -len(telling[i])), default=None)
            if best is None or not away[best]:
                return []
            chosen.append(telling[best])
            left = [s for s in left if s.is_zero(telling[best])]
        parts.append((tuple(chosen), points))
    return parts


class Search:
    """Goes through the branches; ``gaps`` say what stopped it, ``asked`` what points decided."""

    def __init__(self, ring: Ring, time: Budget, found: FoundComponents) -> None:
        self.ring = ring
        self.time = time
        self._found = found
        self.gaps: list[str] = []
        self.asked: list[tuple[Relations, SearchPlace, int]] = []
        self.depth = 0
        self._rng = np.random.default_rng(FIRST_SEED)
        self._residues = Residues(ring)
        self._slices: Slices = {}
        self._seen: set[object] = set()
        self._later: list[tuple[int, Callable[[], None]]] = []

    def run(self, place: SearchPlace) -> None:
        """Find all components at a place."""
        self._search(place)
        while self._later:
            first = min(range(len(self._later)), key=lambda i: self._later[i][0])
            self.depth, run = self._later.pop(first)
            run()

    def confirm(self, minors: Minors, rank: int) -> None:
        """Note it unless ``rank`` is the generic rank of the matrix before rows were used up."""
        # A nonzero minor shows that it is no less; zeros of all larger ones, that it is no more.
        short, reduced = min(minors.sides), minors.size
        less = reduced > 0 and (short < reduced or not any(True for _ in minors))
        more = short > max(reduced, 0) and any(
            True for _ in Minors(minors.matrix, max(reduced, 0) + 1, self.ring, self.time)
        )
        if reduced < 0 or less or more:
            self.gaps.append(f"the generic rank is not {rank}, as points chosen at random said")

    # Branches -----------------------------------------------------------------------

    def _search(self, place: SearchPlace) -> None:
        """All components at a place."""
        values = place.values
        key = frozenset(values.items())
        if key in self._seen or self._found.covers(values):
            return
        self._seen.add(key)
        reduced = self._reduced(place)
        if reduced is None:
            return
        minors = reduced.minors
        if reduced.room == 0 and any(  # one regular point: nothing else of this codimension
            self._residues.generic_rank(minors.matrix, self._rng) >= minors.size for _ in range(2)
        ):
            return
        common = self._common_factor(minors)
        if common is None:
            self._found.add(values, (), True)
            return
        if reduced.room == 0:
            return
        shared = self.ring.factors(common, self.time)
        for f in shared:
            fixed = self.ring.joint_value(f)
            at = {} if fixed is None else dict([fixed])
            self._found.add({**values, **at}, () if at else (f,), True)
        if reduced.room < 2:
            return
        found = corner(minors.matrix, self.ring, self.time)
        if found is None or found.determinant == 0:
            self._branches(minors.simplest_cofactor(common), shared, reduced)
            return
        # Where the determinant of the corner is not zero, what is left has to drop its rank.
        rest = self._reduced(reduced.beside(found.rest, minors.size - len(found.rows)))
        if rest is not None:
            common = self._common_factor(rest.minors)
            if common is not None and rest.room >= 2:
                self._branches(rest.minors.simplest_cofactor(common), (), rest)
        self._branches(self.ring.factors(found.determinant, self.time), shared, reduced)

    def _branches(
        self, factors: Sequence[Poly], shared: Sequence[Poly], place: SearchPlace
    ) -> None:
        """Go on inside each of some factors, but for those that are components themselves."""
        for f in factors:
            if f not in shared:
                self._and((), f, place, 0)

    def _relation(self, p: Poly, place: SearchPlace) -> None:
        """Components inside p = 0."""
        key = (frozenset(place.values.items()), str(p), place.minors.size)
        if key in self._seen or self._found.covers(place.values, (p,)):
            return
        self._seen.add(key)
        place = place.zeroed((p,))
        others = []
        proper = (minor for minor in place.minors if not self.ring.divides(p, minor))
        for minor in itertools.islice(proper, 6):
            if not (factors := self.ring.factors(minor, self.time)):
                return
            others.append(factors)
        if not others:
            self._found.add(place.values, (p,), True)
            return
        if place.room < 2:
            return
        for g in min(others, key=cost):
            self._and((p,), g, place, 1)

    def _and(self, relations: Relations, g: Poly, place: SearchPlace, count: int) -> None:
        """Components inside some equations of codimension ``count``, and one more."""
        fixed = self.ring.joint_value(g)
        if fixed is not None:
            self._within(relations, place, dict([fixed]))
        else:
            self._system((*relations, g), place, count + 1)

    def _within(self, relations: Relations, place: SearchPlace, new: Mapping[int, Value]) -> None:
        """Go on at ``new`` values with all factors of what equations become there."""
        place, put = place.at(new), self.ring.putting(new)
        became = [self.ring.strip(put(p)) for p in relations]
        factors = [self.ring.factors(p, self.time) for p in became if p != 0]
        for combination in itertools.product(*factors):
            distinct = tuple({str(h): h for h in combination}.values())
            fixed = next(((h, f) for h in distinct if (f := self.ring.joint_value(h))), None)
            if fixed is not None:
                left = tuple(h for h in distinct if h is not fixed[0])
                self._within(left, place, dict([fixed[1]]))
            elif not distinct:
                self._search(place)
            elif (reduced := self._reduced(place)) is not None:
                independent = self._independent(distinct, place.values)
                self._system(independent, reduced, len(independent))

    def _independent(self, relations: Relations, values: Mapping[int, Value]) -> Relations:
        """Return some relations, of which each cuts the common zeros of those before it."""
        # At joint values several relations may have more common zeros than their number says: one
        # that leaves a part of them is left out, and more is searched.
        ordered = sorted(relations, key=len)
        kept = ordered[:2]  # irreducible, none a multiple of the other
        for g in ordered[2:]:
            try:
                cuts = not any(s.is_zero(g) for s in self._points(kept, values))
            except Undecided:
                cuts = True  # then the system is not decided either, and that is said
            if cuts:
                kept.append(g)
        return tuple(kept)

    def _system(self, relations: Relations, place: SearchPlace, count: int) -> None:
        """Find components inside common zeros of codimension ``count``.

        Those that are such common zeros themselves are stated by as few joints as can be found.
        Where none is, one more minor cuts the rest down by one dimension.
        """
        if count == 1:
            self._relation(relations[0], place)
            return
        key = (frozenset(place.values.items()), frozenset(map(str, relations)), place.minors.size)
        if key in self._seen or place.room < count:
            return
        self._seen.add(key)
        if count > 2:  # what is larger, and found at less cost, first
            run = functools.partial(self._common_zeros, relations, place, count)
            self._later.append((count, run))
        else:
            self._common_zeros(relations, place, count)

    def _common_zeros(self, relations: Relations, place: SearchPlace, count: int) -> None:
        """See ``_system``."""
        self.time.check()
        try:
            points = list(self._points(relations, place.values, count))
        except Undecided:
            self.gaps.append(f"the common points of {len(relations)} equations were not told apart")
            return
        minors = place.minors
        singular = [s for s in points if s.rank(minors.matrix) < minors.size]
        self.asked.append((relations, place, count))
        if singular:
            if len(relations) == 2:
                self._eliminate(*relations, place, singular)
            missed = [s for s in singular if not self._found.holds(s)]
            if missed:
                known = [s for s in points if s not in missed]
                stated = relations
                if known:
                    stated = self._statement(relations, minors, missed, known)
                    stated = self._fewer(stated, place, count)
                self._found.add(place.values, stated, False, len(place.values) + count, missed)
        # What is singular beside the part of the matrix that is looked at is searched by itself.
        regular = [s for s in points if s not in singular and not place.singular(s)]
        if regular and place.room > count:
            self._cut(relations, [s for s in points if s not in regular], regular, place, count)

    def _cut(
        self,
        relations: Relations,
        singular: list[SlicePoint],
        regular: list[SlicePoint],
        place: SearchPlace,
        count: int,
    ) -> None:
        """Go on inside what is regular of some equations, cut by one minor more."""
        parts = [(relations, regular)]
        if singular:
            parts = regular_parts(relations, singular, regular, self.ring, self.time)
            if not parts:
                self.gaps.append(
                    f"sets of codimension {len(place.values) + count + 1} or more inside the "
                    f"regular part of {len(relations)} equations were not searched"
                )
        for stated, on in parts:
            fixed = next((v for f in stated if (v := self.ring.joint_value(f))), None)
            if fixed is not None:  # all of it is searched there
                self._search(place.at(dict([fixed])))
                continue
            zeroed = place.zeroed(stated)
            ways = [place] if zeroed is place else [place, zeroed]
            cuts = [(c, way) for way in ways if (c := way.minors.cutting(on)) is not None]
            if not cuts:
                self.gaps.append(
                    f"no single minor cut all of the common zeros of {len(relations)} equations"
                )
                continue
            cutting, there = min(cuts, key=lambda c: place.minors.effort(c[0]))
            for g in cutting:
                self._and(stated, g, there, count)

    def _eliminate(self, p: Poly, g: Poly, place: SearchPlace, singular: list[SlicePoint]) -> None:
        """Look for components of p = g = 0 by the factors of a resultant, free of one joint."""
        degrees = zip(p.degrees(), g.degrees(), strict=True)
        each = [int(a) * int(b) for a, b in degrees]
        shared = set(self.ring.joints_of(p)) & set(self.ring.joints_of(g))
        # By which joint a resultant is simplest.
        joint = min(shared, key=lambda j: each[self.ring.variables(j)[-1]], default=None)
        # Largest product of term counts for which a symbolic resultant is tried.
        if joint is None or len(p) * len(g) > 2_000:
            return
        resultant = self.ring.strip(self.ring.eliminated(p, g, joint))
        for h in self.ring.factors(resultant, self.time):
            fixed = self.ring.joint_value(h)
            if fixed is not None:
                put = self.ring.putting(dict([fixed]))
                common = self.ring.gcd(put(p), put(g))
                for e in self.ring.factors(self.ring.strip(common), self.time):
                    self._within((e,), place, dict([fixed]))
            elif len(h) <= len(p) + len(g) and any(s.is_zero(h) for s in singular):
                for other in sorted((p, g), key=len):
                    points = self._all_singular(self._points((h, other), place.values), place)
                    if points and all(s.transversal((h, other)) for s in points):
                        self._found.add(place.values, (h, other), False, points=points)
                        break

    def _all_singular(self, points: Iterator[SlicePoint], place: SearchPlace) -> list[SlicePoint]:
        """Points of some equations if all of these are singular, else none."""
        found = []
        for s in points:  # a slice at a time, as they are asked
            if not place.singular(s):
                return []
            found.append(s)
        return found

    def _points(
        self,
        relations: Sequence[Poly],
        values: Mapping[int, Value],
        count: int | None = None,
        once_on: Slices | None = None,
    ) -> Iterator[SlicePoint]:
        """Generic points of the common zeros of some equations, of codimension ``count``."""
        # Patiently on slices that others are met on, or once on some of their own.
        given = relations, self._residues, self._rng, values, self.time.check, count
        slices = self._slices if once_on is None else once_on
        return slice_points(*given, patient=once_on is None, slices=slices)

    # Statements ---------------------------------------------------------------------

    def _fewer(self, stated: Relations, place: SearchPlace, count: int) -> Relations:
        """As few equations as the codimension, if some say the same."""
        # Their common zeros have no parts of lower dimension: where generic points of all parts are
        # singular, and new, all is.
        slices = Slices()
        for few in itertools.combinations(stated[:5], count):
            points = self._points(few, place.values, once_on=slices)
            with contextlib.suppress(Undecided):
                singular = self._all_singular(points, place)
                if singular and not any(map(self._found.holds, singular)):
                    return few
        return stated

    def _statement(
        self,
        relations: Relations,
        minors: Minors,
        singular: list[SlicePoint],
        others: list[SlicePoint],
    ) -> tuple[Poly, ...]:
        """Return equations of the singular part of the common zeros of some equations.

        One factor of every minor, that all of the singular part shares, and of the rest as little
        as can be: where these vanish all minors do, so that not even a regular part of lower
        dimension is stated.
        """
        stated = list(relations)
        for minor in minors:
            self.time.check()
            if any(self.ring.divides(r, minor) for r in stated):
                continue
            whole = [
                f
                for f in self.ring.factors(minor, self.time)
                if all(s.is_zero(f) for s in singular)
            ]
            if len(whole) > 1:
                whole.sort(key=lambda f: (sum(s.is_zero(f) for s in others), len(f)))
            stated.append(whole[0] if whole else minor)
        return tuple(sorted(stated, key=len))

    # Pieces -------------------------------------------------------------------------

    def _common_factor(self, minors: Minors) -> Poly | None:
        """Greatest common divisor of all minors; None if all of them are zero."""
        common = None
        for minor in minors:
            self.time.check_factor(len(minor), self.ring.long_to_factor(minor))
            common = minor if common is None else self.ring.gcd(common, minor)
            if self.ring.is_constant(common):
                break
        return common

    def _reduced(self, place: SearchPlace) -> SearchPlace | None:
        """The place with a smaller matrix, unless all of it is singular (noted), or none."""
        small = place.minors.smaller
        if small.size <= 0:
            return None
        if min(small.sides) < small.size:
            self._found.add(place.values, (), True)
            return None
        return replace(place, minors=small, room=min(place.room, small.bound))


_TO_ASK = 0.1
"""Share of the time for asking the second prime, however long the search took."""


@dataclass(frozen=True, eq=False)
class Decomposition:
    """What a search found."""

    components: list[Component]
    gaps: list[str]  # what stopped it, and what it did not decide
    second: RandomSteps  # what it decided at random points


def decompose(
    matrix: Callable[[], Matrix],
    rank: int,
    ring: Ring,
    time: Budget,
    place: tuple[Mapping[int, Value], int] | None = None,
    known: Sequence[Component] = (),
) -> Decomposition:
    """Return the components of where the rank of a matrix drops, as far as the time goes.

    Inside a ``place`` alone, where one is given: joints at values, of which the matrix is the one
    there, and the largest codimension of what is looked for, these included. Nothing that lies in
    what is ``known`` is looked into.
    """
    apart = Apart(time, time.on_clock + _TO_ASK * time.seconds)
    # A child tells what it found, in case that it is stopped.
    found = FoundComponents(ring, apart.tell)
    for c in known:
        found.add(c.values, c.relations, c.proven, c.codimension)
    search = Search(ring, time, found)

    def searched() -> Decomposition:
        try:
            minors = Minors(matrix(), rank, ring, time).smaller
            if place is None:
                search.confirm(minors, rank)
            bound = minors.bound if minors.size > 0 and minors.matrix else 1
            values, limit = place or ({}, bound)
            search.run(SearchPlace(values, minors, max(0, limit - len(values))))
        except BudgetExceeded as reason:
            inside_of = f" among sets inside {search.depth} simultaneous equations or more"
            search.gaps.append(
                f"not all minors were searched{inside_of if search.depth else ''}: {reason}"
            )
        components = found.irredundant(time)
        second = RandomSteps(0, (), ())
        if search.asked:
            second = ask_again(search.asked, components, ring, time.part(1.0, _TO_ASK))
        return Decomposition(components, [*search.gaps, *second.gaps], second)

    ended = apart.run(searched)
    if ended.result is not None:
        return ended.result
    # Points that found some are gone with the child: only division shows which lie in others.
    left = merged([], sorted([*found.all, *ended.told], key=by_size), ring)
    asked = RandomSteps(len(search.asked) + 1, (WORD_PRIME,), (FIRST_SEED,), (ended.reason,))
    search.gaps.append(f"not all minors were searched: {ended.reason}")
    return Decomposition(left, search.gaps, asked)
