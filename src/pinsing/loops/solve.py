"""Closing the loops: passive joints from actuated ones, along a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.loops.batch import BatchLoops, newton
from pinsing.loops.closure import CLOSED, Loops, Mask, gauss_newton, ranks
from pinsing.loops.modes import assembly_sign, home, mode_of
from pinsing.loops.motion import motions
from pinsing.loops.pose import Pose
from pinsing.loops.singular_points import SingularPoint, find_singular, turning_points
from pinsing.loops.structure import likeness, same
from pinsing.loops.trace import STEP, StoppedError, Trace, trace
from pinsing.robot.mechanism import Mechanism
from pinsing.serialization import JsonResult

_STEP = 0.05


class InfeasibleError(ConfigurationError):
    """Inputs at which the loops cannot be closed.

    Attributes
    ----------
    inputs : tuple of float
        As asked for.
    feasible : dict of str to tuple of Interval
        For each input, the others held, where the loops do close.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        inputs: Array,
        feasible: dict[str, tuple[Interval, ...]],
        beyond: int = 0,
    ) -> None:
        self.inputs, self.feasible = tuple(float(x) for x in inputs), feasible
        asked = ", ".join(f"{n} = {v:.6g}" for n, v in zip(mechanism.inputs, inputs, strict=True))
        ranges = "; ".join(
            f"{name} in {' or '.join(str(i) for i in found)}" if found else f"no {name} at all"
            for name, found in feasible.items()
        )
        outside = " within the joint limits (beyond them they do)" if beyond else ""
        super().__init__(
            f"{mechanism.name}: the loops do not close at {asked}{outside}; with the other inputs "
            f"held, they close for {ranges}"
        )


@dataclass(frozen=True, eq=False)
class Solution(JsonResult):
    """Loops closed at given inputs.

    Attributes
    ----------
    inputs : (n_a,) array
        As asked for, radians and metres.
    q : (n,) array
        The configuration; the last one reached where ``converged`` is false.
    residual : float
        Closure error, over the length scale.
    converged : bool
        Whether the loops are closed at the inputs asked for.
    mode : str
        Assembly and working mode there.
    reached : float
        Part of the path covered, 0 to 1.
    note : str
        Why it ended early, else empty.
    pose : Pose or None
        Of the output, where it was asked for.
    ways : int
        In how many ways passive joints (balls, universal joints) can be flipped with the same
        pose and the same loads, as far as they were looked for.
    """

    schema: ClassVar[str] = "pinsing/mechanism-solution/2"

    inputs: Array
    q: Array
    residual: float
    converged: bool
    mode: str
    reached: float
    note: str
    pose: Pose | None = None
    ways: int = 1


def solve(
    mechanism: Mechanism, inputs: npt.ArrayLike, start: npt.ArrayLike | None = None
) -> Solution:
    """Follow the passive joints from ``start`` (home by default) to new inputs (n_a,).

    Newton with continuation on the straight path of the inputs, in steps of at most 0.05 rad,
    halved where Newton would leave the assembly mode. It stops at the type 2 singularity where
    the mode ends.
    """
    inputs = mechanism.check_inputs(inputs)
    q = home(mechanism) if start is None else mechanism.check(start)
    found = follow(mechanism, inputs[None, :], q)
    return found[0]


def follow(
    mechanism: Mechanism, path: npt.ArrayLike, start: npt.ArrayLike | None = None
) -> tuple[Solution, ...]:
    """Close the loops along a path of inputs (N, n_a), each from the one before.

    Returns
    -------
    tuple of Solution
        One a point; where the path leaves the feasible range the rest has ``converged`` false.
    """
    path = np.atleast_2d(mechanism.check_inputs(path))
    loops = Loops(mechanism)
    free = np.isin(np.arange(mechanism.n), mechanism.passive)
    actuated = list(mechanism.actuated)
    q = home(mechanism) if start is None else mechanism.check(start)
    q, error = gauss_newton(loops, q, free)
    out, lost = [], error > CLOSED
    why = "the loops do not close at the start" if lost else ""
    for target in path:
        part = 0.0
        if not lost:
            q, part, why = _walk(loops, q, target, actuated, free)
            lost = part < 1
        error = float(np.abs(loops.scaled(q)[0]).max())
        out.append(Solution(target, q.copy(), error, not lost, mode_of(mechanism, q), part, why))
    return tuple(out)


