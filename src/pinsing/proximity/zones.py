"""How near is too near: distances beyond which no tip motion exceeds the joint speed limits.

Branch and bound over boxes of joint space. A box is done where the joint speeds that the tip
motions take are proven to stay within their limits (`pinsing.kinematics.speed_bounds`), or where
all of it is nearer to a family than the distance that is looked for is going to be: distance to a
family grows no faster than the joints that it depends on move. A configuration that does exceed a
limit bounds the answer from below.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import SearchOptions, nearest_points
from pinsing.algebra.trig_sum import off_values
from pinsing.algebra.two_sided import two_sided
from pinsing.arguments import checked
from pinsing.errors import OptionError, UnknownNameError
from pinsing.families import ClosedForm, Family
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.speed_bounds import SpeedBounds
from pinsing.kinematics.tip_speed import TIP_SPEED, TURN_SPEED, SpeedJudge, check_speeds
from pinsing.notebook import one_line
from pinsing.prose import listed
from pinsing.proximity.trajectory import angle_text
from pinsing.proximity.watched import Watched, metric_note, titled, watch
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.serialization import JsonResult

GAP = 0.05
"""Share of a distance within which a configuration that exceeds a limit is looked for."""
BOXES = 300_000
"""Boxes for each distance."""
_EXTRA = 1e-9
"""Radians added to each distance for the rounding of the distances themselves."""


@dataclass(frozen=True, eq=False)
class Zones(JsonResult):
    """Distances from singularities beyond which tip motions keep the joint speed limits.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    tip_speed, turn_speed : float
        m/s and rad/s of the tip, at once and in any directions.
    joint_speeds : (n,) array
        Speed limits, rad/s and m/s. Joint speeds of a redundant arm are the least ones (those of
        the pseudoinverse).
    within : tuple of str
        Where the answer holds, in words; empty for all of joint space.
    lower, upper : (n,) arrays
        The same as joint values.
    distances : dict of str to float
        Proven: farther than these from the families, radians (or metres over the length scale),
        no limit is exceeded. 0 where the family need not be kept away from.
    exceeding : dict of str to float
        A configuration that exceeds a limit is this far from the family, and farther than
        ``distances`` from the others; 0 where none was found.
    common, common_exceeding : float
        The same with one distance for all families.
    worst : (n,) array
        The configuration that exceeds a limit farthest from all families; empty if none was found.
    sigma_min, sigma_min_proven : float
        The least singular value found outside the zones, and a proven bound of all.
    condition_number : float
        The largest found outside the zones.
    titles : dict of str to str
        What families are called, with their condition where it is short.
    complete : bool
        Whether the closed form is: it does not matter to the proof.
    boxes : int
        Boxes that were looked at.
    notes : tuple of str
        What was assumed, and where the search ended before the gap was reached.
    """

    schema: ClassVar[str] = "pinsing/zones/1"

    arm: ArmSummary
    tip_speed: float
    turn_speed: float
    joint_speeds: Array
    within: tuple[str, ...]
    lower: Array
    upper: Array
    distances: dict[str, float]
    exceeding: dict[str, float]
    common: float
    common_exceeding: float
    worst: Array
    sigma_min: float
    sigma_min_proven: float
    condition_number: float
    titles: dict[str, str]
    complete: bool
    boxes: int
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        said = ", ".join(f"{name} {d:.3g}" for name, d in self.distances.items())
        return one_line("Zones", f"{self.arm.name}, {said}")

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return the answer in lines.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("scara"))
        >>> print(pinsing.zones(form, joint_speeds=[5, 5, 1, 10]).text().splitlines()[0])
        scara: keep 20.3° from F1: q2 = 0° or 180° (proven)
        """

        def far(x: float) -> str:
            return angle_text(x, degrees)

        speeds = f"{self.tip_speed:g} m/s and {self.turn_speed:g} rad/s of the tip"
        kept = [n for n, d in self.distances.items() if d > 0]
        where = f"with {listed(self.within)}, " if self.within else ""
        if kept:
            away = listed([f"{far(self.distances[n])} from {self.titles[n]}" for n in kept])
            lines = [f"{self.arm.name}: {where}keep {away} (proven)"]
        else:
            lines = [f"{self.arm.name}: {where}no distance need be kept (proven)"]
        lines += ["", f"  Then {speeds}, in any directions, exceed no joint speed limit"]
        for name in kept:
            found = self.exceeding[name]
            short = f"a limit is exceeded at {far(found)}" if found else "none found that does"
            lines.append(f"  {self.titles[name]}: {far(self.distances[name])}; {short}")
        found = self.common_exceeding
        short = f"; a limit is exceeded at {far(found)}" if found else ""
        lines.append(f"  One distance for all: {far(self.common)}{short}")
        if math.isfinite(self.sigma_min):
            lines.append(
                f"  Outside: sigma_min down to {self.sigma_min:.3g} (at least "
                f"{self.sigma_min_proven:.3g}, proven), condition number up to "
                f"{self.condition_number:.3g} (found)"
            )
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


