"""Singular loci over the pose of the output, in closed form, where each leg passes one force.

Type 2 (and constraint): the forces that the legs pass on with the actuators locked are dependent.
Their Plücker coordinates are polynomials in the pose, and in the inputs where these move their
inner ends; the determinant of six of them (three in the plane) is the equation, exactly. After
Merlet, "Singular configurations of parallel manipulators and Grassmann geometry" (1989), "Parallel
Robots" (2006), chapters 2 and 6, and St-Onge and Gosselin, "Singularity analysis and representation
of the general Gough-Stewart platform" (2000), who give its degree: three in the position. With what
each actuator feels of them and the motions of the output that its rows leave out, a determinant
too, comes type 1. Of legs on cranks, rails or driven feet in space the determinants have tens of
thousands of terms: they stay determinants, and `closing` says which poses and inputs go together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pinsing.algebra.ring import Poly
from pinsing.loops.closure import near_home, random_closed, ranks
from pinsing.loops.dyad import planar_dyad
from pinsing.loops.exact import Row, cross, short_fraction
from pinsing.loops.forms import (
    PoseEquation,
    PoseForms,
    PoseLocus,
    has_real_points,
    pose_equation,
    random_variables,
)
from pinsing.loops.legs import Rod, Rods, rods
from pinsing.loops.mode_counts import point_legs
from pinsing.loops.modes import home
from pinsing.loops.pose_notes import (
    PROOFS,
    in_plane,
    inputs_notes,
    locus_distance,
    made_exact,
    needs,
    with_inputs,
)
from pinsing.loops.pose_ring import (
    PARALLEL,
    PoseRing,
    counts_hinges,
    determinant,
    every_position,
    hinged_type1,
)
from pinsing.loops.sphere_loci import SphereLoci, sphere_loci, squares_note
from pinsing.loops.structure import once, output_pose
from pinsing.loops.three_distances import input_loci
from pinsing.robot.mechanism import Mechanism


@once
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
    if found is not None:
        return _forms(mechanism, found)
    sphere = sphere_loci(mechanism)
    return _point_forms(mechanism) if sphere is None else _sphere_forms(mechanism, sphere)


Part = tuple[str, str, Any, bool]
"""Kind, words, a polynomial, and whether it has real points whatever its signs."""


def _loci(ring: PoseRing, parts: Iterable[Part]) -> list[PoseLocus]:
    """Loci of polynomials that are taken as they are, each once."""
    out: list[PoseLocus] = []
    seen: list[Any] = []
    for kind, words, poly, sure in parts:
        if (kind, poly) not in seen:
            seen.append((kind, poly))
            found = ring.equation(poly)
            out.append(PoseLocus(kind, words, found, sure or has_real_points(found)))
    return out


def _factors(parts: Iterable[tuple[str, str, Any]]) -> Iterator[Part]:
    for kind, words, poly in parts:
        for factor, _ in poly.factor()[1] if poly != 0 else ():
            yield kind, words, factor, False


def _sphere_forms(mechanism: Mechanism, found: SphereLoci) -> PoseForms:
    """Over the orientation, and the inputs where they do not drop out."""
    parts = [("type 2", "the planes of the outer links meet in one line", found.type2)]
    for k, (leg, poly) in enumerate(zip(found.legs, found.type1, strict=True), 1):
        name = mechanism.joints[leg.joint]
        parts.append(("type 1", f"leg {k} is folded or stretched: {name} turns nothing", poly))
    squares = squares_note(found)
    loci = []
    for kind, words, factor, _ in _factors(parts):
        equation = pose_equation(factor, found.names, (), 1)
        # Sums of squares have real zeros too: turns by which an outer axis meets a base axis.
        real = bool(squares) or has_real_points(equation)
        loci.append(PoseLocus(kind, words, equation, real))
    notes = [squares] if squares else []
    if len(found.names) > 4:
        notes.append(with_inputs("orientation", "loops", "an"))
    else:
        notes.append("both links of each leg are quarter circles: the inputs drop out")
    if found.off > 1e-12:
        notes.append(f"axes were made exact, by at most {found.off:.1e}")
    notes.append(PROOFS)
    always = "" if found.type2 != 0 else (
        "architecture singularity: the moments of the legs lie in a plane at every orientation"
    )  # fmt: skip
    return PoseForms(found.names, always, tuple(loci), (), (), True, tuple(notes))


def _point_forms(mechanism: Mechanism) -> PoseForms | None:
    """Of a five-bar over the position of its middle pin, the output, and the inputs.

    Each leg passes one force on the pin, along its rod. None of others, and where the inputs alone
    will do.
    """
    found = point_legs(mechanism)
    if found is None or planar_dyad(mechanism) is not None:
        return None
    ring = PoseRing(found, level=True)
    (a, b, _), (c, d, _) = (ring.direction(rod) for rod in found.rods)
    both = _factors([("type 2", "both rods are in line", a * d - b * c)])
    loci = [*_loci(ring, both), *_type1(ring)]
    both_in = with_inputs("position", "loop", "a")
    notes = (*in_plane(found, turns=False), both_in, *made_exact(ring), PROOFS)
    return PoseForms(ring.names, "", tuple(loci), (), (), True, notes, (), _closing(ring))


def _forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    turning = not found.planar and any(rod.moved or rod.side for rod in found.rods)
    level = turning and _upright(mechanism, found)
    if turning and not level:
        return _turning_forms(mechanism, found)
    notes: list[str] = []
    if level:
        notes.append(
            "equations without e0, e1, e2, e3 are of an output that keeps the axes of the base (its"
            " translational mode) and count there alone, where they are what the determinants come "
            "down to; the determinants hold whether it is turned or not"
        )
    ring = PoseRing(found, level)
    notes += made_exact(ring)
    if ring.snapped > 0:
        notes.append(
            f"rods of one crank that are parallel to {PARALLEL:g} m were taken as parallel (their "
            f"ends were moved by at most {ring.snapped:.1e} m)"
        )
    lines = ring.lines()
    # Zero as a polynomial where every pose is singular.
    together = ring.without_norm(determinant(lines, ring.number(1)))
    notes += [] if level and together != 0 else list(needs(ring))
    if together != 0 and _dependent(ring.determinant(lines)):
        notes.append(
            "the coordinates of the file make the lines dependent to 1e-9 of their size, at every "
            "pose tried; that is taken for what is meant"
        )
        together = ring.number(0)
    ones = _type1(ring)
    if together == 0:
        words = _architecture(found)
        return PoseForms(ring.names, words, tuple(ones), (), (), True, tuple(notes))
    loci = [*_loci(ring, _split(ring, together)), *ones]
    if level:
        # Of an output that is not turned, then the determinants that hold for a turned one, too.
        turned = _turning_forms(mechanism, found)
        more = [replace(x, words=f"turned or not, {x.words}") for x in turned.loci]
        said = tuple(dict.fromkeys([*notes, *turned.notes]))
        return replace(turned, loci=(*loci, *more), notes=said)
    words = "over the inputs, where two assembly modes meet"
    inputs = tuple(PoseLocus("type 2", words, x, has_real_points(x)) for x in input_loci(mechanism))
    return PoseForms(
        ring.names, "", tuple(loci), every_position(ring, together),
        tuple(_at_home(mechanism, ring, together)), not found.hinged or counts_hinges(ring),
        tuple(notes), inputs, _closing(ring),
    )  # fmt: skip


def _architecture(found: Rods) -> str:
    """Words for lines that are dependent at every pose."""
    a, b = (np.array([getattr(r, end) for r in found.rods]) for end in ("inner", "outer"))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    # Whether the outer points are the inner ones moved, turned and scaled.
    U, sigma, Vt = np.linalg.svd(a.T @ b)
    size = float(sigma.sum() / (a**2).sum())
    near = np.abs(size * a @ (U @ Vt) - b).max() <= 1e-9 * max(1.0, float(np.abs(b).max()))
    why = "the leg lines are dependent whatever the pose"
    if near and not any(r.moved or r.side for r in found.rods):
        why = f"platform and base {'triangles' if len(a) == 3 else 'hexagons'} are similar"
    return f"architecture singularity: {why}: singular at every pose"


def _turning_forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    """Of legs on cranks, rails or driven feet in space: determinants, or one leg's equation."""
    ring = PoseRing(found, False, unit=True)
    notes = list(inputs_notes(ring))
    two, closing = ring.determinant(ring.lines()), _closing(ring)
    if _dependent(two):
        always = "architecture singularity: the leg lines are dependent whatever the pose"
        return PoseForms(
            ring.names,
            f"{always}: singular at every pose",
            (),
            (),
            (),
            True,
            tuple(notes),
            (),
            closing,
        )
    kind = "type 2 or constraint" if found.hinged or len(mechanism.task.rows) < 6 else "type 2"
    loci = [PoseLocus(kind, _complex(found), two, has_real_points(two))]
    ones = _turning_type1(ring)
    if ones is None:
        notes.append(
            "type 1 is not in these equations: the output does not show each of the freedoms once; "
            "the equations in the joint angles have it"
        )
    made = PoseForms(
        ring.names, "", (*loci, *(ones or ())), (), (), ones is not None, tuple(notes), (), closing
    )
    tried = near_home(mechanism) + random_closed(mechanism, 6, np.random.default_rng(2719))
    alone = replace(made, loci=made.loci[:1])
    if len(tried) < 4 or max(locus_distance(mechanism, alone, q) for q in tried) > 1e-10:
        return made
    return replace(
        made, architecture=f"{kind} at each of the {len(tried)} closed configurations tried: taken "
        "for singular at every pose",
    )  # fmt: skip


