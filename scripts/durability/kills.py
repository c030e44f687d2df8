"""Kill long runs at random moments, go on with them, and compare every byte of what they leave.

Each life of a run is a process of its own, forked from this one so that it need not import
everything again. It is ended by SIGKILL, by Ctrl-C, by Ctrl-C twice, or by a SIGKILL of one of its
worker processes, after a random time. The folder that the last life completes must be the one of a
run at one stretch, to the last byte.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import math
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

_HANG = 120.0  # seconds that no life takes
_STOPPED = 130

MAP = ("map", "stanford", "--count", "330000", "--chunk", "4096")
SWEEP = (
    "analyze",
    "--sweep",
    "stanford",
    "--levels",
    "1,2",
    "--samples",
    "2001",
    "--chunk",
    "1",
    "--no-keep",
)

# ADDRESS is put in when the scheduler has one.
KINDS: dict[str, tuple[str, ...]] = {
    "map, threads": (*MAP, "--threads", "2"),
    "map, all values kept": (*MAP, "--keep-values", "--threads", "2"),
    "sweep, threads": (*SWEEP, "--threads", "2"),
    "map, worker processes": (*MAP, "--workers", "2"),
    "map, one worker process killed": (*MAP, "--workers", "2"),
    # As pinsing starts workers they take seconds to come up; forked ones are there at once.
    "map, forked worker processes": (*MAP, "--workers", "2"),
    "map, one forked worker killed": (*MAP, "--workers", "2"),
    "sweep, Dask": (*SWEEP, "--dask", "ADDRESS"),
    "sweep, one Dask worker killed": (*SWEEP, "--dask", "ADDRESS"),
}
OF_WORKERS = "SIGKILL of a worker"
_WAYS = ("SIGKILL", "SIGKILL", "SIGINT", "SIGINT twice")
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
        cluster: Cluster | None = None
        if "ADDRESS" in words:
            cluster = stack.enter_context(dask(folder))
            words = tuple(cluster.address if word == "ADDRESS" else word for word in words)
        whole = folder / "whole"
        began = time.monotonic()
        code, said = life([*words, "-o", str(whole)], whole, None, "forked" in kind)
        longest = time.monotonic() - began
        if code:
            found.wrong.append(f"the run at one stretch failed: {said}")
            return found
        expected = contents(whole)
        found.chunks = len(expected) - 2  # and the plan and the result
        while found.kills < kills and len(found.wrong) < 5 and time.monotonic() < limit:
            out = folder / f"run{found.runs}"
            line = [*words, "-o", str(out)]
            if cluster is not None and kind.endswith("killed"):
                _without_workers(line, out, cluster, rng, found)
            else:
                ways = _WAYS if not kind.endswith("killed") else (OF_WORKERS,)
                _one_run(line, out, longest, rng, found, kills, limit, ways, "forked" in kind)
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
    ways: Sequence[str],
    forked: bool,
) -> None:
    for _ in range(10 * kills + 100):
        how = rng.choice(ways)
        early = rng.random() < _EARLY
        after = rng.uniform(0, longest if early else longest / 40)
        enough = found.kills >= kills or time.monotonic() >= limit
        code, said = life(words, out, None if enough else (how, after, not early), forked)
        ended = {"SIGKILL": -signal.SIGKILL, OF_WORKERS: 2}.get(how, _STOPPED)
        if code == 0:
            return
        if enough or code != ended or "Traceback" in said:
            found.wrong.append(f"{how} after {after:.3f} s: exit code {code}: {said[-4000:]}")
            return
        at_once = "ended at once" in said
        if how == OF_WORKERS and "a worker process died" not in said:
            found.wrong.append(f"{how} after {after:.3f} s: says something else: {said[-500:]}")
            return
        if how.startswith("SIGINT") and "stopped" not in said and not at_once:
            found.wrong.append(f"{how} after {after:.3f} s: says nothing of it: {said[-500:]}")
            return
        if (out / "plan.json").exists():
            found.ends["SIGINT twice" if at_once else how.removesuffix(" twice")] += 1
        else:
            found.early += 1
    found.wrong.append("a run came to no end")


def _without_workers(
    words: list[str], out: Path, cluster: Cluster, rng: random.Random, found: Campaign
) -> None:
    """One run, whose workers are killed and replaced; it is to go on with what there is."""
    said, before = out.with_name("said"), 0
    child = _born(words, said)
    limit = time.monotonic() + _HANG
    code = None
    while code is None and time.monotonic() < limit:
        code = _wait(child, rng.uniform(0.05, 0.5))
        if code is None and _chunks(out) > before:  # something came in since the last kill
            before = _chunks(out)
            cluster.kill_worker(rng)
            found.ends[OF_WORKERS] += 1
            cluster.start_worker()
    if code is None:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if code != 0:
        text = said.read_text(errors="replace")
        found.wrong.append(f"{OF_WORKERS}: exit code {code}: {text[-500:]}")


def _born(words: list[str], said: Path, forked: bool = False) -> int:
    """Number of a new process that runs a command line."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        child = os.fork()
        if child == 0:
            _live(words, said, forked)
        return child
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _workers_of(process: int) -> list[int]:
    """Worker processes of a life: its children, but for the one that tracks resources."""
    found = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        for number in map(int, task.read_text().split()):
            with contextlib.suppress(OSError):
                if b"resource_tracker" not in Path(f"/proc/{number}/cmdline").read_bytes():
                    found.append(number)
    return sorted(found)


