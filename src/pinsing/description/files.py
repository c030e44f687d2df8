"""Files of a robot description: packages, meshes, and xacro files turned into URDF text.

``package://NAME/...`` and ``$(find NAME)`` are looked up in this order: the folders given by the
user, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, then upward from the file. A mesh is taken only from
within the robot's own folders or a package found in this way, links resolved; anything else is
named and left alone. Meshes are looked for when the robot is drawn and not when it is loaded.

xacro runs in a process of its own. What it allows a file to do, and so what a file from a stranger
may do here:

- read files within its own folder and the packages that it names (``<xacro:include>``, with
  wildcards, and ``xacro.load_yaml``, by the safe loader);
- read the environment variables ``ROS_*``, ``AMENT_*``, ``GAZEBO_*`` and ``GZ_*`` (``$(env X)``,
  ``$(optenv X)``), and those that the user names in ``PINSING_XACRO_ENV`` (names or patterns,
  separated by commas); any other that is set is refused, for it may hold a password;
- learn the names of folders: the working one (``$(cwd)``), its own, and those of packages
  (``$(find X)``), as the addresses of meshes need them;
- compute: ``${...}`` and ``$(eval ...)`` are interpreted over a white list
  (`pinsing.description.xacro_expression`), never handed to Python.

The child process, limited in time and memory, opens no file itself: this process reads for it.
Where the kernel allows it, the child can open no file or socket and start no process at all.
"""

from __future__ import annotations

import contextlib
import fnmatch
import glob
import itertools
import json
import os
import re
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote
from xml.parsers import expat

