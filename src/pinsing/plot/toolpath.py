"""A toolpath: clearance along it, and over what is free."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pinsing.arguments import checked
from pinsing.families import ClosedForm
from pinsing.plot.style import COLORS, SINGULAR, legend_below, plain
from pinsing.postures.toolpath import PathPlan
from pinsing.proximity.clearance import clearance


@checked
def path_sheet(plan: PathPlan, form: ClosedForm) -> Figure:
    """Draw the clearance along a planned path, and the map of what is free that it was chosen from.

    Parameters
    ----------
    plan : PathPlan
        A path, from ``plan_path``.
    form : ClosedForm
        The form that it was planned with.

    Returns
    -------
    Figure
        Above, the clearance at each pose, its proven least value and the bound of all paths; below,
        where something was free, the greatest clearance over the branches at each pose and value,
        with the path drawn in.

    Raises
    ------
    ValueError
        If there is no path.
    """
    from matplotlib import pyplot as plt

    if plan.reason:
        raise ValueError(f"there is no path to draw: {plan.reason}")
    wide = len(plan.grid) > 1
    figure, axes = plt.subplots(
        1 + wide, 1, figsize=(8, 7 if wide else 4), sharex=True, squeeze=False, layout="constrained"
    )
    top = axes[0, 0]
    poses = np.arange(len(plan.q))
    along = np.degrees(clearance(form, plan.q, certify=True, gap=1e-3).upper)
    top.plot(poses, along, color=COLORS[0], label="the path")
    top.axhline(
        np.degrees(plan.clearance), color=COLORS[0], ls="--", lw=1, label="its least (proven)"
    )
    top.axhline(np.degrees(plan.bound), color=SINGULAR, ls=":", lw=1, label="bound of all paths")
    if wide and plan.fixed:
        kept = f"least with {plain(plan.free)} kept"
        top.axhline(np.degrees(max(plan.fixed)), color=COLORS[1], ls="-.", lw=1, label=kept)
    top.set_ylim(bottom=0)
    top.set_ylabel("clearance [°]")
    top.set_title(f"{plain(plan.arm.name)}: distance to the nearest singularity")
    legend_below(top)
    if wide:
        below = axes[1, 0]
        room = np.degrees(np.where(np.isfinite(plan.room), plan.room, np.nan))
        mesh = below.pcolormesh(
            poses, np.degrees(plan.grid), room.T, cmap="viridis", vmin=0, shading="nearest",
            rasterized=True,
        )  # fmt: skip
        figure.colorbar(mesh, ax=below, label="clearance [°]")
        values = np.degrees(plan.values)
        jump = np.abs(np.diff(values)) > 180  # round the circle
        below.plot(*_broken(poses, values, jump), color="white", lw=3)
        below.plot(*_broken(poses, values, jump), color=SINGULAR, lw=1.5)
        below.set_ylabel(f"{plain(plan.free)} [°]")
        below.set_xlabel("pose")
    else:
        top.set_xlabel("pose")
    return figure


def _broken(x: np.ndarray, y: np.ndarray, jump: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    at = np.flatnonzero(jump) + 1
    return np.insert(x.astype(float), at, np.nan), np.insert(y, at, np.nan)
