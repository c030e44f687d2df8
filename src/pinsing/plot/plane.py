"""Map of sigma_min over two joints, with the closed-form loci on top."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import compress, cycle, product
from typing import Any, Literal

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from pinsing.algebra.conditions import Conditions, two_sided
from pinsing.arguments import checked, real_numbers, whole_number
from pinsing.errors import OptionError
from pinsing.families import Branch, ClosedForm, Equation, Family, closed_form
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.jacobian import ratios, singular_values, tip_poses
from pinsing.measures import ALIKE, Array, ArrayLike, Bool, Ints
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    SMALL,
    held_label,
    joint_label,
    joint_symbol,
    legend_below,
    new_axes,
    plain,
    ticks,
)
from pinsing.postures.aspects import Aspects, aspects as aspects_of
from pinsing.robot.arm import Arm
from pinsing.sampling.generalize import apart

SAMPLES = 161
"""Points to each side of the map."""

# On top of the blue to yellow of the map.
_LINES = ("#FFFFFF", "#FF9DA7", "#A6F0C6")  # with four dashes, twelve kinds of lines


@checked
def sigma_plane(
    arm: Arm,
    joint_a: str,
    joint_b: str,
    ax: Axes | None = None,
    *,
    q: ArrayLike | None = None,
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
    plane, Q = two_joints(arm, joint_a, joint_b, q, samples, ignore_limits)
    families = tuple(closed_form(arm, prove=False).families if families is None else families)
    values, what, unit = _measured(arm, Q.reshape(-1, arm.n), measure, families)

    ax = new_axes(3.6) if ax is None else ax
    mesh = ax.pcolormesh(
        *_sides(Q, plane), values.reshape(samples, samples), cmap="cividis", shading="nearest",
        rasterized=True, vmin=0,
    )  # fmt: skip
    # Above, where it leaves the map and the legend the whole width.
    bar = ax.figure.colorbar(mesh, ax=ax, location="top", pad=0.02, aspect=34, shrink=0.96)
    bar.set_label(what + unit, fontsize=SMALL + 1)
    bar.ax.tick_params(labelsize=SMALL)
    for family, color, dash in zip(families, cycle(_LINES), cycle(DASHES), strict=False):
        draw_family(ax, family, Q, plane, family_label(family), color=color, dash=dash)
    label_plane(ax, arm, Q, plane, plane, degrees)
    legend_below(ax, 1, left=True)
    legend = ax.get_legend()
    if legend is not None:  # light lines need a dark ground, as they have on the map
        legend.set_frame_on(True)
        legend.get_frame().set(facecolor="#3b4a63", edgecolor="none")
        for text in legend.get_texts():
            text.set_color("white")
    return ax


def _measured(
    arm: Arm, Q: Array, measure: str, families: tuple[Family, ...]
) -> tuple[Array, str, str]:
    """Values (N,) at Q (N, n), what they are, and their unit."""
    if measure == "sigma":
        return singular_values(arm, Q)[:, -1], r"$\sigma_{\min}$", ""
    real = [family.branches for family in families if family.real]
    OptionError.refuse_if(
        not real, "clearance is infinite: no family of singular configurations is known"
    )
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of(real, np.asarray(arm.prismatic), weight)
    what = "clearance" if arm.design is None else "distance from families of the design"
    return np.degrees(two_sided(conditions, Q).lower), f"{what}, at least", " [deg]"


def two_joints(
    arm: Arm, joint_a: str, joint_b: str, q: ArrayLike | None, samples: int, ignore_limits: bool
) -> tuple[tuple[int, int], Array]:
    """Indices of two joints, which must differ, and `plane_of` them at q or a regular place."""
    plane = arm.space.index(joint_a), arm.space.index(joint_b)
    OptionError.refuse_if(plane[0] == plane[1], "a map needs two different joints")
    base = regular_configuration(arm) if q is None else arm.check_one(q)
    return plane, plane_of(arm, plane, base, samples, ignore_limits)


def plane_of(
    arm: Arm, plane: tuple[int, int], base: Array, samples: int, ignore_limits: bool
) -> Array:
    """A grid (k, k, n) over two joints: the first along the second axis, the other at ``base``."""
    whole_number(samples, "samples", 2, 2000)
    lower, upper = arm.space.range(ignore_limits)
    Q = np.tile(base, (samples, samples, 1))
    x, y = (np.linspace(lower[j], upper[j], samples) for j in plane)
    Q[..., plane[0]], Q[..., plane[1]] = x[None, :], y[:, None]
    return Q


def _sides(Q: Array, plane: tuple[int, int]) -> tuple[Array, Array]:
    """Values (k,) of both joints of a grid."""
    return Q[0, :, plane[0]], Q[:, 0, plane[1]]


def label_plane(
    ax: Axes,
    arm: Arm,
    Q: Array,
    plane: tuple[int, int],
    moving: Iterable[int],
    degrees: bool,
    before: str = "",
) -> None:
    """Ends, ticks and labels of the axes of a grid, and a title that says where the rest stays."""
    for axis, j in zip((ax.xaxis, ax.yaxis), plane, strict=True):
        slides, low, high = bool(arm.prismatic[j]), float(Q[0, 0, j]), float(Q[-1, -1, j])
        ticks(axis, low, high, slides, degrees)
        (ax.set_xlim if axis is ax.xaxis else ax.set_ylim)(low, high)
        axis.set_label_text(joint_label(j, slides, degrees), fontsize=SMALL + 1)
    rest = [
        held_label(j, bool(arm.prismatic[j]), float(Q[0, 0, j]), degrees)
        for j in range(arm.n)
        if j not in tuple(moving)
    ]
    ax.set_title(before + ", ".join([plain(arm.name), *rest]), fontsize=SMALL - 1)


def regular_configuration(arm: Arm) -> Array:
    """The most regular of some configurations within the limits; the same every time."""
    Q = arm.space.sample(256, np.random.default_rng(3))
    chosen = Q[int(np.argmax(ratios(arm, Q)))]
    # Round numbers are easier to read in a title, and as good.
    return np.asarray(np.clip(np.round(chosen, 2), *arm.span))


def family_label(family: Family) -> str:
    """``F1: q3 = 0° or 180°`` where that is short, else the family's name and its joints."""
    # Letters of a condition that a legend has room for
    if len(family.text) <= 26:
        return f"{family.label}: {family.text}"
    joints = sorted({j for b in family.branches for j in b.involved})
    named = ", ".join(joint_symbol(j, bool(family.prismatic[j])) for j in joints)
    return f"{family.label}, of {named}"


