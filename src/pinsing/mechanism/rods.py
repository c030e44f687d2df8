"""Bounds known for mechanisms whose legs pass one force each."""

from __future__ import annotations

from pinsing.robot.mechanism import Mechanism


def most_assemblies(mechanism: Mechanism) -> int | None:
    """How many poses given inputs can have at most; None where no number is known."""
    return None
