"""Closing the loops: along paths and curves of the inputs, in all modes; and what is singular.

With the pose of the output given, legs do not know of each other: each is solved alone, and what
the whole can do is the product.

A curve with one input free is followed in the space of all joints (pseudo-arclength continuation),
so that it runs through type 2 singularities, where the moving input turns back and another assembly
mode begins. The ends of the feasible range of an input are therefore points of the curve like any
other.

The measures have a kink at zero, so what is refined is, with the loops closed and all inputs but
one held, a singular value with the sign that its vectors give it:

    type 1:      of [G; J]   (a motion that leaves the output at rest)
    type 2:      of [G; S]   (a motion that leaves the actuators at rest)
    type 3:      of both
    constraint:  of G        (one motion more than the mobility)
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from pinsing.errors import ConfigurationError, OptionError, PinsingError
from pinsing.interface import JsonResult, checked
from pinsing.loops.closure import (
    BatchLoops,
    Loops,
    gauss_newton,
    groups,
    likeness,
    output_pose,
    passive_joints,
    planar_dyad,
    ranks,
    structure,
    to_its_size,
)
from pinsing.loops.legs import level_words, most_assemblies, number_of_modes
from pinsing.loops.motion import (
    MANY,
    Pose,
    _motions,
    assembly_sign,
    closed_from_random,
    home,
    home_error,
    leg_modes,
    measure_many,
    mode_at,
    mode_of,
    motions,
    pose_of,
    read_pose,
)
from pinsing.measures import ALIKE, ROUNDING, SEED, SINGULAR_RTOL, SOLVED, Array, ArrayLike, Bool
from pinsing.robot.mechanism import Mechanism

STEP = 0.04
"""Largest step along a curve, radians (or length scales)."""

MOST_STEPS = 4000


@dataclass(frozen=True, eq=False)
class Trace:
    """One curve of closed configurations.

    Attributes
    ----------
    moving : int
        Position, among the inputs, of the one that moves.
    q : (N, n) array
        Configurations in order, not folded; type 2 ends of the moving input are among them.
    direction : (N, n) array
        Unit tangents, lengths over the length scale.
    constraint_ratio, input_ratio, output_ratio : (N,) arrays
        Measures of the constraint, type 2 and type 1 singularities.
    closed : bool
        Whether the curve came back to its start.
    held : tuple of int
        Joints that keep their values along it: the other inputs.
    """

    moving: int
    q: Array
    direction: Array
    constraint_ratio: Array
    input_ratio: Array
    output_ratio: Array
    closed: bool
    held: tuple[int, ...] = ()

    @property
    def measures(self) -> dict[str, Array]:
        """Of each kind of singularity the measure (N,) that is zero there."""
        return {
            "type 1": self.output_ratio,
            "type 2": self.input_ratio,
            "constraint": self.constraint_ratio,
        }

    def passes(self, mechanism: Mechanism, q: Array) -> bool:
        """Return True if the curve runs through q (n,), whole turns aside."""
        away = mechanism.space.wrap(q - self.q) / mechanism.space.metric
        k = int(np.argmin(np.abs(away).max(axis=1)))
        # Off the curve by its curvature only, along it by up to a step.
        along = away[k] @ self.direction[k]
        across = away[k] - along * self.direction[k]
        return bool(abs(along) <= STEP and np.abs(across).max() <= STEP / 4)


def trace(
    mechanism: Mechanism,
    start: Array,
    moving: int,
    step: float = STEP,
    over: Callable[[], bool] | None = None,
) -> Trace:
    """Follow the curve through a closed configuration ``start`` (n,), one input moving.

    The curve ends where it closes, or where a joint meets its limit (continuous joints and
    those of a full turn have none); then it is followed to the other side as well.

    Raises
    ------
    PinsingError
        If the loops do not close at ``start``, or the curve has no end.
    StoppedError
        If ``over`` said that the time is up.
    """
    held = tuple(j for k, j in enumerate(mechanism.actuated) if k != moving)
    path = Curve(mechanism, mechanism.actuated[moving], held, step, over)
    q = path.correct(mechanism.space.fold(start))
    if q is None:
        raise PinsingError(
            f"{mechanism.name}: no curve begins here: the loops do not close at the start"
        )
    points, closed = path.run(q, None)
    if not closed:
        behind, _ = path.run(q, -points[0][1])
        points = [(p, -t) for p, t in reversed(behind[1:])] + points
    Q = np.array([p for p, _ in points])
    output_ratio, input_ratio, constraint_ratio = measure_many(BatchLoops(mechanism), Q)
    return Trace(
        moving=moving,
        q=Q,
        direction=np.array([t for _, t in points]),
        constraint_ratio=constraint_ratio,
        input_ratio=input_ratio,
        output_ratio=output_ratio,
        closed=closed,
        held=held,
    )


class Curve:
    """Steps along a curve of closed configurations: the joint ``index`` moves, others are held."""

    def __init__(
        self,
        mechanism: Mechanism,
        index: int,
        held: Sequence[int],
        step: float = STEP,
        over: Callable[[], bool] | None = None,
    ) -> None:
        self.mechanism, self.index, self.step, self.over = mechanism, index, step, over
        self.loops = Loops(mechanism)
        self.free = ~np.isin(np.arange(mechanism.n), held)
        self.units = self.loops.column_scale
        whole = ~mechanism.prismatic & (mechanism.upper - mechanism.lower >= 2 * np.pi - 1e-9)
        self.low = np.where(whole, -np.inf, mechanism.lower) - ROUNDING
        self.high = np.where(whole, np.inf, mechanism.upper) + ROUNDING

    def tangent(self, q: Array, along: Array | None) -> Array:
        """Unit tangent at q; to the side of ``along``, or of greater values of the moving joint."""
        t = np.zeros(len(q))
        t[self.free] = np.linalg.svd(self.loops.scaled(q)[1][:, self.free])[2][-1]
        side = t[self.index] if along is None else t @ along
        return np.asarray(t if side >= 0 else -t)

    def correct(self, guess: Array, along: Array | None = None) -> Array | None:
        """Nearest closed configuration with the same held inputs, across the tangent; or None."""
        more = None if along is None else lambda _: (np.zeros(1), along)
        q, error = gauss_newton(self.loops, guess, self.free, 20, 1.0, more)
        return q if error <= SOLVED else None

    def run(self, start: Array, side: Array | None) -> tuple[list[tuple[Array, Array]], bool]:
        """Points and tangents from ``start`` on, and whether the curve came back to it."""
        q, t = start, self.tangent(start, side)
        out = [(q, t)]
        step, travelled = self.step, 0.0
        while len(out) < MOST_STEPS:
            StoppedError.refuse_if(
                self.over is not None and self.over(),
                f"{self.mechanism.name}: no time is left to follow a curve",
            )
            new = self.correct(q + step * t * self.units, t)
            turn = -t if new is None else self.tangent(new, t)
            # The next tangent must be close: a sharp bend wants smaller steps.
            if turn @ t < 0.98 and step > 1e-4:
                step /= 2
                continue
            if new is None or turn @ t < 0.5:
                return out, False
            travelled += step
            # Whether the step leads over the start, in the same direction.
            gap = self.mechanism.space.wrap(start - q) / self.units
            along = float(gap @ t)
            near = 0 <= along <= step and np.abs(gap - along * t).max() <= step / 4
            if travelled > 2 * self.step and near and out[0][1] @ t > 0.5:
                # The start, moved by the whole turns that the curve has made.
                out.append((new + self.mechanism.space.wrap(start - new), out[0][1]))
                return out, True
            if not self._inside(new):
                end = self._at_limit(q, new)
                if np.abs((end - q) / self.units).max() > ROUNDING:
                    out.append((end, self.tangent(end, t)))
                return out, False
            q, t = new, turn
            out.append((q, t))
            step = min(self.step, 1.5 * step)
        raise PinsingError(
            f"{self.mechanism.name}: a curve of closed configurations is still open after "
            f"{MOST_STEPS} steps: use a larger step"
        )

    def _inside(self, q: Array) -> bool:
        return bool(((q >= self.low) & (q <= self.high)).all())

    def _at_limit(self, q: Array, new: Array) -> Array:
        """Where the curve meets the first limit on its way from q to ``new``."""
        limits = np.clip(new, self.low + ROUNDING, self.high - ROUNDING)
        part = (limits - q) / np.where(new == q, 1.0, new - q)
        for j in sorted(np.flatnonzero(limits != new).tolist(), key=part.__getitem__):

            def off(x: Array, j: int = j) -> tuple[Array, Array]:
                return (x - limits)[[j]] / self.units[j], np.eye(len(x))[[j]]

            end, error = gauss_newton(self.loops, q + part[j] * (new - q), self.free, 20, 1.0, off)
            if error <= SOLVED and self._inside(end):
                return end
        return q


class StoppedError(PinsingError):
    """The time was up before a curve had an end."""


KINDS = ("type 1", "type 2", "constraint")


@dataclass(frozen=True, eq=False)
class SingularPoint(JsonResult):
    """A singular configuration of a mechanism.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, ``type 3`` (both) or ``constraint``.
    q : (n,) array
        All joints, radians and metres.
    inputs : (n_a,) array
        The actuated ones.
    moving : str
        Input along which it was found; empty if none was singled out.
    mode : str
        Mode there: ``0`` for a sign that changes.
    position : (3,) array
        Origin of the output frame, metres.
    ratio : float
        Measure that vanishes.
    closure : float
        Loop-closure error, over the length scale.
    converged : bool
        Whether both are zero to tolerance.
    range_end : bool
        Whether the moving input turns back here: an end of its feasible range.
    direction : (m,) array
        Type 1: output direction lost; type 2: output velocity with the actuators held; unit
        length, zero where nothing moves. Lengths over the length scale.
    whole_curve : bool
        Whether every point of the curve on which it was found is singular so: where that input
        stays, the output moves with all inputs held.
    """

    schema: ClassVar[str] = "pinsing/mechanism-singular-point/1"

    kind: str
    q: Array
    inputs: Array
    moving: str
    mode: str
    position: Array
    ratio: float
    closure: float
    converged: bool
    range_end: bool
    direction: Array
    whole_curve: bool = field(default=False, metadata={"optional": True})

    def __str__(self) -> str:
        end = ", an end of its feasible range" if self.range_end else ""
        along = f" (along {self.moving}{end})" if self.moving else ""
        values = ", ".join(f"{x:.9g}" for x in self.inputs)
        return f"{self.kind} at inputs ({values}){along}; {self.mode}; measure {self.ratio:.1e}"


def refine_point(
    mechanism: Mechanism,
    q: ArrayLike,
    kind: str,
    held: Sequence[int] = (),
    rtol: float = SINGULAR_RTOL,
) -> SingularPoint:
    """Refine a singular point of a kind near q (n,), the joints ``held`` (indices) fixed.

    With one joint fewer held than the mobility the point is isolated; with fewer held, the
    nearest one of a continuum is taken. Type 3 is two conditions: it takes one joint fewer held.

    Raises
    ------
    OptionError
        If the kind is none of ``type 1``, ``type 2``, ``type 3`` and ``constraint``.
    """
    OptionError.refuse_if(
        kind not in (*KINDS, "type 3"),
        f"unknown kind {kind!r}: it is type 1, type 2, type 3 or constraint",
    )
    q = mechanism.check(q)
    loops = Loops(mechanism)
    inner = Loops(to_its_size(mechanism))
    free = ~np.isin(np.arange(mechanism.n), held)
    more = functools.partial(_vanishing, inner, kind=kind)
    found, _ = gauss_newton(inner, q, free, 40, np.pi, more)
    return _point(loops, found, kind, held, rtol)


def find_singular(
    mechanism: Mechanism,
    traces: Sequence[Trace],
    rtol: float = SINGULAR_RTOL,
    over: Callable[[], bool] | None = None,
) -> tuple[SingularPoint, ...]:
    """Return all singular points along curves, refined; each once, in the order of inputs.

    Once ``over()`` is true, those that are refined by then.
    """
    found: list[SingularPoint] = []
    for t in traces:
        for kind, k in _candidates(t, mechanism.actuated[t.moving]):
            if over is not None and over():
                break
            if (point := refined(mechanism, t, kind, k, rtol)) is not None:
                asked = ("type 1", "type 2") if point.kind == "type 3" else (point.kind,)
                whole = all(bool((t.measures[k] <= ROUNDING).all()) for k in asked)
                found.append(replace(point, whole_curve=whole))
    once = _of_one_mode(mechanism, found)
    return tuple(sorted(once, key=lambda p: (p.moving, p.kind, *np.round(p.inputs, 9))))


def refined(
    mechanism: Mechanism, t: Trace, kind: str, k: int, rtol: float = SINGULAR_RTOL
) -> SingularPoint | None:
    """The singular point of a kind beside sample k of a curve; None where there is none."""
    point = refine_point(mechanism, t.q[k], kind, t.held, rtol)
    near = np.abs(mechanism.space.wrap(point.q - t.q[k])).max() <= 6 * STEP
    return point if point.converged and near else None


def _of_one_mode(mechanism: Mechanism, found: list[SingularPoint]) -> list[SingularPoint]:
    """Points within the limits; of those that differ in flipped passive joints only, the first."""
    Q = np.reshape([p.q for p in found], (-1, mechanism.n))
    inside = ~mechanism.space.unreachable(Q, ALIKE).any(axis=1)
    marks, out = likeness(mechanism, Q), list[int]()
    for k in np.flatnonzero(inside).tolist():
        point = found[k]
        for place, other in enumerate(out):
            seen, away = found[other], float(np.abs(marks[k] - marks[other]).max())
            again = np.abs(mechanism.space.wrap(point.q - seen.q)).max() <= ALIKE
            # Where two of a kind meet, Newton ends with half the digits.
            near = point.kind == seen.kind and np.abs(point.inputs - seen.inputs).max() <= 1e-6
            if again or away <= (5e-3 if near else ALIKE):
                better = point.ratio < seen.ratio
                if again:
                    # Found as type 1 and as type 2: what both say together is the kind.
                    better = point.range_end > seen.range_end and point.kind == seen.kind
                out[place] = k if better else other
                break
        else:
            out.append(k)
    return [found[k] for k in out]


def turns(t: Trace, index: int) -> list[int]:
    """Samples beside which a joint, by its index, turns back along a curve."""
    slope = t.direction[:, index]
    # An input that stays along a curve does not turn: the signs of its slope are rounding.
    found = np.flatnonzero(slope[:-1] * slope[1:] <= 0) + 1
    return _one_of_each_run(found.tolist(), np.abs(slope) <= ROUNDING)


def _one_of_each_run(found: Sequence[int], zero: Bool) -> list[int]:
    """Of points in a run of samples that are zero throughout only that nearest to the middle."""
    out = [k for k in found if not zero[k]]
    for run in np.ma.clump_masked(np.ma.array(zero, mask=zero)):  # type: ignore[no-untyped-call]
        inside = [k for k in found if run.start <= k < run.stop]
        out += sorted(inside, key=lambda k: abs(2 * k - run.start - run.stop + 1))[:1]
    return sorted(out)


def _candidates(t: Trace, index: int) -> list[tuple[str, int]]:
    out = [("type 2", k) for k in turns(t, index)]
    for kind, ratio in t.measures.items():
        if len(ratio) < 3:
            continue
        # The last point of a closed curve is its first again.
        before, after = (ratio[-2], ratio[1]) if t.closed else (np.inf, np.inf)
        around = np.array([before, *ratio, after])
        left, right = around[:-2], around[2:]
        low = (ratio <= left) & (ratio <= right) & (ratio < 0.3)
        # Beside a zero the measure grows by its own size within a step; not so a flat minimum.
        if not t.closed:
            around[0], around[-1] = ratio[2], ratio[-3]
        low &= np.maximum(left, right) >= 1.3 * ratio
        if low.all():
            continue
        out += [
            (kind, k) for k in _one_of_each_run(np.flatnonzero(low).tolist(), ratio <= ROUNDING)
        ]
    # At a constraint singularity the others are met as well, and less exactly: it goes first.
    return sorted(out, key=lambda c: c[0] != "constraint")


def _vanishing(loops: Loops, q: Array, kind: str) -> tuple[Array, Array]:
    """Return what is zero where q (n,) is of a kind, singular values first, and slopes (k, n)."""
    generic, actuated = ranks(loops.mechanism), list(loops.mechanism.actuated)
    lost = {
        "type 1": generic.constraint + generic.output,
        "type 2": len(q),
        "constraint": generic.constraint,
    }

    def matrix(at: Array, which: str) -> Array:
        """The matrix that loses a rank."""
        G = loops.scaled(at)[1]
        if which == "constraint":
            return G
        more = loops.output_scaled(at) if which == "type 1" else np.eye(len(q))[actuated]
        return np.vstack([G, more])

    values, slopes = [], []
    for one in ("type 1", "type 2") if kind == "type 3" else (kind,):
        U, sigma, Vt = np.linalg.svd(matrix(q, one))
        # It changes as u dM v, both kept: so does what is zero of a vector v beside that one.
        place = lost[one] - 1
        u, still = U[:, place], Vt[place:]
        steps = np.diag(1e-5 * loops.column_scale)
        changes = [u @ (matrix(q + e, one) - matrix(q - e, one)) / 2e-5 for e in steps]
        values.append(np.pad(sigma[place : place + 1], (0, len(still) - 1)))
        slopes.append(still @ np.transpose(changes))
    return np.concatenate(values), np.concatenate(slopes)


def _point(loops: Loops, q: Array, kind: str, held: Sequence[int], rtol: float) -> SingularPoint:
    mechanism = loops.mechanism
    q = mechanism.space.wrap(q)
    closure = float(np.abs(loops.scaled(q)[0]).max())
    found = _motions(loops, q, rtol)
    ratio = {
        "type 1": found.output_ratio,
        "type 2": found.input_ratio,
        "type 3": max(found.output_ratio, found.input_ratio),
        "constraint": found.constraint_ratio,
    }[kind]
    converged = closure <= rtol and ratio <= rtol
    free = [j for j in mechanism.actuated if j not in held]
    direction = np.zeros(found.outputs.shape[0])
    if kind == "type 1":
        direction = np.linalg.svd(found.outputs)[0][:, ranks(mechanism).output - 1]
    elif kind == "type 2":
        moved = found.outputs @ np.linalg.svd(found.inputs)[2][-1]
        size = float(np.linalg.norm(moved))
        direction = moved / size if size > rtol else direction
    alone = len(free) == 1
    return SingularPoint(
        kind=found.kind(rtol) if converged else kind,
        q=q,
        inputs=q[list(mechanism.actuated)],
        moving=mechanism.joints[free[0]] if alone else "",
        mode=mode_of(mechanism, q),
        position=np.array(loops.output(q)[0].translation),
        ratio=ratio,
        closure=closure,
        converged=converged,
        range_end=alone and kind == "type 2" and _turns_back(loops, q, free[0], held),
        direction=direction,
    )


def _turns_back(loops: Loops, q: Array, index: int, held: Sequence[int]) -> bool:
    """Whether the input has an extremum on its curve: steps to both sides move it the same way."""
    curve = Curve(loops.mechanism, index, held)
    t = curve.tangent(q, None)
    ways = [curve.correct(q + side * 1e-3 * t * curve.units, t) for side in (1, -1)]
    moved = [float(way[index] - q[index]) for way in ways if way is not None]
    return len(moved) == 2 and moved[0] * moved[1] > 0


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
    return follow(mechanism, mechanism.check_inputs(inputs)[None, :], start)[0]


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
    loops, free = Loops(mechanism), passive_joints(mechanism)
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
    """Move inputs to a target as far as the mode leads: where it is, the part covered, and why."""
    origin, units = q[actuated], loops.column_scale
    distance = float(np.abs((target - origin) / units[actuated]).max())
    part, step = 0.0 if distance else 1.0, _STEP / max(distance, _STEP)
    while part < 1:
        ahead = min(1.0, part + step)
        # Along the tangent, by not too long a step.
        G, move = loops.scaled(q)[1], (ahead - part) * (target - origin) / units[actuated]
        passive = np.linalg.lstsq(G[:, free], -G[:, actuated] @ move, rcond=1e-11)[0]
        longest = max(float(np.abs(passive).max(initial=0.0)), 2 * _STEP)
        guess = q.copy()
        guess[free] += passive * (2 * _STEP / longest) * units[free]
        guess[actuated] = origin + ahead * (target - origin)
        # A corrector that runs off is about to jump to another assembly mode, or over a fold.
        new, error = gauss_newton(loops, guess, free, steps=12, reach=_STEP)
        if error <= SOLVED:
            q, part, step = new, ahead, min(2 * step, _STEP / distance)
            continue
        step /= 2
        if step < 1e-5 / max(distance, 1e-5):
            return q, part, "the path ends at a type 2 singularity: the loops do not close beyond"
    return q, 1.0, ""


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
    passive = passive_joints(mechanism)
    free = passive | (np.arange(mechanism.n) == actuated[moving])
    rng = np.random.default_rng(seed)
    out: list[Trace] = []
    marks: list[Array] = []
    known = -1
    while known < len(out):
        known = len(out)
        found = closed_from_random(BatchLoops(mechanism), start, free, starts, rng)
        begin: list[Array] = []
        for q, legs in zip(found, leg_modes(mechanism, found, passive, rng, 1), strict=True):
            if not all(legs):
                continue
            for leg, modes in zip(structure(mechanism).legs, legs, strict=True):
                q[list(leg.joints)] = modes[0].q[list(leg.joints)]
            begin.append(q)
        Q = np.reshape(begin, (-1, mechanism.n))
        Q = Q[~mechanism.space.unreachable(Q).any(axis=1)]
        for q, mark in zip(Q, likeness(mechanism, Q), strict=True):
            if any(t.passes(mechanism, q) for t in out) or any(_on_line(m, mark) for m in marks):
                continue
            if len(out) == MOST_CURVES:
                return tuple(out)
            try:
                out.append(trace(mechanism, q, moving, over=over))
            except StoppedError:
                return tuple(out)
            marks.append(likeness(mechanism, out[-1].q))
    return tuple(out)


def _on_line(marks: Array, mark: Array) -> bool:
    """Whether a line through marks (N, k) runs through one (k,): of flipped joints, say."""
    near = int(np.argmin(np.linalg.norm(marks - mark, axis=1)))
    beside = marks[max(near - 1, 0) : near + 2]
    steps, away = np.diff(beside, axis=0), mark - beside[:-1]
    size = (steps**2).sum(axis=1)
    along = np.clip((away * steps).sum(axis=1) / np.where(size > 0, size, 1.0), 0, 1)
    # Beside a step by its curvature only.
    off = np.linalg.norm(away - along[:, None] * steps, axis=1)
    return bool((off <= 0.05 * np.sqrt(size)).any())


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
        ends = [(t.q[k], refined(mechanism, t, "type 2", k)) for k in turns(t, index)]
        beside = [q + mechanism.space.wrap(p.q - q) for q, p in ends if p is not None]
        value = np.array([*t.q, *beside])[:, index]
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
    loops = Loops(mechanism)
    along = here.basis @ np.linalg.svd(here.inputs)[2][-1] * loops.column_scale
    sides = [gauss_newton(loops, q + side * 0.02 * along)[0] for side in (1, -1)]
    found = [solve(mechanism, inputs, way) for way in sides]
    return max(found, key=lambda s: (round(s.reached, 3), assembly_sign(mechanism, s.q) == "+"))


STARTS = 400
_MOST = 4096


@dataclass(frozen=True, eq=False)
class Modes(JsonResult):
    """The modes of a mechanism at given inputs (direct problem) or for a pose (inverse problem).

    Attributes
    ----------
    problem : str
        ``direct`` (assembly modes) or ``inverse`` (working modes).
    modes : tuple of Solution
        One configuration of each, with the number of ways to assemble it.
    starts : int
        Random starts from which poses were sought; 0 where a closed form gives them all.
    hits : tuple of int
        For each mode, how many starts led to its pose; empty with a closed form.
    beyond : int
        Poses of the output found that need a joint beyond its limits.
    loose : int
        Poses found at which the output moves with the inputs held. Where they are points of one
        curve they are not counted: a single one is among the modes.
    bound : int or None
        No more can exist, by algebra, limits left aside; None where no such number is known.
    complete : bool
        Whether these are all: by a closed form, or since as many were found as algebra gives.
    statement : str
        All of this in words.
    """

    schema: ClassVar[str] = "pinsing/mechanism-modes/1"

    problem: str
    modes: tuple[Solution, ...]
    starts: int
    hits: tuple[int, ...]
    beyond: int
    loose: int
    bound: int | None
    complete: bool
    statement: str

    def __str__(self) -> str:
        lines = [self.statement]
        lines += [
            f"  {k}: {s.pose}; {s.mode}; {s.ways} way{'s' * (s.ways != 1)} to assemble it"
            for k, s in enumerate(self.modes, 1)
        ]
        return "\n".join(lines)


@checked
def assembly_modes(
    mechanism: Mechanism,
    inputs: ArrayLike | None = None,
    starts: int = STARTS,
    seed: int = SEED,
) -> Modes:
    """Solve the direct problem: every pose of the output that was found at given inputs.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``. Limits are kept; ``mechanism.without_limits()`` has none.
    inputs : (n_a,) array_like, optional
        Values of the actuated joints, radians and metres; home by default.
    starts : int
        Random starts.
    seed : int
        Seed of the starts.

    Returns
    -------
    Modes
        None in it where the loops do not close.

    Raises
    ------
    ConfigurationError
        If an input is beyond its limits.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.loops.assembly_modes(pinsing.load_mechanism("five_bar"))
    >>> len(found.modes), found.complete
    (2, True)
    """
    ranks(mechanism)
    actuated = list(mechanism.actuated)
    asked = home(mechanism)[actuated] if inputs is None else mechanism.check_inputs(inputs)
    OptionError.refuse_if(starts < 1, f"starts must be 1 or more, got {starts}")
    dyad = planar_dyad(mechanism)
    if dyad is not None:
        return _exact(mechanism, "direct", dyad.close(asked), 2)
    begin = mechanism.home.copy()
    begin[actuated] = asked
    outside = mechanism.space.outside(begin)[actuated]
    if outside.any():
        if inputs is None:
            raise home_error(mechanism)
        k = int(np.argmax(outside))
        raise ConfigurationError(
            f"{mechanism.name}: {mechanism.inputs[k]} = {asked[k]:.6g} is outside its limits: take "
            "another value, or ignore the limits (--ignore-limits, without_limits())"
        )
    return _sought(mechanism, begin, passive_joints(mechanism), None, starts, seed)


@checked
def working_modes(
    mechanism: Mechanism, pose: ArrayLike | None = None, starts: int = STARTS, seed: int = SEED
) -> Modes:
    """Solve the inverse problem: every way to reach a pose of the output that was found.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``. Limits are kept; ``mechanism.without_limits()`` has none.
    pose : array_like, optional
        Of the output, metres and radians, base axes; home by default. Either a matrix (4, 4); or
        x, y, z and a quaternion, scalar first (7,); or x, y, z and roll, pitch, yaw (6,); or
        x, y and the turn about z (3,) of an output with the rows vx, vy, wz; else the coordinates
        that the rows of the output name: x, y, z for translations, roll, pitch, yaw for
        rotations.
    starts : int
        Random starts.
    seed : int
        Seed of the starts.

    Returns
    -------
    Modes
        Empty where the output does not reach the pose.

    Raises
    ------
    OptionError
        If the pose leaves a freedom open: fewer rows than degrees of freedom.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.loops.working_modes(pinsing.load_mechanism("five_bar"))
    >>> len(found.modes), found.complete
    (4, True)
    """
    generic = ranks(mechanism)
    OptionError.refuse_if(starts < 1, f"starts must be 1 or more, got {starts}")
    OptionError.refuse_if(
        generic.output < generic.mobility,
        f"{mechanism.name} has {generic.mobility} degrees of freedom, but the output "
        f"{mechanism.output} ({mechanism.task}) shows {generic.output} of them: a pose leaves "
        "the others open; name more rows of the output in the loop file",
    )
    wanted = read_pose(mechanism, pose)
    dyad = planar_dyad(mechanism)
    if dyad is not None and dyad.at_pin():
        at = complex(*(dyad.basis @ wanted.translation))
        return _exact(mechanism, "inverse", dyad.working_modes(at), 4)
    free = np.ones(mechanism.n, dtype=bool)
    target = (np.array(wanted.rotation), np.array(wanted.translation), mechanism.task.rows)
    return _sought(mechanism, mechanism.home.copy(), free, target, starts, seed)


def assemblies(
    mechanism: Mechanism, inputs: ArrayLike, starts: int = STARTS, seed: int = SEED
) -> tuple[Solution, ...]:
    """Return all assembly modes found at given inputs (n_a,), each with one configuration.

    From the closed form where the mechanism has one (planar RR-RR loops: exactly two), else by
    Newton from ``starts`` random positions of the passive joints.

    Raises
    ------
    InfeasibleError
        If there is none; it carries the feasible range of each input.
    """
    found = assembly_modes(mechanism, inputs, starts, seed)
    if not found.modes:
        inputs = mechanism.check_inputs(inputs)
        raise InfeasibleError(mechanism, inputs, feasible(mechanism, inputs), found.beyond)
    return found.modes


def _noun(problem: str, count: int) -> str:
    """Of so many modes of a problem, ``direct`` or ``inverse``."""
    kind = "assembly mode" if problem == "direct" else "working mode"
    return kind if count == 1 else f"{kind}s"


def _exact(mechanism: Mechanism, problem: str, found: tuple[Array, ...], most: int) -> Modes:
    inside = [q for q in found if not mechanism.space.unreachable(q).any()]
    beyond = len(found) - len(inside)
    solved = (_solution(mechanism, q, 1, exact=True) for q in inside)
    modes = tuple(sorted(solved, key=lambda s: _order(s, mechanism)))
    words = f"{_noun(problem, len(modes))}: all there are, by the intersection of circles"
    words = f"{len(modes)} {words}" + f"; {beyond} more beyond the joint limits" * (beyond > 0)
    return Modes(problem, modes, 0, (), beyond, 0, most, True, words)


def _sought(
    mechanism: Mechanism,
    begin: Array,
    free: Bool,
    target: tuple[Array, Array, tuple[int, ...]] | None,
    starts: int,
    seed: int,
) -> Modes:
    """Modes from random starts; of the direct problem where there is no target."""
    direct, rng, loops = target is None, np.random.default_rng(seed), BatchLoops(mechanism)
    poses, hits = _poses(loops, closed_from_random(loops, begin, free, starts, rng, target))
    loose = [motions(mechanism, q).input_ratio <= ALIKE for q in poses]
    # All but the first of the poses at which the output is loose, where there are many.
    spare = set(np.flatnonzero(loose)[1:].tolist()) if sum(loose) > MANY else set()
    kept = [k for k in range(len(poses)) if k not in spare]
    reached = np.array([poses[k] for k in kept]).reshape(-1, mechanism.n)
    pairs: list[tuple[Solution, int]] = []
    beyond, moving = 0, 0
    for k, legs in zip(kept, leg_modes(mechanism, reached, free, rng, 24), strict=True):
        beyond += not all(legs)
        for choice in itertools.islice(itertools.product(*legs), _MOST + 1 - len(pairs)):
            q = poses[k].copy()
            for leg, one in zip(structure(mechanism).legs, choice, strict=True):
                q[list(leg.joints)] = one.q[list(leg.joints)]
            ways = int(np.prod([one.ways for one in choice]))
            pairs.append((_solution(mechanism, q, ways), hits[k]))
            moving += any(one.loose for one in choice)
    cut = len(pairs) > _MOST
    pairs = sorted(pairs[:_MOST], key=lambda x: _order(x[0], mechanism))
    modes = [m for m, _ in pairs]
    bound = most_assemblies(mechanism) if direct else None
    number, by = number_of_modes(mechanism, begin[list(mechanism.actuated)], target, poses)
    reached_all = number == (len(poses) if direct else len(modes)) and not spare
    complete = reached_all or (bound is not None and len(poses) >= bound and not spare)
    problem = "direct" if direct else "inverse"
    sure, once, level = reached_all and not cut, sum(hits[k] == 1 for k in kept), ""
    open_, also = not sure and not complete, ";" if sure else ","
    if not (complete or spare or cut):
        found = poses if direct else [m.q for m in modes]
        level = level_words(mechanism, found, None if target is None else target[1])
    # Words by whether they are true.
    told = [
        (True, f"{len(modes)} {_noun(problem, len(modes))}"),
        (sure, f": all there are, by {by}"),
        (not sure, f" found from {starts} starts"),
        (
            beyond > 0,
            f"{also} {beyond} more pose{'s' * (beyond != 1)} beyond the joint limits",
        ),
        (not sure, f"; {'no more can' if complete else 'more may'} exist"),
        (
            open_ and once > 0,
            f" ({once} of {len(kept)} poses {'was' if once == 1 else 'were'} met only once)",
        ),
        (open_ and bound is not None, f", at most {bound} with limits left aside"),
        (not sure and direct and number is not None, f"; there are {number}, by {by}"),
        (
            not (sure or direct or cut) and (number or 0) > len(modes),
            f"; at most {number} within the limits of the actuators, by {by}",
        ),
        (True, level),
        (
            moving > 0,
            f"; at {moving} of them a leg moves by itself, the output at rest and the inputs held: "
            "one point stands for a curve of configurations",
        ),
    ]
    loose_words = (
        f"the inputs do not fix the pose: at {len(spare) + 1} of {len(poses)} poses found from "
        f"{starts} starts the output moves with the inputs held. They are points of curves of "
        "poses, of which one is given"
    )
    words = loose_words if spare else "".join(text for holds, text in told if holds)
    words += f"; the list ends after {_MOST}" * cut
    return Modes(
        problem, tuple(modes), starts, tuple(c for _, c in pairs), beyond,
        len(spare) + bool(spare), bound, complete, words,
    )  # fmt: skip


def _poses(loops: BatchLoops, Q: Array) -> tuple[list[Array], list[int]]:
    """Return configurations with different poses of the output, and how often each was found."""
    # At a double solution (type 2) Newton's method has half of the digits, and one looks like
    # several: poses that lie close are brought nearer first.
    mechanism = loops.mechanism
    poses, hits = Q, np.ones(len(Q), dtype=int)
    for again in (True, False):
        R, p, _ = loops.output(poses)
        marks = np.concatenate([p / mechanism.length_scale, R.reshape(-1, 9)], axis=1)
        alike = groups(marks, 10 * ALIKE)
        firsts = [group[0] for group in alike]
        poses, marks = poses[firsts], marks[firsts]
        hits = np.array([hits[group].sum() for group in alike], dtype=int)
        gaps = np.abs(marks[:, None] - marks[None]).max(axis=-1) + np.eye(len(poses))
        for k in np.flatnonzero((gaps <= 1e-3).any(axis=1)).tolist() if again else ():
            poses[k], _ = gauss_newton(Loops(mechanism), poses[k], passive_joints(mechanism))
    return list(poses), hits.tolist()


def _solution(mechanism: Mechanism, q: Array, ways: int, exact: bool = False) -> Solution:
    loops = Loops(mechanism)
    if not exact:
        q, error = gauss_newton(loops, q, passive_joints(mechanism), steps=8)
        if error > SOLVED:
            q, _ = gauss_newton(loops, q, steps=8)
    q = mechanism.space.fold(q)
    return Solution(
        inputs=q[list(mechanism.actuated)],
        q=q,
        residual=float(np.abs(loops.scaled(q)[0]).max()),
        converged=True,
        mode=mode_of(mechanism, q),
        reached=1.0,
        note="",
        pose=pose_of(output_pose(mechanism, q)),
        ways=ways,
    )


def _order(s: Solution, mechanism: Mechanism) -> tuple[tuple[int, ...], list[float]]:
    return mode_at(mechanism, s.q).order, np.round(mechanism.space.wrap(s.q), 6).tolist()
