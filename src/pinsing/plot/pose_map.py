"""Singular loci and aspects of a mechanism as a slice over two coordinates of the output's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pinsing._types import Array, Bool, Ints, NDArray
from pinsing.errors import OptionError
from pinsing.loops.closure import ranks
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.modes import assembly_sign, home, mode_at
from pinsing.loops.motion import COORDINATES
from pinsing.loops.pose_loci import pose_forms
from pinsing.loops.pose_slice import PoseSlice, free_coordinates, keeps_turn, pose_slice
from pinsing.loops.problems import working_modes
from pinsing.loops.structure import likeness, output_pose, same
from pinsing.measures import ALIKE
from pinsing.plot.mechanism import (
    TYPE_1,
    TYPE_2,
    crosses_zero,
    joint_points,
    looks_apart,
    zero_line,
)
from pinsing.plot.plane import SAMPLES
from pinsing.robot.mechanism import Mechanism

_PALE = {
    True: ("#dfeadb", "#c4dcc9", "#d3e6e9", "#e9efcf"),
    False: ("#f3e3cf", "#efd3cd", "#e8d9ea", "#f2e9c9"),
}
LEAST = 12
"""Grid cells below which a region is not told from the roughness of the grid."""


def regions(
    inside: Bool, left_sides: Sequence[Array], turns: tuple[bool, bool] = (False, False)
) -> tuple[NDArray[np.int_], list[bool]]:
    """Number the connected regions of a grid in which no left side changes its sign.

    ``inside`` (k, k) is where poses are reached; columns (the abscissa) and rows go round a whole
    turn where ``turns`` says so: then the first one is the last. Numbers (k, k) are from 1 on,
    largest first, 0 where nothing is reached or a region is a few cells; of each region it is told
    whether the product of the left sides is positive.
    """
    from scipy.ndimage import label

    pattern = np.zeros(inside.shape, dtype=int)
    for k, left in enumerate(left_sides):
        pattern += (left > 0).astype(int) << k
    found: list[tuple[int, Bool, bool]] = []
    for value in np.unique(pattern[inside]).tolist():
        numbers, count = label(inside & (pattern == value))
        even = (len(left_sides) - int(value).bit_count()) % 2 == 0
        for members in _joined(numbers, count, turns):
            cells = np.isin(numbers, members)
            if int(cells.sum()) >= LEAST:
                found.append((int(cells.sum()), cells, even))
    found.sort(key=lambda x: -x[0])
    out = np.zeros(inside.shape, dtype=int)
    for k, (_, cells, _) in enumerate(found, 1):
        out[cells] = k
    return out, [even for _, _, even in found]


def _joined(numbers: NDArray[np.int_], count: int, turns: tuple[bool, bool]) -> list[Ints]:
    """Numbers of regions, those together that meet across a whole turn."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    sides = [numbers[:, [0, -1]]] * turns[0] + [numbers[[0, -1]].T] * turns[1]
    meet = np.concatenate([np.zeros((0, 2), dtype=int), *sides])
    meet = meet[(meet > 0).all(axis=1)] - 1
    graph = coo_matrix((np.ones(len(meet)), meet.T), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    return [np.flatnonzero(group == k) + 1 for k in np.unique(group)]


def colors(positive: Sequence[bool]) -> list[str]:
    """A pale colour for each region: green and blue for those that are positive, else warm."""
    shades = {sign: cycle(pale) for sign, pale in _PALE.items()}
    return [next(shades[sign]) for sign in positive]


PASSIVE = "#7d3c98"
LIMIT = "#6b7480"
SINGULAR = "#e4e2e8"
_MOST_NAMED = 6


@dataclass(frozen=True, eq=False)
class Panel:
    """One working mode of a slice."""

    title: str  # its name
    # (ny, nx) of int: the aspect that each pose is in, largest first, from 1 on; 0 outside
    numbers: NDArray[np.int_]
    positive: tuple[bool, ...]  # of each aspect, whether it is the assembly mode of home
    lefts: tuple[tuple[str, Array], ...]  # kind and left side of each equation
    reached: Bool  # (ny, nx) of bool: where the loops close, limits aside
    margin: Array  # (ny, nx): how far the joint that is nearest to a limit is inside
    # a locus that parts aspects vanishes all over: every pose of the panel is singular
    everywhere: bool


def pose_map(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    ax: Axes | None = None,
    samples: int | None = None,
    degrees: bool = True,
    start: Array | None = None,
) -> Axes:
    """Draw a slice through the loci: two coordinates of the pose vary, the others stay.

    Coloured is where the mechanism gets to within the limits of all its joints, in the working mode
    of home: each aspect in a colour of its own. Green and blue ones are of the assembly mode of
    home, warm ones of the other. Lines are the loci, from their exact equations. ``start`` (n,),
    closed, takes the place of home.
    """
    names = _names(mechanism, over)
    q = home(mechanism) if start is None else start
    found = pose_slice(mechanism, names, [q], samples or SAMPLES)
    panel = panels(mechanism, found, [""])[0]
    handles = _handles(mechanism, [panel])
    if ax is None:
        figure, ax = plt.subplots(figsize=(6, 5.4), layout="constrained")
        figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)
    else:
        ax.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2, fontsize=8
        )
    _draw(ax, mechanism, found, panel, degrees)
    told = "every pose of this slice is singular" if panel.everywhere else _what(mechanism)
    ax.set_title(f"{mechanism.name}: {told}", fontsize=10)
    return ax


