"""Which components lie in others, told by generic points of them.

A search by all minors that is stopped leaves small pieces, of which a system that slices lead to
later holds several. These are no components of their own, and a count of how many of the components
were met on slices is not to ask for them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, on_any
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.ring import Ring
from pinsing.algebra.slices import slice_points
from pinsing.algebra.zeros import Undecided

_SEED = 43
_SHORT = 200
"""Terms of a component's relations up to which its points are looked for: others are no pieces."""


def without_inner(
    components: Sequence[Component], doubtful: Sequence[Component], ring: Ring, time: Budget
) -> list[Component]:
    """Components without those of ``doubtful`` whose points all lie on the others that are left.

    Points are those of random slices modulo a prime of 62 bits, of each choice of joints; what
    cannot be told in time stays.
    """
    left = list(components)
    residues, rng = Residues(ring), np.random.default_rng(_SEED)
    for c in sorted(doubtful, key=lambda c: -c.codimension):
        if not c.relations or sum(map(len, c.relations)) > _SHORT:
            continue
        others = [k for k in left if k is not c]
        count = c.codimension - len(c.values)
        try:
            found = slice_points(c.relations, residues, rng, c.values, time.check, count)
            points = [on_any(others, s) for s in found]
        except (BudgetExceeded, Undecided):
            continue
        if points and all(points):
            left = others
    return left