@checked
def zones(
    form: ClosedForm,
    linear: float = TIP_SPEED,
    angular: float = TURN_SPEED,
    *,
    joint_speeds: npt.ArrayLike | None = None,
    within: Mapping[str, tuple[float, float]] | str | None = None,
    boxes: int = BOXES,
    progress: Callable[[str, int, int], None] | None = None,
) -> Zones:
    """Find the distances from singularities beyond which joint speed limits are kept.

    First the least common distance, then that of each family, in the order of the form, lowered as
    far as it goes with those of the others as they are.

    Parameters
    ----------
    form : ClosedForm
        Of the arm.
    linear, angular : float
        Tip speeds, m/s and rad/s, at once and in any directions.
    joint_speeds : (n,) array_like, optional
        Speed limits, rad/s and m/s; those of the description if not given.
    within : mapping or str, optional
        Where: "limits" (the joint limits), or ranges by joint, radians and metres; else whole
        circles. Prismatic joints always keep their limits.
    boxes : int
        Most boxes looked at for each distance; the answer is proven with fewer, but larger.
    progress : callable
        Told what is done, how far it is, and how far that goes.

    Returns
    -------
    Zones
        With what was assumed in ``notes``.

    Raises
    ------
    OptionError, UnknownNameError
        If speeds or ranges make no sense, speed limits are not known, or the arm has a task that
        is not covered.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("scara"))
    >>> found = pinsing.zones(form, joint_speeds=[5, 5, 1, 10])
    >>> found.common_exceeding <= found.common
    True
    """
    arm = form.loaded
    if arm is None:
        raise OptionError("a form that was read from JSON has no robot: make it with closed_form")
    check_speeds(linear, angular)
    judge = SpeedJudge(arm, joint_speeds)
    missing = [n for n, c in zip(arm.joints, judge.limits, strict=True) if not math.isfinite(c)]
    if missing and not judge.reason:
        raise OptionError(f"no speed limit is known of {listed(missing)}: give joint_speeds")
    if judge.reason:
        raise OptionError(f"{arm.name}: {judge.reason}")
    low, high, words = _ranges(arm, within)
    search = _Search(arm, form, judge, (linear, angular), (low, high), boxes, progress)
    return search.zones(words)


def _ranges(
    arm: Arm, within: Mapping[str, tuple[float, float]] | str | None
) -> tuple[Array, Array, tuple[str, ...]]:
    """Lower and upper values (n,), and how they are called."""
    low = np.where(arm.prismatic, arm.lower, -np.pi)
    high = np.where(arm.prismatic, arm.upper, np.pi)
    if not np.isfinite([low, high]).all():
        raise OptionError(f"{arm.name} has a prismatic joint without limits")
    if within is None:
        return low, high, ()
    if isinstance(within, str):
        if within != "limits":
            raise OptionError(f"within={within!r}: give 'limits', or ranges by joint")
        bounded = np.isfinite(arm.lower) & (arm.upper - arm.lower < 2 * np.pi)
        low, high = np.where(bounded, arm.lower, low), np.where(bounded, arm.upper, high)
        return low, high, ("the joint limits kept",)
    words = []
    for name, ends in within.items():
        if name not in arm.joints:
            raise UnknownNameError("joint", name, arm.joints)
        j = arm.joints.index(name)
        a, b = (float(x) for x in ends)
        if not (math.isfinite(a) and math.isfinite(b) and a < b):
            raise OptionError(f"within: {name} needs two ascending values, got {a:g} and {b:g}")
        slides = bool(arm.prismatic[j])
        low[j], high[j] = (a, b) if slides or b - a < 2 * np.pi else (-np.pi, np.pi)
        unit, factor = (" m", 1.0) if slides else ("°", 180 / np.pi)
        words.append(f"{name} between {factor * a:.4g}{unit} and {factor * b:.4g}{unit}")
    return low, high, tuple(words)


