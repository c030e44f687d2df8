"""The point of a zero set that is nearest to a configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.families.zero_set import System, project, residuals

_LOOK = 8
"""Steps along the set that every start takes before the closest ones are chosen."""
_FOLLOWED = 24
"""Starts that are gone on with."""
_APART = 0.05
_SHORTEST = 1e-4


def nearest(
    equations: Sequence[Equation],
    q: Array,
    starts: Array,
    free: npt.NDArray[np.bool_],
    weight: Array,
) -> tuple[Array, float] | None:
    """Point of the zero set nearest to q (n,), the best from several ``starts`` (N, n).

    Each start is put on the set and slides along it a little; the closest ones go on as long
    as that brings them closer, and are polished by Newton's method. No point that was seen is
    closer than the one that is returned; that none is at all is not proven.

    Returns
    -------
    (point, distance) or None
        None if no start led to the set.
    """

    def distance(x: Array) -> Array:
        return np.asarray(np.linalg.norm((x - q) * weight * free, axis=-1))

    rough, _ = project(equations, starts, free, iterations=12)
    rough = rough[np.abs(residuals(equations, rough)).max(axis=-1) < 1e-3]
    # A short way along the set says more about where a start will end than where it begins.
    rough = _slide(equations, q, rough, free, weight, iterations=_LOOK)
    chosen: list[Array] = []
    for x in rough[np.argsort(distance(rough))]:
        if all(np.abs(x - other).max() > _APART for other in chosen):
            chosen.append(x)
            if len(chosen) == _FOLLOWED:
                break
    if not chosen:
        return None
    on_set, ok = project(equations, np.array(chosen), free)
    if not ok.any():
        return None
    slid = _slide(equations, q, on_set[ok], free, weight)
    polished, ok = project(equations, _newton(equations, q, slid, free, weight), free)
    found = np.concatenate([slid, polished[ok]])
    length = distance(found)
    best = int(np.argmin(length))
    return found[best], float(length[best])


def _slide(
    equations: Sequence[Equation],
    q: Array,
    start: Array,
    free: npt.NDArray[np.bool_],
    weight: Array,
    iterations: int = 40,
) -> Array:
    """Move points of the set (N, n) along it towards q, each step one that brings them closer."""
    x = start.copy()
    system = System(equations)
    scale = np.where(free, 1.0 / weight, 0.0)
    gap = np.linalg.norm((x - q) * weight * free, axis=-1)
    length = np.ones(len(x))
    moving = np.arange(len(x))
    for _ in range(iterations):
        here = x[moving]
        A = system.gradients(here) * scale
        pinv = np.linalg.pinv(A, rcond=1e-7)
        delta = (here - q) * weight * free
        pull = _tangential(A, pinv, delta)
        going = np.linalg.norm(pull, axis=-1) > 1e-9 * np.maximum(1.0, gap[moving])
        going &= length[moving] > _SHORTEST
        moving, here, pull = moving[going], here[going], pull[going]
        if not len(moving):
            break
        trial, ok = project(
            equations, here + length[moving, None] * pull * scale, free, iterations=10
        )
        trial_gap = np.linalg.norm((trial - q) * weight * free, axis=-1)
        closer = ok & (trial_gap < gap[moving])
        x[moving[closer]], gap[moving[closer]] = trial[closer], trial_gap[closer]
        length[moving] *= np.where(closer, 1.5, 1 / 3)
        length[moving] = np.minimum(length[moving], 1.0)
    return x


def _newton(
    equations: Sequence[Equation],
    q: Array,
    starts: Array,
    free: npt.NDArray[np.bool_],
    weight: Array,
    iterations: int = 80,
) -> Array:
    """Stationary points of the distance near ``starts`` (N, n).

    Newton's method on the constraint, with the tangential pull back towards q: the
    iteration x <- q + A^+ (A (x - q) - f) in weighted coordinates. Where the set bends away
    from q the pull overshoots: it is relaxed as long as it changes its direction.
    """
    x = starts.copy()
    system = System(equations)
    scale = np.where(free, 1.0 / weight, 0.0)
    moving = np.arange(len(x))
    relax, before = np.ones(len(x)), np.zeros_like(x)
    for _ in range(iterations):
        here = x[moving]
        f = system.values(here)
        A = system.gradients(here) * scale
        pinv = np.linalg.pinv(A, rcond=1e-9)
        delta = (here - q) * weight * free
        pull = _tangential(A, pinv, delta)
        turned = (pull * before[moving]).sum(axis=-1) < 0
        relax[moving] = np.where(turned, relax[moving] / 2, np.minimum(1.0, relax[moving] * 1.1))
        before[moving] = pull
        step = relax[moving, None] * pull - np.einsum("nij,nj->ni", pinv, f)
        size = np.linalg.norm(step, axis=-1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))
        x[moving] += step * scale
        moving = moving[size[:, 0] >= 1e-13]
        if not len(moving):
            break
    return x


def _tangential(A: Array, pinv: npt.NDArray[np.floating[Any]], delta: Array) -> Array:
    """What of -delta (N, n) lies along the set, whose slopes (N, k, n) are A: (N, n)."""
    return np.asarray(np.einsum("nij,nj->ni", pinv, np.einsum("nij,nj->ni", A, delta)) - delta)
