"""Points on the zero set of equations, which are singular, how near; proof that a box has none.

In closed form all joints are drawn but as many as there are equations. A joint that enters an
equation once is found from the others: with f = A cos q + B sin q + C,
q = atan2(B, A) +- arccos(-C / sqrt(A^2 + B^2)). Where several equations hold, each is solved for a
joint that none of those solved before it has, so that these still hold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pinsing.algebra.budget import PER_SECOND
from pinsing.algebra.conditions import Branch, Conditions, SearchOptions, nearest_points
from pinsing.algebra.equation import Equation, System
from pinsing.interface import JsonResult
from pinsing.kinematics.jacobian import ratios
from pinsing.kinematics.refine import approach
from pinsing.measures import FLOAT_NOISE, NOISE, ROUNDING, Array, Bool
from pinsing.robot.arm import Arm, JointSpace


@dataclass(frozen=True, eq=False)
class SearchBox:
    """Where points are looked for: free joints between bounds, others fixed; all (n,)."""

    lower: Array
    upper: Array
    free: Bool
    fixed: Array

    @classmethod
    def of(
        cls, branch: Branch, lower: Array, upper: Array, fixed: Array | None = None
    ) -> SearchBox:
        """Of a branch, whose joints with a value are held there, or at some copies of these."""
        held, free = np.zeros(len(lower)), np.ones(len(lower), dtype=bool)
        for v in branch.values:
            held[v.joint], free[v.joint] = v.value, False
        return cls(lower, upper, free, held if fixed is None else fixed)

    def drawn(self, count: int, rng: np.random.Generator) -> Array:
        """Random configurations (N, n)."""
        q = rng.uniform(self.lower, self.upper, (count, len(self.lower)))
        return np.where(self.free, q, self.fixed)

    def inside(self, q: Array, slack: float = ROUNDING, but: bool | Bool = False) -> Bool:
        """Return which of some configurations (N, n) are inside, ``but`` for some joints."""
        inside = (q >= self.lower - slack) & (q <= self.upper + slack) | but
        return np.asarray(inside.all(axis=-1))


MOST_ORDERED = 3
"""Equations at once, of which all orders are tried."""


@dataclass(frozen=True, eq=False)
class Step:
    """One equation solved for one joint: and how it enters that."""

    equation: Equation
    joint: int
    kind: str


Order = tuple[Step, ...]


def orders(equations: Sequence[Equation], free: Bool) -> list[Order]:
    """Ways to solve equations one by one, each for a ``free`` joint of its own; or none."""
    # Of many as many of the simplest as can be solved one after the other.
    simple = sorted(equations, key=lambda e: (len(e.involved), len(e.cos)))
    fewest = 2 if len(simple) > MOST_ORDERED else max(1, len(simple))
    for count in range(len(simple), fewest - 1, -1):
        ways = [peeled(simple[:count], free, k) for k in range(3)]
        if any(ways):
            return [way for way in ways if way]
    return []


def peeled(equations: Sequence[Equation], free: Bool, way: int = 0) -> Order | None:
    """Return an order to solve equations in: a joint that only one has comes last."""
    # Of many those near the base (way 0), near the tip (1), or both by turns (2) come last. Of few
    # those with one solution first: what one of them seldom has a value for another one may.
    left, few = list(equations), len(equations) <= MOST_ORDERED
    steps: list[Step] = []
    while left:
        count = np.zeros(len(free), dtype=int)
        for e in left:
            count[list(e.involved)] += 1
        options = [
            Step(e, j, kind)
            for e in left
            for j in e.involved
            if free[j] and count[j] == 1 and (kind := e.enters(j))
        ]
        if not options:
            return None
        options.sort(key=lambda step: (few and step.kind in ("two", "opposite"), step.joint))
        near_tip = way == 1 or (way == 2 and len(steps) % 2 == 1)
        chosen = options[way % len(options) if few else -int(near_tip)]
        steps.append(chosen)
        left = [e for e in left if e is not chosen.equation]
    return tuple(reversed(steps))


def draw(order: Order, box: SearchBox, count: int, rng: np.random.Generator) -> Array:
    """Return points (k, n) in a box on an order's equations, free joints solved or drawn."""
    many = len(order) > MOST_ORDERED
    if many:
        # Of a long order more are tried, by so much for each step more.
        count = max(count, min(2_000, int(count * 1.5 ** (len(order) - MOST_ORDERED))))
    q, open_ = box.drawn(count, rng), box.free.copy()
    for step in order:
        if many and 0 < len(q) < count:
            # What solved all so far goes on several times, with other values of what is not used.
            q = q[rng.integers(len(q), size=count)]
            q = np.where(open_, rng.uniform(box.lower, box.upper, q.shape), q)
        value, known = _solved(step, q, rng)
        low, high = box.lower[step.joint], box.upper[step.joint]
        if step.kind != "length":  # plus whole turns such that it lies within limits
            turn = 2 * np.pi
            first = np.ceil((low - ROUNDING - value) / turn)
            room = np.floor((high + ROUNDING - value) / turn) - first
            some = np.floor(rng.random(len(q)) * (room + 1)) if high - low > turn else 0.0
            value, known = value + turn * (first + some), known & (room >= 0)
        q[:, step.joint] = value
        q = q[known & (value >= low - ROUNDING) & (value <= high + ROUNDING)]
        open_[list(step.equation.involved)] = False
    if many:  # those that went on with nothing else to draw may have come to the same end
        # Of points that are the same, radians or metres.
        first = np.unique(q[:, box.free & ~open_].round(9), axis=0, return_index=True)[1]
        q = q[np.sort(first)]
    return q


