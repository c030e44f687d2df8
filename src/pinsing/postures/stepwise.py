"""All inverse solutions step by step, of arms whose axes allow it: where a search then starts.

- *Three axes meet in a point* (those of the wrist, or of the shoulder where the chain is read from
  tip to base): the other three joints bring that point to a known place. The third of them solves
  an equation of degree four in the tangent of half its angle (Pieper, 1968; see
  `pinsing.postures.three_joints`), here found as a trigonometric polynomial of degree two; the
  second and first follow. What is left to the wrist is one rotation.
- *Three parallel axes* after one joint, and two that cross: the height of the crossing point along
  the three axes gives the first joint; the rotation then gives the last two and the sum of the
  three; in their plane two links reach a point.

Each equation is solved for all its roots, so no solution of the nominal geometry is left out
unless a root is nearly double or an angle is nearly free. That is said: ``clear`` is then False.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from pinsing._types import Array
from pinsing.kinematics.jacobian import tip_placement
from pinsing.postures.exact_chain import ExactChain, turns
from pinsing.postures.three_joints import Measures, Point
from pinsing.robot.nominal import Nominal

_NEAR = 0.05
"""Roots this far from real are starts, too: the arm itself may have what its nominal one lacks."""
_ALIKE = 1e-6
"""How far the tip of the nominal arm may be from that of the arm, over its length scale."""


@dataclass
class Steps:
    """Starts (K, n), and whether the equations left no doubt that these are all solutions.

    Of the starts those that miss the pose by less than ``near`` (radians, metres over the length
    scale) are solutions; the others belong to roots that are complex, but nearly real.
    """

    Q: Array
    clear: bool
    near: float


@dataclass
class _Roots:
    """Solves single equations, and keeps in mind whether each root was clear."""

    slack: float
    clear: bool = field(default=True)

    def wave(self, a: float, b: float, c: float, size: float) -> list[float]:
        """All x with ``a cos x + b sin x = c``; ``size`` is that of the numbers it came from."""
        r = math.hypot(a, b)
        if r < self.slack * size:
            self.clear &= abs(c) > 2 * self.slack * size
            return [] if abs(c) > _NEAR * size else [0.0, math.pi / 2, math.pi, -math.pi / 2]
        share = c / r
        if abs(abs(share) - 1) < self.slack * max(1.0, size / r):
            self.clear = False
        if abs(share) > 1 + max(_NEAR, self.slack):
            return []
        middle, half = math.atan2(b, a), math.acos(max(-1.0, min(1.0, share)))
        return [middle + half, middle - half]

    def angle(self, goal: Array, start: Array, size: float) -> float:
        """By which angle ``start`` (2,) is turned into the direction of ``goal`` (2,)."""
        self.clear &= min(math.hypot(*goal), math.hypot(*start)) > self.slack * size
        return math.atan2(goal[1], goal[0]) - math.atan2(start[1], start[0])

    def circle(self, value: Array) -> list[float]:
        """Zeros of a trigonometric polynomial of degree two, from its values at k turns / 8."""
        c = np.fft.fft(value) / 8
        size = np.abs(c).max()
        terms = np.array([c[2], c[1], c[0], c[-1], c[-2]])
        if abs(c[2]) < 1e-13 * size:
            terms = terms[1:-1]
            self.clear &= abs(c[1]) > 1e-9 * size
        z = np.roots(terms) if size > 0 else np.empty(0)
        if not len(z):
            self.clear = False
            return []
        off = np.abs(np.log(np.maximum(np.abs(z), 1e-300)))
        return self._kept(np.asarray(np.angle(z), float), off, np.abs(z[:, None] - z))

    def line(self, x: Array, value: Array, size: float) -> list[float]:
        """Real zeros of a polynomial of degree four or less, from its values at five x."""
        terms = np.polyfit(x / size, value, 4)
        terms[np.abs(terms) < 1e-12 * np.abs(terms).max()] = 0.0
        z = np.roots(terms)
        if not len(z):
            self.clear = False
            return []
        near = np.abs(z) < 1e6
        apart = np.abs(z[:, None] - z)
        return [
            size * v for v in self._kept(np.asarray(z.real, float), np.abs(z.imag) + ~near, apart)
        ]

    def _kept(self, at: Array, off: Array, apart: Array) -> list[float]:
        """Roots that are real or nearly; double ones are not clear."""
        near = off < max(_NEAR, self.slack)
        apart = apart + 9 * np.eye(len(at))
        self.clear &= not (apart[near][:, near] < math.sqrt(self.slack)).any()
        return [float(v) for v in at[near]]


def steps_of(geometry: Nominal, position: Array, rotation: Array | None) -> Steps | None:
    """All solutions of the nominal arm; None where its axes allow no such steps.

    Parameters
    ----------
    geometry : Nominal
        Of an arm whose joints are all free.
    position : (3,) array
        Of the tip in the base frame, metres.
    rotation : (3, 3) array or None
        Of the tip.
    """
    plan = geometry.arm.once("stepwise", lambda: _plan(geometry))
    if plan is None:
        return None
    # Times the change of the geometry by which it became nominal: what counts as nearly double.
    roots = _Roots(min(_NEAR, max(1e-7, 1e3 * geometry.jacobian_change)))
    R = np.eye(3) if rotation is None else rotation @ plan.tip.T
    p = position
    if plan.backward:
        R, p = R.T, -R.T @ position
    kinds = {"middle": _middle, "wrist": _wrist, "point": _three}
    x = np.array(list(kinds[plan.kind](plan, roots, R, p))).reshape(-1, plan.chain.n)
    Q = np.empty_like(x)
    order = list(plan.chain.order)
    Q[:, order] = plan.chain.sign * x - plan.chain.offset[order]
    return Steps(Q, roots.clear, 1e-8 + 10 * roots.slack)


@dataclass(frozen=True, eq=False)
class _Plan:
    """Which steps, on which chain."""

    kind: str
    chain: ExactChain
    backward: bool
    tip: Array
    """Rotation of the tip frame of the arm against the end of the chain."""
    centre: Array
    """A point that the last joints do not move, seen from the end of the chain."""
    along: float
    """Its height along the axis that it is on."""
    measures: Measures | None
    parallel: bool
    crossing: bool
    scale: float


def _plan(geometry: Nominal) -> _Plan | None:
    rows, arm = geometry.arm.task.rows, geometry.arm
    whole = rows == tuple(range(6)) and arm.n == 6
    if arm.coupling is not None or not (whole or (rows == (0, 1, 2) and arm.n == 3)):
        return None
    chain = ExactChain.of(geometry)
    X = _tip(geometry, chain)
    if X is None:
        return None
    if not whole:
        w = np.array([float(v) for v in chain.translation[3]])
        return _pointed("point", chain, False, X, w, 0.0, arm.length_scale)
    for back in (False, True):
        read = chain.backward() if back else chain
        if any(read.prismatic[3:]):
            continue
        middle = read.planar_middle()
        common = read.common_point(3)
        place = 3 if common is not None else 4 if middle is not None else None
        if place is None:
            continue
        along = float(common[2]) if common is not None else float(middle or 0.0)
        zero = np.zeros((1, 6))
        R, p = read.frames(zero)
        end = p[0, 5] + R[0, 5] @ read.numbers[1][6]
        E = R[0, 5] @ read.numbers[0][6]
        centre = E.T @ (p[0, place] + along * R[0, place][:, 2] - end)
        if common is None:
            return _Plan(
                "middle", read, back, X, centre, along, None, False, False, arm.length_scale
            )
        plan = _pointed("wrist", read, back, X, centre, along, arm.length_scale)
        if plan is not None:
            return plan
    return None


def _pointed(
    kind: str, chain: ExactChain, back: bool, X: Array, centre: Array, along: float, scale: float
) -> _Plan | None:
    found = chain.common_point(3) if kind == "wrist" else None
    w = chain.seen_before(3, Fraction(0) if found is None else found[2])
    point = Point.of(chain, w)
    if point is None or (point.parallel and point.tau[0] == 0 and point.tau[1] == 0):
        return None
    return _Plan(
        kind, chain, back, X, centre, along, point.numbers, point.parallel, point.crossing, scale
    )


def _tip(geometry: Nominal, chain: ExactChain) -> Array | None:
    """Rotation of the tip frame at the end of the chain; None where the two arms disagree."""
    arm = geometry.arm
    X = None
    for q in (np.zeros(arm.n), np.linspace(0.3, 1.1, arm.n)):
        R, p = chain.frames(chain.values(q[None]))
        C, c = chain.numbers
        last, value = R[0, -1], chain.values(q[None])[0, -1:]
        if chain.prismatic[-1]:
            p[0, -1] += last[:, 2] * value
        else:
            last = last @ turns(value)[0]
        there = tip_placement(arm, q)
        if np.abs(p[0, -1] + last @ c[-1] - there.translation).max() > _ALIKE * arm.length_scale:
            return None
        found = (last @ C[-1]).T @ there.rotation
        if X is not None and np.abs(found - X).max() > _ALIKE:
            return None
        X = found
    return X


def _three(plan: _Plan, roots: _Roots, R: Array, p: Array) -> Iterator[list[float]]:
    """Values of three joints that bring the point to p."""
    m = plan.measures
    assert m is not None
    C, c = plan.chain.numbers
    e, tau, flat = m.e, m.tau, m.tau[:2]
    y = C[0].T @ (p - c[0])
    shift = float((C[1].T @ c[1] - tau) @ e)
    y = y - np.array([0.0, 0.0, shift])
    Z, S = float(y[2] - e @ tau), float(y @ y - tau @ tau)
    L = max(plan.scale, float(np.linalg.norm(y)))

    def left(x: Array) -> Array:
        v = m.constant + m.cosine * x[:, None] if m.slides else _around(m, x)
        h = (v**2).sum(axis=1) + 2 * tau[2] * v[:, 2]
        if plan.parallel:
            return np.asarray((Z - e[2] * v[:, 2]) / L)
        if plan.crossing:
            return np.asarray((S - h) / L**2)
        far = (S - h) ** 2 / (4 * flat @ flat) + (Z - e[2] * v[:, 2]) ** 2 / (e[:2] @ e[:2])
        return np.asarray((far - (v[:, :2] ** 2).sum(axis=1)) / L**2)

    if m.slides:
        at = L * np.linspace(-2, 2, 5)
        thirds = roots.line(at, left(at), L)
    else:
        thirds = roots.circle(left(np.arange(8) * math.pi / 4))
    for third in thirds:
        v = (m.constant + m.cosine * third) if m.slides else _around(m, np.array([third]))[0]
        T, E = (S - v @ v - 2 * tau[2] * v[2]) / 2, Z - e[2] * v[2]
        if plan.parallel:
            seconds = _second(roots, flat, v, T, L)
        elif plan.crossing:
            seconds = _second(roots, e[:2], v, E, L)
        else:
            goal = flat * T / (flat @ flat) + e[:2] * E / (e[:2] @ e[:2])
            seconds = [roots.angle(goal, v[:2], L)]
        for second in seconds:
            u = turns(np.array([second]))[0] @ v
            here = C[1] @ (u + tau)
            yield [roots.angle(y[:2], here[:2], L), second, third]


def _around(m: Measures, x: Array) -> Array:
    return np.asarray(m.constant + m.cosine * np.cos(x)[:, None] + m.sine * np.sin(x)[:, None])


def _second(roots: _Roots, along: Array, v: Array, value: float, L: float) -> list[float]:
    """All x for which v, turned by x about z, has this product with a vector (2,)."""
    size = float(np.linalg.norm(along)) * L
    a, b = along[0] * v[0] + along[1] * v[1], along[1] * v[0] - along[0] * v[1]
    return roots.wave(float(a), float(b), float(value), size)


def _wrist(plan: _Plan, roots: _Roots, R: Array, p: Array) -> Iterator[list[float]]:
    """Values of six joints, the last three axes of which meet."""
    C, _ = plan.chain.numbers
    for first in _three(plan, roots, R, p + R @ plan.centre):
        x = np.array([[*first, 0.0, 0.0, 0.0]])
        before = plan.chain.frames(x)[0][0, 3]
        for rest in _turned(roots, C[4], C[5], before.T @ R @ C[6].T):
            yield [*first, *rest]


def _turned(roots: _Roots, A: Array, B: Array, M: Array) -> Iterator[tuple[float, float, float]]:
    """All angles with ``Rz(a) A Rz(b) B Rz(c) = M``."""
    a = A[2, 0] * B[0, 2] + A[2, 1] * B[1, 2]
    b = A[2, 1] * B[0, 2] - A[2, 0] * B[1, 2]
    for middle in roots.wave(a, b, float(M[2, 2] - A[2, 2] * B[2, 2]), 1.0):
        N = A @ turns(np.array([middle]))[0] @ B
        outer = roots.angle(M[:2, 2], N[:2, 2], 1.0)
        # Of the last the rest of the rotation, which holds where the outer one is free, too.
        rest = N.T @ turns(np.array([-outer]))[0] @ M
        yield outer, middle, math.atan2(rest[1, 0] - rest[0, 1], rest[0, 0] + rest[1, 1])


def _middle(plan: _Plan, roots: _Roots, R: Array, p: Array) -> Iterator[list[float]]:
    """Values of six joints, the second to fourth of which have parallel axes."""
    chain = plan.chain
    C, c = chain.numbers
    L = plan.scale
    centre = p + R @ plan.centre
    frames, origins = chain.frames(np.zeros((1, 6)))
    known = origins[0, 4] + plan.along * frames[0, 4][:, 2]
    height = float(frames[0, 1][:, 2] @ (known - origins[0, 1]))
    y = C[0].T @ (centre - c[0])
    n = C[1][:, 2]
    goal = height + float(n @ c[1]) - n[2] * y[2]
    flips = [math.copysign(1.0, C[k][2, 2]) for k in (2, 3)]
    for q0 in roots.wave(n[0] * y[0] + n[1] * y[1], n[0] * y[1] - n[1] * y[0], float(goal), L):
        R1 = C[0] @ turns(np.array([q0]))[0] @ C[1]
        p1 = c[0] + C[0] @ turns(np.array([q0]))[0] @ c[1]
        for sum_, q4, q5 in _turned(roots, C[2] @ C[3] @ C[4], C[5], R1.T @ R @ C[6].T):
            after = R1 @ turns(np.array([sum_]))[0] @ C[2] @ C[3]
            p4 = centre - plan.along * (after @ C[4])[:, 2]
            g = R1.T @ (p4 - after @ c[4] - p1)
            r, k = C[2].T @ c[2], c[3]
            far = (g[:2] @ g[:2] - c[2][:2] @ c[2][:2] - k[:2] @ k[:2]) / 2
            a, b = r[0] * k[0] + r[1] * k[1], r[1] * k[0] - r[0] * k[1]
            for q2 in roots.wave(float(a), float(b), float(far), L * L):
                there = c[2] + C[2] @ turns(np.array([q2]))[0] @ k
                q1 = roots.angle(g[:2], there[:2], L)
                q3 = flips[0] * flips[1] * (sum_ - q1 - flips[0] * q2)
                yield [q0, q1, q2, q3, q4, q5]
