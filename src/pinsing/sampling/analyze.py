"""analyze: closed forms and the paper's sweep on one arm, each checking the other."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias

import numpy as np

from pinsing.algebra.budget import Stages
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, Family, closed_form
from pinsing.families.form import answer_text, families_text
from pinsing.interface import MAX_SEED, MAX_STARTS, JsonResult, checked, whole_number
from pinsing.kinematics.jacobian import NEAR_RTOL, SINGULAR_RTOL, measure, ratios
from pinsing.kinematics.refine import (
    approach,
    describe,
    describe_many,
    walk,
)
from pinsing.measures import ALIKE, PRACTICAL, Array, ArrayLike, Bool, NDArray
from pinsing.notebook import verdict
from pinsing.prose import PLAIN, Page, Span, alarm, caution, html_text as text, unbroken
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import ANGLE_TOL, nominal, nominal as nominal_geometry
from pinsing.sampling.generalize import (
    DRAWS,
    ConditionTester,
    Finding,
    JointCondition,
    finding_spans,
    held,
)
from pinsing.sampling.sweeps import (
    SAMPLES,
    SPECIAL_ANGLES,
    CurveTable,
    Special,
    SweepResult,
    sweep,
)
from pinsing.sampling.tally import BLOCK

_SAME_RELATION = 1e-2  # the same beside a relation: near it, a raw geometry blurs the values
_CANDIDATES = 12  # configurations looked at for a representative


_Points: TypeAlias = Any
"""Ends of walks, P records: ``q`` (n,), ``ratio``, ``curve`` (its number, or -1), and ``at``: its
moving joint where the curve itself is zero, else NaN."""


@checked
def singular_configurations(
    arm: Arm,
    result: SweepResult,
    *,
    samples: int = DRAWS,
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
    OptionError.refuse_if(
        plan.arm.joints != arm.joints,
        f"the sweep is of {plan.arm.name} ({', '.join(plan.arm.joints)}), not of {arm.name} "
        f"({', '.join(arm.joints)}): sweep the same arm",
    )
    exact = nominal(arm).arm if geometry is None else geometry
    tester = ConditionTester(exact, plan.relevant, samples, SINGULAR_RTOL, plan.seed)
    whole_number(random_starts, "random_starts", 0, MAX_STARTS)
    points = _refined(exact, result, random_starts, until)
    sharp = points.ratio <= SINGULAR_RTOL
    collector = _Collector(arm, exact, result, tester, points[sharp])
    for row, curves in CurveTable(plan).forced():
        collector.add(tester.condition(row), curves)
    collector.explain(until)
    findings = collector.findings(until)
    blunt = points[~sharp & (points.ratio <= NEAR_RTOL)]
    findings += _valleys(arm, exact, result, blunt, findings, samples, until)
    return tuple(findings)


def _refined(exact: Arm, result: SweepResult, random_starts: int, until: float) -> _Points:
    """Ends of the walks from all dips, uniform rows that are not regular, and random starts."""
    plan, table, dips = result.plan, CurveTable(result.plan), result.candidates
    moving = table.rows(dips.curve).moving
    along = table.configurations(dips.curve, dips.sample)
    # Along its own moving joint at first: special values stay what they are.
    for some in _batches(np.arange(len(along)), until):
        only = moving[some, None] == np.arange(exact.n)
        ends = approach(exact, along[some], only, bounded=not plan.ignore_limits)
        along[some] = np.where(ends.singular[:, None], ends.q, along[some])
    extra = [
        q for q, row in zip(plan.uniform, result.uniform, strict=True) if row.status != "regular"
    ]
    rng = np.random.default_rng(plan.seed)
    extra += list(exact.space.sample(random_starts, rng, plan.ignore_limits))
    q = np.array([*along, *extra]).reshape(-1, exact.n)
    ratio = ratios(exact, q)
    at = np.full(len(q), np.nan)
    on = np.flatnonzero(ratio[: len(along)] <= SINGULAR_RTOL)
    at[on] = q[on, moving[on]]
    # What stays blunt along its own curve may still be near a singularity of all joints.
    relevant = np.isin(np.arange(exact.n), plan.relevant)
    for some in _batches(np.flatnonzero(ratio > SINGULAR_RTOL), until):
        ends = walk(exact, q[some], relevant, plan.ignore_limits)
        q[some], ratio[some] = ends.q, ends.ratio
    curves = np.concatenate([dips.curve, np.full(len(extra), -1)]).astype(np.intp)
    kinds = [("q", float, (exact.n,)), ("ratio", float), ("curve", np.intp), ("at", float)]
    return np.rec.fromarrays([exact.fold(q), ratio, curves, at], dtype=kinds)


def _batches(rows: NDArray[np.intp], until: float) -> Iterator[NDArray[np.intp]]:
    """Rows, some at a time, as long as there is time: derivatives of many would fill the memory."""
    for start in range(0, len(rows), BLOCK):
        if time.monotonic() <= until:
            yield rows[start : start + BLOCK]


class _Collector:
    """Gathers conditions, and which of the singular points lie on them."""

    def __init__(
        self, arm: Arm, exact: Arm, result: SweepResult, tester: ConditionTester, points: _Points
    ) -> None:
        self.arm, self.exact, self.result, self.tester = arm, exact, result, tester
        self.points = points
        self.explained = np.zeros(len(points.q), dtype=bool)
        # Each condition, the curves that led to it, and the points that lie on it.
        self.known: list[tuple[JointCondition, list[int], NDArray[np.intp]]] = []

    def add(self, condition: JointCondition, curves: Iterable[int] = ()) -> None:
        """Record a condition, unless it is known, and all points that lie on it."""
        for known, where, _ in self.known:
            # conditions whose values agree to this are one
            if condition.same_as(known, _SAME_RELATION if condition.related else 1e-5):
                where += curves
                return
        tol = _SAME_RELATION if condition.related else ALIKE
        mask = on_condition(self.exact, condition, self.points.q, tol)
        if condition.related:
            rows = np.flatnonzero(mask & ~self.explained)
            mask[:] = False
            mask[rows] = self._related(condition, self.points.q[rows])
        members = np.flatnonzero(mask)
        self.explained |= mask
        seen = [c for c in self.points.curve[members].tolist() if c >= 0]
        self.known.append((condition, [*curves, *seen], members))

    def _related(self, condition: JointCondition, Q: Array) -> Bool:
        """Which of Q (P, n) owe their singularity to all joints of a relation, and no fewer."""
        joints = tuple(self.exact.joints.index(name) for name in condition.depends_on)

        def forced(subset: tuple[int, ...]) -> Bool:
            # sigma_r / sigma_1 of a member of a relation, from refined values
            return np.asarray(self.tester.worst_ratios(held(Q, subset), 6) <= 1e-6)

        fewer = itertools.combinations(joints, len(joints) - 1)
        return np.asarray(forced(joints) & ~np.any([forced(s) for s in fewer], axis=0))

    def explain(self, until: float = math.inf) -> None:
        """Generalise points until every one lies on a condition."""
        # On rounded geometries hardly a point does: after many in a row without news, the rest is
        # taken for more of the same.
        idle = 0
        for i in range(len(self.points.q)):
            # points in a row without a new condition
            if self.explained[i] or idle >= 50 or time.monotonic() > until:
                continue
            before = len(self.known)
            for condition in self.tester.conditions(self.tester.snap(self.points.q[i])):
                self.add(condition)
            self.explained[i] = True
            idle = 0 if len(self.known) > before else idle + 1

    def findings(self, until: float = math.inf) -> list[Finding]:
        """One a condition, in the order of print."""
        found: list[Finding] = []
        for condition, curves, rows in self.known:
            if found and time.monotonic() > until:
                break
            candidates, reachable = self._candidates(condition, rows)
            # The first that loses one rank only and is boundary or interior, if any.
            described = describe_many(self.exact, candidates[:_CANDIDATES])
            simple = [c for c in described if c.rank == c.generic_rank - 1]
            decided = [c for c in simple if c.kind != "undecided"]
            chosen = (decided or simple or described)[0]
            found.append(
                Finding(
                    status="singular",
                    condition=condition,
                    configuration=chosen,
                    raw_ratio=float(ratios(self.arm, chosen.q)[0]),
                    reachable=reachable,
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
        self, condition: JointCondition, rows: NDArray[np.intp]
    ) -> tuple[Array, bool | None]:
        """Members of a condition, within the limits if there are any; and whether there are."""
        exact, rng = self.exact, np.random.default_rng(self.result.plan.seed)
        rest = np.clip(exact.fold(self.result.plan.nominal), exact.lower, exact.upper)
        others = np.concatenate([rest[None], exact.space.sample(_CANDIDATES - 1, rng)])
        row = row_of(condition.fixed, exact)
        Q = exact.fold(np.where(np.isnan(row), others, row))
        first = np.where(np.isnan(row), rest, Q[0])
        inside = bool(exact.within_limits(first, ANGLE_TOL))  # a rounded limit is met
        if not condition.related:
            return Q, inside
        found = exact.fold(self.points.q[rows])
        if not exact.within_limits(found).any():
            ends = approach(exact, Q, np.isin(exact.joints, condition.related), inside)
            forced = row_of(condition.forced_by, exact)
            alone = np.where(np.isnan(forced), rest, forced)
            found = np.concatenate([found, exact.fold(ends.q[ends.singular]), alone[None]])
        met = found[exact.within_limits(found)]
        if len(met):
            return met[:_CANDIDATES], True
        return found[:_CANDIDATES], None if inside else False


def on_condition(arm: Arm, condition: JointCondition, Q: Array, tol: float = ALIKE) -> Bool:
    """Tell for Q (P, n) whether the fixed joints have their values, whole turns aside."""
    row = row_of(condition.fixed, arm)
    off = np.abs(arm.space.wrap(Q - row))
    return np.asarray((np.isnan(row) | (off <= tol)).all(axis=1))


def row_of(values: Mapping[str, float], arm: Arm) -> Array:
    """Values by joint as a row (n,), NaN where a joint has none."""
    return np.array([values.get(name, np.nan) for name in arm.joints])


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
    points = points[~beside]
    points = points[np.argsort(points.ratio, kind="stable")]
    plan = result.plan
    tester = ConditionTester(exact, plan.relevant, samples, NEAR_RTOL, plan.seed)
    left = np.ones(len(points.q), dtype=bool)
    found: list[Finding] = []
    # at most twelve near-singular valleys are stated
    while left.any() and len(found) < 12 and time.monotonic() <= until:
        i = int(np.flatnonzero(left)[0])
        left[i] = False
        for condition in map(tester.stated, tester.minimal_sets(tester.snap(points.q[i]))):
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
                    reachable=True if chosen.within_limits else None,
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


@dataclass(frozen=True, eq=False)
class FamilyCheck:
    """What Pinocchio says of configurations sampled on a family."""

    family: str  # its name
    samples: int  # configurations, over whole circles
    # largest sigma_r / sigma_1 on the nominal geometry; singular if within SINGULAR_RTOL
    nominal_ratio: float
    # raw_ratio and raw_sigma_min: largest sigma_r / sigma_1, and sigma_r, on the geometry of the
    # file
    raw_ratio: float
    raw_sigma_min: float


@dataclass(frozen=True, eq=False)
class RandomSearch:
    """Singular configurations that were looked for without any plan or algebra."""

    starts: int  # random configurations within the limits that were refined
    singular: int  # how many became singular to SINGULAR_RTOL
    # how many of those lie on a family, or in a valley of sigma_r so flat that the zero next to
    # them does
    on_family: int
    off: tuple[Array, ...]  # the others


@dataclass(frozen=True, eq=False)
class Analysis(JsonResult):
    """Everything found about the singular configurations of an arm.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    geometry : str
        "both" (curves on the raw geometry, families and tests on the nominal one), "raw" or
        "nominal" (everything on one).
    closed_form : ClosedForm
        The families.
    findings : tuple of Finding
        What the sweep found, refined and generalised.
    family_of : tuple of str
        Name of the family of each finding, or an empty string.
    checks : tuple of FamilyCheck
        Samples of each family, judged by Pinocchio.
    random_search : RandomSearch
        The search that is independent of both.
    jacobians : int
        Jacobians that the sweep took.
    sweep_complete : bool
        False if the sweep was stopped.
    notes : tuple of str
        Notes of the sweep.
    problems : tuple of str
        Contradictions: each is a bug of pinsing, or of the file; empty if all agree.
    seconds : float
        Time it took.
    missing : tuple of str
        Stages that were cut short, by the time or by Ctrl-C.
    sweep : SweepResult or None
        The curves; not written to JSON.
    """

    schema: ClassVar[str] = "pinsing/analysis/1"
    made_by: ClassVar[str] = "pinsing.analyze(arm)"

    arm: ArmSummary
    geometry: str
    closed_form: ClosedForm
    findings: tuple[Finding, ...]
    family_of: tuple[str, ...]
    checks: tuple[FamilyCheck, ...]
    random_search: RandomSearch
    jacobians: int
    sweep_complete: bool
    notes: tuple[str, ...]
    problems: tuple[str, ...]
    seconds: float
    missing: tuple[str, ...] = ()
    sweep: SweepResult | None = field(default=None, repr=False, metadata={"json": False})

    @property
    def families(self) -> tuple[Family, ...]:
        """The families of the closed form."""
        return self.closed_form.families

    @property
    def complete(self) -> bool:
        """True if no singular configuration can be missing."""
        return self.closed_form.complete

    @property
    def agree(self) -> bool:
        """True if closed forms, sweep and random search contradict each other nowhere."""
        return not self.problems

    @property
    def singular(self) -> bool:
        """True if a singular configuration within the joint limits is known."""
        reachable = any(f.is_reachable for f in self.families)
        return reachable or any(f.reachable and f.status == "singular" for f in self.findings)

    def __repr__(self) -> str:
        checks = "checks agree" if self.agree else "CONTRADICTIONS"
        return f"<Analysis: {repr(self.closed_form).partition(': ')[2].rstrip('>')}; {checks}>"

    def __str__(self) -> str:
        return analysis_text(self)

    def _repr_latex_(self) -> str:
        """For notebooks: the families."""
        return self.closed_form.latex()

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: the families, and whether the checks agree."""
        if self.agree:
            checks = verdict("sweep and random search agree", "good")
        else:
            checks = verdict("CONTRADICTIONS:", "alarm") + text(" " + "; ".join(self.problems))
        return f"{self.closed_form._repr_html_()}<p>{checks}</p>"


