"""What making a geometry exact moved, and the decimal that a length is moved to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

from pinsing._dataclass import dataclass

ROUNDING = 1e-9
"""Radians, or metres, that count as rounding: right angles are put there whatever the tolerance."""


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


@dataclass(frozen=True)
class Deviation:
    """How far the geometry of an answer is from the file's, where that is more than rounding.

    Attributes
    ----------
    angle : float
        Radians; the largest angle that was moved to a multiple of 15 degrees.
    length : float
        Metres; the largest length that was put to zero, by ``snap_length`` alone.
    twist : float
        Radians, and so no entry of a rotation differs by more; the largest angle for which a
        rational rotation stands that is as near as ten digits tell.
    """

    angle: float
    length: float
    twist: float

    @classmethod
    def of(cls, snaps: Iterable[Snap]) -> Deviation | None:
        """What was moved by more than rounding; None where nothing was, and no twist replaced."""
        largest = {"angle": ROUNDING, "length": ROUNDING, "twist": 0.0}
        start = dict(largest)
        for snap in snaps:
            largest[snap.what] = max(largest[snap.what], snap.size)
        if largest == start:
            return None
        return cls(**{what: size if size > start[what] else 0.0 for what, size in largest.items()})

    @property
    def geometry(self) -> str:
        """What the answer is about."""
        if self.angle or self.length:
            return "the nominal design"
        return "a rational geometry beside the file's"

    @property
    def change(self) -> str:
        """By how much that differs from the file."""
        said = []
        if self.angle:
            degrees = math.degrees(self.angle)
            said.append(f"angles moved by at most {self.angle:.1e} rad ({degrees:.1g}°)")
        if self.twist:
            said.append(f"twists by at most {self.twist:.1e} rad, to rational rotations")
        moved = f"by at most {1e3 * self.length:.3g} mm" if self.length else "as written"
        return ", ".join([*said, f"lengths {moved}"])

    def __str__(self) -> str:
        return f"{self.geometry}: {self.change}"


def shortest_decimal(value: float, noise: float) -> Fraction:
    """The decimal with the fewest digits within float ``noise`` of a length: the one written."""
    for digits in range(16):
        rounded = round(value, digits)
        if abs(rounded - value) <= noise:
            return Fraction(repr(rounded))
    return Fraction(repr(value))
