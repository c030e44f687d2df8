"""Axes, ellipsoids and lost motions drawn into a user's own meshcat visualizer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.configuration.at import at
from pinsing.errors import OptionError
from pinsing.measures import pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.view.links import Links, base_placement
from pinsing.view.scene import draw_scene
from pinsing.view.sizes import ARROWS, Sizes, drawn_radii, quaternion, turn_z_to

SYMBOLS = {
    "arrow": ("translation", "line", "screw"),
    "ring": ("rotation", "screw"),
    "line": ("line", "screw"),
}
"""What each kind of lost motion is drawn as; the page does the same."""


class Overlay:
    """Keeps the node ``pinsing`` of a visualizer up to date.

    Parameters
    ----------
    visualizer : pinocchio MeshcatVisualizer or meshcat.Visualizer
        The former also displays the robot, if its model is the arm's or the one it came from.
    arm : Arm
        The arm.
    size : Sizes
        How large things are drawn.

    Raises
    ------
    OptionError
        If it is neither, or has no viewer yet.
    """

    def __init__(self, visualizer: Any, arm: Arm, size: Sizes) -> None:
        root = getattr(visualizer, "viewer", visualizer)
        if not hasattr(root, "set_transform"):
            raise OptionError(
                "visualizer must be a meshcat.Visualizer, or a MeshcatVisualizer after initViewer()"
            )
        self._arm, self._size = arm, size
        self._display = getattr(visualizer, "display", None)
        self._model = getattr(visualizer, "model", None)
        draw_scene(root, arm, Links(None), size)
        self._node = root["pinsing"]
        self._node.set_transform(base_placement(arm).homogeneous)
        self._node["floor"].set_property("visible", False)
        for j in range(arm.model.njoints):
            self._node[f"arm/{j}/bone"].set_property("visible", self._model is None)

    def show(self, q: Array, mode: str) -> None:
        """Place everything as at q (n,); ``mode`` is "pure" or "all" motions."""
        arm, node, state = self._arm, self._node, at(self._arm, q)
        self._move_robot(q)
        hot = {arm.joints[i] for d in state.dependences for i in d.indices}
        data = arm.model.createData()
        pin.forwardKinematics(arm.model, data, arm.model_q(q))
        for j in range(1, arm.model.njoints):
            here = node[f"arm/{j}"]
            here.set_transform(data.oMi[j].homogeneous)
            here["axis"].set_property("visible", arm.model.names[j] not in hot)
            here["hot"].set_property("visible", arm.model.names[j] in hot)
        node["tip"].set_transform(_place(state.tip_position, np.array([0, 0, 0, 1])))
        shapes = [(e.axes, e.radii) for e in (state.translational, state.rotational)]
        if mode == "pure":
            shapes = [(e.axes, e.radii) for e in pure_ellipsoids(state.J)]
        for kind, (axes, radii) in zip(("translation", "rotation"), shapes, strict=True):
            drawn = drawn_radii(radii, getattr(self._size, kind), self._size.reach)
            node[f"ellipsoid/{kind}"].set_property("visible", bool(drawn[0] > 0))
            if drawn[0] > 0:
                pose = _place(state.tip_position, quaternion(axes)) @ np.diag([*drawn, 1.0])
                node[f"ellipsoid/{kind}"].set_transform(pose)
        for k in range(ARROWS):
            lost = state.lost[k] if k < len(state.lost) else None
            close = lost is not None and (
                np.linalg.norm(lost.point - state.tip_position) <= 1.5 * self._size.reach
            )
            for part, kinds in SYMBOLS.items():
                seen = lost is not None and bool(close) and lost.kind in kinds
                node[f"lost/{k}/{part}"].set_property("visible", seen)
            if lost is not None:
                node[f"lost/{k}"].set_transform(_place(lost.point, turn_z_to(lost.direction)))

    def _move_robot(self, q: Array) -> None:
        if self._display is None or self._model is None:
            return
        arm, model = self._arm, self._model
        if list(model.names) == list(arm.model.names):
            self._display(arm.model_q(q))
        elif list(model.names) == list(arm.source.full_model.names):
            full = full_configuration(arm, q)
            self._display(full)
            self._node.set_transform(base_placement(arm, full).homogeneous)


def full_configuration(arm: Arm, q: Array) -> Array:
    """Configuration of the model before joints were locked."""
    full, values = arm.source.full_model, arm.model_q(q)
    out: Array = np.array(arm.source.reference)
    for j in range(1, arm.model.njoints):
        here = arm.model.joints[j]
        there = full.joints[full.getJointId(arm.model.names[j])]
        out[there.idx_q : there.idx_q + there.nq] = values[here.idx_q : here.idx_q + here.nq]
    return out


def _place(position: Array, turn: Array) -> Array:
    return np.array(pin.XYZQUATToSE3(np.array([*position, *turn])).homogeneous)
