"""The child process in which xacro runs.

It is started by path (see `pinsing.description.files`), gets a request on stdin, asks its parent
for files and packages, and answers, all in lines of JSON. Being a process of its own it may bend
xacro to what pinsing needs, and may be stopped when a file never ends:

- expressions are interpreted (`pinsing.description.xacro_expression`), where xacro would hand them
  to Python's eval; the functions that xacro offers them are replaced by our own;
- files, wildcards, packages and environment variables are asked for, never opened or read;
- document types and entities are refused in every file;
- memory and time are limited, and after the imports Python and the kernel are told to let nothing
  in or out (`pinsing.description.child_jail`).
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import types
from pathlib import Path
from typing import Any


def find_siblings() -> None:
    """Make modules beside this one importable without running the package around them."""
    here = Path(__file__).resolve().parent
    for name, folder in (("pinsing", here.parent), ("pinsing.description", here)):
        module = types.ModuleType(name)
        module.__path__ = [str(folder)]
        sys.modules[name] = module


class Parent:
    """The process that started this one: asks it, and remembers the arguments it gave."""

    def __init__(self) -> None:
        self._in, self._out = sys.stdin.buffer, sys.stdout.buffer
        self.request: dict[str, Any] = json.loads(self._in.readline())

    def ask(self, kind: str, text: str) -> dict[str, Any]:
        """Return the answer to a question."""
        self.tell({"ask": kind, "text": text})
        answer: dict[str, Any] = json.loads(self._in.readline())
        return answer

    def tell(self, message: dict[str, Any]) -> None:
        """Send a message."""
        self._out.write(json.dumps(message).encode() + b"\n")
        self._out.flush()


def expand(parent: Parent) -> dict[str, Any]:
    """Run xacro on the request's file."""
    request = parent.request
    try:
        import xacro
    except ImportError as error:
        return {"problem": f"xacro cannot be imported ({error}): pip install xacro"}
    from pinsing.description import child_jail
    from pinsing.description.xacro_expression import Refused
    from pinsing.description.xacro_rules import Arguments, Places, Rules, explain

    places, arguments = Places(), Arguments(request["arguments"])
    Rules(xacro, parent.ask, places, arguments).enforce()
    xacro.root_dir = os.getcwd()
    os.environ.clear()  # variables are asked for, too
    sys.setrecursionlimit(4000)
    no_wall = child_jail.close_in() if request["wall"] else "not asked for"
    child_jail.watch(lambda event: Refused(f"a call of {event} is not accepted"))
    noise = io.StringIO()
    try:
        with contextlib.redirect_stderr(noise), contextlib.redirect_stdout(noise):
            text = xacro.process_file(request["path"], mappings=arguments).toprettyxml(indent="  ")
            text.encode()
    except Exception as error:  # a file may bring about any
        return explain(error, xacro, places)
    warnings = [w[9:] for w in noise.getvalue().splitlines() if w.startswith("warning: ")]
    return {
        "xml": text,
        "unknown": sorted(set(request["arguments"]) - arguments.known),
        "known": sorted(arguments.known),
        "warnings": warnings,
        "no_wall": no_wall,
    }


def main() -> None:
    """Answer one request."""
    parent = Parent()
    sys.path[:] = parent.request["sys_path"]
    find_siblings()
    from pinsing.description import child_jail

    child_jail.limit_resources(parent.request["seconds"], parent.request["memory"])
    parent.tell({"answer": expand(parent)})


if __name__ == "__main__":
    main()
