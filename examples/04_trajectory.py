"""Check a motion: where it meets a singularity between its samples, and how clear these are."""

import numpy as np

import pinsing

arm = pinsing.load("ur5")
form = pinsing.closed_form(arm)
start = np.radians([0, -70, 75, -90, -60, 0])
end = np.radians([30, -60, 60, -90, 60, 0])  # the wrist turns through zero on the way
straight = np.linspace(start, end, 20)

check = pinsing.check_trajectory(arm, straight, np.linspace(0, 2, 20))
for crossing in check.crossings:
    print(f"meets {crossing.family} at t = {crossing.t:.3f} s")
aspect = pinsing.connect(form, start, end).answer
print(f"start and end are in aspects that are {aspect}: every way between them meets one")

lower = pinsing.clearance(form, straight).lower
print(f"{(lower > 0.2).sum()} of its {len(straight)} samples are proven clear by 0.2 rad")
