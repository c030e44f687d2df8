"""Map of sigma_min over two joints, with the closed-form loci on top."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.arguments import checked, whole_number
from pinsing.errors import OptionError
from pinsing.families import Branch, ClosedForm, Equation, Family, closed_form
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.verdict import ratios
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

# On top of the blue to yellow of the map.
_LINES = ("#FFFFFF", "#FF9DA7", "#A6F0C6", "#F4C7FF", "#FFFFFF", "#FF9DA7", "#A6F0C6")


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
    plane = a, b = two_joints(arm, joint_a, joint_b, samples)
    families = tuple(closed_form(arm, prove=False).families if families is None else families)
    base = regular_configuration(arm) if q is None else arm.check_one(q)
    Q = plane_of(arm, plane, base, samples, ignore_limits)
    values, what, unit = _measured(arm, Q.reshape(-1, arm.n), measure, families)

    ax = new_axes(3.6) if ax is None else ax
    shown = values.reshape(samples, samples)
    mesh = ax.pcolormesh(
        Q[0, :, a], Q[:, 0, b], shown, cmap="cividis", shading="nearest", rasterized=True, vmin=0
    )
    # Above, where it leaves the map and the legend the whole width.
    bar = ax.figure.colorbar(mesh, ax=ax, location="top", pad=0.02, aspect=34, shrink=0.96)
    bar.set_label(what + unit, fontsize=SMALL + 1)
    bar.ax.tick_params(labelsize=SMALL)
    styles = cycle(zip(_LINES, DASHES, strict=True))
    for family in families:
        color, dash = next(styles)
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
    if not real:
        raise OptionError("clearance is infinite: no family of singular configurations is known")
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of(real, np.asarray(arm.prismatic), weight)
    what = "clearance" if arm.design is None else "distance from families of the design"
    return np.degrees(two_sided(conditions, Q).lower), f"{what}, at least", " [deg]"


def two_joints(arm: Arm, joint_a: str, joint_b: str, samples: int) -> tuple[int, int]:
    """Indices of two joints, which must differ; a number of samples is checked as well."""
    a, b = arm.space.index(joint_a), arm.space.index(joint_b)
    if a == b:
        raise OptionError("a map needs two different joints")
    whole_number(samples, "samples", 2, 2000)
    return a, b


def plane_of(
    arm: Arm, plane: tuple[int, int], base: Array, samples: int, ignore_limits: bool
) -> Array:
    """A grid (k, k, n) over two joints: the first along the second axis, the other at ``base``."""
    lower, upper = arm.space.range(ignore_limits)
    Q = np.tile(base, (samples, samples, 1))
    x, y = (np.linspace(lower[j], upper[j], samples) for j in plane)
    Q[..., plane[0]], Q[..., plane[1]] = x[None, :], y[:, None]
    return Q


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
    ax.set_title(before + held_title(arm, Q[0, 0], moving, degrees), fontsize=SMALL - 1)


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
    # Letters of a condition that a legend has room for
    if len(family.text) <= 26:
        return f"{family.label}: {family.text}"
    joints = sorted({j for b in family.branches for j in b.involved})
    named = ", ".join(joint_symbol(j, bool(family.prismatic[j])) for j in joints)
    return f"{family.label}, of {named}"


_HERE = 1e-6


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
    """Draw the part of a family that lies in a plane, under one name in the legend.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    family : Family
        What to draw.
    Q : (k, k, n) array
        A grid of the plane: the first joint along the second axis, the other along the first.
    plane : tuple of int
        The two joints, from 0.
    label : str
        What the legend calls it, if any of it is there.
    color : str
        Of its lines.
    dash : object
        How they are dashed.

    Returns
    -------
    bool
        Whether the family meets the plane.
    """
    a, b = plane
    x, y = Q[0, :, a], Q[:, 0, b]
    line = {"color": color, "linestyle": dash, "linewidth": 1.3}
    drawn = False
    for branch in family.branches:
        free = _values_in_plane(branch, Q[0, 0], plane, family.prismatic)
        if free is None:
            continue
        equations = _in_plane(branch.equations, Q, plane)
        if equations is None:
            continue
        xs, ys = (
            _copies(free.get(j), axis, bool(family.prismatic[j])) for j, axis in ((a, x), (b, y))
        )
        if xs is None and ys is None:
            if len(equations) != 1:
                continue  # everything, or points: nothing that a line could show
            level = equations[0](Q)
            if level.min() * level.max() > 0:
                continue
            ax.contour(x, y, level, levels=[0.0], linewidths=1.3, colors=color, linestyles=[dash])
            drawn = True
            continue
        if xs is not None and ys is not None:
            if not equations:
                grid = np.array([(u, v) for u in xs for v in ys]).reshape(-1, 2)
                ax.plot(*grid.T, "o", color=color, markersize=4)
                drawn = drawn or bool(len(grid))
            continue
        fixed, other = (a, y) if xs is not None else (b, x)
        for value in xs if xs is not None else ys or ():
            if not equations:
                (ax.axvline if fixed == a else ax.axhline)(value, **line)
                drawn = True
            else:
                points = _zeros(equations[0], Q[0, 0], fixed, value, b if fixed == a else a, other)
                held = np.full(len(points), value)
                pair = (held, points) if fixed == a else (points, held)
                ax.plot(*pair, "o", color=color, markersize=4)
                drawn = drawn or bool(len(points))
    if drawn:
        ax.plot([], [], label=label, **line)
    return drawn


def fills_plane(family: Family, Q: Array, plane: tuple[int, int]) -> bool:
    """Whether every configuration of a plane, given as for `draw_family`, is of the family."""
    for branch in family.branches:
        if _values_in_plane(branch, Q[0, 0], plane, family.prismatic) == {}:
            equations = _in_plane(branch.equations, Q, plane)
            if equations is not None and all(_vanishes(e, Q) for e in equations):
                return True
    return False


def _vanishes(equation: Equation, Q: Array) -> bool:
    return bool(np.abs(equation(Q)).max() <= _HERE * equation.size)


def _values_in_plane(
    branch: Branch, q: Array, plane: tuple[int, int], prismatic: npt.NDArray[np.bool_]
) -> dict[int, float] | None:
    """Values that a branch gives the two joints, None if the other joints rule it out."""
    free = {}
    for v in branch.values:
        if v.joint in plane:
            free[v.joint] = v.value
            continue
        gap = q[v.joint] - v.value
        if not prismatic[v.joint]:
            gap -= 2 * np.pi * np.round(gap / (2 * np.pi))
        if abs(gap) > _HERE:
            return None
    return free


def _in_plane(
    equations: Iterable[Equation], Q: Array, plane: tuple[int, int]
) -> list[Equation] | None:
    """Equations that speak of the two joints; None if another one is not fulfilled."""
    out = []
    for e in equations:
        if set(e.involved) & set(plane):
            out.append(e)
        elif abs(float(e(Q[0, 0]))) > _HERE * e.size:
            return None
    return out


def _copies(value: float | None, axis: Array, slides: bool) -> list[float] | None:
    """A value and its copies a whole turn away, within the axis; None if there is no value."""
    if value is None:
        return None
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
    every = _given(axes) if figure is None else list(figure.subplots(1, 3))
    Q = arm.space.sample(samples, np.random.default_rng(2026))
    tips = tip_positions(arm, Q)
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
        letters = "xyz"
        ax.set_xlabel(f"{letters[a]} [m]", fontsize=SMALL)
        ax.set_ylabel(f"{letters[b]} [m]", fontsize=SMALL)
        width = f"{middle[across] + 0.0:.3g} ± {half:.2g} m"
        ax.set_title(f"{letters[across]} = {width}", fontsize=SMALL)
        ax.set_aspect("equal")
        ax.tick_params(labelsize=SMALL - 1)
        ax.plot(0, 0, "s", color="#D55E00", markersize=4)
    bar = every[0].figure.colorbar(mesh, ax=every, location="right", shrink=0.75, pad=0.02)
    bar.set_label(f"{what}, best there{unit}", fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL - 1)
    every[0].figure.suptitle(
        f"{plain(arm.name)}: best of {samples:,} random configurations at each place "
        "(blank: none came there; square: base)",
        fontsize=SMALL,
    )
    return every[0]


def tip_positions(arm: Arm, Q: Array) -> Array:
    """Tip positions (N, 3) at configurations (N, n), metres in the base."""
    model, frame = arm.model, arm.tip_id
    data = model.createData()
    out = np.empty((len(Q), 3))
    for k, q in enumerate(arm.model_q(Q)):
        pin.framesForwardKinematics(model, data, q)
        out[k] = data.oMf[frame].translation
    return out


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


def _given(axes: Any) -> list[Axes]:
    every = list(axes.flat) if isinstance(axes, np.ndarray) else axes
    if (
        not isinstance(every, list | tuple)
        or len(every) != 3
        or not all(isinstance(ax, Axes) for ax in every)
    ):
        raise OptionError("axes must be three of matplotlib's, for the slices x-z, y-z and x-y")
    return list(every)
