"""Legs that pass one force each on the output: what a kind answers, and how one is recognised.

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
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from pinsing.loops.motion import home
from pinsing.loops.structure import (
    PLANE,
    SPACE,
    SPHERE,
    Centre,
    NotThisKind,
    at_zero,
    loop_ends,
    output_pose,
    plane_axes,
    room_of,
    structure,
)
from pinsing.measures import ROUNDING, Array, ArrayLike
from pinsing.robot.mechanism import Mechanism, Sample, path_to
from pinsing.robot.source import kept

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
        # |e - q first| = length.
        middle = along / size
        left = middle**2 - known / size
        NotThisKind.refuse_if(abs(left) <= ROUNDING)
        return () if left < 0 else (middle + float(np.sqrt(left)), middle - float(np.sqrt(left)))

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

    def length(self, rod: Rod) -> float:
        """Distance of C and B at home, metres; in the plane if that is level."""
        q = home(self.mechanism)
        pose = self.placed(output_pose(self.mechanism, q))
        away = pose.act(rod.outer) - rod.foot(float(q[rod.joint]))
        return float(np.linalg.norm(away[: 2 if self.planar else 3]))


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


def why_no_rods(mechanism: Mechanism) -> str:
    """What keeps the legs from passing one force each; empty where they do."""
    found = _recognized(mechanism)
    return found if isinstance(found, str) else ""


def most_assemblies(mechanism: Mechanism) -> int | None:
    """Return how many poses given inputs can have at most; None where no number is known."""
    # Three distances of a body in a plane: 6 (Gosselin and Sefrioui 1991); six in space: 40
    # (Raghavan 1991, Lazard 1992); 3-RPS: 16 (Nanua, Waldron and Murthy 1990). On the sphere three
    # equations of degree 2 in the quaternion: 8, where they are finite in number.
    found = rods(mechanism) or sphere_rods(mechanism)
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

    def rods(self) -> Rods:
        mechanism = self.mechanism
        out: list[Rod] = []
        for way in self.ways():
            for kind in (self.hanging,) if way.hanging else (self.foot_driven, self.along):
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
        along = np.array([s.axis[joint] for s in self.samples])
        NotThisKind.refuse_if(not self.mechanism.prismatic[joint] or self.beside(joint, reach))
        lengths = (reach * self.flat * along).sum(axis=1)
        values = np.array([s.q[joint] for s in self.samples])
        for off in (lengths - values, -lengths - values):
            if np.abs(off - off[0]).max() <= ROUNDING:
                return 0.0 if abs(off[0]) <= ROUNDING else round(float(off[0]), 12)
        raise NotThisKind

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
        """The force of a leg with one centre and one actuated joint before or behind it."""
        mechanism, sample, path = self.mechanism, self.samples[0], way.path
        driven, passive, centre = self.parted(path)
        whole = len(way.joints) in (0, self.ball)
        NotThisKind.refuse_if(len(driven) != 1 or len(passive) > self.ball or not whole)
        (joint,) = driven
        hinge = len(passive) == 1 and not self.planar
        axis = sample.axis[passive[0]]
        C, B, outer = self.points(centre), way.end, self.in_output(way.other)
        if path.index(joint) > path.index(passive[-1]):
            if self.planar and not mechanism.prismatic[joint]:
                elbow = sample.joints[joint + 1].translation
                one, two = (float(np.linalg.norm((elbow - p[0])[:2])) for p in (C, B))
                return [Rod("elbow", joint, outer, C[0], links=(one, two))]
            tilts = max(abs(s.axis[joint] @ axis) for s in self.samples)
            NotThisKind.refuse_if(hinge and tilts > ROUNDING)
            return self.strut(joint, outer, C[0], B - C, axis if hinge else None)
        NotThisKind.refuse_if(path != [joint, *passive])
        if not hinge:
            return [carried(mechanism, sample, joint, C[0], outer)]
        # A hinge that a slide or a crank with the same axis carries (PRS, RRS): its point that is
        # straight across from the end of the rod.
        off = (B - C) @ axis
        turned = np.abs([s.axis[passive[0]] - axis for s in self.samples]).max()
        NotThisKind.refuse_if(max(turned, np.abs(off - off[0]).max()) > ROUNDING)
        return [replace(carried(mechanism, sample, joint, C[0] + off[0] * axis, outer), hinge=axis)]

    def hanging(self, way: _Way) -> list[Rod]:
        """The force of a leg written from the output: the loop is at its foot, or at the crank."""
        driven, passive, centre = self.parted(way.hanging)
        NotThisKind.refuse_if(len(passive) not in ((1,) if self.planar else (2, 3)))
        B = self.points(centre)
        outer = self.in_output(B)
        if not driven and len(way.path) == 1 and way.path[0] in self.mechanism.actuated:
            return [carried(self.mechanism, self.samples[0], way.path[0], way.end[0], outer)]
        NotThisKind.refuse_if(len(driven) != 1 or way.path or way.hanging != (*passive, *driven))
        return self.strut(driven[0], outer, way.end[0], way.other - B)

    def foot_driven(self, way: _Way) -> list[Rod]:
        """The forces of one leg that is driven at its foot."""
        mechanism, sample, path = self.mechanism, self.samples[0], way.path
        slides = mechanism.prismatic[path].tolist()
        known = slides == [False, True] or (slides == [False, False, True] and not self.planar)
        at_foot = set(path[:-1]) & set(mechanism.actuated)
        NotThisKind.refuse_if(not known or not at_foot or len(way.joints) not in (0, self.ball))
        first, slide = path[0], path[-1]
        axis = sample.axis[first]
        foot, B = np.array(sample.joints[first + 1].translation), way.end
        if len(path) == 3:
            # Where along the first axis the second one meets it, all crossed at right angles.
            at = [(*s.axis[path], s.origins[path[1]] - s.origins[first]) for s in self.samples]
            off = [x for a, b, c, gap in at for x in (a @ b, b @ c, gap @ np.cross(a, b))]
            NotThisKind.refuse_if(np.abs(off).max() > ROUNDING)
            met = float(at[0][3] @ axis)
        else:
            # Straight across from the end.
            off = (B - foot) @ axis
            met = float(off[0])
            along = max(abs(s.axis[slide] @ axis) for s in self.samples)
            NotThisKind.refuse_if(max(along, np.abs(off - met).max()) > ROUNDING)
        foot = foot + met * axis
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
        along = np.array([s.axis[joint] for s in self.samples])
        return bool(np.abs(np.cross(reach * self.flat, along)).max() > ROUNDING)


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
