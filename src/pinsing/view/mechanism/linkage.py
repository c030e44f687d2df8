"""What the page of a mechanism computes from: tree, loops, modes and sizes, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.loops.batch import hinged_balls
from pinsing.loops.closure import random_closed, ranks
from pinsing.loops.dyad import planar_dyad
from pinsing.loops.modes import assembly_rows, elbows, home
from pinsing.loops.motion import mechanism_at
from pinsing.loops.pose import led_pose
from pinsing.loops.structure import structure
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.robot.chains import frame_index
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.source import Source
from pinsing.view.entries import chain_data, frame_data, joint_data, numbers, sizes_data
from pinsing.view.links import geometry as mg
from pinsing.view.scene import HOT, ROTATION, Sizes, ring_arrow, straight_arrow, torus
from pinsing.view.tab import SIDE

SCHEMA = "pinsing/mechanism-engine/1"


def mechanism_data(mechanism: Mechanism, sizes: Sizes, normal: Array | None) -> dict[str, Any]:
    """All that the page's engine needs to move a mechanism by itself; ready for JSON.

    Keys: ``schema``; ``chain``, as of an arm, its tip the output; ``loops``, each with ``kind`` and
    the two frames; ``task``, ``metric`` (what counts as one radian, per joint), ``joints``
    (limits, None where infinite), ``actuated``; ``ranks`` that are generic; ``judge``, tolerances
    of the verdict; ``home`` (n,), closed; ``assembly``, rows of the closure whose determinant
    tells assembly modes apart, and its sign at home, or None; ``pose``, coordinates in which the
    output is led (see `led_pose`); ``balls`` that are written as three hinges, their centres in
    the frame of the first; ``legs``, the joints of each; ``elbows``; ``dyad``, where two
    links in a plane close the loop, or None; ``normal`` of the plane of a planar mechanism;
    ``sizes``.

    Parameters
    ----------
    normal : (3,) array, optional
        Of the plane of a planar mechanism: turning is then drawn as a ring in the plane.
    """
    m, model = mechanism, mechanism.model
    generic = ranks(m)
    rows, sign = assembly_rows(m)
    dyad = planar_dyad(m)
    return {
        "schema": SCHEMA,
        "output": m.output,
        "chain": chain_data(model, m.output_id),
        "loops": [
            {
                "kind": loop.kind,
                "a": frame_data(model, frame_index(model, loop.frame_a)),
                "b": frame_data(model, frame_index(model, loop.frame_b)),
            }
            for loop in m.loops
        ],
        "task": {"rows": list(m.task.rows), "lengthScale": m.length_scale},
        "metric": numbers(m.space.metric),
        "joints": joint_data(m.joints, m.prismatic, m.lower, m.upper),
        "actuated": list(m.actuated),
        "ranks": {
            "constraint": generic.constraint,
            "mobility": generic.mobility,
            "output": generic.output,
        },
        "judge": {"rtol": SINGULAR_RTOL, "nearRtol": NEAR_RTOL},
        "home": numbers(home(m)),
        "assembly": None if rows is None else {"rows": rows, "sign": sign},
        "pose": led_pose(m),
        "balls": [
            {"joints": list(ball.joints), "centre": numbers(ball.point)} for ball in hinged_balls(m)
        ],
        "legs": [list(leg.joints) for leg in structure(m).legs],
        "elbows": [
            {
                "crank": e.crank - 1,
                "elbow": e.elbow - 1,
                "endJoint": e.end_joint - 1,
                "end": list(e.end),
                "slides": e.slides,
            }
            for e in elbows(m)
        ],
        "dyad": None
        if dyad is None
        else {
            "sides": [
                {
                    "pivot": numbers(side.pivot),
                    "crank": side.crank,
                    "crankSign": side.crank_sign,
                    "crankLength": side.crank_length,
                    "crankAngle": side.crank_angle,
                    "pin": side.pin,
                    "pinSign": side.pin_sign,
                    "rodLength": side.rod_length,
                    "rodAngle": side.rod_angle,
                }
                for side in dyad.sides
            ]
        },
        "normal": None if normal is None else numbers(np.asarray(normal)),
        "sizes": sizes_data(sizes),
    }


_PARALLEL = 1e-6


@dataclass(frozen=True, eq=False)
class Linkage:
    """The spanning tree of a mechanism, as a `Body`.

    Attributes
    ----------
    mechanism : Mechanism
        The whole.
    """

    mechanism: Mechanism

    @property
    def model(self) -> pin.Model:
        """The spanning tree."""
        return self.mechanism.model

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints."""
        return self.mechanism.joints

    @property
    def tip_id(self) -> int:
        """Index of the output frame."""
        return self.mechanism.output_id

    @property
    def span(self) -> tuple[Array, Array]:
        """The limits, and where there are none what `JointSpace.span` has instead."""
        return self.mechanism.space.span

    @property
    def known(self) -> dict[str, Any]:
        """What was computed of the mechanism before."""
        return self.mechanism.known

    @property
    def source(self) -> Source:
        """Where the tree comes from."""
        return self.mechanism.source

    @property
    def base(self) -> str:
        """The root."""
        return "universe"

    @property
    def ends(self) -> tuple[int, ...]:
        """Frames that links end in: those that close the loops, and the output."""
        m = self.mechanism
        names = [name for loop in m.loops for name in (loop.frame_a, loop.frame_b)]
        return tuple(dict.fromkeys([*(frame_index(m.model, n) for n in names), m.output_id]))


