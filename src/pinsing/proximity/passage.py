"""Stretches of a motion in which it may be nearer to a singular configuration than a bound.

Distance changes no faster than the configuration moves. On a step of length d between places at
which it is at least a and b it is at least (a + b - d) / 2; steps for which that is below the
bound are halved, until they are short. So nothing nearer than the bound lies outside the
stretches, and they reach beyond it by no more than a short step and the slack of the bounds.

How a motion passes families: meetings, nearest approaches, stretches that are near.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import BOXES, SearchOptions, nearest_points, two_sided
from pinsing.kinematics.jacobian import singular_values, task_jacobians
from pinsing.kinematics.tip_speed import SpeedJudge
from pinsing.kinematics.verdict import generic_rank
from pinsing.measures import PRACTICAL, ROUNDING, Array, ArrayLike, Bool
from pinsing.proximity.clearance import CLOSE, nearest_family
from pinsing.proximity.crossings import Crossing, Motion, crossings_of, runs
from pinsing.proximity.watched import Watched
from pinsing.robot.arm import Arm

_LONG_JUMP, _SHORT_JUMP = np.pi, 0.2


@dataclass(frozen=True)
class Excess:
    """A stretch of time in which a joint exceeds something.

    Attributes
    ----------
    joint : str
        Name of the joint.
    t, t_end : float
        From the first to the last sample (step) at which it does.
    worst : float
        The largest value, of magnitude; of a position outside its limits the value itself.
    t_worst : float
        When.
    limit : float
        What it exceeds.
    """

    joint: str
    t: float
    t_end: float
    worst: float
    t_worst: float
    limit: float


class Speeds:
    """Gathers what a trajectory, fed in pieces, asks of the joints."""

    def __init__(
        self,
        arm: Arm,
        tip_speed: float,
        turn_speed: float,
        joint_speeds: ArrayLike | None,
        accelerations: Array | None,
        timed: bool,
    ) -> None:
        self.arm, self.timed, self.accelerations = arm, timed, accelerations
        self.judge = SpeedJudge(arm, joint_speeds)
        self.limits = self.judge.limits
        self.tip_speed, self.turn_speed = tip_speed, turn_speed
        self._found: dict[str, list[Excess]] = {}
        self._open: dict[tuple[str, int], int] = {}

    def found(self, kind: str) -> tuple[Excess, ...]:
        """Excesses of a kind, in the order of time."""
        return tuple(sorted(self._found.get(kind, []), key=lambda e: (e.t, e.joint)))

    def feed(self, t: Array, Q: Array, first: int, last: int) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        own = slice(first, last)
        low, high = self.arm.lower - ROUNDING, self.arm.upper + ROUNDING
        out = np.maximum(Q[own] - high, low - Q[own])
        limit = np.where(Q[own] > high, self.arm.upper, self.arm.lower)
        self._keep("outside", t[own], t[own], out, Q[own], limit, out > 0)
        self._cost(t[own], Q[own])
        begin = max(first, 1)  # steps belong to the sample at which they end
        if last <= begin:
            return
        step = np.diff(Q, axis=0)[begin - 1 : last - 1]
        before, after = t[begin - 1 : last - 1], t[begin:last]
        usual = np.median(np.abs(step), axis=0)
        far = np.where(self.arm.prismatic, self.arm.length_scale, 1.0)
        bound = np.maximum(_SHORT_JUMP * far, 20.0 * usual) if len(step) > 8 else np.inf * far
        bound = np.minimum(bound, np.where(self.arm.prismatic, np.inf, _LONG_JUMP))
        jump = np.abs(step) > bound
        limits = np.broadcast_to(bound, step.shape)
        self._keep("jump", before, after, np.abs(step), np.abs(step), limits, jump)
        if not self.timed:
            return
        speed = np.abs(step) / (after - before)[:, None]
        limits = np.broadcast_to(self.limits, speed.shape)
        over = speed > limits * (1 + 1e-9)
        self._keep("speed", before, after, speed / limits, speed, limits, over)
        begin = max(begin, 2)
        if self.accelerations is None or last <= begin:
            return
        rate = np.diff(Q, axis=0) / np.diff(t)[:, None]
        middle = (t[1:] + t[:-1]) / 2
        bend = np.abs(np.diff(rate, axis=0) / np.diff(middle)[:, None])[begin - 2 : last - 2]
        limits = np.broadcast_to(self.accelerations, bend.shape)
        at = t[begin - 1 : last - 1]
        self._keep("acceleration", at, at, bend / limits, bend, limits, bend > limits * (1 + 1e-9))

    def _cost(self, t: Array, Q: Array) -> None:
        """Return where some tip velocity of the given speeds needs more than a joint's limit."""
        if self.judge.reason:
            return
        L, limits = self.arm.length_scale, self.judge.limits
        sigma = np.asarray(singular_values(self.arm, Q))[:, self.judge.rank - 1]
        size = math.hypot(self.tip_speed / L, self.turn_speed)
        hard = np.flatnonzero(size > sigma * limits.min() * (1 - 1e-9))
        share = np.zeros(Q.shape)
        for part in np.array_split(hard, max(1, len(hard) // 4096)):
            share[part] = self.judge.shares(Q[part], self.tip_speed, self.turn_speed)
        limits = np.broadcast_to(limits, share.shape)
        worst = np.where(share > 0, share * np.where(share > 0, limits, 0.0), 0.0)
        self._keep("cost", t, t, share, worst, limits, share > 1)

    def between(self, passage: Passage) -> None:
        """Take, too, where the motion meets families and is nearest to them, as of ``passage``."""
        met = passage.own_crossings if passage.watched.tube else passage.crossings
        places: list[Crossing | Approach] = [*met, *passage.crossings, *passage.approaches]
        if self.judge.reason or not places:
            return
        share = self.judge.shares(np.array([p.q for p in places]), self.tip_speed, self.turn_speed)
        share[: len(met)][share[: len(met)] > 1e5] = np.inf  # singular but for rounding
        listed = self._found.setdefault("cost", [])
        for i, j in np.argwhere(share > 1):
            t, joint, limit = places[i].t, self.arm.joints[j], float(self.limits[j])
            new = Excess(joint, t, t, float(share[i, j]) * limit, t, limit)
            gap = 1e-9 * (1 + abs(t))
            ours = [k for k, e in enumerate(listed) if e.joint == joint]
            same = [k for k in ours if listed[k].t - gap <= t <= listed[k].t_end + gap]
            if not same:
                listed.append(new)
            elif new.worst > listed[same[0]].worst:
                listed[same[0]] = replace(listed[same[0]], worst=new.worst, t_worst=t)

    def _keep(
        self, kind: str, t: Array, t_end: Array, size: Array, value: Array, limit: Array, bad: Bool
    ) -> None:
        """Turn runs of bad entries (K, n) into excesses, joined with those of the piece before."""
        listed = self._found.setdefault(kind, [])
        for j in range(self.arm.n):
            was = self._open.pop((kind, j), None)
            for first, end in runs(bad[:, j]):
                k = first + int(np.argmax(size[first:end, j]))
                times = float(t[first]), float(t_end[end - 1])
                worst = float(value[k, j]), float(t[k]), float(limit[k, j])
                new = Excess(self.arm.joints[j], *times, *worst)
                if first == 0 and was is not None:
                    old = listed[was]
                    larger = abs(new.worst - new.limit) > abs(old.worst - old.limit)
                    listed[was] = replace(new if larger else old, t=old.t, t_end=new.t_end)
                    index = was
                elif len(listed) < 200:
                    listed.append(new)
                    index = len(listed) - 1
                else:
                    continue
                if end == len(bad):
                    self._open[kind, j] = index


@dataclass(frozen=True)
class NearStretch:
    """A time in which the clearance may be below a bound.

    Attributes
    ----------
    t, t_end : float
        From when to when.
    family : str
        The nearest one found where the clearance may be least.
    clearance : float
        Proven: nowhere in it is a family nearer than this.
    """

    t: float
    t_end: float
    family: str
    clearance: float


class Stretches:
    """Gathers the stretches of a motion that is fed in pieces."""

    def __init__(self, watched: Watched, near: float) -> None:
        self.watched, self.near = watched, near
        self.cut = False
        self._found: list[NearStretch] = []
        self._open = False

    def feed(self, motion: Motion, u: Array, Q: Array, least: Array) -> None:
        """Take places u (K,) of a motion, where the clearance is at least ``least``."""
        watched, near = self.watched, self.near
        for halvings in range(19):
            length = watched.length(np.diff(Q, axis=0))
            # A lower bound of the clearance on each step.
            bound = np.maximum((least[:-1] + least[1:] - length) / 2, 0.0)
            inside = bound < near
            near_runs = runs(inside)
            outside = least >= near
            again = inside & (outside[:-1] | outside[1:])
            # Steps of a stretch on which it may be a good deal nearer than is known so far.
            known = np.full(len(inside), np.inf)
            for start, end in near_runs:
                known[start:end] = least[start : end + 1].min()
            again |= inside & (bound < 0.95 * known - 0.01 * near)
            # Steps of this length are not halved any more.
            again &= length > 1e-4
            if halvings == 18 or not again.any():
                break
            k = np.flatnonzero(again)
            middle = (u[k] + u[k + 1]) / 2
            there = motion.at(middle)
            found = two_sided(watched.conditions, there).lower
            u, Q = np.insert(u, k + 1, middle), np.insert(Q, k + 1, there, axis=0)
            least = np.insert(least, k + 1, found) * watched.known_along(Q)
        t = motion.time(u)
        for start, end in near_runs:
            lowest = start + int(np.argmin(least[start : end + 1]))
            nearest = nearest_family(watched.conditions, Q[lowest : lowest + 1])[0]
            new = NearStretch(
                float(t[start]),
                float(t[end]),
                watched.names[int(nearest[0])],
                float(bound[start:end].min()),
            )
            if start == 0 and self._open and self._found:
                old = self._found[-1]
                deeper = new if new.clearance < old.clearance else old
                self._found[-1] = NearStretch(old.t, new.t_end, deeper.family, deeper.clearance)
            elif len(self._found) < 1000:
                self._found.append(new)
            else:
                self.cut = True
        self._open = bool(len(inside) and inside[-1])

    def finish(self, crossings: Sequence[Crossing]) -> tuple[NearStretch, ...]:
        """All of them; where a family is met in one, that is its family."""
        out = []
        for s in self._found:
            met = next((c for c in crossings if c.t <= s.t_end and c.t_end >= s.t), None)
            out.append(s if met is None else NearStretch(s.t, s.t_end, met.family, 0.0))
        return tuple(out)


def least_along(
    Q: Array,
    lower: Array,
    known: float,
    length: Callable[[Array], Array],
    bounded: Callable[[Array], Array],
    most: float = np.inf,
    share: float = 0.0,
) -> tuple[float, float]:
    """Return the least distance along a path (N, n), proven between points too, and at which point.

    ``bounded`` gives ``lower`` bounds (N,). Segments are halved where their ends allow much less
    than is ``known`` of points, or less by a ``share`` of it, up to ``most`` points.
    """
    lowest, place = float(lower.min()), float(lower.argmin())
    least, step, at = np.inf if len(Q) > 1 else lowest, 1.0, np.arange(len(Q) - 1.0)
    ends, low = np.stack([Q[:-1], Q[1:]]), np.stack([lower[:-1], lower[1:]])
    while True:
        way = length(ends[1] - ends[0])
        bound = np.maximum((low[0] + low[1] - way) / 2, 0.0)
        wide = np.flatnonzero(bound < known - (share * known or BISECTED / 2))
        if not len(wide) or way[wide].max() < PRACTICAL or len(wide) > most:
            return float(bound.min(initial=least)), place
        least = float(np.delete(bound, wide).min(initial=least))
        most, step = most - len(wide), step / 2
        first, last = ends[:, wide]
        middle, at = (first + last) / 2, at[wide]
        lower = bounded(middle)
        known = min(known, float(lower.min()))
        if lower.min() < lowest:
            lowest, place = float(lower.min()), float(at[lower.argmin()] + step)
        # A bound at the middle holds at the ends, less the way.
        a, b = np.maximum(low[:, wide], lower - way[wide] / 2)
        ends = np.stack([np.concatenate([first, middle]), np.concatenate([middle, last])])
        low = np.stack([np.concatenate([a, lower]), np.concatenate([lower, b])])
        at = np.concatenate([at, at + step])


BISECTED = np.radians(0.1)
"""How near what is proven of a path is brought to what is found on it, radians."""
_CANDIDATES = 6
_SEARCH = SearchOptions(boxes=BOXES // 3)
_CLOSE, _APART, _PROVEN = SearchOptions(gap=CLOSE, boxes=20_000), 0.01, 2000
"""How closely distances of samples are proven, how far apart in joint space, how many of a part."""


@dataclass(frozen=True, eq=False)
class Approach:
    """The nearest approach to a family.

    Attributes
    ----------
    family : str
        Its name.
    t : float
        When.
    q : (n,) array
        The configuration.
    upper : float
        Distance from the family there.
    lower : float
        Proven: nowhere on the motion is the family nearer.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the family.
    outside : str
        "point" if the nearest point of the family is outside the joint limits, "family" if all
        of it is (proven), else empty.
    """

    family: str
    t: float
    q: Array
    upper: float
    lower: float
    title: str = field(default="", metadata={"optional": True})
    outside: str = field(default="", metadata={"optional": True})


class Passage:
    """Gathers how a motion, fed in pieces, passes the watched families; `finish` completes it.

    ``cut``: there are more meetings or stretches than are kept. ``trend`` of the clearance at the
    end: "toward", "away" or "steady". ``own_crossings``: where the determinant of a robot that has
    a design changes its sign from one place looked at to the next, and the family that is nearest.
    """

    def __init__(self, watched: Watched, near: float) -> None:
        self.watched, self.near = watched, near
        count = len(watched.families)
        self.crossings: list[Crossing] = []
        self.own_crossings: list[Crossing] = []
        self._stretches = Stretches(watched, near)
        self.cut = False
        self._plain = watched.conditions.plain
        self._families = watched.each
        # Of each family: the least distance proven along the path, found, and proven of a sample.
        self._least, self._nearest, self._proven = np.full((3, count), np.inf)
        # Of each family: a distance, and the samples around a place at which it may be nearest.
        self._candidates: list[list[tuple[float, Motion, float]]] = [[] for _ in range(count)]
        self.trend = "steady"

    def feed(self, t: Array, Q: Array, first: int, last: int, end: bool) -> None:
        """Take samples ``first`` to ``last`` of t (N,) and Q (N, n); the others are neighbours."""
        if len(Q) == 1:
            t, Q, last = np.repeat(t, 2), np.repeat(Q, 2, axis=0), 2
        motion = Motion(t, np.stack([Q[:-1], np.diff(Q, axis=0)], axis=1))
        begin, stop = float(t[first]), float(t[min(last, len(t) - 1)])
        for c in crossings_of(self.watched, motion):
            if c.t_end >= begin and (c.t < stop or end):
                self._add(c)
        self._look(motion, first, min(last, len(motion.pieces)), end)

    def _add(self, c: Crossing) -> None:
        for k in range(len(self.crossings) - 1, max(-1, len(self.crossings) - 8), -1):
            other = self.crossings[k]
            if other.family == c.family and c.t <= other.t_end + 1e-12 * (1 + abs(c.t)):
                if c.t_end > other.t_end:  # goes on in the next part
                    self.crossings[k] = replace(other, t_end=c.t_end, kind=c.kind)
                return
        if len(self.crossings) < 1000:
            self.crossings.append(c)
        else:
            self.cut = True

    def _look(self, motion: Motion, first: int, last: int, end: bool) -> None:
        """Clearance at samples and, where steps are long, in between."""
        steps = self.watched.length(motion.pieces[first:last, 1])
        # Longer steps are looked at in between, this far apart in joint space.
        counts = np.clip(np.ceil(steps / _APART), 1, 64).astype(np.int64)
        parts = (first + k + np.arange(m) / m for k, m in enumerate(counts))
        u = np.concatenate([*parts, [float(last)]])
        Q = motion.at(u)
        length = self.watched.length(np.diff(Q, axis=0))
        if not self._families:
            return
        way = np.append(0.0, np.cumsum(length)) * (1 + ROUNDING)
        lower, upper = self._bounds(Q, length, way)
        arm = self.watched.tube and self.watched.arm
        if arm and generic_rank(arm) == arm.n == len(arm.task.rows):
            self._change_sign(arm, motion, u, Q)
        for f, conditions in enumerate(self._families):

            def bounded(x: Array, c: Conditions = conditions, f: int = f) -> Array:
                return nearest_points(c, x, *self.watched.families[f].limits, _CLOSE).lower

            known = float(min(self._nearest[f] - 0.75 * CLOSE, self._proven[f]))
            most = 0 if self.watched.margin else _PROVEN
            least, _ = least_along(Q, lower[:, f], known, self.watched.length, bounded, most)
            self._least[f] = min(self._least[f], least)
            some = np.isfinite(upper[:, f]).any()
            self._candidate(f, motion, u, way, (upper if some else lower)[:, f])
        self._stretches.feed(motion, u, Q, lower.min(axis=1))
        if end and len(u) > 1:
            f = int(nearest_family(self.watched.conditions, Q[-1:])[0][0])
            two = two_sided(self._plain, Q[-2:], each=True).each[:, f, 0]
            change = float(two[1] - two[0])
            small = 1e-6 * max(float(length[-1]), 1e-12)
            self.trend = "steady" if abs(change) <= small else "away" if change > 0 else "toward"

    def _change_sign(self, arm: Arm, motion: Motion, u: Array, Q: Array) -> None:
        """Keep where the determinant of the arm's Jacobian changes its sign between places u."""
        above = np.linalg.det(task_jacobians(arm, Q)) > 0
        first = np.flatnonzero(above[1:] != above[:-1])
        low, high = u[first], u[first + 1]
        for _ in range(50):
            middle = (low + high) / 2
            same = (np.linalg.det(task_jacobians(arm, motion.at(middle))) > 0) == above[first]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        there = motion.at(high)
        nearest = nearest_family(self.watched.conditions, there)[0]
        self.own_crossings += [
            Crossing(t, t, q, self.watched.names[f], "crossing", self.watched.families[f].title)
            for t, q, f in zip(motion.time(high).tolist(), there, nearest, strict=True)
        ]
        self.cut |= len(self.own_crossings) > 1000
        del self.own_crossings[1000:]

    def _bounds(self, Q: Array, length: Array, way: Array) -> tuple[Array, Array]:
        """Return bounds (M, F) of distances; close ones where these bound the least."""
        # Lower ones of one sample, less the way to another one, hold there.
        margin, each = self.watched.margin, two_sided(self._plain, Q, each=True).each
        self._nearest = np.fmin(self._nearest, each[..., 1].min(axis=0))
        for f, conditions in enumerate(self._families):
            low, limits = each[:, f, 0], self.watched.families[f].limits
            lost = ROUNDING + np.finfo(np.float64).eps * len(way) * way[-1]
            # First samples that are far apart: what is proven of them spares most of the others.
            for apart in 16 * _APART, 4 * _APART, _APART:
                least = np.append(np.inf, np.append((low[:-1] + low[1:] - length) / 2, np.inf))
                weak = np.flatnonzero(np.minimum(least[1:], least[:-1]) < self._nearest[f])
                weak = weak[np.unique(np.floor(way[weak] / apart), return_index=True)[1]]
                weak = weak[np.argsort(low[weak], kind="stable")[:_PROVEN]]
                found = nearest_points(conditions, Q[weak], *limits, _CLOSE)
                self._nearest[f] = min(self._nearest[f], found.upper.min(initial=np.inf))
                self._proven[f] = min(self._proven[f], found.lower.min(initial=np.inf))
                each[weak, f, 1] = np.fmin(each[weak, f, 1], found.upper)
                low[weak] = np.maximum(low[weak], found.lower)
                np.maximum(low, np.maximum.accumulate(low + way) - way - lost, out=low)
                back = np.maximum.accumulate((low - way)[::-1])[::-1] + way - lost
                np.maximum(low, back, out=low)
        if margin is None:
            return each[..., 0], each[..., 1]
        return margin.take_off(Q, each) * self.watched.known_along(Q)[:, None], each[..., 1]

    def _candidate(self, f: int, motion: Motion, u: Array, way: Array, upper: Array) -> None:
        """Keep the lowest local minima of distances to family f, of places u (M,)."""
        known = np.flatnonzero(np.isfinite(upper))
        padded = np.concatenate([[np.inf], upper[known], [np.inf]])
        dips = known[(padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:])]
        kept = self._candidates[f]
        for i in dips[np.argsort(upper[dips], kind="stable")][:_CANDIDATES]:
            a, b = np.searchsorted(way, way[i] + 2 * _APART * np.array([-1, 1]))
            low, high = int(max(u[a] - 1, 0)), int(np.ceil(u[min(b, len(u) - 1)]) + 1)
            high = min(max(high, low + 1), len(motion.pieces))
            part = Motion(motion.t[low : high + 1], motion.pieces[low:high])
            kept.append((float(upper[i]), part, float(u[i] - low)))
        kept.sort(key=lambda c: c[0])
        del kept[_CANDIDATES:]

    def finish(self) -> None:
        """Certify the nearest approaches, and put all in order."""
        found = [self._approach(f) for f in range(len(self.watched.families))]
        self.approaches = tuple(sorted(filter(None, found), key=lambda a: a.upper))
        self.crossings.sort(key=lambda c: c.t)
        self.cut |= self._stretches.cut
        self.near_stretches = self._stretches.finish(self.crossings)

    def _approach(self, f: int) -> Approach | None:
        name, watched = self.watched.names[f], self.watched
        title = watched.families[f].title
        for c in self.crossings:
            if c.family == name:
                return Approach(name, c.t, c.q, 0.0, 0.0, title)
        conditions = self._families[f]
        found = [_refined(conditions, watched, m, u) for _, m, u in self._candidates[f]]
        if not found:
            return None
        upper, t, q = min(found, key=lambda x: (round(x[0], 9), x[1]))
        nearest = nearest_points(conditions, q[None], *watched.families[f].limits, _SEARCH)
        upper = min(upper, float(nearest.upper[0]))
        least = max(0.0, min(float(self._least[f]), upper))
        outside = "family" if watched.families[f].is_reachable is False else ""
        if not outside:
            moved = np.abs(nearest.q[0] - q) > ROUNDING
            outside = "point" * bool((watched.space.unreachable(nearest.q[0]) & moved).any())
        return Approach(name, t, q, upper, least, title, outside)


def _refined(
    conditions: Conditions, watched: Watched, motion: Motion, near: float
) -> tuple[float, float, Array]:
    """Least distance found near a place of a motion: (upper, t, q)."""

    def at(places: Array) -> Array:
        Q = motion.at(places)
        return nearest_points(conditions, Q, watched.lower, watched.upper, _CLOSE).upper

    low, high = 0.0, float(len(motion.pieces))
    u = np.unique(np.clip([near, low, high, near - 0.5, near + 0.5], low, high))
    upper = at(u)
    for _ in range(12):
        k = int(np.argmin(upper))
        left, right = u[max(k - 1, 0)], u[min(k + 1, len(u) - 1)]
        if right - left < 1e-6:
            break
        fresh = np.setdiff1d(np.array([(left + u[k]) / 2, (u[k] + right) / 2]), u)
        u, upper = np.append(u, fresh), np.append(upper, at(fresh))
        order = np.argsort(u)
        u, upper = u[order], upper[order]
    k = int(np.argmin(upper))
    place = u[k : k + 1]
    return float(upper[k]), float(motion.time(place)[0]), motion.at(place)[0]
