"""Plots of mechanisms: maps over the inputs and the pose, measures along a curve, the linkage."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, cycle, zip_longest
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from pinsing.errors import OptionError
from pinsing.loops.closure import (
    BatchLoops,
    Dyad,
    groups,
    likeness,
    output_pose,
    planar_dyad,
    plane_axes,
    ranks,
    same,
)
from pinsing.loops.joint_loci import LoopForms, joint_forms, loop_forms
from pinsing.loops.map import PoseSlice, PoseWay, free_coordinates, pose_slice
from pinsing.loops.motion import (
    COORDINATES,
    assembly_sign,
    home,
    led_pose,
    mechanism_at,
    mode_at,
)
from pinsing.loops.pose_loci import pose_forms
from pinsing.loops.solve import (
    SingularPoint,
    Solution,
    Trace,
    assembly_modes,
    curves,
    find_singular,
    working_modes,
)
from pinsing.measures import ALIKE, ROUNDING, Array, ArrayLike, Bool, NDArray
from pinsing.plot.style import DASHES, legend_of_all, pi_ticks, plain, unit
from pinsing.postures.joint_map import connected
from pinsing.prose import unbroken
from pinsing.robot.mechanism import Mechanism, Sample, closing

TYPE_1 = "#c0392b"
TYPE_2 = "#1f5fa8"
_FEASIBLE = "#eef3e6"
_LINK, _DRIVEN, _NODE, _OUTPUT = "#8a9ba8", "#41719c", "#37424d", "#cc333d"
_PLATE, _GROUND = "#e9d5d6", "#e3e7ea"


def input_map(
    mechanism: Mechanism,
    assembly: str = "+",
    ax: Axes | None = None,
    samples: int = 721,
    degrees: bool = True,
) -> Axes:
    """Map over the two inputs of a 5R: where it closes, and its type 1 and type 2 loci."""
    dyad = planar_dyad(mechanism)
    if dyad is None or len(mechanism.inputs) != 2:
        raise OptionError("a map over the inputs needs a planar loop with two cranks (5R)")
    OptionError.refuse_if(
        assembly not in ("+", "-"), f"assembly mode must be + or -, got {assembly!r}"
    )
    ax = plt.subplots()[1] if ax is None else ax
    left = is_left(mechanism, dyad) == (assembly == "+")
    x = y = np.linspace(-np.pi, np.pi, samples)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    q = dyad.configuration(grid, left)
    closed = np.asarray(np.isfinite(q).all(axis=-1))
    d = np.degrees if degrees else np.asarray
    ax.contourf(d(x), d(y), closed.astype(float), levels=[0.5, 1.5], colors=[_FEASIBLE])
    ax.fill([], [], color=_FEASIBLE, label="loops close")
    distance, (one, two) = abs(np.diff(dyad.ends(grid)))[..., 0], dyad.rods
    for reach, style in ((one + two, "-"), (abs(one - two), "--")):
        if reach > 0:
            said = "type 2: B1, P, B2 in line"
            zero_line(ax, d(x), d(y), distance - reach, TYPE_2, style, said)
    for kind, inputs in _isolated(mechanism, dyad):
        two = kind == "type 2"
        label = once(ax, "type 2: B1 = B2") if two else None
        color = TYPE_2 if two else TYPE_1
        ax.plot(*d(inputs), "o", color=color, ms=5, mfc="white", zorder=4, label=label)
    for value, style, said in _type_1(mechanism, dyad, q):
        zero_line(ax, d(x), d(y), value, TYPE_1, style, said)
    for axis, name in zip((ax.xaxis, ax.yaxis), mechanism.inputs, strict=True):
        axis.set_label_text(f"{plain(name)} [{unit(False, degrees)}]")
        if not degrees:
            pi_ticks(axis, -np.pi, np.pi)
    ax.set(title=f"assembly {assembly}", aspect="equal")
    return ax


def _type_1(mechanism: Mechanism, dyad: Dyad, q: Array) -> Iterator[tuple[Array, str, str]]:
    """Yield left sides of type 1 over the grid, NaN where loops are open, strokes and words."""
    # Of an output that is the pin: of each leg, stretched and folded; else equations in the angles.
    if dyad.at_pin():
        for leg in (0, 1):
            bend = dyad.bend(q, leg)
            for sense, style, how in ((1, "-", "stretched"), (-1, "--", "folded")):
                left = np.where(sense * bend.real > 0, bend.imag, np.nan)
                yield left, style, f"type 1: a leg {how}"
        return
    closed = np.isfinite(q).all(axis=-1)
    for locus in (x for x in joint_forms(mechanism).loci if x.kind == "type 1"):
        left = np.full(closed.shape, np.nan)
        left[closed] = locus.value(q[closed], mechanism.joints)
        yield left, "-", "type 1: the output loses a direction"


def map_legend(ax: Axes, down: float = 0.12) -> None:
    """Say below the axes what is drawn in them."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -down), ncols=2, fontsize=8)