def _closing(ring: PoseRing) -> tuple[PoseEquation, ...]:
    """Lengths of rods that are no actuators, and planes of hinges, by pose and inputs."""
    out = []
    for rod in ring.rods.rods:
        if rod.moved:
            out.append(ring.length(rod, short_fraction(ring.rods.length(rod))))
        if rod.hinge is not None and ring.unit:
            out.append(ring.dot(ring.direction(rod), ring.hinge(rod)))
    return tuple(ring.equation(x) for x in out)


def _dependent(found: PoseEquation) -> bool:
    """Whether the rows of a determinant are dependent, to the rounding of a file, at random."""
    M = found.entries(random_variables(found.names, 6))
    M = M / np.maximum(np.linalg.norm(M, axis=-1), 1e-300)[..., None]
    sigma = np.linalg.svd(M, compute_uv=False)
    return bool((sigma[:, -1] <= 1e-9 * sigma[:, 0]).all())


def _complex(found: Rods) -> str:
    across = any(rod.side for rod in found.rods)
    if found.hinged:
        which = "the forces that the legs pass" if across else "the rod lines"
        return (
            f"{which} and the forces along the hinges through the same points belong to one linear "
            "complex"
        )
    which = "forces that the legs pass" if across else "rod lines"
    return f"the six {which} belong to one linear complex"