def _walk(
    loops: Loops, q: Array, target: Array, actuated: list[int], free: Mask
) -> tuple[Array, float, str]:
    origin = q[actuated].copy()
    units = loops.column_scale[actuated]
    distance = float(np.abs((target - origin) / units).max())
    if distance == 0:
        return q, 1.0, ""
    part, step = 0.0, min(1.0, _STEP / distance)
    smallest = min(1.0, 1e-5 / distance)
    while part < 1:
        ahead = min(1.0, part + step)
        guess = _predict(loops, q, (ahead - part) * (target - origin) / units, actuated, free)
        guess[actuated] = origin + ahead * (target - origin)
        # A corrector that runs off is about to jump to another assembly mode, or over a fold.
        new, error = gauss_newton(loops, guess, free, steps=12, reach=_STEP)
        if error <= CLOSED:
            q, part = new, ahead
            step = min(2 * step, _STEP / distance)
            continue
        step /= 2
        if step < smallest:
            return q, part, "the path ends at a type 2 singularity: the loops do not close beyond"
    return q, 1.0, ""


def _predict(loops: Loops, q: Array, move: Array, actuated: list[int], free: Mask) -> Array:
    G = loops.scaled(q)[1]
    passive = np.linalg.lstsq(G[:, free], -G[:, actuated] @ move, rcond=1e-11)[0]
    longest = float(np.abs(passive).max(initial=0.0))
    if longest > 2 * _STEP:
        passive *= 2 * _STEP / longest
    out = q.copy()
    out[free] += passive * loops.column_scale[free]
    return out


MOST_CURVES = 24
"""More curves of one input are not followed: free passive joints multiply them."""


@dataclass(frozen=True)
class Interval:
    """Values of one input at which the loops close, the others held.

    Attributes
    ----------
    lower, upper : float
        Radians or metres; a full turn runs from -pi to pi. A ``lower`` above ``upper`` does not
        occur: a range that crosses pi ends beyond it.
    whole : bool
        Whether it is a full turn, without ends.
    """

    lower: float
    upper: float
    whole: bool = False

    def __contains__(self, value: float) -> bool:
        if self.whole:
            return True
        turns = np.array([-1, 0, 1]) * 2 * np.pi
        return bool(((value + turns >= self.lower) & (value + turns <= self.upper)).any())

    def __str__(self) -> str:
        return "whole circle" if self.whole else f"[{self.lower:.6g}, {self.upper:.6g}]"


def distinct(mechanism: Mechanism, found: Sequence[Array]) -> list[Array]:
    """Configurations (n,) within the limits, one of each mode."""
    out: list[Array] = []
    marks: list[Array] = []
    for q in found:
        q = mechanism.space.fold(q)
        if mechanism.space.unreachable(q).any():
            continue
        mark = likeness(mechanism, q)
        if not any(same(mark, other) for other in marks):
            out.append(q)
            marks.append(mark)
    return out


def curves(
    mechanism: Mechanism,
    inputs: npt.ArrayLike,
    moving: int,
    starts: int = 160,
    seed: int = 811,
    over: Callable[[], bool] | None = None,
) -> tuple[Trace, ...]:
    """Solution curves with input ``moving`` (position among the inputs) free, the others held.

    Each curve is followed as a whole, over type 2 singularities and through all the assembly
    modes that it connects, and ends at limits of joints. Once ``over()`` is true, the curves that
    have their ends by then are all.
    """
    ranks(mechanism)
    inputs = mechanism.check_inputs(inputs)
    actuated = list(mechanism.actuated)
    start = mechanism.home.copy()
    start[actuated] = inputs
    free = np.isin(np.arange(mechanism.n), [*mechanism.passive, actuated[moving]])
    rng = np.random.default_rng(seed)
    low, high = mechanism.space.span
    begin = np.repeat(start[None], starts, axis=0)
    begin[:, free] = rng.uniform(low, high, begin.shape)[:, free]
    # Home first: what is known to close is not left to chance.
    begin[0, free] = home(mechanism)[free]
    found, error = newton(BatchLoops(mechanism), begin, free)
    closed = distinct(mechanism, list(found[error <= 1e-9]))
    return cover(mechanism, closed, moving, over)


