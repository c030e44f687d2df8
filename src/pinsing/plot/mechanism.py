"""Plots of mechanisms: the map over the inputs, measures along a curve, the linkage itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array, Bool
from pinsing.errors import OptionError
from pinsing.loops.dyad import Dyad, planar_dyad
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.loop_forms import LoopForms, loop_forms
from pinsing.loops.modes import assembly_sign, home
from pinsing.loops.motion import mechanism_at
from pinsing.loops.singular_points import SingularPoint
from pinsing.loops.structure import output_pose, plane_axes
from pinsing.loops.trace import Trace
from pinsing.plot.style import pi_ticks, plain, unit
from pinsing.robot.joints import joint_axis
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TYPE_1 = "#c0392b"
TYPE_2 = "#1f5fa8"
_FEASIBLE = "#eef3e6"
_LINKS = ("#41719c", "#8a9ba8")
_STYLES = ("-", "--", "-.", ":")


def input_map(
    mechanism: Mechanism,
    assembly: str = "+",
    ax: Axes | None = None,
    samples: int = 721,
    ranges: tuple[tuple[float, float], tuple[float, float]] = ((-np.pi, np.pi), (-np.pi, np.pi)),
    degrees: bool = True,
) -> Axes:
    """Map over the two inputs of a 5R: where it closes, and its type 1 and type 2 loci.

    Parameters
    ----------
    mechanism : Mechanism
        With two inputs and a planar dyad.
    assembly : str
        Assembly mode, ``+`` (as at home) or ``-``.
    ax : Axes, optional
        Axes to draw into.
    samples : int
        Grid points a side.
    ranges : pair of (low, high)
        Of the inputs, radians.
    degrees : bool
        Draw over degrees, or over radians.

    Raises
    ------
    OptionError
        If the mechanism is another kind, or the mode has another name.
    """
    dyad = planar_dyad(mechanism)
    if dyad is None or len(mechanism.inputs) != 2:
        raise OptionError("a map over the inputs needs a planar loop with two cranks (5R)")
    if assembly not in ("+", "-"):
        raise OptionError(f"assembly mode must be + or -, got {assembly!r}")
    ax = _axes(ax)
    left = is_left(mechanism, dyad) == (assembly == "+")
    x, y = (np.linspace(*r, samples) for r in ranges)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    q = dyad.configuration(grid, left)
    closed = np.asarray(np.isfinite(q).all(axis=-1))
    d = np.degrees if degrees else np.asarray
    ax.contourf(d(x), d(y), closed.astype(float), levels=[0.5, 1.5], colors=[_FEASIBLE])
    gap = np.subtract(*dyad.ends(grid))
    distance = np.linalg.norm(gap, axis=-1)
    one, two = (side.rod_length for side in dyad.sides)
    for reach, style in ((one + two, "-"), (abs(one - two), "--")):
        if reach > 0:
            zero_line(ax, d(x), d(y), distance - reach, TYPE_2, style)
    for kind, inputs in _isolated(mechanism, dyad):
        color = TYPE_2 if kind == "type 2" else TYPE_1
        ax.plot(*d(inputs), "o", color=color, ms=5, mfc="white", zorder=4)
    for value, style in _type_1(mechanism, dyad, q, closed):
        zero_line(ax, d(x), d(y), value, TYPE_1, style)
    for axis, name, (low, high) in zip((ax.xaxis, ax.yaxis), mechanism.inputs, ranges, strict=True):
        axis.set_label_text(f"{plain(name)} [{unit(False, degrees)}]")
        if not degrees:
            pi_ticks(axis, low, high)
    ax.set_title(f"assembly {assembly}")
    ax.set_aspect("equal")
    return ax


def _type_1(
    mechanism: Mechanism, dyad: Dyad, q: Array, closed: Bool
) -> Iterator[tuple[Array, str]]:
    """Left sides of type 1 over the grid, NaN where the loops do not close, with their strokes.

    Of an output that is the pin: of each leg, stretched and folded. Of another one the equations in
    the joint angles.
    """
    if not dyad.at_pin(mechanism):
        forms = joint_forms(mechanism)
        for k, locus in enumerate(forms.loci):
            if locus.kind == "type 1":
                value = np.full(closed.shape, np.nan)
                value[closed] = forms.values(q[closed])[:, k]
                yield value, "-"
        return
    for leg in (0, 1):
        crank, rod = dyad.link_directions(q, leg)
        straight = (crank * rod).sum(axis=-1) > 0
        sine = dyad.elbow_sine(q, leg)
        for stretched, style in ((True, "-"), (False, "--")):
            yield np.where(closed & (straight == stretched), sine, np.nan), style


def map_legend(ax: Axes, mechanism: Mechanism | None = None) -> None:
    """Say what the lines of ``input_map`` are: of this mechanism, or of one led at its pin."""
    dyad = None if mechanism is None else planar_dyad(mechanism)
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(color=_FEASIBLE, label="loops close"),
        Line2D([], [], color=TYPE_2, label="type 2: B1, P, B2 in line"),
        Line2D([], [], color=TYPE_2, marker="o", mfc="white", ls="", label="type 2: B1 = B2"),
    ]
    if mechanism is None or dyad is None or dyad.at_pin(mechanism):
        handles += [
            Line2D([], [], color=TYPE_1, label="type 1: a leg stretched"),
            Line2D([], [], color=TYPE_1, ls="--", label="type 1: a leg folded"),
        ]
    else:
        handles.append(Line2D([], [], color=TYPE_1, label="type 1: the output loses a direction"))
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=8)


def measure_curves(
    mechanism: Mechanism,
    traces: Sequence[Trace],
    points: Sequence[SingularPoint] = (),
    ax: Axes | None = None,
    degrees: bool = True,
) -> Axes:
    """Type 1 and type 2 measures along solution curves, over the moving input.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    traces : sequence of Trace
        From ``curves``.
    points : sequence of SingularPoint
        Marked where they lie on the curves.
    ax : Axes, optional
        Axes to draw into.
    degrees : bool
        Draw angles in degrees, or in radians.
    """
    ax = _axes(ax)
    for t, style in zip(traces, _STYLES * len(traces), strict=False):
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
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    return ax


def draw_linkage(
    mechanism: Mechanism,
    q: npt.ArrayLike,
    ax: Axes | None = None,
    ellipse: float = 0.25,
    color: str | None = None,
) -> Axes:
    """The links of a planar mechanism, its joints, and the velocity ellipse of the output.

    Parameters
    ----------
    q : (n,) array_like
        Closed configuration, radians and metres.
    ellipse : float
        Metres that 1 m per unit input speed is drawn as; 0 leaves the ellipse out. At a type 2
        singularity the uncontrolled velocity is drawn as an arrow instead.
    color : str, optional
        Of the links.
    """
    ax = _axes(ax)
    model = mechanism.model
    q = mechanism.check(q)
    across, up = drawing_plane(mechanism) or (0, 1)
    plane = [across, up]
    driven = {j for j in range(1, model.njoints) if model.parents[j] == 0}
    for body, points, output in bodies(mechanism, q):
        if body == 0:
            continue
        shade = color or _LINKS[int(body not in driven)]
        ends = distinct(points)[:, plane]
        if len(ends) > 2:
            around = np.arctan2(*(ends - ends.mean(axis=0)).T[::-1])
            ax.fill(
                *ends[np.argsort(around)].T, facecolor="#e9d5d6", edgecolor=shade, lw=3.2, zorder=2
            )
        else:
            ax.plot(*ends.T, color=shade, lw=3.2, zorder=2)
        ax.plot(*ends.T, "o", color="#37424d", ms=4, zorder=3)
        first = body in driven
        ax.plot(
            *points[0, plane],
            "s" if first else "o",
            color="#37424d",
            ms=7 if first else 5,
            zorder=3,
        )
        if output is not None:
            stem = np.array([ends.mean(axis=0), output[plane]])
            if len(ends) > 2:
                ax.plot(*stem.T, color=shade, lw=1.4, zorder=2)
    P = np.array(output_pose(mechanism, q).translation)[plane]
    ax.plot(*P, "o", color="#cc333d", ms=7, zorder=5)
    rows = list(mechanism.task.rows)
    if ellipse > 0 and {across, up} <= set(rows):
        _velocity(ax, mechanism, q, P, [rows.index(across), rows.index(up)], ellipse)
    ax.set_aspect("equal")
    ax.margins(0.1)
    if plane != [0, 1]:
        ax.set_xlabel(f"{'xyz'[across]} [m]")
        ax.set_ylabel(f"{'xyz'[up]} [m]")
    return ax


def _velocity(
    ax: Axes, mechanism: Mechanism, q: Array, P: Array, plane: list[int], scale: float
) -> None:
    state = mechanism_at(mechanism, q)
    if state.velocity is None:
        free = state.uncontrolled[plane, 0] * scale
        free = free / max(float(np.linalg.norm(free)), 1e-12) * 1.4 * scale
        ax.plot(*np.stack([P - free, P + free], axis=1), alpha=0)  # so that the arrows fit
        for sign in (1, -1):
            ax.annotate(
                "",
                tuple(P + sign * free),
                tuple(P),
                arrowprops={"arrowstyle": "-|>", "color": TYPE_2, "lw": 2},
                zorder=6,
            )
        return
    U, sigma, _ = np.linalg.svd(state.velocity[plane])
    t = np.linspace(0, 2 * np.pi, 181)
    size = np.zeros(2)
    size[: len(sigma)] = sigma
    shown = np.minimum(size, 4.0) * scale
    curve = P[:, None] + U @ (shown[:, None] * np.stack([np.cos(t), np.sin(t)]))
    ax.plot(*curve, color=TYPE_1, lw=1.6, zorder=4)
    ax.fill(*curve, color=TYPE_1, alpha=0.12, zorder=1)


def is_left(mechanism: Mechanism, dyad: Dyad) -> bool:
    """Whether assembly mode + (home's) has the pin to the left of B1 -> B2."""
    inputs = home(mechanism)[list(mechanism.actuated)]
    return assembly_sign(mechanism, dyad.configuration(inputs, True)) == "+"


def _isolated(mechanism: Mechanism, dyad: Dyad) -> list[tuple[str, Array]]:
    """Kind and inputs of the loci that are single points."""
    forms: LoopForms | None = loop_forms(mechanism)
    loci = () if forms is None else forms.loci
    out = [(x.kind, x.witness.inputs) for x in loci if x.points_only and x.witness]
    # Mirrored about the line of the pivots it is another, or itself where all is in line.
    gap = dyad.sides[1].pivot - dyad.sides[0].pivot
    axis = float(np.arctan2(gap[1], gap[0]))
    for kind, p in list(out):
        mirrored = np.zeros(2)
        for side in dyad.sides:
            assert side.crank is not None  # two inputs, two cranks
            i = mechanism.actuated.index(side.crank)
            angle = side.crank_sign * p[i] + side.crank_angle
            mirrored[i] = side.crank_sign * (2 * axis - angle - side.crank_angle)
        out.append((kind, (mirrored + np.pi) % (2 * np.pi) - np.pi))
    return out


def crosses_zero(value: Array) -> bool:
    """Return True if a grid of values, NaN aside, has both signs."""
    there = value[np.isfinite(value)]
    return bool(len(there)) and bool(there.min() < 0 < there.max())


def zero_line(ax: Axes, x: Array, y: Array, value: Array, color: str, style: str) -> None:
    """Draw where a grid of values, NaN where there is none, changes its sign."""
    if crosses_zero(value):
        shown = np.ma.masked_invalid(value)
        ax.contour(x, y, shown, levels=[0.0], colors=[color], linestyles=[style], linewidths=1.5)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


_LINK, _DRIVEN, _NODE, _OUTPUT = "#8a9ba8", "#41719c", "#37424d", "#cc333d"
_PLATE, _GROUND = "#e9d5d6", "#e3e7ea"
_FLAT = 1e-9


def joint_points(mechanism: Mechanism, q: Array) -> Array:
    """Origins (k, 3) of all joints, of the frames that close loops, and of the output."""
    return np.concatenate([p for _, p, _ in bodies(mechanism, q)])


def drawing_plane(mechanism: Mechanism) -> tuple[int, int] | None:
    """Axes of the base to draw a planar mechanism over, across and up; None of others.

    0, 1, 2 for x, y, z.
    """
    plane = plane_axes(mechanism)
    if plane is None:
        return None
    found = np.abs(plane[0][2])
    k = int(np.argmax(found))
    if found[k] < 1 - 1e-6:
        return None
    return ((1, 2), (0, 2), (0, 1))[k]


def draw_space_linkage(mechanism: Mechanism, q: Array, ax: Any) -> None:
    """Draw a closed configuration q (n,) into 3D axes: what is driven in blue, the output red."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    driven = {j + 1 for j in mechanism.actuated}
    for body, points, output in bodies(mechanism, q):
        corners = distinct(points)
        color = _DRIVEN if body in driven else _LINK
        if len(corners) > 2:
            face = _GROUND if body == 0 else _PLATE
            plate = Poly3DCollection(
                [_around(corners)], facecolor=face, edgecolor=_NODE, alpha=0.75, linewidths=1.2
            )
            ax.add_collection3d(plate)
        elif len(corners) == 2 and body > 0:
            ax.plot(*corners.T, color=color, lw=2.6, solid_capstyle="round")
        elif len(corners) == 2:
            ax.plot(*corners.T, color=_NODE, lw=1.0, ls=":")
        ax.plot(*corners.T, ls="", marker="o", color=_NODE, ms=3)
        if output is not None:
            if len(corners) > 2:
                ax.plot(*np.array([corners.mean(axis=0), output]).T, color=color, lw=1.2)
            ax.plot(*output[:, None], ls="", marker="o", color=_OUTPUT, ms=5)


def bodies(mechanism: Mechanism, q: Array) -> list[tuple[int, Array, Array | None]]:
    """Each body with the points (k, 3) where it holds others, and the output if it bears it."""
    model, data = mechanism.model, mechanism.model.createData()
    pin.framesForwardKinematics(model, data, mechanism.model_q(q))
    places = _places(mechanism, data)
    closing = {name for loop in mechanism.loops for name in (loop.frame_a, loop.frame_b)}
    output = model.frames[mechanism.output_id]
    out = []
    for body in range(model.njoints):
        points = [] if body == 0 else [places[body]]
        points += [places[j] for j in range(1, model.njoints) if model.parents[j] == body]
        points += [
            data.oMi[body].act(f.placement.translation)
            for f in model.frames
            if f.parentJoint == body and f.name in closing
        ]
        here = None
        if output.parentJoint == body:
            here = np.array(data.oMi[body].act(output.placement.translation))
            if len(points) < 3:  # the link goes to it
                points.append(here)
        if points:
            out.append((body, np.array(points), here))
    return out


def _places(mechanism: Mechanism, data: pin.Data) -> list[Array]:
    """Where each joint is drawn: at its origin; all of them in one point, out on its axis."""
    model = mechanism.model
    origins = [np.array(data.oMi[j].translation) for j in range(model.njoints)]
    middle = origins[1]
    if any(np.linalg.norm(p - middle) > _FLAT for p in origins[1:]):
        return origins
    closing = {name for loop in mechanism.loops for name in (loop.frame_a, loop.frame_b)}
    away = [
        float(np.linalg.norm(data.oMi[f.parentJoint].act(f.placement.translation) - middle))
        for f in model.frames
        if f.name in closing
    ]
    reach = max(away, default=0.0) or mechanism.length_scale
    out = [middle]
    for j in range(1, model.njoints):
        axis = joint_axis(model.joints[j], model.names[j])[0]
        out.append(middle + reach * (data.oMi[j].rotation @ axis))
    return out


def distinct(points: Array) -> Array:
    """Points (k, 3) without those that coincide with earlier ones."""
    kept: list[Array] = []
    for p in points:
        if all(np.linalg.norm(p - other) > _FLAT for other in kept):
            kept.append(p)
    return np.array(kept)


def _around(points: Array) -> Array:
    """Points in the order of a walk round their middle, in the plane that suits them best."""
    rest = points - points.mean(axis=0)
    _, _, Vt = np.linalg.svd(rest)
    flat = rest @ Vt[:2].T
    return np.asarray(points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))])
