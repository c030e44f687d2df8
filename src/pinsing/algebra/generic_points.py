"""Points over finite fields at which polynomials are zero, and what others are there.

A prime has 62 bits, and what is computed modulo it is exact: the points have coordinates in finite
fields, and a rank is a rank.

All common zeros of k polynomials in k variables, over the closure of the field: variables are
eliminated by resultants, down to one; its values are roots of irreducible factors, each in a field
of its own, and from there the other variables follow as common roots, in larger fields where they
must be. A resultant has zeros of its own making besides: those have no common root above them, and
fall away.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field as dataclass_field
from typing import Any

import numpy as np
from flint import fmpz_mod_poly_ctx, fq_default_ctx, fq_default_poly_ctx, nmod_mat, nmod_poly

from pinsing.algebra.ring import (
    WORD_PRIME,
    MadeOnce,
    Matrix,
    Poly,
    Ring,
    Value,
    coefficients_by,
    divided_by,
    image,
    line_of,
    modular_context,
    terms_of,
)
from pinsing.errors import Refusal
from pinsing.robot.surd import residue


class Undecided(Refusal):
    """The zeros are not finitely many, or more than can be told apart."""


@dataclass(frozen=True, eq=False)
class Zero:
    """One common zero, and with it all its conjugates."""

    field: Any  # the finite field of the coordinates
    at: Mapping[int, Any]  # variable (by index) and its value

    # powers of values that were asked for
    powers: dict[tuple[int, int], Any] = dataclass_field(default_factory=dict)

    @functools.cached_property
    def _residues(self) -> dict[int, int]:
        return {v: _number(x) for v, x in self.at.items()}

    def value(self, poly: Any) -> Any:
        """Value there of a polynomial in these variables."""
        if self.field.degree() == 1:
            known = [self._residues.get(v, 0) for v in range(poly.context().nvars())]
            return self.field(int(poly(*known)))
        total = self.field.zero()
        for monomial, c in terms_of(poly).items():
            term = self.field(int(c))
            for key in enumerate(monomial):
                if key[1]:
                    if key not in self.powers:
                        self.powers[key] = self.at[key[0]] ** int(key[1])
                    term = term * self.powers[key]
            total = total + term
        return total


def zeros(
    polys: Sequence[Any],
    variables: Sequence[int],
    nonzero: Mapping[int, Any],
    rng: np.random.Generator,
    check: Callable[[float], None],
    patient: bool = True,
) -> Iterable[Zero]:
    """Return every common zero of ``polys``; lazily, unless ``patient``, which tries other ways.

    There are as many ``polys`` as ``variables`` (indices) or more, in these alone, modulo a prime
    of 62 bits. Zeros of ``nonzero`` polynomials, in one variable each, are not wanted. ``check`` is
    asked, with the number of term products, before each long step. Undecided if there are
    infinitely many, or an eliminant is too long.
    """
    given = nonzero, rng, check, int(polys[0].context().modulus())
    if not patient:
        return _Solver(*given, False, False).each(polys, variables)
    with contextlib.suppress(Undecided):
        return list(_Solver(*given, True, False).each(polys, variables))
    return list(_Solver(*given, True, True).each(polys, variables))


@dataclass(frozen=True, eq=False)
class _Solver:
    """What all steps of an elimination share: parameters of ``zeros``, and the prime.

    ``orders``: try other orders of elimination; ``mixing``: try combinations of the polynomials.
    """

    nonzero: Mapping[int, Any]
    rng: np.random.Generator
    check: Callable[[float], None]
    prime: int
    orders: bool
    mixing: bool

    def each(self, polys: Sequence[Any], variables: Sequence[int]) -> Iterator[Zero]:
        """See ``zeros``: one after the other."""
        Undecided.refuse_if(any(f == 0 for f in polys))
        if any(f.is_constant() for f in polys):
            return
        if not variables:
            yield Zero(_field(self.prime), {})
            return
        having = {v: [f for f in polys if f.degrees()[v] > 0] for v in variables}
        cost = {v: (len(having[v]), sum(f.degrees()[v] for f in having[v])) for v in variables}
        *others, last = sorted(variables, key=cost.__getitem__)[: None if self.orders else 1]
        for v in others:
            try:
                found = list(self._solved(polys, variables, v, having[v]))
            except Undecided:
                # Zeros that are not wanted may be whole curves; some variable, eliminated first,
                # leaves them where they are known.
                continue
            yield from found
            return
        yield from self._solved(polys, variables, last, having[last])

    def _solved(
        self, polys: Sequence[Any], variables: Sequence[int], v: int, having: Sequence[Any]
    ) -> Iterator[Zero]:
        """Zeros, with one variable eliminated first."""
        rest = [u for u in variables if u != v]
        if not having:  # none, or as many as there are values of v
            Undecided.refuse_if(list(self.each(polys, rest)))
            return
        free = [f for f in polys if f.degrees()[v] == 0]
        if not rest or len(having) == 1:
            below = list(self.each(free, rest))
        else:
            below = self._eliminated(free, having, v, rest)
        for zero in below:
            self.check(0.0)
            for above in _above(zero, having, v):
                if v not in self.nonzero or not above.value(self.nonzero[v]).is_zero():
                    yield above

    def _eliminated(
        self, free: Sequence[Any], having: Sequence[Any], v: int, rest: Sequence[int]
    ) -> list[Zero]:
        """Zeros of resultants in place of the polynomials that have variable v."""
        ordered = sorted(having, key=lambda f: (f.degrees()[v], len(f)))
        try:
            return list(self.each([*free, *self._resultants(ordered, v)], rest))
        except Undecided:
            if len(having) < 3 or not self.mixing:
                raise
        # Over a whole curve the pivot may share one root with one of the others, and another
        # with the next. Not so where they are mixed.
        mixed = [sum(f * int(self.rng.integers(1, self.prime)) for f in having) for _ in having]
        return list(self.each([*free, *self._resultants(mixed, v)], rest))

    def _resultants(self, polys: Sequence[Any], v: int) -> list[Any]:
        """Return resultants with the first polynomial, and of three or more one more."""
        # It rules out most of the zeros of the resultants' own making.
        pairs = [(polys[0], f) for f in polys[1:]]
        if len(polys) > 2:
            pairs.append((polys[1], polys[2]))
        out = []
        for pivot, f in pairs:
            a, b = ([int(d) for d in g.degrees()] for g in (pivot, f))
            into = [1.0 + a[v] * b[u] + b[v] * a[u] for u in range(len(a)) if u != v]
            terms = float(np.prod(into))
            # Degrees and terms; beyond, the factors of an eliminant take seconds.
            Undecided.refuse_if(max(into, default=0) > 3_000 or terms > 10_000)
            # Term products that one of a resultant costs.
            self.check(8.0 * terms * (a[v] + b[v]) ** 2)
            found = pivot.resultant(f, pivot.context().names()[v])
            # Without the factors whose zeros are not wanted.
            out.append(functools.reduce(divided_by, self.nonzero.values(), found))
        return out


def _above(zero: Zero, polys: Sequence[Any], v: int) -> list[Zero]:
    """The common roots of polynomials in variable v, the others being at a zero."""
    over = fq_default_poly_ctx(zero.field)
    common: Any = None
    for f in polys:
        parts = coefficients_by(f, (v,))
        line = over([zero.value(parts.get((i,), 0 * f)) for i in range(int(f.degrees()[v]) + 1)])
        common = line if common is None else common.gcd(line)
    # a whole line of zeros
    Undecided.refuse_if(common == 0)
    if common.degree() == 0:
        return []
    common = common.radical()
    if common.degree() == 1:
        return [Zero(zero.field, {**zero.at, v: -common[0] * common[1].inverse()})]
    return _extended(zero, common, v)


def _extended(zero: Zero, common: Any, v: int) -> list[Zero]:
    """Return roots that are not in a zero's field, in larger ones.

    The sum w of the root and of a multiple of the field's generator generates both: w has the
    irreducible factors of a resultant as its minimal polynomials, and the generator is a common
    root of two polynomials over the field of w.
    """
    prime = int(zero.field.characteristic())
    if zero.field.degree() == 1:
        line = nmod_poly([_number(c) for c in common.coeffs()], prime)
        known = {u: _number(x) for u, x in zero.at.items()}
        roots = (_field_of(factor) for factor, _ in line.factor()[1])
        return [Zero(F, {**{u: F(x) for u, x in known.items()}, v: root}) for F, root in roots]
    plane = modular_context(("x", "w"), prime)
    x, w = plane.gens()
    modulus = [int(c) for c in zero.field.modulus().coeffs()]
    terms = [[int(a) for a in c.to_list()] for c in common.coeffs()]
    for multiple in range(1, 4 + 1):
        y = w - multiple * x
        below = sum((c * x**i for i, c in enumerate(modulus)), plane.constant(0))
        above = plane.constant(0)
        for row in reversed(terms):
            above = above * y + sum((c * x**i for i, c in enumerate(row)), plane.constant(0))
        minimal = nmod_poly(line_of(terms_of(below.resultant(above, "x")), 1), prime)
        if minimal.gcd(minimal.derivative()).degree() > 0:
            continue  # two roots give one sum
        return [_with_sum(zero, f, v, modulus, terms, multiple) for f, _ in minimal.factor()[1]]
    raise Undecided


def _with_sum(
    zero: Zero, factor: Any, v: int, modulus: list[int], terms: list[list[int]], multiple: int
) -> Zero:
    """A zero and the root above it, over the field that their weighted sum generates."""
    field, w = _field_of(factor)
    over = fq_default_poly_ctx(field)
    y = over([w, field(-multiple)])
    above = over.zero()
    for row in reversed(terms):
        above = above * y + over([field(c) for c in row])
    shared = over([field(c) for c in modulus]).gcd(above)
    Undecided.refuse_if(shared.degree() != 1)
    generator = -shared[0] * shared[1].inverse()
    at = {u: _moved(x, generator, field) for u, x in zero.at.items()}
    return Zero(field, {**at, v: w - field(multiple) * generator})


def _moved(value: Any, generator: Any, field: Any) -> Any:
    """An element of a field, in a larger field in which its generator is known."""
    total = field.zero()
    for c in reversed(value.to_list()):
        total = total * generator + field(int(c))
    return total


def _field_of(factor: Any) -> tuple[Any, Any]:
    """The field that a root of an irreducible polynomial generates, and the root."""
    prime = int(factor.modulus())
    if factor.degree() == 1:
        field = _field(prime)
        return field, field(int(-factor[0] / factor[1]))
    field = fq_default_ctx(
        modulus=fmpz_mod_poly_ctx(prime)([int(c) for c in factor.coeffs()]),
        fq_type="FQ_NMOD",
        check_prime=False,
        check_modulus=False,
    )
    return field, field([0, 1])


@functools.cache
def _field(prime: int) -> Any:
    """The prime field itself."""
    return fq_default_ctx(prime, 1, fq_type="FQ_NMOD", check_prime=False)


def _number(value: Any) -> int:
    """An element of the prime field, as an integer."""
    line = value.to_list()
    return int(line[0]) if line else 0


# Random slices ------------------------------------------------------------------------


class Residues:
    """Images of a ring's polynomials modulo a prime, made once each."""

    def __init__(self, ring: Ring, prime: int = WORD_PRIME) -> None:
        self.ring, self.prime = ring, prime
        self._images = MadeOnce()

    def of(self, poly: Poly) -> Any:
        """The image of a polynomial."""
        return self._images.of(poly, lambda p: image(p, self.ring, self.prime))

    def generic_rank(self, matrix: Matrix, rng: np.random.Generator) -> int:
        """Rank of a matrix at a random point: never more than the generic one, over any field."""
        return self.rank_at(matrix, self.random_point(rng))

    def random_point(self, rng: np.random.Generator) -> list[int]:
        """A value of each variable."""
        return [random_residue(rng, self.prime) for _ in range(self.ring.nvars)]

    def rank_at(self, matrix: Matrix, point: Sequence[int]) -> int:
        """Rank of a matrix at a point."""
        values = [(0 if x == 0 else int(self.of(x)(*point))) for row in matrix for x in row]
        return int(nmod_mat(len(matrix), len(matrix[0]), values, self.prime).rank())


