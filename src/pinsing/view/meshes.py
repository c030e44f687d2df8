"""Meshes of a robot, read in a child process with limits; one that fails is left out and named."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack

from pinsing.atomic_write import write_bytes
from pinsing.description import child_jail
from pinsing.description.files import MEMORY
from pinsing.errors import PinsingError
from pinsing.measures import Array
from pinsing.view.collada import Painted, unpacked

SECONDS_EACH = 20.0
"""Processor time for one mesh, which a busy machine does not use up."""
_WORKER = Path(__file__).with_name("mesh_worker.py")
_WANTED = {".dae": "paint", ".obj": "judge", ".stl": "judge"}  # go into the page as they are


Mesh = tuple[Painted, ...]
"""The triangles of a mesh file, by paint; none where the file itself goes into the page."""


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
    meshes = {path: mesh for path, mesh in found.items() if not isinstance(mesh, str)}
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
    """Return the mesh of each file, by a child process or `cache_folder`, or what is wrong with it.

    ``tell`` gets a line on which of the kernel's walls around the child is missing.
    """
    found: dict[Path, Mesh | str | None] = {}
    folder = cache_folder()
    files: dict[Path, Path] = {}  # where answers are kept
    for path in paths:
        found[path] = _unfit(path)
        if found[path] is None and folder is not None and (key := content_key(path)):
            files[path] = folder / key
            found[path] = kept(files[path])
    left = [path for path in paths if found[path] is None]
    missing: list[str] = []
    while left:
        ended = "the reader of meshes cannot be started"
        done = _ask_child(left, missing) or dict.fromkeys(left, ended)
        left = left[len(done) :]
        for path, answered in done.items():
            mesh = answered if isinstance(answered, str) else unpacked(answered)
            found[path] = "breaks its reader" if mesh is None else mesh
            if path in files and mesh is not None and isinstance(answered, bytes):
                keep(files[path], answered)
    if missing:
        walls = "; ".join(dict.fromkeys(missing))
        tell(f"meshes were read without all of the kernel's walls: {walls}")
    return {path: mesh for path, mesh in found.items() if mesh is not None}


def _unfit(path: Path) -> str | None:
    """Why a file is not read at all; None if it may be."""
    try:
        if path.stat().st_size > 256 * 2**20:
            return "is too large"
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    return None if path.is_file() else "is not a plain file"


def _ask_child(paths: Sequence[Path], missing: list[str]) -> dict[Path, bytes | str]:
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
            [sys.executable, "-ISB", str(_WORKER)],
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
    messages = _messages(said)
    missing += map(str, next(messages, []))
    done: dict[Path, bytes | str] = dict(zip(paths, messages, strict=False))
    if len(done) < len(paths):
        ended = "needs too much memory, or breaks its reader"
        done[paths[len(done)]] = f"is not read within {SECONDS_EACH:g} s" if slow else ended
    return done


def _messages(said: bytes) -> Iterator[Any]:
    """What a child wrote, up to where it ended: texts, bytes and lists of texts."""
    stream = io.BytesIO(said)
    with contextlib.suppress(umsgpack.UnpackException):
        while True:
            yield umsgpack.unpack(stream)


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
    digest = hashlib.sha256(f"5\0{path.suffix.lower()}\0".encode())  # the version of answers
    try:
        with path.open("rb") as file:
            while part := file.read(1 << 20):
                digest.update(part)
    except OSError:  # the child says what is wrong with it
        return ""
    return digest.hexdigest()


def kept(file: Path) -> Mesh | None:
    """The mesh of an answer that was kept; None where nothing whole is there."""
    try:
        data = file.read_bytes()
    except OSError:
        return None
    digest, body = data[:32], data[32:]
    if hashlib.sha256(body).digest() != digest:
        return None
    with contextlib.suppress(OSError):
        os.utime(file)  # the longest unused go first
    return unpacked(body)


def keep(file: Path, body: bytes) -> None:
    """Keep an answer; a full disk, or one that cannot be written, is no error."""
    if len(body) > 64 * 2**20:
        return
    with contextlib.suppress(OSError, PinsingError):
        write_bytes(file, hashlib.sha256(body).digest() + body)
        files = [(path, path.stat()) for path in file.parent.iterdir() if path.is_file()]
        total = sum(found.st_size for _, found in files)
        for path, found in sorted(files, key=lambda f: f[1].st_mtime):
            if total <= 512 * 2**20:
                break
            path.unlink(missing_ok=True)
            total -= found.st_size
