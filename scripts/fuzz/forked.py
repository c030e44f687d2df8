"""Child processes that are forked from this one, which has loaded everything they need.

pinsing starts a new interpreter for a xacro file and for meshes. That takes most of the time of a
case; here the same child runs in a fork, under the same limits and filters.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

_WORKERS = {
    "xacro_worker.py": "pinsing.description.xacro_worker",
    "mesh_worker.py": "pinsing.view.mesh_worker",
}
_NEEDED = (
    "xacro", "yaml", "coal", "pinsing.description.child_jail", "pinsing.description.xacro_rules",
    "pinsing.description.xacro_expression",
)  # fmt: skip


class Forked:
    """Stands for ``subprocess.Popen`` of one of pinsing's own child processes."""

    def __init__(self, words: Sequence[str], **_streams: Any) -> None:
        module = importlib.import_module(_WORKERS[Path(words[-1]).name])
        child_in, own_in = os.pipe()
        own_out, child_out = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            for handle in (own_in, own_out):
                os.close(handle)
            _live(module, child_in, child_out)
        os.close(child_in)
        os.close(child_out)
        self.stdin: BinaryIO = os.fdopen(own_in, "wb")
        self.stdout: BinaryIO = os.fdopen(own_out, "rb")
        self.returncode: int | None = None

    def kill(self) -> None:
        """End it."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self, timeout: float = math.inf) -> int:
        """Wait for its end, for so many seconds."""
        limit = time.monotonic() + timeout
        while self.returncode is None:
            pid, status = os.waitpid(self.pid, 0 if timeout == math.inf else os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
            elif time.monotonic() > limit:
                raise subprocess.TimeoutExpired("child", timeout)
            else:
                time.sleep(0.0005)
        return self.returncode


def run(words: Sequence[str], input: bytes, timeout: float, **_rest: Any) -> Any:
    """Stand for ``subprocess.run`` of such a child."""
    child = Forked(words)
    clock = threading.Timer(timeout, child.kill)
    clock.start()
    with contextlib.suppress(BrokenPipeError), child.stdin as stream:
        stream.write(input)
    with child.stdout as stream:
        said = stream.read()
    clock.cancel()
    return subprocess.CompletedProcess(words, child.wait(), said)


def _live(module: Any, child_in: int, child_out: int) -> None:
    """What the child is; never returns."""
    code = 1
    try:
        os.dup2(child_in, 0)
        os.dup2(child_out, 1)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        sys.stdin = io.TextIOWrapper(os.fdopen(0, "rb", closefd=False))
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False))
        module.main()
        code = 0
    finally:
        os._exit(code)


def fork_children() -> None:
    """Let pinsing fork its child processes from now on."""
    for name in _NEEDED:
        importlib.import_module(name)
    for name in ("pinsing.description.files", "pinsing.view.meshes"):
        module = importlib.import_module(name)
        names = {"Popen": Forked, "run": run, "TimeoutExpired": subprocess.TimeoutExpired}
        stand_in = type("subprocess", (), {**names, "PIPE": -1, "DEVNULL": -3})
        vars(module)["subprocess"] = stand_in
