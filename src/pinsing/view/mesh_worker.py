"""The child process that reads mesh files: Assimp trusts them more than one may.

It is started by path (see `pinsing.view.meshes`), gets the paths of meshes as a line of JSON, and
answers for each, in order, with a line of JSON: ``problem``, or the numbers of vertices and of
triangles, whose doubles and 32-bit integers follow as bytes. Memory is limited, nothing can be
written, and on Linux the kernel lets it read files in the folders of its meshes only, where it has
Landlock, and any file where it has not: no socket, no process. What is missing of that is said in
the line before the answers.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from typing import Any, BinaryIO

_MOST_VERTICES = 5_000_000
_LARGEST = 1e9


def read(loader: Any, path: str, content: bool) -> tuple[Any, Any]:
    """Return vertices (n, 3) in the unit of the file, and triangles (m, 3).

    Without ``content`` they are judged, and none are returned.

    Raises
    ------
    ValueError
        If there are none, too many, or they are not finite.
    """
    import numpy as np

    mesh = loader.load(path, np.ones(3))
    if not 0 < mesh.num_vertices <= _MOST_VERTICES or mesh.num_tris == 0:
        raise ValueError(f"has {mesh.num_vertices} vertices and {mesh.num_tris} triangles")
    vertices = np.array(mesh.vertices(), dtype=np.float64)
    if not np.isfinite(vertices).all():
        raise ValueError("has vertices that are not finite")
    if np.abs(vertices).max() > _LARGEST:
        raise ValueError("has vertices farther away than any robot reaches")
    if not content:
        return vertices[:0], np.zeros((0, 3), np.int32)
    triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    faces = np.array([[t[0], t[1], t[2]] for t in triangles], dtype=np.int32)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("has triangles without vertices")
    return vertices, faces


def answer(loader: Any, path: str, content: bool, out: BinaryIO) -> None:
    """Write what became of one file."""
    try:
        vertices, faces = read(loader, path, content)
    except MemoryError:
        message: dict[str, Any] = {"problem": "needs too much memory"}
    except Exception as error:  # the reader has no error of its own
        lines = [x for x in str(error).splitlines() if x.strip() and not x.startswith("Hint")]
        message = {"problem": " ".join((lines or [type(error).__name__])[-1].split())[:200]}
    else:
        message = {"vertices": len(vertices), "faces": len(faces)}
    out.write(json.dumps(message).encode() + b"\n")
    if "problem" not in message:
        out.write(vertices.tobytes())
        out.write(faces.tobytes())
    out.flush()


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
    import numpy  # noqa: F401 (before files are out of reach)

    name = "child_jail"  # by its file: the package around it is not wanted here
    spec = importlib.util.spec_from_file_location(name, request["jail"])
    assert spec is not None
    assert spec.loader is not None
    child_jail = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(child_jail)

    loader = coal.MeshLoader()
    child_jail.limit_resources(request["seconds"], request["memory"])
    # Landlock first: the filter lets no more rules be made.
    folders = {os.path.dirname(os.path.realpath(path)) for path, _ in request["paths"]}
    walls = (child_jail.read_only_below(folders), child_jail.close_in(reading=True))
    out.write(json.dumps({"no_wall": [why for why in walls if why]}).encode() + b"\n")
    out.flush()
    for path, content in request["paths"]:
        child_jail.begin_work(request["seconds_each"])
        answer(loader, path, content, out)


if __name__ == "__main__":
    main()
