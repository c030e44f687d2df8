"""How far the singular configurations of a robot are from the families of its design, proven.

With D the determinant of the robot's task Jacobian, and ``P = h f1 f2 ...`` a product of the
conditions of the design's families and a factor h, D = P + E with a small E: at a singular
configuration ``|P| = |E|``. In a box of joint values, let ``phi_k(t)`` be a bound that |f_k| is
not below at a point farther than t from family k: ``sin(t/2)`` for a joint value, and
``G t - M t^2/2`` for an equation of slope G at least and curvature M at most, with terms up to
``t^5``, along the line on which a value of its sign is zero first. Where
``|h| prod max(phi_k(t), min |f_k|) > |E|`` all over the box, no singular configuration in it is
farther than t from all families. Boxes in which P + s E may be zero for an s from 0 to 1 are halved
until that is near the largest distance that a search finds. Outside of the tube none of these is
zero: D has the sign of P there, and a path from one side of a family to the other meets a singular
configuration of the robot.

The Jacobian of an arm of seven joints has full rank where one of its minors is not zero. Each is a
trigonometric polynomial of the five inner joints; boxes are halved, and cut down to where all may
be zero, until their points are near enough to a family. Nothing separates there: no wall persists.
Many such arms have singular configurations far from every family, though not within their joint
limits: where full circles give no narrow width, boxes of these alone are looked at.

E is a trigonometric polynomial, of degree 2 in each joint for the pose: the sixth exterior power of
a turn of screws has no higher frequency. For other tasks the degree is at most that of the rows.
It is found from its values on a grid; bounds of their rounding are counted to E.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pinsing._batch import engine
from pinsing.algebra.conditions import (
    Branch,
    Conditions,
    Margin,
    SearchOptions,
    nearest_points,
    sums_of,
    two_sided,
)
from pinsing.algebra.trig_sum import TINY, TrigSum
from pinsing.errors import Refusal
from pinsing.families.family import Family
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.kinematics.refine import approach
from pinsing.measures import ROUNDING, Array, Ints
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import AxisDifference, differences, flatten


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
        as of a wide one. Of redundant arms always False: their singular configurations are of
        codimension 2 but for special designs, so that paths go round them. Where two walls meet
        a path may pass between them, as a hyperbola opens.
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
        Why there is no proof, of all configurations; empty where there is one.
    assumed : tuple of AxisDifference
        How far each axis of the robot is from where the design has it.
    boxes : int
        How many boxes of joint values were looked at.
    within_limits : bool
        Whether the widths are proven of configurations within the joint limits alone.
    """

    width: float
    lower: float
    proven: bool
    families: tuple[TubeWidth, ...]
    near: float
    reason: str
    assumed: tuple[AxisDifference, ...]
    boxes: int
    within_limits: bool = field(default=False, metadata={"optional": True})

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
        one = "one of them by more than that, away from the others,"
        if many == 1:
            which, one = "The wall persists", "it by more than that"
        persist = f" {which}: any path across {one} meets a singular configuration."
        every = f"{count} of the design. Every singular configuration of {self.whose} lies "
        beyond = f" Nothing is proven beyond the limits: on full circles {self.reason}."
        return f"{every}{self.where}.{beyond * self.within_limits}{persist * bool(walls)}"

    @property
    def whose(self) -> str:
        """Whose singular configurations are near to the families, in words."""
        return "this robot" + " within its joint limits" * self.within_limits

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


def _degrees(x: float) -> str:
    """An angle rounded up: what is said of it stays true."""
    places = 10 if x > math.radians(1) else 100
    return f"{math.ceil(places * math.degrees(x) - 1e-9) / places:g}°"


