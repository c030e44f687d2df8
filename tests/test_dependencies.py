"""What the sources import is declared, and its oldest versions are those that are tested."""

import re
import sys
from importlib import metadata
from pathlib import Path

import pytest
from test_layers import every_import

ROOT = Path(__file__).parent.parent
OLDEST = ROOT / ".github" / "oldest.txt"


@pytest.mark.skipif(not OLDEST.exists(), reason="not a checkout of the repository")
def test_the_oldest_set_is_that_of_the_lower_bounds():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    users = project[project.index("\ndependencies = [") : project.index("\ndev = [")]
    allowed = dict(re.findall(r'"([\w-]+)>=([\d.]+)"', users))
    oldest = OLDEST.read_text(encoding="utf-8")
    tested = dict(re.findall(r"(?m)^(?:# )?([\w-]+)==([\d.]+)$", oldest)[::-1])
    assert {"pin", "numpy", "distributed", "pytest"} <= set(allowed)
    assert set(allowed) <= set(tested)

    def parts(version: str) -> list[int]:
        return [int(part) for part in re.sub(r"(\.0)+$", "", version).split(".")]

    for name, version in allowed.items():
        assert parts(version) == parts(tested[name]), name


# The packages whose modules have other names than themselves.
PROVIDER = {
    "collada": "pycollada", "flint": "python-flint", "mpl_toolkits": "matplotlib",
    "pil": "pillow", "pinocchio": "pin", "umsgpack": "u-msgpack-python", "yaml": "pyyaml",
}  # fmt: skip
# Used without an import that the walk sees.
BY_NAME = {"example-robot-data": "files alone", "meshcat": "files alone"}


@pytest.mark.skipif(not OLDEST.exists(), reason="not a checkout of the repository")
def test_all_that_the_sources_import_is_declared_and_nothing_else():
    """What comes only because something else needs it may stop to come."""
    names = {i.imported.partition(".")[0] for i in every_import() if i.runs}
    names -= {*sys.stdlib_module_names, "pinsing"}
    used = {PROVIDER.get(name.lower(), name.lower()) for name in names}
    needed = [r for r in metadata.requires("pinsing") or () if "extra ==" not in r]
    declared = {re.split("[<>=;\\s]", requirement)[0].lower() for requirement in needed}
    assert used - declared == set()
    assert declared - used == set(BY_NAME)
