"""Singular loci from the closure equations themselves, exactly: for loops of any kind and cut.

With G the Jacobian of the closure equations, the joints that carry no actuator move with all
actuators held where the columns of G that are theirs are dependent; a motion leaves the output at
rest where the columns of G over the rows of the output are. Both are matrices of polynomials in
the joint angles. Where they have more rows than columns (overconstrained loops, more actuators
than freedoms) all their largest minors vanish there together.

Where each leg ends at the output in a ball (a pin in the plane, a hinge through the centre of a
spherical mechanism) what it passes on is said in its own joint angles: forces through that point
which do no work on its passive joints. With one such joint they are those along its axis and along
the arm to it, with two the one across both velocities.
"""

from __future__ import annotations

import functools
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation, equation
from pinsing.algebra.minors import determinant
from pinsing.algebra.real_roots import real_roots
from pinsing.algebra.ring import Poly, Ring, make_ring, rational
from pinsing.errors import OptionError
from pinsing.loops.closure import near_home, random_closed, ranks
from pinsing.loops.exact import Hinge, LegChain, Row, Turn, cross, dot, leg_chain, rational_turn
from pinsing.loops.forms import JointForms, JointLocus, PoseEquation, trig_polynomial
from pinsing.loops.legs import sphere_rods
from pinsing.loops.pose_loci import squares_note
from pinsing.loops.structure import (
    PLANE,
    SIZE,
    SPACE,
    SPHERE,
    NotThisKind,
    at_zero,
    in_room,
    loop_ends,
    room_of,
    structure,
    without_length,
)
from pinsing.measures import NOISE, ROUNDING
from pinsing.robot.mechanism import Mechanism, closing, path_to
from pinsing.robot.source import kept

if TYPE_CHECKING:
    from pinsing.families import ClosedForm


@dataclass(frozen=True, eq=False)
class LegWrench:
    """One wrench that a leg passes on with its actuator locked."""

    leg: int  # number of the way from the base to the output, from 1
    # force and moment about the origin of the base (6,); in the plane fx, fy, mz; on the sphere the
    # moment about the centre. Homogeneous: all entries of one degree in each joint
    line: Row
    # what each actuated joint of the leg feels of it; a joint that feels nothing is left out
    arms: dict[int, Poly]


@dataclass(frozen=True, eq=False)
class LegWrenches:
    """All legs of a mechanism."""

    kind: str  # ``space``, ``plane`` or ``sphere``
    ring: Ring  # of all joints
    turn: Turn  # rotation before anything: the normal of the plane becomes z
    carrier: LegChain  # the way along the tree, up to the output
    output: Row  # origin of the output frame in the base, times the carrier's scale
    # whether the carrier ends in a ball (pin, hinge) at the output; else its own joints are the
    # unknowns
    ended: bool
    # of all ways; of the others alone where the carrier has no such end
    wrenches: tuple[LegWrench, ...]
    # what is zero where passive joints of a leg are dependent themselves: by its number, these, and
    # whether they are the three hinges that a file writes for a ball
    passive: dict[tuple[int, tuple[int, ...], bool], Poly]
    off: float  # by how much numbers of the file were changed to be exact


