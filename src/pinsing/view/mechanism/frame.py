"""All that the page of a mechanism shows at one configuration, as plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing._types import Array
from pinsing.configuration.state import NEAR_SINGULAR, REGULAR, SINGULAR
from pinsing.measures import velocity_ellipsoid
from pinsing.mechanism.lost_motion import Free, Lost, free_motions, lost_motions
from pinsing.mechanism.motion import MechanismState, mechanism_at, motions
from pinsing.robot.mechanism import Mechanism
from pinsing.view.ellipsoids import Sizes, drawn_radii, pure_ellipsoids, quaternion, turn_z_to
from pinsing.view.frame import ARROWS, digit, link_placements, rounded

LONGEST = 0.6
"""Semi-axes are drawn no longer than this share of the mechanism: towards type 2 they grow."""

_MOVES = 1e-6
_CLOSE = 1.5


def mechanism_frame(
    mechanism: Mechanism, q: Array, sizes: Sizes, normal: Array | None = None
) -> dict[str, Any]:
    """Placements, ellipses, measures and words at a closed q (n,), ready for JSON.

    Keys as in `pinsing.view.frame.make_frame`, with ``kind``, ``mode`` and the measures ``one``
    and ``two`` (of type 1 and 2) and ``constraint`` in place of rank and singular values, and
    ``free``: arrows of what moves with the actuators at rest.

    Parameters
    ----------
    normal : (3,) array, optional
        Of the plane of a planar mechanism: turning is then drawn as a ring in the plane.
    """
    state = mechanism_at(mechanism, q)
    lost, free = lost_motions(mechanism, state), free_motions(mechanism, state)
    if state.kind in ("regular", "type 2"):
        lost = ()
    if state.kind in ("regular", "type 1"):
        free = ()
    hot = _moving(mechanism, state)
    low, high = mechanism.lower - 1e-9, mechanism.upper + 1e-9
    return {
        "q": rounded(state.q, 12),
        "links": link_placements(mechanism.model, mechanism.model_q(q)),
        "tip": rounded(state.position),
        "ellipsoids": _ellipsoids(mechanism, state, sizes, lost, normal),
        "lost": [_line(found, state.position, sizes) for found in lost][:ARROWS],
        "free": _arrows(free, state.position, sizes),
        "given": [found.words for found in free],
        "hot": hot,
        "why": _why(mechanism, state, hot),
        "status": _status(state),
        "kind": state.kind,
        "mode": state.mode,
        "one": digit(state.output_ratio),
        "two": digit(state.input_ratio),
        "constraint": digit(state.constraint_ratio),
        "condition": digit(_condition(mechanism, state)),
        "gain": "inf" if state.velocity is None else digit(_gain(state.velocity)),
        "outside": [
            name
            for name, bad in zip(mechanism.joints, (state.q < low) | (state.q > high), strict=True)
            if bad
        ],
        "notes": [],
        "verdict": {"text": _verdict(state)},
        "refused": None,
    }


def _status(state: MechanismState) -> str:
    if state.kind != "regular":
        return SINGULAR
    return NEAR_SINGULAR if state.near else REGULAR


def _verdict(state: MechanismState) -> str:
    if state.kind == "regular":
        if not state.near:
            return ""
        measures = (
            ("type 1", state.output_ratio),
            ("type 2", state.input_ratio),
            ("a constraint singularity", state.constraint_ratio),
        )
        name, value = min(measures, key=lambda m: m[1])
        return f"close to {name} (measure {value:.1g})"
    return {
        "type 1": "a direction of the output is lost",
        "type 2": "the output moves with the actuators locked",
        "type 3": "a direction is lost, and the output moves with the actuators locked",
        "constraint": "the linkage gains a motion: its loops hold less than elsewhere",
    }[state.kind]


def _condition(mechanism: Mechanism, state: MechanismState) -> float:
    """Largest over smallest output speed at unit input speed, lengths over the length scale."""
    if state.kind != "regular" or state.velocity is None:
        return float("inf")
    rows = np.array(mechanism.task.rows)
    scale = np.where(rows < 3, 1 / mechanism.length_scale, 1.0)
    sigma = np.linalg.svd(state.velocity * scale[:, None], compute_uv=False)
    kept = sigma[: min(len(sigma), state.velocity.shape[1])]
    return float(kept[0] / kept[-1]) if kept[-1] > 0 else float("inf")


def _gain(velocity: Array) -> float:
    """Output speed at unit input speed, metres and radians."""
    return float(np.linalg.norm(velocity, 2))


def _moving(mechanism: Mechanism, state: MechanismState) -> list[int]:
    """Joints that move in the singular motion: with the actuators, or the output, at rest."""
    if state.kind in ("regular", "constraint"):
        return []
    found = motions(mechanism, state.q)
    hot: set[int] = set()
    for kind, rows in (("type 1", found.outputs), ("type 2", found.inputs)):
        if state.kind in (kind, "type 3"):
            z = found.basis @ np.linalg.svd(rows)[2][-1]
            hot |= {int(i) for i in np.flatnonzero(np.abs(z) > _MOVES)}
    return sorted(hot)


def _why(mechanism: Mechanism, state: MechanismState, hot: list[int]) -> list[str]:
    names = [mechanism.joints[i] for i in hot]
    if not names:
        return []
    who = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    rest = {
        "type 1": f"{mechanism.output} is locked",
        "type 2": "the actuators are locked",
        "type 3": f"{mechanism.output} or the actuators are locked",
    }[state.kind]
    return [f"{who} can move although {rest}"]


def _ellipsoids(
    mechanism: Mechanism,
    state: MechanismState,
    sizes: Sizes,
    lost: tuple[Lost, ...],
    normal: Array | None,
) -> dict[str, dict[str, Any]]:
    J = np.zeros((6, len(mechanism.inputs)))
    if state.velocity is not None:
        J[list(mechanism.task.rows)] = state.velocity
    every = (velocity_ellipsoid(J[:3]), velocity_ellipsoid(J[3:]))
    scales = (sizes.translation, sizes.rotation)
    out: dict[str, dict[str, Any]] = {}
    for mode, pair in (("all", every), ("pure", pure_ellipsoids(J))):
        out[mode] = {}
        for kind, e, scale in zip(("translation", "rotation"), pair, scales, strict=True):
            drawn = drawn_radii(np.minimum(e.radii, LONGEST * sizes.reach / scale), scale)
            turn = quaternion(e.axes)
            if kind == "rotation" and normal is not None:
                drawn, turn = np.full(3, drawn[0]), turn_z_to(normal)
            flat = _flat(lost, kind, pure=mode == "pure")
            out[mode][kind] = {
                "turn": rounded(turn),
                "drawn": rounded(drawn, 6),
                "radii": [digit(float(x)) for x in e.radii],
                "flat": None if flat is None else rounded(turn_z_to(flat)),
            }
    return out


def _flat(lost: tuple[Lost, ...], kind: str, pure: bool) -> Array | None:
    """Direction in which an ellipsoid is flat: of the only lost motion, if it has such a part."""
    if len(lost) != 1:
        return None
    parts = {"translation": lost[0].force, "rotation": lost[0].moment}
    part = parts.pop(kind)
    (other,) = parts.values()
    # Together with the other part every motion of this one may still be there.
    if np.linalg.norm(part) <= _MOVES or (not pure and np.linalg.norm(other) > _MOVES):
        return None
    return np.asarray(part / np.linalg.norm(part))


def _line(lost: Lost, tip: Array, sizes: Sizes) -> dict[str, Any]:
    on_tip = lost.line is None or np.linalg.norm(lost.line - tip) <= _MOVES * sizes.reach
    along = lost.force if np.linalg.norm(lost.force) > 0 else lost.moment
    return {
        "kind": "direction" if on_tip else "line",
        "turn": rounded(turn_z_to(along / np.linalg.norm(along))),
        "at": rounded(tip if lost.line is None else lost.line),
        "close": lost.line is None or bool(np.linalg.norm(lost.line - tip) <= _CLOSE * sizes.reach),
        "words": lost.words,
    }


def _arrows(free: tuple[Free, ...], tip: Array, sizes: Sizes) -> dict[str, Any]:
    """Where the arrows of what moves by itself go: along it, and about the axis of a turn."""
    out: dict[str, Any] = {"translation": None, "rotation": None}
    for found in free[:1]:
        speed = float(np.linalg.norm(found.velocity))
        turns = float(np.linalg.norm(found.turning)) > 0
        if speed > _MOVES and (not turns or speed > _MOVES * sizes.reach):
            turn = rounded(turn_z_to(found.velocity / speed))
            out["translation"] = {"at": rounded(tip), "turn": turn}
        if turns and found.centre is not None:
            near = np.linalg.norm(found.centre - tip) <= _CLOSE * sizes.reach
            turn = rounded(turn_z_to(found.turning))
            out["rotation"] = {"at": rounded(found.centre), "turn": turn} if near else None
    return out
