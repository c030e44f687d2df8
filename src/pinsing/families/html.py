"""Closed forms as HTML for notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pinsing.algebra.equation import latex_symbol
from pinsing.notebook import formula, legend, marked, name, table, text, verdict

if TYPE_CHECKING:
    from pinsing.families.family import Family
    from pinsing.families.solve import ClosedForm

_HEADER = ("", "singular where", "kind", "reachable", "why")
_TONES: dict[bool | None, str] = {True: "alarm", False: "good"}


def families_html(forms: ClosedForm) -> str:
    """The families in a table, and how sure it is that none is missing."""
    tone = {"proven": "good", "not complete": "caution"}.get(forms.word)
    said = forms.word if forms.complete else "NOT complete"
    state = verdict(said, tone) if tone else f"<strong>{text(said)}</strong>"
    count = len(forms.families)
    head = (
        f"{name(forms.arm.name)} {text(f'(task {forms.arm.task}, generic rank')} "
        f"{forms.generic_rank}{text('):')} {count} "
        f"{text('family' if count == 1 else 'families')} {text('of singular configurations,')} "
        f"{state}"
    )
    gaps = "".join(f"<p>{verdict('not complete:', 'caution')} {text(g)}</p>" for g in forms.gaps)
    rows = [_row(f) for f in forms.families]
    shown = f"{table(rows, _HEADER)}{_where(forms.legend)}" if rows else ""
    return f"<p>{head}</p>{shown}{gaps}"


def family_html(family: Family) -> str:
    """A row with its header, and the joints that its symbols stand for."""
    involved = sorted({j for b in family.branches for j in b.involved})
    symbols = [f"{'d' if family.prismatic[j] else 'q'}{j + 1}" for j in involved]
    named = tuple(zip(symbols, family.joints, strict=False))
    return table([_row(family)], _HEADER) + _where(named)


def _where(named: tuple[tuple[str, str], ...]) -> str:
    return legend((latex_symbol(symbol), joint) for symbol, joint in named if symbol != joint)


def _row(family: Family) -> tuple[str, ...]:
    tone, words = _TONES.get(family.is_reachable), family.reachability.words
    varies = family.kind == "varies"
    kind = "; ".join(str(part) for part in family.kinds) if varies else family.kind
    return (
        name(family.name),
        formula(family.latex, family.text if "terms]" in family.text else ""),
        text(kind),
        marked(words, tone) if tone else text(words),
        text(family.reason),
    )
