"""Closed configurations of a mechanism at inputs or poses drawn at random, thousands at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.loops.batch import BatchLoops, newton
from pinsing.loops.closure import near_home, random_closed
from pinsing.loops.four_distances import cannot_close
from pinsing.loops.modes import home

TRIES = 4
_STEPS = 30
_CLOSED = 1e-9
_PILOT = 512
_PILOT_SEED = 64
_SPARE = 64
_FEW = 8


def draw_closed(
    loops: BatchLoops,
    actuated: list[int],
    over: str,
    count: int,
    rng: np.random.Generator,
    known: Array,
) -> tuple[Array, int]:
    """Closed configurations (M, n) of those drawn, in that order, and how many cannot close.

    Parameters
    ----------
    loops : BatchLoops
        Of the mechanism.
    actuated : list of int
        Joints that are drawn, over inputs.
    over : str
        ``inputs`` or ``poses``.
    count : int
        How many to draw.
    rng : numpy.random.Generator
        Of this chunk.
    known : (N, n) array
        From `known_closed`: starts near by, and the box and orientations of poses.
    """
    mechanism = loops.mechanism
    low, high = mechanism.space.span
    free = np.ones(mechanism.n, dtype=bool)
    target = None
    held = np.zeros((count, 0))
    left = np.arange(count)
    if over == "inputs":
        free[actuated] = False
        held = rng.uniform(low[actuated], high[actuated], (count, len(actuated)))
        # Of redundant actuators some follow from the others: nothing is proven by these alone.
        if tuple(actuated) == tuple(mechanism.actuated):
            left = np.flatnonzero(~cannot_close(mechanism, held))
    else:
        target = _poses(loops, count, rng, known)
    impossible = count - len(left)
    out = np.zeros((count, mechanism.n))
    kept = np.zeros(count, dtype=bool)
    for k in range(TRIES):
        # Drawn for all, so that a start does not depend on what others came to.
        drawn = rng.uniform(low, high, (count, mechanism.n)) if k > 1 else None
        if not len(left):
            break
        # From home first, so that most are in its mode; then from near by; then from anywhere.
        if drawn is not None:
            Q = drawn[left]
        elif k and len(known):
            Q = known[_nearest(loops, known, actuated, held[left], target, left)]
        else:
            Q = np.tile(home(mechanism), (len(left), 1))
        if over == "inputs":
            Q[:, actuated] = held[left]
        here = None if target is None else (target[0][left], target[1][left], mechanism.task.rows)
        Q, size = newton(loops, Q, free, target=here, steps=_STEPS)
        done = size <= _CLOSED
        Q = mechanism.space.fold(Q)
        # One beyond a limit is kept until it is found within it another way.
        out[left[done]], kept[left[done]] = Q[done], True
        done &= ~mechanism.space.unreachable(Q).any(axis=1)
        left = left[~done]
    return out[kept], impossible


def _nearest(
    loops: BatchLoops,
    known: Array,
    actuated: list[int],
    held: Array,
    target: tuple[Array, Array] | None,
    left: npt.NDArray[np.intp],
) -> npt.NDArray[np.intp]:
    """Which of the known configurations has the nearest inputs, or pose of the output."""
    if target is None:
        units = loops.units[actuated]
        have, want = known[:, actuated] / units, held / units
    else:
        R, p, _ = loops.output(known)
        scale = loops.mechanism.length_scale
        have = np.concatenate([p / scale, R.reshape(-1, 9)], axis=1)
        turned, moved = target[0][left].reshape(-1, 9), target[1][left]
        want = np.concatenate([moved / scale, turned], axis=1)
    away = (have**2).sum(axis=1) - 2 * want @ have.T
    return np.asarray(away.argmin(axis=1))


def known_closed(loops: BatchLoops) -> Array:
    """Closed configurations (N, n) from random starts; within the limits where enough are."""
    mechanism = loops.mechanism
    rng = np.random.default_rng(_PILOT_SEED)
    drawn = rng.uniform(*mechanism.space.span, (_PILOT, mechanism.n))
    drawn[0] = home(mechanism)
    Q, size = newton(loops, drawn, np.ones(mechanism.n, dtype=bool), steps=_STEPS)
    Q = mechanism.space.fold(Q[size <= _CLOSED])
    if not len(Q):
        # Starts within narrow limits lead nowhere; those that told the ranks did.
        spare = random_closed(mechanism, _SPARE, rng) + near_home(mechanism)
        Q = mechanism.space.fold(np.array(spare).reshape(-1, mechanism.n))
    inside = Q[~mechanism.space.unreachable(Q).any(axis=1)]
    return inside if len(inside) >= _FEW else Q


def _poses(
    loops: BatchLoops, count: int, rng: np.random.Generator, known: Array
) -> tuple[Array, Array]:
    """Rotations (count, 3, 3) and positions (count, 3) to reach."""
    R, p, _ = loops.output(known)
    chosen = rng.integers(len(known), size=count)
    return R[chosen], rng.uniform(p.min(axis=0), p.max(axis=0), (count, 3))