def analysis_text(
    analysis: Analysis, page: Page = PLAIN, degrees: bool = False, robot: str = ""
) -> str:
    """Families first, then how they were checked, then what was assumed."""
    arm = analysis.arm
    lines = [
        answer_text(analysis.closed_form, page, robot),
        "",
        page.paragraph(
            f"{arm.name}: {arm.n} joints, {arm.base} -> {arm.tip}, task {arm.task} "
            f"(generic rank {analysis.closed_form.generic_rank}), "
            f"length scale {unbroken(f'{arm.length_scale:g} m')}",
            rest="  ",
        ),
        "",
        families_text(analysis.closed_form, page, degrees),
    ]
    extra = [
        f
        for f, owner in zip(analysis.findings, analysis.family_of, strict=True)
        if not owner and f.status == "singular"
    ]
    if extra and not analysis.complete:
        title = "Found by the sweep beside these families:"
        lines += _points(page, title, map(finding_spans, extra))
    near = [f for f in analysis.findings if f.status == "near-singular"]
    if near:
        lines += _points(page, "Near-singular valleys:", map(finding_spans, near))
    if analysis.missing:
        lines += _points(page, caution("Missing:"), ((text,) for text in analysis.missing))
    if analysis.problems:
        bad = alarm("CONTRADICTIONS (please report them):")
        lines += _points(page, bad, ((p,) for p in analysis.problems), "  ! ")
    lines += _points(page, "Checked:", ((text,) for text in _checks(analysis)))
    notes = dict.fromkeys((*_geometry(analysis), *arm.notes, *analysis.notes))
    if notes:
        lines += _points(page, "Assumed:", ((text,) for text in notes))
    return "\n".join(lines)


