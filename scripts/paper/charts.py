"""Charts of the page: minimum singular values over a joint, ellipsoids, loci."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from pinsing.kinematics.at import State
from pinsing.robot.arm import Arm
from pinsing.sampling.sweeps import SweepResult

COLORS = ("#1f5fa8", "#c0392b", "#2e8b57", "#8e5ea2", "#b8860b")
plt.rcParams.update(
    {
        "figure.dpi": 110,
        "font.size": 9,
        "axes.grid": True,
        "grid.color": "#e3e3e3",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
    }
)


@dataclass(frozen=True)
class Panel:
    """One part of a figure: joints at 0 or 180 degrees, and those that move.

    Attributes
    ----------
    title : str
    fixed : tuple of str
        Joints at special values; each at 0, and then each at 180 degrees.
    moving : tuple of str
        One curve each.
    """

    title: str
    fixed: tuple[str, ...]
    moving: tuple[str, ...]


def save(figure: plt.Figure, folder: Path, name: str) -> None:
    figure.tight_layout()
    figure.savefig(folder / f"{name}.png")
    plt.close(figure)


def sigma_panels(
    result: SweepResult, panels: Sequence[Panel], folder: Path, name: str, columns: int = 3
) -> None:
    """Distributions of sigma_min as in the paper's Figures 2 to 4 and 6 to 9."""
    rows = -(-len(panels) // columns)
    columns = min(columns, len(panels))
    figure, axes = plt.subplots(rows, columns, figsize=(3.7 * columns, 2.9 * rows), squeeze=False)
    for ax in axes.flat[len(panels) :]:
        ax.axis("off")
    for ax, panel in zip(axes.flat, panels, strict=False):
        draw_panel(result, panel, ax)
    save(figure, folder, name)


def draw_panel(result: SweepResult, panel: Panel, ax: plt.Axes) -> None:
    sliding = dict(zip(result.arm.joints, result.arm.prismatic, strict=True))
    top = 0.0
    for k, moving in enumerate(panel.moving):
        values = (0.0, np.pi) if panel.fixed else (0.0,)
        for value, style in zip(values, ("-", "--"), strict=False):
            curve = result.curve(dict.fromkeys(panel.fixed, value), moving)
            x = curve.x if sliding[moving] else np.degrees(curve.x)
            label = moving if value == 0 else None
            ax.plot(x, curve.sigma_min, style, color=COLORS[k % len(COLORS)], label=label)
            top = max(top, float(curve.sigma_min.max()))
    unit = "m" if sliding[panel.moving[0]] else "°"
    ax.set_xlabel(f"{', '.join(panel.moving)} ({unit})")
    ax.set_ylabel("σ_min")
    ax.set_title(panel.title)
    ax.set_ylim(-0.03 * top if top > 1e-9 else -0.001, 1.15 * top if top > 1e-9 else 0.01)
    if not sliding[panel.moving[0]]:
        ax.set_xlim(-180, 180)
        ax.set_xticks(range(-180, 181, 90))
    if top <= 1e-9:
        ax.text(0.5, 0.6, "zero throughout", transform=ax.transAxes, ha="center", color="#666")
    if len(panel.moving) > 1:
        ax.legend(ncols=len(panel.moving), fontsize=8)


def ellipsoid_pairs(states: Mapping[str, State], arm: Arm, folder: Path, name: str) -> None:
    """Translational and rotational velocity ellipsoids, as in Figures 13 to 16."""
    figure = plt.figure(figsize=(7.6, 3.5 * len(states)))
    for i, (title, state) in enumerate(states.items()):
        for k, (ellipsoid, unit) in enumerate(
            ((state.translational, "m/s"), (state.rotational, "rad/s"))
        ):
            ax = figure.add_subplot(len(states), 2, 2 * i + k + 1, projection="3d")
            _ellipsoid(ax, ellipsoid.axes, ellipsoid.radii, COLORS[k], unit)
            kind = "translational" if k == 0 else "rotational"
            radii = ", ".join(f"{r:.3g}" for r in ellipsoid.radii)
            ax.set_title(f"{title}\n{kind}: semi-axes {radii} {unit}", fontsize=8)
    save(figure, folder, name)


def _ellipsoid(ax: plt.Axes, axes: np.ndarray, radii: np.ndarray, color: str, unit: str) -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 48), np.linspace(0, np.pi, 24))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    points = np.einsum("ij,jab->iab", axes * radii, sphere)
    ax.plot_surface(*points, color=color, alpha=0.45, linewidth=0, shade=True)
    ax.plot_wireframe(*points[:, ::4, ::6], color=color, linewidth=0.4, alpha=0.7)
    reach = float(radii.max())
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-reach, reach))
    ax.set_xlabel(f"x ({unit})", fontsize=7)
    ax.set_ylabel("y", fontsize=7)
    ax.set_zlabel("z", fontsize=7)
    ax.tick_params(labelsize=6)
    ax.locator_params(nbins=3)
    ax.set_box_aspect((1, 1, 1))
    # Across the thinnest axis, so that a flat ellipsoid is seen as flat.
    thin, long = axes[:, 2], axes[:, 0]
    view = np.cross(thin, long) + 0.25 * thin
    view = view if view[2] >= 0 else -view
    ax.view_init(
        elev=float(np.degrees(np.arcsin(view[2] / np.linalg.norm(view)))),
        azim=float(np.degrees(np.arctan2(view[1], view[0]))),
    )
