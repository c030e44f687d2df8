"""line_postures: which other postures of the start would follow a straight line of the tip."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm, closed_form
from pinsing.geometry.nominal import nominal
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.verdict import generic_rank
from pinsing.postures.inverse import inverse
from pinsing.postures.names import posture_names
from pinsing.proximity.line import LinePosture, check_line
from pinsing.robot.arm import Arm


@checked
def line_postures(
    arm: Arm, q0: npt.ArrayLike, pose: npt.ArrayLike, *, forms: ClosedForm | None = None
) -> tuple[LinePosture, ...]:
    """Try a straight line of the tip in all other postures of the pose at which it starts.

    Parameters
    ----------
    arm : Arm
        A serial arm; where it has more joints than conditions there are endlessly many others,
        and none is tried.
    q0 : (n,) or (nq,) array_like
        Where the line starts, radians and metres.
    pose : (3,), (6,) or (4, 4) array_like
        Target, as of `check_line`.
    forms : ClosedForm, optional
        Of the arm, if at hand.

    Returns
    -------
    tuple of LinePosture
        Those that reach the end within the limits first; of these the clearest first.

    Raises
    ------
    ConfigurationError
        If q0 or the pose make no sense.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("scara")
    >>> [p.outcome for p in pinsing.line_postures(arm, [0, 1.0, 0, 0], [0.4, 0.2, 0.1])]
    ['reached']
    """
    here = arm.check_one(q0, "q0")
    if arm.n != generic_rank(arm) or arm.coupling is not None:
        return ()
    form = closed_form(arm) if forms is None else forms
    try:
        known = inverse(arm, tip_placement(arm, here).homogeneous)
    except OptionError:
        return ()
    out = []
    for s in known:
        if not s.regular or np.abs(arm.space.wrap(s.q - here)).max() < 1e-6:
            continue
        try:
            line = check_line(arm, s.q, pose, forms=form)
        except ConfigurationError:
            continue
        inside = not arm.space.outside(line.q).any()
        clear = min((a.lower for a in line.approaches), default=float("inf"))
        names = posture_names(nominal(arm), s.q[None])[0]
        if line.crossings:
            clear = 0.0
        out.append(LinePosture(s.q, names, line.outcome, line.s_end, inside, clear))
    out.sort(key=lambda p: (p.outcome != "reached", not p.within_limits, -p.clearance, -p.s_end))
    return tuple(out)
