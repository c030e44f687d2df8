"""Constraint Jacobians and measures of mechanisms, all at once against Pinocchio one by one.

    python scripts/bench/mechanism_rate.py [NAME ...]

Rates per second of processor time, on one thread, the best of several repeats taken in turn, so
that what else the machine does falls on both. "one by one" reuses Pinocchio's data, and decomposes
each constraint Jacobian as `motions` does.
"""

# ruff: noqa: E402 (threads are set before NumPy comes in)

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import time
from collections.abc import Callable

import numpy as np

import pinsing
from pinsing.loops.closure import BatchLoops, Loops, random_closed
from pinsing.loops.map import mechanism_map
from pinsing.loops.motion import _motions, measure_many

SHELF = (
    "five_bar", "four_bar", "planar_3rrr", "planar_3rpr", "gough_stewart", "stewart_6_3", "delta",
    "rps3", "agile_eye", "bennett", "rssr",
)  # fmt: skip
MANY, FEW, REPEATS = 2048, 128, 7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(SHELF))
    options = parser.parse_args()
    print("| mechanism | Jacobians | one by one | measures | one by one | `map` over inputs |")
    print("|---|---|---|---|---|---|")
    for name in options.names or SHELF:
        mechanism = pinsing.load_mechanism(name)
        batch, single = BatchLoops(mechanism), Loops(mechanism)
        found = np.array(random_closed(mechanism, 60, np.random.default_rng(0)))
        Q = np.resize(found, (MANY, mechanism.n))
        check(batch, single, found)
        rates = best(
            {
                "J": (MANY, lambda b=batch, Q=Q: jacobians(b, Q)),
                "J1": (FEW, lambda s=single, Q=Q: [both(s, q) for q in Q[:FEW]]),
                "m": (MANY, lambda b=batch, Q=Q: measure_many(b, Q)),
                "m1": (FEW, lambda s=single, Q=Q: [_motions(s, q, 1e-9) for q in Q[:FEW]]),
                "map": (MANY, lambda m=mechanism: mechanism_map(m, "inputs", MANY)),
            }
        )
        J, J1, m, m1, whole = (rates[k] for k in ("J", "J1", "m", "m1", "map"))
        print(
            f"| {name} | {J:,.0f} | {J1:,.0f} ({J / J1:.1f} times) | {m:,.0f} | {m1:,.0f} "
            f"({m / m1:.1f} times) | {whole:,.0f} |",
            flush=True,
        )


def jacobians(batch: BatchLoops, Q: np.ndarray) -> None:
    """Constraint and output Jacobians of all."""
    placed = batch.place(Q)
    batch.closure(Q, placed=placed)
    batch.output(Q, placed)


def both(single: Loops, q: np.ndarray) -> None:
    """The same of one, by Pinocchio."""
    single.at(q)
    single.output(q)


def check(batch: BatchLoops, single: Loops, found: np.ndarray) -> None:
    """Both are the same numbers."""
    G = batch.closure(found)[1]
    for k, q in enumerate(found):
        assert np.abs(G[k] - single.scaled(q)[1]).max() < 1e-9


def best(what: dict[str, tuple[int, Callable[[], object]]]) -> dict[str, float]:
    """Rates of the best repeat of each, taken in turn."""
    least = dict.fromkeys(what, np.inf)
    for _ in range(REPEATS):
        for key, (count, run) in what.items():
            began = time.process_time()
            run()
            least[key] = min(least[key], (time.process_time() - began) / count)
    return {key: 1 / seconds for key, seconds in least.items()}


if __name__ == "__main__":
    main()
