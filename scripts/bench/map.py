"""Time and memory of a whole map of a Panda, all of its seven joints.

    python scripts/bench/map.py [--count 1e8] [--threads 2] [--sampling sobol] [--out DIR]

With --out the time includes putting each chunk on the disk.
"""

from __future__ import annotations

import argparse
import resource
import time

from pinsing._batch import engine
from pinsing.robot.load import load
from pinsing.sampling import sigma_map


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=float, default=1e8)
    parser.add_argument("--threads", type=int, default=engine.cpu_count())
    parser.add_argument("--sampling", default="sobol")
    parser.add_argument("--out")
    options = parser.parse_args()
    arm = load("panda")
    began, used = time.perf_counter(), time.process_time()
    result = sigma_map(
        arm,
        options.sampling,
        count=int(options.count),
        joints=arm.joints,
        threads=options.threads,
        out=options.out,
    )
    seconds, cpu = time.perf_counter() - began, time.process_time() - used
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{result.engine}, {options.threads} threads, {options.sampling}: {result.done:,} "
        f"configurations in {seconds:.1f} s ({seconds / result.done * 1e6:.3f} us each; processor "
        f"time {cpu / result.done * 1e6:.3f} us each); peak memory {peak:.0f} MiB"
    )


if __name__ == "__main__":
    main()
