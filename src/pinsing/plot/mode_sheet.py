"""The modes of a mechanism side by side: assembly modes at its inputs, working modes at a pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.loops.closure import ranks
from pinsing.loops.modes import home
from pinsing.loops.pose import COORDINATES, pose_of
from pinsing.loops.pose_slice import free_coordinates
from pinsing.loops.problems import Modes, assembly_modes, working_modes
from pinsing.loops.solve import Solution
from pinsing.loops.structure import output_pose
from pinsing.plot.mechanism import draw_linkage, draw_space_linkage, drawing_plane, joint_points
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 16
_ROW = 4
_SMALL = 7.5


def mode_sheet(
    mechanism: Mechanism,
    inputs: npt.ArrayLike | None = None,
    degrees: bool = True,
    direct: Modes | None = None,
    inverse: Modes | None = None,
) -> Figure:
    """Draw every mode that was found: first the direct problem, then the inverse one.

    Assembly modes are those at ``inputs``; working modes those of the pose that the first of them
    has. Each picture has its number in the text of ``analyze --loops``.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    inputs : (n_a,) array_like, optional
        Values of the actuated joints, radians and metres; home by default.
    degrees : bool
        Angles in degrees.
    direct, inverse : Modes, optional
        What was found before.

    Raises
    ------
    OptionError
        If the loops do not close at these inputs.
    """
    from matplotlib import pyplot as plt

    asked = home(mechanism)[list(mechanism.actuated)] if inputs is None else inputs
    direct = assembly_modes(mechanism, asked) if direct is None else direct
    if not direct.modes:
        raise OptionError(f"{mechanism.name}: there is no mode to draw: {direct.statement}")
    q = home(mechanism) if inputs is None else direct.modes[0].q
    generic = ranks(mechanism)
    if inverse is None and generic.output >= generic.mobility:
        inverse = working_modes(mechanism, output_pose(mechanism, q).homogeneous)
    plane = drawing_plane(mechanism)
    parts = [("At these inputs", direct, _pose_words)]
    if inverse is not None and inverse.modes:
        parts.append(("At this pose", inverse, _input_words))
    chosen = [looks_apart(mechanism, found.modes) for _, found, _ in parts]
    rows = [-(-len(which) // _ROW) for which in chosen]
    columns = min(_ROW, max(map(len, chosen)))
    figure = plt.figure(
        figsize=(max(2.7 * columns, 5.4), 2.95 * sum(rows) + 0.5 * len(parts)),
        layout="constrained",
    )
    blocks = figure.subfigures(len(parts), 1, height_ratios=rows, squeeze=False)[:, 0]
    every = [
        found.modes[k].q for (_, found, _), which in zip(parts, chosen, strict=True) for k in which
    ]
    box = _box(mechanism, every)
    for block, (title, found, told), count, which in zip(blocks, parts, rows, chosen, strict=True):
        more = "" if len(which) == len(found.modes) else f". {_left_out(len(which))}"
        block.suptitle(_wrapped(f"{title}: {found.statement}{more}", columns), fontsize=9)
        for place, k in enumerate(which, 1):
            mode = found.modes[k]
            ax = block.add_subplot(count, columns, place, **({} if plane else {"projection": "3d"}))
            _draw(mechanism, mode.q, ax, plane, box)
            ways = f"; {mode.ways} ways" if mode.ways > 1 else ""
            words = _wrapped(told(mechanism, mode, degrees), 1)
            ax.set_title(f"{k + 1}: {mode.mode}{ways}\n{words}", fontsize=_SMALL)
    return figure


def looks_apart(mechanism: Mechanism, modes: Sequence[Solution], most: int = _MOST) -> list[int]:
    """Places of modes that look different: legs that are turned round look as they did."""
    kept: list[int] = []
    clouds: list[Array] = []
    # Of those that look alike the one whose legs are not turned round.
    slides = list(np.flatnonzero(mechanism.prismatic))
    turned = [int((mode.q[slides] < 0).sum()) for mode in modes]
    for k in np.argsort(turned, kind="stable").tolist():
        cloud = joint_points(mechanism, modes[k].q)
        if all(np.abs(cloud - other).max() > 1e-6 for other in clouds):
            kept.append(k)
            clouds.append(cloud)
        if len(kept) == most:
            break
    return sorted(kept)


def _left_out(count: int) -> str:
    if count == _MOST:
        return f"The first {count} that look different are drawn"
    return (
        f"Drawn: {count}; the others look like {'it' if count == 1 else 'these'}, legs turned round"
    )


def _draw(
    mechanism: Mechanism, q: Array, ax: Any, plane: tuple[int, int] | None, box: Array
) -> None:
    if plane:
        draw_linkage(mechanism, q, ax, ellipse=0)
        ax.set_xlim(*box[:, plane[0]])
        ax.set_ylim(*box[:, plane[1]])
        ax.tick_params(labelsize=_SMALL - 1)
        for axis in (ax.xaxis, ax.yaxis):
            axis.label.set_fontsize(_SMALL)
        return
    draw_space_linkage(mechanism, q, ax)
    for letter, low, high in zip("xyz", *box, strict=True):
        getattr(ax, f"set_{letter}lim")(low, high)
        getattr(ax, f"set_{letter}ticklabels")([])
    ax.set_box_aspect(box[1] - box[0])
    ax.view_init(elev=18, azim=-60)


def _box(mechanism: Mechanism, every: Sequence[Array]) -> Array:
    """Corners (2, 3) of a box about all configurations, a little larger."""
    points = np.concatenate([joint_points(mechanism, q) for q in every])
    low, high = points.min(axis=0), points.max(axis=0)
    more = 0.08 * float((high - low).max())
    # What is flat has some room too.
    thin = np.maximum(0.0, 0.25 * (high - low).max() - (high - low)) / 2
    return np.array([low - more - thin, high + more + thin])


def _pose_words(mechanism: Mechanism, mode: Solution, degrees: bool) -> str:
    at = pose_of(output_pose(mechanism, mode.q))
    pose = [*at.position, *at.angles]
    return ", ".join(
        f"{name} {_number(pose[COORDINATES.index(name)], name in COORDINATES[3:], degrees)}"
        for name in free_coordinates(mechanism)
    )


def _input_words(mechanism: Mechanism, mode: Solution, degrees: bool) -> str:
    slides = mechanism.prismatic[list(mechanism.actuated)].tolist()
    return ", ".join(
        f"{name} {_number(value, not slide, degrees)}"
        for name, value, slide in zip(mechanism.inputs, mode.inputs.tolist(), slides, strict=True)
    )


def _number(value: float, turns: bool, degrees: bool) -> str:
    if turns and degrees:
        return f"{round(float(np.degrees(value))) + 0:d}°"
    return f"{round(value, 2) + 0.0:.2f}" + (" rad" if turns else "")


def _wrapped(words: str, columns: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(words, 40 * columns + (0 if columns > 1 else 2)))
