"""How many modes there are where the passive joints of one loop are three parallel pins.

With the inputs held the loop is a triangle, whatever its actuated joints are (five-bars on cranks,
on slides, welded or driven in the middle): it stands on either side of the base. For a position of
its middle pin each leg with one actuated joint has the two solutions of a quadratic equation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.leg_wrenches import path_to
from pinsing.loops.mode_counts import inside, values
from pinsing.loops.modes import home
from pinsing.loops.rod import Rods, Sample
from pinsing.loops.rods import carried, plane_axes
from pinsing.loops.structure import structure
from pinsing.robot.mechanism import Mechanism

LOOP = -1
"""Stands for the pin that a loop closes in, among the joints of its ring."""

_SMALL = 1e-9
_FLAT = 1e-5
"""Height of a triangle, of its longest side, at which both of its places are one."""


def count_triangles(mechanism: Mechanism, found: Sequence[Array]) -> int | None:
    """Poses at the inputs of closed configurations (n,), limits left aside; None of other loops."""
    ring = _ring(mechanism)
    if ring is None or not found:
        return None
    moving = {j for j in ring if j in mechanism.passive}
    if not moving & set(path_to(mechanism, structure(mechanism).output)):
        return None
    corners = _corners(mechanism, ring, found[0])
    if corners is None:
        return None
    sides = corners - np.roll(corners, 1, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if lengths.min() <= _SMALL * max(lengths.max(), _SMALL):
        return None
    height = abs(sides[0][0] * sides[1][1] - sides[0][1] * sides[1][0]) / lengths.max()
    return 1 if height <= _FLAT * lengths.max() else 2


def count_of_point(mechanism: Mechanism, p: Array) -> int | None:
    """Values of the inputs within their limits that bring the middle pin to p (3,), the output.

    None of other mechanisms, or where two solutions meet.
    """
    legs = point_legs(mechanism)
    if legs is None:
        return None
    count = 1
    for rod, length in zip(legs.rods.rods, legs.lengths, strict=True):
        roots = values(mechanism, rod, legs.rods.axes @ p, True, length)
        if roots is None:
            return None
        count *= sum(inside(mechanism, rod.joint, v) for v in roots)
    return count


@dataclass(frozen=True, eq=False)
class PointLegs:
    """Both rods of a five-bar whose output is the position of the middle pin, in any plane.

    Attributes
    ----------
    rods : Rods
        Each hangs on a crank or a slide.
    lengths : tuple of float
        Metres.
    """

    rods: Rods
    lengths: tuple[float, ...]


def point_legs(mechanism: Mechanism) -> PointLegs | None:
    """The rods of such a five-bar; None of other mechanisms."""
    return mechanism.once("point_legs", lambda: _point_legs(mechanism))


def _point_legs(mechanism: Mechanism) -> PointLegs | None:
    ring, plane = _ring(mechanism), plane_axes(mechanism)
    if ring is None or plane is None or not _position_in(plane[0], mechanism.task.rows):
        return None
    driven = [j in mechanism.actuated for j in ring]
    if driven != [True, False, False, False, True] or len(ring) != mechanism.n + (LOOP in ring):
        return None
    start = _sample(mechanism, home(mechanism), *plane)
    zero = _sample(mechanism, np.zeros(mechanism.n), *plane)
    if not _at_pin(mechanism, ring[2], start):
        return None
    loop = mechanism.loops[0]
    found, lengths = [], []
    for act, pin, own in ((ring[0], ring[1], loop.frame_a), (ring[4], ring[3], loop.frame_b)):
        rod = carried(mechanism, zero, act, _place(mechanism, zero, pin, own), np.zeros(3))
        if rod is None:
            return None
        reach = _place(mechanism, start, pin, own) - np.array(start.output.translation)
        found.append(rod)
        lengths.append(float(np.linalg.norm(reach[:2])))
    return PointLegs(Rods(mechanism, tuple(found), True, *plane), tuple(lengths))


def _position_in(axes: Array, rows: Sequence[int]) -> bool:
    """Whether rows of a task are the position in a plane, whose axes are rows of (3, 3)."""
    across = [k for k in range(3) if k not in rows]
    return set(rows) <= {0, 1, 2} and bool((np.abs(axes[:2, across]) <= _SMALL).all())


def _place(mechanism: Mechanism, sample: Sample, pin: int, own: str) -> Array:
    """Where a pin is (3,); that of the loop by its frame ``own``, since the tree may be open."""
    if pin != LOOP:
        return np.array(sample.joints[pin + 1].translation)
    frames = zip(sample.frames, mechanism.model.frames, strict=True)
    return np.array(next(f for f, x in frames if x.name == own).translation)


def _ring(mechanism: Mechanism) -> list[int] | None:
    """Joints around the one loop from base to base, of which three are passive pins; or None."""
    if len(mechanism.loops) != 1 or mechanism.prismatic[list(mechanism.passive)].any():
        return None
    loop = mechanism.loops[0]
    bodies = {f.name: int(f.parentJoint) for f in mechanism.model.frames}
    first, second = (path_to(mechanism, bodies[name]) for name in (loop.frame_a, loop.frame_b))
    if set(first) & set(second):
        return None
    ring = [*first, *([] if loop.kind == "6d" else [LOOP]), *reversed(second)]
    pins = [j for j in ring if j not in mechanism.actuated]
    return ring if len(pins) == 3 and set(mechanism.passive) <= set(pins) else None


def _corners(mechanism: Mechanism, ring: Sequence[int], q: Array) -> Array | None:
    """The three pins (3, 2) in their plane; None where they are not parallel."""
    sample, loop = _sample(mechanism, q, np.eye(3), np.eye(3)), mechanism.loops[0]
    pins = [j for j in ring if j not in mechanism.actuated]
    axes = np.array([sample.axis[j] for j in pins if j != LOOP])
    frame = next(f for f, x in zip(sample.frames, mechanism.model.frames, strict=True)
                 if x.name == loop.frame_a)  # fmt: skip
    if loop.kind == "planar":
        axes = np.concatenate([axes, np.array(frame.rotation)[None, :, 2]])
    if np.abs(np.cross(axes, axes[0])).max() > _SMALL:
        return None
    points = np.array(
        [frame.translation if j == LOOP else sample.joints[j + 1].translation for j in pins]
    )
    return np.asarray(points @ np.linalg.svd(axes[:1])[2][1:].T)


def _at_pin(mechanism: Mechanism, pin: int, at: Sample) -> bool:
    """Whether the output is the position of a pin, as a point of one of its two bodies."""
    frames = {f.name: f for f in mechanism.model.frames}
    output, loop = frames[mechanism.output], mechanism.loops[0]
    if pin == LOOP:
        bodies = {frames[name].parentJoint for name in (loop.frame_a, loop.frame_b)}
    else:
        bodies = {pin + 1, mechanism.model.parents[pin + 1]}
    if output.parentJoint not in bodies:
        return False
    away = _place(mechanism, at, pin, loop.frame_a) - np.array(at.output.translation)
    return bool(np.linalg.norm(away[:2]) <= _SMALL * mechanism.length_scale)


def _sample(mechanism: Mechanism, q: Array, axes: Array, own: Array) -> Sample:
    return Sample(mechanism, structure(mechanism), q, axes, own)
