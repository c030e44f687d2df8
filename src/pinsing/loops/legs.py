"""Legs that pass one force each on the output, and how many modes there are, by algebra.

A leg has two passive centres, C and B, and one actuated joint: a slide along C B (UPS, SPS, RPR), a
crank or slide before C (RUS, PUS, RRR, PRR), or an elbow between them in the plane. With the
actuator locked everything that the leg can pass on is a force along C B, since each passive axis
meets that line. Where the inner centre is a single turning joint in space (RPS, PRS, RRS) it passes
a second force: through B, along that joint's axis.

A leg that is driven at its foot and has a passive slide along C B (RPR, RPS, UPS) passes a force
through B across C B: with a the axis of the foot's first joint, along a x CB where that joint is
driven, along (a x CB) x CB where the second one is. Each does work on its own joint alone.

A leg of a spherical 3-RRR has its actuated axis u in the base, its middle axis v, its outer axis w
in the output. With the actuator held it passes a moment along v x w. Three dependent ones are type
2: the planes of the outer links meet in one line. The actuator does not work on its moment where u
. (v x w) = 0: type 1. Where both links are quarter circles v is along u x w, and the inputs drop
out. After Gosselin and Angeles, "Singularity analysis of closed-loop kinematic chains" (1990), and
Bonev and Gosselin, "Singularity loci of spherical parallel mechanisms" (2005).

Given the pose each leg is by itself: its actuated joint has the two solutions of a quadratic
equation. One rod that ties two links, each on one joint (four-bar, RSSR, slider-crank): with one of
the joints given its length is a quadratic equation of the other. Three legs on hinges (3-RPS): a
height and a tilt of the output leave two solutions of a line and a circle, and each leg two
lengths. An output that keeps the axes of the base (Delta): its position is on three spheres. Where
the passive joints of one loop are three parallel pins (five-bars on cranks, on slides, welded or
driven in the middle) the loop is a triangle with the inputs held, on either side of the base.

A body in a plane with three points at given distances from three given ones has at most six poses:
with one of the points as origin two of the three equations are linear in the position, and what is
left is of degree 6 in the tangent of half the angle. After Gosselin and Sefrioui, "Polynomial
solutions for the direct kinematic problem of planar three-degree-of-freedom parallel manipulators"
(1991). Two poses meet, at a type 2 singularity, where its discriminant in the angle is zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from flint import Ordering, fmpq_mpoly_ctx, fmpq_poly

from pinsing.algebra.ring import Poly, coefficients_by, divided_by, rational
from pinsing.loops.closure import (
    PLANE,
    SPACE,
    SPHERE,
    Centre,
    NotThisKind,
    at_zero,
    bodies,
    loop_ends,
    output_pose,
    plane_axes,
    position_in,
    room_of,
    structure,
)
from pinsing.loops.forms import PoseEquation, exact_points, pose_equation
from pinsing.loops.motion import home
from pinsing.measures import ROUNDING, Array, ArrayLike
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import Mechanism, Sample, closing, path_to

Condition = tuple[str, float | None]
"""Words, and the distance of C and B there; None: the force does not work on the motion of C."""
_NONE = np.zeros(3)


@dataclass(frozen=True, eq=False)
class Rod:
    """One force that a leg passes, by C = inner + c first + s second, and B."""

    # ``strut``: the actuated joint slides along C B; ``foot``: driven at its foot, the force is
    # across C B, whose length a passive joint slides; ``elbow``: driven between C and B, in the
    # plane; ``crank`` and ``rail``: the actuated joint moves C, and C B has one length
    kind: str
    joint: int  # the actuated joint of the leg
    outer: Array  # (3,): B in the frame of the output, metres
    inner: Array  # (3,): C in the base; of a kind that moves it the part that does not move
    # (3,): axis of the only passive joint at C, in space: the leg passes a force along it too
    hinge: Array | None = None
    # first and second: (3,): of a crank, with cosine and sine of its angle, and of a rail, with its
    # value and 0
    first: Array = field(default_factory=lambda: _NONE)
    second: Array = field(default_factory=lambda: _NONE)
    # (3,): a, the axis of the first joint of a foot
    across: Array = field(default_factory=lambda: _NONE)
    side: int = 0  # 0: the force is along C B; 1: along a x CB; 2: along (a x CB) x CB
    sliding: int = -1  # the joint that slides along C B; -1 where there is none
    # what is added to its value for the length of C B, metres; below zero it is one the other way
    offset: float = 0.0
    links: tuple[float, float] = (0.0, 0.0)  # lengths on both sides of an elbow, metres

    @property
    def moved(self) -> bool:
        """Whether C moves with the actuated joint."""
        return self.kind in ("crank", "rail")

    def foot(self, values: ArrayLike) -> Array:
        """C (..., 3) at values (...) of the joint."""
        x = np.asarray(values, dtype=float)[..., None]
        c, s = (np.cos(x), np.sin(x)) if self.kind == "crank" else (x, 0 * x)
        return np.asarray(self.inner + c * self.first + s * self.second)

    def distance(self, values: Array, length: float) -> Array | None:
        """Distance (N,) of C and B at values (N,), ``length`` at home; None where it is open."""
        if self.kind == "strut":
            return np.asarray(np.abs(values + self.offset))
        return np.full(len(values), length) if self.moved else None

    def solutions(self, B: Array, planar: bool, length: float) -> tuple[float, ...]:
        """Values of the joint with the end at B (3,); NotThisKind where two meet, or not told."""
        e, first, second = np.array([B - self.inner, self.first, self.second])[
            :, : 2 if planar else 3
        ]
        if self.kind == "strut":
            reach = float(np.linalg.norm(e))
            NotThisKind.refuse_if(reach <= ROUNDING)
            return reach - self.offset, -reach - self.offset
        NotThisKind.refuse_if(not self.moved)
        along, size, known = float(e @ first), float(first @ first), float(e @ e) - length**2
        if self.kind == "crank":
            # Both angles with a cos + b sin = c.
            b, c = float(e @ second), (known + size) / 2
            most = float(np.hypot(along, b))
            NotThisKind.refuse_if(abs(most - abs(c)) <= ROUNDING)
            if most < abs(c):
                return ()
            middle, spread = float(np.arctan2(b, along)), float(np.arccos(c / most))
            return middle + spread, middle - spread
        return _two_roots(size, -along, known)  # |e - q first| = length

    def variables(self, name: str) -> tuple[str, ...]:
        """Variables that equations have for the joint of this name."""
        return {"crank": (f"cos {name}", f"sin {name}"), "rail": (name,)}.get(self.kind, ())

    def type1(self, number: int, name: str, planar: bool, level: bool) -> list[Condition]:
        """Where the actuator, the joint of this name, does not move a rod that has a length."""
        if self.kind == "elbow":
            one, two = self.links
            where = f"at its actuated elbow {name}"
            return [
                (f"leg {number} is stretched {where}", one + two),
                (f"leg {number} is folded {where}", abs(one - two)),
            ]
        words = f"rod {number} is in a plane with the axis of crank {name} and its pin"
        if planar:
            words = f"crank {name} and its rod are in line"
        elif level:
            words = f"the rods of crank {name} are in line with it, or meet its axis"
        slide = f"rod {number} is across the slide {name}"
        return [(slide if self.kind == "rail" else words, None)] if self.moved else []

    def foot_text(self, name: str) -> str:
        """C for people, with the joint's name."""
        text = written(self.inner)
        if self.kind == "crank":
            return f"{text} + cos {name} {written(self.first)} + sin {name} {written(self.second)}"
        return f"{text} + {name} {written(self.first)}" if self.moved else text


