"""How many modes there are, by algebra, where each leg passes one force.

Given the pose, each leg is by itself: its actuated joint has the two solutions of a quadratic
equation.
"""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.loops.rod import Rod
from pinsing.loops.rods import rods
from pinsing.loops.sphere_loci import count_inputs
from pinsing.loops.three_distances import rod_length
from pinsing.robot.mechanism import Mechanism

TOUCHING = 1e-9
"""Two solutions that are this near to each other are not counted."""
_PLANE, _SPACE = {0, 1, 5}, set(range(6))


def count_working(mechanism: Mechanism, R: Array, p: Array) -> int | None:
    """Values of the inputs for a pose R (3, 3), p (3,) within their limits; None where not told.

    Passive joints have limits of their own, which may leave fewer.
    """
    found = rods(mechanism)
    if found is None:
        return count_inputs(mechanism, R)
    if found.tilted or any(rod.bends or rod.side for rod in found.rods):
        return None
    if set(mechanism.task.rows) != (_PLANE if found.planar else _SPACE):
        return None
    joints = [rod.joint for rod in found.rods]
    if len(set(joints)) < len(joints) or any(rod.hinge is not None for rod in found.rods):
        return None
    count = 1
    for rod in found.rods:
        length = 0.0 if rod.slides else rod_length(mechanism, rod)
        roots = values(mechanism, rod, p + R @ rod.outer, found.planar, length)
        if roots is None:
            return None
        count *= sum(inside(mechanism, rod.joint, v) for v in roots)
    return count


def values(
    mechanism: Mechanism, rod: Rod, B: Array, planar: bool, length: float
) -> tuple[float, ...] | None:
    """What the actuated joint can be with the outer end at B; None where two solutions meet."""
    keep = (1.0, 1.0, 0.0) if planar else (1.0, 1.0, 1.0)
    e = (B - rod.inner) * keep
    if rod.slides:
        reach = float(np.linalg.norm(e))
        return None if reach <= TOUCHING else (reach - rod.offset, -reach - rod.offset)
    first, second = rod.first * keep, rod.second * keep
    if mechanism.prismatic[rod.joint]:
        # |e - q a| = length.
        middle, size = float(e @ first) / float(first @ first), float(first @ first)
        left = middle**2 - (float(e @ e) - length**2) / size
        if abs(left) <= TOUCHING:
            return None
        return () if left < 0 else (middle + float(np.sqrt(left)), middle - float(np.sqrt(left)))
    # (cos, sin) . (e . first, e . second) = known.
    a, b = float(e @ first), float(e @ second)
    known = (float(e @ e) + float(first @ first) - length**2) / 2
    size = float(np.hypot(a, b))
    if abs(size - abs(known)) <= TOUCHING:
        return None
    if size < abs(known):
        return ()
    middle, spread = float(np.arctan2(b, a)), float(np.arccos(known / size))
    return middle + spread, middle - spread


def inside(mechanism: Mechanism, joint: int, value: float) -> bool:
    """Whether a value of a joint is within its limits, whole turns aside."""
    low, high = float(mechanism.lower[joint]), float(mechanism.upper[joint])
    if mechanism.prismatic[joint]:
        return low <= value <= high
    if not np.isfinite([low, high]).all():
        return True
    return (value - low) % (2 * np.pi) <= high - low
