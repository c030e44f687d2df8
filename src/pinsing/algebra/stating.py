"""Equations of what is singular of some equations' common zeros, as few as can be."""

from __future__ import annotations

import itertools

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import FoundComponents
from pinsing.algebra.generic_points import Residues, SlicePoint
from pinsing.algebra.minors import Minors
from pinsing.algebra.place import SearchPlace
from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.slices import Slices, slice_points
from pinsing.algebra.zeros import Undecided

_SHORTEST = 5
"""Equations of a long system among which fewer that say the same are looked for."""

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
        for few in itertools.combinations(relations[:_SHORTEST], count):
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
