"""The command line, within the process of the test; and Python in one of its own."""

import subprocess
import sys
from typing import Any

from click.testing import CliRunner, Result

from pinsing.cli.app import command


def run(*words: object) -> Result:
    """Run `pinsing WORDS`."""
    return CliRunner().invoke(command, [*map(str, words)], prog_name="pinsing")


def python(*words: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own: what it prints, and how it ends."""
    line = [sys.executable, *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, **more)


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
