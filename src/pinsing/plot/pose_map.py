"""Singular loci of a mechanism as a slice over two coordinates of the output's pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.mechanism.dyad import planar_dyad
from pinsing.mechanism.likeness import output_pose
from pinsing.mechanism.modes import home
from pinsing.mechanism.pose import pose_of
from pinsing.mechanism.pose_loci import PoseForms, pose_forms
from pinsing.mechanism.rods import Rod, Rods, rods
from pinsing.plot.mechanism import TYPE_1, TYPE_2
from pinsing.plot.pose_aspects import colors, regions
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
_COLORS = {"type 1": TYPE_1, "type 2": TYPE_2, "constraint": "#7d3c98",
           "type 2 or constraint": TYPE_2}  # fmt: skip
_REACHED = "#eef3e6"
_MOST_NAMED = 4


def pose_map(
    mechanism: Mechanism,
    over: Sequence[str] = ("x", "y"),
    ax: Axes | None = None,
    samples: int = 201,
    degrees: bool = True,
) -> Axes:
    """Draw a slice through the loci: two coordinates of the pose vary, the others stay at home.

    Coloured is where the legs reach within the limits of the actuated joints, in the working mode
    of home: each aspect of the slice in a colour of its own; green and blue ones have the sign of
    the largest one's type 2 equation, warm ones the other. Lines are the loci, exactly.

    Parameters
    ----------
    mechanism : Mechanism
        One whose legs pass one force each.
    over : two of x, y, z, roll, pitch, yaw
        The coordinates, in the order of the axes.
    ax : Axes, optional
        Axes to draw into.
    samples : int
        Grid points a side.
    degrees : bool
        Angles in degrees.

    Raises
    ------
    OptionError
        If there is no closed form over the pose, or the coordinates are others.
    """
    from matplotlib import pyplot as plt
    from matplotlib.colors import BoundaryNorm, ListedColormap

    forms, found = pose_forms(mechanism), rods(mechanism)
    if found is None and planar_dyad(mechanism) is not None:
        raise OptionError(
            f"{mechanism.name}: two links in a plane close its loop, so that its map is over the "
            "inputs: leave --over out"
        )
    if forms is None or found is None or not (forms.loci or forms.architecture):
        raise OptionError(
            f"{mechanism.name}: a map over the pose needs legs that pass one force each, and this "
            "one has others: see pinsing families --loops"
        )
    if any(rod.hinge is not None for rod in found.rods):
        raise OptionError(
            f"{mechanism.name}: its hinges tie the coordinates of a pose to each other, so that "
            "two of them with the others at home are poses that it does not have; take pinsing "
            "map --loops --over poses"
        )
    first, second = _chosen(over, found, forms)
    at_home = pose_of(found.placed(output_pose(mechanism, home(mechanism))))
    start = np.array([*at_home.position, *at_home.angles])
    sides = [_side(mechanism, found, start, k, samples) for k in (first, second)]
    inside = _variables(mechanism, found, _grid(start, (first, second), sides))[1]
    # Beyond what is reached there is nothing to see.
    sides = [
        side if k > 2 else _cropped(side, inside.any(axis=axis))
        for k, side, axis in ((first, sides[0], 0), (second, sides[1], 1))
    ]
    values, inside = _variables(mechanism, found, _grid(start, (first, second), sides))
    ax = plt.subplots(figsize=(6, 5.4))[1] if ax is None else ax
    unit = [180 / np.pi if degrees and k > 2 else 1.0 for k in (first, second)]
    x, y = sides[0] * unit[0], sides[1] * unit[1]
    lefts = [
        x.equation(np.stack([values[n] for n in x.equation.names], axis=-1)) for x in forms.loci
    ]
    parting = [v for v, x in zip(lefts, forms.loci, strict=True) if x.kind != "type 1"]
    numbers, signs = regions(
        inside.astype(bool), [np.nan_to_num(v) for v in parting], (first > 2, second > 2)
    )
    shades = [_REACHED, *colors(signs)]
    shown = np.where(inside, numbers + 1, 0)
    edges = np.arange(len(shades) + 1) + 0.5
    if inside.any():
        ax.pcolormesh(x, y, np.ma.masked_less(shown, 1), cmap=ListedColormap(shades),
                      norm=BoundaryNorm(edges, len(shades)), shading="nearest",
                      rasterized=True)  # fmt: skip
    drawn = set()
    for locus, left in zip(forms.loci, lefts, strict=True):
        finite = left[np.isfinite(left)]
        if len(finite) and finite.min() < 0 < finite.max():
            ax.contour(x, y, left, levels=[0.0], colors=[_COLORS[locus.kind]], linewidths=1.4)
            drawn.add(locus.kind)
    for kind in sorted(drawn):
        ax.plot([], [], color=_COLORS[kind], label=kind)
    moved = any(rod.moved for rod in found.rods)
    border = "type 1 or a limit" if moved else "a limit"
    if forms.architecture or not signs:
        ax.fill([], [], color=_REACHED, label=f"reached; its border: {border}")
    for number, shade in list(enumerate(shades[1:], 1))[:_MOST_NAMED]:
        more = f"; border: {border}" if number == 1 else ""
        ax.fill([], [], color=shade, label=f"aspect {number}{more}")
    if len(signs) > _MOST_NAMED:
        ax.fill([], [], color="none", label=f"and {len(signs) - _MOST_NAMED} more")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2, fontsize=8)
    names = [
        f"{COORDINATES[k]} [{'m' if k < 3 else '°' if degrees else 'rad'}]" for k in (first, second)
    ]
    ax.set_xlabel(names[0])
    ax.set_ylabel(names[1])
    if first < 3 and second < 3:
        ax.set_aspect("equal")
    title = "every pose is singular" if forms.architecture else "singular poses of the output"
    ax.set_title(f"{mechanism.name}: {title}", fontsize=10)
    return ax


def _grid(start: Array, chosen: tuple[int, int], sides: list[Array]) -> Array:
    """Poses (n2, n1, 6): two coordinates over their sides, the others as at the start."""
    grid = np.broadcast_to(start, (len(sides[1]), len(sides[0]), 6)).copy()
    grid[..., chosen[0]], grid[..., chosen[1]] = np.meshgrid(*sides)
    return grid


def _cropped(side: Array, reached: npt.ArrayLike) -> Array:
    """As many values, but from a little before the first that is reached to a little after."""
    there = np.flatnonzero(reached)
    if not len(there):
        return side
    low, high = side[there[0]], side[there[-1]]
    more = max(0.12 * (high - low), float(side[1] - side[0]))
    return np.linspace(low - more, high + more, len(side))


def _chosen(over: Sequence[str], found: Rods, forms: PoseForms) -> tuple[int, int]:
    names = ["yaw" if n in ("phi", "φ") else n for n in over]
    free = ("x", "y", "yaw") if found.planar else COORDINATES
    if any(rod.moved for rod in found.rods) and not found.planar:
        free = COORDINATES[:3]
    if len(names) != 2 or names[0] == names[1] or not set(names) <= set(free):
        raise OptionError(
            f"a map over the pose goes over two of {', '.join(free)}; got {', '.join(over)}"
        )
    return COORDINATES.index(names[0]), COORDINATES.index(names[1])


def _side(mechanism: Mechanism, found: Rods, start: Array, k: int, samples: int) -> Array:
    """Values of a coordinate: a whole turn, or as far as base and legs are large."""
    if k > 2:
        return np.linspace(-np.pi, np.pi, samples)
    size = max(
        float(np.linalg.norm(rod.inner - start[:3])) + float(np.linalg.norm(rod.first))
        for rod in found.rods
    )
    return np.asarray(start[k] + np.linspace(-1.5 * size, 1.5 * size, samples))


def _variables(mechanism: Mechanism, found: Rods, grid: Array) -> tuple[dict[str, Array], Array]:
    """Values of all variables of equations over a grid of poses (..., 6), and where legs reach."""
    flat = grid.reshape(-1, 6)
    R = np.array([pin.rpy.rpyToMatrix(*p[3:]) for p in flat])
    e = np.array([_quaternion(M) for M in R])
    values = {n: flat[:, k] for k, n in enumerate("xyz")}
    values |= {f"e{k}": e[:, k] for k in range(4)}
    values["cos φ"], values["sin φ"] = np.cos(flat[:, 5]), np.sin(flat[:, 5])
    inside = np.ones(len(flat), dtype=bool)
    q0 = home(mechanism)
    pose0 = output_pose(mechanism, q0)
    for rod in found.rods:
        B = flat[:, :3] + R @ rod.outer
        name = mechanism.joints[rod.joint]
        if rod.slides:
            value = np.linalg.norm(B - rod.inner, axis=1)
        else:
            value = _driven(mechanism, rod, B, pose0, float(q0[rod.joint]))
            values[name], values[f"cos {name}"] = value, np.cos(value)
            values[f"sin {name}"] = np.sin(value)
        low, high = mechanism.lower[rod.joint], mechanism.upper[rod.joint]
        inside &= np.isfinite(value) & (value >= low) & (value <= high)
    shape = grid.shape[:-1]
    return {n: v.reshape(shape) for n, v in values.items()}, inside.reshape(shape)


def _quaternion(R: Array) -> tuple[float, float, float, float]:
    e = pin.Quaternion(R)
    return float(e.w), float(e.x), float(e.y), float(e.z)


def _driven(mechanism: Mechanism, rod: Rod, B: Array, pose: pin.SE3, value: float) -> Array:
    """The actuated joint's value for outer ends B (N, 3), bent as at home; NaN out of reach."""
    slides = bool(mechanism.prismatic[rod.joint])

    def inner(v: Array) -> Array:
        c, s = (v, 0 * v) if slides else (np.cos(v), np.sin(v))
        return rod.inner + c[:, None] * rod.first + s[:, None] * rod.second

    def both(ends: Array) -> tuple[Array, Array]:
        reach = ends - rod.inner
        with np.errstate(invalid="ignore"):
            if slides:
                along = reach @ rod.first / (rod.first @ rod.first)
                rest = (length**2 - (reach**2).sum(axis=1)) / (rod.first @ rod.first) + along**2
                return along - np.sqrt(rest), along + np.sqrt(rest)
            a, b = reach @ rod.first, reach @ rod.second
            k = ((reach**2).sum(axis=1) + rod.first @ rod.first - length**2) / 2
            middle, half = np.arctan2(b, a), np.arccos(k / np.hypot(a, b))
        return middle - half, middle + half

    at = np.array([pose.act(rod.outer)])
    length = float(np.linalg.norm(at - inner(np.array([value]))))
    options = both(at)
    away = [abs(float(np.sin((o[0] - value) / 2))) if not slides else abs(float(o[0] - value))
            for o in options]  # fmt: skip
    found = both(B)[int(np.argmin(away))]
    return found if slides else np.asarray(np.arctan2(np.sin(found), np.cos(found)))
