"""scripts/setup: installs once, and again when the environment does not use the sources."""

import shutil
import subprocess
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Stands for pip: notes how it was called, and installs as an editable installation does.
PIP = """
import pathlib, shutil, sys
place = pathlib.Path(__file__).parents[1]
with open("calls.txt", "a") as calls:
    print(sys.argv[-1], file=calls)
shutil.rmtree(place / "pinsing", ignore_errors=True)
(place / "src.pth").write_text(str(pathlib.Path("src").resolve()))
"""


def calls(clone: Path, *extra: str) -> list[str]:
    """What pip is asked for by a set-up."""
    (clone / "calls.txt").write_text("")
    subprocess.run(["bash", "scripts/setup", *extra], cwd=clone, check=True, timeout=120)
    return (clone / "calls.txt").read_text().split()


def test_a_set_up_installs_once_and_again_where_the_sources_are_not_used(tmp_path: Path):
    clone, other = tmp_path / "clone", tmp_path / "other/src/pinsing"
    for name in ("scripts/setup", "pyproject.toml", "CMakeLists.txt"):
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, clone / name)
    batch = "src/pinsing/_batch"
    shutil.copytree(ROOT / batch, clone / batch, ignore=shutil.ignore_patterns("*.py*", "__*"))
    (clone / "src/pinsing/__init__.py").write_text("")
    venv.create(clone / ".venv", symlinks=True)
    (packages,) = (clone / ".venv/lib").glob("python*/site-packages")
    (packages / "pip").mkdir()
    (packages / "pip/__main__.py").write_text(PIP)

    for word, code in (("--help", 0), ("tests", 2)):
        done = subprocess.run(["bash", "scripts/setup", word], cwd=clone, capture_output=True)
        assert (done.returncode, done.stdout[:20]) == (code, b"usage: scripts/setup")
    assert calls(clone) == ["."]
    assert calls(clone) == []
    (packages / "pinsing").mkdir()  # `pip install .`: a copy, found before src/
    (packages / "pinsing/__init__.py").write_text("")
    assert calls(clone) == ["."]
    other.mkdir(parents=True)  # an environment that uses another clone
    (other / "__init__.py").write_text("")
    (packages / "src.pth").write_text(str(other.parent))
    assert calls(clone) == ["."]
    assert calls(clone, "dev") == [".[dev]"]  # more than is there
    assert calls(clone) == calls(clone, "dev") == []  # or no more
    (clone / "src/pinsing/_batch/kernel.cpp").write_text("// other\n")
    assert calls(clone, "test") == [".[test]"]
