"""Robots known by name: pinsing's own, those of example-robot-data, those of robot_descriptions.

The data package is found without importing it, or Pinocchio. A robot goes by the stem of its file
and by the name that example-robot-data's own loader gives it; ``Talos-Arm`` finds ``talos_arm``.
Robots of the package robot_descriptions are called ``rd:NAME``. Importing one of its modules would
download a repository; a robot that is not on this computer is refused with what is missing.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
import re
import sys
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from pinsing.errors import RobotFileError, UnknownNameError


def urdf_folder() -> Path:
    """Return the folder of DH tables, xacro and their URDFs; RobotFileError if there is none."""
    package = Path(__file__).resolve().parents[1]
    packaged, checkout = package / "urdf", package.parents[1] / "urdf"
    for folder in (packaged, checkout):
        if folder.is_dir():
            return folder
    raise RobotFileError("no such folder: install pinsing again, it is incomplete", packaged)


PREFIX = "rd:"
PACKAGE = "robot_descriptions"
_CACHE = "ROBOT_DESCRIPTIONS_CACHE"
_CLONE = "clone_to_directory"
"""What the package calls that clones a repository, or fetches a commit into one."""


def described_robot(name: str) -> CatalogEntry:
    """Return a robot of the package that is on this computer, or say what is missing."""
    RobotFileError.refuse_if(
        importlib.util.find_spec(PACKAGE) is None,
        f"is a robot of the package {PACKAGE}, which is not installed: "
        "pip install 'pinsing[descriptions]'",
        Path(name),
    )
    known = _descriptions()
    plain = name.removeprefix(PREFIX)
    if plain not in known:
        names = [PREFIX + n for n in known]
        raise UnknownNameError("robot", name, names, hint="pinsing list rd: shows all names")
    RobotFileError.refuse_if(
        missing := _missing(known[plain]),
        f"is not on this computer: {missing} would have to be downloaded, which pinsing does "
        f"not do; `robot_descriptions pull {plain}` does it",
        Path(name),
    )
    return _paths(_module(name, plain), name)


def _descriptions() -> Mapping[str, Any]:
    """What the package holds; nothing where it is not installed."""
    here = importlib.util.find_spec(PACKAGE) is not None
    return getattr(importlib.import_module(PACKAGE), "DESCRIPTIONS", {}) if here else {}


def _missing(what: Any) -> str:
    """Address of the repository of a robot that is not in the cache; empty where it is."""
    repositories = importlib.import_module(f"{PACKAGE}._repositories").REPOSITORIES
    if (repository := repositories.get(getattr(what, "repository", None))) is None:
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


@contextlib.contextmanager
def _without_git() -> Iterator[None]:
    """Let the package take folders of its cache as they are, whole or not, and fetch nothing."""
    known = importlib.util.find_spec(f"{PACKAGE}._cache") is not None
    cache = importlib.import_module(f"{PACKAGE}._cache") if known else SimpleNamespace()
    before = getattr(cache, _CLONE, None)

    def here(repo_url: str, target_dir: str, commit: str | None = None) -> SimpleNamespace:
        return SimpleNamespace(working_dir=target_dir)  # all that the package asks of a clone

    setattr(cache, _CLONE, here)
    try:
        yield
    finally:
        setattr(cache, _CLONE, before)


def _paths(module: ModuleType, name: str) -> CatalogEntry:
    keys = [k for k in ("URDF_PATH", "XACRO_PATH", "MJCF_PATH") if getattr(module, k, None)]
    RobotFileError.refuse_if(
        not keys, "comes neither as a URDF, a xacro nor a MuJoCo model", Path(name)
    )
    key, path = keys[0], Path(getattr(module, keys[0]))
    RobotFileError.refuse_if(
        not path.is_file(),
        f"is incomplete on this computer: there is no {path}. What is missing would have to be "
        f"downloaded, which pinsing does not do; `robot_descriptions pull "
        f"{name.removeprefix(PREFIX)}` does it",
        Path(name),
    )
    arguments = getattr(module, "XACRO_ARGS", {}) if key == "XACRO_PATH" else {}
    package = getattr(module, "PACKAGE_PATH", None)
    return CatalogEntry(
        name,
        path,
        name,
        PACKAGE,
        packages={Path(package).name: Path(package)} if package else {},
        xacro_args={str(k): str(v) for k, v in arguments.items()},
    )


_DATA = "example-robot-data"
_DATA_FOLDER = "cmeel.prefix/share/example-robot-data/robots"
_FILE_SUFFIXES = (".urdf", ".xacro", ".xml")

# Names of example-robot-data's loaders (robots_loader.py) that are not the stem of a file, with
# the folder and file; where the stem alone would be taken for another file, the loader wins. Arms
# whose file has their name stand here so that they are found without looking through all folders.
# Upstream loads UR5 for "ur3"; here it is UR3.
_LOADERS = {
    "alexander": "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "anymal_kinova": "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "asr_twodof": "asr_twodof_description/urdf/TwoDofs.urdf",
    "b1_z1": "b1_description/urdf/b1-z1.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "borinot": "borinot_description/urdf/borinot_flying_arm_2.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1_with_hands": "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
    "hector": "hector_description/robots/quadrotor_base.urdf",
    "hextilt": "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "icub": "icub_description/robots/icub.urdf",
    "iris": "iris_description/robots/iris_simple.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "romeo": "romeo_description/urdf/romeo.urdf",
    "so100": "so_arm_description/urdf/so100.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "talos_box": "talos_data/robots/talos_reduced_box.urdf",
    "talos_full": "talos_data/robots/talos_full_v2.urdf",
    "talos_full_box": "talos_data/robots/talos_full_v2_box.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
    "tiago_dual": "tiago_description/robots/tiago_dual.urdf",
    "tiago_no_hand": "tiago_description/robots/tiago_no_hand.urdf",
    "tiago_pro": "tiago_pro_description/robots/tiago_pro.urdf",
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur3_limited": "ur_description/urdf/ur3_joint_limited_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur5_limited": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "ur10_limited": "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
}
# Names that people use and no file or loader has.
_ALIASES = {
    "crb15000": "gofa5",
    "franka": "panda",
    "franka_panda": "panda",
    "franka_research_3": "fr3",
    "j2s6s200": "kinova",
    "jaco": "kinova",
    "kinova_j2s6s200": "kinova",
    "unitree_g1": "g1",
    "unitree_z1": "z1",
    "xarm": "xarm7",
    "xarm850": "uf850",
}
_TITLES = {
    "iiwa14": "KUKA LBR iiwa 14 R820",
    "irb1400": "ABB IRB 1400",
    "planar3r": "planar arm with three parallel axes",
    "puma560": "Unimation PUMA 560",
    "scara": "SCARA arm",
    "stanford": "Stanford arm",
    "surgical7": "7-joint surgical arm",
    "baxter": "Rethink Baxter",
    "g1": "Unitree G1",
    "icub": "iCub humanoid",
    "kinova": "Kinova Jaco j2s6s200",
    "panda": "Franka Emika Panda",
    "pr2": "Willow Garage PR2",
    "romeo": "Romeo humanoid",
    "so100": "SO-100 arm",
    "so101": "SO-101 arm",
    "talos": "PAL Robotics TALOS",
    "talos_arm": "left arm of PAL Robotics TALOS",
    "tiago": "PAL Robotics TIAGo",
    "tiago_dual": "PAL Robotics TIAGo with two arms",
    "tiago_no_hand": "PAL Robotics TIAGo without hand",
    "tiago_pro": "PAL Robotics TIAGo Pro",
    "ur10": "Universal Robots UR10",
    "ur3": "Universal Robots UR3",
    "ur5": "Universal Robots UR5",
    "xarm7": "UFACTORY xArm 7",
    "z1": "Unitree Z1",
}
_NOTES = {
    "hector": "a quadrotor without joints: nothing to analyse",
    "ur_ur3": "an empty file of the data package: take ur3",
}


@dataclass(frozen=True)
class CatalogEntry:
    """A robot that has a name.

    Attributes
    ----------
    name : str
        The name.
    path : Path
        Its URDF.
    title : str
        What it is, in words.
    source : str
        "pinsing" or "example-robot-data".
    tip, base : str or None
        Frames to take by default; None leaves the choice to the loader.
    alias_of : str or None
        The name that this one stands for.
    note : str
        What to know about it.
    packages : mapping of str to Path
        Folders of its own packages, by name.
    xacro_args : mapping of str to str
        Arguments that its xacro is to be given.
    """

    name: str
    path: Path
    title: str
    source: str
    tip: str | None = None
    base: str | None = None
    alias_of: str | None = None
    note: str = ""
    packages: Mapping[str, Path] = field(default_factory=dict)
    xacro_args: Mapping[str, str] = field(default_factory=dict)


@cache
def known_arms() -> dict[str, dict[str, Any]]:
    """Return what ``urdf/arms.yaml`` says of arms, by name."""
    import yaml

    text = (urdf_folder() / "arms.yaml").read_text(encoding="utf-8")
    arms: dict[str, dict[str, Any]] = yaml.load(
        text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    )
    return arms


def known_robots() -> dict[str, CatalogEntry]:
    """Return every known robot by name, sorted; pinsing's own names win."""
    entries = {**_table_arms(), **_data_robots(), **_own_robots()}
    for alias, name in _ALIASES.items():
        if name in entries and alias not in entries:
            target = entries[name]
            entries[alias] = replace(target, name=alias, alias_of=target.alias_of or name)
    return dict(sorted(entries.items()))


