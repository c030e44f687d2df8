"""Postures: the pieces that singular configurations cut joint space into, and ways within them."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.postures.aspects import (
        Aspects as Aspects,
        Connection as Connection,
        aspect_changes as aspect_changes,
        aspects as aspects,
        connect as connect,
    )
    from pinsing.postures.changes import (
        Cuspidality as Cuspidality,
        PostureChanges as PostureChanges,
        cuspidality as cuspidality,
        line_postures as line_postures,
        posture_changes as posture_changes,
    )
    from pinsing.postures.placement import WorkpiecePlacement as WorkpiecePlacement
    from pinsing.postures.toolpath import PathPlan as PathPlan, plan_path as plan_path
    from pinsing.proximity.zones import zones as zones

public(
    __name__,
    {
        "aspects": "Aspects Connection aspect_changes aspects connect",
        "changes": "Cuspidality PostureChanges cuspidality line_postures posture_changes",
        "placement": "WorkpiecePlacement",
        "toolpath": "PathPlan plan_path",
        "pinsing.proximity.zones": "zones",
    },
    called="pinsing.inverse(arm, pose) or pinsing.posture_changes(arm, q)",
)
