"""The meshes of a robot, looked for when the robot is drawn and not when it is loaded.

Meshes are rewritten to the file that was found, so that no later reader looks for them elsewhere.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

from pinsing.description.ros_packages import MeshProblem, PackageIndex
from pinsing.description.xml_tree import show

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


_LARGEST = 256 * 2**20
_END = re.compile(rb"</(?:[\w.-]+:)?COLLADA\s*>\s*\Z")


class ColladaProblem(Exception):
    """A file that cannot be judged."""


def image_references(path: Path) -> tuple[str, ...]:
    """Return the text of every ``<init_from>`` in the library of images, as written.

    Elsewhere the same tag holds no file but the name of an image.

    Raises
    ------
    ColladaProblem
        If the file is too large, changes, is no XML, in an odd encoding, or declares entities.
    """
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > _LARGEST:
            raise ColladaProblem("is too large")
        # Not the most that is allowed: room for that would be made first, in milliseconds.
        data = stream.read(size + 1)
    if len(data) != size:
        raise ColladaProblem("changes while it is read")
    # Files are large: most are looked through twice and no more.
    declares = b"<!" in data and (b"<!DOCTYPE" in data or b"<!ENTITY" in data)
    if declares or b"\0" in data[:400]:
        raise ColladaProblem("has entities or an odd encoding")
    if b"init_from" not in data or (end_of_images := data.rfind(b"library_images")) < 0:
        return ()
    found: list[str] = []
    depth = library = inside = 0

    def start(tag: str, _attributes: dict[str, str]) -> None:
        nonlocal depth, library, inside
        depth += 1
        if "library_images" in tag:
            library = library or depth
        if library and "init_from" in tag and not inside:
            inside = depth
            found.append("")

    def end(_tag: str) -> None:
        nonlocal depth, library, inside
        inside = 0 if depth == inside else inside
        library = 0 if depth == library else library
        depth -= 1

    def text(words: str) -> None:
        if inside:
            found[-1] += words

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text
    try:
        # Behind the last library of images, most often at the top, there are but numbers. A file
        # that does not end as it should is read whole, to hear where it is broken.
        whole = _END.search(data[-200:]) is not None
        parser.Parse(data[: data.find(b">", end_of_images) + 1] if whole else data, not whole)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise ColladaProblem("is not well-formed XML") from error
    return tuple(found)


@dataclass(frozen=True)
class FoundMeshes:
    """What became of the meshes of a description.

    Attributes
    ----------
    xml : str
        Plain URDF. Its meshes and textures exist, as file:// addresses; others are left out.
    missing : tuple of str
        Mesh and texture addresses, as in the file, that do not exist or may not be opened.
    packages : tuple of Path
        Folders of the packages that they were found in.
    notes : tuple of str
        What is not drawn, in at most two notes.
    """

    xml: str
    missing: tuple[str, ...]
    packages: tuple[Path, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Shapes:
    """What a robot looks like: shapes and materials, and meshes that are looked for once.

    That is when ``found`` is first asked for: the addresses and the folders to look in are those
    of the time of loading, the files those that are there by then. Later changes of the folder
    are not seen. A copy that is pickled has found them, since addresses may mean nothing elsewhere.

    Attributes
    ----------
    text : str
        Plain URDF, with the addresses of meshes as in the file.
    index : PackageIndex
        Where they may be.
    """

    text: str
    index: PackageIndex = field(repr=False, compare=False)

    @cached_property
    def found(self) -> FoundMeshes:
        """The meshes that there are."""
        return _found(self.text, self.index)

    def __getstate__(self) -> dict[str, object]:
        return {"text": self.text, "index": self.index, "found": self.found}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)


def _found(text: str, index: PackageIndex) -> FoundMeshes:
    from xml.etree import ElementTree  # only what is drawn needs it

    root = ElementTree.fromstring(text)
    meshes = _Meshes(index)
    for link in root.iterfind("link"):
        for shape in [child for child in link if child.tag in ("visual", "collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is not None:
                address = meshes.locate(mesh.get("filename", ""))
                if address is None:
                    link.remove(shape)
                    continue
                mesh.set("filename", address)
            for material in shape.iterfind("material"):
                _locate_texture(material, meshes)
    for material in root.findall("material"):
        _locate_texture(material, meshes)
        if not len(material):
            root.remove(material)
    return FoundMeshes(
        xml=ElementTree.tostring(root, "unicode"),
        missing=tuple(meshes.missing),
        packages=index.used(),
        notes=tuple(meshes.notes()),
    )


def _locate_texture(material: Element, meshes: _Meshes) -> None:
    texture = material.find("texture")
    if texture is None:
        return
    address = meshes.locate(texture.get("filename", ""))
    if address is None:
        material.remove(texture)
    else:
        texture.set("filename", address)


@dataclass
class _Meshes:
    """The meshes of one file: which were found, which are missing, which may not be opened."""

    index: PackageIndex
    _paths: dict[str, str | None] = field(default_factory=dict)
    missing: dict[str, MeshProblem] = field(default_factory=dict)

    def locate(self, uri: str) -> str | None:
        """Return the file:// address of a mesh, None if it cannot be had."""
        if uri not in self._paths:
            try:
                path = self.index.mesh(uri)
                self._check_images(path)
                self._paths[uri] = f"file://{path}"
            except MeshProblem as problem:
                self._paths[uri] = None
                self.missing[uri] = problem
        return self._paths[uri]

    def _check_images(self, path: Path) -> None:
        """Refuse a Collada mesh that would have the viewer embed a file from elsewhere."""
        if path.suffix.lower() != ".dae":
            return
        try:
            for name in image_references(path):
                # As the viewer finds it.
                self.index.image(path.parent / name)
        except (ColladaProblem, OSError) as error:
            raise MeshProblem(str(error), refused=True) from error

    def notes(self) -> list[str]:
        """Return what to say about meshes that are not drawn, in at most two notes."""
        notes = []
        for refused in (True, False):
            found = [(u, p) for u, p in self.missing.items() if p.refused == refused]
            if found:
                uri, problem = found[0]
                lead = "not opened" if refused else "not found"
                notes.append(
                    f"{len(found)} of {len(self._paths)} mesh files {lead} and not drawn, as "
                    f"{show(uri, 90)} ({problem})"
                )
        return notes
