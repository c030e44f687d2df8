"""Results in a notebook: HTML with equations as MathML, and one-line texts.

Nothing has to be fetched to read them, and nothing is known of the page around: it may be dark.
Names come out of files that anybody may have written. They are escaped and stand in ``<code>``,
which MathJax leaves alone: a name is neither an element nor mathematics.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pinsing.mathml import escaped, mathml
from pinsing.prose import visible

_COLORS = {"alarm": "#b00020", "caution": "#8a5a00", "good": "#1b6e3c"}
"""Grounds that white is read on; a page's own ground is not known."""
_DOTS = {"alarm": "#e5484d", "caution": "#b7791f", "good": "#2f9e5f"}
"""Seen on white and on black."""
_LONGEST = 110


def one_line(kind: str, text: str) -> str:
    """Return ``<kind: first line of text>``, short and without control characters."""
    first = text.strip().splitlines()[0] if text.strip() else ""
    first = visible(first)
    cut = first if len(first) <= _LONGEST else first[: _LONGEST - 3] + "..."
    return f"<{kind}: {cut}>" if cut else f"<{kind}>"


def text(words: str, block: bool = False) -> str:
    """Words as HTML that no page takes for mathematics; a ``block`` keeps its lines."""
    tag = "pre" if block else "span"
    return f'<{tag} class="tex2jax_ignore mathjax_ignore">{escaped(words)}</{tag}>'


def name(words: str) -> str:
    """A name out of a file."""
    return f'<code class="tex2jax_ignore mathjax_ignore">{escaped(words)}</code>'


def formula(latex: str, short: str = "") -> str:
    """LaTeX of our own making, typeset; behind ``short``, where that is given."""
    typeset = f'<span style="font-size:115%">{mathml(latex)}</span>'
    if not short:
        return typeset
    # What no line may end in scrolls by itself: the table stays as wide as it is.
    inside = f'<div style="max-width: 24em; overflow-x: auto">{typeset}</div>'
    return f"<details><summary>{text(short)}</summary>{inside}</details>"


def legend(named: Iterable[tuple[str, str]]) -> str:
    """Return what the symbols of equations stand for: pairs of LaTeX and a name out of a file."""
    kept = '<span style="white-space:nowrap">'
    pairs = [f"{kept}{formula(symbol)} =</span> {name(joint)}" for symbol, joint in named]
    return f"<p>{text('where')} {', '.join(pairs)}</p>" if pairs else ""


def verdict(words: str, tone: str) -> str:
    """A verdict on a ground of its colour: ``alarm``, ``caution`` or ``good``."""
    style = f"background:{_COLORS[tone]};color:#fff;padding:0.1em 0.45em;border-radius:0.25em"
    return f'<strong style="{style}">{text(words)}</strong>'


def marked(words: str, tone: str) -> str:
    """Words behind a dot of a colour, for the many rows of a table."""
    dot = f'<span style="color:{_DOTS[tone]}">●</span>'
    return f"<span>{dot}&#160;{text(words)}</span>"


def table(rows: Iterable[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Rows of cells that are HTML already; a line of their words breaks where it must."""
    left = 'style="text-align:left;vertical-align:top;white-space:normal"'
    head = "".join(f"<th {left}>{text(h)}</th>" for h in header)
    body = "".join(
        "<tr>" + "".join(f"<td {left}>{cell}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f"<table>{f'<thead><tr>{head}</tr></thead>' if header else ''}<tbody>{body}</tbody></table>"
    )
