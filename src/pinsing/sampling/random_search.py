"""Singular configurations met from random starts: whether each is on a family."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.configuration.rank_drop import approach
from pinsing.configuration.refine import walk
from pinsing.families import ClosedForm
from pinsing.kinematics.verdict import SINGULAR_RTOL
from pinsing.robot.arm import Arm
from pinsing.sampling.analysis_result import RandomSearch
from pinsing.sampling.stages import Stages

ON_FAMILY_TOL = 1e-5
"""Distance in joint space (radians; metres over the length scale) that counts as on a family."""

_VALLEY = 1e-2
"""How far from a zero of sigma_r it may be below the tolerance."""
_DOWN = 0.7
"""Share of the way from a family that is left when a point is put back towards it."""
_STAYED = 0.85
"""Share above which it has come back to where it was."""
_STEPS = 30
_NOISE = 1e-13
"""sigma_r / sigma_1 of what is singular, with rounding."""
_SECONDS = 0.2
"""For one distance to one family."""
_BATCH = 100


def random_search(
    exact: Arm, forms: ClosedForm, starts: int, seed: int, stages: Stages
) -> RandomSearch:
    """Walk from random configurations to singular ones, and look for each on the families.

    Parameters
    ----------
    exact : Arm
        The arm on its nominal geometry.
    forms : ClosedForm
        Its families.
    starts, seed : int
        How many configurations, and what they are drawn from.
    stages : Stages
        Says when time is over.
    """
    if starts == 0:
        return RandomSearch(0, 0, 0, ())
    rng = np.random.default_rng(seed)
    begin = exact.space.sample(starts, rng)
    reached = []
    for k in range(0, starts, _BATCH):
        if k and stages.over:
            starts = k
            break
        ends = walk(exact, begin[k : k + _BATCH])
        reached.append(ends.q[ends.ratio <= SINGULAR_RTOL])
    found = np.concatenate(reached)
    on = np.zeros(len(found), dtype=bool)
    for family in forms.families:
        if on.all():
            break
        on[~on] = family.contains(found[~on], ON_FAMILY_TOL)
    off = found[~on]
    if len(off):
        # In a flat valley sigma_r is below the tolerance some way off already: the nearest true
        # zero decides.
        ends = approach(exact, off)
        close = ends.singular & (np.abs(ends.q - off).max(axis=1) <= _VALLEY)
        close &= np.array([forms.family_of(q, ON_FAMILY_TOL) is not None for q in ends.q])
        off = off[~close]
        off = np.array([q for q in off if stages.over or not leads_down(exact, forms, q)])
    return RandomSearch(starts, len(found), len(found) - len(off), tuple(off))


def leads_down(exact: Arm, forms: ClosedForm, q: Array) -> bool:
    """Whether q (n,) is in a valley of sigma_r that ends on a family nearby.

    Where sigma_r falls like a higher power of the distance, walks end far off the zero: rounding
    hides it. So the point is put back towards the family, and polished from there, again and
    again. In a valley it stays where it was put; a zero of its own draws it back, unless that is
    part of a set which meets the family here. So it is put away from the family first: there a
    valley is no zero.
    """
    where = _beside(forms, q)
    if where is not None and ON_FAMILY_TOL < where[0] <= _VALLEY:
        away = where[1] + _VALLEY / where[0] * exact.space.wrap(q - where[1])
        ends = approach(exact, away)
        there = _beside(forms, ends.q[0])
        if ends.ratio[0] <= _NOISE and there is not None and there[0] > _VALLEY / 2:
            return False
    for _ in range(_STEPS):
        if where is None or where[0] > _VALLEY:
            return False
        distance, nearest = where
        if distance <= ON_FAMILY_TOL:
            return True
        between = nearest + _DOWN * exact.space.wrap(q - nearest)
        ends = approach(exact, between)
        q, where = ends.q[0], _beside(forms, ends.q[0])
        if not ends.singular[0] or where is None or where[0] > _STAYED * distance:
            return False
    return False


def _beside(forms: ClosedForm, q: Array) -> tuple[float, Array] | None:
    """The nearest family's distance, and its point (n,), if one is near."""
    near = [f for f in forms.families if f.contains(q, 2 * _VALLEY)]
    found = [f.distance(q, seconds=_SECONDS) for f in near]
    best = min(found, key=lambda d: d.upper, default=None)
    return None if best is None else (best.upper, best.q)