def draw_family(
    ax: Axes,
    family: Family,
    Q: Array,
    plane: tuple[int, int],
    label: str,
    *,
    color: str,
    dash: Any = "-",
) -> bool:
    """Draw a family in a plane of joints, Q (k, k, n), the first along axis 2; True if it meets."""
    line = {"color": color, "linestyle": dash, "linewidth": 1.3}
    drawn = [
        _draw_branch(ax, branch, family.prismatic, Q, plane, line) for branch in family.branches
    ]
    if any(drawn):
        ax.plot([], [], label=label, **line)
    return any(drawn)


def _draw_branch(
    ax: Axes, branch: Branch, prismatic: Bool, Q: Array, plane: tuple[int, int], line: Any
) -> bool:
    """Draw where a branch meets a plane: a curve, straight lines, or points; tell if it does."""
    met = _in_plane(branch, Q, plane, prismatic)
    if met is None:
        return False
    free, equations = met
    sides = _sides(Q, plane)
    if not free:
        # Everything, or points, is nothing that a line could show.
        level = equations[0](Q) if len(equations) == 1 else np.ones(1)
        crossed = bool(level.min() * level.max() <= 0)
        if crossed:
            dash = [line["linestyle"]]
            ax.contour(
                *sides, level, levels=[0.0], linewidths=1.3, colors=line["color"], linestyles=dash
            )
        return crossed
    at = {
        k: _copies(free[j], side, bool(prismatic[j]))
        for k, (j, side) in enumerate(zip(plane, sides, strict=True))
        if j in free
    }
    if len(at) == 2:
        points = [] if equations else list(product(at[0], at[1]))
    else:
        ((k, values),) = at.items()
        if not equations:
            for value in values:
                (ax.axhline if k else ax.axvline)(value, **line)
            return bool(values)
        other, side = plane[1 - k], sides[1 - k]
        points = [
            (x, value) if k else (value, x)
            for value in values
            for x in _zeros(equations[0], Q[0, 0], plane[k], value, other, side).tolist()
        ]
    if points:
        ax.plot(*np.transpose(points), "o", color=line["color"], markersize=4)
    return bool(points)


