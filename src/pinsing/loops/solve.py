"""Closing the loops: passive joints from actuated ones, along a path."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.loops.closure import CLOSED, Loops, Mask, gauss_newton
from pinsing.loops.feasible import Interval
from pinsing.loops.modes import home, mode_of
from pinsing.loops.pose import Pose
from pinsing.robot.load_mechanism import Mechanism
from pinsing.serialization import JsonResult

_STEP = 0.05
_SMALLEST = 1e-5


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
    smallest = min(1.0, _SMALLEST / distance)
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
