"""Inputs at which the loops cannot close, by distances: a proof where Newton only finds nothing.

Two legs that pass forces along C B and C' B' make a quadrilateral C B B' C'. Whatever the pose of
the output, B B' is a length @ C B and C' B' are the lengths
of the rods: where one of the four is longer than the three others together, nothing closes.
"""

from __future__ import annotations

import itertools

import numpy as np

from pinsing._types import Array, Bool
from pinsing.loops.rod import Rod, Rods
from pinsing.loops.rods import rods
from pinsing.loops.three_distances import rod_length
from pinsing.robot.mechanism import Mechanism

# What is too long by less than this, over the longest, may be rounding.
_SURE = 1e-9


def cannot_close(mechanism: Mechanism, inputs: Array) -> Bool:
    """Which inputs (N, n_a) leave the loops open, by the inequality of four distances: (N,) bool.

    Proven where it is true, but for the rounding of lengths, of which 1e-9 is left to spare; where
    it is false the loops may close or not. Nothing is known of mechanisms whose legs are no `rods`.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    inputs : (N, n_a) array
        Values of the actuated joints, in their order, radians and metres.
    """
    out = np.zeros(len(inputs), dtype=bool)
    found = rods(mechanism)
    if found is None:
        return out
    column = {j: k for k, j in enumerate(mechanism.actuated)}
    # Driven at the foot or at the elbow C B has another length, that is not among the inputs.
    plain = [r for r in found.rods if not r.side and not r.bends]
    ends = [_inner(mechanism, r, inputs[:, column[r.joint]]) for r in plain]
    lengths = [_length(mechanism, r, inputs[:, column[r.joint]]) for r in plain]
    for a, b in itertools.combinations(range(len(plain)), 2):
        sides = np.stack(
            [
                _norm(found, ends[a] - ends[b]),
                np.full(len(inputs), _norm(found, plain[a].outer - plain[b].outer)),
                lengths[a],
                lengths[b],
            ]
        )
        longest = sides.max(axis=0)
        out |= 2 * longest - sides.sum(axis=0) > _SURE * longest
    return out


def _inner(mechanism: Mechanism, rod: Rod, values: Array) -> Array:
    """C (N, 3) at values (N,) of the rod's joint."""
    slides = mechanism.prismatic[rod.joint]
    c, s = (values, np.zeros_like(values)) if slides else (np.cos(values), np.sin(values))
    return np.asarray(rod.inner + c[:, None] * rod.first + s[:, None] * rod.second)


def _length(mechanism: Mechanism, rod: Rod, values: Array) -> Array:
    """Lengths (N,) of C B; a value of a slide below zero is a length the other way."""
    if rod.slides:
        return np.abs(values + rod.offset)
    return np.full(len(values), rod_length(mechanism, rod))


def _norm(found: Rods, away: Array) -> Array:
    """Distances, in the plane those that are level."""
    return np.asarray(np.linalg.norm(away[..., :2] if found.planar else away, axis=-1))
