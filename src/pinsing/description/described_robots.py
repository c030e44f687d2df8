"""Robots of the package robot_descriptions, which are called ``rd:NAME``.

Importing one of that package's modules downloads a repository. pinsing does not do that: a robot
that is not on this computer is refused with a line that says what would have to be fetched.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from pinsing._dataclass import dataclass
from pinsing.errors import RobotFileError, UnknownNameError

PREFIX = "rd:"
PACKAGE = "robot_descriptions"
_CACHE = "ROBOT_DESCRIPTIONS_CACHE"
_CLONE = "clone_to_directory"
"""What the package calls that clones a repository, or fetches a commit into one."""


@dataclass(frozen=True)
class Described:
    """Where a robot of the package is.

    Attributes
    ----------
    path : Path
        URDF, xacro or MuJoCo model.
    folders : tuple of Path
        Folders that hold its packages.
    packages : mapping of str to Path
        Its own package, by name.
    xacro_args : mapping of str to str
        Arguments of its xacro.
    """

    path: Path
    folders: tuple[Path, ...]
    packages: Mapping[str, Path]
    xacro_args: Mapping[str, str]


def described_robots() -> dict[str, tuple[str, str]]:
    """Title and remark of each robot by its name, ``rd:`` included; none without the package.

    Only those that are a URDF, a xacro or a MuJoCo model; most of them are.
    """
    if importlib.util.find_spec(PACKAGE) is None:
        return {}
    found = {}
    for name, what in sorted(_descriptions().items()):
        title = f"{getattr(what, 'maker', '') or ''} {getattr(what, 'robot', name)}".strip()
        missing = _missing(what)
        found[PREFIX + name] = (title, "not on this computer" if missing else "")
    return found


def described_robot(name: str) -> Described:
    """Find a robot that is on this computer.

    Raises
    ------
    RobotFileError
        If the package is not installed, the robot is not on this computer, or it is broken.
    UnknownNameError
        If the package knows no such robot.
    """
    if importlib.util.find_spec(PACKAGE) is None:
        raise RobotFileError(
            f"is a robot of the package {PACKAGE}, which is not installed: "
            "pip install 'pinsing[descriptions]'",
            Path(name),
        )
    known = _descriptions()
    plain = name.removeprefix(PREFIX)
    if plain not in known:
        names = [PREFIX + n for n in known]
        raise UnknownNameError("robot", name, names, hint="pinsing list rd: shows all names")
    missing = _missing(known[plain])
    if missing:
        raise RobotFileError(
            f"is not on this computer: {missing} would have to be downloaded, which pinsing does "
            f"not do; `robot_descriptions pull {plain}` does it",
            Path(name),
        )
    return _paths(_module(name, plain), name)


def _descriptions() -> Mapping[str, Any]:
    package = importlib.import_module(PACKAGE)
    found: Mapping[str, Any] = getattr(package, "DESCRIPTIONS", {})
    return found


def _missing(what: Any) -> str:
    """Address of the repository of a robot that is not in the cache; empty where it is."""
    repositories = importlib.import_module(f"{PACKAGE}._repositories").REPOSITORIES
    repository = repositories.get(getattr(what, "repository", None))
    if repository is None:
        return "its repository"
    cache = os.path.expanduser(os.environ.get(_CACHE, "~/.cache/robot_descriptions"))
    return "" if Path(cache, repository.cache_path).is_dir() else str(repository.url)


def _module(name: str, plain: str) -> ModuleType:
    """Import the module of a robot whose repository is here; what it prints is dropped."""
    try:
        with contextlib.redirect_stdout(io.StringIO()), _without_git():
            return importlib.import_module(f"{PACKAGE}.{plain}")
    except Exception as error:  # git, the network, or the module itself: all of another package
        reason = " ".join(str(error).split())[:200]
        raise RobotFileError(
            f"the package {PACKAGE} fails: {reason or type(error).__name__}", Path(name)
        ) from None


@dataclass(frozen=True)
class _Clone:
    """As much of a clone as the package asks for."""

    working_dir: str


@contextlib.contextmanager
def _without_git() -> Iterator[None]:
    """Let the package take folders of its cache as they are, whole or not, and fetch nothing."""
    try:
        cache = importlib.import_module(f"{PACKAGE}._cache")
    except ModuleNotFoundError as error:
        if error.name != f"{PACKAGE}._cache":
            raise
        yield
        return
    before = getattr(cache, _CLONE, None)

    def here(repo_url: str, target_dir: str, commit: str | None = None) -> _Clone:
        return _Clone(target_dir)

    setattr(cache, _CLONE, here)
    try:
        yield
    finally:
        setattr(cache, _CLONE, before)


def _paths(module: ModuleType, name: str) -> Described:
    for key in ("URDF_PATH", "XACRO_PATH", "MJCF_PATH"):
        path = getattr(module, key, None)
        if path is not None:
            break
    else:
        raise RobotFileError("comes neither as a URDF, a xacro nor a MuJoCo model", Path(name))
    if not Path(path).is_file():
        plain = name.removeprefix(PREFIX)
        raise RobotFileError(
            f"is not whole on this computer: there is no {path}. What is missing would have to be "
            f"downloaded, which pinsing does not do; `robot_descriptions pull {plain}` does it",
            Path(name),
        )
    folders = [
        Path(folder).parent if key == "PACKAGE_PATH" else Path(folder)
        for key in ("PACKAGE_PATH", "REPOSITORY_PATH")
        if (folder := getattr(module, key, None))
    ]
    arguments = getattr(module, "XACRO_ARGS", {}) if key == "XACRO_PATH" else {}
    package = getattr(module, "PACKAGE_PATH", None)
    return Described(
        path=Path(path),
        folders=tuple(folders),
        packages={Path(package).name: Path(package)} if package else {},
        xacro_args={str(k): str(v) for k, v in arguments.items()},
    )
