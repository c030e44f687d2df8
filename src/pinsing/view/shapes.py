"""Shapes of links as meshcat draws them.

Pinocchio's own viewer does the same, but importing it takes a second and more (trimesh, scipy), and
it puts any file into the page that a Collada file calls its texture.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.description.collada import ColladaProblem, image_references
from pinsing.view.drawing import geometry as mg
from pinsing.view.painted import Painted, as_object

_IMAGES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
_LARGEST_IMAGE = 32 * 2**20
_AROUND = 24


class DrawnRod(mg.Cylinder):  # type: ignore[misc]
    """A cylinder or cone along z, which three.js draws along y."""

    def intrinsic_transform(self) -> Array:
        """Turn of the drawn cylinder, (4, 4)."""
        # Rows and columns are swapped on the way to the page.
        return np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])


class _Collada(mg.ReferenceSceneElement):  # type: ignore[misc]
    """A Collada file: its triangles; with its textures, as it is, where it is not plain."""

    def __init__(self, file: Path, parts: Sequence[Painted]) -> None:
        super().__init__()
        self.path: Any = None
        self.content = as_object(parts) if parts else self._as_file(file)

    def _as_file(self, file: Path) -> dict[str, Any]:
        return {
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


def draw_shape(node: Any, shape: pin.GeometryObject, parts: Sequence[Painted] = ()) -> str:
    """Draw one shape at a meshcat node; return why it cannot be drawn, empty if it is.

    ``parts`` are those of a Collada file, as far as it is plain.
    """
    try:
        made = _made(shape, parts)
    except (OSError, ValueError, ColladaProblem) as error:
        return f"the shape {shape.name!r} is not drawn: {' '.join(str(error).split())}"
    if made is None:
        kind = type(shape.geometry).__name__
        return f"the shape {shape.name!r} is not drawn: it is a {kind}"
    material = mg.MeshPhongMaterial(color=_color(shape.meshColor))
    if float(shape.meshColor[3]) != 1.0:
        material.transparent, material.opacity = True, float(shape.meshColor[3])
    if isinstance(made, _Collada):
        made.path = node.path
        node.window.send(made)
    else:
        node.set_object(made, material)
    return ""


def _made(shape: pin.GeometryObject, parts: Sequence[Painted]) -> Any:
    geometry = shape.geometry
    if isinstance(geometry, coal.Box):
        return mg.Box([2.0 * float(x) for x in geometry.halfSide])
    if isinstance(geometry, coal.Sphere):
        return mg.Sphere(float(geometry.radius))
    if isinstance(geometry, coal.Cylinder):
        return DrawnRod(2.0 * float(geometry.halfLength), float(geometry.radius))
    if isinstance(geometry, coal.Cone):
        return DrawnRod(
            2.0 * geometry.halfLength, radiusTop=0.0, radiusBottom=float(geometry.radius)
        )
    if isinstance(geometry, coal.Capsule):
        return _capsule(float(geometry.halfLength), float(geometry.radius))
    file = Path(shape.meshPath)
    kind = file.suffix.lower()
    if kind == ".dae":
        return _Collada(file, parts)
    if kind == ".obj":
        return mg.MeshGeometry(file.read_text(encoding="utf-8", errors="replace"), "obj")
    if kind == ".stl":
        return mg.StlMeshGeometry.from_file(str(file))
    if isinstance(geometry, coal.BVHModelBase) and geometry.num_vertices:
        corners = [geometry.tri_indices(k) for k in range(geometry.num_tris)]
        faces = np.array([[t[0], t[1], t[2]] for t in corners], dtype=np.uint32)
        vertices = np.array(geometry.vertices(), dtype=np.float32)
        return mg.TriangularMeshGeometry(vertices, faces)
    return None


def _capsule(half: float, radius: float) -> Any:
    """A cylinder along z with round ends: rings from pole to pole, metres."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * (_AROUND // 4) + 1)
    rise = radius * np.sin(angle) + np.where(angle > 0, half, -half)
    turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    across = radius * np.cos(angle)[:, None]
    points = [
        across * np.cos(turn),
        across * np.sin(turn),
        np.broadcast_to(rise[:, None], (len(angle), _AROUND)),
    ]
    ring, place = np.meshgrid(np.arange(len(angle) - 1), np.arange(_AROUND), indexing="ij")
    a = (ring * _AROUND + place).ravel()
    b = (ring * _AROUND + (place + 1) % _AROUND).ravel()
    faces = np.concatenate(
        [np.stack([a, b, b + _AROUND], 1), np.stack([a, b + _AROUND, a + _AROUND], 1)]
    )
    vertices = np.stack([x.ravel() for x in points], axis=1)
    return mg.TriangularMeshGeometry(vertices.astype(np.float32), faces.astype(np.uint32))


def _color(rgba: Array) -> int:
    r, g, b = (min(255, max(0, int(255 * float(x)))) for x in rgba[:3])
    return r << 16 | g << 8 | b


def _textures(file: Path) -> dict[str, str]:
    """Images that a Collada file names, as data addresses; only real images from beside it."""
    home = file.resolve().parent.parent
    out = {}
    for name in image_references(file):
        image = (file.parent / name.removeprefix("file://")).resolve()
        if not image.is_relative_to(home) or not image.is_file():
            continue
        if image.stat().st_size > _LARGEST_IMAGE:
            continue
        data = image.read_bytes()
        kind = next((k for start, k in _IMAGES.items() if data.startswith(start)), None)
        if kind is not None:
            out[name] = f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return out
