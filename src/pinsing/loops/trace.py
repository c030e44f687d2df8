"""Curves of closed configurations with one input free: pseudo-arclength continuation.

A curve is followed in the space of all joints, so that it runs through type 2 singularities,
where the moving input turns back and another assembly mode begins. The ends of the feasible
range of an input are therefore points of the curve like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.errors import PinsingError
from pinsing.loops.closure import CLOSED, Loops, ranks
from pinsing.loops.motion import Motions, _motions
from pinsing.measures import SINGULAR_RTOL
from pinsing.robot.joint_space import SLACK
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

    def passes(self, mechanism: Mechanism, q: Array, tol: float = STEP) -> bool:
        """Whether the curve runs through q (n,), whole turns aside."""
        units = mechanism.space.metric
        away = mechanism.space.wrap(q - self.q) / units
        k = int(np.argmin(np.abs(away).max(axis=1)))
        # Off the curve by its curvature only, along it by up to a step.
        along = away[k] @ self.direction[k]
        across = away[k] - along * self.direction[k]
        return bool(abs(along) <= tol and np.abs(across).max() <= tol / 4)


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
    path = _Curve(mechanism, moving, step, over)
    try:
        q = path.correct(mechanism.space.fold(start))
    except _LostError:
        raise PinsingError(
            f"{mechanism.name}: no curve begins here: the loops do not close at the start"
        ) from None
    ahead, closed = path.run(q, None)
    points = ahead
    if not closed:
        behind, _ = path.run(q, -ahead[0][1])
        points = [(p, -t) for p, t in reversed(behind[1:])] + ahead
    Q = np.array([p for p, _ in points])
    measured = [path.measure(p) for p in Q]
    return Trace(
        moving=moving,
        q=Q,
        direction=np.array([t for _, t in points]),
        constraint_ratio=np.array([m.constraint_ratio for m in measured]),
        input_ratio=np.array([m.input_ratio for m in measured]),
        output_ratio=np.array([m.output_ratio for m in measured]),
        closed=closed,
        held=path.held_joints,
    )


class _Curve:
    def __init__(
        self, mechanism: Mechanism, moving: int, step: float, over: Callable[[], bool] | None
    ) -> None:
        self.mechanism, self.step, self.over = mechanism, step, over
        self.loops = Loops(mechanism)
        self.rank = ranks(mechanism).constraint
        self.index = mechanism.actuated[moving]
        self.held_joints = tuple(j for k, j in enumerate(mechanism.actuated) if k != moving)
        self.held = np.eye(mechanism.n)[list(self.held_joints)]
        self.units = self.loops.column_scale
        whole = ~mechanism.prismatic & (mechanism.upper - mechanism.lower >= 2 * np.pi - 1e-9)
        self.low = np.where(whole, -np.inf, mechanism.lower) - SLACK
        self.high = np.where(whole, np.inf, mechanism.upper) + SLACK

    def tangent(self, q: Array, along: Array | None) -> Array:
        G = self.loops.scaled(q)[1]
        t = np.linalg.svd(np.vstack([G, self.held]))[2][-1]
        if along is None:
            return np.asarray(t if t[self.index] >= 0 else -t)
        return np.asarray(t if t @ along >= 0 else -t)

    def correct(self, guess: Array, along: Array | None = None) -> Array:
        """Nearest closed configuration with the same held inputs, across the tangent."""
        q = guess.copy()
        best = np.inf
        for _ in range(20):
            error, G = self.loops.scaled(q)
            size = float(np.abs(error).max())
            if size <= 1e-14 or (size <= CLOSED and size >= best):
                return q
            best = size
            rows = np.vstack([G, self.held] if along is None else [G, self.held, along])
            target = np.concatenate([-error, np.zeros(len(rows) - len(error))])
            q = q + np.linalg.lstsq(rows, target, rcond=1e-11)[0] * self.units
            if not np.isfinite(q).all() or np.abs(q - guess).max() > 1.0:
                break
        if float(np.abs(self.loops.scaled(q)[0]).max()) <= CLOSED:
            return q
        raise _LostError

    def run(self, start: Array, along: Array | None) -> tuple[list[tuple[Array, Array]], bool]:
        """Points and tangents from ``start`` on, and whether the curve came back to it."""
        q, t = start, self.tangent(start, along)
        out = [(q, t)]
        step, travelled = self.step, 0.0
        while len(out) < _MOST:
            if self.over is not None and self.over():
                raise StoppedError(f"{self.mechanism.name}: no time is left to follow a curve")
            try:
                new = self.correct(q + step * t * self.units, t)
                turn = self.tangent(new, t)
            except _LostError:
                turn = -t
            # The next tangent must be close: a sharp bend wants smaller steps.
            if turn @ t < 0.98 and step > 1e-4:
                step /= 2
                continue
            if turn @ t < 0.5:
                return out, False
            travelled += step
            if travelled > 2 * self.step and self._back(start, out[0][1], q, t, step):
                out.append((self._same_turns(start, new), out[0][1]))
                return out, True
            if not self._inside(new):
                end = self._last_inside(q, t, step)
                if np.abs((end - q) / self.units).max() > SLACK:
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
        while long - short > SLACK / 4:
            middle = (short + long) / 2
            try:
                new = self.correct(q + middle * t * self.units, t)
            except _LostError:
                break
            if self._inside(new):
                good, short = new, middle
            else:
                long = middle
        return good

    def _back(self, start: Array, first: Array, q: Array, t: Array, step: float) -> bool:
        """Whether the step from q leads over the start, in the same direction."""
        gap = self.mechanism.space.wrap(start - q) / self.units
        along = float(gap @ t)
        across = float(np.abs(gap - along * t).max())
        return bool(0 <= along <= step and across <= step / 4 and first @ t > 0.5)

    def _same_turns(self, start: Array, near: Array) -> Array:
        """The start, moved by the whole turns that the curve has made."""
        return np.asarray(near + self.mechanism.space.wrap(start - near))

    def measure(self, q: Array) -> Motions:
        return _motions(self.loops, q, SINGULAR_RTOL)


class StoppedError(PinsingError):
    """The time was up before a curve had an end."""


class _LostError(Exception):
    """The corrector did not converge."""
