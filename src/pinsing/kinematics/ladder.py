"""Arms whose inverse solution goes step by step, each with two answers that a sign tells apart.

**Theorem.** Let each step of an inverse solution leave at most two values of one joint, given the
pose and the joints found before, of opposite signs of a function that is zero only where the arm
is singular. Then no two regular inverse solutions of a pose agree in all signs. A sign cannot
change along a way without a singular configuration. So two inverse solutions of one pose are
never in one aspect: the arm is not cuspidal, and a pose has at most 2^k regular solutions, k the
number of steps.

Why the functions are zero only at singular configurations: let ``g(x; T) = 0`` be the equation of
a step, x its joint and T the pose, which holds for all configurations. If ``dg/dx = 0`` at one,
then for every velocity of the joints dg is zero, so dg/dT is zero on every velocity of the tip
that keeps the joints found before: on all of them, if the arm is regular. In each step here dg/dT
is not zero unless the arm is singular for a reason that the step names.

- *Spherical wrist* (the last three axes meet in a point; or the first three, the chain then read
  from tip to base): the point is moved by three joints alone (see below);
  then the rotation of the wrist is known, and with it the angle of its outer axes, which leaves
  two values of the middle one, of opposite signs of the derivative; the outer ones are then known
  unless their axes are parallel, where the arm is singular.
- *Three parallel axes* between one and two joints, these two crossing (or the mirror image): the
  crossing point is known from the pose, and so is its height along the parallel axes, which
  leaves two values of the first joint; the angle between them and the last axis leaves two of the
  joint before it; the last one is then known; in the plane of the three, two links reach a point.
- *All axes parallel*: two links reach a point in a plane; a slide along them changes nothing.

Names of postures where the field has some: shoulder left or right, elbow up or down, wrist.

After Lee and Ziegler (1984), put so that they do not depend on the frames of a drawing. For arms
whose second axis is at right angles to the first, with a point C that is known from the pose
(the centre of the wrist):

- *shoulder left*, *right*: seen from the first axis towards C, the plane in which the arm moves
  passes on the left, or on the right. Where it passes through the first axis, *front* means that
  C is on the side where axis 2 is, or else where C is at the middle of the joint ranges, or else
  (C on the first axis there) where a positive joint 2 leans an upright arm.
- *elbow up*, *down*: axis 3 is above, or below, the line from axis 2 to C (to axis 4 where that is
  parallel to both, as of a UR5) while C is ahead. Above is where the first axis points, turned to
  the upper half of the base. Axes 2 and 3 are parallel.
- *wrist no-flip*, *flip*: joint 5 turns axis 6 away from axis 4 by 0 to 180 degrees, or by 180 to
  360 degrees, counted from where axes 4 and 6 are nearest to having one direction. FANUC counts
  joint 5 the other way: its pendant shows N at J5 = -90 degrees.

Each changes only at a singular configuration, since the signs above do.

Where an equation of one joint has one real root beside the known one: proven on a torus.

With ``x = tan(d / 2)``, d the angle from the known root of P, P (1 + x^2)^2 / 2x is a cubic in x
whose coefficients are trigonometric polynomials of q2 and q3. It has one real root, x = infinity
counted, exactly where its discriminant is negative. That is of degree 4 in q2 and 8 in q3: a
trigonometric sum, of which boxes show that it is negative wherever it may have its largest value.

One step of an inverse solution that has two answers, told apart by a sign.

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

The exact chain of an arm, and how its axes lie: parallel, crossing, through one point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from pinsing.kinematics.jacobian import joint_frames
from pinsing.measures import ROUNDING, Array, Chain, NDArray
from pinsing.robot.arm import Arm
from pinsing.robot.mimic import exact_generic_rank
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import Exact

Exacts: TypeAlias = NDArray[Any]
"""Exact numbers, as objects: sums and products of such arrays are exact."""


@dataclass(frozen=True, eq=False)
class ExactChain:
    """Placements between joints that turn about z, or slide along it, as exact numbers."""

    # of placement i, which stands before joint i; the last before the tip
    rotation: Exacts  # (n + 1, 3, 3)
    translation: Exacts  # (n + 1, 3), metres
    prismatic: tuple[bool, ...]  # which joints slide
    # by which joint values are multiplied: -1 for a chain that is read from tip to base
    sign: float
    order: tuple[int, ...]  # the arm's joint at each place
    offset: Array  # (n,): added to the values of the arm's joints, radians

    @classmethod
    def of(cls, nominal: Nominal) -> ExactChain:
        """The chain from base to tip."""
        R, t = (np.array(x, dtype=object) for x in (nominal.rotation, nominal.translation))
        order = tuple(range(len(nominal.prismatic)))
        return cls(R, t, nominal.prismatic, 1.0, order, nominal.offset)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    def backward(self) -> ExactChain:
        """The chain from tip to base: the same arm, with its tip held and its base moved."""
        turned = self.rotation[::-1].swapaxes(1, 2)
        moved = -(turned @ self.translation[::-1, :, None])[:, :, 0]
        return ExactChain(
            turned, moved, self.prismatic[::-1], -self.sign, self.order[::-1], self.offset
        )

    def values(self, Q: Array) -> Array:
        """Joint values (..., n) in the order and with the zeros of this chain."""
        return self.sign * (Q + self.offset)[..., list(self.order)]

    @cached_property
    def numbers(self) -> Chain:
        """The same as floats."""
        R, t = self.rotation.astype(float), self.translation.astype(float)
        return Chain(R, t, np.array(self.prismatic, dtype=bool))

    def frames(self, x: Array) -> tuple[Array, Array]:
        """Return `joint_frames` at values x (N, n) of this chain."""
        return joint_frames(self.numbers, x)

    def parallel(self, j: int) -> bool:
        """Return True if axes j and j + 1 are parallel."""
        return not self.rotation[j + 1, :2, 2].any()

    def crossing(self, j: int) -> tuple[Exact, Exact] | None:
        """Heights along axes j and j + 1 of the point where they cross; None if they do not."""
        axis, t = self.rotation[j + 1, :, 2], self.translation[j + 1]
        size = axis[:2] @ axis[:2]
        if size == 0 or _cross(t, axis) != 0:
            return None
        along = -(t[:2] @ axis[:2]) / size
        return t[2] + along * axis[2], along

    def seen_before(self, j: int, height: Exact) -> Exacts:
        """The point at a height along axis j, in the frame that joint j - 1 moves."""
        return np.asarray(self.translation[j] + self.rotation[j, :, 2] * height)


def _cross(a: Exacts, b: Exacts) -> Exact:
    """Height of the vector product of two vectors."""
    return a[0] * b[1] - a[1] * b[0]  # type: ignore[no-any-return]


def _squared(a: Exacts) -> Exacts:
    """The pair as a complex number, squared: direction of twice the angle."""
    return np.array([a[0] * a[0] - a[1] * a[1], 2 * a[0] * a[1]])


MOST = 800_000
"""Boxes after which a proof is given up."""


def _discriminant(c0: Array, c1: Array, c2: Array, c3: Array, sign: float = 1.0) -> Array:
    return np.asarray(
        18 * c3 * c2 * c1 * c0
        - sign * 4 * c2**3 * c0
        + c2**2 * c1**2
        - sign * 4 * c3 * c1**3
        - sign * 27 * c3**2 * c0**2
    )


def one_root_left(cubic: Point) -> bool:
    """Return True if the discriminant is proven negative all over the torus of q2 and q3."""
    # It is largest somewhere: where no box around shows growth in some direction.
    (amplitude, phase, rate), made = cubic.expanded(), 0
    squares = rate[:, [0, 0, 1, 1]] * rate[:, [0, 1, 0, 1]]
    steep = np.linalg.norm(rate, axis=1)
    # Errors of a gradient. The sum of the squares of the coefficients' errors is the mean of the
    # squares of the values' (Parseval); two of each term count.
    noise = np.sqrt(2 * len(steep)) * cubic.rounding + 1e-13 * amplitude.sum()
    noise *= steep.max()
    width = 2 * np.pi / 32
    at = width * (np.arange(32) + 0.5) - np.pi
    x = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    while len(x):
        made += len(x)
        h = width / 2 * (1 + 1e-9)  # a little too wide: rounding leaves no gap
        value = cubic.discriminant(x) + cubic.rounding
        if made > MOST or (value >= 0).any():
            return False
        angle = x @ rate.T + phase
        gradient = -(amplitude * np.sin(angle)) @ rate
        bend = -(amplitude * np.cos(angle)) @ squares
        reach = h * np.abs(rate).sum(axis=1)
        swing = h * np.abs(gradient).sum(axis=1) + h**2 / 2 * np.abs(bend).sum(axis=1)
        top = value + swing + amplitude @ reach**3 / 6 + 4 * h * noise
        # The derivative along the gradient, less how much it changes in the box.
        size = np.linalg.norm(gradient, axis=1)
        change = np.abs(np.einsum("nij,nj->ni", bend.reshape(-1, 2, 2), gradient)).sum(axis=1)
        rest = (amplitude * steep) @ reach**2 / 2 + 4 * noise
        x = x[(top >= 0) & (size**2 <= h * change + size * rest)]
        width /= 2
        x = (x[:, None] + width / 2 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])).reshape(-1, 2)
    return True


@dataclass(frozen=True, eq=False)
class SolutionStage:
    """A step in which at most two values are left, of opposite signs of ``value``."""

    name: str  # "shoulder", "elbow" or "wrist" where the field has a word for it; else of its joint
    joint: int  # the joint that it finds
    # of configurations (N, n): (N,). Not zero where the arm is not singular
    value: Callable[[Array], Array]
    reason: str  # why there are at most two


@dataclass(frozen=True, eq=False)
class Point:
    """A point that three joints move, the first two of which turn; numbers exact, or floats.

    ``v = constant + cosine cos q3 + sine sin q3``, or ``constant + cosine q3`` for a slide.
    """

    chain: ExactChain
    slides: bool
    e: Exacts
    tau: Exacts
    constant: Exacts
    cosine: Exacts
    sine: Exacts

    @classmethod
    def of(cls, chain: ExactChain, w: Exacts) -> Point | None:
        """The point w of the third joint's frame; None where one of the first two slides."""
        if chain.prismatic[0] or chain.prismatic[1]:
            return None
        (_, R, C, *_), (_, t, c, *_) = chain.rotation, chain.translation
        e, tau = R[2], R.T @ t
        if (size := e[:2] @ e[:2]) != 0:
            tau = tau - (tau[:2] @ e[:2]) / size * e
        x, y, z = C.T
        if chain.prismatic[2]:
            return cls(chain, True, e, tau, c + C @ w, z, 0 * z)
        return cls(chain, False, e, tau, c + z * w[2], x * w[0] + y * w[1], y * w[0] - x * w[1])

    @cached_property
    def numbers(self) -> Point:
        """The same as floats, for what is asked at configurations Q (N, n) of the arm."""
        exact = ("e", "tau", "constant", "cosine", "sine")
        return replace(self, **{name: getattr(self, name).astype(float) for name in exact})

    @property
    def height(self) -> Exacts:
        """v_z as a function of q3: coefficients of cos and sin, or of q3 and its square."""
        return np.array([self.cosine[2], self.sine[2]])

    @property
    def square(self) -> Exacts:
        """|v|^2 as a function of q3."""
        last = 1 if self.slides else 2 * (self.constant @ self.sine)
        return np.array([2 * (self.constant @ self.cosine), last])

    @property
    def h(self) -> Exacts:
        """The number h as a function of q3."""
        return np.asarray(self.square + self.height * (2 * self.tau[2]))

    def mirror(self) -> Exacts | None:
        """Return the direction (cos, sin) of the q3 about which P is even, ``(c, 1)`` for a slide.

        None where P, with all its coefficients of S and Z, is not.
        """
        n, m, h, ez = self.square, self.height, self.h, self.e[2]
        if self.slides:
            # h is quadratic, v_z linear: |v|^2 - v_z^2 and h are even about the same value.
            middle = -h[0] / 2
            slope = n[0] - 2 * self.constant[2] * m[0]
            even = ez * m[0] == 0 and slope + 2 * (1 - m[0] * m[0]) * middle == 0
            return np.array([middle, 1]) if even else None
        a2 = self.tau[:2] @ self.tau[:2]
        h0 = self.constant @ self.constant + self.cosine @ self.cosine
        h0 = h0 + 2 * self.tau[2] * self.constant[2]
        over = 1 + ez * ez / (self.e[:2] @ self.e[:2])
        # Arrays come first: numbers with square roots take none as the other factor.
        first = [h, m * ez, h * (h0 / (2 * a2)) - n + m * (2 * over * self.constant[2])]
        second = _squared(h) / (8 * a2) + _squared(m) * (over / 2)
        given = next((p for p in first if p.any()), None)
        if given is None or any(_cross(given, p) != 0 for p in first):
            return None
        return given if _cross(_squared(given), second) == 0 else None

    def third(self, Q: Array) -> tuple[Array, Array]:
        """The vector v and its derivative by q3, (N, 3) each."""
        q = self.chain.values(Q)[:, 2, None]
        if self.slides:
            return self.constant + self.cosine * q, np.broadcast_to(self.cosine, (len(q), 3))
        c, s = np.cos(q), np.sin(q)
        return self.constant + self.cosine * c + self.sine * s, self.sine * c - self.cosine * s

    def second(self, Q: Array, v: Array) -> Array:
        """The vector v turned about the second axis, its first two components (2, N)."""
        q = self.chain.values(Q)[:, 1]
        c, s = np.cos(q), np.sin(q)
        return np.array([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]])

    def h_by_third(self, Q: Array) -> Array:
        """Derivative of h by q3."""
        v, dv = self.third(Q)
        return np.asarray(2 * (v * dv).sum(axis=1) + 2 * self.tau[2] * dv[:, 2])

    def by_second(self, along: Array, Q: Array) -> Array:
        """Derivative by q2 of the part of ``Rz(q2) v`` along a vector."""
        u = self.second(Q, self.third(Q)[0])
        return np.asarray(along[1] * u[0] - along[0] * u[1])

    def slope(self, Q: Array) -> Array:
        """Derivative P' at q3, S and Z those of the configuration."""
        v, dv = self.third(Q)
        tau, e, u = self.tau[:2], self.e[:2], self.second(Q, v)
        out = -(tau @ u) * self.h_by_third(Q) / (tau @ tau)
        out = out - 2 * (e @ u) * self.e[2] * dv[:, 2] / (e @ e)
        return np.asarray(out - 2 * (v[:, :2] * dv[:, :2]).sum(axis=1))

    def from_mirror(self, mirror: Exacts, Q: Array) -> Array:
        """Sine of the angle of q3 from where P is even, or the length."""
        q = self.chain.values(Q)[:, 2]
        c, s = mirror.astype(float)
        if self.slides:
            return np.asarray(q - c)
        return np.asarray((c * np.sin(q) - s * np.cos(q)) / np.hypot(c, s))

    def discriminant(self, x: Array) -> Array:
        """That of the cubic which is left of P without the root q3, at q2 and q3 (N, 2): (N,)."""
        waves = np.stack([np.cos(x), np.sin(x)])
        return _discriminant(*self._cubic(waves[:, :, 0], waves[:, :, 1], 1.0))

    def _cubic(self, second: Array, third: Array, s: float) -> tuple[Array, Array, Array, Array]:
        """Return coefficients, for cosines and sines of both joints; with s = -1 size bounds."""
        # Those are of absolute values of all numbers, with cosines and sines of 1.

        def own(a: Array) -> Array:
            return a if s > 0 else np.abs(a)

        def turning(a: Array) -> tuple[Array, Array]:  # derivatives of a cosine and a sine
            return a[1] * third[0] - s * a[0] * third[1], -s * (a[0] * third[0] + a[1] * third[1])

        constant, cosine, sine, tau, e = map(
            own, (self.constant, self.cosine, self.sine, self.tau, self.e)
        )
        v = constant[:, None] + cosine[:, None] * third[0] + sine[:, None] * third[1]
        u = (second[0] * v[0] - s * second[1] * v[1], second[1] * v[0] + second[0] * v[1])
        T, E = (k[0] * u[0] + k[1] * u[1] for k in (tau, e))
        n = 2 * np.array([constant @ cosine, constant @ sine])
        rise = np.array([cosine[2], sine[2]])
        # What v_z, h and |v|^2 are linear in: 2 x (slope - bend x) / (1 + x^2) from the root on.
        V, H, N = turning(rise), turning(n + 2 * tau[2] * rise), turning(n)
        a2, s2 = float(tau[:2] @ tau[:2]), float(e[:2] @ e[:2])
        over = 1 + e[2] ** 2 / s2
        line = [
            -s * T * H[k] / a2 - s * 2 * e[2] / s2 * E * V[k] - s * N[k] + 2 * v[2] * V[k]
            for k in (0, 1)
        ]
        square = [
            0.5 / a2 * H[0] ** 2 + 2 * over * V[0] ** 2,
            H[0] * H[1] / a2 + 4 * over * V[0] * V[1],
            0.5 / a2 * H[1] ** 2 + 2 * over * V[1] ** 2,
        ]
        return line[0], line[1] + square[0], line[0] + square[1], line[1] + square[2]

    @cached_property
    def rounding(self) -> float:
        """A bound of the error of a computed discriminant: it comes of some 120 roundings."""
        ones = np.ones((2, 1))
        return 2e-14 * float(_discriminant(*self._cubic(ones, ones, -1.0), sign=-1.0)[0])

    def expanded(self) -> tuple[Array, Array, Array]:
        """The discriminant as a sum of cosines in q2 and q3: amplitudes, phases, rates (T, 2)."""
        most, last = 4, 8  # degrees in q2 and q3
        grid = np.indices((4 * most, 4 * last)) * np.pi / 2 / np.reshape([most, last], (2, 1, 1))
        values = self.discriminant(grid.reshape(2, -1).T).reshape(grid.shape[1:])
        # Terms with j = 0 come twice, once with i and once with -i.
        waves = np.fft.rfft2(values) / values.size
        places = np.indices((2 * most + 1, last + 1)).reshape(2, -1)
        i, j = places[0] - most, places[1]
        terms = np.where(j > 0, 2, 1) * waves[i, j]
        return np.abs(terms), np.angle(terms), np.stack([i, j], axis=1).astype(float)


