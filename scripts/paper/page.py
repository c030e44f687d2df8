"""One page, as HTML and as Markdown."""

from __future__ import annotations

import html
from collections.abc import Sequence

from paper.rows import VERDICTS, Section, Table, count

TITLE = "The paper, made again"
INTRO = (
    "X. Zhang, B. Fan, C. Wang, X. Cheng, “Analysis of Singular Configuration of Robotic "
    "Manipulators”: every table, and every figure that shows a computed quantity, made with "
    "pinsing from the paper's own DH tables and set beside what was printed.",
    "Made by scripts/paper; no number on this page is typed in, except those that "
    "are quoted from the paper.",
)

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
h1{font-size:1.8rem;margin-bottom:.3rem} h2{font-size:1.25rem;margin-top:2.6rem}
table{border-collapse:collapse;width:100%;font-size:.88rem;margin:.8rem 0}
th,td{border-bottom:1px solid #ddd;padding:.35rem .5rem;text-align:left;vertical-align:top}
th{border-bottom:2px solid #888} caption{text-align:left;font-size:.9rem;color:#555}
td.n{font-variant-numeric:tabular-nums}
.v{white-space:nowrap;font-weight:600} .agrees{color:#1d7a3c} .differs{color:#b3261e}
.incomplete{color:#9a5b00} .overcome{color:#1f5fa8}
figure{margin:1.2rem 0} figure img{max-width:100%} figcaption{font-size:.88rem;color:#444}
nav{font-size:.92rem} .wide{overflow-x:auto}
@media print{h2{break-after:avoid} figure,tr{break-inside:avoid}}
"""


def to_html(sections: Sequence[Section], images: str) -> str:
    """The page; pictures are taken from the folder ``images``, relative to it."""
    e = html.escape
    out = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{e(TITLE)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{e(TITLE)}</h1>",
        *(f"<p>{e(line)}</p>" for line in INTRO),
        "<ul>",
        *(
            f'<li><span class="v {v}">{e(v)}</span> ({n}): {e(VERDICTS[v])}</li>'
            for v, n in count(sections).items()
        ),
        "</ul>",
        "<nav><ol>",
        *(f'<li><a href="#s{i}">{e(s.title)}</a></li>' for i, s in enumerate(sections, 1)),
        "</ol></nav>",
    ]
    for i, s in enumerate(sections, 1):
        out.append(f'<h2 id="s{i}">{i}. {e(s.title)}</h2>')
        out += [f"<p>{e(line)}</p>" for line in s.text]
        if s.rows:
            out.append('<div class="wide"><table><tr>')
            heads = ("What", "Printed", "Computed", "Verdict", "Reason")
            out += [f"<th>{h}</th>" for h in heads] + ["</tr>"]
            for r in s.rows:
                out.append(
                    f'<tr><td>{e(r.what)}</td><td class="n">{e(r.printed)}</td>'
                    f'<td class="n">{e(r.computed)}</td>'
                    f'<td class="v {r.verdict}">{e(r.verdict)}</td><td>{e(r.reason)}</td></tr>'
                )
            out.append("</table></div>")
        out += [_html_table(t) for t in s.tables]
        for f in s.figures:
            out.append(
                f'<figure><img src="{images}/{f.name}.png" alt="{e(f.caption)}">'
                f"<figcaption>{e(f.caption)}</figcaption></figure>"
            )
        out += [f"<p>{e(line)}</p>" for line in s.after]
    return "\n".join([*out, "</body></html>", ""])


def _html_table(t: Table) -> str:
    e = html.escape
    rows = "".join(
        "<tr>" + "".join(f'<td class="n">{e(c)}</td>' for c in row) + "</tr>" for row in t.rows
    )
    head = "".join(f"<th>{e(h)}</th>" for h in t.head)
    return (
        f'<div class="wide"><table><caption>{e(t.caption)}</caption>'
        f"<tr>{head}</tr>{rows}</table></div>"
    )


def to_markdown(sections: Sequence[Section], images: str) -> str:
    """The same page in Markdown."""
    out = [f"# {TITLE}", "", *_spaced(INTRO)]
    out += [f"- **{v}** ({n}): {VERDICTS[v]}" for v, n in count(sections).items()]
    out.append("")
    for i, s in enumerate(sections, 1):
        out += [f"## {i}. {s.title}", "", *_spaced(s.text)]
        if s.rows:
            out.append("| What | Printed | Computed | Verdict | Reason |")
            out.append("| --- | --- | --- | --- | --- |")
            for r in s.rows:
                cells = (r.what, r.printed, r.computed, f"**{r.verdict}**", r.reason)
                out.append("| " + " | ".join(_cell(c) for c in cells) + " |")
            out.append("")
        for t in s.tables:
            if t.caption:
                out += [t.caption, ""]
            out.append("| " + " | ".join(_cell(c) for c in t.head) + " |")
            out.append("|" + " --- |" * len(t.head))
            out += ["| " + " | ".join(_cell(c) for c in row) + " |" for row in t.rows]
            out.append("")
        for f in s.figures:
            out += [f"![{f.caption}]({images}/{f.name}.png)", "", f"*{f.caption}*", ""]
        out += _spaced(s.after)
    return "\n".join(out).rstrip() + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _spaced(lines: Sequence[str]) -> list[str]:
    return [x for line in lines for x in (line, "")]
