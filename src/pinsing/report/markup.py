"""HTML of a report, piece by piece: escaped, with classes in place of styles, fit for a strict CSP.

Names come out of files that anybody may have written: `text` and `name` are the only ways in.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Sequence
from typing import Any

from pinsing.mathml import mathml
from pinsing.prose import visible

_SHORT = 12  # rows, of some lines each, that a page of paper has room for


def text(words: str) -> str:
    """Words, escaped; control characters and marks that hide or turn text are shown as such."""
    return html.escape(visible(words, keep="\n\t"))


def name(words: str) -> str:
    """A name out of a file."""
    return f"<code>{text(words)}</code>"


def math(latex: str) -> str:
    """LaTeX of our own making, as MathML."""
    return f'<span class="math">{mathml(latex)}</span>'


def badge(words: str, tone: str = "") -> str:
    """A verdict; its colour repeats what the word says."""
    return f'<strong class="badge {tone}">{text(words)}</strong>'


def paragraph(*parts: str, kind: str = "") -> str:
    """Parts that are HTML already."""
    return f"<p{_class(kind)}>{' '.join(part for part in parts if part)}</p>"


def bullets(items: Iterable[str], kind: str = "") -> str:
    """Items that are HTML already; nothing where there are none."""
    rows = "".join(f"<li>{item}</li>" for item in items)
    return f"<ul{_class(kind)}>{rows}</ul>" if rows else ""


def terms(pairs: Iterable[tuple[str, str]], kind: str = "") -> str:
    """Names and what they mean, HTML already."""
    rows = "".join(f"<div><dt>{head}</dt><dd>{body}</dd></div>" for head, body in pairs)
    return f"<dl{_class(kind)}>{rows}</dl>"


def table(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()
) -> str:
    """A table: plain words on top, cells that are HTML already; the first of each row heads it."""

    def cells(row: Sequence[str]) -> str:
        out = [f'<th scope="row"{_class("n" if 0 in numbers else "")}>{row[0]}</th>']
        out += [
            f"<td{_class('n' if k in numbers else '')}>{c}</td>" for k, c in enumerate(row[1:], 1)
        ]
        return "".join(out)

    head = "".join(
        f'<th scope="col"{_class("n" if k in numbers else "")}>{text(h)}</th>'
        for k, h in enumerate(header)
    )
    lines = [f"<tr>{cells(row)}</tr>" for row in rows]
    body = "".join(lines)
    # A wide table scrolls by itself, also by keyboard; a short one stays on one page of paper.
    kind = "wide short" if len(lines) <= _SHORT else "wide"
    return (
        f'<div class="{kind}" role="region" tabindex="0" aria-label="{text(caption)}"><table>'
        f"<caption>{text(caption)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    )


def figure(png: bytes, alt: str, caption: str, kind: str = "") -> str:
    """A picture; ``alt`` is plain words, ``caption`` HTML."""
    data = base64.b64encode(png).decode("ascii")
    return (
        f'<figure{_class(kind)}><img alt="{text(alt)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def section(key: str, title: str, *parts: str) -> tuple[str, str, str]:
    """Key, plain title and HTML of a section."""
    body = "\n".join(part for part in parts if part)
    return key, title, f'<section id="{key}"><h2>{text(title)}</h2>\n{body}\n</section>'


def download(words: str, file: str, data: str) -> str:
    """A link that saves text as a file, without any network."""
    packed = base64.b64encode(data.encode()).decode("ascii")
    return (
        f'<a download="{text(file)}" href="data:application/json;base64,{packed}">{text(words)}</a>'
    )


def data_block(key: str, data: Any) -> str:
    """JSON that programs find in the page; nothing in it ends the element."""
    written = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        written = written.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json" id="{key}">{written}</script>'


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
