"""The files that a xacro may read: the parent's side, which alone opens any.

xacro runs in a child that can open nothing. It asks for files, wildcards and packages; here is
judged what it gets: plain files within the robot's own folder or a package. Where the user has
named the package (an option, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH) a link in it may lead anywhere,
as links of a workspace do; in a folder that merely came with the file it may not. Environment
variables are asked for as well: they may hold passwords, and what a file makes of them may be
passed on, so that only those are shown that belong to robots or that the user has named.
"""

from __future__ import annotations

import fnmatch
import glob
import os
import re
from pathlib import Path
from typing import Any

from pinsing.description.ros_packages import PackageIndex

_MOST_BYTES = 64 * 2**20
_MOST_QUESTIONS = 5000
_MOST_FOUND = 1000
_MOST_STEPS = 20_000


SHOWN = ("ROS_*", "AMENT_*", "GAZEBO_*", "GZ_*")
"""Environment variables that any file may read: they configure robots, and are no secret."""
MORE_SHOWN = "PINSING_XACRO_ENV"
"""The variable by which a user names more of them, separated by commas."""


def _variable(name: str) -> dict[str, Any]:
    """Value of an environment variable, ``hidden`` where it is not for files, or ``unset``."""
    if name not in os.environ:
        return {"unset": True}
    named = [word.strip() for word in os.environ.get(MORE_SHOWN, "").split(",")]
    if any(fnmatch.fnmatchcase(name, pattern) for pattern in (*SHOWN, *named) if pattern):
        return {"value": os.environ[name]}
    return {
        "problem": f"the environment variable {name!r} is not shown to files: set "
        f"{MORE_SHOWN}={name} if this one may read it"
    }


def _fits(name: str, part: str) -> bool:
    """Return True if a name is one that a part of a pattern stands for, as `glob` has it."""
    if not glob.has_magic(part):
        return name == part
    return (part[0] == "." or name[0] != ".") and fnmatch.fnmatchcase(name, part)


class XacroFiles:
    """Answers the questions of one xacro process.

    Parameters
    ----------
    index : PackageIndex
        Packages that may be used.
    largest : int
        Largest file that is read, bytes.
    """

    def __init__(self, index: PackageIndex, largest: int) -> None:
        self.index, self.largest = index, largest
        self._left, self._questions = _MOST_BYTES, _MOST_QUESTIONS

    def answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return what a question asks for, or ``problem`` or ``missing`` with the reason."""
        self._questions -= 1
        if self._questions < 0:
            return {"problem": f"more than {_MOST_QUESTIONS} files are asked for"}
        text = str(question.get("text", ""))
        if "\0" in text:
            return {"problem": "a file name holds a null character"}
        kind = question.get("ask")
        if kind == "env":
            return _variable(text)
        if kind == "find":
            folder = self.index.find(text)
            return {"folder": None if folder is None else str(folder)}
        try:
            return self._found(text) if kind == "glob" else self._content(Path(text))
        except OSError as error:
            return {"missing": error.strerror or "cannot be read", "errno": error.errno}
        except RuntimeError:  # links in a ring
            return {"problem": f"{text} cannot be read"}

    def _found(self, pattern: str) -> dict[str, Any]:
        # The fixed part of the pattern: whatever the rest finds lies below it.
        fixed = re.split(r"[*?\[]", pattern, maxsplit=1)[0]
        if ".." in pattern[len(fixed) :].split("/"):
            return {"problem": f"{pattern} leads upward after a wildcard"}
        if self._real(Path(os.path.dirname(fixed))) is None:
            return {"problem": self._outside(pattern)}
        start = os.path.dirname(fixed)
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
                if steps > _MOST_STEPS:
                    return {"problem": f"{pattern} looks at more than {_MOST_STEPS} files"}
                for name in names:
                    path = os.path.join(folder, name)
                    if not _fits(name, part) or not os.path.lexists(path):
                        continue
                    # A folder that links lead to again holds nothing new; one outside is not read.
                    if last:
                        below[path] = path
                    elif os.path.isdir(path) and self._real(Path(path)) is not None:
                        below.setdefault(os.path.realpath(path), path)
            folders = list(below.values())
        if len(folders) > _MOST_FOUND:
            return {"problem": f"{pattern} finds more than {_MOST_FOUND} files"}
        return {"names": sorted(folders)}

    def _content(self, path: Path) -> dict[str, Any]:
        real = self._real(path)
        if real is None:
            return {"problem": self._outside(str(path))}
        if real.exists() and not real.is_file():
            return {"problem": f"{path} is not a plain file"}
        with real.open("rb") as stream:
            data = stream.read(self.largest + 1)
        if len(data) > self.largest:
            return {"problem": f"{path} is larger than {self.largest // 2**20} MiB"}
        self._left -= len(data)
        if self._left < 0:
            return {"problem": f"more than {_MOST_BYTES // 2**20} MiB of files are asked for"}
        try:
            return {"text": data.decode("utf-8")}
        except UnicodeDecodeError:
            return {"problem": f"{path} is not UTF-8 text"}

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
