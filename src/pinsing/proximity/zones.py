"""How near is too near: distances beyond which no tip motion exceeds the joint speed limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.measures import Array
from pinsing.notebook import one_line
from pinsing.prose import listed
from pinsing.proximity.trajectory import angle_text
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.robot.chain import chain_differs
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class Zones(JsonResult):
    """Distances from singularities beyond which tip motions keep the joint speed limits.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    placements : (n + 1, 3, 4) array
        Of each joint in the one before, and of the tip: rotations, and metres.
    tip_speed, turn_speed : float
        m/s and rad/s of the tip, at once and in any directions.
    joint_speeds : (n,) array
        Speed limits, rad/s and m/s. A redundant arm exceeds one if all joint speeds that make a
        motion do.
    within : tuple of str
        Where the answer holds, in words; empty for all of joint space.
    lower, upper : (n,) arrays
        The same as joint values.
    tip_lower, tip_upper : (3,) arrays
        The same as positions of the tip in the base, metres; infinite where all count.
    posture : tuple of str
        The same as names of the posture, such as "elbow up"; empty for all.
    distances : dict of str to float
        Proven: farther than these from the families, radians (or metres over the length scale),
        no limit is exceeded. 0 where the family need not be kept away from.
    exceeding : dict of str to float
        A configuration that exceeds a limit is this far from the family, and farther than
        ``distances`` from the others; 0 where none was found.
    common, common_exceeding : float
        The same with one distance for all families.
    worst : (n,) array
        The configuration that exceeds a limit farthest from all families; empty if none was found.
    sigma_min, sigma_min_proven : float
        The least singular value found outside the zones, and a proven bound of all.
    condition_number : float
        The largest found outside the zones.
    titles : dict of str to str
        What families are called, with their condition where it is short.
    complete : bool
        Whether the closed form is: it does not matter to the proof.
    boxes : int
        Work: boxes that were looked at, two for each configuration that was tried, and an eighth of
        those that distances took.
    notes : tuple of str
        What was assumed, and where the search ended before the gap was reached.
    """

    schema: ClassVar[str] = "pinsing/zones/2"

    arm: ArmSummary
    placements: Array
    tip_speed: float
    turn_speed: float
    joint_speeds: Array
    within: tuple[str, ...]
    lower: Array
    upper: Array
    tip_lower: Array
    tip_upper: Array
    posture: tuple[str, ...]
    distances: dict[str, float]
    exceeding: dict[str, float]
    common: float
    common_exceeding: float
    worst: Array
    sigma_min: float
    sigma_min_proven: float
    condition_number: float
    titles: dict[str, str]
    complete: bool
    boxes: int
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        said = ", ".join(f"{name} {d:.3g}" for name, d in self.distances.items())
        return one_line("Zones", f"{self.arm.name}, {said}")

    @property
    def speeds(self) -> str:
        """Speeds of the tip, in words."""
        return f"{self.tip_speed:g} m/s and {self.turn_speed:g} rad/s"

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return the answer in lines.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("scara"))
        >>> print(pinsing.zones(form, joint_speeds=[5, 5, 1, 10]).text().splitlines()[0])
        scara: keep 20.3° from F1: q2 = 0° or 180° (proven)
        """

        def far(x: float) -> str:
            return angle_text(x, degrees)

        kept = [n for n, d in self.distances.items() if d > 0]
        where = f"with {listed(self.within)}, " if self.within else ""
        exceeded = self.common_exceeding
        if kept and not math.isfinite(self.sigma_min):
            lines = [
                f"{self.arm.name}: {where}no useful distance was found",
                "",
                f"  {self.speeds} exceed a limit nearly everywhere, or the search ended too early:",
                "  try lower --tip-speed and --turn-speed, a smaller --within, or more --boxes "
                f"({self.boxes:,} here)",
                f"  A joint speed limit is exceeded even {far(exceeded)} from all families",
            ][: 5 if exceeded else 4]
            return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])
        if kept:
            away = listed([f"{far(self.distances[n])} from {self.titles[n]}" for n in kept])
            lines = [f"{self.arm.name}: {where}keep {away} (proven)"]
        elif not math.isfinite(self.sigma_min):
            lines = [f"{self.arm.name}: {where}no configuration was found"]
        else:
            lines = [f"{self.arm.name}: {where}no distance need be kept (proven)"]
        then = f"  Then {self.speeds} of the tip, in any directions, exceed no joint speed limit"
        lines += ["", then] if math.isfinite(self.sigma_min) else [""]
        for name in kept:
            found = self.exceeding[name]
            short = (
                f"a limit is exceeded at {far(found)}"
                if found
                else "no configuration found that exceeds one"
            )
            lines.append(f"  {self.titles[name]}: {far(self.distances[name])}; {short}")
        short = f"; a limit is exceeded at {far(exceeded)}" if exceeded else ""
        lines.append(f"  One distance for all: {far(self.common)}{short}")
        if math.isfinite(self.sigma_min):
            lines.append(
                f"  Outside: sigma_min down to {self.sigma_min:.3g} (at least "
                f"{self.sigma_min_proven:.3g}, proven), condition number up to "
                f"{self.condition_number:.3g} (found)"
            )
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


def zone_distances(
    zones: Zones, arm: ArmSummary, loaded: Arm | None, names: Sequence[str]
) -> Array:
    """Return distances (F,) of zones to named families, 0 where none is kept."""
    # OptionError for another arm or families, or zones that depend on a posture or on the tip.
    require_zones_of(zones, arm, loaded, names)
    if zones.posture or np.isfinite(zones.tip_lower).any():
        raise OptionError(f"zones of {', '.join(zones.within)}: give those of joint ranges")
    return np.array([zones.distances.get(name, 0.0) for name in names])


def require_zones_of(
    zones: Zones, arm: ArmSummary, loaded: Arm | None, names: Sequence[str]
) -> None:
    """Raise OptionError unless zones are of this arm, and of families of these names."""
    mine, other = (
        (a.name, a.joints, a.base, a.tip, a.task, a.length_scale) for a in (zones.arm, arm)
    )
    kept = {name for name, far in zones.distances.items() if far > 0}
    if mine != other or kept - set(names):
        raise OptionError(
            f"zones are of {zones.arm.name}, base {zones.arm.base}, tip {zones.arm.tip}, task "
            f"{zones.arm.task}, and families {', '.join(sorted(kept))}, not of {arm.name}, base "
            f"{arm.base}, tip {arm.tip}, task {arm.task}, and {', '.join(names)}"
        )
    OptionError.refuse_if(
        loaded is not None and chain_differs(loaded, zones.placements),
        f"zones are of {zones.arm.name} with its joints in other places, as by another "
        "calibration: make them of this robot, with the options that it has here",
    )
