"""xacro files turned into URDF text, in a process of their own.

What xacro allows a file to do, and so what a file from a stranger may do here:

- read files within its own folder and the packages that it names (``<xacro:include>``, with
  wildcards, and ``xacro.load_yaml``, by the safe loader);
- read the environment variables ``ROS_*``, ``AMENT_*``, ``GAZEBO_*`` and ``GZ_*`` (``$(env X)``,
  ``$(optenv X)``), and those that the user names in ``PINSING_XACRO_ENV`` (names or patterns,
  separated by commas); any other that is set is refused, for it may hold a password;
- learn the names of folders: the working one (``$(cwd)``), its own, and those of packages
  (``$(find X)``), as the addresses of meshes need them;
- compute: ``${...}`` and ``$(eval ...)`` are interpreted over a white list
  (`pinsing.description.xacro_expression`), never handed to Python.

xacro runs in a child process, limited in time and memory, that opens no file itself: this process
reads for it (`pinsing.description.xacro_files`). Where the kernel allows it, the child can open no
file or socket and start no process at all.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pinsing._dataclass import dataclass
from pinsing.description import child_jail
from pinsing.description.ros_packages import PackageIndex
from pinsing.description.xacro_files import XacroFiles
from pinsing.description.xml_tree import MAX_BYTES, Node
from pinsing.errors import RobotFileError

TIMEOUT_SECONDS = 12
"""Processor time of the child, which a busy machine does not use up."""
_PATIENCE = 10  # times that on the clock, whatever else runs
_FAREWELL = 1.0
_MEMORY = 2 * 2**30
_LONGEST_ANSWER = 256 * 2**20
_WALL = True  # tests leave it out, to see that nothing depends on it
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
    index = PackageIndex(path, packages, named=True)
    request = {
        "path": str(index.file),
        "arguments": {name: str(value) for name, value in (arguments or {}).items()},
        "sys_path": [os.path.abspath(entry) for entry in sys.path],
        "seconds": TIMEOUT_SECONDS,
        "memory": _MEMORY,
        "wall": _WALL,
    }
    answer = _converse(path, request, XacroFiles(index, MAX_BYTES))
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
    warnings = list(answer["warnings"])
    if answer["no_wall"]:
        warnings.append(
            f"xacro ran without the kernel's wall, by its white list alone: {answer['no_wall']}"
        )
    return Expansion(
        answer["xml"],
        index.used(),
        tuple(dict.fromkeys(_printable(warning) for warning in warnings)),
    )


def _converse(path: Path, request: dict[str, Any], files: XacroFiles) -> dict[str, Any]:
    """Start the child, answer its questions, and return its answer."""
    import subprocess  # most robots are no xacro, and a start can do without

    try:
        child = subprocess.Popen(
            [sys.executable, "-I", "-B", str(_WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        raise RobotFileError(f"xacro cannot be started: {error.strerror}", path) from error
    late = threading.Event()

    def stop() -> None:
        late.set()
        child.kill()

    clock = threading.Timer(TIMEOUT_SECONDS * _PATIENCE, stop)
    clock.daemon = True
    clock.start()
    answer: dict[str, Any] | None = None
    assert child.stdin is not None
    assert child.stdout is not None
    try:
        with child.stdin, child.stdout:
            child.stdin.write(json.dumps(request).encode() + b"\n")
            child.stdin.flush()
            while answer is None:
                line = child.stdout.readline(_LONGEST_ANSWER)
                if not line.endswith(b"\n"):
                    break
                message = json.loads(line)
                answer = message.get("answer")
                if answer is None:
                    child.stdin.write(json.dumps(files.answer(message)).encode() + b"\n")
                    child.stdin.flush()
        if answer is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(_FAREWELL)  # of itself, so that its exit code says why
    except (BrokenPipeError, ConnectionResetError):
        child.wait()  # it has ended; why is told below
    finally:
        clock.cancel()
        child.kill()
        code = child.wait()
    if answer is not None:
        return answer
    if late.is_set() or code in child_jail.OUT_OF_TIME:
        raise RobotFileError(
            f"xacro does not end within {TIMEOUT_SECONDS} s: expand it by hand (xacro FILE) "
            "and give the result",
            path,
        )
    raise RobotFileError(
        "xacro stopped, out of memory or time: expand it by hand (xacro FILE) and give the result",
        path,
    )


def _printable(text: str) -> str:
    """Return text of the file's making with its control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
