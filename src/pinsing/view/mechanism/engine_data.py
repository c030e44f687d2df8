"""What the page of a mechanism computes from: tree, loops, modes and sizes, as plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing._types import Array
from pinsing.loops.batch import hinged_balls
from pinsing.loops.closure import ranks
from pinsing.loops.dyad import Side, planar_dyad
from pinsing.loops.modes import assembly_rows, elbows, home
from pinsing.loops.pose import led_pose
from pinsing.loops.structure import structure
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.robot.chains import frame_index
from pinsing.robot.mechanism import Mechanism
from pinsing.view.engine_data import chain_data, frame_data, joint_data, numbers, sizes_data
from pinsing.view.sizes import Sizes

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
        "dyad": None if dyad is None else {"sides": [_side(side) for side in dyad.sides]},
        "normal": None if normal is None else numbers(np.asarray(normal)),
        "sizes": sizes_data(sizes),
    }


def _side(side: Side) -> dict[str, Any]:
    return {
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
