"""Singular loci over the pose and the inputs of legs on cranks, rails or driven feet, in space.

PUS, RUS, PRS, RRS and their like with an output that turns: the wrenches that the legs pass on with
the actuators locked are polynomials in the pose and in the input of their leg. Type 2 (and
constraint) is the determinant of six of them. With what each actuator feels of them and the motions
of the output that its rows leave out, a determinant too, comes type 1. Multiplied out they have
tens of thousands of terms: they stay determinants. A pose and inputs that close the loops fulfil
the equations of `closing`. After Merlet, "Parallel Robots" (2006), chapters 2 and 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.algebra.ring import Poly
from pinsing.loops.closure import near_home, random_closed
from pinsing.loops.pose_architecture import always_dependent
from pinsing.loops.pose_equation import (
    PoseEquation,
    determinant_equation,
    entry,
    pose_equation,
)
from pinsing.loops.pose_forms import PoseForms, PoseLocus
from pinsing.loops.pose_notes import inputs_notes
from pinsing.loops.pose_real import has_real_points
from pinsing.loops.pose_ring import PoseRing, Row, cross
from pinsing.loops.pose_values import locus_distance
from pinsing.loops.rod import Rod, Rods
from pinsing.loops.three_distances import rod_length
from pinsing.robot.mechanism import Mechanism

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
