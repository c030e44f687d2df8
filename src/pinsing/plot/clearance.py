"""Clearance along a trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pinsing.plot.style import SINGULAR, legend_below, new_axes
from pinsing.proximity.clearance import quick
from pinsing.proximity.crossings import crossings_of
from pinsing.proximity.motion import motion_of
from pinsing.proximity.watched import Forms, watch

_MOST = 4000
_LOWEST = 1e-3  # degrees


def clearance_along(
    forms: Forms,
    trajectory: npt.ArrayLike,
    times: npt.ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    families: Sequence[str] | None = None,
) -> Axes:
    """Draw the proven clearance along a trajectory, one line a family, and where it is met.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of the arm.
    trajectory : (N, n) or (N, nq) array_like
        Radians and metres. Of very many samples the lowest of each run are drawn.
    times : (N,) array_like, optional
        Seconds; the number of the sample by default.
    ax : Axes, optional
        Where to draw.
    families : sequence of str, optional
        Names; by default all that have real points.

    Returns
    -------
    Axes
        Degrees on a logarithmic scale; markers at the bottom where a family is met.

    Raises
    ------
    ConfigurationError, OptionError
        As from ``crossings``.
    """
    watched = watch(forms, families)
    motion = motion_of(watched, trajectory, times)
    count = len(motion.pieces) + 1
    places = np.arange(count, dtype=float)
    if count < _MOST // 4:  # a few waypoints: curves between them
        places = np.linspace(0, count - 1, _MOST // 4)
    runs = np.array_split(places, min(_MOST, len(places)))
    ax = new_axes() if ax is None else ax
    for k, name in enumerate(watched.names):
        alone = watch(forms, [name])
        t, low = [], []
        for run in runs:
            lower = quick(alone, motion.at(run)).lower
            i = int(np.argmin(lower))
            t.append(float(motion.time(run[i : i + 1])[0]))
            low.append(float(lower[i]))
        degrees = np.maximum(np.degrees(low), _LOWEST)
        ax.plot(t, degrees, label=name, color=f"C{k % 10}", linewidth=1.2)
    met = crossings_of(watched, motion)
    if len(met):
        at = [c.t for c in met]
        ax.plot(at, np.full(len(at), _LOWEST), "v", color=SINGULAR, label="met", clip_on=False)
    ax.set_yscale("log")
    ax.set_ylim(bottom=_LOWEST)
    ax.set_xlim(motion.t[0], max(motion.t[-1], motion.t[0] + 1e-9))
    ax.set_xlabel("time (s)" if times is not None else "sample")
    ax.set_ylabel("clearance, at least (°)")
    legend_below(ax)
    return ax
