"""Time distances, clearances, crossings and trajectory checks, beside a search from many starts.

    python scripts/bench/clearance.py [--count 100000] [--each 40]

Rows are the best of several rounds (or the median over configurations, where it says so). The last
column of a distance is that of the way it was found before there were bounds: hundreds of starts
put on the set and slid along it towards the configuration, with no word about what it missed.
"""

from __future__ import annotations

import argparse
import time
import timeit
from collections.abc import Callable

import numpy as np

from pinsing.algebra.conditions import two_sided
from pinsing.families import Branch, Family, closed_form
from pinsing.families.zero_set import project
from pinsing.proximity.clearance import suggest, watch
from pinsing.proximity.crossings import crossings
from pinsing.proximity.monitor import Monitor
from pinsing.proximity.trajectory import check_trajectory
from pinsing.robot.load import load

ROUNDS = 7
FAMILIES = [
    ("ur5", "F3"),
    ("puma560", "F3"),
    ("irb1400", "F3"),
    ("z1", "F3"),
    ("panda", "F4"),
    ("panda", "F5"),
    ("xarm7", "F4"),
]


def best(work: Callable[[], object]) -> float:
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def from_many_starts(family: Family, q: np.ndarray, rng: np.random.Generator) -> float:
    """Shortest distance found from 384 starts, without a bound."""
    return min(_branch(branch, q, rng) for branch in family.branches)


def _branch(branch: Branch, q: np.ndarray, rng: np.random.Generator) -> float:
    target = q.copy()
    for v in branch.values:
        off = q[v.joint] - v.value
        target[v.joint] -= off - 2 * np.pi * np.round(off / (2 * np.pi))
    free = np.zeros(len(q), dtype=bool)
    free[[j for e in branch.equations for j in e.involved]] = True
    x = target + rng.normal(size=(384, len(q))) * free
    for _ in range(40):
        x, ok = project(branch.equations, x, free, iterations=10)
        x = x[ok] + 0.3 * (target - x[ok])
    x, ok = project(branch.equations, x, free)
    return float(np.linalg.norm(x[ok] - q, axis=1).min(initial=np.inf))


def distances(each: int) -> None:
    heads = f"{'median':>9} {'95 %':>9} {'most':>9} {'gap':>8}   many starts"
    print(f"{'distance, gap 1e-6':22} {heads}")
    for name, number in FAMILIES:
        arm = load(name)
        family = next(f for f in closed_form(arm).families if f.name == number)
        rng = np.random.default_rng(0)
        Q = rng.uniform(-np.pi, np.pi, (each, arm.n))
        for limited in (False, True):
            times, gaps = [], []
            for q in Q:
                start = time.perf_counter()
                found = family.distance(q, within_limits=limited)
                times.append(time.perf_counter() - start)
                gaps.append(found.upper - found.lower)
            ms = np.array(times) * 1e3
            words = "within limits" if limited else "torus"
            line = (
                f"{name + ' ' + number:9} {words:12} {np.median(ms):7.2f}ms "
                f"{np.quantile(ms, 0.95):7.2f}ms {ms.max():7.1f}ms {np.nanmax(gaps):8.1e}"
            )
            if not limited:
                start = time.perf_counter()
                olds = [from_many_starts(family, q, rng) for q in Q[:3]]
                took = (time.perf_counter() - start) / 3e-3
                worse = max(o - family.distance(q).upper for o, q in zip(olds, Q[:3], strict=True))
                line += f"   {took:.0f} ms, too long by up to {worse:.1e}"
            print(line, flush=True)


def clearances(count: int) -> None:
    print(f"\nclearance of {count} configurations, all families, one thread")
    for name in ("ur5", "puma560", "stanford", "panda", "surgical7"):
        form = closed_form(load(name))
        conditions = watch(form).conditions
        Q = np.random.default_rng(0).uniform(-3, 3, (count, form.arm.n))
        fast = best(lambda c=conditions, Q=Q: two_sided(c, Q, threads=1)) / count
        part = Q[: count // 20]
        slow = best(lambda c=conditions, Q=part: two_sided(c, Q, compiled=False)) / len(part)
        one = best(lambda c=conditions, Q=Q: [two_sided(c, Q[:1]) for _ in range(100)]) / 100
        print(
            f"{name:10} {fast * 1e9:7.0f} ns each   NumPy {slow * 1e9:7.0f} ns   "
            f"one at a time {one * 1e6:5.1f} us"
        )


def motions(count: int) -> None:
    arm = load("ur5")
    form = closed_form(arm)
    t = np.linspace(0, 50, count)
    Q = np.stack([np.sin((i + 1) * 0.37 * t + i) for i in range(6)], axis=1) * 2
    print(f"\ncrossings of {count} samples of a UR5: {best(lambda: crossings(form, Q)):.3f} s")
    start = time.perf_counter()
    check_trajectory(arm, Q, t, forms=form)
    print(f"check_trajectory of the same: {time.perf_counter() - start:.2f} s")


def monitors(calls: int = 2000) -> None:
    print("\nMonitor.update, one call from Python: least, and median and most over 50 places")
    for name in ("ur5", "puma560", "stanford", "panda", "surgical7"):
        form = closed_form(load(name))
        monitor = Monitor(form, warn=0.2, stop=0.1)
        rng = np.random.default_rng(0)
        places = rng.uniform(-2, 2, (50, 2, form.arm.n))
        each = [
            min(timeit.repeat(lambda q=q, v=v, m=monitor: m.update(q, v), number=40, repeat=20))
            / 40
            * 1e6
            for q, v in places
        ]
        q = places[0, 0]
        alone = best(lambda m=monitor, q=q: [m.update(q) for _ in range(calls)]) / calls * 1e6
        print(
            f"{name:10} {min(each):5.1f} {np.median(each):5.1f} {max(each):5.1f} us with speeds, "
            f"{alone:5.1f} us without"
        )


def suggestions() -> None:
    print("\nsuggest, closed form given: proven clearance, bound of what is possible, time")
    for name in ("ur5", "puma560", "stanford", "panda", "surgical7"):
        arm = load(name)
        form = closed_form(arm)
        for near in (None, np.zeros(arm.n)):
            if near is not None and not arm.within_limits(near):
                continue
            start = time.perf_counter()
            found = suggest(arm, near=near, forms=form)
            took = time.perf_counter() - start
            words = "anywhere" if near is None else "near zero"
            print(
                f"{name:10} {words:9} {np.degrees(found.lower):7.2f} of at most "
                f"{np.degrees(found.most):7.2f} degrees  {took:6.2f} s"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--each", type=int, default=40)
    options = parser.parse_args()
    distances(options.each)
    clearances(options.count)
    motions(options.count)
    monitors()
    suggestions()
