"""Points over finite fields at which polynomials are zero, and what others are there.

They come from ``slices``. A prime has 62 bits, and what is computed modulo it is exact: the points
have coordinates in finite fields, and a rank is a rank.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from flint import nmod_mat

from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import MadeOnce, Poly, Ring, Value, terms_of
from pinsing.algebra.zeros import (
    WORD_PRIME,
    Undecided,
    Zero,
    image,
    modular_context,
    rank_over,
    residue,
    zeros,
)

Powers = tuple[tuple[int, int], ...]
"""Variables and exponents of a term."""


class Residues:
    """Images of a ring's polynomials modulo a prime, made once each."""

    def __init__(self, ring: Ring, prime: int = WORD_PRIME) -> None:
        self.ring, self.prime = ring, prime
        self._images, self._terms = MadeOnce(), MadeOnce()

    def of(self, poly: Poly) -> Any:
        """The image of a polynomial."""
        return self._images.of(poly, lambda p: image(p, self.ring, self.prime))

    def terms(self, poly: Poly) -> list[tuple[Powers, int]]:
        """Its terms, which some points are put into."""
        return self._terms.of(poly, self._powers)  # type: ignore[no-any-return]

    def _powers(self, poly: Poly) -> list[tuple[Powers, int]]:
        terms = terms_of(self.of(poly)).items()
        return [(tuple([(v, int(e)) for v, e in enumerate(m) if e]), int(c)) for m, c in terms]

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
        for j in range(len(residues.ring.prismatic)):
            if j in chosen:
                i = chosen.index(j)
                self.images += self.coordinates(i, self.context.gens()[i])
                continue
            known = values.get(j)
            for k in range(len(residues.ring.variables(j))):
                x = residue(known[k], prime) if known else random_residue(rng, prime)
                self.images.append(self.context.constant(x))

    def of(self, poly: Poly) -> Any:
        """A polynomial on the slice."""
        return self._known.of(
            poly, lambda p: self.residues.of(p).compose(*self.images, ctx=self.context)
        )

    def coordinates(self, i: int, t: Any) -> list[Any]:
        """Variables of the i-th free joint where its variable on the slice is t."""
        a, b = self._turns[i]
        return [t] if self.residues.ring.prismatic[self.chosen[i]] else [a - b * t, b + a * t]

    @cached_property
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
        return rank_over([[self.value(x) for x in row] for row in matrix])

    def transversal(self, polys: Sequence[Poly]) -> bool:
        """Return True if zero sets cross there: their gradients are independent."""
        nvars = self.slice.residues.ring.nvars
        slopes = [[self.value(p.derivative(v)) for v in range(nvars)] for p in polys]
        return rank_over(slopes) == len(polys)

    def has(self, joint: int, value: Value) -> bool:
        """Return True if a joint is at a value there."""
        ring, prime = self.slice.residues.ring, self.slice.residues.prime
        wanted = [residue(c, prime) for c in value]
        x, *y = (self.zero.value(self.slice.images[v]) for v in ring.variables(joint))
        if not y:
            return bool(x == self.field(wanted[0]))
        return bool((x * wanted[1] - y[0] * wanted[0]).is_zero())


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
    ring = residues.ring
    having = [set(ring.joints_of(p)) for p in polys]
    for chosen in itertools.combinations(sorted(set().union(*having)), count or len(polys)):
        if not all(joints.intersection(chosen) for joints in having):
            continue  # one of them is a constant on this slice
        key = (chosen, *sorted(values.items()))
        for attempt in range(_ATTEMPTS if patient else 1):
            slice_ = None if slices is None or attempt else slices.get(key)
            if slice_ is None:
                slice_ = RandomSlice(chosen, residues, rng, values)
                if slices is not None:
                    slices[key] = slice_
            on_slice = [slice_.of(f) for f in polys]
            try:
                found = zeros(on_slice, range(len(chosen)), slice_.circles, rng, check, patient)
            except Undecided:
                if attempt + 1 == _ATTEMPTS:
                    raise
            else:
                yield from (SlicePoint(slice_, zero) for zero in found)
                break
