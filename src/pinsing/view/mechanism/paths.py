"""Motions to play: into a singular pose of a mechanism, and along the locus it lies on."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.mechanism.closure import CLOSED, Loops, gauss_newton
from pinsing.mechanism.singular_points import SingularPoint, refine_point
from pinsing.mechanism.trace import trace
from pinsing.robot.mechanism import Mechanism

FRAMES = 48
"""Configurations of a path."""

_FAR = 1.0
_STEP = 0.05
_SWING = 0.6
_JUMP = 0.35
_SHORTEST = 6
_REGULAR = 1e-3


def into(mechanism: Mechanism, point: SingularPoint, frames: int = FRAMES) -> Array:
    """Configurations (frames, n) from a regular pose to a singular one, one input moving.

    Of the two ways to come, the one that starts further from all singularities; (0, n) where
    no input leads out of the singularity.
    """
    first = _moving(mechanism, point)
    others = [k for k in range(len(mechanism.inputs)) if k != first]
    for moving in (first, *others):
        way = _way_out(mechanism, point.q, moving)
        if way is None:
            continue
        ease = (1 - np.cos(np.linspace(0, np.pi, frames))) / 2
        path = _between(mechanism, _unrolled(mechanism, way)[::-1], ease)
        path[-1] += mechanism.space.wrap(point.q - path[-1])
        return path
    return np.zeros((0, mechanism.n))


def along(mechanism: Mechanism, point: SingularPoint, frames: int = FRAMES) -> Array:
    """Singular configurations (frames, n), there and back on the locus of a pose.

    Another input swings; the one along which the pose was found is solved for. With one input
    only, or where the locus cannot be followed, there is none: (0, n).
    """
    moving = _moving(mechanism, point)
    held = [j for k, j in enumerate(mechanism.actuated) if k != moving]
    for joint in held if point.converged else ():
        path = [point.q]
        for sign in (1, -1):
            way = _followed(mechanism, point, joint, sign, held)
            if way:
                path += [*way, *way[-2::-1], point.q]
        if len(path) >= _SHORTEST:
            # Between them none would be singular exactly.
            rows = np.linspace(0, len(path) - 1, frames, endpoint=False).round().astype(int)
            return np.asarray(_unrolled(mechanism, np.array(path))[rows])
    return np.zeros((0, mechanism.n))


def _way_out(mechanism: Mechanism, q: Array, moving: int) -> Array | None:
    """Rows from q to the most regular configuration to one side; None if there is none."""
    curve = trace(mechanism, q, moving)
    measure = np.minimum(curve.input_ratio, curve.output_ratio)
    here = int(np.argmin(np.abs(mechanism.space.wrap(curve.q - q)).max(axis=1)))
    count = len(curve.q)
    if curve.closed:  # the last sample is the first again
        ways = [(here + step * np.arange(count - 1)) % (count - 1) for step in (1, -1)]
    else:
        ways = [np.arange(here, count), np.arange(here, -1, -1)]
    best, found = _REGULAR, None
    for way in ways:
        rows = _unrolled(mechanism, curve.q[way])
        end = _until(rows, measure[way])
        if measure[way[end]] > best:
            best, found = float(measure[way[end]]), rows[: end + 1]
    return found


def _moving(mechanism: Mechanism, point: SingularPoint) -> int:
    return mechanism.inputs.index(point.moving) if point.moving else 0


def _until(q: Array, measure: Array) -> int:
    """Sample to begin at: the most regular one before the measure falls again, not too far."""
    far = 0
    for k in range(1, len(q)):
        if measure[k] < 0.7 * measure[far] and measure[far] > 0.02:
            break
        if np.abs(q[k] - q[0]).max() > _FAR:
            break
        far = k if measure[k] > measure[far] or far == 0 else far
    return far


def _unrolled(mechanism: Mechanism, q: Array) -> Array:
    """Rows moved by whole turns so that each is beside the one before."""
    steps = mechanism.space.wrap(np.diff(q, axis=0))
    return np.concatenate([q[:1], q[0] + np.cumsum(steps, axis=0)])


def _between(mechanism: Mechanism, q: Array, place: Array) -> Array:
    """Configurations at shares ``place`` (N,) of the way along rows q, closed again."""
    loops, everything = Loops(mechanism), np.ones(mechanism.n, dtype=bool)
    out = []
    for row in _interpolated(q, place):
        closed, error = gauss_newton(loops, row, everything)
        if error <= CLOSED:
            out.append(closed)
    return np.array(out)


def _interpolated(q: Array, place: Array) -> Array:
    x = place * (len(q) - 1)
    k = np.minimum(x.astype(int), len(q) - 2)
    t = (x - k)[:, None]
    return np.asarray((1 - t) * q[k] + t * q[k + 1])


def _followed(
    mechanism: Mechanism, point: SingularPoint, joint: int, sign: int, held: list[int]
) -> list[Array]:
    """Poses on the locus as one input moves away to one side, as far as it goes."""
    out: list[Array] = []
    q = before = point.q
    for _ in range(round(_SWING / _STEP)):
        # As far on as the last step went; the first one moves the swinging joint alone.
        guess = q + mechanism.space.wrap(q - before)
        guess[joint] = q[joint] + sign * _STEP
        found = refine_point(mechanism, guess, point.kind, held)
        if not found.converged or np.abs(mechanism.space.wrap(found.q - q)).max() > _JUMP:
            break
        before, q = q, found.q
        out.append(q)
    return out
