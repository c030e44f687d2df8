"""Starts that came near to a pose and did not reach it: what they say about a search."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.robot.joint_space import JointSpace

_SMALL = 1e-5
"""What is left of the pose below which a start all but reached it: radians, or length scales."""

_BESIDE = 0.1
"""Joint distance within which a start that stalled says nothing more than the solution there."""

_KEPT = 512


@dataclass(eq=False)
class Stalled:
    """Where starts ended that all but reached a pose.

    Newton's steps stall where the Jacobian is singular, or nearly: there what is left of the pose
    is small along a whole valley. So a small rest that is not zero means that there may be a
    solution nearby, and not that the pose is out of reach.
    """

    space: JointSpace
    Q: list[Array] = field(default_factory=list)
    left: list[float] = field(default_factory=list)

    def add(self, Q: Array, left: Array) -> None:
        """Keep the ends Q (N, n), at each of which ``left`` (N,) of the pose remains."""
        near = np.flatnonzero(left < _SMALL)
        for k in near[: _KEPT - len(self.Q)]:
            self.Q.append(Q[k])
            self.left.append(float(left[k]))

    def doubt(self, solutions: Array) -> str:
        """What they say against that solutions (K, n) are all there are; empty if nothing."""
        if not self.Q:
            return ""
        Q, left = np.array(self.Q), np.array(self.left)
        for q in solutions:
            away = np.abs(self.space.wrap(Q - q)).max(axis=1) > _BESIDE
            Q, left = Q[away], left[away]
        if not len(Q):
            return ""
        count = f"{len(Q)} start{'s' * (len(Q) != 1)}"
        return (
            f"{count} came within {left.min():.1g} of the pose and stalled, as happens next to "
            "singular configurations: there may be a solution there"
        )
