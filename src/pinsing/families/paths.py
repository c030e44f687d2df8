"""Paths to play: along a family, and out of the regular into a singular configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.families.family import Family
from pinsing.families.parts import Branch
from pinsing.families.zero_set import project
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.verdict import own_shares, ratios
from pinsing.robot.arm import Arm

ALONG_FRAMES = 54
INTO_FRAMES = 30


@runtime_checkable
class FamilyLike(Protocol):
    """The part of a family that paths and viewers need."""

    @property
    def name(self) -> str:
        """Short name."""

    @property
    def text(self) -> str:
        """The condition in one line."""

    @property
    def joints(self) -> Sequence[str]:
        """Names of the joints involved."""

    @property
    def values(self) -> Sequence[dict[int, float]]:
        """Fixed joint values of each branch."""

    def contains(self, q: npt.ArrayLike, tol: float = 1e-6) -> npt.NDArray[np.bool_]:
        """Tell whether q belongs to it."""

    def distance(self, q: npt.ArrayLike) -> Any:
        """Distance: value and nearest q."""

    def sample(self, n: int, rng: np.random.Generator) -> Array:
        """Configurations inside the limits."""


def along(arm: Arm, family: FamilyLike | None, start: Array, frames: int = ALONG_FRAMES) -> Array:
    """Singular path: a closed curve on a family through ``start``.

    All joints swing smoothly; each point is then brought back onto the family. The swing is
    made smaller until the whole path is continuous and inside the limits.

    Returns
    -------
    (frames, n) array
        Radians and metres; (0, n) where the family is a point, or no such path was found.
    """
    if family is None:
        return np.zeros((0, arm.n))
    phase = np.linspace(0.0, 2 * np.pi, frames, endpoint=False)[:, None]
    lower, upper = arm.span
    swing = np.where(arm.prismatic, 0.3 * (upper - lower), 0.6)
    rhythm = 1 + np.arange(arm.n) % 2
    up, down = np.maximum(upper - start, 0), np.maximum(start - lower, 0)
    for size in (1.0, 0.6, 0.3, 0.12):
        to_both = np.minimum(np.minimum(up, down), size * swing)
        to_one = np.minimum(np.maximum(up, down), size * swing) * np.where(up > down, 1.0, -1.0)
        sides = to_both >= 0.4 * np.abs(to_one)
        wave = np.where(
            sides,
            to_both * np.sin(rhythm * phase),
            to_one * (1 - np.cos(rhythm * phase)) / 2,
        )
        path = onto(family, start + wave, start)
        if path is None or np.ptp(path, axis=0).max() < 1e-6:
            continue
        closed = np.concatenate([path, path[:1]])
        inside = (path >= lower - 1e-9).all() and (path <= upper + 1e-9).all()
        if inside and np.abs(np.diff(closed, axis=0)).max() <= 0.35:
            return path
    return np.zeros((0, arm.n))


def onto(family: FamilyLike, Q: Array, start: Array) -> Array | None:
    """Bring points Q (N, n) onto the piece of a family that ``start`` (n,) is on."""
    branches: Sequence[Branch] = getattr(family, "branches", ())
    if not branches:
        return np.array([_near(np.asarray(family.distance(q).q), q) for q in Q])
    branch = min(branches, key=lambda b: _off(b, start))
    out = Q.copy()
    for v in branch.values:
        out[:, v.joint] = start[v.joint]
    if not branch.equations:
        return out
    free = np.zeros(Q.shape[1], dtype=bool)
    free[[j for e in branch.equations for j in e.involved]] = True
    out, ok = project(branch.equations, out, free)
    return out if bool(ok.all()) else None


def _off(branch: Branch, q: Array) -> float:
    """How far q is from fulfilling a branch: joint values, and residuals of its equations."""
    gaps = [abs(np.exp(1j * q[v.joint]) - np.exp(1j * v.value)) for v in branch.values]
    gaps += [abs(float(e(q))) / e.size for e in branch.equations]
    return float(np.sum(gaps))


def _near(q: Array, target: Array) -> Array:
    """Revolute values of q by whole turns to where ``target`` is."""
    gap = q - target
    return np.asarray(np.where(np.abs(gap) > np.pi, q - 2 * np.pi * np.round(gap / 2 / np.pi), q))


def into(arm: Arm, moved: Sequence[int], goal: Array, frames: int = INTO_FRAMES) -> Array:
    """Path from a regular configuration into the singular one ``goal`` (n,).

    Only the joints ``moved``, which the condition is about, move, if that is enough; the way is
    the one, among many tried, on which the arm starts most regular and sigma_r falls steadily.

    Returns
    -------
    (frames, n) array
        The last row is ``goal``.
    """
    rng = np.random.default_rng(9)
    lower, upper = arm.span
    reach = np.where(arm.prismatic, 0.4 * (upper - lower), 1.1)
    best, best_score = np.repeat(goal[None], frames, axis=0), -np.inf
    for joints in (tuple(moved), tuple(range(arm.n))):
        ways = np.zeros((60, arm.n))
        ways[:, joints] = rng.uniform(-1, 1, (60, len(joints)))
        ways[:, joints] /= np.abs(ways[:, joints]).max(axis=1, keepdims=True)
        begin = np.clip(goal + ways * reach, np.minimum(lower, goal), np.maximum(upper, goal))
        t = np.linspace(0, 1, 9)[:, None, None]
        Q = begin + t * (goal - begin)
        ratio = ratios(arm, Q.reshape(-1, arm.n)).reshape(9, len(ways))
        rises = np.maximum(np.diff(ratio, axis=0), 0).sum(axis=0)
        score = ratio[0] - 2 * rises
        k = int(np.argmax(score))
        if score[k] > best_score:
            ease = (1 - np.cos(np.linspace(0, np.pi, frames))) / 2
            best, best_score = begin[k] + ease[:, None] * (goal - begin[k]), float(score[k])
        if best_score > 0.02:
            break
    best[-1] = goal
    return np.asarray(best)


_APART = 0.12  # radians, about seven degrees


def telling_poses(
    arm: Arm, family: FamilyLike, count: int, others: Sequence[Family] = ()
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
