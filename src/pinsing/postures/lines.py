"""line_postures: which other postures of the start would follow a straight line of the tip."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.verdict import generic_rank
from pinsing.postures.inverse import inverse
from pinsing.postures.names import posture_names
from pinsing.proximity.line import LinePosture, check_line
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

_ITSELF = 1e-6


@checked
def line_postures(
    arm: Arm, q0: npt.ArrayLike, pose: npt.ArrayLike, *, forms: ClosedForm | None = None
) -> tuple[LinePosture, ...]:
    """Try a straight line of the tip in all other postures of the pose at which it starts.

    Joints that turn start as many whole turns away as keep them within their limits on all of
    the line, where that is possible; of the given posture, too, if it leaves them without.

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
    form = form_to_measure(arm) if forms is None else forms
    try:
        known = inverse(arm, tip_placement(arm, here).homogeneous)
    except OptionError:
        return ()
    out = []
    for s in known:
        itself = bool(np.abs(arm.space.wrap(s.q - here)).max() < _ITSELF)
        if not (s.regular or itself):
            continue
        start = here if itself else s.q
        try:
            line = check_line(arm, start, pose, forms=form)
        except ConfigurationError:
            continue
        turned = _turned(arm, line.q)
        inside = not arm.space.outside(line.q + turned).any()
        if itself and not (inside and turned.any()):
            continue
        clear = min((a.lower for a in line.approaches), default=float("inf"))
        names = posture_names(nominal(arm), s.q[None])[0]
        if line.crossings:
            clear = 0.0
        start = start + turned if inside else start
        out.append(LinePosture(start, names, line.outcome, line.s_end, inside, clear))
    out.sort(key=lambda p: (p.outcome != "reached", not p.within_limits, -p.clearance, -p.s_end))
    return tuple(out)


def _turned(arm: Arm, Q: Array) -> Array:
    """Whole turns (n,), as few as possible, that bring each joint of Q (N, n) into its limits."""
    fewest = np.ceil((arm.lower - 1e-9 - Q.min(axis=0)) / (2 * math.pi))
    most = np.floor((arm.upper + 1e-9 - Q.max(axis=0)) / (2 * math.pi))
    usable = ~arm.prismatic & (fewest <= most)
    return np.where(usable, np.clip(0.0, fewest, most), 0.0) * 2 * math.pi
