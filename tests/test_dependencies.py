"""The oldest dependencies that are allowed are those that are tested."""

from __future__ import annotations

import re
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