def ways_of(chain: ExactChain, w: Exacts) -> tuple[SolutionStage, ...] | None:
    """Return stages that tell apart all ways in which three joints bring w somewhere, or None."""
    # Two regular configurations that bring the point to the same place and agree in all signs are
    # the same but for whole turns.
    if (point := Point.of(chain, w)) is None:
        return None
    m, third, second = point.numbers, chain.order[2], chain.order[1]
    if not point.e[:2].any():  # the first two axes are parallel
        if not point.height.any() or not point.tau[:2].any():
            return None
        said = "the first two axes are parallel: the height of the point depends on"
        far = f"its distance from the first axis leaves two values of joint {second + 1}"
        last = SolutionStage("shoulder", second, lambda Q: m.by_second(m.tau, Q), far)
        if point.slides:
            return (last,)
        first = f"{said} joint {third + 1} alone, which has two values"
        return SolutionStage("elbow", third, lambda Q: m.third(Q)[1][:, 2], first), last
    if not point.tau[:2].any():  # the first two axes meet in a point
        if not point.h.any():
            return None
        first = (
            "the first two axes cross: how far the point is from there depends on "
            f"joint {third + 1} alone, which has two values"
        )
        high = f"its height leaves two values of joint {second + 1}"
        return (
            SolutionStage("elbow", third, m.h_by_third, first),
            SolutionStage("shoulder", second, lambda Q: m.by_second(m.e, Q), high),
        )
    if (mirror := point.mirror()) is not None:
        first = (
            f"height and distance of the point are the same for two values of joint {third + 1} "
            "that are mirror images, whatever the others"
        )
        what = "square of its length" if point.slides else "cosine of its angle"
        far = f"the {what} from the mirror solves a quadratic equation"

        def steep(Q: Array) -> Array:
            side = m.from_mirror(mirror, Q)
            return np.where(side == 0, 0.0, m.slope(Q) / np.where(side == 0, 1.0, side))

        return (
            SolutionStage("elbow", third, lambda Q: m.from_mirror(mirror, Q), first),
            SolutionStage("shoulder", second, steep, far),
        )
    if point.slides or not one_root_left(m):
        return None
    only = (
        f"joint {third + 1} solves an equation that has no more than two real roots wherever the "
        "point is (its discriminant, without the known root, is negative on all of the torus of "
        f"joints {second + 1} and {third + 1}: certified), of opposite signs of its slope"
    )
    return (SolutionStage("", third, m.slope, only),)


