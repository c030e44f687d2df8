"""Real singular points from random starts, held against what slices over finite fields led to.

A component whose joint values are roots of an equation has points over the fields only that have
these roots; over the real numbers random starts meet it where it has real points at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Value
from pinsing.families.pieces import PieceMaker
from pinsing.families.zero_set import residuals
from pinsing.kinematics.batch import own_scale
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives
from pinsing.kinematics.verdict import ratios
from pinsing.measures import NOISE
from pinsing.robot.arm import Arm


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

    def drawn(self, starts: Array, free: Bool, box: tuple[Array, Array]) -> Array:
        """Singular points (k, n) of a box that starts (N, n) in it lead to; see ``Confirm``."""
        if not len(starts):
            return starts
        # Steps from random starts.
        q = _newton(self.arm, starts, free, 30, box)
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


BLUNT = 1e-4
"""Radians, metres, or shares of an equation's coefficients: up to here a point that Newton's method
found is on a branch where it is a multiple root, of which half of the digits or less hold."""


def real_points(maker: PieceMaker, own: OwnPoints, time: Budget) -> Array:
    """Return singular configurations (k, n) that random starts over whole circles lead to."""
    rng = np.random.default_rng(37)
    box = maker.lower, maker.upper
    n = len(maker.symbols)
    found = []
    # Random starts at once, and how often.
    for _ in range(4):
        # Random starts at once, and how often.
        starts = rng.uniform(*box, (100, n))
        found.append(own.drawn(starts, np.ones(n, dtype=bool), box))
        # Work of a batch of starts, in products of terms.
        if time.stop(1e6):
            break
    return np.concatenate(found)


def on_none(maker: PieceMaker, points: Array, components: Sequence[Component]) -> Bool:
    """Return which singular configurations (N, n) are clearly on no component."""
    left = np.ones(len(points), dtype=bool)
    for c in components:
        q = points[left]
        if not len(q):
            break
        branch = maker.branch_of(c.values, c.relations)
        off = np.zeros(len(q))
        for v in branch.values:
            off = np.maximum(off, maker.away(q, v))
        if branch.equations:
            off = np.maximum(off, np.abs(residuals(branch.equations, q)).max(axis=-1))
        left[left] = off > BLUNT
    return left


@dataclass(frozen=True, eq=False)
class RandomSingular:
    """Singular configurations that random starts led to."""

    maker: PieceMaker  # of the chain
    q: Array  # (k, n): the configurations

    def missed(self, components: Sequence[Component]) -> Array:
        """Those (m, n) that are clearly on none of some components."""
        return self.q[on_none(self.maker, self.q, components)]

    def on(self, component: Component) -> Bool:
        """Return which of them are on a component, as near as rounding tells: (k,)."""
        return ~on_none(self.maker, self.q, [component])

    def at(self, q: Array, joint: int, value: Value) -> Bool:
        """Return which of some configurations (m, n) have a joint at a value."""
        held = self.maker.branch_of({joint: value}, ()).values[0]
        return np.asarray(self.maker.away(q, held) < BLUNT)


def gap(points: Array, missed: Bool, prismatic: Bool) -> list[str]:
    """Return what missed points say, with one of them; nothing where none was missed."""
    if not missed.any():
        return []
    q = points[int(np.argmax(missed))]
    turned = np.remainder(q + np.pi, 2 * np.pi) - np.pi
    shown = ", ".join(f"{x:.4g}" for x in np.where(prismatic, q, turned))
    return [
        f"{int(missed.sum())} of {len(points)} singular configurations that random starts led to "
        f"lie on no family, such as q = {shown}: something is missing"
    ]