def _solved(step: Step, q: Array, rng: np.random.Generator) -> tuple[Array, Bool]:
    """Return values (N,) of the joint given the others of q (N, n), and if there are any."""
    # The equation at two or three values of the joint tells its coefficients.
    places = {"half": (0.0, np.pi), "length": (0.0, 1.0)}
    at = np.array(places.get(step.kind, (0.0, np.pi / 2, np.pi)))
    at = at - (step.kind != "length") * step.equation.shift[step.joint]
    trial = np.repeat(q[None], len(at), axis=0)
    trial[..., step.joint] = at[:, None]
    f = step.equation(trial)
    # Of an equation's size: coefficients of a joint this small do not say what its value is.
    flat = 1e-9 * step.equation.size
    if step.kind == "length":
        slope = f[1] - f[0]
        known = np.abs(slope) > flat
        return -f[0] / np.where(known, slope, 1.0), known
    half = step.kind == "half"  # a cos(q/2) + b sin(q/2)
    constant = np.zeros(len(q)) if half else (f[0] + f[2]) / 2
    cosine, sine = f[0] - constant, f[1] - constant
    radius = np.hypot(cosine, sine)
    known = (radius > flat) & (np.abs(constant) <= radius)
    share = np.clip(-constant / np.where(known, radius, 1.0), -1.0, 1.0)
    side = -1.0 if half else np.where(rng.random(len(q)) < 0.5, -1.0, 1.0)
    turn = np.arctan2(sine, cosine) + side * np.arccos(share)
    return (2 if half else 1) * turn - step.equation.shift[step.joint], known


Stop = Callable[[], bool]
"""Whether a search is to end with what it has; asked between its steps."""
_PROOF_TERMS = 12_000
"""Boxes times terms of a proof that there is nothing to find, before it is looked for at random."""
ROUNDS = 12
"""Batches of random starts before a search gives up."""
_LEAST_DRAWN = 32
"""Random starts of a batch, at least."""
_CHEAP = 500
"""Terms of a system up to which a first look at it is taken though the time is over."""


def system_of(equations: Sequence[Equation]) -> System:
    """The system of some equations, made once if short: the first keeps it, and it all of them."""
    if not equations or sum(len(e.cos) for e in equations) > _CHEAP:
        return System(equations)
    return equations[0].once(f"system of {[id(e) for e in equations]}", lambda: System(equations))