def _turning_type1(ring: PoseRing) -> list[PoseLocus] | None:
    """Where a motion leaves the output at rest; None where these equations do not tell."""
    mechanism = ring.rods.mechanism
    task, inputs = sorted(mechanism.task.rows), list(mechanism.actuated)
    wrenches = list(_wrenches(ring))
    if len(task) == 6 and sorted(rod.joint for rod, _, _ in wrenches) == sorted(inputs):
        return _type1(ring)
    left = [k for k in range(6) if k not in task]
    if len(left) + len(inputs) != 6 or len(wrenches) != 6:
        return None
    zero, rows = ring.number(0), []
    for rod, force, feels in wrenches:
        N, at = ring.turn[1], ring.outer(rod)
        arm = [b - N * ring.variable(n) for b, n in zip(at, "xyz", strict=True)]
        whole = [*force, *cross(arm, force)]
        felt = [feels if j == rod.joint else zero for j in inputs]
        rows.append([*(whole[k] for k in left), *felt])
    found = ring.determinant(rows, (*(k % 2 for k in left), *[0] * len(inputs)))
    if _dependent(found):
        return None
    words = "a motion of the joints leaves the rows of the output at rest"
    return [PoseLocus("type 1", words, found, has_real_points(found))]


def _wrenches(ring: PoseRing) -> Iterator[tuple[Rod, Row, Poly]]:
    """Each force, through the outer end of its rod, and what the actuated joint feels of it.

    Of forces across a rod up to a factor that is zero only where the force is.
    """
    for rod in ring.rods.rods:
        force = ring.force(rod)
        yield rod, force, ring.moment_arm(rod) if rod.moved else ring.dot(force, force)
        if rod.hinge is not None:
            axis = ring.hinge(rod)
            slides = rod.moved and ring.rods.mechanism.prismatic[rod.joint]
            yield rod, axis, ring.dot(axis, ring.motion(rod)) if slides else ring.number(0)


