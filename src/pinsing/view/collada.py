"""Collada files as painted triangles, small, with nothing left to parse for a page.

They are read by pycollada in the child process that reads meshes (`pinsing.view.mesh_worker`): a
stranger's file may be made to take time and memory. Only what robots' files are usually made of:
triangles and polygons with normals, painted evenly. Any other file goes into the page as it is,
where three.js reads it. As there, ``unit`` and ``up_axis`` are not looked at.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pinsing.errors import Refusal
from pinsing.measures import Array, NDArray

_STEPS = 32767  # of the longest side, in each direction


class NotPlainError(Refusal, ValueError):
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
class Painted:
    """Triangles of one paint, in steps of their size."""

    middle: tuple[float, float, float]  # where the steps count from, unit of the file
    step: float  # length of a step
    vertices: NDArray[np.int16]  # (n, 4), in steps; the last column pads
    normals: NDArray[np.int8]  # (n, 4), 127 long; the last column pads
    faces: NDArray[Any]  # (m, 3), vertices
    paint: Paint

    @classmethod
    def of(cls, vertices: Array, normals: Array, faces: NDArray[Any], paint: Paint) -> Painted:
        """Round: a link of a metre to 0.015 mm."""
        NotPlainError.refuse_if(
            not (np.isfinite(vertices).all() and np.isfinite(normals).all()),
            "a number is not finite",
        )
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        x, y, z = (low + high) / 2
        step = float(max((high - low).max() / 2, 1e-12) / _STEPS)
        steps = np.zeros((len(vertices), 4), dtype=np.int16)
        steps[:, :3] = np.rint((vertices - (x, y, z)) / step)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        shown = np.zeros((len(vertices), 4), dtype=np.int8)
        shown[:, :3] = np.rint(127 * normals / np.where(length > 0, length, 1.0))
        kind = np.uint16 if len(steps) < 2**16 else np.uint32
        return cls((float(x), float(y), float(z)), step, steps, shown, faces.astype(kind), paint)

    @property
    def farthest(self) -> float:
        """Largest coordinate, rounded up."""
        return max(map(abs, self.middle)) + _STEPS * self.step


def read_collada(data: bytes) -> tuple[Painted, ...]:
    """Return the visual scene of a Collada file; NotPlainError for textures, bones and the like."""
    from collada import Collada
    from collada.common import DaeError

    by_paint: dict[Paint, list[Any]] = {}
    corners = 0
    try:
        file = Collada(io.BytesIO(data))
        NotPlainError.refuse_if(
            next(file.xmlnode.iter("{*}texture", "{*}instance_controller"), None) is not None,
            "it has textures, or bones",
        )
        # pycollada takes it for zero
        NotPlainError.refuse_if(
            any("nan" in (e.text or "").lower() for e in file.xmlnode.iter("{*}float_array")),
            "a number is not finite",
        )
        for geometry in file.scene.objects("geometry"):
            for primitive in geometry.primitives():
                for paint, shape in _triangles(primitive):
                    corners += len(shape[0]) + shape[2].size
                    NotPlainError.refuse_if(corners > 20_000_000, "it is too large")
                    by_paint.setdefault(paint, []).append(shape)
    except (
        *(DaeError, ValueError, KeyError, IndexError, AttributeError, TypeError),
        *(RecursionError, OverflowError, np.linalg.LinAlgError),
    ) as error:
        raise NotPlainError(" ".join(str(error).split())) from None
    NotPlainError.refuse_if(not by_paint, "it has no triangles")
    return tuple(Painted.of(*_joined(shapes), paint) for paint, shapes in by_paint.items())


def _triangles(primitive: Any) -> Iterator[tuple[Paint, Any]]:
    """Vertices, normals (n, 3) and triangles (m, 3) of a shape with its transform."""
    if hasattr(primitive, "triangleset"):
        primitive = primitive.triangleset()  # a polygon is a fan, as three.js takes it
    if not hasattr(primitive, "ntriangles") or not primitive.ntriangles:
        return  # lines
    NotPlainError.refuse_if(
        primitive.original.sources.get("COLOR") or primitive.normal is None,
        "its vertices are painted, or have no normals",
    )
    at_vertex, at_normal = primitive.vertex_index.ravel(), primitive.normal_index.ravel()
    NotPlainError.refuse_if(
        min(at_vertex.min(), at_normal.min()) < 0, "a corner is none of its vertices"
    )
    many = len(primitive.normal)
    used, corners = np.unique(at_vertex.astype(np.int64) * many + at_normal, return_inverse=True)
    vertex, normal = np.divmod(used, many)
    yield (
        Paint() if primitive.material is None else _paint(primitive.material.effect),
        (primitive.vertex[vertex], primitive.normal[normal], corners.reshape(-1, 3)),
    )


def _joined(shapes: Sequence[Any]) -> tuple[Array, Array, NDArray[Any]]:
    vertices, normals, faces = zip(*shapes, strict=True)
    starts = np.cumsum([0, *(len(v) for v in vertices[:-1])])
    moved = [f + start for f, start in zip(faces, starts, strict=True)]
    return np.concatenate(vertices), np.concatenate(normals), np.concatenate(moved)


def _paint(effect: Any) -> Paint:
    from collada.material import OPAQUE_MODE

    NotPlainError.refuse_if(effect.shadingtype == "constant", "it has another shading")
    # By the table of the specification; a share that is not given is the whole.
    r, _, _, a = effect.transparent or (1.0, 1.0, 1.0, 1.0)
    opacity = float(effect.transparency * a)
    if effect.transparent and effect.opaque_mode == OPAQUE_MODE.RGB_ZERO:
        opacity = 1.0 - float((effect.transparency or 1.0) * r)
    shininess = 30.0 if effect.shininess is None else float(effect.shininess)
    NotPlainError.refuse_if(not np.isfinite([opacity, shininess]).all(), "a number is not finite")
    return Paint(
        _hex(effect.diffuse),
        _hex(effect.specular),
        _hex(effect.emission),
        shininess,
        # What nobody could see is a slip of the program that wrote it.
        min(1.0, opacity) if opacity > 0.01 else 1.0,
    )


def _hex(rgba: Sequence[float] | None) -> int:
    r, g, b = (int(255 * x + 0.5) for x in np.clip((rgba or (0, 0, 0))[:3], 0.0, 1.0))
    return r << 16 | g << 8 | b


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

    def take(kind: type[np.generic], rows: int, columns: int) -> NDArray[Any]:
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
