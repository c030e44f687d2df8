"""An arm as lines between its joints, and what is lost at its tip, in three dimensions."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.configuration.lost_motion import LostMotion
from pinsing.configuration.state import State
from pinsing.plot.style import SMALL
from pinsing.robot.arm import Arm
from pinsing.robot.joint_axis import joint_axis

BONE = "#5b6472"
LOST = "#C4187C"
HOT = "#D55E00"
_COSINE = 0.34
"""Of the angle between the line of sight and the normal of what is flat: 70 degrees."""
_GREATEST_OFF = 1.5
"""Lost motions about lines farther from the tip than this, in sizes of the arm, are not drawn."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Where the joints of an arm are at one configuration.

    Attributes
    ----------
    points : (k, 3) array
        The base, each joint from there on, and the tip, metres in the base.
    joints : (n, 3) array
        The free joints alone.
    axes : (n, 3) array
        Their unit directions.
    prismatic : (n,) array of bool
        Which of them slide.
    """

    points: Array
    joints: Array
    axes: Array
    prismatic: Array

    @property
    def size(self) -> float:
        """Largest distance of a point from the base, metres."""
        return float(np.linalg.norm(self.points - self.points[0], axis=1).max()) or 1.0


def skeleton(arm: Arm, q: Array) -> Skeleton:
    """The joints of ``arm`` at q (n,)."""
    model = arm.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, arm.model_q(q))
    chain = []
    joint = int(model.frames[arm.tip_id].parentJoint)
    while joint > 0:
        chain.append(joint)
        joint = int(model.parents[joint])
    names = {str(name): j for j, name in enumerate(model.names)}
    named = [(name, names[name]) for name in arm.joints]
    places = [np.array(data.oMi[j].translation) for j in reversed(chain)]
    tip = np.array(data.oMf[arm.tip_id].translation)
    return Skeleton(
        points=np.array([np.zeros(3), *places, tip]),
        joints=np.array([data.oMi[j].translation for _, j in named]),
        axes=np.array([data.oMi[j].rotation @ joint_axis(model.joints[j], n)[0] for n, j in named]),
        prismatic=np.array(arm.prismatic),
    )


def draw_skeleton(ax: Any, bones: Skeleton, hot: tuple[int, ...] = ()) -> None:
    """Draw an arm: bones, joints, and the axes that depend on each other (``hot``) thin."""
    ax.plot(*bones.points.T, color=BONE, linewidth=3.2, solid_capstyle="round", zorder=2)
    ax.plot(*bones.points[:1].T, "s", color=BONE, markersize=7, zorder=2)
    for slides, marker in ((False, "o"), (True, "D")):
        some = bones.joints[bones.prismatic == slides]
        if len(some):
            ax.plot(*some.T, marker, color="white", markeredgecolor=BONE, markersize=4.5, zorder=3)
    for number, j in enumerate(i for i in hot if not bones.prismatic[i]):
        reach = 0.55 * bones.size * bones.axes[j]
        ends = np.stack([bones.joints[j] - reach, bones.joints[j] + reach], axis=1)
        label = "" if number else "joint axes that depend on each other"
        ax.plot(*ends, color=HOT, linewidth=0.9, label=label, zorder=2)


def draw_lost(ax: Any, state: State, size: float, center: Array) -> None:
    """Draw each lost motion once, with its words in the legend; one far away is in words only.

    A translation or a motion along a line is a line with arrows at both ends, a rotation has a
    circle about it, a screw both.
    """
    for lost in state.lost:
        through = center + (lost.point - state.tip_position)
        if np.linalg.norm(through - center) > _GREATEST_OFF * size:
            words = "\n".join(textwrap.wrap(f"{lost.words} (outside the picture)", 62))
            ax.plot([], [], [], color=LOST, linestyle="--", linewidth=1.5, label=words)
            continue
        words = "\n".join(textwrap.wrap(lost.words, 62))
        ends = 0.5 * size * np.array([-1.0, 1.0])[:, None] * lost.direction + through
        ax.plot(*ends.T, color=LOST, linestyle="--", linewidth=1.5, label=words, zorder=5)
        if lost.kind != "rotation":
            for end in ends:
                _arrow(ax, end, (end - through) / (0.5 * size), 0.09 * size)
        if lost.kind in ("rotation", "screw"):
            _turn(ax, lost, through, 0.2 * size)


def _arrow(ax: Any, end: Array, direction: Array, length: float) -> None:
    """Two short lines that meet at the end of a line."""
    across = _across(direction)
    for side in (across, -across):
        back = end - length * direction + 0.45 * length * side
        ax.plot(*np.stack([back, end], axis=1), color=LOST, linewidth=1.5, zorder=5)


def _turn(ax: Any, lost: LostMotion, through: Array, radius: float) -> None:
    """Most of a circle about the direction, with an arrow at its end."""
    x = _across(lost.direction)
    y = np.cross(lost.direction, x)
    t = np.linspace(0.0, 1.6 * np.pi, 60)[:, None]
    circle = through + radius * (np.cos(t) * x + np.sin(t) * y)
    ax.plot(*circle.T, color=LOST, linewidth=1.5, zorder=5)
    heading = (circle[-1] - circle[-2]) / np.linalg.norm(circle[-1] - circle[-2])
    out = (circle[-1] - through) / radius
    for side in (out, -out):
        back = circle[-1] + 0.4 * radius * (-heading + 0.5 * side)
        ax.plot(*np.stack([back, circle[-1]], axis=1), color=LOST, linewidth=1.5, zorder=5)


def _across(direction: Array) -> Array:
    """A unit vector across a direction (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(direction)))]
    found = np.cross(direction, other)
    return np.asarray(found / np.linalg.norm(found))


def show_whole(ax: Any, points: Array) -> None:
    """Equal scale along all axes, as tight a cube about points (k, 3) as there is."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.52 * float((high - low).max()) or 1.0
    middle = (low + high) / 2
    for letter, m in zip("xyz", middle, strict=True):
        getattr(ax, f"set_{letter}lim")(m - half, m + half)
    ax.set_box_aspect((1, 1, 1), zoom=0.9)
    ax.tick_params(labelsize=SMALL - 1.5, pad=-1)
    ax.locator_params(nbins=4)


def look_obliquely(ax: Any, normals: Array, bones: Array) -> None:
    """Turn the camera so that what is flat, with these normals (k, 3), is seen from the side.

    Of the directions that show the plates so, one that shows the arm, points (m, 3), widest.
    """
    flat = bones - bones.mean(axis=0)
    size = float(np.linalg.norm(flat)) or 1.0
    best = (-np.inf, 22.0, -60.0)
    for elevation in (18.0, 28.0):
        for azimuth in range(-175, 185, 10):
            e, a = np.radians([elevation, azimuth])
            view = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
            seen = np.linalg.norm(flat - np.outer(flat @ view, view)) / size
            usual = abs(((azimuth + 60 + 180) % 360) - 180) / 180  # as plots are, if all is equal
            off = [abs(abs(float(view @ n)) - _COSINE) for n in normals]
            score = float(seen) - 3.0 * sum(off) / max(len(off), 1) - 0.1 * usual
            if score > best[0]:
                best = (score, elevation, float(azimuth))
    ax.view_init(elev=best[1], azim=best[2])