def find_tube(robot: Arm, design: Arm, families: Sequence[Family]) -> Tube:
    """Find how far the singular configurations of a robot are from families of its design."""
    assumed, F = differences(robot, design), len(families)
    reason, persists, limited = "", [False] * F, False
    width, found, near, count = np.full(F + 1, np.inf), np.zeros(F + 1), NEAR, 0
    try:
        of = factorize(robot, design, families)
        ranges = _limits(robot, of)
        has_limits = bool((ranges != of.ranges).any())
        for limited in (False, True) if has_limits else (False,):
            of = replace(of, ranges=ranges) if limited else of
            width, found, near, count = find_widths(of, families, has_limits and not limited)
            if np.isfinite(width).all():
                break
            far = f"one was found {_degrees(found[-1])} from all of them"
            few = f"{count} boxes of joint values did not suffice"
            reason += "; within the joint limits " * limited
            reason += few if count else f"{far}, too far for a narrow width"
        if of.arm is None:
            even = {f.family for f in of.factors if f.power % 2 == 0}
            both = _two_sides(of, width, near)
            persists = [two and k not in even for k, two in enumerate(both)]
    except Unproven as unproven:
        reason = str(unproven)
    proven = bool(np.isfinite(width).all())
    if not proven:
        width, persists, near = np.full(F + 1, np.inf), [False] * F, NEAR
    names = (f.name for f in families)
    rows = zip(names, width[:F].tolist(), found[:F].tolist(), persists, strict=True)
    return Tube(
        float(width[-1]),
        float(found[-1]),
        proven,
        tuple(TubeWidth(*row) for row in rows),
        near,
        reason,
        assumed,
        count,
        proven and limited,
    )


def _limits(robot: Arm, of: Equations) -> Array:
    """Limits (d, 2) of the joints that matter; of those that turn all around, a circle."""
    both = np.stack([robot.lower - ROUNDING, robot.upper + ROUNDING], axis=1)
    ranges = both[list(of.joints)]
    return np.where(np.diff(ranges) < 2 * np.pi, ranges, _CIRCLE)


NEAR = math.radians(10)
"""Radians; a configuration this near to two families is where they meet, unless widths are more."""

_UNIT = float(np.finfo(float).epsneg)
_MORE = 1 + ROUNDING
"""What bounds grow by, for the rounding of the few operations that they are made of."""


@dataclass(frozen=True)
class Factor:
    """A condition of a branch as a sum over the joints that matter, and its power in P."""

    family: int
    sum: TrigSum
    is_value: bool
    branch: int
    power: int = 1


@dataclass(frozen=True)
class Equations:
    """What is zero at the singular configurations of a robot, by its design's families.

    The determinant as ``h prod f^m + E``, a sum over the joints that matter; or minors of the
    Jacobian of a redundant robot.
    """

    joints: tuple[int, ...]  # that matter
    factors: tuple[Factor, ...]
    ranges: Array  # (d, 2): of these joints; a circle from any value
    conditions: Conditions  # of the families
    # the kernel's sums beside the factors, three before and the rest after these: of the design's
    # determinant, E and h; or three that stand for none, and the minors
    sums: tuple[TrigSum, ...]
    arm: Arm | None = None  # that is redundant

    def search(self, x: Array) -> Array:
        """Singular configurations (K, d) near starts (N, d)."""
        if self.arm is not None:
            n, inner = self.arm.n, list(self.joints)
            drops = approach(self.arm, _whole(inner, n, x), np.isin(np.arange(n), inner))
            return np.asarray(drops.q[drops.sigma[:, -1] < 1e-9 * drops.sigma[:, 0]][:, inner])
        for _ in range(12):
            plain, rest = (s.at(x) for s in self.sums[:2])
            slope = plain.gradient + rest.gradient
            least = np.maximum((slope**2).sum(axis=1), TINY)
            step = ((plain.value + rest.value) / least)[:, None] * slope
            size = np.linalg.norm(step, axis=1, keepdims=True)
            x = x - step * np.minimum(1.0, 0.2 / np.maximum(size, TINY))
        return np.asarray(x[size[:, 0] < 1e-9])


class Unproven(Refusal):
    """There is no proof: why, in words."""


