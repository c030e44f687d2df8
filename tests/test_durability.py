"""Short runs of scripts/durability, and proof that it would notice."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).parent.parent / "scripts"


@pytest.fixture(scope="module")
def tools() -> Any:
    sys.path.insert(0, str(SCRIPTS))
    try:
        names = ("disk", "failures", "power", "kills", "report")
        return {name: importlib.import_module(f"durability.{name}") for name in names}
    finally:
        sys.path.remove(str(SCRIPTS))


@pytest.mark.parametrize("command", ["at --json", "sweep --out FILE.npz", "plot .png"])
def test_each_operation_fails_in_turn(tools: Any, tmp_path: Path, command: str) -> None:
    rows, wrong = tools["failures"].failures(command, tmp_path)
    assert wrong == []
    operations = {row["operation"].split(",")[0] for row in rows}
    assert operations >= {"open", "write", "fsync", "replace", "fsync of a folder"}
    assert all(row["good"] == row["cases"] > 0 for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", ["map --out DIR", "sweep --out DIR", "families --certificate", "view --html", "dh"]
)
def test_each_operation_fails_in_turn_in_long_commands(
    tools: Any, tmp_path: Path, command: str
) -> None:
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
    wrong = tools["failures"].failures("at --json", tmp_path)[1]
    assert any("neither old nor new" in line for line in wrong)


@pytest.mark.parametrize("command", ["map --out DIR", "sweep --out DIR"])
def test_loss_of_power(tools: Any, tmp_path: Path, command: str) -> None:
    row, wrong = tools["power"].cuts(command, 12, 1, tmp_path)
    assert wrong == []
    assert row["good"] == 12
    assert row["operations"] > 20


def test_a_disk_that_does_not_flush_is_noticed(tools: Any, tmp_path: Path) -> None:
    """Chunks that are torn are named and done again; a torn plan cannot be gone on with."""
    row, wrong = tools["power"].cuts("map --out DIR", 25, 1, tmp_path, flushing=False)
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
