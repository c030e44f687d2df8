"""The other postures of a pose, and whether the arm gets there without a singularity."""

import numpy as np

import pinsing

for name in ("puma560", "so100"):
    arm = pinsing.load(name)
    print(f"{name}: {pinsing.cuspidality(arm, poses=5)}"[:110])

arm = pinsing.load("puma560")
found = pinsing.posture_changes(arm, np.radians([10, 30, -40, 20, 50, 10]))
for other in found.others:
    way = other.connection.answer if other.connection else "beyond the limits"
    print(np.round(np.degrees(other.solution.q), 1), "aspect:", way)
