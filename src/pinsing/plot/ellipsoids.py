"""Velocity ellipsoids in three dimensions, as in the paper's Figures 12 to 16, or of pure motions.

Translations (m/s) and rotations (rad/s) never share an axis: each has a picture of its own. With
the arm, its joints are drawn too and each ellipsoid sits at the tip, at a scale that is said.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from itertools import product
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from matplotlib import pyplot as plt

from pinsing.errors import OptionError
from pinsing.interface import checked
from pinsing.kinematics.at import REGULAR, State
from pinsing.kinematics.jacobian import SINGULAR_RTOL
from pinsing.kinematics.lost_motion import LostMotion
from pinsing.measures import PRACTICAL, Array, Ellipsoid, pure_by_default, pure_ellipsoids
from pinsing.plot.style import COLORS, COLUMN, SMALL, legend_below, legend_of_all, plain
from pinsing.robot.arm import Arm
from pinsing.robot.models import joint_axis

BONE = "#5b6472"
LOST = "#C4187C"
HOT = "#D55E00"


def draw_skeleton(ax: Any, arm: Arm, q: Array, hot: Sequence[int] = ()) -> tuple[Array, float]:
    """Draw an arm: bones, joints, and the axes that depend on each other (``hot``) thin.

    Returns the points (k, 3) of the base, each joint from there on, and the tip, metres in the
    base; and the largest distance of one from the base.
    """
    model = arm.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, arm.model_q(q))
    names = list(model.names)
    places = [data.oMi[j] for j in model.supports[model.frames[arm.tip_id].parentJoint]]
    # The first is the base.
    points = np.array([place.translation for place in (*places, data.oMf[arm.tip_id])])
    size = float(np.linalg.norm(points - points[0], axis=1).max()) or 1.0
    joints = np.array([data.oMi[names.index(name)].translation for name in arm.joints])
    ax.plot(*points.T, color=BONE, linewidth=3.2, solid_capstyle="round", zorder=2)
    ax.plot(*points[:1].T, "s", color=BONE, markersize=7, zorder=2)
    for slides, marker in ((False, "o"), (True, "D")):
        some = joints[arm.prismatic == slides]
        if len(some):
            ax.plot(*some.T, marker, color="white", markeredgecolor=BONE, markersize=4.5, zorder=3)
    label = "joint axes that depend on each other"
    for i in hot:
        if not arm.prismatic[i]:
            j = names.index(arm.joints[i])
            axis = data.oMi[j].rotation @ joint_axis(model.joints[j], arm.joints[i])[0]
            ends = joints[i] + 0.55 * size * np.array([[-1.0], [1.0]]) * axis
            ax.plot(*ends.T, color=HOT, linewidth=0.9, label=label, zorder=2)
            label = ""
    return points, size


def draw_lost(ax: Any, state: State, size: float) -> None:
    """Draw each lost motion once, with its words in the legend; far ones in words only."""
    # A translation or a motion along a line is a line with arrows at both ends, a rotation has a
    # circle about it, a screw both.
    for lost in state.lost:
        # Lost motions about lines farther from the tip than this, in sizes of the arm,
        # are not drawn
        far = np.linalg.norm(lost.point - state.tip_position) > 1.5 * size
        words = "\n".join(textwrap.wrap(lost.words + " (outside the picture)" * bool(far), 62))
        ends = lost.point + 0.5 * size * np.array([[-1.0], [1.0]]) * lost.direction
        line = np.zeros((3, 0)) if far else ends.T
        ax.plot(*line, color=LOST, linestyle="--", linewidth=1.5, label=words, zorder=5)
        if lost.kind != "rotation" and not far:
            for end, sign in zip(ends, (-1.0, 1.0), strict=True):
                _arrow(ax, end, sign * lost.direction, _across(lost.direction), 0.09 * size)
        if lost.kind in ("rotation", "screw") and not far:
            _turn(ax, lost, 0.2 * size)


def _arrow(ax: Any, end: Array, direction: Array, across: Array, length: float) -> None:
    """Two short lines that meet at the end of a line."""
    for side in (across, -across):
        back = end - length * direction + 0.45 * length * side
        ax.plot(*np.stack([back, end], axis=1), color=LOST, linewidth=1.5, zorder=5)


def _turn(ax: Any, lost: LostMotion, radius: float) -> None:
    """Most of a circle about the direction, with an arrow at its end."""
    x = _across(lost.direction)
    y = np.cross(lost.direction, x)
    t = np.linspace(0.0, 1.6 * np.pi, 60)[:, None]
    circle = lost.point + radius * (np.cos(t) * x + np.sin(t) * y)
    ax.plot(*circle.T, color=LOST, linewidth=1.5, zorder=5)
    heading = (circle[-1] - circle[-2]) / np.linalg.norm(circle[-1] - circle[-2])
    _arrow(ax, circle[-1], heading, (circle[-1] - lost.point) / radius, 0.4 * radius)


def _across(direction: Array) -> Array:
    """A unit vector across a direction (3,)."""
    found = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    return np.asarray(found / np.linalg.norm(found))


def show_whole(ax: Any, points: Array) -> None:
    """Equal scale along all axes, as tight a cube about points (k, 3) as there is."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.52 * float((high - low).max()) or 1.0
    middle = (low + high) / 2
    ax.set(**{f"{x}lim": (m - half, m + half) for x, m in zip("xyz", middle, strict=True)})
    ax.set_box_aspect((1, 1, 1), zoom=0.9)
    ax.tick_params(labelsize=SMALL - 1.5, pad=-1)
    ax.locator_params(nbins=4)


