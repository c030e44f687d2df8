"""In which coordinates the output of a mechanism can be led, for the sliders of its pose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.loops.closure import Loops, random_closed, ranks
from pinsing.loops.modes import home
from pinsing.loops.motion import motions
from pinsing.robot.mechanism import Mechanism

_SAMPLES = 4
_SEED = 673
_STILL = 1e-8


def led_pose(mechanism: Mechanism) -> dict[str, Any]:
    """Rows of the output that can be led independently, and what its turns are; ready for JSON.

    Keys: ``rows``, of the output's rows as many as it has freedoms, those that move most at home;
    ``turn``, None where it does not turn, else ``kind``: ``full`` (all three, led as a rotation),
    ``axis`` (about one axis of the base always: ``at`` is the angle at the rotation ``zero``), or
    ``angles`` (some of roll, pitch and yaw; the others follow).
    """
    loops = Loops(mechanism)
    start = home(mechanism)
    rows = sorted(_independent(mechanism, loops, start))
    turning = [row for row in rows if row >= 3]
    if not turning:
        return {"rows": rows, "turn": None}
    if len(turning) == 3:
        return {"rows": rows, "turn": {"kind": "full"}}
    others = [row for row in (3, 4, 5) if row not in turning]
    samples = [start, *random_closed(mechanism, _SAMPLES, np.random.default_rng(_SEED))]
    still = all(np.abs(_moves(mechanism, loops, q)[others]).max() <= _STILL for q in samples)
    if len(turning) > 1 or not still:
        return {"rows": rows, "turn": {"kind": "angles"}}
    R = np.array(loops.output(start)[0].rotation)
    angle = float(pin.rpy.matrixToRpy(R)[turning[0] - 3])
    return {"rows": rows, "turn": {"kind": "axis", "at": angle, "zero": R.tolist()}}


def _moves(mechanism: Mechanism, loops: Loops, q: Array) -> Array:
    """Velocities (6, d) of the output over the motions that the loops allow, without units."""
    model, data = mechanism.model, mechanism.model.createData()
    J = pin.computeFrameJacobian(
        model, data, mechanism.model_q(q), mechanism.output_id, pin.LOCAL_WORLD_ALIGNED
    )
    scale = np.repeat([1 / mechanism.length_scale, 1.0], 3)
    return np.asarray(scale[:, None] * J * loops.column_scale @ motions(mechanism, q).basis)


def _independent(mechanism: Mechanism, loops: Loops, q: Array) -> list[int]:
    """Rows of the output that move independently, the one that moves most first."""
    rest = _moves(mechanism, loops, q)[list(mechanism.task.rows)]
    count = min(ranks(mechanism).output, len(rest))
    chosen: list[int] = []
    for _ in range(count):
        # Of rows that move alike the earlier one is taken, whatever rounding says.
        k = int(np.argmax(np.round(np.linalg.norm(rest, axis=1), 9)))
        chosen.append(int(mechanism.task.rows[k]))
        size = float(np.linalg.norm(rest[k]))
        if size > 0:
            rest = rest - np.outer(rest @ rest[k], rest[k]) / size**2
    return list(dict.fromkeys(chosen))
