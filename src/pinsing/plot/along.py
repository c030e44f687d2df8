"""Singular values and clearance along a trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.arguments import checked, real_numbers
from pinsing.errors import ConfigurationError
from pinsing.families import ClosedForm
from pinsing.kinematics.verdict import NEAR_RTOL, SINGULAR_RTOL, measure
from pinsing.plot.style import COLORS, SINGULAR, SMALL, legend_below, new_axes, plain, unit
from pinsing.proximity.clearance import quick
from pinsing.proximity.crossings import Crossing, crossings, crossings_of, motion_of
from pinsing.proximity.watched import Forms, watch
from pinsing.robot.arm import Arm


@checked
def sigma_along(
    arm: Arm,
    trajectory: npt.ArrayLike,
    ax: Axes | None = None,
    *,
    times: npt.ArrayLike | None = None,
    forms: ClosedForm | None = None,
    near_rtol: float = NEAR_RTOL,
    degrees: bool = False,
) -> Axes:
    """Draw the singular values along a trajectory, on a logarithmic scale.

    Parameters
    ----------
    arm : Arm
        The arm.
    trajectory : (N, n) or (N, nq) array_like
        Configurations, radians and metres.
    ax : Axes, optional
        Where to draw.
    times : (N,) array_like, optional
        Seconds; by default the length of the path in joint space, radians (metres over the
        length scale).
    forms : ClosedForm, optional
        Of the arm: where the motion meets a family is marked with the family's name, as
        ``crossings`` has proven it, also between the configurations, where the line then
        comes down to its zero.
    near_rtol : float
        sigma_r / sigma_1 at or below which the ground is shaded as near-singular.
    degrees : bool
        The length of the path in degrees.

    Returns
    -------
    Axes
        One line for each singular value, the smallest in front; markers where singular.

    Raises
    ------
    ConfigurationError
        If the trajectory is not (N, n) with N at least 2, or times do not fit it.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> from pinsing import plot
    >>> Q = np.linspace([0, -1, 1], [0, 1, 1], 50)
    >>> plot.sigma_along(pinsing.load("planar3r"), Q).get_yscale()
    'log'
    """
    Q = arm.check(trajectory, "trajectory")
    if Q.ndim != 2 or len(Q) < 2:
        raise ConfigurationError(
            f"a trajectory needs two configurations or more, (N, {arm.n}); got shape {Q.shape}"
        )
    t = _path_length(arm, Q) if times is None else real_numbers(times, "times")
    if times is None and t[-1] == t[0]:
        raise ConfigurationError("the trajectory stays at one configuration: it has no length")
    if (
        t.shape != (len(Q),)
        or not np.isfinite(t).all()
        or (np.diff(t) < (1e-300 if times is not None else 0)).any()
    ):
        raise ConfigurationError(f"times must be {len(Q)} increasing numbers")
    if times is None and degrees:
        t = np.degrees(t)
    met = () if forms is None else tuple(crossings(forms, Q))
    places = np.interp([one.t for one in met], np.arange(len(Q)), t)
    Q, t = _with_crossings(Q, t, met, places)
    sigma, ratio = measure(arm, Q)
    drawn = np.maximum(sigma, 1e-12)  # a logarithm has no zero
    ax = new_axes() if ax is None else ax
    for k in range(sigma.shape[1] - 1):
        ax.plot(t, drawn[:, k], color="0.6", linewidth=0.9,
                label=r"$\sigma_1, \ldots$" if k == 0 else "")  # fmt: skip
    ax.plot(t, drawn[:, -1], color=COLORS[0], linewidth=1.7, label=r"$\sigma_{\min}$")
    near = ratio <= near_rtol
    if near.any():
        ax.fill_between(
            t,
            0,
            1,
            where=near,
            step="mid",
            transform=ax.get_xaxis_transform(),
            color=COLORS[4],
            alpha=0.25,
            linewidth=0,
            label="near-singular",
        )
    zero = ratio <= SINGULAR_RTOL
    if zero.any():
        ax.plot(t[zero], drawn[zero, -1], "o", color=SINGULAR, markersize=3.5, label="singular")
    rows = _mark_crossings(ax, met, places, t[-1] - t[0])
    ax.set_yscale("log")
    ax.set_xlim(t[0], t[-1])
    ax.set_xlabel(
        f"path length in joint space [{unit(False, degrees)}]" if times is None else "time [s]",
        fontsize=SMALL,
    )
    ax.set_ylabel("singular values", fontsize=SMALL)
    ax.tick_params(labelsize=SMALL)
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.set_title(plain(arm.name), fontsize=SMALL + 1, pad=6 + _ROW * rows)
    legend_below(ax, 4)
    return ax


_ROW = 9
"""Points from one row of families' names to the next."""


