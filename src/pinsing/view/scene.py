"""The fixed part of a scene: the robot's meshes and shapes, and what there is to see of it.

Frames then place it. Paths: ``pinsing/arm/<joint of the model>/{visual,bone,axis,hot}``,
``pinsing/tip``, ``pinsing/ellipsoid/{translation,rotation}``,
``pinsing/lost/<number>/{arrow,ring,line}``, ``pinsing/floor``.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import umsgpack

from pinsing.description.files import ColladaProblem, image_references
from pinsing.errors import OptionError
from pinsing.kinematics.at import at
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import Array, ArrayLike, NDArray, pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.models import cut_out, frame_index, joint_axis
from pinsing.view.collada import Painted
from pinsing.view.meshes import Mesh, read_geometry

Data = dict[str, Any]
"""What three.js, or meshcat, reads as JSON."""


@dataclass(frozen=True)
class SceneNode:
    """A place in a scene of meshcat; ``send`` takes what is drawn there."""

    send: Callable[[Data], object]
    path: str

    def __getitem__(self, below: str) -> SceneNode:
        return SceneNode(self.send, f"{self.path}/{below}")

    def draw(self, *parts: Data, at: Array | None = None) -> None:
        """Show objects of three.js here, each with its geometry and material inside it."""
        lists: Data = {"geometry": [], "material": []}
        objects = []
        for k, part in enumerate(parts):
            here = {"uuid": f"{self.path} {k}", **part}
            for kind in lists.keys() & part.keys():
                here[kind] = f"{self.path} {k} {kind}"
                lists[kind].append({**part[kind], "uuid": here[kind]})
            objects.append(here)
        whole = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": lists["geometry"],
            "materials": lists["material"],
            "object": {"type": "Group", "children": objects} if objects[1:] else objects[0],
        }
        self.send({"type": "set_object", "path": self.path, "object": whole})
        if at is not None:
            self.move(at)

    def move(self, placement: Array) -> None:
        """Place all that is here, (4, 4)."""
        matrix = placement.T.ravel().tolist()
        self.send({"type": "set_transform", "path": self.path, "matrix": matrix})

    def show(self, visible: bool) -> None:
        """Show all that is here, or hide it."""
        seen = {"property": "visible", "value": visible}
        self.send({"type": "set_property", "path": self.path, **seen})

    def delete(self) -> None:
        """Take away all that is here."""
        self.send({"type": "delete", "path": self.path})


class Recorder:
    """Keeps what is drawn below its ``root``: (where, command as msgpack) in order."""

    def __init__(self) -> None:
        self.commands: list[tuple[str, bytes]] = []
        self.root = SceneNode(
            lambda one: self.commands.append((one["path"], umsgpack.packb(one))), ""
        )

    def parts(self) -> tuple[bytes, bytes]:
        """Return commands to show at once, and link shapes, which are large."""
        # Each after its length as 4 bytes, little endian.
        parts = bytearray(), bytearray()
        for path, command in self.commands:
            parts["/visual/" in path].extend(len(command).to_bytes(4, "little") + command)
        return bytes(parts[0]), bytes(parts[1])


def painted(shape: Data, color: float, **more: Any) -> Data:
    """A shape in a colour, 0xrrggbb."""
    return {**shape, "material": {"type": "MeshPhongMaterial", "color": color, **more}}


# Of closed shapes three.js draws the outside alone: each other way of painting is one more program
# that a graphics card has to be given before the first picture.
BOTH_SIDES = 2


def _shape(geometry: str, **sizes: Any) -> Data:
    return {"type": "Mesh", "geometry": {"type": geometry, **sizes}}


def _box(x: float, y: float, z: float) -> Data:
    return _shape("BoxGeometry", width=x, height=y, depth=z)


def _ball(radius: float, around: int = 20, down: int = 20) -> Data:
    return _shape("SphereGeometry", radius=radius, widthSegments=around, heightSegments=down)


def rod(height: float, radius: float, top: float | None = None) -> Data:
    """A cylinder along z, metres; a cone with another radius on ``top``."""
    radii = {"radiusTop": radius if top is None else top, "radiusBottom": radius}
    shape = _shape("CylinderGeometry", **radii, height=height, radialSegments=50)
    # three.js draws it along y.
    return {**shape, "matrix": [1.0, 0, 0, 0, 0, 0, 1.0, 0, 0, -1.0, 0, 0, 0, 0, 0, 1.0]}


def ring(radius: float, tube: float) -> Data:
    """A ring about z, metres."""
    return _shape("TorusGeometry", radius=radius, tube=tube, radialSegments=12, tubularSegments=64)


_ARRAYS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32")
"""Types of numbers, in the order of their types in msgpack."""


def _numbers(kind: str, data: bytes) -> umsgpack.Ext:
    return umsgpack.Ext(17 + _ARRAYS.index(kind), data)


def _array(values: NDArray[Any], columns: int) -> Data:
    kind, little = values.dtype.name, values.astype(values.dtype.newbyteorder("<"), copy=False)
    return {
        "itemSize": columns,
        "type": f"{kind.capitalize()}Array",
        "array": _numbers(kind, little.tobytes()),
        "normalized": False,
    }


def _points(faces: NDArray[Any] | None = None, **columns: NDArray[Any]) -> Data:
    """Points out of arrays (n, k) of their positions, normals; triangles (m, 3) between them."""
    data: Data = {"attributes": {name: _array(x, x.shape[1]) for name, x in columns.items()}}
    index = {} if faces is None else {"index": _array(faces, 1)}
    return _shape("BufferGeometry", data=data | index)


def _lines(kind: str, points: Array, color: int) -> Data:
    """A ``Line`` through points (n, 3), or ``LineSegments`` between pairs of them."""
    shape = _points(position=points.astype(np.float32))
    return {**painted(shape, color, type="LineBasicMaterial"), "type": kind}


_PLAIN: dict[type, Callable[[Any], Data]] = {
    coal.Box: lambda box: _box(*(2.0 * float(x) for x in box.halfSide)),
    coal.Sphere: lambda ball: _ball(float(ball.radius)),
    coal.Cylinder: lambda one: rod(2.0 * float(one.halfLength), float(one.radius)),
}


def _parts(shape: pin.GeometryObject, mesh: Mesh | None) -> list[Data]:
    """A visual shape of a robot, or its mesh; ValueError or OSError if it cannot be shown."""
    r, g, b = (min(255, max(0, int(255 * float(x)))) for x in shape.meshColor[:3])
    opacity = float(shape.meshColor[3])
    look: Data = {"color": r << 16 | g << 8 | b, "transparent": opacity != 1.0, "opacity": opacity}
    look["side"] = BOTH_SIDES
    if mesh:
        return [_surface(part, look) for part in mesh]
    file, form = Path(shape.meshPath), shape.geometry
    kind = "" if mesh is None else file.suffix.lower()
    if kind == ".dae":
        text = file.read_text(encoding="utf-8", errors="replace")
        whole = {"format": "dae", "data": text, "resources": _textures(file)}
        return [{"type": "_meshfile_object", **whole}]
    if kind == ".obj":
        text = file.read_text(encoding="utf-8", errors="replace")
        drawn = _shape("_meshfile", format="obj", data=text)
    elif kind == ".stl":
        drawn = _shape("_meshfile", format="stl", data=_numbers("uint8", file.read_bytes()))
    elif type(form) in _PLAIN:
        drawn = _PLAIN[type(form)](form)
    else:
        raise ValueError(f"it is a {type(form).__name__}")
    return [painted(drawn, **look)]


_LOOK = ("color", "specular", "emissive", "shininess", "opacity")


def _surface(part: Painted, look: Data) -> Data:
    """Triangles of a mesh file, with its own paint or ``look``."""
    columns = {"position": part.vertices, "normal": part.normals}
    if not len(part.normals):  # three.js makes them
        columns.pop("normal")
    x, y, z, step = part.place.tolist()
    matrix = [step, 0, 0, 0, 0, step, 0, 0, 0, 0, step, 0, x, y, z, 1]
    if len(part.paint):
        look = {"side": BOTH_SIDES, **dict(zip(_LOOK, part.paint.tolist(), strict=True))}
        look["transparent"] = look["opacity"] < 1.0
    return {**painted(_points(part.faces, **columns), **look), "matrix": matrix}


_IMAGES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


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
    model = source.full_model
    moving = set(range(1, model.njoints)).difference(source.locked)
    cut, carried = cut_out(model, moving, source.reference, frame_index(model, source.base))
    for g in whole.geometryObjects:
        joint, place = carried[int(g.parentJoint)]
        # Joints are found again by name: a mechanism has them in an order of its own.
        g.parentJoint = arm.model.getJointId(cut.names[joint]) if joint else 0
        g.placement = place * g.placement
    return Links(whole, notes, meshes)


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


def draw_links(node: SceneNode, links: Links) -> tuple[str, ...]:
    """Draw all geometry below ``node/<joint>/visual``; return what could not be drawn."""
    notes = []
    for number, g in enumerate(links.geometry.geometryObjects if links.geometry else ()):
        try:
            parts = _parts(g, links.meshes.get(Path(g.meshPath)))
        except (OSError, ValueError, ColladaProblem) as error:
            said = " ".join(str(error).split())
            notes.append(f"the shape {g.name!r} is not drawn: {said}")
            continue
        # Names of the file stay out of paths.
        place = g.placement.homogeneous @ np.diag([*g.meshScale, 1.0])
        node[f"{int(g.parentJoint)}/visual/{number}"].draw(*parts, at=place)
    return tuple(notes)


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

_DISC = np.linspace(0.0, 2 * np.pi, 65)


def draw_scene(
    root: SceneNode, arm: Arm | Mechanism, links: Links, size: Sizes, ends: Sequence[int]
) -> tuple[str, ...]:
    """Draw all below a scene's ``root``, bones to ``ends`` (frames) too; return notes."""
    node, reach = root["pinsing"], size.reach
    notes = draw_links(node["arm"], links)
    _skeleton(node["arm"], arm, reach, ends)
    _axes(node["arm"], arm, reach)
    _ellipsoid(node["ellipsoid/translation"], TRANSLATION)
    _ellipsoid(node["ellipsoid/rotation"], ROTATION)
    for k in range(ARROWS):
        straight_arrow(node[f"lost/{k}/arrow"], reach)
        ring_arrow(node[f"lost/{k}/ring"], reach)
        faint = {"type": "MeshBasicMaterial", "opacity": 0.64, "transparent": True}
        node[f"lost/{k}/line"].draw(painted(rod(4 * reach, 0.0012 * reach), LOST, **faint))
    node["tip"].draw(painted(_ball(0.012 * reach, 48, 32), 0x111827))
    _floor(node["floor"], arm, reach)
    return (*links.notes, *notes)


