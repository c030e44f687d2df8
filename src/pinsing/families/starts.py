"""A family's own points from random starts, where its equations are too many to draw points of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.families.empty_box import Stop
from pinsing.families.nearness import Confirm, near
from pinsing.families.parts import Branch
from pinsing.families.zero_set import thrown
from pinsing.robot.joint_space import JointSpace

_LATE, _FEWEST, _MOST = 12, 40, 400
"""Starts at once: where the time is over, and where it is not."""
_TURNS = 4
"""Times that so many are tried."""
ON = 1e-9
"""Distance in joint space up to which a point is on a branch: small residuals say less."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Where random starts are drawn from.

    Attributes
    ----------
    held : sequence of (Branch, (n,) array)
        Branches with the values of their fixed joints.
    space : JointSpace
        Of all joints.
    lower, upper : (n,) arrays
        The box.
    within : bool
        Whether points outside of it do not count.
    """

    held: Sequence[tuple[Branch, Array]]
    space: JointSpace
    lower: Array
    upper: Array
    within: bool

    def own(self, confirm: Confirm, n: int, rng: np.random.Generator, stop: Stop | None) -> Array:
        """Up to n own points (k, n) of the branches, from each about as many.

        By what singular means, as far as the equations hold there; then, where that finds too few,
        by the equations.
        """
        found = [np.zeros((0, self.space.n))]
        share = -(-n // max(1, len(self.held)))
        for i, (branch, fixed) in enumerate(self.held):
            if i and stop is not None and stop():
                break
            free = np.ones(self.space.n, dtype=bool)
            free[[v.joint for v in branch.values]] = False
            missing = share
            for _ in range(_TURNS):
                q = self._by_rank(confirm, branch, fixed, free, missing, rng, stop)
                found.append(q[:missing])
                missing -= len(found[-1])
                if missing == 0 or not len(q) or (stop is not None and stop()):
                    break
            if missing:
                q = self._by_equations(confirm, branch, fixed, free, missing, rng, stop)
                found.append(q[:missing])
        return np.concatenate(found)[:n]

    def _by_rank(
        self,
        confirm: Confirm,
        branch: Branch,
        fixed: Array,
        free: Bool,
        n: int,
        rng: np.random.Generator,
        stop: Stop | None,
    ) -> Array:
        late = stop is not None and stop()  # then a first look is taken all the same
        count = _LATE if late else min(max(_FEWEST, 4 * n), _MOST)
        starts = np.where(free, rng.uniform(self.lower, self.upper, (count, len(free))), fixed)
        q = self._inside(confirm.drawn(starts, free, (self.lower, self.upper)))
        return q[near((branch,), self.space, q, ON)] if len(q) else q

    def _by_equations(
        self,
        confirm: Confirm,
        branch: Branch,
        fixed: Array,
        free: Bool,
        n: int,
        rng: np.random.Generator,
        stop: Stop | None,
    ) -> Array:
        count = min(max(_FEWEST, 4 * n), _MOST)
        box = self.lower, self.upper
        q = thrown(branch.equations, *box, free, fixed, count, rng, stop)
        q = q[confirm(q)] if len(q) else q
        return self._inside(q) if self.within else q

    def _inside(self, q: Array) -> Array:
        """Those of some points (N, n) that are in the box, up to whole turns."""
        q = self.space.fold(q)
        return np.asarray(q[((q >= self.lower - 1e-9) & (q <= self.upper + 1e-9)).all(axis=-1)])
