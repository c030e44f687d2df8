"""Short runs of scripts/durability, and proof that it would notice."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command_line import run
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


def test_what_is_said_to_be_refused_for_mechanisms_is(tools: Any, tmp_path: Path) -> None:

    urdf = Path(__file__).parents[2] / "urdf"
    files = [str(urdf / "five_bar.urdf"), "--loops", str(urdf / "five_bar.loops.yaml")]
    for name, out in tools["commands"].REFUSED.items():
        done = run(name, *files, "-o", str(tmp_path / out))
        assert done.exit_code == 2
        assert not list(tmp_path.iterdir())


def test_an_option_that_is_not_here_is_noticed(tools: Any) -> None:
    import click

    from pinsing.cli.options import output_option

    @click.command("new")
    @output_option(picture=".png .svg")
    @click.option("--table", metavar="FILE.csv")
    @click.option("--loops", metavar="FILE.yaml")
    @click.option("--name", metavar="NAME")
    def new(**_: Any) -> None: ...

    program = click.Group(commands={"new": new, "inside": click.Group(commands={"new": new})})
    found = tools["commands"].uncovered(program)
    options = [f"{path} {o}" for path in ("inside new", "new") for o in ("picture", "--table")]
    assert sorted(found) == sorted(f"{o}{end}" for o in options for end in ("", " of a mechanism"))


QUICK = {"at .json", "sweep .npz", "plot .png"}


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(set(COMMANDS) - QUICK))
def test_each_operation_fails_in_turn_in_every_command(
    tools: Any, tmp_path: Path, command: str
) -> None:
    if command in tools["commands"].BROWSER and find_browser() is None:
        pytest.skip("there is no browser")
    assert tools["failures"].failures(command, tmp_path)[1] == []


def test_a_writer_that_cleans_nothing_up_is_noticed(
    tools: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pinsing.atomic_write as writer

    def careless(target: Path, data: bytes) -> None:
        handle = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.write(handle, data)
        os.fsync(handle)
        os.close(handle)

    monkeypatch.setattr(writer, "replace_file", careless)
    wrong = tools["failures"].failures("at .json", tmp_path)[1]
    assert any("neither old nor new" in line for line in wrong)


@pytest.mark.parametrize("command", tiered(["map FOLDER", "sweep FOLDER"], ("map FOLDER",)))
def test_loss_of_power(tools: Any, tmp_path: Path, command: str) -> None:
    row, wrong = tools["power"].cuts(command, 12, 1, tmp_path)
    assert wrong == []
    assert row["good"] == 12
    assert row["operations"] > 20


@pytest.mark.slow
def test_a_disk_that_does_not_flush_is_noticed(tools: Any, tmp_path: Path) -> None:
    """Chunks that are torn are named and done again; a torn plan cannot be gone on with."""
    row, wrong = tools["power"].cuts("map FOLDER", 25, 1, tmp_path, flushing=False)
    assert row["damaged"] + len(wrong) > 0


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


def test_the_report_says_what_was_not_measured(tools: Any) -> None:
    text = tools["report"].report({"cuts": []})
    assert text.count("Not measured.") == 2
