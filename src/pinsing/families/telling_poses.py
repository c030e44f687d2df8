"""Configurations that show a family well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.families.family import Family
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.verdict import own_shares
from pinsing.robot.arm import Arm

_APART = 0.12  # radians, about seven degrees


def telling_poses(
    arm: Arm, family: Family, count: int, others: Sequence[Family] = ()
) -> tuple[Array, ...]:
    """Configurations of a family that show it well, at most ``count``.

    They are on no other family where there are such, away from other singularities, above the
    floor, not twisted up, and unlike each other; the same ones at every call. ``others`` are
    families to stay away from. Empty where the limits allow none.
    """
    rng = np.random.default_rng(4)
    Q = family.sample(80, rng)
    witness = getattr(family, "witness", None)
    if not len(Q):
        return () if witness is None else (np.array(witness, dtype=float),)
    apart = _apart(arm, others, Q)
    alone = apart >= min(_APART, float(apart.max()))
    Q, apart = Q[alone], apart[alone]
    share = own_shares(arm, Q)
    # The singular value that should survive at a generic point of the family.
    drop = max(1, int(np.median((share <= 1e-7).sum(axis=1))))
    healthy = share[:, -1 - drop] if share.shape[1] > drop else 1.0
    lower, upper = arm.span
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-9)
    twisted = np.abs((Q - middle) / half).mean(axis=1)
    score = np.minimum(healthy / 0.1, 1.0) + 0.7 * _above_floor(arm, Q) - 0.8 * twisted
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
    """1 where the tip is above the base, 0 where far below it; (N,)."""
    z = np.array([tip_placement(arm, q).translation[2] for q in Q])
    spread = float(np.ptp(z)) or 1.0
    return np.clip((z + 0.1 * spread) / (0.2 * spread), 0.0, 1.0)
