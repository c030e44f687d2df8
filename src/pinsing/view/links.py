"""The robot itself: its meshes and shapes, joint by joint of the reduced model.

Mesh files are read in a child process with limits; one that fails is left out and named.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import importlib
import io
import json
import os
import re
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import coal
import numpy as np
import pinocchio as pin
import umsgpack

from pinsing._types import Array, NDArray
from pinsing.atomic_write import write_bytes
from pinsing.description import child_jail
from pinsing.description.ros_packages import ColladaProblem, image_references
from pinsing.description.xacro import MEMORY
from pinsing.errors import PinsingError
from pinsing.robot.arm import Arm
from pinsing.robot.chains import frame_index
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.models import make_names_unique, turned_round
from pinsing.view.collada import Painted, as_object, unpacked


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


SECONDS_EACH = 20.0
"""Processor time for one mesh, which a busy machine does not use up."""
_WORKER = Path(__file__).with_name("mesh_worker.py")
_WANTED = {".dae": "paint", ".obj": "judge", ".stl": "judge"}  # go into the page as they are


@dataclass(frozen=True)
class Mesh:
    """The triangles of a mesh file; empty where the file itself goes into the page."""

    vertices: Array  # (n, 3), unit of the file
    faces: NDArray[np.int32]  # (m, 3), indices from 0
    painted: tuple[Painted, ...] = ()  # of a plain painted Collada file, by paint


def read_geometry(
    model: pin.Model, xml: str
) -> tuple[pin.GeometryModel, dict[Path, Mesh], tuple[str, ...]]:
    """Return the visual geometry of a checked URDF, its meshes, and notes on what was left out."""
    # A mesh stands as a sphere in the geometry, with its path and scale. ValueError or RuntimeError
    # if Pinocchio cannot read the URDF.
    root = ET.fromstring(xml)
    wanted: dict[str, tuple[Path, Array]] = {}
    for link in root.iter("link"):
        for number, visual in enumerate(link.findall("visual")):
            for shape in visual.findall("geometry"):
                mesh = shape.find("mesh")
                if mesh is None:
                    continue
                scale = np.array([float(x) for x in mesh.get("scale", "1 1 1").split()])
                path = Path(mesh.get("filename", "").removeprefix("file://"))
                wanted[f"{link.get('name')}_{number}"] = (path, scale)
                # Pinocchio builds everything around it.
                shape.remove(mesh)
                ET.SubElement(shape, "sphere", radius="1")
    geometry = pin.buildGeomFromUrdfString(model, ET.tostring(root, "unicode"), pin.VISUAL)
    if not wanted:
        return geometry, {}, ()
    paths = tuple(dict.fromkeys(path for path, _ in wanted.values()))
    said: list[str] = []
    found = read_meshes(paths, said.append)
    for name in [g.name for g in geometry.geometryObjects if g.name in wanted]:
        path, scale = wanted[name]
        if isinstance(found[path], str):
            geometry.removeGeometryObject(name)
            continue
        held = geometry.geometryObjects[geometry.getGeometryId(name)]
        held.meshPath, held.meshScale = str(path), scale
    meshes = {path: mesh for path, mesh in found.items() if isinstance(mesh, Mesh)}
    return geometry, meshes, (*_notes(found), *said)


def _notes(found: Mapping[Path, Mesh | str]) -> tuple[str, ...]:
    failed = [(path, problem) for path, problem in found.items() if isinstance(problem, str)]
    notes = [f"mesh {path} is not drawn: {problem}" for path, problem in failed[:3]]
    if len(failed) > 3:
        notes.append(f"{len(failed) - 3} more meshes are not drawn")
    return tuple("".join(c if c.isprintable() else "?" for c in note) for note in notes)


def read_meshes(
    paths: Sequence[Path], tell: Callable[[str], object] = lambda _: None
) -> dict[Path, Mesh | str]:
    """Return the mesh of each file, by a child process or `mesh_cache`, or what is wrong with it.

    ``tell`` gets a line on which of the kernel's walls around the child is missing.
    """
    found: dict[Path, Mesh | str] = {}
    left = []
    for path in paths:
        try:
            large = path.stat().st_size > 256 * 2**20
            if large or not path.is_file():
                found[path] = "is too large" if large else "is not a plain file"
            else:
                left.append(path)
        except OSError as error:
            found[path] = f"cannot be read: {error.strerror}"
    folder = cache_folder() if left else None
    keys = {path: key for path in left if folder and (key := content_key(path))}
    for path, key in keys.items():
        assert folder is not None
        before = kept(folder, key)
        if before is not None and (mesh := _mesh(path, *before)) is not None:
            found[path] = mesh
    left = [path for path in left if path not in found]
    missing: list[str] = []
    while left:
        done = _ask_child(left, missing)
        if len(done) == 0:  # the child did not even start
            found.update(dict.fromkeys(left, "the reader of meshes cannot be started"))
            break
        left = left[len(done) :]
        for path, answered in done.items():
            if isinstance(answered, str):
                found[path] = answered
                continue
            found[path] = _mesh(path, *answered) or "breaks its reader"
            if folder is not None and path in keys:
                keep(folder, keys[path], *answered)
    if missing:
        walls = "; ".join(dict.fromkeys(missing))
        tell(f"meshes were read without all of the kernel's walls: {walls}")
    return {path: found[path] for path in paths}


def _mesh(path: Path, first: bytes, second: bytes) -> Mesh | None:
    """A mesh of the two pieces that the child sent; None if they are something else."""
    parts: tuple[Painted, ...] | None = ()
    if path.suffix.lower() == ".dae":
        parts = unpacked(first, second) if first else ()
        first = second = b""
    if len(first) % 24 or len(second) % 12 or parts is None:
        return None
    return Mesh(
        np.frombuffer(first, dtype=np.float64).reshape(-1, 3),
        np.frombuffer(second, dtype=np.int32).reshape(-1, 3),
        parts,
    )


def _ask_child(paths: Sequence[Path], missing: list[str]) -> dict[Path, tuple[bytes, bytes] | str]:
    """Return a child's answers on the first files, the one at which it ended last."""
    # Walls that are not there are added to ``missing``.
    request = {
        "paths": [(str(path), _WANTED.get(path.suffix.lower(), "content")) for path in paths],
        "sys_path": [os.path.abspath(entry) for entry in sys.path],
        "seconds_each": SECONDS_EACH,
        "seconds": int(SECONDS_EACH) * len(paths) + 10,
        "memory": MEMORY,
    }
    try:
        child = subprocess.run(
            [sys.executable, "-I", "-B", str(_WORKER)],
            input=json.dumps(request).encode() + b"\n",
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=5 * SECONDS_EACH * len(paths),  # on the clock, whatever else runs
            check=False,
        )
        said, slow = child.stdout, child.returncode in child_jail.OUT_OF_TIME
    except subprocess.TimeoutExpired as late:
        said, slow = late.stdout or b"", True
    except OSError:
        return {}
    answers = io.BytesIO(said)
    line = answers.readline()
    if line.endswith(b"\n"):
        missing += map(str, json.loads(line)["no_wall"])
    done: dict[Path, tuple[bytes, bytes] | str] = {}
    for path in paths:
        result = _receive(answers)
        done[path] = result or (
            f"is not read within {SECONDS_EACH:g} s"
            if slow
            else "needs too much memory, or breaks its reader"
        )
        if result is None:
            break
    return done


