"""Plots: results in, matplotlib axes out; nothing is shown or saved here.

Every function takes an optional ``ax`` and returns the axes that it drew on. Without ``ax``
it makes a figure that is readable at one column's width.
"""

from pinsing.plot.aspect_plane import aspect_plane, locus
from pinsing.plot.curves import sigma_along, sigma_curves
from pinsing.plot.ellipsoids import ellipsoids
from pinsing.plot.plane import sigma_plane, workspace
from pinsing.plot.reach import inverse_count

sigma_map = sigma_plane
"""As `sigma_plane`: the name that it had before, which is that of `pinsing.sigma_map` too."""

__all__ = [
    "aspect_plane",
    "ellipsoids",
    "inverse_count",
    "locus",
    "sigma_along",
    "sigma_curves",
    "sigma_map",
    "sigma_plane",
    "workspace",
]