def _two_roots(a: float, b: float, c: float) -> tuple[float, ...]:
    """Real roots of a t^2 + 2 b t + c; NotThisKind where they are one, or it is not quadratic."""
    NotThisKind.refuse_if(a <= ROUNDING)
    middle, left = -b / a, (b / a) ** 2 - c / a
    NotThisKind.refuse_if(abs(left) <= ROUNDING)
    return () if left < 0 else (middle + math.sqrt(left), middle - math.sqrt(left))


@dataclass(frozen=True, eq=False)
class Rods:
    """All forces on the output."""

    mechanism: Mechanism  # the mechanism
    rods: tuple[Rod, ...]  # in the order of the legs; several may share a crank
    # ``plane``: everything moves in parallel planes; ``sphere``: about one centre, C and B are on
    # the unit sphere about it, and what counts of a force is its moment; else ``space``
    kind: str
    # (3, 3): rows: axes of the base in which all of this is; in the plane the third is its normal
    axes: Array
    own: Array  # (3, 3): columns: axes of the output that are along those when it is not turned

    @property
    def planar(self) -> bool:
        """Whether everything moves in parallel planes."""
        return self.kind == PLANE

    @property
    def tilted(self) -> bool:
        """Whether these are not the axes of the base, or of the output."""
        eye = np.eye(3)
        return bool(max(np.abs(self.axes - eye).max(), np.abs(self.own - eye).max()) > ROUNDING)

    @property
    def hinged(self) -> bool:
        """Whether a leg passes a force along a hinge."""
        return any(rod.hinge is not None for rod in self.rods)

    def placed(self, pose: pin.SE3) -> pin.SE3:
        """A pose of the output in these axes: in the plane a turn about the third."""
        there = np.zeros(3) if self.kind == SPHERE else pose.translation
        return pin.SE3(self.axes @ pose.rotation @ self.own, self.axes @ there)

    def flattened(self, vectors: Array) -> Array:
        """Vectors (..., 3) without what in a plane is across it."""
        return np.asarray(vectors * [1, 1, 0]) if self.planar else vectors

    def length(self, rod: Rod) -> float:
        """Distance of C and B at home, metres; in the plane if that is level."""
        q = home(self.mechanism)
        pose = self.placed(output_pose(self.mechanism, q))
        away = pose.act(rod.outer) - rod.foot(float(q[rod.joint]))
        return float(np.linalg.norm(self.flattened(away)))


def written(axis: Array) -> str:
    """A vector for people."""
    return f"({', '.join(f'{round(float(v), 12) + 0.0:.6g}' for v in axis)})"


def inside(mechanism: Mechanism, joint: int, values: Iterable[float]) -> int:
    """How many values of a joint are within its limits, whole turns aside."""
    low, high = float(mechanism.lower[joint]), float(mechanism.upper[joint])
    if mechanism.prismatic[joint]:
        return sum(low <= v <= high for v in values)
    endless = not np.isfinite([low, high]).all()
    return sum(bool(endless or (v - low) % (2 * np.pi) <= high - low) for v in values)


def rods(mechanism: Mechanism) -> Rods | None:
    """Recognise a mechanism whose legs pass one force each; None for another one."""
    found = _recognized(mechanism)
    return found if isinstance(found, Rods) else None


def legs_of(mechanism: Mechanism) -> Rods | None:
    """The rods, those of a spherical mechanism, or those of a five-bar on its pin."""
    return rods(mechanism) or sphere_rods(mechanism) or point_legs(mechanism)


def why_no_rods(mechanism: Mechanism) -> str:
    """What keeps the legs from passing one force each; empty where they do."""
    found = _recognized(mechanism)
    return found if isinstance(found, str) else ""


