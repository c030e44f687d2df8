"""From the distributions of a sweep to singular configurations, stated and generalised.

Beyond the paper: every dip of every curve is refined to machine accuracy, on the nominal
geometry; duplicates are merged; and each configuration is generalised to the joint values,
or the relation between joints, that it is an instance of.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.arguments import checked, whole_number
from pinsing.configuration.refine import (
    SingularConfiguration,
    approach,
    describe,
    describe_many,
    walk,
)
from pinsing.errors import OptionError
from pinsing.kinematics.verdict import NEAR_RTOL, SINGULAR_RTOL, ratios
from pinsing.measures import Reachability
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import ANGLE_TOL, nominal
from pinsing.sampling.curves import CurveTable
from pinsing.sampling.generalize import SAMPLES, ConditionTester, Finding, JointCondition
from pinsing.sampling.sweep_result import SweepResult

_ON = 1e-6  # radians or metres: a value this near to a fixed one is that one
_SAME_RELATION = 1e-2  # the same beside a relation: near it, a raw geometry blurs the values
_CANDIDATES = 12  # configurations looked at for a representative
_BATCH = 4096  # walks at a time


MAX_STARTS = 10_000_000


@dataclass(frozen=True, eq=False)
class _Points:
    """Ends of walks: q (P, n), sigma_r / sigma_1 (P,), curve index or -1 (P,).

    ``at`` (P,) is the value of the curve's moving joint where the curve itself is zero, else NaN.
    """

    q: Array
    ratio: Array
    curve: npt.NDArray[np.intp]
    at: Array

    def where(self, mask: Bool) -> _Points:
        return _Points(self.q[mask], self.ratio[mask], self.curve[mask], self.at[mask])


@checked
def singular_configurations(
    arm: Arm,
    result: SweepResult,
    *,
    samples: int = SAMPLES,
    random_starts: int = 0,
    geometry: Arm | None = None,
    until: float = math.inf,
) -> tuple[Finding, ...]:
    """State what a sweep of ``arm`` has found.

    Parameters
    ----------
    arm : Arm
        The arm that was swept.
    result : SweepResult
        Its sweep, complete or not.
    samples : int
        Random values of the other joints that each condition is tested at.
    random_starts : int
        Refine that many random configurations as well, beside the dips.
    geometry : Arm, optional
        Geometry to refine and test on, instead of the nominal one of ``arm``.
    until : float
        Time of ``time.monotonic()`` at which no further dip is refined or generalised: then what
        was found by then is returned.

    Returns
    -------
    tuple of Finding
        Joint values first, fewest first; then relations; then near-singular valleys.

    Raises
    ------
    OptionError
        If the sweep is of an arm with other joints, or a number makes no sense.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r")
    >>> pinsing.sampling.singular_configurations(arm, pinsing.sampling.sweep(arm))[0]
    <Finding: q2 = 0, whatever the others (boundary)>
    """
    plan = result.plan
    if plan.arm.joints != arm.joints:
        raise OptionError(
            f"the sweep is of {plan.arm.name} ({', '.join(plan.arm.joints)}), not of {arm.name} "
            f"({', '.join(arm.joints)}): sweep the same arm"
        )
    exact = nominal(arm).arm if geometry is None else geometry
    tester = ConditionTester(exact, plan.relevant, samples, SINGULAR_RTOL, plan.seed)
    whole_number(random_starts, "random_starts", 0, MAX_STARTS)
    points = _refined(exact, result, random_starts, until)
    sharp = points.ratio <= SINGULAR_RTOL
    collector = _Collector(arm, exact, result, tester, points.where(sharp))
    table = CurveTable(plan)
    for fixed in plan.forced:
        held = tuple(arm.joints.index(name) for name in fixed)
        values = np.zeros(arm.n)
        values[list(held)] = list(fixed.values())
        collector.add(tester.condition(held, values), table.of_set(fixed))
    collector.explain(until)
    findings = collector.findings(until)
    blunt = points.where(~sharp & (points.ratio <= NEAR_RTOL))
    findings += _valleys(arm, exact, result, blunt, findings, samples, until)
    return tuple(findings)


def _refined(exact: Arm, result: SweepResult, random_starts: int, until: float) -> _Points:
    """Ends of the walks from all dips, uniform rows that are not regular, and random starts."""
    plan = result.plan
    relevant = np.isin(np.arange(exact.n), plan.relevant)
    table, dips = CurveTable(plan), result.candidates
    starts = table.configurations(dips.curve, dips.sample)
    moving = table.rows(dips.curve).moving[:, None] == np.arange(exact.n)
    along = _along(exact, starts, moving, plan.ignore_limits, until)
    extra = [
        q for q, row in zip(plan.uniform, result.uniform, strict=True) if row.status != "regular"
    ]
    rng = np.random.default_rng(plan.seed)
    extra += list(exact.space.sample(random_starts, rng, plan.ignore_limits))
    q = np.array([*along, *extra]).reshape(-1, exact.n)
    ratio = ratios(exact, q)
    at = np.full(len(q), np.nan)
    on = np.flatnonzero(ratio[: len(dips.curve)] <= SINGULAR_RTOL)
    at[on] = q[on, table.rows(dips.curve).moving[on]]
    # What stays blunt along its own curve may still be near a singularity of all joints.
    blunt = np.flatnonzero(ratio > SINGULAR_RTOL)
    for some in _batches(blunt):
        if time.monotonic() > until:
            break
        ends = walk(exact, q[some], relevant, plan.ignore_limits)
        q[some], ratio[some] = ends.q, ends.ratio
    curves = np.concatenate([dips.curve, np.full(len(extra), -1)]).astype(np.intp)
    return _Points(exact.fold(q), ratio, curves, at)


def _along(exact: Arm, starts: Array, moving: Bool, ignore_limits: bool, until: float) -> Array:
    """Refine each start along its own moving joint: special values stay what they are."""
    found = starts.copy()
    for some in _batches(np.arange(len(starts))):
        if time.monotonic() > until:
            break
        ends = approach(exact, starts[some], moving[some], bounded=not ignore_limits)
        found[some] = np.where(ends.singular[:, None], ends.q, starts[some])
    return found


def _batches(rows: npt.NDArray[np.intp]) -> Iterator[npt.NDArray[np.intp]]:
    """Rows, some at a time: the derivatives of many would fill the memory."""
    for start in range(0, len(rows), _BATCH):
        yield rows[start : start + _BATCH]


class _Collector:
    """Gathers conditions, and which of the singular points lie on them."""

    def __init__(
        self, arm: Arm, exact: Arm, result: SweepResult, tester: ConditionTester, points: _Points
    ) -> None:
        self.arm, self.exact, self.result, self.tester = arm, exact, result, tester
        self.points = points
        self.explained = np.zeros(len(points.q), dtype=bool)
        self.conditions: list[JointCondition] = []
        self.curves: list[list[int]] = []
        self.members: list[npt.NDArray[np.intp]] = []

    def add(self, condition: JointCondition, curves: Iterable[int] = ()) -> None:
        """Record a condition, unless it is known, and all points that lie on it."""
        for known, where in zip(self.conditions, self.curves, strict=True):
            # conditions whose values agree to this are one
            if condition.same_as(known, _SAME_RELATION if condition.related else 1e-5):
                where += curves
                return
        tol = _SAME_RELATION if condition.related else _ON
        mask = on_condition(self.exact, condition, self.points.q, tol)
        if condition.related:
            rows = np.flatnonzero(mask & ~self.explained)
            mask[:] = False
            mask[rows] = self._related(condition, self.points.q[rows])
        members = np.flatnonzero(mask)
        self.explained |= mask
        self.conditions.append(condition)
        self.members.append(members)
        self.curves.append([*curves, *(c for c in self.points.curve[members].tolist() if c >= 0)])

    def _related(self, condition: JointCondition, Q: Array) -> Bool:
        """Which of Q (P, n) owe their singularity to all joints of a relation, and no fewer."""
        held = tuple(self.exact.joints.index(name) for name in condition.depends_on)

        def forced(subset: tuple[int, ...]) -> Bool:
            worst = self.tester.worst_ratios([subset] * len(Q), Q, 6)
            # sigma_r / sigma_1 of a member of a relation, from refined values
            return np.asarray(worst <= 1e-6)

        fewer = itertools.combinations(held, len(held) - 1)
        return np.asarray(forced(held) & ~np.any([forced(s) for s in fewer], axis=0))

    def explain(self, until: float = math.inf) -> None:
        """Generalise points until every one lies on a condition.

        On a raw geometry with rounded angles hardly a point does, to the tolerance: then, when
        many in a row have brought nothing new, the others are taken for more of the same.
        """
        idle = 0
        for i in range(len(self.points.q)):
            # points in a row without a new condition
            if self.explained[i] or idle >= 50 or time.monotonic() > until:
                continue
            before = len(self.conditions)
            for condition in self.tester.conditions(self.tester.snap(self.points.q[i])):
                self.add(condition)
            self.explained[i] = True
            idle = 0 if len(self.conditions) > before else idle + 1

    def findings(self, until: float = math.inf) -> list[Finding]:
        """One a condition, in the order of print."""
        found: list[Finding] = []
        for condition, curves, rows in zip(self.conditions, self.curves, self.members, strict=True):
            if found and time.monotonic() > until:
                break
            candidates, reachable = self._candidates(condition, rows)
            chosen = _representative(self.exact, candidates)
            found.append(
                Finding(
                    status="singular",
                    condition=condition,
                    configuration=chosen,
                    raw_ratio=float(ratios(self.arm, chosen.q)[0]),
                    reachability=Reachability.of(reachable),
                    seen=len(curves),
                    curves=tuple(dict.fromkeys(curves)),
                    zeros=tuple(
                        (int(self.points.curve[i]), float(self.points.at[i]))
                        for i in rows.tolist()
                        if np.isfinite(self.points.at[i])
                    ),
                )
            )
        return sorted(found, key=lambda f: _order(self.arm, f))

    def _candidates(
        self, condition: JointCondition, rows: npt.NDArray[np.intp]
    ) -> tuple[Array, bool | None]:
        """Members of a condition, within the limits if there are any; and whether there are."""
        exact, rng = self.exact, np.random.default_rng(self.result.plan.seed)
        rest = np.clip(exact.fold(self.result.plan.nominal), exact.lower, exact.upper)
        Q = np.concatenate([rest[None], exact.space.sample(_CANDIDATES - 1, rng)])
        fixed = [exact.joints.index(name) for name in condition.fixed]
        Q[:, fixed] = list(condition.fixed.values())
        Q = exact.fold(Q)
        held = np.where(np.isin(np.arange(exact.n), fixed), Q[0], rest)
        inside = bool(exact.within_limits(held, ANGLE_TOL))  # a rounded limit is met
        if not condition.related:
            return Q, inside
        seen = exact.fold(self.points.q[rows])
        met = seen[exact.within_limits(seen)]
        if len(met):
            return met[:_CANDIDATES], True
        related = [exact.joints.index(name) for name in condition.related]
        bounded = inside
        ends = approach(exact, Q, np.isin(np.arange(exact.n), related), bounded)
        tried = exact.fold(ends.q[ends.singular])
        if inside and len(tried):
            return tried, True
        elsewhere = seen[:_CANDIDATES] if len(seen) else tried
        if not len(elsewhere):
            values = rest.copy()
            values[[exact.joints.index(name) for name in condition.forced_by]] = list(
                condition.forced_by.values()
            )
            elsewhere = values[None]
        return elsewhere, None if inside else False


def on_condition(
    arm: Arm, condition: JointCondition, Q: Array, tol: float = _ON
) -> npt.NDArray[np.bool_]:
    """Tell for Q (P, n) whether the fixed joints have their values, whole turns aside."""
    joints = [arm.joints.index(name) for name in condition.fixed]
    wanted = np.zeros(arm.n)
    wanted[joints] = list(condition.fixed.values())
    return np.asarray((np.abs(arm.space.wrap(Q - wanted))[:, joints] <= tol).all(axis=1))


def _representative(exact: Arm, Q: Array) -> SingularConfiguration:
    """The first of Q (P, n) that loses one rank only and is boundary or interior, if any."""
    described = describe_many(exact, Q[:_CANDIDATES])
    simple = [c for c in described if c.rank == c.generic_rank - 1]
    decided = [c for c in simple if c.kind != "undecided"]
    return (decided or simple or described)[0]


def _valleys(
    arm: Arm,
    exact: Arm,
    result: SweepResult,
    points: _Points,
    known: list[Finding],
    samples: int,
    until: float = math.inf,
) -> list[Finding]:
    """Near-singular dips that lead to no singularity, deepest first, each stated once."""
    beside = np.zeros(len(points.q), dtype=bool)
    for finding in known:
        if finding.condition.minimal:
            # a mere dip this near to a singular condition belongs to it
            beside |= on_condition(exact, finding.condition, points.q, 0.02)
    points = points.where(~beside)
    points = _Points(*(a[np.argsort(points.ratio, kind="stable")] for a in vars(points).values()))
    plan = result.plan
    tester = ConditionTester(exact, plan.relevant, samples, NEAR_RTOL, plan.seed)
    left = np.ones(len(points.q), dtype=bool)
    found: list[Finding] = []
    # at most twelve near-singular valleys are stated
    while left.any() and len(found) < 12 and time.monotonic() <= until:
        i = int(np.flatnonzero(left)[0])
        left[i] = False
        for condition in tester.plain_conditions(points.q[i]):
            # near-singular valleys are wide
            rows = on_condition(exact, condition, points.q, 0.05)
            left &= ~rows
            chosen = describe(exact, points.q[i])
            curves = [c for c in points.curve[rows].tolist() if c >= 0]
            found.append(
                Finding(
                    status="near-singular",
                    condition=condition,
                    configuration=chosen,
                    raw_ratio=float(ratios(arm, chosen.q)[0]),
                    reachability=Reachability.of(True if chosen.within_limits else None),
                    seen=int(rows.sum()),
                    curves=tuple(dict.fromkeys(curves)),
                )
            )
    return found


def _order(arm: Arm, finding: Finding) -> tuple[object, ...]:
    condition = finding.condition
    places = tuple(arm.joints.index(name) for name in condition.depends_on)
    values = tuple((abs(v), v < 0) for v in condition.fixed.values())
    return (bool(condition.related), len(places), places, values)
