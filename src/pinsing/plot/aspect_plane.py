"""Aspects in colours over two joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from pinsing._types import Array, Ints
from pinsing.arguments import checked, real_numbers, whole_number
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, Family
from pinsing.families import closed_form as closed_form_of
from pinsing.plot.plane import (
    draw_family,
    family_label,
    fills_plane,
    label_plane,
    plane_of,
    regular_configuration,
    two_joints,
)
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    joint_symbol,
    legend_below,
    new_axes,
    value_label,
)
from pinsing.postures.aspects import Aspects
from pinsing.postures.aspects import aspects as aspects_of
from pinsing.robot.arm import Arm

SAMPLES = 241
_COLOURS = (
    "#4E79A7", "#F28E2B", "#76B7B2", "#E15759", "#59A14F", "#EDC948", "#B07AA1", "#9C755F",
    "#A0CBE8", "#FFBE7D", "#2C6E6A", "#FF9D9A", "#8CD17D", "#8F7A12", "#D4A6C8", "#D7B5A6",
    "#1F3A5F", "#8C1C2B", "#C9E8E4", "#5B3A73",
)  # fmt: skip
"""One for each aspect that the legend names: no two alike."""


@checked
def aspect_plane(
    arm: Arm,
    joint_a: str,
    joint_b: str,
    ax: Axes | None = None,
    *,
    q: npt.ArrayLike | None = None,
    forms: ClosedForm | None = None,
    samples: int = SAMPLES,
    ignore_limits: bool = False,
    degrees: bool = False,
) -> Axes:
    """Draw the aspects over two joints, the others at ``q``.

    Two regions of one colour are of one aspect: they are joined by way of other joints.

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
    forms : ClosedForm, optional
        Of the arm, if at hand.
    samples : int
        Points to each side.
    ignore_limits : bool
        Joints that turn endlessly instead of ending at limits.
    degrees : bool
        Label angles in degrees; the axes are in radians all the same.

    Returns
    -------
    Axes
        The regions are its first collection; the legend has the aspects' numbers, and their names
        where the field has some. Of more than 20 the largest are named, and the others grey.

    Raises
    ------
    UnknownNameError
        If a joint does not exist.
    OptionError
        If both joints are the same.
    ConfigurationError
        If q has the wrong length, is not finite, or is outside limits that count.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> axes = plot.aspect_plane(pinsing.load("scara"), "q1", "q2", samples=41)
    >>> len(axes.get_legend().get_texts())
    2
    """
    plane = a, b = two_joints(arm, joint_a, joint_b, samples)
    form = closed_form_of(arm) if forms is None else forms
    found = aspects_of(form, not ignore_limits)
    base = regular_configuration(arm) if q is None else arm.check_one(q)
    Q = plane_of(arm, plane, base, samples, ignore_limits)
    x, y = Q[0, :, a], Q[:, 0, b]
    numbers = _numbers(found, Q)
    named, others = _named(numbers)
    said = [_said(found, number) for number in named]
    lines = said + [f"and {others} more"] * (others > 0)
    untold = float(np.mean(numbers <= 0)) > 0.005  # what can be seen of the picture
    lines += ["aspect not told"] * untold
    columns = 1 if max(map(len, lines), default=0) > 14 else 3
    legend_height = 0.147 * -(-len(lines) // columns)
    ax = new_axes(3.2 + legend_height) if ax is None else ax
    colours = [*_COLOURS[: len(named)], "#C8C8C8"]
    shown = np.full(numbers.shape, float(len(named)))
    for k, number in enumerate(named):
        shown[numbers == number] = k
    shown[numbers <= 0] = np.nan
    ax.pcolormesh(
        x, y, shown, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(colours) - 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    edge = (np.diff(numbers, axis=0, append=numbers[-1:]) != 0) | (
        np.diff(numbers, axis=1, append=numbers[:, -1:]) != 0
    )
    line = np.where(edge, 1.0, np.nan)
    ax.pcolormesh(x, y, line, cmap=ListedColormap(["#222222"]), shading="nearest", rasterized=True)
    label_plane(ax, arm, Q, plane, plane, degrees)
    shades = colours if others else colours[:-1]
    for text, colour in zip(lines, shades + ["white"] * untold, strict=True):
        ax.plot([], [], "s", color=colour, markeredgecolor="#888888", label=text)
    legend_below(ax, columns, left=True)
    return ax


def _named(numbers: Ints) -> tuple[list[int], int]:
    """The aspects that have a colour of their own, the largest ones; and how many others."""
    seen, size = np.unique(numbers[numbers > 0], return_counts=True)
    largest = np.argsort(-size, kind="stable")[: len(_COLOURS)]
    return np.sort(seen[largest]).tolist(), max(0, len(seen) - len(_COLOURS))


def _said(found: Aspects, number: int) -> str:
    names = found[number - 1].names if number <= len(found) else ()
    return f"aspect {number}" + (f": {', '.join(names)}" if names else "")


def _numbers(found: Aspects, Q: Array) -> Ints:
    """Number of the aspect at each point of a grid (M, N, n); 0 where it could not be told.

    Points that touch and have the same signs, between the same joint values, are of one aspect:
    it is asked at the point of such a region that is farthest from its edge, and at others only
    if it is not told there.
    """
    chosen = found._map
    assert chosen is not None
    label = _regions(_keys(found, Q))
    depth = _depth(label)
    numbers = np.zeros(label.shape, dtype=np.int64)
    order = np.lexsort((-depth.ravel(), label.ravel()))
    first = np.unique(label.ravel()[order], return_index=True)[1][1:]
    for points in np.split(order, first):
        # A thin region may have nothing but edge: points of it may be singular.
        some = np.unique(np.linspace(0, len(points) - 1, 12).astype(np.int64))
        told = (found.of(q) for q in Q.reshape(-1, Q.shape[-1])[points[some]])
        number = next((n for n in told if n is not None), 0)
        numbers.ravel()[points] = number
    return numbers


def _keys(found: Aspects, Q: Array) -> Ints:
    """Which arcs and signs each point has, as one number."""
    chosen = found._map
    assert chosen is not None
    key = np.zeros(Q.shape[:-1], dtype=np.int64)
    for part in chosen.partition.parts:
        for place, j in enumerate(part.joints):
            arcs = part.arcs[place]
            value = Q[..., j]
            if chosen.partition.endless[j] and not arcs[0].circle:
                low = arcs[0].low
                value = low + np.mod(value - low, 2 * math.pi)
            key = key * (len(arcs) + 1) + np.searchsorted([a.high for a in arcs[:-1]], value)
        for surface in part.surfaces:
            key = key * 2 + (surface.equation(Q) > 0)
    return key


def _regions(key: Ints) -> Ints:
    """Label of the connected set of equal keys at each point of a grid."""
    from scipy.ndimage import label

    out = np.zeros(key.shape, dtype=np.int64)
    for value in np.unique(key):
        numbers, _ = label(key == value)
        out[numbers > 0] = numbers[numbers > 0] + out.max()
    return out


def _depth(label: Ints) -> Ints:
    """Steps from each point to another label or the edge of the grid."""
    from scipy.ndimage import distance_transform_cdt

    inside = np.ones(label.shape, dtype=bool)
    inside[[0, -1]] = inside[:, [0, -1]] = False
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(label, step, axis) == label
    return np.asarray(distance_transform_cdt(inside, "taxicab"))


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
