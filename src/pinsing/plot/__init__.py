"""Plots: results in, matplotlib axes out; nothing is shown or saved here.

Every function takes an optional ``ax`` and returns the axes that it drew on. Without ``ax``
it makes a figure that is readable at one column's width.
"""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.plot.curves import sigma_along as sigma_along, sigma_curves as sigma_curves
    from pinsing.plot.ellipsoids import ellipsoids as ellipsoids
    from pinsing.plot.plane import (
        aspect_plane as aspect_plane,
        inverse_count as inverse_count,
        locus as locus,
        sigma_plane as sigma_plane,
        workspace as workspace,
    )

public(
    __name__,
    {
        "curves": "sigma_along sigma_curves",
        "ellipsoids": "ellipsoids",
        "plane": "aspect_plane inverse_count locus sigma_plane workspace",
    },
    advice={"sigma_map": "pinsing.plot.sigma_plane, or pinsing.sampling.sigma_map"},
    called="pinsing.plot.sigma_plane, pinsing.plot.sigma_curves, pinsing.plot.ellipsoids, ...",
)