def fills_plane(family: Family, Q: Array, plane: tuple[int, int]) -> bool:
    """Return True if every configuration of a plane, as for `draw_family`, is of the family."""
    return any(
        met is not None and not met[0] and all(np.abs(e(Q)).max() <= ALIKE * e.size for e in met[1])
        for met in (_in_plane(branch, Q, plane, family.prismatic) for branch in family.branches)
    )


def _in_plane(
    branch: Branch, Q: Array, plane: tuple[int, int], prismatic: Bool
) -> tuple[dict[int, float], list[Equation]] | None:
    """Values and equations of a branch that speak of the two joints; None if it is not met."""
    q = Q[0, 0]
    values = {v.joint: v.value for v in branch.values}
    off = [apart(float(q[j]), v, bool(prismatic[j])) for j, v in values.items() if j not in plane]
    ours = [bool(set(e.involved) & set(plane)) for e in branch.equations]
    rest = compress(branch.equations, (not our for our in ours))
    if max(off, default=0.0) > ALIKE or any(abs(float(e(q))) > ALIKE * e.size for e in rest):
        return None
    return (
        {j: v for j, v in values.items() if j in plane},
        list(compress(branch.equations, ours)),
    )


def _copies(value: float, axis: Array, slides: bool) -> list[float]:
    """A value and its copies a whole turn away, within the axis."""
    turns = [0.0] if slides else (2 * np.pi * np.arange(-2, 3)).tolist()
    return [value + t for t in turns if axis[0] - 1e-9 <= value + t <= axis[-1] + 1e-9]


def _zeros(
    equation: Equation, q: Array, fixed: int, value: float, moving: int, axis: Array
) -> Array:
    """Places on a line of the plane where an equation changes sign."""
    fine = np.linspace(axis[0], axis[-1], 2001)
    Q = np.tile(q, (len(fine), 1))
    Q[:, fixed], Q[:, moving] = value, fine
    f = equation(Q)
    k = np.flatnonzero(f[:-1] * f[1:] <= 0)
    slope = f[k + 1] - f[k]
    part = np.divide(-f[k], slope, out=np.zeros(len(k)), where=slope != 0)
    return np.asarray(fine[k] + part * (fine[1] - fine[0]))


_CELLS = 48


