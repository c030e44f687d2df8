"""Closing the loops: passive joints from actuated ones, along a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing._types import Array, ArrayLike, Bool
from pinsing.errors import ConfigurationError
from pinsing.loops.closure import BatchLoops, Loops, gauss_newton, ranks
from pinsing.loops.modes import assembly_sign, closed_from_random, home, leg_modes, mode_of
from pinsing.loops.motion import Pose, motions
from pinsing.loops.singular_points import StoppedError, Trace, trace, turning_points
from pinsing.loops.structure import likeness, structure
from pinsing.measures import SEED, SOLVED
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


def solve(mechanism: Mechanism, inputs: ArrayLike, start: ArrayLike | None = None) -> Solution:
    """Follow the passive joints from ``start`` (home by default) to new inputs (n_a,).

    Newton with continuation on the straight path of the inputs, in steps of at most 0.05 rad,
    halved where Newton would leave the assembly mode. It stops at the type 2 singularity where
    the mode ends.
    """
    inputs = mechanism.check_inputs(inputs)
    return follow(mechanism, inputs[None, :], start)[0]


def follow(
    mechanism: Mechanism, path: ArrayLike, start: ArrayLike | None = None
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
    out, lost = [], error > SOLVED
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
    loops: Loops, q: Array, target: Array, actuated: list[int], free: Bool
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
        if error <= SOLVED:
            q, part = new, ahead
            step = min(2 * step, _STEP / distance)
            continue
        step /= 2
        if step < smallest:
            return q, part, "the path ends at a type 2 singularity: the loops do not close beyond"
    return q, 1.0, ""


def _predict(loops: Loops, q: Array, move: Array, actuated: list[int], free: Bool) -> Array:
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
    """Values of one input at which the loops close, the others held."""

    # lower and upper: radians or metres; a full turn runs from -pi to pi. A ``lower`` above
    # ``upper`` does not occur: a range that crosses pi ends beyond it
    lower: float
    upper: float
    whole: bool = False  # whether it is a full turn, without ends

    def __contains__(self, value: float) -> bool:
        if self.whole:
            return True
        turns = np.array([-1, 0, 1]) * 2 * np.pi
        return bool(((value + turns >= self.lower) & (value + turns <= self.upper)).any())

    def __str__(self) -> str:
        return "whole circle" if self.whole else f"[{self.lower:.6g}, {self.upper:.6g}]"


def curves(
    mechanism: Mechanism,
    inputs: ArrayLike,
    moving: int,
    starts: int = 160,
    seed: int = SEED,
    over: Callable[[], bool] | None = None,
) -> tuple[Trace, ...]:
    """Trace solution curves with input ``moving`` (its position) free, the others held.

    Each curve is followed as a whole, over type 2 singularities and through all the assembly
    modes that it connects, and ends at limits of joints; those that differ in flipped joints are
    one. Random ``starts`` are drawn until none of them leads to a new curve, or `MOST_CURVES` are
    known. Once ``over()`` is true, the curves that have their ends by then are all.
    """
    ranks(mechanism)
    inputs = mechanism.check_inputs(inputs)
    actuated = list(mechanism.actuated)
    start = mechanism.home.copy()
    start[actuated] = inputs
    passive = np.isin(np.arange(mechanism.n), mechanism.passive)
    free = passive | (np.arange(mechanism.n) == actuated[moving])
    rng = np.random.default_rng(seed)
    out: list[Trace] = []
    marks: list[Array] = []
    known = -1
    while known < len(out):
        known = len(out)
        found = closed_from_random(BatchLoops(mechanism), start, free, starts, rng)
        for q, legs in zip(found, leg_modes(mechanism, found, passive, rng, 1), strict=True):
            if not all(legs):
                continue
            for leg, modes in zip(structure(mechanism).legs, legs, strict=True):
                q[list(leg.joints)] = modes[0].q[list(leg.joints)]
            if mechanism.space.unreachable(mechanism.space.fold(q)).any():
                continue
            mark = likeness(mechanism, q)
            if any(t.passes(mechanism, q) for t in out) or any(_on_line(m, mark) for m in marks):
                continue
            if len(out) == MOST_CURVES:
                return tuple(out)
            try:
                out.append(trace(mechanism, q, moving, over=over))
            except StoppedError:
                return tuple(out)
            marks.append(np.array([likeness(mechanism, x) for x in out[-1].q]))
    return tuple(out)


def _on_line(marks: Array, mark: Array) -> bool:
    """Whether a line through marks (N, k) runs through one (k,): of flipped joints, say."""
    near = int(np.argmin(np.linalg.norm(marks - mark, axis=1)))
    for k in range(max(near - 1, 0), min(near + 1, len(marks) - 1)):
        start, step = marks[k], marks[k + 1] - marks[k]
        size = float(step @ step)
        along = float(np.clip((mark - start) @ step / size, 0, 1)) if size > 0 else 0.0
        # Beside a step by its curvature only.
        if np.linalg.norm(mark - start - along * step) <= 0.05 * np.sqrt(size):
            return True
    return False


def feasible(mechanism: Mechanism, inputs: ArrayLike) -> dict[str, tuple[Interval, ...]]:
    """Find the values of each input that close the loops, the others held at ``inputs`` (n_a,)."""
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


def drive(mechanism: Mechanism, inputs: ArrayLike, start: ArrayLike) -> Solution:
    """Follow the passive joints from a closed ``start`` (n,) to new inputs (n_a,), as ``solve``.

    A start at a type 2 singularity, where two assembly modes meet, is left into the one that
    leads further towards the inputs; where both do, into the one of home.
    """
    inputs = mechanism.check_inputs(inputs)
    q = mechanism.check(start)
    here = motions(mechanism, q)
    if here.input_ratio > 1e-6 or np.array_equal(inputs, q[list(mechanism.actuated)]):
        return solve(mechanism, inputs, q)
    loops, everything = Loops(mechanism), np.ones(mechanism.n, dtype=bool)
    along = here.basis @ np.linalg.svd(here.inputs)[2][-1] * loops.column_scale
    sides = [gauss_newton(loops, q + side * 0.02 * along, everything)[0] for side in (1, -1)]
    found = [solve(mechanism, inputs, way) for way in sides]
    return max(found, key=lambda s: (round(s.reached, 3), assembly_sign(mechanism, s.q) == "+"))
