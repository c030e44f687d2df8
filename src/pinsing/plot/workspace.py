"""How well places are reached: slices of the workspace, coloured by the best found there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.arguments import checked, whole_number
from pinsing.errors import OptionError
from pinsing.families import ClosedForm
from pinsing.kinematics.jacobian import singular_values
from pinsing.plot.style import SMALL, plain
from pinsing.proximity.clearance import quick
from pinsing.proximity.watched import watch
from pinsing.robot.arm import Arm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAMPLES = 60_000
_CELLS = 48


@checked
def workspace(
    arm: Arm,
    axes: Any = None,
    *,
    measure: Literal["sigma", "clearance"] = "sigma",
    forms: ClosedForm | None = None,
    samples: int = SAMPLES,
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
    every = _three() if axes is None else _given(axes)
    Q = arm.space.sample(samples, np.random.default_rng(2026))
    tips = tip_positions(arm, Q)
    values, label = _measured(arm, Q, measure, forms)
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
    bar.set_label(label, fontsize=SMALL)
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


def _measured(arm: Arm, Q: Array, measure: str, forms: ClosedForm | None) -> tuple[Array, str]:
    if measure == "sigma":
        return singular_values(arm, Q)[:, -1], r"$\sigma_{\min}$, best there"
    if forms is None:
        from pinsing.families.solve import form_to_measure

        forms = form_to_measure(arm)
    lower = np.degrees(quick(watch(forms), Q).lower)
    if not np.isfinite(lower).all():
        raise OptionError("clearance is infinite: no family of singular configurations is known")
    return lower, "clearance, at least, best there [deg]"


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


def _three() -> list[Axes]:
    from matplotlib import pyplot as plt

    return list(plt.subplots(1, 3, figsize=(9.0, 3.3), layout="constrained")[1])


def _given(axes: Any) -> list[Axes]:
    from matplotlib.axes import Axes

    every = list(axes.flat) if isinstance(axes, np.ndarray) else axes
    if (
        not isinstance(every, list | tuple)
        or len(every) != 3
        or not all(isinstance(ax, Axes) for ax in every)
    ):
        raise OptionError("axes must be three of matplotlib's, for the slices x-z, y-z and x-y")
    return list(every)
