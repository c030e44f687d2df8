"""Imports point down only, are declared, and importing pinsing stays cheap.

A new package is entered in ORDER, above all that it imports.
"""

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from importlib import metadata
from importlib.util import resolve_name
from pathlib import Path

import pytest
from command_line import python
from packaging.version import Version
from public import script
from tiers import tiered

import pinsing
from pinsing.cli.app import COMMANDS

SOURCE = Path(pinsing.__file__).parent

# From the ground up. A package imports what stands before it, and itself; nothing else.
ORDER = (
    "measures", "_version", "_package", "proof", "errors", "prose", "notebook", "description",
    "interface", "robot", "atomic_write", "chunk_file",
    "_batch", "kinematics", "algebra", "families", "loops", "proximity",
    "postures", "sampling", "plot", "view", "report", "cli", "__init__", "__main__",
)  # fmt: skip

# Slow to import, and who may do so when imported itself; all others within a function.
HEAVY: dict[str, set[str]] = {
    "click": {"cli"}, "matplotlib": {"plot"}, "meshcat": {"view"}, "rich": set(), "scipy": set(),
    "sympy": set(), "tornado": {"view"}, "xacro": set(), "yourdfpy": set(), "zmq": {"view"},
}  # fmt: skip


@dataclass(frozen=True)
class Import:
    importer: str  # module, pinsing.robot.load
    imported: str
    line: int
    at_import: bool  # neither in a function nor for type checking only
    runs: bool = True  # not for type checking only

    def __str__(self) -> str:
        return f"{self.importer}, line {self.line}: imports {self.imported}"


