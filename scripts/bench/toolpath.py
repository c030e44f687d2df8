"""Clearance and time along toolpaths of a UR5: what others minimise, and ours by 20 and 1 degrees.

A ladder of all inverse solutions at rotations in steps of 20 degrees, and its shortest path: in
joint motion, as Descartes' DensePlanner has it, no joint by more than 45 degrees from pose to pose
(https://docs.ros.org/en/hydro/api/descartes_planner/html/); or in rotation about the tool's axis,
as RoboDK's minimum tool orientation change, whose steps are 20 degrees, too
(https://robodk.com/doc/en/Robot-Machining-Path-tool-offset.html). Both are written here as their
pages describe them, on our inverse kinematics; none of their code runs. Times are processor time.
"""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pinocchio as pin

import pinsing
from pinsing.kinematics.inverse import InverseMany
from pinsing.kinematics.jacobian import tip_placement
from pinsing.measures import Array, Ints

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


def shortest(arm: pinsing.Arm, T: Array, turned: float) -> Array:
    """Configurations (N, n) of the ladder's path: least ``turned`` times rotation plus motion."""
    angles = np.radians(np.arange(-180, 180, 20))
    spins = [pin.SE3(pin.utils.rotate("z", angle), np.zeros(3)).homogeneous for angle in angles]
    poses = T[:, None] @ np.array(spins) @ np.linalg.inv(TORCH)
    Q = InverseMany(arm, None).solve(poses[..., :3, 3], poses[..., :3, :3])
    roll = np.repeat(angles, Q.shape[2])
    Q = Q.reshape(len(T), -1, arm.n)
    turns = turned * np.abs(np.angle(np.exp(1j * (roll[:, None] - roll))))
    costs = np.where(np.isfinite(Q[0, :, 0]), turned * np.abs(roll), np.inf)
    origins: list[Ints] = []
    for before, after in pairwise(Q):
        motion = np.abs(arm.space.wrap(after[:, None] - before))
        steps = np.where(motion.max(axis=-1) < np.pi / 4, motion.sum(axis=-1) + turns, np.inf)
        origins.append((costs + steps).argmin(axis=1))
        costs = (costs + steps).min(axis=1)
    at = [int(costs.argmin())]
    for origin in reversed(origins):
        at.append(int(origin[at[-1]]))
    return Q[np.arange(len(T)), at[::-1]]


def main() -> None:
    """Print one row for each path."""
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm, prove=False)
    for name, T in toolpaths(1000).items():
        cells = []
        for turned in (0.0, 1e3):
            start = time.process_time()
            Q = shortest(arm, T, turned)
            spent = time.process_time() - start
            check = pinsing.check_trajectory(arm, Q, forms=form)
            least = f"{np.degrees(pinsing.clearance(form, Q).lower.min()):.1f}°"
            cells += ["singular" if check.crossings else least, f"{spent:.1f} s"]
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
