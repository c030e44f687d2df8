"""What `pinsing.inverse` answers: the inverse solutions of a pose."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import field
from typing import ClassVar

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.joint_text import typed
from pinsing.robot.arm_summary import ArmSummary
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class InverseSolution:
    """One configuration that reaches the pose.

    Attributes
    ----------
    q : (n,) array
        Joint values; of copies that differ by whole turns one, within the limits where one is:
        from -pi to pi if that is within, else nearest to the middle of the limits.
    regular : bool
        Whether it is not singular: then it is isolated, and moves smoothly with the pose. Where
        joints are held this is about the others: they meet all conditions.
    sigma_ratio : float
        sigma_r / sigma_1: what the verdict stands on.
    within_limits : bool
        Whether all joints are within their limits.
    met : int
        How many starts led here, random or made.
    error : float
        What is left of the pose, radians and metres over the length scale.
    radius : float
        A true solution of the pose, regular and the only one, is proven to be within this distance
        of q in joint space (`pinsing.postures.kantorovich`); infinite where that is not proven.
    """

    q: Array
    regular: bool
    sigma_ratio: float
    within_limits: bool
    met: int
    error: float
    radius: float = field(default=math.inf, metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class InverseSolutions(JsonResult):
    """The inverse solutions of a pose, as far as they were found.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    position : (3,) array
        Of the tip in the base frame, metres.
    rotation : (3, 3) array or None
        Of the tip; None where it does not matter to the task.
    fixed : dict of str to float
        Joints that were held, where the arm has more than the task needs.
    solutions : tuple of InverseSolution
        Those within the limits first, best conditioned first.
    starts : int
        Random starts that were made.
    doubt : str
        What speaks against that these are all; empty where nothing does.
    notes : tuple of str
        What one should know.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> len(pinsing.inverse(arm, [0.3, 0.2, 0.4, 3, 0.2, 0.1]))
    8
    """

    schema: ClassVar[str] = "pinsing/inverse/1"
    made_by: ClassVar[str] = "pinsing.inverse(arm, pose)"

    arm: ArmSummary
    position: Array
    rotation: Array | None
    fixed: dict[str, float]
    solutions: tuple[InverseSolution, ...]
    starts: int
    doubt: str
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.solutions)

    def __iter__(self) -> Iterator[InverseSolution]:
        return iter(self.solutions)

    def __getitem__(self, index: int) -> InverseSolution:
        return self.solutions[index]

    @property
    def certified(self) -> int:
        """How many different regular solutions are proven to exist: there are no fewer."""
        turns = ~self.arm.prismatic
        kept: list[InverseSolution] = []
        for s in self.solutions:
            apart = math.isfinite(s.radius)
            for k in kept:
                gap = s.q - k.q
                gap[turns] = np.remainder(gap[turns] + math.pi, 2 * math.pi) - math.pi
                apart &= bool(np.linalg.norm(gap) > s.radius + k.radius)
            if apart:
                kept.append(s)
        return len(kept)

    @property
    def q(self) -> Array:
        """All of them, (K, n)."""
        n = len(self.arm.joints)
        return np.array([s.q for s in self.solutions]).reshape(-1, n)

    @checked
    def text(self, degrees: bool = False) -> str:
        """Lines for people.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> arm = pinsing.load("scara")
        >>> print(pinsing.inverse(arm, [9, 0, 0, 0, 0, 0]).text().splitlines()[0])
        no inverse solution was found from 256 starts: the pose seems out of reach
        """
        count = len(self.solutions)
        if not count:
            head = f"no inverse solution was found from {self.starts} starts"
            lines = [head if self.doubt else f"{head}: the pose seems out of reach"]
        else:
            inside = sum(s.within_limits for s in self.solutions)
            lines = [
                f"{count} inverse solution{'s' * (count != 1)} found from {self.starts} starts, "
                f"{inside} within the joint limits"
            ]
        for k, s in enumerate(self.solutions, 1):
            said = [] if s.regular else ["SINGULAR"]
            said += [] if s.within_limits else ["outside the limits"]
            tail = f"   ({', '.join(said)})" if said else ""
            lines.append(f"{k:>4}  {typed(s.q, self.arm.prismatic, degrees, digits=6)}{tail}")
        if self.doubt:
            lines.append(f"note: {self.doubt}")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])

    def __str__(self) -> str:
        return self.text()
