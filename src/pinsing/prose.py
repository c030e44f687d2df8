"""Text for people: at the width of their terminal, a few words in colour, names made safe."""

from __future__ import annotations

import os
import re
import sys
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TextIO

WIDTH = 100
"""Columns where there is no terminal."""

NARROWEST, WIDEST = 60, 200
"""Columns that text is fitted to: longer lines are hard to follow, shorter ones hold nothing."""

LISTED = 8
"""Entries of a list that are shown; of longer ones it is said how many more there are."""

_LEAST = 20  # columns that a wrapped text keeps, however deep its indent
_KEPT = "\u00a0"  # a space that is no place to break at


class Tone(Enum):
    """What a coloured word tells, with its sequence of ANSI (ECMA-48, "select graphic")."""

    ALARM = "\x1b[1;31m"
    CAUTION = "\x1b[33m"
    GOOD = "\x1b[32m"


_END = "\x1b[0m"
_PAINT = re.compile("|".join(re.escape(code) for code in (*(t.value for t in Tone), _END)))


@dataclass(frozen=True)
class Toned:
    """Words that are coloured where colours are shown."""

    text: str
    tone: Tone


Span = str | Toned


def alarm(text: str) -> Toned:
    """Such as ``SINGULAR``."""
    return Toned(text, Tone.ALARM)


def caution(text: str) -> Toned:
    """Such as ``near-singular``."""
    return Toned(text, Tone.CAUTION)


def good(text: str) -> Toned:
    """Such as ``complete``."""
    return Toned(text, Tone.GOOD)


def verdict(status: str, text: str = "") -> Span:
    """A status, or a text that tells it, in the colour of the status."""
    text = text or status
    return {"singular": alarm(text), "near-singular": caution(text)}.get(status, text)


_LOUD: dict[str, Span] = {
    "SINGULAR": alarm("SINGULAR"),
    "NOT DECIDED": caution("NOT DECIDED"),
    "NOT complete": caution("NOT complete"),
}
_LOUD_WORDS = re.compile(rf"\b({'|'.join(_LOUD)})\b")
_HEAD = re.compile(r" *(?:\d+  )?")  # an indent, and the number in a list


def listed(words: Sequence[str]) -> str:
    """Return ``a, b and c``; an empty text for none."""
    *head, last = words or [""]
    return f"{', '.join(head)} and {last}" if head else last


def unbroken(text: str) -> str:
    """A text whose spaces are no places to break a line at."""
    return text.replace(" ", _KEPT)


def measured(text: str) -> str:
    """A text whose vectors, and numbers with their units, stay whole: ``(0.1, 0.2, 0.3) m``."""
    text = re.sub(r"\(-?\d[^()]*\)(?= m\b)?", lambda found: unbroken(found[0]), text)
    return re.sub(r"(?<=[\d)]) (?=(?:m|rad|deg|m/s|rad/s|m/rad|ms|s)\b)", _KEPT, text)


def formula(text: str) -> str:
    """Return a condition that breaks between terms and conditions only, and after a colon."""
    condition, colon, words = text.partition(": ")
    loose = re.sub(r" (?=[-+=] |and |or |\()", "\n", condition)
    loose = re.sub(r"(?<=;) ", "\n", loose)
    return unbroken(loose).replace("\n", " ") + colon + words


def safe(text: str, painted: bool = False) -> str:
    """Show control characters, escape sequences and invisible marks in place of obeying them."""
    # Names come out of files that anybody may have written. Newlines and tabs stay; so do the few
    # sequences of ``Tone`` if the text is ``painted``.
    if painted:
        plain, codes = _PAINT.split(text), [*_PAINT.findall(text), ""]
        return "".join(safe(p) + code for p, code in zip(plain, codes, strict=True))
    return visible(text, keep="\n\t")


