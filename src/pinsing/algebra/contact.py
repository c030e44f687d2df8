"""When a straight motion meets a condition, and whether it moves toward or away from it.

Along ``x + s u`` an equation is ``h(s) = f(x + s u)``. With ``|h''| <= M`` Taylor's theorem gives
``|h(s)| >= |h(0)| - c s - M s^2 / 2``, where c is how fast ``|h|`` falls: up to the root of the
right side there is no zero. From there again, and so on: the steps shrink as those of Newton's
method do, and each is proven. A branch is met where all its conditions hold at once, so that its
step is the longest of theirs.

The plain reference of ``contact.cpp``, for installations without the compiled engine.
"""

from __future__ import annotations

import math

import numpy as np

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions, WeightedBranch
from pinsing.algebra.trig_sum import COMBINED, TrigSum

_WINDOW = 1.0
"""How far ahead second derivatives are bounded where lengths occur."""


def contact_along(
    c: Conditions, family: int, x: Array, velocity: Array, horizon: float
) -> tuple[float, float]:
    """Contact of ``x + t velocity`` with any condition, and the rate for one family.

    Parameters
    ----------
    c : Conditions
        The conditions.
    family : int
        Whose distance the rate is of; -1 for none.
    x, velocity : (n,) arrays
        Weighted coordinates, and per second.
    horizon : float
        Seconds that are looked ahead.

    Returns
    -------
    time : float
        No condition is met sooner: proven; infinite for none within the horizon.
    rate : float
        How fast the first-order distance from the family grows.
    """
    speed = float(np.abs(velocity).max())
    if not speed > 0:
        return math.inf, 0.0
    u = velocity / speed
    own = [_approach(c, b, x, u) for b in c.branches if b.family == family]
    rate = min(own, default=(0.0, 0.0))[1] * speed
    end = min(horizon * speed, 1e6)
    work = max(2 * sum(len(s.amplitude) for s in c.sums), 300)
    best, met = end, False
    for branch in c.branches:
        s, at, steps = 0.0, x, 0
        while s < best:
            step = _step(c, branch, at, u)
            s, work = s + step, work - len(branch.joints)
            work -= sum(len(f.amplitude) for f in branch.sums)
            if step <= 1e-9 + 1e-7 * s or steps == 64 or work < 0:
                break
            at, steps = x + min(s, best) * u, steps + 1
        if s < best:
            best, met = s, True
    if met:
        return best * (1 - 1e-14) / speed, rate
    return end / speed if end < horizon * speed else math.inf, rate


def _step(c: Conditions, branch: WeightedBranch, x: Array, u: Array) -> float:
    """How far along u a branch is not met."""
    values = zip(branch.joints, branch.values, c.turn[branch.joints], strict=True)
    steps = [_of_value(*map(float, (v, x[j], u[j], turn))) for j, v, turn in values]
    return max([*steps, *(_of_sum(s, x, u) for s in branch.sums)])


def _of_value(value: float, here: float, moves: float, turn: float) -> float:
    ahead = value - here
    slack = 1e-15 * (abs(here) + abs(value) + turn)
    off = ahead - turn * math.floor(ahead / turn + 0.5) if turn > 0 else ahead
    if abs(off) <= slack:
        return 0.0
    ahead = ahead if moves > 0 else -ahead
    if turn > 0:
        ahead -= turn * math.floor(ahead / turn)
    if moves == 0 or ahead < 0:
        return math.inf
    return max(ahead - slack, 0.0) / abs(moves) * (1 - 1e-15)


def _of_sum(s: TrigSum, x: Array, u: Array) -> float:
    value, gradient, error, slope_error = (a[0] for a in s.at(x[None]))
    left = float(max(abs(value) - error, 0.0))
    if not left > 0:
        return 0.0
    slope = float(gradient @ u)
    falls = float(-slope if value > 0 else slope) + float(slope_error * np.abs(u).sum())
    swing = np.abs(s.rate @ u) + 1e-14 * (np.abs(s.rate) @ np.abs(u))
    most = np.abs(x) + _WINDOW * np.abs(u)
    bend = float(s.bend(most[None], swing, np.abs(u)[None])[0])
    root = math.sqrt(falls * falls + 2 * bend * left)
    step = math.inf
    if falls > 0:
        step = 2 * left / (falls + root)
    elif bend > 0:
        step = (root - falls) / bend
    step *= 1 - 1e-12
    return min(step, _WINDOW) if len(s.slides) else step


def _approach(c: Conditions, branch: WeightedBranch, x: Array, u: Array) -> tuple[float, float]:
    """First-order distance from a branch, and how it changes along u."""
    off, across = np.zeros(c.n), 0.0
    for j, value in zip(branch.joints, branch.values, strict=True):
        d, turn = float(x[j] - value), float(c.turn[j])
        off[j] = math.remainder(d, turn) if turn > 0 else d
        across += float(u[j]) ** 2
    if branch.sums:
        at = [s.at(x[None]) for s in branch.sums[:COMBINED]]
        g, value = np.concatenate([a.gradient for a in at]), np.concatenate([a.value for a in at])
        gram, moves = g @ g.T, g @ u
        gram += (1e-9 * np.trace(gram) + 1e-300) * np.eye(len(gram))
        off += g.T @ np.linalg.solve(gram, value)
        across += float(moves @ np.linalg.solve(gram, moves))
    distance = float(np.linalg.norm(off))
    if distance > 1e-12:
        return distance, float(off @ u) / distance
    return distance, math.sqrt(max(across, 0.0))
