"""What a sweep will do, before it is done: nominal configuration, special values, sets, cost."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing.arguments import MAX_SEED, checked, whole_number
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.batch import batch
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.verdict import NEAR_RTOL, SINGULAR_RTOL, generic_rank, ratios, scale_notes
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool, Ints, NDArray
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import ANGLE_TOL, nominal as nominal_geometry
from pinsing.sampling.generalize import ConditionTester, apart, value_text
from pinsing.sampling.map_plan import moving_ranges
from pinsing.serialization import JsonResult

SPECIAL_ANGLES = (0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi)
"""Special values of revolute joints, radians (paper, Section 3.2)."""

Special = Sequence[float] | Mapping[str, Sequence[float]]
"""Special angles of all revolute joints, or the special values of single joints by name."""

SAMPLES = 181
"""Points of a curve: every two degrees of a whole turn."""

MOVES_TIP = "only moves the tip point, which never changes the rank for the pose"
NOT_ASKED = "not asked for"
NOT_CHANGING = "does not change sigma_min"
NOT_CHANGING_BOTH = "do not change sigma_min"


@dataclass(frozen=True, eq=False)
class JointEffect:
    """What one joint does to sigma_r, and the values it is set to."""

    joint: str  # its name
    # greatest relative change (max - min) / max of sigma_r along its whole range, from the nominal
    # and several random configurations, on the nominal geometry
    change: float
    swept: bool  # false if it is left out of the combinations
    reason: str  # why it is left out; empty otherwise
    special: Array  # (k,): special values that it is set to, radians or metres
    range: Array  # (2,): ends of the range that it moves over, radians or metres


@dataclass(frozen=True, eq=False)
class PlannedLevel:
    """All sets of special values of one size."""

    level: int  # number of joints at special values
    joints: NDArray[np.intp]  # (S, level) of int: which joints, ascending
    values: Array  # (S, level): at which values, radians or metres
    # (S,) of bool: singular whatever the others, while none of its subsets among the special values
    # is
    forced: Bool
    swept: bool  # false if only the test for ``forced`` is asked of this level, and no curves


@dataclass(frozen=True, eq=False)
class SweepPlan(JsonResult):
    """Everything that decides what a sweep computes, and how much that is.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    nominal : (n,) array
        Configuration that the joints rest at, radians or metres: step (1).
    nominal_sigma : (r,) array
        Singular values there.
    nominal_origin : str
        ``given``, ``pi/3`` (the paper's choice) or ``random`` (best conditioned of some).
    effects : tuple of JointEffect
        One a joint.
    uniform_values : (U,) array
        Special angles, radians, that all revolute joints are set to at once: step (2).
    uniform : (U, n) array
        Those configurations, prismatic joints at ``nominal``.
    levels : tuple of PlannedLevel
        The combinations: steps (2) to (4).
    samples : int
        Points of a curve.
    ignore_limits, prune : bool
        Whole circles instead of the limits; leave out sets that contain a forced one.
    seed : int
        Of all random values.
    n_curves, n_jacobians : int
        Curves, and Jacobians to be computed.
    notes : tuple of str
        What was left out, and why.
    """

    schema: ClassVar[str] = "pinsing/sweep-plan/1"
    made_by: ClassVar[str] = "pinsing.sampling.plan_sweep(arm)"

    arm: ArmSummary
    nominal: Array
    nominal_sigma: Array
    nominal_origin: str
    effects: tuple[JointEffect, ...]
    uniform_values: Array
    uniform: Array
    levels: tuple[PlannedLevel, ...]
    samples: int
    ignore_limits: bool
    prune: bool
    seed: int
    n_curves: int
    n_jacobians: int
    notes: tuple[str, ...]

    @property
    def relevant(self) -> tuple[int, ...]:
        """Indices of the joints that a singularity can depend on, asked for or not."""
        return tuple(
            i
            for i, effect in enumerate(self.effects)
            if effect.change > ROUNDING and effect.reason != MOVES_TIP
        )

    @property
    def swept(self) -> tuple[int, ...]:
        """Indices of the joints that are combined."""
        return tuple(i for i, effect in enumerate(self.effects) if effect.swept)

    @property
    def forced(self) -> tuple[Mapping[str, float], ...]:
        """Minimal sets of special values that are singular whatever the others."""
        names = self.arm.joints
        return tuple(
            {names[j]: float(v) for j, v in zip(joints, values, strict=True)}
            for level in self.levels
            for joints, values in zip(
                level.joints[level.forced], level.values[level.forced], strict=True
            )
        )

    @checked
    def moving(self, fixed: Iterable[int]) -> tuple[int, ...]:
        """Return the joints that move in turn while ``fixed`` are at special values.

        Parameters
        ----------
        fixed : iterable of int
            Indices of joints.

        Returns
        -------
        tuple of int
            Indices of the others that are swept.

        Examples
        --------
        >>> import pinsing
        >>> plan = pinsing.sampling.plan_sweep(pinsing.load("ur5"))
        >>> plan.swept, plan.moving([1])
        ((1, 2, 3, 4), (2, 3, 4))
        """
        held = set(fixed)
        return tuple(i for i in self.swept if i not in held)

    def __str__(self) -> str:
        sets = ", ".join(
            f"{len(p.values):,} of {p.level} joint{'s' * (p.level > 1)}"
            for p in self.levels
            if p.swept
        )
        held = f"; special values: {sets}" if sets else ", with no joint at a special value"
        return f"{self.n_curves:,} curves, {self.n_jacobians:,} Jacobians{held}"


def uniform_configurations(
    arm: Arm, nominal: Array, special: Special, ignore_limits: bool, notes: list[str]
) -> tuple[tuple[float, Array], ...]:
    """Step (2): all revolute joints at one special value, prismatic ones at ``nominal``."""
    if arm.prismatic.all():
        return ()
    flat = itertools.chain(*special.values()) if isinstance(special, Mapping) else special
    values = np.array(list(flat), dtype=float)
    Q = np.where(arm.prismatic, nominal, values[:, None])
    outside = arm.space.unreachable(Q).any(axis=1) & (not ignore_limits)
    if outside.any():
        places = ", ".join(value_text(value) for value in values[outside].tolist())
        notes.append(f"not tried, being outside the joint limits: all joints at {places} at once")
    inside = distinct(values[~outside].tolist(), False)
    rows = np.where(arm.prismatic, nominal, np.reshape(inside, (-1, 1)))
    return tuple(zip(inside, rows if ignore_limits else arm.fold(rows), strict=True))


def distinct(values: Iterable[float], slides: bool) -> list[float]:
    """Values of a joint, those that are the same but for whole turns once."""
    kept: list[float] = []
    for value in values:
        if all(apart(value, known, slides) >= ROUNDING for known in kept):
            kept.append(value)
    return kept


def choose_nominal(
    arm: Arm, given: ArrayLike | None, ignore_limits: bool, rng: np.random.Generator
) -> tuple[Array, str]:
    """Return a regular configuration (n,), given or found, and its origin: step (1)."""
    # All revolute joints at pi/3, as in the paper, if within the limits and well conditioned; else
    # the best conditioned of some random ones.
    if given is not None:
        q = arm.check_one(given, "nominal")
        if not ignore_limits and not arm.within_limits(q):
            bad = np.flatnonzero(arm.space.outside(q))
            names = ", ".join(arm.joints[i] for i in bad)
            raise ConfigurationError(
                f"the nominal configuration is outside the limits of {names}; "
                "change it, or sweep with ignore_limits",
                joint=arm.joints[bad[0]],
                value=float(q[bad[0]]),
                limits=(float(arm.lower[bad[0]]), float(arm.upper[bad[0]])),
            )
        given_ratio = float(ratios(arm, q)[0])
        ConfigurationError.refuse_if(
            given_ratio <= SINGULAR_RTOL,
            f"the nominal configuration is singular (sigma_r/sigma_1 = {given_ratio:.1e}); "
            "choose a regular one, or leave it out and one is found",
        )
        return q, "given"
    low, high = arm.span
    # Four fifths of the range: the paper's 0.3 m for d3 of the Stanford arm in [-0.5, 0.5].
    paper = np.where(arm.prismatic, low + 0.8 * (high - low), np.pi / 3)
    inside = ignore_limits or bool(arm.within_limits(paper))
    if inside and ratios(arm, paper)[0] > NEAR_RTOL:
        return paper, "pi/3"
    tries = arm.space.sample(200, rng, ignore_limits)
    ratio = ratios(arm, tries)
    ConfigurationError.refuse_if(
        ratio.max() <= SINGULAR_RTOL,
        f"{arm.name} is singular at every configuration within its limits; "
        "widen them or sweep with ignore_limits",
    )
    return tries[int(ratio.argmax())], "random"


def special_values(
    arm: Arm, special: Special, ignore_limits: bool, notes: list[str]
) -> list[Array]:
    """Return special values of each joint within its limits; ``notes`` gets those left out."""
    # A prismatic joint takes 0 and the middle of its range.
    by_joint = special if isinstance(special, Mapping) else {}
    for name in by_joint:
        UnknownNameError.refuse_if(name not in arm.joints, "joint", name, arm.joints)
    common = SPECIAL_ANGLES if isinstance(special, Mapping) else tuple(special)
    result, left_out = [], []
    used: set[float] = set()
    merged = False
    for i, name in enumerate(arm.joints):
        slides = bool(arm.prismatic[i])
        usual = (0.0, float(arm.span[0][i] + arm.span[1][i]) / 2) if slides else common
        values = np.array(by_joint.get(name, usual), dtype=float)
        for value in values[~np.isfinite(values)]:
            raise OptionError(f"special value {value} of {name} is not finite")
        rows = np.zeros((len(values), arm.n))
        rows[:, i] = values
        arm.check(rows, "special")
        room = ROUNDING if slides else ANGLE_TOL  # files say 1.5707 for 90 degrees
        folded = rows if ignore_limits else arm.fold(rows)
        outside = arm.space.outside(folded, room)[:, i] & (not ignore_limits)
        for value in values[outside].tolist():
            if name in by_joint:
                raise ConfigurationError(
                    f"special value {value:g} of {name} is outside its limits "
                    f"[{arm.lower[i]:g}, {arm.upper[i]:g}]; "
                    "change it, or sweep with ignore_limits",
                    joint=name,
                    value=value,
                    limits=(float(arm.lower[i]), float(arm.upper[i])),
                )
            left_out.append(f"{name} = {value_text(value, slides)}")
        inside = folded[~outside, i].tolist()
        used |= set(values[~outside].tolist())
        result.append(np.array(distinct(inside, slides), dtype=float))
        merged = merged or (not slides and len(result[-1]) < len(inside))
    if special is not SPECIAL_ANGLES and not isinstance(special, Mapping):
        for value in () if arm.prismatic.all() else common:
            ConfigurationError.refuse_if(
                value not in used,
                f"special value {value:g} is outside the limits of every joint; "
                "change it, or sweep with ignore_limits",
            )
    if merged:
        notes.append("special values a whole turn apart are swept once")
    if left_out:
        what = "special value is" if len(left_out) == 1 else "special values are"
        named = f" ({', '.join(left_out)})" if len(left_out) < 3 else ""
        notes.append(f"{len(left_out)} {what} outside the joint limits: left out{named}")
    return result


LEVELS = (1, 2)
"""Levels of a sweep unless asked otherwise: cheap, and enough for most arms."""

_EFFECT_SAMPLES = 33
_MAX_SETS = 500_000
MAX_SAMPLES = 32_768  # a hundredth of a degree of a whole turn


@checked
def plan_sweep(
    arm: Arm,
    nominal: ArrayLike | None = None,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    seed: int = 0,
    geometry: Arm | None = None,
) -> SweepPlan:
    """Choose what to sweep and count what it costs.

    Parameters
    ----------
    arm, nominal, special, levels, samples, joints, ignore_limits, prune, seed, geometry
        As in ``sweep``.

    Returns
    -------
    SweepPlan
        What `sweep` would compute.

    Raises
    ------
    ConfigurationError
        If ``nominal`` or a special value given by the caller lies outside the limits
        (``ignore_limits`` lifts them), or ``nominal`` is singular.
    OptionError
        If levels, samples or special values make no sense, or too many sets result.
    UnknownNameError
        If a joint does not exist.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.sampling.plan_sweep(pinsing.load("planar3r"))
    <SweepPlan: 3 curves, 547 Jacobians; special values: 4 of 1 joint>
    """
    OptionError.refuse_if(
        not 3 <= samples <= MAX_SAMPLES,
        f"a curve needs at least 3 samples, and at most {MAX_SAMPLES:,}; got {samples}",
    )
    exact = nominal_geometry(arm).arm if geometry is None else geometry
    asked = _levels(levels, arm.n)
    named = arm.joints if joints is None else joints
    chosen = tuple(sorted({arm.space.index(name) for name in named}))
    rng = np.random.default_rng(whole_number(seed, "seed", 0, MAX_SEED))
    notes = list(scale_notes(arm))
    q, origin = choose_nominal(arm, nominal, ignore_limits, rng)
    ranges = moving_ranges(arm, ignore_limits, notes)
    values = special_values(arm, special, ignore_limits, notes)
    uniform = uniform_configurations(arm, q, special, ignore_limits, notes)
    effects = _effects(arm, exact, q, chosen, values, ranges, rng, notes)
    planned = _combinations(exact, effects, asked, prune, seed)
    for level in asked:
        if level > sum(e.swept for e in effects):
            notes.append(
                f"level {level} is empty: there are not {level} joints that change sigma_min"
            )
    swept = sum(e.swept for e in effects)
    n_curves = len(chosen) + sum(len(p.values) * (swept - p.level) for p in planned if p.swept)
    return SweepPlan(
        arm=summarize(arm),
        nominal=q,
        nominal_sigma=singular_values(arm, q)[0],
        nominal_origin=origin,
        effects=effects,
        uniform_values=np.array([value for value, _ in uniform], dtype=float),
        uniform=np.array([row for _, row in uniform], dtype=float).reshape(-1, arm.n),
        levels=planned,
        samples=samples,
        ignore_limits=ignore_limits,
        prune=prune,
        seed=seed,
        n_curves=n_curves,
        n_jacobians=n_curves * samples + len(uniform),
        notes=tuple(notes),
    )


def _levels(levels: int | Iterable[int] | None, n: int) -> tuple[int, ...]:
    if levels is None:
        return tuple(level for level in LEVELS if level < n)
    if isinstance(levels, int | np.integer):
        levels = range(1, min(int(levels), n) + 1)
    asked = tuple(sorted({int(level) for level in levels}))
    OptionError.refuse_if(
        not asked or asked[0] < 1 or asked[-1] > n - 1,
        f"levels must lie between 1 and {n - 1} for {n} joints, got "
        f"{', '.join(map(str, asked)) or 'none'}",
    )
    return asked


def _effects(
    arm: Arm,
    exact: Arm,
    q: Array,
    chosen: tuple[int, ...],
    values: list[Array],
    ranges: Array,
    rng: np.random.Generator,
    notes: list[str],
) -> tuple[JointEffect, ...]:
    """Return which joints change sigma_r, by their curves from q and from random configurations."""
    bases = np.concatenate([q[None], arm.space.sample(4, rng, ignore_limits=True)])
    Q = np.repeat(bases[None, :, None], arm.n, axis=0).repeat(_EFFECT_SAMPLES, axis=2)
    for i in range(arm.n):
        Q[i, :, :, i] = np.linspace(ranges[i, 0], ranges[i, 1], _EFFECT_SAMPLES)
    sigma = batch(exact).own_sigma(Q.reshape(-1, arm.n))[:, generic_rank(exact) - 1]
    sigma = sigma.reshape(arm.n, len(bases), _EFFECT_SAMPLES)
    top = sigma.max(axis=2)
    change = ((top - sigma.min(axis=2)) / np.where(top > 0, top, 1.0)).max(axis=1)
    effects = []
    for i, name in enumerate(arm.joints):
        reason = ""
        if i not in chosen:
            reason = NOT_ASKED
        elif change[i] <= ROUNDING:
            reason = NOT_CHANGING
        elif arm.task.name == "pose" and i == arm.n - 1 and arm.coupling is None:
            # Taken at a point of the base, no column depends on the last joint at all.
            reason = MOVES_TIP
        elif not len(values[i]):
            notes.append(f"{name} has no special value inside its limits; it only moves")
        effects.append(
            JointEffect(name, float(change[i]), not reason, reason, values[i], ranges[i])
        )
    by_reason: dict[str, list[str]] = {}
    for effect in effects:
        if effect.reason:
            by_reason.setdefault(effect.reason, []).append(effect.joint)
    for why, names in by_reason.items():
        many = len(names) > 1 and why == NOT_CHANGING
        notes.append(f"not swept: {', '.join(names)} ({NOT_CHANGING_BOTH if many else why})")
    return tuple(effects)


def _combinations(
    exact: Arm, effects: tuple[JointEffect, ...], asked: tuple[int, ...], prune: bool, seed: int
) -> tuple[PlannedLevel, ...]:
    """Return sets of special values by level, and if they force a singularity."""
    # Lower levels than asked for are tested too, so that forced sets are minimal.
    swept = [i for i, effect in enumerate(effects) if effect.swept]
    counts = [1]  # elementary symmetric polynomials of the numbers of special values
    for i in swept:
        k = len(effects[i].special)
        counts = [a + k * b for a, b in zip([*counts, 0], [0, *counts], strict=True)]
    top = min(max(asked, default=0), len(swept))
    total = sum(counts[1 : top + 1])
    OptionError.refuse_if(
        total > _MAX_SETS,
        f"{total:,} sets of special values are too many (at most {_MAX_SETS:,}); "
        "choose fewer levels or joints",
    )
    tester = ConditionTester(exact, range(0), seed=seed)
    found: list[Array] = []
    planned = []
    for level in range(1, top + 1):
        sets = [
            (joints, values)
            for joints in itertools.combinations(swept, level)
            for values in itertools.product(*(effects[j].special.tolist() for j in joints))
        ]
        joints = np.array([js for js, _ in sets], dtype=np.intp).reshape(-1, level)
        rows = np.full((len(sets), exact.n), np.nan)
        values = np.array([vs for _, vs in sets], dtype=float).reshape(-1, level)
        np.put_along_axis(rows, joints, values, axis=1)
        new = np.ones(len(sets), dtype=bool)  # holds no forced set of fewer joints
        for known in found:
            new &= (rows != known)[:, ~np.isnan(known)].any(axis=1)
        if prune:
            joints, values, rows, new = joints[new], values[new], rows[new], new[new]
        forced = new.copy()
        forced[new] = tester.worst_ratios(rows[new], 2) <= tester.rtol
        forced[forced] = [tester.forces(row) for row in rows[forced]]
        found += list(rows[forced])
        planned.append(PlannedLevel(level, joints, values, forced, level in asked))
    return tuple(planned)


@dataclass(frozen=True, eq=False)
class CurveRows:
    """Some curves."""

    numbers: Ints  # (C,) of int: which ones
    base: Array  # (C, n): the configuration that all of a curve has but for the joint that moves
    fixed: Bool  # (C, n) of bool: joints at special values
    moving: Ints  # (C,) of int: index of the joint that moves
    # (C,) of bool: the special values are a minimal set that is singular whatever the others
    forced: Bool
    singular: Bool  # (C,) of bool: they contain such a set: the curve is singular all along


class CurveTable:
    """All curves of a plan by their numbers; ``ranges`` (n, 2) are ends of each joint's range.

    First each joint from the nominal configuration, then level by level, set by set, each joint
    that moves in turn. The Jacobian of sample s of curve c has the number c * samples + s.
    """

    def __init__(self, plan: SweepPlan) -> None:
        self.plan = plan
        self._alone = np.array(
            [i for i, e in enumerate(plan.effects) if e.reason != NOT_ASKED], dtype=np.int64
        )
        self._swept = np.array(plan.swept, dtype=np.int64)
        # Curves of one level: number of the first, how many for every set, and the level.
        self._blocks: list[tuple[int, int, PlannedLevel]] = []
        self._length = len(self._alone)
        for level in plan.levels:
            each = len(self._swept) - level.level if level.swept else 0
            self._blocks.append((self._length, each, level))
            self._length += each * len(level.values)
        self.ranges = np.array([effect.range for effect in plan.effects], dtype=float)

    def __len__(self) -> int:
        return self._length

    def rows(self, numbers: ArrayLike) -> CurveRows:
        """Look up the curves ``numbers`` (C,)."""
        found = np.asarray(numbers, dtype=np.int64)
        count, n = len(found), len(self.plan.nominal)
        base = np.tile(self.plan.nominal, (count, 1))
        fixed, forced = np.zeros((count, n), dtype=bool), np.zeros(count, dtype=bool)
        moving = np.zeros(count, dtype=np.int64)
        alone = found < len(self._alone)
        moving[alone] = self._alone[found[alone]]
        for first, each, level in self._blocks:
            here = np.flatnonzero((found >= first) & (found < first + each * len(level.values)))
            if not len(here):
                continue
            place, turn = np.divmod(found[here] - first, each)
            rows, joints = here[:, None], level.joints[place]
            base[rows, joints] = level.values[place]
            fixed[rows, joints] = True
            forced[here] = level.forced[place]
            free = ~fixed[rows, self._swept[None]]  # the same number in each row
            others = np.nonzero(free)[1].reshape(len(here), each)
            moving[here] = self._swept[others[np.arange(len(here)), turn]]
        # A pruned plan has no set that contains a forced one, but those themselves.
        singular = forced if self.plan.prune else self._singular(base, fixed)
        return CurveRows(found, base, fixed, moving, forced, singular)

    def fixed_values(self, rows: CurveRows, k: int) -> Mapping[str, float]:
        """Joints at special values of one of ``rows``, by name."""
        names = self.plan.arm.joints
        return {names[j]: float(rows.base[k, j]) for j in np.flatnonzero(rows.fixed[k])}

    def forced(self) -> Iterator[tuple[Array, range]]:
        """Minimal sets that are singular whatever the others, and the numbers of their curves."""
        # As rows (n,), NaN where a joint is free.
        for first, each, level in self._blocks:
            for place in np.flatnonzero(level.forced).tolist():
                row = np.full(len(self.plan.nominal), np.nan)
                row[level.joints[place]] = level.values[place]
                begin = first + place * each
                yield row, range(begin, begin + each)

    def configurations(self, curves: ArrayLike, samples: ArrayLike) -> Array:
        """Joint vectors (P, n) of samples (P,) of curves (P,)."""
        rows = self.rows(curves)
        places = np.asarray(samples, dtype=np.int64)[:, None]
        Q = rows.base.copy()
        moved = axis_values(self.ranges[rows.moving], self.plan.samples, places)
        np.put_along_axis(Q, rows.moving[:, None], moved, axis=1)
        return Q

    def configuration(self, index: int) -> Array:
        """Joint vector (n,) of the Jacobian with that number."""
        curve, sample = divmod(index, self.plan.samples)
        return np.asarray(self.configurations([curve], [sample])[0])

    def _singular(self, base: Array, fixed: Bool) -> Bool:
        """Return which rows contain a set that is singular whatever the others."""
        found = np.zeros(len(base), dtype=bool)
        for row, _ in self.forced():
            found |= (np.isnan(row) | (fixed & (base == row))).all(axis=1)
        return found


def axis_values(ranges: Array, samples: int, places: Ints) -> Array:
    """Return values as of ``linspace`` over ``ranges`` (C, 2) at ``places`` (C, P), ends exact."""
    low, high = ranges[:, :1], ranges[:, 1:]
    values = places * ((high - low) / (samples - 1)) + low
    return np.asarray(np.where(places == samples - 1, high, values))


_CELLS = 64  # parts of a range


def kinds(rows: CurveRows, samples: int, row: Ints, sample: Ints) -> Ints:
    """Kind (P,) of candidates: sample (P,) of the curves in row (P,) of ``rows``."""
    n = rows.fixed.shape[1]
    group = (rows.fixed @ (1 << np.arange(n, dtype=np.int64))) * n + rows.moving
    return np.asarray(group[row] * _CELLS + sample * _CELLS // samples)
