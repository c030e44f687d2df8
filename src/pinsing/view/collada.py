"""Collada files as triangles, so that a page has little to read and nothing to parse.

Runs in the child process that reads meshes (`pinsing.view.mesh_worker`): a stranger's file may be
made to take time and memory. Each element is read once, and what it makes is counted.

Only what robots' files are usually made of: triangles and polygons with normals, painted evenly.
Any other file goes into the page as it is, where three.js reads it.

Source of the format: COLLADA 1.5 specification, Khronos Group, 2008. As in three.js within meshcat,
and so in Pinocchio's viewer, ``unit`` and ``up_axis`` are not looked at.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any
from uuid import uuid1

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array

_SPACE = "{http://www.collada.org/2005/11/COLLADASchema}"
_DEEPEST = 64
_MOST_VERTICES = 5_000_000
_MOST_USES = 100_000  # of geometry, by nodes


class NotPlainError(ValueError):
    """The file holds something else than plain painted triangles."""


@dataclass(frozen=True)
class Paint:
    """What a surface looks like: colours in 0xrrggbb."""

    color: int = 0xFFFFFF
    specular: int = 0
    emissive: int = 0
    shininess: float = 30.0
    opacity: float = 1.0


@dataclass(frozen=True)
class PaintedPart:
    """Triangles of one paint.

    Attributes
    ----------
    vertices, normals : (n, 3) arrays
        In the unit of the file.
    faces : (m, 3) array of int
        Three vertices each, counted from 0.
    paint : Paint
        Of all of them.
    """

    vertices: Array
    normals: Array
    faces: npt.NDArray[np.uint32]
    paint: Paint


def read_collada(text: str) -> tuple[PaintedPart, ...]:
    """Read the visual scene of a Collada file.

    Raises
    ------
    NotPlainError
        If it holds textures, bones, colours of single vertices, or anything else that is not
        plain; or nothing at all.
    """
    try:
        return _File(ET.fromstring(text)).parts()
    except (ET.ParseError, ValueError, KeyError, IndexError, AttributeError, TypeError) as error:
        raise NotPlainError(" ".join(str(error).split())) from None


class _File:
    def __init__(self, root: ET.Element) -> None:
        self.root = root
        self.by_id = {e.get("id"): e for e in root.iter() if e.get("id")}
        # By element: files refer to the same one from many places.
        self.paints: dict[ET.Element, Paint] = {}
        self.sources: dict[ET.Element, Array] = {}
        self.vertices = self.uses = 0

    def parts(self) -> tuple[PaintedPart, ...]:
        for unusual in ("texture", "instance_controller", "instance_node", "lookat", "skew"):
            if self.root.find(f".//{_SPACE}{unusual}") is not None:
                raise NotPlainError(f"it has a {unusual}")
        scene = self._named(_need(self.root, f"{_SPACE}scene/{_SPACE}instance_visual_scene"))
        found = [
            part
            for node in scene.findall(f"{_SPACE}node")
            for part in self._node(node, np.eye(4), 0)
        ]
        if not found:
            raise NotPlainError("it has no triangles")
        return _joined(found)

    def _named(self, user: ET.Element, key: str = "url") -> ET.Element:
        return self.by_id[(user.get(key) or "")[1:]]

    def _node(self, node: ET.Element, place: Array, depth: int) -> Iterator[PaintedPart]:
        if depth > _DEEPEST:
            raise NotPlainError("its nodes are too deep")
        for child in node:
            place = place @ _transform(child)
        for use in node.findall(f"{_SPACE}instance_geometry"):
            self.uses += 1
            if self.uses > _MOST_USES:
                raise NotPlainError("it is too large")
            paints = {
                e.get("symbol"): self._paint(self._named(e, "target"))
                for e in use.iter(f"{_SPACE}instance_material")
            }
            mesh = self._named(use).find(f"{_SPACE}mesh")
            if mesh is None:
                raise NotPlainError("its geometry is no mesh")
            for part in self._mesh(mesh, paints):
                yield _moved(part, place)
        for child in node.findall(f"{_SPACE}node"):
            yield from self._node(child, place, depth + 1)

    def _mesh(self, mesh: ET.Element, paints: dict[str | None, Paint]) -> Iterator[PaintedPart]:
        for shape in mesh:
            kind = shape.tag.removeprefix(_SPACE)
            if kind in ("source", "vertices", "extra", "lines", "linestrips"):
                continue
            if kind not in ("triangles", "polylist"):
                raise NotPlainError(f"it has {kind}")
            if int(shape.get("count") or 0) == 0:
                continue
            paint = paints.get(shape.get("material"), Paint())
            vertices, normals, corners = self._corners(shape)
            self.vertices += len(vertices) + len(corners)
            if self.vertices > 4 * _MOST_VERTICES:
                raise NotPlainError("it is too large")
            yield PaintedPart(
                vertices, normals, _triangles(shape, corners).astype(np.uint32), paint
            )

    def _corners(self, shape: ET.Element) -> tuple[Array, Array, npt.NDArray[np.int64]]:
        """Vertices and their normals (n, 3), and which of them each corner is."""
        inputs = {e.get("semantic"): e for e in shape.findall(f"{_SPACE}input")}
        if "COLOR" in inputs:
            raise NotPlainError("its vertices are painted")
        width = 1 + max(int(e.get("offset") or 0) for e in shape.findall(f"{_SPACE}input"))
        index = _numbers(_need(shape, f"{_SPACE}p")).astype(np.int64).reshape(-1, width)
        through = self._named(inputs["VERTEX"], "source")
        own = {e.get("semantic"): e for e in through.findall(f"{_SPACE}input")}
        at_vertex = index[:, int(inputs["VERTEX"].get("offset") or 0)]
        at_normal, user = at_vertex, own.get("NORMAL")
        if user is None:
            user = inputs["NORMAL"]
            at_normal = index[:, int(user.get("offset") or 0)]
        places, normals = self._source(own["POSITION"]), self._source(user)
        ends = ((at_vertex, places), (at_normal, normals))
        if any(at.min() < 0 or at.max() >= len(rows) for at, rows in ends):
            raise NotPlainError("a corner is none of its vertices")
        used, corners = np.unique(at_vertex * len(normals) + at_normal, return_inverse=True)
        vertex, normal = np.divmod(used, len(normals))
        return places[vertex], normals[normal], corners.reshape(-1)

    def _source(self, user: ET.Element) -> Array:
        """Rows of three numbers."""
        source = self._named(user, "source")
        if source in self.sources:
            return self.sources[source]
        access = _need(source, f"{_SPACE}technique_common/{_SPACE}accessor")
        if int(access.get("stride") or 1) != 3 or int(access.get("offset") or 0) != 0:
            raise NotPlainError("its numbers are not in threes")
        rows = _numbers(_need(source, f"{_SPACE}float_array")).reshape(-1, 3)
        if not np.isfinite(rows).all():
            raise NotPlainError("a number is not finite")
        self.sources[source] = rows
        return rows

    def _paint(self, material: ET.Element) -> Paint:
        if material not in self.paints:
            self.paints[material] = self._read_paint(material)
        return self.paints[material]

    def _read_paint(self, material: ET.Element) -> Paint:
        effect = self._named(_need(material, f"{_SPACE}instance_effect"))
        technique = _need(effect, f"{_SPACE}profile_COMMON/{_SPACE}technique")
        model = next(
            (m for kind in ("phong", "blinn", "lambert") for m in technique.iter(_SPACE + kind)),
            None,
        )
        if model is None:
            raise NotPlainError("it has another shading")
        shines = model.tag != f"{_SPACE}lambert"
        shininess = _float(model, "shininess")
        return Paint(
            _hex(_color(model, "diffuse")),
            _hex(_color(model, "specular")) if shines else 0,
            _hex(_color(model, "emission")),
            30.0 if shininess is None else shininess,
            _opacity(model),
        )


def _need(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    if found is None:
        raise NotPlainError(f"it has no {path.rpartition('}')[2]}")
    return found


def _numbers(element: ET.Element) -> Array:
    return np.array((element.text or "").split(), dtype=float)


def _triangles(shape: ET.Element, corners: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Corners as triangles (m, 3); a polygon is a fan, as three.js takes it."""
    if shape.tag == f"{_SPACE}triangles":
        return corners.reshape(-1, 3)
    sides = _numbers(_need(shape, f"{_SPACE}vcount")).astype(np.int64)
    if sides.sum() != len(corners) or (sides < 0).any():
        raise NotPlainError("its polygons have other corners than it says")
    first, fans = np.cumsum(sides) - sides, np.maximum(sides - 2, 0)
    here = np.repeat(first, fans)
    k = np.arange(len(here)) - np.repeat(np.cumsum(fans) - fans, fans) + 1
    return np.stack([corners[here], corners[here + k], corners[here + k + 1]], axis=1)