@kept
def leg_wrenches(mechanism: Mechanism) -> LegWrenches:
    """The wrenches of all legs."""
    zero = at_zero(mechanism)
    kind, turn, centre = room_of(mechanism)
    ring = make_ring(mechanism.prismatic.tolist())
    ways = leg_ways(mechanism)
    used = [j for joints, _, _ in ways for j in joints if j in mechanism.passive]
    NotThisKind.refuse_if(len(used) > len(set(used)), "legs share passive joints")
    wrenches: list[LegWrench] = []
    passive: dict[tuple[int, tuple[int, ...], bool], Poly] = {}
    path = path_to(mechanism, structure(mechanism).output)
    carrier = leg_chain(ring, path, zero.axis[path], zero.origins[path], turn)
    off = carrier.off
    at = np.array(zero.frames[mechanism.output_id].translation)
    output = carrier.placed(carrier.point(at), carrier.scale)
    ended = ways[0][1] is not None or kind == SPHERE
    for number, (joints, end, ball) in enumerate(ways, 1):
        if number == 1 and not ended:
            continue
        chain = leg_chain(ring, joints, zero.axis[joints], zero.origins[joints], turn)
        off = max(off, chain.off)
        loose = number, tuple(j for j in joints if j in mechanism.passive), False
        for wrench, content in _leg(mechanism, chain, number, kind, end, centre):
            wrenches.append(wrench)
            if not ring.nowhere_zero(content):
                passive[loose] = passive.get(loose, ring.one) * content
        if ball:
            # Where the three hinges that are written for a ball lie in a plane.
            axes = [h.axis for h in carrier.hinges if h.joint in ball]
            flat = dot(axes[0], cross(axes[1], axes[2]), ring.zero)
            if not ring.nowhere_zero(flat):
                passive[number, ball, True] = flat
    return LegWrenches(kind, ring, turn, carrier, output, ended, tuple(wrenches), passive, off)


Way = tuple[list[int], Array | None, tuple[int, ...]]
"""Joints before the end of a leg, the end (3,) with all joints at zero, hinges of a ball there."""


def leg_ways(mechanism: Mechanism) -> list[Way]:
    """Return each way from the base to the output, that of the tree first."""
    # The first one's end is None where it has none of its own, and on the sphere.
    built, zero, kind = structure(mechanism), at_zero(mechanism), room_of(mechanism)[0]
    NotThisKind.refuse_if(built.output == 0, "the output is the base")
    path = path_to(mechanism, built.output)
    out: list[Way] = [(path, None, ())]
    last = next((c for c in built.centres if built.output - 1 in c.joints), None)
    size = 3 if kind == SPACE else 1
    if kind != SPHERE and last is not None and len(path) > size == len(last.joints):
        end = np.array(zero.joints[path[-size] + 1].act(last.point))
        out = [(path[:-size], end, last.joints if kind == SPACE else ())]
    for loop, inner, _, joints, outside in loop_ends(mechanism):
        NotThisKind.refuse_if(
            outside[-1:] != [built.output - 1], "a loop closes away from the output"
        )
        NotThisKind.refuse_if(
            loop.kind not in ("3d", "planar" if kind == PLANE else "3d"),
            f"a loop of type {loop.kind} leaves no ball, pin or hinge",
        )
        NotThisKind.refuse_if(
            not joints or built.output - 1 in joints,
            "a loop ties the output to the base or to itself",
        )
        out.append((joints, np.array(zero.frames[inner].translation), ()))
    return out


def _leg(
    mechanism: Mechanism, chain: LegChain, number: int, kind: str, end: Array | None, centre: Array
) -> Iterator[tuple[LegWrench, Poly]]:
    """The wrenches of one way, each with what is zero where its passive joints are dependent."""
    zero = chain.ring.zero
    point = chain.position if end is None else chain.point(end)
    passive = [h for h in chain.hinges if h.joint in mechanism.passive]
    driven = [h for h in chain.hinges if h.joint in mechanism.actuated]

    def moved(hinge: Hinge) -> Row:
        """What a joint does to the end, or to the turn, up to a positive factor."""
        return hinge.axis if kind == SPHERE else chain.velocity(hinge, point, chain.scale)

    arms = [moved(h) for h in passive]
    if kind == SPHERE and end is not None:
        # A loop that closes in a point of the sphere leaves a turn about the radius there.
        arms.append([b - chain.scale * m for b, m in zip(point, chain.fixed(centre), strict=True)])
    for force in _forces(chain, passive, arms, point, kind):
        plain, content = _primitive(force)
        felt = {
            h.joint: arm
            for h in driven
            if (arm := dot(plain, moved(h), zero)) != 0
        }  # fmt: skip
        yield LegWrench(number, _line(chain, plain, point, kind), felt), content


