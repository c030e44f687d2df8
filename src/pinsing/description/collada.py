"""What a Collada mesh refers to: Pinocchio's viewer embeds every image that a .dae names."""

from __future__ import annotations

import os
import re
from pathlib import Path
from xml.parsers import expat

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