def measure_curves(
    mechanism: Mechanism,
    traces: Sequence[Trace],
    points: Sequence[SingularPoint],
    ax: Axes,
    degrees: bool,
) -> None:
    """Type 1 and type 2 measures along solution curves, over the moving input."""
    for t, style in zip(traces, cycle(DASHES), strict=False):
        joint = mechanism.actuated[t.moving]
        slides = bool(mechanism.prismatic[joint])
        in_unit = np.degrees if degrees and not slides else np.asarray
        value = t.q[:, joint]
        ax.plot(in_unit(value), t.output_ratio, color=TYPE_1, ls=style, lw=1.2)
        ax.plot(in_unit(value), t.input_ratio, color=TYPE_2, ls=style, lw=1.2)
        for p in points:
            if p.moving == mechanism.inputs[t.moving]:
                at = float(p.q[joint])
                if not slides:
                    at += 2 * np.pi * np.round((value.mean() - at) / (2 * np.pi))
                color = TYPE_1 if p.kind == "type 1" else TYPE_2
                ax.plot(in_unit(at), 0, "o", color=color, ms=5, clip_on=False, zorder=3)
        ax.set_xlabel(f"{plain(mechanism.inputs[t.moving])} [{unit(slides, degrees)}]")
    ax.plot([], [], color=TYPE_1, label="type 1 measure")
    ax.plot([], [], color=TYPE_2, label="type 2 measure")
    ax.set_ylim(bottom=0)
    map_legend(ax, 0.16)


def draw_linkage(
    mechanism: Mechanism, q: ArrayLike, ax: Axes | None = None, ellipse: float = 0.25
) -> Axes:
    """Draw the links of a planar mechanism, its joints, and the output's velocity ellipse."""
    # 1 m per unit input speed is drawn as ``ellipse`` metres, 0 leaves it out. At a type 2
    # singularity the uncontrolled velocity is an arrow instead.
    ax = plt.subplots()[1] if ax is None else ax
    q = mechanism.check(q)
    plane = list(drawing_plane(mechanism) or (0, 1))
    P = np.array(output_pose(mechanism, q).translation)[plane]
    _draw_links(mechanism, q, ax, plane)
    rows = list(mechanism.task.rows)
    if ellipse > 0 and set(plane) <= set(rows):
        _velocity(ax, mechanism, q, P, [rows.index(row) for row in plane], ellipse)
    ax.set_aspect("equal")
    ax.margins(0.1)
    if plane != [0, 1]:
        ax.set(**{f"{x}label": f"{'xyz'[k]} [m]" for x, k in zip("xy", plane, strict=True)})
    return ax


def _velocity(
    ax: Axes, mechanism: Mechanism, q: Array, P: Array, plane: list[int], scale: float
) -> None:
    state = mechanism_at(mechanism, q)
    if state.velocity is None:
        free = state.uncontrolled[plane, 0] * scale
        free = free / max(float(np.linalg.norm(free)), 1e-12) * 1.4 * scale
        ends = np.array([P - free, P + free])
        ax.plot(*ends.T, alpha=0)  # so that the arrows fit
        arrow = {"arrowstyle": "-|>", "color": TYPE_2, "lw": 2}
        for end in ends[::-1]:
            ax.annotate("", tuple(end), tuple(P), arrowprops=arrow, zorder=6)
        return
    U, sigma, _ = np.linalg.svd(state.velocity[plane])
    t = np.linspace(0, 2 * np.pi, 181)
    shown = np.minimum(np.pad(sigma, (0, 2 - len(sigma))), 4.0) * scale
    curve = P[:, None] + U @ (shown[:, None] * np.stack([np.cos(t), np.sin(t)]))
    ax.plot(*curve, color=TYPE_1, lw=1.6, zorder=4)
    ax.fill(*curve, color=TYPE_1, alpha=0.12, zorder=1)