def _upright(mechanism: Mechanism, found: Rods) -> bool:
    """Whether the output moves along the axes of the base and is not turned at home."""
    if any(rod.side or rod.hinge is not None for rod in found.rods):
        return False
    away = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max()
    return bool(away < 1e-9) and set(mechanism.task.rows) == {0, 1, 2}


def _split(ring: PoseRing, together: Any) -> Iterator[Part]:
    """Factors of the determinant with what each means."""
    hinged = ring.rods.hinged
    *numbers, last = range(1, len(ring.rods.rods) + 1)
    names = f"the lines of legs {', '.join(map(str, numbers))} and {last}"
    words = "the six leg lines belong to one linear complex"
    if ring.rods.planar:
        words = f"{names} meet in one point or are parallel"
    elif hinged:
        words = (
            f"{names} and the forces along the hinges through the same points belong to one linear "
            "complex"
        )
    parallel = _parallelograms(ring)
    for factor, _ in together.factor()[1]:
        if parallel is not None and divmod(parallel[0], factor)[1] == 0:
            plane = "the rods are parallel to a plane, or two pairs of them to each other"
            yield "type 2", plane, factor, False
        elif parallel is not None and divmod(parallel[1], factor)[1] == 0:
            normals = (
                "the normals of the three parallelograms are parallel to a plane: the output can "
                "turn"
            )
            yield "constraint", normals, factor, False
        else:
            yield "type 2 or constraint" if hinged else "type 2", words, factor, False


def _parallelograms(ring: PoseRing) -> tuple[Any, Any] | None:
    """With the output level and two rods a crank: determinants of directions and of normals."""
    mine = [[r for r in ring.rods.rods if r.joint == joint] for joint in ring.drivers]
    if not ring.level or [len(pair) for pair in mine] != [2, 2, 2]:
        return None
    directions, normals = [], []
    for one, two in mine:
        d, other = ring.direction(one), ring.direction(two)
        if any(a != b for a, b in zip(d, other, strict=True)):
            return None
        apart = [b - a for a, b in zip(ring.outer(one), ring.outer(two), strict=True)]
        directions.append(d)
        normals.append(cross(apart, d))
    one_ = ring.number(1)
    return determinant(directions, one_), determinant(normals, one_)


def _type1(ring: PoseRing) -> list[PoseLocus]:
    """Where a motion that the hinges allow, or a leg's own, leaves the output at rest."""
    words = "a motion that the hinges allow leaves the rows of the output at rest"
    hinged = [("type 1", words, hinged_type1(ring))] if counts_hinges(ring) else []
    parts: list[Part] = []
    for k, rod in enumerate(ring.rods.rods, 1):
        name = ring.rods.mechanism.joints[rod.joint]
        for words, reach in rod.type1(k, name, ring.rods.planar, ring.level):
            if reach is None:
                arm = ring.without_norm(ring.moment_arm(rod))
                parts += _factors([("type 1", words, arm)])
            else:
                # A circle, or its centre: real points, whatever its signs.
                parts.append(("type 1", words, ring.length(rod, short_fraction(reach)), True))
    return _loci(ring, [*_factors(hinged), *parts])


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
