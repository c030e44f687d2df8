"""What the program says when nobody can take it, or where input and files are odd: one line."""

import contextlib
import importlib
import json
import os
import re
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest
from arms import URDF
from command_line import python, run, started
from tiers import sampled, tiered_rows
from urdf_texts import robot

import pinsing
from pinsing.atomic_write import check_writable, write_text
from pinsing.cli import app, output
from pinsing.cli.app import VARIANTS
from pinsing.cli.output import say, waiting
from pinsing.errors import OutputError, PinsingError, ResultError

AT = ["at", "planar3r", "--q", "0,0,0", "--fail-if-singular", "--no-distances"]
JSON = ["map", "planar3r", "--count", "5000", "-o"]
FULL = Path("/dev/full")
TAKES_NOTHING = "pinsing: error: cannot write to standard output: "


def shell(words: list[str], ending: str, before: str = "") -> subprocess.CompletedProcess[str]:
    line = f'{before}"$0" -m pinsing "$@" {ending}'
    command = ["bash", "-c", line, sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


CLOSED = [TAKES_NOTHING + "it is closed"]
STREAMS: list[tuple[list[str], str, int, list[str]]] = [
    (AT, ">&-", 2, CLOSED), ([*JSON, "-"], ">&-", 2, CLOSED), (["--help"], ">&-", 2, CLOSED),
    ([], ">&-", 2, CLOSED), (AT, "<&- >&- 2>&-", 2, []), (AT, "2>&-", 1, []),
    (AT, "2> /dev/full", 1, []), ([*JSON, "-"], "| true; exit ${PIPESTATUS[0]}", 141, []),
]  # fmt: skip
"""A command and its streams; how it ends, and its errors: 1 is of what was asked for."""


@pytest.mark.parametrize(("words", "ending", "code", "said"), tiered_rows(STREAMS, STREAMS[:1]))
def test_streams_that_are_not_there(words, ending, code, said) -> None:
    done = shell(words, ending)
    assert done.returncode == code
    notes = "pinsing: note"
    assert [x for x in done.stderr.splitlines() if not x.startswith(notes)] == said
    if code == 1:
        assert "SINGULAR" in done.stdout.splitlines()[0]


@pytest.mark.slow
def test_a_file_is_whole_though_stdout_is_closed(tmp_path: Path) -> None:
    """Its number is that of the stream which is not there: nothing printed may get into it."""
    for out, ending in (("a.json", ">&-"), ("b.json", "")):
        done = shell([*JSON, str(tmp_path / out)], ending)
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
# Of the others the help: what they make goes into files.
PRINTING = {
    "list --info": ("list", "planar3r"),
    "analyze": (*SHORT, "--random-starts", "2", "--fail-if-singular"),
    "at": ("at", "planar3r", "--q", "0,0,0", "--fail-if-singular"),
    "check": ("check", "planar3r", "PATH"),
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
    "export --urdf": ("export", "--urdf", str(URDF / "stanford.dh.yaml"), "-o", "-"),
    "list": ("list", "ur"),
}
ENDINGS = {"full": ">/dev/full", "closed": ">&-", "gone": "| true; exit ${PIPESTATUS[0]}"}


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
@pytest.mark.parametrize("name", sorted([*app.COMMANDS, *VARIANTS]))
def test_no_command_ends_with_1_where_nobody_takes_its_output(read, name):
    """Also where 1 is what it would end with: that means something else."""
    asked = [*name.split(), "--help"]
    for words in ([read.get(word, word) for word in PRINTING.get(name, asked)], asked):
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
    done = shell(["list", "planar3r"], "", f"ulimit -v {limit}; ")
    if limit <= 30_000 and "pinsing" not in done.stderr:
        pytest.skip("Python itself does not start")
    assert done.returncode == 2
    (said,) = done.stderr.splitlines()
    assert said.startswith("pinsing: error: memory is limited to ") or "out of memory" in said
    assert said.endswith("raise the limit (ulimit -v)")


LITTLE = "pinsing: error: out of memory: ask for less, or close other programs\n"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), LITTLE), (RuntimeError("std::bad_alloc"), LITTLE),
        (RuntimeError("can't start new thread"), LITTLE),
        (ImportError("libcoal.so: failed to map segment from shared object"), LITTLE),
        (RuntimeError("a fault of ours"), ""),
    ],
)  # fmt: skip
def test_running_out_of_memory_is_one_line_and_no_other_error_is(error, said, monkeypatch):
    fail = Mock(side_effect=error)
    monkeypatch.setattr(importlib.import_module("pinsing.robot.load"), "given_file", fail)
    done = run("list", "planar3r")
    assert done.stderr == said
    assert done.exit_code == 2 if said else done.exception is error


