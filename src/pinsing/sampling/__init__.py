"""Many configurations at once: sweeps, maps and analyses, in chunks that are stored and reduced."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.sampling.analyze import (
        Analysis as Analysis,
        analyze as analyze,
        singular_configurations as singular_configurations,
    )
    from pinsing.sampling.generalize import (
        Finding as Finding,
        Generalization as Generalization,
        generalize as generalize,
    )
    from pinsing.sampling.maps import (
        MapPlan as MapPlan,
        MapResult as MapResult,
        plan_map as plan_map,
        sigma_map as sigma_map,
    )
    from pinsing.sampling.sweeps import (
        SweepPlan as SweepPlan,
        SweepResult as SweepResult,
        plan_sweep as plan_sweep,
        sweep as sweep,
    )

public(
    __name__,
    {
        "analyze": "Analysis analyze singular_configurations",
        "generalize": "Finding Generalization generalize",
        "maps": "MapPlan MapResult plan_map sigma_map",
        "sweeps": "SweepPlan SweepResult plan_sweep sweep",
    },
)
