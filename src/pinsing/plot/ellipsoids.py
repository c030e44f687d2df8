"""Velocity ellipsoids in three dimensions, as in the paper's Figures 12 to 16."""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing.arguments import checked
from pinsing.configuration.state import REGULAR, State, VelocityEllipsoid
from pinsing.errors import OptionError
from pinsing.kinematics.verdict import SINGULAR_RTOL
from pinsing.plot.style import COLORS, SMALL, legend_below, new_axes, plain

KINDS = ("translational", "rotational")
_COLOR = {"translational": COLORS[0], "rotational": COLORS[4]}
_LOST = "#C4187C"


@checked
def ellipsoids(state: State, ax: Any = None, *, kind: str = "both") -> Any:
    """Draw the velocity ellipsoids of a configuration, at unit joint speed.

    An ellipsoid of zero thickness is drawn as the plate that it is, with its flat direction
    as a dashed line.

    Parameters
    ----------
    state : State
        From ``at(arm, q)``.
    ax : 3D axes, optional
        Where to draw.
    kind : str
        "translational" (m/s), "rotational" (rad/s) or "both".

    Returns
    -------
    Axes3D
        One surface for each ellipsoid; equal scale along all axes.

    Raises
    ------
    OptionError
        If ``kind`` is another word, or ``ax`` is not three-dimensional.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> axes = plot.ellipsoids(pinsing.at(pinsing.load("planar3r"), [0, 0.5, 1]))
    >>> axes.get_title()
    'planar3r: regular'
    """
    if kind not in (*KINDS, "both"):
        raise OptionError(f"unknown kind {kind!r}: translational, rotational or both")
    kinds = KINDS if kind == "both" else (kind,)
    if ax is None:
        ax = new_axes(3.3, projection="3d")
    if getattr(ax, "name", "") != "3d":
        raise OptionError("ellipsoids needs axes with projection='3d'")
    found: dict[str, VelocityEllipsoid] = {k: getattr(state, k) for k in kinds}
    size = max(max(float(e.radii[0]) for e in found.values()), 1e-9)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(0, np.pi, 21))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    for name, e in found.items():
        surface = sphere * e.radii @ e.axes.T
        ax.plot_surface(
            *np.moveaxis(surface, -1, 0),
            color=_COLOR[name],
            alpha=0.32,
            linewidth=0.12,
            edgecolor=_COLOR[name],
            shade=False,
        )
        radii = ", ".join(f"{r:.3g}" for r in np.where(e.radii > 1e-9 * size, e.radii, 0.0))
        ax.plot([], [], [], color=_COLOR[name], linewidth=5, alpha=0.6,
                label=f"{name}: {radii} {e.unit}")  # fmt: skip
        flat = e.radii <= SINGULAR_RTOL * e.radii[0]
        for number, axis in enumerate(e.axes.T[flat] if state.status != REGULAR else ()):
            ends = 0.8 * size * np.stack([-axis, axis], axis=1)
            label = "" if number else f"{name}: lost direction"
            ax.plot(*ends, color=_LOST, linestyle="--", linewidth=1.4, label=label)
    for letter in "xyz":
        getattr(ax, f"set_{letter}lim")(-1.05 * size, 1.05 * size)
        getattr(ax, f"set_{letter}label")(_axis_label(letter, kinds), fontsize=SMALL, labelpad=-4)
    ax.tick_params(labelsize=SMALL - 1.5, pad=-1)
    ax.locator_params(nbins=5)
    ax.set_box_aspect((1, 1, 1))
    ax.set_title(f"{plain(state.arm.name)}: {state.status}", fontsize=SMALL + 1)
    legend_below(ax, 1, at=(0.5, -0.08))
    return ax


def _axis_label(letter: str, kinds: tuple[str, ...]) -> str:
    if len(kinds) > 1:  # the units are in the legend
        return f"${letter}$"
    return f"$v_{letter}$ [m/s]" if "translational" in kinds else rf"$\omega_{letter}$ [rad/s]"
