"""Cases that stand in a data file: text that is read, and exactly what is said of it.

A case is a line ``=== HEAD``, the text, a line ``>>>``, and what is said. ``PINSING_WORDS=1``
writes anew what is said. A head that ends in ``(slow)`` is of the slow tier; a line said that ends
in ``...`` goes on in the words of another program. What stands before the first case is a good
file, of which the text of a case may be changes: lines of ``- old`` and of ``+ new``.
"""

import os
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any

import pytest


class Golden:
    """The cases of a file, by their heads."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.good, *blocks = path.read_text(encoding="utf-8").split("=== ")
        self.good = self.good.rstrip() + "\n"
        parts = {head: rest for head, _, rest in (block.partition("\n") for block in blocks)}
        self.cases = {head: tuple(rest.split(">>>\n")) for head, rest in parts.items()}
        assert len(parts) == len(blocks), f"{path}: a head is there twice"

    def heads(self, *before: Any) -> list[Any]:
        """For ``parametrize``, with other arguments before them."""
        slow = {head: [pytest.mark.slow] * head.endswith("(slow)") for head in self.cases}
        return [pytest.param(*before, head, marks=marks) for head, marks in slow.items()]

    def text(self, head: str) -> str:
        """What is read: the text of the case, or the good file as it changes that."""
        text = self.cases[head][0]
        if not text.startswith("- ") or not self.good.strip():
            return text
        runs = [(s, [*lines]) for s, lines in groupby(text.splitlines(), lambda line: line[:1])]
        parts = ["\n".join(line[2:] for line in lines) for _, lines in runs]
        text = self.good
        for old, new in zip(parts[::2], parts[1::2], strict=True):
            assert text.count(old) == 1, f"{head}: {old}"
            text = text.replace(old, new)
        return text

    def hold(self, head: str, said: str) -> None:
        """What is said of a case is what the file has."""
        text, before = self.cases[head]
        pairs = zip_longest(said.strip().split("\n"), before.strip().split("\n"), fillvalue="")
        lines = [b if b.endswith("...") and a.startswith(b[:-3]) else a for a, b in pairs]
        said = "\n".join(lines).strip()
        if os.environ.get("PINSING_WORDS"):
            start, whole = f"=== {head}\n{text}>>>\n", self.path.read_text(encoding="utf-8")
            whole = whole.replace(start + before, f"{start}{said}\n\n")
            self.path.write_text(whole, encoding="utf-8")
        else:
            assert said == before.strip()
