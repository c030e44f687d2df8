"""Boundary or interior, piece by piece of a family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pinsing._types import Array
from pinsing.configuration.second_order import kinds_many
from pinsing.families.family import Family
from pinsing.families.parts import Branch, KindPart
from pinsing.families.statement import statement
from pinsing.families.zero_set import residuals
from pinsing.robot.arm import Arm

if TYPE_CHECKING:
    from pinsing.families.pieces import PieceMaker

_FIRST = 6
"""Points that are looked into of those where that takes longer, if all kinds agree then."""
_SHORT = 60
"""Characters that a condition may have to be named as the place of a kind."""


def kinds_of(family: Family, points: Array, arm: Arm, maker: PieceMaker) -> tuple[KindPart, ...]:
    """What kind of singularity the points (N, n) of a family are, and where which.

    One part if all that could be decided agree. Where whole branches are of one kind each, such
    as q3 = 0 and q3 = 180 degrees, the parts are named by these; else they are shares of the
    points.
    """
    kinds = kinds_many(arm, points, _FIRST)
    rest = [i for i, kind in enumerate(kinds) if kind is None]
    if rest and (len(set(kinds)) > 2 or len(family.branches) > 2):  # each branch, or shares: all
        for i, kind in zip(rest, kinds_many(arm, points[rest]), strict=True):
            kinds[i] = kind
    points = points[[kind is not None for kind in kinds]]
    found = [kind for kind in kinds if kind is not None]
    counts = Counter(found)
    total = len(found)
    if len(counts) == 1:
        return (KindPart(found[0], "", 1.0, total),)
    owner = _owners(family, points)
    by_branch = {
        b: Counter(k for k, o in zip(found, owner, strict=True) if o == b)
        for b in dict.fromkeys(owner)
    }
    if len(by_branch) == len(family.branches) and all(len(c) == 1 for c in by_branch.values()):
        places = {
            kind: _place([family.branches[b] for b, c in by_branch.items() if kind in c], maker)
            for kind in counts
        }
        longest = max(places, key=lambda k: len(places[k]))
        if len(places[longest]) > _SHORT:
            places[longest] = ""  # named by what the others are not
        if all(len(place) <= _SHORT for place in places.values()):
            return tuple(
                KindPart(k, places[k] or "all other points", counts[k] / total, total)
                for k in sorted(places, key=lambda k: places[k] == "")
            )
    return tuple(KindPart(k, "", n / total, total) for k, n in counts.most_common())


def _place(branches: Sequence[Branch], maker: PieceMaker) -> str:
    """The condition of some branches: where the values of all differ, these."""
    return statement(branches, (), maker.symbols, [bool(p) for p in maker.ring.prismatic])


def _owners(family: Family, points: Array) -> list[int]:
    """The branch that each point lies on."""
    off = np.empty((len(family.branches), len(points)))
    for i, branch in enumerate(family.branches):
        off[i] = np.linalg.norm(branch.off(points, family.space), axis=-1)
        if branch.equations:
            off[i] += np.abs(residuals(branch.equations, points)).max(axis=-1)
    return [int(i) for i in off.argmin(axis=0)]
