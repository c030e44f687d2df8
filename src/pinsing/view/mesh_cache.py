"""What became of mesh files that were read before, on the disk, by the hash of their content."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
import sys
from pathlib import Path

from pinsing.atomic_write import write_bytes
from pinsing.errors import PinsingError

_VERSION = "2"
_MOST_BYTES = 512 * 2**20
_LARGEST = 64 * 2**20


def cache_folder() -> Path | None:
    """Our own folder of meshes, for this user alone; None where there can be none.

    ``PINSING_CACHE`` names another place; empty, it means none.
    """
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
    """Name under which a mesh file's answer is kept: of its bytes and its kind.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while part := file.read(1 << 20):
            digest.update(part)
    asked = f"{_VERSION}\0{path.suffix.lower()}"
    return hashlib.sha256(digest.digest() + asked.encode()).hexdigest()


def kept(folder: Path, key: str) -> tuple[bytes, bytes] | None:
    """Vertices and triangles that were kept, as bytes; None where nothing whole is there."""
    try:
        head, _, body = (folder / key).read_bytes().partition(b"\n")
        said = json.loads(head)
        count, digest = int(said["vertices"]), str(said["sha256"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if hashlib.sha256(body).hexdigest() != digest or not 0 <= count <= len(body):
        return None
    with contextlib.suppress(OSError):
        os.utime(folder / key)  # the longest unused go first
    return body[:count], body[count:]


def keep(folder: Path, key: str, vertices: bytes, faces: bytes) -> None:
    """Keep an answer; a full disk, or one that cannot be written, is no error."""
    body = vertices + faces
    if len(body) > _LARGEST:
        return
    head = {"vertices": len(vertices), "sha256": hashlib.sha256(body).hexdigest()}
    with contextlib.suppress(OSError, PinsingError):
        write_bytes(folder / key, json.dumps(head).encode() + b"\n" + body)
        _prune(folder)


def _prune(folder: Path) -> None:
    files = [(p, p.stat()) for p in folder.iterdir() if p.is_file()]
    total = sum(found.st_size for _, found in files)
    for path, found in sorted(files, key=lambda f: f[1].st_mtime):
        if total <= _MOST_BYTES:
            break
        path.unlink(missing_ok=True)
        total -= found.st_size
