"""One step of an inverse solution that has two answers, told apart by a sign."""

from __future__ import annotations

from collections.abc import Callable

from pinsing._dataclass import dataclass
from pinsing._types import Array


@dataclass(frozen=True, eq=False)
class SolutionStage:
    """A step in which at most two values are left, of opposite signs of ``value``.

    Attributes
    ----------
    name : str
        "shoulder", "elbow" or "wrist" where the field has a word for it; else of its joint.
    joint : int
        The joint that it finds.
    value : callable
        Of configurations (N, n): (N,). Not zero where the arm is not singular.
    reason : str
        Why there are at most two.
    """

    name: str
    joint: int
    value: Callable[[Array], Array]
    reason: str
