"""How far the singular configurations of a robot are from the families of its design, proven.

With D the determinant of the robot's task Jacobian, and ``P = h f1 f2 ...`` a product of the
conditions of the design's families and a factor h, D = P + E with a small E: at a singular
configuration ``|P| = |E|``. In a box of joint values, let ``phi_k(t)`` be a bound that |f_k| is
not below at a point farther than t from family k: ``sin(t/2)`` for a joint value, and
``G t - M t^2/2`` for an equation of slope G at least and curvature M at most, along the gradient
or, where it is small, the axes in which a value of either sign goes to zero fastest. Where
``|h| prod max(phi_k(t), min |f_k|) > |E|`` all over the box, no singular configuration in it is
farther than t from all families. Boxes are halved until that is near the largest distance that a
search finds. Outside of the tube D has the sign of P: a path from one side of a family to the
other meets a singular configuration of the robot.

E is a trigonometric polynomial, of degree 2 in each joint for the pose: the sixth exterior power of
a turn of screws has no higher frequency. For other tasks the degree is at most that of the rows.
It is found from its values on a grid; bounds of their rounding are counted to E.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pinsing._types import Array, Ints
from pinsing.algebra.conditions import Margin, weighted_sum
from pinsing.algebra.nearest import SearchOptions, nearest_points
from pinsing.algebra.trig_sum import TINY, At, TrigSum, to_zeros
from pinsing.families.family import Family
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import ROUNDING
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.design import AxisDifference, differences
from pinsing.robot.exact_placements import Deviation


@dataclass(frozen=True)
class TubeWidth:
    """The tube about one family, farther than ``Tube.near`` from all others.

    Attributes
    ----------
    family : str
        Its name.
    width : float
        Radians, proven: every singular configuration of the robot that is farther from all other
        families is within this of this one. Infinite where nothing is proven.
    lower : float
        Radians; the largest distance that a search found, proven to be one.
    persists : bool
        Whether every path across the tube that is far from the other families meets a singular
        configuration; False where no configuration was found outside of the tube on either side,
        as of a wide one. Where two walls meet a path may pass between them, as a hyperbola opens.
    """

    family: str
    width: float
    lower: float
    persists: bool


@dataclass(frozen=True)
class Tube:
    """How far the singular configurations of a robot are from the families of its design.

    Attributes
    ----------
    width : float
        Radians, proven: every singular configuration of the robot is within this of a family.
        Infinite where nothing is proven.
    lower : float
        Radians; the largest distance that a search found, proven to be one.
    proven : bool
        Whether there is a width. Else nothing is known of how far singular configurations are.
    families : tuple of TubeWidth
        The tube about each family, where the others are far.
    near : float
        Radians; what is farther from a family than this is far.
    reason : str
        Why there is no proof; empty where there is one.
    assumed : tuple of AxisDifference
        How far each axis of the robot is from where the design has it.
    boxes : int
        How many boxes of joint values were looked at.
    """

    width: float
    lower: float
    proven: bool
    families: tuple[TubeWidth, ...]
    near: float
    reason: str
    assumed: tuple[AxisDifference, ...]
    boxes: int

    @property
    def deviation(self) -> Deviation:
        """How far the robot is from the design."""
        angle, length = max(a.angle for a in self.assumed), max(a.length for a in self.assumed)
        return Deviation(angle, length, 0.0)

    @property
    def alone(self) -> float:
        """The width where only one family is near."""
        return max((f.width for f in self.families), default=self.width)

    @property
    def margin(self) -> Margin:
        """What to take off distances from the families, for them to be about the robot."""
        return Margin(np.full(len(self.families), self.alone), self.width, self.near)

    def __str__(self) -> str:
        many = len(self.families)
        count = "1 family" if many == 1 else f"{many} families"
        if not self.proven:
            return (
                f"{count} of the design. How far the singular configurations of this robot are "
                f"from these is NOT proven: {self.reason}. How near they are to a configuration is "
                "bounded by its Jacobian alone."
            )
        # Of a wide tube it says nothing that helps.
        told = self.alone <= math.radians(20)
        walls = [f.family for f in self.families if f.persists and told]
        which = "Each wall persists" if len(walls) == many else f"{', '.join(walls)} persist"
        persist = (
            f" {which}: any path across one of them by more than that, away from the others, meets "
            "a singular configuration."
        )
        every = (
            f"{count} of the design. Every singular configuration of this robot lies {self.where}."
        )
        return every + persist * bool(walls)

    @property
    def where(self) -> str:
        """Where the singular configurations of the robot are, in words."""
        which = "the family" if len(self.families) == 1 else "one of them"
        said = f"within {_degrees(self.alone)} of {which}"
        if self.width > self.alone:
            said += f" ({_degrees(self.width)} where two are within {_degrees(self.near)})"
        if self.width > 2 * self.lower:
            said += f"; the farthest that a search found is {_degrees(self.lower)} away"
        return said

    @property
    def assumptions(self) -> str:
        """What was assumed of each joint, in a sentence."""
        return "axes of this robot differ from the design's by " + ", ".join(map(str, self.assumed))


def _degrees(x: float) -> str:
    """An angle rounded up: what is said of it stays true."""
    places = 10 if x > math.radians(1) else 100
    return f"{math.ceil(places * math.degrees(x) - 1e-9) / places:g}°"


def find_tube(robot: Arm, design: Arm, families: Sequence[Family]) -> Tube:
    """Find how far the singular configurations of a robot are from families of its design."""
    assumed, F = differences(robot, design), len(families)
    reason, persists = "", [False] * F
    width, found, count = np.full(F + 1, np.inf), np.zeros(F + 1), 0
    try:
        product = factorize(robot, design, families)
        width, found, count = find_widths(product, families)
        powers = [[f.power % 2 for f in product.factors if f.family == k] for k in range(F)]
        both = _two_sides(product, width)
        persists = [all(odd) and two for odd, two in zip(powers, both, strict=True)]
    except Unproven as why:
        reason = str(why)
    if not reason and not np.isfinite(width[-1]):
        reason = f"{count} boxes of joint values did not suffice"
    if reason:
        width, persists = np.full(F + 1, np.inf), [False] * F
    rows = zip(families, width[:F].tolist(), found[:F].tolist(), persists, strict=True)
    parts = tuple(TubeWidth(f.name, w, low, p) for f, w, low, p in rows)
    whole = float(width[-1]), float(found[-1])
    return Tube(*whole, not reason, parts, NEAR, reason, assumed, count)


NEAR = math.radians(10)
"""Radians; a configuration this near to two families is where they meet."""
_UNIT = float(np.finfo(float).epsneg)
_MORE = 1 + ROUNDING
"""What bounds grow by, for the rounding of the few operations that they are made of."""


@dataclass(frozen=True)
class Factor:
    """A condition of a branch as a sum over the joints that matter, and its power in P."""

    family: int
    sum: TrigSum
    is_value: bool
    power: int = 1


@dataclass(frozen=True)
class Product:
    """The determinant of a robot as ``h prod f^m + E``."""

    joints: tuple[int, ...]
    factors: tuple[Factor, ...]
    h: TrigSum
    rest: TrigSum


class Unproven(Exception):
    """There is no proof: why, in words."""


def factorize(robot: Arm, design: Arm, families: Sequence[Family]) -> Product:
    """Write the determinant of a robot by the conditions of its design's families."""
    rows, n = robot.task.rows, robot.n
    if len(rows) != n:
        raise Unproven(f"{n} joints have no determinant for the {len(rows)} rows of the task")
    if robot.prismatic.any() or robot.task.at_tip:
        raise Unproven("a joint is prismatic, or rows of the task are in the tip's axes")
    pose = robot.task.name == "pose"
    joints = tuple(range(1, n - 1) if pose else range(n))
    if len(joints) > 4:
        raise Unproven(f"the determinant depends on {len(joints)} joints")
    factors = [_factor(k, b, joints) for k, f in enumerate(families) for b in f.branches]
    size, degree = float(np.linalg.norm(flatten(design).t, axis=1).sum()), 2 if pose else n
    grid = _TorusGrid(joints, n, 2 * degree + 1)
    rng = np.random.default_rng(1)
    # A start at which no condition is small on the grid, so that they can be divided by.
    starts = rng.uniform(0, 2 * np.pi / grid.count, (30, len(joints)))
    values = [_least(factors, grid.at(s)) for s in starts]
    start = starts[int(np.argmax(values))]
    Q = grid.at(start)
    D0, error = _determinants(design, Q, joints, size)
    logs = np.log(np.abs(np.stack([f.sum(Q) for f in factors] + [np.full(len(Q), np.e)], axis=1)))
    powers = np.rint(np.linalg.lstsq(logs, np.log(np.abs(D0) + TINY), rcond=None)[0][:-1])
    factors = [
        Factor(f.family, f.sum, f.is_value, max(int(m), 1))
        for f, m in zip(factors, powers, strict=True)
    ]
    P, spread = _product(factors, Q)
    h = grid.sum(D0 / P, start, 0.0)
    kept = h.amplitude > 1e-7 * h.amplitude.max()
    h = TrigSum(h.amplitude[kept], h.phase[kept], h.rate[kept], h.power[kept], 1e-12)
    # P has to be a trigonometric polynomial that the grid is fine enough for.
    twice = 2 * np.abs(h.rate).max(axis=0)
    twice += sum(f.power * 2 * np.abs(f.sum.rate).max(axis=0) for f in factors)
    if (np.rint(twice).astype(int) % 2).any() or (twice > 2 * degree + 1e-9).any():
        raise Unproven("the determinant of the design has other factors than the families")
    at = h.at(Q)
    off = np.abs(at.value) * spread + at.error * (np.abs(P) + spread)
    D, error = _determinants(robot, Q, joints, size)
    rest = grid.sum(D - at.value * P, start, float(error + off.max()))
    if rest.amplitude.sum() > np.abs(D).max() / 2:
        raise Unproven(
            "the design differs too much from the robot, or has its joint zeros elsewhere"
        )
    return Product(joints, tuple(factors), h, rest)


