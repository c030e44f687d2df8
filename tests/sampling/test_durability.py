"""Short runs of scripts/durability, and proof that it would notice."""

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tiers import tiered

from pinsing.view.picture import find_browser

SCRIPTS = Path(__file__).parents[2] / "scripts"


def _tool(name: str) -> Any:
    sys.path.insert(0, str(SCRIPTS))
    try:
        return importlib.import_module(f"durability.{name}")
    finally:
        sys.path.remove(str(SCRIPTS))


COMMANDS = _tool("commands").COMMANDS


@pytest.fixture(scope="module")
def tools() -> Any:
    names = ("commands", "disk", "failures", "power", "kills", "report")
    return {name: _tool(name) for name in names}


@pytest.mark.parametrize(
    "command", tiered(["at .json", "sweep .npz", "plot .png"], ("at .json", "sweep .npz"))
)
def test_each_operation_fails_in_turn(tools: Any, tmp_path: Path, command: str) -> None:
    rows, wrong = tools["failures"].failures(command, tmp_path)
    assert wrong == []
    operations = {row["operation"].split(",")[0] for row in rows}
    assert operations >= {"open", "write", "fsync", "replace", "fsync of a folder"}
    assert all(row["good"] == row["cases"] > 0 for row in rows)


def test_every_command_that_writes_is_here(tools: Any) -> None:
    """Found from the program itself, so that a new option cannot be forgotten."""
    from pinsing.cli.app import command

    assert tools["commands"].uncovered(command) == []


QUICK = {"at .json", "sweep .npz", "plot .png"}


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(set(COMMANDS) - QUICK))
def test_each_operation_fails_in_turn_in_every_command(
    tools: Any, tmp_path: Path, command: str
) -> None:
    if command in tools["commands"].BROWSER and find_browser() is None:
        pytest.skip("there is no browser")
    assert tools["failures"].failures(command, tmp_path)[1] == []


@pytest.mark.parametrize("command", tiered(["map FOLDER", "sweep FOLDER"], ("map FOLDER",)))
def test_loss_of_power(tools: Any, tmp_path: Path, command: str) -> None:
    row, wrong = tools["power"].cuts(command, 12, 1, tmp_path)
    assert wrong == []
    assert row["good"] == 12
    assert row["operations"] > 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map, threads", "sweep, threads", "map, worker processes"])
def test_kills(tmp_path: Path, kind: str) -> None:
    """In a process of its own: what is forked must not have threads."""
    done = subprocess.run(
        [
            *(sys.executable, "-m", "durability", "kills", "--kills", "40", "--kind", kind),
            *("--json", str(tmp_path / "kills.json")),
        ],
        cwd=SCRIPTS,
        capture_output=True,
        text=True,
        timeout=540,
    )
    assert done.returncode == 0, done.stderr
