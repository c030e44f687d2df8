"""What an analysis has found, and its text for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from pinsing._types import Array
from pinsing.families import ClosedForm, Family
from pinsing.families.form import answer_text, families_text
from pinsing.measures import SINGULAR_RTOL
from pinsing.notebook import text, verdict
from pinsing.prose import PLAIN, Page, Span, alarm, caution, unbroken
from pinsing.robot.arm import ArmSummary
from pinsing.sampling.finding import Finding, finding_spans
from pinsing.sampling.sweep_result import SweepResult
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class FamilyCheck:
    """What Pinocchio says of configurations sampled on a family.

    Attributes
    ----------
    family : str
        Its name.
    samples : int
        Configurations, over whole circles.
    nominal_ratio : float
        Largest sigma_r / sigma_1 on the nominal geometry; singular if within SINGULAR_RTOL.
    raw_ratio, raw_sigma_min : float
        Largest sigma_r / sigma_1, and sigma_r, on the geometry of the file.
    """

    family: str
    samples: int
    nominal_ratio: float
    raw_ratio: float
    raw_sigma_min: float


@dataclass(frozen=True, eq=False)
class RandomSearch:
    """Singular configurations that were looked for without any plan or algebra.

    Attributes
    ----------
    starts : int
        Random configurations within the limits that were refined.
    singular : int
        How many became singular to SINGULAR_RTOL.
    on_family : int
        How many of those lie on a family, or in a valley of sigma_r so flat that the zero next
        to them does.
    off : tuple of (n,) arrays
        The others.
    """

    starts: int
    singular: int
    on_family: int
    off: tuple[Array, ...]


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
        """Whether no singular configuration can be missing."""
        return self.closed_form.complete

    @property
    def agree(self) -> bool:
        """Whether closed forms, sweep and random search contradict each other nowhere."""
        return not self.problems

    @property
    def singular(self) -> bool:
        """Whether a singular configuration within the joint limits is known."""
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


def analysis_text(analysis: Analysis, page: Page = PLAIN, degrees: bool = False) -> str:
    """Families first, then how they were checked, then what was assumed.

    Parameters
    ----------
    analysis : Analysis
        What to print.
    page : Page
        What it is fitted to.
    degrees : bool
        Configurations to paste in degrees.
    """
    arm = analysis.arm
    lines = [
        answer_text(analysis.closed_form, page),
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