def look_obliquely(ax: Any, normals: Array, bones: Array) -> None:
    """Turn the camera so that what is flat, of ``normals`` (k, 3), is seen from the side."""
    # Of the directions that show the plates so, one that shows the arm, points (m, 3), widest.
    flat = bones - bones.mean(axis=0)
    size = float(np.linalg.norm(flat)) or 1.0

    def score(angles: tuple[float, float]) -> float:
        e, a = np.radians(angles)
        view = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        seen = np.linalg.norm(flat - np.outer(flat @ view, view)) / size
        usual = abs(((angles[1] + 60 + 180) % 360) - 180) / 180  # as plots are, if all is equal
        # Of the angle between the line of sight and the normal of what is flat: 70 degrees
        off = [abs(abs(float(view @ n)) - 0.34) for n in normals]
        return float(seen) - 3.0 * sum(off) / max(len(off), 1) - 0.1 * usual

    elevation, azimuth = max(product((18.0, 28.0), np.arange(-175.0, 185.0, 10.0)), key=score)
    ax.view_init(elev=elevation, azim=azimuth)


KINDS = ("translational", "rotational")
_COLOR = {"translational": COLORS[0], "rotational": COLORS[4]}
_UNIT = {"translational": "m/s", "rotational": "rad/s"}
_WHICH = {
    ("translational", "pure"): "translations, tool orientation held",
    ("rotational", "pure"): "rotations, tip held",
    ("translational", "all"): "translational part of all motions",
    ("rotational", "all"): "rotational part of all motions",
}


@checked
def ellipsoids(
    state: State,
    ax: Any = None,
    *,
    kind: str = "both",
    motions: Literal["pure", "all"] | None = None,
    arm: Arm | None = None,
) -> Any:
    """Draw the velocity ellipsoids of a configuration, at unit joint speed.

    An ellipsoid of zero thickness is drawn as the plate that it is, with the lost motion as a
    dashed line. The title of each picture says which ellipsoid it is.

    Parameters
    ----------
    state : State
        From ``at(arm, q)``.
    ax : 3D axes, optional
        Where to draw; with ``kind`` "both" only together with ``arm``.
    kind : str
        "translational" (m/s), "rotational" (rad/s) or "both", side by side.
    motions : str, optional
        "all": the three rows of J at unit joint speed, as in the paper's Eqs. (15), (16).
        "pure": translations while the tool keeps its orientation, and rotations about a tip that
        rests; these are flat wherever a pose is singular. By default "pure" for a pose that the
        arm can move every way in general, else "all".
    arm : Arm, optional
        The arm that the state is of: its joints are drawn, and the ellipsoids at its tip.

    Returns
    -------
    Axes3D
        The (first) axes drawn on; equal scale along all three. Without ``arm`` they are in m/s
        or rad/s, with it in metres, and the legend says what 1 m/s or 1 rad/s is drawn as.

    Raises
    ------
    OptionError
        If ``kind`` or ``motions`` is another word, ``ax`` is not three-dimensional or one for two
        units, or ``arm`` is another one than the state's.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> arm = pinsing.load("ur5")
    >>> axes = plot.ellipsoids(pinsing.at(arm, [0, -1.2, 0, -1, -1.5, 0]), arm=arm)
    >>> axes.get_title()
    'translations, tool orientation held [m/s]'
    """
    OptionError.refuse_if(
        kind not in (*KINDS, "both"), f"unknown kind {kind!r}: translational, rotational or both"
    )
    if arm is not None and arm.joints != state.arm.joints:
        raise OptionError(f"arm is {arm.name} with other joints than the state of {state.arm.name}")
    kinds = KINDS if kind == "both" else (kind,)
    OptionError.refuse_if(
        ax is not None and getattr(ax, "name", "") != "3d",
        "ellipsoids needs axes with projection='3d'",
    )
    OptionError.refuse_if(
        ax is not None and arm is None and len(kinds) > 1,
        "one axis cannot carry m/s and rad/s: choose kind='translational' or 'rotational', "
        "or leave ax out",
    )
    if motions is None:
        motions = "pure" if pure_by_default(state.arm.task, state.generic_rank) else "all"
    if motions == "pure":
        found = dict(zip(KINDS, pure_ellipsoids(state.J), strict=True))
    else:
        found = {k: Ellipsoid(getattr(state, k).axes, getattr(state, k).radii) for k in KINDS}
    flat = [_flat_axes(state, found[name]) for name in kinds]
    normals = np.concatenate([f for f in flat if len(f) == 1] or [np.zeros((0, 3))])
    count = len(kinds)
    every = [ax] * count
    if ax is None:
        size = (count * COLUMN, 3.3 if arm is None else 4.0)
        figure = plt.figure(figsize=size, layout="constrained")
        every = [figure.add_subplot(1, count, k + 1, projection="3d") for k in range(count)]
        figure.suptitle(f"{plain(state.arm.name)}: {state.status}", fontsize=SMALL + 1)
    for each, name in zip(every, kinds, strict=True):
        each.set_title(f"{_WHICH[name, motions]} [{_UNIT[name]}]", fontsize=SMALL)
        if arm is None:
            _alone(each, state, name, found[name])
        else:
            _at_tip(each, state, name, found[name], arm, normals)
    if ax is not None and count > 1:
        ax.set_title(f"velocity ellipsoids, {motions} motions", fontsize=SMALL)
    if ax is None and count > 1:
        legend_of_all(every)
    else:
        legend_below(every[0], 1, at=(0.5, -0.1))
    return every[0]


