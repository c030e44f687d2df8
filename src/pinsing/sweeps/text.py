"""A sweep as text for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from pinsing.joint_text import typed
from pinsing.measures import SINGULAR_RTOL
from pinsing.prose import PLAIN, Page, Span, alarm, unbroken, verdict
from pinsing.sweeps.joint_condition import value_text

if TYPE_CHECKING:
    from pinsing.sweeps.findings import Finding
    from pinsing.sweeps.result import SweepResult

_DIGITS = 9


def sweep_text(
    result: SweepResult,
    findings: Sequence[Finding] | None = None,
    page: Page = PLAIN,
    degrees: bool = False,
) -> str:
    """What was swept, what was found, and what was left out.

    Parameters
    ----------
    result : SweepResult
        What to print.
    findings : sequence of Finding, optional
        What `singular_configurations` made of it, if that was asked.
    page : Page
        What it is fitted to.
    degrees : bool
        Configurations in degrees.
    """
    room = page.width - 2
    lines = [page.paragraph(*spans, rest="  ") for spans in _swept(result, degrees, room)]
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
    at = typed(plan.nominal, result.arm.prismatic, degrees, _DIGITS, room=room)
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
        yield (str(result.summary),)


def finding_spans(finding: Finding) -> tuple[Span, ...]:
    """What was found, with its verdict."""
    condition = f"{finding.condition}, whatever the others"
    reach = {True: "", False: ", outside the limits", None: ", none found within the limits"}
    where = reach[finding.reachable]
    if finding.status != "singular":
        ratio = unbroken(f"sigma_r/sigma_1 = {finding.configuration.sigma_ratio:.1e}")
        return f"{condition}: ", verdict(finding.status), f", {ratio}{where}"
    kind = finding.configuration.kind
    said = f" ({kind})" if kind != "undecided" else ""
    raw = ""
    if finding.raw_ratio > SINGULAR_RTOL:
        raw = f"; on the file as it is the ratio is {finding.raw_ratio:.1e}"
    return (f"{condition}{said}{where}{raw}",)