def _ellipsoid(node: SceneNode, color: int) -> None:
    """Unit sphere with its three principal circles: they show a disc even edge on."""
    clear = {"side": BOTH_SIDES, "opacity": 0.38, "transparent": True, "depthWrite": False}
    node["skin"].draw(painted(_ball(1.0, 48, 32), color, **clear))
    c, s, o = np.cos(_DISC), np.sin(_DISC), np.zeros_like(_DISC)
    darker = sum(int(0.6 * (color >> part & 255)) << part for part in (0, 8, 16))
    for name, circle in (("xy", (c, s, o)), ("yz", (o, c, s)), ("zx", (s, o, c))):
        node[name].draw(_lines("Line", np.transpose(circle), darker))


def straight_arrow(node: SceneNode, reach: float, color: int = LOST) -> None:
    """Double arrow along z: translations both ways."""
    half = 0.22 * reach
    node["shaft"].draw(painted(rod(2 * half, 0.0045 * reach), color))
    _heads(node, reach, half + 0.0225 * reach, 0.045, color)


def _heads(node: SceneNode, reach: float, height: float, length: float, color: int) -> None:
    """Heads of a double arrow along z, their middles at this height."""
    sizes = length * reach, 0.014 * reach
    for name, sign, cone in (
        ("up", 1.0, rod(*sizes, 0.0)),
        ("down", -1.0, rod(sizes[0], 0.0, sizes[1])),
    ):
        node[name].draw(painted(cone, color), at=raised(sign * height))


