"""What is said beside the loci over the pose: what else is singular, and what they hold for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pinsing._types import Array
from pinsing.loops.pose_hinges import counts_hinges
from pinsing.loops.pose_ring import PoseRing
from pinsing.loops.rod import Rod, Rods
from pinsing.loops.structure import structure
from pinsing.loops.three_distances import degree_notes, length_name, rod_length

_SMALL = 1e-9


def _written(axis: Array) -> str:
    return f"({', '.join(f'{round(float(v), 12) + 0.0:.6g}' for v in axis)})"


def inputs_notes(ring: PoseRing) -> Iterator[str]:
    """Notes on determinants over the pose and the inputs."""
    if ring.off > 1e-12:
        yield f"coordinates were made exact, by at most {ring.off:.1e} m"
    mechanism = ring.rods.mechanism
    plain = [r for r in ring.rods.rods if not r.moved]
    if plain and len(mechanism.task.rows) == 6:
        first = " or is along the axis of its first joint" if any(r.side for r in plain) else ""
        also = "also " if ring.drivers else ""
        yield f"type 1: {also}where a leg has no length{_short(ring, plain)}{first}; {_else(ring)}"
    yield from _lines(ring)
    inputs = " and inputs" if ring.drivers else ""
    if ring.drivers or any(r.hinge is not None for r in ring.rods.rods):
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
        name, C = mechanism.joints[rod.joint], _written(rod.inner)
        if rod.moved and mechanism.prismatic[rod.joint]:
            C += f" + {name} {_written(rod.first)}"
        elif rod.moved:
            C += f" + cos {name} {_written(rod.first)} + sin {name} {_written(rod.second)}"
        force = ("B - C", "a x (B - C)", "(a x (B - C)) x (B - C)")[rod.side]
        text = f"force {k}: f = {force}, b = {_written(rod.outer)}, C = {C}"
        if rod.across is not None and rod.side:
            text += f", a = {_written(rod.across)}"
        if rod.hinge is not None:
            text += f"; and f = {_written(rod.hinge)}, across which B - C stays"
        if rod.moved:
            text += f"; it closes where |B - C| = {rod_length(mechanism, rod):.6g} m"
        yield text


def in_plane(found: Rods, turns: bool = True) -> Iterator[str]:
    """What x, y, and φ where the output ``turns``, are in a plane that is not that of the base."""
    eye = np.eye(3)
    if not found.tilted or (not turns and np.abs(found.axes - eye).max() <= _SMALL):
        return
    x, y, n = (_written(a) for a in found.axes)
    if not turns:
        yield f"x and y are in the plane of the mechanism: x along {x} of the base, y along {y}"
        return
    yield (
        f"x, y and φ are in the plane of the mechanism: x along {x} of the base, y along {y}, "
        f"φ about {n}, zero where {_written(found.own[:, 0])} of the output is along x"
    )


def needs(ring: PoseRing) -> Iterator[str]:
    """Notes, one after the other."""
    mechanism = ring.rods.mechanism
    legs = [rod for rod in ring.rods.rods if rod.slides or rod.side]
    if legs:
        tied = any(rod.hinge is not None for rod in ring.rods.rods)
        open_ = tied and not counts_hinges(ring)
        if open_:
            yield (
                "type 1 is not in these equations: the rows of the output and the hinges are not "
                "six together; the equations in the joint angles have it"
            )
        if not open_:
            told = tied or any(rod.moved or rod.bends for rod in ring.rods.rods)
            also = "also " if told else ""
            yield f"type 1: {also}where a leg has no length{_short(ring, legs)}; {_else(ring)}"
    yield from in_plane(ring.rods)
    if any(rod.moved for rod in ring.rods.rods):
        yield (
            "the equations are in the pose and the inputs together: a pose and inputs that close "
            f"the loops are singular if and only if one of them is zero{_aside(ring)}"
        )
        cranks = not mechanism.prismatic[list(ring.drivers)].any()
        if ring.rods.planar and cranks and all(rod.moved for rod in ring.rods.rods):
            yield (
                "the pose alone: eliminating the three inputs by their closure (each quadratic) "
                "multiplies eight working modes, to degree 44 in x and y at a given angle, 42 with "
                "legs of equal lengths (Bonev and Gosselin 2001); not done"
            )
    yield from degree_notes(mechanism)
    if any(rod.hinge is not None for rod in ring.rods.rods):
        yield (
            "poses of this mechanism keep the outer end of each leg in the plane across its hinge; "
            f"such a pose is singular if and only if one of the equations holds{_aside(ring)}"
        )
    yield from _passive(ring)
    yield "exact over the rationals at each step; certificates are of each leg alone (--prove)"
