"""The child process that reads mesh files: Assimp trusts them more than one may.

It is started by path (see `pinsing.view.meshes`), gets the paths of meshes as a line of JSON, and
answers for each, in order, in msgpack: what is wrong with it in words, or what `packed` makes of
it, no bytes where the page gets the file itself. Memory is limited, nothing can be written, and on
Linux the kernel lets it read files in the folders of its meshes only, where it has Landlock, and
any file where it has not: no socket, no process. What is missing of that comes first, as a list.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import types
from pathlib import Path
from typing import Any

_LARGEST = 1e9


def read(loader: Any, path: str, wanted: str) -> bytes:
    """Return the bytes of an answer, none to "judge"; ValueError for bad vertices."""
    import numpy as np

    from pinsing.view.collada import NotPlainError, Painted, packed, read_collada

    if wanted == "paint":
        with contextlib.suppress(NotPlainError):
            parts = read_collada(Path(path).read_bytes())
            if max(part.farthest for part in parts) > _LARGEST:
                raise ValueError("has vertices farther away than any robot reaches")
            return packed(parts)
    mesh = loader.load(path, np.ones(3))
    if not 0 < mesh.num_vertices <= 5_000_000 or mesh.num_tris == 0:
        raise ValueError(f"has {mesh.num_vertices} vertices and {mesh.num_tris} triangles")
    vertices = np.array(mesh.vertices(), dtype=np.float64)
    if not np.isfinite(vertices).all():
        raise ValueError("has vertices that are not finite")
    if np.abs(vertices).max() > _LARGEST:
        raise ValueError("has vertices farther away than any robot reaches")
    if wanted != "content":
        return b""
    triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    faces = np.array([[t[0], t[1], t[2]] for t in triangles], dtype=np.int32)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("has triangles without vertices")
    as_it_is = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(0)
    points, none = vertices.astype(np.float32), np.zeros((0, 4), dtype=np.int8)
    return packed([Painted(points, none, faces.astype(np.uint32), *as_it_is)])


def answer(loader: Any, path: str, wanted: str) -> str | bytes:
    """Return what became of one file."""
    try:
        return read(loader, path, wanted)
    except MemoryError:
        return "needs too much memory"
    except Exception as error:  # the reader has no error of its own
        lines = [x for x in str(error).splitlines() if x.strip() and not x.startswith("Hint")]
        return " ".join((lines or [type(error).__name__])[-1].split())[:200]


def main() -> None:
    """Answer one request."""
    request = json.loads(sys.stdin.buffer.readline())
    # Libraries write what they like to the ordinary outputs.
    out = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    sys.path[:] = request["sys_path"]
    import coal
    import umsgpack

    root = Path(__file__).resolve().parent.parent
    for name in ("pinsing", "pinsing.view", "pinsing.description"):
        package = types.ModuleType(name)  # the packages themselves import more than is wanted
        package.__path__ = [str(root.joinpath(*name.split(".")[1:]))]
        sys.modules[name] = package
    import pinsing.view.collada  # noqa: F401 (with NumPy, before files are out of reach)
    from pinsing.description import child_jail

    if any(wanted == "paint" for _, wanted in request["paths"]):
        import collada  # noqa: F401

    loader = coal.MeshLoader()
    child_jail.limit_resources(request["seconds"], request["memory"])
    # Landlock first: the filter lets no more rules be made.
    folders = {os.path.dirname(os.path.realpath(path)) for path, _ in request["paths"]}
    walls = (child_jail.read_only_below(folders), child_jail.close_in(reading=True))
    umsgpack.pack([why for why in walls if why], out)
    for path, wanted in request["paths"]:
        out.flush()  # what is known, if the next one breaks the reader
        child_jail.begin_work(request["seconds_each"])
        umsgpack.pack(answer(loader, path, wanted), out)
    out.flush()


if __name__ == "__main__":
    main()