def ring_arrow(node: SceneNode, reach: float, color: int = LOST) -> None:
    """Axis along z with a ring around it: rotations about it."""
    node["shaft"].draw(painted(rod(0.34 * reach, 0.0035 * reach), color))
    node["ring"].draw(painted(ring(0.085 * reach, 0.0045 * reach), color))
    for k in range(2):
        spin = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi * k), np.zeros(3)).homogeneous
        lie = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.array([0.085 * reach, 0, 0]))
        head = painted(rod(0.04 * reach, 0.014 * reach, 0.0), color)
        node[f"head{k}"].draw(head, at=spin @ lie.homogeneous)


def _axes(node: SceneNode, arm: Arm | Mechanism, reach: float) -> None:
    """Each joint axis twice: plain, and highlighted for when it is dependent."""
    for j in range(1, arm.model.njoints):
        axis, slides = joint_axis(arm.model.joints[j], arm.model.names[j])
        for name, color, length, radius in (
            ("axis", AXIS, 0.15, 0.002),
            ("hot", HOT, 0.42, 0.0025),
        ):
            here = node[f"{j}/{name}"]
            here.move(along(axis))
            here["rod"].draw(painted(rod(length * reach, radius * reach), color))
            if slides:  # heads tell a sliding direction from a turning axis
                _heads(here, reach, length * reach / 2, 0.04, color)