AT_IMPORT = """
import os, signal, sys
class Pressed:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r} and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Pressed())
"""
AT_THE_END = """
import atexit, os, signal, sys
atexit.register(os.kill, os.getpid(), signal.SIGINT)
"""
RUN = """
sys.argv = ["pinsing", "list", "panda"]
from pinsing.cli import program
program()
"""


@pytest.mark.parametrize("module", ["click", "pinsing.cli.app", "pinsing.robot.load"])
def test_ctrl_c_in_the_middle_of_imports(module):
    """Ctrl-C: click ends the line that was typed. The last is imported while a command runs."""
    done = python("-c", AT_IMPORT.format(module=module) + RUN, timeout=60)
    assert (done.returncode, done.stderr.split()) == (130, ["pinsing:", "stopped"])
    assert done.stdout == ""


@pytest.mark.slow
def test_ctrl_c_when_all_is_done():
    done = python("-c", AT_THE_END + RUN, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert "panda" in done.stdout


def unwritable(path: str | Path, write: Callable[..., object] = check_writable) -> str:
    """What is said of a place for output, in one line."""
    with pytest.raises(OutputError) as raised:
        write(path)
    assert str(raised.value).isprintable()
    return str(raised.value)


def test_what_is_written_over_stays_what_it_was(tmp_path):
    real, link, fresh = (tmp_path / f"{name}.txt" for name in ("real", "link", "fresh"))
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    (tmp_path / "new").symlink_to("fresh.txt")
    write_text(link, "new")
    write_text(check_writable(tmp_path / "new"), "x")  # the file it stands for is made
    assert link.is_symlink()
    assert (tmp_path / "new").is_symlink()
    assert (real.read_text(), fresh.read_text()) == ("new", "x")
    mask = os.umask(0)
    os.umask(mask)
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (real, fresh)]
    assert modes == [0o640, 0o666 & ~mask]
    write_text(os.devnull, "x")
    assert not Path(os.devnull).is_file()


def test_places_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "far").symlink_to("no/where")
    for place, said in (
        (tmp_path / "loop", "leads to itself"),
        (tmp_path / "far", "no such folder"),
        (tmp_path / "no" / "x.json", "cannot write"),
        (tmp_path, "cannot write"),
        ("", "it is a folder"),
        ("a\0b", "null character"),
        ("\ud800.html", "half a character"),
        (tmp_path / "a\nb" / "c.txt", r"a\nb"),
        ("x" * 10**6, "cannot write"),
    ):
        message = unwritable(place)
        assert said in message
        assert len(message) < 300
    assert "leads to itself" in unwritable(tmp_path / "loop", lambda path: write_text(path, "x"))
    assert (tmp_path / "loop").is_symlink()
    (tmp_path / "in").touch()
    said = unwritable(tmp_path / "in", lambda path: check_writable(path, inputs=(path,)))
    assert "it is the input" in said
    say(f"wrote {tmp_path}/a\nb")
    assert capsys.readouterr().err.count("\n") == 1
    message = str(PinsingError("no \ud800\x1b[2J\nhere" + "x" * 10**6))
    assert message.encode().isascii()
    assert message.isprintable()
    assert len(message) < 5000


