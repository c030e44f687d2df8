"""All that a page shows at one configuration, as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.configuration.at import at
from pinsing.configuration.state import REGULAR, State
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import Ellipsoid
from pinsing.measures import pure_ellipsoids as pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.serialization import encode
from pinsing.view.entries import Entry

FLOOR = 0.012
"""Drawn semi-axes are at least this share of the largest: an exact zero would vanish."""

LEAST = 0.006
"""And at least this share of the reach: a disc or a line of a small arm would be a sliver."""

SLIM = 0.1
"""But for its sake no more than this share of the largest: what is flat is to look flat."""

FLAT_RTOL = 1e-5
"""A semi-axis at or below this share of the largest counts as flat; drawing needs no more."""

_SEED = 512


@dataclass(frozen=True)
class Sizes:
    """How large things are drawn; one choice per arm, so that poses can be compared.

    Attributes
    ----------
    reach : float
        Length of the stretched arm, metres.
    translation : float
        Metres drawn for 1 m/s.
    rotation : float
        Metres drawn for 1 rad/s.
    """

    reach: float
    translation: float
    rotation: float


def sizes(arm: Arm, scale: float = 1.0) -> Sizes:
    """Sizes that suit an arm: the ellipsoids about a quarter of its reach, times ``scale``."""
    rng = np.random.default_rng(_SEED)
    lower, upper = arm.span
    J = frame_jacobians(arm, rng.uniform(lower, upper, (48, arm.n)))
    length = _reach(arm)
    fastest = np.median(np.linalg.svd(J[:, :3], compute_uv=False)[:, 0])
    turning = np.median(np.linalg.svd(J[:, 3:], compute_uv=False)[:, 0])
    return Sizes(
        reach=length,
        translation=scale * 0.27 * length / max(float(fastest), 1e-9),
        rotation=scale * 0.20 * length / max(float(turning), 1e-9),
    )


def _reach(arm: Arm) -> float:
    """Sum of the distances between successive joints, sliders pulled out, metres."""
    offsets = [np.linalg.norm(place.translation) for place in arm.model.jointPlacements[2:]]
    tip = np.linalg.norm(arm.model.frames[arm.tip_id].placement.translation)
    lower, upper = arm.span
    slides = np.maximum(np.abs(lower), np.abs(upper))[arm.prismatic].sum()
    return max(float(sum(offsets) + tip + slides), 1e-3)


def drawn_radii(radii: Array, scale: float, reach: float) -> Array:
    """Semi-axes (3,) to draw, metres: floored where flat; all zero where there is no motion."""
    largest = scale * float(radii[0])
    if radii[0] <= 1e-12:
        return np.zeros(3)
    thinnest = max(FLOOR * largest, min(LEAST * reach, SLIM * largest))
    return np.asarray(np.maximum(scale * radii, thinnest))


def flat_direction(ellipsoid: Ellipsoid, rtol: float = FLAT_RTOL) -> Array | None:
    """Direction (3,) of the single semi-axis that is zero, if there is exactly one."""
    radii = ellipsoid.radii
    if radii[0] <= 0 or radii[2] > rtol * radii[0] or radii[1] <= rtol * radii[0]:
        return None
    axis = ellipsoid.axes[:, 2]
    return np.asarray(axis * np.sign(axis[int(np.argmax(np.abs(axis).round(9)))]))


def quaternion(rotation: Array) -> Array:
    """Quaternion (x, y, z, w) of a rotation matrix (3, 3)."""
    return np.array(pin.Quaternion(rotation).coeffs())


def turn_z_to(direction: Array) -> Array:
    """Quaternion (x, y, z, w) of the shortest turn from z to a unit vector (3,)."""
    return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).coeffs())


ON = 1e-7
"""Closer than this, in joint space, is on the family."""

_ALIKE = 2e-6
"""Bounds no farther apart are one distance."""


@dataclass(frozen=True)
class NearestFamily:
    """The nearest family that was found.

    Attributes
    ----------
    entry : int
        Its place in the list of entries.
    value : float
        How far the point of it is that was found, radians, or metres over the length scale.
    lower : float
        No point of this family is nearer: proven.
    least : float
        No point of any family is nearer: proven.
    on : bool
        Whether the configuration belongs to it.
    text : str
        ``0.8° from q5 = 0``; ``between 24° and 90° from ...`` where no more is known.
    """

    entry: int
    value: float
    lower: float
    least: float
    on: bool
    text: str


def nearest_family(arm: Arm, q: Array, entries: Sequence[Entry]) -> NearestFamily | None:
    """Find the nearest family to q (n,) among those that the arm can reach."""
    best, least = None, math.inf
    for index, entry in enumerate(entries):
        if entry.family is None or entry.reachable is False:
            continue
        found = entry.family.distance(q)
        # A set of fixed joints has one distance, which is exact.
        lower = float(getattr(found, "lower", found.value))
        least = min(least, lower)
        if best is None or found.value < best[2].value:
            best = index, entry, found, lower
    if best is None:
        return None
    index, entry, found, lower = best
    on = bool(found.value <= ON)
    slides = [bool(arm.prismatic[j]) for j in entry.moved]

    def far(value: float) -> str:
        return _length(value, arm.length_scale, slides)

    value = float(found.value)
    if not math.isfinite(value):
        words = f"at least {far(least)} from every family; no point of one was found"
        return NearestFamily(index, value, lower, least, on, words)
    said = "on" if on else _how_far(value, lower, least, far)
    words = f"{said} {entry.name}: {entry.where(np.asarray(found.q))}"
    return NearestFamily(index, value, lower, least, on, words)


def _how_far(value: float, lower: float, least: float, far: Callable[[float], str]) -> str:
    """The distance as far as it is known, as the page says it."""
    certain = min(lower, least)
    if far(certain) == far(value) or value - certain <= _ALIKE:
        return f"{far(value)} from"
    if certain <= 0:
        return f"at most {far(value)} from"
    between = f"between {far(certain)} and {far(value)} from"
    return f"{between} the nearest family; found:" if least < lower else between


def _length(value: float, length_scale: float, slides: Sequence[bool]) -> str:
    if slides and all(slides):
        return f"{_short(value * length_scale * 1000)} mm"
    return f"{_short(math.degrees(value))}°"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 20 else f"{value:.1f}" if value >= 0.1 else f"{value:.2g}"


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
