"""How near a configuration is to the loci over the pose, and what their variables are there."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.loops.likeness import output_pose
from pinsing.loops.pose import pose_of
from pinsing.loops.pose_equation import PoseEquation
from pinsing.loops.pose_forms import PoseForms
from pinsing.loops.rod import Rods
from pinsing.loops.rods import rods
from pinsing.loops.three_pins import point_legs
from pinsing.robot.mechanism import Mechanism

_LEVEL = 1e-9
_TURNS = ("e0", "e1", "e2", "e3")


def locus_distance(mechanism: Mechanism, forms: PoseForms, q: Array) -> float:
    """The least of the equations' values at q (n,), each over the size that its terms can have.

    Lengths count with the size of the mechanism, all else with 1: a term that is zero by itself,
    as in ``e3 = 0``, says how near it is.
    """
    at = variables_at(mechanism, forms, q)
    found = _rods(mechanism)
    places = [] if found is None else [p for r in found.rods for p in (r.inner, r.outer)]
    reach = max((float(np.linalg.norm(p)) for p in places), default=mechanism.length_scale)
    reach = max(reach, *(abs(at[n]) for n in "xyz"))
    # Beside equations in the quaternion those without it are of a level output.
    turned = "e0" in forms.variables and "z" in forms.variables and abs(at["e0"]) < 1 - _LEVEL
    loci = [x for x in forms.loci if not turned or "e0" in x.equation.names]
    return min(_relative(locus.equation, at, reach) for locus in loci)


def variables_at(mechanism: Mechanism, forms: PoseForms, q: Array) -> dict[str, float]:
    """Values of the variables of equations at a configuration q (n,)."""
    found = _rods(mechanism)
    there = output_pose(mechanism, q)
    pose = pose_of(there if found is None else found.placed(there))
    out = dict(zip("xyz", pose.position, strict=True))
    out |= {f"e{k}": e for k, e in enumerate(pose.quaternion)}
    out["cos φ"], out["sin φ"] = float(np.cos(pose.angles[2])), float(np.sin(pose.angles[2]))
    for name, value in zip(mechanism.joints, q.tolist(), strict=True):
        out[name] = value
        out[f"cos {name}"], out[f"sin {name}"] = float(np.cos(value)), float(np.sin(value))
    return out


def _rods(mechanism: Mechanism) -> Rods | None:
    """Of legs that pass one force on the output, or of a five-bar on its pin."""
    if (found := rods(mechanism)) is not None:
        return found
    legs = point_legs(mechanism)
    return None if legs is None else legs.rods


def _relative(equation: PoseEquation, at: dict[str, float], reach: float) -> float:
    x = np.array([at[n] for n in equation.names])
    turning = [n in _TURNS or n.startswith(("cos ", "sin ")) for n in equation.names]
    most = np.where(turning, 1.0, np.maximum(np.abs(x), reach))
    if equation.matrix:
        sizes = np.array([[_size(e, most) for e in row] for row in equation.matrix])
        return _dependent(equation.entries(x), sizes)
    size = _size(equation, most)
    return abs(float(equation(x))) / size if size > 0 else 0.0


def _size(equation: PoseEquation, most: Array) -> float:
    """What its largest term can be."""
    terms = np.prod(most**equation.powers, axis=1) * equation.values
    return float(np.abs(terms).max(initial=0.0))


def _dependent(matrix: Array, sizes: Array) -> float:
    """The least singular value over the largest, columns and rows by what they can be."""
    columns = sizes.max(axis=0)
    columns = np.where(columns > 0, columns, 1.0)
    rows = (sizes / columns).max(axis=1)
    level = matrix / columns / np.where(rows > 0, rows, 1.0)[:, None]
    sigma = np.linalg.svd(level, compute_uv=False)
    return float(sigma[-1] / sigma[0]) if sigma[0] > 0 else 0.0
