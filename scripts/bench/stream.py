"""A robot that streams its joints at 1 kHz, judged as `pinsing check ROBOT --follow -` does.

    scripts/bench/stream.py [--robot ur5] [--seconds 3600] [--rate 1000] [--realtime]

A second process writes joint states; this one is pinned to one processor. Of each verdict: its
processor time, its time on the clock, and how old the joint state was when it was ready. After each
verdict comes a control: a loop of as many steps each time, about as long as a verdict, and timed
like it. What the machine does to both shows in both. With --realtime (root) no other program runs
before this one.

A verdict above 2 ms is attributed by Linux's own count: its processor time; the time for which it
was ready and another thread had the processor; and the rest, for which a virtual machine had no
processor at all, unless the thread waited for another one (voluntary switches: none, or it is
told). At last the slowest lines are judged again, five times each after the line before: the best
time is the verdict's own.
"""

from __future__ import annotations

import argparse
import gc
import heapq
import io
import json
import os
import re
import resource
import subprocess
import sys
import time
from collections import Counter
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

import pinsing
from pinsing.proximity.monitor import Follower, follow, lines_of


def produce(robot: str, seconds: float, rate: float) -> None:
    """Write joint states of sines through the joint ranges; `t` is this machine's clock."""
    arm = pinsing.load(robot)
    middle, half = (arm.span[0] + arm.span[1]) / 2, (arm.span[1] - arm.span[0]) / 2
    speeds = np.linspace(0.1, 0.7, arm.n)
    start = time.monotonic()
    for k in range(round(seconds * rate)):
        time.sleep(max(0.0, start + k / rate - time.monotonic()))
        q = middle + half * np.sin(speeds * k / rate + np.arange(arm.n))
        state = {"t": time.monotonic(), "name": list(arm.joints), "position": q.tolist()}
        os.write(1, json.dumps(state).encode() + b"\n")


def memory() -> float:
    """Memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 2**20


BOUND = 2e-3
"""Seconds that a verdict may take."""
SLOWEST = 1000
"""Lines that are judged again."""
CONTROL = 2.5e-4
"""Seconds of a control."""


def taken(processor: int) -> float:
    """Seconds that a virtual machine's host has taken from a processor."""
    lines = Path("/proc/stat").read_text().splitlines()
    words = next(line.split() for line in lines if line.startswith(f"cpu{processor} "))
    return int(words[8]) / os.sysconf("SC_CLK_TCK")


@dataclass
class Spent:
    """Milliseconds of one verdict or control, and what else happened meanwhile."""

    clock: float
    cpu: float
    waited: float
    switches: int
    preempted: int
    faults: int
    collections: int

    @property
    def away(self) -> float:
        """Milliseconds without a processor, and without waiting for one."""
        return self.clock - self.cpu - self.waited


class Stopwatch:
    """Times of the thread that makes it."""

    def __init__(self) -> None:
        self._queue = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
        self._collected = 0
        gc.callbacks.append(self._count)

    def _count(self, phase: str, info: dict) -> None:
        self._collected += phase == "stop"

    def _counts(self) -> tuple[float, int, int, int, int]:
        of = resource.getrusage(resource.RUSAGE_THREAD)
        waited = int(os.pread(self._queue, 99, 0).split()[1]) / 1e6
        return waited, of.ru_nvcsw, of.ru_nivcsw, of.ru_minflt + of.ru_majflt, self._collected

    def start(self) -> None:
        """Begin."""
        self._before = self._counts()
        self._clock, self._cpu = time.perf_counter(), time.thread_time()

    def stop(self) -> Spent:
        """End."""
        cpu, clock = time.thread_time() - self._cpu, time.perf_counter() - self._clock
        counts = zip(self._counts(), self._before, strict=True)
        return Spent(1e3 * clock, 1e3 * cpu, *(b - a for b, a in counts))


def control(steps: int) -> None:
    """The same work each time."""
    for _ in range(steps):
        pass


class Timed(Follower):
    """Notes the times of each verdict, milliseconds, and of the control after it."""

    def __init__(self, *given, room: int) -> None:
        super().__init__(*given)
        self.times, self.count = np.ones((room, 5), dtype=np.float32), 0
        self.slow: list[tuple[int, Spent]] = []
        self.slow_controls: list[tuple[int, Spent]] = []
        self.lines: list[tuple[float, str, str]] = []
        self.last, self.watch = "", Stopwatch()
        self.steps, least = 1000, np.inf
        for _ in range(100):
            self.watch.start()
            control(self.steps)
            least = min(least, self.watch.stop().clock)
        self.steps = round(self.steps * 1e3 * CONTROL / least)

    def verdict(self, line):
        """Judge a line, timed."""
        self.watch.start()
        said = super().verdict(line)
        spent = self.watch.stop()
        age = np.nan if said is None else 1e3 * (time.monotonic() - said["t"])
        self.watch.start()
        control(self.steps)
        other = self.watch.stop()
        self.count += 1
        if spent.clock > 1e3 * BOUND:
            self.slow.append((self.count, spent))
        if other.clock > 1e3 * BOUND:
            self.slow_controls.append((self.count, other))
        heapq.heappush(self.lines, (spent.clock, self.last or line, line))
        if len(self.lines) > SLOWEST:
            heapq.heappop(self.lines)
        self.last = line
        if self.count <= len(self.times):
            self.times[self.count - 1] = spent.cpu, spent.clock, age, other.cpu, other.clock
        return said


