"""Where others run it: a wheel in an environment that knows no compiler; systems but Linux.

The wheel needs the package index, for what pinsing depends on; skipped where there is none.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from arms import URDF
from command_line import python
from dh_arms import dh_text

from pinsing.cli.app import COMMANDS
from pinsing.cli.show import KINDS

ROOT = Path(__file__).parent.parent
# What scripts/demo and scripts/setup call. No compiler, no CMake, nothing else.
PROGRAMS = (
    *("bash", "cat", "cut", "dirname", "env", "find", "rm", "sha256sum"),
    *("sh", "sort", "touch", "uname", "xargs"),
)
DROPPED = ("CC", "CXX", "PINSING_REQUIRE_ENGINE", "PYTHONPATH", "VIRTUAL_ENV", "COLUMNS")
pytestmark = pytest.mark.slow


def run(words: list[object], bare: dict[str, str], folder: Path) -> Any:
    options = {"capture_output": True, "text": True, "timeout": 1200}
    return subprocess.run([*map(str, words)], env=bare, cwd=folder, **options)


def bare(folder: Path) -> dict[str, str]:
    """The variables of a user whose PATH holds a dozen programs."""
    folder.mkdir()
    for name in PROGRAMS:
        place = shutil.which(name)
        assert place, name
        (folder / name).symlink_to(place)
    kept = {k: v for k, v in os.environ.items() if k not in DROPPED}
    base = Path(sys.base_prefix) / "bin" / f"python3.{sys.version_info.minor}"
    return kept | {"PATH": str(folder), "PYTHON": str(base if base.exists() else sys.executable)}


def clone(folder: Path) -> Path:
    """The project as a clone has it, with the changes that are not committed yet."""
    asked = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    listed = subprocess.run(asked, capture_output=True, text=True, cwd=ROOT)
    if listed.returncode:
        pytest.skip("not a git work tree")
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def build(tree: Path, folder: Path) -> Path:
    """A wheel, built with the compiler of this machine."""
    folder.mkdir()
    words = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, tree]
    done = run(words, dict(os.environ) | {"PINSING_REQUIRE_ENGINE": "1"}, folder)
    if done.returncode and "No matching distribution" in done.stderr:
        pytest.skip("no package index")
    assert done.returncode == 0, done.stderr
    (found,) = folder.glob("pinsing-*.whl")
    return found


def holds_the_program_and_not_the_source_of_the_kernel(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert any(n.startswith("pinsing/_batch/") and n.endswith(".so") for n in names)
    assert not [n for n in names if n.endswith((".cpp", ".hpp"))]
    assert not [n for n in names if n.startswith(("tests/", "docs/", "scripts/", "build/"))]
    assert "pinsing/urdf/puma560.urdf" in names
    assert "pinsing/py.typed" in names


Q, OTHER = "0,-1,1,0,1,0", "0.3,-1.2,1.2,0,0.8,0"
CALLS = [
    "list ur5", "list", "at ur5 --q " + Q, "analyze planar3r", "analyze five_bar --loops",
    "families ur5 -o proof.cert.json", "families planar_3rrr --loops", "verify proof.cert.json",
    "analyze planar3r --sweep", "map ur5 --count 1000", "map five_bar --loops --count 1000",
    "at ur5 --suggest", "zones planar3r --joint-speeds 2,2,2", "check ur5 path.csv",
    f"line ur5 --q {Q} --to 0.3,0.2,0.5", "postures scara --aspects", f"postures ur5 --q {Q}",
    "postures scara --cuspidal --poses 2", "export ur5 -o guard.h -o guard.py",
    "view stanford -o arm.html", "view five_bar --loops -o five_bar.html",
    "report planar3r -o arm.report.html", "report planar_3rrr --loops -o loops.report.html",
    f"export {ROOT / 'urdf/scara.dh.yaml'} -o scara.urdf",
    "path ur5 poses.csv --free roll --step 30", "plot curves stanford",
    "plot map scara --over q1,q2", "plot ellipsoids ur5", "plot locus ur5 --family F3",
    f"plot along ur5 --q={Q} --q={OTHER}", "plot workspace planar3r --task position",
    "plot aspects ur5 --over elbow_joint,wrist_2_joint",
    "plot solutions arm.dh.yaml --task position", "plot curves five_bar --loops",
    "plot map planar_3rpr --loops", "plot map delta --loops", "plot map five_bar --loops",
    "plot map four_bar --loops", "plot ellipsoids delta --loops", "plot modes five_bar --loops",
]  # fmt: skip
"""Every command, and every kind of plot, for arms and for mechanisms."""


def every_command_runs(pinsing: Path, alone: dict[str, str], folder: Path) -> None:
    """Nothing is missing that a command imports on the way; refusals are said, in one line."""
    called = [call.split() for call in CALLS]
    assert {words[0] for words in called} == set(COMMANDS)
    assert {words[1] for words in called if words[0] == "plot"} == set(KINDS)
    folder.mkdir()
    (folder / "path.csv").write_text("\n".join([Q, OTHER]) + "\n")
    (folder / "poses.csv").write_text("x,y,z,i,j,k\n0.4,0.1,0.2,0,0,1\n0.4,0.2,0.2,0,0,1\n")
    (folder / "arm.dh.yaml").write_text(dh_text([(-90, 1, 0), (90, 2, 1), (0, 1.5, 0)]))
    wrong = []
    for number, words in enumerate(called):
        if words[0] == "plot":
            words += ["-o", f"figure{number}.png"]
        said = run([pinsing, *words], alone, folder)
        if said.returncode != 0 or "Traceback" in said.stderr:
            wrong.append((" ".join(words), said.returncode, said.stderr[-400:]))
        if words == ["list", "ur5"]:
            assert "compiled" in said.stdout
    assert wrong == []
    assert (folder / "arm.html").stat().st_size > 500_000


def test_a_wheel_and_the_demo_run_where_there_is_no_compiler(tmp_path):
    """One test, so that what it installs is installed once.

    Of the README's two commands the other, scripts/test, is what runs this.
    """
    tree = clone(tmp_path / "clone")
    wheel = build(tree, tmp_path / "wheel")
    holds_the_program_and_not_the_source_of_the_kernel(wheel)

    alone = bare(tmp_path / "bin")
    assert [p for p in ("cc", "c++", "gcc", "cmake") if shutil.which(p, path=alone["PATH"])] == []
    place = tree / ".venv"
    made = run([alone["PYTHON"], "-m", "venv", place], alone, tree)
    assert made.returncode == 0, made.stderr
    install = [place / "bin/python", "-m", "pip", "install", "-q", "--no-compile", wheel]
    done = run(install, alone, tree)
    assert done.returncode == 0, done.stderr
    every_command_runs(place / "bin/pinsing", alone, tmp_path / "elsewhere")

    done = run([tree / "scripts/demo"], alone, tree)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Checked:") == 3
    assert "\nNext:\n" in done.stdout[-300:]
    said = run([place / "bin/pinsing", "list", "ur5"], alone, tree)
    assert "Pinocchio and NumPy" in said.stdout


# Where Linux's own modules and calls are missing, as on macOS, the work is the same ------

HIDING = """
import builtins, ctypes, os, sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name in {"fcntl", "resource"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

class Library(ctypes.CDLL):
    def __getattr__(self, name):
        if name in {"prctl", "syscall"}:
            raise AttributeError(name)
        return super().__getattr__(name)

def kept(path, *rest, **options):
    if isinstance(path, (str, os.PathLike)) and str(path).startswith("/proc"):
        raise FileNotFoundError(path)
    return opened(path, *rest, **options)

import multiprocessing.resource_tracker, platform, sysconfig
sysconfig.get_config_vars()  # of the system that this is
opened, builtins.open = builtins.open, kept
sys.meta_path.insert(0, Hidden())
for name in ("fcntl", "resource"):
    sys.modules.pop(name, None)
ctypes.CDLL = Library
"""
MANY = """
import json
from click.testing import CliRunner
from pinsing.cli.app import command
done = [CliRunner().invoke(command, words) for words in json.loads(sys.argv[1])]
print(json.dumps([(one.exit_code, one.output) for one in done]))
"""
ANSWERS = [
    ("families ur5", "proven complete"), ("map planar3r --count 64", "planar3r"),
    ("map planar3r --count 64 -o runs", "need Linux or macOS"),
    ("families panda", "proven complete"),
    ("at stanford --q 0,1,0.3,1,0,0", "wrist"), ("postures ur5", "aspects"),
    ("list arm.xacro", "links"), ("families arm.xacro", "proven complete"),
    ("analyze planar3r --sweep --levels 1", "planar3r"),
    ("families ur5 -o proof.cert.json", "proven"), ("verify proof.cert.json", "proven"),
    ("path ur5 poses.csv", "49.4°"), ("plot curves planar3r -o out.png", ""),
    ("zones planar3r --joint-speeds 1,1,1", "no useful distance was found"),
    ("check planar3r --follow run.csv", '"level": "clear"'),
    ("report planar3r -o out.html", "proven"), ("view planar3r -o view.html", "wrote view.html"),
]  # fmt: skip


@pytest.mark.parametrize("system", ["darwin", "linux"])  # as in a container
def test_commands_answer_without_what_only_linux_has(tmp_path, system):
    (tmp_path / "arm.xacro").write_text((URDF / "stanford.urdf").read_text())
    rows = [f"0.4,{y},0.3,3.1,0,0" for y in (0.2, 0.1, 0)]
    (tmp_path / "poses.csv").write_text("\n".join(["x,y,z,roll,pitch,yaw", *rows]))
    (tmp_path / "run.csv").write_text("q1,q2,q3\n0.1,1,0.3\n")
    words = json.dumps([words.split() for words, _ in ANSWERS])
    env = {"MPLBACKEND": "junk", "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    code = f"{HIDING}\nsys.platform = {system!r}\n{MANY}"
    done = python("-c", code, words, env=env, cwd=tmp_path, timeout=120)
    assert done.returncode == 0, done.stderr
    for (code, said), (asked, answer) in zip(json.loads(done.stdout), ANSWERS, strict=True):
        # A folder that cannot be locked is refused.
        assert code == (2 if asked.endswith("-o runs") else 0), (asked, said)
        assert answer in said, asked
    assert not (tmp_path / "runs").exists()
