"""The robot itself: its meshes and shapes, joint by joint of the reduced model."""

from __future__ import annotations

import base64
import importlib
import re
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import umsgpack

from pinsing.description.ros_packages import ColladaProblem, image_references
from pinsing.measures import Array
from pinsing.robot.arm import Arm
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.models import frame_index, lock_joints, turned_round
from pinsing.view.collada import Painted, as_object
from pinsing.view.meshes import Mesh, read_geometry


def _import_meshcat() -> Any:
    if "IPython" in sys.modules or "meshcat" in sys.modules:
        return importlib.import_module("meshcat")
    package, display = ModuleType("IPython"), ModuleType("IPython.display")
    package.display = display  # type: ignore[attr-defined]
    display.HTML = lambda *args: importlib.import_module("IPython.display").HTML(*args)  # type: ignore[attr-defined]
    stand_ins = {module.__name__: module for module in (package, display)}
    sys.modules.update(stand_ins)
    try:
        return importlib.import_module("meshcat")
    finally:
        for name, module in stand_ins.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]


meshcat: Any = _import_meshcat()
geometry: Any = meshcat.geometry


_SHAPES = re.compile(r"/arm/\d+/visual/")


class Recorder:
    """Takes what `meshcat.Visualizer` sends: (where, command as msgpack) in order."""

    def __init__(self) -> None:
        self.commands: list[tuple[str, bytes]] = []

    def send(self, command: Any) -> None:
        """Keep a command."""
        lowered = command.lower()
        self.commands.append((str(lowered.get("path", "")), umsgpack.packb(lowered)))

    def visualizer(self) -> Any:
        """A meshcat visualizer at the root that draws into this recorder."""
        return meshcat.Visualizer.view_into(self, meshcat.path.Path(()))

    def parts(self) -> tuple[bytes, bytes]:
        """Return commands to show at once, and link shapes, which are large."""
        # Each after its length as 4 bytes, little endian.
        parts = bytearray(), bytearray()
        for path, command in self.commands:
            later = _SHAPES.search(path) is not None
            parts[later].extend(len(command).to_bytes(4, "little") + command)
        return bytes(parts[0]), bytes(parts[1])


_IMAGES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


class DrawnRod(geometry.Cylinder):  # type: ignore[misc]
    """A cylinder or cone along z, which three.js draws along y."""

    def intrinsic_transform(self) -> Array:
        """Turn of the drawn cylinder, (4, 4)."""
        # Rows and columns are swapped on the way to the page.
        return np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])


class _Collada(geometry.ReferenceSceneElement):  # type: ignore[misc]
    """A Collada file: its triangles; with its textures, as it is, where it is not plain."""

    def __init__(self, file: Path, parts: Sequence[Painted]) -> None:
        super().__init__()
        self.path: Any = None
        if parts:
            self.content = as_object(parts)
            return
        self.content = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [],
            "materials": [],
            "object": {
                "uuid": self.uuid,
                "type": "_meshfile_object",
                "format": "dae",
                "data": file.read_text(encoding="utf-8", errors="replace"),
                "resources": _textures(file),
                "matrix": np.eye(4).ravel().tolist(),
            },
        }

    def lower(self) -> dict[str, Any]:
        return {"type": "set_object", "path": self.path.lower(), "object": self.content}


def draw_shape(node: Any, shape: pin.GeometryObject, mesh: Mesh | None) -> str:
    """Draw one shape, or its mesh, at a meshcat node; return why it cannot be, empty if it is."""
    try:
        made = _made(shape, mesh)
    except (OSError, ValueError, ColladaProblem) as error:
        return f"the shape {shape.name!r} is not drawn: {' '.join(str(error).split())}"
    material = geometry.MeshPhongMaterial(color=_color(shape.meshColor))
    if float(shape.meshColor[3]) != 1.0:
        material.transparent, material.opacity = True, float(shape.meshColor[3])
    if isinstance(made, _Collada):
        made.path = node.path
        node.window.send(made)
    else:
        node.set_object(made, material)
    return ""


def _made(shape: pin.GeometryObject, mesh: Mesh | None) -> Any:
    form = shape.geometry
    if mesh is not None:
        return _mesh(Path(shape.meshPath), mesh)
    if isinstance(form, coal.Box):
        return geometry.Box([2.0 * float(x) for x in form.halfSide])
    if isinstance(form, coal.Sphere):
        return geometry.Sphere(float(form.radius))
    if isinstance(form, coal.Cylinder):
        return DrawnRod(2.0 * float(form.halfLength), float(form.radius))
    raise ValueError(f"it is a {type(form).__name__}")


