"""Conditions: joints at values, and sums that are zero; the nearest point, and zeros on the way.

All of it in weighted coordinates ``x = w q``, in which distances are plain norms.

Every zero of a sum along pieces of a motion, and when a straight one meets a condition: on an
interval of half-width h, with f and f' in its middle and W a bound of |f''| on it, there is no zero
where |f| > |f'| h + W h^2 / 2; at most one where |f'| > W h, and the signs at the ends tell; else
the interval is halved, until f cannot be told from zero on it.

Along ``x + s u`` with ``|h''| <= M`` Taylor's theorem gives ``|h(s)| >= |h(0)| - c s - M s^2 / 2``,
c how fast ``|h|`` falls: up to the root of the right side there is no zero. From there again, and
so on: the steps shrink as those of Newton's method do, and each is proven. A branch is met where
all its conditions hold at once, so that its step is the longest of theirs.

The compiled engine does the latter (``contact.cpp``); here stands the plain reference.

The nearest point is found, with a proof that none is much nearer, by branch and bound. The compiled
engine does it. What stands here in NumPy is the plain reference, for installations without it and
arms too long for it: the same bounds in fewer kinds, so that it needs more boxes.

Two-sided bounds of many configurations are in closed form. The lower one is that of
`pinsing.algebra.trig_sum`; along the gradient g of a sum f a zero is reached within
``2 |f| / (|g| + sqrt(|g|^2 - 2 M |f|))``, where that is real: the upper one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from pinsing._batch import engine
from pinsing.algebra.budget import PER_SECOND
from pinsing.algebra.equation import Equation
from pinsing.algebra.ring import Value
from pinsing.algebra.trig_sum import COMBINED, TINY, At, TrigSum, least_norm, off_values, to_zeros
from pinsing.errors import OptionError
from pinsing.interface import whole_number
from pinsing.measures import ROUNDING, Array, Bool, Ints
from pinsing.robot.arm import JointSpace

NORMS = ("euclidean", "max")


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
        joints = [v.joint for v in self.values]
        away = q[:, joints] - [v.value for v in self.values]
        turns = np.where(space.prismatic[joints], 0.0, np.round(away / (2 * np.pi)))
        return np.asarray((away - 2 * np.pi * turns) / space.metric[joints])

    def put(self, q: Array, space: JointSpace) -> Array:
        """Return Q (N, n) with the fixed joints at the nearest copies of their values."""
        out, joints = q.copy(), [v.joint for v in self.values]
        out[:, joints] -= self.off(q, space) * space.metric[joints]
        return out

    def held(self, space: JointSpace, box: tuple[Array, Array]) -> list[Array]:
        """Return the values of the fixed joints in (n,) arrays: all copies that fit a box."""
        copies = []
        for v in self.values:
            low, high = box[0][v.joint] - ROUNDING, box[1][v.joint] + ROUNDING
            first, last = (np.array([low, high]) - v.value) / (2 * np.pi)
            turns = range(math.ceil(first), math.floor(last) + 1)
            every = (v.value + 2 * np.pi * turn for turn in turns)
            slides = space.prismatic[v.joint]
            copies.append([x for x in ([v.value] if slides else every) if low <= x <= high])
        choices = list(itertools.product(*copies))
        fixed = np.zeros((len(choices), space.n))
        fixed[:, [v.joint for v in self.values]] = np.reshape(choices, (len(choices), len(copies)))
        return list(fixed)


@dataclass(frozen=True, eq=False)
class WeightedBranch:
    """One branch of a family: joints (k,) at values (k,), and sums that are zero, all at once."""

    family: int
    joints: Ints
    values: Array
    sums: tuple[TrigSum, ...]

    def used(self, n: int) -> Bool:
        """Joints (n,) that occur in the sums."""
        used = np.zeros(n, dtype=bool)
        for s in self.sums:
            used[s.used] = True
        return used


@dataclass(frozen=True, eq=False)
class Margin:
    """How far what distances are asked of may be from the families that they are taken to.

    Every point of it is within ``alone`` of a family, or else within ``meeting`` of one and within
    ``near`` of a second one.
    """

    alone: Array  # (F,): of each family; in weighted coordinates
    # meeting and near: where families meet
    meeting: float
    near: float
    # what no point of it is nearer than to Q (N, n), joint values: (N,), weighted coordinates
    own: Callable[[Array], Array] | None = None
    # (2, n): joint values of the points that are meant, where it is not all; bounds beyond are 0
    limits: Array | None = None

    def times(self, factor: float) -> Margin:
        """The same in coordinates in which no distance is longer than this many times."""
        return replace(
            self,
            alone=self.alone * factor,
            meeting=self.meeting * factor,
            near=self.near * factor,
        )

    def holds(self, Q: Array) -> Bool:
        """Return which configurations (N,) bounds are of: those within the limits."""
        low, high = (-np.inf, np.inf) if self.limits is None else self.limits
        return np.asarray(((low - ROUNDING <= Q) & (high + ROUNDING >= Q)).all(axis=1))

    def take_off(self, Q: Array, each: Array) -> Array:
        """Return bounds (N, F) of the distance of Q to the points near each family."""
        # Of those to families, (N, F, 2), lower and upper; at most the latter.
        lower = each[..., 0]
        second = np.sort(lower, axis=1)[:, 1:2] if lower.shape[1] > 1 else np.inf
        # The second nearest of a family and the others is not nearer than these two.
        there = np.maximum(lower - self.meeting, np.maximum(lower, second) - self.near)
        with np.errstate(invalid="ignore"):
            off = np.minimum(lower - self.alone, there)
        found = np.where(np.isfinite(self.meeting), np.maximum(off, 0.0), 0.0)
        found = np.where(self.holds(Q)[:, None], found, 0.0)
        if self.own is not None:
            found = np.maximum(found, np.minimum(self.own(Q)[:, None], each[..., 1]))
        return found


@dataclass(frozen=True, eq=False)
class Conditions:
    """The branches of some families, ready to be asked at many configurations."""

    families: int  # how many; branches refer to them by index
    # (n,): weighted coordinate over joint value: 1 for revolute joints, 1 / length scale for
    # prismatic ones unless weights were given
    weight: Array
    turn: Array  # (n,): a whole turn in weighted coordinates; 0 for prismatic joints
    # a point lies on a family where it lies on one of its branches
    branches: tuple[WeightedBranch, ...]
    norm: str = "euclidean"  # "euclidean" or "max"
    # what is taken off lower bounds, for them to be about a robot whose design has the families
    margin: Margin | None = None
    # (F,): whether all zeros of a family are its points; upper bounds are of such. None: of all
    sure: Bool | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.weight)

    @cached_property
    def zeros(self) -> Conditions:
        """The same of all zeros, without a margin."""
        return replace(self, margin=None, sure=None)

    @cached_property
    def sums(self) -> tuple[TrigSum, ...]:
        """The sums of all branches, one after the other."""
        return tuple(s for b in self.branches for s in b.sums)

    @cached_property
    def box(self) -> float:
        """Products of a budget that a box of a search costs at most, in all branches."""
        # Six terms take the time of one product.
        return _BOX + sum(s.rate.size for s in self.sums) / 6

    def size(self, X: Array) -> Array:
        """Length (...,) of differences X (..., n)."""
        largest = self.norm == "max"
        sizes = np.abs(X).max(axis=-1, initial=0.0) if largest else np.linalg.norm(X, axis=-1)
        return np.asarray(sizes)

    def joined(self, a: Array, b: Array) -> Array:
        """Length of a difference whose parts in some joints and the others have lengths a, b."""
        return np.asarray(np.maximum(a, b) if self.norm == "max" else np.hypot(a, b))

    def scaled(self, Q: Array) -> Array:
        """Weighted coordinates of joint values Q (..., n), C-contiguous."""
        return np.ascontiguousarray(Q * self.weight)

    @cached_property
    def flat(self) -> dict[str, Array | Ints | Bool]:
        """Return all numbers as flat arrays, as the kernel and guards in C hold them."""
        # ``x_start``: where values (equations, terms, rates, powers) of a branch (branch, equation,
        # term, term) start. The joint of a power of p is there p times.
        sums, n = self.sums, self.n
        rate, power = (
            np.concatenate([np.zeros((0, n)), *(getattr(s, k) for s in sums)])
            for k in ("rate", "power")
        )
        per_sum = {
            k: np.array([getattr(s, k) for s in sums], dtype=float)
            for k in ("noise", "reach", "curvature", "steepness")
        }
        amplitude, phase, rate_norm = (
            np.concatenate([np.zeros(0), *(getattr(s, k) for s in sums)])
            for k in ("amplitude", "phase", "rate_norm")
        )
        return {
            "family": np.array([b.family for b in self.branches], dtype=np.int64),
            "weight": self.weight,
            "turn": self.turn,
            "value_start": _starts([len(b.joints) for b in self.branches]),
            "value_joint": np.array([j for b in self.branches for j in b.joints], dtype=np.int64),
            "value": np.array([v for b in self.branches for v in b.values], dtype=float),
            "equation_start": _starts([len(b.sums) for b in self.branches]),
            "term_start": _starts([len(s.amplitude) for s in sums]),
            **per_sum,
            "sliding": np.array([bool(len(s.slides)) for s in sums], dtype=bool),
            "amplitude": amplitude,
            "phase": phase,
            "rate_norm": rate_norm,
            "rate_start": _starts((rate != 0).sum(axis=1)),
            "rate_joint": np.nonzero(rate)[1],
            "rate": rate[rate != 0],
            "power_start": _starts(power.sum(axis=1)),
            "power_joint": np.repeat(np.nonzero(power)[1], power[power != 0].astype(np.int64)),
        }

    @cached_property
    def compiled(self) -> Any | None:
        """The same in the compiled engine; None where that is not installed, or too small."""
        return engine.condition_set(self.families, self.flat, self.norm == "max")

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "compiled"}

    @classmethod
    def of(
        cls,
        families: Sequence[Sequence[Branch]],
        prismatic: Bool,
        weight: Array,
        norm: str = "euclidean",
    ) -> Conditions:
        """Conditions of families, each a sequence of branches whose union it is."""
        weight = np.array(weight, dtype=float)
        OptionError.refuse_if(
            not (np.isfinite(weight) & (weight > 0)).all(),
            f"weights must be positive numbers, got {weight.tolist()}",
        )
        heaviest = 1e30  # squares and powers of weights have to be floats
        OptionError.refuse_if(
            not ((weight >= 1 / heaviest) & (weight <= heaviest)).all(),
            f"weights must lie between {1 / heaviest:g} and {heaviest:g}, got {weight.tolist()}",
        )
        OptionError.refuse_if(
            norm not in NORMS, f"norm must be one of {', '.join(NORMS)}, got {norm!r}"
        )
        turn = np.where(prismatic, 0.0, 2 * np.pi * weight)
        weighted = []
        for f, branch in ((f, b) for f, branches in enumerate(families) for b in branches):
            joints = np.array([v.joint for v in branch.values], dtype=np.int64)
            values = np.array([v.value for v in branch.values], dtype=float) * weight[joints]
            sums = tuple(weighted_sum(e, weight, norm == "max") for e in branch.equations)
            weighted.append(WeightedBranch(f, joints, values, sums))
        return cls(len(families), weight, turn, tuple(weighted), norm)


def weighted_sum(e: Equation, weight: Array, largest: bool = False) -> TrigSum:
    """An equation as a sum in weighted coordinates."""
    rate = e.frequencies / 2
    return TrigSum(
        amplitude=np.hypot(e.cos, e.sin) / np.prod(weight**e.powers, axis=-1),
        phase=np.arctan2(-e.sin, e.cos) + rate @ e.shift,
        rate=rate / weight,
        power=e.powers,
        noise=max(e.accuracy, 1e-15) + 2.3e-16 * (2 * len(e.cos) + 16),
        largest=largest,
    )


def sums_of(branch: Branch, prismatic: Bool, weight: Array) -> list[TrigSum]:
    """Return all conditions of a branch as sums in weighted coordinates: values last."""
    sums = [weighted_sum(e, weight) for e in branch.equations]
    for v in branch.values:
        at = np.eye(len(weight))[[v.joint]]
        if prismatic[v.joint]:  # q - v
            power, phase = np.vstack([at, 0 * at]), [0.0, np.pi * (v.value > 0)]
            size = [1 / weight[v.joint], abs(v.value)]
            sums.append(TrigSum(size, phase, 0 * power, power, 5e-15))
        else:  # sin((q - v) / 2)
            rate = at / weight / 2
            sums.append(TrigSum([1.0], [-(v.value + np.pi) / 2], rate, 0 * rate, 5e-15))
    return sums


def _starts(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


SIMPLE, FLAT = 1, 2
"""Kinds of an event: one change of sign; an interval on which the equation is zero to rounding."""


@dataclass(frozen=True, eq=False)
class Zeros:
    """Events along pieces, in the order of pieces."""

    # piece and equation: (K,): where, and of which equation
    piece: Ints
    equation: Ints
    s: Array  # (K,): place within the piece, 0 to 1: the zero, or the middle of the interval
    width: Array  # (K,): half of the interval; 0 for a simple zero
    kind: Ints  # (K,): SIMPLE or FLAT
    ends: Array  # (m, E, 2): values of the equations at both ends of each piece


def zeros_along(conditions: Conditions, pieces: Array) -> Zeros:
    """Return every zero of every equation along pieces (m, degree + 1, n)."""
    # Joint values are ``sum_k pieces[i, k] s^k`` for s from 0 to 1.
    scaled = conditions.scaled(pieces)
    ends = np.empty((len(pieces), len(conditions.sums), 2))
    found = [_zeros(f, e, scaled, ends) for e, f in enumerate(conditions.sums)]
    rows = np.concatenate([np.zeros((0, 5)), *found])
    rows = rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))]
    whole = rows.astype(np.int64)
    return Zeros(whole[:, 0], whole[:, 1], rows[:, 2], rows[:, 3], whole[:, 4], ends)


def place(pieces: Array, index: Ints, s: Array) -> Array:
    """Joint values (K, n) at s (K,) of the pieces of some indices (K,)."""
    return _polynomial(pieces[index], s, np.zeros(len(s)))[0]


def _zeros(f: TrigSum, e: int, pieces: Array, ends: Array) -> Array:
    every = np.arange(len(pieces))
    for side in (0, 1):
        ends[:, e, side] = f.at(place(pieces, every, np.full(len(pieces), float(side)))).value
    index, s, h = every, np.full(len(every), 0.5), np.full(len(every), 0.5)
    looks = np.zeros(len(every), dtype=np.int64)
    rows = [np.zeros((0, 5))]
    for _ in range(44):  # by then intervals are narrower than rounding
        if not len(index):
            break
        value, slope, bend, error = _expand(f, pieces[index], s, h)
        swing = np.abs(slope) * h + 0.5 * bend * h * h
        left = np.abs(value) <= swing + error
        monotone = left & (np.abs(slope) > (bend * h + error) * (1 + 1e-12))
        np.add.at(looks, index, 1)
        flat = left & ~monotone
        flat &= (np.abs(value) + swing <= 4 * error) | (h < 1e-13) | (looks[index] > 6000)
        rows.append(_rows(index[flat], e, s[flat], h[flat], FLAT))
        rows.append(_simple(f, e, pieces, index[monotone], s[monotone], h[monotone]))
        again = left & ~monotone & ~flat
        index, half = np.repeat(index[again], 2), np.repeat(h[again] / 2, 2)
        s = np.repeat(s[again], 2) + half * np.tile([-1.0, 1.0], int(again.sum()))
        h = half
    return np.concatenate(rows)


def _rows(index: Ints, e: int, s: Array, h: Array, kind: int) -> Array:
    return np.stack([index, np.full(len(s), e), s, h, np.full(len(s), kind)], axis=1).astype(float)


def _simple(f: TrigSum, e: int, pieces: Array, index: Ints, s: Array, h: Array) -> Array:
    """Zeros on intervals on which the equation is monotone, by chords that keep the zero between.

    An end that stays counts half of its value then (M. Dowell, P. Jarratt, 1971).
    """
    low, high = s - h, s + h
    ends = [f.at(place(pieces, index, x)).value for x in (low, high)]
    change = (ends[0] < 0) != (ends[1] < 0)
    index, before, at = index[change], low[change], high[change]
    value, other = ends[1][change], ends[0][change]
    for _ in range(60):
        flat = value == other
        step = np.where(flat, 0.0, value) * (at - before) / np.where(flat, 1.0, value - other)
        at, last = at - step, at
        found = f.at(place(pieces, index, at))
        turned = (found.value < 0) != (value < 0)
        before, other = np.where(turned, last, before), np.where(turned, value, other / 2)
        value = found.value
        if ((np.abs(step) <= 1e-16) | (np.abs(value) <= found.error)).all():
            break
    return _rows(index, e, at, np.zeros(len(at)), SIMPLE)


def _expand(f: TrigSum, pieces: Array, s: Array, h: Array) -> tuple[Array, Array, Array, Array]:
    """Value, slope, bound of the second derivative and error on intervals (K,)."""
    x, x_slope, x_most, x_bend = _polynomial(pieces, s, h)
    _, turning, _, second = _polynomial(pieces @ f.rate.T, s, h)
    far = np.abs(pieces[:, :, f.used]).sum(axis=1).max(axis=1, initial=0.0)
    value, gradient, error, _ = f.at(x, far=2 * pieces.shape[1] * np.maximum(far, 4.0))
    size, width = f.sizes(x_most), h[:, None]
    bend = f.bend(x_most, np.abs(turning) + second * width, np.abs(x_slope) + x_bend * width)
    for j in f.slides:
        second = second + f.power[:, j] * x_bend[:, j, None] / np.maximum(
            x_most[:, j, None], 1e-150
        )
    bend += (size * second).sum(axis=1) * (1 + 1e-12)
    return value, (gradient * x_slope).sum(axis=1), bend, error


def _polynomial(a: Array, s: Array, h: Array) -> tuple[Array, Array, Array, Array]:
    """Expand polynomials a (K, degree + 1, m) at s (K,): all results (K, m)."""
    # Value and slope, and bounds of value and second derivative on s - h to s + h.
    s, h = s[:, None], h[:, None]
    value, slope, second = (np.zeros((len(a), a.shape[2])) for _ in range(3))
    for i in range(a.shape[1] - 1, -1, -1):
        slope = slope * s + value
        value = value * s + a[:, i]
    for i in range(a.shape[1] - 1, 1, -1):
        second = second * (s + h) + i * (i - 1) * np.abs(a[:, i])
    return value, slope, np.abs(value) + (np.abs(slope) + second * h) * h, second


_WINDOW = 1.0
"""How far ahead second derivatives are bounded where lengths occur."""


def contact_along(
    c: Conditions, family: int, x: Array, velocity: Array, horizon: float
) -> tuple[float, float]:
    """Return the contact of ``x + t velocity`` with any condition, and the rate for one family.

    ``x``, ``velocity`` (n,) are weighted coordinates, and per second. No condition is met before
    the first number, up to the horizon (seconds): proven; infinite for none. The second is how fast
    the first-order distance from the family grows, whose number is -1 for none.
    """
    speed = float(np.abs(velocity).max())
    if not speed > 0:
        return math.inf, 0.0
    u = velocity / speed
    own = [_approach(c, b, x, u) for b in c.branches if b.family == family]
    rate = min(own, default=(0.0, 0.0))[1] * speed
    end = min(horizon * speed, 1e6)
    work = max(2 * sum(len(s.amplitude) for s in c.sums), 300)
    best, met = end, False
    for branch in c.branches:
        s, at, steps = 0.0, x, 0
        while s < best:
            step = _step(c, branch, at, u)
            s, work = s + step, work - len(branch.joints)
            work -= sum(len(f.amplitude) for f in branch.sums)
            if step <= 1e-9 + 1e-7 * s or steps == 64 or work < 0:
                break
            at, steps = x + min(s, best) * u, steps + 1
        if s < best:
            best, met = s, True
    if met:
        return best * (1 - 1e-14) / speed, rate
    return end / speed if end < horizon * speed else math.inf, rate


def _step(c: Conditions, branch: WeightedBranch, x: Array, u: Array) -> float:
    """Return how far along u a branch is not met."""
    values = zip(branch.joints, branch.values, c.turn[branch.joints], strict=True)
    steps = [_of_value(*map(float, (v, x[j], u[j], turn))) for j, v, turn in values]
    return max([*steps, *(_of_sum(s, x, u) for s in branch.sums)])


def _of_value(value: float, here: float, moves: float, turn: float) -> float:
    ahead = value - here
    slack = 1e-15 * (abs(here) + abs(value) + turn)
    off = ahead - turn * math.floor(ahead / turn + 0.5) if turn > 0 else ahead
    if abs(off) <= slack:
        return 0.0
    ahead = ahead if moves > 0 else -ahead
    if turn > 0:
        ahead -= turn * math.floor(ahead / turn)
    if moves == 0 or ahead < 0:
        return math.inf
    return max(ahead - slack, 0.0) / abs(moves) * (1 - 1e-15)


def _of_sum(s: TrigSum, x: Array, u: Array) -> float:
    value, gradient, error, slope_error = (a[0] for a in s.at(x[None]))
    left = float(max(abs(value) - error, 0.0))
    if not left > 0:
        return 0.0
    slope = float(gradient @ u)
    falls = float(-slope if value > 0 else slope) + float(slope_error * np.abs(u).sum())
    swing = np.abs(s.rate @ u) + 1e-14 * (np.abs(s.rate) @ np.abs(u))
    bend = float(s.bend((np.abs(x) + _WINDOW * np.abs(u))[None], swing, np.abs(u)[None])[0])
    if bend == 0:  # none of its joints moves
        return math.inf
    root = math.sqrt(falls * falls + 2 * bend * left)
    step = (2 * left / (falls + root) if falls > 0 else (root - falls) / bend) * (1 - 1e-12)
    return min(step, _WINDOW) if len(s.slides) else step


def _approach(c: Conditions, branch: WeightedBranch, x: Array, u: Array) -> tuple[float, float]:
    """First-order distance from a branch, and how it changes along u."""
    off, joints = np.zeros(c.n), branch.joints
    off[joints] = off_values(x[None, joints], branch.values, c.turn[joints])[0]
    across = float(u[joints] @ u[joints])
    if branch.sums:
        at = [s.at(x[None]) for s in branch.sums[:COMBINED]]
        g, value = np.concatenate([a.gradient for a in at]), np.concatenate([a.value for a in at])
        gram, moves = g @ g.T, g @ u
        gram += (1e-9 * np.trace(gram) + 1e-300) * np.eye(len(gram))
        off += g.T @ np.linalg.solve(gram, value)
        across += float(moves @ np.linalg.solve(gram, moves))
    distance = float(np.linalg.norm(off))
    if distance > 1e-12:
        return distance, float(off @ u) / distance
    return distance, math.sqrt(max(across, 0.0))


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of the distance to the nearest family, and to each."""

    # lower and upper: (N,): in weighted coordinates; infinite where there is no family, or no
    # bound. Lower ones less the conditions' margin
    lower: Array
    upper: Array
    # (N,): the one of the least lower bound, before a margin is taken off; -1 without any
    family: Ints
    each: Array  # (N, F, 2): lower and upper bound of each family; (0, 0, 2) unless asked for
    # (N, F, n): weighted coordinates of points; families are no farther from them than upper bounds
    # are longer than the ways there. (0, F, n) unless asked for
    points: Array