def again(given: tuple, lines: list[tuple[float, str, str]]) -> float:
    """The longest of the least seconds of five verdicts on each line, after the line before it."""
    worst = 0.0
    for _, before, line in lines:
        times = []
        for _ in range(5):
            follower = Follower(*given)
            follower.verdict(before)
            start = time.perf_counter()
            follower.verdict(line)
            times.append(time.perf_counter() - start)
        worst = max(worst, min(times))
    return worst


def realtime(asked: argparse.Namespace, priority: int) -> None:
    """Run before every program that has no such priority."""
    if asked.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--processor", type=int, default=0)
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--role", choices=["produce", "judge"], default="judge")
    asked = parser.parse_args()
    if asked.role == "produce":
        realtime(asked, 40)
        return produce(asked.robot, asked.seconds, asked.rate)
    os.sched_setaffinity(0, {asked.processor})
    me = [sys.executable, *sys.argv, "--role"]
    others = set(range(os.cpu_count() or 1)) - {asked.processor}
    producer = subprocess.Popen([*me, "produce"], stdout=subprocess.PIPE)
    os.sched_setaffinity(producer.pid, others or {0})
    form = pinsing.closed_form(pinsing.load(asked.robot))
    room = round(asked.seconds * asked.rate)
    given = form, form.loaded, False, np.radians(5)
    follower = Timed(*given, room=room)
    assert producer.stdout is not None
    gc.freeze()
    realtime(asked, 50)
    levels: dict[str, int] = {}
    errors: Counter[str] = Counter()
    held: list[float] = []
    dropped, start, cpu = 0, time.monotonic(), time.process_time()
    stolen = taken(asked.processor)
    with io.FileIO(producer.stdout.fileno(), closefd=False) as raw, open(os.devnull, "w") as out:
        for said in follow(follower, lines_of(raw), live=True):
            out.write(json.dumps(said) + "\n")
            kind = said.get("level", "stalled" if "stalled" in said else "error")
            levels[kind] = levels.get(kind, 0) + 1
            dropped = said.get("dropped", dropped)
            if kind == "error":
                errors[re.sub(r"\d[\d.e+-]*", "#", said["error"])] += 1
            if time.monotonic() - start > 10 + 600 * len(held):
                held.append(memory())
        clock, cpu = time.monotonic() - start, time.process_time() - cpu
    stolen = taken(asked.processor) - stolen
    print(f"{asked.robot}: {room} lines in {clock:.0f} s, {levels}, {dropped} thinned")
    for message, times in errors.most_common():
        print(f"error line, {times} times: {message}")
    words = ", ".join(f"{m:.1f}" for m in (*held, memory()))
    print(f"memory, MiB: {words} (after 10 s, each 10 minutes more, and at the end)")
    print(f"load {os.getloadavg()[2]:.1f}, processor {100 * cpu / clock:.1f} % of one")
    columns = "processor time", "clock", "age", "control, processor time", "control, clock"
    for k, what in enumerate(columns):
        of = follower.times[: follower.count, k]
        p = np.percentile(of, [50, 99, 99.9, 99.99])
        over = int((of > 1e3 * BOUND).sum())
        words = ", ".join(f"{v:.3f}" for v in (*p, of.max()))
        print(
            f"{what}, ms: {words} (50, 99, 99.9, 99.99 %, worst); {over} above 2 ms, "
            f"worst is verdict {int(of.argmax()) + 1}"
        )
    print(f"the host took {stolen:.2f} s of the processor")
    for what, slow in (("verdicts", follower.slow), ("controls", follower.slow_controls)):
        own = [(k, x) for k, x in slow if x.clock - x.away > 1e3 * BOUND or x.switches]
        print(
            f"{len(slow)} {what} above 2 ms on the clock, {len(slow) - len(own)} of them at most "
            f"2 ms without the time for which there was no processor, "
            f"{sum(x.away for _, x in slow):.0f} ms in all; the others, ms: "
            "number, clock, processor, ready but waiting; switches (own, forced), faults, gc"
        )
        for k, x in own:
            print(f"  {k}: {', '.join(f'{v:.2f}'.rstrip('0').rstrip('.') for v in astuple(x))}")
    print(f"the {len(follower.lines)} slowest again: {1e3 * again(given, follower.lines):.3f} ms")


if __name__ == "__main__":
    main()
