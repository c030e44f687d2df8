"""How near a family is, and which points of its equations are its own: singular ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing.algebra.conditions import Branch, Conditions
from pinsing.algebra.nearest import SearchOptions, nearest_points
from pinsing.families.zero_set import SearchBox, Stop, project, thrown
from pinsing.kinematics.batch import own_scale
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.verdict import ratios
from pinsing.measures import NOISE, ROUNDING, Array, Bool
from pinsing.robot.arm import Arm
from pinsing.robot.joint_space import JointSpace
from pinsing.serialization import JsonResult

_STARTS = 200


@dataclass(frozen=True, eq=False)
class Distance(JsonResult):
    """How far a configuration is from a family.

    Attributes
    ----------
    value : float
        Euclidean in joint space: revolute differences wrapped, in radians; prismatic ones
        over the length scale. The same as ``upper``.
    q : (n,) array
        The nearest configuration of the family that was found; NaN without any.
    exact : bool
        True for joint-value families: ``lower`` and ``upper`` are equal.
    lower : float
        No configuration of the family is nearer: proven, rounding included. Infinite where
        none lies within the limits.
    upper : float
        How far ``q`` is.
    """

    schema: ClassVar[str] = "pinsing/distance/1"

    value: float
    q: Array
    exact: bool
    lower: float
    upper: float

    def __str__(self) -> str:
        if np.isinf(self.lower):
            return "infinite, none within the limits"
        if np.isinf(self.upper):
            return f"at least {self.lower:.6g}, no configuration found"
        kind = "exact" if self.exact else f"to {self.upper - self.lower:.0e}"
        at = ", ".join(f"{value:.4g}" for value in self.q)
        return f"{self.value:.6g} ({kind}), to q = {at}"


BLUNT = 1e-4
"""Radians, metres, or shares of an equation's coefficients: up to here a point that Newton's method
found is on a branch where it is a multiple root, of which half of the digits or less hold."""


@dataclass(frozen=True, eq=False)
class OwnPoints:
    """The singular ones among the points of equations."""

    arm: Arm  # the exact one
    # whether the equations are known to be zero at singular points only: they touch zero there,
    # which leaves their points half of the digits
    touching: bool = False

    def __call__(self, points: Array) -> Bool:
        """Return which of some points (N, n) are singular."""
        # sigma_r / sigma_1 of what is singular among the points of equations.
        return ratios(self.arm, points) <= 1e-6

    def drawn(self, count: int, box: SearchBox, rng: np.random.Generator) -> Array:
        """Singular points (k, n) of a box that random starts in it lead to; see ``OwnPoints``."""
        # Steps from random starts.
        q = _newton(self.arm, box.drawn(count, rng), box.free, 30, (box.lower, box.upper))
        q = q[np.isfinite(q).all(axis=-1)]
        return q[ratios(self.arm, q) <= NOISE] if len(q) else q

    def sharpened(self, points: Array, free: Bool) -> Array:
        """Return points (N, n) made singular to all digits along ``free`` joints, if possible."""
        before = ratios(self.arm, points)
        blunt = np.flatnonzero(before > NOISE)
        if not len(blunt):
            return points
        moved = _newton(self.arm, points[blunt], free)
        near = np.isfinite(moved).all(axis=-1)
        # Radians or metres: what is this far away is another point.
        near &= np.abs(np.where(np.isfinite(moved), moved, 0.0) - points[blunt]).max(axis=-1) < 1e-3
        moved = np.where(near[:, None], moved, points[blunt])
        better = ratios(self.arm, moved) < before[blunt]
        sharp = points.copy()
        sharp[blunt[better]] = moved[better]
        return sharp


def _newton(
    arm: Arm, q: Array, free: Bool, steps: int = 8, box: tuple[Array, Array] | None = None
) -> Array:
    """Solve J(q)^T u = 0 and u.u = 1 for q (N, n) and the lost direction u, near a solution."""
    # From elsewhere many starts end nowhere. Minimum-norm steps, sliders in the arm's own length as
    # in H: the solutions are a set of some dimension.
    J, H = own_jacobians_and_derivatives(arm, q)
    u = np.linalg.svd(J)[0][..., -1]
    n, columns = q.shape[-1], own_scale(arm).columns
    for _ in range(steps):
        residual = np.concatenate(
            [np.einsum("kr,krj->kj", u, J), (u * u).sum(axis=-1, keepdims=True) - 1], axis=-1
        )
        A = np.zeros((len(q), n + 1, n + u.shape[-1]))
        A[:, :n, :n] = np.einsum("kr,krij->kij", u, H) * free
        A[:, :n, n:] = np.swapaxes(J, -1, -2)
        A[:, n, n:] = 2 * u
        # Singular values of Newton's matrix that count, relative to the largest.
        step = -np.einsum("kij,kj->ki", np.linalg.pinv(A, rcond=1e-10), residual)
        long = np.linalg.norm(step[:, :n], axis=-1, keepdims=True)
        # Radians or metres of a step.
        step *= np.minimum(1.0, 1.0 / np.maximum(long, 1e-300))
        q = q + np.where(free, step[:, :n] * columns, 0.0)
        q = q if box is None else np.clip(q, *box)  # sliders would go on without end
        u = u + step[:, n:]
        J, H = own_jacobians_and_derivatives(arm, q)
    return q


def near(
    branches: Sequence[Branch],
    space: JointSpace,
    q: Array,
    tol: float,
    confirm: OwnPoints | None = None,
) -> Bool:
    """Return which of q (N, n) have a point of some branch within ``tol``, limits aside."""
    found = np.zeros(len(q), dtype=bool)
    for branch in branches:
        todo = np.flatnonzero(~found)
        close = todo[np.linalg.norm(branch.off(q[todo], space), axis=-1) <= tol]
        if not branch.equations:
            found[close] = True
            continue
        free = branch.free(space.n)
        moved, ok = project(branch.equations, branch.put(q[close], space), free)
        gap = np.hypot(
            np.linalg.norm((moved - q[close]) / space.metric * free, axis=-1),
            np.linalg.norm(branch.off(q[close], space), axis=-1),
        )
        good = ok & (gap <= tol)
        if confirm is not None and good.any():
            good[good] = confirm(moved[good])
        found[close] |= good
    return found


def nearest(
    conditions: Conditions,
    q: Array,
    limits: tuple[Array, Array],
    options: SearchOptions,
    exact: bool,
) -> Distance | None:
    """Return the distance from q (n,) to where conditions hold; None without a known real point."""
    # ``exact``: what was found is the nearest, as among joint values.
    found = nearest_points(conditions, q[None], *limits, options)
    lower, upper, point = float(found.lower[0]), float(found.upper[0]), found.q[0]
    if found.family[0] < 0:
        if not options.within_limits:
            return None
        point = np.full(len(q), np.nan)
    return Distance(upper, point, exact, upper if exact else lower, upper)


def own_nearest(
    found: Distance, branches: Sequence[Branch], space: JointSpace, q: Array, confirm: OwnPoints
) -> Distance:
    """Return the distance to a confirmed point; its lower bound holds, as families are subsets."""
    if not np.isfinite(found.q).all() or confirm(found.q[None])[0]:
        return found
    rng = np.random.default_rng(3)
    step = space.metric * max(found.upper, 1e-3)
    starts = q + rng.normal(size=(_STARTS, len(q))) * step * rng.uniform(0.1, 3.0, (_STARTS, 1))
    best, least = found.q, np.inf
    for branch in branches:
        moved, ok = project(branch.equations, branch.put(starts, space), branch.free(space.n))
        moved = moved[ok]
        moved = moved[confirm(moved)] if len(moved) else moved
        away = moved - q
        away -= np.where(space.prismatic, 0.0, 2 * np.pi * np.round(away / (2 * np.pi)))
        size = np.linalg.norm(away / space.metric, axis=-1)
        if len(size) and size.min() < least:
            least, best = float(size.min()), q + away[int(size.argmin())]
    if not np.isfinite(least):
        best = np.full(len(q), np.nan)
    return Distance(least, best, False, found.lower, least)


_FEWEST, _MOST = 40, 400
"""Starts at once: where the time is over, and where it is not."""


def own_drawn(
    held: Sequence[tuple[Branch, SearchBox]],
    space: JointSpace,
    within: bool,
    confirm: OwnPoints,
    n: int,
    rng: np.random.Generator,
    stop: Stop | None,
) -> Array:
    """Return up to n own points (k, n) from random starts, about as many a branch.

    By rank, then by equations; ``within``: points outside of the boxes do not count.
    """
    found = [np.zeros((0, space.n))]
    for i, (branch, box) in enumerate(held):
        if i and stop is not None and stop():
            break
        missing = -(-n // len(held))
        # Times that so many are tried.
        for _ in range(4):
            late = stop is not None and stop()  # then a first look is taken all the same
            count = 12 if late else min(max(_FEWEST, 4 * missing), _MOST)
            q = space.fold(confirm.drawn(count, box, rng))
            q = q[box.inside(q)]
            q = q[near((branch,), space, q, ROUNDING)] if len(q) else q
            found.append(q[:missing])
            missing -= len(found[-1])
            if missing == 0 or not len(q) or (stop is not None and stop()):
                break
        if missing:
            count = min(max(_FEWEST, 4 * missing), _MOST)
            q = thrown(branch.equations, box, count, rng, stop)
            q = q[confirm(q)] if len(q) else q
            q = space.fold(q) if within else q
            found.append((q[box.inside(q)] if within else q)[:missing])
    return np.concatenate(found)[:n]
