"""The making of a plan: what each joint does, which sets of special values there are.

Steps (1) and (2) of the paper's joint-angle parameterization method (Section 3.2), and the
list of combinations for steps (2) to (4), level by level.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import MAX_SEED, checked, whole_number
from pinsing.errors import OptionError
from pinsing.kinematics.batch import batch
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.verdict import generic_rank, scale_notes
from pinsing.robot.arm import Arm
from pinsing.robot.arm_summary import summarize
from pinsing.robot.nominal import nominal as nominal_geometry
from pinsing.sampling.generalize import ConditionTester, random_configurations
from pinsing.sampling.special_values import (
    SPECIAL_ANGLES,
    Special,
    choose_nominal,
    moving_ranges,
    special_values,
    uniform_configurations,
)
from pinsing.sampling.sweep_plan import (
    MOVES_TIP,
    NO_EFFECT,
    NOT_ASKED,
    NOT_CHANGING,
    NOT_CHANGING_BOTH,
    SAMPLES,
    JointEffect,
    PlannedLevel,
    SweepOptions,
    SweepPlan,
)

LEVELS = (1, 2)
"""Levels of a sweep unless asked otherwise: cheap, and enough for most arms."""

_EFFECT_SAMPLES = 33
_EFFECT_STARTS = 4
_MAX_SETS = 500_000
_MAX_SAMPLES = 10_000_000  # finer, neighbours differ by rounding where a curve is level
_SCREEN_CHUNK = 4096


@checked
def plan_sweep(
    arm: Arm,
    nominal: npt.ArrayLike | None = None,
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
    >>> pinsing.plan_sweep(pinsing.load("planar3r"))
    <SweepPlan: 3 curves, 547 Jacobians; special values: 4 of 1 joint>
    """
    options = SweepOptions(nominal, special, levels, samples, joints, ignore_limits, prune, seed)
    return planned_sweep(arm, options, geometry)


def planned_sweep(arm: Arm, options: SweepOptions, geometry: Arm | None = None) -> SweepPlan:
    """As `plan_sweep`, of options that travel together."""
    samples, ignore_limits, seed = options.samples, options.ignore_limits, options.seed
    if not 3 <= samples <= _MAX_SAMPLES:
        raise OptionError(
            f"a curve needs at least 3 samples, and at most {_MAX_SAMPLES:,}; got {samples}"
        )
    exact = nominal_geometry(arm).arm if geometry is None else geometry
    asked = _levels(options.levels, arm.n)
    chosen = _joints(arm, options.joints)
    rng = np.random.default_rng(whole_number(seed, "seed", 0, MAX_SEED))
    notes = list(scale_notes(arm))
    q, origin = choose_nominal(arm, options.nominal, ignore_limits, rng)
    ranges = moving_ranges(arm, ignore_limits, notes)
    values = special_values(arm, options.special, ignore_limits, notes)
    uniform = uniform_configurations(arm, q, options.special, ignore_limits, notes)
    effects = _effects(arm, exact, q, chosen, values, ranges, rng, notes)
    planned = _combinations(exact, effects, asked, options.prune, seed)
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
        prune=options.prune,
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
    if not asked or asked[0] < 1 or asked[-1] > n - 1:
        raise OptionError(
            f"levels must lie between 1 and {n - 1} for {n} joints, got "
            f"{', '.join(map(str, asked)) or 'none'}"
        )
    return asked


def _joints(arm: Arm, joints: Sequence[str] | None) -> tuple[int, ...]:
    if joints is None:
        return tuple(range(arm.n))
    return tuple(sorted({arm.space.index(name) for name in joints}))


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
    """Which joints change sigma_r, by their curves from q and from random configurations."""
    bases = np.concatenate([q[None], random_configurations(arm, _EFFECT_STARTS, rng)])
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
        elif change[i] <= NO_EFFECT:
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
    """Sets of special values level by level, with the test whether they force a singularity.

    Lower levels than asked for are tested too, so that forced sets are minimal.
    """
    swept = [i for i, effect in enumerate(effects) if effect.swept]
    counts = [1]  # elementary symmetric polynomials of the numbers of special values
    for i in swept:
        k = len(effects[i].special)
        counts = [a + k * b for a, b in zip([*counts, 0], [0, *counts], strict=True)]
    top = min(max(asked, default=0), len(swept))
    total = sum(counts[1 : top + 1])
    if total > _MAX_SETS:
        raise OptionError(
            f"{total:,} sets of special values are too many (at most {_MAX_SETS:,}); "
            "choose fewer levels or joints"
        )
    tester = ConditionTester(exact, range(0), seed=seed)
    found: list[frozenset[tuple[int, float]]] = []
    planned = []
    for level in range(1, top + 1):
        sets = [
            tuple(zip(js, vs, strict=True))
            for js in itertools.combinations(swept, level)
            for vs in itertools.product(*(effects[j].special.tolist() for j in js))
        ]
        new = np.array([not any(f <= set(s) for f in found) for s in sets], dtype=bool)
        if prune:
            sets, new = [s for s, n in zip(sets, new, strict=True) if n], new[new]
        js = np.array([[j for j, _ in s] for s in sets], dtype=np.intp).reshape(-1, level)
        vs = np.array([[v for _, v in s] for s in sets], dtype=float).reshape(-1, level)
        forced = new & _forced(tester, js, vs, new)
        found += [frozenset(s) for s, f in zip(sets, forced, strict=True) if f]
        planned.append(PlannedLevel(level, js, vs, forced, level in asked))
    return tuple(planned)


def _forced(
    tester: ConditionTester,
    joints: npt.NDArray[np.intp],
    values: Array,
    ask: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Which sets (S, k) are singular whatever the others; only those to ``ask`` of are tested."""
    forced = np.zeros(len(joints), dtype=bool)
    rows = np.flatnonzero(ask)
    for start in range(0, len(rows), _SCREEN_CHUNK):
        chunk = rows[start : start + _SCREEN_CHUNK]
        full = np.zeros((len(chunk), tester.arm.n))
        np.put_along_axis(full, joints[chunk], values[chunk], axis=1)
        subsets = [tuple(row) for row in joints[chunk].tolist()]
        forced[chunk] = tester.worst_ratios(subsets, full, 2) <= tester.rtol
    for i in np.flatnonzero(forced):
        full_row = np.zeros(tester.arm.n)
        full_row[joints[i]] = values[i]
        forced[i] = tester.forces(tuple(joints[i].tolist()), full_row)
    return forced
