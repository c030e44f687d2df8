"""suggest: a configuration that is far from all singular ones, such as for a home pose."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from pinsing.algebra.budget import PER_SECOND, Budget
from pinsing.algebra.conditions import BOXES, SearchOptions, halved, nearest_points
from pinsing.arguments import MAX_SEED, checked, typed, whole_number
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import Branch
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.jacobian import ratios
from pinsing.measures import ALIKE, NEAR_RTOL, Array, ArrayLike, Ints
from pinsing.proximity.clearance import (
    CLOSE,
    Forms,
    Watched,
    certified,
    require_forms_of,
    titled,
    watch,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.serialization import JsonResult

_CLIMBERS = 48
_STEPS = 25
_TRIED = 4
_BATCH = 256


@dataclass(frozen=True, eq=False)
class Room:
    """The configurations to choose from: a box and a ball, in weighted coordinates."""

    low: Array  # (n,), equal to ``high`` for joints that do not matter
    high: Array
    center: Array  # (n,), preferred where nothing else decides
    around: Array  # (n,), centre of the ball
    reach: float  # its radius; infinite without one

    def fit(self, X: Array) -> Array:
        """Move points X (N, n) into the box and the ball."""
        X = np.clip(X, self.low, self.high)
        if not np.isfinite(self.reach):
            return X
        far = np.linalg.norm(X - self.around, axis=1)
        left = self.reach - float(np.linalg.norm(self.center - self.around))
        size = np.maximum(np.linalg.norm(X - self.center, axis=1), 1e-300)
        share = np.where(far <= self.reach, 1.0, np.minimum(1.0, max(left, 0.0) / size))
        return np.asarray(self.center + share[:, None] * (X - self.center))


class Sites:
    """Points of the families, each with the joints that make it one: the others are free."""

    def __init__(self, watched: Watched, rng: np.random.Generator) -> None:
        self.watched = watched
        turn = watched.conditions.turn
        self.turn = np.where(turn > 0, turn, np.inf)
        self._groups: dict[tuple[int, tuple[int, ...]], Array] = {}
        for number, family in enumerate(watched.families):
            for branch in family.branches:
                count = 96 if branch.equations else 1
                found = replace(family, branches=(branch,)).points(count, rng)
                self._take(number, branch, found * watched.weight)

    def _take(self, family: int, branch: Branch, X: Array) -> None:
        joints = branch.involved
        old = self._groups.get((family, joints), np.zeros((0, len(joints))))
        self._groups[family, joints] = np.concatenate([old, self._folded(X)[:, list(joints)]])

    def add(self, X: Array, families: Ints) -> None:
        """Take points X (N, n) of families (N,), known by their number; -1 is none."""
        for x, number in zip(X, families, strict=True):
            if number >= 0:
                family = self.watched.families[int(number)]
                q = x / self.watched.weight
                parts = [replace(family, branches=(b,)) for b in family.branches]
                on = [p.branches[0] for p in parts if p.contains(q, 1e-9).item()]
                if on:
                    self._take(int(number), min(on, key=lambda b: len(b.involved)), x[None])

    def each(self, X: Array, half: Array | float = 0.0) -> Array:
        """No point of boxes around X (N, n), ``half`` (N, n) to each side, is farther: (N, F)."""
        X, half = self._folded(X), np.broadcast_to(half, X.shape)
        out = np.full((len(X), len(self.watched.families)), np.inf)
        for (family, joints), points in self._groups.items():
            total = np.zeros((len(X), len(points)))
            for k, j in enumerate(joints):
                off = np.abs(X[:, j, None] - points[:, k])
                off = np.minimum(off, self.turn[j] - off) + half[:, j, None]
                total += np.minimum(off, self.turn[j] / 2) ** 2
            out[:, family] = np.minimum(out[:, family], np.sqrt(total.min(axis=1, initial=np.inf)))
        return out

    def within(self, X: Array, half: Array | float = 0.0) -> Array:
        """The same of the nearest family: (N,)."""
        return np.asarray(self.each(X, half).min(axis=1))

    def _folded(self, X: Array) -> Array:
        """Values (N, n) of turning joints within half a turn of zero."""
        turns = np.round(X / self.turn)
        return np.asarray(X - np.where(turns == 0, 0.0, self.turn) * turns)


class RoomSearch:
    """Searches a room for a point with a large clearance, and for the most there can be.

    ``budget`` is for boxes. Where families of ``arm`` are missing, no singular configuration is
    chosen. ``best`` (n,) is the clearest point so far, weighted, ``lower`` and ``upper`` bound its
    clearance, and ``most`` that of all points.
    """

    def __init__(
        self, arm: Arm, watched: Watched, room: Room, rng: np.random.Generator, budget: Budget
    ) -> None:
        self.arm, self.watched, self.room, self.rng = arm, watched, room, rng
        self.budget = budget
        self.sites = Sites(watched, rng)
        self.best = room.center.copy()
        self.lower, self.upper, self.most = -np.inf, np.inf, np.inf
        self.prove(room.center[None])
        self.climb()
        self.split()
        self.settle()

    def prove(self, X: Array) -> Array:
        """Lower bounds (N,) of the clearance at X, and sites where the nearest points are."""
        w = self.watched
        terms = sum(s.rate.size for branch in w.conditions.branches for s in branch.sums)
        box = _BOX + terms / 6  # six of them in the time of a product
        boxes = min(BOXES, self.budget.left * PER_SECOND / (box * len(X)))
        options = SearchOptions(CLOSE, max(1, int(boxes)))
        found = nearest_points(w.conditions, X / w.weight, w.lower, w.upper, options)
        self.budget.spend(box * float(found.boxes.sum()))
        self.sites.add(found.q * w.weight, found.family)
        lower = found.lower
        if not w.complete:
            lower = np.where(ratios(self.arm, X / w.weight) > NEAR_RTOL, lower, -np.inf)
        k = int(np.argmax(lower))
        if lower[k] > self.lower:
            self.best, self.lower, self.upper = X[k].copy(), float(lower[k]), float(found.upper[k])
        return lower

    def climb(self) -> None:
        """From many starts uphill on what the sites promise, proving the best."""
        room = self.room
        X = room.fit(self.rng.uniform(room.low, room.high, (4096, self.watched.n)))
        promise = np.concatenate([self.sites.within(x) for x in np.array_split(X, 16)])
        X = X[np.argsort(-promise, kind="stable")[:_CLIMBERS]]
        for round_ in range(12):
            if self.budget.over:
                return
            sizes = (0.3 * 0.8**round_ * 0.85**step for step in range(_STEPS))
            promise = self._uphill(X, self.sites.within, sizes)
            order = np.argsort(-promise, kind="stable")
            if promise[order[0]] <= self.lower + CLOSE:
                return
            self.prove(X[self._apart(X, order)])

    def _uphill(
        self, X: Array, worth: Callable[[Array], Array], sizes: Iterable[float], some: bool = False
    ) -> Array:
        """Move points X by random steps, shares of the room, to where they are worth more: (N,)."""
        width, value = self.room.high - self.room.low, worth(X)
        for size in sizes:
            moved = self.rng.integers(2, size=X.shape) if some else 1  # some joints at a time
            tried = self.room.fit(X + moved * self.rng.normal(size=X.shape) * width * size)
            there = worth(tried)
            better = there > value
            X[better], value[better] = tried[better], there[better]
        return value

    def _apart(self, X: Array, order: Ints) -> list[int]:
        """The first few that are not all in one place."""
        chosen: list[int] = []
        for i in order:
            if all(np.linalg.norm(X[i] - X[k]) > 0.1 for k in chosen):
                chosen.append(int(i))
            if len(chosen) == _TRIED:
                break
        return chosen

    def split(self) -> None:
        """Rule boxes out that promise no more than was proven; what is left bounds all."""
        room = self.room
        centers, halves = (room.low + room.high)[None] / 2, (room.high - room.low)[None] / 2
        bounds = self._promise(centers, halves)
        for _ in range(40):
            goal = max(self.lower, 0.0) + CLOSE
            keep = bounds > goal
            centers, halves, bounds = centers[keep], halves[keep], bounds[keep]
            if not len(bounds) or self.budget.over:
                break
            order = np.argsort(-bounds, kind="stable")
            now, later = order[:_BATCH], order[_BATCH:]
            self.prove(room.fit(centers[now[:2]]))
            parts, both = halved(centers[now], halves[now], halves[now].argmax(axis=1))
            fresh = np.minimum(self._promise(parts, both), np.tile(bounds[now], 2))
            centers = np.concatenate([centers[later], parts])
            halves = np.concatenate([halves[later], both])
            bounds = np.concatenate([bounds[later], fresh])
        goal = max(self.lower, 0.0) + CLOSE
        self.most = max(goal, float(bounds.max(initial=0.0))) + ALIKE

    def _promise(self, centers: Array, halves: Array) -> Array:
        out = self.sites.within(centers, halves * (1 + 1e-12))
        if np.isfinite(self.room.reach):
            gap = np.maximum(np.abs(centers - self.room.around) - halves, 0.0)
            out = np.where(np.linalg.norm(gap, axis=1) > self.room.reach + ALIKE, -np.inf, out)
        return out

    def settle(self) -> None:
        """Farther from the other families too, and to where joints are preferred, at no cost."""
        if not np.isfinite(self.lower) or self.budget.over:
            return
        enough = self.lower - CLOSE

        def worth(X: Array) -> Array:
            each = self.sites.each(X)
            off = np.linalg.norm(X - self.room.center, axis=1)
            # Of clearance that is given for being nearer to where joints are preferred.
            return np.where(each.min(axis=1) >= enough, each.sum(axis=1) - 0.05 * off, -np.inf)

        X = np.repeat(self.best[None], _CLIMBERS, axis=0)
        sizes = (0.5 * 0.93**step for step in range(3 * _STEPS))
        value = self._uphill(X, worth, sizes, some=True)
        for i in np.argsort(-value, kind="stable")[:_TRIED]:
            kept = self.best, self.lower, self.upper
            self.lower = -np.inf
            if self.prove(X[i][None])[0] >= enough:
                return
            self.best, self.lower, self.upper = kept


REACH = 0.5
"""How far from a given configuration one is suggested, radians."""

WORK = 10.0
"""Of `suggest`; arms of the catalogue use 3.2 at most."""
_BOX = 20.0
"""Products that a box costs."""


@dataclass(frozen=True, eq=False)
class Suggestion(JsonResult):
    """A configuration with a large clearance.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    q : (n,) array
        The configuration, radians and metres, within the joint limits.
    lower : float
        Proven, rounding included: no configuration of a family is nearer to ``q``. Radians, or
        metres over the length scale; infinite where there is no singular configuration at all.
    upper : float
        A configuration of a family is as near as this.
    most : float
        No configuration that was to choose from has a larger clearance; infinite where that was
        not found out.
    family : str
        The nearest family; empty for none.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the nearest family.
    families : tuple of str
        Those that were kept away from.
    sigma_ratio : float
        sigma_r / sigma_1 at ``q``: 1 is the best conditioned that there is.
    near : (n,) array or None
        The configuration that it was to be near.
    reach : float
        Within how far of ``near``; infinite without it.
    complete : bool
        Whether the families are all that there is. Otherwise ``lower`` is of those known.
    notes : tuple of str
        What was assumed, and what one should know.
    """

    schema: ClassVar[str] = "pinsing/suggestion/1"
    made_by: ClassVar[str] = "pinsing.suggest(arm)"

    arm: ArmSummary
    q: Array
    lower: float
    upper: float
    most: float
    family: str
    families: tuple[str, ...]
    sigma_ratio: float
    near: Array | None
    reach: float
    complete: bool
    notes: tuple[str, ...]
    title: str = field(default="", metadata={"optional": True})

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text: the configuration to paste, and its proven clearance.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> print(pinsing.suggest(pinsing.load("scara")).text(degrees=True).splitlines()[0])
        --deg --q 0,90,0.105,0
        """
        lines = [typed(self.q, self.arm.prismatic, degrees, digits=8)]
        if math.isinf(self.lower):
            lines.append("No configuration of this arm is singular.")
        elif not self.families:
            lines.append("Clearance unknown: no family of singular configurations is known.")
        else:
            lines.append(
                f"Proven: no singular configuration {'' if self.complete else 'that is known '}"
                f"within {_far(self.lower, degrees, math.floor)}; one was found at "
                f"{_far(self.upper, degrees, math.ceil)}, on {titled(self.family, self.title)}."
            )
        if math.isfinite(self.most):
            where = "Nowhere within the limits"
            if self.near is not None:
                reach = _far(self.reach, degrees, round)
                where = f"Nowhere within {reach} of the given configuration"
            most = _far(self.most, degrees, math.ceil)
            lines.append(f"{where} is the clearance above {most}.")
        lines.append(f"sigma_r/sigma_1 there: {self.sigma_ratio:.3g}")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