def _factor(family: int, branch: object, joints: tuple[int, ...]) -> Factor:
    values, equations = branch.values, branch.equations  # type: ignore[attr-defined]
    if len(values) + len(equations) != 1:
        raise Unproven(f"F{family + 1} is of several conditions, which separate nothing")
    if equations:
        s = weighted_sum(equations[0], np.ones(equations[0].frequencies.shape[1]))
        rate, power = s.rate[:, list(joints)], s.power[:, list(joints)]
        return Factor(family, TrigSum(s.amplitude, s.phase, rate, power, s.noise), False)
    rate = np.array([[0.5 * (j == values[0].joint) for j in joints]])
    phase = -values[0].value / 2 - np.pi / 2
    return Factor(family, TrigSum([1.0], [phase], rate, np.zeros(rate.shape), 1e-12), True)


def _least(factors: Sequence[Factor], Q: Array) -> float:
    return float(np.abs(_product(factors, Q)[0]).min())


def _product(factors: Sequence[Factor], x: Array) -> tuple[Array, Array]:
    """``prod f^m`` at x (N, d), and bounds of its errors."""
    value, largest = np.ones(len(x)), np.ones(len(x))
    for f in factors:
        at = f.sum.at(x)
        value, largest = (
            value * at.value**f.power,
            largest * (np.abs(at.value) + at.error) ** f.power,
        )
    return value, largest * _MORE - np.abs(value) + 1e-14 * largest