def _points(
    page: Page, title: Span, texts: Iterable[tuple[Span, ...]], mark: str = "  - "
) -> list[str]:
    return ["", page.paragraph(title), *(page.paragraph(*text, first=mark) for text in texts)]


def _share(some: int, of: int) -> str:
    """``all of them``, ``none of them`` or ``3 of them``."""
    return f"{'none' if some == 0 else 'all' if some == of else some} of them"


def _checks(analysis: Analysis) -> Iterator[str]:
    found = [f for f in analysis.findings if f.status == "singular"]
    on = sum(
        bool(owner)
        for f, owner in zip(analysis.findings, analysis.family_of, strict=True)
        if f.status == "singular"
    )
    stopped = "" if analysis.sweep_complete else ", stopped before its end"
    yield (
        f"sweep of {analysis.jacobians} Jacobians{stopped}: {len(found)} singular sets found, "
        f"{_share(on, len(found))} on the families above"
    )
    search = analysis.random_search
    if search.starts:
        yield (
            f"{search.starts} random starts within the limits: {search.singular} ended at singular "
            f"configurations, {_share(search.on_family, search.singular)} on the families above"
        )
    sampled = [c for c in analysis.checks if c.samples]
    if sampled:
        worst = max(c.nominal_ratio for c in sampled)
        yield (
            f"{sum(c.samples for c in sampled)} configurations sampled from the families: "
            f"sigma_r/sigma_1 <= {worst:.1e} in Pinocchio (singular: <= {SINGULAR_RTOL:g})"
        )
        if analysis.closed_form.jacobian_change > 1e-12 and analysis.geometry == "both":
            by_family = ", ".join(
                f"{c.family} {c.raw_ratio:.1e} (sigma_min {c.raw_sigma_min:.1e})" for c in sampled
            )
            yield f"the same samples on the numbers of the file: sigma_r/sigma_1 <= {by_family}"
    yield f"{analysis.seconds:.1f} s in all"


