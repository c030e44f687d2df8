"""What the page is made of: rows of printed against computed values, and sections of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

AGREES = "agrees"
DIFFERS = "differs"
INCOMPLETE = "incomplete"
EXTENDED = "overcome"

VERDICTS = {
    AGREES: "the printed value is the computed one, to the digits printed",
    DIFFERS: "the printed value does not follow from the paper's own tables",
    INCOMPLETE: "true as far as it goes, but something is missing",
    EXTENDED: "a limit stated in the paper that no longer holds",
}


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes
    ----------
    what : str
        The quantity, with the configuration.
    printed, computed : str
        As the paper has it, and as pinsing finds it.
    verdict : str
        One of VERDICTS.
    reason : str
        Why, or what follows.
    """

    what: str
    printed: str
    computed: str
    verdict: str
    reason: str = ""

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise ValueError(f"unknown verdict {self.verdict!r}")


@dataclass(frozen=True)
class Figure:
    """A picture of the page.

    Attributes
    ----------
    name : str
        Stem of its file.
    caption : str
        What it shows, and what it says.
    """

    name: str
    caption: str


@dataclass(frozen=True)
class Table:
    """A table that is no comparison.

    Attributes
    ----------
    head : tuple of str
    rows : tuple of tuple of str
    caption : str
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A part of the page: words, comparisons, tables, figures, in this order."""

    title: str
    text: tuple[str, ...] = ()
    rows: tuple[Row, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    after: tuple[str, ...] = field(default=())


def same(printed: float, computed: float, digits: int) -> bool:
    """Whether a value rounds (or is cut) to the printed one with so many decimals."""
    unit = 10.0**-digits
    return abs(printed - computed) <= unit * (1 + 1e-9)


def judged(what: str, printed: str, computed: float, reason: str = "", digits: int = 0) -> Row:
    """Row of a printed number; agreement means to its last digit, rounded or cut."""
    decimals = len(printed.partition(".")[2])
    agrees = same(float(printed), computed, decimals)
    shown = f"{computed:.{max(decimals + 2, digits)}f}"
    return Row(what, printed, shown, AGREES if agrees else DIFFERS, reason)


def tiny(value: float, below: float = 1e-12) -> str:
    """A number that should be zero: rounding differs between machines, so it is not printed."""
    return f"below {below:.0e}" if abs(value) < below else f"{value:.2g}"


def count(sections: Sequence[Section]) -> dict[str, int]:
    """Number of rows of each verdict."""
    rows = [row for s in sections for row in s.rows]
    return {v: sum(row.verdict == v for row in rows) for v in VERDICTS}
