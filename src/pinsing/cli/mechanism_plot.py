"""``plot --loops``: figures of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pinsing.cli.figure import off_screen, save_figure
from pinsing.cli.mechanism import read, tell_of_limits, typed_inputs
from pinsing.errors import OptionError

if TYPE_CHECKING:
    from pinsing._types import Array
    from pinsing.robot.mechanism import Mechanism

_LOOP_PLOTS = ("map", "curves", "ellipsoids", "modes")
_ARM_PLOTS: dict[str, Any] = {
    "fixed": (), "families": (), "each": None, "motions": None, "measure": "sigma",
}  # fmt: skip
_PLOT_OPTIONS = {"families": "family"}


def plot_loops(
    loops: Path,
    kind: str,
    out: Path,
    configurations: Sequence[str] = (),
    dpi: int = 200,
    deg: bool = False,
    over: str | None = None,
    ignore_limits: bool = False,
    **options: Any,
) -> None:
    """``plot --loops``: maps over the pose or the inputs, measures, the linkage, its modes.

    ``map --over x,y`` is a slice through the loci and aspects over two coordinates of the output's
    pose, for each working mode; the others are as at home, or as at ``--q``. Without ``--over``
    ``map`` shows both assembly modes of a 5R over its inputs, all poses of a mechanism of one
    freedom, else the first two coordinates. ``curves`` shows each input in turn, ``ellipsoids`` the
    linkage with its velocity ellipse in every assembly mode, ``modes`` all modes side by side.
    """
    if kind not in _LOOP_PLOTS:
        raise OptionError(
            f"there is no {kind} plot of mechanisms: use {', '.join(_LOOP_PLOTS[:-1])} or "
            f"{_LOOP_PLOTS[-1]}"
        )
    if over is not None and kind != "map":
        raise OptionError("--over goes with plot map --loops: --over x,y")
    given = [name for name, usual in _ARM_PLOTS.items() if options.get(name, usual) != usual]
    if given:
        raise OptionError(
            f"{'--' + _PLOT_OPTIONS.get(given[0], given[0])} does not go with plot --loops"
        )
    mechanism = read(loops, options)
    if ignore_limits:
        mechanism = mechanism.without_limits()
    tell_of_limits(mechanism)
    inputs = typed_inputs(mechanism, configurations, deg)
    off_screen()
    figure = _figure(mechanism, kind, inputs, bool(configurations), over, deg)
    save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.04)


def _figure(
    mechanism: Mechanism, kind: str, inputs: Array, asked: bool, over: str | None, deg: bool
) -> Any:
    import matplotlib.pyplot as plt

    from pinsing.loops import assemblies, curves, find_singular, ranks
    from pinsing.loops.loop_forms import planar_dyad
    from pinsing.plot.mechanism import draw_linkage, input_map, map_legend, measure_curves

    names = None if over is None else [n.strip() for n in over.split(",")]
    if kind == "modes":
        from pinsing.plot.mechanism import mode_sheet

        return mode_sheet(mechanism, inputs if asked else None, deg)
    if kind == "map" and ranks(mechanism).mobility == 1:
        from pinsing.plot.mechanism import motion_curve

        _without_q(asked, "all poses are on one curve")
        return motion_curve(mechanism, names, None, deg).figure
    if kind == "map" and (names is not None or planar_dyad(mechanism) is None):
        from pinsing.plot.pose_map import pose_maps

        start = assemblies(mechanism, inputs)[0].q if asked else None
        return pose_maps(mechanism, names, None, deg, start)
    if kind == "map":
        _without_q(asked, "this map is over all inputs")
        figure, axes = plt.subplots(1, 2, figsize=(11, 6.2))
        for ax, sign in zip(axes, "+-", strict=True):
            input_map(mechanism, sign, ax, degrees=deg)
            map_legend(ax, mechanism)
    elif kind == "curves":
        count = len(mechanism.inputs)
        figure, grid = plt.subplots(1, count, figsize=(5.2 * count, 4), squeeze=False)
        for k, ax in enumerate(grid[0]):
            found = curves(mechanism, inputs, k)
            measure_curves(mechanism, found, find_singular(mechanism, found), ax, deg)
    else:
        modes = assemblies(mechanism, inputs)
        figure, grid = plt.subplots(1, len(modes), figsize=(4.8 * len(modes), 4.8), squeeze=False)
        for ax, mode in zip(grid[0], modes, strict=True):
            draw_linkage(mechanism, mode.q, ax)
            ax.set_title(mode.mode)
    figure.tight_layout()
    return figure


def _without_q(asked: bool, why: str) -> None:
    if asked:
        raise OptionError(f"--q does not go with this map: {why}")
