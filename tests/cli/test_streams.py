"""The program when nobody can take what it says: one line, exit code 2, never a traceback."""

import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from arms import URDF
from command_line import run, started
from tiers import sampled, tiered

from pinsing.cli import app
from pinsing.cli.app import VARIANTS

COMMANDS = {
    "at": ["at", "planar3r", "--q", "0,0,0", "--fail-if-singular", "--no-distances"],
    "json": ["map", "planar3r", "--count", "5000", "-o", "-"], "help": ["--help"], "nothing": [],
}  # fmt: skip
FULL = Path("/dev/full")
TAKES_NOTHING = "pinsing: error: cannot write to standard output: "


def shell(words: list[str], ending: str) -> subprocess.CompletedProcess[str]:
    line = f'"$0" -m pinsing "$@" {ending}'
    command = ["bash", "-c", line, sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def errors(done: subprocess.CompletedProcess[str]) -> list[str]:
    return [x for x in done.stderr.splitlines() if not x.startswith("pinsing: note")]


@pytest.mark.parametrize("name", tiered(COMMANDS, {"at"}))
def test_closed(name: str) -> None:
    done = shell(COMMANDS[name], ">&-")
    assert done.returncode == 2
    assert errors(done) == [TAKES_NOTHING + "it is closed"]


@pytest.mark.slow
def test_all_closed() -> None:
    assert shell(COMMANDS["at"], "<&- >&- 2>&-").returncode == 2


@pytest.mark.slow
def test_a_reader_that_has_gone() -> None:
    done = shell(COMMANDS["json"], "| true; exit ${PIPESTATUS[0]}")
    assert done.returncode == 141
    assert errors(done) == []


@pytest.mark.slow
@pytest.mark.parametrize("ending", tiered(["2>&-", "2> /dev/full"], {"2>&-"}))
def test_nobody_hears_the_messages(ending: str) -> None:
    done = shell(COMMANDS["at"], ending)
    assert done.returncode == 1  # it is singular, and that was asked for
    assert "SINGULAR" in done.stdout.splitlines()[0]


@pytest.mark.slow
def test_a_file_is_whole_though_stdout_is_closed(tmp_path: Path) -> None:
    """Its number is that of the stream which is not there: nothing printed may get into it."""
    words = ["map", "planar3r", "--count", "5000", "-o"]
    for out, ending in (("a.json", ">&-"), ("b.json", "")):
        done = shell([*words, str(tmp_path / out)], ending)
        assert done.returncode == (2 if ending else 0)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["a.json", "b.json"]


@pytest.mark.slow
def test_a_stream_that_others_have_set_not_to_wait(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    words = ["map", "planar3r", "--count", "50000", "--worst", "20000", "-o", "-"]
    with started("-m", "pinsing", *words, stdout=writer) as child:
        os.close(writer)
        with open(reader, "rb") as file:
            text = file.read()
    assert child.returncode == 0
    assert len(text) > 1_000_000
    assert text.rstrip().endswith(b"}")


SHORT = ("analyze", "planar3r", "--levels", "1", "--samples", "5")
PRINTING = {
    "list --info": ("list", "planar3r"),
    "analyze": (*SHORT, "--random-starts", "2", "--fail-if-singular"),
    "at": ("at", "planar3r", "--q", "0,0,0", "--fail-if-singular"),
    "check": ("check", "planar3r", "PATH"),
    "path": ("path", "--help"),
    "line": ("line", "stanford", "--q", "0.1,0.7,0.3,0.2,0.6,0.1", "--to", "0.1,0.2,0.3"),
    "at --suggest": ("at", "--suggest", "planar3r"),
    "postures --aspects": ("postures", "--aspects", "planar3r"),
    "postures": ("postures", "planar3r", "--q", "0,1,0.5"),
    "postures --cuspidal": ("postures", "--cuspidal", "planar3r", "--poses", "1"),
    "export": ("export", "planar3r", "-o", "-.h"),
    "analyze --sweep": (*SHORT, "--sweep"),
    "map": ("map", "planar3r", "--count", "2000"),
    "families": ("families", "planar3r"),
    "verify": ("verify", "CERTIFICATE"),
    "view": ("view", "--help"),
    "plot": ("plot", "--help"),  # and so is a figure
    "report": ("report", "--help"),  # a report is a file: nothing else goes to stdout
    "export --urdf": ("export", "--urdf", str(URDF / "stanford.dh.yaml"), "-o", "-"),
    "list": ("list", "ur"),
    "zones": ("zones", "--help"),
}
ENDINGS = {"full": ">/dev/full", "closed": ">&-", "gone": "| true; exit ${PIPESTATUS[0]}"}


def commands() -> list[str]:
    def below(group: Any, path: str = "") -> Iterator[str]:
        for name, one in group.commands.items():
            whole = f"{path} {name}".strip()
            yield from below(one, whole) if hasattr(one, "commands") else [whole]

    return [*below(app.command), *VARIANTS]


def test_every_command_is_here() -> None:
    assert sorted(commands()) == sorted(PRINTING)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("read")
    (folder / "path.csv").write_text("0,0.5,0.7\n0.2,0.0,0.0\n")
    certificate = folder / "proof.cert.json"
    done = shell(["families", "planar3r", "-o", str(certificate)], "")
    assert done.returncode == 0, done.stderr
    return {"PATH": str(folder / "path.csv"), "CERTIFICATE": str(certificate)}


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize("name", sorted(PRINTING))
def test_no_command_ends_with_1_where_nobody_takes_its_output(read, name):
    """Also where 1 is what it would end with: that means something else."""
    for words in ([read.get(word, word) for word in PRINTING[name]], [*name.split(), "--help"]):
        for kind, ending in ENDINGS.items():
            done = shell(words, ending)
            assert "Traceback" not in done.stderr
            # What is read by nobody may have been written before its reader went.
            assert done.returncode in ({141, 0} if kind == "gone" else {2}), (kind, done.stderr)
            said = [x for x in done.stderr.splitlines() if x.startswith("pinsing: error: ")]
            reason = {"full": "No space left on device", "closed": "it is closed"}.get(kind, "")
            assert said == [TAKES_NOTHING + reason] * (done.returncode == 2), done.stderr
            assert all(x.startswith("pinsing: ") for x in done.stderr.splitlines())


@pytest.mark.parametrize("limit", sampled([30_000, 60_000, 150_000, 300_000, 500_000]))
def test_a_memory_limit_is_said_in_one_line(limit: int) -> None:
    line = f'ulimit -v {limit}; "$0" -m pinsing "$@"'
    words = [sys.executable, "list", "planar3r"]
    done = subprocess.run(
        ["bash", "-c", line, *words], capture_output=True, text=True, timeout=120, check=False
    )
    if limit <= 30_000 and "pinsing" not in done.stderr:
        pytest.skip("Python itself does not start")
    assert done.returncode == 2
    (said,) = done.stderr.splitlines()
    assert said.startswith("pinsing: error: memory is limited to ") or "out of memory" in said
    assert said.endswith("raise the limit (ulimit -v)")


def failed(error: Exception, monkeypatch: pytest.MonkeyPatch) -> Any:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(importlib.import_module("pinsing.robot.load"), "given_file", fail)
    return run("list", "planar3r")


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(), RuntimeError("std::bad_alloc"), RuntimeError("can't start new thread"),
        ImportError("libcoal.so: failed to map segment from shared object"),
    ],
)  # fmt: skip
def test_running_out_of_memory_is_one_line(error, monkeypatch):
    done = failed(error, monkeypatch)
    assert done.exit_code == 2
    said = "pinsing: error: out of memory: ask for less, or close other programs"
    assert done.stderr.splitlines() == [said]


def test_any_other_error_is_not_taken_for_too_little_memory(monkeypatch):
    done = failed(RuntimeError("a fault of ours"), monkeypatch)
    assert isinstance(done.exception, RuntimeError)
