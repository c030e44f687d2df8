"""What a result remembers of the arm it was computed for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.robot.arm import Arm
from pinsing.robot.joint_space import JointSpace


@dataclass(frozen=True, eq=False)
class ArmSummary:
    """Plain data of an Arm, for printing, JSON and loading it again.

    Attributes
    ----------
    name, source, tip, base, task : str
        As on the arm; ``source`` is the path or name it was loaded from.
    joints : tuple of str
        Free joints, base to tip.
    prismatic : (n,) array of bool
        Which of them slide.
    lower, upper : (n,) arrays
        Limits, radians or metres; infinite for continuous joints.
    length_scale : float
        Metres.
    notes : tuple of str
        What was assumed while loading.
    """

    name: str
    source: str
    tip: str
    base: str
    task: str
    joints: tuple[str, ...]
    prismatic: npt.NDArray[np.bool_]
    lower: Array
    upper: Array
    length_scale: float
    notes: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @property
    def space(self) -> JointSpace:
        """Its joints alone: limits, and what is outside of them."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, self.length_scale)


def summarize(arm: Arm) -> ArmSummary:
    """Plain data of ``arm``."""
    return ArmSummary(
        name=arm.name,
        # A name that is no UTF-8 has no place in JSON.
        source=arm.source.label.encode("utf-8", "backslashreplace").decode(),
        tip=arm.tip,
        base=arm.base,
        task=arm.task.name,
        joints=arm.joints,
        prismatic=arm.prismatic,
        lower=arm.lower,
        upper=arm.upper,
        length_scale=arm.length_scale,
        notes=arm.notes,
    )