def random_residue(rng: np.random.Generator, prime: int) -> int:
    """A residue that is not zero."""
    return int(rng.integers(1, prime))


_ATTEMPTS = 4

Slices = dict[object, "RandomSlice"]
"""Random slices that several systems of equations are met on."""


class RandomSlice:
    """Some joints free, others at values that they have, or at random ones.

    Free joints' circles are turned by random angles: no zero is at the infinity of its tangent.
    """

    def __init__(
        self,
        chosen: tuple[int, ...],
        residues: Residues,
        rng: np.random.Generator,
        values: Mapping[int, Value],
    ) -> None:
        self.residues, self.chosen, prime = residues, chosen, residues.prime
        self.context = modular_context(tuple(f"t{i}" for i in range(len(chosen))), prime)
        self._turns = [(random_residue(rng, prime), random_residue(rng, prime)) for _ in chosen]
        self.images: list[Any] = []  # all variables of the ring on the slice
        self._known = MadeOnce()
        ring = residues.ring
        for j in range(len(ring.prismatic)):
            if j in chosen:
                i = chosen.index(j)
                self.images += self.coordinates(i, self.context.gens()[i])
                continue
            drawn = (random_residue(rng, prime) for _ in ring.variables(j))
            known = (residue(x, prime) for x in values.get(j, ()))
            self.images += map(self.context.constant, known if j in values else drawn)

    def of(self, poly: Poly) -> Any:
        """A polynomial on the slice."""
        return self._known.of(
            poly, lambda p: self.residues.of(p).compose(*self.images, ctx=self.context)
        )

    def coordinates(self, i: int, t: Any) -> list[Any]:
        """Variables of the i-th free joint where its variable on the slice is t."""
        a, b = self._turns[i]
        return [t] if self.residues.ring.prismatic[self.chosen[i]] else [a - b * t, b + a * t]

    @functools.cached_property
    def circles(self) -> dict[int, Any]:
        """Forms x^2 + y^2 of the free revolute joints: zero only where no angle is meant."""
        return {
            i: sum(x * x for x in self.coordinates(i, self.context.gens()[i]))
            for i, j in enumerate(self.chosen)
            if not self.residues.ring.prismatic[j]
        }


