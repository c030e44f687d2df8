"""The LaTeX that pinsing writes, as MathML, which browsers typeset by themselves.

Notebooks show HTML; one that holds MathML needs neither MathJax nor a network. Known is what
pinsing writes: names and numbers with indices and powers, sines and cosines, words between.
Anything else (it may come out of a file) is shown as it is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

_TOKENS = re.compile(
    r"(?P<command>\\(?:[A-Za-z]+|.))|(?P<number>\d+(?:\.\d+)?)|(?P<word>[A-Za-z]+)"
    r"|(?P<mark>[-+=(){}^_/,.<>|:;])|(?P<space>\s+)"
)
_OPERATORS = {"pm": "±", "cdot": "·", "le": "≤", "ge": "≥", "times": "×"}
_FUNCTIONS = ("cos", "sin")
_LETTERS = {"sigma": "σ", "pi": "π", "circ": "°", "varphi": "φ"}
_THIN, _SPACE = "0.17em", "0.4em"
_GAPS = {",": _THIN, " ": _SPACE, "quad": "1em"}
_UPRIGHT = ("mathrm", "operatorname")


def escaped(words: str) -> str:
    """Words without what HTML would take for its own."""
    import html  # with all names of characters: a command without a page can do without

    return html.escape(words)


class _Unknown(ValueError):
    """LaTeX beyond what pinsing writes."""


def mathml(latex: str) -> str:
    """A formula as inline HTML: ``<math>`` elements that a line may end between.

    Browsers break no line within a formula, so that a sum of twenty terms would widen the page:
    each summand is an element of its own. Spaces stand between the parts, so that the text alone
    can be read where a page takes the elements away.
    """
    try:
        pieces = list(_pieces(_Reader(latex).row(0)))
    except _Unknown:
        return f'<code class="tex2jax_ignore mathjax_ignore">{escaped(latex)}</code>'
    return " ".join(f"<math>{' '.join(piece)}</math>" for piece in pieces)


def _pieces(row: list[str]) -> Iterator[list[str]]:
    """Divide before each sign that joins two summands, and at each gap between conditions."""
    signs = (_operator("+"), _operator("−"))
    piece: list[str] = []
    depth = 0
    for part in row:
        depth += (part == _operator("(")) - (part == _operator(")"))
        if depth == 0 and part in signs and piece:
            yield piece
            piece = [part.replace("<mo", '<mo form="infix"')]  # else it stands like a sign alone
        elif depth == 0 and part == _gap(_SPACE):
            if piece:
                yield piece
            piece = []
        else:
            piece.append(part)
    if piece:
        yield piece


class _Reader:
    """Goes over the tokens of a formula once."""

    def __init__(self, latex: str) -> None:
        self._latex = latex
        self._tokens: list[tuple[str, str]] = []
        end = 0
        for match in _TOKENS.finditer(latex):
            if match.start() != end:
                raise _Unknown(latex)
            end = match.end()
            if match.lastgroup != "space":
                self._tokens.append((str(match.lastgroup), match.group()))
            elif self._tokens and self._tokens[-1][0] != "space":
                self._tokens.append(("space", " "))
        if end != len(latex):
            raise _Unknown(latex)
        self._at = 0

    def row(self, depth: int) -> list[str]:
        """Elements up to the brace that closes, or the end."""
        if depth > 12:
            raise _Unknown(self._latex)
        out: list[str] = []
        while self._at < len(self._tokens):
            kind, token = self._tokens[self._at]
            if token == "}" and kind == "mark":
                if depth == 0:
                    raise _Unknown(self._latex)
                return out
            self._at += 1
            if kind == "space":
                continue
            if kind == "mark" and token in "^_":
                if not out:
                    raise _Unknown(self._latex)
                gap = [out.pop()] if len(out) > 1 and out[-1] == _gap(_THIN) else []
                out.append(self._script(out.pop(), token, depth))  # cos^2: before its gap
                out += gap
            else:
                if token[1:] in _FUNCTIONS and out and out[-1].startswith(("<mn", "<ms")):
                    out.append(_gap(_THIN))
                elif token in ("-", r"\pm") and _begins(out):
                    # Else a sign that follows another stands as far off as between two numbers.
                    sign = _operator("−" if token == "-" else "±")
                    out.append(sign.replace("<mo", '<mo form="prefix"'))
                    continue
                out += self._element(kind, token, depth)
        if depth:
            raise _Unknown(self._latex)
        return out

    def _element(self, kind: str, token: str, depth: int) -> list[str]:
        if kind == "number":
            return [f"<mn>{token}</mn>"]
        if kind == "word":
            return [f"<mi>{token}</mi>"]
        if kind == "mark":
            if token == "{":
                return [f"<mrow>{' '.join(self._rest_of_group(depth))}</mrow>"]
            return [_operator("−" if token == "-" else token)]
        command = token[1:]
        if command == "text":
            return [f"<mtext>{escaped(self._words())}</mtext>"]
        if command in _UPRIGHT:
            upright = f'<mi mathvariant="normal">{escaped(self._words())}</mi>'
            return [upright, _gap(_THIN)] if command == "operatorname" else [upright]
        if command == "sqrt":
            return [f"<msqrt>{''.join(self._group(depth))}</msqrt>"]
        if command == "pmod":
            inner = "".join(self._group(depth))
            inner = f"{_operator('(')}<mi>mod</mi> {_gap(_SPACE)}{inner}{_operator(')')}"
            return [_gap(_SPACE), f"<mrow>{inner}</mrow>"]
        if command in _FUNCTIONS:
            return [f"<mi>{command}</mi>", _gap(_THIN)]
        if command in _LETTERS:
            return [f"<mi>{_LETTERS[command]}</mi>"]
        if command in _OPERATORS:
            return [_operator(_OPERATORS[command])]
        if command in _GAPS:
            return [_gap(_GAPS[command])]
        raise _Unknown(self._latex)

    def _script(self, base: str, mark: str, depth: int) -> str:
        inner = self._group(depth)
        body = inner[0] if len(inner) == 1 else f"<mrow>{''.join(inner)}</mrow>"
        if body == "<mi>°</mi>":  # a degree sign stands high already
            return base.replace("</mn>", "°</mn>") if base.startswith("<mn>") else base + body
        tag = "msup" if mark == "^" else "msub"
        return f"<{tag}>{base}{body}</{tag}>"

    def _group(self, depth: int) -> list[str]:
        """What an index or a power takes: braces, or one token."""
        while self._at < len(self._tokens) and self._tokens[self._at][0] == "space":
            self._at += 1
        if self._at == len(self._tokens):
            raise _Unknown(self._latex)
        kind, token = self._tokens[self._at]
        self._at += 1
        if token == "{":
            return self._rest_of_group(depth)
        if kind == "mark":
            raise _Unknown(self._latex)
        return self._element(kind, token, depth + 1)

    def _rest_of_group(self, depth: int) -> list[str]:
        inner = self.row(depth + 1)
        self._at += 1
        return inner

    def _words(self) -> str:
        """The plain words in the braces of a text."""
        if self._at == len(self._tokens) or self._tokens[self._at][1] != "{":
            raise _Unknown(self._latex)
        words = ""
        for at in range(self._at + 1, len(self._tokens)):
            kind, token = self._tokens[at]
            if token == "}":
                self._at = at + 1
                return words
            if kind == "command" or token == "{":
                raise _Unknown(self._latex)
            words += token
        raise _Unknown(self._latex)


def _begins(row: list[str]) -> bool:
    """Whether what comes next begins a term, as after an equals sign or a gap."""
    return not row or row[-1] == _gap(_SPACE) or (row[-1].startswith("<mo") and ")" not in row[-1])


def _operator(sign: str) -> str:
    fixed = ' stretchy="false"' if sign in "()" else ""
    return f"<mo{fixed}>{escaped(sign)}</mo>"


def _gap(width: str) -> str:
    return f'<mspace width="{width}"></mspace>'
