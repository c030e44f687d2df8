"""What pinsing makes of a robot before it analyses anything."""

from __future__ import annotations

from dataclasses import field, replace
from typing import ClassVar

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.kinematics.engine import engine_name
from pinsing.kinematics.jacobian import generic_rank
from pinsing.prose import PLAIN, Page, Table
from pinsing.report.home_pose import SingularPose, singular_poses
from pinsing.robot.arm import Arm
from pinsing.robot.arm_summary import ArmSummary, summarize
from pinsing.robot.nominal import nominal
from pinsing.robot.second_reader import SecondReading
from pinsing.robot.snap import Snap
from pinsing.serialization import JsonResult

ROUNDING = 1e-9
"""Radians or metres: what the nominal geometry moves by less is not worth a line of its own."""


@dataclass(frozen=True, eq=False)
class ArmInfo(JsonResult):
    """An arm, its generic rank, and how exact its geometry is.

    Attributes
    ----------
    arm : ArmSummary
        Chain, joints, limits, tip, base, task, length scale, notes.
    kinds : tuple of str
        ``revolute``, ``continuous`` or ``prismatic``, one a joint.
    file : str
        The description file; empty for a model in memory.
    generic_rank : int
        Rank of the task Jacobian at almost every configuration.
    task_rows : int
        Rows of the task.
    snaps : tuple of Snap
        Numbers that the nominal geometry moves.
    jacobian_change : float
        Bound of what that changes in any column of the scaled task Jacobian.
    engine : str
        What computes batches of Jacobians for this arm on this machine.
    singular_poses : tuple of SingularPose
        Zero, neutral and named poses that are singular, each with a clear one near it.
    second_reading : SecondReading or None
        What yourdfpy reads in the same URDF; None where it was not asked, or the arm is from none.
    """

    schema: ClassVar[str] = "pinsing/info/2"

    arm: ArmSummary
    kinds: tuple[str, ...]
    file: str
    generic_rank: int
    task_rows: int
    snaps: tuple[Snap, ...]
    jacobian_change: float
    engine: str
    singular_poses: tuple[SingularPose, ...]
    second_reading: SecondReading | None = field(default=None, metadata={"optional": True})

    def head(self, page: Page = PLAIN) -> str:
        """Lines above the table of joints."""
        arm = self.arm
        rank = f"{self.generic_rank} ({arm.n} joints, {self.task_rows} task rows)"
        if self.generic_rank < min(arm.n, self.task_rows):
            rank += "; the joints are never independent in this task"
        elif arm.n > self.generic_rank:
            rank += f"; redundant by {arm.n - self.generic_rank}"
        rows = [("robot", arm.name)]
        if self.file:
            rows.append(("file", self.file))
        rows += [
            ("base", arm.base),
            ("tip", arm.tip),
            ("task", arm.task),
            ("length scale", f"{arm.length_scale:g} m"),
            ("generic rank", rank),
            ("geometry", self.geometry()),
            ("engine", self.engine),
        ]
        if self.second_reading is not None:
            rows.append(("second reader", str(self.second_reading)))
        return page.fields(rows)

    def geometry(self) -> str:
        """One sentence on raw and nominal geometry."""
        if self.jacobian_change <= 1e-12:
            return "exact: every number of the file is taken as it is"
        size = {"angle": 0.0, "length": 0.0, "twist": 0.0}
        count = dict.fromkeys(size, 0)
        for snap in self.snaps:
            size[snap.what] = max(size[snap.what], snap.size)
            count[snap.what] += 1
        said = [
            f"{count[what]} {what}{'s' if count[what] > 1 else ''} "
            f"(at most {size[what]:.1e} {'m' if what == 'length' else 'rad'})"
            for what in size
            if count[what]
        ]
        return (
            f"rounded in the file; made exact for closed forms by moving {', '.join(said)}; "
            f"this changes no Jacobian column by more than {self.jacobian_change:.1e}"
        )

    def joints(self, degrees: bool = False) -> Table:
        """Table of the joints."""
        arm = self.arm
        rows = []
        for i, name in enumerate(arm.joints):
            slides = bool(arm.prismatic[i])
            unit = "m" if slides else "deg" if degrees else "rad"
            factor = 180 / np.pi if degrees and not slides else 1.0
            low, high = (
                f"{limit * factor:.6g}" if np.isfinite(limit) else "none"
                for limit in (arm.lower[i], arm.upper[i])
            )
            rows.append((str(i + 1), name, self.kinds[i], low, high, unit))
        header = ("#", "joint", "type", "lower", "upper", "unit")
        return Table(header, tuple(rows), frozenset({0, 3, 4}))

    def poses(self, degrees: bool = False, room: int | None = None) -> list[str]:
        """A line for each pose that people begin with and that is singular."""
        arm = self.arm
        return [p.text(arm.source, arm.prismatic, degrees, room) for p in self.singular_poses]

    def __str__(self) -> str:
        return f"{self.head()}\n\n{PLAIN.table(self.joints())}"


def describe(arm: Arm) -> ArmInfo:
    """Gather what `ArmInfo` holds; among its notes are meshes that are not there."""
    exact = nominal(arm)
    # Without any limit a turning joint is continuous, as a URDF would call it.
    free = ~(np.isfinite(arm.lower) | np.isfinite(arm.upper))
    kinds = np.where(arm.prismatic, "prismatic", np.where(free, "continuous", "revolute"))
    return ArmInfo(
        arm=replace(summarize(arm), notes=(*arm.notes, *arm.source.mesh_notes)),
        kinds=tuple(str(k) for k in kinds),
        file="" if arm.source.path is None else str(arm.source.path),
        generic_rank=generic_rank(arm),
        task_rows=len(arm.task.rows),
        snaps=exact.snaps,
        jacobian_change=exact.jacobian_change,
        engine=engine_name(arm),
        singular_poses=singular_poses(arm),
    )
