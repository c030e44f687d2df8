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
reads for it (`pinsing.description.xacro`). Where the kernel allows it, the child can open no
file or socket and start no process at all.
"""

from __future__ import annotations

import contextlib
import fnmatch
import glob
import json
import os
import re
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pinsing.description import child_jail
from pinsing.description.ros_packages import LARGEST, PackageIndex
from pinsing.description.xml_tree import MAX_BYTES, Node
from pinsing.errors import Refusal, RobotFileError

_MOST_BYTES = 64 << 20
_MOST_FILES = 5000
_MOST_STEPS = 20_000


SHOWN = ("ROS_*", "AMENT_*", "GAZEBO_*", "GZ_*")
"""Environment variables that any file may read: they configure robots, and are no secret."""
MORE_SHOWN = "PINSING_XACRO_ENV"
"""The variable by which a user names more of them, separated by commas."""


class _Denied(Refusal):
    """What a file may not have, and why."""


def _variable(name: str) -> str | None:
    """Value of an environment variable that files may see; None where it is not set."""
    named = [word.strip() for word in os.environ.get(MORE_SHOWN, "").split(",")]
    shown = any(fnmatch.fnmatchcase(name, pattern) for pattern in (*SHOWN, *named) if pattern)
    _Denied.refuse_if(
        name in os.environ and not shown,
        f"the environment variable {name!r} is not shown to files: set "
        f"{MORE_SHOWN}={name} if this one may read it",
    )
    return os.environ.get(name)


class XacroFiles:
    """Answers the questions of one xacro process, by files of at most ``largest`` bytes."""

    def __init__(self, index: PackageIndex, largest: int) -> None:
        self.index, self.largest = index, largest
        self._left, self._questions = _MOST_BYTES, _MOST_FILES

    def answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return what was ``found``, or ``problem`` or ``missing`` with the reason."""
        text = str(question.get("text", ""))
        try:
            return {"found": self._found(str(question.get("ask")), text)}
        except _Denied as problem:
            return {"problem": str(problem)}
        except OSError as error:
            return {"missing": error.strerror or "cannot be read", "errno": error.errno}
        except RuntimeError:  # links in a ring
            return {"problem": f"{text} cannot be read"}

    def _found(self, kind: str, text: str) -> Any:
        self._questions -= 1
        _Denied.refuse_if(self._questions < 0, f"more than {_MOST_FILES} files are asked for")
        _Denied.refuse_if("\0" in text, "a file name holds a null character")
        match kind:
            case "env":
                return _variable(text)
            case "find":
                folder = self.index.find(text)
                return None if folder is None else str(folder)
            case "glob":
                return self._names(text)
        return self._content(Path(text))

    def _names(self, pattern: str) -> list[str]:
        # The fixed part of the pattern: whatever the rest finds lies below it.
        fixed = re.split(r"[*?\[]", pattern, maxsplit=1)[0]
        upward = ".." in pattern[len(fixed) :].split("/")
        _Denied.refuse_if(upward, f"{pattern} leads upward after a wildcard")
        start = os.path.dirname(fixed)
        _Denied.refuse_if(self._real(Path(start)) is None, self._outside(pattern))
        parts = [part for part in pattern[len(start) :].split("/") if part]
        folders, steps = [start], 0
        for depth, part in enumerate(parts):
            last, below = depth == len(parts) - 1, {}
            for folder in folders:
                try:
                    names = sorted(os.listdir(folder or ".")) if glob.has_magic(part) else [part]
                except OSError:
                    continue
                steps += 1 + len(names)
                _Denied.refuse_if(
                    steps > _MOST_STEPS, f"{pattern} looks at more than {_MOST_STEPS} files"
                )
                for name in names:
                    path = os.path.join(folder, name)
                    hidden = name[0] == "." != part[0]
                    fits = not hidden and fnmatch.fnmatchcase(name, part)
                    if not fits or not os.path.lexists(path):
                        continue
                    # A folder that links lead to again holds nothing new; one outside is not read.
                    if last:
                        below[path] = path
                    elif os.path.isdir(path) and self._real(Path(path)) is not None:
                        below.setdefault(os.path.realpath(path), path)
            folders = list(below.values())
        many = len(folders) > _MOST_FILES
        _Denied.refuse_if(many, f"{pattern} finds more than {_MOST_FILES} files")
        return sorted(folders)

    def _content(self, path: Path) -> str:
        if (real := self._real(path)) is None:
            raise _Denied(self._outside(str(path)))
        _Denied.refuse_if(real.exists() and not real.is_file(), f"{path} is not a plain file")
        with real.open("rb") as stream:
            data = stream.read(self.largest + 1)
        most = f"{self.largest // 2**20} MiB"
        _Denied.refuse_if(len(data) > self.largest, f"{path} is larger than {most}")
        self._left -= len(data)
        most = f"{_MOST_BYTES // 2**20} MiB"
        _Denied.refuse_if(self._left < 0, f"more than {most} of files are asked for")
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError:
            raise _Denied(f"{path} is not UTF-8 text") from None

    def _real(self, path: Path) -> Path | None:
        """Return where a path leads, None where that may not be read."""
        real = path.resolve()
        if path == self.index.file or any(
            real.is_relative_to(root.resolve()) for root in self.index.roots()
        ):
            return real
        plain = Path(os.path.normpath(path))
        named = (*self.index.given.values(), *self.index.environment())
        return plain if any(plain.is_relative_to(folder) for folder in named) else None

    def _outside(self, path: str) -> str:
        return (
            f"{path} lies outside the robot's folder ({self.index.own_folder}) and its packages: "
            "give the folder it is in with --package NAME=DIR"
        )


