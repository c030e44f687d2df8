"""Map of sigma_min over two joints, with the closed-form loci on top."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle
from typing import Literal

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.arguments import checked, whole_number
from pinsing.errors import OptionError
from pinsing.families import Family
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.verdict import ratios
from pinsing.plot.family_curve import draw_family
from pinsing.plot.style import (
    DASHES,
    SMALL,
    joint_label,
    joint_symbol,
    legend_below,
    new_axes,
    plain,
    ticks,
    value_label,
)
from pinsing.robot.arm import Arm

SAMPLES = 161
"""Points to each side of the map."""
_MOST_SAMPLES = 2000

# On top of the blue to yellow of the map.
_LINES = ("#FFFFFF", "#FF9DA7", "#A6F0C6", "#F4C7FF", "#FFFFFF", "#FF9DA7", "#A6F0C6")
_SHORT = 26
"""Letters of a condition that a legend has room for."""


@checked
def sigma_plane(
    arm: Arm,
    joint_a: str,
    joint_b: str,
    ax: Axes | None = None,
    *,
    q: npt.ArrayLike | None = None,
    measure: Literal["sigma", "clearance"] = "sigma",
    families: Iterable[Family] | None = None,
    samples: int = SAMPLES,
    ignore_limits: bool = False,
    degrees: bool = False,
) -> Axes:
    """Draw sigma_min over two joints, the others at ``q``.

    Parameters
    ----------
    arm : Arm
        The arm.
    joint_a, joint_b : str
        Names of the joints along x and y.
    ax : Axes, optional
        Where to draw.
    q : (n,) or (nq,) array_like
        Values of the other joints, radians and metres; by default a regular configuration
        within the limits.
    measure : str
        "sigma": the smallest singular value. "clearance": the proven lower bound of the distance
        to the nearest of the families, in degrees; limits are not considered.
    families : iterable of Family, optional
        Drawn where they meet this plane; ``closed_form(arm).families`` by default.
    samples : int
        Points to each side.
    ignore_limits : bool
        Draw whole circles of revolute joints.
    degrees : bool
        Label angles in degrees; the axes are in radians all the same.

    Returns
    -------
    Axes
        The map is its first collection; each locus is a line, contour or marker, with the
        family's name in the legend.

    Raises
    ------
    UnknownNameError
        If a joint does not exist.
    OptionError
        If both joints are the same, or the measure is another word.
    ConfigurationError
        If q has the wrong length or is not finite.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> axes = plot.sigma_plane(pinsing.load("planar3r"), "q2", "q3", samples=41)
    >>> axes.get_legend().get_texts()[0].get_text()
    'F1: q2 = 0° or 180°'
    """
    a, b = arm.space.index(joint_a), arm.space.index(joint_b)
    if a == b:
        raise OptionError("a map needs two different joints")
    whole_number(samples, "samples", 2, _MOST_SAMPLES)
    if families is None:
        from pinsing.families import closed_form

        families = closed_form(arm, prove=False).families
    families = tuple(families)
    base = regular_configuration(arm) if q is None else arm.check_one(q)
    lower, upper = arm.space.range(ignore_limits)
    x, y = (np.linspace(lower[j], upper[j], samples) for j in (a, b))
    Q = np.tile(base, (samples, samples, 1))
    Q[..., a], Q[..., b] = x[None, :], y[:, None]
    values, label = _measured(arm, Q.reshape(-1, arm.n), measure, families)

    ax = new_axes(3.6) if ax is None else ax
    shown = values.reshape(samples, samples)
    mesh = ax.pcolormesh(x, y, shown, cmap="cividis", shading="nearest", rasterized=True, vmin=0)
    # Above, where it leaves the map and the legend the whole width.
    bar = ax.figure.colorbar(mesh, ax=ax, location="top", pad=0.02, aspect=34, shrink=0.96)
    bar.set_label(label, fontsize=SMALL + 1)
    bar.ax.tick_params(labelsize=SMALL)
    styles = cycle(zip(_LINES, DASHES, strict=True))
    for family in families:
        color, dash = next(styles)
        draw_family(ax, family, Q, (a, b), family_label(family), color=color, dash=dash)
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    for axis, j in ((ax.xaxis, a), (ax.yaxis, b)):
        ticks(axis, lower[j], upper[j], bool(arm.prismatic[j]), degrees)
    ax.set_xlabel(joint_label(a, bool(arm.prismatic[a]), degrees), fontsize=SMALL + 1)
    ax.set_ylabel(joint_label(b, bool(arm.prismatic[b]), degrees), fontsize=SMALL + 1)
    ax.set_title(held_title(arm, base, (a, b), degrees), fontsize=SMALL - 1)
    legend_below(ax, 1, left=True)
    legend = ax.get_legend()
    if legend is not None:  # light lines need a dark ground, as they have on the map
        legend.set_frame_on(True)
        legend.get_frame().set(facecolor="#3b4a63", edgecolor="none")
        for text in legend.get_texts():
            text.set_color("white")
    return ax


def _measured(arm: Arm, Q: Array, measure: str, families: tuple[Family, ...]) -> tuple[Array, str]:
    """Values (N,) at Q (N, n), and what they are."""
    if measure == "sigma":
        return singular_values(arm, Q)[:, -1], r"$\sigma_{\min}$"
    real = [family.branches for family in families if family.real]
    if not real:
        raise OptionError("clearance is infinite: no family of singular configurations is known")
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of(real, np.asarray(arm.prismatic), weight)
    return np.degrees(two_sided(conditions, Q).lower), "clearance, at least [deg]"


def held_title(arm: Arm, q: Array, moving: Iterable[int], degrees: bool) -> str:
    """The arm's name, and where the joints stay that do not move."""
    rest = ", ".join(
        f"{joint_symbol(j, bool(arm.prismatic[j]))} = "
        f"{value_label(float(q[j]), bool(arm.prismatic[j]), degrees)}"
        for j in range(arm.n)
        if j not in tuple(moving)
    )
    return f"{plain(arm.name)}, {rest}" if rest else plain(arm.name)


def regular_configuration(arm: Arm) -> Array:
    """The most regular of some configurations within the limits; the same every time."""
    rng = np.random.default_rng(3)
    Q = arm.space.sample(256, rng)
    chosen = Q[int(np.argmax(ratios(arm, Q)))]
    # Round numbers are easier to read in a title, and as good.
    return np.asarray(np.clip(np.round(chosen, 2), *arm.span))


def family_label(family: Family) -> str:
    """``F1: q3 = 0° or 180°`` where that is short, else the family's name and its joints."""
    if len(family.text) <= _SHORT:
        return f"{family.name}: {family.text}"
    joints = sorted({j for b in family.branches for j in b.involved})
    named = ", ".join(joint_symbol(j, bool(family.prismatic[j])) for j in joints)
    return f"{family.name} (of {named})"