def factorize(robot: Arm, design: Arm, families: Sequence[Family]) -> Equations:
    """Write the determinant of a robot by the conditions of its design's families."""
    rows, n = robot.task.rows, robot.n
    pose = robot.task.name == "pose"
    redundant = pose and n == 7
    Unproven.refuse_if(
        len(rows) != n and not redundant,
        f"{n} joints have no determinant for the {len(rows)} rows of the task",
    )
    Unproven.refuse_if(
        robot.prismatic.any() or robot.task.at_tip,
        "a joint is prismatic, or rows of the task are in the tip's axes",
    )
    joints = tuple(range(1, n - 1) if pose else range(n))
    Unproven.refuse_if(not engine.available(), str(engine.unavailable_reason()))
    branches = [(k, b) for k, f in enumerate(families) for b in f.branches]
    factors = [f for i, (k, b) in enumerate(branches) for f in _factors(k, i, b, joints, n)]
    ranges = np.tile(_CIRCLE, (len(joints), 1))
    conditions = Conditions.of([f.branches for f in families], robot.prismatic, np.ones(n))
    if redundant:
        Unproven.refuse_if(
            len(factors) > 54 or max(len(f.sum.used) for f in factors) > 4,
            "the design has too many conditions, or one of five joints",
        )
        none = TrigSum([0.0], [0.0], np.zeros((1, 5)), np.zeros((1, 5)), 0.0)
        sums = (none, none, none, *_minors(robot, joints))
        return Equations(joints, tuple(factors), ranges, conditions, sums, robot)
    Unproven.refuse_if(
        len(factors) > len(branches), "a family is of several conditions, which separate nothing"
    )
    Unproven.refuse_if(
        len(joints) > (4 if pose else 3), f"the determinant depends on {len(joints)} joints"
    )
    size, degree = float(np.linalg.norm(flatten(design).t, axis=1).sum()), 2 if pose else n
    grid = _TorusGrid(len(joints), 2 * degree + 1)
    rng = np.random.default_rng(1)
    # A start at which no condition is small on the grid, so that they can be divided by.
    starts = rng.uniform(0, 2 * np.pi / grid.count, (30, len(joints)))
    values = [float(np.abs(_product(factors, grid.at(s))[0]).min()) for s in starts]
    start = starts[int(np.argmax(values))]
    Q = grid.at(start)
    D0, error = _determinants(design, Q, joints, size)
    logs = np.log(np.abs(np.stack([f.sum(Q) for f in factors] + [np.full(len(Q), np.e)], axis=1)))
    powers = np.rint(np.linalg.lstsq(logs, np.log(np.abs(D0) + TINY), rcond=None)[0][:-1])
    factors = [replace(f, power=max(int(m), 1)) for f, m in zip(factors, powers, strict=True)]
    P, spread = _product(factors, Q)
    h = grid.sum(D0 / P, start, 0.0)
    kept = h.amplitude > 1e-7 * h.amplitude.max()
    h = TrigSum(h.amplitude[kept], h.phase[kept], h.rate[kept], h.power[kept], 1e-12)
    # P has to be a trigonometric polynomial that the grid is fine enough for.
    twice = 2 * np.abs(h.rate).max(axis=0)
    twice += sum(f.power * 2 * np.abs(f.sum.rate).max(axis=0) for f in factors)
    Unproven.refuse_if(
        (np.rint(twice).astype(int) % 2).any() or (twice > 2 * degree + 1e-9).any(),
        "the determinant of the design has other factors than the families",
    )
    at = h.at(Q)
    off = np.abs(at.value) * spread + at.error * (np.abs(P) + spread)
    D, error = _determinants(robot, Q, joints, size)
    rest = grid.sum(D - at.value * P, start, float(error + off.max()))
    Unproven.refuse_if(
        rest.amplitude.sum() > np.abs(D).max() / 2,
        "the design differs too much from the robot, or has its joint zeros elsewhere",
    )
    plain = grid.sum(at.value * P, start, float(off.max()))
    return Equations(joints, tuple(factors), ranges, conditions, (plain, rest, h))


