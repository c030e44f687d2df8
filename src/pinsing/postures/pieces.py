"""Which kind of piece a box of arcs is: the cheapest that tells its components."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.postures.bound_on_boxes import Terms
from pinsing.postures.boxes import Ground
from pinsing.postures.divided import Divided
from pinsing.postures.partition import Arc, Part
from pinsing.postures.piece import Piece, Plain
from pinsing.postures.sectioned import Sectioned
from pinsing.postures.sections import across, sections
from pinsing.postures.subdivision import subdivide
from pinsing.postures.wheel import Wheel, hub_of


def make_piece(part: Part, box: tuple[Arc, ...], scale: Array, until: float) -> Piece:
    """Find the components of a box of arcs.

    Parameters
    ----------
    part : Part
        Joints and equations.
    box : tuple of Arc
        An arc of each of its joints.
    scale : (n,) array
        What counts as one radian, of all joints of the arm.
    until : float
        Time by ``time.monotonic`` at which to stop.
    """
    if not part.surfaces:
        return Plain(part, box)
    if len(part.surfaces) == 1:
        hub = hub_of(part, box)
        if hub is not None:
            return Wheel(part, box, hub)
    hub = across(part, box)
    if hub is not None:
        mine = scale[list(part.joints)]
        return Sectioned(part, box, hub, sections(part, box, hub, mine, until))
    ground = Ground(
        terms=tuple(Terms.of(s.equation, part.joints) for s in part.surfaces),
        low=np.array([a.low for a in box]),
        high=np.array([a.high for a in box]),
        circle=np.array([a.circle for a in box]),
        scale=scale[list(part.joints)],
    )
    return Divided(part, box, subdivide(ground, until))
