"""Motions and postures: where a motion changes its aspect, and which postures follow a line."""

from __future__ import annotations

import math

import numpy as np

from pinsing._types import Array, ArrayLike
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.inverse import inverse
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.ladder import posture_names
from pinsing.kinematics.verdict import generic_rank
from pinsing.measures import ALIKE
from pinsing.postures.aspects import Aspects, aspects, map_of
from pinsing.proximity.crossings import check_times, crossings_of, motion_of
from pinsing.proximity.line import LinePosture, check_line
from pinsing.proximity.trajectory import AspectChange
from pinsing.proximity.watched import Forms, watch
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal


@checked
def line_postures(
    arm: Arm, q0: ArrayLike, pose: ArrayLike, *, forms: ClosedForm | None = None
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
    >>> [p.outcome for p in pinsing.postures.line_postures(arm, [0, 1.0, 0, 0], [0.4, 0.2, 0.1])]
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
        itself = bool(np.abs(arm.space.wrap(s.q - here)).max() < ALIKE)
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


@checked
def aspect_changes(
    forms: Forms, Q: ArrayLike, t: ArrayLike | None = None, *, of: Aspects | None = None
) -> tuple[AspectChange, ...]:
    """Find where a motion changes its aspect.

    It meets families that separate at places none of which is missing (`crossings`); of the
    configurations halfway between these the aspect is looked up.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of the arm.
    Q : (N, n) or (N, nq) array_like
        Samples, radians and metres; joints move linearly between them.
    t : (N,) array_like, optional
        Seconds, ascending; without them t counts samples from 0.
    of : Aspects, optional
        Aspects of the arm, if at hand; by default those within the limits where the motion is
        within them, else those of joints that turn endlessly. Where their count is not proven,
        two numbers may be of one aspect.

    Returns
    -------
    tuple of AspectChange
        In the order of time; a family that is met without another aspect behind it is left out.

    Raises
    ------
    ConfigurationError
        If Q has the wrong shape, a value that is not finite, or leaves the limits of ``of``.
    OptionError
        If forms are none, or of different arms, or times do not ascend; if ``of``
        are the aspects of another arm.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("scara"))
    >>> change, = pinsing.postures.aspect_changes(form, [[0, -1, 0, 0], [0, 1, 0, 0]])
    >>> round(change.t, 9), change.before, change.after
    (0.5, 1, 2)
    """
    OptionError.refuse_if(
        not isinstance(forms, ClosedForm) and not len(forms),
        "forms must be a ClosedForm, or several of one arm: see closed_form",
    )
    arm = forms.arm if isinstance(forms, ClosedForm) else forms[0].arm
    samples = watch(forms).check(Q)
    ConfigurationError.refuse_if(
        samples.ndim != 2 or not len(samples),
        f"a trajectory has shape (N, {arm.n}), one column a joint; got {samples.shape}",
    )
    times = check_times(t, len(samples))
    if len(samples) == 1:
        return ()
    if of is None:
        inside = (samples >= arm.lower - 1e-9) & (samples <= arm.upper + 1e-9)
        of = aspects(forms, bool(inside.all()))
    chosen = map_of(of, forms)
    met = crossings_of(chosen.cutting, motion_of(chosen.cutting, samples, times))
    span = max(float(times[-1] - times[0]), 1e-300)
    groups: list[tuple[float, float, set[str]]] = []
    for event in sorted(met, key=lambda e: e.t):
        # Share of the motion within which two meetings are one.
        if groups and event.t - groups[-1][1] <= 1e-9 * span:
            start, end, names = groups[-1]
            groups[-1] = (start, max(end, event.t_end), names | {event.family})
        else:
            groups.append((event.t, event.t_end, {event.family}))
    ends = [float(times[0]), *(x for g in groups for x in g[:2]), float(times[-1])]
    between = []
    for a, b in zip(ends[::2], ends[1::2], strict=True):
        q = _at(times, samples, (a + b) / 2)
        number = of.of(q) if b > a else None
        between.append((q, number))
    geometry = forms.geometry if isinstance(forms, ClosedForm) else forms[0].geometry
    words: list[tuple[str, ...]] = [() for _ in between]
    if geometry is not None:
        words = posture_names(geometry, np.array([q for q, _ in between]))
    return tuple(
        AspectChange(g[0], tuple(sorted(g[2])), a[1], b[1], u, v)
        for g, a, b, u, v in zip(
            groups, between[:-1], between[1:], words[:-1], words[1:], strict=True
        )
        if a[1] is not None and b[1] is not None and a[1] != b[1]
    )


def _at(times: Array, Q: Array, t: float) -> Array:
    return np.array([np.interp(t, times, Q[:, j]) for j in range(Q.shape[1])])
