"""Singular loci of a spherical mechanism over the orientation of its output."""

from __future__ import annotations

from pinsing.loops.pose_equation import pose_equation
from pinsing.loops.pose_forms import PoseForms, PoseLocus
from pinsing.loops.pose_real import has_real_points
from pinsing.loops.sphere_loci import SphereLoci, squares_note
from pinsing.robot.mechanism import Mechanism


def of_sphere(mechanism: Mechanism, found: SphereLoci) -> PoseForms:
    """Over the orientation, and the inputs where they do not drop out."""
    parts = [("type 2", "the planes of the outer links meet in one line", found.type2)]
    for k, (leg, poly) in enumerate(zip(found.legs, found.type1, strict=True), 1):
        name = mechanism.joints[leg.joint]
        parts.append(("type 1", f"leg {k} is folded or stretched: {name} turns nothing", poly))
    squares = squares_note(found)
    loci = [
        # Sums of squares have real zeros too: turns by which an outer axis meets a base axis.
        PoseLocus(kind, words, equation, bool(squares) or has_real_points(equation))
        for kind, words, poly in parts if poly != 0
        for factor, _ in poly.factor()[1]
        for equation in [pose_equation(factor, found.names, (), 1)]
    ]  # fmt: skip
    notes = [squares] if squares else []
    if len(found.names) > 4:
        notes.append(
            "the equations are in the orientation and the inputs together: an orientation and "
            "inputs that close the loops are singular if and only if one of them is zero"
        )
    else:
        notes.append("both links of each leg are quarter circles: the inputs drop out")
    if found.off > 1e-12:
        notes.append(f"axes were made exact, by at most {found.off:.1e}")
    notes.append(
        "exact over the rationals at each step; certificates are of each leg alone (--prove)"
    )
    always = "" if found.type2 != 0 else (
        "architecture singularity: the moments of the legs lie in a plane at every orientation"
    )  # fmt: skip
    return PoseForms(found.names, always, tuple(loci), (), (), True, tuple(notes))