def _determinants(arm: Arm, x: Array, joints: tuple[int, ...], size: float) -> tuple[Array, float]:
    """Return determinants (N,) of task Jacobians in units of ``size``, and a bound of their errors.

    64 n units in the last place bound the error of an entry, a sum of products of at most 2n + 2
    rotations. Elimination with pivots is exact for a matrix that differs by n^3 2^(n-1) units
    (Wilkinson), and a determinant is linear in each column.
    """
    n, rows = arm.n, list(arm.task.rows)
    Q = np.zeros((len(x), n))
    Q[:, list(joints)] = x
    J = frame_jacobians(arm, Q)[:, rows] / np.where(np.array(rows) < 3, size, 1.0)[:, None]
    column = float(np.linalg.norm(J, axis=1).max()) * _MORE
    change = (64 * n + n**4 * 2 ** (n - 1)) * _UNIT * max(column, 1.0)
    return np.linalg.det(J), n * column ** (n - 1) * change * _MORE


@dataclass(frozen=True)
class _TorusGrid:
    """As many values of each joint as a trigonometric polynomial has coefficients."""

    joints: tuple[int, ...]
    n: int
    count: int

    def at(self, start: Array) -> Array:
        """Joint values (N, d)."""
        d, step = len(self.joints), 2 * np.pi / self.count
        index = np.indices((self.count,) * d).reshape(d, -1).T
        return np.asarray(start + step * index)

    def sum(self, values: Array, start: Array, error: float) -> TrigSum:
        """Return the trigonometric polynomial of ``values`` (N,), each right to ``error``."""
        # Interpolation on N points makes errors at most sqrt(N) times as large.
        d, half = len(self.joints), self.count // 2
        k = np.arange(-half, half + 1)
        wave = np.exp(-2j * np.pi / self.count * np.outer(k, np.arange(self.count))) / self.count
        table = values.reshape((self.count,) * d).astype(complex)
        for _ in range(d):  # each joint's axis in turn goes to the end
            table = np.moveaxis(np.tensordot(table, wave, axes=(0, 1)), -1, -1)
        rate = np.indices(table.shape).reshape(d, -1).T - half
        flat = table.reshape(-1) * np.exp(-1j * rate @ start)
        first = np.array([row[np.flatnonzero(row)[0]] if row.any() else 0 for row in rate])
        once = first >= 0
        amplitude = np.abs(flat[once]) * np.where(first[once] > 0, 2, 1)
        N = len(values)
        error = math.sqrt(N) * error + N * d * (self.count + 8) * 8 * _UNIT * float(
            np.abs(values).max()
        )
        small = np.cumsum(np.sort(amplitude)) <= 1e-6 * amplitude.sum()
        kept = np.argsort(amplitude)[small.sum() :]
        error += float(amplitude.sum() - amplitude[kept].sum())
        size = float(amplitude[kept].sum())
        phase, kept_rate = np.angle(flat[once])[kept], rate[once][kept].astype(float)
        noise = 1e-12 + error / max(size, TINY)
        return TrigSum(amplitude[kept], phase, kept_rate, np.zeros(kept_rate.shape), noise)