def project(
    equations: Sequence[Equation] | System,
    start: Array,
    free: Bool,
    iterations: int = 60,
    stop: Stop | None = None,
) -> tuple[Array, Bool]:
    """Move points (N, n) onto zeros of equations, along ``free`` joints; return which got there."""
    # Gauss-Newton with minimum-norm steps, also where gradients vanish or depend on each other.
    q = np.array(start, dtype=float)
    if not equations or not len(q):
        return q, np.ones(len(q), dtype=bool)
    system = equations if isinstance(equations, System) else system_of(equations)
    best, least = q.copy(), np.full(len(q), np.inf)
    left = np.arange(len(q))
    for iteration in range(iterations + 1):
        f = system.values(q[left])
        worst = np.abs(f).max(axis=-1)
        # Where gradients nearly vanish a step may lead away again: the best is kept.
        better = worst < least[left]
        best[left[better]], least[left[better]] = q[left[better]], worst[better]
        left, f = left[worst > FLOAT_NOISE], f[worst > FLOAT_NOISE]
        if not len(left) or iteration == iterations or (stop is not None and stop()):
            break
        A = system.gradients(q[left]) * free
        # All but on the set, what is left of f is rounding: not to be divided by small slopes.
        if system.count == 1:
            square = np.einsum("nij,nij->n", A, A)[:, None]
            step = np.where(square > 0, -f * A[:, 0] / np.where(square > 0, square, 1.0), 0.0)
        else:
            # Smallest slope that a step is divided by, relative to the largest, near the set and
            # else.
            rcond = np.where(np.abs(f).max(axis=-1) < 1e-10, 1e-6, 1e-10)
            step = -np.einsum("nij,nj->ni", np.linalg.pinv(A, rcond=rcond), f)
        step = np.where(free, step, 0.0)  # rounding moved the others a little
        size = np.linalg.norm(step, axis=-1, keepdims=True)
        q[left] += step * np.minimum(1.0, 0.7 / np.maximum(size, 1e-300))
    return best, np.asarray(least <= 1e-12)


def search(
    equations: Sequence[Equation],
    box: SearchBox,
    count: int,
    rng: np.random.Generator,
    rounds: int = ROUNDS,
    stop: Stop | None = None,
) -> Array:
    """Return points (k, n) of the zero set inside a box, k up to ``count``.

    In closed form where the equations can be solved in turn; where that finds too few, as in a
    small box, random starts are projected. ``stop`` ends it, except for a first look at a short
    system.
    """
    if not equations:  # all that is drawn is there
        return box.drawn(max(_LEAST_DRAWN, 2 * count), rng)[:count]
    found, free = [np.zeros((0, len(box.lower)))], box.free
    missing = count
    lengths = sorted(len(e.cos) for e in equations)
    terms = np.cumsum(lengths)
    within = None if terms[-1] <= _CHEAP else stop
    ways = orders(equations, free)
    # Batches of points in closed form before random starts are brought to the set instead.
    for attempt in range(6 if ways else 0):
        way = ways[attempt % len(ways)]
        q = draw(way, box, max(8, 4 * missing), rng)
        # Most are there, up to rounding, unless equations are left that no joint was solved from.
        iterations = 3 if len(way) == len(equations) else 20
        q, ok = project(equations, q, free, iterations, within)
        found.append(q[ok & box.inside(q, but=~free)][:missing])
        missing -= len(found[-1])
        if missing <= 0:
            return np.concatenate(found)
        if within is not None and within():
            break
    whole, short = system_of(equations), None
    if len(lengths) > MOST_ORDERED:  # the short ones bring most points near at little cost
        few = max(2, int((terms <= 0.2 * terms[-1]).sum()))
        short = system_of(sorted(equations, key=lambda e: len(e.cos))[:few])
    # What is asked for next is drawn from the same numbers, whether this search is spared or not.
    nothing, boxes = False, _PROOF_TERMS // int(terms[-1])
    if ways and missing == count and boxes and all(free[list(e.involved)].all() for e in equations):
        # A short look may show that the box, and what counts as in it, has no point.
        nothing = proven_empty(equations, box.lower - ROUNDING, box.upper + ROUNDING, boxes)
    for _ in range(rounds):
        q = box.drawn(max(_LEAST_DRAWN, 2 * missing), rng)
        if nothing:
            continue
        if short is not None:
            q, _ = project(short, q, free, 20, within)
        q, ok = project(whole, q, free, 30, within)
        for _ in range(12):  # back into the box, and onto the set again
            out = np.flatnonzero(ok & ~box.inside(q, 1e-12, ~free))
            if not len(out):
                break
            clipped = np.where(free, np.clip(q[out], box.lower, box.upper), q[out])
            q[out], ok[out] = project(whole, clipped, free, 30, within)
        found.append(q[ok & box.inside(q, but=~free)][:missing])
        missing -= len(found[-1])
        if missing <= 0 or (stop is not None and stop()):
            break
        within = stop
    return np.concatenate(found)


