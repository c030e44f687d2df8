"""Singular loci of a spherical mechanism over the orientation of its output."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.algebra.ring import Poly
from pinsing.loops.closure import near_home, random_closed, ranks
from pinsing.loops.dyad import planar_dyad
from pinsing.loops.forms import (
    PoseEquation,
    PoseForms,
    PoseLocus,
    determinant_equation,
    entry,
    has_real_points,
    planar_equation,
    pose_equation,
)
from pinsing.loops.legs import Rod, Rods, rods
from pinsing.loops.mode_counts import point_legs
from pinsing.loops.modes import home
from pinsing.loops.pose_notes import (
    always_dependent,
    architecture,
    in_plane,
    inputs_notes,
    locus_distance,
    needs,
)
from pinsing.loops.pose_ring import (
    PARALLEL,
    PoseRing,
    Row,
    counts_hinges,
    cross,
    determinant,
    every_position,
    hinged_type1,
)
from pinsing.loops.sphere_loci import SphereLoci, sphere_loci, squares_note
from pinsing.loops.structure import output_pose
from pinsing.loops.three_distances import input_loci, rod_length
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


_DEPENDENT = 1e-10
_TRIED = 6
_FEW = 4
_SEED = 2719
"""Roots of the ring's number in the columns of a wrench: force, then moment."""
_ROOTS = (0, 1, 0, 1, 0, 1)


@dataclass(frozen=True, eq=False)
class _Wrench:
    """A force through a point of the output, both as polynomials.

    ``feels``: what the actuated joint of its rod feels of it.
    """

    rod: Rod
    force: Row
    line: Row
    feels: Poly


def turning(found: Rods) -> bool:
    """Whether the loci are over pose and inputs, as determinants."""
    return not found.planar and any(rod.moved or rod.side for rod in found.rods)


def turning_forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    """The loci, each a determinant that is not multiplied out, or one leg's equation."""
    ring = PoseRing(found, False, unit=True)
    wrenches = list(_wrenches(ring))
    notes = list(inputs_notes(ring))
    two = _matrix(ring, [w.line for w in wrenches], _ROOTS)
    words = _words(found)
    if always_dependent(found):
        always = "architecture singularity: the leg lines are dependent whatever the pose"
        return PoseForms(
            ring.names, f"{always}: singular at every pose", (), (), (), True, tuple(notes), (),
            tuple(closing(ring)),
        )  # fmt: skip
    hinged = any(rod.hinge is not None for rod in found.rods)
    kind = "type 2 or constraint" if hinged or len(mechanism.task.rows) < 6 else "type 2"
    loci = [PoseLocus(kind, words, two, has_real_points(two))]
    ones, complete = _type1(ring, wrenches)
    if not complete:
        notes.append(
            "type 1 is not in these equations: the output does not show each of the freedoms once; "
            "the equations in the joint angles have it"
        )
    made = PoseForms(
        ring.names, "", (*loci, *ones), (), (), complete, tuple(notes), (), tuple(closing(ring))
    )
    return _said(mechanism, made)


def closing(ring: PoseRing) -> Iterator[PoseEquation]:
    """Lengths of the rods that are no actuators, and planes of hinges, by pose and inputs."""
    for rod in ring.rods.rods:
        if rod.moved:
            length = rod_length(ring.rods.mechanism, rod)
            yield _equation(ring, ring.length(rod, simple(length)))
        if rod.hinge is not None:
            yield _equation(ring, ring.dot(ring.direction(rod), ring.hinge(rod)))


def simple(value: float) -> Fraction:
    """A length without what the solver left: a short fraction where there is one."""
    short = Fraction(value).limit_denominator(10**4)
    return short if abs(float(short) - value) <= 1e-9 else Fraction(repr(round(value, 12)))


def _equation(ring: PoseRing, poly: Poly) -> PoseEquation:
    return pose_equation(poly, ring.names, ring.odd, ring.square)


def _wrenches(ring: PoseRing) -> Iterator[_Wrench]:
    slides = ring.rods.mechanism.prismatic
    for rod in ring.rods.rods:
        force = ring.force(rod)
        yield _Wrench(rod, force, ring.line(rod), _feels(ring, rod, force))
        if rod.hinge is not None:
            axis = ring.hinge(rod)
            zero = ring.number(0)
            along = ring.motion(rod) if rod.moved and slides[rod.joint] else [zero] * 3
            yield _Wrench(rod, axis, ring.hinge_line(rod), ring.dot(axis, along))


def _feels(ring: PoseRing, rod: Rod, force: Row) -> Poly:
    """Work on the leg's own joint, up to a factor that is zero only where the force is."""
    return ring.moment_arm(rod) if rod.moved else ring.dot(force, force)