def pose_maps(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    samples: int | None = None,
    degrees: bool = True,
    start: Array | None = None,
) -> Figure:
    """The same for every working mode at the pose of home, side by side in one figure."""
    names = _names(mechanism, over)
    modes = _modes(mechanism, names, start)
    shown = modes[:8]
    if len(shown) == 1:
        alone = pose_map(mechanism, names, None, samples, degrees, start)
        return alone.figure  # type: ignore[return-value]
    count = round(SAMPLES / len(shown) ** (1 / 3)) | 1  # odd: home is one of the points
    found = pose_slice(mechanism, names, [q for _, q in shown], samples or count)
    drawn = panels(mechanism, found, [title for title, _ in shown])
    columns = 2 if len(shown) <= 4 else 4
    rows = -(-len(shown) // columns)
    height = 3.25
    if all(COORDINATES.index(name) < 3 for name in found.names):  # with room for its title
        height *= min(1.0, 0.85 * float(np.ptp(found.y) / np.ptp(found.x)) + 0.2)
    figure, grid = plt.subplots(
        rows, columns, figsize=(3.3 * columns, height * rows + 0.9), squeeze=False, sharex=True,
        sharey=True, layout="constrained",
    )  # fmt: skip
    for k, ax in enumerate(grid.ravel()):
        if k >= len(drawn):
            ax.axis("off")
            continue
        _draw(ax, mechanism, found, drawn[k], degrees)
        count = len(drawn[k].positive)
        told = (
            "every pose singular" if drawn[k].everywhere else f"{count} aspect{'s' * (count != 1)}"
        )
        ax.set_title(f"{drawn[k].title}: {told}", fontsize=9)
        ax.label_outer()
    more = "" if len(modes) == len(shown) else f" ({len(shown)} of {len(modes)})"
    figure.suptitle(f"{mechanism.name}: {_what(mechanism)}, by working mode{more}", fontsize=11)
    figure.legend(
        handles=_handles(mechanism, drawn), loc="outside lower center", ncols=3, fontsize=8
    )
    return figure


def panels(mechanism: Mechanism, found: PoseSlice, titles: Sequence[str]) -> list[Panel]:
    """Aspects and left sides of each working mode of a slice."""
    forms = joint_forms(mechanism)
    everywhere = _everywhere(mechanism)
    turns = (COORDINATES.index(found.names[0]) > 2, COORDINATES.index(found.names[1]) > 2)
    out = []
    for k, title in enumerate(titles):
        reached = np.isfinite(found.q[k]).all(axis=-1)
        lefts: list[tuple[str, Array]] = []
        if not everywhere:
            values = np.full((*reached.shape, len(forms.loci)), np.nan)
            values[reached] = forms.values(found.q[k][reached])
            # Hinges that a file has in place of a ball are left out: the ball is not dependent.
            loci = enumerate(forms.loci)
            lefts = [(locus.kind, values[..., i]) for i, locus in loci if not locus.ball]
        lost = [kind != "passive" and _vanishes(v) for kind, v in lefts]
        # What is left of those is rounding.
        lefts = [x for x, zero in zip(lefts, lost, strict=True) if not zero]
        parting = [np.nan_to_num(v) for kind, v in lefts if kind != "passive"]
        numbers, signs = regions(found.inside[k], parting, turns)
        positive = tuple(
            _of_home(mechanism, found.q[k], numbers == number, sign)
            for number, sign in enumerate(signs, 1)
        )
        out.append(
            Panel(title, numbers, positive, tuple(lefts), reached, found.margin[k], any(lost))
        )
    return out


def _names(mechanism: Mechanism, over: Sequence[str] | None) -> tuple[str, ...]:
    OptionError.refuse_if(
        ranks(mechanism).mobility < 2,
        f"{mechanism.name} has one degree of freedom: its poses are a curve, which plot map "
        "--loops shows without --over",
    )
    OptionError.refuse_if(
        not joint_forms(mechanism).complete,
        f"{mechanism.name}: a map over the pose needs equations in the joint angles, and there "
        f"are none: {'; '.join(joint_forms(mechanism).notes)}",
    )
    return tuple(over) if over is not None else free_coordinates(mechanism)[:2]


def _modes(
    mechanism: Mechanism, over: Sequence[str], start: Array | None
) -> list[tuple[str, Array]]:
    """Return working modes at one pose that look different, by name, the start's first."""
    # Of an output that keeps its axes those where it is turned belong to another slice.
    q = home(mechanism) if start is None else start
    place = output_pose(mechanism, q)
    found = list(working_modes(mechanism, place.homogeneous).modes)
    if keeps_turn(mechanism, over, q):
        found = [mode for mode in found if not _turned(mechanism, mode.q, place)]
    kept = [found[k].q for k in looks_apart(mechanism, found, len(found) or 1)]
    mark = likeness(mechanism, q)
    cloud = joint_points(mechanism, q)
    others = [
        x
        for x in kept
        # Legs that are turned round look as they did.
        if not same(mark, likeness(mechanism, x))
        and np.abs(cloud - joint_points(mechanism, x)).max() > ALIKE
    ]
    names = [_title(mechanism, x) for x in (q, *others)]
    at_home = same(mark, likeness(mechanism, home(mechanism)))
    out = []
    for k, (name, x) in enumerate(zip(names, (q, *others), strict=True)):
        which = f" {names[: k + 1].count(name)}" if names.count(name) > 1 else ""
        out.append((f"{name}{which}{' (home)' if at_home and k == 0 else ''}", x))
    return out


def _turned(mechanism: Mechanism, q: Array, place: pin.SE3) -> bool:
    return bool(np.abs(output_pose(mechanism, q).rotation - place.rotation).max() > ALIKE)


def _title(mechanism: Mechanism, q: Array) -> str:
    elbows = "".join(mode_at(mechanism, q).elbows)
    return f"elbows {elbows}" if elbows else "working mode"


def _vanishes(left: Array) -> bool:
    there = np.abs(left[np.isfinite(left)])
    # Left sides, whose factors have unit length, of a locus that is zero all over a slice.
    return bool(len(there)) and float(there.max()) <= 1e-10


def _everywhere(mechanism: Mechanism) -> bool:
    """Return True if every pose is of type 2: there are no lines then, only rounding."""
    forms = pose_forms(mechanism)
    if forms is not None and forms.architecture:
        return True
    return "type 2" in joint_forms(mechanism).always


def _of_home(mechanism: Mechanism, Q: Array, there: Bool, sign: bool) -> bool:
    """Return True if a region is of the assembly mode of home, or of the equation's sign."""
    from scipy.ndimage import distance_transform_edt

    deepest = np.unravel_index(int(np.argmax(distance_transform_edt(there))), there.shape)
    told = assembly_sign(mechanism, Q[deepest])
    return told == "+" if told in "+-" else sign


def _what(mechanism: Mechanism) -> str:
    return "every pose is singular" if _everywhere(mechanism) else "aspects of the workspace"


def _draw(ax: Axes, mechanism: Mechanism, found: PoseSlice, panel: Panel, degrees: bool) -> None:
    from scipy.ndimage import gaussian_filter

    rows = [COORDINATES.index(name) for name in found.names]
    unit = [180 / np.pi if degrees and row > 2 else 1.0 for row in rows]
    x, y = found.x * unit[0], found.y * unit[1]
    shades = [SINGULAR] * len(panel.positive) if panel.everywhere else colors(panel.positive)
    if shades:
        edges = np.arange(len(shades) + 1) + 0.5
        ax.pcolormesh(
            x, y, np.ma.masked_less(panel.numbers, 1), cmap=ListedColormap(shades),
            norm=BoundaryNorm(edges, len(shades)), shading="nearest", rasterized=True,
        )  # fmt: skip
    if _bordered(panel):
        ones = [left for kind, left in panel.lefts if kind == "type 1"]
        if ones:
            edge, level = np.ma.masked_invalid(border_field(panel.reached, ones)), 0.0
        else:
            # Cells over which the border of what was reached is smoothed.
            edge, level = gaussian_filter(panel.reached.astype(float), 0.9), 0.5
        ax.contour(x, y, edge, levels=[level], colors=[_border(mechanism)], linewidths=1.2)
    zero_line(ax, x, y, panel.margin, LIMIT, "--")
    for kind, left in panel.lefts:
        color = {"passive": PASSIVE, "type 1": TYPE_1}.get(kind, TYPE_2)
        zero_line(ax, x, y, left, color, ":" if kind == "passive" else "-")
    for axis, name, row in zip((ax.xaxis, ax.yaxis), found.names, rows, strict=True):
        axis.set_label_text(f"{name} [{'m' if row < 3 else '°' if degrees else 'rad'}]")
    if max(rows) < 3:
        ax.set_aspect("equal")


def _bordered(panel: Panel) -> bool:
    return bool(panel.reached.any()) and int((~panel.reached).sum()) >= LEAST


def border_field(reached: Bool, ones: Sequence[Array]) -> Array:
    """Return, over the grid (ny, nx), what is zero where the loops close no further, else NaN.

    The left side of type 1 goes to zero there as the root of the distance does: its square, which
    is known inside, goes on in a straight line to the cells outside. Where it does not go to zero
    the border is half way between the cells.
    """
    squares = np.array([np.square(v) / max(float(np.nanmax(v * v)), 1e-300) for v in ones])
    squares[:, ~reached] = np.nan
    padded = np.pad(squares, ((0, 0), (2, 2), (2, 2)), constant_values=np.nan)
    ny, nx = reached.shape
    field: Array = squares.min(axis=0)
    straight, slanted = ((0, 1), (0, -1), (1, 0), (-1, 0)), ((1, 1), (1, -1), (-1, 1), (-1, -1))
    for ways, sure in ((straight, True), (slanted, True), (straight, False), (slanted, False)):
        led = []
        for j, i in ways:
            near, further = (
                padded[:, 2 + k * j : 2 + k * j + ny, 2 + k * i : 2 + k * i + nx] for k in (1, 2)
            )
            last = near.min(axis=0)
            on = (2 * near - further).min(axis=0) if sure else -last
            # What bends downwards is led a little too high.
            on = np.where((on >= 0) & (on < last / 2), -1e-6 * last, on)
            led.append(np.where(on < 0, on, np.nan))
        known = np.isfinite(led)
        mean = np.where(known, led, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        new = ~np.isfinite(field) & known.any(axis=0)
        field[new] = mean[new]
    return field


def _border(mechanism: Mechanism) -> str:
    """Colour of where the loops close no further: type 1, where there is such a locus."""
    return TYPE_1 if any(x.kind == "type 1" for x in joint_forms(mechanism).loci) else LIMIT


def _handles(mechanism: Mechanism, drawn: Sequence[Panel]) -> list[Any]:
    """Return what lines and colours are, of those that occur."""
    kinds = {kind for panel in drawn for kind, left in panel.lefts if crosses_zero(left)}
    bordered = any(map(_bordered, drawn))
    closes = "type 1" in kinds or (bordered and _border(mechanism) == TYPE_1)
    limited = any((p.margin[np.isfinite(p.margin)] < 0).any() for p in drawn)
    lines = (
        (kinds - {"type 1", "passive"}, TYPE_2, "-", "type 2"),
        (closes, TYPE_1, "-", "type 1: the loops close no further"),
        (bordered and not closes, LIMIT, "-", "the loops close no further"),
        (limited, LIMIT, "--", "limit of a joint"),
        ("passive" in kinds, PASSIVE, ":", "passive joints dependent"),
    )
    out: list[Any] = [
        Line2D([], [], color=color, ls=style, label=label)
        for there, color, style, label in lines
        if there
    ]
    if _everywhere(mechanism):
        return [*out, Patch(color=colors([True])[0], label="reached; singular everywhere")]
    if any(panel.everywhere for panel in drawn):
        out.append(Patch(color=SINGULAR, label="every pose singular"))
        drawn = [panel for panel in drawn if not panel.everywhere]
    if not drawn:
        return out
    if len(drawn) > 1:
        told = {p for panel in drawn for p in panel.positive}
        for sign, word in ((True, "assembly +, as at home"), (False, "assembly −")):
            if sign in told:
                out.append(Patch(color=colors([sign])[0], label=f"aspects of {word}"))
        return out
    positive = drawn[0].positive
    for number, (sign, shade) in enumerate(zip(positive, colors(positive), strict=True), 1):
        if number <= _MOST_NAMED:
            word = "assembly +" if sign else "assembly −"
            out.append(Patch(color=shade, label=f"aspect {number}: {word}"))
    if len(positive) > _MOST_NAMED:
        out.append(Patch(color="none", label=f"and {len(positive) - _MOST_NAMED} more"))
    return out
