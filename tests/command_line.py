"""The command line, within the process of the test; and Python in one of its own."""

import subprocess
import sys

from click.testing import CliRunner, Result

from pinsing.cli.app import command


def run(*words: object) -> Result:
    """Run `pinsing WORDS`."""
    return CliRunner().invoke(command, [*map(str, words)], prog_name="pinsing")


def and_peak(code: str) -> tuple[str, float]:
    """What a child process prints, and its peak resident memory in MiB."""
    # Not ru_maxrss: that starts from the size of the parent, which is a whole test run.
    code += (
        "lines = open('/proc/self/status').read().splitlines()\n"
        "print(next(int(x.split()[1]) for x in lines if x.startswith('VmHWM')) / 1024)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *said, peak = done.stdout.splitlines()
    return "\n".join(said), float(peak)
