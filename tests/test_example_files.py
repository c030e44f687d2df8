"""The files of examples/: short, and each run as a user would."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from tiers import tiered

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name: str, *words: object) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *map(str, words)],
        capture_output=True,
        text=True,
        env={**os.environ, "MPLBACKEND": "agg"},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_examples_are_short():
    files = sorted(EXAMPLES.glob("*.py"))
    assert len(files) >= 2
    long = {f.name: n for f in files if (n := len(f.read_text().splitlines())) >= 40}
    assert not long


def test_every_example_is_run_by_a_test():
    tests = [p.read_text() for p in Path(__file__).parent.rglob("test_*.py")]
    for file in EXAMPLES.glob("*.py"):
        assert any(file.name in text for text in tests), file.name


# What each prints, whatever the machine; those that draw, ask or start more have a test below.
SAID = {
    "01_analyse.py": r"ur5: 3 families, complete: True\nF1 \(boundary, codimension 1\)",
    "02_view.py": r"shows P1, F1, F2, F3",
    "03_custom_model.py": r"F1: .*q2 = ±90°.*\n  at .*: singular",
    "04_trajectory.py": r"meets F2 at t = 1\.000 s\n.*different.*\n\d+ of its 20 samples",
    "08_closed_loop.py": r"2 assembly modes\n[\s\S]*inputs, in m², complete",
    "09_certificate.py": r"as it was: ACCEPTED: puma560[\s\S]*forged: REJECTED.*exit code 1",
    "10_posture_change.py": r"puma560: not cuspidal, proven[\s\S]*aspect: different",
}


@pytest.mark.parametrize("name", tiered(SAID, {"03_custom_model.py"}))
def test_an_example_says_what_it_found(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert re.search(SAID[name], run(name)), name


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="Dask is not installed")
def test_map_over_a_cluster():
    assert "the same on threads: True" in run("07_map_over_a_cluster.py")


@pytest.mark.slow
def test_through_singularities(tmp_path):
    picture = tmp_path / "speeds.png"
    said = run("06_through_singularities.py", picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = re.findall(r"^(\w+) the (\w+) .*, (\w+): at most (\S+) rad/s, misses (\S+)$", said, re.M)
    assert len(rows) == 10
    for _, _, method, speed, missed in rows:
        if method == "pinv":  # follows, at any speed
            assert float(speed) > 1000
            assert float(missed) < 1e-5
        else:  # slow, and gives something up
            assert float(speed) < 2
            assert float(missed) > 1e-3


@pytest.mark.skipif(importlib.util.find_spec("pink") is None, reason="pink is not installed")
def test_pink_barrier():
    said = run("11_pink_barrier.py")
    without, with_ = (float(x) for x in re.findall(r"nearest (\S+) degrees", said))
    assert without < 0.5
    assert with_ > 5