def most_assemblies(mechanism: Mechanism) -> int | None:
    """Return how many poses given inputs can have at most; None where no number is known."""
    # Three distances of a body in a plane: 6 (Gosselin and Sefrioui 1991); six in space: 40
    # (Raghavan 1991, Lazard 1992); 3-RPS: 16 (Nanua, Waldron and Murthy 1990). On the sphere three
    # equations of degree 2 in the quaternion: 8, where they are finite in number.
    found = legs_of(mechanism)
    if found is None or any(rod.side for rod in found.rods):
        return None
    six, hinged, sphere = (SPACE, 6, False), (SPACE, 3, True), (SPHERE, 3, False)
    known = {(PLANE, 3, False): 6, six: 40, hinged: 16, sphere: 8}
    return known.get((found.kind, len(found.rods), found.hinged))


def carried(mechanism: Mechanism, sample: Sample, joint: int, C: Array, outer: Array) -> Rod:
    """Return the rod whose inner end C (3,) moves with one joint; none of C on its axis."""
    axis, at = sample.axis[joint], np.array(sample.joints[joint + 1].translation)
    if mechanism.prismatic[joint]:
        return Rod("rail", joint, outer, C - sample.q[joint] * axis, first=axis)
    arm = C - at
    rest = (arm @ axis) * axis
    c, s = np.cos(sample.q[joint]), np.sin(sample.q[joint])
    first = c * (arm - rest) - s * np.cross(axis, arm - rest)
    NotThisKind.refuse_if(np.linalg.norm(first) <= ROUNDING)
    return Rod("crank", joint, outer, at + rest, first=first, second=np.cross(axis, first))


@dataclass(frozen=True, eq=False)
class _Way:
    """A leg from the base to the output, which it meets in a loop or in joints of the tree."""

    path: list[int]  # joints from the base to where it meets the output, or to the loop
    end: Array  # (N, 3): its last point there, at the samples
    other: Array  # (N, 3): the point that this is to meet; of joints of the tree the same
    joints: tuple[int, ...] = ()  # those of the tree at the output
    hanging: tuple[int, ...] = ()  # from the output to the loop, where it is written from there


@kept
def _recognized(mechanism: Mechanism) -> Rods | str:
    """The rods, or why there are none."""
    try:
        return _Recognizer(mechanism).rods()
    except NotThisKind as why:
        return str(why)