def _factors(
    family: int, index: int, branch: Branch, joints: tuple[int, ...], n: int
) -> list[Factor]:
    """Return the conditions of a branch: of different joints, where there are several."""
    out = []
    for k, s in enumerate(sums_of(branch, np.zeros(n, dtype=bool), np.ones(n))):
        rate, power = s.rate[:, list(joints)], s.power[:, list(joints)]
        made = TrigSum(s.amplitude, s.phase, rate, power, s.noise)
        out.append(Factor(family, made, k >= len(branch.equations), index))
    used = np.concatenate([f.sum.used for f in out])
    Unproven.refuse_if(
        len(set(used)) < len(used), f"two conditions of F{family + 1} are of one joint"
    )
    # Values are bounded fastest.
    return out[::-1]


def _product(factors: Sequence[Factor], x: Array) -> tuple[Array, Array]:
    """``prod f^m`` at x (N, d), and bounds of its errors."""
    value, largest = np.ones(len(x)), np.ones(len(x))
    for f in factors:
        at = f.sum.at(x)
        size = np.abs(at.value) + at.error
        value, largest = value * at.value**f.power, largest * size**f.power
    return value, largest * _MORE - np.abs(value) + 1e-14 * largest


def _minors(arm: Arm, joints: tuple[int, ...]) -> list[TrigSum]:
    """Minors of a redundant arm, each a sum over four joints and what there is besides."""
    grid, start = _TorusGrid(len(joints), 5), np.zeros(len(joints))
    size, out = float(np.linalg.norm(flatten(arm).t, axis=1).sum()) / 4, []
    for less in [0, arm.n - 1, *range(1, arm.n - 1)]:
        values, error = _determinants(arm, grid.at(start), joints, size, less)
        s = grid.sum(values, start, error)
        # The first has no terms of the joint that matters least, and no small ones.
        shares = ((s.rate != 0) * s.amplitude[:, None]).sum(axis=0)
        own = s.amplitude * (s.rate[:, shares.argmin()] == 0)
        small = np.cumsum(np.sort(own)) <= 1e-6 * own.sum() + 2 * shares.min()
        main = np.argsort(own)[max(small.sum(), 1) :]
        rest = np.setdiff1d(np.argsort(-s.amplitude), main, assume_unique=True)
        if s.amplitude[rest].sum() < 0.2 * s.amplitude.sum():
            # The least of the rest are counted to its noise.
            sums = np.cumsum(s.amplitude[rest])
            kept = min(1 + int((sums < 0.995 * sums[-1]).sum()), 300)
            noise = s.noise * s.amplitude.sum() + sums[-1] - sums[kept - 1]
            out.append(_part(s, main, 1e-12))
            out.append(_part(s, rest[:kept], noise / sums[kept - 1] * _MORE))
    return out


def _part(s: TrigSum, kept: Ints, noise: float) -> TrigSum:
    return TrigSum(s.amplitude[kept], s.phase[kept], s.rate[kept], s.power[kept], noise)


def _determinants(
    arm: Arm, x: Array, joints: tuple[int, ...], size: float, less: int | None = None
) -> tuple[Array, float]:
    """Return determinants (N,) of task Jacobians in units of ``size``, and a bound of their errors.

    The column ``less`` is left out.

    64 n units in the last place bound the error of an entry, a sum of products of at most 2n + 2
    rotations. Elimination of m rows with pivots is exact for a matrix that differs by m^3 2^(m-1)
    units (Wilkinson), and a determinant is linear in each column.
    """
    n, rows = arm.n, list(arm.task.rows)
    J = (
        frame_jacobians(arm, _whole(joints, n, x))[:, rows]
        / np.where(np.array(rows) < 3, size, 1.0)[:, None]
    )
    J = J if less is None else np.delete(J, less, axis=2)
    m, column = len(rows), float(np.linalg.norm(J, axis=1).max()) * _MORE
    change = (64 * n + m**4 * 2 ** (m - 1)) * _UNIT * max(column, 1.0)
    return np.linalg.det(J), m * column ** (m - 1) * change * _MORE


