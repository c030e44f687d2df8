"""A configuration of a family that people can read and type: round numbers where they may be."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from pinsing._types import Array
from pinsing.families.family import Family
from pinsing.families.parts import Branch
from pinsing.families.zero_set import gradients, project
from pinsing.kinematics.batch import batch
from pinsing.kinematics.verdict import generic_rank
from pinsing.robot.arm import Arm

_STEPS = 100
"""Round values that the range of a joint has at least."""
_TRIES = 8
_SINGULAR = 1e-11
_ZERO = 1e-8


def readable(family: Family, branch: Branch, q: Array, arm: Arm, within_limits: bool) -> Array:
    """A configuration near q (n,), on the same branch, with round values where nothing hangs on it.

    Joints at fixed values stay there; of the joints in equations, as many as there are equations
    are solved for, and the others are round.

    Parameters
    ----------
    family : Family
        The family.
    branch : Branch
        The branch of it that q lies on.
    q : (n,) array
        Radians and metres.
    arm : Arm
        The nominal geometry.
    within_limits : bool
        Stay within the joint limits.

    Returns
    -------
    (n,) array
        As singular as q, and of the same rank; q itself if none was found.
    """
    start = _unwound(family, q, within_limits)
    rounded = np.round(start / _grid(family)) * _grid(family)
    # Zero is where other families are.
    rounded = np.where(rounded == 0, np.where(start < 0, -1, 1) * _grid(family), rounded)
    held = [v.joint for v in branch.values]
    rounded[held] = start[held]
    rounded = _decimal(rounded, family)
    rounded[held] = start[held]
    tries = iter([rounded]) if not branch.equations else _solved(branch, rounded)
    for found in tries:
        if not (within_limits and arm.space.unreachable(found).any()) and _alike(arm, found, q):
            return np.asarray(found)
    return q


def _unwound(family: Family, q: Array, within_limits: bool) -> Array:
    """Q (n,) without whole turns, where the limits have room for that."""
    turned = q - 2 * np.pi * np.round(q / (2 * np.pi))
    inside = (turned >= family.lower) & (turned <= family.upper) | (not within_limits)
    return np.where(~family.prismatic & inside, turned, q)


def _grid(family: Family) -> Array:
    """Step (n,) of round values: a power of ten."""
    lower, upper = family.box(within_limits=True)
    span = np.where(upper > lower, np.minimum(upper - lower, 2 * np.pi), 1.0)
    span = np.where(family.prismatic & (upper > lower), upper - lower, span)
    return np.asarray(10.0 ** np.floor(np.log10(span / _STEPS)))


def _decimal(values: Array, family: Family) -> Array:
    """The floats nearest to the decimals that are meant."""
    places = -np.log10(_grid(family)).round().astype(int)
    return np.array([round(float(v), int(k)) for v, k in zip(values, places, strict=True)])


def _solved(branch: Branch, start: Array) -> Iterator[Array]:
    """Points of a branch that differ from ``start`` in as few joints as it has equations."""
    joints = sorted({j for e in branch.equations for j in e.involved})
    count = min(len(branch.equations), len(joints))
    slope = np.abs(gradients(branch.equations, start[None])[0]).sum(axis=0)
    order = sorted(joints, key=lambda j: -slope[j])
    for chosen in itertools.islice(itertools.combinations(order, count), _TRIES):
        free = np.zeros(len(start), dtype=bool)
        free[list(chosen)] = True
        moved, ok = project(branch.equations, start[None], free)
        if ok[0]:
            yield np.where(free, moved[0], start)


def _alike(arm: Arm, found: Array, q: Array) -> bool:
    """Whether two configurations have the same rank, the first one to all digits."""
    sigma = batch(arm, threads=1).sigma(np.stack([found, q]))[:, : generic_rank(arm)]
    ratio = sigma / sigma[:, :1].clip(min=1e-300)
    zeros = ratio <= _ZERO
    return bool((zeros[0] == zeros[1]).all() and (ratio[0][zeros[0]] <= _SINGULAR).all())
