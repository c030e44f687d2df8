"""Inverse solutions by EAIK, of the arms that it knows.

EAIK (Ostermeier, https://github.com/OstermD/EAIK) decomposes arms of six revolute joints into
subproblems. It is given the nominal chain, whose axes meet or are parallel exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.nominal import nominal


def decomposed(arm: Arm, held: int | None = None, value: float = 0.0) -> Any:
    """Return EAIK's robot of an arm, a joint held at a value; None if EAIK does not know it."""
    try:
        from eaik.IK_Homogeneous import HomogeneousRobot
    except ImportError:
        return None
    chain = flatten(nominal(arm).arm)
    if chain.prismatic.any() or arm.coupling is not None or arm.n - (held is not None) != 6:
        return None
    frames, at = [], np.eye(4)
    for R, t in zip(chain.R, chain.t, strict=True):  # axes along z, all joints at zero; the tip
        here = np.eye(4)
        here[:3, :3], here[:3, 3] = R, t
        at = at @ here
        frames.append(at)
    robot = HomogeneousRobot(np.array(frames), fixed_axes=[] if held is None else [(held, value)])
    return robot if robot.hasKnownDecomposition() else None


def exactly(found: Any, n: int) -> Array:
    """Solutions (k, n), a held joint included, without those that are least squares only."""
    return np.asarray(np.asarray(found.Q, dtype=float).reshape(-1, n)[~np.asarray(found.is_LS)])
