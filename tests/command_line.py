"""The command line, within the process of the test; and Python in one of its own."""

import re
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from click.testing import CliRunner, Result

from pinsing.cli.app import command

# What is different elsewhere, or the next time, in what is said.
_VARIES = (
    (r"\d[\d.]* ms\b", "# ms"),
    (r"\d\.?\d*e-1[5-9]\b", "#e-16"),
    (r"\((avx512|avx2|baseline)\)|engine \w+$", "(engine)"),
    (r"(already: )/.*/|(?<=Error: )/.*/", r"\1.../"),
    (r"sha256:\w+|(?<=pinsing )\d+\.\d+\.\d+", "#"),
    (r"(?<=not JSON: maximum).*|(?<=setting an array element).*", " ..."),
    (r"^pinsing: .*\u2026\n?", ""),  # a line of progress, on a slow machine
)


def run(*words: object) -> Result:
    """Run `pinsing WORDS`."""
    return CliRunner().invoke(command, [*map(str, words)], prog_name="pinsing")


def settled(text: str) -> str:
    """What is said, with marks in place of what varies."""
    for pattern, mark in _VARIES:
        text = re.sub(pattern, mark, text, flags=re.MULTILINE)
    return text


def python(*words: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own: what it prints, and how it ends."""
    line = [sys.executable, *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, **more)


def started(*words: object, **more: Any) -> subprocess.Popen[Any]:
    """Python in a process of its own that goes on: pipes of text but where said otherwise."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, *map(str, words)], **{**pipes, **more})


def soon(holds: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait until something holds, so long at the most."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it has not come to that"
        time.sleep(0.005)


def and_peak(code: str) -> tuple[str, float]:
    """What a child process prints, and its peak resident memory in MiB."""
    # Not ru_maxrss: that starts from the size of the parent, which is a whole test run.
    code += (
        "lines = open('/proc/self/status').read().splitlines()\n"
        "print(next(int(x.split()[1]) for x in lines if x.startswith('VmHWM')) / 1024)"
    )
    done = python("-c", code, check=True)
    *said, peak = done.stdout.splitlines()
    return "\n".join(said), float(peak)