TIMEOUT_SECONDS = 12
"""Processor time of the child, which a busy machine does not use up."""
_PATIENCE = 10  # times that on the clock, whatever else runs
_FAREWELL = 1.0
MEMORY = 2 << 30
_WALL = True  # tests leave it out, to see that nothing depends on it
_WORKER = Path(__file__).with_name("xacro_worker.py")


@dataclass(frozen=True)
class Expansion:
    """What xacro made of a file: URDF text, package folders it used, and its warnings."""

    xml: str
    package_folders: tuple[Path, ...]
    warnings: tuple[str, ...]


def is_xacro(path: Path, root: Node) -> bool:
    """Return True if the suffix or an element says that a file is to be expanded."""
    # The namespace alone does not: files that xacro wrote keep it.
    return path.suffix.lower() == ".xacro" or any(
        node.tag.startswith("xacro:")
        for child in root.children
        if child.tag != "gazebo"
        for node in child.walk()
    )


def expand_xacro(
    path: Path,
    packages: Mapping[str, str | Path] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Expansion:
    """Return the URDF that xacro makes of a file; errors name the file and, if known, line."""
    index = PackageIndex(path, packages, named=True)
    request = {
        "path": str(index.file),
        "arguments": {name: str(value) for name, value in (arguments or {}).items()},
        "sys_path": [os.path.abspath(entry) for entry in sys.path],
        "seconds": TIMEOUT_SECONDS,
        "memory": MEMORY,
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
            [sys.executable, "-ISB", str(_WORKER)],
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
    gone = BrokenPipeError, ConnectionResetError  # why is told below
    try:
        with contextlib.suppress(*gone), child.stdin as told, child.stdout as said:
            line, reply = b"\n", request
            while answer is None and line.endswith(b"\n"):
                told.write(json.dumps(reply).encode() + b"\n")
                told.flush()
                line = said.readline(LARGEST)
                question = json.loads(line) if line.endswith(b"\n") else {}
                answer = question.get("answer")
                reply = files.answer(question) if "ask" in question else {}
        if answer is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(_FAREWELL)  # of itself, so that its exit code says why
    finally:
        clock.cancel()
        child.kill()
        code = child.wait()
    if answer is not None:
        return answer
    RobotFileError.refuse_if(
        late.is_set() or code in child_jail.OUT_OF_TIME,
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
