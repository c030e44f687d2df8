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

from pinsing._dataclass import dataclass
from pinsing.algebra.generic_points import Powers, Residues, SlicePoint, random_residue
from pinsing.algebra.prime_field import modular_context, residue
from pinsing.algebra.ring import Poly, Value
from pinsing.algebra.zeros import Undecided, Zero, zeros

_ATTEMPTS = 4

Slices = dict[object, "RandomSlice"]
"""Random slices that several systems of equations are met on."""


@dataclass(frozen=True, eq=False)
class RandomSlice:
    """Some joints free, the others at random values.

    Every free joint's circle is turned by a random angle, so that no zero is at the infinity of
    its half-angle tangent.

    Attributes
    ----------
    residues : Residues
        Images of polynomials.
    chosen : tuple of int
        The free joints.
    fixed : mapping of str to int
        Variables of the others, at random values or those that they are at.
    images : list
        All variables of the ring on the slice.
    context : nmod_mpoly_ctx
        The slice's ring.
    turns : list of (int, int)
        Random angles.
    known : dict
        Polynomials on the slice, by id; they are kept, so that their ids stay their own.
    terms : dict
        See SlicePoint.
    """

    residues: Residues
    chosen: tuple[int, ...]
    fixed: Mapping[str, int]
    images: Sequence[Any]
    context: Any
    turns: Sequence[tuple[int, int]]
    known: dict[int, tuple[Poly, Any]] = field(default_factory=dict)
    terms: dict[int, tuple[Poly, list[tuple[Powers, int]]]] = field(default_factory=dict)

    def of(self, poly: Poly) -> Any:
        """A polynomial on the slice."""
        if id(poly) not in self.known:
            image = self.residues.of(poly).compose(*self.images, ctx=self.context)
            self.known[id(poly)] = (poly, image)
        return self.known[id(poly)][1]

    def coordinates(self, i: int, t: Any) -> list[Any]:
        """Variables of the i-th free joint where its variable on the slice is t."""
        a, b = self.turns[i]
        slides = self.residues.ring.prismatic[self.chosen[i]]
        return [t] if slides else [a - b * t, b + a * t]

    @cached_property
    def circles(self) -> dict[int, Any]:
        """What is zero only where no angle is meant: x^2 + y^2 of each free joint that turns."""
        return {
            i: sum(x * x for x in self.coordinates(i, self.context.gens()[i]))
            for i, j in enumerate(self.chosen)
            if not self.residues.ring.prismatic[j]
        }

    def point(self, zero: Zero) -> SlicePoint:
        """A zero on the slice as a point of all joints."""
        solved = {
            v: x
            for i, j in enumerate(self.chosen)
            for v, x in zip(
                self.residues.ring.variables(j), self.coordinates(i, zero.at[i]), strict=True
            )
        }
        return SlicePoint(self.residues, self.fixed, zero.field, solved, self.terms)


def random_slice(
    chosen: tuple[int, ...],
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
) -> RandomSlice:
    """A slice with the chosen joints free, and joints that have a value there at it."""
    ring, prime = residues.ring, residues.prime
    names = ring.context.names()
    context = modular_context(tuple(f"t{i}" for i in range(len(chosen))), prime)
    turns = [(random_residue(rng, prime), random_residue(rng, prime)) for _ in chosen]
    fixed: dict[str, int] = {}
    images: list[Any] = []
    made = RandomSlice(residues, chosen, fixed, images, context, turns)
    for j in range(len(ring.prismatic)):
        if j in chosen:
            i = chosen.index(j)
            images += made.coordinates(i, context.gens()[i])
            continue
        known = values.get(j)
        for k, v in enumerate(ring.variables(j)):
            fixed[names[v]] = residue(known[k], prime) if known else random_residue(rng, prime)
            images.append(context.constant(fixed[names[v]]))
    return made


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
        Whether to try again, and in other ways, where points are not told apart at once. If not,
        they are found one after the other, as they are asked for.
    slices : dict, optional
        Slices that were used before, and are again where they fit; new ones are added.

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
        key = (chosen, *sorted(values.items()))
        for attempt in range(_ATTEMPTS if patient else 1):
            slice_ = None if slices is None or attempt else slices.get(key)
            if slice_ is None:
                slice_ = random_slice(chosen, residues, rng, values)
                if slices is not None:
                    slices[key] = slice_
            on_slice = [slice_.of(f) for f in polys]
            try:
                found = zeros(on_slice, range(len(chosen)), slice_.circles, rng, check, patient)
            except Undecided:
                if attempt + 1 == _ATTEMPTS:
                    raise
            else:
                yield from map(slice_.point, found)
                break
