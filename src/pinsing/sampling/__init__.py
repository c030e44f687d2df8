"""Many configurations at once: sweeps, maps and analyses, in chunks that are stored and reduced."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.sampling.analyze import Analysis as Analysis
    from pinsing.sampling.analyze import analyze as analyze
    from pinsing.sampling.analyze import singular_configurations as singular_configurations
    from pinsing.sampling.generalize import Finding as Finding
    from pinsing.sampling.generalize import Generalization as Generalization
    from pinsing.sampling.generalize import generalize as generalize
    from pinsing.sampling.map_plan import MapPlan as MapPlan
    from pinsing.sampling.map_plan import plan_map as plan_map
    from pinsing.sampling.map_run import MapResult as MapResult
    from pinsing.sampling.map_run import sigma_map as sigma_map
    from pinsing.sampling.sweep_plan import SweepPlan as SweepPlan
    from pinsing.sampling.sweep_plan import plan_sweep as plan_sweep
    from pinsing.sampling.sweep_run import SweepResult as SweepResult
    from pinsing.sampling.sweep_run import sweep as sweep

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
