"""What every target of the fuzzer answers with."""

from __future__ import annotations

Ended = tuple[str, str]


class Wrong(Exception):
    """What must not be, although nothing was raised; told as "unclear"."""


def refused(message: str) -> Ended:
    """Judge a message by itself: one line, printable, of a bearable length."""
    if not message.strip() or len(message) > 2000 or any(not c.isprintable() for c in message):
        raise Wrong(f"not a clear line: {message[:300]!r}")
    return "refused", message
