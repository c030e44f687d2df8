"""Singular loci of a spherical 3-RRR over the orientation of its output, exactly.

Leg i has its actuated axis u in the base, its middle axis v, its outer axis w in the output. With
the actuator held it passes a moment along v x w. Three dependent ones are type 2: the planes of
the outer links meet in one line. The actuator does not work on its moment where u . (v x w) = 0:
type 1. Where both links are quarter circles v is along u x w, and the inputs drop out. After
Gosselin and Angeles, "Singularity analysis of closed-loop kinematic chains" (1990), and Bonev and
Gosselin, "Singularity loci of spherical parallel mechanisms" (2005).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx

from pinsing._types import Array
from pinsing.algebra.ring import Poly, divided_by, rational
from pinsing.loops.exact import away, cross, dot, quaternion_turn, vector
from pinsing.loops.forms import TURNS, pose_equation
from pinsing.loops.legs import angles_of
from pinsing.loops.structure import (
    SMALL,
    SPHERE,
    at_zero,
    closing,
    once,
    path_to,
    room_of,
    structure,
)
from pinsing.robot.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class SphereLeg:
    """One leg's axes.

    Attributes
    ----------
    joint : int
        The actuated joint.
    driven : (3,) array
        u, in the base.
    middle : (3,) array
        v in the base with the actuated joint at zero.
    outer : (3,) array
        w, in the output.
    cosine : float
        Of the angle between v and w.
    """

    joint: int
    driven: Array
    middle: Array
    outer: Array
    cosine: float

    def solutions(self, R: Array) -> tuple[float, ...] | None:
        """Values of the joint for an orientation R (3, 3); None where two meet.

        v . w is the cosine of the outer link, linear in cosine and sine of the joint's angle.
        """
        w, u = R @ self.outer, self.driven
        rest = float(u @ self.middle) * u
        a, b = float(w @ (self.middle - rest)), float(w @ np.cross(u, self.middle))
        return angles_of(a, b, self.cosine - float(w @ rest))

    @property
    def square(self) -> bool:
        """Whether both links are quarter circles."""
        return bool(max(abs(float(self.driven @ self.middle)), abs(self.cosine)) <= SMALL)


@dataclass(frozen=True, eq=False)
class SphereLoci:
    """The equations, as polynomials.

    Attributes
    ----------
    names : tuple of str
        e0, e1, e2, e3, and cosine and sine of the actuated joints where they occur.
    type2 : Poly
        Determinant of the moments.
    type1 : tuple of Poly
        For each leg.
    legs : tuple of SphereLeg
        The legs.
    off : float
        By how much numbers of the file were changed to be exact.
    """

    names: tuple[str, ...]
    type2: Poly
    type1: tuple[Poly, ...]
    legs: tuple[SphereLeg, ...]
    off: float


@once
def sphere_loci(mechanism: Mechanism) -> SphereLoci | None:
    """Loci of a spherical mechanism of three legs of three joints; None for another one."""
    if room_of(mechanism)[0] != SPHERE or set(mechanism.task.rows) != {3, 4, 5}:
        return None
    legs = _legs(mechanism)
    if len(legs) != 3:
        return None
    joints = () if all(leg.square for leg in legs) else tuple(leg.joint for leg in legs)
    names = [*TURNS]
    for j in joints:
        names += [f"cos {mechanism.joints[j]}", f"sin {mechanism.joints[j]}"]
    type2, type1, off = _polynomials(legs, names, joints)
    return SphereLoci(tuple(names), type2, type1, tuple(legs), off)


MOST_ASSEMBLIES = 8
"""Three equations of degree 2 in the quaternion: no more, where they are finite in number."""


def type1_alone(mechanism: Mechanism) -> bool:
    """Whether type 2 is shown to need type 1 of a leg."""
    found = sphere_loci(mechanism)
    return found is not None and bool(squares_note(found))


def squares_note(found: SphereLoci) -> str:
    """What a sum of squares says; empty where type 2 is none.

    With the base in the axes u and the output in the axes w, both at right angles, the moments'
    determinant has squares only: it is zero where some components of the quaternion are.
    """
    U = np.array([leg.driven for leg in found.legs]).T
    W = np.array([leg.outer for leg in found.legs]).T
    right = max(float(np.abs(A.T @ A - np.eye(3)).max()) for A in (U, W)) <= SMALL
    if not right or not all(leg.square for leg in found.legs):
        return ""
    unit = np.eye(3)
    straight = [replace(leg, driven=e, outer=e) for leg, e in zip(found.legs, unit, strict=True)]
    type2, type1, _ = _polynomials(straight, TURNS, ())
    names = type2.context().names()
    zeros = _zeros(type2, len(TURNS))
    at_zeros = [[p.subs({names[k]: 0 for k in zero}) for p in type1] for zero in zeros]
    if not zeros or not all(0 in values for values in at_zeros):
        return ""
    written = pose_equation(type2, ("f0", "f1", "f2", "f3"), (), 1)
    return (
        "counted from where the outer axes are along those of the base, by f0, f1, f2, f3, type 2 "
        f"is a sum of squares, {written}: zero only where two of them are, and there a leg is of "
        "type 1 (proven)"
    )


def _zeros(poly: Poly, count: int) -> list[frozenset[int]]:
    """Least sets of variables that are zero on the real zeros of a sum of squares; else none."""
    terms = [(tuple(int(e) for e in m), c) for m, c in poly.to_dict().items()]
    signs = {c > 0 for _, c in terms}
    if len(signs) != 1 or any(e % 2 for m, _ in terms for e in m):
        return []
    out: list[frozenset[int]] = []
    for size in range(1, count):
        for chosen in itertools.combinations(range(count), size):
            hit = all(any(m[k] for k in chosen) for m, _ in terms)
            if hit and not any(known <= set(chosen) for known in out):
                out.append(frozenset(chosen))
    return out


def _polynomials(
    legs: Sequence[SphereLeg], names: Sequence[str], joints: Sequence[int]
) -> tuple[Poly, tuple[Poly, ...], float]:
    """Type 2, type 1 of each leg, and what was changed; v is u x w where no joints are given."""
    context: Any = fmpq_mpoly_ctx.get([f"v{k}" for k in range(len(names))], Ordering.degrevlex)
    gens = context.gens()
    R, N = quaternion_turn(gens[:4])
    zero = context.constant(0)
    off, rows, ones = 0.0, [], []
    for k, leg in enumerate(legs):
        u, w0 = vector(leg.driven), vector(leg.outer)
        off = max(off, away((u, w0), (leg.driven, leg.outer)))
        base = [context.constant(rational(x)) for x in u]
        w = [sum((R[i][j] * rational(w0[j]) for j in range(3)), zero) for i in range(3)]
        v = cross(base, w)
        if joints:
            c, s = gens[4 + 2 * k : 6 + 2 * k]
            rest = (leg.driven @ leg.middle) * leg.driven
            parts = [leg.middle - rest, np.cross(leg.driven, leg.middle), rest]
            exact = [vector(p) for p in parts]
            off = max(off, away(exact, parts))
            v = [
                c * rational(exact[0][i]) + s * rational(exact[1][i]) + rational(exact[2][i])
                for i in range(3)
            ]
        moment = cross(v, w)
        rows.append(moment)
        ones.append(divided_by(dot(base, moment, zero), N))
    type2 = dot(rows[0], cross(rows[1], rows[2]), zero)
    return divided_by(type2, N), tuple(ones), off


def _legs(mechanism: Mechanism) -> list[SphereLeg]:
    """The legs; none of them where one is of another kind."""
    built, zero = structure(mechanism), at_zero(mechanism)
    centre = room_of(mechanism)[2]
    turn = np.array(zero.frames[mechanism.output_id].rotation)
    whole, last = path_to(mechanism, built.output), zero.axis[built.output - 1]
    # Of each way: its joints, the outer axis by the link before it, and by the output.
    ways = [(whole[:-1], last, last)]
    for loop, inner, outer in zip(mechanism.loops, *closing(mechanism), strict=True):
        if int(mechanism.model.frames[inner].parentJoint) == built.output:
            inner, outer = outer, inner
        if loop.kind == "6d" or int(mechanism.model.frames[outer].parentJoint) != built.output:
            return []
        radii = [np.array(zero.frames[k].translation) - centre for k in (inner, outer)]
        sizes = [float(np.linalg.norm(r)) for r in radii]
        if min(sizes) <= SMALL:
            return []
        joints = path_to(mechanism, int(mechanism.model.frames[inner].parentJoint))
        ways.append((joints, radii[0] / sizes[0], radii[1] / sizes[1]))
    out = []
    for joints, before, after in ways:
        if [j in mechanism.actuated for j in joints] != [True, False]:
            return []
        u, v = zero.axis[joints[0]], zero.axis[joints[1]]
        out.append(SphereLeg(joints[0], u, v, turn.T @ after, float(v @ before)))
    return out if {leg.joint for leg in out} == set(mechanism.actuated) else []
