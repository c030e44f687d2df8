"""Whether the compiled kernel was built from the C++ sources that lie beside the Python.

A checkout that is used in place moves on under its kernel: Python then calls functions whose
arguments have changed, and the kernel answers with errors, or with numbers that mean something
else. The build writes a fingerprint of its sources into the kernel (CMakeLists.txt).
"""

from __future__ import annotations

import hashlib
from pathlib import Path

SUFFIXES = (".cpp", ".hpp", ".pyi")


def fingerprint(folder: Path) -> str | None:
    """SHA-256 of the names and contents of the sources in a folder; None where there are none."""
    files = sorted((f for f in folder.iterdir() if f.suffix in SUFFIXES), key=lambda f: f.name)
    if not any(f.suffix == ".cpp" for f in files):
        return None
    lines = (f"{f.name}:{hashlib.sha256(f.read_bytes()).hexdigest()}\n" for f in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def why_stale(built: object, folder: Path) -> str | None:
    """Return why a kernel with fingerprint ``built`` is not used; None where it fits its sources.

    Without sources there is nothing to compare: the kernel came with its Python. One without a
    fingerprint (None), beside sources, is an old one.
    """
    try:
        here = fingerprint(folder)
    except OSError:
        return None
    if here is None or here == built:
        return None
    return (
        "the compiled batch engine is older or newer than the sources of pinsing in "
        f"{folder.parent}: build it again with pip install (pip install -e . in a checkout)"
    )
