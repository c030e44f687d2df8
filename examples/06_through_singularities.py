"""Lead a UR5 through its wrist and along its shoulder singularity, by each method.

python examples/06_through_singularities.py speeds.png
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import pinsing

DT, STEPS = 0.002, 600
arm = pinsing.load("ur5", units="rad")  # without damping joints are thrown several turns
shoulder = pinsing.closed_form(arm).families[2]
above = shoulder.distance([0, -1.8, 1.2, -0.9, -1.4, 0]).q  # the wrist above the shoulder
bent = np.array([0, -1.2, 1.4, -1.2, 0.5, 0])
turn = -pinsing.frame_jacobian(arm, bent)[:, 4] + [0, 0, 0, 0.02, 0.02, 0.02]  # straightens q5
TASKS = {  # where it starts, and the velocity of the tip (m/s, rad/s), the same all the time
    "through the wrist singularity": (bent, turn),
    "along the shoulder singularity": (above, [0.05, 0.02, 0.1, 0, 0, 0]),
}
figure, axes = plt.subplots(2, 2, figsize=(10, 6), sharex=True, layout="constrained")
for column, (title, (start, twist)) in zip(axes.T, TASKS.items(), strict=True):
    for method in ("pinv", "dls", "filter", "sdls", "jparse"):
        q, speed, missed = np.array(start), [], []
        for _ in range(STEPS):
            J = pinsing.frame_jacobian(arm, q)
            found = pinsing.inverse_velocity(J, twist, method)
            q = q + DT * found.dq
            speed.append(np.abs(found.dq).max())
            missed.append(np.linalg.norm(found.missed))
        column[0].semilogy(DT * np.arange(STEPS), speed, label=method)
        column[1].plot(DT * np.arange(STEPS), missed)
        print(f"{title}, {method}: at most {max(speed):.3g} rad/s, misses {max(missed):.3g}")
    column[0].set(title=title, ylabel="largest joint speed (rad/s)")
    column[1].set(xlabel="time (s)", ylabel="twist missed (m/s, rad/s)")
axes[0, 0].legend()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "speeds.png")