def is_left(mechanism: Mechanism, dyad: Dyad) -> bool:
    """Return True if assembly mode + (home's) has the pin to the left of B1 -> B2."""
    inputs = home(mechanism)[list(mechanism.actuated)]
    return assembly_sign(mechanism, dyad.configuration(inputs, True)) == "+"


def _isolated(mechanism: Mechanism, dyad: Dyad) -> list[tuple[str, Array]]:
    """Kind and inputs of the loci that are single points."""
    forms: LoopForms | None = loop_forms(mechanism)
    loci = () if forms is None else forms.loci
    out = [(x.kind, x.witness.inputs) for x in loci if x.points_only and x.witness]
    # Mirrored about the line of the pivots it is another, or itself where all is in line.
    axis = np.angle(dyad.pivots[1] - dyad.pivots[0])
    turns = 2 * dyad.senses * (axis - np.angle(dyad.arms))
    turn = turns[[dyad.cranks.tolist().index(j) for j in mechanism.actuated]]
    return [*out, *((kind, (turn - p + np.pi) % (2 * np.pi) - np.pi) for kind, p in out)]


def once(ax: Axes, label: str) -> str | None:
    """A label for the legend, unless something in the axes has it."""
    return None if label in ax.get_legend_handles_labels()[1] else label


def zero_line(
    ax: Axes, x: Array, y: Array, value: Array, color: str, style: str, said: str
) -> None:
    """Draw where a grid of values, NaN where there is none, changes its sign, and what it says."""
    there = value[np.isfinite(value)]
    if len(there) and there.min() < 0 < there.max():
        shown = np.ma.masked_invalid(value)
        ax.contour(x, y, shown, levels=[0.0], colors=[color], linestyles=[style], linewidths=1.5)
        ax.plot([], [], color=color, ls=style, label=once(ax, said))


def joint_points(mechanism: Mechanism, q: Array) -> Array:
    """Origins (k, 3) of all joints, of the frames that close loops, and of the output."""
    return np.concatenate([p for _, p, _ in bodies(mechanism, q)])


def drawing_plane(mechanism: Mechanism) -> tuple[int, int] | None:
    """Return axes (0, 1, 2) of the base across and up for a planar mechanism; else None."""
    plane = plane_axes(mechanism)
    across = np.zeros(3) if plane is None else np.abs(plane[0][2])
    drawn = ((1, 2), (0, 2), (0, 1))[int(np.argmax(across))]
    return drawn if across.max() >= 1 - 1e-6 else None


def _draw_links(mechanism: Mechanism, q: Array, ax: Any, shown: list[int]) -> None:
    """Draw links into plane axes, two of the base's, or 3D ones: what is driven in blue."""
    flat, driven, links = len(shown) == 2, driven_bodies(mechanism), bodies(mechanism, q)
    for body, points, output in links[1:] if flat else links:  # the first is the base
        corners = points[[group[0] for group in groups(points, ROUNDING)]][:, shown]
        color = _DRIVEN if body in driven else _LINK
        if len(corners) > 2 and flat:
            ax.fill(*_around(corners).T, facecolor=_PLATE, edgecolor=color, lw=3.2, zorder=2)
        elif len(corners) > 2:
            face = _GROUND if body == 0 else _PLATE
            plate = Poly3DCollection(
                [_around(corners)], facecolor=face, edgecolor=_NODE, alpha=0.75, linewidths=1.2
            )
            ax.add_collection3d(plate)
        elif body > 0:
            ax.plot(*corners.T, color=color, lw=3.2 if flat else 2.6, solid_capstyle="round")
        else:
            ax.plot(*corners.T, color=_NODE, lw=1.0, ls=":")
        ax.plot(*corners.T, ls="", marker="o", color=_NODE, ms=4 if flat else 3, zorder=3)
        if flat and mechanism.model.parents[body] == 0:
            ax.plot(*corners[0], "s", color=_NODE, ms=7, zorder=3)
        if output is not None:
            if len(corners) > 2:
                ax.plot(*np.array([corners.mean(axis=0), output[shown]]).T, color=color, lw=1.3)
            ax.plot(*output[shown, None], "o", color=_OUTPUT, ms=7 if flat else 5, zorder=5)


def driven_bodies(mechanism: Mechanism) -> set[int]:
    """Bodies (joints of the model) that actuators move: a slide lengthens both its links."""
    parents = mechanism.model.parents
    return {
        body
        for j in mechanism.actuated
        for body in ([j + 1, int(parents[j + 1])] if mechanism.prismatic[j] else [j + 1])
    }


