"""Maps: singular values over a grid or sample of any size, reduced as they are computed."""

from pinsing.maps.mechanism import MechanismMap, WorstConfiguration, mechanism_map
from pinsing.maps.plan import MapPlan, plan_map
from pinsing.maps.result import MapPoint, MapResult
from pinsing.maps.run import MapJob, sigma_map
from pinsing.runs.distribution import Distribution, Extreme

__all__ = [
    "Distribution",
    "Extreme",
    "MapJob",
    "MapPlan",
    "MapPoint",
    "MapResult",
    "MechanismMap",
    "WorstConfiguration",
    "mechanism_map",
    "plan_map",
    "sigma_map",
]
