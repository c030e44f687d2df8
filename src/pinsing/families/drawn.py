"""Points of families in closed form: all joints drawn but as many as there are equations.

A joint that enters an equation once is found from the others: with f = A cos q + B sin q + C,
q = atan2(B, A) +- arccos(-C / sqrt(A^2 + B^2)). Where several equations hold, each is solved for a
joint that none of those solved before it has, so that these still hold.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.algebra.equation import Equation

_EDGE = 1e-9
"""Radians or metres; a value this far beyond the box is within."""
_MOST = 3
"""Equations at once, of which all orders are tried."""


@dataclass(frozen=True, eq=False)
class Step:
    """One equation solved for one joint: kind "once", "half" or "length", as in `joint_form`."""

    equation: Equation
    joint: int
    kind: str


Order = tuple[Step, ...]


def orders(equations: Sequence[Equation], free: npt.NDArray[np.bool_]) -> list[Order]:
    """Ways to solve equations one after the other, each for a free joint of its own; or none.

    Parameters
    ----------
    equations : sequence of Equation
        What is to hold.
    free : (n,) array of bool
        Joints that may be solved for.
    """
    if len(equations) > _MOST:
        return _many(equations, free)
    if not equations:
        return []
    solvable = {
        id(e): [(j, k) for j in e.involved if free[j] and (k := _kind(e, j))] for e in equations
    }
    if not all(solvable.values()):
        return []
    found: list[Order] = []
    for ordered in itertools.permutations(equations):
        for joints in itertools.product(*(solvable[id(e)] for e in ordered)):
            steps = tuple(Step(e, j, k) for e, (j, k) in zip(ordered, joints, strict=True))
            if all(
                later.joint not in earlier.equation.involved
                for i, later in enumerate(steps)
                for earlier in steps[:i]
            ):
                found.append(steps)
    # Different joints first: what one of them seldom has a value for another one may.
    found.sort(key=lambda steps: sum(s.kind == "once" for s in steps))
    # Ways to solve that are made use of.
    return found[:3]


def _many(equations: Sequence[Equation], free: npt.NDArray[np.bool_]) -> list[Order]:
    """Ways for many equations: as many of the simplest as can be solved one after the other."""
    ordered = sorted(equations, key=lambda e: (len(e.involved), len(e.cos)))
    for count in range(len(ordered), 1, -1):
        some = ordered[:count]
        ways = [peeled(some, free, prefer) for prefer in (1, -1, 0)]
        if found := [way for way in ways if way]:
            return list(dict.fromkeys(found))
    return []


def peeled(
    equations: Sequence[Equation], free: npt.NDArray[np.bool_], prefer: int = 0
) -> Order | None:
    """An order to solve many equations in, from the back: a joint that only one has comes last.

    Parameters
    ----------
    equations : sequence of Equation
        What is to hold.
    free : (n,) array of bool
        Joints that may be solved for.
    prefer : int
        1: joints near the base are solved for last; -1: those near the tip; 0: by turns.
    """
    left = list(equations)
    steps: list[Step] = []
    while left:
        count = np.zeros(len(free), dtype=int)
        for e in left:
            count[list(e.involved)] += 1
        options = [
            (j, e, kind)
            for e in left
            for j in e.involved
            if free[j] and count[j] == 1 and (kind := _kind(e, j))
        ]
        if not options:
            return None
        options.sort(key=lambda option: option[0])
        first = prefer > 0 or (prefer == 0 and len(steps) % 2 == 0)
        j, e, kind = options[0 if first else -1]
        steps.append(Step(e, j, kind))
        left = [other for other in left if other is not e]
    return tuple(reversed(steps))


def draw(
    order: Order,
    lower: Array,
    upper: Array,
    free: npt.NDArray[np.bool_],
    fixed: Array,
    count: int,
    rng: np.random.Generator,
) -> Array:
    """Points (k, n) in a box on which the equations of an order hold, of ``count`` tried.

    Parameters
    ----------
    order : tuple of Step
        One of ``orders``.
    lower, upper : (n,) arrays
        The box.
    free : (n,) array of bool
        Joints that are drawn or solved for; the others stay at ``fixed``.
    fixed : (n,) array
        Radians and metres.
    count : int
        How many are tried; of long orders more.
    rng : np.random.Generator
        Where they are drawn from.
    """
    many = len(order) > _MOST
    if many:
        # Of a long order more are tried, by so much for each step more.
        count = max(count, min(2_000, int(count * 1.5 ** (len(order) - _MOST))))
    q = np.where(free, rng.uniform(lower, upper, (count, len(lower))), fixed)
    open_ = free.copy()
    for step in order:
        if many and 0 < len(q) < count:
            # What solved all so far goes on several times, with other values of what is not used.
            q = q[rng.integers(len(q), size=count)]
            q = np.where(open_, rng.uniform(lower, upper, q.shape), q)
        value, known = _solved(step, q, rng)
        if step.kind != "length":
            value, inside = _copy(value, lower[step.joint], upper[step.joint], rng)
        else:
            inside = (value >= lower[step.joint] - _EDGE) & (value <= upper[step.joint] + _EDGE)
        q[:, step.joint] = value
        q = q[known & inside]
        open_[list(step.equation.involved)] = False
    if many:  # those that went on with nothing else to draw may have come to the same end
        # Of points that are the same, radians or metres.
        first = np.unique(q[:, free & ~open_].round(9), axis=0, return_index=True)[1]
        q = q[np.sort(first)]
    return q


def _kind(equation: Equation, joint: int) -> str:
    """Return how a joint enters, if it does so once."""
    rates = set(np.abs(equation.frequencies[:, joint]).tolist())
    powers = set(equation.powers[:, joint].tolist())
    if powers != {0}:
        return "length" if powers <= {0, 1} and rates == {0} else ""
    return "once" if rates <= {0, 2} else "half" if rates == {1} else ""


def _solved(step: Step, q: Array, rng: np.random.Generator) -> tuple[Array, Bool]:
    """Values (N,) of the joint given the others of q (N, n), and whether there are any.

    The equation is evaluated at two or three values of the joint, which tell its coefficients.
    """
    places = {"once": (0.0, np.pi / 2, np.pi), "half": (0.0, np.pi), "length": (0.0, 1.0)}
    at = np.array(places[step.kind]) - (step.kind != "length") * step.equation.shift[step.joint]
    trial = np.repeat(q[None], len(at), axis=0)
    trial[..., step.joint] = at[:, None]
    f = step.equation(trial)
    # Of an equation's size: coefficients of a joint this small do not say what its value is.
    flat = 1e-9 * step.equation.size
    if step.kind == "length":
        slope = f[1] - f[0]
        known = np.abs(slope) > flat
        return -f[0] / np.where(known, slope, 1.0), known
    if step.kind == "half":  # a cos(q/2) + b sin(q/2)
        turn = 2 * np.arctan2(-f[0], f[1])
        return turn - step.equation.shift[step.joint], np.hypot(f[0], f[1]) > flat
    constant, cosine = (f[0] + f[2]) / 2, (f[0] - f[2]) / 2
    sine = f[1] - constant
    radius = np.hypot(cosine, sine)
    known = (radius > flat) & (np.abs(constant) <= radius)
    share = np.clip(-constant / np.where(known, radius, 1.0), -1.0, 1.0)
    side = np.where(rng.random(len(q)) < 0.5, -1.0, 1.0)
    turn = np.arctan2(sine, cosine) + side * np.arccos(share)
    return turn - step.equation.shift[step.joint], known


def _copy(angle: Array, low: float, high: float, rng: np.random.Generator) -> tuple[Array, Bool]:
    """Angles (N,) plus whole turns such that they lie within limits, and whether they do."""
    turn = 2 * np.pi
    first = np.ceil((low - _EDGE - angle) / turn)
    room = np.floor((high + _EDGE - angle) / turn) - first
    chosen = np.floor(rng.random(len(angle)) * (room + 1)) if high - low > turn else 0.0
    return angle + turn * (first + chosen), room >= 0
