"""What pinsing makes of a robot before it analyses anything."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from pinsing.arguments import typed
from pinsing.errors import PinsingError
from pinsing.families import closed_form
from pinsing.kinematics.jacobian import SINGULAR_RTOL, engine_name, generic_rank, ratios
from pinsing.measures import ROUNDING, Array, Bool
from pinsing.prose import PLAIN, Page, Table
from pinsing.proximity.suggestion import suggest
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import (
    AxisDifference,
    Snap,
    assumptions,
    design_of,
    deviation_of,
    differences,
    flatten,
    jacobian_change,
    nominal,
)
from pinsing.robot.second_reader import SecondReading
from pinsing.serialization import JsonResult

_SECONDS = 2.0
"""Time for the closed form; where it needs more, the command that takes it is named."""


@dataclass(frozen=True, eq=False)
class SingularPose:
    """A pose that people begin with and that is singular."""

    name: str  # "zero", "neutral" (zero, moved into the limits) or the model's
    q: Array  # (n,), radians and metres
    within_limits: bool
    families: tuple[str, ...]  # those that it is on, if found in short time
    instead: Array | None  # (n,), a clear configuration near it, unless that would take long
    clearance: float  # proven, of ``instead``; 0 without it

    def text(
        self, robot: str, prismatic: Bool, degrees: bool = False, room: int | None = None
    ) -> str:
        """One line: what is singular, and a configuration to paste or the command for one."""
        outside = "" if self.within_limits else ", which is outside the limits,"
        on = f" (on {', '.join(self.families)})" if self.families else ""
        said = f"the {self.name} pose{outside} is singular{on}"
        if self.instead is None:
            return f"{said}; pinsing at --suggest {robot} finds one that is not"
        far = f"{np.floor(np.degrees(self.clearance) * 100) / 100:g}°"
        pose = typed(self.instead, prismatic, degrees, digits=8, room=room)
        return (
            f"{said}; the next is near it, {far} or more from every singular one (proven): {pose}"
        )


def singular_poses(arm: Arm) -> tuple[SingularPose, ...]:
    """Zero, neutral and named poses of an arm that are singular."""
    exact = nominal(arm).arm
    named: list[tuple[str, Array]] = []
    for name, q in (("zero", np.zeros(arm.n)), *named_poses(arm, neutral=arm.source.reference)):
        known = any(np.array_equal(q, other) for _, other in named)
        if not known and min(float(ratios(a, q)[0]) for a in (exact, arm)) <= SINGULAR_RTOL:
            named.append((name, q))
    if not named:
        return ()
    form = closed_form(arm, seconds=_SECONDS, prove=False)
    out = []
    for name, q in named:
        instead, clearance = None, 0.0
        if form.complete and form.families:
            with contextlib.suppress(PinsingError):  # too far outside the limits
                found = suggest(arm, near=q, forms=form, work=1.5)
                if found.lower > 0:
                    instead, clearance = found.q, found.lower
        on = tuple(f.name for f in form.families if f.real and bool(f.contains(q)))
        out.append(SingularPose(name, q, bool(arm.within_limits(q)), on, instead, clearance))
    return tuple(out)


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
    assumed : tuple of AxisDifference
        How far each axis is from that of the design that families are of; empty without one.
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
    assumed: tuple[AxisDifference, ...] = field(default=(), metadata={"optional": True})
    second_reading: SecondReading | None = field(default=None, metadata={"optional": True})

    def head(self, page: Page = PLAIN) -> str:
        """Lines above the table of joints."""
        arm = self.arm
        rank = f"{self.generic_rank} ({arm.n} joints, {self.task_rows} task rows)"
        if self.generic_rank < min(arm.n, self.task_rows):
            rank += "; the joints are never independent in this task"
        elif arm.n > self.generic_rank:
            rank += f"; redundant by {arm.n - self.generic_rank}"
        rows = [
            ("robot", arm.name),
            ("file", replace(arm, source=self.file).described),
            ("base", arm.base),
            ("tip", arm.tip),
            ("task", arm.task),
            ("length scale", f"{arm.length_scale:g} m"),
            ("generic rank", rank),
            ("geometry", self.geometry()),
            ("engine", self.engine),
            ("second reader", str(self.second_reading or "")),
        ]
        return page.fields([row for row in rows if row[1]])

    def geometry(self) -> str:
        """One sentence on raw and nominal geometry, or on the design that is assumed."""
        if self.assumed:
            return f"families are of {deviation_of(self.assumed)}; {assumptions(self.assumed)}"
        if not any(snap.size > 1e-12 for snap in self.snaps):
            return "exact: every number of the file is taken as it is"
        sizes = {
            what: [snap.size for snap in self.snaps if snap.what == what]
            for what in ("angle", "length", "twist")
        }
        said = [
            f"{len(each)} {what}{'s' if len(each) > 1 else ''} "
            f"(at most {max(each):.1e} {'m' if what == 'length' else 'rad'})"
            for what, each in sizes.items()
            if each
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
    made = arm if arm.design is None else design_of(arm, arm.design)
    off = made is not arm and jacobian_change(flatten(arm), flatten(made), arm) > ROUNDING
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
        assumed=differences(arm, made) if off else (),
    )


def named_poses(arm: Arm, **more: Array) -> Iterator[tuple[str, Array]]:
    """Configurations of the whole robot: ``more``, and those that the description names."""
    named = arm.source.full_model.referenceConfigurations
    for name, full in (*more.items(), *((str(e.key()), np.array(e.data())) for e in named)):
        with contextlib.suppress(PinsingError):  # locked joints stand elsewhere in it
            yield name, arm.q_of(full)
