"""A family of singular configurations as curves over two joints."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.arguments import checked, real_numbers, whole_number
from pinsing.errors import OptionError
from pinsing.families import Family
from pinsing.plot.plane import draw_family, family_label, fills_plane, label_plane, plane_of
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    joint_symbol,
    legend_below,
    new_axes,
    value_label,
)
from pinsing.robot.arm import Arm

SAMPLES = 241
"""Points to each side of the grid that the curves are followed on."""
_MOST_CURVES = 12


@checked
def locus(
    arm: Arm,
    family: Family,
    joint_a: str | None = None,
    joint_b: str | None = None,
    ax: Axes | None = None,
    *,
    q: npt.ArrayLike | None = None,
    third: str | None = None,
    values: npt.ArrayLike | None = None,
    samples: int = SAMPLES,
    ignore_limits: bool = False,
    degrees: bool = False,
) -> Axes:
    """Draw where a family is over two joints, the others at ``q``; a curve for each third value.

    Parameters
    ----------
    arm : Arm
        The arm.
    family : Family
        One of ``closed_form(arm).families``.
    joint_a, joint_b : str, optional
        Names of the joints along x and y; by default the first two of the family's joints.
    ax : Axes, optional
        Where to draw.
    q : (n,) or (nq,) array_like, optional
        Values of the other joints, radians and metres; by default those of the family's own
        configuration, ``family.generic``. Marked if it is on the family.
    third : str, optional
        Name of a joint that is put at each of ``values``, a curve for each.
    values : (k,) array_like, optional
        Radians, or metres.
    samples : int
        Points to each side of the grid.
    ignore_limits : bool
        Draw whole circles of revolute joints.
    degrees : bool
        Label angles in degrees; the axes are in radians all the same.

    Returns
    -------
    Axes
        A line, contour or points for each curve, named in the legend. Where the family does not
        meet the plane the legend says "none", where it holds all of it "the whole plane", which
        is shaded.

    Raises
    ------
    UnknownNameError
        If a joint does not exist.
    OptionError
        If joints are the same, or only one of ``third`` and ``values`` is given.
    ConfigurationError
        If q has the wrong length, values are not a row of numbers, or anything is not finite.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> arm = pinsing.load("puma560")
    >>> family = pinsing.closed_form(arm).families[1]
    >>> axes = plot.locus(arm, family, "q2", "q3")
    >>> axes.get_ylabel()
    '$q_{3}$ [rad]'
    """
    whole_number(samples, "samples", 2, 2000)
    if family.n != arm.n or not set(family.joints) <= set(arm.joints):
        raise OptionError(f"family {family.name} is of another arm than {arm.name}")
    a, b = _plane(arm, family, joint_a, joint_b)
    base = _base(arm, family, q)
    c, steps = _third(arm, (a, b), third, values, base)
    Q = plane_of(arm, (a, b), base, samples, ignore_limits)
    ax = new_axes(3.6) if ax is None else ax
    for value, color, dash in zip(steps, cycle(COLORS), cycle(DASHES), strict=False):
        name = family_label(family)
        if c is not None:
            Q[..., c] = value
            slides = bool(arm.prismatic[c])
            name = f"{joint_symbol(c, slides)} = {value_label(float(value), slides, degrees)}"
        if fills_plane(family, Q, (a, b)):
            whole = f"{name}: the whole plane"
            ax.axvspan(Q[0, 0, a], Q[0, -1, a], color=color, alpha=0.15, label=whole)
        elif not draw_family(ax, family, Q, (a, b), name, color=color, dash=dash):
            ax.plot([], [], linestyle="", label=f"{name}: none")
    if c is None and bool(family.contains(base)):
        ax.plot(base[a], base[b], "o", color=SINGULAR, markersize=5, label="configuration")
    ax.grid(visible=True, color="#dddddd", linewidth=0.5)
    moving = (a, b) if c is None else (a, b, c)
    label_plane(ax, arm, Q, (a, b), moving, degrees, f"{family.label} of ")
    legend_below(ax, 2)
    return ax


def _plane(arm: Arm, family: Family, first: str | None, second: str | None) -> tuple[int, int]:
    """The two joints, those not given taken from what the family speaks of, else in order."""
    given = [None if name is None else arm.space.index(name) for name in (first, second)]
    mixed = [set(e.involved) for e in family.equations]
    ordered = sorted({j for group in mixed for j in group})
    ordered += sorted({j for branch in family.branches for j in branch.involved})
    free = [j for j in dict.fromkeys([*ordered, *range(arm.n)]) if j not in given]
    a, b = (free.pop(0) if j is None and free else j for j in given)
    if a is None or b is None or a == b:
        raise OptionError("a locus needs two different joints")
    return a, b


def _base(arm: Arm, family: Family, q: npt.ArrayLike | None) -> Array:
    if q is not None:
        return arm.check_one(q)
    return np.zeros(arm.n) if family.generic is None else np.array(family.generic)


def _third(
    arm: Arm, plane: tuple[int, int], third: str | None, values: npt.ArrayLike | None, base: Array
) -> tuple[int | None, Sequence[float]]:
    if third is None and values is None:
        return None, (0.0,)
    if third is None or values is None:
        raise OptionError("third and values belong together: a joint, and where it is put")
    c = arm.space.index(third)
    if c in plane:
        raise OptionError(f"{third} is along an axis already: the third joint must be another")
    steps = np.atleast_1d(real_numbers(values, "values"))
    for value in steps.ravel():
        arm.check_one(np.where(np.arange(arm.n) == c, value, base))
    if steps.ndim != 1 or not 1 <= len(steps) <= _MOST_CURVES:
        raise OptionError(f"values must be a row of 1 to {_MOST_CURVES} numbers")
    return c, steps.tolist()