def _far(x: float, degrees: bool, to: Callable[[float], float]) -> str:
    """A distance with four places, rounded to the side that keeps it true."""
    if math.isinf(x):
        return "any distance"
    return f"{to(math.degrees(x) * 100) / 100:g}°" if degrees else f"{to(x * 1e4) / 1e4:g} rad"


@checked
def suggest(
    arm: Arm,
    *,
    near: ArrayLike | None = None,
    reach: float = REACH,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    work: float = WORK,
    seed: int = 0,
) -> Suggestion:
    """Suggest a configuration within the joint limits that is far from all singular ones.

    Clearance is that of `clearance`: singular configurations beyond the limits count too, since
    an arm is slow and weak beside them all the same. Joints that no family depends on stay at
    zero, or in the middle of their limits, or as in ``near``.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    near : (n,) or (nq,) array_like, optional
        A configuration that the answer should be near, radians and metres.
    reach : float
        With ``near``: the answer is no farther from it than this, radians (metres over the
        length scale), in the Euclidean norm and without whole turns.
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm, such as those of two tasks; computed if not given.
    families : sequence of str, optional
        Names of the families that count; by default all that have real points.
    work : float
        Work after which the search ends, the same on every machine: in seconds of an idle one.
    seed : int
        Of the starts of the search.

    Returns
    -------
    Suggestion
        The configuration, its proven clearance, and a bound of what is possible.

    Raises
    ------
    ConfigurationError
        If ``near`` has the wrong length or a value that is not finite, or nothing within the
        limits is within ``reach`` of it.
    OptionError, UnknownNameError
        If an option makes no sense, forms are of another arm, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.suggest(pinsing.load("puma560"))
    >>> found.lower > 1.4, found.lower <= found.upper <= found.most
    (True, True)
    """
    OptionError.refuse_if(
        not (math.isfinite(reach) and reach > 0), f"reach must be a positive number, got {reach!r}"
    )
    OptionError.refuse_if(not work > 0, f"work must be positive, got {work!r}")
    whole_number(seed, "seed", 0, MAX_SEED)
    target = None if near is None else arm.check_one(near, "near")
    if forms is not None:
        require_forms_of(forms, arm)
    watched = watch(form_to_measure(arm) if forms is None else forms, families)
    notes: list[str] = []
    room = _room(arm, watched, target, reach, notes)
    rng = np.random.default_rng(seed)
    most, lower, upper, family = np.inf, np.inf, np.inf, ""
    if watched.families:
        budget = Budget(math.inf, work)
        search = RoomSearch(arm, watched, room, rng, budget)
        if budget.over:
            notes.append(f"the search ended after {budget.allowed}")
        q = _rounded(arm, watched, room, search.best / watched.weight)
        at = certified(watched, q[None], SearchOptions())[0]
        lower, upper, family = float(at.lower[0]), float(at.upper[0]), str(at.nearest[0])
        # Whether the box that was looked through holds all configurations, whole turns aside.
        endless = arm.prismatic & ~(np.isfinite(arm.lower) & np.isfinite(arm.upper))
        if not (endless & (watched.used.any(axis=0) | (not watched.complete))).any():
            most = max(search.most, upper) + (0.0 if near is None else _margin(arm, reach))
        if target is not None:  # the clearance changes by no more than one moves
            there = certified(watched, target[None], SearchOptions(gap=1e-3))[0]
            most = max(min(most, float(there.upper[0]) + reach), upper)
    elif watched.complete:
        q = _rounded(arm, watched, room, room.center / watched.weight)
    else:
        drawn = room.fit(rng.uniform(room.low, room.high, (2048, arm.n))) / watched.weight
        q = _rounded(arm, watched, room, drawn[int(np.argmax(ratios(arm, drawn)))])
        lower = 0.0
    return Suggestion(
        arm=summarize(arm),
        q=q,
        lower=lower,
        upper=upper,
        most=most,
        family=family,
        families=watched.names,
        sigma_ratio=float(ratios(arm, q[None])[0]),
        near=target,
        reach=float(reach) if target is not None else np.inf,
        complete=watched.complete,
        notes=(*notes, *watched.gaps),
        title=dict(zip(watched.names, (f.title for f in watched.families), strict=True)).get(
            family, ""
        ),
    )