def two_sided(
    conditions: Conditions,
    Q: Array,
    *,
    each: bool = False,
    compiled: bool = True,
    threads: int | None = None,
    isa: str | None = None,
    points: bool = False,
) -> Bounds:
    """Return distance bounds of finite Q (N, n) from conditions, or ``each`` family's.

    With ``points`` upper ones are closer where the engine is compiled.
    """
    # ``isa`` is an instruction set of the compiled engine, for the same bits on every machine.
    X = conditions.scaled(Q)
    handle = conditions.compiled if compiled else None
    N, F = len(X), conditions.families
    margin, sure = conditions.margin, conditions.sure
    if margin is not None or sure is not None:
        ask = partial(two_sided, compiled=compiled, threads=threads, isa=isa, points=points)
        found = ask(conditions.zeros, Q, each=True)
        family = _nearest(found.each)[2]
        if sure is not None:
            found.each[:, ~sure, 1] = np.inf
        if margin is not None:
            found.each[..., 0] = margin.take_off(Q, found.each)
        lower, upper, _ = _nearest(found.each)
        return replace(found, lower=lower, upper=upper, family=family)
    if handle is not None:
        count = 1 if N < 4096 else threads or engine.cpu_count()
        how = each, points, isa or engine.isa_names()[-1], count
        lower, upper, family, every, near = handle.clearances(X, *how)
        every = np.empty((0, 0, 2)) if every is None else every
        near = np.empty((0, F, X.shape[1])) if near is None else near
        return Bounds(lower, upper, family.astype(np.int64), every, near)
    every, near = np.empty((N, F, 2)), np.repeat(X[: N if points else 0, None], F, axis=1)
    rows = max(1, 2_000_000 // max((len(s.amplitude) for s in conditions.sums), default=1))
    for first in range(0, N, rows):
        every[first : first + rows] = _each(conditions, X[first : first + rows])
    return Bounds(*_nearest(every), every, near)


def _nearest(each: Array) -> tuple[Array, Array, Ints]:
    lower, upper = (each[..., k].min(axis=1, initial=np.inf) for k in (0, 1))
    family = np.argmin(each[..., 0], axis=1) if each.shape[1] else np.full(len(each), -1)
    return lower, upper, np.where(np.isfinite(lower), family, -1)


@np.errstate(over="ignore")  # a quotient that overflows is a distance farther than any other
def _each(c: Conditions, X: Array) -> Array:
    out = np.full((len(X), c.families, 2), np.inf)
    for branch in c.branches:
        lower, upper = _of_values(c, branch, X)
        if branch.sums:
            at = [s.at(X) for s in branch.sums]
            reached = (
                _reached(branch.sums[0], X, at[0]) if len(at) == 1 else np.full(len(X), np.inf)
            )
            lower = c.joined(lower, to_zeros(branch.sums, at, X)) * (1 - 1e-15)
            upper = c.joined(upper, reached) * (1 + 1e-15)
        here = out[:, branch.family]
        np.minimum(here, np.stack([lower, upper], axis=1), out=here)
    return out


def _of_values(c: Conditions, branch: WeightedBranch, X: Array) -> tuple[Array, Array]:
    joints = branch.joints
    off, slack = off_values(X[:, joints], branch.values, c.turn[joints])
    total = c.size(off)
    slack = slack + 1e-15 * total
    return np.maximum(total - slack, 0.0), total + slack


def _reached(s: TrigSum, X: Array, at: At) -> Array:
    """Distance by which a zero is reached along the gradient; infinite where it need not be."""
    value, slope = np.abs(at.value) + at.error, s.dual(at.gradient) - at.slope_error
    within = np.minimum(2 * value / np.maximum(slope, TINY), 1e3)
    least = np.sqrt(2 * (s.bend_within(X, within) * value))
    # The root of slope^2 - least^2: squares of huge slopes overflow.
    root = np.sqrt(np.maximum(slope - least, 0.0)) * np.sqrt(np.maximum(slope + least, 0.0))
    found = 2 * value / np.maximum(slope + root, TINY) * (1 + 8e-15)
    return np.where((slope >= least) & (slope > 0) & (found <= within * (1 + 1e-9)), found, np.inf)


def halved(centers: Array, halves: Array, axis: Ints) -> tuple[Array, Array]:
    """Return centres and half widths (2N, n) of the halves of boxes, each cut along one joint."""
    cut = np.eye(centers.shape[1])[axis] * halves / 2
    return np.concatenate([centers - cut, centers + cut]), np.tile(halves - cut, (2, 1))


GAP = 1e-6
"""Upper less lower bound at which a search ends."""

BOXES = 300_000
"""Boxes for one configuration at most: half a second of the compiled search, of sums of some dozen
terms. Arms of the catalogue take up to 10,000 for the default gap."""
WORK = 10.0
"""Seconds of a budget: of `suggest`, where arms of the catalogue use 3.2 at most, and of a search
whose number of boxes is not given. All BOXES of sums of a hundred terms take less; chains with
thousands of terms take up to a minute for these. Of a finger of Alex they would gain next to
nothing more; of its arm to the wrist, 9 joints, a lower bound of 0.49 instead of 0.42 rad."""
_BOX = 20.0
"""Products that a box costs besides its terms."""


@dataclass(frozen=True)
class SearchOptions:
    """How far, and among which points, the nearest one is searched."""

    gap: float = GAP  # upper less lower bound at which a search may end, in weighted coordinates
    # boxes looked at for one configuration, after which the bounds reached so far are returned;
    # None for BOXES, or as many as WORK allows
    boxes: int | None = None
    # whether only points within the joint limits count. Otherwise revolute differences are wrapped,
    # and all values of prismatic joints allowed
    within_limits: bool = False

    def __post_init__(self) -> None:
        OptionError.refuse_if(not self.gap > 0, f"gap must be positive, got {self.gap!r}")
        if self.boxes is not None:
            whole_number(self.boxes, "boxes", 1, 10**12)


@dataclass(frozen=True, eq=False)
class Nearest:
    """Nearest points of conditions."""

    # lower and upper: (N,): no point is nearer than ``lower``, one was found at ``upper``; weighted
    # coordinates. Both are infinite where there is proven to be none; ``upper`` alone where none
    # was found
    lower: Array
    upper: Array
    family: Ints  # (N,): family of the point found, -1 without any
    q: Array  # (N, n): the points found, joint values
    boxes: Ints  # (N,): boxes looked at


def nearest_points(
    conditions: Conditions,
    Q: Array,
    lower: Array,
    upper: Array,
    options: SearchOptions,
    *,
    compiled: bool = True,
) -> Nearest:
    """Return nearest points of conditions to finite Q (N, n), by best-first branch and bound."""
    # Joint limits are (n,), or (families, n), infinite where there are none.
    margin = conditions.margin
    if margin is not None:
        # What is within the limits may be near to points of conditions that are not.
        off = min(max(margin.meeting, margin.near), 2 * np.pi) / conditions.weight
        limits = lower - off, upper + off
        plain = nearest_points(conditions.zeros, Q, *limits, options, compiled=compiled)
        each = two_sided(conditions.zeros, Q, each=True, compiled=compiled).each
        each[..., 0] = np.maximum(each[..., 0], plain.lower[:, None])
        least = margin.take_off(Q, each).min(axis=1, initial=np.inf)
        return replace(plain, lower=np.minimum(least, plain.upper))
    boxes = options.boxes or max(1, min(BOXES, int(WORK * PER_SECOND / conditions.box)))
    X = conditions.scaled(Q)
    N, n = X.shape
    low = np.ascontiguousarray(np.asarray(lower, dtype=float) * conditions.weight)
    high = np.ascontiguousarray(np.asarray(upper, dtype=float) * conditions.weight)
    far = 100.0 + float(np.abs(X).max(initial=0.0))  # how far slides without limits are searched
    handle = conditions.compiled if compiled else None
    if handle is not None:
        how = options.within_limits, far, options.gap, boxes, engine.cpu_count()
        least, most, family, looked, points = handle.nearest(X, low, high, *how)
    else:
        least, most, points = np.full(N, np.inf), np.full(N, np.inf), X.copy()
        family, looked = np.full(N, -1, dtype=np.int64), np.empty(N, dtype=np.int64)
        within = np.broadcast_to(np.stack([low, high], axis=-2), (conditions.families, 2, n))
        for i, x in enumerate(X):
            found = _nearest_by_boxes(conditions, x, within, far, replace(options, boxes=boxes))
            least[i], most[i], family[i], points[i], looked[i] = found
    return Nearest(least, most, family, points / conditions.weight, looked)


def _nearest_by_boxes(
    c: Conditions, x: Array, limits: Array, far: float, options: SearchOptions
) -> tuple[float, float, int, Array, int]:
    """Lower and upper bound of the distance of x (n,), family and point found, and boxes."""
    # Limits are (families, 2, n), in weighted coordinates.
    lower, upper, family, point, looked = np.inf, np.inf, -1, x, 0
    starts = []
    for k, b in enumerate(c.branches):
        target = _put(c, b, x, limits[b.family], options.within_limits)
        if target is not None:
            starts.append((float(c.size(target - x)), k, target))
    for _, k, target in sorted(starts, key=lambda s: s[:2]):
        branch = c.branches[k]
        boxes = _Boxes(c, branch, x, target, limits[branch.family], far, options, upper)
        looked += boxes.run((options.boxes or BOXES) - looked)
        if boxes.point is not None:
            upper, family, point = boxes.best, branch.family, boxes.point
        lower = min(lower, boxes.proven)
    return min(lower, upper), upper, family, point, looked


def _put(
    c: Conditions, branch: WeightedBranch, x: Array, limits: Array, limited: bool
) -> Array | None:
    """Put joints at their values, the nearest copies; None where the limits allow none."""
    out, j = x.copy(), branch.joints
    low, high = np.full((2, len(j)), [[-np.inf], [np.inf]])
    if limited:  # joints that do not matter are put within their limits
        out = np.where(branch.used(c.n), x, np.clip(x, *limits))
        low, high = limits[0, j] - 1e-9, limits[1, j] + 1e-9
    turn = np.where(c.turn[j] > 0, c.turn[j], 1.0)
    first, last = np.ceil((low - branch.values) / turn), np.floor((high - branch.values) / turn)
    turns = np.clip(np.round((x[j] - branch.values) / turn), first, last)
    out[j] = branch.values + c.turn[j] * turns
    return None if ((out[j] < low) | (out[j] > high)).any() else out


class _Boxes:
    """The sums of one branch, and the boxes that may hold a common zero nearer than the best.

    Joints that are in no sum are where the branch has them, nearest to x: at a ``target`` (n,).
    """

    def __init__(
        self,
        c: Conditions,
        branch: WeightedBranch,
        x: Array,
        target: Array,
        limits: Array,
        far: float,
        options: SearchOptions,
        best: float,
    ) -> None:
        self.c, self.sums, self.x, self.gap = c, branch.sums, x, options.gap
        self.best, self.point, self.proven = best, None, np.inf
        self.used = used = branch.used(c.n)
        slack = 1e-15 * (1 + float(np.abs(x).max(initial=0.0)) + 2 * np.pi) * (c.n + 1)
        self.fixed = c.size((target - x)[~used])
        self.at_least = np.maximum(self.fixed - slack, 0.0)
        below, above = used & options.within_limits & np.isfinite(limits)
        reach = np.where(c.turn > 0, c.turn / 2, far)
        low, high = np.where(below, limits[0], x - reach), np.where(above, limits[1], x + reach)
        high = np.where(below & ~above, np.maximum(x, low) + 2 * reach, high)
        low = np.where(above & ~below, np.minimum(x, high) - 2 * reach, low)
        self.low, self.high = np.where(used, low, target), np.where(used, high, target)
        endless = bool((used & (c.turn == 0) & ~(below & above)).any())
        self.beyond = far if endless else np.inf

    def run(self, most: int) -> int:
        """Halve boxes, the nearest first, until the bounds are within the gap; return how many."""
        looked = 0
        if self.fixed < self.best:
            self._attempt(np.clip(self.x, self.low, self.high)[None])
        low = np.where(self.used, np.maximum(self.low, self.x - self.best), self.low)
        high = np.where(self.used, np.minimum(self.high, self.x + self.best), self.high)
        centers, halves = ((low + high) / 2)[None], ((high - low) / 2 * (1 + 1e-15))[None]
        bounds = self._bound(centers, halves) if (low <= high).all() else np.array([np.inf])
        while True:
            done = bounds >= self.best - self.gap / 2
            self.proven = min(self.proven, float(bounds[done].min(initial=np.inf)))
            keep = np.isfinite(bounds) & ~done
            centers, halves, bounds = centers[keep], halves[keep], bounds[keep]
            if not len(bounds) or looked >= most:
                break
            order = np.argsort(bounds)
            now, later = order[:256], order[256:]
            split, both = halved(centers[now], halves[now], halves[now].argmax(axis=1))
            both *= 1 + 4e-16
            looked += len(split)
            fresh = np.maximum(self._bound(split, both), np.tile(bounds[now], 2))
            likely = np.argsort(fresh)[:4]
            self._attempt(split[likely[np.isfinite(fresh[likely])]])
            centers = np.concatenate([centers[later], split])
            halves = np.concatenate([halves[later], both])
            bounds = np.concatenate([bounds[later], fresh])
        self.proven = min(self.proven, float(bounds.min(initial=np.inf)), self.best, self.beyond)
        return looked

    def _bound(self, centers: Array, halves: Array) -> Array:
        """Lower bounds (N,) of the distance to the set within boxes; infinite where it is empty."""
        near = np.clip(self.x, centers - halves, centers + halves)
        out = self.c.size((near - self.x)[:, self.used]) * (1 - 4e-15)
        at = [s.at(centers) for s in self.sums]
        rests = []
        for s, a in zip(self.sums, at, strict=True):
            swing = halves @ np.abs(s.rate).T
            rests.append(0.5 * s.bend(np.abs(centers) + halves, swing, halves) + 2 * a.error)
            out = np.maximum(out, self._slab(centers, halves, a.value, a.gradient, rests[-1]))
        if len(at) > 1:  # and the sum of multiples that the least-norm step has
            value, g = (np.stack([a[k] for a in at], axis=1) for k in (0, 1))
            m = least_norm(g, value + np.einsum("nij,nj->ni", g, near - centers))
            rest = (np.abs(m) * (np.stack(rests, axis=1) + 1e-15 * np.abs(value))).sum(axis=1)
            g, value = (m[..., None] * g).sum(axis=1), (m * value).sum(axis=1)
            out = np.maximum(out, self._slab(centers, halves, value, g, rest))
        return self.c.joined(self.at_least, out) * (1 - 4e-15)

    def _slab(self, centers: Array, halves: Array, value: Array, g: Array, rest: Array) -> Array:
        """Distance (N,) to {|value + g (y - center)| <= rest}; infinite where no box meets it."""
        there = value + (g * (self.x - centers)).sum(axis=1)
        size = np.abs(value) + (np.abs(g) * (np.abs(self.x) + np.abs(centers))).sum(axis=1)
        outside = np.abs(there) - rest - 4e-16 * (self.c.n + 2) * size
        far = np.maximum(outside, 0.0) / np.maximum(self.sums[0].dual(g), TINY) * (1 - 4e-15)
        reach = rest + (np.abs(g) * halves).sum(axis=1)
        return np.where(np.abs(value) > reach * (1 + 1e-14), np.inf, far)

    def _attempt(self, x: Array) -> None:
        """Descend from starts x (N, n) to points of the set that are near, and keep the nearest."""
        if not len(x):
            return
        for iteration in range(60):
            residual, A = self._system(x)
            relax = 0.5 ** (iteration // 12) if iteration < 48 else 0.0
            pull = relax * (self.x - x) * self.used
            free = np.ones(x.shape, dtype=bool)
            for _ in range(2):  # a joint at its limit is held where it would leave
                # Least-norm steps to linearised zeros, and what of the pull is along these.
                held, along = np.where(free[:, None], A, 0.0), np.where(free, pull, 0.0)
                change = residual + np.einsum("nij,nj->ni", held, along)
                back = np.einsum("nij,nj->ni", np.linalg.pinv(held, rcond=1e-9), change)
                step = np.where(free, along - back, 0.0)
                free &= (np.clip(x + step, self.low, self.high) != x) | (step == 0)
            size = np.abs(step).max(axis=1, keepdims=True)
            x = x + step * np.minimum(1.0, 0.6 / np.maximum(size, TINY))
            x = np.clip(x, self.low, self.high)
        residual, _ = self._system(x)
        off = self.c.joined(self.fixed, self.c.size((x - self.x)[:, self.used]))
        off = np.where(np.abs(residual).max(axis=1, initial=0.0) <= 1e-12, off, np.inf)
        k = int(np.argmin(off))
        if off[k] < self.best:
            self.best, self.point = float(off[k]), x[k]

    def _system(self, x: Array) -> tuple[Array, Array]:
        """Residuals (N, k) and slopes (N, k, n) at x (N, n), each over the size of its sum."""
        size = [float(s.amplitude.sum()) * max(1.0, s.noise * 1e13) for s in self.sums]
        at = [s.at(x) for s in self.sums]
        values = [a.value / u for a, u in zip(at, size, strict=True)]
        slopes = [a.gradient / u for a, u in zip(at, size, strict=True)]
        shape = len(self.sums), *x.shape
        every = np.reshape(values, shape[:2]).T, np.reshape(slopes, shape).swapaxes(0, 1)
        return every[0], every[1] * self.used
