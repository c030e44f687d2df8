"""What a family is, in words: its equations written out, its kind and its reach."""

from __future__ import annotations

from collections.abc import Iterator

from pinsing.families.family import Family
from pinsing.families.solved_for import LONG, long_form


def written_out(family: Family) -> tuple[str, ...]:
    """What long equations are, solved for a joint, line by line."""
    alone = tuple(
        line
        for one in family.solved
        for line in (one.solution, *(f"{a} = {b}" for a, b in one.where))
    )
    return (*alone, *(line for one in family.at_once for line in one.lines()))


def exactly(family: Family, latex: bool = False) -> tuple[str, ...]:
    """The equations of a family with exact coefficients, line by line.

    Parameters
    ----------
    family : Family
        The family.
    latex : bool
        As LaTeX, one line an equation.
    """
    lines: list[str] = []
    for one in family.solved:
        if latex:
            lines += [one.exact_latex] if one.exact_latex else []
        else:
            parts = one.exact or one.where
            lines += [one.solution, *(f"{a} = {b}" for a, b in parts)]
            lines += [] if one.exact else ["(its coefficients are known as decimals only)"]
    short = [e for e in family.equations if not family.solved or long_form(e) is None]
    for e in short:
        # Of a long one that no name stands for decimals are better than nothing.
        brief = len(e.cos) <= LONG
        text = e.exact_text(latex) or ("" if brief else e.latex() if latex else e.text())
        lines += [text] if text else []
    return tuple(dict.fromkeys(lines))


def meaning(family: Family) -> Iterator[str]:
    """Kind, reach, codimension and reason, line by line."""
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
