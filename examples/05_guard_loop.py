"""A simulated control loop that slows down near singular configurations and stops before one.

    python examples/05_guard_loop.py

A UR5 turns its wrist towards q5 = 0; joint speeds are scaled by the clearance of a Monitor.
"""

from __future__ import annotations

import numpy as np

import pinsing

WARN, STOP, PERIOD = 0.20, 0.05, 1e-3


def main() -> None:
    """Run two simulated seconds."""
    form = pinsing.closed_form(pinsing.load("ur5"))
    monitor = pinsing.Monitor(form, warn=WARN, stop=STOP)
    q = np.array([0.0, -1.2, 1.3, -1.0, 0.8, 0.0])
    wish = np.array([0.3, 0.0, 0.0, 0.0, -0.8, 0.0])
    least, before, clearance = np.inf, "clear", np.inf
    for tick in range(2000):
        share = float(np.clip((clearance - STOP) / (WARN - STOP), 0, 1))
        verdict = monitor.update(q, share * wish)
        clearance, least = verdict.lower, min(least, verdict.lower)
        if verdict.level != before:
            before = verdict.level
            print(
                f"{tick * PERIOD:.3f} s: {verdict.level}, {verdict.lower:.4f} rad from "
                f"{verdict.family}, {verdict.trend}; contact in {verdict.time_to_contact:.2f} s"
            )
        q = q + share * wish * PERIOD
    print(f"nearest {least:.4f} rad, q5 = {q[4]:.4f}")


if __name__ == "__main__":
    main()
