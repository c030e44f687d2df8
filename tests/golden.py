"""Cases that stand in a data file: text that is read, and exactly what is said of it.

A case is a line ``=== HEAD``, the text, a line ``>>>``, and what is said. ``PINSING_WORDS=1``
writes anew what is said.
"""

import os
from pathlib import Path


class Golden:
    """The cases of a file, by their heads."""

    def __init__(self, path: Path) -> None:
        self.path = path
        blocks = path.read_text(encoding="utf-8").split("=== ")[1:]
        parts = {head: rest for head, _, rest in (block.partition("\n") for block in blocks)}
        self.cases = {head: tuple(rest.split(">>>\n")) for head, rest in parts.items()}
        assert len(parts) == len(blocks), f"{path}: a head is there twice"

    def text(self, head: str) -> str:
        return self.cases[head][0]

    def hold(self, head: str, said: str) -> None:
        """What is said of a case is what the file has."""
        text, before = self.cases[head]
        if os.environ.get("PINSING_WORDS"):
            start, whole = f"=== {head}\n{text}>>>\n", self.path.read_text(encoding="utf-8")
            whole = whole.replace(start + before, f"{start}{said.strip()}\n\n")
            self.path.write_text(whole, encoding="utf-8")
        else:
            assert said.strip() == before.strip()
