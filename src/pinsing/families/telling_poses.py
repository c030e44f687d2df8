"""Configurations that show a family well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.families.family import Family
from pinsing.kinematics.verdict import own_shares
from pinsing.robot.arm import Arm

_APART = 0.12  # radians, about seven degrees


def telling_poses(
    arm: Arm, family: Family, count: int, others: Sequence[Family] = ()
) -> tuple[Array, ...]:
    """Configurations of a family that show it well, at most ``count``.

    They are on no other family where there are such, away from other singularities, above the
    floor with every joint, within half a turn, not twisted up, and unlike each other; the same
    ones at every call. ``others`` are
    families to stay away from. Empty where the limits allow none.
    """
    rng = np.random.default_rng(4)
    Q = family.sample(80, rng)
    witness = getattr(family, "witness", None)
    if not len(Q):
        return () if witness is None else (np.array(witness, dtype=float),)
    lower, upper = arm.span
    turns = np.where(arm.prismatic, 0.0, 2 * np.pi * np.round(Q / (2 * np.pi)))
    Q = np.where((Q - turns >= lower) & (Q - turns <= upper), Q - turns, Q)
    apart = _apart(arm, others, Q)
    alone = apart >= min(_APART, float(apart.max()))
    Q, apart = Q[alone], apart[alone]
    share = own_shares(arm, Q)
    # The singular value that should survive at a generic point of the family.
    drop = max(1, int(np.median((share <= 1e-7).sum(axis=1))))
    healthy = share[:, -1 - drop] if share.shape[1] > drop else 1.0
    half_turn = np.where(arm.prismatic | (lower > np.pi) | (upper < -np.pi), np.inf, np.pi)
    lower, upper = np.maximum(lower, -half_turn), np.minimum(upper, half_turn)
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-9)
    twisted = np.abs((Q - middle) / half).mean(axis=1)
    score = np.minimum(healthy / 0.1, 1.0) + 2.0 * _above_floor(arm, Q) - 0.8 * twisted
    score += 0.5 * np.minimum(apart / (3 * _APART), 1.0)
    chosen = [int(np.argmax(score))]
    reach = np.where(arm.prismatic, half, np.pi)
    for _ in range(min(count, len(Q)) - 1):
        gap = np.min([np.linalg.norm((Q - Q[c]) / reach, axis=1) for c in chosen], axis=0)
        gap[chosen] = -np.inf
        chosen.append(int(np.argmax(score + 1.2 * np.minimum(gap, 1.0))))
    return tuple(Q[c] for c in chosen)


def _apart(arm: Arm, others: Sequence[Family], Q: Array) -> Array:
    """At least how far other families are from Q (N, n); (N,), radians."""
    if not others:
        return np.full(len(Q), np.inf)
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of([f.branches for f in others], np.asarray(arm.prismatic), weight)
    return two_sided(conditions, Q).lower


def _above_floor(arm: Arm, Q: Array) -> Array:
    """1 where no joint and no tip is below the base, 0 from a tenth of the height on; (N,)."""
    data, heights = arm.model.createData(), []
    for q in Q:
        pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
        z = [data.oMi[j].translation[2] for j in range(1, arm.model.njoints)]
        heights.append([*z, data.oMf[arm.tip_id].translation[2]])
    spread = float(np.ptp(heights)) or 1.0
    return np.asarray(np.clip(1 + 10 * np.min(heights, axis=1) / spread, 0.0, 1.0))
