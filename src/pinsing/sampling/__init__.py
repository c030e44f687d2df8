"""Many configurations at once: sweeps, maps and analyses, in chunks that are stored and reduced."""

from pinsing.sampling.map_plan import MapPlan, plan_map
from pinsing.sampling.map_run import MapJob, MapPoint, MapResult, sigma_map
from pinsing.sampling.tally import Distribution, Extreme

__all__ = [
    "Distribution",
    "Extreme",
    "MapJob",
    "MapPlan",
    "MapPoint",
    "MapResult",
    "plan_map",
    "sigma_map",
]
