"""Singular loci over the pose of the output, in closed form, where each leg passes one force.

Type 2 (and constraint): the forces that the legs pass on with the actuators locked are dependent.
Their Plücker coordinates are polynomials in the pose; the determinant of six of them (three in the
plane) is the equation, exactly. After Merlet, "Singular configurations of parallel manipulators and
Grassmann geometry" (1989), and St-Onge and Gosselin, "Singularity analysis and representation of
the general Gough-Stewart platform" (2000), who give its degree: three in the position.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.mechanism.closure import ranks
from pinsing.mechanism.every_position import PoseFamily, every_position
from pinsing.mechanism.joint_forms import JointForms
from pinsing.mechanism.likeness import output_pose
from pinsing.mechanism.modes import home
from pinsing.mechanism.pose import pose_of
from pinsing.mechanism.pose_equation import PoseEquation, planar_equation, pose_equation
from pinsing.mechanism.pose_hinges import counts_hinges, hinged_type1
from pinsing.mechanism.pose_notes import needs
from pinsing.mechanism.pose_ring import PARALLEL, PoseRing, cross, determinant
from pinsing.mechanism.rods import Rod, Rods, rods
from pinsing.mechanism.sphere_loci import SphereLoci, sphere_loci, squares_note
from pinsing.mechanism.three_distances import input_loci
from pinsing.robot.mechanism import Mechanism
from pinsing.serialization import JsonResult

_TRIES = 400
_POSES = 6
_DEPENDENT = 1e-9
_SEED = 2718
_TURNS = ("e0", "e1", "e2", "e3")


@dataclass(frozen=True, eq=False)
class PoseLocus:
    """One irreducible locus.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, ``constraint`` or ``type 2 or constraint``.
    words : str
        What the lines of the legs do there.
    equation : PoseEquation
        Zero exactly there, on poses that the mechanism has with the inputs that they need.
    real : bool
        Whether the equation changes its sign over real poses, or is a sum of squares with real
        zeros; otherwise it is zero at isolated or no real ones, as far as was looked.
    """

    kind: str
    words: str
    equation: PoseEquation
    real: bool

    def __str__(self) -> str:
        none = "" if self.real else " [no real points found]"
        return f"{self.kind}, {self.words}: {self.equation}{none}"


@dataclass(frozen=True, eq=False)
class PoseForms(JsonResult):
    """All singular loci of a mechanism over the pose of its output.

    Attributes
    ----------
    variables : tuple of str
        In which the equations are.
    architecture : str
        Why every pose is singular; empty where not.
    loci : tuple of PoseLocus
        Irreducible over the rationals (or those with the root of 3).
    everywhere : tuple of PoseFamily
        Orientations at which every position is singular; parts of the loci, said by themselves.
    level : tuple of PoseLocus
        The type 2 loci with the output turned as at home, where that is not turned at all.
    complete : bool
        Whether every singular pose is on one of the loci.
    notes : tuple of str
        What was assumed, and what else must hold.
    inputs : tuple of PoseLocus
        Type 2 over the inputs alone, the pose eliminated, where that was done: at inputs on it two
        poses of the output meet, real or complex ones.
    joint_forms : JointForms or None
        Those in the joint angles, which ``families --loops --json`` writes with them; elsewhere
        they are asked for by themselves, with `joint_forms`.
    """

    schema: ClassVar[str] = "pinsing/pose-forms/1"

    variables: tuple[str, ...]
    architecture: str
    loci: tuple[PoseLocus, ...]
    everywhere: tuple[PoseFamily, ...]
    level: tuple[PoseLocus, ...]
    complete: bool
    notes: tuple[str, ...]
    inputs: tuple[PoseLocus, ...] = field(default=(), metadata={"optional": True})
    joint_forms: JointForms | None = field(default=None, metadata={"optional": True})

    def __str__(self) -> str:
        lines = [self.architecture] if self.architecture else []
        lines += [str(x) for x in (*self.loci, *self.everywhere, *self.inputs)]
        return "\n".join([*lines, *self.notes])


def pose_forms(mechanism: Mechanism) -> PoseForms | None:
    """Closed forms over the pose; None where a leg passes more, or other things, than one force.

    A spherical mechanism of three legs has them over its orientation.

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
    found = rods(mechanism)
    sphere = sphere_loci(mechanism) if found is None else None
    if sphere is not None:
        ranks(mechanism)
        return mechanism.once("pose_forms", lambda: _of_sphere(mechanism, sphere))
    if found is None:
        return None
    ranks(mechanism)
    return mechanism.once("pose_forms", lambda: _forms(mechanism, found))


