"""Two-sided bounds of the clearance of many configurations, in closed form.

The lower one is that of `pinsing.algebra.trig_sum`; along the gradient g of a sum f a zero is
reached within ``2 |f| / (|g| + sqrt(|g|^2 - 2 M |f|))``, where that is real: the upper one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pinsing._batch import engine
from pinsing._types import Array, Ints
from pinsing.algebra.conditions import Conditions, WeightedBranch
from pinsing.algebra.trig_sum import TINY, At, TrigSum, off_values, to_zeros


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of the distance to the nearest family, and to each.

    Attributes
    ----------
    lower, upper : (N,) arrays
        In weighted coordinates; infinite where there is no family, or no bound. Lower ones less
        the conditions' margin.
    family : (N,) array of int
        The one of the least lower bound, before a margin is taken off; -1 without any.
    each : (N, F, 2) array
        Lower and upper bound of each family; (0, 0, 2) unless asked for.
    """

    lower: Array
    upper: Array
    family: Ints
    each: Array


def two_sided(
    conditions: Conditions,
    Q: Array,
    *,
    each: bool = False,
    compiled: bool = True,
    threads: int | None = None,
    isa: str | None = None,
) -> Bounds:
    """Bounds of the distance of Q (N, n) from conditions.

    Parameters
    ----------
    conditions : Conditions
        The families.
    Q : (N, n) array
        Joint values, finite.
    each : bool
        Whether the bounds of every family are wanted too.
    compiled : bool
        Whether the compiled engine is used where there is one.
    threads : int, optional
        Threads of the compiled engine; as many as there are processors.
    isa : str, optional
        Instruction set of the compiled engine, for the same bits on every machine; the best
        one here by default.
    """
    X = conditions.scaled(Q)
    handle = conditions.compiled if compiled else None
    N, F = len(X), conditions.families
    every = np.empty((N, F, 2) if each or handle is None else (0, 0, 2))
    lower, upper, family = np.empty(N), np.empty(N), np.empty(N, dtype=np.int64)
    margin = conditions.margin
    if margin is not None:
        found = two_sided(
            conditions.plain, Q, each=True, compiled=compiled, threads=threads, isa=isa
        )
        family = _nearest(found.each)[2]
        found.each[..., 0] = margin.take_off(Q, found.each)
        return replace(found, lower=found.each[..., 0].min(axis=1, initial=np.inf), family=family)
    if handle is not None:
        count = 1 if N < 4096 else threads or engine.cpu_count()
        handle.clearances(X, lower, upper, family, every, isa or engine.isa_names()[-1], count)
        return Bounds(lower, upper, family, every)
    rows = max(1, 2_000_000 // max((len(s.amplitude) for s in conditions.sums), default=1))
    for first in range(0, N, rows):
        every[first : first + rows] = _each(conditions, X[first : first + rows])
    return Bounds(*_nearest(every), every)


def _nearest(each: Array) -> tuple[Array, Array, Ints]:
    lower, upper = (each[..., k].min(axis=1, initial=np.inf) for k in (0, 1))
    family = np.argmin(each[..., 0], axis=1) if each.shape[1] else np.full(len(each), -1)
    return lower, upper, np.where(np.isfinite(lower), family, -1)


@np.errstate(over="ignore")  # a quotient that overflows is a distance farther than any other
def _each(c: Conditions, X: Array) -> Array:
    out = np.full((len(X), c.families, 2), np.inf)
    for branch in c.branches:
        lower, upper = _of_values(c, branch, X)
        if branch.sums:
            at = [s.at(X) for s in branch.sums]
            reached = (
                _reached(branch.sums[0], X, at[0]) if len(at) == 1 else np.full(len(X), np.inf)
            )
            lower = c.joined(lower, to_zeros(branch.sums, at, X)) * (1 - 1e-15)
            upper = c.joined(upper, reached) * (1 + 1e-15)
        here = out[:, branch.family]
        np.minimum(here, np.stack([lower, upper], axis=1), out=here)
    return out


def _of_values(c: Conditions, branch: WeightedBranch, X: Array) -> tuple[Array, Array]:
    joints = branch.joints
    off, slack = off_values(X[:, joints], branch.values, c.turn[joints])
    total = c.size(off)
    slack = slack + 1e-15 * total
    return np.maximum(total - slack, 0.0), total + slack


def _reached(s: TrigSum, X: Array, at: At) -> Array:
    """Distance by which a zero is reached along the gradient; infinite where it need not be."""
    value, slope = np.abs(at.value) + at.error, s.dual(at.gradient) - at.slope_error
    within = np.minimum(2 * value / np.maximum(slope, TINY), 1e3)
    least = np.sqrt(2 * (s.bend_within(X, within) * value))
    # The root of slope^2 - least^2: squares of huge slopes overflow.
    root = np.sqrt(np.maximum(slope - least, 0.0)) * np.sqrt(np.maximum(slope + least, 0.0))
    found = 2 * value / np.maximum(slope + root, TINY) * (1 + 8e-15)
    good = (slope >= least) & (slope > 0) & (found <= within * (1 + 1e-9))
    return np.where(good, found, np.inf)
