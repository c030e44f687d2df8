"""Maps: over two joints with the closed-form loci on top, of the workspace, of inverse solutions.

Where the first of three joints turns, the workspace of a position arm is one of revolution: r, the
distance of the tip from the first axis, and z along it are functions of the other two joints. A
place (r, z) has as many solutions as the map of those joints has points there. The count changes
only across the images of singular configurations (Wenger, 2007: "Cuspidal and noncuspidal robot
manipulators"); these have *cusps*, where three solutions meet, and *nodes*, where two pairs meet at
one place. With R = r^2 / 2 the map is smooth, and singular where f = R_2 z_3 - R_3 z_2 = 0; a cusp
is where the direction that the map forgets is tangent to that curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress, cycle, product
from typing import Any, Literal

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pinsing.algebra.conditions import Conditions, two_sided
from pinsing.errors import OptionError
from pinsing.families import Branch, ClosedForm, Equation, Family, closed_form
from pinsing.families.solve import form_to_measure
from pinsing.interface import checked, real_numbers, whole_number
from pinsing.kinematics.jacobian import (
    generic_rank,
    ratios,
    singular_values,
    tip_and_jacobian,
    tip_poses,
)
from pinsing.measures import ALIKE, Array, ArrayLike, Bool, Ints
from pinsing.plot.style import (
    COLORS,
    DASHES,
    SINGULAR,
    SMALL,
    coloured,
    held_label,
    joint_label,
    joint_symbol,
    labelled,
    legend_below,
    new_axes,
    plain,
    ticks,
)
from pinsing.postures.aspects import Aspects, aspects as aspects_of
from pinsing.proximity.clearance import STEP
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
    every = list(np.ravel(np.array(axes if figure is None else figure.subplots(1, 3), object)))
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
        title = f"{'xyz'[across]} = {middle[across] + 0.0:.3g} ± {half:.2g} m"
        labelled(ax, f"{'xyz'[a]} [m]", f"{'xyz'[b]} [m]", title, numbers=SMALL - 1)
        ax.set_aspect("equal")
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
    shown = np.where(np.isin(numbers, named), np.searchsorted(named, numbers), len(named))
    edge = (np.diff(numbers, axis=0, append=numbers[-1:]) != 0) | (
        np.diff(numbers, axis=1, append=numbers[:, -1:]) != 0
    )
    shown = np.where(edge, len(colours), np.where(numbers > 0, shown, np.nan))
    coloured(ax, *_sides(Q, plane), shown, [*colours, "#222222"])
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
    for part in chosen.parts:
        for place, j in enumerate(part.joints):
            arcs = part.arcs[place]
            value = Q[..., j]
            if chosen.endless[j] and not arcs[0].circle:
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


_FIT = (0.0, 2.0, 4.0)
_FLAT = 1e-7
_CROSS = 1e-3
"""Where f is so much flatter than along its curve, two curves of singular joint values cross."""
_ANGLE = 0.03
"""Curves that touch at a smaller angle, radians, do not cross there."""
_NEAR = 5e-3
"""Nodes are farther from cusps and from each other than this share of the size."""
_SHIFT = 0.1234
"""Whole circles begin at no round angle: special lines are then not on a line of the grid."""


@dataclass(frozen=True, eq=False)
class Reach:
    """The half plane r >= 0, z of the workspace, counted."""

    # r and z: (M,): places, metres: distance from the first axis, and along it from the base
    r: Array
    z: Array
    count: Ints  # (N, M) of int: inverse solutions there
    curves: tuple[Array, ...]  # images (r, z) of singular configurations
    # cusps and nodes: (C, 2): places (r, z) of the cusps and nodes of these
    cusps: Array
    nodes: Array
    cusp_joints: Array  # (C, 2): values of the second and third joint at the cusps


@dataclass(frozen=True, eq=False)
class Section:
    """The tip with joint 1 at 0: ``tensor`` (a, b, 3), across the first axis, and along it last.

    In products of functions: 1, cos and sin of a joint that turns; 1 and the value of a slide.
    """

    slides: tuple[bool, bool]
    tensor: Array

    @classmethod
    def of(cls, arm: Arm) -> Section:
        """Read off the arm at a few configurations, exactly but for rounding."""
        if arm.n != 3 or arm.coupling is not None or generic_rank(arm) != 3:
            raise OptionError(
                "inverse solutions by position are drawn for arms of 3 joints and task position: "
                f"this one has {arm.n} joints and task {arm.task}, of rank {generic_rank(arm)}"
            )
        OptionError.refuse_if(
            arm.task.rows != (0, 1, 2), f"the task must be position, not {arm.task}"
        )
        OptionError.refuse_if(
            arm.prismatic[0],
            "the first joint must be revolute: the workspace is then one of revolution",
        )
        slides = bool(arm.prismatic[1]), bool(arm.prismatic[2])
        every = [_FIT[:2] if s else _FIT for s in slides]
        tips, axis, foot = [], np.zeros(3), np.zeros(3)
        for a, b in product(*every):
            tip, _, J = tip_and_jacobian(arm, np.array([0.0, a, b]))
            axis = J[3:, 0]
            foot = tip - np.cross(J[:3, 0], axis)
            tips.append(tip)
        foot = foot - axis * (axis @ foot)
        x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        x /= np.linalg.norm(x)
        known = (np.array(tips) - foot) @ np.stack([x, np.cross(axis, x), axis]).T
        A, B = (basis(np.array(v), s) for v, s in zip(every, slides, strict=True))
        tensor = np.linalg.solve(np.kron(A, B), known).reshape(A.shape[1], B.shape[1], 3)
        return cls(slides, np.where(np.abs(tensor) < 1e-13 * np.abs(tensor).max(), 0.0, tensor))

    def on(self, x: Array, a: int = 0, b: int = 0) -> Array:
        """Coordinates (..., 3) at joint values (..., 2), or their derivatives of orders a, b."""
        A, B = (
            basis(x[..., k], s, order)
            for k, (s, order) in enumerate(zip(self.slides, (a, b), strict=True))
        )
        a_done = (A @ self.tensor.reshape(A.shape[-1], -1)).reshape(*B.shape, 3)
        return np.asarray((a_done * B[..., None]).sum(axis=-2))

    def place(self, x: Array) -> Array:
        """Places (..., 2): r and z."""
        p = self.on(x)
        return np.stack([np.hypot(p[..., 0], p[..., 1]), p[..., 2]], axis=-1)

    def slopes(self, x: Array) -> Array:
        """Derivatives (..., 2, 2) of r^2 / 2 and z by the two joints."""
        p = self.on(x)
        d = np.stack([self.on(x, 1, 0), self.on(x, 0, 1)], axis=-1)
        R = p[..., 0, None] * d[..., 0, :] + p[..., 1, None] * d[..., 1, :]
        return np.stack([R, d[..., 2, :]], axis=-2)

    def singular(self, x: Array) -> Array:
        """Values (...) of f: zero where the arm is singular off its first axis."""
        return np.asarray(np.linalg.det(self.slopes(x)))

    def steepest(self, x: Array) -> Array:
        """Gradient (..., 2) of f, by differences."""
        e = STEP * np.eye(2)
        return np.stack(
            [(self.singular(x + v) - self.singular(x - v)) / (2 * STEP) for v in e], axis=-1
        )

    def tangent(self, x: Array) -> Array:
        """Return the slope of f along what the map forgets, from r and from z, (..., 2)."""
        # Both are zero at a cusp; one alone may be where its own row of the map is.
        A, g = self.slopes(x), self.steepest(x)
        return np.asarray(A[..., 0] * g[..., 1, None] - A[..., 1] * g[..., 0, None])


def basis(value: Array, slides: bool, order: int = 0) -> Array:
    """Functions (..., k) of a joint value: 1, cos, sin or 1, value; or their derivative."""
    one, zero = np.ones_like(value), np.zeros_like(value)
    if slides:
        return np.stack([zero, one] if order else [one, value], axis=-1)
    c, s = np.cos(value), np.sin(value)
    return np.stack([zero, -s, c] if order else [one, c, s], axis=-1)


def cusps_of(section: Section, curves: list[Array]) -> Array:
    """Joint values (C, 2) of the cusps on curves (K, 2) of singular joint values."""
    from scipy.optimize import root

    size = float(np.abs(section.tensor).max()) ** 3
    found: list[Array] = []
    for curve in curves:
        steep = np.linalg.norm(section.steepest(curve), axis=-1)
        row = np.argmax(np.linalg.norm(section.slopes(curve), axis=-1), axis=-1)
        ends = np.stack([section.tangent(curve)[:-1], section.tangent(curve)[1:]])
        t = np.take_along_axis(ends, row[None, :-1, None], axis=-1)[..., 0]
        told = (np.abs(t) >= _FLAT * size * size).all(axis=0)
        told &= np.minimum(steep[:-1], steep[1:]) >= _FLAT * size
        for k in np.flatnonzero(told & (t[0] * t[1] < 0)).tolist():
            x = root(
                lambda y, r=int(row[k]): [section.singular(y), section.tangent(y)[r]],
                (curve[k] + curve[k + 1]) / 2,
                tol=1e-12,
            ).x
            near = np.linalg.norm(x - curve[k]) < 4 * np.linalg.norm(curve[k + 1] - curve[k])
            crossed = np.linalg.norm(section.steepest(x)) < _CROSS * float(np.median(steep))
            if near and not crossed and not any(_alike(section, x, y) for y in found):
                found.append(x)
    return np.array(found).reshape(-1, 2)


def _alike(section: Section, x: Array, y: Array) -> bool:
    gap = x - y
    gap = gap - np.where(section.slides, 0.0, 2 * math.pi * np.round(gap / (2 * math.pi)))
    return bool(np.abs(gap).max() < 1e-4)


def nodes_of(section: Section, lines: list[Array], cusps: Array, size: float) -> Array:
    """Return places (D, 2) where images of singular curves (K, 2) cross at an angle."""
    # Each is solved for on the curves themselves: where two have one image, as where a joint turns
    # over, the drawing crosses itself by rounding only.
    if not lines:
        return np.zeros((0, 2))
    images = [section.place(x) for x in lines]
    x, p = (np.concatenate([c[:-1] for c in each]) for each in (lines, images))
    v, u = (np.concatenate([np.diff(c, axis=0) for c in each]) for each in (lines, images))
    length = np.linalg.norm(u, axis=1)
    # Pieces of curves whose images are shorter than this share of the size are one place
    drawn = length > 1e-7 * size
    x, p, v, u, length = (each[drawn] for each in (x, p, v, u, length))
    low, high = np.minimum(p, p + u), np.maximum(p, p + u)
    steep = _CROSS * float(np.median(np.linalg.norm(section.steepest(x), axis=-1)))
    found: list[Array] = []
    for i in range(len(p) - 1):
        rest = np.arange(i + 1, len(p))
        j = rest[(low[i + 1 :] <= high[i]).all(axis=1) & (high[i + 1 :] >= low[i]).all(axis=1)]
        cross = u[i, 0] * u[j, 1] - u[i, 1] * u[j, 0]
        apart = np.abs(cross) > _ANGLE * length[i] * length[j]
        j, cross = j[apart], cross[apart]
        gap = p[j] - p[i]
        s, t = ((gap[:, 0] * w[..., 1] - gap[:, 1] * w[..., 0]) / cross for w in (u[j], u[i]))
        for k in np.flatnonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1)):
            both = np.stack([x[i] + s[k] * v[i], x[j[k]] + t[k] * v[j[k]]])
            at = _crossed(section, both, size, steep)
            if at is not None and all(
                np.linalg.norm(at - f) > _NEAR * size for f in [*cusps, *found]
            ):
                found.append(at)
    return np.array(found).reshape(-1, 2)


def _crossed(section: Section, both: Array, size: float, steep: float) -> Array | None:
    """Return the place of a node by Newton, from two joint values (2, 2) near it, or None."""
    # Both are singular, and have one place: four equations, which are regular where the images
    # cross at an angle. At the first axis curves end against their mirror images: that is no node.
    from scipy.optimize import root

    def value(y: Array) -> Array:
        places = section.place(y.reshape(2, 2))
        f = section.singular(y.reshape(2, 2)) / size**3
        return np.concatenate([f, (places[0] - places[1]) / size])

    y = np.asarray(root(value, both.ravel(), tol=1e-12).x).reshape(2, 2)
    # A node is nearer than this to where drawn curves cross, radians or metres.
    if np.abs(y - both).max() > 0.1:
        return None
    at = np.asarray(section.place(y)[0])
    if np.abs(value(y.ravel())).max() > 1e-9 or at[0] < _NEAR * size:
        return None
    g = section.steepest(y)
    if _alike(section, y[0], y[1]) or np.linalg.norm(g, axis=-1).min() < steep:
        return None
    along = np.stack([-g[:, 1], g[:, 0]], axis=-1)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-300)
    w = (section.place(y + 1e-6 * along) - section.place(y - 1e-6 * along)) / 2e-6
    turn = abs(float(w[0, 0] * w[1, 1] - w[0, 1] * w[1, 0]))
    crossed = turn > _ANGLE * float(np.linalg.norm(w[0]) * np.linalg.norm(w[1]))
    return at if crossed and np.linalg.norm(w, axis=1).min() > 1e-6 * size else None


def reach_of(arm: Arm, samples: int, limits: bool) -> Reach:
    """Count the solutions over the half plane, and find the curves, cusps and nodes."""
    section = Section.of(arm)
    ranges = np.stack(arm.space.range(not limits), axis=1)[1:]
    if not limits:
        whole = ~np.array(section.slides) & (np.ptp(ranges, axis=1) >= 2 * math.pi - 1e-9)
        ranges[whole] = [-math.pi + _SHIFT, math.pi + _SHIFT]
    joints = [np.linspace(a, b, 300 + 1) for a, b in ranges]
    X = np.stack(np.meshgrid(*joints, indexing="ij"), axis=-1)
    places = section.place(X)
    f = section.singular(X)
    OptionError.refuse_if(
        np.abs(f).max() < _FLAT * np.abs(section.tensor).max() ** 3,
        "this arm is singular everywhere off its first axis",
    )
    drawn = Figure().add_subplot().contour(joints[0], joints[1], f.T, levels=[0.0])
    lines = [_onto(section, np.asarray(line)) for line in drawn.allsegs[0] if len(line) > 2]
    size = float(np.ptp(places.reshape(-1, 2), axis=0).max())
    lines = [x for x in lines if np.ptp(section.place(x), axis=0).max() > 1e-6 * size]
    joints_at = cusps_of(section, lines)
    cusps = section.place(joints_at)
    # Of cusps at one place, as of mirror images, the first stands for all.
    gaps = np.linalg.norm(cusps[:, None] - cusps, axis=-1)
    cusps = cusps[~np.tril(gaps <= 1e-5 * size, -1).any(axis=1)]
    top = float(places[..., 0].max())
    low, high = float(places[..., 1].min()), float(places[..., 1].max())
    margin = 0.03 * size
    r = np.linspace(0.0, top + margin, samples) + 0.37 * (top + margin) / samples
    z = np.linspace(low - margin, high + margin, samples)
    return Reach(
        r=r,
        z=z,
        count=count_of(section, joints, places[..., 1], r, z),
        curves=tuple(section.place(x) for x in lines),
        cusps=cusps,
        nodes=nodes_of(section, lines, cusps, size),
        cusp_joints=joints_at,
    )


def _onto(section: Section, x: Array) -> Array:
    """The same points, moved onto f = 0 along its gradient."""
    for _ in range(2):
        g = section.steepest(x)
        square = (g * g).sum(axis=-1)
        step = np.where(square > 1e-12, section.singular(x) / np.maximum(square, 1e-12), 0.0)
        x = x - np.clip(step[:, None] * g, -0.01, 0.01)
    return x


def count_of(section: Section, joints: Sequence[Array], height: Array, r: Array, z: Array) -> Ints:
    """Return the number of solutions in two joints for each (r, z), (N, M), on lines of equal z.

    ``height`` (K, L) has z on a grid of ``joints``, linear between: wrong only within some 1e-4 of
    the size from where the count changes.
    """
    # Where z is the same along a side of the grid, as where a turn ends, a line is above it.
    lines = Figure().add_subplot().contour(*joints, height.T, levels=z + 1e-6 * (z[1] - z[0]))
    passed = np.zeros((len(z), len(r) + 1), dtype=np.int64)
    for row, some in zip(passed, lines.allsegs, strict=True):
        for line in some:
            # Between two points of a line is the one nearest to the first axis, where r turns back.
            tip = section.on(np.asarray(line))[:, :2]
            step = np.diff(tip, axis=0)
            share = -(tip[:-1] * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300)
            nearest = tip[:-1] + np.clip(share, 0, 1)[:, None] * step
            way = np.stack([tip, np.concatenate([nearest, tip[-1:]])], axis=1).reshape(-1, 2)
            # From one point to the next each r between is passed once, up or down.
            ends = np.searchsorted(r, np.hypot(*way.T))
            np.add.at(row, np.minimum(ends[:-1], ends[1:]), 1)
            np.add.at(row, np.maximum(ends[:-1], ends[1:]), -1)
    count = np.cumsum(passed, axis=1)[:, :-1]
    # What differs from all places around, next to the curves, is taken from them.
    around = np.stack([np.roll(count, s, (0, 1)) for s in product((-1, 0, 1), repeat=2) if any(s)])
    return np.where((around != count).all(axis=0), np.sort(around, axis=0)[4], count)


PLACES = 400
_BLUES = ("#FFFFFF", "#E3EEF7", "#B8D4EA", "#86B6DB", "#5594C8", "#2F74B0", "#1B5590", "#123E6C")


@checked
def inverse_count(
    arm: Arm, ax: Axes | None = None, *, limits: bool = False, samples: int = PLACES
) -> Axes:
    """Draw the workspace of a 3-joint position arm, coloured by how many inverse solutions it has.

    The first joint turns and is taken to turn endlessly: half a plane through its axis shows all.
    Lines are where the arm is singular; cusps and nodes of these are marked. An arm with a cusp
    can change its posture without meeting a singularity (Omri and Wenger, 1995).

    Parameters
    ----------
    arm : Arm
        Three joints, the first of which turns, and the task "position".
    ax : Axes, optional
        Where to draw.
    limits : bool
        Whether the second and third joint end at their limits; slides always do.
    samples : int
        Places to each side.

    Returns
    -------
    Axes
        r, the distance from the first axis, along x; z along y, metres. The legend says the
        number of cusps and nodes.

    Raises
    ------
    OptionError
        If the arm is of another kind, or ``samples`` makes no sense.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> arm = pinsing.load("ur5", task="position", tip="tool0", joints=[
    ...     "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"])
    >>> axes = plot.inverse_count(arm, samples=40)
    >>> [t.get_text() for t in axes.get_legend().get_texts()]
    ['4 solutions']
    """
    whole_number(samples, "samples", 20, 2000)
    found = reach_of(arm, samples, limits)
    ax = new_axes(4.2) if ax is None else ax
    most = int(found.count.max(initial=0))
    colours = [_BLUES[min(k, len(_BLUES) - 1)] for k in range(most + 1)]
    coloured(ax, found.r, found.z, found.count, colours)
    for curve in found.curves:
        ax.plot(curve[:, 0], curve[:, 1], color="#333333", linewidth=0.9)
    for k in np.unique(found.count[found.count > 0]).tolist():
        said = f"{k} solution{'s' * (k != 1)}"
        ax.plot([], [], "s", color=colours[k], markeredgecolor="#888888", label=said)
    for points, mark, colour, word in (
        (found.cusps, "o", "#D55E00", "cusp"),
        (found.nodes, "D", "#009E73", "node"),
    ):
        if len(points):
            said = f"{len(points)} {word}{'s' * (len(points) != 1)}"
            ax.plot(
                points[:, 0], points[:, 1], mark, color=colour, markersize=4.5, zorder=3,
                markeredgecolor="white", markeredgewidth=0.6, label=said,
            )  # fmt: skip
    ax.set(aspect="equal", xlim=(0, float(found.r[-1])))
    where = "within the joint limits" if limits else "without joint limits"
    title = f"{plain(arm.name)}: inverse solutions by position, {where}"
    labelled(ax, "distance from the first axis, r [m]", "along it, z [m]", title, size=SMALL + 1)
    legend_below(ax, 2, left=True)
    return ax
