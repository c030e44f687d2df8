"""Where a search is, and how many equations more there can be."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import FoundComponents
from pinsing.algebra.generic_points import Residues, SlicePoint, Slices, slice_points
from pinsing.algebra.matrix import Matrix, reduce_matrix
from pinsing.algebra.minors import Minors
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.zeros import Undecided


@dataclass(frozen=True, eq=False)
class SearchPlace:
    """Where the search is: some joints at values.

    Attributes
    ----------
    values : mapping of joint to Value
        These joints.
    matrix : Matrix
        What the matrix becomes there.
    rank : int
        Singular means: rank below this.
    limit : int
        Largest codimension of what is looked for; the joints at values count.
    reduced : bool
        Whether all pivots of the matrix are used up, and its rows are independent.
    whole : SearchPlace or None
        The place with the matrix that says what is singular, where ``matrix`` is a part of it.
    """

    values: Mapping[int, Value]
    matrix: Matrix
    rank: int
    limit: int
    reduced: bool = False
    whole: SearchPlace | None = None

    @property
    def judge(self) -> SearchPlace:
        """The place that says what is singular."""
        return self.whole or self

    def singular(self, point: SlicePoint) -> bool:
        """Whether a point is singular."""
        return point.rank(self.judge.matrix) < self.judge.rank

    def beside(self, matrix: Matrix, rank: int) -> SearchPlace:
        """The same place, looked at by a part of the matrix."""
        return replace(self, matrix=matrix, rank=rank, reduced=False, whole=self.judge)

    def zeroed(self, relations: Sequence[Poly], ring: Ring) -> SearchPlace:
        """The same place with entries that are multiples of some equations at zero.

        They are, where these hold; minors fall into factors so.
        """
        matrix = [
            [
                ring.zero
                if x != 0 and any(len(r) <= len(x) and ring.divides(r, x) for r in relations)
                else x
                for x in row
            ]
            for row in self.matrix
        ]
        return self if matrix == self.matrix else self.beside(matrix, self.rank)

    @property
    def room(self) -> int:
        """How many equations more there may be."""
        return max(0, self.limit - len(self.values))


def bound(matrix: Matrix, rank: int) -> int:
    """Largest codimension of a component of where a matrix is below a rank (Eagon, Northcott)."""
    return (len(matrix) - rank + 1) * (len(matrix[0]) - rank + 1)


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


Part = tuple[tuple[Poly, ...], list[SlicePoint]]


def regular_parts(
    relations: Sequence[Poly],
    singular: Sequence[SlicePoint],
    regular: Sequence[SlicePoint],
    ring: Ring,
    time: Budget,
) -> list[Part]:
    """State the regular part of a system by equations that are nowhere zero on the singular one.

    Parameters
    ----------
    relations : sequence of Poly
        The system.
    singular, regular : sequences of SlicePoint
        Generic points of all its parts.
    ring : Ring
        Its ring.
    time : Budget
        Asked before long steps.

    Returns
    -------
    list of (relations, points)
        What contains the regular part, with its generic points: the system and more equations,
        or one value of a joint alone, within which the search goes on; none if they were not
        told apart.
    """
    telling = [
        f for f in _projections(relations, ring, time) if not all(s.is_zero(f) for s in singular)
    ]
    groups: dict[frozenset[int], list[SlicePoint]] = {}
    for s in regular:
        on = frozenset(i for i, f in enumerate(telling) if s.is_zero(f))
        groups.setdefault(on, []).append(s)
    parts: list[Part] = []
    for on, points in groups.items():
        chosen: list[Poly] = []
        values = [i for i in on if ring.joint_value(telling[i])]
        if values:
            parts.append(((telling[values[0]],), points))
            continue
        left = list(singular)
        while left:
            away = {i: sum(not s.is_zero(telling[i]) for s in left) for i in on}
            best = max(on, key=lambda i: (away[i], -len(telling[i])), default=None)
            if best is None or not away[best]:
                return []
            chosen.append(telling[best])
            left = [s for s in left if s.is_zero(telling[best])]
        parts.append(((*relations, *chosen), points))
    return parts


def _projections(relations: Sequence[Poly], ring: Ring, time: Budget) -> list[Poly]:
    """Factors of the resultants of all two of the equations, by all joints that they share."""
    found: dict[str, Poly] = {}
    for p, g in itertools.combinations(relations, 2):
        # Largest product of term counts for which a symbolic resultant is tried.
        if len(p) * len(g) > 4_000:
            continue
        for joint in sorted(set(ring.joints_of(p)) & set(ring.joints_of(g))):
            time.check()
            resultant = ring.strip(ring.eliminated(p, g, joint))
            if resultant != 0:
                time.check_factor(len(resultant), ring.long_to_factor(resultant))
                found |= {str(f): f for f in ring.factors(resultant)}
    return sorted(found.values(), key=len)


Relations = tuple[Poly, ...]


@dataclass(frozen=True, eq=False)
class Stating:
    """What all statements of a search share.

    Attributes
    ----------
    ring, time, found : Ring, Budget, FoundComponents
        Of the search.
    residues, rng : Residues, Generator
        For its random points.
    """

    ring: Ring
    time: Budget
    found: FoundComponents
    residues: Residues
    rng: np.random.Generator

    def shortened(self, relations: Relations, count: int, place: SearchPlace) -> Relations:
        """As few equations as the codimension, if some say the same.

        Common zeros of so many equations have no parts of lower dimension: where generic points
        of all parts are singular, and new, all is.
        """
        slices: Slices = {}
        # Equations of a long system among which fewer that say the same are looked for.
        for few in itertools.combinations(relations[:5], count):
            if self._states(few, place, slices):
                return few
        return relations

    def _states(self, relations: Relations, place: SearchPlace, slices: Slices) -> bool:
        """Whether all common zeros are singular, and none is on a component that is known."""
        found = False
        check = self.time.check
        points = slice_points(
            relations, self.residues, self.rng, place.values, check, patient=False, slices=slices
        )
        try:
            for s in points:
                self.time.check()
                if not place.singular(s) or self.found.holds(s):
                    return False
                found = True
        except Undecided:
            return False
        return found

    def statement(
        self,
        relations: Relations,
        singular: list[SlicePoint],
        others: list[SlicePoint],
        minors: Minors,
    ) -> tuple[Poly, ...]:
        """Equations of the singular part of the common zeros of some equations.

        One factor of every minor, that all of the singular part shares, and of the rest as
        little as can be: where these vanish all minors do, so that not even a part of lower
        dimension is stated that is regular.
        """
        stated = list(relations)
        for minor in minors:
            self.time.check()
            if any(self.ring.divides(r, minor) for r in stated):
                continue
            whole = [f for f in minors.factors(minor) if all(s.is_zero(f) for s in singular)]
            if len(whole) > 1:
                whole.sort(key=lambda f: (sum(s.is_zero(f) for s in others), len(f)))
            stated.append(whole[0] if whole else minor)
        return tuple(sorted(stated, key=len))