def thrown(
    equations: Sequence[Equation],
    box: SearchBox,
    count: int,
    rng: np.random.Generator,
    stop: Stop | None = None,
) -> Array:
    """Return points (k, n) that random starts in a box converge to: every real part is met."""
    cheap = sum(len(e.cos) for e in equations) <= _CHEAP
    q, ok = project(equations, box.drawn(count, rng), box.free, 40, None if cheap else stop)
    return np.asarray(q[ok])


def fix_joint(equation: Equation, joint: int, value: float) -> Equation | None:
    """Put one joint of an equation at a value; None if the equation then holds everywhere."""
    phase = equation.frequencies[:, joint] * (value + equation.shift[joint]) / 2
    factor = value ** equation.powers[:, joint]
    cos = factor * (equation.cos * np.cos(phase) + equation.sin * np.sin(phase))
    sin = factor * (equation.sin * np.cos(phase) - equation.cos * np.sin(phase))
    frequencies, powers = equation.frequencies.copy(), equation.powers.copy()
    frequencies[:, joint], powers[:, joint] = 0, 0
    # Terms whose angles are the negatives of each other are alike.
    lead = frequencies[np.arange(len(cos)), (frequencies != 0).argmax(axis=1)]
    sign = np.where(lead < 0, -1, 1)
    frequencies *= sign[:, None]
    rows = np.hstack([frequencies, powers])
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    which, moving = which.ravel(), lead != 0  # a constant has no sine
    # What is left of terms that cancel is rounding; anything larger is a term, however small. A
    # slider's value may make terms larger than their coefficients, and what they leave, too.
    size = max(equation.size, float(np.hypot(cos, sin).sum()))
    cos, sin = (np.bincount(which, x).astype(float) for x in (cos, sign * sin * moving))
    terms = np.hypot(cos, sin)
    # Coefficients this many times the accuracy of an equation, and smaller, have cancelled.
    kept = terms > 32.0 * max(equation.accuracy, 1e-15) * size
    if not kept.any():
        return None
    keep = np.flatnonzero(kept)[np.argsort(first[kept])]
    error = equation.accuracy * equation.size + float(terms[~kept].sum())
    return replace(
        equation,
        accuracy=error / min(float(terms[keep].sum()), equation.size),
        frequencies=frequencies[first[keep]],
        powers=powers[first[keep]],
        cos=cos[keep],
        sin=sin[keep],
        exact=(),
    )


def proven_empty(
    equations: Sequence[Equation], lower: Array, upper: Array, boxes: int | None = None
) -> bool:
    """Return True if the equations have no common zero in a box, see ``none_within``; else False.

    Joints that slide in none of them turn: whole turns of these say nothing new.
    """
    turns = ~np.any([e.powers.any(axis=0) for e in equations], axis=0)
    branches = [Branch((), tuple(equations))]
    return none_within(Conditions.of([branches], ~turns, np.ones(len(turns))), lower, upper, boxes)