def _geometry(analysis: Analysis) -> Iterator[str]:
    forms = analysis.closed_form
    if forms.jacobian_change <= 1e-12:
        return
    detail = ""
    # What changes the Jacobian by less is not worth naming one by one
    if forms.jacobian_change > 1e-9:
        more = f"; and {len(forms.snaps) - 3} more" if len(forms.snaps) > 3 else ""
        detail = f" ({'; '.join(forms.snaps[:3])}{more})"
    yield (
        f"families are of the nominal geometry (rounding in the file taken out), which changes no "
        f"Jacobian column by more than "
        f"{forms.jacobian_change:.1e}{detail}"
    )


_VALLEY = 1e-2
"""How far from a zero of sigma_r it may be below the tolerance."""
_BATCH = 100


def random_search(
    exact: Arm, forms: ClosedForm, starts: int, seed: int, stages: Stages
) -> RandomSearch:
    """Walk from random configurations to singular ones, and look for each on the families."""
    if starts == 0:
        return RandomSearch(0, 0, 0, ())
    rng = np.random.default_rng(seed)
    begin = exact.space.sample(starts, rng)
    reached = []
    for k in range(0, starts, _BATCH):
        if k and stages.over:
            starts = k
            break
        ends = walk(exact, begin[k : k + _BATCH])
        reached.append(ends.q[ends.ratio <= SINGULAR_RTOL])
    found = np.concatenate(reached)
    on = np.zeros(len(found), dtype=bool)
    for family in forms.families:
        if on.all():
            break
        on[~on] = family.contains(found[~on], PRACTICAL)
    # In a flat valley sigma_r is below the tolerance some way off already: the zero there decides.
    off, count = [], len(found)
    for q in found[~on]:
        if stages.over and _beside(forms, q) is not None:
            count -= 1  # no time is left to follow it
        elif not leads_down(exact, forms, q):
            off.append(q)
    return RandomSearch(starts, count, count - len(off), tuple(off))


