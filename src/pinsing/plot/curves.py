"""Distributions of sigma_min along a joint, as in the paper's Figures 2 to 9."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import OptionError, UnknownNameError
from pinsing.kinematics.verdict import SINGULAR_RTOL, ratios
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    SMALL,
    joint_symbol,
    legend_below,
    new_axes,
    plain,
    ticks,
    unit,
    value_label,
)
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.sampling.generalize import Finding, JointCondition
from pinsing.sampling.sweep_run import SweepCurve, SweepResult


@checked
def sigma_curves(
    result: SweepResult,
    ax: Axes | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    moving: Sequence[str] | None = None,
    findings: Iterable[Finding] = (),
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
    findings : iterable of Finding, optional
        Refined singular configurations (``singular_configurations``), marked on the curves
        that led to them, also between samples.
    degrees : bool
        Label angles in degrees; the axis is in radians all the same.
    arm : Arm, optional
        The arm that was swept: every dip of a curve is closed in upon, and each true zero is
        marked, whether or not the sweep has refined it.

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
    >>> plot.sigma_curves(pinsing.sweep(pinsing.load("planar3r"))).get_xlabel()
    'joint angle [rad]'
    """
    if arm is not None and arm.joints != result.arm.joints:
        raise OptionError(
            f"arm is {arm.name} with other joints than the sweep of {result.arm.name}"
        )
    summary = result.arm
    if moving is None:
        names = [n for n in summary.joints if _has(result, fixed, n)]
        if not names:
            raise OptionError(f"the sweep has no curve with {result.set_text(dict(fixed or {}))}")
    else:
        names = [moving] if isinstance(moving, str) else list(moving)
        if not names:
            raise OptionError("moving names no joint: leave it out for all")
    curves = [result.curve(fixed, name) for name in names]
    ax = new_axes() if ax is None else ax
    turning = [c for c in curves if not summary.prismatic[c.moving]]
    sliding = [c for c in curves if summary.prismatic[c.moving]]
    top = ax.twiny() if turning and sliding else ax
    styles = cycle(zip(COLORS, DASHES, strict=True))
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
            x = _singular(curve, summary, findings)
            if arm is not None and not curve.forced:
                base = _at(curve, result)
                dips = curve_zeros(arm, base, curve.moving, curve.x, curve.sigma_ratio)
                x = _apart([*x, *dips])
            if len(x):
                mark: dict[str, Any] = {
                    "marker": "o",
                    "color": SINGULAR,
                    "markersize": 3.5,
                    "linestyle": "none",
                }
                label = "" if marked else "singular"
                axes.plot(x, np.zeros(len(x)), clip_on=False, zorder=5, label=label, **mark)
                marked = True
        if some:
            low, high = min(c.x[0] for c in some), max(c.x[-1] for c in some)
            axes.set_xlim(low, high)
            ticks(axes.xaxis, low, high, slides, degrees)
            what = "joint position" if slides else "joint angle"
            axes.set_xlabel(f"{what} [{unit(slides, degrees)}]", fontsize=SMALL)
    highest = max(float(c.sigma_min.max()) for c in curves)
    ax.set_ylim(0, 1.08 * highest if highest > 1e-12 else 1.0)
    ax.set_ylabel(r"$\sigma_{\min}$", fontsize=SMALL + 1)
    ax.tick_params(axis="y", labelsize=SMALL)
    ax.grid(color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    held = ", ".join(_held(summary, name, value, degrees) for name, value in (fixed or {}).items())
    ax.set_title(plain(summary.name) + (f", {held}" if held else ""), fontsize=SMALL + 1)
    if top is not ax:  # one legend for both
        for line in top.get_lines():
            ax.plot([], [], color=line.get_color(), linestyle=line.get_linestyle(),
                    marker=line.get_marker(), label=line.get_label())  # fmt: skip
    legend_below(ax, 4, title=_rest(result, fixed or {}, degrees))
    return ax


_SAME = 1e-7
"""Values of a joint closer than this are one zero of a curve."""


def _at(curve: SweepCurve, result: SweepResult) -> Array:
    """Where the joints are on a curve, all but the one that moves."""
    q = np.array(result.plan.nominal, dtype=float)
    for name, value in curve.fixed.items():
        q[result.arm.joints.index(name)] = value
    return q


def _rest(result: SweepResult, fixed: Mapping[str, float], degrees: bool) -> str:
    """Where joints rest that neither move nor are held, in two lines at most."""
    arm, q = result.arm, result.plan.nominal
    said = [
        _held(arm, name, float(f"{q[j]:.4g}"), degrees)
        for j, name in enumerate(arm.joints)
        if name not in fixed
    ]
    half = (len(said) + 1) // 2
    lines = (
        [", ".join(said)] if len(said) <= 4 else [", ".join(said[:half]), ", ".join(said[half:])]
    )
    return "a joint that does not move rests at " + ",\n".join(lines)


def _has(result: SweepResult, fixed: Mapping[str, float] | None, name: str) -> bool:
    try:
        result.curve(fixed, name)
    except UnknownNameError:
        raise
    except OptionError:
        if not result.kept:
            raise
        return False
    return True


def _held(arm: ArmSummary, name: str, value: float, degrees: bool) -> str:
    index = arm.joints.index(name)
    slides = bool(arm.prismatic[index])
    return f"{joint_symbol(index, slides)} = {value_label(value, slides, degrees)}"


def _singular(curve: SweepCurve, arm: ArmSummary, findings: Iterable[Finding]) -> np.ndarray:
    """Values of the moving joint at which the curve is singular, sampled or refined."""
    if curve.forced:
        return np.zeros(0)  # the whole curve is
    found = list(curve.x[curve.sigma_ratio <= SINGULAR_RTOL])
    name = arm.joints[curve.moving]
    for finding in findings:
        if curve.number not in finding.curves or finding.status != "singular":
            continue
        values = [x for number, x in finding.zeros if number == curve.number]
        stated = finding.condition.fixed.get(name)
        if stated is not None and _on_curve(finding.condition, curve, name, arm):
            values.append(stated)
        turns = [0.0] if arm.prismatic[curve.moving] else 2 * np.pi * np.arange(-2, 3)
        copies = [value + turn for value in values for turn in turns]
        found += [x for x in copies if curve.x[0] - 1e-9 <= x <= curve.x[-1] + 1e-9]
    return _apart(found)


def _apart(values: Iterable[float]) -> np.ndarray:
    """Values in order, those that are the same but for rounding once."""
    kept: list[float] = []
    for x in sorted(values):
        if not kept or x - kept[-1] > _SAME:
            kept.append(float(x))
    return np.array(kept)


def _on_curve(condition: JointCondition, curve: SweepCurve, moving: str, arm: ArmSummary) -> bool:
    """Whether a curve holds all but its moving joint where a condition wants them.

    A dip of the curve may lead to a configuration at which other joints have moved too.
    """
    if condition.related:
        return False
    for name, value in condition.fixed.items():
        if name == moving:
            continue
        if name not in curve.fixed:
            return False
        off = value - curve.fixed[name]
        if not arm.prismatic[arm.joints.index(name)]:
            off = math.remainder(off, 2 * math.pi)
        if abs(off) > 1e-9:
            return False
    return True


_FINE = 17


def curve_zeros(arm: Arm, q: Array, moving: int, x: Array, ratio: Array) -> Array:
    """Values of joint ``moving`` at which the arm is singular, the others at q (n,).

    Each dip of the samples ``ratio`` (N,) over ``x`` (N,) is closed in upon, since sigma_r falls
    to a zero like the absolute value of what it is the distance to: samples step over it.
    """
    padded = np.concatenate([[np.inf], ratio, [np.inf]])
    # sigma_r / sigma_1 above which a dip is not looked at
    dips = np.flatnonzero((ratio <= padded[:-2]) & (ratio <= padded[2:]) & (ratio < 0.3))
    if not len(dips):
        return np.zeros(0)
    low, high = x[np.maximum(dips - 1, 0)], x[np.minimum(dips + 1, len(x) - 1)]
    part = np.linspace(0.0, 1.0, _FINE)
    for _ in range(15):
        grid = low[:, None] + (high - low)[:, None] * part
        Q = np.tile(q, (*grid.shape, 1))
        Q[..., moving] = grid
        found = ratios(arm, Q.reshape(-1, arm.n)).reshape(grid.shape)
        best = found.argmin(axis=1)
        rows = np.arange(len(dips))
        low, high = (
            grid[rows, np.maximum(best - 1, 0)],
            grid[rows, np.minimum(best + 1, _FINE - 1)],
        )
    values, least = grid[rows, best], found[rows, best]
    return np.asarray(values[least <= SINGULAR_RTOL])
