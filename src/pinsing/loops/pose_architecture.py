"""Platforms that are singular at every pose, by their design."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.loops.rod import Rods

_POSES = 6
_DEPENDENT = 1e-9
_SEED = 2718


def architecture(found: Rods) -> str:
    """Words for lines that are dependent at every pose."""
    inner = np.array([r.inner for r in found.rods])
    outer = np.array([r.outer for r in found.rods])
    why = "the leg lines are dependent whatever the pose"
    if not any(r.moved or r.side for r in found.rods) and _similar(inner, outer):
        shape = "triangles" if len(inner) == 3 else "hexagons"
        why = f"platform and base {shape} are similar"
    return f"architecture singularity: {why}: singular at every pose"


def always_dependent(found: Rods) -> bool:
    """Whether the lines are dependent, to the rounding of a file, at random poses and inputs."""
    rng = np.random.default_rng(_SEED)
    size = 0.0
    for _ in range(_POSES):
        e = rng.normal(size=4) * ((1, 0, 0, 1) if found.planar else 1)
        R = pin.Quaternion(*(e / np.linalg.norm(e))).matrix()
        at = rng.normal(size=3) * ((1, 1, 0) if found.planar else 1)
        lines = []
        for rod in found.rods:
            B, value = at + R @ rod.outer, rng.normal()
            turning = not found.mechanism.prismatic[rod.joint]
            c, s = (np.cos(value), np.sin(value)) if turning else (value, 0.0)
            C = rod.inner + c * rod.first + s * rod.second
            force = B - C
            if rod.across is not None and rod.side:
                force = np.cross(rod.across, force)
                force = force if rod.side == 1 else np.cross(force, B - C)
            lines.append(np.concatenate([force, np.cross(B, force)]))
            if rod.hinge is not None:
                lines.append(np.concatenate([rod.hinge, np.cross(B, rod.hinge)]))
        rows = np.array(lines)[:, [0, 1, 5]] if found.planar else np.array(lines)
        sigma = np.linalg.svd(rows / np.linalg.norm(rows, axis=1)[:, None], compute_uv=False)
        size = max(size, float(sigma[-1] / sigma[0]))
    return size <= _DEPENDENT


def _similar(inner: Array, outer: Array) -> bool:
    """Whether the outer points are the inner ones moved, turned and scaled."""
    a, b = inner - inner.mean(axis=0), outer - outer.mean(axis=0)
    U, sigma, Vt = np.linalg.svd(a.T @ b)
    size = float(sigma.sum() / (a**2).sum())
    return bool(np.abs(size * a @ (U @ Vt) - b).max() <= 1e-9 * max(1.0, float(np.abs(b).max())))