@dataclass(frozen=True)
class _Taylor:
    """Bounds of a sum on N boxes, by Taylor's theorem to the third order."""

    sum: TrigSum
    half: Array
    value: Array  # (N,), in the middle
    swing: Array  # (N,), by how much it differs on the box, rounding included
    gradient: Array  # (N, d), in the middle
    second: Array  # (N, d, d), in the middle
    reach: Array  # (N, T), by how much the angle of each term differs
    noise: Array  # (N,), bounds of errors of the derivatives
    parts: Array  # (N, d), a joint's share of ``swing``, about

    @classmethod
    def of(cls, s: TrigSum, x: Array, h: Array) -> _Taylor:
        """On boxes of middles x and half widths h, (N, d)."""
        d, rate, size = x.shape[1], np.abs(s.rate), float(s.amplitude.sum())
        angle, reach = x @ s.rate.T + s.phase, h @ rate.T
        cosine, sine = s.amplitude * np.cos(angle), s.amplitude * np.sin(angle)
        squares = (s.rate[:, :, None] * s.rate[:, None, :]).reshape(-1, d * d)
        second = -(cosine @ squares).reshape(-1, d, d)
        gradient = -sine @ s.rate
        bent = (np.abs(second) @ h[..., None])[..., 0]
        parts = h * (np.abs(gradient) + bent / 2 + (reach**2 * s.amplitude) @ rate / 6)
        # Errors of cosines, and of derivatives by as many units as the largest rate.
        noise = size * (s.noise + 4.5e-16 * s.reach * np.maximum(4.0, np.abs(x).max(axis=1)))
        noise *= s.reach**2
        swing = parts.sum(axis=1) * _MORE + noise
        return cls(s, h, cosine.sum(axis=1), swing, gradient, second, reach, noise, parts)

    def along(self, e: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return what bounds the derivatives along unit directions e (N, d)."""
        # The least slope against the middle's, the curvature in the middle, by how much it differs
        # on the box, its derivative at most, and what each joint takes off the slope (N, d).
        s = self.sum
        rates = np.abs(e @ s.rate.T)
        slope, bend = (self.gradient * e).sum(axis=1), (e[:, None] @ self.second)[:, 0]
        third = s.amplitude * rates * self.reach
        turns = self.half * (np.abs(bend) + third @ np.abs(s.rate) / 2)
        least = slope - turns.sum(axis=1) * _MORE - self.noise
        differs = (rates * third).sum(axis=1) * _MORE + self.noise
        return least, (bend * e).sum(axis=1), differs, rates**3 @ s.amplitude * _MORE, turns


def _fall(slope: Array, curve: Array, jerk: Array, t: Array) -> Array:
    """Return the least fall of a sum by a step up to t (N,), slopes falling ``curve + jerk s``."""
    root = np.sqrt(np.maximum(curve**2 + 2 * jerk * slope, 0.0))
    least = np.maximum(jerk, TINY)
    top = np.where(curve > 0, 2 * slope / np.maximum(curve + root, TINY), (root - curve) / least)
    step = np.minimum(t, top)
    return np.asarray(step * (slope - step * (curve / 2 + step * jerk / 6)))


@dataclass(frozen=True)
class Boxes:
    """Boxes and what is proven on each.

    ``far``: no singular configuration in the box that is farther than ``NEAR`` from all families
    but one is farther than this from that one; last, none at all is farther from the nearest.
    """

    x: Array  # (N, d), middles
    h: Array  # (N, d), half widths
    far: Array  # (N, F + 1)
    split: Ints  # (N,), the joint along which to halve

    def take(self, rows: Any) -> Boxes:
        """Some of them."""
        return Boxes(self.x[rows], self.h[rows], self.far[rows], self.split[rows])

    @classmethod
    def joined(cls, parts: Sequence[Boxes]) -> Boxes:
        """All of some."""
        return cls(
            *(np.concatenate([getattr(p, k) for p in parts]) for k in cls.__dataclass_fields__)
        )


def bound(p: Product, x: Array, h: Array) -> Boxes:
    """What is proven on boxes of middles x and half widths h, (N, d)."""
    few = 1 << 11
    if len(x) > few:  # as many as fit into a processor's cache
        return Boxes.joined(
            [bound(p, x[i : i + few], h[i : i + few]) for i in range(0, len(x), few)]
        )
    wide = h * _MORE
    rest, whole = _Taylor.of(p.rest, x, wide), _Taylor.of(p.h, x, wide)
    most = (np.abs(rest.value) + rest.swing) * _MORE
    room = np.maximum(np.abs(whole.value) - whole.swing, 0.0)
    conditions = [_Condition.on(f, x, wide) for f in p.factors]
    near = [c.below(np.full(len(x), NEAR)) for c in conditions]

    def none_beyond(family: int, t: Array) -> Array:
        product = room
        for f, c, other in zip(p.factors, conditions, near, strict=True):
            product = product * (c.below(t) if family in (-1, f.family) else other) ** f.power
        return np.asarray(product > most)

    def nearest(family: int, at_most: Array) -> Array:
        """The distance beyond which none is: from a family if all others are far, -1 from all."""
        low, high = np.zeros(len(x)), np.minimum(at_most, np.pi)
        some, few = none_beyond(family, low), none_beyond(family, high)
        if some.all():
            return low
        for _ in range(12):
            middle = (low + high) / 2
            good = none_beyond(family, middle)
            low, high = np.where(good, low, middle), np.where(good, middle, high)
        return np.where(some, 0.0, np.where(few, high, at_most))

    far = np.empty((len(x), 2 + max(f.family for f in p.factors)))
    within = np.full((len(x), far.shape[1] - 1), np.inf)
    for f, c in zip(p.factors, conditions, strict=True):
        within[:, f.family] = np.minimum(within[:, f.family], c.within)
    far[:, -1] = nearest(-1, within.min(axis=1))
    for k in range(far.shape[1] - 1):
        found = nearest(k, np.minimum(far[:, -1], within[:, k]))
        others = np.delete(within, k, axis=1).min(axis=1, initial=np.inf)
        far[:, k] = np.where(others < NEAR, 0.0, found)
    # What halving a joint's range gains: E, and conditions that stay off zero, vary less; slopes of
    # those that do not are bounded better.
    score = rest.parts / np.maximum(most, TINY)[:, None]
    for f, c in zip(p.factors, conditions, strict=True):
        zero = c.least < c.below(np.minimum(far[:, -1], np.pi)) * 1.001
        varies = c.parts / np.maximum(c.least, TINY)[:, None]
        score += f.power * np.where(zero[:, None], c.sway, varies)
    return Boxes(x, h, far, np.argmax(score, axis=1))


@dataclass(frozen=True)
class _Condition:
    """A condition on boxes: its least size, and bounds of how it goes to zero.

    ``falls`` are the slopes, curvatures and their derivatives of `_fall`, along the gradient, and
    along the axes in which a positive value falls fastest and a negative one rises fastest.
    """

    is_value: bool
    least: Array
    falls: Sequence[tuple[Array, Array, Array]]
    noise: float
    parts: Array
    sway: Array  # by how much of the slope each joint changes it
    within: Array  # how far zeros are at most from points of the boxes

    @classmethod
    def on(cls, f: Factor, x: Array, h: Array) -> _Condition:
        """Of a factor."""
        at = _Taylor.of(f.sum, x, h)
        least = np.maximum(np.abs(at.value) - at.swing, 0.0)
        noise = f.sum.noise * float(f.sum.amplitude.sum())
        if f.is_value:
            within = 2 * np.arcsin(np.minimum(np.abs(at.value) + noise + at.swing, 1.0))
            return cls(True, least, (), noise, at.parts, 0 * h, within * _MORE)
        size = np.linalg.norm(at.gradient, axis=1)
        u = at.gradient / np.maximum(size, TINY)[:, None]
        slope, curve, differs, jerk, turns = at.along(u)
        falls = [(np.maximum(slope, 0.0), np.abs(curve) + differs, jerk)]
        axes = np.linalg.eigh(at.second)[1]
        for k, sign in ((0, 1), (-1, -1)):
            _, curve, differs, jerk, _ = at.along(axes[:, :, k])
            falls.append((0 * slope, np.minimum(sign * curve + differs, 0.0), jerk))
        radius = np.linalg.norm(h * (f.sum.rate != 0).any(axis=0), axis=1)
        within = radius + _one_joint(f.sum, x, at.gradient)
        sway = turns / np.maximum(size, 1e-2)[:, None]
        return cls(False, least, falls, noise, at.parts, sway, within * _MORE)

    def below(self, t: Array) -> Array:
        """What its size is not below at points of the boxes farther than t (N,) from its zeros."""
        if self.is_value:
            far = np.sin(np.minimum(t, np.pi) / 2)
        else:
            down, *both = (_fall(*fall, t) for fall in self.falls)
            far = np.maximum(down, np.minimum(*both))
        return np.maximum(far / _MORE - self.noise, self.least)


def _one_joint(s: TrigSum, x: Array, gradient: Array) -> Array:
    """Return how far (N,) a zero is at most: a step along one joint changes the sign."""
    # ``f(x + t) = f(x) - b (1 - cos t) + g sin t`` is exact if the joint has no rates but 1 and 0.
    value, found = s.at(x), np.full(len(x), np.inf)
    cosine = np.cos(x @ s.rate.T + s.phase) * s.amplitude
    for j in s.used.tolist():
        rate = float(np.abs(s.rate[:, j]).max())
        b, g = cosine @ s.rate[:, j] ** 2 / rate**2, gradient[:, j] / rate
        top = np.arctan2(g, b)
        off = np.arccos(np.clip((b - value.value) / np.maximum(np.hypot(b, g), TINY), -1, 1))
        step = np.stack([top - off, top + off])
        step = np.mod(step + np.pi, 2 * np.pi) - np.pi
        step = 1.001 / rate * step[np.abs(step).argmin(axis=0), np.arange(len(x))]
        end = x.copy()
        end[:, j] += step
        there = s.at(end)
        sure = (np.abs(there.value) > there.error) & (np.abs(value.value) > value.error)
        crossed = sure & (value.value * there.value < 0)
        found = np.minimum(found, np.where(crossed, np.abs(step), np.inf))
    return found


def search(p: Product, x: Array) -> Array:
    """Singular configurations (K, d) near starts (N, d)."""
    for _ in range(12):
        value, slope = _determinant(p, x)
        step = value[:, None] * slope / np.maximum((slope**2).sum(axis=1), TINY)[:, None]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        x = x - step * np.minimum(1.0, 0.2 / np.maximum(size, TINY))
    return np.asarray(x[size[:, 0] < 1e-9])


def _two_sides(p: Product, width: Array) -> list[bool]:
    """Return which families have configurations outside of their tubes on both sides."""
    x = np.random.default_rng(3).uniform(0, 2 * np.pi, (20_000, len(p.joints)))
    away, found = _away(p, x), []
    for k in range(away.shape[1]):
        out = (away[:, k] > width[k]) & (np.delete(away, k, axis=1) > NEAR).all(axis=1)
        side = _product([replace(f, power=1) for f in p.factors if f.family == k], x[out])[0] > 0
        found.append(bool(side.any() and not side.all()))
    return found


def _away(p: Product, x: Array) -> Array:
    """How far (N, F) configurations (N, d) are from families at least."""
    return _of_families(p, x, lambda s, at: to_zeros([s], [at], x))


def _estimates(p: Product, x: Array) -> Array:
    """How far (N, F) configurations (N, d) are from families, as the slopes there say."""
    return _of_families(p, x, lambda s, at: np.abs(at.value) / s.dual(at.gradient))


def _of_families(p: Product, x: Array, far: Callable[[TrigSum, At], Array]) -> Array:
    away = np.full((len(x), 1 + max(f.family for f in p.factors)), np.inf)
    for f in p.factors:
        at = f.sum.at(x)
        found = 2 * np.arcsin(np.minimum(np.abs(at.value), 1)) if f.is_value else far(f.sum, at)
        away[:, f.family] = np.minimum(away[:, f.family], found)
    return away


def _determinant(p: Product, x: Array) -> tuple[Array, Array]:
    """Values (N,) and gradients (N, d) of ``h prod f^m + E``."""
    rest, h = p.rest.at(x), p.h.at(x)
    at = [f.sum.at(x) for f in p.factors]
    total, slope = h.value, h.gradient
    for f, a in zip(p.factors, at, strict=True):
        power = a.value**f.power
        rise = f.power * a.value ** (f.power - 1)
        slope = slope * power[:, None] + (total * rise)[:, None] * a.gradient
        total = total * power
    return total + rest.value, slope + rest.gradient


MOST = 600_000
"""Boxes after which the width is what has been proven till then."""
SLACK = 1.5
"""A width that is this much larger than the largest distance found is good enough."""
_FIRST = 6


def _first(p: Product) -> tuple[Array, Array]:
    """Boxes (N, d) to begin with: thin where a family is a joint value, as the tube is there."""
    sides = []
    for j in range(len(p.joints)):
        values = [-2 * f.sum.phase[0] - np.pi for f in p.factors if f.is_value and f.sum.rate[0, j]]
        parts = NEAR * np.array([-4, -1.5, -0.5, 0.5, 1.5, 4])
        at = np.add.outer(values, parts) if values else np.linspace(0, 2 * np.pi, _FIRST + 1)
        at = np.unique(np.mod(at, 2 * np.pi).round(12))
        sides.append(np.append(at, at[0] + 2 * np.pi))
    both = [[(e[1:] + e[:-1]) / 2 for e in sides], [(e[1:] - e[:-1]) / 2 for e in sides]]
    x, h = (np.stack(np.meshgrid(*s, indexing="ij"), axis=-1).reshape(-1, len(s)) for s in both)
    return x, h


def find_widths(p: Product, families: Sequence[Family]) -> tuple[Array, Array, int]:
    """Proven widths (F + 1,) as in ``Boxes.far``, the largest distances found, number of boxes."""
    boxes = bound(p, *_first(p))
    count, last = len(boxes.x), boxes.far.shape[1] - 1
    found, done = np.zeros(last + 1), np.zeros(last + 1)

    rng, best = np.random.default_rng(2), np.empty((0, len(p.joints)))

    def columns(away: Array) -> tuple[Array, Ints]:
        """The distance from the nearest family, and which it is: -1 where several are near."""
        order = np.sort(np.append(away, np.full((len(away), 1), np.inf), axis=1), axis=1)
        return order[:, 0], np.where(order[:, 1] > NEAR, away.argmin(axis=1), last)

    def farthest(away: Array, many: int) -> Ints:
        far, column = columns(away)
        order = np.argsort(-far, kind="stable")
        return np.concatenate([order[column[order] == k][:many] for k in range(last + 1)])

    def look(starts: Array, best: Array) -> Array:
        """Search from starts, and up from the points that are farthest from the families."""
        size = 10 ** rng.uniform(-3, -0.5, (len(best), 1))
        beside = best + size * rng.normal(size=best.shape)
        x = search(p, np.concatenate([starts, best, beside]))
        x = x[farthest(_estimates(p, x), 60)]
        Q = np.zeros((len(x), families[0].n))
        Q[:, list(p.joints)] = x
        free, few = np.full(Q.shape[1], np.inf), SearchOptions(gap=1e-3, boxes=500)
        sure = [nearest_points(f.conditions(), Q, -free, free, few).lower for f in families]
        away = np.stack(sure, axis=1)
        far, column = columns(away)
        np.maximum.at(found, column, far)
        found[last] = found.max()
        return np.asarray(x[farthest(away, 20)])

    best = look(rng.uniform(0, 2 * np.pi, (2000, len(p.joints))), best)
    for _ in range(20):
        best = look(best[:0], np.tile(best, (4, 1)))
    while True:
        goal = SLACK * np.append(np.full(last, found[:last].max()), found[last])
        worth = boxes.far / np.maximum(goal, TINY)
        # Where families meet comes first: what is known there bounds the rest.
        meets = worth[:, last] > 1
        worth = np.where(meets, 1e6 * worth[:, last], worth.max(axis=1))
        good = worth <= 1
        done = np.maximum(done, boxes.far[good].max(axis=0, initial=0.0))
        boxes, worth = boxes.take(~good), worth[~good]
        if not len(worth) or count > MOST:
            return np.maximum(done, boxes.far.max(axis=0, initial=0.0)), found, count
        order = np.argsort(-worth, kind="stable")
        few = min(20000, int(meets.sum()) or len(order))
        now, later = boxes.take(order[:few]), boxes.take(order[few:])
        some = now.take(slice(0, 400))
        best = look(some.x + rng.uniform(-1, 1, some.x.shape) * some.h, best)
        rows, h, move = np.arange(len(now.x)), now.h.copy(), np.zeros_like(now.h)
        h[rows, now.split] /= 2
        move[rows, now.split] = h[rows, now.split]
        fresh = bound(p, np.concatenate([now.x - move, now.x + move]), np.tile(h, (2, 1)))
        np.minimum(fresh.far, np.tile(now.far, (2, 1)), out=fresh.far)
        count += len(fresh.x)
        boxes = Boxes.joined([later, fresh])
