"""Postures: the pieces that singular configurations cut joint space into, and ways within them."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.postures.aspects import Aspects as Aspects, aspects as aspects
    from pinsing.postures.changes import (
        PostureChanges as PostureChanges,
        posture_changes as posture_changes,
    )
    from pinsing.postures.connection import Connection as Connection, connect as connect
    from pinsing.postures.cuspidal import Cuspidality as Cuspidality, cuspidality as cuspidality
    from pinsing.postures.motions import (
        aspect_changes as aspect_changes,
        line_postures as line_postures,
    )
    from pinsing.postures.placement import WorkpiecePlacement as WorkpiecePlacement
    from pinsing.postures.toolpath import PathPlan as PathPlan, plan_path as plan_path
    from pinsing.postures.zone_search import zones as zones

public(
    __name__,
    {
        "aspects": "Aspects aspects",
        "changes": "PostureChanges posture_changes",
        "connection": "Connection connect",
        "cuspidal": "Cuspidality cuspidality",
        "motions": "aspect_changes line_postures",
        "placement": "WorkpiecePlacement",
        "toolpath": "PathPlan plan_path",
        "zone_search": "zones",
    },
    called="pinsing.inverse(arm, pose) or pinsing.posture_changes(arm, q)",
)
