"""The README's commands and code do what it shows."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from pinsing.cli.app import command

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)

# One runs for minutes on a clean clone and sets up an environment: .ci/run calls these two.
SCRIPTS = ("scripts/demo", "scripts/test")


def commands() -> list[tuple[str, str]]:
    """Each command shown, and what is shown of its output."""
    found = []
    for kind, text in BLOCKS:
        if kind == "console":
            for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                line, _, output = part.partition("\n")
                found.append((re.sub(r"\s+#.*", "", line).strip(), output))
    return found


def pattern(shown: str) -> str:
    """A regular expression of shown output, in which ``...`` stands for anything."""
    escaped = re.escape(shown.strip())
    return re.sub(r"(\\\s|\\\n)*(\\\.){3}(\\\s|\\\n)*", r"[\\s\\S]*", escaped)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "urdf").symlink_to(ROOT / "urdf")
    return tmp_path


def test_two_commands_come_first():
    assert [line for line, _ in commands()[:2]] == list(SCRIPTS)
    for name in SCRIPTS:
        assert os.access(ROOT / name, os.X_OK)


def test_commands_print_what_is_shown(folder, monkeypatch):
    """In the order of the README: later ones use files of earlier ones."""
    monkeypatch.chdir(folder)
    for line, shown in commands():
        if line in SCRIPTS:
            continue
        words = shlex.split(line)
        assert words[0] == "pinsing", line
        done = CliRunner().invoke(command, words[1:], prog_name="pinsing", catch_exceptions=False)
        assert done.exit_code == 0, f"{line}\n{done.stderr}"
        assert re.search(pattern(shown), done.stdout), f"{line}\n{done.stdout}"


@pytest.mark.parametrize("code", [text for kind, text in BLOCKS if kind == "python"])
def test_python_runs(code, folder):
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("target", re.findall(r"\]\((?!https?:)([^)#]+)\)", README))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists(), f"README links to {target}"
