"""Closed forms as text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator

from pinsing.closed_form import ClosedForm, Family
from pinsing.measures import SINGULAR_RTOL


def families_text(found: ClosedForm) -> str:
    """Return the families with all that is known of each, and the legend of their symbols."""
    lines = str(found).splitlines()[:1]
    for family in found.families:
        lines += ["", f"{family.name}  {family.text}"]
        lines += [f"    {said}" for said in _details(family)]
    named = [f"{symbol} = {name}" for symbol, name in found.legend if symbol != name]
    if named:
        lines += ["", "where " + ", ".join(named)]
    lines += ["", f"{found.seconds * 1e3:.0f} ms; {_geometry(found)}"]
    return "\n".join(lines)


def _details(family: Family) -> Iterator[str]:
    if family.reason:
        yield f"why: {family.reason}"
    yield from family.lost
    where = {
        "reachable": "reachable within the limits",
        "not reachable": "not reachable within the limits (proven)",
    }.get(family.reachability, "no point within the limits was found")
    kind = "" if family.kind == "undecided" else f"{family.kind}, "
    yield f"{kind}codimension {family.codimension}, {where}"
    if not family.real:
        yield "no real point found"
    if family.raw_ratio is not None and family.raw_ratio > SINGULAR_RTOL:
        yield f"the file as it is reaches sigma_r/sigma_1 = {family.raw_ratio:.1e}"


def _geometry(found: ClosedForm) -> str:
    if not found.snaps:
        return "exact for the numbers of the file"
    return (
        f"exact for the nominal geometry: {len(found.snaps)} rounded numbers of the file were "
        f"moved, which changes no Jacobian column by more than {found.jacobian_change:.1e}"
    )


def families_latex(found: ClosedForm) -> str:
    """Return an ``align*`` of the families, with the legend as comments."""
    rows = [rf"  \text{{{f.name}:}} \quad & {f.latex}" for f in found.families]
    legend = [f"% {symbol} = {name}" for symbol, name in found.legend if symbol != name]
    return "\n".join([*legend, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"])
