"""Results in a notebook: HTML with equations as MathML.

Nothing has to be fetched to read them, and nothing is known of the page around: it may be dark.
Names come out of files that anybody may have written. They are escaped and stand in ``<code>``,
which MathJax leaves alone: a name is neither an element nor mathematics.

Formulas are the LaTeX that pinsing writes: names and numbers with indices and powers, sines and
cosines, words between. Anything else (it may come out of a file) is shown as it is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from pinsing.errors import Refusal
from pinsing.prose import escaped as escaped, html_text as text

_PLAIN = r"-+=()^_/,.<>|:;"
_TOKENS = re.compile(
    rf"\\(?:text|mathrm|operatorname)\{{[{_PLAIN}\w ]*\}}|\\[A-Za-z]+|\\.|\d+(?:\.\d+)?|[A-Za-z]+"
    rf"|[{_PLAIN}{{}}]| ",
    re.ASCII,
)
_THIN, _SPACE, _QUAD = (f'<mspace width="{w}"></mspace>' for w in ("0.17em", "0.4em", "1em"))
_FUNCTIONS = (r"\cos", r"\sin")


class _Unknown(Refusal, ValueError):
    """LaTeX beyond what pinsing writes."""


def mathml(latex: str) -> str:
    """Return a formula as inline HTML: ``<math>`` elements that a line may end between."""
    # Browsers break no line within a formula: each summand is an element of its own. Spaces between
    # make the text readable where a page takes the elements away.
    whole = re.sub(r"\s+", " ", latex)
    tokens = _TOKENS.findall(whole)
    try:
        _Unknown.refuse_if("".join(tokens) != whole, whole)
        pieces = list(_pieces(_row(tokens[::-1], 0)))
    except (_Unknown, IndexError):  # something else, or it ends too early
        return f'<code class="tex2jax_ignore mathjax_ignore">{escaped(latex)}</code>'
    return " ".join(f"<math>{' '.join(piece)}</math>" for piece in pieces)


def _pieces(row: list[str]) -> Iterator[list[str]]:
    """Divide before each sign that joins two summands, and at each gap between conditions."""
    signs = (_operator("+"), _operator("−"))
    piece: list[str] = []
    depth = 0
    for part in row:
        depth += (part == _operator("(")) - (part == _operator(")"))
        # In brackets as well, where so much stands before that no line has room for more.
        if part in signs and piece and (depth == 0 or len(piece) > 12):
            yield piece
            piece = [part.replace("<mo", '<mo form="infix"')]  # else it stands like a sign alone
        elif depth == 0 and part == _SPACE:
            if piece:
                yield piece
            piece = []
        else:
            piece.append(part)
    if piece:
        yield piece


def _row(left: list[str], depth: int) -> list[str]:
    """Elements up to the brace that closes, or the end, of tokens ``left``, the next one last."""
    _Unknown.refuse_if(depth > 12, "too deep")
    out: list[str] = []
    while left or depth:
        token = left.pop()
        if token == "}" and depth:
            break
        if token == " ":
            continue
        if token in ("^", "_") and out:
            gap = [out.pop()] if len(out) > 1 and out[-1] == _THIN else []
            out += [_script(out.pop(), token, _group(left, depth)), *gap]  # cos^2: before its gap
        elif token in ("-", r"\pm") and _begins(out):
            # Else a sign that follows another stands as far off as between two numbers.
            sign = _operator("−" if token == "-" else "±")
            out.append(sign.replace("<mo", '<mo form="prefix"'))
        else:
            if token in _FUNCTIONS and out and out[-1].startswith(("<mn", "<ms")):
                out.append(_THIN)
            out += _element(token, left, depth)
    return out


def _element(token: str, left: list[str], depth: int) -> list[str]:
    """What a token stands for, with what it takes of those that are left."""
    if token in _FIXED:
        return _FIXED[token]
    if token[0].isdigit():
        return [f"<mn>{token}</mn>"]
    if token.isalpha():
        return [f"<mi>{token}</mi>"]
    if token == "{":
        return [f"<mrow>{' '.join(_row(left, depth + 1))}</mrow>"]
    if token[0] != "\\" and token not in "}^_":
        return [_operator("−" if token == "-" else token)]
    command, _, words = token[1:].partition("{")
    if words:
        words = escaped(words[:-1])
        if command == "text":
            return [f"<mtext>{words}</mtext>"]
        return [f'<mi mathvariant="normal">{words}</mi>', _THIN][: 1 + (command != "mathrm")]
    if command == "sqrt":
        return [f"<msqrt>{''.join(_group(left, depth))}</msqrt>"]
    if command == "pmod":
        inner = f"{_operator('(')}<mi>mod</mi> {_SPACE}{''.join(_group(left, depth))}"
        return [_SPACE, f"<mrow>{inner}{_operator(')')}</mrow>"]
    raise _Unknown(token)


def _script(base: str, mark: str, inner: list[str]) -> str:
    body = inner[0] if len(inner) == 1 else f"<mrow>{''.join(inner)}</mrow>"
    if body == "<mi>°</mi>":  # a degree sign stands high already
        return base.replace("</mn>", "°</mn>") if base.startswith("<mn>") else base + body
    tag = "msup" if mark == "^" else "msub"
    return f"<{tag}>{base}{body}</{tag}>"


def _group(left: list[str], depth: int) -> list[str]:
    """Return what an index or a power takes: braces, or one token."""
    while (token := left.pop()) == " ":
        pass
    return _row(left, depth + 1) if token == "{" else _element(token, left, depth + 1)


def _begins(row: list[str]) -> bool:
    """Return True if what comes next begins a term, as after an equals sign or a gap."""
    return not row or row[-1] == _SPACE or (row[-1].startswith("<mo") and ")" not in row[-1])


def _operator(sign: str) -> str:
    fixed = ' stretchy="false"' if sign in "()" else ""
    return f"<mo{fixed}>{escaped(sign)}</mo>"


_FIXED = {
    r"\sigma": ["<mi>σ</mi>"],
    r"\pi": ["<mi>π</mi>"],
    r"\circ": ["<mi>°</mi>"],
    r"\varphi": ["<mi>φ</mi>"],
    r"\pm": ["<mo>±</mo>"],
    r"\cdot": ["<mo>·</mo>"],
    r"\le": ["<mo>≤</mo>"],
    r"\ge": ["<mo>≥</mo>"],
    r"\times": ["<mo>×</mo>"],
    r"\cos": ["<mi>cos</mi>", _THIN],
    r"\sin": ["<mi>sin</mi>", _THIN],
    r"\,": [_THIN],
    r"\ ": [_SPACE],
    r"\quad": [_QUAD],
}
"""Commands of LaTeX that always stand for the same elements."""


_COLORS = {"alarm": "#b00020", "caution": "#8a5a00", "good": "#1b6e3c"}
"""Grounds that white is read on; a page's own ground is not known."""
_DOTS = {"alarm": "#e5484d", "caution": "#b7791f", "good": "#2f9e5f"}
"""Seen on white and on black."""


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