def none_within(
    conditions: Conditions, lower: Array, upper: Array, boxes: int | None = None
) -> bool:
    """Return True if it is proven, by so many boxes, that no point of conditions is within limits.

    The search for the nearest point ends with the first one that it finds.
    """
    if boxes is None:  # work of a second, as boxes of long sums take long
        boxes = max(1, min(40_000, int(PER_SECOND / conditions.box)))
    turns = (conditions.turn > 0) & np.isfinite(lower)
    upper = np.minimum(upper, np.where(turns, lower + 2 * np.pi, np.inf))
    middle = np.clip(0.0, lower, upper)
    options = SearchOptions(gap=1e9, boxes=boxes, within_limits=True)
    return bool(np.isinf(nearest_points(conditions, middle[None], lower, upper, options).lower[0]))


def never_zero(equation: Equation) -> bool:
    """Return True if the constant term outweighs all the others: no zero anywhere."""
    if equation.powers.any():
        return False
    size = np.hypot(equation.cos, equation.sin)
    moving = (equation.frequencies != 0).any(axis=1)
    error = 4 * len(size) * max(equation.accuracy, 1e-15) * equation.size
    return bool(np.abs(equation.cos[~moving]).sum() > size[moving].sum() + error)


_STARTS = 200


@dataclass(frozen=True, eq=False)
class Distance(JsonResult):
    """How far a configuration is from a family.

    Attributes
    ----------
    value : float
        Euclidean in joint space: revolute differences wrapped, in radians; prismatic ones
        over the length scale. The same as ``upper``.
    q : (n,) array
        The nearest configuration of the family that was found; NaN without any.
    exact : bool
        True for joint-value families: ``lower`` and ``upper`` are equal.
    lower : float
        No configuration of the family is nearer: proven, rounding included. Infinite where
        none lies within the limits.
    upper : float
        How far ``q`` is.
    """

    schema: ClassVar[str] = "pinsing/distance/1"

    value: float
    q: Array
    exact: bool
    lower: float
    upper: float

    def __str__(self) -> str:
        if np.isinf(self.lower):
            return "infinite, none within the limits"
        if np.isinf(self.upper):
            return f"at least {self.lower:.6g}, no configuration found"
        kind = "exact" if self.exact else f"to {self.upper - self.lower:.0e}"
        at = ", ".join(f"{value:.4g}" for value in self.q)
        return f"{self.value:.6g} ({kind}), to q = {at}"


BLUNT = 1e-4
"""Radians, metres, or shares of an equation's coefficients: up to here a point that Newton's method
found is on a branch where it is a multiple root, of which half of the digits or less hold."""


@dataclass(frozen=True, eq=False)
class OwnPoints:
    """The singular ones among the points of equations."""

    arm: Arm  # the exact one

    def __call__(self, points: Array) -> Bool:
        """Return which of some points (N, n) are singular."""
        # sigma_r / sigma_1 of what is singular among the points of equations.
        return ratios(self.arm, points) <= 1e-6

    def drawn(self, count: int, box: SearchBox, rng: np.random.Generator) -> Array:
        """Singular points (k, n) of a box that random starts in it lead to; see ``OwnPoints``."""
        lower, upper = np.where(box.free, [box.lower, box.upper], [[-np.inf], [np.inf]])
        within = replace(self.arm, lower=lower, upper=upper)
        found = approach(within, box.drawn(count, rng), box.free, bounded=True)
        return found.q[found.ratio <= NOISE]

    def sharpened(self, points: Array, free: Bool) -> Array:
        """Return points (N, n) made singular to all digits along ``free`` joints, if possible."""
        before = ratios(self.arm, points)
        blunt = np.flatnonzero(before > NOISE)
        if not len(blunt):
            return points
        found = approach(self.arm, points[blunt], free)
        # Radians or metres: what is this far away is another point.
        near = np.abs(found.q - points[blunt]).max(axis=-1) < 1e-3
        better = near & (found.ratio < before[blunt])
        sharp = points.copy()
        sharp[blunt[better]] = found.q[better]
        return sharp


