"""The fixed part of a scene: the robot's meshes and shapes, and what there is to see of it.

Frames then place it. Paths: ``pinsing/arm/<joint of the model>/{visual,bone,axis,hot}``,
``pinsing/tip``, ``pinsing/ellipsoid/{translation,rotation}``,
``pinsing/lost/<number>/{arrow,ring,line}``, ``pinsing/floor``.
"""

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

from pinsing.description.files import ColladaProblem, image_references
from pinsing.errors import OptionError
from pinsing.kinematics.at import at
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import Array, ArrayLike, pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.models import frame_index, joint_axis, lock_joints, turned_round
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


ARROWS = 3
"""Lost motions drawn at most."""

FLATTEST = 0.012
"""Drawn semi-axes are at least this share of the largest: an exact zero would vanish."""

LEAST = 0.006
"""And at least this share of the reach: a disc or a line of a small arm would be a sliver."""

SLIM = 0.1
"""But for its sake no more than this share of the largest: what is flat is to look flat."""


@dataclass(frozen=True)
class Sizes:
    """How large things are drawn; one choice per arm, so that poses can be compared."""

    reach: float  # length of the stretched arm, metres
    translation: float  # metres drawn for 1 m/s
    rotation: float  # metres drawn for 1 rad/s


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
    thinnest = max(FLATTEST * largest, min(LEAST * reach, SLIM * largest))
    return np.asarray(np.maximum(scale * radii, thinnest))


def along(direction: Array, position: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """A transform (4, 4) to a position, with the shortest turn from z to a unit vector (3,)."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.asarray(direction))
    return np.array(pin.SE3(turn.matrix(), np.array(position, dtype=float)).homogeneous)


# Okabe and Ito's palette: told apart with any colour vision.
TRANSLATION = 0x0072B2
ROTATION = 0xE69F00
LOST = 0xC4187C
HOT = 0xD55E00
AXIS = 0x6B7280
BONE = 0x9AA5B1
DRUM = 0x5B6673
FLOOR = 0xC9D1D9

# Of closed shapes three.js draws the outside alone: each other way of painting is one more program
# that a graphics card has to be given before the first picture.
OUTSIDE = 0

_DISC = np.linspace(0.0, 2 * np.pi, 65)


class _Sphere(geometry.Sphere):  # type: ignore[misc]
    """A sphere smooth enough to be stretched."""

    def lower(self, object_data: Any) -> dict[str, Any]:
        data: dict[str, Any] = super().lower(object_data)
        return {**data, "widthSegments": 48, "heightSegments": 32}


def draw_scene(
    root: Any, arm: Arm | Mechanism, links: Links, size: Sizes, ends: Sequence[int]
) -> tuple[str, ...]:
    """Draw all below meshcat's ``root``, bones to ``ends`` (frames) too; return notes."""
    node = root["pinsing"]
    notes = draw_links(node["arm"], links)
    _skeleton(node["arm"], arm, size.reach, ends)
    _axes(node["arm"], arm, size.reach)
    _ellipsoid(node["ellipsoid/translation"], TRANSLATION)
    _ellipsoid(node["ellipsoid/rotation"], ROTATION)
    for k in range(ARROWS):
        straight_arrow(node[f"lost/{k}/arrow"], size.reach)
        ring_arrow(node[f"lost/{k}/ring"], size.reach)
        line = DrawnRod(4 * size.reach, 0.0012 * size.reach)
        faint = geometry.MeshBasicMaterial(color=LOST, opacity=0.64, side=OUTSIDE)
        node[f"lost/{k}/line"].set_object(line, faint)
    tip = _Sphere(0.012 * size.reach)
    node["tip"].set_object(tip, geometry.MeshPhongMaterial(color=0x111827, side=OUTSIDE))
    _floor(node["floor"], arm, size.reach)
    return (*links.notes, *notes)


def _ellipsoid(node: Any, color: int) -> None:
    """Unit sphere with its three principal circles: they show a disc even edge on."""
    skin = geometry.MeshPhongMaterial(color=color, opacity=0.38, transparent=True, depthWrite=False)
    node["skin"].set_object(_Sphere(1.0), skin)
    c, s, o = np.cos(_DISC), np.sin(_DISC), np.zeros_like(_DISC)
    darker = sum(int(0.6 * (color >> part & 255)) << part for part in (0, 8, 16))
    for name, circle in (("xy", (c, s, o)), ("yz", (o, c, s)), ("zx", (s, o, c))):
        points = np.array(circle, dtype=np.float32)
        material = geometry.LineBasicMaterial(color=darker, side=OUTSIDE)
        node[name].set_object(geometry.Line(geometry.PointsGeometry(points), material))


def straight_arrow(node: Any, reach: float, color: int = LOST) -> None:
    """Double arrow along z: translations both ways."""
    material = geometry.MeshPhongMaterial(color=color, side=OUTSIDE)
    half, head = 0.22 * reach, 0.045 * reach
    node["shaft"].set_object(DrawnRod(2 * half, 0.0045 * reach), material)
    for name, sign in (("up", 1.0), ("down", -1.0)):
        node[name].set_object(_cone(head, 0.014 * reach, sign), material)
        node[name].set_transform(raised(sign * (half + head / 2)))


def ring_arrow(node: Any, reach: float, color: int = LOST) -> None:
    """Axis along z with a ring around it: rotations about it."""
    material = geometry.MeshPhongMaterial(color=color, side=OUTSIDE)
    node["shaft"].set_object(DrawnRod(0.34 * reach, 0.0035 * reach), material)
    node["ring"].set_object(Torus(0.085 * reach, 0.0045 * reach), material)
    for k in range(2):
        spin = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi * k), np.zeros(3)).homogeneous
        lie = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.array([0.085 * reach, 0, 0]))
        node[f"head{k}"].set_object(_cone(0.04 * reach, 0.014 * reach, 1.0), material)
        node[f"head{k}"].set_transform(spin @ lie.homogeneous)