from pinsing.description import child_jail
from pinsing.description.xml_tree import MAX_BYTES, Node, show
from pinsing.errors import Refusal, RobotFileError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# How far above the file a package is looked for, and how far without a package.xml to name it.
_LEVELS_UP = 6
_LEVELS_UP_UNNAMED = 2
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*")
_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_MESH_SUFFIXES = frozenset(
    [
        ".stl",
        ".stla",
        ".stlb",
        ".dae",
        ".obj",
        ".ply",
        ".glb",
        ".gltf",
        ".off",
        ".wrl",
        ".3ds",
        ".fbx",
        ".msh",
        ".x3d",
        ".iv",
        ".usd",
    ]
)
_IMAGE_SUFFIXES = frozenset([".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".gif"])


class MeshProblem(Refusal):
    """A mesh that may not be opened."""


class MissingMesh(MeshProblem):
    """A mesh that is not there."""


class ColladaProblem(MeshProblem):
    """A file that cannot be judged."""


class PackageIndex:
    """The packages and mesh files that one description file (None: text) may use.

    ``packages`` are folders by name, which win over all else; ``roots`` more folders of meshes,
    used by its xacro. ``named``: folders above the file, or beside these, count only if their
    package.xml names the package: any file in them can be read, not only meshes.
    """

    def __init__(
        self,
        file: Path | None,
        packages: Mapping[str, str | Path] | None = None,
        roots: tuple[Path, ...] = (),
        *,
        named: bool = False,
    ) -> None:
        self.file = None if file is None else Path(os.path.abspath(file))
        self.given = {name: Path(os.path.abspath(d)) for name, d in (packages or {}).items()}
        self._more_roots, self._named = roots, named
        # As they are now: meshes are looked for later, and are still those of the file as loaded.
        ros, ament = _folders("ROS_PACKAGE_PATH"), _folders("AMENT_PREFIX_PATH")
        self._environment = (*ros, *(prefix / "share" for prefix in ament))
        self._ros = [_absolute(folder) for folder in ros]
        self._ament = [_absolute(folder) for folder in ament]
        self._home = Path(os.path.expanduser("~"))
        self._found: dict[str, Path | None] = {}

    def find(self, name: str) -> Path | None:
        """Return the folder of a package, None where there is none."""
        if name not in self._found:
            places = self._places(name) if _NAME.fullmatch(name) else ()
            self._found[name] = next((folder for folder in places if folder.is_dir()), None)
        return self._found[name]

    def used(self) -> tuple[Path, ...]:
        """Return the folders of the packages found so far."""
        return tuple(dict.fromkeys(d for d in self._found.values() if d is not None))

    def environment(self) -> tuple[Path, ...]:
        """Return the folders of packages that the user's environment names."""
        return tuple(folder for folder in self._environment if folder.is_absolute())

    def _places(self, name: str) -> Iterator[Path]:
        """Yield the folders that the package of a name may be, if they are there, in order."""
        if name in self.given:
            yield self.given[name]
            return
        for entry in self._ros:
            if _is_package(entry, name) or entry.name == name:
                yield entry
            yield entry / name
            with contextlib.suppress(OSError):
                inner = [file.parent for file in sorted(entry.glob("*/package.xml"))]
                yield from (folder for folder in inner if _is_package(folder, name))
        yield from (prefix / "share" / name for prefix in self._ament)
        for level, folder in enumerate(self._ancestors):
            own, sibling = not self._named or folder == self.own_folder, folder / name
            if _is_package(folder, name) or (own and folder.name == name):
                yield folder
            near = level < _LEVELS_UP_UNNAMED or (sibling / "package.xml").is_file()
            if _is_package(sibling, name) or (own and near):
                yield sibling

    @cached_property
    def _ancestors(self) -> tuple[Path, ...]:
        if self.file is None:
            return ()
        # Never the file system's root, nor the home folder: their children are not packages.
        ends = (self._home, Path(self.file.anchor))
        parents = self.file.parents[:_LEVELS_UP]
        return tuple(itertools.takewhile(lambda folder: folder not in ends, parents))

    @cached_property
    def own_folder(self) -> Path | None:
        """Return the folder that the description file and its meshes live in, if there is a file.

        The package around the file, else the folder around ``urdf``, ``robots`` or ``xacro``, else
        the folder of the file.
        """
        if self.file is None:
            return None
        for folder in self._ancestors[:3]:
            if (folder / "package.xml").is_file():
                return folder
        here = self.file.parent
        if here.name in ("urdf", "urdfs", "robots", "xacro") and here.parent in self._ancestors:
            return here.parent
        return here

    def mesh(self, uri: str) -> Path:
        """Return the file that a mesh or texture address points to."""
        MeshProblem.refuse_if("\0" in uri or not uri.strip(), "is no file name")
        path = self._locate(uri.strip())
        try:
            real = self._inside(path, "lies outside the robot's folders")
            suffixes = _MESH_SUFFIXES | _IMAGE_SUFFIXES
            MeshProblem.refuse_if(
                real.suffix.lower() not in suffixes, "is not of a known mesh format"
            )
            MissingMesh.refuse_if(not real.is_file(), "no such file")
        except (OSError, RuntimeError) as error:
            raise MissingMesh("cannot be read") from error
        return path

    def drawable(self, uri: str) -> Path:
        """As `mesh`; a Collada mesh may not have the viewer embed a file from elsewhere."""
        path = self.mesh(uri)
        if path.suffix.lower() == ".dae":
            try:
                names = image_references(path)
            except OSError as error:
                raise MeshProblem(str(error)) from error
            for name in names:
                self._require_image(path.parent / name)  # as the viewer finds it
        return path

    def _require_image(self, path: Path) -> None:
        try:
            real = self._inside(path, "refers to a file outside the robot's folders")
        except (OSError, RuntimeError, ValueError) as error:
            raise MeshProblem("refers to a file that cannot be read") from error
        MeshProblem.refuse_if(
            real.suffix.lower() not in _IMAGE_SUFFIXES, "refers to a file that is no image"
        )

    def _inside(self, path: Path, otherwise: str) -> Path:
        """Return where a path leads, which must be within the robot's folders."""
        real = path.resolve()
        MeshProblem.refuse_if(not is_below(real, self.roots()), otherwise)
        return real

    def _locate(self, uri: str) -> Path:
        scheme, separator, rest = uri.partition("://")
        if not separator or scheme == "file":
            place = unquote(rest) if separator else uri
            MeshProblem.refuse_if(
                self.file is None and not os.path.isabs(place), "has no folder to be looked for in"
            )
            return Path(os.path.normpath(os.path.join(self.file or "", "..", place)))
        MeshProblem.refuse_if(
            scheme not in ("package", "model"), f"{scheme}:// addresses are not opened"
        )
        name, _, inner = rest.lstrip("/").partition("/")
        MeshProblem.refuse_if(not _NAME.fullmatch(name), "is no package name")
        if (folder := self.find(name)) is None:
            raise MissingMesh(f"package {name!r} not found")
        path = Path(os.path.normpath(os.path.join(folder, *inner.split("/")))) if inner else folder
        MeshProblem.refuse_if(not path.is_relative_to(folder), "lies outside its package")
        return path

    def roots(self) -> tuple[Path, ...]:
        """Return the folders that the robot's files may be in."""
        own = () if self.own_folder is None else (self.own_folder,)
        return (*own, *self.given.values(), *self._more_roots, *self.used())


def is_below(real: Path, folders: Iterable[Path]) -> bool:
    """Return True for a resolved path within one of some folders, links resolved."""
    return any(real.is_relative_to(folder.resolve()) for folder in folders)


def _folders(variable: str) -> list[Path]:
    return [Path(p) for p in os.environ.get(variable, "").split(os.pathsep) if p]


def _absolute(folder: Path) -> Path:
    try:
        return Path(os.path.abspath(folder))
    except OSError:  # the working folder is gone
        return folder


def _is_package(folder: Path, name: str) -> bool:
    try:
        with (folder / "package.xml").open(encoding="utf-8", errors="replace") as stream:
            found = _PACKAGE_NAME.search(stream.read(65536))
    except OSError:
        return False
    return found is not None and found[1] == name


LARGEST = 256 << 20
_END = re.compile(rb"</(?:[\w.-]+:)?COLLADA\s*>\s*\Z")


def image_references(path: Path) -> tuple[str, ...]:
    """Return the text of every ``<init_from>`` in the library of images; elsewhere it is a name."""
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        ColladaProblem.refuse_if(size > LARGEST, "is too large")
        # Not the most that is allowed: room for that would be made first, in milliseconds.
        data = stream.read(size + 1)
    ColladaProblem.refuse_if(len(data) != size, "changes while it is read")
    # Files are large: most are looked through twice and no more.
    ColladaProblem.refuse_if(
        (b"<!" in data and (b"<!DOCTYPE" in data or b"<!ENTITY" in data)) or b"\0" in data[:400],
        "has entities or an odd encoding",
    )
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
    """What became of the meshes of a description."""

    xml: str  # plain URDF. Its meshes and textures exist, as file:// addresses; others are left out
    # mesh and texture addresses, as in the file, that do not exist or may not be opened
    missing: tuple[str, ...]
    notes: tuple[str, ...]  # what is not drawn, in at most two notes


@dataclass(frozen=True)
class Shapes:
    """What a robot looks like: shapes and materials, and meshes that are looked for once.

    That is when ``found`` is first asked for: the addresses and the folders to look in are those of
    the time of loading, the files those that are there by then. Later changes of the folder are not
    seen. A copy that is pickled has found them, since addresses may mean nothing elsewhere.
    """

    text: str  # plain URDF, with the addresses of meshes as in the file
    index: PackageIndex = field(repr=False, compare=False)  # where they may be

    @cached_property
    def found(self) -> FoundMeshes:
        """The meshes that there are."""
        from xml.etree import ElementTree  # only what is drawn needs it

        root = ElementTree.fromstring(self.text)
        seen: dict[str, Path | MeshProblem] = {}

        def located(element: Element) -> bool:
            """Give an element the file:// address of its file; return False if there is none."""
            if (uri := element.get("filename", "")) not in seen:
                try:
                    seen[uri] = self.index.drawable(uri)
                except MeshProblem as problem:
                    seen[uri] = problem
            path = seen[uri]
            element.set("filename", f"file://{path}")
            return isinstance(path, Path)

        def locate_textures(of: Element) -> None:
            for material in of.iterfind("material"):
                texture = material.find("texture")
                if texture is not None and not located(texture):
                    material.remove(texture)

        for link in root.iterfind("link"):
            for shape in [child for child in link if child.tag in ("visual", "collision")]:
                mesh = shape.find("geometry/mesh")
                if mesh is None or located(mesh):
                    locate_textures(shape)
                else:
                    link.remove(shape)
        locate_textures(root)
        for material in root.findall("material"):
            if not len(material):
                root.remove(material)
        missing = {
            uri: problem for uri, problem in seen.items() if isinstance(problem, MeshProblem)
        }
        notes = []
        for lead, absent in (("not opened", False), ("not found", True)):
            some = [
                u for u, problem in missing.items() if isinstance(problem, MissingMesh) == absent
            ]
            if some:
                notes.append(
                    f"{len(some)} of {len(seen)} mesh files {lead} and not drawn, as "
                    f"{show(some[0], 90)} ({missing[some[0]]})"
                )
        xml = ElementTree.tostring(root, "unicode")
        return FoundMeshes(xml, tuple(missing), tuple(notes))

    def __getstate__(self) -> dict[str, object]:
        return {"text": self.text, "index": self.index, "found": self.found}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)


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
    """Answers the questions of one xacro process."""

    def __init__(self, index: PackageIndex) -> None:
        self.index = index
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
            data = stream.read(MAX_BYTES + 1)
        most = f"{MAX_BYTES // 2**20} MiB"
        _Denied.refuse_if(len(data) > MAX_BYTES, f"{path} is larger than {most}")
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
        if path == self.index.file or is_below(real, self.index.roots()):
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
    answer = _converse(path, request, XacroFiles(index))
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
    began, patience = time.monotonic(), TIMEOUT_SECONDS * _PATIENCE
    clock = threading.Timer(patience, child.kill)
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
        time.monotonic() - began > patience or code in child_jail.OUT_OF_TIME,
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
