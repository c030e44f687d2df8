"""The curves of a sweep by their numbers, and their minima: nothing here is as long as the sweep.

First each joint from the nominal configuration, then level by level, set by set, each joint
that moves in turn. The Jacobian of sample s of curve c has the number c * samples + s.

Every dip of sigma_r is a candidate for a singular configuration. Up to ``most`` candidates all
are kept. Beyond, they are shared out: candidates are of one kind if the same joints are at
special values, the same joint moves, and it stands in the same 64th of its range; of each kind
the smallest sigma_r / sigma_1 come first, and all kinds get as many places as far as they go.
So no family with many dips crowds out another. Kept is what has the smallest (place within its
kind, ratio, number): the outcome is the same to the last bit however the candidates are
grouped, since a candidate that stays out of a part stays out of the whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinsing._types import Array, ArrayLike, Bool, Ints, NDArray
from pinsing.chunk_file import DamagedError, Record
from pinsing.kinematics.verdict import SINGULAR_RTOL
from pinsing.measures import ROUNDING
from pinsing.sampling.sweep_plan import NOT_ASKED, PlannedLevel, SweepPlan
from pinsing.sampling.tally import finite, whole


@dataclass(frozen=True, eq=False)
class CurveRows:
    """Some curves."""

    numbers: Ints  # (C,) of int: which ones
    base: Array  # (C, n): the configuration that all of a curve has but for the joint that moves
    fixed: Bool  # (C, n) of bool: joints at special values
    moving: Ints  # (C,) of int: index of the joint that moves
    # (C,) of bool: the special values are a minimal set that is singular whatever the others
    forced: Bool
    singular: Bool  # (C,) of bool: they contain such a set: the curve is singular all along


class CurveTable:
    """All curves of a plan; ``ranges`` (n, 2) are ends of the range of each joint."""

    def __init__(self, plan: SweepPlan) -> None:
        self.plan = plan
        self._alone = np.array(
            [i for i, e in enumerate(plan.effects) if e.reason != NOT_ASKED], dtype=np.int64
        )
        self._swept = np.array(plan.swept, dtype=np.int64)
        # Curves of one level: number of the first, how many for every set, and the level.
        self._blocks: list[tuple[int, int, PlannedLevel]] = []
        first = len(self._alone)
        for level in plan.levels:
            if level.swept:
                each = len(self._swept) - level.level
                self._blocks.append((first, each, level))
                first += each * len(level.values)
        self._length = first
        self.ranges = np.array([effect.range for effect in plan.effects], dtype=float)

    def __len__(self) -> int:
        return self._length

    def rows(self, numbers: ArrayLike) -> CurveRows:
        """Look up the curves ``numbers`` (C,)."""
        found = np.asarray(numbers, dtype=np.int64)
        count, n = len(found), len(self.plan.nominal)
        base = np.tile(self.plan.nominal, (count, 1))
        fixed, forced = np.zeros((count, n), dtype=bool), np.zeros(count, dtype=bool)
        moving = np.zeros(count, dtype=np.int64)
        alone = found < len(self._alone)
        moving[alone] = self._alone[found[alone]]
        for first, each, level in self._blocks:
            here = np.flatnonzero((found >= first) & (found < first + each * len(level.values)))
            if not len(here):
                continue
            place, turn = np.divmod(found[here] - first, each)
            rows, joints = here[:, None], level.joints[place]
            base[rows, joints] = level.values[place]
            fixed[rows, joints] = True
            forced[here] = level.forced[place]
            free = ~fixed[rows, self._swept[None]]  # the same number in each row
            others = np.nonzero(free)[1].reshape(len(here), each)
            moving[here] = self._swept[others[np.arange(len(here)), turn]]
        # A pruned plan has no set that contains a forced one, but those themselves.
        singular = forced if self.plan.prune else self._singular(base, fixed)
        return CurveRows(found, base, fixed, moving, forced, singular)

    def fixed_values(self, rows: CurveRows, k: int) -> Mapping[str, float]:
        """Joints at special values of one of ``rows``, by name."""
        names = self.plan.arm.joints
        return {names[j]: float(rows.base[k, j]) for j in np.flatnonzero(rows.fixed[k])}

    def of_set(self, fixed: Mapping[str, float]) -> range:
        """Numbers of the curves of one set of special values; empty if it has none."""
        names = self.plan.arm.joints
        values = {names.index(name): value for name, value in fixed.items()}
        joints = sorted(values)
        for first, each, level in self._blocks:
            if level.level == len(joints):
                same = (level.joints == joints).all(axis=1)
                same &= (level.values == [values[j] for j in joints]).all(axis=1)
                for place in np.flatnonzero(same).tolist():
                    begin = first + place * each
                    return range(begin, begin + each)
        return range(0)

    def configurations(self, curves: ArrayLike, samples: ArrayLike) -> Array:
        """Joint vectors (P, n) of samples (P,) of curves (P,)."""
        rows = self.rows(curves)
        places = np.asarray(samples, dtype=np.int64)[:, None]
        Q = rows.base.copy()
        moved = axis_values(self.ranges[rows.moving], self.plan.samples, places)
        np.put_along_axis(Q, rows.moving[:, None], moved, axis=1)
        return Q

    def configuration(self, index: int) -> Array:
        """Joint vector (n,) of the Jacobian with that number."""
        curve, sample = divmod(index, self.plan.samples)
        return np.asarray(self.configurations([curve], [sample])[0])

    def _singular(self, base: Array, fixed: Bool) -> Bool:
        """Return which rows contain a set that is singular whatever the others."""
        found = np.zeros(len(base), dtype=bool)
        for level in self.plan.levels:
            for place in np.flatnonzero(level.forced).tolist():
                joints = level.joints[place]
                found |= (fixed[:, joints] & (base[:, joints] == level.values[place])).all(axis=1)
        return found


def axis_values(ranges: Array, samples: int, places: Ints) -> Array:
    """Return values as of ``linspace`` over ``ranges`` (C, 2) at ``places`` (C, P), ends exact."""
    low, high = ranges[:, :1], ranges[:, 1:]
    values = places * ((high - low) / (samples - 1)) + low
    return np.asarray(np.where(places == samples - 1, high, values))


CANDIDATES = 65_536
"""Dips that a sweep goes on with unless asked otherwise."""

_CELLS = 64  # parts of a range


@dataclass(frozen=True, eq=False)
class Candidates:
    """Dips of the curves, one for each wholly singular stretch, by their numbers.

    Curves whose special values alone are singular whatever the others have none.
    """

    found: int  # how many there were; more than are kept here if they were too many
    curve: Ints  # (K,) of int: numbers of their curves, ascending
    sample: Ints  # (K,) of int: which samples
    # sigma_min and sigma_ratio: (K,): sigma_r, and sigma_r / sigma_1 there
    sigma_min: Array
    sigma_ratio: Array

    def __len__(self) -> int:
        return len(self.curve)


def minima(sigma: Array, ratio: Array) -> Bool:
    """Return which samples of curves are candidates, (C, S).

    Local minima of sigma_r and sigma_r / sigma_1 (C, S), none of a flat curve. A singular stretch,
    which is rounding, has one, at a third: its middle may be special.
    """
    beside = np.pad(sigma, ((0, 0), (1, 1)), constant_values=np.inf)
    left, right = beside[:, :-2], beside[:, 2:]
    top = sigma.max(axis=1)
    bent = top - sigma.min(axis=1) > ROUNDING * top
    found: Bool = (sigma < left) & (sigma <= right) & bent[:, None]
    singular = ratio <= SINGULAR_RTOL
    inside = singular[:, :-2] & singular[:, 1:-1] & singular[:, 2:]
    for row in np.flatnonzero(inside.any(axis=1)):
        steps = np.diff(singular[row].astype(np.int8), prepend=0, append=0)
        for first, stop in zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True):
            if stop - first >= 3:  # singular samples in a row that are a stretch and no crossing
                found[row, first:stop] = False
                found[row, first + (stop - first) // 3] = True
    return found


def kinds(rows: CurveRows, samples: int, row: Ints, sample: Ints) -> Ints:
    """Kind (P,) of candidates: sample (P,) of the curves in row (P,) of ``rows``."""
    n = rows.fixed.shape[1]
    group = (rows.fixed @ (1 << np.arange(n, dtype=np.int64))) * n + rows.moving
    return np.asarray(group[row] * _CELLS + sample * _CELLS // samples)


class Pool:
    """Candidates as they come in, hardly more than ``most`` kept, of those ``found``."""

    names = ("dips_found", "dip_number", "dip_kind", "dip_sigma", "dip_ratio")

    def __init__(self, most: int) -> None:
        self.most = most
        self.found = 0
        self._columns: list[Any] = [np.zeros(0, dtype=kind) for kind in (int, int, float, float)]

    def add(self, number: Ints, kind: Ints, sigma: Array, ratio: Array) -> None:
        """Take candidates (P,), all different, by the numbers of their Jacobians."""
        self._take(len(number), number, kind, sigma, ratio)

    def join(self, record: Record) -> None:
        """Take what `record` of another pool gave, which `check` has judged."""
        found, *columns = (record[name] for name in self.names)
        self._take(int(found), *columns)

    def check(self, record: Record, start: int, stop: int, regular: int) -> None:
        """Judge a pool of Jacobians from ``start`` to ``stop``, so many not of singular curves."""
        size = (min(int(whole(record, "dips_found", (), 0, regular + 1)), self.most),)
        DamagedError.refuse_if(
            (np.diff(whole(record, "dip_number", size, start, stop)) <= 0).any(),
            "its dips are not in order",
        )
        whole(record, "dip_kind", size, 0, 1 << 62)
        for name in ("dip_sigma", "dip_ratio"):
            finite(record, name, size)

    def record(self) -> Record:
        """Return what is kept, by number, as arrays."""
        self._reduce()
        return dict(zip(self.names, (np.array(self.found), *self._columns), strict=True))

    def candidates(self, samples: int) -> Candidates:
        """Return what is kept, of curves with so many samples."""
        self._reduce()
        number, _, sigma, ratio = self._columns
        return Candidates(self.found, number // samples, number % samples, sigma, ratio)

    def _take(self, found: int, *columns: NDArray[Any]) -> None:
        self.found += found
        self._columns = [np.append(*pair) for pair in zip(self._columns, columns, strict=True)]
        if len(self._columns[0]) > 2 * self.most + 4096:
            self._reduce()

    def _reduce(self) -> None:
        """Keep what has the smallest place within its kind, ratio and number; sort by number."""
        number, kind, _, ratio = self._columns
        chosen = np.argsort(number)
        if len(number) > self.most:
            order = np.lexsort((number, ratio, kind))
            sorted_kind = kind[order]
            starts = np.flatnonzero(np.diff(sorted_kind, prepend=sorted_kind[0] - 1))
            sizes = np.diff(starts, append=len(order))
            place = np.empty(len(order), dtype=np.int64)
            place[order] = np.arange(len(order)) - np.repeat(starts, sizes)
            first = np.lexsort((number, ratio, place))[: self.most]
            chosen = first[np.argsort(number[first])]
        self._columns = [column[chosen] for column in self._columns]
