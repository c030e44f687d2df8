"""An analysis as text for people."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pinsing.measures import SINGULAR_RTOL

if TYPE_CHECKING:
    from pinsing.analysis.analyze import Analysis
    from pinsing.families import ClosedForm, Family

_WIDTH = 100


def analysis_text(analysis: Analysis) -> str:
    """Families first, then how they were checked, then what was assumed."""
    arm = analysis.arm
    lines = [
        f"{arm.name}: {arm.n} joints, {arm.base} -> {arm.tip}, task {arm.task} "
        f"(generic rank {analysis.closed_form.generic_rank}), length scale {arm.length_scale:g} m",
        "",
        *families_text(analysis.closed_form),
    ]
    extra = [
        f
        for f, owner in zip(analysis.findings, analysis.family_of, strict=True)
        if not owner and f.status == "singular"
    ]
    if extra and not analysis.complete:
        lines += ["", "Found by the sweep beside these families:"]
        lines += [_wrapped(str(f), "  - ") for f in extra]
    near = [f for f in analysis.findings if f.status == "near-singular"]
    if near:
        lines += ["", "Near-singular valleys:"]
        lines += [_wrapped(str(f), "  - ") for f in near]
    lines += ["", "Checked:"]
    lines += [_wrapped(text, "  - ") for text in _checks(analysis)]
    if analysis.problems:
        lines += ["", "CONTRADICTIONS (please report them):"]
        lines += [_wrapped(text, "  ! ") for text in analysis.problems]
    notes = dict.fromkeys((*arm.notes, *_geometry(analysis), *analysis.notes))
    if notes:
        lines += ["", "Assumed:"]
        lines += [_wrapped(text, "  - ") for text in notes]
    return "\n".join(lines)


def families_text(forms: ClosedForm) -> list[str]:
    """The list of families with what each means."""
    count = len(forms.families)
    if not count and forms.complete:
        head = "No singular configurations: the rank is the same everywhere."
    else:
        what = f"{count} famil{'y' if count == 1 else 'ies'} of singular configurations"
        state = "complete" if forms.complete else "NOT complete"
        head = f"{what}, {state} (closed forms, {1e3 * forms.seconds:.0f} ms):"
    lines = [head]
    for family in forms.families:
        lines += [_wrapped(family.text, f"  {family.name}  ")]
        lines += [_wrapped(text, "      ") for text in _meaning(family)]
    named = [f"{symbol} = {name}" for symbol, name in forms.legend if symbol != name]
    if named:
        lines += [_wrapped("where " + ", ".join(named), "  ")]
    lines += [_wrapped(gap, "  not complete: ") for gap in forms.gaps]
    return lines


def _meaning(family: Family) -> Iterator[str]:
    n = family.n
    where = {
        "reachable": "within the joint limits",
        "not reachable": "outside the joint limits",
        "none found": "no point found within the joint limits",
    }[family.reachability]
    if not family.real:
        yield "no real point found"
        return
    kind = f"{family.kind}, " if family.kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{where}; {size}{proof}"
    if family.reason:
        yield family.reason
    if family.lost:
        yield "there, e.g.: " + "; ".join(family.lost)


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
            f"{search.starts} random starts within the limits: {search.singular} became singular, "
            f"{search.on_family} of them on the families above"
        )
    sampled = [c for c in analysis.checks if c.samples]
    if sampled:
        worst = max(c.nominal_ratio for c in sampled)
        yield (
            f"{sum(c.samples for c in sampled)} samples of the families: sigma_r/sigma_1 "
            f"<= {worst:.1e} in Pinocchio (singular: <= {SINGULAR_RTOL:g})"
        )
        if analysis.closed_form.jacobian_change > 1e-12 and analysis.geometry == "both":
            by_family = ", ".join(
                f"{c.family} {c.raw_ratio:.1e} (sigma_min {c.raw_sigma_min:.1e})" for c in sampled
            )
            yield f"the same samples on the geometry of the file reach sigma_r/sigma_1: {by_family}"
    yield f"{analysis.seconds:.1f} s in all"


def _geometry(analysis: Analysis) -> Iterator[str]:
    forms = analysis.closed_form
    if forms.jacobian_change <= 1e-12:
        return
    shown = "; ".join(forms.snaps[:3])
    more = f"; and {len(forms.snaps) - 3} more" if len(forms.snaps) > 3 else ""
    detail = f" ({shown}{more})" if shown else ""
    yield (
        f"families are of the nominal geometry, which changes no Jacobian column by more than "
        f"{forms.jacobian_change:.1e}{detail}"
    )


def _wrapped(text: str, indent: str) -> str:
    return textwrap.fill(
        text,
        _WIDTH,
        initial_indent=indent,
        subsequent_indent=" " * len(indent),
        break_long_words=False,
        break_on_hyphens=False,
    )