def visible(text: str, keep: str = "") -> str:
    """A text with an escape in place of each character that is not shown, as of a line break."""
    return "".join(
        c if c.isprintable() or c in keep else c.encode("unicode_escape").decode("ascii")
        for c in text
    )


def columns(text: str) -> int:
    """Columns that a line takes: letters of East Asian scripts take two, accents none."""
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1
        for c in text
    )


def is_terminal(stream: TextIO) -> bool:
    """Return True if a person reads it as it is written."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def shows_colour(stream: TextIO) -> bool:
    """Return True if to colour: at a terminal alone, and not against NO_COLOR (no-color.org)."""
    return is_terminal(stream) and not os.environ.get("NO_COLOR")


@dataclass(frozen=True)
class Page:
    """What text is written on."""

    width: int = WIDTH  # columns
    colour: bool = False  # a few words are coloured

    @staticmethod
    def of(stream: TextIO | None = None) -> Page:
        """Return the terminal behind ``stream`` (stdout), or a plain page of 100 columns."""
        # COLUMNS counts only where a terminal does not tell its width: programs that use readline
        # leave it to their children, whatever these write to.
        stream = sys.stdout if stream is None else stream
        if not stream.isatty():
            return Page(WIDTH)
        try:
            width = os.get_terminal_size(stream.fileno()).columns
        except (OSError, ValueError):  # no file behind it
            width = 0
        asked = os.environ.get("COLUMNS", "")
        if not width and asked.isdecimal():
            width = int(asked)
        width = min(max(width, NARROWEST), WIDEST) if width else WIDTH
        return Page(width, shows_colour(stream))

    def paint(self, span: Span) -> str:
        """One span, safe, with its colour if colours are shown."""
        return self._toned(span, safe(span if isinstance(span, str) else span.text))

    def _toned(self, span: Span, text: str) -> str:
        """Safe words of a span, with its colour if colours are shown."""
        if isinstance(span, str) or not self.colour or not text:
            return text
        return f"{span.tone.value}{text}{_END}"

    def paragraph(self, *spans: Span, first: str = "", rest: str | None = None) -> str:
        """Return wrapped text, indented by ``first``, then ``rest`` (as many spaces by default)."""
        # Lines break at spaces only; a word longer than the page, such as a path, stays whole.
        rest = " " * columns(first) if rest is None else rest
        lines: list[str] = []
        line, used, head = "", 0, first
        for word, size in self._words(spans):
            if line and used + 1 + size > max(self.width - columns(head), _LEAST):
                lines.append(head + line)
                line, used, head = word, size, rest
            else:
                line, used = (f"{line} {word}", used + 1 + size) if line else (word, size)
        return "\n".join([*lines, head + line]).replace(_KEPT, " ")

    def _words(self, spans: Sequence[Span]) -> list[tuple[str, int]]:
        """Words with their columns; one may be made of pieces of different tones."""
        words = [("", 0)]
        for span in spans:
            text = span if isinstance(span, str) else span.text
            for k, piece in enumerate(re.split("[ \n\t]", text)):
                if k:
                    words.append(("", 0))
                kept, (before, size) = visible(piece, keep=_KEPT), words[-1]
                words[-1] = (before + self._toned(span, kept), size + columns(kept))
        return [word for word in words if word[0]]

    def fitted(self, text: str) -> str:
        """Return finished lines, long ones wrapped under their beginning, loud words in colour."""
        # What is to be pasted, ``--q ...``, stays whole.
        lines = []
        for line in text.split("\n"):
            head = _HEAD.match(line)
            first = head[0] if head else ""
            spans = [_LOUD.get(piece, piece) for piece in _LOUD_WORDS.split(line[len(first) :])]
            if columns(safe(line)) <= self.width or line.lstrip().startswith("--"):
                lines.append(first + "".join(map(self.paint, spans)))
            else:
                rest = " " * (columns(first) + (0 if first.strip() else 2))
                lines.append(self.paragraph(*spans, first=first, rest=rest))
        return "\n".join(lines)

    def fields(self, pairs: Iterable[tuple[str, Span | Sequence[Span]]], label: int = 0) -> str:
        """Return aligned ``label  text`` lines, long text wrapped under itself."""
        # ``label`` is the least width of the first column.
        pairs = list(pairs)
        indent = max([label, *(columns(head) + 2 for head, _ in pairs)])
        return "\n".join(
            self.paragraph(
                *((text,) if isinstance(text, str | Toned) else text),
                first=safe(head) + " " * (indent - columns(safe(head))),
                rest=" " * indent,
            ).rstrip()
            for head, text in pairs
        )

    def table(self, table: Table) -> str:
        """Columns two spaces apart; where they are too wide, the widest wrap their cells."""
        rows = [tuple(safe(cell) for cell in row) for row in (table.header, *table.rows)]
        count = len(table.header)
        widths = [max(columns(row[k]) for row in rows) for k in range(count)]
        room = self.width - 2 * (count - 1)
        words = [max(columns(w) for r in rows for w in r[k].split() or ("",)) for k in range(count)]
        widths = _narrowed(widths, words, room)  # between words where that does
        widths = _narrowed(widths, [min(w, _LEAST // 2) for w in words], room)
        lines: list[str] = []
        for row in rows:
            cells = [self._cell(cell, widths[k]) for k, cell in enumerate(row)]
            for part in range(max(len(cell) for cell in cells)):
                texts = [cell[part] if part < len(cell) else "" for cell in cells]
                lines.append(
                    "  ".join(
                        _aligned(text, widths[k], k in table.right) for k, text in enumerate(texts)
                    ).rstrip()
                )
        return "\n".join(lines)

    def _cell(self, text: str, width: int) -> list[str]:
        """A cell as lines of at most ``width`` columns; long names are cut where they must be."""
        if columns(text) <= width:
            return [text]
        lines: list[str] = []
        for word in text.split():
            if lines and columns(lines[-1]) + 1 + columns(word) <= width:
                lines[-1] += " " + word
                continue
            lines.append("")
            for letter in word:
                if columns(lines[-1] + letter) > width:
                    lines.append("")
                lines[-1] += letter
        return lines or [""]


PLAIN = Page()
"""100 columns without colours: what ``str`` of a result is written on."""


@dataclass(frozen=True)
class Table:
    """Rows of text under a header."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: frozenset[int] = frozenset()  # columns of numbers, aligned to the right