class _Recognizer:
    """Tries each leg of a mechanism against the kinds, at random configurations of its tree."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.built = mechanism, structure(mechanism)
        plane = plane_axes(mechanism)
        self.planar = plane is not None
        # Passive joints of a ball at the end, in the plane of a pin; coordinates that count.
        self.ball = 1 if self.planar else 3
        self.flat: Array = np.array([1.0, 1.0, 0.0 if self.planar else 1.0])
        self.axes, self.own = plane or (np.eye(3), np.eye(3))
        drawn = mechanism.space.sample(4, np.random.default_rng(4177))
        self.samples = [Sample(mechanism, q, self.axes, self.own) for q in drawn]
        # (N, n) and (N, n, 3): values of the joints, their axes, points on these.
        self.q, self.axis, self.origins = (
            np.array([getattr(s, name) for s in self.samples]) for name in ("q", "axis", "origins")
        )

    def rods(self) -> Rods:
        mechanism = self.mechanism
        out: list[Rod] = []
        for way in self.ways():
            for kind in (self.along,) if way.hanging else (self.foot_driven, self.along):
                with suppress(NotThisKind):
                    out += kind(way)
                    break
            else:
                raise NotThisKind(self.reason(way))
        forces = len(out) + sum(rod.hinge is not None for rod in out)
        needed = 3 if self.planar else 6
        NotThisKind.refuse_if(
            forces != needed,
            f"the legs pass {forces} force{'s' * (forces != 1)} where {needed} hold the output",
        )
        NotThisKind.refuse_if(
            {r.joint for r in out} != set(mechanism.actuated),
            "there are actuated joints that are on no leg from the base to the output",
        )
        room = PLANE if self.planar else SPACE
        return Rods(mechanism, tuple(out), room, self.axes, self.own)

    def ways(self) -> list[_Way]:
        """All legs, that of the tree first."""
        mechanism, output = self.mechanism, self.built.output
        NotThisKind.refuse_if(
            output == 0, f"the output {mechanism.output} is not on a link that moves between legs"
        )
        out = []
        for loop, a, b, inside, outside in loop_ends(mechanism):
            NotThisKind.refuse_if(loop.kind == "6d", f"the loop {loop} is welded")
            NotThisKind.refuse_if(
                output - 1 not in outside or output - 1 in inside,
                f"the loop {loop} does not join a leg to the link of the output",
            )
            hanging = tuple(outside[outside.index(output - 1) + 1 :])
            one, two = (np.array([s.frames[k].translation for s in self.samples]) for k in (a, b))
            out.append(_Way(inside, one, two, hanging=hanging))
        path = path_to(mechanism, output)
        last = next((c for c in self.built.centres if output - 1 in c.joints), None)
        if last is None:
            end = mechanism.joints[path[-1]]
            how = "does not end in a pin or a ball at"
            if path[-1] in mechanism.actuated:
                how = "is driven at its joint with"
            elif mechanism.prismatic[path[-1]]:
                how = "ends in a slide at"
            raise NotThisKind(
                f"the leg of {', '.join(mechanism.joints[j] for j in path)} {how} the output "
                f"({end}), which is not supported over the pose"
            )
        at = self.points(last)
        return [_Way(path[: -len(last.joints)], at, at, last.joints), *out]

    def points(self, centre: Centre) -> Array:
        """A centre (N, 3)."""
        return np.array([s.joints[centre.joints[0] + 1].act(centre.point) for s in self.samples])

    def in_output(self, points: Array) -> Array:
        """Points (N, 3) in the frame of the output, where they are the same at all samples."""
        return np.array(self.samples[0].output.actInv(points[0]))

    def offset(self, joint: int, reach: Array) -> float:
        """Return what a slide's value lacks of its length (N, 3), as from mid-stroke."""
        NotThisKind.refuse_if(not self.mechanism.prismatic[joint] or self.beside(joint, reach))
        lengths = (reach * self.flat * self.axis[:, joint]).sum(axis=1)
        off = np.outer([1.0, -1.0], lengths) - self.q[:, joint]
        same = np.ptp(off, axis=1) <= ROUNDING
        NotThisKind.refuse_if(not same.any())
        found = float(off[int(np.argmax(same)), 0])
        return 0.0 if abs(found) <= ROUNDING else round(found, 12)

    def across(self, points: Array, joint: int, ends: Array) -> Array:
        """Points (N, 3) moved along a joint's axis, which stays, to straight across from ends."""
        axis = self.axis[:, joint]
        off = (ends - points) @ axis[0]
        NotThisKind.refuse_if(max(np.ptp(off), np.abs(axis - axis[0]).max()) > ROUNDING)
        return np.asarray(points[0] + off[0] * axis[0])

    def parted(self, joints: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...], Centre]:
        """The driven joints, the passive ones, and the centre that these have in common."""
        driven = tuple(j for j in joints if j in self.mechanism.actuated)
        passive = tuple(j for j in joints if j not in driven)
        found = [c for c in self.built.centres if c.joints == passive]
        NotThisKind.refuse_if(not found)
        return driven, passive, found[0]

    def strut(
        self, joint: int, outer: Array, C: Array, reach: Array, hinge: Array | None = None
    ) -> list[Rod]:
        """The force along a slide whose length is that of reach (N, 3)."""
        off = self.offset(joint, reach)
        return [Rod("strut", joint, outer, C, hinge, sliding=joint, offset=off)]

    def along(self, way: _Way) -> list[Rod]:
        """The force of a leg with one actuated joint, and one centre before or behind it."""
        mechanism, sample, path = self.mechanism, self.samples[0], way.path
        driven, passive, centre = self.parted([*path, *way.hanging])
        whole = len(way.joints) in (0, self.ball)
        NotThisKind.refuse_if(len(driven) != 1 or len(passive) > self.ball or not whole)
        (joint,) = driven
        first = path == [joint]
        if way.hanging:
            # Written from the output, where the centre is: the loop is at its foot or crank.
            B, C = self.points(centre), way.end[0]
            last = not path and way.hanging[-1] == joint
            NotThisKind.refuse_if(len(passive) < (self.ball + 1) // 2 or not (first or last))
            if first:
                return [carried(mechanism, sample, joint, C, self.in_output(B))]
            return self.strut(joint, self.in_output(B), C, way.other - B)
        hinge = len(passive) == 1 and not self.planar
        axis = self.axis[0, passive[0]]
        C, B, outer = self.points(centre), way.end, self.in_output(way.other)
        if path.index(joint) > path.index(passive[-1]):
            if self.planar and not mechanism.prismatic[joint]:
                elbow = sample.joints[joint + 1].translation
                one, two = (float(np.linalg.norm((elbow - p[0])[:2])) for p in (C, B))
                return [Rod("elbow", joint, outer, C[0], links=(one, two))]
            NotThisKind.refuse_if(hinge and np.abs(self.axis[:, joint] @ axis).max() > ROUNDING)
            return self.strut(joint, outer, C[0], B - C, axis if hinge else None)
        NotThisKind.refuse_if(path != [joint, *passive])
        if not hinge:
            return [carried(mechanism, sample, joint, C[0], outer)]
        # A hinge that a slide or a crank with the same axis carries (PRS, RRS): its point that is
        # straight across from the end of the rod.
        inner = self.across(C, passive[0], B)
        return [replace(carried(mechanism, sample, joint, inner, outer), hinge=axis)]

    def foot_driven(self, way: _Way) -> list[Rod]:
        """The forces of one leg that is driven at its foot."""
        mechanism, path = self.mechanism, way.path
        slides = mechanism.prismatic[path].tolist()
        known = slides == [False, True] or (slides == [False, False, True] and not self.planar)
        at_foot = set(path[:-1]) & set(mechanism.actuated)
        NotThisKind.refuse_if(not known or not at_foot or len(way.joints) not in (0, self.ball))
        first, slide = path[0], path[-1]
        axis, B = self.axis[0, first], way.end
        if len(path) == 3:
            # Where along the first axis the second one meets it, all crossed at right angles.
            a, b, c = np.moveaxis(self.axis[:, path], 1, 0)
            gap = self.origins[:, path[1]] - self.origins[:, first]
            off = [(x * y).sum(axis=1) for x, y in ((a, b), (b, c), (gap, np.cross(a, b)))]
            NotThisKind.refuse_if(np.abs(off).max() > ROUNDING)
            foot = self.origins[0, first] + (gap[0] @ axis) * axis
        else:
            NotThisKind.refuse_if(np.abs(self.axis[:, slide] @ axis).max() > ROUNDING)
            foot = self.across(self.origins[:, first], first, B)
        offset, outer = self.offset(slide, B - foot), self.in_output(way.other)
        hinge = axis if len(path) == 2 and not self.planar else None
        driven = [x for x in ((0, slide), *enumerate(path[:-1], 1)) if x[1] in mechanism.actuated]
        return [
            Rod(
                "foot" if side else "strut", joint, outer, foot, None if k else hinge,
                across=axis if side else _NONE, side=side, sliding=slide, offset=offset,
            )
            for k, (side, joint) in enumerate(driven)
        ]  # fmt: skip

    def reason(self, way: _Way) -> str:
        """Of a leg that is of another kind than those with a wrench over the pose."""
        mechanism = self.mechanism
        joints = [*way.path, *way.joints, *reversed(way.hanging)]
        name = f"the leg of {', '.join(mechanism.joints[j] for j in joints) or 'no joints'}"
        driven = [j for j in joints if j in mechanism.actuated]
        slides = [j for j in joints if mechanism.prismatic[j]]
        where = "is not supported over the pose"
        if not driven:
            return f"{name} has no actuated joint, which {where}"
        told = " and ".join(mechanism.joints[j] for j in driven)
        if way.hanging:
            return f"{name}, written from the output and driven at {told}, {where}"
        loose = [mechanism.joints[j] for j in way.path[:1] if j in slides and j not in driven]
        what = f", driven at {told},"
        turning = [j for j in way.path if not mechanism.prismatic[j]]
        askew = len(slides) == 1 and bool(turning) and way.path[-1] == slides[0]
        if askew:
            # A slide after turning joints that is not along the line through the leg's ends.
            centre = next((c for c in self.built.centres if c.joints[0] == turning[0]), None)
            feet = self.points(centre or Centre((turning[0],), np.zeros(3)))
            askew = self.beside(slides[0], way.end - feet)
        if askew:
            beside = mechanism.joints[slides[0]]
            what = f" slides ({beside}) beside the line from its foot to its end, which"
        elif loose:
            what = f" is driven at {told} behind the passive slide {loose[0]}, which"
        elif len(driven) > 1:
            what = f" has {len(driven)} actuated joints ({told}), which"
        return f"{name}{what} {where}"

    def beside(self, joint: int, reach: Array) -> bool:
        """Whether a joint's axis has another direction than reach (N, 3)."""
        return bool(np.abs(np.cross(reach * self.flat, self.axis[:, joint])).max() > ROUNDING)


@kept
def sphere_rods(mechanism: Mechanism) -> Rods | None:
    """Return the rods of a spherical mechanism of three legs of three joints; None for another."""
    # From middle axes, which the actuated ones carry as cranks, to outer axes.
    with suppress(NotThisKind):
        kind, _, centre = room_of(mechanism)
        NotThisKind.refuse_if(kind != SPHERE or set(mechanism.task.rows) != {3, 4, 5})
        built, zero = structure(mechanism), at_zero(mechanism)
        turn = np.array(zero.frames[mechanism.output_id].rotation)
        whole, last = path_to(mechanism, built.output), zero.axis[built.output - 1]
        # Of each way: its joints, and the outer axis by the output.
        ways = [(whole[:-1], last)]
        for loop, inner, outer, joints, outside in loop_ends(mechanism):
            radii = [np.array(zero.frames[k].translation) - centre for k in (inner, outer)]
            sizes = [float(np.linalg.norm(r)) for r in radii]
            away = loop.kind == "6d" or outside[-1:] != [built.output - 1]
            NotThisKind.refuse_if(away or min(sizes) <= ROUNDING)
            ways.append((joints, radii[1] / sizes[1]))
        out = []
        for joints, after in ways:
            NotThisKind.refuse_if([j in mechanism.actuated for j in joints] != [True, False])
            u, v = zero.axis[joints]
            rest = float(u @ v) * u
            turned = {"first": v - rest, "second": np.cross(u, v), "across": u}
            out.append(Rod("crank", joints[0], turn.T @ after, rest, **turned))
        driven = {leg.joint for leg in out} == set(mechanism.actuated)
        NotThisKind.refuse_if(len(out) != 3 or not driven)
        return Rods(mechanism, tuple(out), SPHERE, np.eye(3), np.eye(3))
    return None


def quarter_circles(found: Rods) -> bool:
    """Whether both links of each leg of a spherical mechanism are quarter circles."""
    off = (max(float(np.abs(r.inner).max()), abs(found.length(r) ** 2 - 2)) for r in found.rods)
    return max(off) <= ROUNDING


Point = tuple[Any, Any]


def planar_rods(mechanism: Mechanism) -> Rods | None:
    """The three forces of a planar mechanism; None for another one."""
    found = rods(mechanism)
    kinds = [rod.kind for rod in found.rods] if found is not None and found.planar else []
    return found if len(kinds) == 3 and not {"elbow", "foot"} & set(kinds) else None


def count_poses(mechanism: Mechanism, inputs: Array) -> int:
    """How many real poses given inputs (n_a,) have, by algebra; NotThisKind where not told."""
    found = planar_rods(mechanism)
    if found is None:
        raise NotThisKind
    at = dict(zip(mechanism.actuated, inputs.tolist(), strict=True))
    inner: list[Any] = []
    outer: list[Any] = []
    squares: list[Any] = []
    for rod in found.rods:
        value = np.array([at[rod.joint]])
        distance = rod.distance(value, found.length(rod))
        assert distance is not None  # such rods are left out
        for points, place in ((inner, rod.foot(value)[0]), (outer, rod.outer)):
            points.append([rational(Fraction(float(v))) for v in place[:2]])
        squares.append(rational(Fraction(float(distance[0])) ** 2))
    # The angle is counted from a turn that no mechanism has: a pose half a turn from it has no t.
    turn = Fraction(5, 13), Fraction(12, 13)
    line, common = _poses(fmpq_poly([0, 1]), inner, outer, squares, 1, turn)
    # Two poses with one orientation, or two that coincide, are told by common roots.
    shared = max(line.gcd(common).degree(), line.gcd(line.derivative()).degree())
    NotThisKind.refuse_if(line.degree() != 6 or shared > 0)
    return sum(bool(root.imag == 0) for root, _ in line.numer().complex_roots())


def length_name(mechanism: Mechanism, rod: Rod, digits: int = 12) -> str:
    """The length of a rod that slides, by the value of its slide."""
    name = mechanism.joints[rod.sliding]
    longer = f"({name} {'+' if rod.offset > 0 else '-'} {abs(rod.offset):.{digits}g})"
    return longer if rod.offset else name


def _poses(
    t: Poly,
    inner: Sequence[Point],
    outer: Sequence[Point],
    squares: Sequence[Any],
    square: int,
    turn: tuple[Any, Any],
) -> tuple[Poly, Poly]:
    """Return the polynomial in t of all poses, and what divides the position."""
    # The angle is 2 atan(sqrt(square) t), counted from that whose cosine and sine are ``turn``; y
    # is in units of sqrt(square).
    n, c0, s0 = 1 + square * t**2, 1 - square * t**2, 2 * t
    # For a square of 3 the turn is none: its sine is over the root.
    a, b = (rational(Fraction(v)) for v in turn)
    c, s = a * c0 - square * b * s0, a * s0 + b * c0
    away, right = [], []
    for k in (1, 2):
        bx, by = (outer[k][i] - outer[0][i] for i in range(2))
        ex, ey = (inner[k][i] - inner[0][i] for i in range(2))
        x, y = c * bx - square * s * by - n * ex, s * bx + c * by - n * ey
        size, _ = divmod(x**2 + square * y**2, n)
        away.append((x, y))
        right.append(n * (squares[k] - squares[0]) - size)
    below = away[0][0] * away[1][1] - away[0][1] * away[1][0]
    # 2 w . d = right, for both: w = (wx, wy / sqrt(square)) over 2 square below and 2 below.
    wx = right[0] * away[1][1] - right[1] * away[0][1]
    wy = away[0][0] * right[1] - away[1][0] * right[0]
    return divided_by(square * wx**2 + wy**2 - 4 * square * squares[0] * below**2, n), below


@kept
def input_loci(mechanism: Mechanism) -> tuple[PoseEquation, ...]:
    """Return type 2 over the inputs, exact, where these are the three distances; else empty."""
    # The variables are the inputs, or the length of a leg by its input, "(p1 + 0.5)", where a slide
    # is not zero at no length. A point on it has two poses that meet, real or complex ones.
    found = planar_rods(mechanism)
    if found is None or not all(r.kind == "strut" for r in found.rods):
        return ()
    exact = exact_points([p for rod in found.rods for p in (rod.outer, rod.inner)])
    # Up to that the coefficients stay of a length that is found in seconds.
    if max(v.denominator for p in exact.vectors for v in p[:2]) > 10**5:
        return ()
    context = fmpq_mpoly_ctx.get(["t", "r0", "r1", "r2"], Ordering.degrevlex)
    plane = [(rational(x), rational(y)) for x, y, _ in exact.vectors]
    t, *squares = context.gens()
    poly, below = _poses(t, plane[1::2], plane[::2], squares, exact.square, (1, 0))
    if int(poly.degrees()[0]) != 6:
        return ()
    # Of similar triangles there are complex turns that have poses whatever the inputs are; where
    # such a turn is real, as of congruent ones, others are singular than poses that meet.
    always = poly.gcd(below)
    poly, _ = divmod(poly, always)
    whole = poly.discriminant("t")
    if whole == 0 or not always.gcd(always.derivative("t")).is_constant():
        return ()
    # Poses of one orientation that do not coincide are in the discriminant too: what divides the
    # position is zero there. For half a turn that has a lower degree, and t is infinite.
    apart = poly.resultant(below, "t")
    if int(below.degrees()[0]) < 4:
        apart *= max(coefficients_by(poly, (0,)).items())[1]
    names = tuple(length_name(mechanism, rod) for rod in found.rods)
    factors = (f for f, _ in whole.factor()[1] if divmod(apart, f)[1] != 0)
    stated = (pose_equation(f, ("t", *names)) for f in factors)
    # In the inputs, not in their squares, and without t.
    return tuple(replace(x, names=names, powers=2 * x.powers[:, 1:]) for x in stated)


LOOP = -1
"""Stands for the pin that a loop closes in, among the joints of its ring."""
_LEVEL = 1e-7


def number_of_modes(
    mechanism: Mechanism,
    inputs: Array,
    target: tuple[Array, Array, tuple[int, ...]] | None,
    found: Sequence[Array],
) -> tuple[int | None, str]:
    """Return how many poses inputs (n_a,) have, or inputs a target pose, and words on it."""
    # Limits left aside; None where algebra does not tell. ``found``: one configuration a pose.
    each = "the two solutions of each leg"
    one_rod = partial(count_one_rod, mechanism, found, target is None)
    ways: list[tuple[Callable[[], int], str]] = [(one_rod, "the quadratic equation of its rod")]
    if target is None:
        ways += [
            (partial(count_triangles, mechanism, found), "the triangle of its three pins"),
            (partial(count_poses, mechanism, inputs), "the real roots of a polynomial of degree 6"),
        ]
    else:
        ways += [
            (partial(count_hinged, mechanism, *target[:2]), f"the planes of its hinges and {each}"),
            (partial(count_inputs, mechanism, *target[:2]), each),
        ]
    for count, by in ways:
        with suppress(NotThisKind):
            return count(), by
    return None, by


def count_inputs(mechanism: Mechanism, R: Array, p: Array) -> int:
    """Return how many inputs within their limits give a pose R (3, 3), p (3,)."""
    # Passive joints have limits of their own, which may leave fewer.
    found = legs_of(mechanism)
    if found is None:
        raise NotThisKind
    if rods(mechanism) is not None:
        every = {0, 1, 5} if found.planar else set(range(6))
        shared = len({rod.joint for rod in found.rods}) < len(found.rods)
        whole = set(mechanism.task.rows) == every
        NotThisKind.refuse_if(found.tilted or found.hinged or shared or not whole)
    there = found.placed(pin.SE3(R, p))
    return _solutions(found, there.rotation, there.translation)


def _solutions(found: Rods, R: Array, p: Array) -> int:
    """Values of the joints of legs, within their limits, at a pose R (3, 3), p (3,)."""
    return math.prod(
        inside(
            found.mechanism, r.joint, r.solutions(p + R @ r.outer, found.planar, found.length(r))
        )
        for r in found.rods
    )


def count_one_rod(mechanism: Mechanism, found: Sequence[Array], direct: bool) -> int:
    """Return how many poses (direct), or working modes, one rod between two joints has."""
    # Configurations ``found`` are to agree in the joint that is given.
    driven, other, centre = _one_rod(mechanism)
    zero, start = at_zero(mechanism), Sample(mechanism, home(mechanism))
    # Whether the one row of the output is the motion of the other joint.
    row, slides = mechanism.task.rows[0], mechanism.prismatic[other]
    along = abs(float(zero.axis[other][row % 3]))
    shown = bool(slides == (row < 3)) and abs(along - 1) <= ROUNDING
    NotThisKind.refuse_if(
        not found or structure(mechanism).output - 1 != other or not (direct or shown)
    )
    given, sought = (driven, other) if direct else (other, driven)
    apart = mechanism.space.wrap(np.array(found) - found[0])[:, given]
    NotThisKind.refuse_if(np.abs(apart).max() > ROUNDING)
    # The ends of the rod: its centre on the side of one joint, where the loop closes on the other.
    near = path_to(mechanism, centre.joints[0] + 1)[0]
    (a,), (b,) = closing(mechanism)
    frame = b if bodies(mechanism)[0][1] == (driven + other - near) + 1 else a

    def end(sample: Sample, joint: int) -> Array:
        at = sample.joints[centre.joints[0] + 1].act(centre.point)
        return np.array(at if joint == near else sample.frames[frame].translation)

    length = float(np.linalg.norm(end(start, given) - end(start, sought)))
    held, moving = (carried(mechanism, zero, j, end(zero, j), np.zeros(3)) for j in (given, sought))
    roots = moving.solutions(held.foot(float(found[0][given])), False, length)
    return len(roots) if direct else inside(mechanism, sought, roots)


def count_hinged(mechanism: Mechanism, R: Array, p: Array) -> int:
    """Working modes of three legs on hinges within the limits of their slides."""
    made = rods(mechanism)
    if made is None or made.planar or len(made.rods) != 3 or any(
        r.hinge is None or r.kind != "strut" for r in made.rods
    ):  # fmt: skip
        raise NotThisKind
    rows = set(mechanism.task.rows)
    moves, turns = [k for k in range(3) if k in rows], [k for k in range(3) if k + 3 in rows]
    NotThisKind.refuse_if((len(moves), len(turns)) != (1, 2))
    poses = _hinged_poses(made.rods, R, p, moves[0], 3 - sum(turns))
    return sum(_solutions(made, turned, at) for turned, at in poses)


def _hinged_poses(
    legs: Sequence[Rod], R: Array, p: Array, move: int, turn: int
) -> Iterator[tuple[Array, Array]]:
    """Poses at this height and tilt that keep each leg's end in the plane across its hinge."""
    axis, across = np.eye(3)[turn], [k for k in range(3) if k != move]
    height = p[move] * np.eye(3)[move]
    rows, right = [], []
    for rod in legs:
        n, v = rod.hinge, R @ rod.outer
        assert n is not None
        along = (v @ axis) * axis
        rows.append([*(n[k] for k in across), n @ (v - along), n @ np.cross(axis, v)])
        right.append(n @ (rod.inner - along - height))
    # Position across, cosine and sine of the turn.
    circle = np.array([0.0, 0.0, 1.0, 1.0])
    for y in _on_line(np.array(rows), np.array(right), np.zeros(4), 1.0, circle):
        at = height.copy()
        at[across] = y[:2]
        yield pin.exp3(np.arctan2(y[3], y[2]) * axis) @ R, at


def level_words(mechanism: Mechanism, found: Sequence[Array], p: Array | None) -> str:
    """Return how many configurations keep the output's axes, against algebra's number; or ""."""
    # ``found``: those within the limits; ``p`` (3,) is the position of the inverse problem.
    with suppress(NotThisKind):
        pairs = _level_pairs(mechanism)
        turned = [output_pose(mechanism, q).rotation - np.eye(3) for q in found]
        level = sum(bool(np.abs(x).max() <= _LEVEL) for x in turned)
        q = found[0] if len(found) else home(mechanism)
        number, by = (_three_spheres(pairs, q), "three spheres") if p is None else (
            _solutions(pairs, np.eye(3), p), "the two solutions of each crank"
        )  # fmt: skip
        all_ = "all there are" if number == level else f"of {number} that there are"
        return f"; {level} with the output not turned: {all_}, by {by}"
    return ""


def _level_pairs(mechanism: Mechanism) -> Rods:
    """One rod of each crank, where the others of the crank do the same for a level output."""
    made = rods(mechanism)
    if made is None or made.planar or set(mechanism.task.rows) != {0, 1, 2}:
        raise NotThisKind
    out: dict[int, Rod] = {}
    for rod in made.rods:
        first = out.setdefault(rod.joint, rod)
        gap = (rod.inner - rod.outer) - (first.inner - first.outer)
        unlike = abs(made.length(rod) - made.length(first))
        one, two = ((r.first, r.second, r.across) for r in (rod, first))
        moved = np.abs(np.subtract(one, two)).max()
        off = max(float(np.abs(gap).max()), unlike, float(moved))
        NotThisKind.refuse_if(off > _LEVEL or not rod.moved or rod.hinge is not None)
    away = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max()
    NotThisKind.refuse_if(len(out) != 3 or away > _LEVEL)
    return replace(made, rods=tuple(out.values()))


def _three_spheres(pairs: Rods, q: Array) -> int:
    """Positions of the output at the inputs of q, limits of passive joints left aside."""
    centres = np.array([r.foot(float(q[r.joint])) - r.outer for r in pairs.rods])
    sizes = np.array([pairs.length(r) for r in pairs.rods])
    rows = 2 * (centres[1:] - centres[0])
    right = (centres[1:] ** 2).sum(axis=1) - centres[0] @ centres[0] - sizes[1:] ** 2
    found = _on_line(rows, right + sizes[0] ** 2, centres[0], float(sizes[0]), np.ones(3))
    return len(found)


def _on_line(rows: Array, right: Array, centre: Array, size: float, weights: Array) -> list[Array]:
    """Points (k,) of the line rows (k - 1, k) x = right at a weighted distance from a centre."""
    U, sigma, Vt = np.linalg.svd(rows)
    NotThisKind.refuse_if(sigma[-1] <= 1e-9 * sigma[0])
    start, v = Vt[:-1].T @ ((U.T @ right) / sigma), Vt[-1]
    x, w = start - centre, weights * v
    return [start + t * v for t in _two_roots(v @ w, x @ w, x @ (weights * x) - size**2)]


def _one_rod(mechanism: Mechanism) -> tuple[int, int, Centre]:
    """The driven joint, the other one, and the rod's centre between."""
    counts = [len(x) for x in (mechanism.loops, mechanism.actuated, mechanism.task.rows)]
    NotThisKind.refuse_if(counts != [1, 1, 1] or mechanism.loops[0].kind == "6d")
    paths = [path_to(mechanism, body) for body in bodies(mechanism)[0]]
    long, short = sorted(paths, key=len, reverse=True)
    NotThisKind.refuse_if(len(short) != 1 or len(long) < 2 or set(long) & set(short))
    ends = (long[0], short[0])
    flat = mechanism.loops[0].kind == "planar" and len(long) != 2
    known = [c for c in structure(mechanism).centres if c.joints == tuple(long[1:])]
    whole = len(long) + 1 == mechanism.n and mechanism.actuated[0] in ends
    NotThisKind.refuse_if(flat or not known or not whole)
    driven, other = ends if mechanism.actuated[0] == ends[0] else ends[::-1]
    return driven, other, known[0]


def count_triangles(mechanism: Mechanism, found: Sequence[Array]) -> int:
    """Poses at the inputs of closed configurations (n,), limits left aside."""
    ring = _ring(mechanism)
    pins = [j for j in ring if j not in mechanism.actuated]
    on_way = set(pins) & set(path_to(mechanism, structure(mechanism).output))
    NotThisKind.refuse_if(not found or not on_way)
    # The three pins are parallel, and corners of a triangle in their plane.
    sample, own = Sample(mechanism, found[0]), closing(mechanism)[0][0]
    axes = np.array([sample.axis[j] for j in pins if j != LOOP])
    if mechanism.loops[0].kind == "planar":
        axes = np.concatenate([axes, np.array(sample.frames[own].rotation)[None, :, 2]])
    NotThisKind.refuse_if(np.abs(np.cross(axes, axes[0])).max() > ROUNDING)
    points = np.array([_place(sample, j, own) for j in pins])
    corners = points @ np.linalg.svd(axes[:1])[2][1:].T
    sides = corners - np.roll(corners, 1, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    NotThisKind.refuse_if(lengths.min() <= ROUNDING * max(lengths.max(), ROUNDING))
    height = abs(sides[0][0] * sides[1][1] - sides[0][1] * sides[1][0]) / lengths.max()
    # Height of a triangle, of its longest side, at which both of its places are one.
    return 1 if height <= 1e-5 * lengths.max() else 2


@kept
def point_legs(mechanism: Mechanism) -> Rods | None:
    """Return both rods, on cranks or slides, of a five-bar that places its middle pin; or None."""
    ring, plane = _ring(mechanism), plane_axes(mechanism)
    driven = [j in mechanism.actuated for j in ring]
    whole = driven == [True, False, False, False, True] and len(ring) == mechanism.n + (
        LOOP in ring
    )
    if plane is None or not whole or not position_in(plane[0], mechanism.task.rows):
        return None
    # The output is the position of the middle pin, as a point of one of its two bodies.
    start, zero = (Sample(mechanism, q, *plane) for q in (home(mechanism), np.zeros(mechanism.n)))
    pin, own = ring[2], closing(mechanism)[0][0]
    joined = bodies(mechanism)[0] if pin == LOOP else (pin + 1, mechanism.model.parents[pin + 1])
    away = _place(start, pin, own) - np.array(start.output.translation)
    near = np.linalg.norm(away[:2]) <= ROUNDING * mechanism.length_scale
    if structure(mechanism).output not in joined or not near:
        return None
    sides = zip((ring[0], ring[4]), (ring[1], ring[3]), closing(mechanism), strict=True)
    with suppress(NotThisKind):
        legs = [
            carried(mechanism, zero, act, _place(zero, middle, own), np.zeros(3))
            for act, middle, (own,) in sides
        ]
        return Rods(mechanism, tuple(legs), PLANE, *plane)
    return None


def _place(sample: Sample, pin: int, own: int) -> Array:
    """Where a pin is (3,); that of the loop by its frame ``own``, since the tree may be open."""
    there = sample.frames[own] if pin == LOOP else sample.joints[pin + 1]
    return np.array(there.translation)


def _ring(mechanism: Mechanism) -> list[int]:
    """Joints around the one loop from base to base, of which three are passive pins; or none."""
    if len(mechanism.loops) != 1 or mechanism.prismatic[list(mechanism.passive)].any():
        return []
    first, second = (path_to(mechanism, body) for body in bodies(mechanism)[0])
    ring = [*first, *([] if mechanism.loops[0].kind == "6d" else [LOOP]), *reversed(second)]
    pins = [j for j in ring if j not in mechanism.actuated]
    whole = len(pins) == 3 and set(mechanism.passive) <= set(pins)
    return ring if whole and not set(first) & set(second) else []
