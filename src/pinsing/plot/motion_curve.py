"""A mechanism of one freedom: its output over its input, or the path of its output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.loops.batch import BatchLoops
from pinsing.loops.closure import ranks
from pinsing.loops.modes import assembly_sign, home
from pinsing.loops.pose import COORDINATES, led_pose, pose_of
from pinsing.loops.pose_slice import free_coordinates
from pinsing.loops.problems import Modes, assembly_modes, working_modes
from pinsing.loops.singular_points import find_singular
from pinsing.loops.solve import Solution, curves
from pinsing.loops.structure import output_pose
from pinsing.plot.mechanism import (
    TYPE_1,
    TYPE_2,
    draw_linkage,
    draw_space_linkage,
    drawing_plane,
    joint_points,
)
from pinsing.prose import unbroken
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLUS = "#3c7a4b"
MINUS = "#b8772c"
_PLAIN = "#41719c"
_MODES = {
    "+": (PLUS, "assembly +, as at home"), "-": (MINUS, "assembly −"), "0": (_PLAIN, "poses"),
    "?": (_PLAIN, "poses"),
}  # fmt: skip
_STILL = 1e-9


def motion_curve(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    ax: Axes | None = None,
    degrees: bool = True,
) -> Axes:
    """Draw all the poses of a mechanism with one degree of freedom, as a curve.

    Green is the assembly mode of home, brown the others; what is singular is marked.

    Parameters
    ----------
    mechanism : Mechanism
        One degree of freedom.
    over : two names, optional
        Of the input and x, y, z, roll, pitch, yaw of the output; the input and what the output
        moves most by default.
    ax : Axes, optional
        Axes to draw into.
    degrees : bool
        Angles in degrees.

    Raises
    ------
    OptionError
        If it has more freedoms, or these coordinates do not move.
    """
    from matplotlib import pyplot as plt

    freedoms = ranks(mechanism).mobility
    if freedoms != 1:
        raise OptionError(
            f"{mechanism.name} has {freedoms} degrees of freedom: its poses are no curve"
        )
    names = _names(mechanism, over)
    inputs = home(mechanism)[list(mechanism.actuated)]
    found = curves(mechanism, inputs, 0)
    points = find_singular(mechanism, found)
    turn = np.array(
        [(360.0 if degrees else 2 * np.pi) if _turns(mechanism, n) else np.inf for n in names]
    )
    told = _apart([(t.q, _values(mechanism, t.q, names, degrees)) for t in found], turn)
    centre = _centre(told[0][1], turn) if told else np.zeros(2)
    for k, name in enumerate(names):
        if not told or max(float(np.ptp(v[:, k])) for _, v in told) <= _STILL:
            raise OptionError(
                f"{mechanism.name}: {name} does not move; take two of "
                f"{', '.join((*mechanism.inputs, *COORDINATES))}"
            )
    ax = plt.subplots(figsize=(6, 5))[1] if ax is None else ax
    shown: set[str] = set()
    signs = [[assembly_sign(mechanism, x) for x in q] for q, _ in told]
    part = any({"+", "-"} <= set(x) for x in signs)
    for number, ((_, values), sign) in enumerate(zip(told, signs, strict=True)):
        for begin, end, which in _runs(sign) if part else [(0, len(values), str(number))]:
            color, label = _MODES[which] if part else (
                (PLUS, "the curve of home") if number == 0 else (MINUS, "other assembly modes")
            )  # fmt: skip
            piece = _broken(values[begin : min(end + 1, len(values))], turn, centre)
            ax.plot(*piece.T, color=color, lw=1.8, label=None if label in shown else label)
            shown.add(label)
    for point in points:
        place = _folded(_values(mechanism, point.q[None], names, degrees), turn, centre)[0]
        color = TYPE_1 if point.kind == "type 1" else TYPE_2
        label = "" if point.kind in shown else point.kind
        ax.plot(*place, "o", color=color, ms=6, zorder=4, ls="", label=label or None)
        shown.add(point.kind)
    for axis, name in zip((ax.xaxis, ax.yaxis), names, strict=True):
        axis.set_label_text(f"{name} [{_unit(mechanism, name, degrees)}]")
    if all(name in COORDINATES[:3] for name in names):
        ax.set_aspect("equal", adjustable="datalim")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    ax.set_title(f"{mechanism.name}: every pose of the output", fontsize=10)
    return ax


def _names(mechanism: Mechanism, over: Sequence[str] | None) -> tuple[str, str]:
    if over is None:
        return mechanism.inputs[0], COORDINATES[led_pose(mechanism)["rows"][0]]
    names = ["yaw" if n in ("phi", "φ") else n for n in over]
    known = (*mechanism.inputs, *COORDINATES)
    if len(names) != 2 or names[0] == names[1] or not set(names) <= set(known):
        raise OptionError(
            f"a curve of poses goes over two of {', '.join(known)}; got {', '.join(over)}"
        )
    return names[0], names[1]


def _values(mechanism: Mechanism, q: Array, names: Sequence[str], degrees: bool) -> Array:
    """The two coordinates (N, 2) along configurations (N, n), angles without jumps."""
    R, p, _ = BatchLoops(mechanism).output(q)
    angles = np.unwrap(np.array([pin.rpy.matrixToRpy(M) for M in R]), axis=0)
    out = []
    for name in names:
        if name in mechanism.inputs:
            value = q[:, mechanism.joints.index(name)]
        else:
            row = COORDINATES.index(name)
            value = p[:, row] if row < 3 else angles[:, row - 3]
        out.append(np.degrees(value) if degrees and _turns(mechanism, name) else value)
    return np.stack(out, axis=1)


def _turns(mechanism: Mechanism, name: str) -> bool:
    if name in mechanism.inputs:
        return not mechanism.prismatic[mechanism.joints.index(name)]
    return name in COORDINATES[3:]


def _unit(mechanism: Mechanism, name: str, degrees: bool) -> str:
    return ("°" if degrees else "rad") if _turns(mechanism, name) else "m"


def _centre(values: Array, turn: Array) -> Array:
    """What angles are shown about: the middle of a curve, if it is less than a whole turn."""
    low, high = values.min(axis=0), values.max(axis=0)
    return np.asarray(np.where(np.isfinite(turn) & (high - low < turn), (low + high) / 2, 0.0))


def _folded(values: Array, turn: Array, centre: Array | float = 0.0) -> Array:
    """Values (..., 2), angles within half a turn of the centre."""
    whole = np.where(np.isfinite(turn), turn, 1.0)
    folded = values - whole * np.round((values - centre) / whole)
    return np.asarray(np.where(np.isfinite(turn), folded, values))


def _broken(values: Array, turn: Array, centre: Array) -> Array:
    """The same as a line that ends where an angle begins anew."""
    out = _folded(values, turn, centre)
    jumps = np.flatnonzero((np.abs(np.diff(out, axis=0)) > turn / 2).any(axis=1)) + 1
    return np.insert(out, jumps, np.nan, axis=0)


def _apart(found: Sequence[tuple[Array, Array]], turn: Array) -> list[tuple[Array, Array]]:
    """Curves that are not one that is there already: balls that are flipped give the same."""
    kept: list[tuple[Array, Array]] = []
    for q, values in found:
        mine = _folded(values, turn)
        for _, other in kept:
            there = _folded(other, turn)
            step = np.abs(_folded(np.diff(other, axis=0), turn)).max(axis=0) + _STILL
            gap = np.abs(_folded(mine[::7, None] - there[None], turn))
            if ((gap <= step).all(axis=2)).any(axis=1).all():
                break
        else:
            kept.append((q, values))
    return kept


def _runs(signs: Sequence[str]) -> list[tuple[int, int, str]]:
    """Stretches (first, beyond the last, sign) of equal signs; a zero goes with what is before."""
    out: list[tuple[int, int, str]] = []
    for k, sign in enumerate(signs):
        if out and sign in (out[-1][2], "0"):
            out[-1] = (out[-1][0], k + 1, out[-1][2])
        else:
            out.append((k, k + 1, sign))
    return out


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
    from matplotlib.layout_engine import ConstrainedLayoutEngine

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
        layout=ConstrainedLayoutEngine(h_pad=0.1),  # keeps headings of two lines apart
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
        unbroken(
            f"{name} {_number(pose[COORDINATES.index(name)], name in COORDINATES[3:], degrees)}"
        )
        for name in free_coordinates(mechanism)
    )


def _input_words(mechanism: Mechanism, mode: Solution, degrees: bool) -> str:
    slides = mechanism.prismatic[list(mechanism.actuated)].tolist()
    return ", ".join(
        unbroken(f"{name} {_number(value, not slide, degrees)}")
        for name, value, slide in zip(mechanism.inputs, mode.inputs.tolist(), slides, strict=True)
    )


def _number(value: float, turns: bool, degrees: bool) -> str:
    if turns and degrees:
        return f"{round(float(np.degrees(value))) + 0:d}°"
    return f"{round(value, 2) + 0.0:.2f}" + (" rad" if turns else "")


def _wrapped(words: str, columns: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(words, 40 * columns + (0 if columns > 1 else 2)))