@dataclass(frozen=True, eq=False)
class Ladder:
    """Steps of an inverse solution whose signs tell all solutions of a pose apart."""

    stages: tuple[SolutionStage, ...]  # the steps with two answers
    kind: str  # what the arm is: in a few words
    chain: ExactChain  # the chain as it is read: from base to tip, or from tip to base
    # a point that is known from the pose: a place in the chain, and a height along its axis
    point: tuple[int, float] | None

    @property
    def most(self) -> int:
        """A pose has no more regular solutions."""
        return 1 << len(self.stages)

    @property
    def reason(self) -> str:
        """Why the arm is not cuspidal."""
        steps = "; ".join(s.reason for s in self.stages)
        count = f"{len(self.stages)} signs" if len(self.stages) > 1 else "one sign"
        tell = "tell" if len(self.stages) > 1 else "tells"
        return (
            f"{self.kind}: {count}, which only a singular configuration changes, {tell} all "
            f"inverse solutions of a pose apart, at most {self.most} ({steps})"
        )

    def signs(self, Q: Array) -> Array:
        """Signs (N, k) at configurations (N, n)."""
        return np.stack([np.sign(s.value(Q)) for s in self.stages], axis=1)


def ladder_of(geometry: Nominal) -> Ladder | None:
    """The steps of an arm, or None where no theorem that is known here holds for it."""
    arm = geometry.arm
    return None if arm.coupling is not None else arm.once("ladder", lambda: _ladder(geometry))