def _alone(ax: Any, state: State, name: str, e: Ellipsoid) -> None:
    """An ellipsoid about the origin of a space of velocities."""
    size = max(float(e.radii[0]), 1e-9)
    _surface(ax, e, 1.0, np.zeros(3), name)
    _legend(ax, name, e, "")
    for number, axis in enumerate(_flat_axes(state, e)):
        ends = 0.8 * size * np.stack([-axis, axis], axis=1)
        label = "" if number else f"{name}: lost direction"
        ax.plot(*ends, color=LOST, linestyle="--", linewidth=1.4, label=label)
    show_whole(ax, size * np.array([[-1.0] * 3, [1.0] * 3]))
    what = "v" if name == "translational" else r"\omega"
    _label(ax, f"${what}_{{}}$ [{_UNIT[name]}]")


def _label(ax: Any, text: str) -> None:
    """Label the three axes; each letter goes into the braces of a text."""
    for letter in "xyz":
        label = text.format(letter)
        getattr(ax, f"set_{letter}label")(label, fontsize=SMALL, labelpad=-4)


def _at_tip(ax: Any, state: State, name: str, e: Ellipsoid, arm: Arm, normals: Array) -> None:
    """The arm in metres, an ellipsoid at its tip, and what is lost there."""
    hot = sorted({i for d in state.dependences for i in d.indices})
    points, size = draw_skeleton(ax, arm, state.q, hot)
    # Largest semi-axis that is drawn, in sizes of the arm: a round number
    scale = 0.4 * size / max(float(e.radii[0]), 1e-9)
    power = 10.0 ** math.floor(math.log10(scale))
    scale = power * max(k for k in (1, 1.5, 2, 3, 4, 5, 7) if k * power <= scale * (1 + 1e-12))
    _surface(ax, e, scale, state.tip_position, name)
    _legend(ax, name, e, f"\n(1 {_UNIT[name]} is drawn {scale:g} m long)")
    draw_lost(ax, state, size)
    radius = scale * float(e.radii[0])
    show_whole(ax, np.array([*points, state.tip_position + radius, state.tip_position - radius]))
    look_obliquely(ax, normals, points)
    _label(ax, "${}$ [m]")


def _surface(ax: Any, e: Ellipsoid, scale: float, center: Array, name: str) -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(0, np.pi, 21))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    ax.plot_surface(
        *np.moveaxis(center + scale * sphere * e.radii @ e.axes.T, -1, 0),
        color=_COLOR[name],
        alpha=0.32,
        linewidth=0.12,
        edgecolor=_COLOR[name],
        shade=False,
    )


def _legend(ax: Any, name: str, e: Ellipsoid, more: str) -> None:
    exact = e.radii > SINGULAR_RTOL * max(float(e.radii[0]), 1e-300)
    radii = ", ".join(f"{r:.3g}" for r in np.where(exact, e.radii, 0.0))
    label = f"{name} semi-axes: {radii} {_UNIT[name]}{more}"
    ax.plot([], [], [], color=_COLOR[name], linewidth=5, alpha=0.6, label=label)


def _flat_axes(state: State, e: Ellipsoid) -> Array:
    """Directions (k, 3) without extent, where the configuration is what makes them so."""
    if state.status == REGULAR or e.radii[0] <= 0:
        return np.zeros((0, 3))
    limit = SINGULAR_RTOL if state.singular else PRACTICAL
    return np.asarray(e.axes.T[e.radii <= max(limit, 10 * state.rtol) * e.radii[0]])