def _forces(
    chain: LegChain, passive: list[Hinge], arms: list[Row], point: Row, kind: str
) -> list[Row]:
    """Forces through the end of a leg that do no work on its passive joints, which move it so."""
    one, zero = chain.ring.one, chain.ring.zero
    every = [[one if i == k else zero for i in range(3)] for k in range(3)]
    if kind == PLANE:
        NotThisKind.refuse_if(len(arms) > 1, "a leg has more passive joints than its end leaves it")
        normal = [one * rational(v) for v in chain.base[2]]  # in the frame of the chain
        crossed = [cross(normal, a) for a in arms or every]
        # Of the three axes any two that are not the normal.
        return crossed if arms else [c for c in crossed if any(x != 0 for x in c)][:2]
    if len(arms) == 2:
        return [cross(arms[0], arms[1])]
    NotThisKind.refuse_if(
        kind == SPHERE or len(arms) > 2, "a leg has other passive joints than its end leaves it"
    )
    if not arms:
        return every
    hinge = passive[0]
    NotThisKind.refuse_if(hinge.slides, "a passive slide is the only passive joint of a leg")
    grown = chain.scale / hinge.scale
    return [hinge.axis, [b - grown * o for b, o in zip(point, hinge.origin, strict=True)]]


def _primitive(force: Row) -> tuple[Row, Poly]:
    """A vector over what its entries share, and that."""
    parts = [x for x in force if x != 0]
    NotThisKind.refuse_if(not parts, "the passive joints of a leg are always dependent")
    content = functools.reduce(lambda a, b: a.gcd(b), parts)
    return [x / content for x in force], content


def _line(chain: LegChain, force: Row, point: Row, kind: str) -> Row:
    """Wrench of a force through a point, in the base; every entry of one degree."""
    f = chain.in_base(force)
    if kind == SPHERE:
        return f
    # About the first joint's place the moment is simple; what it has in common is taken out.
    plain, _ = _primitive([*(chain.scale * x for x in force), *cross(point, force)])
    f, m = chain.in_base(plain[:3]), chain.in_base(plain[3:])
    at = [chain.ring.one * rational(v) for v in chain.at]
    m = [a + b for a, b in zip(m, cross(at, f), strict=True)]
    return in_room(kind, [*f, *m])


_SYMBOL = re.compile(r"\b[qd](\d+)\b")
_ROWS = ("vx", "vy", "vz")


@dataclass(frozen=True, eq=False)
class LegProof:
    """One leg as an arm."""

    leg: int  # its number, from 1: that of the tree first
    joints: tuple[str, ...]  # from the base outwards
    task: str  # rows of the velocity of its end
    form: ClosedForm  # its families; with a certificate where one was found

    def __str__(self) -> str:
        parts = [
            _SYMBOL.sub(lambda m: self.joints[int(m[1]) - 1], f.text) for f in self.form.families
        ]
        where = f"if and only if {' or '.join(parts)}" if parts else "nowhere"
        return (
            f"leg {self.leg}: {', '.join(self.joints)} up to its end ({self.task}) singular "
            f"{where}: {self.form.word}"
        )


def leg_proofs(mechanism: Mechanism, seconds: float = 20.0) -> tuple[LegProof, ...]:
    """Return certified closed forms of legs with one actuator as arms, in ``seconds`` each."""
    # OptionError if no leg ends in a ball, a pin or a hinge at the output.
    try:
        ends = leg_ways(mechanism)
    except NotThisKind as why:
        raise OptionError(f"{mechanism.name}: no leg has a certificate of its own: {why}") from None
    out = tuple(_proofs(mechanism, ends, seconds))
    OptionError.refuse_if(
        not out,
        f"{mechanism.name}: no leg has a certificate of its own: none has one actuator and "
        "ends in a ball, a pin or a hinge at the output",
    )
    return out


