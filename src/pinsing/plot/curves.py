"""Distributions of sigma_min along a joint, as in the paper's Figures 2 to 9."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.interface import checked, real_numbers
from pinsing.kinematics.jacobian import NEAR_RTOL, SINGULAR_RTOL, measure
from pinsing.kinematics.refine import approach
from pinsing.measures import Array, ArrayLike
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    SMALL,
    held_label,
    joint_symbol,
    labelled,
    legend_below,
    new_axes,
    plain,
    ticks,
    unit,
)
from pinsing.postures.toolpath import PathPlan
from pinsing.proximity.clearance import Forms, clearance, quick, watch
from pinsing.proximity.crossings import Crossing, crossings, crossings_of, motion_of
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.robot.nominal import nominal
from pinsing.sampling.sweeps import SweepCurve, SweepResult


@checked
def sigma_curves(
    result: SweepResult,
    ax: Axes | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    moving: Sequence[str] | None = None,
    degrees: bool = False,
    arm: Arm | None = None,
) -> Axes:
    """Draw curves of a sweep: sigma_min over the joint that moves.

    Parameters
    ----------
    result : SweepResult
        The sweep.
    ax : Axes, optional
        Where to draw.
    fixed : mapping of str to float, optional
        Joints held at special values, radians or metres; by default none: the curves from
        the nominal configuration.
    moving : sequence of str, optional
        Joints that move, all by default. Sliding ones get an axis of their own on top.
    degrees : bool
        Label angles in degrees; the axis is in radians all the same.
    arm : Arm, optional
        The arm that was swept: every dip of a curve is closed in upon, on the nominal geometry,
        and each true zero is marked, also between samples.

    Returns
    -------
    Axes
        With one line a curve, and a marker where the arm is singular.

    Raises
    ------
    UnknownNameError
        If a joint does not exist.
    OptionError
        If the sweep has no such curve, or has not kept its curves.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> plot.sigma_curves(pinsing.sampling.sweep(pinsing.load("planar3r"))).get_xlabel()
    'joint angle [rad]'
    """
    if arm is not None and arm.joints != result.arm.joints:
        raise OptionError(
            f"arm is {arm.name} with other joints than the sweep of {result.arm.name}"
        )
    summary = result.arm
    if moving is None:
        there = {c.moving for c in result.curves if c.holds(fixed or {}, summary)}
        names = [n for j, n in enumerate(summary.joints) if j in there or not result.kept]
        OptionError.refuse_if(
            not names, f"the sweep has no curve with {result.set_text(dict(fixed or {}))}"
        )
    else:
        names = [moving] if isinstance(moving, str) else list(moving)
        OptionError.refuse_if(not names, "moving names no joint: leave it out for all")
    curves = [result.curve(fixed, name) for name in names]
    ax = new_axes() if ax is None else ax
    turning = [c for c in curves if not summary.prismatic[c.moving]]
    sliding = [c for c in curves if summary.prismatic[c.moving]]
    top = ax.twiny() if turning and sliding else ax
    styles = zip(cycle(COLORS), cycle(DASHES), strict=False)
    marked = False
    for axes, some, slides in ((ax, turning, False), (top, sliding, True)):
        for curve in some:
            color, dash = next(styles)
            label = joint_symbol(curve.moving, slides) + (
                " (top axis)" if top is not ax and slides else ""
            )
            axes.plot(
                curve.x, curve.sigma_min, color=color, linestyle=dash, linewidth=1.4, label=label
            )
            x = singular_values_of(curve, result, arm)
            if len(x):
                axes.plot(
                    x, np.zeros(len(x)), "o", color=SINGULAR, markersize=3.5, clip_on=False,
                    zorder=5, label="" if marked else "singular",
                )  # fmt: skip
                marked = True
        if some:
            low, high = min(c.x[0] for c in some), max(c.x[-1] for c in some)
            axes.set_xlim(low, high)
            ticks(axes.xaxis, low, high, slides, degrees)
            what = "joint position" if slides else "joint angle"
            axes.set_xlabel(f"{what} [{unit(slides, degrees)}]", fontsize=SMALL)
    highest = max(float(c.sigma_min.max()) for c in curves)
    ax.set(ylim=(0, 1.08 * highest if highest > 1e-12 else 1.0), axisbelow=True)
    ax.set_ylabel(r"$\sigma_{\min}$", fontsize=SMALL + 1)
    ax.tick_params(axis="y", labelsize=SMALL)
    ax.grid(color="0.9", linewidth=0.6)
    held = ", ".join(_held(summary, name, value, degrees) for name, value in (fixed or {}).items())
    ax.set_title(plain(summary.name) + (f", {held}" if held else ""), fontsize=SMALL + 1)
    if top is not ax:  # one legend for both
        for line in top.get_lines():
            ax.plot([], [], color=line.get_color(), linestyle=line.get_linestyle(),
                    marker=line.get_marker(), label=line.get_label())  # fmt: skip
    legend_below(ax, 4, title=_rest(result, fixed or {}, degrees))
    return ax


def _rest(result: SweepResult, fixed: Mapping[str, float], degrees: bool) -> str:
    """Return where joints rest that neither move nor are held, in two lines at most."""
    arm, q = result.arm, result.plan.nominal
    said = [
        _held(arm, name, q[j], degrees) for j, name in enumerate(arm.joints) if name not in fixed
    ]
    half = len(said) if len(said) <= 4 else (len(said) + 1) // 2
    lines = [", ".join(some) for some in (said[:half], said[half:]) if some]
    return "a joint that does not move rests at " + ",\n".join(lines)


def _held(arm: ArmSummary, name: str, value: float, degrees: bool) -> str:
    index = arm.joints.index(name)
    return held_label(index, bool(arm.prismatic[index]), value, degrees)


def singular_values_of(curve: SweepCurve, result: SweepResult, arm: Arm | None = None) -> Array:
    """Return values of the moving joint where a curve is singular: sampled, or zeros of ``arm``."""
    # Samples step over a zero, where sigma_r falls like a distance: each dip is closed in upon.
    x, j, ratio = curve.x, curve.moving, np.pad(curve.sigma_ratio, 1, constant_values=np.inf)
    found = x[curve.sigma_ratio <= SINGULAR_RTOL]
    if curve.forced:  # the whole curve is
        return np.zeros(0)
    if arm is not None:
        # sigma_r / sigma_1 above which a dip is not looked at
        dip = (ratio[1:-1] <= ratio[:-2]) & (ratio[1:-1] <= ratio[2:]) & (ratio[1:-1] < 0.3)
        Q = np.tile(result.plan.nominal, (int(dip.sum()), 1))
        for name, value in curve.fixed.items():
            Q[:, result.arm.joints.index(name)] = value
        Q[:, j] = x[dip]
        ends = approach(nominal(arm).arm, Q, np.arange(arm.n) == j)
        low, high = np.maximum(x[0], x[dip] - x[1] + x[0]), np.minimum(x[-1], x[dip] + x[1] - x[0])
        met = ends.singular & (ends.q[:, j] >= low) & (ends.q[:, j] <= high)
        found = np.sort(np.append(found, ends.q[met, j]))
    # Values of a joint closer than this are one zero of a curve.
    return np.asarray(found[np.diff(found, prepend=-np.inf) > 1e-7])


@checked
def sigma_along(
    arm: Arm,
    trajectory: ArrayLike,
    ax: Axes | None = None,
    *,
    times: ArrayLike | None = None,
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
    ConfigurationError.refuse_if(
        Q.ndim != 2 or len(Q) < 2,
        f"a trajectory needs two configurations or more, (N, {arm.n}); got shape {Q.shape}",
    )
    steps = np.linalg.norm(np.diff(Q, axis=0) / arm.space.metric, axis=1)
    t = np.append(0.0, np.cumsum(steps)) if times is None else real_numbers(times, "times")
    ConfigurationError.refuse_if(
        times is None and t[-1] == t[0],
        "the trajectory stays at one configuration: it has no length",
    )
    ConfigurationError.refuse_if(
        t.shape != (len(Q),)
        or not np.isfinite(t).all()
        or (np.diff(t) < (1e-300 if times is not None else 0)).any(),
        f"times must be {len(Q)} increasing numbers",
    )
    if times is None and degrees:
        t = np.degrees(t)
    met = () if forms is None else tuple(crossings(forms, Q))
    places = np.interp([one.t for one in met], np.arange(len(Q)), t)
    between = [k for k, one in enumerate(met) if abs(one.t - round(one.t)) > 1e-9]
    if between:
        behind = [int(np.ceil(met[k].t)) for k in between]
        Q = np.insert(Q, behind, [met[k].q for k in between], 0)
        t = np.insert(t, behind, places[between])
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
    ax.set(yscale="log", xlim=(t[0], t[-1]), axisbelow=True)
    length = f"path length in joint space [{unit(False, degrees)}]"
    labelled(ax, length if times is None else "time [s]", "singular values")
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_title(plain(arm.name), fontsize=SMALL + 1, pad=6 + _ROW * rows)
    legend_below(ax, 4)
    return ax


_ROW = 9
"""Points from one row of families' names to the next."""


