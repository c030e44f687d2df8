"""Where a family of singular configurations meets a plane over two joints."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from pinsing._types import Array
from pinsing.families import Branch, Equation, Family

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
