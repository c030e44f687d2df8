#!/usr/bin/env python
"""Feed pinsing with broken input of every kind that it reads, and count how each case ends.

Robot files (URDF, xacro, DH tables, loops), expressions of xacro, meshes, folders of runs, results
and certificates as JSON, messages of a page. Every case must end in a result, or in one clear line
with exit code 2; within 10 seconds (of processor time; 45 on the clock, whatever else runs) and
2 GiB; never in a traceback, a crash or a hang. Cases run in worker processes with limits of their
own; a worker that dies or is late is replaced, and the case is reported with its seed.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib
import io
import itertools
import json
import math
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import fuzz_targets
from fuzz_folders import run_folder
from fuzz_judge import Wrong
from fuzz_mutants import bases, mutant
from fuzz_report import FILES, GOOD, KINDS, MEMORY, SECONDS, Outcome, report, table

HANG = 45.0
# Of the cases, where no kind is asked for.
SHARES = {"urdf": 0.06, "xacro": 0.02, "dh": 0.04, "loops": 0.04, "run": 0.02, "mesh": 0.01}
SHARES |= {"expression": 0.35, "result": 0.16, "certificate": 0.15, "message": 0.15}
SUFFIX = {"urdf": "arm.urdf", "xacro": "arm.xacro", "dh": "arm.yaml", "loops": "arm.loops.yaml"}
_URDFS = ("ur5_robot", "panda", "z1", "talos_left_arm", "so101", "kinova")
_TREES = ("four_bar", "five_bar", "planar_3rrr")


def sources() -> dict[str, list[str]]:
    """Good files to break."""
    from pinsing.description.catalog import data_folder
    from pinsing.description.dh_urdf import urdf_folder

    data, own = data_folder(), urdf_folder()
    assert data is not None, "example-robot-data is not installed"
    urdfs = [p for p in sorted(data.rglob("*.urdf")) if p.stem in _URDFS]
    return bases(
        [*urdfs, *sorted(own.glob("*.urdf"))],
        sorted(own.glob("*.dh.yaml")),
        [own / f"{name}.loops.yaml" for name in _TREES],
    )


# In the worker ----------------------------------------------------------------------


def run_case(kind: str, seed: int, files: dict[str, list[str]], folder: Path) -> tuple[str, str]:
    """Run one case in this process; return its outcome and what was said."""
    if kind not in FILES:
        return _run_target(kind, seed, folder)
    index = seed % len(files[kind])
    path = folder / SUFFIX[kind]
    path.write_bytes(mutant(seed, kind, files[kind][index]))
    calls = _calls(kind, seed, index, path)
    outcome, said = "result", ""
    for call in calls:
        outcome, said = _call(call)
        if outcome != "result":
            break
    return outcome, said


def _run_target(kind: str, seed: int, folder: Path) -> tuple[str, str]:
    rng = random.Random(f"{kind} {seed}")
    targets = {**fuzz_targets.TARGETS, "run": functools.partial(run_folder, call=_call)}
    target = targets[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # of expressions that look odd
        try:
            return target(rng, folder)
        except Wrong as error:
            return "unclear", str(error)
        except Exception:
            return "traceback", traceback.format_exc(limit=-4)


def _calls(kind: str, seed: int, index: int, path: Path) -> list[list[str]]:
    if kind == "dh":
        made = str(path.with_name("made.urdf"))
        return [["dh", str(path), "-o", made], ["info", made]]
    if kind == "loops":
        return [["", _TREES[index], str(path)]]
    # One in eight is analysed, with bounds that suit the time.
    if seed % 8 == 0:
        quick = ["--seconds", "1", "--samples", "9", "--random-starts", "20", "--levels", "1"]
        return [["info", str(path)], ["analyze", str(path), *quick]]
    return [["info", str(path)]]


def _call(words: list[str]) -> tuple[str, str]:
    from pinsing.cli import main

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            if words[0]:
                main(words)
            else:
                code = _mechanism(words[1], words[2])
    except SystemExit as ended:
        code = ended.code
    except Exception:
        return "traceback", traceback.format_exc(limit=-4)
    return judge(code, out.getvalue(), err.getvalue())


def _mechanism(tree: str, loops: str) -> int:
    """Load a mechanism as the command line would, and close its loops once."""
    import numpy as np

    from pinsing.description.dh_urdf import urdf_folder
    from pinsing.errors import PinsingError
    from pinsing.mechanism.closure import Loops
    from pinsing.robot.load_mechanism import load_mechanism

    try:
        mechanism = load_mechanism(urdf_folder() / f"{tree}.urdf", loops)
        residual, jacobian = Loops(mechanism).at(mechanism.home)
        assert np.isfinite(residual).all()
        assert np.isfinite(jacobian).all()
        print(mechanism)
    except PinsingError as error:
        print(f"pinsing: error: {error}", file=sys.stderr)
        return 2
    return 0


def judge(code: object, out: str, err: str) -> tuple[str, str]:
    """Return the outcome of a call by its exit code and streams."""
    lines = err.splitlines()
    errors = [line for line in lines if line.startswith("pinsing: error: ")]
    others = [line for line in lines if not line.startswith("pinsing: ")]
    if any("Traceback" in line for line in lines):
        return "traceback", err[-2000:]
    # An analysis whose time is up ends with 130, and with what it has.
    if code in (0, 130) and (out.strip() or "pinsing: wrote " in err) and not errors:
        return "result", ""
    if code == 2 and len(errors) == 1 and not others:
        message = errors[0].removeprefix("pinsing: error: ")
        if len(message) > 2000:
            return "unclear", f"a message of {len(message)} characters: {message[:200]}"
        if not message.strip() or any(not c.isprintable() for c in message):
            return "unclear", repr(message[:200])
        return "refused", message
    return "unclear", f"exit code {code}, stderr {err[-500:]!r}, stdout {out[:200]!r}"


def worker() -> None:
    """Answer cases from stdin, one a line, until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    # What C++ may print belongs to no case's streams: it is the parent that looks at it.
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    files = sources()
    for module in ("pinsing.cli.app", "pinsing.report.info", "pinsing.robot.load"):
        importlib.import_module(module)  # so that no case pays for it
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        for line in sys.stdin:
            kind, seed = json.loads(line)
            before = _processor_time()
            outcome, said = run_case(kind, seed, files, Path(folder))
            used = _processor_time() - before
            print(json.dumps([outcome, said, used]), file=answers, flush=True)


