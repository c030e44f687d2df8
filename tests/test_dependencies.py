"""The oldest dependencies that are allowed are those that are tested."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OLDEST = ROOT / ".github" / "oldest.txt"


@pytest.mark.skipif(not OLDEST.exists(), reason="not a checkout of the repository")
def test_the_oldest_set_is_that_of_the_lower_bounds():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    users = project[project.index("\ndependencies = [") : project.index("\ndev = [")]
    allowed = dict(re.findall(r'"([\w-]+)>=([\d.]+)"', users))
    tested = dict(re.findall(r"(?m)^([\w-]+)==([\d.]+)$", OLDEST.read_text(encoding="utf-8")))
    assert {"pin", "numpy", "distributed", "pytest"} <= set(allowed)
    assert set(allowed) <= set(tested)

    def parts(version: str) -> list[int]:
        return [int(part) for part in re.sub(r"(\.0)+$", "", version).split(".")]

    for name, version in allowed.items():
        assert parts(version) == parts(tested[name]), name


def needed(*extra: str) -> list[str]:
    words = [sys.executable, str(ROOT / "scripts" / "requirements.py"), *extra]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.split("\n")[:-1]


@pytest.mark.skipif(not OLDEST.exists(), reason="not a checkout of the repository")
def test_set_up_installs_what_the_project_names():
    """Setup installs these beside the build, and pinsing itself without any."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lists = dict(re.findall(r"(?ms)^(\w+) = \[(.*?)\](?:  #[^\n]*)?$", project))
    named = {k: re.findall(r'"([^"]+)"', v) for k, v in lists.items()}
    assert needed() == named["dependencies"]
    own = [r for r in named["test"] if not r.startswith("pinsing[")]
    users = named["cluster"] + named["descriptions"] + named["diagnosis"]
    assert sorted(needed("test")) == sorted(named["dependencies"] + own + users)
    more = [r for r in named["dev"] if not r.startswith("pinsing[")] + named["docs"]
    assert sorted(needed("dev")) == sorted(needed("test") + more)