def leads_down(exact: Arm, forms: ClosedForm, q: Array) -> bool:
    """Return True if q (n,) is in a valley of sigma_r that ends on a family nearby.

    Where sigma_r falls like a higher power of the distance, rounding hides the zero from walks. So
    the point is put back towards the family and polished, again and again: in a valley it stays, a
    zero of its own draws it back, unless that belongs to a set which meets the family here. So it
    is put away from the family first: there a valley is no zero.
    """
    where = _beside(forms, q)
    if where is not None and PRACTICAL < where[0] <= _VALLEY:
        away = where[1] + _VALLEY / where[0] * exact.space.wrap(q - where[1])
        ends = approach(exact, away)
        there = _beside(forms, ends.q[0])
        # sigma_r / sigma_1 of what is singular, with rounding
        if ends.ratio[0] <= 1e-13 and there is not None and there[0] > _VALLEY / 2:
            return False
    for _ in range(30):
        if where is None or where[0] > _VALLEY:
            return False
        distance, nearest = where
        if distance <= PRACTICAL:
            return True
        # Share of the way from a family that is left when a point is put back towards it
        ends = approach(exact, nearest + 0.7 * exact.space.wrap(q - nearest))
        q, where = ends.q[0], _beside(forms, ends.q[0])
        # Share above which it has come back to where it was
        if not ends.singular[0] or where is None or where[0] > 0.85 * distance:
            return False
    return False