def _receive(answers: BinaryIO) -> tuple[bytes, bytes] | str | None:
    """Return one answer of the child, None where there is none."""
    line = answers.readline(10_000)
    if not line.endswith(b"\n"):
        return None
    message = json.loads(line)
    if "problem" in message:
        return str(message["problem"])
    sizes = [int(size) for size in message["bytes"]]
    first, second = (answers.read(size) for size in sizes)
    return (first, second) if [len(first), len(second)] == sizes else None


def cache_folder() -> Path | None:
    """Return this user's folder of meshes, or ``PINSING_CACHE``; None if empty or impossible."""
    named = os.environ.get("PINSING_CACHE")
    if named == "":
        return None
    if named is not None:
        base = Path(named)
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", "~")).expanduser() / "pinsing" / "cache"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "pinsing"
    folder = base / "meshes"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except (OSError, RuntimeError):
        return None
    # What others may write is not believed.
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    shared = os.name != "nt" and bool(found.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    return folder if stat.S_ISDIR(found.st_mode) and mine and not shared else None


def content_key(path: Path) -> str:
    """Name under which a mesh file's answer is kept: of its bytes and its kind; empty for none."""
    digest = hashlib.sha256(f"4\0{path.suffix.lower()}\0".encode())  # the version of answers
    try:
        with path.open("rb") as file:
            while part := file.read(1 << 20):
                digest.update(part)
    except OSError:  # the child says what is wrong with it
        return ""
    return digest.hexdigest()


def kept(folder: Path, key: str) -> tuple[bytes, bytes] | None:
    """The two pieces of an answer that were kept; None where nothing whole is there."""
    try:
        data = (folder / key).read_bytes()
    except OSError:
        return None
    digest, body = data[:32], data[32:]
    if hashlib.sha256(body).digest() != digest:
        return None
    with contextlib.suppress(OSError):
        os.utime(folder / key)  # the longest unused go first
    count = 8 + int.from_bytes(body[:8], "little")
    return body[8:count], body[count:]


def keep(folder: Path, key: str, first: bytes, second: bytes) -> None:
    """Keep an answer; a full disk, or one that cannot be written, is no error."""
    body = len(first).to_bytes(8, "little") + first + second
    if len(body) > 64 * 2**20:
        return
    with contextlib.suppress(OSError, PinsingError):
        write_bytes(folder / key, hashlib.sha256(body).digest() + body)
        files = [(path, path.stat()) for path in folder.iterdir() if path.is_file()]
        total = sum(found.st_size for _, found in files)
        for path, found in sorted(files, key=lambda f: f[1].st_mtime):
            if total <= 512 * 2**20:
                break
            path.unlink(missing_ok=True)
            total -= found.st_size


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
    if made is None:
        kind = type(shape.geometry).__name__
        return f"the shape {shape.name!r} is not drawn: it is a {kind}"
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
        return _as_drawn(Path(shape.meshPath), mesh)
    if isinstance(form, coal.Box):
        return geometry.Box([2.0 * float(x) for x in form.halfSide])
    if isinstance(form, coal.Sphere):
        return geometry.Sphere(float(form.radius))
    if isinstance(form, coal.Cylinder):
        return DrawnRod(2.0 * float(form.halfLength), float(form.radius))
    return None


def _as_drawn(file: Path, mesh: Mesh) -> Any:
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
        return Links(geometry, notes, meshes)
    back = base_placement(arm).inverse()
    for g in geometry.geometryObjects:
        joint = int(g.parentJoint)
        name = reduced.names[joint]
        # Joints are found again by name: the arm has them in an order of its own.
        g.parentJoint = arm.model.getJointId(original.get(name, name)) if joint else 0
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