def _narrowed(widths: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Widths that fit the room, taken from the widest first and never below the least."""
    widths = list(widths)
    while sum(widths) > room:
        spare = [k for k, width in enumerate(widths) if width > least[k]]
        if not spare:
            break  # as narrow as it gets: such a table runs over
        widths[max(spare, key=lambda k: widths[k])] -= 1
    return widths


def _aligned(text: str, width: int, right: bool) -> str:
    gap = " " * max(width - columns(text), 0)
    return gap + text if right else text + gap


def shortened(text: str, most: int) -> str:
    """The beginning of a text that is longer than so many letters."""
    return text if len(text) <= most else text[: most - 3] + "..."


def escaped(words: str) -> str:
    """Words without what HTML would take for its own; characters that hide or turn text shown."""
    import html  # with all names of characters: a command without a page can do without

    return html.escape(visible(words, keep="\n\t" + _KEPT))


def one_line(kind: str, text: str) -> str:
    """Return ``<kind: first line of text>``, short and without control characters."""
    first = text.strip().splitlines()[0] if text.strip() else ""
    cut = shortened(visible(first), WIDTH)
    return f"<{kind}: {cut}>" if cut else f"<{kind}>"


def html_text(words: str, block: bool = False) -> str:
    """Words as HTML that no page takes for mathematics; a ``block`` keeps its lines."""
    tag = "pre" if block else "span"
    return f'<{tag} class="tex2jax_ignore mathjax_ignore">{escaped(words)}</{tag}>'