def _cone(height: float, radius: float, sign: float) -> DrawnRod:
    top, bottom = (0.0, radius) if sign > 0 else (radius, 0.0)
    return DrawnRod(height, radiusTop=top, radiusBottom=bottom)


class Torus(geometry.Geometry):  # type: ignore[misc]
    """A ring about z, metres, which three.js makes."""

    def __init__(self, radius: float, tube: float) -> None:
        super().__init__()
        self.size = {"radius": radius, "tube": tube}

    def lower(self, object_data: Any) -> dict[str, Any]:
        """What three.js reads."""
        segments = {"radialSegments": 12, "tubularSegments": 64}
        return {"uuid": self.uuid, "type": "TorusGeometry", **self.size, **segments}


def _axes(node: Any, arm: Arm | Mechanism, reach: float) -> None:
    """Each joint axis twice: plain, and highlighted for when it is dependent."""
    for j in range(1, arm.model.njoints):
        axis, slides = joint_axis(arm.model.joints[j], arm.model.names[j])
        turn = along(axis)
        for name, color, length, radius in (
            ("axis", AXIS, 0.15, 0.002),
            ("hot", HOT, 0.42, 0.0025),
        ):
            material = geometry.MeshPhongMaterial(color=color, side=OUTSIDE)
            here = node[f"{j}/{name}"]
            here.set_transform(turn)
            here["rod"].set_object(DrawnRod(length * reach, radius * reach), material)
            if slides:  # heads tell a sliding direction from a turning axis
                for side, sign in (("up", 1.0), ("down", -1.0)):
                    here[side].set_object(_cone(0.04 * reach, 0.014 * reach, sign), material)
                    here[side].set_transform(raised(sign * length * reach / 2))


def _skeleton(node: Any, arm: Arm | Mechanism, reach: float, frames: Sequence[int]) -> None:
    """Drums at the joints, and bones from each to the next and to the frames."""
    model = arm.model
    ends = zip(*map(np.ndarray.tolist, arm.space.span), strict=True)
    ranges = dict(zip(arm.joints, ends, strict=True))
    bone = geometry.MeshPhongMaterial(color=BONE, side=OUTSIDE)
    drum = geometry.MeshPhongMaterial(color=DRUM, side=OUTSIDE)
    bones = [(int(model.parents[j]), model.jointPlacements[j]) for j in range(1, model.njoints)]
    last = [model.frames[i] for i in frames]
    bones += [(int(frame.parentJoint), frame.placement) for frame in last]
    for number, (parent, place) in enumerate(bones):
        length = float(np.linalg.norm(place.translation))
        if length > 1e-3 * reach:
            here = node[f"{parent}/bone/link{number}"]
            here.set_object(DrawnRod(length, 0.018 * reach), bone)
            here.set_transform(along(place.translation / length, place.translation / 2))
    for j in range(1, model.njoints):
        axis, slides = joint_axis(model.joints[j], model.names[j])
        here = node[f"{j}/bone/drum"]
        side = 0.05 * reach
        shape = (
            geometry.Box([side, side, 2 * side])
            if slides
            else DrawnRod(0.075 * reach, 0.03 * reach)
        )
        here.set_object(shape, drum)
        here.set_transform(along(axis))
        if slides:  # the rail that it runs on stays with the link before
            lower, upper = ranges.get(model.names[j], (0.0, 0.0))
            start = model.jointPlacements[j]
            rail = node[f"{int(model.parents[j])}/bone/rail{j}"]
            rail.set_object(DrawnRod(max(upper - lower, side), 0.012 * reach), bone)
            rail.set_transform(start.homogeneous @ along(axis, axis * (upper + lower) / 2))