def _mesh(file: Path, mesh: Mesh) -> Any:
    kind = file.suffix.lower()
    if kind == ".dae":
        return _Collada(file, mesh.painted)
    if kind == ".obj":
        return geometry.MeshGeometry(file.read_text(encoding="utf-8", errors="replace"), "obj")
    if kind == ".stl":
        return geometry.StlMeshGeometry.from_file(str(file))
    return geometry.TriangularMeshGeometry(
        mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)
    )


def _color(rgba: Array) -> int:
    r, g, b = (min(255, max(0, int(255 * float(x)))) for x in rgba[:3])
    return r << 16 | g << 8 | b


def _textures(file: Path) -> dict[str, str]:
    """Images that a Collada file names, as data addresses; only real images from beside it."""
    home = file.resolve().parent.parent
    out = {}
    for name in image_references(file):
        image = (file.parent / name.removeprefix("file://")).resolve()
        known = image.is_relative_to(home) and image.is_file()
        data = image.read_bytes() if known and image.stat().st_size <= 32 * 2**20 else b""
        kind = next((k for start, k in _IMAGES.items() if data.startswith(start)), None)
        if kind is not None:
            out[name] = f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return out


_AHEAD = "links that are being read"


@dataclass(frozen=True)
class Links:
    """Visual geometry of a robot."""

    # parents in ``arm.model``; fixed shapes in the base of the arm
    geometry: pin.GeometryModel | None
    notes: tuple[str, ...] = ()  # what is missing, forbidden, or cannot be read
    meshes: dict[Path, Mesh] = field(default_factory=dict)

    def bare(self, arm: Arm | Mechanism) -> tuple[int, ...]:
        """Joints of the model that nothing is attached to."""
        if self.geometry is None:
            return tuple(range(1, arm.model.njoints))
        dressed = {int(g.parentJoint) for g in self.geometry.geometryObjects}
        return tuple(j for j in range(1, arm.model.njoints) if j not in dressed)


def read_links_ahead(arm: Arm | Mechanism) -> None:
    """Begin `read_links` in a thread, while something else is computed."""
    if _AHEAD not in arm.known:
        pool = ThreadPoolExecutor(1, thread_name_prefix="pinsing meshes")
        arm.known[_AHEAD] = pool.submit(_read_links, arm)
        pool.shutdown(wait=False)


def read_links(arm: Arm | Mechanism) -> Links:
    """Visual geometry of the robot that an arm was taken from; never fails for its sake."""
    begun: Future[Links] | None = arm.known.pop(_AHEAD, None)
    return _read_links(arm) if begun is None else begun.result()


def _read_links(arm: Arm | Mechanism) -> Links:
    source = arm.source
    if source.xml is None:
        return Links(None)
    absent = source.mesh_notes
    try:
        whole, meshes, notes = read_geometry(source.full_model, source.xml)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        said = f"its meshes cannot be read, so a skeleton stands for it: {reason}"
        return Links(None, (*absent, said))
    notes = (*absent, *notes)
    where = source.full_model, source.locked, source.reference
    reduced, geometry = lock_joints(*where, whole)
    base = frame_index(reduced, source.base)
    if reduced.frames[base].parentJoint:
        _, carried = turned_round(reduced, base)
        for g in geometry.geometryObjects:
            carrier, place = carried[int(g.parentJoint)]
            g.parentJoint, g.placement = carrier, place * g.placement
        return Links(geometry, notes, meshes)
    back = base_placement(arm).inverse()
    for g in geometry.geometryObjects:
        joint = int(g.parentJoint)
        # Joints are found again by name: the arm has them in an order of its own.
        g.parentJoint = arm.model.getJointId(reduced.names[joint]) if joint else 0
        if not joint:
            g.placement = back * g.placement
    return Links(geometry, notes, meshes)


def base_placement(arm: Arm | Mechanism, full_q: Array | None = None) -> pin.SE3:
    """Return the base of the arm in the full model's world, at ``full_q`` (nq,) or the reference.

    Joints that are traversed backwards move it. That of a mechanism is the root of its tree.
    """
    if isinstance(arm, Mechanism) or arm.base == "universe":
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
    for number, g in enumerate(links.geometry.geometryObjects):
        # Names of the file stay out of paths.
        here = node[f"{int(g.parentJoint)}/visual/{number}"]
        notes.append(draw_shape(here, g, links.meshes.get(Path(g.meshPath))))
        if not notes[-1]:
            here.set_transform(g.placement.homogeneous @ np.diag([*g.meshScale, 1.0]))
    return tuple(filter(None, notes))
