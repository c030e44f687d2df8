"""How far singular configurations are: clearance, crossings, trajectories, lines, guards."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.proximity.clearance import (
        Clearance as Clearance,
        Suggestion as Suggestion,
        clearance as clearance,
        is_clear as is_clear,
        suggest as suggest,
    )
    from pinsing.proximity.crossings import (
        Crossing as Crossing,
        Crossings as Crossings,
        crossings as crossings,
    )
    from pinsing.proximity.line import LineCheck as LineCheck, check_line as check_line
    from pinsing.proximity.monitor import (
        Monitor as Monitor,
        Verdict as Verdict,
        export_guard as export_guard,
    )
    from pinsing.proximity.trajectory import (
        TrajectoryCheck as TrajectoryCheck,
        check_trajectory as check_trajectory,
    )
    from pinsing.proximity.zones import Zones as Zones

public(
    __name__,
    {
        "clearance": "Clearance Suggestion clearance is_clear suggest",
        "crossings": "Crossing Crossings crossings",
        "line": "LineCheck check_line",
        "monitor": "Monitor Verdict export_guard",
        "trajectory": "TrajectoryCheck check_trajectory",
        "zones": "Zones",
    },
)
