"""An analysis as text for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from pinsing.joint_text import typed
from pinsing.measures import SINGULAR_RTOL
from pinsing.prose import (
    PLAIN,
    Page,
    Span,
    alarm,
    caution,
    formula,
    good,
    measured,
    unbroken,
)
from pinsing.sweeps.text import finding_spans

if TYPE_CHECKING:
    from pinsing.analysis.analyze import Analysis
    from pinsing.families import ClosedForm, Family


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


def families_text(forms: ClosedForm, page: Page = PLAIN, degrees: bool = False) -> str:
    """The list of families with what each means, and a configuration of each to paste."""
    count = len(forms.families)
    if not count and forms.complete:
        head: tuple[Span, ...] = (
            "No singular configurations: the rank is the same everywhere (",
            _word(forms),
            f"; closed forms, {unbroken(f'{1e3 * forms.seconds:.0f} ms')}).",
        )
    else:
        what = f"{count} famil{'y' if count == 1 else 'ies'} of singular configurations, "
        head = what, _word(forms), f" (closed forms, {unbroken(f'{1e3 * forms.seconds:.0f} ms')}):"
    lines = [page.paragraph(*head)]
    for gap in forms.gaps:
        lines.append(page.paragraph(caution("not complete"), f": {gap}", first="  "))
    if forms.word != "not complete":
        lines.append(proof_text(forms, page))
    for family in forms.families:
        lines.append(page.paragraph(formula(family.text), first=f"  {family.name}  "))
        lines += [page.paragraph(text, first="      ") for text in _meaning(family)]
        lines += _example(family, forms, page, degrees)
    long = [f.name for f in forms.families if " terms]" in f.text]
    if long:
        lines.append(
            page.paragraph(
                f"f(...) of {', '.join(long)}: `pinsing families --latex` writes it out", first="  "
            )
        )
    named = [unbroken(f"{symbol} = {name}") for symbol, name in forms.legend if symbol != name]
    if named:
        lines.append(page.paragraph("where " + ", ".join(named), first="  "))
    lines += [page.paragraph(hint, first="  ") for hint in forms.hints]
    return "\n".join(lines)


def _word(forms: ClosedForm) -> Span:
    """Proven, probable or NOT complete."""
    if forms.word == "proven":
        return good("proven")
    return "probable" if forms.complete else caution("NOT complete")


def proof_text(forms: ClosedForm, page: Page = PLAIN) -> str:
    """What the word rests on: a certificate, or random points."""
    proof = forms.proof
    if proof is not None and proof.accepted:
        size = unbroken(f"{proof.size / 1e3:.1f} kB")
        took = unbroken(f"{1e3 * proof.check_seconds:.0f} ms")
        return page.paragraph(
            good("proven"), f": certificate of {size}, checked in {took}", first="  "
        )
    if proof is None:
        return page.paragraph("probable: no certificate was looked for", first="  ")
    return page.paragraph(
        f"probable: nothing is known to be missing, but {_random_steps(forms)}; "
        f"no certificate: {proof.reason}",
        first="  ",
    )


def _random_steps(forms: ClosedForm) -> str:
    """What rests on random points of finite fields, with primes and seeds."""
    steps = forms.random_steps
    if steps is None or not steps.systems:
        return "the generic rank was taken at random points of two finite fields"
    primes = " and ".join(str(p) for p in steps.primes)
    seeds = " and ".join(str(s) for s in steps.seeds)
    systems = "one system" if steps.systems == 1 else f"{steps.systems} systems"
    return (
        f"{systems} of equations rested on random points modulo {primes} (seeds {seeds}), "
        "each verdict wrong with a chance below 1e-14"
    )


def _meaning(family: Family) -> Iterator[str]:
    n = family.n
    where = {
        "reachable": "within the joint limits",
        "at the joint limit": "at the joint limit",
        "not reachable": "outside the joint limits",
        "none found": "no point found within the joint limits",
    }[family.reachability]
    if not family.real:
        yield "no real point found"
        return
    if family.kind == "varies":
        kind = "; ".join(str(part) for part in family.kinds) + ", "
    else:
        kind = f"{family.kind}, " if family.kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{where}; {size}{proof}"
    yield from family.limits_met
    if family.reason:
        yield family.reason


def _example(family: Family, forms: ClosedForm, page: Page, degrees: bool) -> Iterator[str]:
    """A configuration of the family, to be pasted after ``pinsing at``, and what is lost there."""
    if family.generic is None:
        return
    rounded = family.raw_ratio is not None and family.raw_ratio > SINGULAR_RTOL
    first = f"      e.g. {'--nominal ' if rounded else ''}"
    loose = set(range(family.n)).difference(*(b.involved for b in family.branches))
    q = typed(family.generic, family.prismatic, degrees, loose=loose, room=page.width - len(first))
    yield page.paragraph(q, first=first, rest=" " * 13)
    for text in family.lost:
        yield page.paragraph(measured(text), first="        ")


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
