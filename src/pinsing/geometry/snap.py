"""What making a geometry exact moved, and the decimal that a length is moved to."""

from __future__ import annotations

from fractions import Fraction

from pinsing._dataclass import dataclass

_WRITTEN_DIGITS = 8


@dataclass(frozen=True)
class Snap:
    """One number of the geometry that was moved.

    Attributes
    ----------
    where : str
        Between which joints.
    what : str
        ``angle``, ``length``, or ``twist`` (a rational rotation near the given one).
    raw, nominal : float
        Value before and after, radians or metres.
    """

    where: str
    what: str
    raw: float
    nominal: float

    @property
    def size(self) -> float:
        """Distance moved, radians or metres."""
        return abs(self.nominal - self.raw)

    def __str__(self) -> str:
        unit = "m" if self.what == "length" else "rad"
        return (
            f"{self.where}: {self.what} {self.raw:.10g} -> {self.nominal:.10g} {unit} "
            f"(moved {self.size:.1e})"
        )


def shortest_decimal(value: float, slack: float, noise: float) -> Fraction:
    """Decimal value of a length.

    A number that is a short decimal already (to float ``noise``) is kept: somebody wrote it.
    Any other is the product of rounded angles, and becomes the decimal with the fewest
    digits within ``slack``.
    """
    written = round(value, _WRITTEN_DIGITS)
    tolerance = noise if abs(written - value) <= noise else max(slack, noise)
    for digits in range(16):
        rounded = round(value, digits)
        if abs(rounded - value) <= tolerance:
            return Fraction(repr(rounded))
    return Fraction(repr(value))
