"""Singular loci of a five-bar over the position of its middle pin, which is the output.

Each leg passes one force on the pin, along its rod, whether the rod hangs on a crank or on a slide:
type 2 is where both rods are in line, type 1 where a rod is in line with its crank or across its
slide.
"""

from __future__ import annotations

from pinsing.loops.dyad import planar_dyad
from pinsing.loops.pose_equation import PoseEquation, pose_equation
from pinsing.loops.pose_forms import PoseForms, PoseLocus
from pinsing.loops.pose_notes import in_plane
from pinsing.loops.pose_real import has_real_points
from pinsing.loops.pose_ring import PoseRing
from pinsing.loops.pose_turning import simple
from pinsing.loops.three_pins import point_legs
from pinsing.robot.mechanism import Mechanism


def point_forms(mechanism: Mechanism) -> PoseForms | None:
    """Over the position and the inputs; None of others, and where the inputs alone will do."""
    legs = point_legs(mechanism)
    if legs is None or planar_dyad(mechanism) is not None:
        return None
    found = legs.rods
    ring = PoseRing(found, level=True)
    (a, b, _), (c, d, _) = (ring.direction(rod) for rod in found.rods)
    parts = [("type 2", "both rods are in line", a * d - b * c)]
    for k, rod in enumerate(found.rods, 1):
        name = mechanism.joints[rod.joint]
        slides = mechanism.prismatic[rod.joint]
        words = f"rod {k} is across the slide {name}" if slides else (
            f"crank {name} and its rod are in line"
        )  # fmt: skip
        parts.append(("type 1", words, ring.moment_arm(rod)))

    def written(poly: object) -> PoseEquation:
        return pose_equation(poly, ring.names, ring.odd, ring.square)

    loci = [
        PoseLocus(kind, words, equation, has_real_points(equation))
        for kind, words, poly in parts
        for factor, _ in poly.factor()[1]
        for equation in [written(factor)]
    ]
    closing = tuple(
        written(ring.length(rod, simple(length)))
        for rod, length in zip(found.rods, legs.lengths, strict=True)
    )
    notes = [*in_plane(found, turns=False)]
    notes += [
        "the equations are in the position and the inputs together: a position and inputs that "
        "close the loop are singular if and only if one of them is zero"
    ]
    if ring.off > 1e-12:
        notes.append(f"coordinates were made exact, by at most {ring.off:.1e} m")
    notes.append(
        "exact over the rationals at each step; certificates are of each leg alone (--prove)"
    )
    return PoseForms(ring.names, "", tuple(loci), (), (), True, tuple(notes), (), closing)
