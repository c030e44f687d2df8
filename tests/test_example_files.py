"""The files of examples/: short, and each run as a user would."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

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
    tests = [p.read_text() for p in Path(__file__).parent.glob("test_*.py")]
    for file in EXAMPLES.glob("*.py"):
        assert any(file.name in text for text in tests), file.name


@pytest.mark.slow
def test_through_singularities(tmp_path):
    picture = tmp_path / "speeds.png"
    said = run("through_singularities.py", picture)
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
    said = run("pink_barrier.py")
    without, with_ = (float(x) for x in re.findall(r"nearest (\S+) degrees", said))
    assert without < 0.5
    assert with_ > 5
