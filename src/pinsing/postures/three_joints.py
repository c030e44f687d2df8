"""One step of an inverse solution that has two answers, told apart by a sign.

Where three joints bring a point: in how many ways, and what tells these apart.

The point is ``p = t + R Rz(q2) v(q3)`` before the first axis turns it. Its height Z along that
axis and its squared distance S from a point of the axis do not change with q1 (Pieper, 1968):

    Z = e . Rz(q2) v + const,    S = |v|^2 + 2 tau . Rz(q2) v + const,

e the first axis and tau the vector to the second one, seen from the second; the point on the
first axis is chosen such that tau is at right angles to e but for its height. Then q2 can be
eliminated: with a the distance of the first two axes and s the sine of their angle,

    P(q3) = ((S - h) / 2a)^2 + ((Z - e_z v_z) / s)^2 - |v|^2 + v_z^2 = 0,  h = |v|^2 + 2 tau_z v_z.

Where P' = 0 at a solution the arm is singular: S and Z are functions of q2 and q3 with P = 0
throughout, so P_S dS + P_Z dZ = 0 for both joints; P_S and P_Z are both zero only where the point
is on the second axis, where q2 does not move it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from pinsing._types import Array
from pinsing.postures.exact_chain import ExactChain, Vector, added, apply, transposed_apply
from pinsing.postures.root_bound import Deflated, one_root_left
from pinsing.robot.surd import Exact


@dataclass(frozen=True, eq=False)
class SolutionStage:
    """A step in which at most two values are left, of opposite signs of ``value``.

    Attributes
    ----------
    name : str
        "shoulder", "elbow" or "wrist" where the field has a word for it; else of its joint.
    joint : int
        The joint that it finds.
    value : callable
        Of configurations (N, n): (N,). Not zero where the arm is not singular.
    reason : str
        Why there are at most two.
    """

    name: str
    joint: int
    value: Callable[[Array], Array]
    reason: str


Pair = tuple[Exact, Exact]
_ZERO = Fraction(0)


@dataclass(frozen=True, eq=False)
class Point:
    """A point that three joints move, the first two of which turn; exact numbers.

    ``v = constant + cosine cos q3 + sine sin q3``, or ``constant + cosine q3`` where the third
    slides.
    """

    chain: ExactChain
    slides: bool
    e: Vector
    tau: Vector
    constant: Vector
    cosine: Vector
    sine: Vector

    @classmethod
    def of(cls, chain: ExactChain, w: Vector) -> Point | None:
        """The point w of the third joint's frame; None where one of the first two slides."""
        if chain.prismatic[0] or chain.prismatic[1]:
            return None
        R, t = chain.rotation[1], chain.translation[1]
        C, c = chain.rotation[2], chain.translation[2]
        e: Vector = (R[2][0], R[2][1], R[2][2])
        tau = transposed_apply(R, t)
        size = e[0] * e[0] + e[1] * e[1]
        if size != 0:
            shift = (tau[0] * e[0] + tau[1] * e[1]) / size
            tau = tau[0] - shift * e[0], tau[1] - shift * e[1], tau[2] - shift * e[2]
        nothing: Vector = (_ZERO, _ZERO, _ZERO)
        if chain.prismatic[2]:
            u: Vector = (C[0][2], C[1][2], C[2][2])
            return cls(chain, True, e, tau, added(c, apply(C, w)), u, nothing)
        return cls(
            chain,
            False,
            e,
            tau,
            added(c, apply(C, (_ZERO, _ZERO, w[2]))),
            apply(C, (w[0], w[1], _ZERO)),
            apply(C, (-w[1], w[0], _ZERO)),
        )

    @property
    def parallel(self) -> bool:
        """Whether the first two axes are."""
        return self.e[0] == 0 and self.e[1] == 0

    @property
    def crossing(self) -> bool:
        """Whether the first two axes meet in a point."""
        return not self.parallel and self.tau[0] == 0 and self.tau[1] == 0

    @property
    def height(self) -> Pair:
        """How v_z depends on q3: coefficients of cos and sin, or of q3 and its square."""
        return self.cosine[2], self.sine[2]

    @property
    def square(self) -> Pair:
        """How |v|^2 depends on q3."""
        if self.slides:
            return 2 * _dot(self.constant, self.cosine), Fraction(1)
        return 2 * _dot(self.constant, self.cosine), 2 * _dot(self.constant, self.sine)

    @property
    def h(self) -> Pair:
        """How h depends on q3."""
        n, m, twice = self.square, self.height, 2 * self.tau[2]
        return n[0] + twice * m[0], n[1] + twice * m[1]

    def mirror(self) -> Pair | None:
        """Direction (cos, sin) of the q3 about which P is even; ``(c, 1)`` for a slide; or None.

        None where P is not even. All of P must be, for every S and Z: the coefficients of these,
        and what is free of them.
        """
        n, m, h, ez = self.square, self.height, self.h, self.e[2]
        if self.slides:
            # h is quadratic, v_z linear: |v|^2 - v_z^2 and h are even about the same value.
            middle = -h[0] / 2
            radial: Exact = 1 - m[0] * m[0]
            slope = n[0] - 2 * self.constant[2] * m[0]
            even = ez * m[0] == 0 and slope + 2 * radial * middle == 0
            return (middle, Fraction(1)) if even else None
        s2 = self.e[0] * self.e[0] + self.e[1] * self.e[1]
        a2 = self.tau[0] * self.tau[0] + self.tau[1] * self.tau[1]
        h0 = (
            _dot(self.constant, self.constant)
            + _dot(self.cosine, self.cosine)
            + 2 * self.tau[2] * self.constant[2]
        )
        over = ez * ez / s2
        free = tuple(
            h0 * h[k] / (2 * a2) - n[k] + 2 * (1 + over) * self.constant[2] * m[k] for k in (0, 1)
        )
        first = [h, (ez * m[0], ez * m[1]), (free[0], free[1])]
        hh, mm = _squared(h), _squared(m)
        second = tuple(hh[k] / (8 * a2) + (1 + over) * mm[k] / 2 for k in (0, 1))
        given = next((p for p in first if not _is_zero(p)), None)
        if given is None:
            return None
        doubled = _squared(given)
        alike = all(_cross(given, p) == 0 for p in first)
        return given if alike and _cross(doubled, (second[0], second[1])) == 0 else None

    @cached_property
    def numbers(self) -> Measures:
        """The same as floats."""
        return Measures(
            self.chain,
            self.slides,
            *(np.array([float(x) for x in v]) for v in (self.e, self.tau)),
            *(np.array([float(x) for x in v]) for v in (self.constant, self.cosine, self.sine)),
        )


