"""Damaged meshes, read as the page reads them."""

from __future__ import annotations

import math
import random
import struct
from pathlib import Path

from fuzz.judge import Ended, Wrong, refused
from fuzz.mutants import NUMBERS

MESHES_EACH = 20
"""Files that one case has: a child process reads them all."""


def _meshes() -> dict[str, bytes]:
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    stl = b"\0" * 80 + struct.pack("<I", len(faces))
    text = "solid t\n"
    for face in faces:
        points = [corners[i] for i in face]
        stl += struct.pack("<12fH", 0, 0, 1, *(float(x) for p in points for x in p), 0)
        lines = "\n".join("vertex {} {} {}".format(*p) for p in points)
        text += f"facet normal 0 0 1\nouter loop\n{lines}\nendloop\nendfacet\n"
    rows = "\n".join("{} {} {}".format(*p) for p in corners)
    triangles = "\n".join("3 {} {} {}".format(*f) for f in faces)
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
        f"{rows}\n{triangles}\n"
    )
    obj = "".join("v {} {} {}\n".format(*p) for p in corners)
    obj += "".join("f {} {} {}\n".format(*(i + 1 for i in f)) for f in faces)
    numbers = " ".join(str(x) for p in corners for x in p)
    indices = " ".join(str(i) for f in faces for i in f)
    dae = (
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" '
        'version="1.4.1"><asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>'
        '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" '
        f'count="12">{numbers}</float_array><technique_common><accessor source="#a" count="4" '
        'stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" '
        'type="float"/></accessor></technique_common></source><vertices id="v"><input '
        'semantic="POSITION" source="#p"/></vertices><triangles count="4"><input '
        f'semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles></mesh></geometry>'
        '</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n">'
        '<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes><scene>'
        '<instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    texts = {"t.stl": text + "endsolid t\n", "t.ply": ply, "t.obj": obj, "t.dae": dae}
    texts["t.off"] = f"OFF\n4 4 0\n{rows}\n{triangles}\n"
    return {"b.stl": stl, **{name: value.encode() for name, value in texts.items()}}


def mesh(rngs: list[random.Random], folder: Path) -> Ended:
    """Every file of a case is read, or named with what is wrong with it."""
    import numpy as np

    from pinsing.view.meshes import read_meshes

    rng, goods = rngs[0], sorted(_meshes().items())
    paths = []
    for number in range(MESHES_EACH):
        name, data = rng.choice(goods)
        path = folder / f"mesh{number}{Path(name).suffix}"
        path.write_bytes(_broken_mesh(rng, data, name))
        paths.append(path)
    found = read_meshes(paths)
    if list(found) != paths:
        raise Wrong("some files are not named")
    said = ""
    for read in found.values():
        if isinstance(read, str):
            said = refused(read)[1]
        elif not all(
            np.isfinite(part.vertices).all()
            and part.faces.min() >= 0
            and part.faces.max() < len(part.vertices)
            for part in read
        ):
            raise Wrong("a mesh that is not one")
    return ("refused" if said else "result"), said


def _broken_mesh(rng: random.Random, data: bytes, name: str) -> bytes:
    for _ in range(rng.choice([0, 1, 1, 2, 4])):
        spot = rng.randrange(len(data) + 1)
        way = rng.randrange(6)
        if way == 0:
            data = data[:spot]
        elif way == 1:
            data = data[:spot] + bytes([rng.randrange(256)]) + data[spot + 1 :]
        elif way == 2 and name == "b.stl" and len(data) > 84:
            count = rng.choice([0, 1, 5, 2**16, 2**28, 2**31, 2**32 - 1])
            data = data[:80] + struct.pack("<I", count) + data[84:]
        elif way == 3 and name == "b.stl" and len(data) > 100:
            at = 84 + 4 * rng.randrange((len(data) - 88) // 4)
            odd = rng.choice([math.nan, math.inf, -math.inf, 3e38, 1e-45, -0.0])
            data = data[:at] + struct.pack("<f", odd) + data[at + 4 :]
        elif way == 4:
            data = data[:spot] + data[: rng.randrange(len(data) + 1)] + data[spot:]
        elif name != "b.stl":
            words = data.split(b" ")
            at = rng.randrange(len(words))
            words[at] = rng.choice([*NUMBERS, "-1", "2147483648", "4294967295"]).encode()
            data = b" ".join(words)
    return data
