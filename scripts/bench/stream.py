"""A robot that streams its joints at 1 kHz, judged as `pinsing check ROBOT --follow -` does.

    nice scripts/bench/stream.py [--robot ur5] [--seconds 3600] [--rate 1000] [--processor 1]

A second process writes joint states; this one is pinned to one processor. Of each verdict: its
processor time, its time on the clock, and how old the joint state was when it was ready.
"""

from __future__ import annotations

import argparse
import gc
import io
import json
import os
import subprocess
import sys
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


def memory() -> float:
    """Memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 2**20


class Timed(Follower):
    """Notes the times of each verdict, milliseconds."""

    def __init__(self, *given, room: int) -> None:
        super().__init__(*given)
        self.times, self.count = np.ones((room, 3), dtype=np.float32), 0

    def verdict(self, line):
        """Judge a line, timed."""
        clock, cpu = time.perf_counter(), time.thread_time()
        said = super().verdict(line)
        cpu, clock = time.thread_time() - cpu, time.perf_counter() - clock
        if said is not None and self.count < len(self.times):
            self.times[self.count] = 1e3 * cpu, 1e3 * clock, 1e3 * (time.monotonic() - said["t"])
            self.count += 1
        return said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--processor", type=int, default=1)
    parser.add_argument("--produce", action="store_true")
    asked = parser.parse_args()
    if asked.produce:
        return produce(asked.robot, asked.seconds, asked.rate)
    producer = subprocess.Popen([sys.executable, *sys.argv, "--produce"], stdout=subprocess.PIPE)
    os.sched_setaffinity(0, {asked.processor})
    form = pinsing.closed_form(pinsing.load(asked.robot))
    room = round(asked.seconds * asked.rate)
    follower = Timed(form, form.loaded, False, np.radians(5), room=room)
    assert producer.stdout is not None
    gc.freeze()
    levels: dict[str, int] = {}
    early, dropped, start, cpu = None, 0, time.monotonic(), time.process_time()
    with io.FileIO(producer.stdout.fileno(), closefd=False) as raw, open(os.devnull, "w") as out:
        for said in follow(follower, lines_of(raw), live=True):
            out.write(json.dumps(said) + "\n")
            kind = said.get("level", "stalled" if "stalled" in said else "error")
            levels[kind] = levels.get(kind, 0) + 1
            dropped = said.get("dropped", dropped)
            if early is None and time.monotonic() - start > 10:
                early = memory()
    clock, cpu = time.monotonic() - start, time.process_time() - cpu
    print(f"{asked.robot}: {room} lines in {clock:.0f} s, {levels}, {dropped} thinned")
    print(f"memory {early or 0:.1f} MiB after 10 s, {memory():.1f} at the end")
    print(f"load {os.getloadavg()[2]:.1f}, processor {100 * cpu / clock:.1f} % of one")
    for k, what in enumerate(("processor time", "clock", "age")):
        of = follower.times[: follower.count, k]
        p = np.percentile(of, [50, 99, 99.9, 99.99])
        over = int((of > 2).sum())
        words = ", ".join(f"{v:.3f}" for v in (*p, of.max()))
        print(
            f"{what}, ms: {words} (50, 99, 99.9, 99.99 %, worst); {over} above 2 ms, "
            f"worst is verdict {int(of.argmax()) + 1}"
        )


if __name__ == "__main__":
    main()