def _matrix(ring: PoseRing, rows: list[Row], roots: tuple[int, ...]) -> PoseEquation:
    made = tuple(
        tuple(entry(x, ring.names, ring.odd, ring.square, r)
              for x, r in zip(row, roots, strict=True))
        for row in rows
    )  # fmt: skip
    return determinant_equation(ring.names, made)


def _words(found: Rods) -> str:
    hinged = any(rod.hinge is not None for rod in found.rods)
    across = any(rod.side for rod in found.rods)
    if hinged:
        which = "the forces that the legs pass" if across else "the rod lines"
        return (
            f"{which} and the forces along the hinges through the same points belong to one linear "
            "complex"
        )
    if across:
        return "the six forces that the legs pass belong to one linear complex"
    return "the six rod lines belong to one linear complex"


def _type1(ring: PoseRing, wrenches: list[_Wrench]) -> tuple[list[PoseLocus], bool]:
    """Where a motion leaves the output at rest, and whether that is all told."""
    mechanism = ring.rods.mechanism
    task = sorted(mechanism.task.rows)
    inputs = list(mechanism.actuated)
    if len(task) == 6 and sorted(w.rod.joint for w in wrenches) == sorted(inputs):
        return list(_leg_by_leg(ring)), True
    left = [k for k in range(6) if k not in task]
    if len(left) + len(inputs) != 6 or len(wrenches) != 6:
        return [], False
    zero, rows = ring.number(0), []
    for w in wrenches:
        about = ring.outer(w.rod)
        _, N = ring.turn
        arm = [b - N * ring.variable(n) for b, n in zip(about, "xyz", strict=True)]
        whole = [*w.force, *cross(arm, w.force)]
        feels = [w.feels if j == w.rod.joint else zero for j in inputs]
        rows.append([*(whole[k] for k in left), *feels])
    found = _matrix(ring, rows, (*(_ROOTS[k] for k in left), *[0] * len(inputs)))
    if _always_zero(found):
        return [], False
    words = "a motion of the joints leaves the rows of the output at rest"
    return [PoseLocus("type 1", words, found, has_real_points(found))], True


def _leg_by_leg(ring: PoseRing) -> Iterator[PoseLocus]:
    mechanism = ring.rods.mechanism
    for k, rod in enumerate(ring.rods.rods, 1):
        if not rod.moved:
            continue
        name = mechanism.joints[rod.joint]
        words = (
            f"rod {k} is across the slide {name}" if mechanism.prismatic[rod.joint]
            else f"rod {k} is in a plane with the axis of crank {name} and its pin"
        )  # fmt: skip
        for factor, _ in ring.moment_arm(rod).factor()[1]:
            made = _equation(ring, factor)
            yield PoseLocus("type 1", words, made, has_real_points(made))


def _always_zero(found: PoseEquation) -> bool:
    """Whether a determinant is zero, to rounding, at random values of its variables."""
    x = np.random.default_rng(_SEED).normal(size=(_TRIED, len(found.names)))
    sigma = np.linalg.svd(found.entries(x), compute_uv=False)
    return bool((sigma[:, -1] <= _DEPENDENT * sigma[:, 0]).all())


def _said(mechanism: Mechanism, made: PoseForms) -> PoseForms:
    """With what is to be said where a locus holds at every closed configuration that was tried."""
    tried = near_home(mechanism) + random_closed(mechanism, _TRIED, np.random.default_rng(_SEED))
    two = replace(made, loci=made.loci[:1])
    if len(tried) < _FEW or max(locus_distance(mechanism, two, q) for q in tried) > _DEPENDENT:
        return made
    return replace(
        made, architecture=f"{made.loci[0].kind} at each of the {len(tried)} closed "
        "configurations tried: taken for singular at every pose",
    )  # fmt: skip


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
        alone = tuple(_type1_loci(ring))
        return PoseForms(ring.names, words, alone, (), (), True, tuple(notes))
    loci = [*_split(ring, together), *_type1_loci(ring)]
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
        _equation_loci(ring, ring.length(rod, simple(rod_length(ring.rods.mechanism, rod))))
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


def _type1_loci(ring: PoseRing) -> Iterator[PoseLocus]:
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
        found = _equation_loci(ring, ring.length(rod, simple(reach)))
        words = f"leg {leg} is {shape} at its actuated elbow {name}"
        # A circle, or its centre where both links are alike: real.
        yield PoseLocus("type 1", words, found, True)


def _locus(ring: PoseRing, kind: str, factor: Any, words: str) -> PoseLocus:
    found = _equation_loci(ring, factor)
    return PoseLocus(kind, words, found, has_real_points(found))


def _equation_loci(ring: PoseRing, factor: Any) -> PoseEquation:
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
