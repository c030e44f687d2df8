"""Triangles of mesh files, small, with nothing left to parse for a page; of Collada, painted.

Files are read in the child process of `pinsing.view.mesh_worker`: a stranger's file may be made to
take time and memory. Of Collada, by pycollada, only what robots' files are usually made of:
triangles and polygons with normals, painted evenly. Any other file goes into the page as it is,
where three.js reads it. As there, ``unit`` and ``up_axis`` are not looked at.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import umsgpack

from pinsing.errors import Refusal
from pinsing.measures import Array, NDArray

_STEPS = 32767  # of the longest side, in each direction


class NotPlainError(Refusal, ValueError):
    """The file holds something else than plain painted triangles."""


Paint = tuple[float, ...]
"""Colours, specular and emissive too, as 0xrrggbb; shininess; opacity."""

_UNPAINTED: Paint = (0xFFFFFF, 0, 0, 30.0, 1.0)


class Painted(NamedTuple):
    """Triangles of one paint, in steps of their size."""

    vertices: NDArray[Any]  # (n, 4), in steps; the last column pads; or (n, 3)
    normals: NDArray[Any]  # (n, 4), 127 long; the last column pads; or (0, 4)
    faces: NDArray[Any]  # (m, 3), vertices
    place: Array  # (4,): where the steps count from, and the length of one; unit of the file
    paint: Array  # (5,), as `Paint`; (0,) where the file does not say

    @property
    def farthest(self) -> float:
        """Largest coordinate, rounded up."""
        return float(np.abs(self.place[:3]).max() + _STEPS * self.place[3])


def in_steps(vertices: Array, normals: Array, faces: NDArray[Any], paint: Paint) -> Painted:
    """Round: a link of a metre to 0.015 mm."""
    NotPlainError.refuse_if(
        not (np.isfinite(vertices).all() and np.isfinite(normals).all()), "a number is not finite"
    )
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    step = max((high - low).max() / 2, 1e-12) / _STEPS
    place = np.array([*(low + high) / 2, step], dtype=float)
    steps = np.zeros((len(vertices), 4), dtype=np.int16)
    steps[:, :3] = np.rint((vertices - place[:3]) / step)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    shown = np.zeros((len(vertices), 4), dtype=np.int8)
    shown[:, :3] = np.rint(127 * normals / np.where(length > 0, length, 1.0))
    kind = np.uint16 if len(steps) < 2**16 else np.uint32
    return Painted(steps, shown, faces.astype(kind), place, np.array(paint))


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
    return tuple(in_steps(*_joined(shapes), paint) for paint, shapes in by_paint.items())


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
        _UNPAINTED if primitive.material is None else _paint(primitive.material.effect),
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
    return (
        *map(_hex, (effect.diffuse, effect.specular, effect.emission)),
        shininess,
        # What nobody could see is a slip of the program that wrote it.
        min(1.0, opacity) if opacity > 0.01 else 1.0,
    )


def _hex(rgba: Sequence[float] | None) -> int:
    r, g, b = (int(255 * x + 0.5) for x in np.clip((rgba or (0, 0, 0))[:3], 0.0, 1.0))
    return r << 16 | g << 8 | b


def packed(parts: Sequence[Painted]) -> bytes:
    """Return parts as bytes: type, shape and numbers of each array."""
    arrays = [[(a.dtype.str, a.shape, a.tobytes()) for a in part] for part in parts]
    return bytes(umsgpack.packb(arrays))


def unpacked(data: bytes) -> tuple[Painted, ...] | None:
    """Return the parts that `packed` was given; of no bytes none, of something else None."""
    try:
        arrays = umsgpack.unpackb(data) if data else []
        parts = tuple(
            Painted(*(np.frombuffer(data, kind).reshape(shape) for kind, shape, data in part))
            for part in arrays
        )
        sound = all([a.ndim for a in part] == [2, 2, 2, 1, 1] for part in parts)
        sound &= all(np.isfinite([*part.place, *part.paint]).all() for part in parts)
    except Exception:  # whatever was made to look like an answer
        return None
    return parts if sound else None
