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
    from pinsing.sampling.map_plan import MapPlan as MapPlan, plan_map as plan_map
    from pinsing.sampling.map_run import MapResult as MapResult, sigma_map as sigma_map
    from pinsing.sampling.sweep_plan import SweepPlan as SweepPlan, plan_sweep as plan_sweep
    from pinsing.sampling.sweep_run import SweepResult as SweepResult, sweep as sweep

public(
    __name__,
    {
        "analyze": "Analysis analyze singular_configurations",
        "generalize": "Finding Generalization generalize",
        "map_plan": "MapPlan plan_map",
        "map_run": "MapResult sigma_map",
        "sweep_plan": "SweepPlan plan_sweep",
        "sweep_run": "SweepResult sweep",
    },
)