def linkage_sizes(mechanism: Mechanism, scale: float = 1.0) -> Sizes:
    """Sizes that suit a mechanism: the ellipsoids about a quarter of its extent, by ``scale``.

    Velocities are those at unit input speed, at regular configurations drawn at random.
    """
    rng = np.random.default_rng(377)
    samples = [home(mechanism), *random_closed(mechanism, 16, rng)]
    states = [mechanism_at(mechanism, q) for q in samples]
    fast: dict[bool, list[float]] = {True: [], False: []}
    rows = np.array(mechanism.task.rows)
    for state in states:
        for turns in (False, True):
            part = (rows >= 3) == turns
            if state.velocity is not None and part.any():
                fast[turns].append(float(np.linalg.norm(state.velocity[part], 2)))
    reach = _extent(mechanism, samples[0])
    fastest, turning = (_usual(fast[k]) for k in (False, True))
    return Sizes(
        reach=reach,
        translation=scale * 0.2 * reach / max(fastest, 1e-9),
        rotation=scale * 0.2 * reach / max(turning, 1e-9),
    )


def _usual(speeds: list[float]) -> float:
    """The median of speeds, the first of which, home's, is to be seen well: at most twice it."""
    if not speeds:
        return 1.0
    middle = float(np.median(speeds))
    return min(middle, 2 * speeds[0]) if speeds[0] > 0 else middle


def _extent(mechanism: Mechanism, q: Array) -> float:
    """Largest distance between points of the linkage at q (n,), metres."""
    points = _points(mechanism, q)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return max(float(gaps.max()), 1e-3)


def _points(mechanism: Mechanism, q: Array) -> Array:
    """Origins of the joints and of the frames that links end in, (N, 3)."""
    model = mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, mechanism.model_q(q))
    ends = Linkage(mechanism).ends
    places = [data.oMi[j] for j in range(1, model.njoints)] + [data.oMf[i] for i in ends]
    return np.array([place.translation for place in places])


def plane_normal(mechanism: Mechanism) -> Array | None:
    """Normal (3,) of the plane that a mechanism moves in; None where it moves in space."""
    model = mechanism.model
    data = model.createData()
    J = np.array(pin.computeJointJacobians(model, data, mechanism.model_q(home(mechanism))))
    turning = ~mechanism.prismatic
    if not turning.any():
        return None
    axes = J[3:, turning] / np.linalg.norm(J[3:, turning], axis=0)
    normal = axes[:, 0]
    slides = J[:3, mechanism.prismatic]
    flat = np.abs(np.cross(normal, axes.T)).max() <= _PARALLEL
    if not flat or np.abs(normal @ slides).max(initial=0.0) > _PARALLEL:
        return None
    return np.asarray(normal * (1 if normal[int(np.argmax(np.abs(normal)))] > 0 else -1))


def side(normal: Array | None) -> tuple[float, ...]:
    """Where the camera looks from (three.js axes, y up): across the plane, if there is one."""
    if normal is None:
        return SIDE
    x, y, z = normal
    across = np.array([x, z, -y])
    # A little off the normal, so that what stands on the plane is seen as well.
    tilt = np.array([0.0, 0.0, 1.0]) if abs(z) > 0.7 else np.array([0.0, 1.0, 0.0])
    return tuple(float(v) for v in across + 0.42 * tilt)


def draw_linkage_marks(node: Any, mechanism: Mechanism, size: Sizes) -> None:
    """Draw the arrows of motions that the actuators do not hold; adapt the rest to a plane.

    In a plane the rotations are about its normal: a ring, whose radius is the speed, takes the
    place of an ellipsoid that would be a needle seen from its end; and the floor goes below a
    linkage that lies on it.

    Parameters
    ----------
    node : meshcat visualizer
        The node ``pinsing`` of the scene that `draw_scene` drew.
    mechanism : Mechanism
        The mechanism.
    size : Sizes
        How large things are drawn.
    """
    straight_arrow(node["free/translation"], size.reach, HOT)
    ring_arrow(node["free/rotation"], size.reach, HOT)
    normal = plane_normal(mechanism)
    if normal is None:
        return
    turning = node["ellipsoid/rotation"]
    for part in ("skin", "xy", "yz", "zx"):
        turning[part].delete()
    turning["ring"].set_object(torus(1.0, 0.035), mg.MeshPhongMaterial(color=ROTATION))
    if abs(normal[2]) > 1 - 1e-9:
        below = np.eye(4)
        below[2, 3] = -0.06 * size.reach
        node["floor"].set_transform(below)
