"""xacro files turned into URDF text, in a process of their own.

What xacro allows a file to do, and so what a file from a stranger may do:

- include any file that the user may read (``<xacro:include>``, with wildcards), and load any YAML
  file (``xacro.load_yaml``, by the safe loader);
- read environment variables (``$(env X)``, ``$(optenv X)``) and the working folder (``$(cwd)``);
- evaluate Python expressions (``${...}``, ``$(eval ...)``) with a few builtins and ``math``. Names
  with two underscores are meant to be out of reach, but xacro 2.1 checks only the outermost code,
  so that ``${(lambda: ...)()}`` can run anything.

pinsing therefore runs it in a child process that refuses expressions reaching for Python's
internals, cannot write files, and is limited in time and memory. That makes accidents harmless and
attacks hard; it is no sandbox. Expand a file from a stranger on a machine that you can spare, or
read it first.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pinsing.description import ros_packages as packages_module
from pinsing.description.xml_tree import MAX_BYTES, Node
from pinsing.errors import RobotFileError

TIMEOUT_SECONDS = 6
_MEMORY = 2 * 2**30
_WORKER = Path(__file__).with_name("xacro_worker.py")


@dataclass(frozen=True)
class Expansion:
    """What xacro made of a file: URDF text, package folders it used, and its warnings."""

    xml: str
    package_folders: tuple[Path, ...]
    warnings: tuple[str, ...]


def is_xacro(path: Path, root: Node) -> bool:
    """Tell whether a file is still to be expanded.

    The suffix says so, or an element does. The namespace alone does not: files that xacro wrote
    keep it.
    """
    return path.suffix.lower() == ".xacro" or any(
        node.tag.startswith("xacro:") for child in root.children for node in _outside_gazebo(child)
    )


def _outside_gazebo(node: Node) -> list[Node]:
    return [] if node.tag == "gazebo" else list(node.walk())


def expand_xacro(
    path: Path,
    packages: Mapping[str, str | Path] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Expansion:
    """Return the URDF that xacro makes of a file.

    Parameters
    ----------
    path : Path
        The xacro file.
    packages : Mapping of str to path, optional
        Folders of packages by name, for ``$(find NAME)``.
    arguments : Mapping of str to str, optional
        Values for the file's ``<xacro:arg>``.

    Raises
    ------
    RobotFileError
        With the file, which may be an included one, and the line where it is known: malformed XML,
        a missing include or package, an undefined name, a bad expression, an argument that is
        missing or that the file does not have, or an expansion that does not end.
    """
    request = {
        "path": os.path.abspath(path),
        "packages": {name: os.fspath(folder) for name, folder in (packages or {}).items()},
        "arguments": {name: str(value) for name, value in (arguments or {}).items()},
        "packages_module": packages_module.__file__,
        "sys_path": [os.path.abspath(entry) for entry in sys.path],
        "seconds": TIMEOUT_SECONDS + 2,  # the clock is to strike first, it says more
        "memory": _MEMORY,
        "max_bytes": MAX_BYTES,
    }
    try:
        child = subprocess.run(
            [sys.executable, "-I", "-B", str(_WORKER)],
            input=json.dumps(request).encode(),
            capture_output=True,
            timeout=TIMEOUT_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise RobotFileError(
            f"xacro does not end within {TIMEOUT_SECONDS} s: expand it by hand (xacro FILE) "
            "and give the result",
            path,
        ) from error
    except OSError as error:
        raise RobotFileError(f"xacro cannot be started: {error.strerror}", path) from error
    if child.returncode != 0:
        raise RobotFileError(
            f"xacro stopped with code {child.returncode}, out of memory or time: expand it by hand "
            "(xacro FILE) and give the result",
            path,
        )
    answer = json.loads(child.stdout)
    if "problem" in answer:
        file = answer.get("file")
        same = file is None or os.path.abspath(file) == request["path"]
        raise RobotFileError(
            _printable(answer["problem"]), path if same else file, answer.get("line")
        )
    if answer["unknown"]:
        known = ", ".join(n for n in answer["known"] if n not in answer["unknown"]) or "none"
        names = ", ".join(answer["unknown"])
        raise RobotFileError(f"has no xacro argument {names} (it has: {known})", path)
    return Expansion(
        answer["xml"],
        tuple(Path(folder) for folder in answer["folders"]),
        tuple(dict.fromkeys(_printable(warning) for warning in answer["warnings"])),
    )


def _printable(text: str) -> str:
    """Return text of the file's making with its control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
