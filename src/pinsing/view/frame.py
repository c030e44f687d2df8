"""All that a page shows at one configuration, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.configuration.at import at
from pinsing.configuration.state import REGULAR, State
from pinsing.measures import Ellipsoid
from pinsing.robot.arm import Arm
from pinsing.serialization import encode
from pinsing.view.ellipsoids import (
    Sizes,
    drawn_radii,
    flat_direction,
    pure_ellipsoids,
    quaternion,
    turn_z_to,
)
from pinsing.view.entries import Entry
from pinsing.view.nearest_family import nearest_family

ARROWS = 3
"""Lost motions drawn at most."""


def make_frame(
    arm: Arm, q: Array, sizes: Sizes, entries: Sequence[Entry], near: Sequence[Entry] | None = None
) -> dict[str, Any]:
    """Placements, ellipsoids, numbers and words at q (n,), ready for JSON.

    Keys: ``q``; ``links``, position and quaternion (x, y, z, w) of each joint of the model;
    ``ellipsoids``, by mode and kind, with ``turn`` (quaternion), ``drawn`` (metres, floored),
    ``radii`` (true values) and ``flat`` (quaternion from z to the lost direction, or None);
    ``lost``; ``hot``, joints whose axes are dependent; numbers; ``verdict``.
    Lengths in metres, in the base of the arm.

    Parameters
    ----------
    entries : sequence of Entry
        The list of the page.
    near : sequence of Entry, optional
        Those that the verdict looks at; all by default.
    """
    state = at(arm, q)
    found = nearest_family(arm, state.q, entries if near is None else near)
    index = None
    if found is not None:
        index = found.entry if near is None else entries.index(near[found.entry])
    frame: dict[str, Any] = {
        "q": rounded(state.q, 9),
        "links": link_placements(arm.model, arm.model_q(state.q)),
        "tip": rounded(state.tip_position),
        "ellipsoids": _ellipsoids(state, sizes),
        "lost": [
            {
                "kind": m.kind,
                "turn": rounded(turn_z_to(m.direction)),
                "at": rounded(m.point),
                "close": bool(np.linalg.norm(m.point - state.tip_position) <= 1.5 * sizes.reach),
                "words": m.words,
            }
            for m in state.lost
        ],
        "hot": sorted({i for d in state.dependences for i in d.indices}),
        "why": [d.reason for d in state.dependences],
        "status": state.status,
        "rank": state.rank,
        "genericRank": state.generic_rank,
        "sigma": digits(state.sigma),
        "ratio": digit(state.sigma_ratio),
        "condition": digit(state.condition_number) if state.sigma_ratio > 1e-13 else "inf",
        "manipulability": digit(state.manipulability),
        "outside": list(state.outside),
        "notes": list(state.notes),
        "verdict": None
        if found is None
        else {"text": found.text, "entry": index, "value": digit(found.value), "on": found.on},
    }
    return frame


def link_placements(model: pin.Model, q: Array) -> list[list[float]]:
    """Position and quaternion of each joint of a model, base to tip, at q (nq,), in the base."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return [rounded(pin.SE3ToXYZQUAT(data.oMi[j])) for j in range(1, model.njoints)]


def _ellipsoids(state: State, sizes: Sizes) -> dict[str, dict[str, Any]]:
    pure = pure_ellipsoids(state.J)
    every = [Ellipsoid(e.axes, e.radii) for e in (state.translational, state.rotational)]
    scales = (sizes.translation, sizes.rotation)
    # A direction that is missing everywhere is not lost here.
    lost = state.status != REGULAR
    return {
        mode: {
            kind: _ellipsoid(e, scale, sizes.reach, lost)
            for kind, e, scale in zip(("translation", "rotation"), pair, scales, strict=True)
        }
        for mode, pair in (("all", every), ("pure", pure))
    }


def _ellipsoid(ellipsoid: Ellipsoid, scale: float, reach: float, lost: bool) -> dict[str, Any]:
    flat = flat_direction(ellipsoid) if lost else None
    return {
        "turn": rounded(quaternion(ellipsoid.axes)),
        "drawn": rounded(drawn_radii(ellipsoid.radii, scale, reach), 6),
        "radii": digits(ellipsoid.radii),
        "flat": None if flat is None else rounded(turn_z_to(flat)),
    }


def rounded(values: Any, places: int = 5) -> list[float]:
    """Numbers of a drawing, to so many places."""
    return [float(x) + 0.0 for x in np.round(np.asarray(values, dtype=float), places)]


def digit(value: float) -> Any:
    """A number to be read, as JSON has it."""
    return encode(float(f"{value:.5g}"))


def digits(values: Array) -> list[Any]:
    """Numbers to be read, as JSON has them."""
    return [digit(float(x)) for x in values]
