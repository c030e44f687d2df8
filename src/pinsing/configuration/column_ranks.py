"""Ranks of sets of columns of one task Jacobian, here and at random configurations.

All sets of an arm's few joints at once: the other columns are put to zero, which adds singular
values of zero and changes no other.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from math import comb

import numpy as np
import numpy.typing as npt

from pinsing._batch import engine as kernel
from pinsing._types import Array
from pinsing.kinematics.own_scale import own_scale
from pinsing.kinematics.verdict import SINGULAR_RTOL, generic_rank, zero_of
from pinsing.robot.arm import Arm

Ints = npt.NDArray[np.intp]

_MANY = 60_000  # sets of joints; beyond, the whole arm is named without a search
_AT_ONCE = 8
"""Joints up to which the ranks of all sets are found at once."""


class ColumnRanks:
    """Ranks of sets of columns of one task Jacobian, here and in general.

    Parameters
    ----------
    arm : Arm
        Any arm.
    J : (6, n) array
        Its frame Jacobian at the configuration.
    q : (n,) array
        The configuration, radians and metres.
    rtol : float
        Singular values at or below ``rtol`` times the largest of the task Jacobian are zero.
    generic : (k, m, n) array
        Task Jacobians at random configurations, without units.
    used : tuple of int
        Joints that move the task at some configuration, ascending.
    """

    def __init__(
        self, arm: Arm, J: Array, q: Array, rtol: float, generic: Array, used: tuple[int, ...]
    ) -> None:
        self.J = own_scale(arm).apply(arm, J, q)
        self.generic, self.used = generic, used
        self._bit = {j: 1 << i for i, j in enumerate(used)}
        self._few = len(used) <= _AT_ONCE
        sets = of_all_sets(self.J[None, :, list(used)])[0] if self._few else None
        if sets is not None and len(used) == self.J.shape[1]:
            sigma = sets[-1]
        else:
            sigma = singular_values(self.J[None])[0]
        self.zero = zero_of(arm, sigma, rtol)
        if sets is not None:
            self._table = _counts(sets > self.zero)
            self._generic = arm.once(
                "generic_column_ranks", lambda: _generic_table(generic[:, :, list(used)])
            )
        self._rank: dict[tuple[int, ...], int] = {(): 0}
        r = generic_rank(arm)
        self.spare = len(self.used) - r
        self.lost = r - self.rank(self.used)

    def rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at the configuration."""
        if self._few:
            return int(self._table[self._mask(ids)])
        key = tuple(ids)
        if key not in self._rank:
            self._rank[key] = int(self._ranks(np.array([ids]))[0])
        return self._rank[key]

    def nullity(self, ids: Sequence[int]) -> int:
        """How many of the columns ``ids`` the others of these make up for."""
        return len(ids) - self.rank(ids)

    def generic_rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at almost every configuration."""
        if self._few:
            return int(self._generic[self._mask(ids)])
        sigma = np.linalg.svd(self.generic[:, :, list(ids)], compute_uv=False)
        return int((sigma > SINGULAR_RTOL * sigma.max()).sum(axis=-1).max())

    def deficient(self, ids: Sequence[int]) -> bool:
        """Whether the columns ``ids`` have a smaller rank here than in general."""
        return self.rank(ids) < self.generic_rank(ids)

    def causes(self) -> list[tuple[int, ...]]:
        """Sets that force the loss, one for each rank lost."""
        found: list[tuple[int, ...]] = []
        for ids in self._by_size(self.used, self.spare + 1):
            union = sorted(set(chain(ids, *found)))
            if self.nullity(union) - self.spare > len(found):
                found.append(ids)
            if len(found) == self.lost:
                break
        return found

    def pieces(self, ids: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Smallest sets within ``ids`` that are dependent beyond what is general.

        As many as are needed for the nullity that forces the loss.
        """
        if self.spare == 0:
            return [ids]
        found: list[tuple[int, ...]] = []
        union: list[int] = []
        for part in self._by_size(ids, 1):
            wider = sorted({*union, *part})
            if self.nullity(wider) > self.nullity(union) and self.deficient(part):
                found.append(part)
                union = wider
            if self.nullity(union) > self.spare:
                break
        return found

    def _mask(self, ids: Sequence[int]) -> int:
        return sum(self._bit[i] for i in ids)

    def _ranks(self, sets: Ints) -> Ints:
        """Ranks at the configuration of sets (N, k) of columns."""
        stack = self.J[:, sets].transpose(1, 0, 2)  # (N, m, k)
        return np.asarray((singular_values(stack) > self.zero).sum(axis=-1))

    def _by_size(self, ids: Sequence[int], nullity: int) -> Iterator[tuple[int, ...]]:
        """Sets within ``ids``, smallest first, of at least this nullity."""
        if self._few:
            masks, sizes = _by_number(len(self.used))
            outside = ~self._mask(ids)
            enough = ((masks & outside) == 0) & (sizes - self._table[masks] >= nullity)
            for mask in masks[enough].tolist():
                yield tuple(j for j in self.used if self._bit[j] & mask)
            return
        for size in range(1, len(ids) + 1):
            if comb(len(ids), size) > _MANY:
                break
            sets = np.array(ids)[_combinations(len(ids), size)]
            for k in np.flatnonzero(size - self._ranks(sets) >= nullity):
                yield tuple(int(i) for i in sets[k])
        else:
            return
        yield tuple(ids)


def singular_values(stack: Array) -> Array:
    """Singular values (N, k) of small matrices (N, m, n), in the compiled kernel if it is there."""
    if kernel.available() and min(stack.shape[1:]) > 0:
        return kernel.svdvals(stack, threads=1)
    return np.asarray(np.linalg.svd(stack, compute_uv=False), dtype=np.float64)


def of_all_sets(J: Array) -> Array:
    """Singular values (N, 2^n, k) of all sets of columns of J (N, m, n), by their binary number."""
    n = J.shape[-1]
    kept = _membership(n)  # (2^n, n)
    stack = (J[:, None] * kept[:, None, :]).reshape(-1, *J.shape[1:])
    return singular_values(stack).reshape(len(J), len(kept), -1)


def _counts(above: npt.NDArray[np.bool_]) -> Ints:
    return np.asarray(above.sum(axis=-1))


def _generic_table(J: Array) -> Ints:
    sigma = of_all_sets(J)
    top = sigma.max(axis=(0, 2))  # of each set
    return np.asarray(_counts(sigma > SINGULAR_RTOL * top[:, None]).max(axis=0))


@functools.cache
def _membership(n: int) -> Array:
    """Which of n columns (2^n, n) are in the set of each binary number, as 0 and 1."""
    numbers = np.arange(2**n)
    return ((numbers[:, None] >> np.arange(n)) & 1).astype(float)


@functools.cache
def _by_number(n: int) -> tuple[Ints, Ints]:
    """Binary numbers of all sets of n but the empty one, smallest sets first, and their sizes."""
    sets = [ids for size in range(1, n + 1) for ids in combinations(range(n), size)]
    masks = [sum(1 << i for i in ids) for ids in sets]
    return np.array(masks, dtype=np.intp), np.array([len(ids) for ids in sets], dtype=np.intp)


@functools.cache
def _combinations(n: int, size: int) -> Ints:
    """Sets (N, size) of that many out of n, as indices."""
    return np.array(list(combinations(range(n), size)), dtype=np.intp)