def _ladder(geometry: Nominal) -> Ladder | None:
    rows, n = geometry.arm.task.rows, geometry.arm.n
    if geometry.arm.task.at_tip or exact_generic_rank(geometry, geometry.arm.task) != n:
        return None
    chain = ExactChain.of(geometry)
    if rows == (0, 1, 2) and n == 3:
        stages = ways_of(chain, chain.seen_before(3, Fraction(0)))
        return None if stages is None else Ladder(stages, "three joints move a point", chain, None)
    if rows == tuple(range(6)) and n == 6:
        ways = (read for read in (chain, chain.backward()) if not any(read.prismatic[3:]))
        return next(filter(None, (_wrist(read) or _planar_middle(read) for read in ways)), None)
    upright = not chain.rotation[0, :2, 2].any()  # the first axis is along z of the base
    plane = rows == tuple(range(6)) or (rows == (0, 1, 5) and upright)
    turning = tuple(j for j in range(n) if not chain.prismatic[j])
    if not plane or len(turning) != 3 or not all(chain.parallel(j) for j in range(n - 1)):
        return None
    return Ladder((_two_links(chain, turning),), "all axes are parallel", chain, None)


def _wrist(chain: ExactChain) -> Ladder | None:
    first, second = chain.crossing(3), chain.crossing(4)
    if first is None or second is None or first[1] != second[0]:
        return None
    height = first[0]
    if (stages := ways_of(chain, chain.seen_before(3, height))) is None:
        return None
    where = "wrist" if chain.sign > 0 else "shoulder"
    kind = f"three axes of the {where} meet in a point"
    return Ladder((*stages, _bent(chain, 4, where)), kind, chain, (3, float(height)))


