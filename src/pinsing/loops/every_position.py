"""Orientations that are singular at every position, from the equation of a locus, exactly.

As a polynomial in the position the equation has coefficients in the quaternion. Where all of them
vanish every position is singular. They are looked at on the whole of the unit quaternions and on
each of its coordinate subspaces (turns about one axis, half turns and their like): there what all
coefficients have in common is a condition on the orientation.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.loops.pose_equation import PoseEquation, pose_equation
from pinsing.loops.pose_ring import PoseRing

_AXES = {"e1": "x", "e2": "y", "e3": "z"}
_REAL = 1e-9


@dataclass(frozen=True, eq=False)
class PoseFamily:
    """Orientations of the output at which every position is singular.

    Attributes
    ----------
    words : str
        What they are.
    zero : tuple of str
        Components of the quaternion that are zero.
    equations : tuple of PoseEquation
        What holds of the others; empty where nothing else is asked.
    """

    words: str
    zero: tuple[str, ...]
    equations: tuple[PoseEquation, ...]

    def __str__(self) -> str:
        return self.words


def every_position(ring: PoseRing, poly: Any) -> tuple[PoseFamily, ...]:
    """Families of orientations at which ``poly`` vanishes for all positions."""
    names = ring.names
    turn = [k for k, n in enumerate(names) if n in ("e0", "e1", "e2", "e3")]
    others = [k for k in range(len(names)) if k not in turn]
    if not turn:
        return ()
    coefficients = _coefficients(ring, poly, others)
    found: list[tuple[frozenset[int], Any]] = []
    for count in range(len(turn)):
        for zero in itertools.combinations(turn, count):
            found += _within(ring, coefficients, turn, frozenset(zero), found)
    return tuple(_family(ring, zero, factor) for zero, factor in found)


def _coefficients(ring: PoseRing, poly: Any, others: list[int]) -> list[Any]:
    parts: dict[tuple[int, ...], dict[tuple[int, ...], Any]] = {}
    for monomial, c in poly.to_dict().items():
        powers = [int(e) for e in monomial]
        key = tuple(powers[k] for k in others)
        for k in others:
            powers[k] = 0
        parts.setdefault(key, {})[tuple(powers)] = c
    return [ring.context.from_dict(terms) for terms in parts.values()]


def _within(
    ring: PoseRing,
    coefficients: list[Any],
    turn: list[int],
    zero: frozenset[int],
    known: list[tuple[frozenset[int], Any]],
) -> list[tuple[frozenset[int], Any]]:
    """Conditions that the coefficients share where the quaternion's ``zero`` parts are zero."""
    rest = [c for c in (_restricted(ring, c, zero) for c in coefficients) if c != 0]
    left = [k for k in turn if k not in zero]
    if not rest:
        # All of the subspace.
        if any(z <= zero and _restricted(ring, f, zero) == 0 for z, f in known):
            return []
        return [(zero, ring.number(0))]
    common = functools.reduce(lambda a, b: a.gcd(b), rest)
    out = []
    for factor, _ in common.factor()[1]:
        used = [k for k in left if factor.degrees()[k] > 0]
        # A single component that vanishes is a smaller subspace, seen there.
        if factor.is_constant() or len(factor) == 1 or not _has_real_points(ring, factor, used):
            continue
        if any(z <= zero and _contains(ring, f, zero, factor) for z, f in known):
            continue
        out.append((zero, factor))
    return out


def _restricted(ring: PoseRing, poly: Any, zero: frozenset[int]) -> Any:
    gens = ring.context.names()
    return poly.subs({gens[k]: 0 for k in zero}) if zero else poly


def _contains(ring: PoseRing, other: Any, zero: frozenset[int], factor: Any) -> bool:
    there = _restricted(ring, other, zero)
    return bool(there == 0 or divmod(there, factor)[1] == 0)


def _has_real_points(ring: PoseRing, factor: Any, used: list[int]) -> bool:
    """Whether the factor changes its sign somewhere: else it is a sum of squares, or the like."""
    if len(used) < 2:
        return bool(used)
    plain = pose_equation(factor, ring.names, ring.odd, ring.square)
    x = np.random.default_rng(5).normal(size=(400, len(ring.names)))
    values = plain(x)
    return bool((values > 0).any() and (values < 0).any())


def _family(ring: PoseRing, zero: frozenset[int], factor: Any) -> PoseFamily:
    names = ring.names
    vanish = tuple(names[k] for k in sorted(zero))
    turn = [n for n in names if n in ("e0", "e1", "e2", "e3")]
    left = [n for n in turn if n not in vanish]
    equations = () if factor == 0 else (pose_equation(factor, names, ring.odd, ring.square),)
    return PoseFamily(_words(vanish, left, equations), vanish, equations)


def _words(vanish: tuple[str, ...], left: list[str], equations: tuple[PoseEquation, ...]) -> str:
    end = ": singular at every position"
    if len(left) == 1 and not equations:
        which = left[0]
        return ("not turned at all" if which == "e0" else f"half a turn about {_AXES[which]}") + end
    if len(left) == 2 and "e0" in left:
        axis = _AXES[next(n for n in left if n != "e0")]
        if not equations:
            return f"turned by any angle about {axis}{end}"
        return f"turned by {_angles(equations[0], left)} about {axis}{end}"
    if len(left) == 2:
        one, two = (_AXES[n] for n in left)
        if not equations:
            return f"half a turn about any axis in the plane of {one} and {two}{end}"
        angles = _half_turn_axes(equations[0], left)
        return f"half a turn about an axis at {angles} from {one} towards {two}{end}"
    conditions = [*(f"{n} = 0" for n in vanish), *(str(x) for x in equations)]
    return f"orientations with {', '.join(conditions)}{end}"


def _ratios(equation: PoseEquation, left: list[str]) -> list[float]:
    """Real values of the second component over the first."""
    one, two = (equation.names.index(n) for n in left)
    top = int(max(equation.powers[:, one] + equation.powers[:, two]))
    line = np.zeros(top + 1)
    for value, powers in zip(equation.values, equation.powers, strict=True):
        line[int(powers[two])] += value
    found = np.roots(line[::-1])
    return sorted(float(r.real) for r in found if abs(r.imag) <= _REAL)


def _listed(values: list[float]) -> str:
    """Angles, radians, in degrees: ``±90°``."""
    degrees = sorted({round(math.degrees(v), 6) + 0.0 for v in values})
    plus = [d for d in degrees if d > 0]
    if [-d for d in reversed(plus)] == [d for d in degrees if d < 0] and 0.0 not in degrees:
        return " or ".join(f"±{d:.6g}°" for d in plus)
    return " or ".join(f"{d:.6g}°" for d in degrees)


def _angles(equation: PoseEquation, left: list[str]) -> str:
    ordered = ["e0", next(n for n in left if n != "e0")]
    return _listed([2 * math.atan(r) for r in _ratios(equation, ordered)])


def _half_turn_axes(equation: PoseEquation, left: list[str]) -> str:
    return _listed([math.atan(r) for r in _ratios(equation, left)])
