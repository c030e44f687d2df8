"""Maps: singular values over a grid or sample of any size, reduced as they are computed."""

from pinsing.maps.plan import MapPlan, plan_map
from pinsing.maps.result import Distribution, Extreme, MapPoint, MapResult
from pinsing.maps.run import MapJob, sigma_map

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
