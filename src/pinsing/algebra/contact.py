"""When a straight motion meets a condition, and whether it moves toward or away from it.

Along ``x + s u`` an equation is ``h(s) = f(x + s u)``. With ``|h''| <= M`` Taylor's theorem gives
``|h(s)| >= |h(0)| - c s - M s^2 / 2``, where c is how fast ``|h|`` falls: up to the root of the
right side there is no zero. From there again, and so on: the steps shrink as those of Newton's
method do, and each is proven. A branch is met where all its conditions hold at once, so that its
step is the longest of theirs.

What the compiled engine does in ``contact.cpp``, for installations without it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import sum_at

_WINDOW = 1.0
_STEPS = 64
_FARTHEST = 1e6
_ON = 1e-12
_RIDGE = 1e-9
_COMBINED = 12


class Contact(NamedTuple):
    """What a straight motion leads to.

    Attributes
    ----------
    time : float
        No condition is met sooner: proven; infinite for none within the horizon.
    rate : float
        How fast the first-order distance from a family grows.
    """

    time: float
    rate: float


def contact_along(c: Conditions, family: int, x: Array, velocity: Array, horizon: float) -> Contact:
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
    """
    speed = float(np.abs(velocity).max())
    if not speed > 0:
        return Contact(math.inf, 0.0)
    u = velocity / speed
    own = [_approach(c, b, x, u) for b in range(c.branches) if c.family[b] == family]
    rate = min(own, default=(0.0, 0.0))[1] * speed
    end = min(horizon * speed, _FARTHEST)
    work = max(2 * len(c.amplitude), 300)
    best, met = end, False
    for b in range(c.branches):
        s, at, steps = 0.0, x, 0
        while s < best:
            step, cost = _step(c, b, at, u)
            s, work = s + step, work - cost
            if step <= 1e-9 + 1e-7 * s or steps == _STEPS or work < 0:
                break
            at, steps = x + min(s, best) * u, steps + 1
        if s < best:
            best, met = s, True
    if met:
        return Contact(best * (1 - 1e-14) / speed, rate)
    return Contact(end / speed if end < horizon * speed else math.inf, rate)


def _step(c: Conditions, b: int, x: Array, u: Array) -> tuple[float, int]:
    """How far along u a branch is not met, and how many terms and values were computed for it."""
    step, cost = 0.0, 0
    for i in range(c.value_start[b], c.value_start[b + 1]):
        if math.isinf(step):
            break
        step, cost = max(step, _of_value(c, i, x, u)), cost + 1
    for e in range(c.equation_start[b], c.equation_start[b + 1]):
        if math.isinf(step):
            break
        step = max(step, _of_equation(c, e, x, u))
        cost += int(c.term_start[e + 1] - c.term_start[e])
    return step, cost


def _of_value(c: Conditions, i: int, x: Array, u: Array) -> float:
    j, value = int(c.value_joint[i]), float(c.value[i])
    turn, here, moves = float(c.turn[j]), float(x[j]), float(u[j])
    ahead = value - here
    slack = 1e-15 * (abs(here) + abs(value) + turn)
    off = ahead - turn * math.floor(ahead / turn + 0.5) if turn > 0 else ahead
    if abs(off) <= slack:
        return 0.0
    if moves == 0:
        return math.inf
    ahead = ahead if moves > 0 else -ahead
    if turn > 0:
        ahead -= turn * math.floor(ahead / turn)
    if ahead < 0:
        return math.inf
    return max(ahead - slack, 0.0) / abs(moves) * (1 - 1e-15)


def _of_equation(c: Conditions, e: int, x: Array, u: Array) -> float:
    at = sum_at(c, e, x[None])
    value, error = float(at.value[0]), float(at.error[0])
    left = max(abs(value) - error, 0.0)
    if not left > 0:
        return 0.0
    slope = float(at.gradient[0] @ u)
    length = float(np.abs(u).sum())
    falls = (-slope if value > 0 else slope) + float(at.slope_error[0]) * length
    bend = _bend(c, e, x, u)
    root = math.sqrt(falls * falls + 2 * bend * left)
    step = math.inf
    if falls > 0:
        step = 2 * left / (falls + root)
    elif bend > 0:
        step = (root - falls) / bend
    step *= 1 - 1e-12
    return min(step, _WINDOW) if c.sliding[e] else step


def _bend(c: Conditions, e: int, x: Array, u: Array) -> float:
    """Bound of the second derivative along u, up to the window where lengths occur."""
    total = 0.0
    for t in range(c.term_start[e], c.term_start[e + 1]):
        rates = slice(c.rate_start[t], c.rate_start[t + 1])
        turns = c.rate[rates] * u[c.rate_joint[rates]]
        swing = abs(float(turns.sum())) + 1e-14 * float(np.abs(turns).sum())
        powers = slice(c.power_start[t], c.power_start[t + 1])
        joints, p = c.power_joint[powers], c.power[powers]
        a = np.maximum(np.abs(x[joints]) + _WINDOW * np.abs(u[joints]), 1e-150)
        growth = float((p * np.abs(u[joints]) / a).sum())
        largest = abs(float(c.amplitude[t])) * float(np.prod(a**p))
        total += largest * (swing**2 + 2 * swing * growth + growth**2)
    return total * (1 + 1e-12)


def _approach(c: Conditions, b: int, x: Array, u: Array) -> tuple[float, float]:
    """First-order distance from a branch, and how it changes along u."""
    off, across = np.zeros(c.n), 0.0
    for i in range(c.value_start[b], c.value_start[b + 1]):
        j = int(c.value_joint[i])
        d, turn = float(x[j] - c.value[i]), float(c.turn[j])
        off[j] = math.remainder(d, turn) if turn > 0 else d
        across += float(u[j]) ** 2
    numbers = range(c.equation_start[b], c.equation_start[b + 1])[:_COMBINED]
    if numbers:
        sums = [sum_at(c, e, x[None]) for e in numbers]
        g = np.concatenate([s.gradient for s in sums])
        value = np.concatenate([s.value for s in sums])
        moves = g @ u
        gram = g @ g.T
        gram += (_RIDGE * np.trace(gram) + 1e-300) * np.eye(len(gram))
        off += g.T @ np.linalg.solve(gram, value)
        across += float(moves @ np.linalg.solve(gram, moves))
    distance = float(np.linalg.norm(off))
    if distance > _ON:
        return distance, float(off @ u) / distance
    return distance, math.sqrt(max(across, 0.0))
