"""Clearance and time along toolpaths of a UR5, rotations by 20 degrees against 1 degree."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin

import pinsing
from pinsing._types import Array
from pinsing.kinematics.jacobian import tip_placement

TORCH = pin.SE3(pin.utils.rotate("x", np.radians(45)), np.array([0.0, 0.05, 0.15])).homogeneous
START = np.radians([20, -80, 95, -105, -12, 20])


def along(points: Array, out: Array) -> Array:
    """Poses at points (N, 3) whose z axis points against the direction ``out`` (N, 3)."""
    T = np.tile(np.eye(4), (len(points), 1, 1))
    x = np.cross(np.array([0.0, 1.0, 0.0]), -out)
    x /= np.linalg.norm(x, axis=1)[:, None]
    T[:, :3, :3] = np.stack([x, np.cross(-out, x), -out], axis=-1)
    T[:, :3, 3] = points
    return T


def toolpaths(count: int) -> dict[str, Array]:
    """Return poses (count, 4, 4) by what they are."""
    s = np.linspace(0.05, 1, count)
    cap, turn = np.radians(35) * s, 12 * np.pi * s
    up = np.stack([np.sin(cap) * np.cos(turn), np.sin(cap) * np.sin(turn), np.cos(cap)], axis=1)
    a = np.radians(np.linspace(225, -45, count))
    lean, round_ = np.radians(20), np.stack([np.cos(a), 0 * a, np.sin(a)], axis=1)
    seam = np.cos(lean) * round_ + np.array([0.0, np.sin(lean), 0.0])
    circle = np.tile(tip_placement(pinsing.load("ur5"), START).homogeneous @ TORCH, (count, 1, 1))
    around = np.linspace(0, 2 * np.pi, count)
    circle[:, 0, 3] += 0.12 * (np.cos(around) - 1)
    circle[:, 1, 3] += 0.12 * np.sin(around)
    return {
        "torch on a circle": circle,
        "weld seam around a pipe, 270°": along(np.array([0.55, 0.1, 0.35]) + 0.06 * round_, seam),
        "5-axis spiral on a dome": along(np.array([0.5, 0.05, -0.05]) + 0.2 * up, up),
    }


def main() -> None:
    """Print one row for each path."""
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm, prove=False)
    for name, T in toolpaths(1000).items():
        cells = []
        for step in (20.0, 1.0):
            start = time.process_time()
            plan = pinsing.plan_path(
                form, T, free="roll", step=np.radians(step), arm=arm, tool=TORCH
            )
            said = f"{np.degrees(plan.clearance):.1f}°" if not plan.reason else "no path"
            cells += [said, f"{time.process_time() - start:.1f} s"]
        print(f"| {name} | {' | '.join(cells)} | {np.degrees(plan.bound):.1f}° |", flush=True)


if __name__ == "__main__":
    main()
