"""Families in a table of HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pinsing.algebra.equation_text import latex_symbol
from pinsing.notebook import formula, legend, marked, name, table, text

_HEADER = ("", "singular where", "kind", "reachable", "why")
_TONES: dict[bool | None, str] = {True: "alarm", False: "good"}


def families_table(rows: Iterable[Sequence[str]], named: Iterable[tuple[str, str]]) -> str:
    """Rows of families with their header, and the joints that their symbols stand for."""
    where = legend((latex_symbol(symbol), joint) for symbol, joint in named if symbol != joint)
    return table(rows, _HEADER) + where


def family_row(
    called: str, latex: str, short: str, kind: str, inside: bool | None, reach: str, reason: str
) -> tuple[str, ...]:
    """The cells of a family: its equations behind ``short``, where that is given."""
    tone = _TONES.get(inside)
    reachable = marked(reach, tone) if tone else text(reach)
    return name(called), formula(latex, short), text(kind), reachable, text(reason)
