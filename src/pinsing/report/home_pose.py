"""Poses that people begin with, and what to take instead where they are singular."""

from __future__ import annotations

import contextlib

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.errors import PinsingError
from pinsing.families import closed_form
from pinsing.joint_text import typed
from pinsing.kinematics.verdict import SINGULAR_RTOL, ratios
from pinsing.proximity.suggestion import suggest
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

_SECONDS = 2.0
"""Time for the closed form; where it needs more, the command that takes it is named."""
_SEARCH = 1.5


@dataclass(frozen=True, eq=False)
class SingularPose:
    """A pose that people begin with and that is singular.

    Attributes
    ----------
    name : str
        "zero", "neutral" (zero, moved into the limits) or what the model calls it.
    q : (n,) array
        Radians and metres.
    within_limits : bool
        Whether the joint limits allow it.
    families : tuple of str
        Those that it is on, where they were found in short time.
    instead : (n,) array or None
        A clear configuration near it; None where that would have taken long.
    clearance : float
        Proven clearance of ``instead``; 0 without it.
    """

    name: str
    q: Array
    within_limits: bool
    families: tuple[str, ...]
    instead: Array | None
    clearance: float

    def text(
        self, robot: str, prismatic: Bool, degrees: bool = False, room: int | None = None
    ) -> str:
        """One line: what is singular, and a configuration to paste or the command for one."""
        outside = "" if self.within_limits else ", which is outside the limits,"
        on = f" (on {', '.join(self.families)})" if self.families else ""
        said = f"the {self.name} pose{outside} is singular{on}"
        if self.instead is None:
            return f"{said}; pinsing suggest {robot} finds one that is not"
        far = f"{np.floor(np.degrees(self.clearance) * 100) / 100:g}°"
        pose = typed(self.instead, prismatic, degrees, digits=8, room=room)
        return (
            f"{said}; the next is near it, {far} or more from every singular one (proven): {pose}"
        )


def singular_poses(arm: Arm) -> tuple[SingularPose, ...]:
    """Zero, neutral and named poses of an arm that are singular."""
    exact = nominal(arm).arm
    named = [
        (name, q)
        for name, q in _poses(arm)
        if min(float(ratios(exact, q)[0]), float(ratios(arm, q)[0])) <= SINGULAR_RTOL
    ]
    if not named:
        return ()
    form = closed_form(arm, seconds=_SECONDS, prove=False)
    out = []
    for name, q in named:
        instead, clearance = None, 0.0
        if form.complete and form.families:
            with contextlib.suppress(PinsingError):  # too far outside the limits
                found = suggest(arm, near=q, forms=form, seconds=_SEARCH)
                if found.lower > 0:
                    instead, clearance = found.q, found.lower
        on = tuple(f.name for f in form.families if f.real and bool(f.contains(q)))
        inside = bool(arm.within_limits(q))
        out.append(SingularPose(name, q, inside, on, instead, clearance))
    return tuple(out)


def _poses(arm: Arm) -> list[tuple[str, Array]]:
    found = [("zero", np.zeros(arm.n))]
    model = arm.source.full_model
    named = [("neutral", arm.source.reference)]
    named += [(str(e.key()), np.array(e.data())) for e in model.referenceConfigurations]
    for name, full in named:
        with contextlib.suppress(PinsingError):  # locked joints stand elsewhere in it
            q = arm.q_of(full)
            if not any(np.array_equal(q, other) for _, other in found):
                found.append((name, q))
    return found