def near(
    branches: Sequence[Branch],
    space: JointSpace,
    q: Array,
    tol: float,
    confirm: OwnPoints | None = None,
) -> Bool:
    """Return which of q (N, n) have a point of some branch within ``tol``, limits aside."""
    found = np.zeros(len(q), dtype=bool)
    for branch in branches:
        todo = np.flatnonzero(~found)
        close = todo[np.linalg.norm(branch.off(q[todo], space), axis=-1) <= tol]
        if not branch.equations:
            found[close] = True
            continue
        free = branch.free(space.n)
        moved, ok = project(branch.equations, branch.put(q[close], space), free)
        gap = np.hypot(
            np.linalg.norm((moved - q[close]) / space.metric * free, axis=-1),
            np.linalg.norm(branch.off(q[close], space), axis=-1),
        )
        good = ok & (gap <= tol)
        if confirm is not None and good.any():
            good[good] = confirm(moved[good])
        found[close] |= good
    return found


def own_nearest(
    found: Distance,
    conditions: Conditions,
    branches: Sequence[Branch],
    space: JointSpace,
    q: Array,
    limits: tuple[Array, Array] | None,
    confirm: OwnPoints,
) -> Distance:
    """Return the distance to a confirmed point; its lower bound holds, as families are subsets."""
    rng = np.random.default_rng(3)
    step = max(found.upper, 1e-3) / conditions.weight
    starts = q + rng.normal(size=(_STARTS, len(q))) * step * rng.uniform(0.1, 3.0, (_STARTS, 1))
    best, least = np.full(len(q), np.nan), np.inf
    for branch in branches:
        moved, ok = project(branch.equations, branch.put(starts, space), branch.free(space.n))
        moved = moved[ok]
        if limits is None:
            away = moved - q
            away -= np.where(space.prismatic, 0.0, 2 * np.pi * np.round(away / (2 * np.pi)))
        else:
            moved = space.fold(moved)
            moved = moved[((moved >= limits[0]) & (moved <= limits[1])).all(axis=1)]
            away = moved - q
        away = away[confirm(moved)] if len(moved) else away
        size = conditions.size(away * conditions.weight)
        if len(size) and size.min() < least:
            least, best = float(size.min()), q + away[int(size.argmin())]
    return Distance(least, best, False, found.lower, least)


_FEWEST, _MOST = 40, 400
"""Starts at once: where the time is over, and where it is not."""


def own_drawn(
    held: Sequence[tuple[Branch, SearchBox]],
    space: JointSpace,
    within: bool,
    confirm: OwnPoints,
    n: int,
    rng: np.random.Generator,
    stop: Stop | None,
) -> Array:
    """Return up to n own points (k, n) from random starts, about as many a branch.

    By rank, then by equations; ``within``: points outside of the boxes do not count.
    """
    found = [np.zeros((0, space.n))]
    for i, (branch, box) in enumerate(held):
        if i and stop is not None and stop():
            break
        missing = -(-n // len(held))
        # Times that so many are tried.
        for _ in range(4):
            late = stop is not None and stop()  # then a first look is taken all the same
            count = 12 if late else min(max(_FEWEST, 4 * missing), _MOST)
            q = space.fold(confirm.drawn(count, box, rng))
            q = q[box.inside(q)]
            q = q[near((branch,), space, q, ROUNDING)] if len(q) else q
            found.append(q[:missing])
            missing -= len(found[-1])
            if missing == 0 or not len(q) or (stop is not None and stop()):
                break
        if missing:
            count = min(max(_FEWEST, 4 * missing), _MOST)
            q = space.fold(thrown(branch.equations, box, count, rng, stop))
            q = q[confirm(q)] if len(q) else q
            found.append((q[box.inside(q)] if within else q)[:missing])
    return np.concatenate(found)[:n]
