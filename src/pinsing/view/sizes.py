"""How large things are drawn, and how they are turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.robot.arm import Arm

ARROWS = 3
"""Lost motions drawn at most."""

FLOOR = 0.012
"""Drawn semi-axes are at least this share of the largest: an exact zero would vanish."""

LEAST = 0.006
"""And at least this share of the reach: a disc or a line of a small arm would be a sliver."""

SLIM = 0.1
"""But for its sake no more than this share of the largest: what is flat is to look flat."""


@dataclass(frozen=True)
class Sizes:
    """How large things are drawn; one choice per arm, so that poses can be compared.

    Attributes
    ----------
    reach : float
        Length of the stretched arm, metres.
    translation : float
        Metres drawn for 1 m/s.
    rotation : float
        Metres drawn for 1 rad/s.
    """

    reach: float
    translation: float
    rotation: float


def sizes(arm: Arm, scale: float = 1.0) -> Sizes:
    """Sizes that suit an arm: the ellipsoids about a quarter of its reach, times ``scale``."""
    rng = np.random.default_rng(512)
    lower, upper = arm.span
    J = frame_jacobians(arm, rng.uniform(lower, upper, (48, arm.n)))
    length = _reach(arm)
    fastest = np.median(np.linalg.svd(J[:, :3], compute_uv=False)[:, 0])
    turning = np.median(np.linalg.svd(J[:, 3:], compute_uv=False)[:, 0])
    return Sizes(
        reach=length,
        translation=scale * 0.27 * length / max(float(fastest), 1e-9),
        rotation=scale * 0.20 * length / max(float(turning), 1e-9),
    )


def _reach(arm: Arm) -> float:
    """Sum of the distances between successive joints, sliders pulled out, metres."""
    offsets = [np.linalg.norm(place.translation) for place in arm.model.jointPlacements[2:]]
    tip = np.linalg.norm(arm.model.frames[arm.tip_id].placement.translation)
    lower, upper = arm.span
    slides = np.maximum(np.abs(lower), np.abs(upper))[arm.prismatic].sum()
    return max(float(sum(offsets) + tip + slides), 1e-3)


def drawn_radii(radii: Array, scale: float, reach: float) -> Array:
    """Semi-axes (3,) to draw, metres: floored where flat; all zero where there is no motion."""
    largest = scale * float(radii[0])
    if radii[0] <= 1e-12:
        return np.zeros(3)
    thinnest = max(FLOOR * largest, min(LEAST * reach, SLIM * largest))
    return np.asarray(np.maximum(scale * radii, thinnest))


def quaternion(rotation: Array) -> Array:
    """Quaternion (x, y, z, w) of a rotation matrix (3, 3)."""
    return np.array(pin.Quaternion(rotation).coeffs())


def turn_z_to(direction: Array) -> Array:
    """Quaternion (x, y, z, w) of the shortest turn from z to a unit vector (3,)."""
    return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).coeffs())