@dataclass(frozen=True)
class _TorusGrid:
    """As many values of each joint as a trigonometric polynomial has coefficients."""

    d: int
    count: int

    def at(self, start: Array) -> Array:
        """Joint values (N, d)."""
        index = np.indices((self.count,) * self.d).reshape(self.d, -1).T
        return np.asarray(start + 2 * np.pi / self.count * index)

    def sum(self, values: Array, start: Array, error: float) -> TrigSum:
        """Return the trigonometric polynomial of ``values`` (N,), each right to ``error``."""
        # Interpolation on N points makes errors at most sqrt(N) times as large.
        N, shape = len(values), (self.count,) * self.d
        table = np.fft.fftshift(np.fft.fftn(values.reshape(shape))) / N
        rate = np.indices(shape).reshape(self.d, -1).T - self.count // 2
        flat = table.reshape(-1) * np.exp(-1j * rate @ start)
        first = rate[np.arange(N), (rate != 0).argmax(axis=1)]
        once = first >= 0
        amplitude = np.abs(flat[once]) * np.where(first[once] > 0, 2, 1)
        rounding = N * self.d * (self.count + 8) * 8 * _UNIT * float(np.abs(values).max())
        error = math.sqrt(N) * error + rounding
        small = np.cumsum(np.sort(amplitude)) <= 1e-6 * amplitude.sum()
        kept = np.argsort(amplitude)[small.sum() :]
        error += float(amplitude.sum() - amplitude[kept].sum())
        size = float(amplitude[kept].sum())
        phase, kept_rate = np.angle(flat[once])[kept], rate[once][kept].astype(float)
        noise = 1e-12 + error / max(size, TINY)
        return TrigSum(amplitude[kept], phase, kept_rate, np.zeros(kept_rate.shape), noise)


def halve(p: Equations, boxes: Array, near: float = NEAR) -> Array:
    """Return the halves (2N, 12 + F) of boxes (N, 12 + F), and what is proven of them.

    A row is a middle and half widths of five joints, ``far`` (F + 1,), and the joint to halve. No
    singular configuration in the box that is farther than ``near`` from all families but its
    nearest is farther than ``far`` from that one; last, none at all is farther from the nearest.
    Half boxes are cut down to where the determinant may be zero, of the robot or of one between it
    and the design.
    """
    sums = [Factor(-1, s, False, i) for i, s in enumerate(p.sums)]
    every = [*sums[:3], *p.factors, *sums[3:]]
    terms, about = [], []
    for f in every:
        s = f.sum
        own = np.arange(s.rate.shape[1])
        # What a minor is besides is a sum over all joints.
        if p.arm is not None and (f.family >= 0 or f.branch % 2):
            own = np.append(s.used, np.setdiff1d(own, s.used))[:4]
        rate = np.zeros((len(s.amplitude), 5))
        rate[:, : len(own)] = s.rate[:, own]
        terms.append(np.column_stack([s.amplitude, s.phase, rate]))
        about.append((s.noise, f.family, f.is_value, f.power, f.branch, *np.resize(own, 4)))
    halves = engine.module().tubes(
        np.ascontiguousarray(np.concatenate(terms)),
        np.cumsum([0, *map(len, terms)]).tolist(),
        np.array(about, float),
        boxes.shape[1] - 12,
        near,
        np.ascontiguousarray(boxes),
        engine.isa_names()[-1],
        engine.cpu_count(),
    )
    return np.asarray(halves.reshape(-1, boxes.shape[1]))


def _two_sides(p: Equations, width: Array, near: float) -> list[bool]:
    """Return which families have both sides outside of the tubes: configurations at random tell."""
    low, high = p.ranges.T
    x = np.random.default_rng(3).uniform(low, high, (20_000, len(low)))
    away, found = _about(p, x)[..., 0], []
    for k in range(away.shape[1]):
        out = (away[:, k] > width[k]) & (np.delete(away, k, axis=1) > near).all(axis=1)
        side = _product([replace(f, power=1) for f in p.factors if f.family == k], x[out])[0] > 0
        found.append(bool(side.any() and not side.all()))
    return found


