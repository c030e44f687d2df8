"""How many modes were found, in words."""

from __future__ import annotations


def noun(problem: str, count: int) -> str:
    """Of so many modes of a problem, ``direct`` or ``inverse``."""
    kind = "assembly mode" if problem == "direct" else "working mode"
    return kind if count == 1 else f"{kind}s"


def found_words(
    problem: str, count: int, starts: int, hits: list[int], beyond: int, bound: int | None,
    complete: bool,
) -> str:  # fmt: skip
    """What a search from random starts gave, and whether more can exist."""
    words = f"{count} {noun(problem, count)} found from {starts} starts"
    if beyond:
        words += f", {beyond} more pose{'s' * (beyond != 1)} beyond the joint limits"
    if complete:
        return f"{words}; no more can exist"
    once = sum(h == 1 for h in hits)
    words += "; more may exist"
    if once:
        words += f" ({once} of {len(hits)} poses {'was' if once == 1 else 'were'} met only once)"
    if bound is not None:
        words += f", at most {bound} with limits left aside"
    return words
