"""The regular part of a system whose common zeros are singular in part.

What is left to be searched there is smaller than the singular part, and every minor is zero on
that: so the regular part must be stated by itself before a minor can cut it. Resultants tell the
parts apart: they are projections, and each of their factors is zero on some of the parts only.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.ring import Poly, Ring

_RESULTANT_TERMS = 4_000
"""Largest product of term counts for which a symbolic resultant is tried."""

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
    telling = [f for f in _projections(relations, ring, time) if not _zero(f, singular)]
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


def _zero(f: Poly, points: Sequence[SlicePoint]) -> bool:
    return all(s.is_zero(f) for s in points)


def _projections(relations: Sequence[Poly], ring: Ring, time: Budget) -> list[Poly]:
    """Factors of the resultants of all two of the equations, by all joints that they share."""
    found: dict[str, Poly] = {}
    for p, g in itertools.combinations(relations, 2):
        if len(p) * len(g) > _RESULTANT_TERMS:
            continue
        for joint in sorted(set(ring.joints_of(p)) & set(ring.joints_of(g))):
            time.check()
            resultant = ring.strip(ring.eliminated(p, g, joint))
            if resultant != 0:
                time.check_factor(len(resultant), ring.long_to_factor(resultant))
                found |= {str(f): f for f in ring.factors(resultant)}
    return sorted(found.values(), key=len)