def _floor(node: Any, arm: Arm | Mechanism, reach: float) -> None:
    """A square grid under the base, or under the feet of the robot that carries the arm."""
    half = 10
    step = float(f"{2.4 * reach / half:.1g}")
    lines = [
        end
        for k in range(-half, half + 1)
        for end in ([k, -half, 0], [k, half, 0], [-half, k, 0], [half, k, 0])
    ]
    points = (step * np.array(lines, dtype=np.float32)).T
    material = geometry.LineBasicMaterial(color=FLOOR, side=OUTSIDE)
    node.set_object(geometry.LineSegments(geometry.PointsGeometry(points), material))
    node.set_transform(floor_placement(arm))


def floor_placement(arm: Arm | Mechanism) -> Array:
    """Where the ground is, (4, 4) in the base: the world's z = 0, or lower where links are."""
    model, back = arm.source.full_model, base_placement(arm).inverse()
    data = model.createData()
    pin.forwardKinematics(model, data, arm.source.reference)
    fixed = [data.oMi[j].translation[2] for j in range(1, model.njoints)]
    chain = set(arm.model.names)
    others = [z for z, name in zip(fixed, list(model.names)[1:], strict=True) if name not in chain]
    place = pin.SE3(np.eye(3), np.array([*(back.inverse().translation[:2]), min([0.0, *others])]))
    return np.array((back * place).homogeneous)


def raised(height: float) -> Array:
    """A transform (4, 4) along z, metres."""
    return along(np.array([0.0, 0.0, 1.0]), (0.0, 0.0, height))


SYMBOLS = {
    "arrow": ("translation", "line", "screw"),
    "ring": ("rotation", "screw"),
    "line": ("line", "screw"),
}
"""What each kind of lost motion is drawn as; the page does the same."""


class Overlay:
    """Keeps the node ``pinsing`` of a visualizer up to date.

    A pinocchio MeshcatVisualizer also displays the robot, if its model is the arm's or the one it
    came from; else a meshcat.Visualizer. OptionError if it is neither, or has no viewer yet.
    """

    def __init__(self, visualizer: Any, arm: Arm, size: Sizes) -> None:
        root = getattr(visualizer, "viewer", visualizer)
        OptionError.refuse_if(
            not hasattr(root, "set_transform"),
            "visualizer must be a meshcat.Visualizer, or a MeshcatVisualizer after initViewer()",
        )
        self._arm, self._size = arm, size
        self._display = getattr(visualizer, "display", None)
        self._model = getattr(visualizer, "model", None)
        draw_scene(root, arm, Links(None), size, [arm.tip_id])
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
        tip = state.tip_position
        node["tip"].set_transform(pin.SE3(np.eye(3), tip).homogeneous)
        shapes: tuple[Any, ...] = (state.translational, state.rotational)
        shapes = pure_ellipsoids(state.J) if mode == "pure" else shapes
        for kind, shape in zip(("translation", "rotation"), shapes, strict=True):
            drawn = drawn_radii(shape.radii, getattr(self._size, kind), self._size.reach)
            node[f"ellipsoid/{kind}"].set_property("visible", bool(drawn[0] > 0))
            if drawn[0] > 0:
                pose = pin.SE3(shape.axes, tip).homogeneous @ np.diag([*drawn, 1.0])
                node[f"ellipsoid/{kind}"].set_transform(pose)
        for k in range(ARROWS):
            lost = state.lost[k] if k < len(state.lost) else None
            close = lost is not None and (
                np.linalg.norm(lost.point - tip) <= 1.5 * self._size.reach
            )
            for part, kinds in SYMBOLS.items():
                seen = lost is not None and bool(close) and lost.kind in kinds
                node[f"lost/{k}/{part}"].set_property("visible", seen)
            if lost is not None:
                node[f"lost/{k}"].set_transform(along(lost.direction, lost.point))

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
