"""Processes that run cases, with limits of their own; one that dies or is late is replaced."""

from __future__ import annotations

import contextlib
import functools
import importlib
import json
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

from fuzz import targets as fuzz_targets
from fuzz.commands import TREES, call, calls
from fuzz.coverage import Lines, readers
from fuzz.folders import run_folder
from fuzz.forked import fork_children
from fuzz.judge import Wrong
from fuzz.mutants import DATA, bases, mutant
from fuzz.report import FILES, GOOD, MEMORY, SECONDS, Outcome

HANG = 45.0
_START = 300.0  # seconds that the imports of a new process may take on a busy machine
SUFFIX = {"urdf": "arm.urdf", "xacro": "arm.xacro", "dh": "arm.yaml", "loops": "arm.loops.yaml"}
_URDFS = ("ur5_robot", "panda", "z1", "so101", "kinova")
_WORTH_KEEPING = 60_000  # bytes of a file that others are made from


def sources() -> dict[str, list[str]]:
    """Good files to break."""
    from pinsing.description.catalog import data_folder
    from pinsing.description.dh_table import urdf_folder

    data, own = data_folder(), urdf_folder()
    assert data is not None, "example-robot-data is not installed"
    urdfs = [p for p in sorted(data.rglob("*.urdf")) if p.stem in _URDFS]
    return bases(
        [*urdfs, *sorted(own.glob("*.urdf"))],
        sorted(own.glob("*.dh.yaml")),
        [own / f"{name}.loops.yaml" for name in TREES],
    )


def run_case(
    kind: str, chain: Sequence[int], files: dict[str, list[str]], folder: Path
) -> tuple[str, str, bool]:
    """Run one case in this process: its outcome, what was said, and whether others may go on."""
    if kind not in FILES:
        return *_run_target(kind, chain, folder), kind != "mesh"  # their reader is not Python
    index = chain[0] % len(files[kind])
    path = folder / SUFFIX[kind]
    data = mutant(chain, kind, files[kind][index])
    path.write_bytes(data)
    small = len(data) <= _WORTH_KEEPING
    if not small:  # following every line would be most of its time
        sys.settrace(None)
    if kind == "xacro":
        broken = chain[-1] % 4 == 0
        path.with_name("data.yaml").write_bytes(
            mutant(chain, "yaml", DATA) if broken else DATA.encode()
        )
    outcome, said = "result", ""
    for words in calls(kind, chain[-1], index, path):
        outcome, said = call(words)
        if outcome != "result":
            break
    return outcome, said, small


def _run_target(kind: str, chain: Sequence[int], folder: Path) -> tuple[str, str]:
    rngs = [random.Random(f"{kind} {seed}") for seed in chain]
    targets = {**fuzz_targets.TARGETS, "run": functools.partial(run_folder, call=call)}
    target = targets[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # of expressions that look odd
        try:
            return target(rngs, folder)
        except Wrong as error:
            return "unclear", str(error)
        except Exception:
            return "traceback", traceback.format_exc(limit=-4)


def serve() -> None:
    """Answer cases from stdin, one a line, until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    # What C++ may print belongs to no case's streams: it is the parent that looks at it.
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    files = sources()
    for module in ("pinsing.cli.app", "pinsing.report.arm_report", "pinsing.robot.load"):
        importlib.import_module(module)  # so that no case pays for it
    fork_children()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    lines = Lines(readers())
    print("ready", file=answers, flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for line in sys.stdin:
            kind, chain = json.loads(line)
            before = _processor_time()
            lines.watch()
            outcome, said, keep = run_case(kind, chain, files, Path(folder))
            used = _processor_time() - before
            answer = [outcome, said, used, lines.fresh(), keep]
            print(json.dumps(answer), file=answers, flush=True)


def _processor_time() -> float:
    """Seconds that this process and its children have used: other load does not count."""
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, who))


class Worker:
    """A process that runs cases, replaced when it dies or is late."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def run(self, kind: str, chain: tuple[int, ...]) -> tuple[Outcome, bool]:
        """Run one case, within its time; whether others may be made from it comes second."""
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        started = time.monotonic()
        process.stdin.write(json.dumps([kind, chain]) + "\n")
        process.stdin.flush()
        ready, _, _ = select.select([process.stdout], [], [], HANG)
        seconds = time.monotonic() - started
        line = process.stdout.readline() if ready else ""
        if line:
            outcome, said, used, fresh, keep = json.loads(line)
            if used > SECONDS and outcome in GOOD:
                outcome, said = "late", f"{used:.1f} s; {said}"
            return Outcome(kind, chain, outcome, said, used, tuple(fresh)), keep
        if ready:
            code = process.wait()
            self.stop()
            return Outcome(kind, chain, "crash", f"exit code {code}", seconds), False
        self.stop()
        return Outcome(kind, chain, "hang", f"no answer after {seconds:.0f} s", seconds), False

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            threads = dict.fromkeys(
                ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
            )
            self._process = subprocess.Popen(
                [sys.executable, str(Path(__file__).parent), "--worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, **threads},
            )
            assert self._process.stdout is not None
            select.select([self._process.stdout], [], [], _START)
            if self._process.stdout.readline() != "ready\n":
                raise RuntimeError("a worker does not start")
        return self._process

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    with contextlib.suppress(BrokenPipeError):
                        pipe.close()
            self._process = None