def cover(
    mechanism: Mechanism,
    closed: Sequence[Array],
    moving: int,
    over: Callable[[], bool] | None = None,
) -> tuple[Trace, ...]:
    """Curves through closed configurations, each once up to flips; the first `MOST_CURVES`."""
    out: list[_Followed] = []
    for q in closed:
        if len(out) == MOST_CURVES:
            break
        if not any(t.passes(mechanism, q) for t in out):
            try:
                curve = trace(mechanism, q, moving, over=over)
            except StoppedError:
                break
            marks = np.array([likeness(mechanism, x) for x in curve.q])
            out.append(_Followed(curve, marks))
    return tuple(t.curve for t in out)


@dataclass(frozen=True, eq=False)
class _Followed:
    """A curve, and what its samples share with those that differ in flipped joints (N, k)."""

    curve: Trace
    marks: Array

    def passes(self, mechanism: Mechanism, q: Array) -> bool:
        """Whether it runs through q (n,), or through one that differs in flipped joints only."""
        if self.curve.passes(mechanism, q):
            return True
        mark = likeness(mechanism, q)
        near = int(np.argmin(np.linalg.norm(self.marks - mark, axis=1)))
        for k in range(max(near - 1, 0), min(near + 1, len(self.marks) - 1)):
            start, step = self.marks[k], self.marks[k + 1] - self.marks[k]
            size = float(step @ step)
            along = float(np.clip((mark - start) @ step / size, 0, 1)) if size > 0 else 0.0
            # Beside a step by its curvature only.
            if np.linalg.norm(mark - start - along * step) <= 0.05 * np.sqrt(size):
                return True
        return False


def feasible(mechanism: Mechanism, inputs: npt.ArrayLike) -> dict[str, tuple[Interval, ...]]:
    """For each input, the others held as in ``inputs`` (n_a,), the values that close the loops."""
    inputs = mechanism.check_inputs(inputs)
    return {
        name: intervals(mechanism, curves(mechanism, inputs, k), k)
        for k, name in enumerate(mechanism.inputs)
    }


def intervals(mechanism: Mechanism, found: Sequence[Trace], moving: int) -> tuple[Interval, ...]:
    """Union of what curves cover of the moving input."""
    index = mechanism.actuated[moving]
    pieces = []
    for t in found:
        # The ends are type 2 singularities: between samples, so they are refined.
        ends = [point.q[index] for point in turning_points(mechanism, t)]
        value = t.q[:, index]
        value = np.concatenate([value, _near(value, np.array(ends), mechanism.prismatic[index])])
        low, high = float(value.min()), float(value.max())
        if not mechanism.prismatic[index]:
            if high - low >= 2 * np.pi - 1e-6:
                return (Interval(-np.pi, np.pi, whole=True),)
            bounded = mechanism.upper[index] - mechanism.lower[index] < 2 * np.pi - 1e-9
            turn = 0.0 if bounded else 2 * np.pi * np.floor((low + np.pi) / (2 * np.pi) + 1e-12)
            low, high = low - turn, high - turn
        pieces.append((low, high))
    merged: list[list[float]] = []
    for low, high in sorted(pieces):
        if merged and low <= merged[-1][1] + 1e-9:
            merged[-1][1] = max(merged[-1][1], high)
        else:
            merged.append([low, high])
    # A curve that ends where it begins, at a limit, is no range.
    scale = mechanism.length_scale if mechanism.prismatic[index] else 1.0
    return tuple(Interval(low, high) for low, high in merged if high - low > 1e-7 * scale)


def _near(value: Array, ends: Array, prismatic: bool) -> Array:
    """Ends (folded) moved by the whole turns that bring them beside the curve's own values."""
    if prismatic or not len(ends):
        return ends
    nearest = value[np.argmin(np.abs(np.sin((value[:, None] - ends) / 2)), axis=0)]
    return np.asarray(ends + 2 * np.pi * np.round((nearest - ends) / (2 * np.pi)))


_AT_TYPE_2 = 1e-6


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
    return [gauss_newton(loops, q + side * 0.02 * along, everything)[0] for side in (1, -1)]


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
