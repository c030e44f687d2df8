"""What a mechanism's output cannot do, or does by itself, in words and as arrows."""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.motion import MechanismState
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-6


@dataclass(frozen=True, eq=False)
class Lost:
    """An output motion that no input speed brings about (type 1), given by its wrench.

    Attributes
    ----------
    force, moment : (3,) arrays
        Unit wrench at the output that no actuator feels: its power is zero in every motion.
    line : (3,) array or None
        A point on the line of the force; None where it has none, or not the line of a pure
        force.
    words : str
        In one sentence.
    """

    force: Array
    moment: Array
    line: Array | None
    words: str


@dataclass(frozen=True, eq=False)
class Free:
    """An output motion with all actuators at rest (type 2).

    Attributes
    ----------
    velocity, turning : (3,) arrays
        Of the output frame: metres and radians, one of them of unit size.
    centre : (3,) array or None
        A point on the axis that it turns about; None where it does not turn, or screws.
    words : str
        In one sentence.
    """

    velocity: Array
    turning: Array
    centre: Array | None
    words: str


def lost_motions(mechanism: Mechanism, state: MechanismState) -> tuple[Lost, ...]:
    """Output directions lost at a type 1 singularity."""
    return tuple(_lost(mechanism, state.position, column) for column in state.lost.T)


def free_motions(mechanism: Mechanism, state: MechanismState) -> tuple[Free, ...]:
    """Output velocities that the actuators do not control at a type 2 singularity."""
    return tuple(_free(mechanism, state.position, column) for column in state.uncontrolled.T)


def _lost(mechanism: Mechanism, at: Array, direction: Array) -> Lost:
    # Columns are without units: a power u . (v / L, w), so the force is u_v / L.
    force, moment = _spread(mechanism, direction, 1 / mechanism.length_scale)
    size = float(np.linalg.norm(force))
    if size <= _SMALL:
        axis = _unit(moment)
        return Lost(
            np.zeros(3), axis, None, f"{mechanism.output} cannot turn about {_direction(axis)}"
        )
    force, moment = force / size, moment / size
    if np.linalg.norm(moment) <= _SMALL:
        words = f"{mechanism.output} cannot move along {_direction(force)}"
        return Lost(force, np.zeros(3), at, words)
    if abs(force @ moment) > _SMALL:
        words = f"a screw of {mechanism.output} about {_direction(force)} is lost"
        return Lost(force, moment, None, words)
    point = at + np.cross(force, moment)
    words = (
        f"{mechanism.output}'s link cannot move along the line through {_point(point)} m "
        f"in direction {_direction(force)}"
    )
    return Lost(force, moment, point, words)


def _free(mechanism: Mechanism, at: Array, column: Array) -> Free:
    velocity, turning = _spread(mechanism, column, mechanism.length_scale)
    name, rate = mechanism.output, float(np.linalg.norm(turning))
    if rate <= _SMALL * max(float(np.linalg.norm(velocity)), 1.0):
        if np.linalg.norm(velocity) <= _SMALL:
            words = f"{name} stays, but the linkage moves with the actuators locked"
            return Free(np.zeros(3), np.zeros(3), None, words)
        along = _unit(velocity)
        words = f"{name} gives way along {_direction(along)} with the actuators locked"
        return Free(along, np.zeros(3), None, words)
    velocity, turning = velocity / rate, turning / rate
    if abs(velocity @ turning) > _SMALL:
        words = f"{name} screws about {_direction(turning)} with the actuators locked"
        return Free(velocity, turning, None, words)
    centre = at + np.cross(turning, velocity)
    only_turns = not {0, 1, 2} & set(mechanism.task.rows)
    where = "" if only_turns else f" through {_point(centre)} m"
    words = f"{name} turns about {_direction(turning)}{where} with the actuators locked"
    return Free(velocity, turning, centre, words)


def _spread(mechanism: Mechanism, column: Array, length: float) -> tuple[Array, Array]:
    """Translation and rotation part of a column over the task rows; the former by ``length``."""
    rows = np.zeros(6)
    rows[list(mechanism.task.rows)] = column
    return rows[:3] * length, rows[3:]


def _unit(vector: Array) -> Array:
    size = float(np.linalg.norm(vector))
    return vector / size if size > 0 else vector


def _direction(vector: Array) -> str:
    """``x``, or components; either sense of a line is the same."""
    vector = vector * np.sign(vector[int(np.argmax(np.abs(vector).round(6)))])
    for name, axis in zip("xyz", np.eye(3), strict=True):
        if np.abs(vector - axis).max() <= _SMALL:
            return name
    return _point(vector)


def _point(vector: Array) -> str:
    return "(" + ", ".join(f"{x + 0.0:.3f}" for x in vector.round(3)) + ")"
