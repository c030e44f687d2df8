"""Joint space as a product: joints that no equation joins are cut into arcs, each on its own.

Only what has codimension 1 separates. A joint value cuts its joint exactly; equations join the
joints that they share into a group, and a group is looked at on each box of arcs,
where its components and ways within them are found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.equation import Equation
from pinsing.algebra.trig_sum import TrigSum
from pinsing.measures import PRACTICAL
from pinsing.postures.boxes import sum_of
from pinsing.proximity.watched import Watched


@dataclass(frozen=True)
class Arc:
    """An open range of one joint, between cuts or limits."""

    joint: int  # index of the joint
    # low and high: radians or metres; infinite for a slide without an end
    low: float
    high: float
    # whether both ends are the same point: a joint that turns endlessly, and has no cut
    circle: bool = False

    @property
    def middle(self) -> float:
        """A value well inside."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return (self.low + self.high) / 2
        if math.isfinite(self.low):
            return self.low + 1.0
        return self.high - 1.0 if math.isfinite(self.high) else 0.0

    def put(self, value: float, endless: bool) -> float | None:
        """The value on this arc, by whole turns if the joint turns endlessly; None if it is off."""
        if self.circle:
            return value
        if endless:
            value += 2 * math.pi * math.ceil((self.low - value) / (2 * math.pi))
        return value if self.low < value < self.high else None


@dataclass(frozen=True, eq=False)
class Surface:
    """An equation that separates."""

    family: str  # name of its family
    equation: Equation  # it; its sign tells the sides apart
    irreducible: bool  # whether it is one factor over the field of the geometry, and known to be


@dataclass(frozen=True, eq=False)
class Part:
    """Joints that are told apart from the others: one joint, or a group that equations join."""

    joints: tuple[int, ...]  # their indices, ascending
    arcs: tuple[tuple[Arc, ...], ...]  # what cuts and limits leave of each of them
    surfaces: tuple[Surface, ...]  # equations in these joints
    families: tuple[str, ...] = ()  # what cuts them, by name

    @property
    def boxes(self) -> tuple[tuple[Arc, ...], ...]:
        """Every choice of one arc of each joint."""
        return tuple(product(*self.arcs))


@dataclass(frozen=True, eq=False)
class Partition:
    """Joint space less what separates it, as a product of parts."""

    parts: tuple[Part, ...]  # they share no joint
    # low and high: (n,): ends of the joints: the limits, or infinite
    low: Array
    high: Array
    endless: tuple[bool, ...]  # which joints are circles where nothing cuts them
    exact: bool  # whether these are all that separates
    notes: tuple[str, ...]  # what is not counted, or was taken for something else
    cutting: tuple[str, ...]  # families that separate


def partition(watched: Watched, limits: bool) -> Partition:
    """Cut joint space, within the limits or on whole circles, where slides are endless."""
    n = watched.n
    low = watched.lower if limits else np.full(n, -np.inf)
    high = watched.upper if limits else np.full(n, np.inf)
    endless = tuple(bool(b) for b in ~watched.prismatic & ~(np.isfinite(low) & np.isfinite(high)))
    cuts: list[set[float]] = [set() for _ in range(n)]
    cut_by: list[set[str]] = [set() for _ in range(n)]
    surfaces: list[Surface] = []
    notes: list[str] = []
    exact = watched.complete
    cutting: list[str] = []
    for name, family in zip(watched.names, watched.families, strict=True):
        if not family.real or family.codimension != 1:
            continue
        cutting.append(name)
        for branch in family.branches:
            if len(branch.values) == 1 and not branch.equations:
                (cut,) = branch.values
                cuts[cut.joint].add(cut.value)
                cut_by[cut.joint].add(name)
            elif len(branch.equations) == 1 and not branch.values:
                whole = len(family.branches) == 1 and watched.complete
                surfaces.append(Surface(name, branch.equations[0], whole))
            else:
                exact = False
                notes.append(
                    f"{name} is stated by several equations: what it separates is not counted"
                )
    arcs = [
        _arcs(
            j,
            cuts[j],
            float(low[j]),
            float(high[j]),
            endless[j],
            bool(watched.prismatic[j]),
            notes,
            watched.joints[j],
        )
        for j in range(n)
    ]
    parts = []
    for joints in _groups(n, surfaces):
        mine = tuple(s for s in surfaces if set(s.equation.involved) <= set(joints))
        free = [j for j in joints if mine and any(math.isinf(a.high - a.low) for a in arcs[j])]
        if free:
            exact = False
            names = ", ".join(watched.joints[j] for j in free)
            notes.append(f"{names} has no limits: what equations separate is not counted")
            parts += [Part((j,), (arcs[j],), (), tuple(sorted(cut_by[j]))) for j in joints]
            continue
        families = {s.family for s in mine}.union(*(cut_by[j] for j in joints))
        parts.append(Part(joints, tuple(arcs[j] for j in joints), mine, tuple(sorted(families))))
    return Partition(
        tuple(parts), low, high, endless, exact, tuple(notes), tuple(dict.fromkeys(cutting))
    )


