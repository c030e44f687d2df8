"""Places of a tree of cases, and what they are split by."""

from __future__ import annotations

from dataclasses import field
from typing import Any

from pinsing._dataclass import dataclass
from pinsing.algebra.ring import Poly
from pinsing.proof.squares import Squares

Values = dict[int, tuple[Poly, Poly]]
"""Joints at points (x : y)."""


class NotFound(Exception):
    """No tree of cases was found; says where."""


@dataclass(eq=False)
class Place:
    """One place of the tree, with how it is closed or split.

    Attributes
    ----------
    forms : list of Poly
        What vanishes: first a linear form for each joint that is at a value, then relations.
    values : dict of joint to (x, y)
        Constants.
    relations : list of Poly
        What else vanishes, with these values put in.
    points : bool
        Whether only real points are followed from here on, not whole components.
    family : int or None
        The family that it lies in: then it is closed.
    sum : list of Term
        What is split: forms as text, and the source that each is times.
    cases : list of (Poly, times, Place or None)
        Factors, how often each is there, and where it leads; None where that is empty, or too
        small for a component.
    squares : list of (Fraction, Poly)
        Instead of cases: factors and forms that are squared.
    then : Place or None
        Where squares lead to.
    """

    forms: list[Poly]
    values: Values
    relations: list[Poly]
    points: bool = False
    family: int | None = None
    sum: list[tuple[str, Any]] = field(default_factory=list)
    cases: list[tuple[Poly, int, Place | None]] = field(default_factory=list)
    squares: Squares = field(default_factory=list)
    then: Place | None = None


@dataclass(frozen=True)
class Split:
    """A form that vanishes on all components of a place, as a sum of multiples of sources."""

    sum: list[tuple[Poly, Any]]
    form: Poly


def place_text(place: Place) -> str:
    """A place in a few words, for messages."""
    values = ", ".join(f"joint {j + 1} at {x}:{y}" for j, (x, y) in sorted(place.values.items()))
    relations = ", ".join(f"{len(p)} terms" for p in place.relations)
    return f"[{values or 'anywhere'}; {relations or 'no relations'}]"
