"""The program when nobody can take what it says: one line, exit code 2, never a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMANDS = {
    "at": ["at", "planar3r", "--q", "0,0,0", "--fail-if-singular"],
    "json": ["map", "planar3r", "--count", "5000", "--json", "-"],
    "help": ["--help"],
    "nothing": [],
}
FULL = Path("/dev/full")


def shell(words: list[str], ending: str) -> subprocess.CompletedProcess[str]:
    line = f'"$0" -m pinsing "$@" {ending}'
    command = ["bash", "-c", line, sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def errors(done: subprocess.CompletedProcess[str]) -> list[str]:
    return [x for x in done.stderr.splitlines() if not x.startswith("pinsing: note")]


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize("name", COMMANDS)
def test_full(name: str) -> None:
    done = shell(COMMANDS[name], "> /dev/full")
    assert done.returncode == 2
    said = "pinsing: error: cannot write to standard output: No space left on device"
    assert errors(done) == [said]


@pytest.mark.parametrize("name", COMMANDS)
def test_closed(name: str) -> None:
    done = shell(COMMANDS[name], ">&-")
    assert done.returncode == 2
    assert errors(done) == ["pinsing: error: cannot write to standard output: it is closed"]


def test_all_closed() -> None:
    assert shell(COMMANDS["at"], "<&- >&- 2>&-").returncode == 2


def test_a_reader_that_has_gone() -> None:
    done = shell(COMMANDS["json"], "| true; exit ${PIPESTATUS[0]}")
    assert done.returncode == 141
    assert errors(done) == []


def test_nobody_hears_the_messages() -> None:
    for ending in ("2>&-", "2> /dev/full"):
        done = shell(COMMANDS["at"], ending)
        assert done.returncode == 1  # it is singular, and that was asked for
        assert done.stdout.startswith("arm  ")


def test_a_file_is_whole_though_stdout_is_closed(tmp_path: Path) -> None:
    """Its number is that of the stream which is not there: nothing printed may get into it."""
    words = ["map", "planar3r", "--count", "5000", "--json"]
    for out, ending in (("a.json", ">&-"), ("b.json", "")):
        done = shell([*words, str(tmp_path / out)], ending)
        assert done.returncode == (2 if ending else 0)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["a.json", "b.json"]


def test_a_stream_that_others_have_set_not_to_wait(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    words = ["map", "planar3r", "--count", "50000", "--worst", "20000", "--json", "-"]
    with subprocess.Popen(
        [sys.executable, "-m", "pinsing", *words], stdout=writer, stderr=subprocess.PIPE
    ) as child:
        os.close(writer)
        with open(reader, "rb") as file:
            text = file.read()
    assert child.returncode == 0
    assert len(text) > 1_000_000
    assert text.rstrip().endswith(b"}")