@dataclass(frozen=True, eq=False)
class Measures:
    """What the stages are computed from, at configurations Q (N, n) of the arm."""

    chain: ExactChain
    slides: bool
    e: Array
    tau: Array
    constant: Array
    cosine: Array
    sine: Array

    def third(self, Q: Array) -> tuple[Array, Array]:
        """The vector v and its derivative by q3, (N, 3) each."""
        q = self.chain.values(Q)[:, 2, None]
        if self.slides:
            return self.constant + self.cosine * q, np.broadcast_to(self.cosine, (len(q), 3))
        c, s = np.cos(q), np.sin(q)
        return (
            self.constant + self.cosine * c + self.sine * s,
            self.sine * c - self.cosine * s,
        )

    def second(self, Q: Array, v: Array) -> Array:
        """The vector v turned about the second axis, (N, 3)."""
        q = self.chain.values(Q)[:, 1]
        c, s = np.cos(q), np.sin(q)
        return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]], axis=1)

    def height_by_third(self, Q: Array) -> Array:
        """Derivative of v_z by q3."""
        return np.asarray(self.third(Q)[1][:, 2])

    def h_by_third(self, Q: Array) -> Array:
        """Derivative of h by q3."""
        v, dv = self.third(Q)
        return np.asarray(2 * (v * dv).sum(axis=1) + 2 * self.tau[2] * dv[:, 2])

    def by_second(self, along: Array) -> Callable[[Array], Array]:
        """Derivative by q2 of the part of ``Rz(q2) v`` along a vector."""

        def value(Q: Array) -> Array:
            u = self.second(Q, self.third(Q)[0])
            return np.asarray(along[1] * u[:, 0] - along[0] * u[:, 1])

        return value

    def slope(self, Q: Array) -> Array:
        """Derivative P' at q3, S and Z those of the configuration."""
        v, dv = self.third(Q)
        u = self.second(Q, v)
        T, E = u[:, :2] @ self.tau[:2], u[:, :2] @ self.e[:2]
        a2, s2 = self.tau[:2] @ self.tau[:2], self.e[:2] @ self.e[:2]
        out = -T * self.h_by_third(Q) / a2 - 2 * E * self.e[2] * dv[:, 2] / s2
        return np.asarray(out - 2 * (v[:, :2] * dv[:, :2]).sum(axis=1))

    def from_mirror(self, mirror: Pair) -> Callable[[Array], Array]:
        """Sine of the angle of q3 from where P is even, or the length."""
        c, s = float(mirror[0]), float(mirror[1])

        def value(Q: Array) -> Array:
            q = self.chain.values(Q)[:, 2]
            if self.slides:
                return np.asarray(q - c)
            return np.asarray((c * np.sin(q) - s * np.cos(q)) / np.hypot(c, s))

        return value

    def deflated(self) -> Deflated:
        """What is left of P where the root q3 is taken out."""
        return Deflated(self.e, self.tau, self.constant, self.cosine, self.sine)


