"""Singular loci over the pose of the output, in closed form, where each leg passes one force.

Type 2 (and constraint): the forces that the legs pass on with the actuators locked are dependent.
Their Plücker coordinates are polynomials in the pose; the determinant of six of them (three in the
plane) is the equation, exactly. After Merlet, "Singular configurations of parallel manipulators and
Grassmann geometry" (1989), and St-Onge and Gosselin, "Singularity analysis and representation of
the general Gough-Stewart platform" (2000), who give its degree: three in the position.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pinsing.loops.closure import ranks
from pinsing.loops.every_position import every_position
from pinsing.loops.likeness import output_pose
from pinsing.loops.modes import home
from pinsing.loops.pose_architecture import always_dependent, architecture
from pinsing.loops.pose_equation import PoseEquation, planar_equation, pose_equation
from pinsing.loops.pose_forms import PoseForms, PoseLocus
from pinsing.loops.pose_hinges import counts_hinges, hinged_type1
from pinsing.loops.pose_notes import needs
from pinsing.loops.pose_point import point_forms
from pinsing.loops.pose_real import has_real_points
from pinsing.loops.pose_ring import PARALLEL, PoseRing, cross, determinant
from pinsing.loops.pose_sphere import of_sphere
from pinsing.loops.pose_turning import simple, turning, turning_forms
from pinsing.loops.rod import Rod, Rods
from pinsing.loops.rods import rods
from pinsing.loops.sphere_loci import sphere_loci
from pinsing.loops.three_distances import input_loci, rod_length
from pinsing.robot.mechanism import Mechanism


def pose_forms(mechanism: Mechanism) -> PoseForms | None:
    """Closed forms over the pose; None where a leg passes more, or other things, than one force.

    A spherical mechanism of three legs has them over its orientation, a five-bar on slides, or a
    welded one, over the position of its middle pin.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.

    Returns
    -------
    PoseForms or None
        With ``str()``: the equations in words.

    Raises
    ------
    PinsingError
        If the loops close nowhere.
    """
    ranks(mechanism)
    found = rods(mechanism)
    sphere = sphere_loci(mechanism) if found is None else None
    if sphere is not None:
        return mechanism.once("pose_forms", lambda: of_sphere(mechanism, sphere))
    if found is None:
        return mechanism.once("pose_forms", lambda: point_forms(mechanism))
    return mechanism.once("pose_forms", lambda: _forms(mechanism, found))


def _forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    level = turning(found) and _upright(mechanism, found)
    if turning(found) and not level:
        return turning_forms(mechanism, found)
    notes: list[str] = []
    if level:
        notes.append(
            "equations without e0, e1, e2, e3 are of an output that keeps the axes of the base (its"
            " translational mode) and count there alone, where they are what the determinants come "
            "down to; the determinants hold whether it is turned or not"
        )
    ring = PoseRing(found, level)
    if ring.off > 1e-12:
        notes.append(f"coordinates were made exact, by at most {ring.off:.1e} m")
    if ring.snapped > 0:
        notes.append(
            f"rods of one crank that are parallel to {PARALLEL:g} m were taken as parallel (their "
            f"ends were moved by at most {ring.snapped:.1e} m)"
        )
    together = _together(ring)
    notes += [] if level and together != 0 else list(needs(ring))
    if together != 0 and always_dependent(found):
        notes.append(
            "the coordinates of the file make the lines dependent to 1e-9 of their size, at every "
            "pose tried; that is taken for what is meant"
        )
        together = ring.number(0)
    if together == 0:
        words = architecture(found)
        alone = tuple(_type1(ring))
        return PoseForms(ring.names, words, alone, (), (), True, tuple(notes))
    loci = [*_split(ring, together), *_type1(ring)]
    if level:
        return _in_all_modes(turning_forms(mechanism, found), loci, notes)
    families = every_position(ring, together)
    tied = any(rod.hinge is not None for rod in found.rods)
    return PoseForms(
        ring.names, "", tuple(loci), families, tuple(_at_home(mechanism, ring, together)),
        not tied or counts_hinges(ring), tuple(notes), tuple(_over_inputs(mechanism)),
        _closing(ring),
    )  # fmt: skip


def _in_all_modes(turned: PoseForms, loci: Sequence[PoseLocus], notes: Sequence[str]) -> PoseForms:
    """Loci of a level output, then the determinants that hold for a turned one, too."""
    more = [replace(x, words=f"turned or not, {x.words}") for x in turned.loci]
    return replace(turned, loci=(*loci, *more), notes=tuple(dict.fromkeys([*notes, *turned.notes])))


def _closing(ring: PoseRing) -> tuple[PoseEquation, ...]:
    """Lengths of rods by pose and inputs, where the loci are in both."""
    return tuple(
        _equation(ring, ring.length(rod, simple(rod_length(ring.rods.mechanism, rod))))
        for rod in ring.rods.rods if rod.moved
    )  # fmt: skip


def _upright(mechanism: Mechanism, found: Rods) -> bool:
    """Whether the output moves along the axes of the base and is not turned at home."""
    if any(rod.side or rod.hinge is not None for rod in found.rods):
        return False
    away = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max()
    return bool(away < 1e-9) and set(mechanism.task.rows) == {0, 1, 2}


def _over_inputs(mechanism: Mechanism) -> Iterator[PoseLocus]:
    words = "over the inputs, where two assembly modes meet"
    for found in input_loci(mechanism):
        yield PoseLocus("type 2", words, found, has_real_points(found))


def _together(ring: PoseRing) -> Any:
    """The determinant of all forces; zero as a polynomial where every pose is singular."""
    lines = [ring.line(rod) for rod in ring.rods.rods]
    lines += [ring.hinge_line(rod) for rod in ring.rods.rods if rod.hinge is not None]
    return ring.without_norm(determinant(lines, ring.number(1)))


def _pairs(ring: PoseRing) -> list[tuple[Rod, Rod]]:
    """Rods that share a crank, two by two."""
    out = []
    for joint in ring.drivers:
        mine = [r for r in ring.rods.rods if r.joint == joint]
        if len(mine) != 2:
            return []
        out.append((mine[0], mine[1]))
    return out


def _split(ring: PoseRing, together: Any) -> Iterator[PoseLocus]:
    """Factors of the determinant with what each means."""
    hinged = any(rod.hinge is not None for rod in ring.rods.rods)
    names = _rod_names(ring.rods.rods)
    kind = "type 2 or constraint" if hinged else "type 2"
    if ring.rods.planar:
        words = f"{names} meet in one point or are parallel"
    elif hinged:
        words = (
            f"{names} and the forces along the hinges through the same points belong to one linear "
            "complex"
        )
    else:
        words = "the six leg lines belong to one linear complex"
    parallel = _parallelograms(ring)
    for factor, _ in together.factor()[1]:
        if parallel is not None and divmod(parallel[0], factor)[1] == 0:
            yield _locus(
                ring, "type 2", factor,
                "the rods are parallel to a plane, or two pairs of them to each other",
            )  # fmt: skip
        elif parallel is not None and divmod(parallel[1], factor)[1] == 0:
            yield _locus(
                ring, "constraint", factor,
                "the normals of the three parallelograms are parallel to a plane: the output can "
                "turn",
            )  # fmt: skip
        else:
            yield _locus(ring, kind, factor, words)


def _parallelograms(ring: PoseRing) -> tuple[Any, Any] | None:
    """With the output level and two rods a crank: determinants of directions and of normals."""
    pairs = _pairs(ring) if ring.level else []
    if len(pairs) != 3:
        return None
    directions, normals = [], []
    for one, two in pairs:
        d, other = ring.direction(one), ring.direction(two)
        if any(a != b for a, b in zip(d, other, strict=True)):
            return None
        apart = [b - a for a, b in zip(ring.outer(one), ring.outer(two), strict=True)]
        directions.append(d)
        normals.append(cross(apart, d))
    one_ = ring.number(1)
    return determinant(directions, one_), determinant(normals, one_)


def _type1(ring: PoseRing) -> Iterator[PoseLocus]:
    seen: list[Any] = []
    for factor, _ in hinged_type1(ring).factor()[1] if counts_hinges(ring) else ():
        words = "a motion that the hinges allow leaves the rows of the output at rest"
        yield _locus(ring, "type 1", factor, words)
    for k, rod in enumerate(ring.rods.rods, 1):
        if rod.bends:
            yield from _elbow(ring, k, rod)
        if not rod.moved:
            continue
        name = ring.rods.mechanism.joints[rod.joint]
        slides = ring.rods.mechanism.prismatic[rod.joint]
        if slides:
            words = f"rod {k} is across the slide {name}"
        elif ring.rods.planar:
            words = f"crank {name} and its rod are in line"
        else:
            words = f"the rods of crank {name} are in line with it, or meet its axis"
        for factor, _ in ring.without_norm(ring.moment_arm(rod)).factor()[1]:
            if factor not in seen:
                seen.append(factor)
                yield _locus(ring, "type 1", factor, words)


def _elbow(ring: PoseRing, leg: int, rod: Rod) -> Iterator[PoseLocus]:
    """Where both links of a leg that is driven at its elbow are in line."""
    name = ring.rods.mechanism.joints[rod.joint]
    one, two = rod.links
    for reach, shape in ((one + two, "stretched"), (abs(one - two), "folded")):
        found = _equation(ring, ring.length(rod, simple(reach)))
        words = f"leg {leg} is {shape} at its actuated elbow {name}"
        # A circle, or its centre where both links are alike: real.
        yield PoseLocus("type 1", words, found, True)


def _locus(ring: PoseRing, kind: str, factor: Any, words: str) -> PoseLocus:
    found = _equation(ring, factor)
    return PoseLocus(kind, words, found, has_real_points(found))


def _equation(ring: PoseRing, factor: Any) -> PoseEquation:
    if ring.rods.planar:
        half = (ring.names.index("e0"), ring.names.index("e3"))
        return planar_equation(factor, ring.names, ring.odd, ring.square, half)
    return pose_equation(factor, ring.names, ring.odd, ring.square)


def _rod_names(found: Sequence[Rod]) -> str:
    numbers = [str(k) for k in range(1, len(found) + 1)]
    return f"the lines of legs {', '.join(numbers[:-1])} and {numbers[-1]}"


def _at_home(mechanism: Mechanism, ring: PoseRing, together: Any) -> Iterator[PoseLocus]:
    """The locus where the output is turned as at home, if that is not at all."""
    if ring.level or any(rod.moved for rod in ring.rods.rods):
        return
    there = ring.rods.placed(output_pose(mechanism, home(mechanism)))
    if np.abs(there.rotation - np.eye(3)).max() > 1e-9:
        return
    gens = ring.context.names()
    values = {
        gens[k]: int(n == "e0") for k, n in enumerate(ring.names) if n[0] == "e" and n[1:].isdigit()
    }
    left = together.subs(values)
    if left == 0:
        return
    for factor, _ in left.factor()[1]:
        if not factor.is_constant():
            found = pose_equation(factor, ring.names, ring.odd, ring.square)
            yield PoseLocus(
                "type 2", "with the output turned as at home", found, has_real_points(found)
            )
