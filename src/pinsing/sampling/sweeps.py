"""The paper's joint-angle parameterization method: what a sweep covers and costs; and its run.

One, two, three, ... joints at special values while each remaining joint runs over its range
and the rest stay at the nominal configuration (paper, Section 3.2, steps (1) to (4)).

The result is the same to the last bit however the curves are shared out among chunks: the blocks
that are computed at a time do not depend on them.
"""

from __future__ import annotations

import functools
import hashlib
import io
import itertools
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pinsing.atomic_write import MEBIBYTE, write_bytes
from pinsing.chunk_file import DamagedError, Record, read_arrays, read_bounded
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.interface import MAX_SEED, JsonResult, checked, typed, whole_number
from pinsing.kinematics.jacobian import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    Batch,
    Status,
    batch,
    generic_rank,
    measured,
    ratios,
    run_identity,
    scale_notes,
    singular_values,
    status_of,
)
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool, Ints, NDArray
from pinsing.prose import PLAIN, Page, Span, alarm, unbroken, verdict
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import ANGLE_TOL, nominal as nominal_geometry
from pinsing.sampling.execute import (
    Job,
    Progress,
    Tell,
    planned_batch,
    running,
)
from pinsing.sampling.generalize import (
    ConditionTester,
    Finding,
    apart,
    finding_spans,
    value_text,
)
from pinsing.sampling.tally import (
    CANDIDATES,
    WORST,
    Candidates,
    Distribution,
    Pool,
    Tally,
    WorstPoint,
    check_names,
    distributions,
    finite,
    minima,
    worst_points,
)

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
) -> tuple[Array, Array]:
    """Step (2): special values (U,) that all revolute joints take at once, and the rows (U, n)."""
    if arm.prismatic.all():
        return np.zeros(0), np.zeros((0, arm.n))
    flat = itertools.chain(*special.values()) if isinstance(special, Mapping) else special
    values = np.array(list(flat), dtype=float)
    Q = np.where(arm.prismatic, nominal, values[:, None])
    outside = arm.space.unreachable(Q).any(axis=1) & (not ignore_limits)
    if outside.any():
        places = ", ".join(value_text(value) for value in values[outside].tolist())
        notes.append(f"not tried, being outside the joint limits: all joints at {places} at once")
    inside = np.array(distinct(values[~outside].tolist(), False), dtype=float)
    rows = np.where(arm.prismatic, nominal, inside[:, None])
    return inside, rows if ignore_limits else arm.fold(rows)


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
        rows = np.where(np.arange(arm.n) == i, values[:, None], 0.0)
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
    ranges = arm.space.one_turn(ignore_limits)
    low, high = arm.space.range(ignore_limits)
    cut = high - low - np.ptp(ranges, axis=1) > ROUNDING
    if cut.any():
        names = ", ".join(np.array(arm.joints)[cut])
        notes.append(f"one turn of {names} is swept: the rest of the range only repeats it")
    values = special_values(arm, special, ignore_limits, notes)
    uniform_values, uniform = uniform_configurations(arm, q, special, ignore_limits, notes)
    effects = _effects(arm, exact, q, chosen, values, ranges, rng, notes)
    planned = _combinations(exact, effects, asked, prune, seed)
    swept = sum(e.swept for e in effects)
    notes += [
        f"level {level} is empty: there are not {level} joints that change sigma_min"
        for level in asked
        if level > swept
    ]
    n_curves = len(chosen) + sum(len(p.values) * (swept - p.level) for p in planned if p.swept)
    return SweepPlan(
        arm=summarize(arm),
        nominal=q,
        nominal_sigma=singular_values(arm, q)[0],
        nominal_origin=origin,
        effects=effects,
        uniform_values=uniform_values,
        uniform=uniform,
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
    for why in dict.fromkeys(effect.reason for effect in effects if effect.reason):
        names = [effect.joint for effect in effects if effect.reason == why]
        many = len(names) > 1 and why == NOT_CHANGING
        notes.append(f"not swept: {', '.join(names)} ({NOT_CHANGING_BOTH if many else why})")
    return tuple(effects)


def _combinations(
    exact: Arm, effects: tuple[JointEffect, ...], asked: tuple[int, ...], prune: bool, seed: int
) -> tuple[PlannedLevel, ...]:
    """Return sets of special values by level, and if they force a singularity."""
    # Lower levels than asked for are tested too, so that forced sets are minimal.
    swept = [i for i, effect in enumerate(effects) if effect.swept]
    # Elementary symmetric polynomials of the numbers of special values, however large.
    each = [np.array([1, len(effects[i].special)], dtype=object) for i in swept]
    counts = functools.reduce(np.convolve, each, np.ones(1, dtype=object))
    top = min(max(asked, default=0), len(swept))
    total = int(sum(counts[1 : top + 1]))
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
        self.ranges = np.array([effect.range for effect in plan.effects], dtype=float)
        n = len(plan.effects)
        # Sets of special values, NaN where a joint is free, which joints move in turn, and the
        # number of the first curve of each; the first set is that of no joint.
        sets, forced, swept = [np.full((1, n), np.nan)], [np.zeros(1, dtype=bool)], [True]
        for level in plan.levels:
            sets.append(np.full((len(level.values), n), np.nan))
            np.put_along_axis(sets[-1], level.joints, level.values, axis=1)
            forced.append(level.forced)
            swept += [level.swept] * len(level.values)
        self._sets, self._forced = np.concatenate(sets), np.concatenate(forced)
        self._moves = np.isnan(self._sets) & np.isin(np.arange(n), plan.swept)
        self._moves &= np.array(swept)[:, None]
        self._moves[0] = [effect.reason != NOT_ASKED for effect in plan.effects]
        self._first = np.concatenate([[0], self._moves.sum(axis=1).cumsum()])
        # A pruned plan has no set that contains a forced one, but those themselves.
        self._singular = self._forced.copy()
        for row in () if plan.prune else self._sets[self._forced]:
            self._singular |= (np.isnan(row) | (self._sets == row)).all(axis=1)

    def __len__(self) -> int:
        return int(self._first[-1])

    def rows(self, numbers: ArrayLike) -> CurveRows:
        """Look up the curves ``numbers`` (C,)."""
        found = np.asarray(numbers, dtype=np.int64)
        place = np.searchsorted(self._first, found, side="right") - 1
        fixed, turn = ~np.isnan(self._sets[place]), found - self._first[place]
        base = np.where(fixed, self._sets[place], self.plan.nominal)
        moving = (self._moves[place].cumsum(axis=1) == turn[:, None] + 1).argmax(axis=1)
        return CurveRows(found, base, fixed, moving, self._forced[place], self._singular[place])

    def fixed_values(self, rows: CurveRows, k: int) -> Mapping[str, float]:
        """Joints at special values of one of ``rows``, by name."""
        names = self.plan.arm.joints
        return {names[j]: float(rows.base[k, j]) for j in np.flatnonzero(rows.fixed[k])}

    def forced(self) -> Iterator[tuple[Array, range]]:
        """Minimal sets that are singular whatever the others, and the numbers of their curves."""
        # As rows (n,), NaN where a joint is free.
        for place in np.flatnonzero(self._forced):
            yield self._sets[place], range(self._first[place], self._first[place + 1])

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


CURVES = "sweep.npz"
"""File of the folder of a complete sweep that holds its result, with the curves if kept."""


@dataclass(frozen=True, eq=False)
class SweepCurve:
    """Distribution of sigma_r along one joint."""

    # number of joints at special values; 0 for the curves from the nominal configuration
    level: int
    fixed: Mapping[str, float]  # joints at special values, radians or metres
    forced: bool  # ``fixed`` alone is singular whatever the others, and so is the whole curve
    moving: int  # index of the joint that moves
    x: Array  # (samples,): its values, radians or metres
    sigma_min: Array  # (samples,): sigma_r of the task Jacobian, raw geometry
    sigma_ratio: Array  # (samples,): sigma_r / sigma_1
    number: int  # its place in the plan

    def holds(self, values: Mapping[str, float], arm: ArmSummary) -> bool:
        """Return True if those joints, and no others, are at these special values."""
        slides = dict(zip(arm.joints, arm.prismatic, strict=True))
        return set(values) == set(self.fixed) and all(
            apart(value, self.fixed[name], bool(slides[name])) < 1e-9
            for name, value in values.items()
        )


@dataclass(frozen=True)
class UniformRow:
    """All revolute joints at one special value: step (2)."""

    value: float  # radians
    # sigma_min and sigma_ratio: sigma_r, and sigma_r / sigma_1
    sigma_min: float
    sigma_ratio: float
    status: Status  # ``singular``, ``near-singular`` or ``regular``


@dataclass(frozen=True, eq=False)
class SweepSummary:
    """How sigma_r is distributed over the samples of all curves.

    Curves whose special values alone are singular whatever the others are left out: all of
    them is rounding. The number of a configuration is that of its curve times the samples of a
    curve, plus that of the sample.
    """

    count: int  # configurations
    # singular and near_singular: how many of them are that (ratio at most 1e-9; above it and at
    # most 1e-2)
    singular: int
    near_singular: int
    # sigma_min and ratio: of sigma_r, and of sigma_r / sigma_1
    sigma_min: Distribution
    ratio: Distribution
    # those of smallest ratio, smallest first, the first of equals first
    worst: tuple[WorstPoint, ...]

    def __str__(self) -> str:
        ratio = self.ratio
        shown = ", ".join(
            f"{name} {ratio.quantile(p):.3g}"
            for p, name in ((0.01, "1 %"), (0.1, "10 %"), (0.5, "median"))
        )
        return (
            f"sigma_r/sigma_1 over {self.count:,} configurations: "
            f"smallest {ratio.smallest.value:.3g}, {shown}, largest {ratio.largest.value:.3g}; "
            f"{self.singular:,} singular, {self.near_singular:,} near-singular"
        )


@dataclass(frozen=True, eq=False)
class SweepResult(JsonResult):
    """All that a sweep has computed.

    Attributes
    ----------
    plan : SweepPlan
        What was asked for.
    uniform : tuple of UniformRow
        All joints at each special value.
    curves : tuple of SweepCurve
        In the order of the plan; empty if they are not kept.
    complete : bool
        False if the sweep was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    engine : str
        ``pinocchio``, or the instruction set: the same one gives the same bits.
    kept : bool
        Whether ``curves`` has them.
    done : int
        Jacobians computed.
    summary : SweepSummary or None
        How sigma_r is distributed over the curves; None if there was no curve to look at.
    candidates : Candidates
        The dips of the curves.
    """

    schema: ClassVar[str] = "pinsing/sweep/1"
    made_by: ClassVar[str] = "pinsing.sampling.sweep(arm)"

    plan: SweepPlan
    uniform: tuple[UniformRow, ...]
    curves: tuple[SweepCurve, ...]
    complete: bool
    notes: tuple[str, ...]
    engine: str
    kept: bool
    done: int
    summary: SweepSummary | None
    candidates: Candidates

    @property
    def arm(self) -> ArmSummary:
        """The arm that was swept."""
        return self.plan.arm

    @checked
    def curve(self, fixed: Mapping[str, float] | None, moving: str | int) -> SweepCurve:
        """Look up the curve of joint ``moving`` with ``fixed`` at special values.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres; values of revolute joints up to whole turns. Empty for level 0.
        moving : str or int
            Name or index of the joint.

        Returns
        -------
        SweepCurve
            Its ``x`` and ``sigma_min``, among others.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.
        OptionError
            If there is no such curve, or the curves are not kept.

        Examples
        --------
        >>> import pinsing
        >>> curve = pinsing.sampling.sweep(pinsing.load("planar3r")).curve({}, "q2")
        >>> curve.x.shape, curve.sigma_min.max().round(3).item()
        ((181,), 0.206)
        """
        names = self.arm.joints
        wanted = dict(fixed or {})
        self._known((*wanted, *([moving] if isinstance(moving, str) else [])))
        index = (
            names.index(moving)
            if isinstance(moving, str)
            else whole_number(moving, "moving", 0, len(names) - 1)
        )
        for curve in self.curves:
            if curve.moving == index and curve.holds(wanted, self.arm):
                return curve
        OptionError.refuse_if(
            not self.kept,
            f"the curves of this sweep are not kept ({self.plan.n_jacobians:,} Jacobians); sweep "
            "fewer of them",
        )
        raise OptionError(
            f"there is no curve of {names[index]} with {self.set_text(wanted) or 'no joint fixed'}"
            ": outside the plan, or left out because a part of it is singular already"
        )

    @checked
    def set_text(self, fixed: Mapping[str, float]) -> str:
        """Return the special values in words.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres, by names of joints.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.

        Examples
        --------
        >>> import math, pinsing
        >>> pinsing.sampling.sweep(pinsing.load("planar3r")).set_text({"q2": 0, "q3": math.pi / 2})
        'q2 = 0, q3 = 90 deg'
        """
        self._known(fixed)
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        return ", ".join(f"{n} = {value_text(v, bool(sliding[n]))}" for n, v in fixed.items())

    def _known(self, joints: Iterable[str]) -> None:
        for name in joints:
            UnknownNameError.refuse_if(name not in self.arm.joints, "joint", name, self.arm.joints)

    def __str__(self) -> str:
        return sweep_text(self)


def sweep_text(
    result: SweepResult,
    findings: Sequence[Finding] | None = None,
    page: Page = PLAIN,
    degrees: bool = False,
) -> str:
    """Return what was swept, what was found, and what was left out."""
    lines = [page.paragraph(*spans, rest="  ") for spans in _swept(result, degrees, page.width - 2)]
    if findings is not None:
        title: Span = "Found, refined and generalised:" if findings else "Nothing singular found."
        lines += ["", page.paragraph(title)]
        lines += [page.paragraph(*finding_spans(f), first="  - ") for f in findings]
    if result.notes:
        lines += ["", "Notes:"]
        lines += [page.paragraph(note, first="  - ") for note in result.notes]
    return "\n".join(lines)


def _swept(result: SweepResult, degrees: bool, room: int) -> Iterator[tuple[Span, ...]]:
    plan = result.plan
    yield (f"sweep of {result.arm.name}: {plan}",)
    at = typed(plan.nominal, result.arm.prismatic, degrees, 9, room=room)
    origin = {
        "given": "as given",
        "pi/3": "60 degrees, as in the paper",
        "random": "the best conditioned of some random ones",
    }.get(plan.nominal_origin, plan.nominal_origin)
    sigma = unbroken(f"sigma_min = {plan.nominal_sigma[-1]:.6g}")
    yield (f"nominal configuration ({origin}): {at}; {sigma}",)
    for row in result.uniform:
        value = unbroken(value_text(row.value))
        yield (
            f"all joints at {value}: {unbroken(f'sigma_min = {row.sigma_min:.3g}')}, ",
            verdict(row.status),
        )
    for fixed in plan.forced:
        condition = unbroken(result.set_text(fixed)).replace(",\u00a0", ", ")
        yield f"{condition}: ", alarm("singular"), " whatever the others"
    if result.summary is not None:
        yield (str(result.summary).replace(" %", "\u00a0%"),)


def curves_of(
    table: CurveTable,
    numbers: ArrayLike,
    x: Array,
    sigma_min: Iterable[Array],
    sigma_ratio: Iterable[Array],
) -> Iterator[SweepCurve]:
    """Curves ``numbers`` (C,) of a table, from their values and those (n, S) of all joints."""
    rows = table.rows(numbers)
    values = zip(rows.numbers.tolist(), sigma_min, sigma_ratio, strict=True)
    for k, (number, last, ratio) in enumerate(values):
        yield SweepCurve(
            level=int(rows.fixed[k].sum()),
            fixed=table.fixed_values(rows, k),
            forced=bool(rows.forced[k]),
            moving=int(rows.moving[k]),
            x=x[rows.moving[k]],
            sigma_min=last,
            sigma_ratio=ratio,
            number=number,
        )


def pack_sweep(result: SweepResult) -> bytes:
    """Bytes of the file that `save_npz` writes."""
    table = CurveTable(result.plan)
    rows = table.rows([c.number for c in result.curves])
    shape = len(result.curves), result.plan.samples if result.curves else 0
    header = replace(result, curves=()).to_dict()
    arrays = {
        "header": np.array(json.dumps(header, allow_nan=False).encode()),
        "number": rows.numbers,
        "level": rows.fixed.sum(axis=1),
        "moving": rows.moving,
        "forced": rows.forced,
        "fixed": np.where(rows.fixed, rows.base, np.nan),
        "x": axis_values(table.ranges, result.plan.samples, np.arange(shape[1])[None]),
        "sigma_min": np.array([c.sigma_min for c in result.curves]).reshape(shape),
        "sigma_ratio": np.array([c.sigma_ratio for c in result.curves]).reshape(shape),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)
    return packed.getvalue()


# Jacobians of a chunk at least, in memory and in a folder, where it is 1 MB with its curves.
_CHUNK, _CHUNK_ON_DISK = 16_384, 65_536


class SweepJob(Job):
    """The curves of a sweep, ``curves`` in each chunk, which keeps ``values`` too if asked."""

    def __init__(
        self, plan: SweepPlan, batch: Batch, curves: int, values: bool, worst: int, candidates: int
    ) -> None:
        self.plan, self.batch, self.curves = plan, batch, curves
        self.values, self.worst, self.candidates = values, worst, candidates
        self.table = CurveTable(plan)
        self.count, self.size = len(self.table) * plan.samples, curves * plan.samples

    def identity(self) -> Mapping[str, Any]:
        """Return what decides the numbers, as plain JSON values."""
        plan = self.plan
        digest = hashlib.sha256(self.table.ranges.tobytes())
        for level in plan.levels:
            digest.update(f"{level.level} {level.swept} {level.values.shape};".encode())
            digest.update(level.joints.astype(np.int64).tobytes())
            digest.update(level.values.tobytes() + level.forced.tobytes())
        digest.update(repr([(e.swept, e.reason) for e in plan.effects]).encode())
        return run_identity("sweep", self.batch) | {
            "records": 2,  # of this form; those of another are no damaged ones
            "joints": list(plan.arm.joints),
            "nominal": plan.nominal.tolist(),
            "samples": plan.samples,
            "curves": len(self.table),
            "chunks": self.chunks,
            "curves_of_a_chunk": self.curves,
            "keep": self.values,
            "worst": self.worst,
            "candidates": self.candidates,
            "ranges and special values": digest.hexdigest(),
        }

    def _rows(self, index: int) -> CurveRows:
        start, stop = (number // self.plan.samples for number in self.span(index))
        return self.table.rows(np.arange(start, stop))

    def part(self, index: int) -> Callable[[], Record]:
        """One chunk, with no more than it needs."""
        return functools.partial(
            compute_curves, self.batch, self.values, self.worst, self.candidates,
            self.table.ranges, self.plan.samples, self._rows(index),
        )  # fmt: skip

    def check(self, index: int, record: Record) -> None:
        """Raise a DamagedError that says why ``record`` cannot be that of a chunk."""
        start, stop = self.span(index)
        tally, pool = Tally(self.worst), Pool(self.candidates)
        values = VALUES if self.values else ()
        check_names(record, (*tally.names, *pool.names, *values))
        regular = int((~self._rows(index).singular).sum()) * self.plan.samples
        tally.check(record, regular, start, stop, self._again)
        pool.check(record, start, stop, regular)
        for name in values:
            finite(record, name, (stop - start,))

    def _again(self, numbers: list[int]) -> tuple[Array, Array]:
        Q = self.table.configurations(*np.divmod(numbers, self.plan.samples))
        sigma, ratio = measured(self.batch, Q)
        return sigma[:, -1], ratio

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""
        start, stop = self.span(index)
        count = stop - start
        dips = 32 * min(self.candidates, count)
        return Tally(self.worst).room(count) + dips + (16 * count if self.values else 0)


def compute_curves(
    batch: Batch, values: bool, worst: int, candidates: int, ranges: Array, samples: int,
    rows: CurveRows,
) -> Record:  # fmt: skip
    """Return the tally and candidates of one chunk as arrays.

    With ``values`` also ``sigma_min`` and ``sigma_ratio`` (N,). Joints move over ``ranges``
    (n, 2) in ``samples``; ``rows`` are its curves.
    """
    tally, pool = Tally(worst), Pool(candidates)
    kept: list[tuple[Array, Array]] = []
    places, block = np.arange(samples)[None], _curves_per_block(samples)
    for first in range(0, len(rows.numbers), block):
        some = slice(first, first + block)
        moving = rows.moving[some]
        Q = np.repeat(rows.base[some, None], samples, axis=1)
        moved = axis_values(ranges[moving], samples, places)
        np.put_along_axis(Q, moving[:, None, None], moved[..., None], axis=2)
        found = measured(batch, Q.reshape(-1, Q.shape[2]))
        last, ratio = (x.reshape(Q.shape[:2]) for x in (found.sigma[:, -1], found.ratio))
        numbers = rows.numbers[some, None] * samples + places
        regular = ~rows.singular[some]
        tally.add(0, last[regular].ravel(), ratio[regular].ravel(), numbers[regular].ravel())
        dip = minima(last, ratio) & regular[:, None]
        row, column = np.nonzero(dip)
        kind = kinds(rows, samples, row + first, column)
        pool.add(numbers[dip], kind, last[dip], ratio[dip])
        if values:
            kept.append((last.ravel(), ratio.ravel()))
    record = tally.record() | pool.record()
    if values:
        record |= zip(VALUES, map(np.concatenate, zip(*kept, strict=True)), strict=True)
    return record


def _curves_per_block(samples: int) -> int:
    return max(1, 4096 // samples)  # configurations that are treated at a time, of shorter curves


KEEP_BYTES = 64 * MEBIBYTE
"""Curves are part of the result up to this size: 16 bytes for each Jacobian."""

VALUES = ("sigma_min", "sigma_ratio")
"""Names of the arrays of kept curves in a record: 16 bytes for each Jacobian."""


@checked
def sweep(
    arm: Arm,
    nominal: ArrayLike | None = None,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    progress: Progress | None = None,
    seed: int = 0,
    geometry: Arm | None = None,
    keep: bool | None = None,
) -> SweepResult:
    """Sweep an arm the paper's way, level by level.

    Parameters
    ----------
    arm : Arm
        Any arm; the curves are of its own (raw) geometry.
    nominal : (n,) or (nq,) array_like, optional
        Configuration that the joints rest at, radians or metres; found if not given: pi/3 for
        all revolute joints (the paper's choice) if that will do.
    special : sequence of float, or mapping of joint names to such
        Special values of the revolute joints, radians, or of single joints. Prismatic joints
        take 0 and the middle of their range.
    levels : int or iterable of int, optional
        How many joints are at special values at once; an int means 1 up to it. 1 and 2 by
        default, up to n - 1.
    samples : int
        Points of a curve.
    joints : sequence of str, optional
        Joints that take part; all that change sigma_min by default.
    ignore_limits : bool
        Ignore joint limits.
    prune : bool
        Leave out sets that contain one that is singular whatever the others. False keeps
        everything, as the paper's figures do.
    progress : callable, optional
        Called with (Jacobians done, all of them).
    seed : int
        Of all random values.
    geometry : Arm, optional
        Geometry for the tests whether a set is singular whatever the others, instead of the
        nominal geometry of ``arm``.
    keep : bool, optional
        Keep the curves, of 4 million Jacobians at most; by default where they are no more.

    Returns
    -------
    SweepResult
        After Ctrl-C, what was done until then, with ``complete`` False.

    Raises
    ------
    ConfigurationError, OptionError, UnknownNameError
        As ``plan_sweep``.

    Examples
    --------
    >>> import pinsing
    >>> result = pinsing.sampling.sweep(pinsing.load("planar3r"))
    >>> len(result.curves), result.complete
    (3, True)
    """
    plan = plan_sweep(
        arm, nominal, special, levels, samples, joints, ignore_limits, prune, seed, geometry
    )
    return run_sweep(arm, plan, progress, keep=keep)


def run_sweep(
    arm: Arm,
    plan: SweepPlan,
    progress: Progress | None = None,
    *,
    keep: bool | None = None,
    worst: int = WORST,
    candidates: int = CANDIDATES,
    chunk: int | None = None,
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    threads: int | None = None,
    executor: Executor | None = None,
    parallel: int | None = None,
    tell: Tell | None = None,
) -> SweepResult:
    """Run a plan made for ``arm``; after Ctrl-C ``complete`` is False. Options as of `sweep`.

    The memory taken does not depend on the number of Jacobians: some 3 MB a thread, about 100 bytes
    a candidate, and the curves, which are part of the result up to `KEEP_BYTES` unless ``keep``
    says. ``worst`` configurations and ``candidates`` for `singular_configurations` are kept
    (`pinsing.sampling.tally` says which). A stopped run in ``out`` goes on when called again. The
    result does not depend on ``chunk`` (Jacobians, about), threads or executor, to the last bit.
    OptionError if curves that are to be kept are larger.
    """
    for name, number in (("worst", worst), ("candidates", candidates), ("chunk", chunk)):
        OptionError.refuse_if(
            number is not None and number < 1, f"{name} must be at least 1, got {number}"
        )
    kept = keep is not False and check_keep(plan, keep)
    if chunk is None:
        most = _CHUNK_ON_DISK if kept else 524_288  # in 256 chunks, without the curves
        chunk = max(_CHUNK if out is None else _CHUNK_ON_DISK, min(most, plan.n_jacobians // 256))
    block = _curves_per_block(plan.samples)
    size = max(1, chunk // plan.samples // block) * block
    on = planned_batch(arm, out, engine)
    job = SweepJob(plan, on, int(size), kept, int(worst), int(candidates))
    sigma, ratio = measured(job.batch, plan.uniform)
    uniform = tuple(
        UniformRow(value, sigma_min, sigma_ratio, status_of(sigma_ratio))
        for value, sigma_min, sigma_ratio in zip(
            plan.uniform_values.tolist(), sigma[:, -1].tolist(), ratio.tolist(), strict=True
        )
    )
    table, tally, pool = job.table, Tally(job.worst), Pool(job.candidates)
    values = np.full((2, job.count if kept else 0), np.nan)  # of curves that have come in
    notes = list(plan.notes)

    def take(start: int, record: Record) -> None:
        tally.join(record)
        pool.join(record)
        for row, name in zip(values, VALUES if kept else (), strict=False):
            row[start : start + len(record[name])] = record[name]

    with running(job, out, threads, executor, parallel, progress, tell) as run:
        if not run.reduce(take, len(uniform)):
            notes.append(f"stopped after {run.done // plan.samples} of {len(table)} curves")
        found = pool.candidates(plan.samples)
        if found.found > len(found):
            notes.append(
                f"{found.found:,} dips of sigma_min, of which {len(found):,} are refined: "
                "the smallest of each combination of joints, spread over their ranges"
            )
        if not kept and keep is not False:
            need = _size(16 * plan.n_jacobians)
            notes.append(f"the curves are not part of the result: they take {need}")
        summary = None
        if tally.done:
            spread = distributions(tally, table.configuration)
            points = worst_points(tally, table.configuration)
            summary = SweepSummary(tally.done, tally.singular, tally.near, *spread, points)
        x = axis_values(table.ranges, plan.samples, np.arange(plan.samples)[None])
        last, ratio = values.reshape(2, -1, plan.samples)
        there = np.flatnonzero(~np.isnan(last[:, 0]))
        curves = curves_of(table, there, x, (last[i] for i in there), (ratio[i] for i in there))
        result = SweepResult(
            plan=plan,
            uniform=uniform,
            curves=tuple(curves),
            complete=run.done == job.count,
            notes=tuple(notes),
            engine=job.batch.engine,
            kept=kept,
            done=len(uniform) + run.done,
            summary=summary,
            candidates=found,
        )
        if run.folder is not None and result.complete:
            run.folder.write_bytes(run.folder.path / CURVES, pack_sweep(result))
    return result


def check_keep(plan: SweepPlan, keep: bool | None) -> bool:
    """Return True if the curves of ``plan`` fit into a result."""
    need = 16 * plan.n_jacobians
    OptionError.refuse_if(
        need > KEEP_BYTES and keep,
        f"the curves of {plan.n_jacobians:,} Jacobians take {_size(need)}, and a result holds "
        f"at most {_size(KEEP_BYTES)}; sweep fewer of them",
    )
    return need <= KEEP_BYTES


def _size(need: int) -> str:
    return f"{need / 2**30:.3g} GiB" if need >= 2**30 else f"{need / 2**20:.3g} MiB"


_ROOM = 1024 * MEBIBYTE  # bytes that a saved sweep may take


def save_npz(result: SweepResult, path: str | os.PathLike[str]) -> Path:
    """Write a sweep to ``path`` (``.npz``), readable with ``numpy.load`` alone, or nothing.

    Arrays, for C curves of S samples of an arm of n joints: ``number`` (C,), ``level`` (C,),
    ``moving`` (C,), ``forced`` (C,), ``fixed`` (C, n) with NaN where a joint is not at a special
    value, ``x`` (n, S), ``sigma_min`` and ``sigma_ratio`` (C, S), ``header`` (JSON text). If the
    curves are not part of the result, C and S are 0.
    """
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    write_bytes(target, pack_sweep(result))
    return target


def load_npz(path: str | os.PathLike[str]) -> SweepResult:
    """Return what ``save_npz`` wrote; ResultError if it is missing, damaged, or something else."""
    try:
        arrays: dict[str, Any] = dict(
            read_arrays(read_bounded(Path(path), _ROOM, follow=True), _ROOM)
        )
        header: dict[str, Any] = json.loads(arrays["header"].item())
        bare = SweepResult.from_dict(header)
        values = (arrays[name] for name in ("number", "x", "sigma_min", "sigma_ratio"))
        curves = tuple(curves_of(CurveTable(bare.plan), *values))
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None
    except (KeyError, IndexError, TypeError, ValueError, RecursionError, DamagedError) as error:
        if isinstance(error, ResultError):
            raise ResultError(f"{path}: {error}") from None
        raise ResultError(f"{path} is not a saved sweep, or is damaged: {error}") from None
    return replace(bare, curves=curves)