def _proofs(mechanism: Mechanism, ends: list[Way], seconds: float) -> Iterator[LegProof]:
    from pinsing.families import closed_form, prove
    from pinsing.robot.load import load

    kind, turn, centre = room_of(mechanism)
    zero = at_zero(mechanism)
    task = "position"
    if kind == PLANE:
        normal = np.abs([float(v) for v in turn[2]])
        if normal.max() >= 1 - ROUNDING:
            task = ",".join(r for k, r in enumerate(_ROWS) if k != int(np.argmax(normal)))
    for number, (path, place, _) in enumerate(ends, 1):
        joints, end = (path, place) if kind != SPHERE or place is not None else (
            path[:-1], centre + zero.axis[path[-1]]
        )  # fmt: skip
        driven = [j for j in joints if j in mechanism.actuated]
        if end is None or len(driven) != 1:
            continue
        model = pin.Model(mechanism.model)
        body = joints[-1] + 1
        name = f"end of leg {number}"
        place_there = pin.SE3(np.eye(3), np.array(zero.joints[body].actInv(end)))
        model.addFrame(pin.Frame(name, body, 0, place_there, pin.FrameType.OP_FRAME))
        names = tuple(mechanism.joints[j] for j in joints)
        arm = load(model, tip=name, joints=names, task=task)
        form = prove(closed_form(arm, prove=False), seconds)
        yield LegProof(number, names, task, form)


Step = tuple[int, int]
"""A joint, and 1 where it is passed outwards, -1 where towards the base."""


