"""Velocity ellipsoids in three dimensions, as in the paper's Figures 12 to 16, or of pure motions.

Translations (m/s) and rotations (rad/s) never share an axis: each has a picture of its own. With
the arm, its joints are drawn too and each ellipsoid sits at the tip, at a scale that is said.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.configuration.pure_motions import pure_by_default, pure_ellipsoids
from pinsing.configuration.state import REGULAR, State
from pinsing.errors import OptionError
from pinsing.kinematics.verdict import SINGULAR_RTOL
from pinsing.measures import Ellipsoid
from pinsing.plot.skeleton import (
    LOST,
    draw_lost,
    draw_skeleton,
    look_obliquely,
    show_whole,
    skeleton,
)
from pinsing.plot.style import COLORS, COLUMN, SMALL, legend_below, legend_of_all, new_axes, plain
from pinsing.robot.arm import Arm

KINDS = ("translational", "rotational")
_COLOR = {"translational": COLORS[0], "rotational": COLORS[4]}
_UNIT = {"translational": "m/s", "rotational": "rad/s"}
_WHICH = {
    ("translational", "pure"): "translations, tool orientation held",
    ("rotational", "pure"): "rotations, tip held",
    ("translational", "all"): "translational part of all motions",
    ("rotational", "all"): "rotational part of all motions",
}
_SHARE = 0.4
"""Largest semi-axis that is drawn, in sizes of the arm."""
_FLAT = 1e-5
"""Semi-axes below this share of the largest are flat to the eye."""


@checked
def ellipsoids(
    state: State,
    ax: Any = None,
    *,
    kind: str = "both",
    motions: Literal["pure", "all"] | None = None,
    arm: Arm | None = None,
) -> Any:
    """Draw the velocity ellipsoids of a configuration, at unit joint speed.

    An ellipsoid of zero thickness is drawn as the plate that it is, with the lost motion as a
    dashed line. The title of each picture says which ellipsoid it is.

    Parameters
    ----------
    state : State
        From ``at(arm, q)``.
    ax : 3D axes, optional
        Where to draw; with ``kind`` "both" only together with ``arm``.
    kind : str
        "translational" (m/s), "rotational" (rad/s) or "both", side by side.
    motions : str, optional
        "all": the three rows of J at unit joint speed, as in the paper's Eqs. (15), (16).
        "pure": translations while the tool keeps its orientation, and rotations about a tip that
        rests; these are flat wherever a pose is singular. By default "pure" for a pose that the
        arm can move every way in general, else "all".
    arm : Arm, optional
        The arm that the state is of: its joints are drawn, and the ellipsoids at its tip.

    Returns
    -------
    Axes3D
        The (first) axes drawn on; equal scale along all three. Without ``arm`` they are in m/s
        or rad/s, with it in metres, and the legend says what 1 m/s or 1 rad/s is drawn as.

    Raises
    ------
    OptionError
        If ``kind`` or ``motions`` is another word, ``ax`` is not three-dimensional or one for two
        units, or ``arm`` is another one than the state's.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> arm = pinsing.load("ur5")
    >>> axes = plot.ellipsoids(pinsing.at(arm, [0, -1.2, 0, -1, -1.5, 0]), arm=arm)
    >>> axes.get_title()
    'translations, tool orientation held [m/s]'
    """
    if kind not in (*KINDS, "both"):
        raise OptionError(f"unknown kind {kind!r}: translational, rotational or both")
    if arm is not None and arm.joints != state.arm.joints:
        raise OptionError(f"arm is {arm.name} with other joints than the state of {state.arm.name}")
    kinds = KINDS if kind == "both" else (kind,)
    if ax is not None and getattr(ax, "name", "") != "3d":
        raise OptionError("ellipsoids needs axes with projection='3d'")
    if ax is not None and arm is None and len(kinds) > 1:
        raise OptionError(
            "one axis cannot carry m/s and rad/s: choose kind='translational' or 'rotational', "
            "or leave ax out"
        )
    if motions is None:
        motions = "pure" if pure_by_default(state.arm.task, state.generic_rank) else "all"
    found = _ellipsoids(state, motions)
    flat = [_flat_axes(state, found[name]) for name in kinds]
    normals = np.concatenate([f for f in flat if len(f) == 1] or [np.zeros((0, 3))])
    every: tuple[Any, ...] = (ax,) * len(kinds)
    if ax is None:
        every = _new(len(kinds), arm is not None)
    for each, name in zip(every, kinds, strict=True):
        title = f"{_WHICH[name, motions]} [{_UNIT[name]}]"
        each.set_title(title, fontsize=SMALL)
        if arm is None:
            _alone(each, state, name, found[name])
        else:
            _at_tip(each, state, name, found[name], arm, normals)
        if len(kinds) == 1:
            legend_below(each, 1, at=(0.5, -0.1))
    if ax is not None and len(kinds) > 1:
        ax.set_title(f"velocity ellipsoids, {motions} motions", fontsize=SMALL)
        legend_below(ax, 1, at=(0.5, -0.1))
    if ax is None and len(kinds) > 1:
        legend_of_all(every)
    if ax is None:
        every[0].figure.suptitle(f"{plain(state.arm.name)}: {state.status}", fontsize=SMALL + 1)
    return every[0]


def _ellipsoids(state: State, motions: str) -> dict[str, Ellipsoid]:
    if motions == "pure":
        return dict(zip(KINDS, pure_ellipsoids(state.J), strict=True))
    return {k: Ellipsoid(getattr(state, k).axes, getattr(state, k).radii) for k in KINDS}


def _new(count: int, tall: bool) -> tuple[Any, ...]:
    """As many 3D axes side by side, each a column wide."""
    height = 4.0 if tall else 3.3
    if count == 1:
        return (new_axes(height, projection="3d"),)
    from matplotlib import pyplot as plt

    figure = plt.figure(figsize=(count * COLUMN, height), layout="constrained")
    return tuple(figure.add_subplot(1, count, k + 1, projection="3d") for k in range(count))


def _alone(ax: Any, state: State, name: str, e: Ellipsoid) -> None:
    """An ellipsoid about the origin of a space of velocities."""
    size = max(float(e.radii[0]), 1e-9)
    _surface(ax, e, 1.0, np.zeros(3), name)
    _legend(ax, name, e, "")
    for number, axis in enumerate(_flat_axes(state, e)):
        ends = 0.8 * size * np.stack([-axis, axis], axis=1)
        label = "" if number else f"{name}: lost direction"
        ax.plot(*ends, color=LOST, linestyle="--", linewidth=1.4, label=label)
    show_whole(ax, size * np.array([[-1.0] * 3, [1.0] * 3]))
    what = "v" if name == "translational" else r"\omega"
    for letter in "xyz":
        label = f"${what}_{letter}$ [{_UNIT[name]}]"
        getattr(ax, f"set_{letter}label")(label, fontsize=SMALL, labelpad=-4)


def _at_tip(ax: Any, state: State, name: str, e: Ellipsoid, arm: Arm, normals: Array) -> None:
    """The arm in metres, an ellipsoid at its tip, and what is lost there."""
    bones = skeleton(arm, state.q)
    scale = _round_scale(_SHARE * bones.size / max(float(e.radii[0]), 1e-9))
    hot = tuple(sorted({i for d in state.dependences for i in d.indices}))
    draw_skeleton(ax, bones, hot)
    _surface(ax, e, scale, state.tip_position, name)
    _legend(ax, name, e, f"\n(1 {_UNIT[name]} is drawn {scale:g} m long)")
    draw_lost(ax, state, bones.size, state.tip_position)
    radius = scale * float(e.radii[0])
    show_whole(
        ax, np.array([*bones.points, state.tip_position + radius, state.tip_position - radius])
    )
    look_obliquely(ax, normals, bones.points)
    for letter in "xyz":
        getattr(ax, f"set_{letter}label")(f"${letter}$ [m]", fontsize=SMALL, labelpad=-4)


def _surface(ax: Any, e: Ellipsoid, scale: float, center: Array, name: str) -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(0, np.pi, 21))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    ax.plot_surface(
        *np.moveaxis(center + scale * sphere * e.radii @ e.axes.T, -1, 0),
        color=_COLOR[name],
        alpha=0.32,
        linewidth=0.12,
        edgecolor=_COLOR[name],
        shade=False,
    )


def _legend(ax: Any, name: str, e: Ellipsoid, more: str) -> None:
    exact = e.radii > SINGULAR_RTOL * max(float(e.radii[0]), 1e-300)
    radii = ", ".join(f"{r:.3g}" for r in np.where(exact, e.radii, 0.0))
    label = f"{name} semi-axes: {radii} {_UNIT[name]}{more}"
    ax.plot([], [], [], color=_COLOR[name], linewidth=5, alpha=0.6, label=label)


def _flat_axes(state: State, e: Ellipsoid) -> Array:
    """Directions (k, 3) without extent, where the configuration is what makes them so."""
    if state.status == REGULAR or e.radii[0] <= 0:
        return np.zeros((0, 3))
    limit = SINGULAR_RTOL if state.singular else _FLAT
    return np.asarray(e.axes.T[e.radii <= max(limit, 10 * state.rtol) * e.radii[0]])


def _round_scale(scale: float) -> float:
    """A round number not above ``scale``, and not far below."""
    power = 10.0 ** math.floor(math.log10(scale))
    return power * max(k for k in (1, 1.5, 2, 3, 4, 5, 7) if k * power <= scale * (1 + 1e-12))
