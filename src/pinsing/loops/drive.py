"""Driving a mechanism by hand: one input moves, the passive joints follow, no mode is jumped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.closure import Loops, gauss_newton
from pinsing.loops.modes import assembly_sign
from pinsing.loops.motion import motions
from pinsing.loops.singular_points import SingularPoint, find_singular
from pinsing.loops.solve import Solution, solve
from pinsing.loops.trace import STEP, Trace, trace
from pinsing.robot.mechanism import Mechanism

_AT_TYPE_2 = 1e-6
_LEAVE = 0.02


@dataclass(frozen=True, eq=False)
class Stretch:
    """How far one input can move from a configuration before the assembly mode ends.

    Attributes
    ----------
    name : str
        The input.
    lower, upper : float
        Its values, radians or metres, in the same turn as at the configuration.
    whole : bool
        Whether it goes all the way round: there are no ends, and a full turn about the
        configuration is given.
    points : tuple of SingularPoint
        Singular configurations on the way, those where it ends among them; their ``q`` is in
        the same turn as well.
    """

    name: str
    lower: float
    upper: float
    whole: bool
    points: tuple[SingularPoint, ...]


def drive(mechanism: Mechanism, inputs: npt.ArrayLike, start: npt.ArrayLike) -> Solution:
    """Follow the passive joints from a closed ``start`` (n,) to new inputs (n_a,), as ``solve``.

    A start at a type 2 singularity, where two assembly modes meet, is left into the one that
    leads further towards the inputs; where both do, into the one of home.
    """
    inputs = mechanism.check_inputs(inputs)
    q = mechanism.check(start)
    ways = _ways_out(mechanism, q)
    if not ways or np.array_equal(inputs, q[list(mechanism.actuated)]):
        return solve(mechanism, inputs, q)
    found = [solve(mechanism, inputs, way) for way in ways]
    return max(found, key=lambda s: (round(s.reached, 3), assembly_sign(mechanism, s.q) == "+"))


def _ways_out(mechanism: Mechanism, q: Array) -> list[Array]:
    """Closed configurations to both sides of a type 2 singularity, none at a regular q."""
    here = motions(mechanism, q)
    if here.input_ratio > _AT_TYPE_2:
        return []
    loops = Loops(mechanism)
    along = here.basis @ np.linalg.svd(here.inputs)[2][-1] * loops.column_scale
    everything = np.ones(mechanism.n, dtype=bool)
    return [gauss_newton(loops, q + side * _LEAVE * along, everything)[0] for side in (1, -1)]


def stretch(mechanism: Mechanism, q: npt.ArrayLike, moving: int) -> Stretch:
    """How far input ``moving`` (its place among the inputs) can go from a closed q (n,).

    The other inputs stay; the ends are type 2 singularities or limits of the joint. At a type 2
    singularity both of the modes that meet there count.
    """
    q = mechanism.check(q)
    index = mechanism.actuated[moving]
    curve = trace(mechanism, q, moving)
    away = np.abs(mechanism.space.wrap(curve.q - q)).max(axis=1)
    here = int(np.argmin(away))
    count = len(curve.q)
    if curve.closed:
        here += count - 1
        curve = _three_times(curve)
    value = curve.q[:, index] + q[index] - curve.q[here, index]
    slope = curve.direction[:, index]
    last = min(here + count - 1, len(slope) - 1) if curve.closed else count - 1
    first = max(here - count + 1, 0)
    at_end = motions(mechanism, q).input_ratio <= _AT_TYPE_2
    end, turns = _until_turn(slope, here, last, 1, at_end)
    begin, _ = _until_turn(slope, here, first, -1, at_end)
    whole = curve.closed and not turns
    if whole:
        begin, end = here, last
    mode = "0" if at_end else assembly_sign(mechanism, q)
    points = tuple(
        p
        for p in find_singular(mechanism, [_part(curve, begin, end)])
        if mode in "0?" or assembly_sign(mechanism, p.q) in (mode, "0")
    )
    seen = value[begin : end + 1]
    centre = float(q[index]) if whole else float((seen.min() + seen.max()) / 2)
    points = _unfolded(mechanism, points, index, centre)
    if whole:
        return Stretch(mechanism.inputs[moving], centre - np.pi, centre + np.pi, True, points)
    # Between samples the input still goes a little further, to where it turns back.
    ends = [float(p.q[index]) for p in points if p.range_end]
    lower, upper = min([float(seen.min()), *ends]), max([float(seen.max()), *ends])
    low, high = float(mechanism.lower[index]), float(mechanism.upper[index])
    # The last step before a limit ends short of it.
    near = STEP * (mechanism.length_scale if mechanism.prismatic[index] else 1.0)
    lower = low if lower not in ends and abs(lower - low) <= near else lower
    upper = high if upper not in ends and abs(upper - high) <= near else upper
    return Stretch(mechanism.inputs[moving], lower, upper, False, points)


def _three_times(curve: Trace) -> Trace:
    """A closed curve, with a round more before and after it."""
    round_, last = np.arange(len(curve.q) - 1), len(curve.q) - 1
    turn = curve.q[-1] - curve.q[0]
    turns = np.repeat([-1.0, 0.0, 1.0], [last, last, last + 1])
    found = _rows(curve, np.concatenate([round_, round_, round_, [last]]), closed=True)
    return replace(found, q=found.q + turns[:, None] * turn)


def _rows(curve: Trace, rows: npt.NDArray[np.intp], closed: bool) -> Trace:
    return Trace(
        moving=curve.moving,
        q=curve.q[rows],
        direction=curve.direction[rows],
        constraint_ratio=curve.constraint_ratio[rows],
        input_ratio=curve.input_ratio[rows],
        output_ratio=curve.output_ratio[rows],
        closed=closed,
        held=curve.held,
    )


def _until_turn(slope: Array, start: int, last: int, step: int, at_end: bool) -> tuple[int, bool]:
    """Index, from ``start`` on, just beyond where the slope changes sign; and whether it does."""
    if start == last:
        return start, False
    # At a turning point itself the sign is that of the way ahead.
    begin = start + step if at_end else start
    sign = np.sign(slope[begin])
    for k in range(begin + step, last + step, step):
        if np.sign(slope[k]) != sign:
            return k, True
    return last, False


def _part(curve: Trace, first: int, last: int) -> Trace:
    """Samples from first to last, with one more to each side to see minima at the ends."""
    rows = np.arange(max(first - 1, 0), min(last + 2, len(curve.q)))
    return _rows(curve, rows, closed=False)


def _unfolded(
    mechanism: Mechanism, points: tuple[SingularPoint, ...], index: int, centre: float
) -> tuple[SingularPoint, ...]:
    """Points with the moving input in the turn about ``centre``, in its order."""
    out = []
    for p in points:
        q = p.q.copy()
        if not mechanism.prismatic[index]:
            q[index] += 2 * np.pi * np.round((centre - q[index]) / (2 * np.pi))
        out.append(replace(p, q=q, inputs=q[list(mechanism.actuated)]))
    return tuple(sorted(out, key=lambda p: float(p.q[index])))