class ClosureForms:
    """Rows of Jacobians over the ``ring`` of all joints, seen from a body between them.

    ``off``: by how much numbers of the file were changed to be exact.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.ring = make_ring(mechanism.prismatic.tolist())
        self.zero = at_zero(mechanism)
        self.kind, self.turn, _ = room_of(mechanism)
        self.off = 0.0

    def matrices(self) -> tuple[list[Row], list[Row]]:
        """Return matrices with a column for each passive joint, and for each joint."""
        # Where the first's columns depend, passive joints move with held actuators; where the
        # second's do, a motion leaves the output at rest.
        loops = zip(self.mechanism.loops, *closing(self.mechanism), strict=True)
        rows = [row for loop, a, b in loops for row in self.loop(loop.kind, a, b)]
        held = [[row[j] for j in self.mechanism.passive] for row in rows]
        held, whole = (
            [row for row in M if any(x != 0 for x in row)] for M in (held, [*rows, *self.output()])
        )
        return held, whole

    def loop(self, kind: str, a: int, b: int) -> list[Row]:
        """One loop's rows, seen from the middle of the joints that it goes through."""
        frames = self.mechanism.model.frames
        first, second = (path_to(self.mechanism, int(frames[k].parentJoint)) for k in (a, b))
        shared = sum(x == y for x, y in zip(first, second, strict=False))
        round_ = [(j, -1) for j in reversed(first[shared:])] + [(j, 1) for j in second[shared:]]
        if kind == "6d":
            return self._whole(round_)
        # The rows of a planar loop are along the axes of its first frame: it is the one that rests.
        planar = kind == "planar" and self.kind != PLANE
        rows = self._none()
        back, on = _parted(round_, 0 if planar else len(round_) // 2)
        for side, frame, steps in ((-1, a, back), (1, b, on)):
            self._add(rows, side, np.array(self.zero.frames[frame].translation), steps, self.turn)
        if planar:
            axes = rational_turn(np.array(self.zero.frames[a].rotation))
            unit = [[self.ring.one * rational(axes[i][k]) for i in range(3)] for k in range(2)]
            return [
                [dot(u, [row[j] for row in rows[:3]], self.ring.zero)
                 for j in range(self.mechanism.n)]
                for u in unit
            ]  # fmt: skip
        return rows[:2] if self.kind == PLANE else rows[:3]

    def output(self) -> list[Row]:
        """Rows of the output that count; where all do they may be those of another point."""
        task = self.mechanism.task.rows
        path = [(j, 1) for j in path_to(self.mechanism, structure(self.mechanism).output)]
        if SIZE[self.kind] == len(task) == ranks(self.mechanism).output:
            return self._whole(path)
        rows = self._none()
        place = self.zero.frames[self.mechanism.output_id]
        self._add(rows, 1, np.array(place.translation), path, rational_turn(np.eye(3)))
        return [rows[k] for k in task]

    def _none(self) -> list[Row]:
        return [[self.ring.zero] * self.mechanism.n for _ in range(6)]

    def _whole(self, steps: Sequence[Step]) -> list[Row]:
        """All of a motion between two bodies: that of a point of a body in the middle."""
        rows = self._none()
        middle = len(steps) // 2
        at = self.zero.origins[steps[middle][0]]
        for side, part in zip((-1, 1), _parted(steps, middle), strict=True):
            self._add(rows, side, at, part, self.turn, rests=True)
        return rows if self.kind == SPHERE else in_room(self.kind, rows)

    def _add(
        self, rows: list[Row], side: int, at: Array, steps: Sequence[Step], turn: Turn,
        rests: bool = False,
    ) -> None:  # fmt: skip
        """Add what joints do to a point and to the turn of its body, by their columns."""
        # The point is one of the last body, or of the first where it ``rests``.
        if not steps:
            return
        joints = [j for j, _ in steps]
        # A joint that is passed from its own body to the one before moves that the other way.
        axes = self.zero.axis[joints] * np.array([float(sign) for _, sign in steps])[:, None]
        chain = leg_chain(self.ring, joints, axes, self.zero.origins[joints], turn)
        self.off = max(self.off, chain.off)
        point = chain.fixed(at) if rests else chain.point(at)
        scale = self.ring.one if rests else chain.scale
        times = rational(Fraction(side))
        for hinge in chain.hinges:
            reach = [hinge.scale * b for b in point] if rests else point
            grown = hinge.scale if rests else scale
            for k, x in enumerate(chain.in_base(chain.velocity(hinge, reach, grown))):
                rows[k][hinge.joint] += times * x
            if not hinge.slides:
                for k, x in enumerate(chain.in_base([scale * x for x in hinge.axis])):
                    rows[3 + k][hinge.joint] += times * x


def _parted(steps: Sequence[Step], middle: int) -> tuple[list[Step], list[Step]]:
    """The ways from the middle of some steps back to their start, and on to their end."""
    return [(j, -sign) for j, sign in reversed(steps[:middle])], list(steps[middle:])


_AT_REST = "a motion of the joints leaves the output at rest"


@kept
def joint_forms(mechanism: Mechanism) -> JointForms:
    """Return closed forms in the joint angles.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.

    Returns
    -------
    JointForms
        With ``str()``: the equations. Without any where the legs are of another kind; the notes
        say which.
    """
    generic = ranks(mechanism)
    notes = [
        "a configuration that closes the loops is singular if and only if one of these is zero"
    ]
    try:
        NotThisKind.refuse_if(
            room_of(mechanism)[0] == SPACE and generic.constraint < mechanism.rows,
            f"of {mechanism.rows} closure equations {generic.constraint} are independent, and "
            "that only where the loops close",
        )
        legs = leg_wrenches(mechanism)
        loci = [*_type2(mechanism, legs), *_type1(mechanism, legs), *_passive(mechanism, legs)]
        off = legs.off
        if any(ball for *_, ball in legs.passive):
            notes[0] += "; three hinges in a plane lock the angles of the file, not the ball"
        sphere = sphere_rods(mechanism)
        if sphere is not None and squares_note(sphere):
            ones = " or ".join(str(x.equation) for x in loci if x.kind == "type 1")
            notes.append(
                f"type 2 needs one of type 1 (proven over the orientation): singular if and only "
                f"if {ones}"
            )
    except NotThisKind as error:
        if generic.output < generic.mobility:
            why = "the output does not show each of the freedoms"
            named = without_length(mechanism)
            why += f": {named}" if named else ""
            return JointForms(mechanism.joints, (), False, (f"none: {why}",))
        made = ClosureForms(mechanism)
        held, whole = made.matrices()
        words = "joints move with the actuators held"
        loci = [
            *_loci(made.ring, mechanism, "type 2", words, held),
            *_loci(made.ring, mechanism, "type 1", _AT_REST, whole),
        ]
        off = made.off
        notes[0] = notes[0].replace("zero", "zero, or of less than full rank") if any(
            len(x.matrix) > len(x.matrix[0]) for x in loci if x.matrix
        ) else notes[0]  # fmt: skip
        notes.append(f"from the closure equations as they are, since {error}")
    else_ = " else" if any(x.kind == "passive" for x in loci) else ""
    kinds = {x.kind for x in loci}
    notes += [f"{k}: nowhere{else_}" for k in ("type 1", "type 2") if k not in kinds]
    if off > 1e-12:
        notes.append(f"coordinates were made exact, by at most {off:.1e}")
    tried = near_home(mechanism) + random_closed(mechanism, 6, np.random.default_rng(6203))
    always = tuple(
        dict.fromkeys(
            x.kind for x in loci if x.ratio(np.array(tried), mechanism.joints).max() <= 1e-10
        )
    ) if len(tried) >= 4 else ()  # fmt: skip
    if always:
        notes.append(
            f"at each of the {len(tried)} closed configurations tried the condition of "
            f"{' and '.join(always)} holds: taken for singular everywhere"
        )
    return JointForms(mechanism.joints, tuple(loci), True, tuple(notes), always)


def _type2(mechanism: Mechanism, legs: LegWrenches) -> list[JointLocus]:
    loose = [h for h in legs.carrier.hinges if h.joint in mechanism.passive]
    unknowns = SIZE[legs.kind] if legs.ended else len(loose)
    NotThisKind.refuse_if(
        len(legs.wrenches) != unknowns,
        f"the legs pass {len(legs.wrenches)} forces where {unknowns} would fix the output: "
        + (
            "more actuators than freedoms, or overconstrained loops"
            if len(legs.wrenches) > unknowns
            else "too few"
        ),
    )
    rows = [_row(mechanism, legs, w, locked=True) for w in legs.wrenches]
    words = {
        SPACE: "the wrenches of the legs belong to one linear complex",
        PLANE: "the lines of the legs' forces meet in one point or are parallel",
        SPHERE: "the moments of the legs lie in a plane",
    }[legs.kind]
    free = "the forces of the legs leave the output free"
    return _loci(legs.ring, mechanism, "type 2", words if legs.ended else free, rows)


def _type1(mechanism: Mechanism, legs: LegWrenches) -> list[JointLocus]:
    """Where a motion leaves the output at rest."""
    generic = ranks(mechanism)
    task = mechanism.task.rows
    NotThisKind.refuse_if(
        generic.output < generic.mobility or len(task) != generic.mobility,
        "the output does not show each of the freedoms once",
    )
    whole = SIZE[legs.kind] == len(task)
    single = [tuple(w.arms) for w in legs.wrenches]
    if whole and legs.ended and sorted(single) == [(j,) for j in sorted(mechanism.actuated)]:
        out = []
        for w in legs.wrenches:
            name = mechanism.joints[next(iter(w.arms))]
            words = f"leg {w.leg}: {name} does not work on the force that the leg passes"
            out += _factored(legs.ring, mechanism, "type 1", words, next(iter(w.arms.values())))
        return out
    # An actuated joint is an unknown of its own, but where the carrier's joints are.
    carried = () if legs.ended else tuple(h.joint for h in legs.carrier.hinges)
    used = {j for w in legs.wrenches for j in w.arms}
    drivers = [j for j in mechanism.actuated if j in used and j not in carried]
    zero = legs.ring.zero
    rows = [
        [*_row(mechanism, legs, w, False), *(zero - w.arms.get(j, zero) for j in drivers)]
        for w in legs.wrenches
    ]
    rows += [[*_output_row(legs, k), *[zero] * len(drivers)] for k in task]
    rows = [_level(row, legs.ring) for row in rows]
    NotThisKind.refuse_if(
        any(len(row) != len(rows) for row in rows), "there are other equations than motions"
    )
    return _loci(legs.ring, mechanism, "type 1", _AT_REST, rows)


def _row(mechanism: Mechanism, legs: LegWrenches, wrench: LegWrench, locked: bool) -> Row:
    """A wrench by the output's twist, or by the carrier's joints where these are the unknowns."""
    if legs.ended:
        return wrench.line
    twists = zip(_twists(legs), legs.carrier.hinges, strict=True)
    out = [
        dot(wrench.line, in_room(legs.kind, [*velocity, *turning]), legs.ring.zero)
        for (turning, velocity), joint in twists
        if not locked or joint.joint in mechanism.passive
    ]
    return _level(out, legs.ring)


def _twists(legs: LegWrenches) -> Iterator[tuple[Row, Row]]:
    """Turning and velocity of the base's origin by each of the carrier's joints."""
    chain, zero = legs.carrier, legs.ring.zero
    for h in chain.hinges:
        axis = chain.in_base(h.axis)
        if h.slides:
            yield [zero] * 3, axis
        else:  # scales: both times that of the joint, squared in the velocity
            yield [h.scale * a for a in axis], cross(chain.placed(h.origin, h.scale), axis)


def _output_row(legs: LegWrenches, k: int) -> Row:
    """A row of the output's velocity by the unknowns: in the axes of the turned base."""
    ring, scale = legs.ring, legs.carrier.scale
    zero = ring.zero
    # Rows of the file are in the base; a plane may have been turned to lie level.
    unit = [ring.one * rational(legs.turn[i][k % 3]) for i in range(3)]
    if legs.ended:
        grown = [scale * u for u in unit]
        # With p the output, u . (v + w x p) = u . v + w . (p x u).
        whole = [*([zero] * 3), *grown] if k >= 3 else [*grown, *cross(legs.output, unit)]
        return in_room(legs.kind, whole)
    out = []
    for turning, velocity in _twists(legs):
        moved = [scale * v + c for v, c in zip(velocity, cross(turning, legs.output), strict=True)]
        out.append(dot(unit, turning if k >= 3 else moved, zero))
    return out


def _level(row: Row, ring: Ring) -> Row:
    """Entries of one degree in each joint's pair of variables: times x^2 + y^2, which are 1."""
    for j, w in enumerate(ring.w):
        if w is not None:
            x, y = ring.variables(j)
            leads = (e.monomial(0) if e != 0 else ring.one.monomial(0) for e in row)
            degrees = [m[x] + m[y] for m in leads]
            row = [e * w ** ((max(degrees) - d) // 2) for e, d in zip(row, degrees, strict=True)]
    return row


def _loci(
    ring: Ring, mechanism: Mechanism, kind: str, words: str, rows: list[Row]
) -> list[JointLocus]:
    """A determinant multiplied out and factored where it is small; as it is where not."""
    joints = sorted({j for row in rows for x in row if x != 0 for j in ring.joints_of(x)})
    names = tuple(mechanism.joints[j] for j in joints)
    whole = JointLocus(kind, words, names, None, _matrix(rows, ring, mechanism))
    rows = [_level(row, ring) for row in rows]
    size = float(np.prod([max(len(x) for x in row) + 1.0 for row in rows]))
    if len(joints) > (1 if len(rows) > len(rows[0]) else 7) or size > 4e8:
        return [whole]
    # Of one joint all largest minors vanish together where what they share does.
    minors = [
        determinant([rows[k] for k in chosen], ring, Budget(math.inf))
        for chosen in itertools.combinations(range(len(rows)), len(rows[0]))
    ]
    value = functools.reduce(lambda a, b: a.gcd(b), minors)
    if value == 0:
        return [whole]
    found = _factored(ring, mechanism, kind, words, value)
    if len(found) == 1 and len(found[0].equation.cos) > 24:  # type: ignore[union-attr]
        # One long factor: the determinant says more.
        return [replace(found[0], matrix=whole.matrix)]
    return found


def _matrix(
    rows: list[Row], ring: Ring, mechanism: Mechanism
) -> tuple[tuple[PoseEquation, ...], ...]:
    """Entries without what is left of numbers that were made rational."""
    out = []
    for row in rows:
        found = [trig_polynomial(x, ring, mechanism.joints) for x in row]
        most = max((float(np.abs(x.values).max(initial=0.0)) for x in found), default=0.0)
        out.append(tuple(x.without(NOISE * most) for x in found))
    return tuple(out)


def _factored(
    ring: Ring, mechanism: Mechanism, kind: str, words: str, value: Poly
) -> list[JointLocus]:
    out = []
    for factor in _together(ring, ring.factors(ring.strip(value))):
        found = _plain(equation(factor, ring, mechanism.joints, np.zeros(mechanism.n)))
        names = tuple(mechanism.joints[j] for j in ring.joints_of(factor))
        out.append(JointLocus(kind, words, names, found))
    return out


def _plain(found: Equation) -> Equation:
    """An equation without what is left of numbers that were made rational."""
    least = NOISE * max(np.abs(found.cos).max(initial=0.0), np.abs(found.sin).max(initial=0.0))
    cos = np.where(np.abs(found.cos) >= least, found.cos, 0.0)
    sin = np.where(np.abs(found.sin) >= least, found.sin, 0.0)
    kept = (cos != 0) | (sin != 0)
    exact = [
        ("0" if c == 0 else e[0], "0" if s == 0 else e[1])
        for e, c, s in zip(found.exact, cos.tolist(), sin.tolist(), strict=False)
    ]
    return replace(
        found, frequencies=found.frequencies[kept], powers=found.powers[kept], cos=cos[kept],
        sin=sin[kept], exact=tuple(itertools.compress(exact, kept.tolist())),
    )  # fmt: skip


def _together(ring: Ring, factors: Sequence[Poly]) -> list[Poly]:
    """Factors with real zeros; q = 0 and q = pi, half-angles of one joint, as sin q = 0."""
    out: list[Poly] = []
    halves: dict[int, Poly] = {}
    for factor in factors:
        joints = ring.joints_of(factor)
        if len(joints) != 1 or ring.prismatic[joints[0]]:
            out.append(factor)
            continue
        (j,) = joints
        if int(factor.total_degree()) % 2 == 0:
            out += [factor] if real_roots(factor, j, ring) else []
        elif j in halves:
            out.append(halves.pop(j) * factor)
        else:
            halves[j] = factor
    return [*out, *halves.values()]


def _passive(mechanism: Mechanism, legs: LegWrenches) -> list[JointLocus]:
    out: list[JointLocus] = []
    for (leg, joints, ball), whole in legs.passive.items():
        value = math.prod(legs.ring.factors(whole), start=legs.ring.one)
        names = ", ".join(mechanism.joints[j] for j in joints)
        what = f"the end of the leg is on the axis of {names}"
        what = what if len(joints) == 1 else f"{names} move its end the same way"
        flat = f"the three hinges {names} that stand for a ball lie in a plane"
        words = flat if ball else f"leg {leg}: {what}"
        found = _factored(legs.ring, mechanism, "passive", words, value)
        out += [replace(x, ball=ball) for x in found]
    return out
