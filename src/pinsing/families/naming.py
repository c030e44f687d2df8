"""Wrist, elbow, shoulder: the name that a roboticist gives a family, decided from the geometry.

Only the full pose is named, and only where the geometry makes each condition below singular. With
C the wrist center:

- six joints whose axes 4, 5, 6 meet in one point C (spherical wrist), or whose axes 2, 3, 4 are
  parallel while axes 5 and 6 meet in C (offset wrist, as of a UR5): *wrist* where axes 4, 5 and 6
  are parallel to one plane, so that axes 4 and 6 line up in all usual wrists;
- if also axes 2 and 3 are parallel and axis 1 is not: *elbow* where C (with an offset wrist, axis
  4) lies in the plane of axes 2 and 3, with the links stretched or folded; *shoulder* where C lies
  in the plane through axis 1 parallel to axis 2, above axis 1 where the arm has no lateral offset.
  A prismatic third joint at right angles to axis 2 has a shoulder, and no elbow;
- seven revolute joints, of which the first three meet in S and the last three in C: *shoulder*
  and *wrist* where the three axes are parallel to one plane, *elbow* where S, C and axis 4 are in
  one plane.

A family has the name of the one condition that holds all over it, else none: two conditions at
once are no name. Legs have no names: their joints are hips, knees and ankles.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from pinsing._types import Array
from pinsing.configuration.axis_dependence import generic_axes
from pinsing.configuration.lost_motion import STRUCTURE_TOL, JointAxes
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.robot.arm import Arm

ORDER = ("wrist", "elbow", "shoulder", "")
"""Names in the order in which people are told of families."""

_ON = 1e-6
"""Radians, and share of the arm's size: on the family, whose points have nine digits."""
_LEG = re.compile("hip|knee|ankle|(^|_)leg", re.IGNORECASE)

Holds = Callable[[JointAxes, float], bool]


def title_of(arm: Arm, points: Array) -> str:
    """Return the name of the family that has these points (N, n), or "" if it has none.

    Parameters
    ----------
    arm : Arm
        Its nominal geometry.
    points : (N, n) array
        Configurations all over the family.
    """
    conditions = arm.once("named conditions", lambda: _conditions(arm))
    if not conditions or not len(points):
        return ""
    axes = [JointAxes.of(J, arm.prismatic, np.zeros(3)) for J in frame_jacobians(arm, points)]
    found = [name for name, holds in conditions.items() if all(holds(a, _ON) for a in axes)]
    return found[0] if len(found) == 1 else ""


def _conditions(arm: Arm) -> Mapping[str, Holds]:
    """The conditions that have a name for an arm; none where its geometry does not warrant it."""
    slides = arm.prismatic
    legs = any(_LEG.search(joint) for joint in arm.joints)
    if arm.task.name != "pose" or arm.coupling is not None or legs or arm.n not in (6, 7):
        return {}
    samples = generic_axes(arm)

    def meet(*ids: int) -> bool:
        return all(a.meeting_point(ids, STRUCTURE_TOL) is not None for a in samples)

    def parallel(*ids: int) -> bool:
        return all(a.parallel(ids, STRUCTURE_TOL) for a in samples)

    if arm.n == 7:
        if slides.any() or not (meet(0, 1, 2) and meet(4, 5, 6)):
            return {}
        return {"wrist": _flat(4, 5, 6), "elbow": _stretched, "shoulder": _flat(0, 1, 2)}
    if slides[3:].any():
        return {}
    spherical, offset = meet(3, 4, 5), not slides[1:].any() and parallel(1, 2, 3)
    found: dict[str, Holds] = {}
    if spherical or (offset and meet(4, 5)):
        found["wrist"] = _flat(3, 4, 5)
    planar = not slides[:2].any() and not parallel(0, 1)
    if slides[2]:
        planar = planar and all(a.perpendicular(1, a.direction[2], STRUCTURE_TOL) for a in samples)
    else:
        planar = planar and parallel(1, 2)
    if planar and spherical:
        found["shoulder"] = _above
        found["" if slides[2] else "elbow"] = _moves_center_one_way
    elif planar and offset:
        found["elbow"] = lambda a, tol: a.in_one_plane((1, 2, 3), tol)
        if meet(4, 5):
            found["shoulder"] = _above
    return found


def _flat(*ids: int) -> Holds:
    """Three axes are parallel to one plane."""
    return lambda a, tol: abs(np.linalg.det(a.direction[list(ids)])) <= tol


def _center(a: JointAxes, *ids: int) -> Array:
    met = a.meeting_point(ids, STRUCTURE_TOL)
    return np.full(3, np.nan) if met is None else met  # parallel there: no condition holds


def _above(a: JointAxes, tol: float) -> bool:
    """Axis 1 does not move the wrist center along axis 2."""
    return abs(float(a.velocity(0, _center(a, 4, 5)) @ a.direction[1])) <= tol * a.size


def _moves_center_one_way(a: JointAxes, tol: float) -> bool:
    """Joints 2 and 3 move the wrist center in one direction only, or not at all."""
    center = _center(a, 4, 5)
    return bool(np.isfinite(center).all()) and a.velocity_rank((1, 2), center, tol) < 2


def _stretched(a: JointAxes, tol: float) -> bool:
    """The centers of shoulder and wrist and axis 4 lie in one plane."""
    centers = _center(a, 0, 1, 2), _center(a, 4, 5, 6)
    return all(np.isfinite(c).all() for c in centers) and a.in_one_plane((3,), tol, *centers)
