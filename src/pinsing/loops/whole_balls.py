"""Balls that are written as three hinges, where these lie in a plane: a gimbal lock of the file.

The ball itself turns in every direction there, but three hinges in a plane do not, and turn idly
against each other: a measure that goes to zero for this says nothing of the mechanism. Beside a
lock the three columns of a ball are replaced by those of turns about the axes of the base through
its centre. They span the same turns wherever the hinges are independent, so no rank changes there.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from pinsing._types import Array, Bool
from pinsing.loops.batch import BatchLoops, Placed
from pinsing.loops.structure import Centre, structure
from pinsing.robot.mechanism import Mechanism

BESIDE = 0.1
"""A lock is near where the volume that the three axes span is at most this, of at most 1."""

_HINGES = 3
_FLAT = 1e-6


def locked(mechanism: Mechanism, Q: Array) -> Bool:
    """Whether a ball is locked, or nearly: (N,) bool at Q (N, n)."""
    out = np.zeros(len(Q), dtype=bool)
    for ball in _balls(mechanism):
        out |= np.abs(_volume(mechanism, ball, Q[:, ball[1]])) <= BESIDE
    return out


def ball_jacobians(loops: BatchLoops, Q: Array) -> tuple[Array, Array]:
    """Constraint Jacobian (N, k, n) and task rows of the output (N, m, n), balls taken whole.

    Columns of the three hinges of a ball are of its angular velocity, base axes; lengths are over
    the length scale.
    """
    mechanism = loops.mechanism
    placed = loops.place(Q)
    axis, pivot = placed.axis.copy(), placed.position.copy()
    for ball, at in zip(_balls(mechanism), _centres(placed, hinged_balls(mechanism)), strict=True):
        for joint, along in zip(ball, np.eye(_HINGES), strict=True):
            axis[joint], pivot[joint + 1] = along, at
    whole = replace(placed, axis=axis, pivot=pivot)
    G = loops.closure(Q, placed=whole)[1]
    J = loops.output(Q, whole)[2][:, list(mechanism.task.rows)]
    return G, J


def hinge_rates(loops: BatchLoops, q: Array, basis: Array) -> Array:
    """Joint velocities (n, d) of motions (n, d) in which balls are whole, q (n,).

    Three hinges in a plane show of a turn what they can: its part in that plane.
    """
    out = basis.copy()
    axis = loops.place(q[None]).axis[:, 0]
    for ball in _balls(loops.mechanism):
        rows = list(ball)
        out[rows] = np.linalg.pinv(axis[rows].T, rcond=_FLAT) @ basis[rows]
    return out


def hinged_balls(mechanism: Mechanism) -> tuple[Centre, ...]:
    """Balls of three hinges that carry nothing between them, with their centres."""
    return mechanism.once("whole_balls", lambda: _find(mechanism))


def _balls(mechanism: Mechanism) -> list[tuple[int, ...]]:
    return [ball.joints for ball in hinged_balls(mechanism)]


def _find(mechanism: Mechanism) -> tuple[Centre, ...]:
    model = mechanism.model
    frames = {f.name: int(f.parentJoint) - 1 for f in model.frames}
    held = {frames[name] for x in mechanism.loops for name in (x.frame_a, x.frame_b)}
    held.add(frames[mechanism.output])
    out = []
    for centre in structure(mechanism).centres:
        ball = centre.joints
        if len(ball) != _HINGES or mechanism.prismatic[list(ball)].any():
            continue
        carried = {j for j in range(mechanism.n) if int(model.parents[j + 1]) - 1 in ball[:2]}
        in_line = all(int(model.parents[b + 1]) - 1 == a for a, b in itertools.pairwise(ball))
        if in_line and not held & set(ball[:2]) and carried == set(ball[1:]):
            out.append(centre)
    return tuple(out)


def _centres(placed: Placed, balls: tuple[Centre, ...]) -> list[Array]:
    """Centres (N, 3) of the balls."""
    firsts = [ball.joints[0] + 1 for ball in balls]
    return [
        placed.position[first] + placed.rotation[first] @ ball.point
        for first, ball in zip(firsts, balls, strict=True)
    ]


def _volume(mechanism: Mechanism, ball: tuple[int, ...], middle: Array) -> Array:
    """Triple product (N,) of the three axes, which depends on the angle (N,) of the middle one."""
    model, own = mechanism.model, structure(mechanism).axes
    a, b, c = ball
    # In the frame of the middle hinge, before it turns.
    first = np.array(model.jointPlacements[b + 1].rotation).T @ own[a]
    axis = own[b]
    last = np.array(model.jointPlacements[c + 1].rotation) @ own[c]
    flat = last - (last @ axis) * axis
    turned = np.cos(middle)[:, None] * flat + np.sin(middle)[:, None] * np.cross(axis, flat)
    return np.asarray(np.cross(axis, turned) @ first)
