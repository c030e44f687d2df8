"""Where the loops close: solution curves of one input, and the ranges that they cover."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.batch import BatchLoops, newton
from pinsing.loops.closure import ranks
from pinsing.loops.likeness import likeness, same
from pinsing.loops.modes import home
from pinsing.loops.singular_points import turning_points
from pinsing.loops.trace import StoppedError, Trace, trace
from pinsing.robot.load_mechanism import Mechanism

_SEED = 811
_CLOSED = 1e-9
_POINT = 1e-7
_BESIDE = 0.05
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
    seed: int = _SEED,
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
    closed = distinct(mechanism, list(found[error <= _CLOSED]))
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
            if np.linalg.norm(mark - start - along * step) <= _BESIDE * np.sqrt(size):
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
    return tuple(Interval(low, high) for low, high in merged if high - low > _POINT * scale)


def _near(value: Array, ends: Array, prismatic: bool) -> Array:
    """Ends (folded) moved by the whole turns that bring them beside the curve's own values."""
    if prismatic or not len(ends):
        return ends
    nearest = value[np.argmin(np.abs(np.sin((value[:, None] - ends) / 2)), axis=0)]
    return np.asarray(ends + 2 * np.pi * np.round((nearest - ends) / (2 * np.pi)))
