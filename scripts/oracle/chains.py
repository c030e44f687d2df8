"""Random structured chains: parallel, meeting and orthogonal axes, sliders, all kinds of tasks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pinsing.robot.arm import Arm
from pinsing.robot.load import load

_ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")
_LENGTHS = (0.05, 0.07, 0.1, 0.12, 0.2, 0.25, 0.3, 0.4)


@dataclass(frozen=True)
class Row:
    """Row of a standard DH table: degrees and metres."""

    theta: float
    d: float
    a: float
    alpha: float
    slides: bool = False


@dataclass(frozen=True)
class Spec:
    """A chain and its task, enough to make it again."""

    rows: tuple[Row, ...]
    task: str

    def __str__(self) -> str:
        def row(r: Row) -> str:
            mark = "P" if r.slides else ""
            return f"{mark}({r.theta:g}, {r.d:g}, {r.a:g}, {r.alpha:g})"

        return f"{self.task}: " + " ".join(row(r) for r in self.rows)


def random_spec(seed: int) -> Spec:
    """A chain of 3 to 8 joints; the same for the same seed."""
    rng = np.random.default_rng([20251, seed])
    n = int(rng.integers(3, 9))
    # Each chain leans to some kind of structure.
    parallel, meeting, slides = (
        rng.uniform(0.1, 0.6),
        rng.uniform(0.2, 0.8),
        rng.choice([0, 0, 0.3]),
    )
    odd = float(rng.choice([0.0, 0.0, 0.0, 0.1]))
    rows = []
    for _ in range(n):
        alpha = float(
            rng.choice([0.0, 180.0]) if rng.random() < parallel else rng.choice([90, -90])
        )
        if rng.random() < odd:
            alpha = float(rng.choice([45.0, -45.0, 60.0, 30.0]))
        a = 0.0 if rng.random() < meeting else float(rng.choice(_LENGTHS))
        d = 0.0 if rng.random() < 0.6 else float(rng.choice(_LENGTHS))
        theta = float(rng.choice([0.0, 0.0, 90.0, 180.0, -90.0]))
        rows.append(Row(theta, d, a, alpha, bool(rng.random() < slides)))
    kind = rng.random()
    if kind < 0.45:
        task = "pose"
    elif kind < 0.65:
        task = "position"
    elif kind < 0.75:
        task = "orientation"
    else:
        size = int(rng.integers(1, 6))
        task = ",".join(_ROWS[i] for i in sorted(rng.choice(6, size, replace=False)))
    return Spec(tuple(rows), task)


def strange_spec(seed: int) -> Spec:
    """A chain of 3 to 8 joints that is special in many ways; the same for the same seed.

    Few lengths, so that many are equal, and many zero: axes meet, are parallel, or coincide.
    """
    rng = np.random.default_rng([20261, seed])
    n = int(rng.integers(3, 9))
    few = [float(x) * float(rng.choice([1, 1, -1])) for x in rng.choice(_LENGTHS, 2)]
    twists = [0.0, 0.0, 180.0, 90.0, -90.0, 90.0, -90.0]
    if rng.random() < 0.3:
        twists += [float(x) for x in rng.choice([30, 45, 60, -45, -60, 120], 2)]
    zero, slides = rng.uniform(0.2, 0.8), float(rng.choice([0.0, 0.0, 0.2, 0.5]))
    rows = tuple(
        Row(
            float(rng.choice([0.0, 0.0, 90.0, 180.0, -90.0])),
            *(0.0 if rng.random() < zero else float(rng.choice(few)) for _ in range(2)),
            float(rng.choice(twists)),
            bool(rng.random() < slides),
        )
        for _ in range(n)
    )
    if rng.random() < 0.2:  # the same backwards
        rows = (*rows[: n // 2], *reversed(rows[: n - n // 2]))
    tasks = ("pose", "pose", "pose", "position", "orientation", "tool-axis", "vx,vy,vz,wz")
    task = str(rng.choice([*tasks, "rows"]))
    if task == "rows":
        size = int(rng.integers(1, 6))
        task = ",".join(_ROWS[i] for i in sorted(rng.choice(6, size, replace=False)))
    return Spec(rows, task)


def arm_of(spec: Spec, limit: float = math.pi) -> Arm:
    """The arm as a model: joint i turns or slides along z, then come d, a and alpha."""
    model = pin.Model()
    model.name = "chain"
    parent, before = 0, pin.SE3.Identity()
    for i, r in enumerate(spec.rows, 1):
        reach = 1.0 if r.slides else limit
        turn = pin.SE3(pin.utils.rotate("z", math.radians(r.theta)), np.zeros(3))
        parent = model.addJoint(
            parent,
            pin.JointModelPZ() if r.slides else pin.JointModelRZ(),
            before * turn,
            f"j{i}",
            np.full(1, 1e3),
            np.full(1, 1e3),
            np.full(1, -reach),
            np.full(1, reach),
        )
        before = pin.SE3(pin.utils.rotate("x", math.radians(r.alpha)), np.array([r.a, 0.0, r.d]))
    model.addFrame(pin.Frame("tip", parent, 0, before, pin.FrameType.OP_FRAME))
    return load(model, tip="tip", task=spec.task, units="rad")
