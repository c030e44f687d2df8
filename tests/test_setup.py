"""scripts/setup: whether it sees that the environment does not use the sources of the clone."""

from __future__ import annotations

import shutil
import subprocess
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Stands for pip: notes that it was called; an editable installation removes the copy.
PIP = """
import pathlib, shutil, sys
place = pathlib.Path(__file__).parents[1]
with open("calls.txt", "a") as calls:
    print(*sys.argv[1:], file=calls)
if "--editable" in sys.argv:
    shutil.rmtree(place / "pinsing", ignore_errors=True)
    (place / "src.pth").write_text(str(pathlib.Path("src").resolve()))
"""


def small_clone(folder: Path) -> tuple[Path, Path]:
    """What the script reads, and an environment with its folder of packages."""
    for name in ("scripts/setup", "pyproject.toml", "CMakeLists.txt"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    (folder / "scripts/requirements.py").write_text("print()\n")
    (folder / "src/pinsing/_batch").mkdir(parents=True)
    (folder / "src/pinsing/_batch/kernel.cpp").write_text("// none\n")
    (folder / "src/pinsing/__init__.py").write_text("")
    venv.create(folder / ".venv", symlinks=True)
    (packages,) = (folder / ".venv/lib").glob("python*/site-packages")
    (packages / "pip").mkdir()
    (packages / "pip/__init__.py").write_text("")
    (packages / "pip/__main__.py").write_text(PIP)
    return folder, packages


def setup(clone: Path) -> tuple[str, int]:
    """What a set-up says, and how often it has called pip."""
    (clone / "calls.txt").write_text("")
    done = subprocess.run(
        ["bash", "scripts/setup"], cwd=clone, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stderr, len((clone / "calls.txt").read_text().splitlines())


def test_a_set_up_sees_that_a_copy_took_the_place_of_the_sources(tmp_path: Path):
    clone, packages = small_clone(tmp_path / "clone")
    assert setup(clone)[1] == 2  # pinsing, and what it needs

    # `pip install .`: a copy, found before src/
    (packages / "pinsing").mkdir()
    (packages / "pinsing/__init__.py").write_text("")
    said, calls = setup(clone)
    assert "does not use the sources in src/" in said
    assert calls == 2

    # an environment that uses another clone
    other = tmp_path / "other/src/pinsing"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("")
    (packages / "src.pth").write_text(str(other.parent))
    assert setup(clone)[1] == 2
    assert setup(clone) == ("", 0)