def described_entries() -> list[CatalogEntry]:
    """Return the robots of the package robot_descriptions; none where it is not installed."""
    # Only those that are a URDF, a xacro or a MuJoCo model; most of them are.
    found = []
    for name, what in sorted(_descriptions().items()):
        title = f"{getattr(what, 'maker', '') or ''} {getattr(what, 'robot', name)}".strip()
        note = "not on this computer" if _missing(what) else ""
        found.append(CatalogEntry(PREFIX + name, Path(PREFIX + name), title, PACKAGE, note=note))
    return found


def find_robot(name: str) -> CatalogEntry:
    """Return the robot of a name (letters and digits, any case); UnknownNameError if none."""
    # What is known by a loader's name is found without looking through all folders.
    own, folder = _own_robots(), data_folder()
    if name in own:
        return own[name]
    if folder is not None and name in _LOADERS and (folder / _LOADERS[name]).is_file():
        return _entry(name, folder / _LOADERS[name], _DATA)
    entries = known_robots()
    alike = [k for k in entries if k == name or canonical(k) == canonical(name)]
    if alike:
        return entries[name if name in alike else alike[0]]
    titled = _titled(name, entries)
    if len({entry.alias_of or entry.name for entry in titled}) == 1:
        return titled[0]
    raise UnknownNameError(
        "robot",
        name,
        entries,
        hint="pinsing list shows all names",
        meant=_meant(name, entries),
        families=_families(entries),
    )


