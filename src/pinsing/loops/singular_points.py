"""Curves of closed configurations with one input free, and the singular points along them.

A curve is followed in the space of all joints (pseudo-arclength continuation), so that it runs
through type 2 singularities, where the moving input turns back and another assembly mode begins.
The ends of the feasible range of an input are therefore points of the curve like any other.

The measures have a kink at zero, so what is refined is a smooth system: the loops closed, all
inputs but one held, and a velocity z of unit length with

    type 1:      G z = 0, J z = 0     (a motion that leaves the output at rest)
    type 2:      G z = 0, S z = 0     (a motion that leaves the actuators at rest)
    type 3:      both, each with a motion of its own
    constraint:  G Z = 0, Z' Z = 1    (one motion more than the mobility)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from pinsing.errors import OptionError, PinsingError
from pinsing.interface import JsonResult
from pinsing.loops.closure import (
    BatchLoops,
    Loops,
    gauss_newton,
    likeness,
    ranks,
    same,
    to_its_size,
)
from pinsing.loops.motion import _motions, measure_many, mode_of
from pinsing.measures import ALIKE, ROUNDING, SINGULAR_RTOL, SOLVED, Array, ArrayLike, Bool
from pinsing.robot.mechanism import Mechanism

STEP = 0.04
"""Largest step along a curve, radians (or length scales)."""

_MOST = 4000


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
        q, error = gauss_newton(self.loops, guess, self.free, 20, 1.0, along)
        return q if error <= SOLVED else None

    def run(self, start: Array, side: Array | None) -> tuple[list[tuple[Array, Array]], bool]:
        """Points and tangents from ``start`` on, and whether the curve came back to it."""
        q, t = start, self.tangent(start, side)
        out = [(q, t)]
        step, travelled = self.step, 0.0
        while len(out) < _MOST:
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
                end = self._last_inside(q, t, step)
                if np.abs((end - q) / self.units).max() > ROUNDING:
                    out.append((end, self.tangent(end, t)))
                return out, False
            q, t = new, turn
            out.append((q, t))
            step = min(self.step, 1.5 * step)
        raise PinsingError(
            f"{self.mechanism.name}: a curve of closed configurations is still open after "
            f"{_MOST} steps: use a larger step"
        )

    def _inside(self, q: Array) -> bool:
        return bool(((q >= self.low) & (q <= self.high)).all())

    def _last_inside(self, q: Array, t: Array, step: float) -> Array:
        """Where the curve meets the limit that a step from q would cross."""
        good, short, long = q, 0.0, step
        while long - short > ROUNDING / 4:
            middle = (short + long) / 2
            new = self.correct(q + middle * t * self.units, t)
            if new is None:
                break
            if self._inside(new):
                good, short = new, middle
            else:
                long = middle
        return good


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
    found = _solve(inner, q, kind, list(held)) * inner.column_scale
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
    out: list[SingularPoint] = []
    marks: list[Array] = []
    for point in found:
        if mechanism.space.unreachable(point.q, ALIKE).any():
            continue
        mark = likeness(mechanism, point.q)
        for k, (other, seen) in enumerate(zip(marks, out, strict=True)):
            again = np.abs(mechanism.space.wrap(point.q - seen.q)).max() <= ALIKE
            # Where two of a kind meet, Newton ends with half the digits.
            close = point.kind == seen.kind and bool(
                np.abs(point.inputs - seen.inputs).max() <= 1e-6
                and np.abs(mark - other).max() <= 5e-3
            )
            if again or close or same(mark, other):
                better = point.ratio < seen.ratio
                if again:
                    # Found as type 1 and as type 2: what both say together is the kind.
                    better = point.range_end > seen.range_end and point.kind == seen.kind
                if better:
                    out[k], marks[k] = point, mark
                break
        else:
            out.append(point)
            marks.append(mark)
    return out


def turns(t: Trace, index: int) -> list[int]:
    """Samples beside which a joint, by its index, turns back along a curve."""
    slope = t.direction[:, index]
    # An input that stays along a curve does not turn: the signs of its slope are rounding.
    found = np.flatnonzero(slope[:-1] * slope[1:] <= 0) + 1
    return _one_of_each_run(found.tolist(), np.abs(slope) <= ROUNDING)


def _one_of_each_run(found: list[int], zero: Bool) -> list[int]:
    """Of points in a run of samples that are zero throughout only that in the middle."""
    out = [k for k in found if not zero[k]]
    steps = np.diff(np.pad(zero.astype(int), 1))
    for a, b in zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0) - 1, strict=True):
        inside = [k for k in found if a <= k <= b]
        middle = sorted(inside, key=lambda k: abs(k - (a + b) / 2))[:1]
        out += inside if b - a < 3 else middle
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


def _solve(loops: Loops, q: Array, kind: str, held: list[int]) -> Array:
    """Solve the smooth system of (x, Z) of a kind near q (n,); x is without units."""
    mechanism, n, step_x = loops.mechanism, loops.mechanism.n, 1e-5
    d = {"type 3": 2, "constraint": ranks(mechanism).mobility + 1}.get(kind, 1)
    # Products of columns of Z that are given: the two of type 3 are each of length 1, no more.
    pairs = np.diag_indices(2) if kind == "type 3" else np.triu_indices(d)
    actuated = np.eye(n)[list(mechanism.actuated)]
    start = q / loops.column_scale

    def matrices(x: Array) -> tuple[Array, list[tuple[Array, slice]]]:
        """Closure error, and matrices with the columns of Z that they take to zero."""
        at = x * loops.column_scale
        error, G = loops.scaled(at)
        if kind == "constraint":
            return error, [(G, slice(None))]
        found = []
        if kind != "type 2":
            found.append(np.vstack([G, loops.output_scaled(at)]))
        if kind != "type 1":
            found.append(np.vstack([G, actuated]))
        return error, [(M, slice(k, k + 1)) for k, M in enumerate(found)]

    def equations(Z: Array, blocks: list[tuple[Array, slice]]) -> Array:
        """What the matrices make of Z (..., n, d), and the products of its columns."""
        moved = [(M @ Z[..., c]).reshape(*Z.shape[:-2], -1) for M, c in blocks]
        unit = (np.swapaxes(Z, -1, -2) @ Z - np.eye(d))[..., pairs[0], pairs[1]]
        return np.concatenate([*moved, unit], axis=-1)

    def residual(x: Array, Z: Array) -> Array:
        error, blocks = matrices(x)
        return np.concatenate([error, equations(Z, blocks), (x - start)[held]])

    def inverse_at(x: Array, Z: Array) -> Array:
        """The inverse of the Jacobian, by central differences: in Z, of degree 2, exact."""
        sides = [(x + step_x * e, x - step_x * e) for e in np.eye(n)]
        in_x = np.array([residual(a, Z) - residual(b, Z) for a, b in sides]) / (2 * step_x)
        error, blocks = matrices(x)
        units = np.eye(n * d).reshape(-1, n, d)
        in_Z = (equations(Z + units, blocks) - equations(Z - units, blocks)) / 2
        in_Z = np.pad(in_Z, ((0, 0), (len(error), len(held))))
        return np.asarray(np.linalg.pinv(np.concatenate([in_x, in_Z]).T, rcond=1e-9))

    x, Z = start, np.zeros((n, d))
    for M, c in matrices(x)[1]:
        Z[:, c] = np.linalg.svd(M)[2][-Z[:, c].shape[1] :].T
    value = residual(x, Z)
    size, stalled = float(np.linalg.norm(value)), 0
    for _ in range(40):
        if size <= 1e-15 or stalled == 2:
            break
        # Damped steps of least length: the system may have dependent or spare equations.
        inverse = inverse_at(x, Z)
        step = -inverse @ value
        factor = min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-300))
        for _ in range(6):
            x_new = x + factor * step[:n]
            Z_new = Z + factor * step[n:].reshape(n, d)
            value_new = residual(x_new, Z_new)
            size_new = float(np.linalg.norm(value_new))
            # Where joints are nearly locked the equations bend: the step that is left tells more.
            ahead, behind = (float(np.linalg.norm(x)) for x in (inverse @ value_new, step))
            left = ahead / max(behind, 1e-300)
            if size_new < size or left < 0.5:
                break
            factor /= 3
        else:
            break
        # A minimum that is not zero is approached slowly: it is no singularity.
        stalled = stalled + 1 if min(size_new / size, left) > 0.9 else 0
        x, Z, value, size = x_new, Z_new, value_new, size_new
    return x


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