@checked
def workspace(
    arm: Arm,
    axes: Any = None,
    *,
    measure: Literal["sigma", "clearance"] = "sigma",
    forms: ClosedForm | None = None,
    samples: int = 60_000,
    through: tuple[float, float, float] | None = None,
) -> Any:
    """Draw slices of the reachable workspace: the best value found at each place of the tip.

    Configurations within the joint limits are drawn at random (with a fixed seed); a slice shows
    those whose tip is within a slab about it. A place is blank where none of them came, which
    does not prove that it cannot be reached.

    Parameters
    ----------
    arm : Arm
        The arm.
    axes : sequence of three Axes, optional
        Where to draw the slices x-z, y-z and x-y.
    measure : str
        "sigma": the smallest singular value of the task Jacobian. "clearance": the proven lower
        bound of the distance to the nearest family, in degrees.
    forms : ClosedForm, optional
        For "clearance"; ``closed_form(arm)`` by default.
    samples : int
        Configurations drawn.
    through : (x, y, z), optional
        Point that the slices go through, metres in the base; by default the axis of the first
        joint, at the middle height of what is reached.

    Returns
    -------
    Axes
        The first of the three.

    Raises
    ------
    OptionError
        If ``measure`` is another word, ``axes`` are not three, or ``samples`` makes no sense.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> plot.workspace(pinsing.load("planar3r"), samples=2000).get_xlabel()
    'x [m]'
    """
    whole_number(samples, "samples", 100, 5_000_000)
    figure = None if axes is not None else plt.figure(figsize=(9.0, 3.3), layout="constrained")
    every = list(np.ravel(axes if figure is None else figure.subplots(1, 3)))
    OptionError.refuse_if(
        len(every) != 3 or not all(isinstance(ax, Axes) for ax in every),
        "axes must be three of matplotlib's, for the slices x-z, y-z and x-y",
    )
    Q = arm.space.sample(samples, np.random.default_rng(2026))
    tips = tip_poses(arm, Q)[0]
    if forms is None and measure == "clearance":
        forms = form_to_measure(arm)
    values, what, unit = _measured(arm, Q, measure, () if forms is None else forms.families)
    low, high = tips.min(axis=0), tips.max(axis=0)
    size = float((high - low).max()) or 1.0
    middle = np.array([0.0, 0.0, (low[2] + high[2]) / 2]) if through is None else np.array(through)
    top = float(values.max(initial=0.0)) or 1.0
    mesh: Any = None
    half = 0.06 * size  # of the thickness of a slice
    planes = (((0, 2), 1), ((1, 2), 0), ((0, 1), 2))
    for ax, ((a, b), across) in zip(every, planes, strict=True):
        near = np.abs(tips[:, across] - middle[across]) <= half
        grid, edges = _best(tips[near][:, [a, b]], values[near], low[[a, b]], size)
        mesh = ax.pcolormesh(*edges, grid.T, cmap="cividis", vmin=0, vmax=top, rasterized=True)
        ax.set_xlabel(f"{'xyz'[a]} [m]", fontsize=SMALL)
        ax.set_ylabel(f"{'xyz'[b]} [m]", fontsize=SMALL)
        width = f"{middle[across] + 0.0:.3g} ± {half:.2g} m"
        ax.set_title(f"{'xyz'[across]} = {width}", fontsize=SMALL)
        ax.set_aspect("equal")
        ax.tick_params(labelsize=SMALL - 1)
        ax.plot(0, 0, "s", color="#D55E00", markersize=4)
    bar = every[0].figure.colorbar(mesh, ax=every, location="right", shrink=0.75, pad=0.02)
    bar.set_label(f"{what}, best there{unit}", fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL - 1)
    every[0].figure.suptitle(
        f"{plain(arm.name)}: best of {samples:,} random configurations at each point "
        "(blank: none came there; square: base)",
        fontsize=SMALL,
    )
    return every[0]


def _best(points: Array, values: Array, low: Array, size: float) -> tuple[Array, list[Array]]:
    """Largest value in each cell (k, k) of a square from ``low`` on, NaN where there is none."""
    edges = [start + size * np.linspace(-0.01, 1.01, _CELLS + 1) for start in low]
    grid = np.full((_CELLS, _CELLS), -np.inf)
    cells = [
        np.clip(np.searchsorted(e, points[:, k], side="right") - 1, 0, _CELLS - 1)
        for k, e in enumerate(edges)
    ]
    np.maximum.at(grid, (cells[0], cells[1]), values)
    return np.where(np.isfinite(grid), grid, np.nan), edges


