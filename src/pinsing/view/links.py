"""The robot itself: its meshes and shapes, joint by joint of the reduced model."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.robot.backward import turned_round
from pinsing.robot.reduced_model import make_names_unique
from pinsing.robot.tip import frame_index
from pinsing.view.body import Body
from pinsing.view.meshes import Mesh, read_geometry, read_meshes
from pinsing.view.shapes import draw_shape

_AHEAD = "links that are being read"


@dataclass(frozen=True)
class Links:
    """Visual geometry of a robot.

    Attributes
    ----------
    geometry : pin.GeometryModel or None
        Its parents are joints of ``arm.model``; placements of what is fixed to the world are
        in the base of the arm. None where the robot comes without any.
    notes : tuple of str
        What is not there, may not be opened or could not be read.
    """

    geometry: pin.GeometryModel | None
    notes: tuple[str, ...] = ()

    def bare(self, arm: Body) -> tuple[int, ...]:
        """Joints of the model that nothing is attached to."""
        if self.geometry is None:
            return tuple(range(1, arm.model.njoints))
        dressed = {int(g.parentJoint) for g in self.geometry.geometryObjects}
        return tuple(j for j in range(1, arm.model.njoints) if j not in dressed)


def read_links_ahead(arm: Body) -> None:
    """Begin `read_links` in a thread, while something else is computed."""
    if _AHEAD not in arm.known:
        pool = ThreadPoolExecutor(1, thread_name_prefix="pinsing meshes")
        arm.known[_AHEAD] = pool.submit(_read_links, arm)
        pool.shutdown(wait=False)


def read_links(arm: Body) -> Links:
    """Visual geometry of the robot that an arm was taken from; never fails for its sake."""
    begun: Future[Links] | None = arm.known.pop(_AHEAD, None)
    return _read_links(arm) if begun is None else begun.result()


def _read_links(arm: Body) -> Links:
    source = arm.source
    if source.xml is None:
        return Links(None)
    absent = source.mesh_notes
    try:
        whole, notes = read_geometry(source.full_model, source.xml)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        said = f"its meshes cannot be read, so a skeleton stands for it: {reason}"
        return Links(None, (*absent, said))
    notes = (*absent, *notes)
    full = source.full_model.copy()
    base = frame_index(full, source.base)
    original = make_names_unique(full)  # as `lock_joints` does
    reduced, geometry = pin.buildReducedModel(full, whole, list(source.locked), source.reference)
    named = full.frames[base].name
    base = next((i for i, f in enumerate(reduced.frames) if f.name == named), 0)
    if reduced.frames[base].parentJoint:
        _, carried = turned_round(reduced, base)
        for g in geometry.geometryObjects:
            carrier, place = carried[int(g.parentJoint)]
            g.parentJoint, g.placement = carrier, place * g.placement
        return Links(geometry, notes)
    back = base_placement(arm).inverse()
    for g in geometry.geometryObjects:
        joint = int(g.parentJoint)
        name = reduced.names[joint]
        # Joints are found again by name: the arm has them in an order of its own.
        g.parentJoint = arm.model.getJointId(original.get(name, name)) if joint else 0
        if not joint:
            g.placement = back * g.placement
    return Links(geometry, notes)


def base_placement(arm: Body, full_q: Array | None = None) -> pin.SE3:
    """Placement of the arm's base in the world of the full model.

    At its configuration ``full_q`` (nq,), or the reference: joints that are traversed backwards
    move the base there.
    """
    if arm.base == "universe":
        return pin.SE3.Identity()
    model = arm.source.full_model
    data = model.createData()
    pin.forwardKinematics(model, data, arm.source.reference if full_q is None else full_q)
    return pin.SE3(pin.updateFramePlacement(model, data, frame_index(model, arm.base)))


def draw_links(node: Any, links: Links) -> tuple[str, ...]:
    """Draw all geometry below ``node/<joint>/visual``; return what could not be drawn."""
    if links.geometry is None:
        return ()
    notes = []
    files = {Path(g.meshPath) for g in links.geometry.geometryObjects}
    found = read_meshes(sorted(file for file in files if file.suffix.lower() == ".dae"))
    for number, g in enumerate(links.geometry.geometryObjects):
        # Names of the file stay out of paths.
        here = node[f"{int(g.parentJoint)}/visual/{number}"]
        mesh = found.get(Path(g.meshPath))
        note = draw_shape(here, g, mesh.painted if isinstance(mesh, Mesh) else ())
        if note:
            notes.append(note)
            continue
        place: Array = g.placement.homogeneous @ np.diag([*g.meshScale, 1.0])
        here.set_transform(place)
    return tuple(notes)
