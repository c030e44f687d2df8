"""Kill long runs at random moments, go on with them, and compare every byte of what they leave.

Each life of a run is a process of its own, forked from this one so that it need not import
everything again. It is ended by SIGKILL, by Ctrl-C, or by Ctrl-C twice, after a random time. The
folder that the last life completes must be the one of a run at one stretch, to the last byte.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

_HANG = 120.0  # seconds that no life takes
_STOPPED = 130

MAP = ("map", "stanford", "--count", "330000", "--chunk", "4096")
SWEEP = ("sweep", "stanford", "--levels", "1,2", "--samples", "2001", "--chunk", "1", "--no-keep")

# ADDRESS is put in when the scheduler has one.
KINDS: dict[str, tuple[str, ...]] = {
    "map, threads": (*MAP, "--threads", "2"),
    "map, all values kept": (*MAP, "--keep-values", "--threads", "2"),
    "sweep, threads": (*SWEEP, "--threads", "2"),
    "map, worker processes": (*MAP, "--workers", "2"),
    "sweep, Dask": (*SWEEP, "--dask", "ADDRESS"),
}
_EARLY = 0.1  # of the lives end at any moment from their start, the others when they are at work


@dataclass
class Campaign:
    """What the lives of the runs of one kind came to.

    Attributes
    ----------
    runs : int
        Runs that were completed and were byte for byte as they should.
    ends : Counter
        Lives that were ended, by signal; those that had not begun to compute are not counted.
    early : int
        Lives that were ended before the run had a plan on the disk.
    chunks : int
        Of a run.
    wrong : list of str
        What went wrong.
    """

    runs: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    early: int = 0
    chunks: int = 0
    wrong: list[str] = field(default_factory=list)

    @property
    def kills(self) -> int:
        """Lives that were ended while they were at work."""
        return sum(self.ends.values())


def campaign(kind: str, kills: int, seed: int, folder: Path, seconds: float = math.inf) -> Campaign:
    """Kill runs of one kind, so often or for so long; complete the last one."""
    words = KINDS[kind]
    rng = random.Random(f"{kind} {seed}")
    found = Campaign()
    limit = time.monotonic() + seconds
    with contextlib.ExitStack() as stack:
        if "ADDRESS" in words:
            address = stack.enter_context(dask(folder))
            words = tuple(address if word == "ADDRESS" else word for word in words)
        whole = folder / "whole"
        began = time.monotonic()
        code, said = life([*words, "--out", str(whole)], whole, None)
        longest = time.monotonic() - began
        if code:
            found.wrong.append(f"the run at one stretch failed: {said}")
            return found
        expected = contents(whole)
        found.chunks = len(expected) - 2  # and the plan and the result
        while found.kills < kills and len(found.wrong) < 5 and time.monotonic() < limit:
            out = folder / f"run{found.runs}"
            _one_run([*words, "--out", str(out)], out, longest, rng, found, kills, limit)
            if contents(out) != expected:
                other = contents(out)
                names = [n for n in {**expected, **other} if expected.get(n) != other.get(n)]
                found.wrong.append(f"{out.name} differs in {', '.join(sorted(names)[:5])}")
            else:
                found.runs += 1
                shutil.rmtree(out)
    return found


def _one_run(
    words: list[str],
    out: Path,
    longest: float,
    rng: random.Random,
    found: Campaign,
    kills: int,
    limit: float,
) -> None:
    for _ in range(10 * kills + 100):
        how = rng.choice(["SIGKILL", "SIGKILL", "SIGINT", "SIGINT twice"])
        early = rng.random() < _EARLY
        after = rng.uniform(0, longest if early else longest / 40)
        enough = found.kills >= kills or time.monotonic() >= limit
        code, said = life(words, out, None if enough else (how, after, not early))
        ended = {"SIGKILL": -signal.SIGKILL}.get(how, _STOPPED)
        if code == 0:
            return
        if enough or code != ended or "Traceback" in said:
            found.wrong.append(f"{how} after {after:.3f} s: exit code {code}: {said[-500:]}")
            return
        at_once = "ended at once" in said
        if how != "SIGKILL" and "stopped" not in said and not at_once:
            found.wrong.append(f"{how} after {after:.3f} s: says nothing of it: {said[-500:]}")
            return
        if (out / "plan.json").exists():
            found.ends["SIGINT twice" if at_once else how.removesuffix(" twice")] += 1
        else:
            found.early += 1
    found.wrong.append("a run came to no end")


def life(words: list[str], out: Path, end: tuple[str, float, bool] | None) -> tuple[int, str]:
    """Run a command line in a process of its own, and end it; its exit code and stderr.

    ``end`` is the signal, after how many seconds, and whether these begin with its first chunk.
    """
    said = out.with_name("said")
    before = _chunks(out)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        child = os.fork()
        if child == 0:
            _live(words, said)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    code = None
    if end is not None:
        how, after, at_work = end
        limit = time.monotonic() + _HANG
        while at_work and code is None and _chunks(out) == before and time.monotonic() < limit:
            code = _wait(child, 0.002)
        code = _wait(child, after) if code is None else code
        if code is None:
            os.kill(child, signal.SIGKILL if how == "SIGKILL" else signal.SIGINT)
            if how.endswith("twice"):
                time.sleep(0.001)
                os.kill(child, signal.SIGINT)  # it is not waited for yet: the number is its own
    if code is None:
        code = _wait(child, _HANG)
    if code is None:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return 999, "it hung"
    return code, said.read_text(errors="replace") if said.exists() else ""


def _chunks(out: Path) -> int:
    try:
        return len(os.listdir(out / "chunks"))
    except FileNotFoundError:
        return 0


def _live(words: list[str], said: Path) -> None:
    """What a life is; never returns."""
    code = 99
    try:
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        err = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for number, handle in ((0, null), (1, null), (2, err)):
            os.dup2(handle, number)
        sys.stderr = os.fdopen(2, "w", buffering=1)
        # It is ignored where this was started in the background.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from pinsing.cli import main

        try:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            main(words)
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0
        except KeyboardInterrupt:  # before the program could, or after it has ended
            os.write(2, b"stopped\n")
            code = _STOPPED
    except BaseException as error:
        os.write(2, f"Traceback: {error!r}".encode())
    finally:
        os._exit(code)


def _wait(child: int, seconds: float) -> int | None:
    limit = time.monotonic() + seconds
    while True:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= limit:
            return None
        time.sleep(0.001)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a run but its lock, litter included."""
    paths = [p for p in folder.rglob("*") if p.is_file() and p.name != "lock"]
    return {str(p.relative_to(folder)): p.read_bytes() for p in paths}


@contextlib.contextmanager
def dask(folder: Path, workers: int = 2) -> Iterator[str]:
    """Address of a scheduler with workers, all of them processes here."""
    file = folder / "scheduler.json"
    where = ["--host", "127.0.0.1", "--no-dashboard"]
    with contextlib.ExitStack() as stack:

        def start(*words: str) -> None:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *words],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)

        start("scheduler", *where, "--port", "0", "--scheduler-file", str(file))
        limit = time.monotonic() + _HANG
        while not (file.exists() and file.stat().st_size):
            if time.monotonic() > limit:
                raise TimeoutError("the scheduler has not come up")
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        options = ["--no-nanny", "--nthreads", "1", "--local-directory", str(folder), *where]
        for _ in range(workers):
            start("worker", address, *options)
        yield address