def _beside(forms: ClosedForm, q: Array) -> tuple[float, Array] | None:
    """The nearest family's distance, and its point (n,), if one is near."""
    found = [f.distance(q) for f in forms.families if f.contains(q, 2 * _VALLEY)]
    best = min(found, key=lambda d: d.upper, default=None)
    return None if best is None else (best.upper, best.q)


SECONDS = 60.0
"""Time for the checks of an analysis, where nobody gives another."""


@checked
def analyze(
    arm: Arm,
    nominal: ArrayLike | None = None,
    *,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    random_starts: int = 300,
    seconds: float | None = None,
    angle_tol: float = ANGLE_TOL,
    snap_length: float = 0.0,
    geometry: str = "both",
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Analysis:
    """Find all singular configurations of an arm, twice, and compare.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    nominal, special, levels, samples, joints, ignore_limits, prune, progress
        As in ``sweep``.
    random_starts : int
        Random configurations within the limits that are refined as a third opinion.
    seconds : float, optional
        Time for all of it, of which closed forms may take a half; by default their budget is one
        of work, as that of ``closed_form``, and the checks have a minute. What there is when it is
        up, or at Ctrl-C, is returned, and ``missing`` says what is not.
    angle_tol, snap_length
        As in ``closed_form``.
    geometry : str
        "both", "raw" or "nominal".
    seed : int
        Of all random values.

    Returns
    -------
    Analysis
        Families first; contradictions, if any, in ``problems``.

    Raises
    ------
    PinsingError
        As ``sweep`` and ``closed_form``.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.analyze(pinsing.load("planar3r"))
    >>> [f.text for f in found.families], found.complete, found.agree
    (['q2 = 0° or 180°'], True, True)
    """
    OptionError.refuse_if(
        geometry not in ("both", "raw", "nominal"),
        f"geometry must be 'both', 'raw' or 'nominal', got {geometry!r}",
    )
    whole_number(random_starts, "random_starts", 0, MAX_STARTS)
    whole_number(seed, "seed", 0, MAX_SEED)
    started = time.monotonic()
    if geometry == "raw":
        angle_tol, snap_length = min(angle_tol, 1e-10), 0.0
    design = None if geometry == "raw" else arm.design
    own = arm if design is None else design  # what the families are of
    exact = nominal_geometry(own, angle_tol, snap_length).arm
    swept = exact if geometry == "nominal" else own
    given = None if seconds is None else Stages(seconds)
    half = None if seconds is None else seconds / 2
    forms = closed_form(
        arm, seconds=half, angle_tol=angle_tol, snap_length=snap_length, design=design or False
    )
    stages = given or Stages(SECONDS)
    result = stages.run(
        "sweep",
        lambda: sweep(
            swept,
            nominal,
            special,
            levels,
            samples,
            joints,
            ignore_limits,
            prune,
            stages.watched(progress),
            seed,
            exact,
        ),
        None,
    )
    nothing: tuple[Finding, ...] = ()
    findings = stages.run(
        "findings of the sweep",
        lambda: (
            nothing
            if result is None
            else singular_configurations(swept, result, geometry=exact, until=stages.until)
        ),
        nothing,
    )
    search = stages.run(
        "random search",
        lambda: random_search(exact, forms, random_starts, seed, stages),
        RandomSearch(0, 0, 0, ()),
    )
    unchecked: tuple[FamilyCheck, ...] = ()
    checks = stages.run(
        "samples of the families",
        lambda: _check_families(swept, exact, forms, seed, stages),
        unchecked,
    )
    unowned = ("",) * len(findings)
    owners = stages.run(
        "families of the findings",
        lambda: tuple(
            "" if family is None else family.name
            for family in (forms.family_of(f.configuration.q, PRACTICAL) for f in findings)
        ),
        unowned,
    )
    compared = findings if owners is not unowned else nothing
    return Analysis(
        arm=summarize(arm),
        geometry=geometry,
        closed_form=forms,
        findings=findings,
        family_of=owners,
        checks=checks,
        random_search=search,
        jacobians=0 if result is None else result.done - len(result.uniform),
        sweep_complete=result is not None and result.complete,
        notes=() if result is None else result.notes,
        problems=tuple(_problems(forms, compared, owners[: len(compared)], checks, search)),
        seconds=time.monotonic() - started,
        missing=tuple(stages.missing),
        sweep=result,
    )


def _check_families(
    swept: Arm, exact: Arm, forms: ClosedForm, seed: int, stages: Stages
) -> tuple[FamilyCheck, ...]:
    rng = np.random.default_rng(seed)
    checks = []
    for family in forms.families:
        if stages.over:
            break
        points = _polished(exact, family.points(60, rng))
        there = measure(swept, points)
        checks.append(
            FamilyCheck(
                family=family.name,
                samples=len(points),
                nominal_ratio=float(ratios(exact, points).max(initial=0.0)),
                raw_ratio=float(there.ratio.max(initial=0.0)),
                raw_sigma_min=float(there.sigma[:, -1].max(initial=0.0)),
            )
        )
    return tuple(checks)


def _polished(exact: Arm, points: Array) -> Array:
    """Return samples (N, n) put onto the singular set where rounding keeps them off it."""
    # Where equations of a family touch, or families meet, points have fewer digits than equations.
    # One that has to move farther stays: it is regular.
    points = points.copy()
    off = np.flatnonzero(ratios(exact, points) > SINGULAR_RTOL)
    if len(off):
        ends = walk(exact, points[off], ignore_limits=True)
        moved = np.linalg.norm(ends.q - exact.fold(points[off]), axis=1)
        near = (ends.ratio <= SINGULAR_RTOL) & (moved <= 1e-6)
        points[off[near]] = ends.q[near]
    return points


def _problems(
    forms: ClosedForm,
    findings: Sequence[Finding],
    owners: Sequence[str],
    checks: Sequence[FamilyCheck],
    search: RandomSearch,
) -> list[str]:
    problems = [
        f"{c.family} has samples that Pinocchio finds regular "
        f"(sigma_r/sigma_1 = {c.nominal_ratio:.1e})"
        for c in checks
        if c.nominal_ratio > SINGULAR_RTOL
    ]
    if forms.complete:
        problems += [
            f"the sweep found {f}, which is on no family"
            for f, owner in zip(findings, owners, strict=True)
            if f.status == "singular" and not owner
        ]
        if search.off:
            q = ", ".join(f"{x:.6g}" for x in search.off[0])
            problems.append(
                f"{len(search.off)} singular configurations from random starts are on no "
                f"family, such as q = {q}"
            )
    return problems