def _arcs(
    joint: int,
    cuts: set[float],
    low: float,
    high: float,
    endless: bool,
    slides: bool,
    notes: list[str],
    name: str,
) -> tuple[Arc, ...]:
    turn = 2 * math.pi
    if endless:
        if not cuts:
            return (Arc(joint, -math.pi, math.pi, True),)
        ends = sorted(math.remainder(c, turn) for c in cuts)
        ends.append(ends[0] + turn)
        return tuple(Arc(joint, a, b) for a, b in pairwise(ends))
    inside = []
    for c in cuts:
        turns = [0]
        if not slides:
            turns = list(range(math.floor((low - c) / turn), math.ceil((high - c) / turn) + 1))
        for k in turns:
            v = c + turn * k
            if low + PRACTICAL < v < high - PRACTICAL:
                inside.append(v)
            elif low < v < high:
                notes.append(
                    f"{name}: a singular value lies on the joint limit, within {PRACTICAL:g}"
                )
    ends = [low, *sorted(inside), high]
    return tuple(Arc(joint, a, b) for a, b in pairwise(ends))


def _groups(n: int, surfaces: list[Surface]) -> list[tuple[int, ...]]:
    """Joints that share an equation, directly or by way of others."""
    groups = [{j} for j in range(n)]
    for s in surfaces:
        joined = [g for g in groups if not g.isdisjoint(s.equation.involved)]
        groups = [g for g in groups if g not in joined] + [set[int]().union(*joined)]
    return sorted(tuple(sorted(g)) for g in groups)