@dataclass(frozen=True, eq=False)
class SlicePoint:
    """One common zero on a slice (and all its conjugates), a point of all joints."""

    slice: RandomSlice
    zero: Zero

    @property
    def field(self) -> Any:
        """The finite field of its coordinates."""
        return self.zero.field

    def value(self, poly: Poly) -> Any:
        """Value of a polynomial of the ring."""
        return self.zero.value(self.slice.of(poly)) if poly != 0 else self.field.zero()

    def is_zero(self, poly: Poly) -> bool:
        """Return True if a polynomial vanishes there."""
        return bool(self.value(poly).is_zero())

    def rank(self, matrix: Matrix) -> int:
        """Rank of a matrix of polynomials there."""
        return self._rank([[self.value(x) for x in row] for row in matrix])

    def transversal(self, polys: Sequence[Poly]) -> bool:
        """Return True if zero sets cross there: their gradients are independent."""
        nvars = self.slice.residues.ring.nvars
        slopes = [[self.value(p.derivative(v)) for v in range(nvars)] for p in polys]
        return self._rank(slopes) == len(polys)

    def _rank(self, rows: Sequence[Sequence[Any]]) -> int:
        """Rank of a matrix over the field; to its prime field an element is a matrix of its own."""
        size = int(self.field.degree())
        powers = [self.field.gen() ** k for k in range(size)]
        images = [x * g for row in rows for g in powers for x in row]
        flat = [int(c) for x in images for c in (x.to_list() + [0] * size)[:size]]
        shape = size * len(rows), size * len(rows[0])
        return int(nmod_mat(*shape, flat, self.slice.residues.prime).rank()) // size


