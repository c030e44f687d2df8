"""Short runs of scripts/durability, and proof that it would notice."""

from pathlib import Path

import pytest
from command_line import python
from public import SCRIPTS, script
from tiers import tiered

from pinsing.cli.app import command as program
from pinsing.view.picture import find_browser

commands, failures, power = (
    script(f"durability.{name}") for name in ("commands", "failures", "power")
)


@pytest.mark.parametrize("command", tiered(["at .json", "sweep .npz", "plot .png"], ("at .json",)))
def test_each_operation_fails_in_turn(tmp_path: Path, command: str) -> None:
    rows, wrong = failures.failures(command, tmp_path)
    assert wrong == []
    operations = {row["operation"].split(",")[0] for row in rows}
    assert operations >= {"open", "write", "fsync", "replace", "fsync of a folder"}
    assert all(row["good"] == row["cases"] > 0 for row in rows)


def test_every_command_that_writes_is_here() -> None:
    """Found from the program itself, so that a new option cannot be forgotten."""
    assert commands.uncovered(program) == []


QUICK = {"at .json", "sweep .npz", "plot .png"}


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(set(commands.COMMANDS) - QUICK))
def test_each_operation_fails_in_turn_in_every_command(tmp_path: Path, command: str) -> None:
    if command in commands.BROWSER and find_browser() is None:
        pytest.skip("there is no browser")
    assert failures.failures(command, tmp_path)[1] == []


@pytest.mark.parametrize("command", tiered(["map FOLDER", "sweep FOLDER"], ("map FOLDER",)))
def test_loss_of_power(tmp_path: Path, command: str) -> None:
    row, wrong = power.cuts(command, 12, 1, tmp_path)
    assert wrong == []
    assert row["good"] == 12
    assert row["operations"] > 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map, threads", "sweep, threads", "map, worker processes"])
def test_kills(tmp_path: Path, kind: str) -> None:
    """In a process of its own: what is forked must not have threads."""
    words = ("-m", "durability", "kills", "--kills", "40", "--kind", kind)
    done = python(*words, "--json", tmp_path / "kills.json", cwd=SCRIPTS, timeout=540)
    assert done.returncode == 0, done.stderr
