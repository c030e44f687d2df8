"""analyze: closed forms and the paper's sweep on one arm, each checking the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import MAX_SEED, checked, whole_number
from pinsing.configuration.refine import walk
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, closed_form
from pinsing.kinematics.verdict import SINGULAR_RTOL, measure, ratios
from pinsing.robot.arm import Arm
from pinsing.robot.arm_summary import summarize
from pinsing.robot.nominal import ANGLE_TOL
from pinsing.robot.nominal import nominal as nominal_geometry
from pinsing.sampling.analysis_result import Analysis, FamilyCheck, RandomSearch
from pinsing.sampling.finding import Finding
from pinsing.sampling.findings import MAX_STARTS, singular_configurations
from pinsing.sampling.planning import planned_sweep
from pinsing.sampling.random_search import ON_FAMILY_TOL, random_search
from pinsing.sampling.special_values import SPECIAL_ANGLES, Special
from pinsing.sampling.stages import Stages
from pinsing.sampling.sweep_plan import SAMPLES, SweepOptions
from pinsing.sampling.sweep_run import run_sweep

_RAW_ANGLE_TOL = 1e-10
_FAMILY_SAMPLES = 60
_ROUNDING = 1e-6

SECONDS = 60.0
"""Time that an analysis may take."""
_ALGEBRA = 1 / 2


@checked
def analyze(
    arm: Arm,
    nominal: npt.ArrayLike | None = None,
    *,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    random_starts: int = 300,
    seconds: float = SECONDS,
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
    seconds : float
        Time for all of it, of which closed forms may take a half. What there is when it is up,
        or at Ctrl-C, is returned, and ``missing`` says what is not.
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
    if geometry not in ("both", "raw", "nominal"):
        raise OptionError(f"geometry must be 'both', 'raw' or 'nominal', got {geometry!r}")
    whole_number(random_starts, "random_starts", 0, MAX_STARTS)
    whole_number(seed, "seed", 0, MAX_SEED)
    started = time.monotonic()
    if geometry == "raw":
        angle_tol, snap_length = min(angle_tol, _RAW_ANGLE_TOL), 0.0
    exact = nominal_geometry(arm, angle_tol, snap_length).arm
    swept = exact if geometry == "nominal" else arm
    stages = Stages(seconds)
    forms = closed_form(
        arm, seconds=_ALGEBRA * seconds, angle_tol=angle_tol, snap_length=snap_length
    )
    options = SweepOptions(nominal, special, levels, samples, joints, ignore_limits, prune, seed)
    result = stages.run(
        "sweep",
        lambda: run_sweep(swept, planned_sweep(swept, options, exact), stages.watched(progress)),
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
        "families of the findings", lambda: tuple(_owner(forms, f) for f in findings), unowned
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


def _owner(forms: ClosedForm, finding: Finding) -> str:
    family = forms.family_of(finding.configuration.q, ON_FAMILY_TOL)
    return "" if family is None else family.name


def _check_families(
    swept: Arm, exact: Arm, forms: ClosedForm, seed: int, stages: Stages
) -> tuple[FamilyCheck, ...]:
    rng = np.random.default_rng(seed)
    checks = []
    for family in forms.families:
        if stages.over:
            break
        points = family.points(_FAMILY_SAMPLES, rng)
        if not len(points):
            checks.append(FamilyCheck(family.name, 0, 0.0, 0.0, 0.0))
            continue
        points = _polished(exact, points)
        there = measure(swept, points)
        checks.append(
            FamilyCheck(
                family=family.name,
                samples=len(points),
                nominal_ratio=float(ratios(exact, points).max()),
                raw_ratio=float(there.ratio.max()),
                raw_sigma_min=float(there.sigma[:, -1].max()),
            )
        )
    return tuple(checks)


def _polished(exact: Arm, points: Array) -> Array:
    """Samples (N, n), those that rounding keeps off the singular set put onto it.

    Where the equations of a family touch, or a family meets another one, they give a point to
    fewer digits than they are solved to. One that has to move farther stays: it is regular.
    """
    points = points.copy()
    off = np.flatnonzero(ratios(exact, points) > SINGULAR_RTOL)
    if len(off):
        ends = walk(exact, points[off], ignore_limits=True)
        moved = np.linalg.norm(ends.q - exact.fold(points[off]), axis=1)
        near = (ends.ratio <= SINGULAR_RTOL) & (moved <= _ROUNDING)
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