def bodies(mechanism: Mechanism, q: Array) -> list[tuple[int, Array, Array | None]]:
    """Each body with the points (k, 3) where it holds others, and the output if it bears it."""
    sample, parents = Sample(mechanism, q), list(mechanism.model.parents)
    frames = mechanism.model.frames
    ends = [
        (frames[k].parentJoint, np.array(sample.frames[k].translation))
        for k in chain(*closing(mechanism))
    ]
    places = sample.origins
    if np.abs(places - places[0]).max() <= ROUNDING:
        # All joints in one point: each is drawn out on its axis.
        away = max((float(np.linalg.norm(p - places[0])) for _, p in ends), default=0.0)
        places = places + (away or mechanism.length_scale) * sample.axis
    out = []
    for body in range(mechanism.n + 1):
        points = [places[j] for j in range(mechanism.n) if body in (j + 1, parents[j + 1])]
        points += [p for k, p in ends if k == body]
        here = np.array(sample.output.translation)
        bears = frames[mechanism.output_id].parentJoint == body
        if bears and len(points) < 3:  # the link goes to it
            points.append(here)
        if points:
            out.append((body, np.array(points), here if bears else None))
    return out


def _around(points: Array) -> Array:
    """Points in the order of a walk round their middle, in the plane that suits them best."""
    rest = points - points.mean(axis=0)
    _, _, Vt = np.linalg.svd(rest)
    flat = rest @ Vt[:2].T
    return np.asarray(points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))])


PLUS = "#3c7a4b"
MINUS = "#b8772c"
_PARTS = [
    (PLUS, "assembly +, as at home", "+"), (MINUS, "assembly −", "-"), ("#41719c", "poses", "0"),
]  # fmt: skip


def motion_curve(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    degrees: bool = True,
) -> Axes:
    """Draw all the poses of a mechanism with one degree of freedom, as a curve.

    Green is the assembly mode of home, brown the others; what is singular is marked. ``over`` are
    two of the input and x, y, z, roll, pitch, yaw of the output; by default the input and what
    moves most.
    """
    freedoms = ranks(mechanism).mobility
    OptionError.refuse_if(
        freedoms != 1, f"{mechanism.name} has {freedoms} degrees of freedom: its poses are no curve"
    )
    known = _coordinates(mechanism)
    names = ["yaw" if n in ("phi", "φ") else n for n in over or ()]
    OptionError.refuse_if(
        over is not None
        and (len(names) != 2 or names[0] == names[1] or not set(names) <= set(known)),
        f"a curve of poses goes over two of {', '.join(known)}; got {', '.join(over or ())}",
    )
    names = names or [mechanism.inputs[0], COORDINATES[led_pose(mechanism)["rows"][0]]]
    found = curves(mechanism, home(mechanism)[list(mechanism.actuated)], 0)
    points = find_singular(mechanism, found)
    turn = np.array(
        [(360.0 if degrees else 2 * np.pi) if _turns(mechanism, n) else np.inf for n in names]
    )
    told = [(t.q, _values(mechanism, t.q, names, degrees)) for t in found]
    for k, name in enumerate(names):
        OptionError.refuse_if(
            max((float(np.ptp(v[:, k])) for _, v in told), default=0.0) <= ROUNDING,
            f"{mechanism.name}: {name} does not move; take two of {', '.join(known)}",
        )
    # Angles are shown about the middle of a curve, if it is less than a whole turn.
    low, high = told[0][1].min(axis=0), told[0][1].max(axis=0)
    centre = np.where(np.isfinite(turn) & (high - low < turn), (low + high) / 2, 0.0)
    _, ax = plt.subplots(figsize=(6, 5))
    signs = [_signs(mechanism, q) for q, _ in told]
    part = any({"+", "-"} <= set(x) for x in signs)
    for number, ((_, values), sign) in enumerate(zip(told, signs, strict=True)):
        pieces = [(MINUS, "other assembly modes", "+-0?")]
        if number == 0:
            pieces = [(PLUS, "the curve of home", "+-0?")]
        for color, label, which in _PARTS if part else pieces:
            there = np.isin(sign, list(which))
            there[1:] |= there[:-1]  # up to where the next piece begins
            if there.any():
                piece = _broken(np.where(there[:, None], values, np.nan), turn, centre)
                ax.plot(*piece.T, color=color, lw=1.8, label=once(ax, label))
    for point in points:
        place = _folded(_values(mechanism, point.q[None], names, degrees), turn, centre)[0]
        color = TYPE_1 if point.kind == "type 1" else TYPE_2
        ax.plot(*place, "o", color=color, ms=6, zorder=4, ls="", label=once(ax, point.kind))
    for axis, name in zip((ax.xaxis, ax.yaxis), names, strict=True):
        turned = "°" if degrees else "rad"
        axis.set_label_text(f"{name} [{turned if _turns(mechanism, name) else 'm'}]")
    if all(name in COORDINATES[:3] for name in names):
        ax.set_aspect("equal", adjustable="datalim")
    map_legend(ax, 0.13)
    ax.set_title(f"{mechanism.name}: every pose of the output", fontsize=10)
    return ax


