"""Type 1 over the pose where the legs tie the output: hinges at the feet (3-RPS and its like).

Each such leg keeps its end in the plane across its hinge: a force along the hinge through that end
does no work. A motion that the hinges allow and that leaves the rows of the output at rest is there
where the forces and these rows, taken as forces and moments on the output, are dependent.
"""

from __future__ import annotations

from pinsing.algebra.ring import Poly
from pinsing.loops.pose_ring import PoseRing, cross, determinant


def counts_hinges(ring: PoseRing) -> bool:
    """Whether forces along hinges and rows of the output are six together."""
    hinges = sum(rod.hinge is not None for rod in ring.rods.rods)
    return hinges > 0 and hinges + len(ring.rods.mechanism.task.rows) == 6


def hinged_type1(ring: PoseRing) -> Poly:
    """The determinant of both; a constant where the output does not show each of the freedoms."""
    zero, one = ring.number(0), ring.number(1)
    at = [ring.variable(n) for n in "xyz"]
    rows = [ring.hinge_line(rod) for rod in ring.rods.rods if rod.hinge is not None]
    for k in ring.rods.mechanism.task.rows:
        unit = [one if i == k % 3 else zero for i in range(3)]
        rows.append([*unit, *cross(at, unit)] if k < 3 else [zero, zero, zero, *unit])
    value = determinant(rows, one)
    return one if value == 0 else ring.without_norm(value)