def _bent(chain: ExactChain, j: int, name: str) -> SolutionStage:
    """The angle of axes j - 1 and j + 1 as a step that finds joint j."""

    def value(Q: Array) -> Array:
        x, C = chain.values(Q)[:, j], chain.numbers.R
        a, b = C[j][2], C[j + 1][:, 2]
        c, s = np.cos(x), np.sin(x)
        return np.asarray(-s * (a[0] * b[0] + a[1] * b[1]) + c * (a[1] * b[0] - a[0] * b[1]))

    joint = chain.order[j]
    outer = sorted((chain.order[j - 1] + 1, chain.order[j + 1] + 1))
    said = f"the angle between axes {outer[0]} and {outer[1]} leaves two values of joint"
    return SolutionStage(name, joint, value, f"{said} {joint + 1}")


def _planar_middle(chain: ExactChain) -> Ladder | None:
    # The joints all turn, and the axes before and after these three are not parallel to them.
    crossing = chain.crossing(4)
    if any(chain.prismatic) or crossing is None or chain.parallel(0) or chain.parallel(3):
        return None
    if not (chain.parallel(1) and chain.parallel(2)):
        return None
    height = float(crossing[0])

    def shoulder(Q: Array) -> Array:
        R, p = chain.frames(chain.values(Q))
        c = p[:, 4] + height * R[:, 4, :, 2]
        return np.asarray((np.cross(R[:, 0, :, 2], R[:, 1, :, 2]) * (c - p[:, 0])).sum(axis=1))

    axes = ", ".join(str(j + 1) for j in sorted(chain.order[1:4]))
    first = chain.order[0]
    said = f"the height of a known point along axes {axes} leaves two values of joint {first + 1}"
    stages = (
        SolutionStage("shoulder", first, shoulder, said),
        _two_links(chain, (1, 2, 3)),
        _bent(chain, 4, "wrist"),
    )
    return Ladder(stages, f"axes {axes} are parallel, and two others cross", chain, (4, height))


