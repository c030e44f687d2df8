"""Count the inverse solutions that EAIK misses: known configurations, and those that ours finds."""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

import pinsing
from pinsing.kinematics.inverse import InverseMany
from pinsing.kinematics.jacobian import tip_placement
from pinsing.measures import Array, Bool


def missed(arm: pinsing.Arm, found: Array, Q: Array) -> Bool:
    """Which configurations (M, n) are none of the solutions (M, S, n), whole turns aside."""
    off = np.abs(arm.space.wrap(found - Q[:, None])).max(axis=-1)
    return ~(np.nan_to_num(off, nan=np.inf).min(axis=1) < 1e-5)


def main() -> None:
    """Print what is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot")
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--ours", type=int, default=1000, help="of which our solver solves so many")
    args = parser.parse_args()
    arm = pinsing.load(args.robot)
    many = InverseMany(arm)
    Q = np.random.default_rng(0).uniform(*arm.space.span, (args.poses, arm.n))
    T = np.array([tip_placement(arm, q).homogeneous for q in Q])
    start, used = time.perf_counter(), time.process_time()
    found = many.solve(T[:, None, :3, 3], T[:, None, :3, :3])[:, 0]
    each = 1e6 / args.poses
    clock, used = (time.perf_counter() - start) * each, (time.process_time() - used) * each
    count = np.isfinite(found[..., 0]).sum()
    print(
        f"{args.robot}: {count / args.poses:.2f} solutions of a pose in {clock:.1f} us of the clock"
    )
    print(f"({used:.1f} us of processors); of {args.poses} known ones missed:", end=" ")
    print(int(missed(arm, found, Q).sum()), flush=True)
    sys.modules["pinsing.kinematics.inverse"].decomposed = lambda *_: None  # type: ignore[attr-defined]
    rows, ours = [], []
    for k in range(args.ours):
        here = [s.q for s in pinsing.inverse(arm, T[k]) if s.regular]
        rows += [k] * len(here)
        ours += here
    lost = missed(arm, found[rows], np.array(ours))
    less = np.isfinite(found[: args.ours, :, 0]).sum() - len(ours)
    print(f"{len(ours)} regular solutions of {args.ours} poses by ours: EAIK misses {lost.sum()},")
    print(f"and has {less} more")


if __name__ == "__main__":
    main()