def life(
    words: list[str], out: Path, end: tuple[str, float, bool] | None, forked: bool = False
) -> tuple[int, str]:
    """Run a command line in a process of its own, and end it; its exit code and stderr.

    ``end`` is the signal, after how many seconds, and whether these begin with its first chunk;
    ``forked`` says that its worker processes are forked.
    """
    said = out.with_name("said")
    before = _chunks(out)
    child = _born(words, said, forked)
    code = None
    if end is not None:
        how, after, at_work = end
        limit = time.monotonic() + _HANG
        while at_work and code is None and _chunks(out) == before and time.monotonic() < limit:
            code = _wait(child, 0.002)
        code = _wait(child, after) if code is None else code
        if code is None and how == OF_WORKERS:
            for number in _workers_of(child)[:1]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(number, signal.SIGKILL)
        elif code is None:
            os.kill(child, signal.SIGKILL if how == "SIGKILL" else signal.SIGINT)
            if how.endswith("twice"):
                time.sleep(0.001)
                os.kill(child, signal.SIGINT)  # it is not waited for yet: the number is its own
    if code is None:
        code = _wait(child, _HANG)
    if code is None:
        os.kill(child, signal.SIGUSR1)  # it says where it is
        time.sleep(1)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        _alone(child)
        return 999, f"it hung: {said.read_text(errors='replace')}"
    _alone(child)
    return code, said.read_text(errors="replace") if said.exists() else ""


def _alone(session: int) -> None:
    """Wait for the last worker of a life: a forked one holds the lock of the folder as well."""
    limit = time.monotonic() + _HANG
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < limit:
            os.killpg(session, 0)
            time.sleep(0.005)
        os.killpg(session, signal.SIGKILL)


def _chunks(out: Path) -> int:
    try:
        return len(os.listdir(out / "chunks"))
    except FileNotFoundError:
        return 0


def _live(words: list[str], said: Path, forked: bool) -> None:
    """What a life is; never returns."""
    code = 99
    try:
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        err = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for number, handle in ((0, null), (1, null), (2, err)):
            os.dup2(handle, number)
        sys.stderr = os.fdopen(2, "w", buffering=1)
        faulthandler.register(signal.SIGUSR1)
        # It is ignored where this was started in the background.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from pinsing.cli import main

        if forked:
            context = multiprocessing.get_context("fork")
            vars(multiprocessing)["get_context"] = lambda *_: context
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


class Cluster:
    """A scheduler with workers, all of them processes here.

    Attributes
    ----------
    address : str
        Of the scheduler.
    """

    def __init__(self, address: str, folder: Path) -> None:
        self.address = address
        options = ["--no-nanny", "--nthreads", "1", "--local-directory", str(folder), *_WHERE]
        self._words = ("worker", address, *options)
        self._workers: list[subprocess.Popen[bytes]] = []

    def start_worker(self) -> None:
        """Add a worker."""
        self._workers.append(_dask_process(*self._words))

    def kill_worker(self, rng: random.Random) -> None:
        """End one of the workers."""
        process = self._workers.pop(rng.randrange(len(self._workers)))
        process.kill()
        process.wait()

    def close(self) -> None:
        """End all workers."""
        while self._workers:
            self.kill_worker(random.Random(0))


_WHERE = ("--host", "127.0.0.1", "--no-dashboard")


def _dask_process(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


@contextlib.contextmanager
def dask(folder: Path, workers: int = 2) -> Iterator[Cluster]:
    """A scheduler with workers."""
    file = folder / "scheduler.json"
    scheduler = _dask_process("scheduler", *_WHERE, "--port", "0", "--scheduler-file", str(file))
    try:
        limit = time.monotonic() + _HANG
        while not (file.exists() and file.stat().st_size):
            if time.monotonic() > limit:
                raise TimeoutError("the scheduler has not come up")
            time.sleep(0.05)
        cluster = Cluster(json.loads(file.read_text())["address"], folder)
        try:
            for _ in range(workers):
                cluster.start_worker()
            # In a process of its own: what is forked here must not have threads.
            code = f"import distributed as d; d.Client({cluster.address!r}).wait_for_workers(1)"
            subprocess.run([sys.executable, "-c", code], check=True, timeout=_HANG)
            yield cluster
        finally:
            cluster.close()
    finally:
        scheduler.kill()
        scheduler.wait()