def _two_links(chain: ExactChain, places: tuple[int, ...]) -> SolutionStage:
    i, j, k = places

    def value(Q: Array) -> Array:
        R, p = chain.frames(chain.values(Q))
        inner, outer = p[:, j] - p[:, i], p[:, k] - p[:, j]
        return np.asarray((inner * np.cross(R[:, j, :, 2], outer)).sum(axis=1))

    joint = chain.order[j]
    said = f"two links reach a point in a plane by two values of joint {joint + 1}"
    return SolutionStage("elbow", joint, value, said)


def posture_names(geometry: Nominal | None, Q: Array) -> list[tuple[str, ...]]:
    """Names of the posture at configurations Q (N, n); empty where the field has none."""
    nameless: list[tuple[str, ...]] = [() for _ in Q]
    if geometry is None or not nameless:
        return nameless
    ladder = ladder_of(geometry)
    if ladder is None or ladder.point is None or ladder.chain.sign < 0:
        return nameless
    # The derivative of the cosine of the wrist's angle is negative while that grows.
    sign = -1 if geometry.arm.source.is_by("Fanuc") else 1
    stays = sign * ladder.stages[-1].value(Q) < 0
    words = _shoulder_and_elbow(geometry.arm, ladder.chain, *ladder.point, Q)
    words.append(np.where(stays, "wrist no-flip", "wrist flip").tolist())
    return [tuple(w) for w in zip(*words, strict=True)]