FINE = 241
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
    q: ArrayLike | None = None,
    forms: ClosedForm | None = None,
    samples: int = FINE,
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
    plane, Q = two_joints(arm, joint_a, joint_b, q, samples, ignore_limits)
    found = aspects_of(closed_form(arm) if forms is None else forms, not ignore_limits)
    numbers = _numbers(found, Q)
    # The largest aspects have a colour of their own.
    seen, size = np.unique(numbers[numbers > 0], return_counts=True)
    largest = np.argsort(-size, kind="stable")[: len(_COLOURS)]
    named, others = np.sort(seen[largest]).tolist(), len(seen) - len(largest)
    names = [", ".join(found[k - 1].names) if k <= len(found) else "" for k in named]
    lines = [f"aspect {k}" + f": {x}" * bool(x) for k, x in zip(named, names, strict=True)]
    lines += [f"and {others} more"] * (others > 0)
    untold = float(np.mean(numbers <= 0)) > 0.005  # what can be seen of the picture
    lines += ["aspect undecided"] * untold
    columns = 1 if max(map(len, lines), default=0) > 14 else 3
    legend_height = 0.147 * -(-len(lines) // columns)
    ax = new_axes(3.2 + legend_height) if ax is None else ax
    colours = [*_COLOURS[: len(named)], "#C8C8C8"]
    shown = np.full(numbers.shape, float(len(named)))
    for k, number in enumerate(named):
        shown[numbers == number] = k
    shown[numbers <= 0] = np.nan
    sides = _sides(Q, plane)
    ax.pcolormesh(
        *sides, shown, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(colours) - 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    edge = (np.diff(numbers, axis=0, append=numbers[-1:]) != 0) | (
        np.diff(numbers, axis=1, append=numbers[:, -1:]) != 0
    )
    line = np.where(edge, 1.0, np.nan)
    ax.pcolormesh(
        *sides, line, cmap=ListedColormap(["#222222"]), shading="nearest", rasterized=True
    )
    label_plane(ax, arm, Q, plane, plane, degrees)
    shades = colours if others else colours[:-1]
    for text, colour in zip(lines, shades + ["white"] * untold, strict=True):
        ax.plot([], [], "s", color=colour, markeredgecolor="#888888", label=text)
    legend_below(ax, columns, left=True)
    return ax


def _numbers(found: Aspects, Q: Array) -> Ints:
    """Return the number of the aspect at each point of a grid (M, N, n); 0 where not told."""
    # Touching points of the same signs, between the same joint values, are of one aspect: it is
    # asked at the one farthest from the region's edge, at others only if it is not told there.
    from scipy.ndimage import distance_transform_cdt, find_objects, label

    keys = _keys(found, Q)
    numbers = np.zeros(keys.shape, dtype=np.int64)
    for key in np.unique(keys):
        regions, _ = label(keys == key)
        for k, box in enumerate(find_objects(regions), 1):
            inside = regions[box] == k
            depth = distance_transform_cdt(np.pad(inside, 1), "taxicab")[1:-1, 1:-1][inside]
            points = Q[box][inside][np.argsort(-depth, kind="stable")]
            # A thin region may have nothing but edge: points of it may be singular.
            some = np.unique(np.linspace(0, len(points) - 1, 12).astype(np.int64))
            told = (found.of(q) for q in points[some])
            numbers[box][inside] = next((n for n in told if n is not None), 0)
    return numbers


def _keys(found: Aspects, Q: Array) -> Ints:
    """Return which arcs and signs each point has, as one number."""
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


_MOST_CURVES = 12


@checked
def locus(
    arm: Arm,
    family: Family,
    joint_a: str | None = None,
    joint_b: str | None = None,
    ax: Axes | None = None,
    *,
    q: ArrayLike | None = None,
    third: str | None = None,
    values: ArrayLike | None = None,
    samples: int = FINE,
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
    OptionError.refuse_if(
        family.n != arm.n or not set(family.joints) <= set(arm.joints),
        f"family {family.name} is of another arm than {arm.name}",
    )
    a, b = _plane(arm, family, joint_a, joint_b)
    given = family.generic if q is None else arm.check_one(q)
    base = np.zeros(arm.n) if given is None else np.array(given)
    c, steps = _third(arm, (a, b), third, values, base)
    Q = plane_of(arm, (a, b), base, samples, ignore_limits)
    ax = new_axes(3.6) if ax is None else ax
    for value, color, dash in zip(steps, cycle(COLORS), cycle(DASHES), strict=False):
        name = family_label(family)
        if c is not None:
            Q[..., c] = value
            name = held_label(c, bool(arm.prismatic[c]), float(value), degrees)
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
    ordered = sorted({j for group in [set(e.involved) for e in family.equations] for j in group})
    ordered += sorted({j for branch in family.branches for j in branch.involved})
    free = [j for j in dict.fromkeys([*ordered, *range(arm.n)]) if j not in given]
    a, b = (free.pop(0) if j is None and free else j for j in given)
    if a is None or b is None or a == b:
        raise OptionError("a locus needs two different joints")
    return a, b


def _third(
    arm: Arm, plane: tuple[int, int], third: str | None, values: ArrayLike | None, base: Array
) -> tuple[int | None, Sequence[float]]:
    if third is None and values is None:
        return None, (0.0,)
    if third is None or values is None:
        raise OptionError("third and values belong together: a joint, and where it is put")
    c = arm.space.index(third)
    OptionError.refuse_if(
        c in plane, f"{third} is along an axis already: the third joint must be another"
    )
    steps = np.atleast_1d(real_numbers(values, "values"))
    for value in steps.ravel():
        arm.check_one(np.where(np.arange(arm.n) == c, value, base))
    OptionError.refuse_if(
        steps.ndim != 1 or not 1 <= len(steps) <= _MOST_CURVES,
        f"values must be a row of 1 to {_MOST_CURVES} numbers",
    )
    return c, steps.tolist()