def _of_sphere(mechanism: Mechanism, found: SphereLoci) -> PoseForms:
    """Over the orientation, and the inputs where they do not drop out."""
    parts = [("type 2", "the planes of the outer links meet in one line", found.type2)]
    for k, (leg, poly) in enumerate(zip(found.legs, found.type1, strict=True), 1):
        name = mechanism.joints[leg.joint]
        parts.append(("type 1", f"leg {k} is folded or stretched: {name} turns nothing", poly))
    squares = squares_note(found)
    loci = [
        # Sums of squares have real zeros too: turns by which an outer axis meets a base axis.
        PoseLocus(kind, words, equation, bool(squares) or _real(equation))
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


def locus_distance(mechanism: Mechanism, forms: PoseForms, q: Array) -> float:
    """The least of the equations' values at q (n,), each over the size that its terms can have.

    Lengths count with the size of the mechanism, all else with 1: a term that is zero by itself,
    as in ``e3 = 0``, says how near it is.
    """
    at = variables_at(mechanism, forms, q)
    found = rods(mechanism)
    places = [] if found is None else [p for r in found.rods for p in (r.inner, r.outer)]
    reach = max((float(np.linalg.norm(p)) for p in places), default=mechanism.length_scale)
    reach = max(reach, *(abs(at[n]) for n in "xyz"))
    return min(_relative(locus.equation, at, reach) for locus in forms.loci)


def variables_at(mechanism: Mechanism, forms: PoseForms, q: Array) -> dict[str, float]:
    """Values of the variables of equations at a configuration q (n,)."""
    found = rods(mechanism)
    there = output_pose(mechanism, q)
    pose = pose_of(there if found is None else found.placed(there))
    out = dict(zip("xyz", pose.position, strict=True))
    out |= {f"e{k}": e for k, e in enumerate(pose.quaternion)}
    out["cos φ"], out["sin φ"] = float(np.cos(pose.angles[2])), float(np.sin(pose.angles[2]))
    for name, value in zip(mechanism.joints, q.tolist(), strict=True):
        out[name] = value
        out[f"cos {name}"], out[f"sin {name}"] = float(np.cos(value)), float(np.sin(value))
    return out


def _relative(equation: PoseEquation, at: dict[str, float], reach: float) -> float:
    x = np.array([at[n] for n in equation.names])
    turning = [n in _TURNS or n.startswith(("cos ", "sin ")) for n in equation.names]
    most = np.where(turning, 1.0, np.maximum(np.abs(x), reach))
    size = float(np.abs(np.prod(most**equation.powers, axis=1) * equation.values).max())
    return abs(float(equation(x))) / size if size > 0 else 0.0


def _forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    cranks = sum(rod.moved for rod in found.rods)
    level = cranks > 0 and not found.planar
    notes: list[str] = []
    if level:
        upright = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max() < 1e-9
        if not upright or set(mechanism.task.rows) != {0, 1, 2}:
            return PoseForms(
                (), "", (), (), (), False,
                ("no closed form: with cranks in space the equation is found for an output that "
                 "is never turned only",),
            )  # fmt: skip
        notes.append(
            "the output keeps the axes of the base (its translational mode); modes in which it is "
            "turned are not in these equations"
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
    notes += list(needs(ring))
    if together != 0 and _always(found):
        notes.append(
            "the coordinates of the file make the lines dependent to 1e-9 of their size, at every "
            "pose tried; that is taken for what is meant"
        )
        together = ring.number(0)
    if together == 0:
        words = _architecture(found)
        alone = tuple(_type1(ring))
        return PoseForms(ring.names, words, alone, (), (), True, tuple(notes))
    loci = [*_split(ring, together), *_type1(ring)]
    families = every_position(ring, together)
    tied = any(rod.hinge is not None for rod in found.rods)
    return PoseForms(
        ring.names, "", tuple(loci), families, tuple(_at_home(mechanism, ring, together)),
        not tied or counts_hinges(ring), tuple(notes), tuple(_over_inputs(mechanism)),
    )  # fmt: skip


def _over_inputs(mechanism: Mechanism) -> Iterator[PoseLocus]:
    words = "over the inputs, where two assembly modes meet"
    for found in input_loci(mechanism):
        yield PoseLocus("type 2", words, found, _real(found))


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


def _locus(ring: PoseRing, kind: str, factor: Any, words: str) -> PoseLocus:
    found = _equation(ring, factor)
    return PoseLocus(kind, words, found, _real(found))


def _equation(ring: PoseRing, factor: Any) -> PoseEquation:
    if ring.rods.planar:
        half = (ring.names.index("e0"), ring.names.index("e3"))
        return planar_equation(factor, ring.names, ring.odd, ring.square, half)
    return pose_equation(factor, ring.names, ring.odd, ring.square)


def _real(found: PoseEquation) -> bool:
    x = np.random.default_rng(_SEED).normal(size=(_TRIES, len(found.names)))
    x *= np.random.default_rng(_SEED + 1).choice([0.1, 1.0, 3.0], size=(_TRIES, 1))
    for k, name in enumerate(found.names[:-1]):
        # A cosine and its sine are of one angle.
        if name.startswith("cos ") and found.names[k + 1] == f"sin {name[4:]}":
            angle = np.random.default_rng(_SEED + 2 + k).uniform(-np.pi, np.pi, _TRIES)
            x[:, k], x[:, k + 1] = np.cos(angle), np.sin(angle)
    values = found(x)
    return bool((values > 0).any() and (values < 0).any())


def _rod_names(found: Sequence[Rod]) -> str:
    numbers = [str(k) for k in range(1, len(found) + 1)]
    return f"the lines of legs {', '.join(numbers[:-1])} and {numbers[-1]}"


def _architecture(found: Rods) -> str:
    inner = np.array([r.inner for r in found.rods])
    outer = np.array([r.outer for r in found.rods])
    why = "the leg lines are dependent whatever the pose"
    if not any(r.moved for r in found.rods) and _similar(inner, outer):
        shape = "triangles" if len(inner) == 3 else "hexagons"
        why = f"platform and base {shape} are similar"
    return f"architecture singularity: {why}: singular at every pose"


def _always(found: Rods) -> bool:
    """Whether the lines are dependent, to the rounding of a file, at random poses and inputs."""
    rng = np.random.default_rng(_SEED)
    size = 0.0
    for _ in range(_POSES):
        e = rng.normal(size=4) * ((1, 0, 0, 1) if found.planar else 1)
        R = pin.Quaternion(*(e / np.linalg.norm(e))).matrix()
        at = rng.normal(size=3) * ((1, 1, 0) if found.planar else 1)
        lines = []
        for rod in found.rods:
            B, value = at + R @ rod.outer, rng.normal()
            turning = not found.mechanism.prismatic[rod.joint]
            c, s = (np.cos(value), np.sin(value)) if turning else (value, 0.0)
            C = rod.inner + c * rod.first + s * rod.second
            lines.append(np.concatenate([B - C, np.cross(C, B)]))
            if rod.hinge is not None:
                lines.append(np.concatenate([rod.hinge, np.cross(B, rod.hinge)]))
        rows = np.array(lines)[:, [0, 1, 5]] if found.planar else np.array(lines)
        sigma = np.linalg.svd(rows / np.linalg.norm(rows, axis=1)[:, None], compute_uv=False)
        size = max(size, float(sigma[-1] / sigma[0]))
    return size <= _DEPENDENT


def _similar(inner: Array, outer: Array) -> bool:
    """Whether the outer points are the inner ones moved, turned and scaled."""
    a, b = inner - inner.mean(axis=0), outer - outer.mean(axis=0)
    U, sigma, Vt = np.linalg.svd(a.T @ b)
    size = float(sigma.sum() / (a**2).sum())
    return bool(np.abs(size * a @ (U @ Vt) - b).max() <= 1e-9 * max(1.0, float(np.abs(b).max())))


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
            yield PoseLocus("type 2", "with the output turned as at home", found, _real(found))