def _shoulder_and_elbow(
    arm: Arm, chain: ExactChain, place: int, height: float, Q: Array
) -> list[list[str]]:
    if any(chain.prismatic[:2]) or chain.rotation[1, 2, 2] != 0:
        return []
    R, p = chain.frames(chain.values(np.stack([np.mean(arm.span, axis=0), *Q])))
    up, across = R[:, 0, :, 2], R[:, 1, :, 2]
    up = np.where(up[:, 2:] < -ROUNDING, -up, up)
    C = p[:, place] + height * R[:, place, :, 2] - p[:, 0]
    shoulder, elbow = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    # Where axis 4 is parallel too, the bend of the links between these three tells the postures.
    end = p[:, 3] - p[:, 0] if chain.parallel(1) and chain.parallel(2) else C
    forward = np.cross(up, across)
    ahead, aside = (forward * C).sum(axis=1), (across * C).sum(axis=1)
    bend = (across * np.cross(end - shoulder, elbow - shoulder)).sum(axis=1)
    if np.ptp(aside) > ROUNDING:
        return []
    if np.abs(aside).max() > ROUNDING:
        said = np.where(ahead * aside > 0, "shoulder right", "shoulder left")
    else:
        # A positive joint 2 leans an upright arm against what is ahead.
        out = (forward[0] * shoulder[0]).sum()
        side = next(x for x in (out, ahead[0], -1.0) if abs(x) > ROUNDING)
        said = np.where(ahead * side > 0, "shoulder front", "shoulder back")
    words = [said[1:].tolist()]
    if chain.parallel(1) and not chain.prismatic[2]:
        words.append(np.where(ahead * bend > 0, "elbow up", "elbow down")[1:].tolist())
    return words
