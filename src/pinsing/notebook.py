"""Results in a notebook: HTML with equations typeset by the page, and one-line texts.

Names come out of files that anybody may have written. They are escaped and stand in ``<code>``,
which MathJax leaves alone: a name is neither an element nor mathematics.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

_COLORS = {"alarm": "#b00020", "caution": "#8a5a00", "good": "#1b6e3c"}
_LONGEST = 110


def one_line(kind: str, text: str) -> str:
    """Return ``<kind: first line of text>``, short and without control characters."""
    first = text.strip().splitlines()[0] if text.strip() else ""
    first = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in first)
    cut = first if len(first) <= _LONGEST else first[: _LONGEST - 3] + "..."
    return f"<{kind}: {cut}>" if cut else f"<{kind}>"


def text(words: str) -> str:
    """Words as HTML that no page takes for mathematics."""
    return f'<span class="tex2jax_ignore mathjax_ignore">{html.escape(words)}</span>'


def name(words: str) -> str:
    """A name out of a file."""
    return f'<code class="tex2jax_ignore mathjax_ignore">{html.escape(words)}</code>'


def formula(latex: str) -> str:
    """LaTeX of our own making, to be typeset."""
    return f"${html.escape(latex)}$"


def verdict(words: str, tone: str) -> str:
    """A verdict in colour: ``alarm``, ``caution`` or ``good``."""
    return f'<strong style="color:{_COLORS[tone]}">{text(words)}</strong>'


def table(rows: Iterable[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Rows of cells that are HTML already."""
    left = 'style="text-align:left"'
    head = "".join(f"<th {left}>{text(h)}</th>" for h in header)
    body = "".join(
        "<tr>" + "".join(f"<td {left}>{cell}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f"<table>{f'<thead><tr>{head}</tr></thead>' if header else ''}<tbody>{body}</tbody></table>"
    )
