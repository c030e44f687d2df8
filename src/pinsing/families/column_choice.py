"""Columns of a chain's Jacobian modulo a prime that are independent, or tell points apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from flint import nmod_mat

from pinsing._types import Bool
from pinsing.algebra.near_minors import NearMinors, NotSquare
from pinsing.algebra.ring import Poly, Value
from pinsing.families.met_points import MetPoints
from pinsing.robot.nominal import PRIMES

Columns = Sequence[Sequence[int]]


def rank(J: Sequence[Sequence[int]], columns: Sequence[int]) -> int:
    """Rank of some columns modulo the prime."""
    flat = [row[j] for row in J for j in columns]
    return int(nmod_mat(len(J), len(columns), flat, PRIMES[0]).rank())


def neighbours(J: Sequence[Sequence[int]], start: int, count: int, n: int) -> list[int]:
    """The first ``count`` joints from ``start`` outward whose columns are independent."""
    chosen: list[int] = []
    for j in (*range(start, n), *range(start - 1, -1, -1)):
        if len(chosen) == count:
            break
        if rank(J, [*chosen, j]) > len(chosen):
            chosen.append(j)
    return chosen


def nearest(J: Sequence[Sequence[int]], j: int, among: Sequence[int], count: int) -> list[int]:
    """The ``count`` independent joints that are nearest to j."""
    chosen: list[int] = []
    for k in sorted(among, key=lambda k: (abs(k - j), k)):
        if len(chosen) == count:
            break
        if rank(J, [*chosen, k]) > len(chosen):
            chosen.append(k)
    return chosen


def cutting(
    minors: NearMinors,
    J: Columns,
    place: Mapping[int, Value],
    regular: MetPoints,
    most: int,
) -> list[Poly]:
    """Minors of near joints, few, of which each point has one that is not zero there."""
    n, width = len(J[0]), minors.rank + 1
    choices: list[tuple[tuple[int, ...], Bool]] = []
    for first in range(n - width + 1):
        window = range(first, first + width)
        for skipped in window:
            some = tuple(j for j in window if j != skipped)
            if rank(J, some) == minors.rank:
                choices.append((some, regular.full(some)))
    left = np.ones(len(regular), dtype=bool)
    chosen: list[Poly] = []
    while left.any() and choices and len(chosen) < most:
        some, cut = max(choices, key=lambda c: int((c[1] & left).sum()))
        if not (cut & left).any():
            break
        left &= ~cut
        try:
            chosen.append(minors.minor(some, place))
        except NotSquare:
            break
    return chosen