def _about(p: Equations, x: Array) -> Array:
    """Bounds (N, F, 2) of how far configurations (N, d) are from families."""
    Q = _whole(p.joints, p.conditions.n, x)
    return two_sided(p.conditions, Q, each=True, points=True).each


def _proven(p: Equations, families: Sequence[Family], x: Array) -> Array:
    """How far (N, F) configurations (N, d) are from families at least, and hardly more."""
    Q, ends = _whole(p.joints, p.conditions.n, x), np.full(p.conditions.n, np.inf)
    how = Q, -ends, ends, SearchOptions(gap=1e-4, boxes=16_000)
    return np.stack([nearest_points(f.conditions(), *how).lower for f in families], axis=1)


def _whole(joints: Sequence[int], n: int, x: Array) -> Array:
    """Joint values (N, n), of which some are given and others zero."""
    Q = np.zeros((len(x), n))
    Q[:, list(joints)] = x
    return Q


MOST = 16_000_000
"""Boxes after which the width is what has been proven till then."""
SLACK = 1.5
"""A width this much larger than the largest distance found is good enough; in the end twice it."""
_CIRCLE = 1 - np.pi, 1 + np.pi
"""The range of a joint that turns all around; halves of it are cut off the usual values."""
_NONE = 1e9
"""A distance where none is known, as in the kernel."""


def _first(p: Equations, families: int, goal: float) -> Array:
    """Boxes (N, 12 + F) to begin with: thin where a family is a joint value, as the tube is."""
    sides, minors = [], p.arm is not None
    branches = [f.branch for f in p.factors]
    for j, (low, high) in enumerate(p.ranges):
        # By minors all within the goal of a value that is a family by itself needs no halving.
        values = [
            -2 * f.sum.phase[0] - np.pi
            for f in p.factors
            if f.is_value and f.sum.rate[0, j] and not (minors and branches.count(f.branch) > 1)
        ]
        parts = NEAR * np.array([-4, -1.5, -0.5, 0.5, 1.5, 4])
        parts = 0.9999 * goal * np.array([-1, 1]) if minors else parts
        at = np.array([low]) if minors else np.linspace(0, 2 * np.pi, 7)
        at = np.add.outer(values, parts) if values else at
        at = np.unique((low + np.mod(at - low, 2 * np.pi)).round(12))
        is_circle = high - low >= 2 * np.pi
        cut = [low, *at[(at > low) & (at < high)], high]
        sides.append(np.append(at, at[0] + 2 * np.pi) if is_circle else np.array(cut))
    both = [[(e[1:] + e[:-1]) / 2 for e in sides], [(e[1:] - e[:-1]) / 2 * _MORE for e in sides]]
    x, h = (np.stack(np.meshgrid(*s, indexing="ij"), axis=-1).reshape(-1, len(s)) for s in both)
    boxes = np.zeros((len(x), 12 + families))
    boxes[:, : len(sides)], boxes[:, 5 : 5 + len(sides)] = x, h
    boxes[:, 10:-1], boxes[:, -1] = _NONE, h.argmax(axis=1)
    return boxes


