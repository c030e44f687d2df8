"""What the page computes from: chain, task, families and sizes of an arm, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array, Bool
from pinsing.configuration.at import never_produced
from pinsing.configuration.axis_dependence import arm_centres, moving_columns
from pinsing.families.parts import Branch
from pinsing.kinematics.batch import own_scale
from pinsing.kinematics.verdict import NEAR_RTOL, SINGULAR_RTOL, generic_rank, task_size
from pinsing.robot.arm import Arm
from pinsing.robot.joints import joint_axis
from pinsing.robot.nominal import nominal
from pinsing.view.entries import Entry
from pinsing.view.sizes import FLOOR, LEAST, SLIM, Sizes

SCHEMA = "pinsing/engine/1"


def engine_data(arm: Arm, entries: Sequence[Entry], sizes: Sizes) -> dict[str, Any]:
    """All that the page's engine needs to compute frames by itself; ready for JSON.

    Keys: ``schema``; ``chain`` (placements of the joints of the model, metres, and how each
    follows q) and ``nominal``, the same of the nominal geometry where that differs; ``task``
    (rows of the frame Jacobian, which of them are in the tip's axes, length scale, generic rank,
    joints that ever move it, task directions that are never produced, (k, 6)); ``judge``
    (tolerances of the verdict, and the arm's own scale that it is taken at);
    ``joints`` (limits, None where infinite); ``families`` (branches: joint values and equations
    as in `Equation`; ``confirm``: only those of their zeros count at which the arm is singular,
    and ``points`` are some); ``centres`` (joints whose axes always meet, with a name); ``sizes``.
    """
    exact = nominal(arm)
    never = np.zeros((0, 6))
    found = never_produced(arm)
    if found.shape[1]:
        never = np.zeros((found.shape[1], 6))
        never[:, list(arm.task.rows)] = found.T
    return {
        "schema": SCHEMA,
        "chain": arm_chain(arm),
        "nominal": None if exact.exact else arm_chain(exact.arm),
        "task": {
            "rows": list(arm.task.rows),
            "atTip": list(arm.task.tip_rows),
            "lengthScale": arm.length_scale,
            "rank": generic_rank(arm),
            "used": list(moving_columns(arm)),
            "never": never.tolist(),
        },
        "judge": {
            "rtol": SINGULAR_RTOL,
            "nearRtol": NEAR_RTOL,
            "size": task_size(arm),
            "length": own_scale(arm).length,
            "columns": numbers(own_scale(arm).columns),
        },
        "joints": joint_data(arm.joints, arm.prismatic, arm.lower, arm.upper),
        "families": [
            _family(index, entry)
            for index, entry in enumerate(entries)
            if getattr(entry.family, "branches", None)
        ],
        "centres": [{"name": c.short, "joints": list(c.ids)} for c in arm_centres(arm) if c.short],
        "sizes": sizes_data(sizes),
    }


def sizes_data(sizes: Sizes) -> dict[str, float]:
    """How large things are drawn."""
    return {
        "reach": sizes.reach,
        "translation": sizes.translation,
        "rotation": sizes.rotation,
        "floor": FLOOR,
        "least": LEAST * sizes.reach,
        "slim": SLIM,
    }


def arm_chain(arm: Arm) -> dict[str, Any]:
    """`chain_data` of an arm's model, with its mimic joints."""
    if arm.coupling is None:
        return chain_data(arm.model, arm.tip_id)
    return chain_data(arm.model, arm.tip_id, arm.coupling.matrix, arm.coupling.offset)


def chain_data(
    model: pin.Model, tip_id: int, matrix: Array | None = None, offset: Array | None = None
) -> dict[str, Any]:
    """Joints of a model, root to leaves, with the frame ``tip_id``: numbers to the last bit.

    A joint stands at row . q + offset, with its row of ``matrix``; at its own q by default.
    """
    matrix = np.eye(model.nv) if matrix is None else matrix
    offset = np.zeros(model.nv) if offset is None else offset
    joints = []
    for j in range(1, model.njoints):
        axis, slides = joint_axis(model.joints[j], model.names[j])
        place = model.jointPlacements[j]
        row = model.joints[j].idx_v
        joints.append(
            {
                "parent": int(model.parents[j]) - 1,
                "R": rows_of(place.rotation),
                "t": numbers(place.translation),
                "axis": numbers(axis),
                "prismatic": slides,
                "weights": numbers(matrix[row]),
                "offset": float(offset[row]),
            }
        )
    return {"joints": joints, "tip": frame_data(model, tip_id)}


def frame_data(model: pin.Model, frame_id: int) -> dict[str, Any]:
    """A frame of a model: its joint (-1: the root) and its placement there."""
    frame = model.frames[frame_id]
    return {
        "parent": int(frame.parentJoint) - 1,
        "R": rows_of(frame.placement.rotation),
        "t": numbers(frame.placement.translation),
    }


def joint_data(
    names: Sequence[str], prismatic: Bool, lower: Array, upper: Array
) -> list[dict[str, Any]]:
    """Names and limits of joints; None where a limit is infinite."""
    return [
        {
            "name": name,
            "prismatic": bool(slides),
            "lower": float(low) if np.isfinite(low) else None,
            "upper": float(high) if np.isfinite(high) else None,
        }
        for name, slides, low, high in zip(names, prismatic, lower, upper, strict=True)
    ]


def _family(index: int, entry: Entry) -> dict[str, Any]:
    branches: Sequence[Branch] = getattr(entry.family, "branches", ())
    # Families that were read from a file do not say that their equations are not enough.
    confirm = getattr(entry.family, "confirm", None) is not None
    confirm = confirm or any(len(b.equations) > 1 for b in branches)
    return {
        "entry": index,
        "name": entry.name,
        "text": entry.text,
        "reason": entry.reason,
        "reachable": entry.reachable is not False,
        "moved": list(entry.moved),
        "confirm": confirm,
        "points": [pose.tolist() for pose in entry.poses] if confirm else [],
        "where": [entry.where_branch(b) for b in branches],
        "branches": [_branch(b) for b in branches],
    }


def _branch(branch: Branch) -> dict[str, Any]:
    return {
        "values": [{"joint": v.joint, "value": v.value} for v in branch.values],
        "equations": [
            {
                "frequencies": e.frequencies.tolist(),
                "powers": e.powers.tolist() if e.powers.any() else None,
                "cos": numbers(e.cos),
                "sin": numbers(e.sin),
                "shift": numbers(e.shift),
                "accuracy": float(e.accuracy),
            }
            for e in branch.equations
        ],
    }


def rows_of(matrix: Array) -> list[list[float]]:
    """Rows of a matrix, ready for JSON."""
    return [numbers(row) for row in np.asarray(matrix)]


def numbers(values: Array) -> list[float]:
    """Numbers, ready for JSON."""
    return [float(x) for x in np.asarray(values).ravel()]