@dataclass(frozen=True, eq=False)
class _Answer:
    """One distance: proven, reached by a configuration that exceeds a limit, and that one."""

    proven: float
    reached: float
    q: Array


class _Search:
    """Branch and bound for one arm.

    Attributes
    ----------
    chunk : int
        Boxes in one call: tens of megabytes.
    wide : float
        Width of the first boxes, radians, or metres over the length scale.
    samples, rounds : int
        Random configurations among which the search begins, and steps from the best of them.
    steps : int
        To the nearest point of a surface.
    """

    chunk, wide, samples, rounds, steps = 2048, 0.8, 8192, 60, 5

    def __init__(
        self,
        arm: Arm,
        form: ClosedForm,
        judge: SpeedJudge,
        speeds: tuple[float, float],
        ranges: tuple[Array, Array],
        boxes: int,
        progress: Callable[[str, int, int], None] | None,
    ) -> None:
        self.arm, self.form, self.judge, self.speeds = arm, form, judge, speeds
        self.low, self.high = ranges
        self.most, self.progress = boxes, progress or (lambda *_: None)
        travel = np.where(arm.prismatic, np.maximum(np.abs(self.low), np.abs(self.high)), 0.0)
        self.bounds = SpeedBounds(judge, *speeds, travel)
        self.watched: Watched = watch(form)
        self.each = [
            Conditions.of([f.branches], self.watched.prismatic, self.watched.weight, "euclidean")
            for f in self.watched.families
        ]
        self.used: Bool = np.array([_used(c) for c in self.each]).reshape(-1, arm.n)
        self.active: Bool = self.bounds.moving | self.used.any(axis=0)
        self.rng = np.random.default_rng(36)
        self.seen = 0
        self.open = self._first_boxes()

    def zones(self, words: tuple[str, ...]) -> Zones:
        """Solve for the common distance, then for each."""
        names, count = self.watched.names, len(self.each)
        notes = []
        common = self._least(None, np.full(count, np.inf), "one distance for all")
        far = np.full(count, common.proven)
        found = np.zeros(count)
        for k, name in enumerate(names):
            lowered = self._least(k, far, f"{k + 1} of {count}")
            far[k], found[k] = min(far[k], lowered.proven), lowered.reached
            if far[k] > (1 + 2 * GAP) * found[k]:
                notes.append(
                    f"{name}: {self.most} boxes did not bring the proven distance within "
                    f"{GAP:.0%} of a configuration that exceeds a limit"
                )
        if self.judge.rank != self.arm.n:
            notes.append("joint speeds are those of least length (the pseudoinverse)")
        if self.arm.prismatic.any():
            notes.append(metric_note(self.arm.length_scale))
        sigma, condition = self._measures(far)
        L = self.arm.length_scale
        needed = max(L / v if (v := self.speeds[0]) else 0.0, 1 / w if (w := self.speeds[1]) else 0)
        both = all(self.speeds) or not (self.bounds.linear.any() and not self.bounds.linear.all())
        length = float(np.linalg.norm(self.judge.limits))
        return Zones(
            arm=summarize(self.arm),
            tip_speed=self.speeds[0],
            turn_speed=self.speeds[1],
            joint_speeds=self.judge.limits,
            within=words,
            lower=self.low,
            upper=self.high,
            distances=dict(zip(names, far.tolist(), strict=True)),
            exceeding=dict(zip(names, found.tolist(), strict=True)),
            common=common.proven,
            common_exceeding=common.reached,
            worst=common.q,
            sigma_min=sigma,
            sigma_min_proven=1 / (length * needed) if both and needed else 0.0,
            condition_number=condition,
            titles=dict(zip(names, map(_called, self.watched.families), strict=True)),
            complete=self.watched.complete,
            boxes=self.seen,
            notes=tuple(notes),
        )

    def _distances(self, Q: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (N, F) of the distances of Q (N, n) to the families.

        Where a family is a surface, the upper one is that of a point near the nearest: steps to
        the tangent plane at the last point, then what is proven to reach the surface from there.
        """
        conditions = self.watched.conditions
        both = two_sided(conditions, Q, each=True).each
        low, up = both[..., 0].copy(), both[..., 1].copy()
        X = conditions.scaled(Q)
        for branch in conditions.branches:
            if len(branch.sums) != 1:
                continue
            held = np.zeros(self.arm.n, dtype=bool)
            held[branch.joints] = True
            start = X.copy()
            off, _ = off_values(X[:, branch.joints], branch.values, conditions.turn[branch.joints])
            start[:, branch.joints] -= off
            x = start
            for _ in range(self.steps):
                at = branch.sums[0].at(x)
                g = np.where(held, 0.0, at.gradient)
                along = (g * (x - start)).sum(axis=1) - at.value
                x = start + g * (along / np.maximum((g * g).sum(axis=1), 1e-12))[:, None]
            near = two_sided(conditions, x / conditions.weight, each=True).each[:, branch.family, 1]
            found = np.linalg.norm(x - X, axis=1) * (1 + _EXTRA) + near
            up[:, branch.family] = np.fmin(up[:, branch.family], found)
        return low, up

    def _share(self, Q: Array) -> Array:
        """Largest share (N,) of the speed limits that tip motions take at Q (N, n)."""
        return self.bounds.of(Q, np.zeros_like(Q)).center

    def _random(self, count: int) -> Array:
        spread = self.rng.uniform(self.low, self.high, (count, self.arm.n))
        return np.where(self.active, spread, (self.low + self.high) / 2)

    def _objective(self, k: int | None, far: Array, distances: Array) -> Array:
        """What is made large (N,): the least distance, or that of family k outside the others."""
        if k is None:
            return np.asarray(distances.min(axis=1, initial=np.inf))
        others = np.arange(len(far)) != k
        outside = (distances[:, others] > far[others]).all(axis=1)
        return np.where(outside, distances[:, k], -np.inf)

    def _attack(self, k: int | None, far: Array) -> tuple[float, Array]:
        """The largest objective found at a configuration that exceeds a limit."""
        Q, step, guess = self._random(self.samples), 0.3, -np.inf
        where = np.empty((0, self.arm.n))
        for _ in range(self.rounds):
            value = self._objective(k, far, self._distances(Q)[1])
            value = np.where(self._share(Q) > 1, value, -np.inf)
            order = np.argsort(-value)[:30]
            if value[order[0]] > guess:
                guess, where = float(value[order[0]]), Q[order[:1]]
            good = Q[order[np.isfinite(value[order])]]
            if not len(good):
                break
            moves = self.rng.normal(size=(10, *good.shape)) * self.active * step
            moved = np.clip(good + moves, self.low, self.high).reshape(-1, self.arm.n)
            Q, step = np.concatenate([good, moved]), step * 0.9
        return self._certified(k, far, where), where[0] if len(where) else where.ravel()

    def _certified(self, k: int | None, far: Array, Q: Array) -> float:
        """The largest objective that is proven of configurations Q (N, n)."""
        if not len(Q):
            return 0.0
        limits = self.watched.lower, self.watched.upper
        low = [nearest_points(c, Q, *limits, SearchOptions(gap=1e-4)).lower for c in self.each]
        return max(0.0, float(self._objective(k, far, np.stack(low, axis=1)).max()))

    def _least(self, k: int | None, far: Array, what: str) -> _Answer:
        """The least distance of family k (of all), those of the others being ``far``."""
        reached, q = self._attack(k, far)
        (C, R), self.open = self.open, (self.open[0][:0], self.open[1][:0])
        ceiling, looked = np.full(len(C), np.inf), 0
        while True:
            target = max((1 + GAP) * reached, _EXTRA)
            keep = ceiling > target
            self._leave(C[~keep], R[~keep])
            C, R, ceiling = C[keep], R[keep], ceiling[keep]
            if not len(C) or looked >= self.most:
                break
            pick = np.argpartition(-ceiling, min(self.chunk, len(C)) - 1)[: self.chunk]
            rest = np.ones(len(C), dtype=bool)
            rest[pick] = False
            looked += len(pick)
            self.progress(what, looked, self.most)
            kept = np.where(np.arange(len(far)) == k, target, np.minimum(far, 1e9))
            c, r = self._trimmed(C[pick], R[pick], np.full(len(far), target) if k is None else kept)
            reach = np.linalg.norm((r * self.watched.weight)[:, None] * self.used, axis=2)
            up = self._distances(c)[1]
            most = up + reach
            top = np.minimum(ceiling[pick], self._objective(k, far, most))
            C, R, ceiling = C[rest], R[rest], ceiling[rest]
            alive = top > target
            self._leave(c[~alive], r[~alive])
            if not alive.any():
                continue
            c, r, top, up, most = (x[alive] for x in (c, r, top, up, most))
            found = self.bounds.of(c, r)
            guess = np.where(found.center > 1, self._objective(k, far, up), -np.inf)
            best = int(guess.argmax())
            if guess[best] > reached:
                sure = self._certified(k, far, c[best : best + 1])
                reached, q = (sure, c[best]) if sure > reached else (reached, q)
            binding = most.argmin(axis=1) if k is None else np.full(len(c), k)
            by_distance = r * self.watched.weight * self.used[binding]
            pull = np.where((found.center > 1)[:, None], by_distance, found.pull)
            alive = found.most > 1
            c, r, top = c[alive], r[alive], top[alive]
            j = np.where(self.active, pull[alive] + 1e-3 * r, -1.0).argmax(axis=1)
            half = np.eye(self.arm.n)[j] * r / 2
            C, R = np.concatenate([C, c - half, c + half]), np.concatenate([R, r - half, r - half])
            ceiling = np.concatenate([ceiling, top, top])
        self._leave(C, R)
        self.seen += looked
        proven = max((1 + GAP) * reached, float(ceiling.max(initial=0.0)))
        return _Answer(proven + _EXTRA if proven else 0.0, reached, q)

    def _leave(self, C: Array, R: Array) -> None:
        """Keep boxes in which a limit may be exceeded, for the next distance."""
        self.open = np.concatenate([self.open[0], C]), np.concatenate([self.open[1], R])

    def _trimmed(self, C: Array, R: Array, kept: Array) -> tuple[Array, Array]:
        """Boxes without what is nearer than ``kept`` (F,) to a family of one joint at a value."""
        low, high = C - R, C + R
        for branch in self.watched.conditions.branches:
            if len(branch.joints) != 1 or branch.sums:
                continue
            j, t = int(branch.joints[0]), float(kept[branch.family])
            turn = self.watched.conditions.turn[j]
            for v in (branch.values[0] - turn, branch.values[0], branch.values[0] + turn):
                a, b = (v - t) / self.watched.weight[j], (v + t) / self.watched.weight[j]
                lo, hi = low[:, j].copy(), high[:, j].copy()
                lower, upper = (lo >= a) & (lo < b) & (hi > b), (hi <= b) & (hi > a) & (lo < a)
                for cut, ends in ((lower, (lo, b)), (upper, (a, hi))):
                    off = low[cut].copy(), high[cut].copy()
                    off[0][:, j], off[1][:, j] = (np.broadcast_to(x, cut.shape)[cut] for x in ends)
                    self._leave((off[0] + off[1]) / 2, (off[1] - off[0]) / 2)
                low[lower, j], high[upper, j] = b, a
        return (low + high) / 2, (high - low) / 2 * (1 + 1e-12)

    def _first_boxes(self) -> tuple[Array, Array]:
        """Centres and half widths (N, n) of boxes that cover the ranges."""
        C, R = ((self.low + self.high) / 2)[None], ((self.high - self.low) / 2)[None]
        R = np.where(self.active, R, 0.0)
        for j in np.flatnonzero(self.active):
            parts = max(1, math.ceil(2 * R[0, j] * self.watched.weight[j] / self.wide))
            if len(C) * parts > self.chunk:
                continue
            half = R[0, j] / parts
            offsets = (2 * np.arange(parts) - parts + 1) * half
            C, R = np.repeat(C, parts, axis=0), np.repeat(R, parts, axis=0)
            C[:, j] += np.tile(offsets, len(C) // parts)
            R[:, j] = half * (1 + 1e-12) + 1e-15
        return C, R

    def _measures(self, far: Array) -> tuple[float, float]:
        """Least sigma and largest condition number found outside the zones."""
        Q = self._random(self.samples)
        low = two_sided(self.watched.conditions, Q, each=True).each[..., 0]
        Q = Q[(low > far).all(axis=1)]
        if not len(Q):
            return math.inf, math.nan
        sigma = np.asarray(singular_values(self.arm, Q))[:, : self.judge.rank]
        return float(sigma[:, -1].min()), float((sigma[:, 0] / sigma[:, -1]).max())


def _used(conditions: Conditions) -> Bool:
    """Joints (n,) that the distance depends on."""
    used = np.zeros(conditions.n, dtype=bool)
    for branch in conditions.branches:
        used[branch.joints] = True
        used |= branch.used(conditions.n)
    return used


def _called(family: Family) -> str:
    """Name of a family, with its condition unless that is a long equation."""
    name = titled(family.name, family.title)
    plain = family.title or not any(branch.equations for branch in family.branches)
    return f"{name}: {family.where()}" if plain else name
