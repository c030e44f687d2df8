"""Time and memory of a large sweep of a Panda, and of what is found from it.

    python scripts/bench/sweep.py [--step 12] [--levels 3] [--samples 601] [--threads 2]
                                  [--out DIR]

Joints are set to multiples of ``--step`` degrees, so many at a time as ``--levels`` says. With
--out the time includes putting each chunk on the disk.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np

from pinsing._batch import engine
from pinsing.robot.load import load
from pinsing.sampling.analyze import singular_configurations
from pinsing.sampling.sweeps import plan_sweep, run_sweep


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--step", type=float, default=12.0)
    parser.add_argument("--levels", type=int, default=3)
    parser.add_argument("--samples", type=int, default=601)
    parser.add_argument("--threads", type=int, default=engine.cpu_count())
    parser.add_argument("--out")
    options = parser.parse_args()
    arm = load("panda")
    began = time.perf_counter()
    special = tuple(np.deg2rad(np.arange(-180, 180, options.step)).tolist())
    plan = plan_sweep(arm, special=special, levels=(options.levels,), samples=options.samples)
    print(f"{plan}; planned in {time.perf_counter() - began:.1f} s, {peak()}")
    began, used = time.perf_counter(), time.process_time()
    result = run_sweep(arm, plan, threads=options.threads, out=options.out)
    seconds, cpu = time.perf_counter() - began, time.process_time() - used
    print(
        f"{result.engine}, {options.threads} threads: {result.done:,} Jacobians in {seconds:.1f} s "
        f"({seconds / result.done * 1e6:.3f} us each; processor time "
        f"{cpu / result.done * 1e6:.3f} us each), {result.candidates.found:,} dips; {peak()}"
    )
    print(result.summary)
    began = time.perf_counter()
    findings = singular_configurations(arm, result)
    print(f"{len(findings)} findings in {time.perf_counter() - began:.1f} s; {peak()}")
    for finding in findings:
        print(f"  {finding}")


def peak() -> str:
    """Peak resident memory so far."""
    return f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB"


if __name__ == "__main__":
    main()