Clear = Callable[[Array], bool]
"""Whether a polyline (K, d) in the joints of a part meets nothing that separates."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """How many components there are, counted from both sides."""

    lower: int  # no fewer components than this
    upper: int  # those that were found; no more where ``closed``
    closed: bool = True  # whether none can be missing

    @property
    def proven(self) -> bool:
        """True if both numbers agree."""
        return self.closed and self.lower == self.upper


def toward(a: Array, b: Array, circle: Bool) -> Array:
    """b, by whole turns of circles as near to a as can be."""
    return np.where(circle, b + 2 * math.pi * np.round((a - b) / (2 * math.pi)), b)


@dataclass(frozen=True, eq=False)
class Plain:
    """A box that no equation divides."""

    part: Part
    box: tuple[Arc, ...]
    found: Counts = Counts(lower=1, upper=1)

    def examples(self, component: int) -> Array:
        """Points (K, d) of the component, its middle first."""
        rng = np.random.default_rng(0)
        middle = np.array([a.middle for a in self.box])
        pairs = zip(self.box, middle, strict=True)
        ends = np.array([[max(a.low, m - 3), min(a.high, m + 3)] for a, m in pairs])
        share = rng.uniform(0.05, 0.95, (63, len(middle)))
        return np.concatenate([middle[None], ends[:, 0] + share * (ends[:, 1] - ends[:, 0])])

    def signs(self, component: int) -> tuple[int, ...]:
        """Nothing has a sign."""
        return ()

    def locate(self, x: Array, clear: Clear) -> int | None:
        """Every point is of the only component."""
        return 0

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """The straight line."""
        return np.stack([a, toward(a, b, np.array([arc.circle for arc in self.box]))])


def top_of(f: TrigSum, hub: int, x: Array, s: Array | float) -> Array:
    """Values (...,) of the hub, once in every term, at which s f is largest over x (..., d)."""
    a, b = x.copy(), x.copy()
    a[..., hub], b[..., hub] = 0.0, math.pi / 2
    top = np.arctan2(s * f(b), s * f(a))
    return np.asarray(top + 2 * math.pi * np.round((x[..., hub] - top) / (2 * math.pi)))


def turns_once(equation: Equation, joint: int) -> bool:
    """Return True if a joint turns exactly once in every term."""
    once = (np.abs(equation.frequencies[:, joint]) == 2).all()
    return bool(once) and not equation.powers[:, joint].any()


def hub_of(part: Part, box: tuple[Arc, ...]) -> int | None:
    """Place in the part of a joint that turns endlessly and is in every term exactly once."""
    equation = part.surfaces[0].equation
    if not part.surfaces[0].irreducible or len(equation.involved) < 2:
        return None
    hubs = (k for k, j in enumerate(part.joints) if box[k].circle and turns_once(equation, j))
    return next(hubs, None)


@dataclass(frozen=True, eq=False)
class Wheel:
    """A box divided by one equation that has a joint which turns endlessly once in every term.

    Then f = R cos(q - phi) with R and phi functions of the other joints. Where R is not zero, f is
    positive on one arc of q and negative on another. R is zero where two polynomials are that have
    no factor in common, since it would be one of f, which is irreducible: on a set of codimension 2
    or more, which does not separate the box of the other joints. So f > 0 is connected, and f < 0
    is. They are one where f changes its sign once round another joint.
    """

    part: Part
    box: tuple[Arc, ...]
    hub: int

    @cached_property
    def _terms(self) -> TrigSum:
        return sum_of(self.part.surfaces[0].equation, self.part.joints)

    @cached_property
    def _circle(self) -> Bool:
        return np.array([a.circle for a in self.box])

    @cached_property
    def _odd(self) -> Bool:
        """Joints once round which f changes its sign."""
        odd = np.round(2 * self._terms.rate).astype(np.int64) % 2 != 0
        return np.asarray(odd.any(axis=0) & self._circle)

    @property
    def _joined(self) -> bool:
        return bool(self._odd.any())

    @property
    def found(self) -> Counts:
        """Both signs, or one set."""
        count = 1 if self._joined else 2
        return Counts(lower=count, upper=count)

    def examples(self, component: int) -> Array:
        """Points (K, d), where |f| is large first."""
        rng = np.random.default_rng(0)
        low, high = (np.array([getattr(a, k) for a in self.box]) for k in ("low", "high"))
        inside = low + (high - low) * rng.uniform(0.05, 0.95, (512, len(low)))
        s = 1.0 if component == 0 else -1.0
        x = self._top(inside, s)
        return np.asarray(x[np.argsort(-np.abs(self._terms(x)))[:32]])

    def signs(self, component: int) -> tuple[int, ...]:
        """The sign of the equation."""
        return (0 if self._joined else (1, -1)[component],)

    def locate(self, x: Array, clear: Clear) -> int | None:
        """The sign of the equation tells."""
        return 0 if self._joined or self._terms(x) > 0 else 1

    def _top(self, x: Array, s: float) -> Array:
        """Points (..., d) with the hub where s f is largest, by whole turns near to what it was."""
        top = x.copy()
        top[..., self.hub] = top_of(self._terms, self.hub, x, s)
        return top

    def route(self, component: int, a: Array, b: Array, clear: Clear) -> Array | None:
        """By way of the tops over a line in the other joints, or over lines round R = 0."""
        s, rng = float(np.sign(self._terms(a))), np.random.default_rng(0)
        goal = toward(a, b, self._circle)
        if self._terms(goal) * s < 0:  # half a turn of signs away
            goal[self._odd.argmax()] += 2 * math.pi
        low, high = (np.array([getattr(arc, k) for arc in self.box]) for k in ("low", "high"))
        for attempt in range(12):
            middle = [low + (high - low) * rng.uniform(0.05, 0.95, len(a))] if attempt else []
            points = [a, self._top(a, s)]
            for stop in (*middle, goal):
                if (way := self._follow(points[-1], stop, s, clear, 0)) is None:
                    break
                points += way
            else:
                end = goal.copy()
                end[self.hub] = toward(points[-1], goal, self._circle)[self.hub]
                path = np.array([*points, end])
                if clear(path):
                    return path
        return None

    def _follow(
        self, here: Array, there: Array, s: float, clear: Clear, depth: int
    ) -> list[Array] | None:
        """Tops from one top to that over another point, close enough for straight lines."""
        there = there.copy()
        there[self.hub] = here[self.hub]
        end = self._top(there, s)
        if abs(end[self.hub] - here[self.hub]) < 1.2 and clear(np.stack([here, end])):
            return [end]
        if depth > 9:
            return None
        half = self._follow(here, (here + there) / 2, s, clear, depth + 1)
        if half is None:
            return None
        rest = self._follow(half[-1], there, s, clear, depth + 1)
        return None if rest is None else half + rest