def ways_of(chain: ExactChain, w: Vector) -> tuple[SolutionStage, ...] | None:
    """Stages that tell all ways apart in which three joints bring a point somewhere.

    Parameters
    ----------
    chain : ExactChain
        A chain; its first three joints count.
    w : exact triple
        The point in the frame that the third joint moves.

    Returns
    -------
    tuple of Stage or None
        None where no such stages are known. Two configurations that bring the point to the same
        place, singular neither, and agree in all signs are the same but for whole turns.
    """
    point = Point.of(chain, w)
    if point is None:
        return None
    m, h, third, second = point.numbers, point.h, chain.order[2], chain.order[1]
    if point.parallel:
        if _is_zero(point.height) or (point.tau[0] == 0 and point.tau[1] == 0):
            return None
        said = "the first two axes are parallel: the height of the point depends on"
        far = f"its distance from the first axis leaves two values of joint {second + 1}"
        last = SolutionStage("shoulder", second, m.by_second(m.tau), far)
        if point.slides:
            return (last,)
        first = f"{said} joint {third + 1} alone, which has two values"
        return SolutionStage("elbow", third, m.height_by_third, first), last
    if point.crossing:
        if _is_zero(h):
            return None
        first = (
            "the first two axes cross: how far the point is from there depends on "
            f"joint {third + 1} alone, which has two values"
        )
        high = f"its height leaves two values of joint {second + 1}"
        return (
            SolutionStage("elbow", third, m.h_by_third, first),
            SolutionStage("shoulder", second, m.by_second(m.e), high),
        )
    mirror = point.mirror()
    if mirror is not None:
        aside = m.from_mirror(mirror)
        first = (
            f"height and distance of the point are the same for two values of joint {third + 1} "
            "that are mirror images, whatever the others"
        )
        what = "square of its length" if point.slides else "cosine of its angle"
        far = f"the {what} from the mirror solves a quadratic equation"

        def steep(Q: Array) -> Array:
            side = aside(Q)
            safe = np.where(side == 0, 1.0, side)
            return np.where(side == 0, 0.0, m.slope(Q) / safe)

        return SolutionStage("elbow", third, aside, first), SolutionStage(
            "shoulder", second, steep, far
        )
    if point.slides or not one_root_left(m.deflated()):
        return None
    only = (
        f"joint {third + 1} solves an equation that has no more than two real roots wherever the "
        "point is (its discriminant, without the known root, is negative on all of the torus of "
        f"joints {second + 1} and {third + 1}: certified), of opposite signs of its slope"
    )
    return (SolutionStage("", third, m.slope, only),)


def _dot(a: Sequence[Exact], b: Sequence[Exact]) -> Exact:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _is_zero(a: Pair) -> bool:
    return a[0] == 0 and a[1] == 0


def _cross(a: Pair, b: Pair) -> Exact:
    return a[0] * b[1] - a[1] * b[0]


def _squared(a: Pair) -> Pair:
    """The pair as a complex number, squared: direction of twice the angle."""
    return a[0] * a[0] - a[1] * a[1], 2 * a[0] * a[1]
