"""Generic points of the common zeros of several polynomials, on random slices.

To know whether some component of V(p, g) is singular it is enough to look at generic points
of it: all joints but two are put at random values, the two that remain are solved for, and
the rank of the Jacobian is taken there. A component of codimension two meets such a slice for
some pair of joints, so that all pairs together meet every component; and so with three
polynomials and three joints, and so on.

All of this is done modulo a prime of 62 bits, where it is exact: the points have coordinates
in finite fields, and a rank is a rank. A verdict is wrong only if a random value happens to
be a root of one of the polynomials involved, which for degrees in the thousands has a chance
of about 1e-15 (Schwartz, 1980; Zippel, 1979), or if the prime divides one of the numbers that
must not vanish: so a search asks again modulo another prime, at other random points.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np
from flint import nmod_mat

from pinsing._dataclass import dataclass
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.prime_field import (
    WORD_PRIME,
    image,
    modular_context,
    rank_over,
    residue,
    residues_of,
)
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.zeros import Undecided, zeros

_ATTEMPTS = 4

Powers = tuple[tuple[int, int], ...]
"""Variables and exponents of a term."""


class Residues:
    """Images of a ring's polynomials modulo a prime, made once each."""

    def __init__(self, ring: Ring, prime: int = WORD_PRIME) -> None:
        self.ring, self.prime = ring, prime
        self._images: dict[int, tuple[Poly, Any]] = {}
        self._terms: dict[int, tuple[Poly, list[tuple[Powers, int]]]] = {}

    def of(self, poly: Poly) -> Any:
        """The image of a polynomial."""
        if id(poly) not in self._images:  # the polynomial is kept, so that its id stays its own
            self._images[id(poly)] = (poly, image(poly, self.ring, self.prime))
        return self._images[id(poly)][1]

    def terms(self, poly: Poly) -> list[tuple[Powers, int]]:
        """Its terms, without making a polynomial of them."""
        if id(poly) not in self._terms:  # as above
            listed = [
                (tuple([(v, e) for v, e in enumerate(m) if e]), c)
                for m, c in residues_of(poly, self.ring, self.prime).items()
                if c
            ]
            self._terms[id(poly)] = (poly, listed)
        return self._terms[id(poly)][1]

    def generic_rank(self, matrix: Matrix, rng: np.random.Generator) -> int:
        """Rank of a matrix at a random point: never more than the generic one, over any field."""
        return self.rank_at(matrix, self.random_point(rng))

    def random_point(self, rng: np.random.Generator) -> list[int]:
        """A value of each variable."""
        return [_random(rng, self.prime) for _ in range(self.ring.nvars)]

    def rank_at(self, matrix: Matrix, point: Sequence[int]) -> int:
        """Rank of a matrix at a point."""
        values = [self._value(x, point) for row in matrix for x in row]
        return int(nmod_mat(len(matrix), len(matrix[0]), values, self.prime).rank())

    def _value(self, poly: Poly, point: Sequence[int]) -> int:
        return 0 if poly == 0 else int(self.of(poly)(*point))


@dataclass(frozen=True, eq=False)
class SlicePoint:
    """One common zero on a slice (and all its conjugates).

    Attributes
    ----------
    residues : Residues
        Images of polynomials.
    fixed : mapping of str to int
        Variables at random values.
    field : fq_default_ctx
        The finite field of the coordinates.
    free : mapping of int to fq_default
        The variables that were solved for, by index.
    on_slice : dict
        Polynomials with those values in them: by id, with their terms. Shared by its points.
    monomials : dict
        Those that were asked for, with their values: the entries of a matrix share most of them.
    """

    residues: Residues
    fixed: Mapping[str, int]
    field: Any
    free: Mapping[int, Any]
    on_slice: dict[int, tuple[Poly, list[tuple[Powers, int]]]] = field(default_factory=dict)
    monomials: dict[Any, Any] = field(default_factory=dict)

    def value(self, poly: Poly) -> Any:
        """Value of a polynomial of the ring."""
        total = self.field.zero()
        if poly == 0:
            return total
        for monomial, c in self._terms(poly):
            total = total + self._monomial(monomial) * c
        return total

    def _monomial(self, monomial: Powers) -> Any:
        """Value of a product of powers (variable, exponent)."""
        if monomial not in self.monomials:
            if len(monomial) < 2:
                powers = [self.free[v] ** e for v, e in monomial]
                self.monomials[monomial] = powers[0] if powers else self.field.one()
            else:
                before = self._monomial(monomial[:-1])
                self.monomials[monomial] = before * self._monomial(monomial[-1:])
        return self.monomials[monomial]

    def _terms(self, poly: Poly) -> list[tuple[Powers, int]]:
        """Powers (variable, exponent) and coefficient of each term in the free variables."""
        if id(poly) not in self.on_slice:  # the polynomial is kept, so that its id stays its own
            prime, known = self.residues.prime, self._known
            gathered: dict[Powers, int] = {}
            for powers, c in self.residues.terms(poly):
                left = []
                for v, e in powers:
                    if v in self.free:
                        left.append((v, e))
                    else:
                        c = c * known[v] ** e % prime
                key = tuple(left)
                gathered[key] = gathered.get(key, 0) + c
            listed = [(key, c % prime) for key, c in gathered.items()]
            self.on_slice[id(poly)] = (poly, listed)
        return self.on_slice[id(poly)][1]

    @cached_property
    def _known(self) -> dict[int, int]:
        """The variables at random values, by index."""
        names = self.residues.ring.context.names()
        return {v: self.fixed[name] for v, name in enumerate(names) if name in self.fixed}

    def is_zero(self, poly: Poly) -> bool:
        """Whether a polynomial vanishes there."""
        return bool(self.value(poly).is_zero())

    def rank(self, matrix: Matrix) -> int:
        """Rank of a matrix of polynomials there."""
        return rank_over([[self.value(x) for x in row] for row in matrix])

    def transversal(self, polys: Sequence[Poly]) -> bool:
        """Whether zero sets cross there, rather than touch: their gradients are independent."""
        nvars = self.residues.ring.nvars
        slopes = [[self.value(p.derivative(v)) for v in range(nvars)] for p in polys]
        return rank_over(slopes) == len(polys)

    def has(self, joint: int, value: Value) -> bool:
        """Whether a joint is at a value there."""
        x, *y = (self._at(v) for v in self.residues.ring.variables(joint))
        wanted = [self.field(residue(c, self.residues.prime)) for c in value]
        if not y:
            return bool(x == wanted[0])
        return bool((x * wanted[1] - y[0] * wanted[0]).is_zero())

    def _at(self, variable: int) -> Any:
        if variable in self.free:
            return self.free[variable]
        return self.field(self.fixed[self.residues.ring.context.names()[variable]])


