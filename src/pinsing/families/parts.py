"""What a family is made of: joints at values, equations in the others; kinds on its parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.equation import Equation, format_angle
from pinsing.algebra.ring import Value
from pinsing.measures import ROUNDING, Reachability
from pinsing.robot.joint_space import JointSpace


@dataclass(frozen=True)
class JointValue:
    """A joint at a fixed value.

    Attributes
    ----------
    joint : int
        Index of the joint.
    value : float
        Radians in (-pi, pi], or metres.
    rational : bool
        True if its half-angle tangent (or its length) is rational; else an algebraic number.
    minimal : tuple of int
        Where it was solved for: coefficients, the constant first, of the irreducible polynomial
        that the tangent of half the angle (counted from where the nominal geometry has its zero)
        or the length is a root of.
    exact : tuple or None
        The value in the ring of the exact polynomials, where it is in its field: x and y of a
        revolute joint, metres of a prismatic one; not written to JSON.
    """

    joint: int
    value: float
    rational: bool
    minimal: tuple[int, ...] = ()
    exact: Value | None = field(default=None, compare=False, repr=False, metadata={"json": False})


@dataclass(frozen=True)
class KindPart:
    """Boundary or interior on a part of a family.

    Attributes
    ----------
    kind : str
        "boundary", "interior" or "undecided".
    where : str
        The condition of the part; empty if it is all of the family, or just a share of it.
    share : float
        Of the points that were looked at.
    points : int
        How many were looked at in all.
    """

    kind: str
    where: str
    share: float
    points: int

    def __str__(self) -> str:
        if self.where:
            return f"{self.kind} at {self.where}"
        count = round(self.share * self.points)
        return self.kind if count == self.points else f"{self.kind} at {count} of {self.points}"


@dataclass(frozen=True, eq=False)
class Branch:
    """One piece of a family: joints at values, and equations in the others."""

    values: tuple[JointValue, ...]
    equations: tuple[Equation, ...]

    @property
    def involved(self) -> tuple[int, ...]:
        """Indices of the joints that matter, ascending."""
        joints = {v.joint for v in self.values}
        return tuple(sorted(joints.union(*(e.involved for e in self.equations))))

    def free(self, n: int) -> Bool:
        """Return which of n joints its equations are about."""
        mask = np.zeros(n, dtype=bool)
        mask[[j for e in self.equations for j in e.involved]] = True
        return mask

    def off(self, q: Array, space: JointSpace) -> Array:
        """Return the weighted differences (N, k) of the fixed joints of q (N, n)."""
        if not self.values:
            return np.zeros((len(q), 0))
        joints = [v.joint for v in self.values]
        away = q[:, joints] - np.array([v.value for v in self.values])
        wrapped = away - 2 * np.pi * np.round(away / (2 * np.pi))
        away = np.where(space.prismatic[joints], away, wrapped)
        return np.asarray(away / space.metric[joints])

    def put(self, q: Array, space: JointSpace) -> Array:
        """Return Q (N, n) with the fixed joints at the nearest copies of their values."""
        out = q.copy()
        if self.values:
            joints = [v.joint for v in self.values]
            out[:, joints] -= self.off(q, space) * space.metric[joints]
        return out

    def held(self, space: JointSpace, box: tuple[Array, Array] | None = None) -> list[Array]:
        """Return the values of the fixed joints in (n,) arrays: all copies that fit a box."""
        fixed = [np.zeros(space.n)]
        for v in self.values:
            copies = [v.value]
            if box is not None:
                low, high = box[0][v.joint] - ROUNDING, box[1][v.joint] + ROUNDING
                if not space.prismatic[v.joint]:
                    first, last = (np.array([low, high]) - v.value) / (2 * np.pi)
                    turns = range(math.ceil(first), math.floor(last) + 1)
                    copies = [v.value + 2 * np.pi * k for k in turns]
                elif not low <= v.value <= high:
                    copies = []
            fixed = [f.copy() for f in fixed for _ in copies]
            for k, f in enumerate(fixed):
                f[v.joint] = copies[k % len(copies)]
        return fixed


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


_BEST_FIRST = (
    Reachability.INSIDE, Reachability.AT_LIMIT, Reachability.UNKNOWN, Reachability.OUTSIDE
)  # fmt: skip


def values_reached(
    branches: Sequence[Branch],
    limits: tuple[Array, Array],
    prismatic: Bool,
    reached: Reachability,
    met: Callable[[Branch], bool],
) -> tuple[ValueReach, ...]:
    """Return each value at which branches fix a joint, and whether the limits allow it."""
    # ``met`` tells if a configuration within the limits was found on such a branch.
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
                best = min(known.get(key, here), here, key=_BEST_FIRST.index)
                known[key] = best if inside else Reachability.OUTSIDE
    return tuple(ValueReach(key[0], exact[key], known[key]) for key in sorted(known))


def _inside(value: float, joint: int, limits: tuple[Array, Array], prismatic: Bool) -> bool:
    """Return True if a value is within a joint's limits, whole turns aside."""
    low, high = float(limits[0][joint]) - ROUNDING, float(limits[1][joint]) + ROUNDING
    if prismatic[joint]:
        return low <= value <= high
    if not (math.isfinite(low) and math.isfinite(high)):
        return True
    turn = 2 * math.pi
    return value + turn * math.ceil((low - value) / turn) <= high


def reach_words(reached: Reachability, values: Sequence[ValueReach], prismatic: Bool) -> str:
    """Return "within the joint limits", perhaps "with q2 = 0° (not 180°)", and the like."""
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
