"""Closed forms as text for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pinsing.joint_text import typed
from pinsing.measures import SINGULAR_RTOL
from pinsing.prose import PLAIN, Page, Span, caution, formula, good, measured, unbroken

if TYPE_CHECKING:
    from pinsing.families.family import Family
    from pinsing.families.solve import ClosedForm


def families_text(
    forms: ClosedForm, page: Page = PLAIN, degrees: bool = False, brief: bool = False
) -> str:
    """The list of families with what each means, and a configuration of each to paste.

    Parameters
    ----------
    forms : ClosedForm
        What to print.
    page : Page
        What it is fitted to.
    degrees : bool
        Configurations to paste in degrees.
    brief : bool
        The conditions alone, with the arm that they are of.
    """
    lines = [page.paragraph(*_head(forms, brief))]
    for gap in forms.gaps:
        lines.append(page.paragraph(caution("not complete"), f": {gap}", first="  "))
    if forms.word != "not complete" and not brief:
        lines.append(proof_text(forms, page))
    for family in forms.families:
        lines.append(page.paragraph(formula(family.text), first=f"  {family.name}  "))
        if not brief:
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
    if named and forms.families:
        lines.append(page.paragraph("where " + ", ".join(named), first="  "))
    lines += [page.paragraph(hint, first="  ") for hint in forms.hints]
    return "\n".join(lines)


def _head(forms: ClosedForm, brief: bool) -> tuple[Span, ...]:
    count = len(forms.families)
    took = unbroken(f"{1e3 * forms.seconds:.0f} ms")
    arm = f"{forms.arm.name}, task {forms.arm.task} (generic rank {forms.generic_rank}): "
    if not count and forms.complete:
        what = "no singular configurations: the rank is the same everywhere ("
        if brief:
            return arm, what, _word(forms), ")"
        return what.capitalize(), _word(forms), f"; closed forms, {took})."
    what = f"{count} famil{'y' if count == 1 else 'ies'} of singular configurations, "
    if brief:
        return arm, what, _word(forms)
    return what, _word(forms), f" (closed forms, {took}):"


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
    if not family.real:
        yield "no real point found"
        return
    if family.kind == "varies":
        kind = "; ".join(str(part) for part in family.kinds) + ", "
    else:
        kind = f"{family.kind}, " if family.kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{family.reachability.words}; {size}{proof}"
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
