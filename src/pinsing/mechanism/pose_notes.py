"""What is said beside the loci over the pose: what else is singular, and what they hold for."""

from __future__ import annotations

from collections.abc import Iterator

from pinsing._types import Array
from pinsing.mechanism.pose_hinges import counts_hinges
from pinsing.mechanism.pose_ring import PoseRing
from pinsing.mechanism.three_distances import degree_notes


def _written(axis: Array) -> str:
    return f"({', '.join(f'{v + 0.0:.6g}' for v in axis)})"


def needs(ring: PoseRing) -> Iterator[str]:
    """Notes, one after the other."""
    mechanism = ring.rods.mechanism
    legs = [rod for rod in ring.rods.rods if rod.slides]
    if legs:
        reach = mechanism.lower[[rod.joint for rod in legs]] > 0
        away = ", which the limits exclude" if reach.all() else ""
        tied = any(rod.hinge is not None for rod in ring.rods.rods)
        open_ = tied and not counts_hinges(ring)
        if open_:
            yield (
                "type 1 is not in these equations: the rows of the output and the hinges are not "
                "six together; the equations in the joint angles have it"
            )
        if not open_:
            yield f"type 1: {'also ' if tied else ''}where a leg has no length{away}; nowhere else"
    bent = [str(k) for k, rod in enumerate(ring.rods.rods, 1) if rod.bends]
    if bent:
        which = f"leg {bent[0]} is" if len(bent) == 1 else f"one of legs {', '.join(bent)} is"
        yield f"type 1: where {which} stretched or folded at its actuated elbow; nowhere else"
    if ring.rods.tilted:
        x, y, n = (_written(a) for a in ring.rods.axes)
        own = _written(ring.rods.own[:, 0])
        yield (
            f"x, y and φ are in the plane of the mechanism: x along {x} of the base, y along {y}, "
            f"φ about {n}, zero where {own} of the output is along x"
        )
    if any(rod.moved for rod in ring.rods.rods):
        yield (
            "the equations are in the pose and the inputs together: a pose and inputs that close "
            "the loops are singular if and only if one of them is zero"
        )
        if ring.rods.planar and not mechanism.prismatic[list(ring.drivers)].any():
            yield (
                "the pose alone: eliminating the three inputs by their closure (each quadratic) "
                "multiplies eight working modes, to degree 44 in x and y at a given angle, 42 with "
                "legs of equal lengths (Bonev and Gosselin 2001); not done"
            )
    yield from degree_notes(mechanism)
    if any(rod.hinge is not None for rod in ring.rods.rods):
        yield (
            "poses of this mechanism keep the outer end of each leg in the plane across its hinge; "
            "such a pose is singular if and only if one of the equations holds"
        )
    yield "exact over the rationals at each step; certificates are of each leg alone (--prove)"