def _values(mechanism: Mechanism, q: Array, names: Sequence[str], degrees: bool) -> Array:
    """Coordinates (N, k) of these names along configurations (N, n), angles without jumps."""
    R, p, _ = BatchLoops(mechanism).output(q)
    angles = np.unwrap(np.array([pin.rpy.matrixToRpy(M) for M in R]), axis=0)
    every = np.concatenate([q[:, list(mechanism.actuated)], p, angles], axis=1)
    unit = [180 / np.pi if degrees and _turns(mechanism, name) else 1.0 for name in names]
    return np.asarray(every[:, [_coordinates(mechanism).index(name) for name in names]] * unit)


def _coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the inputs, then of the output's coordinates."""
    return (*mechanism.inputs, *COORDINATES)


def _turns(mechanism: Mechanism, name: str) -> bool:
    slides = dict(zip(mechanism.joints, mechanism.prismatic.tolist(), strict=True))
    return not slides[name] if name in mechanism.inputs else name in COORDINATES[3:]


def _folded(values: Array, turn: Array, centre: Array) -> Array:
    """Values (..., 2), angles within half a turn of the centre."""
    whole = np.where(np.isfinite(turn), turn, 1.0)
    folded = values - whole * np.round((values - centre) / whole)
    return np.asarray(np.where(np.isfinite(turn), folded, values))


def _broken(values: Array, turn: Array, centre: Array) -> Array:
    """The same as a line that ends where an angle begins anew."""
    out = _folded(values, turn, centre)
    jumps = np.flatnonzero((np.abs(np.diff(out, axis=0)) > turn / 2).any(axis=1)) + 1
    return np.insert(out, jumps, np.nan, axis=0)


def _signs(mechanism: Mechanism, Q: Array) -> NDArray[np.str_]:
    """Assembly signs (N,) along configurations (N, n); a zero goes with what is before."""
    signs = np.array([assembly_sign(mechanism, q) for q in Q])
    return signs[np.maximum.accumulate(np.where(signs == "0", 0, np.arange(len(signs))))]


_MOST = 16
_ROW = 4
_SMALL = 7.5