def _titled(name: str, entries: Mapping[str, CatalogEntry]) -> list[CatalogEntry]:
    """Return the robots of this title; with a digit, of this one without its maker, too."""
    # After a comma a title has another name as sold, in capitals, or says more.
    wanted, found = canonical(name), []
    for entry in entries.values():
        maker, _, sold = entry.title.partition(" ")
        names = [entry.title, *(f"{maker} {s}" for s in sold.split(", ") if s[:1].isupper())]
        if wanted in map(canonical, names) or (
            re.search(r"\d", wanted) and wanted in (canonical(n.partition(" ")[2]) for n in names)
        ):
            found.append(entry)
    return found


def _meant(name: str, entries: Mapping[str, CatalogEntry]) -> list[str]:
    """Return the robots that have a name, all words of it, or most: "gofa", "Motoman HC10DTP"."""
    words, whole = re.findall(r"[a-z]{3,}", name.lower()[:100]), canonical(name[:100])
    titled = {k: f"{k} {e.title}" for k, e in entries.items() if e.alias_of is None}
    plain = {known: canonical(said) for known, said in titled.items()}
    shared = {known: _parts(said) & _parts(name[:100]) for known, said in titled.items()}
    exact = [known for known, said in plain.items() if len(whole) > 2 and whole in said]
    near = [known for known, said in plain.items() if words and all(w in said for w in words)]
    most = max(map(len, shared.values()), default=0)
    like = [k for k, s in shared.items() if len(s) == most > 1 and any(map(str.isalpha, s))]
    return sorted(exact or near or like, key=lambda known: -len(shared[known]))


def _parts(name: str) -> set[str]:
    """Return letters and numbers of a name apart: kr, 6, r and 900 of "KR6 R900"."""
    return set(re.findall("[a-z]+|[0-9]+", unicodedata.normalize("NFKD", name).lower()))