def _mark_crossings(ax: Axes, met: Sequence[Crossing], places: Array, length: float) -> int:
    """Draw a line and the family's name wherever one is met; return the rows of names."""
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
    trajectory: ArrayLike,
    times: ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    families: Sequence[str] | None = None,
) -> Axes:
    """Draw the proven clearance along a trajectory, one line a family, and where it is met."""
    # Degrees on a logarithmic scale, markers at the bottom where a family is met; of very many
    # samples the lowest of each run are drawn.
    watched = watch(forms, families)
    motion = motion_of(watched, trajectory, times)
    count = len(motion.pieces) + 1
    # Of a few waypoints curves between them.
    places = np.linspace(0, count - 1, 1000) if count < 1000 else np.arange(count, dtype=float)
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
    ax.set(
        yscale="log",
        ylim=(_LOWEST_CLEARANCE, None),
        xlim=(motion.t[0], max(motion.t[-1], motion.t[0] + 1e-9)),
        xlabel="time (s)" if times is not None else "sample",
        ylabel="clearance, at least (°)",
    )
    legend_below(ax)
    return ax


@checked
def path_sheet(plan: PathPlan, form: ClosedForm) -> Figure:
    """Draw the clearance along a planned path, and the map of what is free that it was chosen from.

    Above, the clearance at each pose, its proven least value, the bound of all paths, and the
    clearance with what is free kept, as far as each branch goes; below, where something was free,
    the greatest clearance over the branches at each pose and value, with the path drawn in.
    """
    if plan.reason:
        raise ValueError(f"there is no path to draw: {plan.reason}")
    wide = len(plan.grid) > 1
    figure, axes = plt.subplots(
        1 + wide, 1, figsize=(8, 7 if wide else 4), sharex=True, squeeze=False, layout="constrained"
    )
    top = axes[0, 0]
    poses = np.arange(len(plan.q))
    turned = watch(form).space.wrap(plan.q)  # many turns would read as degrees
    along = np.degrees(clearance(form, turned, certify=True, gap=1e-3).upper)
    top.plot(poses, along, color=COLORS[0], label="the path")
    top.axhline(
        np.degrees(plan.clearance), color=COLORS[0], ls="--", lw=1, label="its least (proven)"
    )
    top.axhline(np.degrees(plan.bound), color=SINGULAR, ls=":", lw=1, label="bound of all paths")
    label = f"{plain(plan.free)} kept, each branch" if wide else "other branches"
    for k, line in enumerate(np.degrees(plan.kept)):
        top.plot(poses, line, color=COLORS[1], lw=0.8, zorder=1, label=None if k else label)
    title = f"{plain(plan.arm.name)}: distance to the nearest singularity"
    top.set(ylim=(0, 1.05 * top.get_ylim()[1]), ylabel="clearance [°]", title=title)
    legend_below(top)
    if wide:
        below = axes[1, 0]
        room = np.degrees(np.where(np.isfinite(plan.room), plan.room, np.nan))
        mesh = below.pcolormesh(
            poses, np.degrees(plan.grid), room.T, cmap="viridis", vmin=0, shading="nearest",
            rasterized=True,
        )  # fmt: skip
        figure.colorbar(mesh, ax=below, label="clearance [°]")
        values = np.degrees(plan.values)
        jump = np.flatnonzero(np.abs(np.diff(values)) > 180) + 1  # round the circle
        broken = [np.insert(line.astype(float), jump, np.nan) for line in (poses, values)]
        below.plot(*broken, color="white", lw=3)
        below.plot(*broken, color=SINGULAR, lw=1.5)
        below.set_ylabel(f"{plain(plan.free)} [°]")
    axes[-1, 0].set_xlabel("pose")
    return figure