def _path_length(arm: Arm, Q: Array) -> Array:
    """Length (N,) of the way up to each configuration."""
    step = np.diff(Q, axis=0) / arm.space.metric
    return np.asarray(np.concatenate([[0.0], np.cumsum(np.linalg.norm(step, axis=1))]))


def _with_crossings(
    Q: Array, t: Array, met: Sequence[Crossing], places: Array
) -> tuple[Array, Array]:
    """Configurations, and those between two of them at which a family is met."""
    between = [k for k, one in enumerate(met) if abs(one.t - round(one.t)) > 1e-9]
    if not between:
        return Q, t
    behind = [int(np.ceil(met[k].t)) for k in between]
    return np.insert(Q, behind, [met[k].q for k in between], 0), np.insert(
        t, behind, places[between]
    )


def _mark_crossings(ax: Axes, met: Sequence[Crossing], places: Array, length: float) -> int:
    """Draw a line, and the family's name above it, wherever a family is met.

    Names that would lie over one another stand in rows; returns how many rows there are.
    """
    ends: list[float] = []  # of the last name in each row
    for one, place in zip(met, places.tolist(), strict=True):
        ax.axvline(place, color=SINGULAR, linewidth=0.8, linestyle=":", zorder=1)
        row = next((k for k, end in enumerate(ends) if place >= end), len(ends))
        ends[row : row + 1] = [place + 0.025 * (1 + len(one.family)) * length]
        ax.annotate(
            one.family,
            (place, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 2 + _ROW * row),
            textcoords="offset points",
            ha="center",
            fontsize=SMALL - 1,
        )
    return len(ends)


_LOWEST_CLEARANCE = 1e-3  # degrees


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
    if count < 1000:  # a few waypoints: curves between them
        places = np.linspace(0, count - 1, 1000)
    runs = np.array_split(places, min(4000, len(places)))
    ax = new_axes() if ax is None else ax
    for k, name in enumerate(watched.names):
        alone = watch(forms, [name])
        t, low = [], []
        for run in runs:
            lower = quick(alone, motion.at(run)).lower
            i = int(np.argmin(lower))
            t.append(float(motion.time(run[i : i + 1])[0]))
            low.append(float(lower[i]))
        degrees = np.maximum(np.degrees(low), _LOWEST_CLEARANCE)
        ax.plot(t, degrees, label=alone.families[0].label, color=f"C{k % 10}", linewidth=1.2)
    met = crossings_of(watched, motion)
    if len(met):
        at = [c.t for c in met]
        ax.plot(
            at, np.full(len(at), _LOWEST_CLEARANCE), "v", color=SINGULAR, label="met", clip_on=False
        )
    ax.set_yscale("log")
    ax.set_ylim(bottom=_LOWEST_CLEARANCE)
    ax.set_xlim(motion.t[0], max(motion.t[-1], motion.t[0] + 1e-9))
    ax.set_xlabel("time (s)" if times is not None else "sample")
    ax.set_ylabel("clearance, at least (°)")
    legend_below(ax)
    return ax
