"""An analysis as text for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from pinsing.families.text import families_text
from pinsing.measures import SINGULAR_RTOL
from pinsing.prose import PLAIN, Page, Span, alarm, caution, unbroken
from pinsing.sweeps.finding import finding_spans

if TYPE_CHECKING:
    from pinsing.analysis.analyze import Analysis


_ROUNDING = 1e-9
"""What changes the Jacobian by less is not worth naming one by one."""


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
        f"{on} of them on the families above"
    )
    search = analysis.random_search
    if search.starts:
        yield (
            f"{search.starts} random starts within the limits: {search.singular} ended at singular "
            f"configurations, "
            f"{search.on_family} of them on the families above"
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
    if forms.jacobian_change > _ROUNDING:
        more = f"; and {len(forms.snaps) - 3} more" if len(forms.snaps) > 3 else ""
        detail = f" ({'; '.join(forms.snaps[:3])}{more})"
    yield (
        f"families are of the nominal geometry (rounding in the file taken out), which changes no "
        f"Jacobian column by more than "
        f"{forms.jacobian_change:.1e}{detail}"
    )