def _transform(element: ET.Element) -> Array:
    kind = element.tag.removeprefix(_SPACE)
    if kind not in ("matrix", "translate", "scale", "rotate"):
        return np.eye(4)
    values, out = _numbers(element), np.eye(4)
    if kind == "matrix":
        return values.reshape(4, 4)
    if kind == "translate":
        out[:3, 3] = values
    elif kind == "scale":
        out[:3, :3] = np.diag(values)
    else:  # Rodrigues' formula
        length = float(np.linalg.norm(values[:3]))
        if not length > 0:
            raise NotPlainError("it turns about no axis")
        (x, y, z), angle = values[:3] / length, np.deg2rad(values[3])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        out[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return out


def _moved(part: PaintedPart, place: Array) -> PaintedPart:
    if not np.isfinite(place).all():
        raise NotPlainError("a number is not finite")
    turn = place[:3, :3]
    normals = part.normals @ np.linalg.inv(turn)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return PaintedPart(
        part.vertices @ turn.T + place[:3, 3],
        normals / np.where(length > 0, length, 1.0),
        part.faces,
        part.paint,
    )


def _joined(parts: list[PaintedPart]) -> tuple[PaintedPart, ...]:
    """Parts of the same paint as one."""
    out = []
    by_paint: dict[Paint, list[PaintedPart]] = {}
    for part in parts:
        by_paint.setdefault(part.paint, []).append(part)
    for paint, same in by_paint.items():
        starts = np.cumsum([0, *(len(part.vertices) for part in same[:-1])])
        faces = [part.faces + np.uint32(k) for part, k in zip(same, starts, strict=True)]
        vertices = np.concatenate([part.vertices for part in same])
        normals = np.concatenate([part.normals for part in same])
        out.append(PaintedPart(vertices, normals, np.concatenate(faces).astype(np.uint32), paint))
    return tuple(out)


def _color(model: ET.Element, name: str) -> Array | None:
    found = model.find(f"{_SPACE}{name}/{_SPACE}color")
    return None if found is None else _numbers(found)


def _float(model: ET.Element, name: str) -> float | None:
    found = model.find(f"{_SPACE}{name}/{_SPACE}float")
    if found is None:
        return None
    value = float(found.text or "nan")
    if not np.isfinite(value):
        raise NotPlainError("a number is not finite")
    return value


def _hex(rgba: Array | None) -> int:
    if rgba is None:
        return 0
    r, g, b = (int(255 * x + 0.5) for x in np.clip(rgba[:3], 0.0, 1.0))
    return r << 16 | g << 8 | b


def _opacity(model: ET.Element) -> float:
    """Of ``transparent`` and ``transparency``, by the table of the specification."""
    share = _float(model, "transparency")
    element = model.find(f"{_SPACE}transparent")
    if element is None and share is None:
        return 1.0
    rgba = _color(model, "transparent")
    rgba = np.ones(4) if rgba is None else rgba
    mode = "A_ONE" if element is None else element.get("opaque", "A_ONE")
    weight = float(rgba[3] if mode.startswith("A") else rgba[0]) * (1.0 if share is None else share)
    value = weight if mode.endswith("_ONE") else 1.0 - weight
    # What nobody could see is a slip of the program that wrote it.
    return min(1.0, value) if value > 0.01 else 1.0


_STEPS = 32767  # of the longest side, in each direction
_TYPES = {"Int8Array": 17, "Int16Array": 19, "Uint16Array": 20, "Uint32Array": 22}


@dataclass(frozen=True)
class Painted:
    """Triangles of one paint, in whole steps of their size.

    Attributes
    ----------
    middle : tuple of float
        Where the steps count from, in the unit of the file.
    step : float
        Their length.
    vertices : (n, 4) array of int16
        In steps; the last column pads.
    normals : (n, 4) array of int8
        127 long; the last column pads.
    faces : (m, 3) array of uint16 or uint32
        Three vertices each.
    paint : Paint
        Of all of them.
    """

    middle: tuple[float, float, float]
    step: float
    vertices: npt.NDArray[np.int16]
    normals: npt.NDArray[np.int8]
    faces: npt.NDArray[Any]
    paint: Paint

    @classmethod
    def of(cls, part: PaintedPart) -> Painted:
        """Round: a link of a metre to 0.015 mm."""
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        x, y, z = (low + high) / 2
        step = float(max((high - low).max() / 2, 1e-12) / _STEPS)
        steps = np.zeros((len(part.vertices), 4), dtype=np.int16)
        steps[:, :3] = np.rint((part.vertices - (x, y, z)) / step)
        normals = np.zeros((len(part.vertices), 4), dtype=np.int8)
        normals[:, :3] = np.rint(127 * part.normals)
        kind = np.uint16 if len(steps) < 2**16 else np.uint32
        middle = (float(x), float(y), float(z))
        return cls(middle, step, steps, normals, part.faces.astype(kind), part.paint)


def packed(parts: Sequence[Painted]) -> tuple[bytes, bytes]:
    """Return parts as bytes: what they are in JSON, and their numbers."""
    head = [
        {
            "middle": part.middle,
            "step": part.step,
            "vertices": len(part.vertices),
            "faces": len(part.faces),
            "paint": asdict(part.paint),
        }
        for part in parts
    ]
    body = [
        array.tobytes() for part in parts for array in (part.vertices, part.normals, part.faces)
    ]
    return json.dumps(head).encode(), b"".join(body)


def unpacked(head: bytes, body: bytes) -> tuple[Painted, ...] | None:
    """Return the parts that `packed` was given; None if that is something else."""
    parts, at = [], 0

    def take(kind: type[np.generic], rows: int, columns: int) -> npt.NDArray[Any]:
        nonlocal at
        found = np.frombuffer(body, kind, rows * columns, at).reshape(rows, columns)
        at += found.nbytes
        return found

    try:
        for one in json.loads(head):
            n, (x, y, z) = int(one["vertices"]), one["middle"]
            vertices, normals = take(np.int16, n, 4), take(np.int8, n, 4)
            faces = take(np.uint16 if n < 2**16 else np.uint32, int(one["faces"]), 3)
            paint = Paint(**one["paint"])
            middle = (float(x), float(y), float(z))
            parts.append(Painted(middle, float(one["step"]), vertices, normals, faces, paint))
    except (ValueError, KeyError, TypeError):
        return None
    return tuple(parts)


def as_object(parts: Sequence[Painted]) -> dict[str, Any]:
    """The parts in the JSON of three.js, as meshcat takes it."""
    geometries, materials, meshes = [], [], []
    for part in parts:
        shape, paint = str(uuid1()), str(uuid1())
        x, y, z = part.middle
        step = part.step
        geometries.append(
            {
                "uuid": shape,
                "type": "BufferGeometry",
                "data": {
                    "attributes": {
                        "position": _array("Int16Array", part.vertices, 4),
                        "normal": _array("Int8Array", part.normals, 4),
                    },
                    "index": _array(
                        "Uint16Array" if part.faces.dtype == np.uint16 else "Uint32Array",
                        part.faces,
                        1,
                    ),
                },
            }
        )
        materials.append({"uuid": paint, **_material(part.paint)})
        meshes.append(
            {
                "uuid": str(uuid1()),
                "type": "Mesh",
                "geometry": shape,
                "material": paint,
                "matrix": [step, 0, 0, 0, 0, step, 0, 0, 0, 0, step, 0, x, y, z, 1],
            }
        )
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": geometries,
        "materials": materials,
        "object": {"uuid": str(uuid1()), "type": "Group", "children": meshes},
    }


def _array(kind: str, values: npt.NDArray[Any], columns: int) -> dict[str, Any]:
    from umsgpack import Ext  # the child process that makes the parts can do without

    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return {
        "itemSize": columns,
        "type": kind,
        "array": Ext(_TYPES[kind], little.tobytes()),
        "normalized": False,
    }


def _material(paint: Paint) -> dict[str, Any]:
    more = {"type": "MeshPhongMaterial", "side": 2, "transparent": paint.opacity < 1.0}
    return {**asdict(paint), **more}
