"""The blocks of a page in Markdown, run in its order as a reader would: commands, Python, files."""

import base64
import contextlib
import gzip
import io
import json
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import dedent

import pytest
from click.testing import CliRunner

from pinsing.cli.app import command

ROOT = Path(__file__).parents[1]

# Shell commands that set up an environment, run for hours, or need another machine. Each is said
# here, so that a block that nobody runs is a decision.
NOT_RUN = {
    "scripts/demo", "scripts/docs", "scripts/setup", "scripts/test", ".ci/run", "python3 -m venv",
    ".venv/bin/pip install", "pip install", ". .venv/bin/activate", 'eval "$(_PINSING_COMPLETE',
    "pinsing map panda --count 1e10",
}  # fmt: skip
SHELL = ("cc ", "./loop", "python meshcat_scene.py", "python src/pinsing/proof/checker.py ")
TOLD = ("text", "mermaid")  # shown, and nothing to run

_FENCED = re.compile(
    r"^ *(?P<fence>```|:::)(?:\{code-block\} )?(?P<kind>\w[\w-]*)\n(?P<body>.*?)^ *(?P=fence)$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """One block: its language, the file that it is (or none), and its text."""

    kind: str
    text: str
    file: str | None = None


def blocks(page: str) -> list[Block]:
    """All blocks of a page that have a language; one without is an error."""
    bare = re.search(r"(?:^|\n\n) *```\n(?!\n)", page)
    assert bare is None or page[: bare.start()].count("```") % 2, "a block without a language"
    found = []
    for match in _FENCED.finditer(page):
        text, file = dedent(match["body"]), None
        if text.startswith(":caption: "):
            first, _, text = text.split("\n", 2)
            file = first.removeprefix(":caption: ")
        found.append(Block(match["kind"], text, file))
    return found


def commands(text: str) -> list[tuple[str, int, str]]:
    """Each command of a console block, its exit code, and what is shown of its output."""
    found = []
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        line, _, output = part.partition("\n")
        line, _, remark = line.partition(" #")
        code = re.search(r"exit code (\d+)", remark)
        found.append((line.strip(), int(code[1]) if code else 0, output))
    return found


def pattern(shown: str) -> str:
    """A regular expression of shown output: ``...`` is anything, times and ratios are any."""
    escaped = re.escape(shown.strip())
    escaped = re.sub(r"(\\\s|\\\n)*(\\\.){3}(\\\s|\\\n)*", r"[\\s\\S]*", escaped)
    escaped = re.sub(r"[\d\\.]+(?=\\ (?:ms|s)\b)", r"[\\d.]+", escaped)
    return re.sub(r"[\d\\.]+e\\-\d\d\b", r"[\\d.]+e-\\d\\d", escaped)


@dataclass
class Reader:
    """Somebody who types all of a page in one folder."""

    names: dict[str, object] = field(default_factory=lambda: {"__name__": "__page__"})
    said: str = ""

    def read(self, page: str) -> None:
        """Run the blocks of a page."""
        for block in blocks(page):
            if block.file is not None:
                Path(block.file).write_text(block.text, encoding="utf-8")
            elif block.kind == "console":
                for line, code, shown in commands(block.text):
                    self.type(line, code, shown)
            elif block.kind == "python":
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(compile(block.text, "<page>", "exec"), self.names)
                self.said = out.getvalue()
            elif block.kind == "output":
                assert re.search(pattern(block.text), self.said), self.said
            elif block.kind == "sh":
                for line in block.text.splitlines():
                    self.shell(line)
            else:
                assert block.kind in TOLD, f"nobody runs a block of {block.kind}"

    def type(self, line: str, code: int, shown: str) -> None:
        """Type one command, and compare."""
        if any(line.startswith(words) for words in NOT_RUN):
            return
        words = shlex.split(line)
        assert words[0] == "pinsing", line
        done = CliRunner().invoke(command, words[1:], prog_name="pinsing", catch_exceptions=False)
        assert done.exit_code == code, f"{line}\n{done.stderr}"
        assert re.search(pattern(shown), done.stdout), f"{line}\n{done.stdout}"
        self.said = done.stdout

    def shell(self, line: str) -> None:
        """Give one line to the shell, if it is one of those that are run."""
        if not line.strip() or any(line.startswith(words) for words in NOT_RUN):
            return
        assert line.startswith(SHELL), f"nobody runs {line}"
        line = line.replace("python src/", f"python {ROOT}/src/")
        line = line.replace("python ", f"{shlex.quote(sys.executable)} ")
        done = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        self.said = done.stdout


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Reader:
    """A reader in an empty folder, not in a clone."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    return Reader()


def baked(text: str) -> dict:
    """What a static page that is given as text holds."""
    packed = re.search(r'id="baked-page"[^>]*>([^<]+)<', text)
    return json.loads(gzip.decompress(base64.b64decode(packed[1])))
