"""What making a geometry exact moved."""

from __future__ import annotations

from dataclasses import dataclass


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
