"""Join random pairs of configurations within the limits: how many are decided, how fast, how clear.

python scripts/bench/connect.py [ROBOT ...] [--pairs 400] [--same]

With --same only pairs in one aspect are drawn: UR5 has 16, so that few random pairs share one.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

import pinsing

ROBOTS = ("ur5", "ur3", "ur10", "puma560", "irb1400", "z1", "stanford", "iiwa14", "surgical7")


def row(name: str, pairs: int, same: bool) -> str:
    """One line: answers, processor time, least clearance against that of the nearer end."""
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm)
    begin = time.process_time()
    found = pinsing.aspects(form)
    counted = time.process_time() - begin
    rng = np.random.default_rng(1)
    answers: Counter[str] = Counter()
    taken, share = [], []
    while answers.total() < pairs:
        qa, qb = arm.space.sample(2, rng)
        if same and found.of(qa) != found.of(qb):
            continue
        begin = time.process_time()
        joined = pinsing.connect(form, qa, qb, of=found)
        seconds = time.process_time() - begin
        answers[joined.answer] += 1
        if joined.answer == "same":
            taken.append(seconds)
            ends = float(np.min(pinsing.clearance(form, np.stack([qa, qb])).lower))
            share.append(joined.clearance / ends)
    said = ", ".join(f"{n} {word}" for word, n in sorted(answers.items()))
    line = f"{name}: aspects {found.lower} to {found.upper} in {counted:.2f} s; {said}"
    if taken:
        half = f"{np.median(taken):.3f} s, at most {max(taken):.3f} s"
        late = sum(t > 0.5 for t in taken)
        line += f"; joined in {half} ({late} over 0.5 s)"
        line += f"; clearance over that of the nearer end {np.median(share):.2f}"
        line += f", least {min(share):.3f}"
    return line


def main() -> None:
    """Print a line for each robot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    parser.add_argument("--pairs", type=int, default=400)
    parser.add_argument("--same", action="store_true")
    options = parser.parse_args()
    for name in options.robots:
        print(row(name, options.pairs, options.same), flush=True)


if __name__ == "__main__":
    main()