def slice_points(
    polys: Sequence[Poly],
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
    check: Callable[[float], None],
    count: int | None = None,
    patient: bool = True,
) -> Iterator[SlicePoint]:
    """Common zeros of polynomials on a random slice for every k joints.

    Parameters
    ----------
    polys : sequence of Poly
        Polynomials whose common zeros all have codimension k, or more where there are more
        polynomials than k.
    residues : Residues
        Their images.
    rng : Generator
        For the slices.
    values : mapping of joint to Value
        Joints that are at fixed values already (and occur in no polynomial).
    check : callable
        Asked before each long step; ends the search by an exception.
    count : int, optional
        k, if it is not the number of the polynomials.
    patient : bool
        Whether to try again, and in other ways, where points are not told apart at once.

    Raises
    ------
    Undecided
        If the points of a slice cannot be told apart, whatever the slice.
    """
    ring = residues.ring
    having = [set(ring.joints_of(p)) for p in polys]
    for chosen in itertools.combinations(sorted(set().union(*having)), count or len(polys)):
        if not all(joints.intersection(chosen) for joints in having):
            continue  # one of them is a constant on this slice
        attempts = _ATTEMPTS if patient else 1
        for attempt in range(attempts):
            try:
                points = _points_on(polys, chosen, residues, rng, values, check, patient)
            except Undecided:
                if attempt + 1 == attempts:
                    raise
            else:
                yield from points
                break


def _points_on(
    polys: Sequence[Poly],
    chosen: Sequence[int],
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
    check: Callable[[float], None],
    patient: bool,
) -> list[SlicePoint]:
    """Common zeros in the chosen joints, the others at random values.

    Every chosen joint's circle is turned by a random angle, so that no zero is at the infinity
    of its half-angle tangent.
    """
    ring = residues.ring
    names = ring.context.names()
    prime = residues.prime
    free = modular_context(tuple(f"t{i}" for i in range(len(chosen))), prime)
    turns = [(_random(rng, prime), _random(rng, prime)) for _ in chosen]

    def coordinates(i: int, t: Any) -> list[Any]:
        a, b = turns[i]
        return [t] if ring.prismatic[chosen[i]] else [a - b * t, b + a * t]

    fixed: dict[str, int] = {}
    images: list[Any] = []
    for j in range(len(ring.prismatic)):
        if j in chosen:
            i = chosen.index(j)
            images += coordinates(i, free.gens()[i])
            continue
        known = values.get(j)
        for k, v in enumerate(ring.variables(j)):
            fixed[names[v]] = residue(known[k], prime) if known else _random(rng, prime)
            images.append(free.constant(fixed[names[v]]))
    on_slice = [residues.of(f).compose(*images, ctx=free) for f in polys]
    circles = {  # where x^2 + y^2 = 0 no angle is meant
        i: sum(x * x for x in coordinates(i, free.gens()[i]))
        for i, j in enumerate(chosen)
        if not ring.prismatic[j]
    }
    points = []
    terms: dict[int, tuple[Poly, list[tuple[Any, int]]]] = {}
    for zero in zeros(on_slice, range(len(chosen)), circles, rng, check, patient):
        solved = {
            v: x
            for i, j in enumerate(chosen)
            for v, x in zip(ring.variables(j), coordinates(i, zero.at[i]), strict=True)
        }
        points.append(SlicePoint(residues, fixed, zero.field, solved, terms))
    return points


def _random(rng: np.random.Generator, prime: int) -> int:
    return int(rng.integers(1, prime))
