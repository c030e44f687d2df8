"""A robot that streams its joints at 1 kHz, judged as `pinsing check ROBOT --follow -` does.

    scripts/bench/stream.py [--robot ur5] [--seconds 3600] [--rate 1000] [--realtime]

A second process writes joint states; this one is pinned to one processor. Of each verdict: its
processor time, its time on the clock, and how old the joint state was when it was ready. A third
process, the witness, does nothing on the same processor but sleep for half a millisecond: where it
wakes late, the machine took the processor from all. With --realtime (root) no other program does.
At last the slowest lines are judged again, five times each after the line before: the best time is
the verdict's own.
"""

from __future__ import annotations

import argparse
import gc
import heapq
import io
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import pinsing
from pinsing.proximity.follow import Follower, follow, lines_of


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


def witness() -> None:
    """Write when this processor was taken away: from, until, seconds of this machine's clock."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    start = time.monotonic()
    while True:
        time.sleep(LATE / 2)
        end = time.monotonic()
        if end - start > LATE:
            print(start, end)
        start = end


def memory() -> float:
    """Memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 2**20


BOUND = 2e-3
"""Seconds that a verdict may take."""
SLOWEST = 1000
"""Lines that are judged again."""
LATE = 1e-3
"""Seconds that the witness may sleep; it asks for half of them."""


class Timed(Follower):
    """Notes the times of each verdict, milliseconds."""

    def __init__(self, *given, room: int) -> None:
        super().__init__(*given)
        self.times, self.count = np.ones((room, 3), dtype=np.float32), 0
        self.slow: list[tuple[float, float]] = []
        self.lines: list[tuple[float, str, str]] = []
        self.last = ""

    def verdict(self, line):
        """Judge a line, timed."""
        clock, cpu = time.perf_counter(), time.thread_time()
        said = super().verdict(line)
        cpu, clock = time.thread_time() - cpu, time.perf_counter() - clock
        if clock > BOUND:
            now = time.monotonic()
            self.slow.append((now - clock, now))
        heapq.heappush(self.lines, (clock, self.last or line, line))
        if len(self.lines) > SLOWEST:
            heapq.heappop(self.lines)
        self.last = line
        if said is not None and self.count < len(self.times):
            self.times[self.count] = 1e3 * cpu, 1e3 * clock, 1e3 * (time.monotonic() - said["t"])
            self.count += 1
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
    parser.add_argument("--role", choices=["produce", "judge", "witness"], default="judge")
    asked = parser.parse_args()
    if asked.role == "produce":
        realtime(asked, 40)
        return produce(asked.robot, asked.seconds, asked.rate)
    os.sched_setaffinity(0, {asked.processor})
    if asked.role == "witness":
        realtime(asked, 60)
        return witness()
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
    held: list[float] = []
    dropped, start, cpu = 0, time.monotonic(), time.process_time()
    with (
        io.FileIO(producer.stdout.fileno(), closefd=False) as raw,
        open(os.devnull, "w") as out,
        tempfile.TemporaryFile("w+") as stalls,
    ):
        beside = subprocess.Popen([*me, "witness"], stdout=stalls)
        for said in follow(follower, lines_of(raw), live=True):
            out.write(json.dumps(said) + "\n")
            kind = said.get("level", "stalled" if "stalled" in said else "error")
            levels[kind] = levels.get(kind, 0) + 1
            dropped = said.get("dropped", dropped)
            if time.monotonic() - start > 10 + 600 * len(held):
                held.append(memory())
        clock, cpu = time.monotonic() - start, time.process_time() - cpu
        beside.terminate()
        beside.wait()
        stalls.seek(0)
        away = [tuple(map(float, line.split())) for line in stalls]
    taken = sum(any(a < end and b > start for a, b in away) for start, end in follower.slow)
    print(f"{asked.robot}: {room} lines in {clock:.0f} s, {levels}, {dropped} thinned")
    words = ", ".join(f"{m:.1f}" for m in (*held, memory()))
    print(f"memory, MiB: {words} (after 10 s, each 10 minutes more, and at the end)")
    print(f"load {os.getloadavg()[2]:.1f}, processor {100 * cpu / clock:.1f} % of one")
    for k, what in enumerate(("processor time", "clock", "age")):
        of = follower.times[: follower.count, k]
        p = np.percentile(of, [50, 99, 99.9, 99.99])
        over = int((of > 1e3 * BOUND).sum())
        words = ", ".join(f"{v:.3f}" for v in (*p, of.max()))
        print(
            f"{what}, ms: {words} (50, 99, 99.9, 99.99 %, worst); {over} above 2 ms, "
            f"worst is verdict {int(of.argmax()) + 1}"
        )
    longest = max((1e3 * (b - a) for a, b in away), default=0.0)
    print(f"the processor was taken away {len(away)} times, for at most {longest:.1f} ms")
    print(f"{len(follower.slow)} verdicts took more than 2 ms, {taken} of them in such a time")
    print(f"the {len(follower.lines)} slowest again: {1e3 * again(given, follower.lines):.3f} ms")


if __name__ == "__main__":
    main()
