"""Painted triangles as a page takes them: small, with nothing left to parse."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any
from uuid import uuid1

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing.view.collada import Paint, PaintedPart

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
