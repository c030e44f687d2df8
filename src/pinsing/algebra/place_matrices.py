"""Matrices of the places that a search comes to, and their minors, made once each.

Several branches come to one place: then what its matrix is reduced to, and the minors of that, are
those that are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pinsing.algebra.budget import Budget
from pinsing.algebra.matrix import Matrix, reduce_matrix
from pinsing.algebra.minors import Minors
from pinsing.algebra.place import SearchPlace
from pinsing.algebra.ring import Ring, Value


class PlaceMatrices:
    """What was made of the matrices of one search; matrices are known by their ids, and kept."""

    def __init__(self, ring: Ring, time: Budget) -> None:
        self.ring, self.time = ring, time
        self._put_in: dict[object, tuple[Matrix, Matrix]] = {}
        self._smaller: dict[tuple[int, int], tuple[Matrix, tuple[Matrix, int]]] = {}
        self._minors: dict[tuple[int, int], Minors] = {}

    def at(self, place: SearchPlace, new: Mapping[int, Value]) -> SearchPlace:
        """The place with some more joints at values."""
        whole = place.judge
        key = id(whole.matrix), frozenset(new.items())
        if key not in self._put_in:
            put = self.ring.putting(new)
            self._put_in[key] = whole.matrix, [[put(x) for x in row] for row in whole.matrix]
        matrix = self._put_in[key][1]
        return replace(whole, values={**whole.values, **new}, matrix=matrix, reduced=False)

    def smaller(self, place: SearchPlace) -> tuple[Matrix, int]:
        """A smaller matrix whose rank drops where that of a place does, and the rank meant."""
        if place.reduced:
            return place.matrix, place.rank
        key = id(place.matrix), place.rank
        if key not in self._smaller:
            found = reduce_matrix(place.matrix, place.rank, self.ring, self.time)
            self._smaller[key] = place.matrix, found
        return self._smaller[key][1]

    def minors(self, place: SearchPlace) -> Minors:
        """The minors of a place, which keep its matrix."""
        key = id(place.matrix), place.rank
        if key not in self._minors:
            self._minors[key] = Minors(place.matrix, place.rank, self.ring, self.time)
        return self._minors[key]