def mode_sheet(
    mechanism: Mechanism,
    inputs: ArrayLike | None = None,
    degrees: bool = True,
    found: Sequence[tuple[str, Sequence[Solution]]] = (),
) -> Figure:
    """Draw every mode that was found: first the direct problem, then the inverse one."""
    # Assembly modes are those at ``inputs``; working modes those of the pose that the first of them
    # has; ``found`` are the statement and modes of each, where they are at hand. Each picture has
    # its number in the text of ``analyze --loops``.
    if not found:
        direct = assembly_modes(mechanism, inputs)
        OptionError.refuse_if(
            not direct.modes, f"{mechanism.name}: there is no mode to draw: {direct.statement}"
        )
        q = home(mechanism) if inputs is None else direct.modes[0].q
        found, generic = [(direct.statement, direct.modes)], ranks(mechanism)
        if generic.output >= generic.mobility:
            inverse = working_modes(mechanism, output_pose(mechanism, q).homogeneous)
            found.append((inverse.statement, inverse.modes))
    plane = drawing_plane(mechanism)
    told = (("At these inputs", free_coordinates(mechanism)), ("At this pose", mechanism.inputs))
    parts = [
        (f"{title}: {said}", names, modes, looks_apart(mechanism, modes))
        for (title, names), (said, modes) in zip(told, found, strict=False)
        if modes
    ]
    rows = [-(-len(which) // _ROW) for *_, which in parts]
    columns = min(_ROW, max(len(which) for *_, which in parts))
    figure = plt.figure(
        figsize=(max(2.7 * columns, 5.4), 2.95 * sum(rows) + 0.5 * len(parts)),
        layout=ConstrainedLayoutEngine(h_pad=0.1),  # keeps headings of two lines apart
    )
    blocks = figure.subfigures(len(parts), 1, height_ratios=rows, squeeze=False)[:, 0]
    box = _box(mechanism, [modes[k].q for _, _, modes, which in parts for k in which])
    for block, (heading, names, modes, which), count in zip(blocks, parts, rows, strict=True):
        those = "it" if len(which) == 1 else "these"
        if len(which) == _MOST < len(modes):
            heading += f". The first {_MOST} that look different are drawn"
        elif len(which) < len(modes):
            heading += f". Drawn: {len(which)}; the others look like {those}, legs turned round"
        block.suptitle(_wrapped(heading, columns), fontsize=9)
        for place, k in enumerate(which, 1):
            mode = modes[k]
            ax = block.add_subplot(count, columns, place, **({} if plane else {"projection": "3d"}))
            _draw(mechanism, mode.q, ax, plane, box)
            ways = f"; {mode.ways} ways" if mode.ways > 1 else ""
            words = _wrapped(_words(mechanism, mode, names, degrees), 1)
            ax.set_title(f"{k + 1}: {mode.mode}{ways}\n{words}", fontsize=_SMALL)
    return figure


def looks_apart(mechanism: Mechanism, modes: Sequence[Solution], most: int = _MOST) -> list[int]:
    """Places of modes that look different: legs that are turned round look as they did."""
    # Of those that look alike the one whose legs are not turned round.
    turned = [int((mode.q[mechanism.prismatic] < 0).sum()) for mode in modes]
    order = np.argsort(turned, kind="stable").tolist()
    alike = groups((joint_points(mechanism, modes[k].q) for k in order), 1e-6)
    return sorted(order[group[0]] for group in alike[:most])


def _draw(
    mechanism: Mechanism, q: Array, ax: Any, plane: tuple[int, int] | None, box: Array
) -> None:
    if plane:
        draw_linkage(mechanism, q, ax, ellipse=0)
        ax.set(xlim=box[:, plane[0]], ylim=box[:, plane[1]])
        ax.tick_params(labelsize=_SMALL - 1)
        for axis in (ax.xaxis, ax.yaxis):
            axis.label.set_fontsize(_SMALL)
        return
    _draw_links(mechanism, q, ax, [0, 1, 2])
    ax.set(**{f"{letter}lim": ends for letter, ends in zip("xyz", box.T, strict=True)})
    ax.set(xticklabels=[], yticklabels=[], zticklabels=[])
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


def _words(mechanism: Mechanism, mode: Solution, names: Sequence[str], degrees: bool) -> str:
    """Values of the inputs or coordinates of these names."""
    said = []
    for name, at in zip(names, _values(mechanism, mode.q[None], names, degrees)[0], strict=True):
        turns = _turns(mechanism, name)
        value = f"{round(float(at), 2) + 0.0:.2f}" + " rad" * turns
        if turns and degrees:
            value = f"{round(float(at)) + 0:d}°"
        said.append(unbroken(f"{name} {value}"))
    return ", ".join(said)


def _wrapped(words: str, columns: int) -> str:
    return "\n".join(textwrap.wrap(words, 40 * columns + (0 if columns > 1 else 2)))


_SAMPLES = 161
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
    key = np.where(inside, 0, -1)
    for k, left in enumerate(left_sides):
        key += (inside & (left > 0)).astype(int) << k
    cells, key = np.arange(key.size).reshape(key.shape), key.ravel()
    across, along = (cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])
    # Regions that meet across a whole turn are one.
    ends = (cells[:, 0], cells[:, -1]), (cells[0], cells[-1])
    beside = [across, along, *(pair for pair, on in zip(ends, turns, strict=True) if on)]
    one, two = (np.concatenate([pair[k].ravel() for pair in beside]) for k in (0, 1))
    alike = key[one] == key[two]
    label = connected(len(key), one[alike], two[alike]).reshape(inside.shape)
    found, sizes = np.unique(label, return_counts=True)
    signs = key[found]
    order = np.lexsort((found, signs, -sizes)).tolist()
    kept = [k for k in order if signs[k] >= 0 and sizes[k] >= LEAST]
    out = np.zeros(inside.shape, dtype=int)
    for number, k in enumerate(kept, 1):
        out[label == found[k]] = number
    return out, [(len(left_sides) - int(signs[k]).bit_count()) % 2 == 0 for k in kept]


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


def pose_maps(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    degrees: bool = True,
    start: Array | None = None,
) -> Figure:
    """Draw a slice through the loci: two coordinates of the pose vary, the others stay.

    Coloured is where the mechanism gets to within the limits of all its joints, each aspect in a
    colour of its own, side by side for every working mode at the pose of home. Green and blue
    aspects are of the assembly mode of home, warm ones of the other. Lines are the loci, from their
    exact equations. ``start`` (n,), closed, takes the place of home.
    """
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
    names = tuple(over) if over is not None else free_coordinates(mechanism)[:2]
    modes = _modes(mechanism, names, start)
    shown = modes[:8]
    count = round(_SAMPLES / len(shown) ** (1 / 3)) | 1  # odd: home is one of the points
    found = pose_slice(mechanism, names, [q for _, q in shown], count)
    drawn = panels(mechanism, found, [title for title, _ in shown])
    alone = len(shown) == 1
    columns = 1 if alone else 2 if len(shown) <= 4 else 4
    rows = -(-len(shown) // columns)
    height = 3.25
    if all(COORDINATES.index(name) < 3 for name in found.names):  # with room for its title
        height *= min(1.0, 0.85 * float(np.ptp(found.y) / np.ptp(found.x)) + 0.2)
    figure, grid = plt.subplots(
        rows, columns, figsize=(6, 5.4) if alone else (3.3 * columns, height * rows + 0.9),
        squeeze=False, sharex=True, sharey=True, layout="constrained",
    )  # fmt: skip
    for panel, ax in zip_longest(drawn, grid.ravel()):
        if panel is None:
            ax.axis("off")
            continue
        _draw_slice(ax, mechanism, found, panel, degrees, alone)
        count = len(panel.positive)
        told = f"{count} aspect{'s' * (count != 1)}"
        ax.set_title(
            f"{panel.title}: {'every pose singular' if panel.everywhere else told}", fontsize=9
        )
        ax.label_outer()
    what = "every pose is singular" if _everywhere(mechanism) else "aspects of the workspace"
    if alone:
        what = "every pose of this slice is singular" if drawn[0].everywhere else what
        grid[0, 0].set_title(f"{mechanism.name}: {what}", fontsize=10)
    else:
        more = "" if len(modes) == len(shown) else f" ({len(shown)} of {len(modes)})"
        figure.suptitle(f"{mechanism.name}: {what}, by working mode{more}", fontsize=11)
    legend_of_all(figure.axes, 2 if alone else 3)
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
        # Left sides, whose factors have unit length, of loci that are zero all over the slice: what
        # is left of them is rounding.
        lost = [
            kind != "passive" and reached.any() and float(np.nanmax(np.abs(v))) <= 1e-10
            for kind, v in lefts
        ]
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


def _modes(
    mechanism: Mechanism, over: Sequence[str], start: Array | None
) -> list[tuple[str, Array]]:
    """Return working modes at one pose that look different, by name, the start's first."""
    # Of an output that keeps its axes those where it is turned belong to another slice.
    q = home(mechanism) if start is None else start
    place = output_pose(mechanism, q)
    found = list(working_modes(mechanism, place.homogeneous).modes)
    if PoseWay(mechanism, over, q).keep_turn([q]):
        found = [
            mode
            for mode in found
            if np.abs(output_pose(mechanism, mode.q).rotation - place.rotation).max() <= ALIKE
        ]
    kept = [found[k].q for k in looks_apart(mechanism, found, len(found) or 1)]
    mark = likeness(mechanism, q[None])
    cloud = joint_points(mechanism, q)
    others = [
        x
        for x in kept
        # Legs that are turned round look as they did.
        if not same(mark, likeness(mechanism, x[None]))
        and np.abs(cloud - joint_points(mechanism, x)).max() > ALIKE
    ]
    signs = ["".join(mode_at(mechanism, x).elbows) for x in (q, *others)]
    names = [f"elbows {x}" if x else "working mode" for x in signs]
    at_home = same(mark, likeness(mechanism, home(mechanism)[None]))
    numbers = [f" {names[: k + 1].count(x)}" * (names.count(x) > 1) for k, x in enumerate(names)]
    ends = [" (home)" * at_home, *[""] * len(others)]
    titles = ["".join(parts) for parts in zip(names, numbers, ends, strict=True)]
    return list(zip(titles, (q, *others), strict=True))


def _everywhere(mechanism: Mechanism) -> bool:
    """Return True if every pose is of type 2: there are no lines then, only rounding."""
    forms = pose_forms(mechanism)
    always = forms is not None and bool(forms.architecture)
    return always or "type 2" in joint_forms(mechanism).always


def _of_home(mechanism: Mechanism, Q: Array, there: Bool, sign: bool) -> bool:
    """Return True if a region is of the assembly mode of home, or of the equation's sign."""
    from scipy.ndimage import distance_transform_edt

    deepest = np.unravel_index(int(np.argmax(distance_transform_edt(there))), there.shape)
    told = assembly_sign(mechanism, Q[deepest])
    return told == "+" if told in "+-" else sign


def _draw_slice(
    ax: Axes, mechanism: Mechanism, found: PoseSlice, panel: Panel, degrees: bool, alone: bool
) -> None:
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
        said = "every pose singular" * panel.everywhere
        if _everywhere(mechanism):
            said = "reached; singular everywhere"
        _name_aspects(ax, panel.positive, shades, alone, said)
    # Where the loops close no further is type 1, where there is such a locus.
    bounds, color = "the loops close no further", LIMIT
    if any(x.kind == "type 1" for x in joint_forms(mechanism).loci):
        bounds, color = f"type 1: {bounds}", TYPE_1
    if panel.reached.any() and int((~panel.reached).sum()) >= LEAST:
        ones = [left for kind, left in panel.lefts if kind == "type 1"]
        if ones:
            edge, level = np.ma.masked_invalid(border_field(panel.reached, ones)), 0.0
        else:
            # Cells over which the border of what was reached is smoothed.
            edge, level = gaussian_filter(panel.reached.astype(float), 0.9), 0.5
        ax.contour(x, y, edge, levels=[level], colors=[color], linewidths=1.2)
        ax.plot([], [], color=color, label=bounds)
    zero_line(ax, x, y, panel.margin, LIMIT, "--", "limit of a joint")
    lines = {
        "passive": (PASSIVE, ":", "passive joints dependent"), "type 1": (TYPE_1, "-", bounds)
    }  # fmt: skip
    for kind, left in panel.lefts:
        zero_line(ax, x, y, left, *lines.get(kind, (TYPE_2, "-", "type 2")))
    for axis, name, row in zip((ax.xaxis, ax.yaxis), found.names, rows, strict=True):
        axis.set_label_text(f"{name} [{'m' if row < 3 else '°' if degrees else 'rad'}]")
    if max(rows) < 3:
        ax.set_aspect("equal")


def border_field(reached: Bool, ones: Sequence[Array]) -> Array:
    """Return, over the grid (ny, nx), what is zero where the loops close no further, else NaN.

    The left side of type 1 goes to zero there as the root of the distance does: its square, which
    is known inside, goes on in a straight line to the cells outside. Where it does not go to zero
    the border is half way between the cells.
    """
    from scipy.ndimage import distance_transform_edt

    squares = np.array([np.square(v) / max(float(np.nanmax(v * v)), 1e-300) for v in ones])
    squares[:, ~reached] = np.nan
    # Of each cell the nearest that is reached, and the one behind that.
    away, near = distance_transform_edt(~reached, return_indices=True)
    behind = np.clip(2 * near - np.indices(reached.shape), -1, np.reshape(reached.shape, (2, 1, 1)))
    padded = np.pad(squares, ((0, 0), (1, 1), (1, 1)), constant_values=np.nan)
    first, second = squares[:, near[0], near[1]], padded[:, behind[0] + 1, behind[1] + 1]
    last, on = first.min(axis=0), (2 * first - second).min(axis=0)
    # What bends downwards is led a little too high.
    on = np.where((on >= 0) & (on < last / 2), -1e-6 * last, on)
    outside = np.where(away < 1.5, np.where(on < 0, on, -last), np.nan)
    return np.where(reached, last, outside)


def _name_aspects(
    ax: Axes, positive: Sequence[bool], shades: Sequence[str], alone: bool, said: str
) -> None:
    """Say what the colours of aspects are: each of a single picture, of several those of a sign."""
    for number, (sign, shade) in enumerate(zip(positive, shades, strict=True), 1):
        label = f"aspects of assembly {'+, as at home' if sign else '−'}"
        if alone and number <= _MOST_NAMED:
            label = f"aspect {number}: assembly {'+' if sign else '−'}"
        elif alone:
            shade, label = "none", f"and {len(positive) - _MOST_NAMED} more"
        ax.fill([], [], color=shade, label=once(ax, said or label))
