"""Cases of data files: each has a name, what it changes in a good file, and what is said then.

Such a file begins with what it is about, and with the good file. The lines of a case are ``- old``
and ``+ new``, what of the good file is replaced by what (``+`` alone: the whole of it), and
``! answer`` for each. An answer that ends in ``...`` goes on in the words of another program. A
case that takes long has ``(slow)`` behind its name.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any

import pytest

_MARK = "\n=== "


@dataclass(frozen=True)
class Case:
    """A name, a text, the answers that are expected, and where both stand."""

    name: str
    text: str
    answers: tuple[str, ...]
    file: Path
    block: str

    def check(self, found: Sequence[str]) -> None:
        """These are the answers: ``PINSING_WORDS=1 pytest`` writes them into the file."""
        pairs = zip_longest(found, self.answers, fillvalue="")
        found = [e if e.endswith("...") and a.startswith(e[:-3]) else a for a, e in pairs]
        if os.environ.get("PINSING_WORDS"):
            kept = [line for line in self.block.split("\n") if line and line[0] != "!"]
            anew = "\n".join([*kept, *(f"! {answer}" for answer in found), ""])
            text = self.file.read_text().replace(f"{_MARK}{self.block}", f"{_MARK}{anew}")
            self.file.write_text(text)
        assert tuple(found) == self.answers


def good(file: Path) -> str:
    """The good file of such a file."""
    return file.read_text().split(_MARK)[1].partition("\n")[2]


def cases(*files: Path) -> list[Any]:
    """Those of all the files, for ``parametrize``."""
    out = []
    for file in files:
        blocks = file.read_text().split(_MARK)[2:]
        out += [_case(file, good(file), block) for block in blocks]
    return out


def _case(file: Path, text: str, block: str) -> Any:
    name, *lines = block.split("\n")
    parts: dict[str, list[str]] = {"-": [], "+": [], "!": [], "": []}
    for sign, run in groupby(lines, key=lambda line: line[:1]):
        parts[sign].append("\n".join(line[2:] for line in run))
    olds, news = parts["-"] or [text], parts["+"] or [""]
    for old, new in zip(olds, news, strict=True):
        assert text.count(old) == 1, (name, old)
        text = text.replace(old, new)
    answers = tuple("\n".join(parts["!"]).splitlines())
    name, slow, _ = name.partition(" (slow)")
    marks = pytest.mark.slow if slow else ()
    return pytest.param(
        Case(name, text, answers, file, block), id=f"{file.stem}, {name}", marks=marks
    )
