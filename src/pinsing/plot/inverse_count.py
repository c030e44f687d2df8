"""The workspace of a 3-joint arm by its number of inverse solutions, with cusps and nodes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from pinsing.arguments import checked, whole_number
from pinsing.plot.reach import reach_of
from pinsing.plot.style import SMALL, legend_below, new_axes, plain
from pinsing.robot.arm import Arm

SAMPLES = 400
_COLOURS = ("#FFFFFF", "#E3EEF7", "#B8D4EA", "#86B6DB", "#5594C8", "#2F74B0", "#1B5590", "#123E6C")


@checked
def inverse_count(
    arm: Arm, ax: Axes | None = None, *, limits: bool = False, samples: int = SAMPLES
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
    colours = [_COLOURS[min(k, len(_COLOURS) - 1)] for k in range(most + 1)]
    ax.pcolormesh(
        found.r, found.z, found.count, cmap=ListedColormap(colours), vmin=-0.5, vmax=most + 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
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
    ax.set_aspect("equal")
    ax.set_xlim(0, float(found.r[-1]))
    ax.set_xlabel("distance from the first axis, r [m]", fontsize=SMALL + 1)
    ax.set_ylabel("along it, z [m]", fontsize=SMALL + 1)
    ax.tick_params(labelsize=SMALL)
    where = "within the joint limits" if found.within_limits else "without joint limits"
    ax.set_title(f"{plain(arm.name)}: inverse solutions by place, {where}", fontsize=SMALL)
    legend_below(ax, 2, left=True)
    return ax
