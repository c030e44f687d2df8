"""Between the joint vector of an arm and the configuration of the whole model it was taken from.

The whole model's configuration is Pinocchio's: (nq,) numbers in the model's order, seven for a
floating base, cosine and sine for a continuous joint. The lengths n and nq are equal only where
the arm is the whole model and every joint is one number, and then both mean the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.robot.tip import frame_index, joint_path

if TYPE_CHECKING:
    from pinsing.robot.arm import Arm

_SAME = 1e-6
"""Radians or metres: a locked or following joint this close to where it belongs is there."""
_UNIT = 1e-3
"""How far cosine and sine of a continuous joint may be from the unit circle."""


def from_full(arm: Arm, full_q: Array) -> Array:
    """Joint vectors (..., n) of the arm out of configurations (..., nq) of its whole model.

    What is neither on the chain nor holds it in shape does not count: fingers, other arms, the
    place of a floating base. Angles of continuous joints are in (-pi, pi].

    Raises
    ------
    ConfigurationError
        If a joint that is locked between base and tip, or follows another one, is elsewhere in
        ``full_q`` than the arm has it; or if a continuous joint has no angle.
    """
    whole = arm.source.full_model
    locked = set(arm.source.locked)
    kept = [j for j in range(1, whole.njoints) if j not in locked]
    values = np.stack([_value(arm, j, full_q) for j in kept], axis=-1)
    names = [whole.names[j] for j in kept]
    q = values[..., [names.index(name) for name in arm.joints]]
    if arm.coupling is not None:
        there = q @ arm.coupling.matrix.T + arm.coupling.offset
        for row, j in enumerate(kept):
            turns = whole.joints[j].nq == 2
            _require(arm, j, values[..., row], there[..., row], turns, "follows another joint")
    base = int(whole.frames[frame_index(whole, arm.source.base)].parentJoint)
    last = int(whole.frames[frame_index(whole, arm.tip)].parentJoint)
    for j in joint_path(whole, last, base):
        if j in locked and whole.joints[j].nv == 1:  # a floating base carries the arm's own axes
            value, at = _value(arm, j, full_q), _value(arm, j, arm.source.reference)
            _require(arm, j, value, at, whole.joints[j].nq == 2, "is locked in this arm")
    return q


def to_full(arm: Arm, q: Array, others: Array) -> Array:
    """Configurations (..., nq) of the whole model: ``others`` (nq,) with the arm at q (..., n)."""
    whole = arm.source.full_model
    values = q if arm.coupling is None else q @ arm.coupling.matrix.T + arm.coupling.offset
    out = np.broadcast_to(others, (*q.shape[:-1], whole.nq)).copy()
    locked = set(arm.source.locked)
    kept = [j for j in range(1, whole.njoints) if j not in locked]
    for row, j in enumerate(kept):
        i, value = whole.joints[j].idx_q, values[..., row]
        if whole.joints[j].nq == 2:
            out[..., i], out[..., i + 1] = np.cos(value), np.sin(value)
        else:
            out[..., i] = value
    return out


def _value(arm: Arm, joint: int, full_q: Array) -> Array:
    """Plain value of a joint with one degree of freedom, radians or metres."""
    whole = arm.source.full_model
    entry = whole.joints[joint]
    i = entry.idx_q
    if entry.nq == 1:
        return np.asarray(full_q[..., i])
    c, s = full_q[..., i], full_q[..., i + 1]
    off = np.abs(np.hypot(c, s) - 1)
    if not (off <= _UNIT).all():
        name = whole.names[joint]
        raise ConfigurationError(
            f"q of continuous joint {name!r} must be its cosine and sine "
            f"(entries {i} and {i + 1} of the whole model's {whole.nq})",
            joint=name,
        )
    return np.asarray(np.arctan2(s, c))


def _require(arm: Arm, joint: int, value: Array, at: Array, turns: bool, why: str) -> None:
    off = value - at
    if turns:
        off = off - 2 * np.pi * np.round(off / (2 * np.pi))
    wrong = np.abs(off) > _SAME
    if not wrong.any():
        return
    name = arm.source.full_model.names[joint]
    value, at = np.broadcast_arrays(value, at)
    here, there = float(value[wrong].flat[0]), float(at[wrong].flat[0])
    raise ConfigurationError(
        f"joint {name!r} {why} and belongs at {there:g}, but the whole model's q has it at "
        f"{here:g}: give the arm's own {arm.n} values, or load the arm with that joint as it is",
        joint=name,
        value=here,
        limits=(there, there),
    )
