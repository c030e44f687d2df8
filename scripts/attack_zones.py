"""Attack zones: look at many configurations outside them for one that exceeds a speed limit.

Example: pinsing zones ur5 --within limits -o zones.json, then
scripts/attack_zones.py ur5 zones.json --samples 1e8
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

import pinsing
from pinsing.algebra.conditions import two_sided
from pinsing.kinematics import singular_values
from pinsing.kinematics.tip_speed import SpeedJudge
from pinsing.proximity import Zones
from pinsing.proximity.clearance import watch
from pinsing.proximity.zones import Region

CHUNK = 200_000


def main() -> int:
    """Print how many samples lay outside, and the largest share of a limit; 1 if one exceeds it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot")
    parser.add_argument("zones", type=Path)
    parser.add_argument("--samples", type=float, default=1e7)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    found = Zones.from_json(given.zones.read_text())
    arm = pinsing.load(given.robot, task=found.arm.task, length_scale=found.arm.length_scale)
    form = pinsing.closed_form(arm)
    watched, judge = watch(form), SpeedJudge(arm, found.joint_speeds)
    box = zip("xyz", found.tip_lower, found.tip_upper, strict=True)
    ranges = {axis: (low, high) for axis, low, high in box if math.isfinite(low)}
    region = Region(form, arm, {**dict.fromkeys(found.posture), **ranges})
    far = np.array([found.distances[name] for name in watched.names])
    # Joint speeds of least length are at most |twist| / sigma.
    size = math.hypot(found.tip_speed / arm.length_scale, found.turn_speed)
    rng = np.random.default_rng(given.seed)
    outside, worst, looked = 0, 0.0, 0
    while looked < given.samples:
        Q = rng.uniform(found.lower, found.upper, (CHUNK, arm.n))
        looked += CHUNK
        Q = Q[(two_sided(watched.conditions, Q, each=True).each[..., 0] > far).all(axis=1)]
        outside += len(Q)
        sigma = np.asarray(singular_values(arm, Q))[:, judge.rank - 1]
        Q = Q[size > sigma * judge.limits.min() * max(worst, 0.5)]
        Q = Q[region.holds(Q)]
        if len(Q):
            taken = judge.shares(Q, found.tip_speed, found.turn_speed)
            worst = max(worst, float(taken.max()))
    print(f"{looked:.3g} samples, {outside:.3g} outside the zones: at most {worst:.4f} of a limit")
    return int(worst > 1)


if __name__ == "__main__":
    sys.exit(main())
