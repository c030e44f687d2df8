"""Ctrl-C before the work begins and after it is done: the exit code tells, and no traceback."""

import pytest
from command_line import python

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


def ended(code):
    return python("-c", code + RUN, timeout=60)


@pytest.mark.parametrize("module", ["click", "pinsing.cli.app", "pinsing.description.catalog"])
def test_in_the_middle_of_imports(module):
    done = ended(AT_IMPORT.format(module=module))
    assert done.returncode == 130
    assert done.stderr.split() == ["pinsing:", "stopped"]  # click ends the line that was typed
    assert done.stdout == ""


@pytest.mark.slow
def test_when_all_is_done():
    done = ended(AT_THE_END)
    assert done.returncode == 0
    assert done.stderr == ""
    assert "panda" in done.stdout