def _processor_time() -> float:
    """Seconds that this process and its children have used: other load does not count."""
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, who))


# In the parent ----------------------------------------------------------------------


class Worker:
    """A process that runs cases, replaced when it dies or is late."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def run(self, kind: str, seed: int) -> Outcome:
        """Run one case, within its time."""
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        started = time.monotonic()
        process.stdin.write(json.dumps([kind, seed]) + "\n")
        process.stdin.flush()
        # The first answer of a process waits for its imports too.
        ready, _, _ = select.select([process.stdout], [], [], HANG)
        seconds = time.monotonic() - started
        line = process.stdout.readline() if ready else ""
        if line:
            outcome, said, used = json.loads(line)
            if used > SECONDS and outcome in GOOD:
                outcome, said = "late", f"{used:.1f} s; {said}"
            return Outcome(kind, seed, outcome, said, used)
        if ready:
            code = process.wait()
            self.stop()
            return Outcome(kind, seed, "crash", f"exit code {code}", seconds)
        self.stop()
        return Outcome(kind, seed, "hang", f"no answer after {seconds:.0f} s", seconds)

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            threads = dict.fromkeys(
                ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
            )
            self._process = subprocess.Popen(
                [sys.executable, __file__, "--worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, **threads},
            )
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


def fuzz(cases: Iterable[tuple[str, int]], workers: int) -> Iterator[Outcome]:
    """Run cases over some worker processes; yield how each ended, in no certain order."""
    todo = iter(cases)
    lock = threading.Lock()
    results: list[Outcome] = []
    done = threading.Semaphore(0)
    total = 0

    def serve() -> None:
        own = Worker()
        try:
            while True:
                with lock:
                    case = next(todo, None)
                if case is None:
                    return
                outcome = own.run(*case)
                with lock:
                    results.append(outcome)
                done.release()
        finally:
            own.stop()
            done.release()

    threads = [threading.Thread(target=serve) for _ in range(workers)]
    for thread in threads:
        thread.start()
    ended = 0
    while ended < workers:
        done.acquire()
        with lock:
            outcome = results[total] if total < len(results) else None
        if outcome is None:
            ended += 1
        else:
            total += 1
            yield outcome
    for thread in threads:
        thread.join()


def _until(limit: float, cases: Iterable[tuple[str, int]]) -> Iterator[tuple[str, int]]:
    return itertools.takewhile(lambda case: time.monotonic() < limit, cases)


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=3000, help="in all")
    parser.add_argument("--minutes", type=float, default=math.inf, help="no new case after them")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--kind", choices=KINDS, action="append", help="default: all")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, help="write every outcome there")
    parser.add_argument("--report", type=Path, help="write the Markdown report there")
    parser.add_argument("--one", type=int, help="run the case of this seed here, and show it")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.worker:
        worker()
        return 0
    kinds = options.kind or list(KINDS)
    if options.one is not None:
        with tempfile.TemporaryDirectory() as folder:
            for kind in kinds:
                print(kind, *run_case(kind, options.one, sources(), Path(folder)), sep="\n")
        return 0
    whole = sum(SHARES[k] for k in kinds)
    cases = [
        (kind, options.seed + i)
        for kind in kinds
        for i in range(round(options.cases * SHARES[kind] / whole))
    ]
    random.Random(options.seed).shuffle(cases)  # so that a part of them is of every kind
    limit = time.monotonic() + 60 * options.minutes
    outcomes = []
    for number, o in enumerate(fuzz(_until(limit, cases), options.workers), 1):
        outcomes.append(o)
        if o.outcome not in GOOD:
            print(f"{o.kind} {o.seed}: {o.outcome}: {o.said}", flush=True)
        if number % 200 == 0:
            print(f"{number} of {len(cases)}", file=sys.stderr, flush=True)
    print(table(outcomes))
    if options.report:
        options.report.write_text(report(outcomes, options.seed), encoding="utf-8")
    if options.json:
        options.json.write_text(json.dumps([vars(o) for o in outcomes], indent=0))
    return int(any(o.outcome not in GOOD for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
