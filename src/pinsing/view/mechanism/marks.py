"""What the scene of a mechanism has beyond that of an arm."""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing.robot.mechanism import Mechanism
from pinsing.view.drawing import geometry as mg
from pinsing.view.mechanism.linkage import plane_normal
from pinsing.view.scene import HOT, ROTATION, ring_arrow, straight_arrow, torus
from pinsing.view.sizes import Sizes


def draw_linkage_marks(node: Any, mechanism: Mechanism, size: Sizes) -> None:
    """Draw the arrows of motions that the actuators do not hold; adapt the rest to a plane.

    In a plane the rotations are about its normal: a ring, whose radius is the speed, takes the
    place of an ellipsoid that would be a needle seen from its end; and the floor goes below a
    linkage that lies on it.

    Parameters
    ----------
    node : meshcat visualizer
        The node ``pinsing`` of the scene that `draw_scene` drew.
    mechanism : Mechanism
        The mechanism.
    size : Sizes
        How large things are drawn.
    """
    straight_arrow(node["free/translation"], size.reach, HOT)
    ring_arrow(node["free/rotation"], size.reach, HOT)
    normal = plane_normal(mechanism)
    if normal is None:
        return
    turning = node["ellipsoid/rotation"]
    for part in ("skin", "xy", "yz", "zx"):
        turning[part].delete()
    turning["ring"].set_object(torus(1.0, 0.035), mg.MeshPhongMaterial(color=ROTATION))
    if abs(normal[2]) > 1 - 1e-9:
        below = np.eye(4)
        below[2, 3] = -0.06 * size.reach
        node["floor"].set_transform(below)
