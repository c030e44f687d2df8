"""The links of a mechanism in space: base and platform as plates, legs as lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.loops.structure import plane_axes
from pinsing.robot.joints import joint_axis
from pinsing.robot.mechanism import Mechanism

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
