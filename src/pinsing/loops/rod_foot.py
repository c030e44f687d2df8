"""Legs that are driven at the foot, before a passive slide: RPR in the plane, RPS and UPS in space.

What such a leg passes on is across its slide: with a the axis of the first joint and d = B - C the
force of the first joint is along a x d, that of the second joint of a universal foot (whose axis is
along a x d) along (a x d) x d, that of a driven slide along d. Each does work on its own joint
alone.
"""

from __future__ import annotations

import numpy as np

from pinsing.loops.rod import End, Rod, Sample, end_point, in_output, slide_offset
from pinsing.loops.structure import Structure
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9


def foot_driven(
    mechanism: Mechanism,
    built: Structure,
    samples: list[Sample],
    path: list[int],
    end: End,
    planar: bool,
) -> list[Rod]:
    """The forces of one leg that is driven at its foot; empty for another one."""
    size = 1 if planar else 3
    if end.hanging or (end.centre is not None and len(end.centre.joints) != size):
        return []
    slides = mechanism.prismatic[path]
    if not 2 <= len(path) <= (2 if planar else 3) or slides[:-1].any() or not slides[-1]:
        return []
    first, slide = path[0], path[-1]
    if not set(path[:-1]) & set(mechanism.actuated):
        return []
    flat = np.array([1.0, 1.0, 0.0]) if planar else np.ones(3)
    axis = samples[0].axis[first]
    foot = np.array(samples[0].joints[first + 1].translation)
    B = np.array([end_point(s, end) for s in samples])
    along = np.array([s.axis[slide] for s in samples])
    if np.abs(along @ axis).max() > _SMALL and len(path) == 2:
        return []
    if len(path) == 3:
        met = _universal(samples, path, along)
        if met is None:
            return []
        foot = foot + met * axis
    else:
        # Straight across from the end.
        off = (B - foot) @ axis
        if np.abs(off - off[0]).max() > _SMALL:
            return []
        foot = foot + off[0] * axis
    if np.abs(np.cross((B - foot) * flat, along)).max() > _SMALL:
        return []
    offset = slide_offset((B - foot) * flat, along, np.array([s.q[slide] for s in samples]))
    if offset is None:
        return []
    outer, zero = in_output(mechanism, samples[0], end), np.zeros(3)
    hinge = axis if len(path) == 2 and not planar else None
    out = []
    for side, joint in ((0, slide), *enumerate(path[:-1], 1)):
        if joint in mechanism.actuated:
            out.append(
                Rod(
                    joint, side == 0, outer, foot, zero, zero, hinge, False, axis, side, slide,
                    offset,
                )
            )  # fmt: skip
            hinge = None
    return out


def _universal(samples: list[Sample], path: list[int], along: object) -> float | None:
    """Where along the first axis the second one meets it, all crossed at right angles, or None."""
    found = []
    for s, slide in zip(samples, np.asarray(along), strict=True):
        a, b = s.axis[path[0]], s.axis[path[1]]
        if max(abs(float(a @ b)), abs(float(b @ slide))) > _SMALL:
            return None
        gap = np.array(s.joints[path[1] + 1].translation - s.joints[path[0] + 1].translation)
        if abs(float(gap @ np.cross(a, b))) > _SMALL:
            return None
        found.append(float(gap @ a))
    return found[0]
