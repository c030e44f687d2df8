"""The robot itself: its meshes and shapes, joint by joint of the reduced model."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from pinocchio.visualize import MeshcatVisualizer

from pinsing._types import Array
from pinsing.robot.reduced_model import make_names_unique
from pinsing.robot.tip import frame_index
from pinsing.view.body import Body
from pinsing.view.meshes import read_geometry


@dataclass(frozen=True)
class Links:
    """Visual geometry of a robot.

    Attributes
    ----------
    geometry : pin.GeometryModel or None
        Its parents are joints of ``arm.model``; placements of what is fixed to the world are
        in the base of the arm. None where the robot comes without any.
    notes : tuple of str
        What could not be read.
    """

    geometry: pin.GeometryModel | None
    notes: tuple[str, ...] = ()

    def bare(self, arm: Body) -> tuple[int, ...]:
        """Joints of the model that nothing is attached to."""
        if self.geometry is None:
            return tuple(range(1, arm.model.njoints))
        dressed = {int(g.parentJoint) for g in self.geometry.geometryObjects}
        return tuple(j for j in range(1, arm.model.njoints) if j not in dressed)


def read_links(arm: Body) -> Links:
    """Visual geometry of the robot that an arm was taken from; never fails for its sake."""
    source = arm.source
    if source.xml is None:
        return Links(None)
    try:
        whole, notes = read_geometry(source.full_model, source.xml)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        return Links(None, (f"its meshes cannot be read, so a skeleton stands for it: {reason}",))
    full = source.full_model.copy()
    original = make_names_unique(full)  # as `lock_joints` does
    reduced, geometry = pin.buildReducedModel(full, whole, list(source.locked), source.reference)
    back = base_placement(arm).inverse()
    for g in geometry.geometryObjects:
        joint = int(g.parentJoint)
        name = reduced.names[joint]
        # Joints are found again by name: the arm has them in an order of its own.
        g.parentJoint = arm.model.getJointId(original.get(name, name)) if joint else 0
        if not joint:
            g.placement = back * g.placement
    return Links(geometry, notes)


def base_placement(arm: Body) -> pin.SE3:
    """Placement of the arm's base in the world of the full model."""
    if arm.base == "universe":
        return pin.SE3.Identity()
    model = arm.source.full_model
    data = model.createData()
    pin.forwardKinematics(model, data, arm.source.reference)
    return pin.SE3(pin.updateFramePlacement(model, data, frame_index(model, arm.base)))


class _Drawer(MeshcatVisualizer):  # type: ignore[misc]
    """Pinocchio's own reader of geometry, with each object under its joint."""

    def getViewerNodeName(self, geometry_object: Any, geometry_type: Any) -> str:
        """Path of an object; names of the file stay out of it."""
        return f"{int(geometry_object.parentJoint)}/visual/{self.number}"


def draw_links(node: Any, links: Links) -> tuple[str, ...]:
    """Draw all geometry below ``node/<joint>/visual``; return what could not be drawn."""
    if links.geometry is None:
        return ()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        drawer = _Drawer(pin.Model(), None, pin.GeometryModel())
        drawer.initViewer(viewer=node)
        for number, g in enumerate(links.geometry.geometryObjects):
            drawer.number = number
            drawer.loadViewerGeometryObject(g, pin.GeometryType.VISUAL)
            place: Array = g.placement.homogeneous @ np.diag([*g.meshScale, 1.0])
            node[drawer.getViewerNodeName(g, None)].set_transform(place)
    mesh = [str(w.message) for w in said if issubclass(w.category, UserWarning)]
    return tuple(" ".join(text.split()) for text in mesh)