def modules() -> dict[str, Path]:
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = ("pinsing", *path.relative_to(SOURCE).with_suffix("").parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()
SIZE = script("size")


def imports_of(module: str) -> Iterator[Import]:
    statements = SIZE.statements(MODULES[module])
    package = module if MODULES[module].name == "__init__.py" else module.rpartition(".")[0]
    later, typing = set(), set()
    for node in statements:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            later.update(range(node.lineno, node.end_lineno + 1))
        elif isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            typing.update(range(node.lineno, node.body[-1].end_lineno + 1))
    for node in statements:
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = resolve_name("." * node.level + (node.module or ""), package)
            inner = [f"{base}.{alias.name}" for alias in node.names]
            names = [name if name in MODULES else base for name in inner]
        else:
            continue
        runs = node.lineno not in typing
        for name in names:
            yield Import(module, name, node.lineno, runs and node.lineno not in later, runs)


def room(module: str) -> str:
    """``pinsing.robot.load`` -> ``robot``."""
    return module.partition(".")[2].partition(".")[0] or "__init__"


@cache
def every_import() -> tuple[Import, ...]:
    return tuple(i for module in MODULES for i in imports_of(module))


@cache
def own_imports() -> tuple[Import, ...]:
    return tuple(i for i in every_import() if i.imported in MODULES)


def test_every_package_has_its_place_and_imports_point_down():
    assert {room(m) for m in MODULES} == set(ORDER)
    place = {name: k for k, name in enumerate(ORDER)}
    wrong = [str(i) for i in own_imports() if place[room(i.importer)] < place[room(i.imported)]]
    assert not wrong, "\n".join(wrong)


def test_the_house_has_at_most_ten_floors():
    """A package stands above all that it imports; its doors are no floors."""
    arrows = {(room(i.importer), room(i.imported)) for i in own_imports()}
    floor: dict[str, int] = {}
    for name in ORDER[:-2]:
        floor[name] = 1 + max((floor[b] for a, b in arrows if a == name != b), default=0)
    assert max(floor.values()) <= 10, floor


def test_no_module_imports_itself_by_way_of_others():
    """What a module needs within a function, or for a type alone, it needs.

    Two that need each other are one thing, or lack a third below both: a result stands with its
    text in one module, what makes it in another above.
    """
    graph: dict[str, set[str]] = {}
    for i in own_imports():
        if i.importer != i.imported and not i.importer.startswith(f"{i.imported}."):
            graph.setdefault(i.importer, set()).add(i.imported)
    TopologicalSorter(graph).prepare()  # names a way from a module back to itself


def test_heavy_imports_wait_until_they_are_needed():
    wrong = [
        str(i)
        for i in every_import()
        if i.at_import
        and (library := i.imported.partition(".")[0]) in HEAVY
        and room(i.importer) not in HEAVY[library]
    ]
    assert not wrong, "\n".join(wrong)


def modules_after(code: str) -> tuple[str, set[str]]:
    """What a line of Python prints, and the modules that it has loaded.

    In a process of its own, since here everything is imported already.
    """
    listed = f"{code}; import sys; print(*sys.modules, file=sys.stderr)"
    run = python("-c", listed, check=True, env={"PYTHONPATH": str(SOURCE.parent), "PATH": ""})
    return run.stdout, set(run.stderr.split())


def command(*words: str) -> str:
    return f"from pinsing.cli.app import command; command({words!r}, standalone_mode=False)"


AT = ("at", "ur5", "--q", "0,-1,1,0,1,0")
# They print: what others open, start, draw or keep from the terminal can wait.
PRINTING = (
    "webbrowser subprocess tempfile shutil logging html asyncio yaml http ssl email zipfile "
    "matplotlib meshcat scipy sympy rich tornado xacro yourdfpy zmq pandas trimesh xml.etree "
    "pinsing.view pinsing.plot pinsing.report pinsing.loops pinsing.sampling pinsing.postures "
)
COLD = {
    # Nor does what the child of xacro imports, which starts for each xacro file and DH table.
    "the help of a command": (
        "from pinsing.cli import families, motion, robots, show;"
        "import pinsing.errors, pinsing.description.catalog, pinsing.description.xacro_rules;"
        "pinsing.description.catalog.known_robots()",
        "",
        "numpy rich matplotlib meshcat pinocchio scipy yourdfpy xacro flint ssl",
    ),
    # NumPy imports masked arrays by itself in some functions: 25 ms of a start of half a second.
    "a closed form": (
        "import pinsing; str(pinsing.closed_form(pinsing.load('ur5')))",
        "",
        "numpy.ma asyncio urllib.request yaml ssl pinocchio.visualize pinsing.view pinsing.plot "
        "subprocess tempfile shutil html pinsing.families.design",
    ),
    # Plots, pages, commands, clusters: a tenth of a second of a short one.
    "an analysis": (
        "import pinsing; arm = pinsing.load('planar3r'); "
        "analysis = pinsing.analyze(arm, random_starts=50); str(analysis), analysis.to_json(); "
        "pinsing.sampling.sweep(arm, samples=9, levels=1)",
        "",
        "asyncio concurrent.futures.process numpy.ma yaml ssl http email scipy "
        "matplotlib meshcat yourdfpy xacro rich click tornado zmq",
    ),
    # Its rotations alone take 0.4 s to import.
    "a mechanism, and poses in a file": (
        "import pathlib, pinsing; from pinsing.postures.placement import read_poses; "
        "read_poses(pathlib.Path('poses.csv')); "
        "pinsing.loops.analyze_mechanism(pinsing.load_mechanism('five_bar'))",
        "",
        "scipy",
    ),
    # A browser would wait for it in vain.
    "a page": (
        "import pinsing; pinsing.Viewer(pinsing.load('planar3r'), skeleton=True).html()",
        "",
        "IPython meshcat zmq pinsing.postures",
    ),
    "families": (command("families", "ur5", "--no-prove"), "3 families", PRINTING),
    "at": (command(*AT), "regular", PRINTING),
    "at, without distances": (
        command(*AT, "--no-distances"),
        "regular",
        PRINTING + "flint pinsing.families pinsing.proof",
    ),
}
QUICK = ("the help of a command", "a closed form", "at, without distances")


@pytest.mark.parametrize("what", tiered(COLD, QUICK))
def test_what_is_done_first_pulls_in_little(what, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text("x,y,z,roll,pitch,yaw\n" + "1,0,0,0,0,1\n" * 2)
    code, answer, heavy = COLD[what]
    said, loaded = modules_after(code)
    assert answer in said
    assert loaded.isdisjoint(heavy.split())


def test_a_command_imports_no_other_and_the_list_none():
    parts = {f"pinsing.cli.{place}" for place, _ in COMMANDS.values()}
    for words, needed in (["--help"], set()), (["list", "--help"], {"pinsing.cli.robots"}):
        code = "import contextlib; from pinsing.cli import main\n"
        code += f"with contextlib.suppress(SystemExit): main({words!r})\n0"
        assert modules_after(code)[1] & parts == needed


# Class names that stand twice, the rooms they stand in, and why.
TWICE = {
    "Ring": ["algebra", "proof"],  # the checker shares no line with what it checks
}


def test_a_class_name_has_one_meaning():
    """Two classes of one name are one too many, whatever their rooms."""
    places: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for node in SIZE.statements(path):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(room(module))
    assert {name: sorted(rooms) for name, rooms in places.items() if len(rooms) > 1} == TWICE


def test_no_package_is_larger_than_a_tenth_of_the_whole():
    """But families, mechanisms and the page."""
    statements = Counter()
    for module, path in MODULES.items():
        statements[room(module)] += len(SIZE.statements(path))
    large = {name for name, n in statements.items() if n > statements.total() / 10}
    assert large <= {"families", "loops", "view"}


def test_no_size_is_over_its_limit():
    """`scripts/size.py` says what is counted; limits are lowered with each step, not raised."""
    assert SIZE.main() == 0


# What the sources import is declared, and its oldest versions are those that are tested ---

ROOT = Path(__file__).parent.parent
OLDEST = ROOT / ".github" / "oldest.txt"


needs_checkout = pytest.mark.skipif(not OLDEST.exists(), reason="not a checkout of the repository")


@needs_checkout
def test_the_oldest_set_is_that_of_the_lower_bounds():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    users = project[project.index("\ndependencies = [") : project.index("\ndev = [")]
    allowed = dict(re.findall(r'"([\w-]+)>=([\d.]+)"', users))
    oldest = OLDEST.read_text(encoding="utf-8")
    tested = dict(re.findall(r"(?m)^(?:# )?([\w-]+)==([\d.]+)$", oldest)[::-1])
    assert {"pin", "numpy", "distributed", "pytest"} <= set(allowed)
    for name, version in allowed.items():
        assert Version(version) == Version(tested[name]), name


# The packages whose modules have other names than themselves.
PROVIDER = {
    "collada": "pycollada", "flint": "python-flint", "mpl_toolkits": "matplotlib",
    "pil": "pillow", "pinocchio": "pin", "umsgpack": "u-msgpack-python", "yaml": "pyyaml",
}  # fmt: skip
# Used without an import that the walk sees.
BY_NAME = {"example-robot-data": "files alone", "meshcat": "files alone"}


@needs_checkout
def test_all_that_the_sources_import_is_declared_and_nothing_else():
    """What comes only because something else needs it may stop to come."""
    names = {i.imported.partition(".")[0] for i in every_import() if i.runs}
    names -= {*sys.stdlib_module_names, "pinsing"}
    used = {PROVIDER.get(name.lower(), name.lower()) for name in names}
    needed = [r for r in metadata.requires("pinsing") or () if "extra ==" not in r]
    declared = {re.split("[<>=;\\s]", requirement)[0].lower() for requirement in needed}
    assert used - declared == set()
    assert declared - used == set(BY_NAME)
