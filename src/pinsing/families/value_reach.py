"""Which of the joint values that a family fixes are within the joint limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.algebra.equation_text import format_angle
from pinsing.families.parts import Branch
from pinsing.measures import Reachability

_SLACK = 1e-9
"""Radians or metres; a value this far beyond a limit is within."""


@dataclass(frozen=True)
class ValueReach:
    """One value of one joint that a family fixes, and whether the limits allow it.

    Attributes
    ----------
    joint : int
        Index of the joint.
    value : float
        Radians in (-pi, pi], or metres.
    reachability : Reachability
        As of a family, of its configurations with this value.
    """

    joint: int
    value: float
    reachability: Reachability


def values_reached(
    branches: Sequence[Branch],
    limits: tuple[Array, Array],
    prismatic: Bool,
    reached: Reachability,
    met: Callable[[Branch], bool],
) -> tuple[ValueReach, ...]:
    """Each value that the branches fix a joint at, once, and whether the limits allow it.

    Parameters
    ----------
    branches : sequence of Branch
        Of a family.
    limits : (lower, upper)
        (n,) arrays, radians and metres, infinite where there are none.
    prismatic : (n,) array of bool
        Which joints slide.
    reached : Reachability
        Of the family as a whole.
    met : callable
        Whether a configuration within the limits was found on a branch whose values are.
    """
    known: dict[tuple[int, float], Reachability] = {}
    exact = {(v.joint, round(v.value, 9)): v.value for b in branches for v in b.values}
    if reached in (Reachability.OUTSIDE, Reachability.UNKNOWN):
        known |= dict.fromkeys(exact, reached)
    else:
        for branch in branches:
            if not branch.values:
                continue
            # A branch is where all its values are, so one that is outside takes it all there.
            allowed = all(_inside(v.value, v.joint, limits, prismatic) for v in branch.values)
            found = allowed and (not branch.equations or met(branch))
            for v in branch.values:
                inside = _inside(v.value, v.joint, limits, prismatic)
                here: Reachability = reached if found else Reachability.UNKNOWN
                if not allowed:
                    here = Reachability.OUTSIDE
                key = v.joint, round(v.value, 9)
                known[key] = _better(known.get(key), here) if inside else Reachability.OUTSIDE
    return tuple(ValueReach(key[0], exact[key], known[key]) for key in sorted(known))


def _better(a: Reachability | None, b: Reachability) -> Reachability:
    """What is known of configurations of one kind or another."""
    order = [Reachability.INSIDE, Reachability.AT_LIMIT, Reachability.UNKNOWN, Reachability.OUTSIDE]
    return b if a is None else min(a, b, key=order.index)


def _inside(value: float, joint: int, limits: tuple[Array, Array], prismatic: Bool) -> bool:
    """Whether a value is within a joint's limits, whole turns aside."""
    low, high = float(limits[0][joint]) - _SLACK, float(limits[1][joint]) + _SLACK
    if prismatic[joint]:
        return low <= value <= high
    if not (math.isfinite(low) and math.isfinite(high)):
        return True
    turn = 2 * math.pi
    return value + turn * math.ceil((low - value) / turn) <= high


def reach_words(reached: Reachability, values: Sequence[ValueReach], prismatic: Bool) -> str:
    """Where a family is within the limits: with which values of its joints, where not with all.

    Examples are "within the joint limits" and "within the joint limits with q2 = 0° (not 180°)".
    """
    if reached not in (Reachability.INSIDE, Reachability.AT_LIMIT):
        return reached.words
    parts = []
    for joint in sorted({v.joint for v in values}):
        of = [v for v in values if v.joint == joint]
        good = [v for v in of if v.reachability in (Reachability.INSIDE, Reachability.AT_LIMIT)]
        if len(good) == len(of) or not good:
            continue
        never = [v for v in of if v.reachability is Reachability.OUTSIDE]
        other = [v for v in of if v.reachability is Reachability.UNKNOWN]
        slides = bool(prismatic[joint])
        said = [f"not {_listed(never, slides)}"] if never else []
        said += [f"none found with {_listed(other, slides)}"] if other else []
        symbol = f"{'d' if slides else 'q'}{joint + 1}"
        parts.append(f"{symbol} = {_listed(good, slides)} ({', '.join(said)})")
    return reached.words + (f" with {' and '.join(parts)}" if parts else "")


def _listed(values: Sequence[ValueReach], slides: bool) -> str:
    numbers = sorted((v.value for v in values), key=lambda x: (abs(x), x))
    said = [f"{x:.6g} m" if slides and x else "0" if slides else format_angle(x) for x in numbers]
    return " or ".join(said)
