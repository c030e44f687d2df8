"""Polynomials in joints, lengths and twists, as one reads them."""

from __future__ import annotations

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.equation import Equation, equation
from pinsing.algebra.ring import Poly, Ring

_DIGITS = 4
"""Characters of a coefficient up to which it is written exactly: lengths have more."""
_LONGEST = 24
"""Terms beyond which an equation is told by its size."""


@dataclass(frozen=True)
class DesignNames:
    """The names and offsets that polynomials of a design are written with.

    Attributes
    ----------
    ring : Ring
        Of the polynomials: in joints, then in symbols.
    n : int
        Number of joints.
    names : tuple of str
        Of joints and symbols.
    offset : array
        Radians added to each that is an angle.
    """

    ring: Ring
    n: int
    names: tuple[str, ...]
    offset: Array

    def equation(self, poly: Poly) -> Equation:
        """The polynomial as a sum of cosines and sines."""
        return equation(poly, self.ring, self.names, self.offset)

    def text(self, poly: Poly) -> str:
        """Its zeros in one line."""
        return text_of(self.equation(poly))

    def moves(self, poly: Poly) -> bool:
        """Whether a joint occurs."""
        return any(j < self.n for j in self.ring.joints_of(poly))


def text_of(e: Equation, latex: bool = False) -> str:
    """An equation as one reads it, its coefficients exact."""
    written = int((e.cos != 0).sum() + (e.sin != 0).sum())
    if written > _LONGEST and not latex:
        return f"f({', '.join(e.joints[j] for j in e.involved)}) = 0 [{len(e.cos)} terms]"
    whole = all(len(c) <= _DIGITS for pair in e.exact for c in pair)
    return (whole and e.exact_text(latex)) or (e.latex() if latex else e.text())
