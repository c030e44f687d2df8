"""Postures: the pieces that singular configurations cut joint space into, and ways within them."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.postures.aspects import (
        Aspects as Aspects,
        aspect_changes as aspect_changes,
        aspects as aspects,
    )
    from pinsing.postures.changes import (
        PostureChanges as PostureChanges,
        line_postures as line_postures,
        posture_changes as posture_changes,
    )
    from pinsing.postures.connection import Connection as Connection, connect as connect
    from pinsing.postures.cuspidal import Cuspidality as Cuspidality, cuspidality as cuspidality
    from pinsing.postures.placement import WorkpiecePlacement as WorkpiecePlacement
    from pinsing.postures.toolpath import PathPlan as PathPlan, plan_path as plan_path
    from pinsing.postures.zone_search import zones as zones

public(
    __name__,
    {
        "aspects": "Aspects aspect_changes aspects",
        "changes": "PostureChanges line_postures posture_changes",
        "connection": "Connection connect",
        "cuspidal": "Cuspidality cuspidality",
        "placement": "WorkpiecePlacement",
        "toolpath": "PathPlan plan_path",
        "zone_search": "zones",
    },
    called="pinsing.inverse(arm, pose) or pinsing.posture_changes(arm, q)",
)
