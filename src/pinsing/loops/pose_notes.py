"""What is said beside the loci over the pose: what else is singular, and what they hold for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pinsing._types import Array
from pinsing.loops.forms import TURNS, PoseEquation, PoseForms
from pinsing.loops.legs import Rod, Rods, rods, written
from pinsing.loops.mode_counts import point_legs
from pinsing.loops.pose import pose_of
from pinsing.loops.pose_ring import PoseRing, counts_hinges
from pinsing.loops.structure import output_pose, structure
from pinsing.loops.three_distances import degree_notes, length_name
from pinsing.robot.mechanism import Mechanism

PROOFS = "exact over the rationals at each step; certificates are of each leg alone (--prove)"


def with_inputs(pose: str, loops: str, article: str) -> str:
    """That equations are in the pose and the inputs together."""
    return (
        f"the equations are in the {pose} and the inputs together: {article} {pose} and inputs "
        f"that close the {loops} are singular if and only if one of them is zero"
    )


def made_exact(ring: PoseRing) -> Iterator[str]:
    """By how much coordinates were changed."""
    if ring.off > 1e-12:
        yield f"coordinates were made exact, by at most {ring.off:.1e} m"


def inputs_notes(ring: PoseRing) -> Iterator[str]:
    """Notes on determinants over the pose and the inputs."""
    yield from made_exact(ring)
    mechanism = ring.rods.mechanism
    plain = [r for r in ring.rods.rods if not r.moved]
    if plain and len(mechanism.task.rows) == 6:
        first = " or is along the axis of its first joint" if any(r.side for r in plain) else ""
        also = "also " if ring.drivers else ""
        yield f"type 1: {also}where a leg has no length{_short(ring, plain)}{first}; {_else(ring)}"
    yield from _lines(ring)
    inputs = " and inputs" if ring.drivers else ""
    if ring.drivers or ring.rods.hinged:
        what = f"a pose{inputs} that close the loops are" if inputs else (
            "a pose that closes the loops is"
        )  # fmt: skip
        yield f"{what} singular if and only if one of the loci is zero{_aside(ring)}"
    if ring.drivers:
        count = 2 ** len(ring.drivers)
        yield (
            f"the pose alone: eliminating the inputs by their closure (each quadratic) multiplies "
            f"{count} working modes; not done"
        )
    yield from _passive(ring)
    yield (
        "determinants are exact and not multiplied out; certificates are of each leg alone "
        "(--prove)"
    )


def _short(ring: PoseRing, legs: Sequence[Rod]) -> str:
    """Where slides have no length, unless they are counted from there; whether limits allow it."""
    mechanism = ring.rods.mechanism
    slides = {r.sliding: r for r in legs if r.sliding >= 0}
    named = [f"{length_name(mechanism, r, 6).strip('()')} = 0" for r in slides.values() if r.offset]
    where = f" ({' or '.join(named)})" if named else ""
    reached = any(
        mechanism.lower[k] + r.offset <= 0 <= mechanism.upper[k] + r.offset
        for k, r in slides.items()
    )
    return where + ("" if reached else ", which the limits exclude")


def _alone(ring: PoseRing) -> list[str]:
    """Passive joints at one point that can be dependent by themselves, and where they are."""
    mechanism = ring.rods.mechanism
    kinds = {
        2: "universal joints whose rod lies in the plane of their two axes, as along the first one",
        3: "balls written as three hinges, which lie in a plane",
    }
    found = []
    for count, words in kinds.items():
        joints = [
            ", ".join(mechanism.joints[j] for j in c.joints)
            for c in structure(mechanism).centres
            if len(c.joints) == count and not ring.rods.planar
        ]
        if joints:
            found.append(f"{words} ({'; '.join(joints)})")
    return found


def _aside(ring: PoseRing) -> str:
    """What is added to "if and only if" where passive joints can be dependent."""
    return ", or passive joints move by themselves (below)" if _alone(ring) else ""


def _else(ring: PoseRing) -> str:
    return "else only where passive joints move by themselves (below)" if _alone(ring) else (
        "nowhere else"
    )  # fmt: skip


def _passive(ring: PoseRing) -> Iterator[str]:
    """What the pose does not tell: joints at one point that line up."""
    found = _alone(ring)
    if found:
        yield (
            "passive joints that move by themselves, the output at rest, are not in these "
            f"equations: {'; '.join(found)}; the equations in the joint angles have each"
        )


def _lines(ring: PoseRing) -> Iterator[str]:
    """What the rows of the determinant are, leg by leg."""
    mechanism = ring.rods.mechanism
    yield (
        "rows of the determinant of type 2: a force f through B and its moment B x f about the "
        "origin of the base; B = (x, y, z) + R b with R the rotation of e0, e1, e2, e3"
    )
    for k, rod in enumerate(ring.rods.rods, 1):
        force = ("B - C", "a x (B - C)", "(a x (B - C)) x (B - C)")[rod.side]
        C = rod.foot_text(mechanism.joints[rod.joint])
        text = f"force {k}: f = {force}, b = {written(rod.outer)}, C = {C}"
        if rod.side:
            text += f", a = {written(rod.across)}"
        if rod.hinge is not None:
            text += f"; and f = {written(rod.hinge)}, across which B - C stays"
        if rod.moved:
            text += f"; it closes where |B - C| = {ring.rods.length(rod):.6g} m"
        yield text


def in_plane(found: Rods, turns: bool = True) -> Iterator[str]:
    """What x, y, and φ where the output ``turns``, are in a plane that is not that of the base."""
    eye = np.eye(3)
    if not found.tilted or (not turns and np.abs(found.axes - eye).max() <= 1e-9):
        return
    x, y, n = (written(a) for a in found.axes)
    if not turns:
        yield f"x and y are in the plane of the mechanism: x along {x} of the base, y along {y}"
        return
    yield (
        f"x, y and φ are in the plane of the mechanism: x along {x} of the base, y along {y}, "
        f"φ about {n}, zero where {written(found.own[:, 0])} of the output is along x"
    )


def needs(ring: PoseRing) -> Iterator[str]:
    """Notes, one after the other."""
    mechanism = ring.rods.mechanism
    legs = [rod for rod in ring.rods.rods if rod.sliding >= 0]
    if legs:
        tied = ring.rods.hinged
        open_ = tied and not counts_hinges(ring)
        if open_:
            yield (
                "type 1 is not in these equations: the rows of the output and the hinges are not "
                "six together; the equations in the joint angles have it"
            )
        if not open_:
            told = tied or any(rod.moved or rod.kind == "elbow" for rod in ring.rods.rods)
            also = "also " if told else ""
            yield f"type 1: {also}where a leg has no length{_short(ring, legs)}; {_else(ring)}"
    yield from in_plane(ring.rods)
    if any(rod.moved for rod in ring.rods.rods):
        yield with_inputs("pose", "loops", "a") + _aside(ring)
        cranks = not mechanism.prismatic[list(ring.drivers)].any()
        if ring.rods.planar and cranks and all(rod.moved for rod in ring.rods.rods):
            yield (
                "the pose alone: eliminating the three inputs by their closure (each quadratic) "
                "multiplies eight working modes, to degree 44 in x and y at a given angle, 42 with "
                "legs of equal lengths (Bonev and Gosselin 2001); not done"
            )
    yield from degree_notes(mechanism)
    if ring.rods.hinged:
        yield (
            "poses of this mechanism keep the outer end of each leg in the plane across its hinge; "
            f"such a pose is singular if and only if one of the equations holds{_aside(ring)}"
        )
    yield from _passive(ring)
    yield PROOFS


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
    turned = "e0" in forms.variables and "z" in forms.variables and abs(at["e0"]) < 1 - 1e-9
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
    return point_legs(mechanism)


def _relative(equation: PoseEquation, at: dict[str, float], reach: float) -> float:
    x = np.array([at[n] for n in equation.names])
    turning = [n in TURNS or n.startswith(("cos ", "sin ")) for n in equation.names]
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