def _room(arm: Arm, watched: Watched, near: Array | None, reach: float, notes: list[str]) -> Room:
    low, high = (limit.copy() for limit in arm.space.span)
    if near is None:
        # One turn is enough, about zero where that is within the limits.
        whole = ~arm.prismatic & (high - low >= 2 * np.pi)
        center = np.where(whole, np.clip(0.0, low + np.pi, high - np.pi), (low + high) / 2)
        low, high = np.where(whole, center - np.pi, low), np.where(whole, center + np.pi, high)
        around, radius = center, np.inf
    else:
        around, radius = arm.fold(near), reach - _margin(arm, reach)
        size = reach / watched.weight
        low = np.maximum(np.where(np.isfinite(arm.lower), arm.lower, -np.inf), around - size)
        high = np.minimum(np.where(np.isfinite(arm.upper), arm.upper, np.inf), around + size)
        center = np.clip(around, arm.lower, arm.upper)
        away = float(watched.length(center - around))
        if away > reach:
            j = int(np.argmax(np.abs(center - around)))
            raise ConfigurationError(
                f"near is {away:.4g} outside the joint limits ({arm.joints[j]!r} most), farther "
                f"than reach {reach:g}: nothing within the limits is that near",
                joint=arm.joints[j],
                value=float(around[j]),
                limits=(float(arm.lower[j]), float(arm.upper[j])),
            )
        if away > 0:
            notes.append("the given configuration is outside the joint limits")
        if not np.array_equal(around, near):
            notes.append("whole turns were taken off the given configuration, into the limits")
    still = watched.complete & ~watched.used.any(axis=0)
    low, high = np.where(still, center, low), np.where(still, center, high)
    w = watched.weight
    return Room(low * w, high * w, center * w, around * w, radius)


def _margin(arm: Arm, reach: float) -> float:
    """Return what is left free in the ball, so that a rounded configuration is in it as well."""
    return min(1e-4 * math.sqrt(arm.n), reach / 10)


def _rounded(arm: Arm, watched: Watched, room: Room, q: Array) -> Array:
    """The configuration with few digits, where these stay within the limits and the ball."""
    short = np.where(arm.prismatic, np.round(q, 4), np.radians(np.round(np.degrees(q), 2))) + 0.0
    inside = (short >= arm.lower) & (short <= arm.upper)
    short = np.where(inside, short, np.clip(q, arm.lower, arm.upper))
    away = float(np.linalg.norm(short * watched.weight - room.around))
    return short if away <= room.reach + _margin(arm, room.reach) else q
