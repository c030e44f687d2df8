"""Text for people: names made safe, tables that suit a terminal or a pipe."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TextIO


def safe(text: str) -> str:
    """Show control characters, escape sequences and invisible marks in place of obeying them.

    Names come out of files that anybody may have written. Newlines and tabs stay.
    """
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode("ascii")
        for c in text
    )


def is_rich(stream: TextIO) -> bool:
    """Whether to draw for a person at a terminal: not into a pipe, nor against NO_COLOR."""
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"


@dataclass(frozen=True)
class Table:
    """Rows of text under a header.

    Attributes
    ----------
    header : tuple of str
        One a column.
    rows : tuple of tuples of str
        Each as long as the header.
    right : frozenset of int
        Columns of numbers, aligned to the right.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: frozenset[int] = frozenset()

    def plain(self) -> str:
        """Columns two spaces apart, the last one free to run on."""
        lines = [tuple(safe(cell) for cell in row) for row in (self.header, *self.rows)]
        widths = [max(len(row[k]) for row in lines) for k in range(len(self.header))]
        return "\n".join(
            "  ".join(
                cell.rjust(width) if k in self.right else cell.ljust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in lines
        )

    def show(self, stream: TextIO | None = None) -> None:
        """Print, drawn with rich on a terminal, plain anywhere else."""
        stream = sys.stdout if stream is None else stream
        if not is_rich(stream):
            print(self.plain(), file=stream)
            return
        import rich.box
        from rich.console import Console
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(box=rich.box.SIMPLE_HEAD, pad_edge=False)
        for k, title in enumerate(self.header):
            table.add_column(Text(safe(title)), justify="right" if k in self.right else "left")
        for row in self.rows:
            table.add_row(*(Text(safe(cell)) for cell in row))
        Console(file=stream).print(table)


def fields(pairs: Iterable[tuple[str, str]], width: int = 100) -> str:
    """Aligned ``label  text`` lines, long text wrapped under itself."""
    pairs = list(pairs)
    indent = max((len(label) for label, _ in pairs), default=0) + 2
    lines: list[str] = []
    for label, text in pairs:
        wrapped = textwrap.wrap(
            text, max(width - indent, 20), break_long_words=False, break_on_hyphens=False
        ) or [""]
        labels = [label, *[""] * (len(wrapped) - 1)]
        lines += [
            f"{head:<{indent}}{part}".rstrip() for head, part in zip(labels, wrapped, strict=True)
        ]
    return "\n".join(lines)


def joined(names: Sequence[str], limit: int = 8) -> str:
    """Names with commas, cut after ``limit`` with the count of the rest."""
    more = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {more} more" if more > 0 else "")