def _skeleton(node: SceneNode, arm: Arm | Mechanism, reach: float, frames: Sequence[int]) -> None:
    """Drums at the joints, and bones from each to the next and to the frames."""
    model = arm.model
    ends = zip(*map(np.ndarray.tolist, arm.space.span), strict=True)
    ranges = dict(zip(arm.joints, ends, strict=True))
    bones = [(int(model.parents[j]), model.jointPlacements[j]) for j in range(1, model.njoints)]
    last = [model.frames[i] for i in frames]
    bones += [(int(frame.parentJoint), frame.placement) for frame in last]
    for number, (parent, place) in enumerate(bones):
        length = float(np.linalg.norm(place.translation))
        if length > 1e-3 * reach:
            bone = painted(rod(length, 0.018 * reach), BONE)
            middle = along(place.translation / length, place.translation / 2)
            node[f"{parent}/bone/link{number}"].draw(bone, at=middle)
    side = 0.05 * reach
    for j in range(1, model.njoints):
        axis, slides = joint_axis(model.joints[j], model.names[j])
        drum = _box(side, side, 2 * side) if slides else rod(0.075 * reach, 0.03 * reach)
        node[f"{j}/bone/drum"].draw(painted(drum, DRUM), at=along(axis))
        if slides:  # the rail that it runs on stays with the link before
            lower, upper = ranges.get(model.names[j], (0.0, 0.0))
            middle = along(axis, axis * (upper + lower) / 2)
            rail = painted(rod(max(upper - lower, side), 0.012 * reach), BONE)
            here = node[f"{int(model.parents[j])}/bone/rail{j}"]
            here.draw(rail, at=model.jointPlacements[j].homogeneous @ middle)


def _floor(node: SceneNode, arm: Arm | Mechanism, reach: float) -> None:
    """A square grid under the base, or under the feet of the robot that carries the arm."""
    half = 10
    step = float(f"{2.4 * reach / half:.1g}")
    lines = [
        end
        for k in range(-half, half + 1)
        for end in ([k, -half, 0], [k, half, 0], [-half, k, 0], [half, k, 0])
    ]
    grid = _lines("LineSegments", step * np.array(lines), FLOOR)
    node.draw(grid, at=floor_placement(arm))


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
        where = SceneNode(
            lambda command: root.window.send(SimpleNamespace(lower=lambda: command)),
            root.path.lower().rstrip("/"),
        )
        draw_scene(where, arm, Links(None), size, [arm.tip_id])
        self._node = where["pinsing"]
        self._node.move(base_placement(arm).homogeneous)
        self._node["floor"].show(False)
        for j in range(arm.model.njoints):
            self._node[f"arm/{j}/bone"].show(self._model is None)

    def show(self, q: Array, mode: str) -> None:
        """Place everything as at q (n,); ``mode`` is "pure" or "all" motions."""
        arm, node, state = self._arm, self._node, at(self._arm, q)
        self._move_robot(q)
        hot = {arm.joints[i] for d in state.dependences for i in d.indices}
        data = arm.model.createData()
        pin.forwardKinematics(arm.model, data, arm.model_q(q))
        for j in range(1, arm.model.njoints):
            here = node[f"arm/{j}"]
            here.move(data.oMi[j].homogeneous)
            here["axis"].show(arm.model.names[j] not in hot)
            here["hot"].show(arm.model.names[j] in hot)
        tip = state.tip_position
        node["tip"].move(pin.SE3(np.eye(3), tip).homogeneous)
        shapes: tuple[Any, ...] = (state.translational, state.rotational)
        shapes = pure_ellipsoids(state.J) if mode == "pure" else shapes
        for kind, shape in zip(("translation", "rotation"), shapes, strict=True):
            drawn = drawn_radii(shape.radii, getattr(self._size, kind), self._size.reach)
            node[f"ellipsoid/{kind}"].show(bool(drawn[0] > 0))
            if drawn[0] > 0:
                pose = pin.SE3(shape.axes, tip).homogeneous @ np.diag([*drawn, 1.0])
                node[f"ellipsoid/{kind}"].move(pose)
        for k in range(ARROWS):
            lost = state.lost[k] if k < len(state.lost) else None
            close = lost is not None and (
                np.linalg.norm(lost.point - tip) <= 1.5 * self._size.reach
            )
            for part, kinds in SYMBOLS.items():
                seen = lost is not None and bool(close) and lost.kind in kinds
                node[f"lost/{k}/{part}"].show(seen)
            if lost is not None:
                node[f"lost/{k}"].move(along(lost.direction, lost.point))

    def _move_robot(self, q: Array) -> None:
        if self._display is None or self._model is None:
            return
        arm, model = self._arm, self._model
        if list(model.names) == list(arm.model.names):
            self._display(arm.model_q(q))
        elif list(model.names) == list(arm.source.full_model.names):
            full = full_configuration(arm, q)
            self._display(full)
            self._node.move(base_placement(arm, full).homogeneous)


def full_configuration(arm: Arm, q: Array) -> Array:
    """Configuration of the model before joints were locked."""
    full, values = arm.source.full_model, arm.model_q(q)
    out: Array = np.array(arm.source.reference)
    for j in range(1, arm.model.njoints):
        here = arm.model.joints[j]
        there = full.joints[full.getJointId(arm.model.names[j])]
        out[there.idx_q : there.idx_q + there.nq] = values[here.idx_q : here.idx_q + here.nq]
    return out