def slice_points(
    polys: Sequence[Poly],
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
    check: Callable[[float], None],
    count: int | None = None,
    patient: bool = True,
    slices: Slices | None = None,
) -> Iterator[SlicePoint]:
    """Yield common zeros of polynomials on a random slice for every k joints; all of codimension k.

    That is ``count``, or the number of the polynomials. Some joints are at ``values`` already (and
    occur in no polynomial). If not ``patient`` points are found one after the other, as they are
    asked for; else it is tried again, and in other ways, where they are not told apart at once.
    ``slices`` that were used before are again where they fit. Undecided if the points of a slice
    cannot be told apart, whatever the slice.
    """
    slices = {} if slices is None else slices
    having = [set(residues.ring.joints_of(p)) for p in polys]
    for chosen in itertools.combinations(sorted(set().union(*having)), count or len(polys)):
        if not all(joints.intersection(chosen) for joints in having):
            continue  # one of them is a constant on this slice
        key = (chosen, *sorted(values.items()))
        for attempt in range(_ATTEMPTS if patient else 1):
            if attempt or key not in slices:
                slices[key] = RandomSlice(chosen, residues, rng, values)
            slice_ = slices[key]
            on_slice = [slice_.of(f) for f in polys]
            try:
                found = zeros(on_slice, range(len(chosen)), slice_.circles, rng, check, patient)
            except Undecided:
                if attempt + 1 == _ATTEMPTS:
                    raise
            else:
                yield from (SlicePoint(slice_, zero) for zero in found)
                break