def find_widths(
    p: Equations, families: Sequence[Family], narrow: bool = False
) -> tuple[Array, Array, float, int]:
    """Proven widths (F + 1,) as in `halve`, the largest distances found, near, number of boxes.

    By minors ``narrow`` ones alone; boxes know no distance of more than three times ``near`` from
    an equation. Else, where widths of families alone may be over half of ``near``, it is more.
    """
    last, rng = len(families), np.random.default_rng(2)
    found, done = np.zeros(last + 1), np.zeros(last + 1)
    (low, high), minors, near = p.ranges.T, p.arm is not None, NEAR

    def farthest(far: Array, column: Ints, many: int) -> Ints:
        """The farthest from the nearest family: of those near each one alone, and near several."""
        order = np.argsort(-far, kind="stable")
        return np.concatenate([order[column[order] == k][:many] for k in range(last + 1)])

    def columns(away: Array, apart: float) -> Ints:
        """Of which family alone (N,) those are that are so far (N, F) from each; or the last."""
        second = np.sort(np.append(away, np.full((len(away), 1), np.inf), axis=1), axis=1)[:, 1]
        return np.where(second > apart, away.argmin(axis=1), last)

    def look(starts: Array, best: Array) -> Array:
        """Search from starts, and up from the points that are farthest from the families."""
        beside = best + 10 ** rng.uniform(-3, -0.5, (len(best), 1)) * rng.normal(size=best.shape)
        x = low + np.mod(p.search(np.concatenate([starts, best, beside])) - low, 2 * np.pi)
        x = x[(x <= high).all(axis=1)]
        # How far at most, as of all in a box, which is not halved: slopes may be large across a
        # family whose zeros are far along it all the same.
        boxes = np.full((len(x), 12 + last), _NONE)
        boxes[:, :10], boxes[:, : len(low)], boxes[:, 5 : 5 + len(low)] = 0.0, x, ROUNDING
        most = halve(p, boxes, near)[::2, 10 + last]
        about = _about(p, x)[..., 1]
        far, column = np.minimum(most, about.min(axis=1)), columns(about, 1.002 * near)
        # What may be farther than all before is proven to be far.
        top = [i for i in farthest(far, column, 3) if far[i] > 1.01 * found[column[i]]]
        away = _proven(p, families, x[top])
        np.maximum.at(found, columns(away, near), away.min(axis=1))
        found[last] = found.max()
        return np.asarray(x[farthest(far, column, 20)])

    while True:
        best = look(rng.uniform(low, high, (2000, len(low))), np.empty((0, len(low))))
        for _ in range(12):
            best = look(best[:0], np.tile(best, (4, 1)))
        wide = last > 1 and (2 if minors else 4) * found[:last].max() > near
        if wide and minors and narrow:
            return np.full(last + 1, np.inf), found, near, 0
        if not wide or minors or near > 2 * NEAR:
            break
        near, found[:last] = 1.5 * near, 0.0
    boxes, level = halve(p, _first(p, last, 2 * found[:last].max()), near), 64.0
    count = len(boxes)

    def left(boxes: Array) -> tuple[Array, Array]:
        """Return boxes that are not good enough, and how many times what is they are."""
        nonlocal done
        early = count < (0.15 if minors else 0.05) * MOST
        slack, each = (SLACK, not minors) if early else (2.0, False)
        alone = found[:last] if 4 * count < 3 * MOST else found
        # Some calibrations leave a family where it is.
        least = alone.max() * (0.03 if each else 1.0)
        goal = slack * np.append(np.maximum(alone, least)[:last], found[last])
        worth = (boxes[:, 10:-1] / np.maximum(goal, TINY)).max(axis=1)
        bad = worth > 1
        done = np.maximum(done, boxes[~bad, 10:-1].max(axis=0, initial=0.0))
        return boxes[bad], worth[bad]

    while True:
        kept, todo, enough = (
            [],
            np.array_split(boxes, 1 + len(boxes) // 50_000),
            count * 1.5 + 50_000,
        )
        while todo and count <= min(MOST, enough):
            now = [todo.pop()]
            while todo and sum(map(len, now)) < 50_000:
                now.append(todo.pop())
            boxes, worth = left(np.concatenate(now))
            kept.append(boxes[worth <= level])
            fresh = halve(p, boxes[worth > level], near)
            count += len(fresh)
            todo += np.array_split(fresh, 2) if len(fresh) else []
        boxes, worth = left(np.concatenate([*kept, *todo]))
        level = level if todo else max(1.0, level / 1.5)
        if not len(boxes) or count > MOST:
            width = np.maximum(done, boxes[:, 10:-1].max(axis=0, initial=0.0))
            width[width >= _NONE] = np.inf
            return width, found, max(near, float(width[:last].max())), count
        # The worst boxes are as good as may be at this level: what is in them may be far.
        worst = boxes[np.argsort(-worth, kind="stable")[:400]]
        off = rng.uniform(-1, 1, (len(worst), 5)) * worst[:, 5:10]
        best = look((worst[:, :5] + off)[:, : len(low)], best)