def test_a_map_into_what_is_no_folder(tmp_path):
    def drawn(out: str | Path) -> object:
        return pinsing.sampling.sigma_map(pinsing.load("planar3r"), count=8, out=out)

    (tmp_path / "link").symlink_to("no")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_text("")
    for name, why in (("link", "not there"), ("pipe", "pipe"), ("file", "it is a file")):
        assert why in unwritable(tmp_path / name, drawn)
    for bad in ("\ud800", "x" * 10**6, "a/" * 10**5):
        assert len(unwritable(bad, drawn)) < 500


def test_settings_of_figures_are_read_from_files_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLBACKEND", "agg")
    os.mkfifo(tmp_path / "matplotlibrc")
    for named in ("/dev/full", str(tmp_path), str(tmp_path / "matplotlibrc")):
        monkeypatch.setenv("MATPLOTLIBRC", named)
        output.off_screen()
        assert "MATPLOTLIBRC" not in os.environ
        assert capsys.readouterr().err.count("MATPLOTLIBRC is ignored") == 1
    mine = tmp_path / "mine"
    mine.write_text("")
    monkeypatch.setenv("MATPLOTLIBRC", str(mine))
    output.off_screen()
    assert os.environ["MATPLOTLIBRC"] == str(mine)


def test_half_a_character_in_a_result():
    arm = pinsing.load("planar3r", task="position")
    state = pinsing.at(arm, [0.1, 0.2, 0.3])
    form = pinsing.closed_form(arm)
    for result, old in ((state, '"q2"'), (form, '"planar3r"'), (form.families[0], '"q2"')):
        text = result.to_json(indent=None)
        assert old in text
        with pytest.raises(ResultError, match="half a character"):
            type(result).from_json(text.replace(old, r'"\ud800"'))


def test_numbers_in_a_result_that_cannot_be_reckoned_with(recwarn):
    state = pinsing.at(pinsing.load("planar3r", task="position"), [0.1, 0.2, 0.3]).to_dict()
    for key, value in state.items():
        huge = json.loads(json.dumps(value), parse_float=lambda _: 1e308)
        with contextlib.suppress(ResultError):
            pinsing.State.from_dict({**state, key: huge})
    assert not recwarn.list


def test_a_long_step_is_said_once_and_a_short_one_never(capsys: pytest.CaptureFixture[str]) -> None:
    with waiting(after=0.2) as at:
        at("short")
        time.sleep(0.01)
        at("long")
        time.sleep(0.5)
        at("")
        time.sleep(0.3)
    assert capsys.readouterr() == ("", "pinsing: long \u2026\n")


def test_on_a_terminal_the_line_counts_and_goes_also_after_an_error(capsys, monkeypatch):
    monkeypatch.setattr(output, "is_terminal", lambda stream: True)

    def interrupted():
        with waiting(after=0.05) as at:
            for k in range(26):
                at("long", f"{k} boxes")
                time.sleep(0.05)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    told = capsys.readouterr().err
    assert "pinsing: long \u2026 0 s" in told
    assert "pinsing: long \u2026 1 s 2" in told
    assert told.endswith("\r\x1b[K")
    assert "\n" not in told


@pytest.mark.parametrize(
    "name", ["at --q 0,0,0", "list --info", "analyze --sweep", "analyze", "families"]
)
def test_output_is_checked_before_the_robot_is_read(tmp_path, monkeypatch, name):
    never = Mock(side_effect=AssertionError("the robot was read"))
    monkeypatch.setattr(importlib.import_module("pinsing.robot.load"), "load", never)
    for end in ("json", "npz") if "sweep" in name else ("json",):
        bad = tmp_path / "none" / f"x.{end}"
        done = run(*name.split(), "-o", bad, "planar3r")
        assert (done.exit_code, done.stdout) == (2, "")
        assert re.fullmatch("pinsing: error: cannot write .*\n", done.stderr)
    assert list(tmp_path.iterdir()) == []


def test_the_robot_itself_is_not_replaced(tmp_path):
    path = tmp_path / "robot.json"
    path.write_text(robot())
    assert "robot itself" in run("at", path, "--q", "0,0", "-o", path).stderr
    assert path.read_text() == robot()
