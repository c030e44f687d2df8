"""The curves of a sweep by their numbers: nothing here is as long as the sweep.

First each joint from the nominal configuration, then level by level, set by set, each joint
that moves in turn. The Jacobian of sample s of curve c has the number c * samples + s.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.sampling.sweep_plan import NOT_ASKED, PlannedLevel, SweepPlan


@dataclass(frozen=True, eq=False)
class CurveRows:
    """Some curves.

    Attributes
    ----------
    numbers : (C,) array of int
        Which ones.
    base : (C, n) array
        The configuration that all of a curve has but for the joint that moves.
    fixed : (C, n) array of bool
        Joints at special values.
    moving : (C,) array of int
        Index of the joint that moves.
    forced : (C,) array of bool
        The special values are a minimal set that is singular whatever the others.
    singular : (C,) array of bool
        They contain such a set: the curve is singular all along.
    """

    numbers: Ints
    base: Array
    fixed: Bool
    moving: Ints
    forced: Bool
    singular: Bool


@dataclass(frozen=True, eq=False)
class _Block:
    """Curves of one level, from number ``first`` on: ``each`` for every set."""

    first: int
    each: int
    level: PlannedLevel


class CurveTable:
    """All curves of a plan.

    Parameters
    ----------
    plan : SweepPlan
        The plan.
    """

    def __init__(self, plan: SweepPlan) -> None:
        self.plan = plan
        self._alone = np.array(
            [i for i, e in enumerate(plan.effects) if e.reason != NOT_ASKED], dtype=np.int64
        )
        self._swept = np.array(plan.swept, dtype=np.int64)
        self._blocks: list[_Block] = []
        first = len(self._alone)
        for level in plan.levels:
            if level.swept:
                each = len(self._swept) - level.level
                self._blocks.append(_Block(first, each, level))
                first += each * len(level.values)
        self._length = first
        self._ranges = np.array([effect.range for effect in plan.effects], dtype=float)

    def __len__(self) -> int:
        return self._length

    @property
    def ranges(self) -> Array:
        """Ends of the range of each joint, (n, 2)."""
        return self._ranges

    def rows(self, numbers: npt.ArrayLike) -> CurveRows:
        """Look up the curves ``numbers`` (C,)."""
        found = np.asarray(numbers, dtype=np.int64)
        count, n = len(found), len(self.plan.nominal)
        base = np.tile(self.plan.nominal, (count, 1))
        fixed, forced = np.zeros((count, n), dtype=bool), np.zeros(count, dtype=bool)
        moving = np.zeros(count, dtype=np.int64)
        alone = found < len(self._alone)
        moving[alone] = self._alone[found[alone]]
        for block in self._blocks:
            last = block.first + block.each * len(block.level.values)
            here = np.flatnonzero((found >= block.first) & (found < last))
            if not len(here):
                continue
            place, turn = np.divmod(found[here] - block.first, block.each)
            rows, joints = here[:, None], block.level.joints[place]
            base[rows, joints] = block.level.values[place]
            fixed[rows, joints] = True
            forced[here] = block.level.forced[place]
            free = ~fixed[rows, self._swept[None]]  # the same number in each row
            others = np.nonzero(free)[1].reshape(len(here), block.each)
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
        for block in self._blocks:
            if block.level.level == len(joints):
                same = (block.level.joints == joints).all(axis=1)
                same &= (block.level.values == [values[j] for j in joints]).all(axis=1)
                for place in np.flatnonzero(same).tolist():
                    first = block.first + place * block.each
                    return range(first, first + block.each)
        return range(0)

    def configurations(self, curves: npt.ArrayLike, samples: npt.ArrayLike) -> Array:
        """Joint vectors (P, n) of samples (P,) of curves (P,)."""
        rows = self.rows(curves)
        places = np.asarray(samples, dtype=np.int64)[:, None]
        Q = rows.base.copy()
        moved = axis_values(self._ranges[rows.moving], self.plan.samples, places)
        np.put_along_axis(Q, rows.moving[:, None], moved, axis=1)
        return Q

    def configuration(self, index: int) -> Array:
        """Joint vector (n,) of the Jacobian with that number."""
        curve, sample = divmod(index, self.plan.samples)
        return np.asarray(self.configurations([curve], [sample])[0])

    def _singular(self, base: Array, fixed: Bool) -> Bool:
        """Which rows contain a set that is singular whatever the others."""
        found = np.zeros(len(base), dtype=bool)
        for level in self.plan.levels:
            for place in np.flatnonzero(level.forced).tolist():
                joints = level.joints[place]
                at = fixed[:, joints] & (base[:, joints] == level.values[place])
                found |= at.all(axis=1)
        return found


def axis_values(ranges: Array, samples: int, places: Ints) -> Array:
    """Values of joints that move over ``ranges`` (C, 2) in so many samples, at ``places`` (C, P).

    Those of ``numpy.linspace``, any stretch by itself; the ends are exact.
    """
    low, high = ranges[:, :1], ranges[:, 1:]
    values = places * ((high - low) / (samples - 1)) + low
    return np.asarray(np.where(places == samples - 1, high, values))