def _families(known: Collection[str]) -> str:
    """Return one name of each of some well-known kinds of robot."""
    groups: dict[str, list[str]] = {}
    for name in ("ur5", "panda", "iiwa14", *_TITLES):
        if name in known:
            groups.setdefault(re.split(r"[\d_]", name)[0], []).append(name)
    return ", ".join([names[0] for names in groups.values()][:12])


def locate_robot(robot: str | Path) -> CatalogEntry | Path:
    """Return what a user means by a robot: an existing file, a path, or a name.

    ``rd:NAME`` is a robot of robot_descriptions. Else an existing path wins; text with a path
    separator or the suffix .urdf, .xacro or .xml is a path unless a robot has this title, and so is
    a `Path`; all else is a name.
    """
    path = Path(robot)
    if isinstance(robot, str) and robot.startswith(PREFIX):
        return described_robot(robot)
    try:
        # A folder may happen to bear the name of a robot.
        exists = path.is_file() or (path.exists() and not _is_name(robot))
    except (OSError, ValueError):
        exists = False
    if exists:
        return path
    RobotFileError.refuse_if(
        not _is_name(robot)
        and not (
            isinstance(robot, str)
            and not os.path.isdir(path.parent)
            and (entries := known_robots())
            and any("/" in entries[known].title for known in _meant(robot, entries))
        ),
        "no such file",
        robot,  # as typed: a name with a slash is a path
    )
    try:
        return find_robot(str(robot))
    except UnknownNameError as error:
        if path.is_dir():
            return path  # its reader says what to give
        raise UnknownNameError(
            "robot",
            error.name,
            error.known,
            hint="no file of that name either; pinsing list shows all names",
            meant=error.close,
            families=_families(error.known),
        ) from None


def _is_name(robot: str | Path) -> bool:
    return (
        isinstance(robot, str)
        and not re.search(r"[/\\\0]", robot)
        and robot not in ("", ".", "..", "~")
        and not robot.lower().endswith(_FILE_SUFFIXES)
    )


def _own_robots() -> dict[str, CatalogEntry]:
    try:
        folder = urdf_folder()
    except RobotFileError:
        return {}
    return {path.stem: _entry(path.stem, path, "pinsing") for path in sorted(folder.glob("*.urdf"))}


def _table_arms() -> dict[str, CatalogEntry]:
    """Return the arms that ``urdf/arms.yaml`` has as DH tables."""
    try:
        path = urdf_folder() / "arms.yaml"
    except RobotFileError:
        return {}
    return {
        name: CatalogEntry(name, path, f"{arm['maker']} {arm['model']}", "pinsing", tip="tool0")
        for name, arm in known_arms().items()
        if "rows" in arm
    }


def data_folder() -> Path | None:
    """Return the folder of example-robot-data's robots, None where it is not installed."""
    # As its package is found when it is imported; to ask for its metadata costs 50 ms.
    folders = (Path(place, _DATA_FOLDER) for place in sys.path if place)
    return next((folder for folder in folders if folder.is_dir()), None)


def _data_robots() -> dict[str, CatalogEntry]:
    if (folder := data_folder()) is None:
        return {}
    files = sorted(folder.rglob("*.urdf"))
    entries = {
        name: _entry(name, folder / file, _DATA)
        for name, file in _LOADERS.items()
        if (folder / file).is_file()
    }
    stems = Counter(path.stem for path in files)
    loader_of = {entry.path: entry.name for entry in entries.values()}
    for path in files:
        name = path.stem
        if stems[name] > 1 or (name in entries and entries[name].path != path):
            if path in loader_of:
                continue
            # Another robot has the name: the folder tells them apart.
            name = f"{path.relative_to(folder).parts[0].removesuffix('_description')}_{name}"
        if name not in entries:
            entries[name] = replace(
                _entry(loader_of.get(path, name), path, _DATA),
                name=name,
                alias_of=loader_of.get(path),
            )
    return entries


def _entry(name: str, path: Path, source: str) -> CatalogEntry:
    title = _TITLES.get(name, name.replace("_", " "))
    return CatalogEntry(name, path, title, source, note=_NOTES.get(name, ""))


def canonical(name: str) -> str:
    """Return what of a name matters: its letters and digits, in any case."""
    return re.sub(r"[\W_]", "", unicodedata.normalize("NFKD", name).lower())
