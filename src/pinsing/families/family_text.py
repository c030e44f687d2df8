"""What a family is, in words: its equations written out, its kind and its reach."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from pinsing.families.family import Family
from pinsing.families.solved_for import LONG, long_form

_TERM = re.compile(r"(?= [+-] )")
_WIDE = 80
"""Characters of a line that a printed page has room for."""
_HALF = re.compile(r"(?:cos|sin)\(([^()/]*|\([^()/]*\))/2\)")
_SYMBOL = re.compile(r"q[0-9]+")
_COMMAND = re.compile(r"\\[a-zA-Z]+ ?|[{}_^\\]")


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


def latex_lines(latex: str) -> list[str]:
    """A long statement in LaTeX as lines of a page's width, broken at commas and between terms."""
    lines: list[str] = []
    for part in latex.split(r",\ "):
        whole = [""]
        for term in _TERM.split(part):
            here = whole[-1]
            # Round brackets may close on another line, braces may not.
            closed = here.count("{") == here.count("}")
            if here.strip() and closed and _seen(here) + _seen(term) > _WIDE:
                whole.append("")
            whole[-1] += term
        lines += [line.strip() for line in whole]
    return lines


def _seen(latex: str) -> int:
    """About how many characters of it are seen; a name such as sin counts as three."""
    return len(_COMMAND.sub(lambda m: "abc" if m[0][1:].strip() in ("sin", "cos") else "", latex))


def meaning(family: Family) -> Iterator[str]:
    """Kind, reach, codimension and reason, line by line."""
    n = family.n
    if not family.real:
        yield "no real point found in the time given, which does not prove that there is none"
        return
    if family.kind == "varies":
        kind = "; ".join(str(part) for part in family.kinds) + ", "
    else:
        kind = f"{family.kind}, " if family.kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{family.reach}; {size}{proof}"
    yield from family.limits_met
    if family.reason:
        yield family.reason


def half_angles(families: Iterable[Family]) -> Iterator[str]:
    """Why there are half angles in equations that are printed, where there are any."""
    where: dict[str, set[str]] = {}
    for family in families:
        for line in (family.text, *written_out(family)):
            for angle in _HALF.findall(line):
                where.setdefault(family.name, set()).update(_SYMBOL.findall(angle))
    if not where:
        return
    joints = sorted(set().union(*where.values()), key=lambda symbol: int(symbol[1:]))
    yield (
        f"half of {', '.join(joints)} in {', '.join(where)}: equations are factors of a longer "
        "one, and in a factor half of an angle may be left, as where another is zero at a single "
        "value of that joint; a whole turn changes the sign of such an equation, "
        "never whether it holds"
    )
