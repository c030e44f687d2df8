"""Text for people: its width, its colours, and what can be pasted out of it."""

import contextlib
import fcntl
import io
import os
import pty
import re
import shlex
import struct
import termios

import pytest
from command_line import run as pinsing_command, started
from tiers import tiered

from pinsing.prose import NARROWEST, WIDEST, Page, Table, alarm, columns, safe

ANSI = re.compile(r"\x1b\[[0-9;]*m")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _own_terminal(monkeypatch):
    for name in ("NO_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")


def in_terminal(width: int, *words: str, **environment: str) -> str:
    """What a terminal of some width is sent, stdout and stderr, and what remains shown of it."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
    env = {**os.environ, "TERM": "xterm-256color", **environment}
    child = started("-m", "pinsing", *words, stdin=slave, stdout=slave, stderr=slave, env=env)
    os.close(slave)
    text = b""
    with contextlib.suppress(OSError):  # until the other end is closed
        while part := os.read(master, 65536):
            text += part
    os.close(master)
    child.wait(60)
    text = text.decode().replace("\r\n", "\n")
    return re.sub(r"(?m)^.*\r\x1b\[K", "", text)  # a bar that was drawn over


class TestPage:
    def test_width_and_colour_of_a_terminal_and_of_a_pipe(self, monkeypatch):
        assert Page.of(io.StringIO()) == Page(100, False)
        assert Page.of(Terminal()).colour
        monkeypatch.setenv("NO_COLOR", "1")
        assert not Page.of(Terminal()).colour
        monkeypatch.setenv("NO_COLOR", "")  # no-color.org: set and not empty
        assert Page.of(Terminal()).colour
        monkeypatch.setenv("TERM", "dumb")
        assert not Page.of(Terminal()).colour

    @pytest.mark.parametrize(
        ("given", "width"), [("80", 80), ("10", NARROWEST), ("900", WIDEST), ("", 100), ("x", 100)]
    )
    def test_columns_count_where_a_terminal_does_not_tell(self, monkeypatch, given, width):
        monkeypatch.setenv("COLUMNS", given)
        assert Page.of(Terminal()).width == width
        assert Page.of(io.StringIO()).width == 100

    def test_names_cannot_paint(self):
        page = Page(100, colour=True)
        shown = page.paragraph("a\x1b[31mb", alarm("c\x1b[2Jd"))
        assert shown == "a\\x1b[31mb\x1b[1;31mc\\x1b[2Jd\x1b[0m"
        assert safe(shown, painted=True) == shown
        assert "\x1b" not in safe(shown)
        assert safe("\x1b[2J", painted=True) == "\\x1b[2J"

    def test_finished_lines_are_wrapped_under_their_beginning(self):
        first, *rest = "  12  one two three four", "      --q 1,2,3 and so on and on"
        rest += ["SINGULAR: one two three", "short"]
        text = "\n".join([f"{first} five", *rest])
        assert Page(28).fitted(text).split("\n") == [first, "      five", *rest]
        assert "\n  three" in Page(22).fitted(text)
        for width in (22, 28):  # colours take no room and change no break
            painted = Page(width, colour=True).fitted(text)
            assert "\x1b[1;31mSINGULAR\x1b[0m: one" in painted
            assert ANSI.sub("", painted) == Page(width).fitted(text)

    def test_a_wide_table_wraps_its_widest_columns(self):
        rows = (("1", "x" * 70, "some words that go on and on for a while", "m"),)
        text = Page(60).table(Table(("#", "name", "note", "unit"), rows, frozenset({0})))
        assert max(map(len, text.splitlines())) <= 60
        assert text.count("x") == 70
        assert "".join(text.split()).count("while") == 1


COMMANDS = [
    ("analyze", "ur5", "--levels", "1"), ("families", "panda"),
    ("at", "ur5", "--deg", "--q", "0,-80,60,-100,0,0"), ("list", "panda"),
    ("analyze", "--sweep", "panda", "--levels", "1"), ("map", "ur5", "--count", "1000"),
    ("list", "tal"), ("at", "--suggest", "scara"),
]  # fmt: skip


def run(*words: str) -> str:
    done = pinsing_command(*words)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("words", tiered(COMMANDS, (COMMANDS[2],)), ids=lambda words: words[0])
def test_lines_are_as_long_as_the_page_is_wide(words, monkeypatch):
    longest = []
    for width in (60, 100, 200):
        monkeypatch.setattr("pinsing.prose.WIDTH", width)
        lines = run(*words).splitlines()
        assert len(lines) >= 2
        # Paths stay whole, to be copied.
        longest.append(max(columns(line) for line in lines if "/robots/" not in line))
        assert longest[-1] <= width
    assert longest[0] < longest[1] <= longest[2] or words[0] in ("list", "map", "at")


@pytest.mark.slow
@pytest.mark.parametrize("width", [60, 200])
def test_a_terminal_is_filled_and_not_overrun(width):
    shown = ANSI.sub("", in_terminal(width, "analyze", "ur5", "--levels", "1", COLUMNS="80"))
    longest = max(map(columns, shown.splitlines()))
    assert width - 40 < longest <= width
    assert "Assumed:" in shown


@pytest.mark.slow
def test_verdicts_are_coloured_on_a_terminal_alone():
    singular = ("at", "puma560", "--q", "0.1,0.2,0.3,0.4,0,0.5")
    shown = in_terminal(100, *singular)
    assert "\x1b[1;31mSINGULAR\x1b[0m: rank 5" in shown
    assert "(\x1b[32mproven\x1b[0m" in in_terminal(100, "families", "puma560")
    assert "\x1b" not in in_terminal(100, *singular, NO_COLOR="1")
    piped = pinsing_command(*singular).output
    assert "SINGULAR" in piped
    assert "\x1b" not in piped


@pytest.mark.parametrize("robot", tiered(["ur5", "stanford", "xarm7"], ("stanford",)))
@pytest.mark.parametrize(("deg", "width"), [(False, 100), (True, 60)])
def test_what_is_shown_of_a_family_can_be_pasted(robot, deg, width, monkeypatch):
    monkeypatch.setattr("pinsing.prose.WIDTH", width)
    text = run("families", "-v", robot, "--deg" if deg else "--rad")
    text = re.split(r"\n\n\d+ families", text)[-1]
    examples = re.findall(r"e\.g\. (.*(?:\n {9,}.*)*)\n((?: {8}\w.*\n)+)", text)
    assert len(examples) == len(re.findall(r"(?m)^  F\d+  ", text)) > 0
    for options, lost in examples:
        assert ("--deg" in options) == deg
        assert "pi" not in options or not deg
        state = run("at", robot, *shlex.split(options))
        assert "SINGULAR" in state
        first = " ".join(lost.split()).partition(" (")[0]
        assert first in " ".join(state.split())
