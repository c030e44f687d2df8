"""Motions that a configuration cannot produce, and wrenches that it carries for free, in words.

A wrench w with J^T w = 0 needs no joint torque, and no motion of the tip has power against it:
that is what is lost. A pure force through the tip takes a translation away, a pure moment a
rotation, a force off the tip the motion of a line along itself, any other wrench the motion on
a screw (J. K. Davidson and K. H. Hunt, "Robots and Screw Theory", 2004).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.configuration.line_geometry import cross, length

ALIGNED = math.radians(0.1)
"""Radians; a direction this close to an axis of the tool or the base goes by that axis."""

EXACT_TOL = 1e-5
"""Share of a wrench that may be moment (or force) and still be called a pure force (moment)."""


@dataclass(frozen=True, eq=False)
class LostMotion:
    """One independent motion that cannot be produced.

    Attributes
    ----------
    kind : str
        ``translation``, ``rotation``, ``line`` or ``screw``.
    direction : (3,) array
        Unit vector, base axes.
    point : (3,) array
        A point of the line or screw axis, metres, in the base; for the others the tip.
    pitch : float
        Of the screw, metres per radian; 0 for a line and a translation, infinite for a rotation.
    wrench : (6,) array
        Force (N) and moment about the tip (N m), base axes, that needs no joint torque. The
        force has length 1, or the moment where there is no force.
    twist : (6,) array
        Tip velocity (m/s) and angular velocity (rad/s), base axes, that is perpendicular to all
        producible ones, translations measured in units of the length scale.
    speed : float
        What is left of the motion at unit joint speed: the greatest power against the wrench,
        in m/s, or in rad/s for a rotation; zero up to rounding where it is truly lost.
    words : str
        What cannot be done.
    """

    kind: str
    direction: Array
    point: Array
    pitch: float
    wrench: Array
    twist: Array
    speed: float
    words: str

    @property
    def free_wrench(self) -> str:
        """What needs no joint torque, in words that follow those of the motion."""
        return {
            "rotation": "a moment about it",
            "screw": "a wrench on it",
        }.get(self.kind, "a force along it")

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True, eq=False)
class Tool:
    """Where the tip is, for words.

    Attributes
    ----------
    position : (3,) array
        Metres, in the base.
    rotation : (3, 3) array
        Columns are the tool axes, in base axes.
    size : float
        Length that a lever arm is small against, metres.
    landmarks : mapping of str to (3,) arrays
        Points worth a name, such as the wrist centre.
    """

    position: Array
    rotation: Array
    size: float
    landmarks: Mapping[str, Array]


def lost_motions(
    U: Array,
    J: Array,
    own_length: float,
    length_scale: float,
    tool: Tool,
    tol: float = EXACT_TOL,
    hardly: bool = False,
) -> tuple[LostMotion, ...]:
    """Describe a space of lost motions by translations, rotations, lines and screws.

    Parameters
    ----------
    U : (6, d) array
        Orthonormal basis, in rows where translations are divided by the arm's own length.
    J : (6, n) array
        Frame Jacobian, metres and radians.
    own_length, length_scale : float
        Metres; of ``U``, and of the twists.
    tool : Tool
        The tip.
    tol : float
        Share of a wrench that is neglected when it is called pure.
    hardly : bool
        Say "nearly loses", with the speed that is left, in place of "cannot".
    """
    forces, moments = U[:3], U[3:]
    # Coefficients of the wrenches in U without moment, and of those without force.
    no_moment, no_force = _null_space(moments, tol), _null_space(forces, tol)
    pure = np.concatenate([no_moment, no_force], axis=1)
    rest = _null_space(pure.T, 1e-6) if pure.size else np.eye(U.shape[1])
    columns = [np.append(d, np.zeros(3)) for d in nice_basis(forces @ no_moment, tool.rotation)]
    columns += [np.append(np.zeros(3), d) for d in nice_basis(moments @ no_force, tool.rotation)]
    columns += list((U @ rest).T)

    def described(u: Array) -> LostMotion:
        force, moment = u[:3] / own_length, u[3:]
        at_scale = np.append(length_scale * force, moment)
        at_scale /= np.linalg.norm(at_scale)
        strength = float(np.linalg.norm(force))
        is_moment = strength * own_length <= tol
        wrench = np.append(force, moment) / (np.linalg.norm(moment) if is_moment else strength)
        force, moment = wrench[:3], wrench[3:]
        point, pitch = tool.position, math.inf
        direction = moment if is_moment else force
        if not is_moment:
            pitch, lever = float(force @ moment), cross(force, moment)
            point = point if length(lever) <= tol * tool.size else point + lever
        # Of d and -d, the one whose largest component is positive.
        largest = int(np.argmax(np.abs(direction).round(9)))
        direction = np.asarray(direction * np.sign(direction[largest]))
        if is_moment:
            kind, noun, verb = "rotation", "rotation", "rotate"
            where = f"about {axis_name(direction, tool.rotation)}"
        elif abs(pitch) > tol * tool.size:
            kind, noun, verb = "screw", "motion", "move"
            line = _line_words(direction, point, tool, tol)
            where = f"on the screw of pitch {pitch:.3g} m/rad about the line {line}"
        elif point is tool.position:
            kind, noun, verb, pitch = "translation", "translation", "translate", 0.0
            where = f"along {axis_name(direction, tool.rotation)}"
        else:
            kind, noun, verb, pitch = "line", "motion", "move", 0.0
            where = f"along the line {_line_words(direction, point, tool, tol)}"
        speed = float(np.linalg.norm(J.T @ wrench))
        words = f"cannot {verb} {where}"
        if hardly:
            unit = "rad/s" if is_moment else "m/s"
            words = f"nearly loses {noun} {where} ({speed:.2g} {unit} at unit joint speed)"
        return LostMotion(
            kind=kind,
            direction=direction,
            point=np.array(point),
            pitch=pitch,
            wrench=wrench,
            twist=np.append(length_scale * at_scale[:3], at_scale[3:]),
            speed=speed,
            words=words,
        )

    return tuple(described(u) for u in columns)


def _null_space(A: Array, tol: float) -> Array:
    """Orthonormal coefficients (d, k) of combinations of the columns of A (m, d) that vanish."""
    if A.shape[1] == 1:  # one combination, which does or does not
        return np.zeros((1, 0)) if length(A[:, 0]) > tol else np.ones((1, 1))
    _, sigma, Vt = np.linalg.svd(A)
    return np.asarray(Vt[int((sigma > tol).sum()) :].T)


def nice_basis(span: Array, rotation: Array) -> list[Array]:
    """Basis of the space of the columns of ``span`` (3, k): tool axes, base axes, then any."""
    if span.shape[1] == 0:
        return []
    if span.shape[1] == 1:
        inside = span / length(span[:, 0])
    else:
        left, sigma, _ = np.linalg.svd(span, full_matrices=False)
        inside = left[:, sigma > 0.5 * sigma[0]]
    chosen: list[Array] = []
    for axis in (*rotation.T, *np.eye(3), *inside.T):
        inner = inside @ (inside.T @ axis)
        rest = inner.copy()
        for other in chosen:
            rest -= (rest @ other) * other
        if np.linalg.norm(axis - inner) > ALIGNED or np.linalg.norm(rest) < 0.1:
            continue
        chosen.append(rest / np.linalg.norm(rest))
        if len(chosen) == inside.shape[1]:
            break
    return chosen


def axis_name(direction: Array, rotation: Array) -> str:
    """``tool x``, ``base z``, both, or the components in tool axes."""
    tool = _aligned(rotation.T @ direction)
    base = _aligned(direction)
    if tool and base:
        return f"tool {tool} (base {base})"
    if tool or base:
        return f"tool {tool}" if tool else f"base {base}"
    return f"{vector(rotation.T @ direction)} of the tool"


def _aligned(direction: Array) -> str:
    k = int(np.argmax(np.abs(direction)))
    across = float(np.linalg.norm(np.delete(direction, k)))
    return "xyz"[k] if across <= math.sin(ALIGNED) else ""


def vector(components: Array, digits: int = 3) -> str:
    """``(0.707, 0, -0.707)``."""
    return "(" + ", ".join(f"{x:.{digits}f}" for x in np.round(components, digits) + 0.0) + ")"


def _line_words(direction: Array, point: Array, tool: Tool, tol: float) -> str:
    on_it = [
        name
        for name, place in tool.landmarks.items()
        if length(cross(direction, place - point)) <= 10 * tol * tool.size
    ]
    if len(on_it) > 1:
        return "through " + " and ".join(on_it[:2])
    through = vector(point) + " m"
    if on_it:
        through = f"{on_it[0]} {vector(tool.landmarks[on_it[0]])} m"
    base = _aligned(direction)
    along = f"base {base}" if base else f"{vector(direction)} of the base"
    return f"through {through} in direction {along}"
