"""What commands say, one transcript a command: ``PINSING_WORDS=1 pytest`` writes them anew.

A transcript is a list of commands, ``$ pinsing ...``, each with its first lines, all
that it says on stderr, and its exit code where that is not 0. Add a command, write it anew.
"""

import os
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from tiers import tiered

from pinsing.cli.app import command

FOLDER = Path(__file__).parent / "words"
NAMES = sorted(path.stem for path in FOLDER.glob("*.txt"))
_LINES = 14
"""Of each answer: its first screen."""
_VARIES = (
    (r"\d[\d.]* ms\b", "# ms"),
    (r"\d\.?\d*e-1[5-9]\b", "#e-16"),
    (r"\((avx512|avx2|baseline)\)|engine \w+$", "(engine)"),
    (r"(already: )/.*/", r"\1.../"),
    (r"sha256:\w+|(?<=pinsing )\d+\.\d+\.\d+", "#"),
    (r"^pinsing: .*\u2026\n?", ""),  # a line of progress, on a slow machine
)


def said(line: str) -> str:
    done = CliRunner().invoke(command, shlex.split(line)[2:], prog_name="pinsing")
    assert "Traceback" not in done.output
    if done.exit_code == 2:
        assert done.stderr.count("pinsing: error: ") == 1
    answer = done.stdout.splitlines()
    lines = answer[:_LINES] + ["..."] * (len(answer) > _LINES) + done.stderr.splitlines()
    text = "\n".join([line, *lines, *[f"exit {done.exit_code}"] * bool(done.exit_code)])
    for pattern, mark in _VARIES:
        text = re.sub(pattern, mark, text, flags=re.MULTILINE)
    return text.rstrip()


@pytest.mark.parametrize("name", tiered(NAMES, {*NAMES} - {"check", "families", "line"}))
def test_words(name, monkeypatch):
    path = FOLDER / f"{name}.txt"
    monkeypatch.chdir(FOLDER)
    monkeypatch.setenv("COLUMNS", "100")
    before = path.read_text()
    lines = [line for line in before.splitlines() if line.startswith("$ pinsing")]
    assert lines
    there = sorted(FOLDER.rglob("*"))
    now = "\n\n".join(map(said, lines)) + "\n"
    assert sorted(FOLDER.rglob("*")) == there  # nothing is written
    if os.environ.get("PINSING_WORDS"):
        path.write_text(now)
    else:
        assert now == before
