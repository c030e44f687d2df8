"""What each leg passes on, in its own joint angles: wrenches that its passive joints do not feel.

A leg ends at the output in a ball (a pin in the plane, a hinge through the centre of a spherical
mechanism). It passes forces through that point which do no work on its passive joints: with one
such joint those along its axis and along the arm to it, with two the one across both velocities.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.algebra.ring import Poly, Ring, make_ring, rational
from pinsing.errors import OptionError
from pinsing.loops.exact import (
    Hinge,
    LegChain,
    Row,
    Turn,
    cross,
    dot,
    leg_chain,
    rational_turn,
    turn_to,
)
from pinsing.loops.structure import (
    SMALL,
    NotThisKind,
    Sample,
    at_zero,
    closing,
    once,
    path_to,
    plane_normal,
    structure,
)
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from pinsing.families import ClosedForm

SPACE, PLANE, SPHERE = "space", "plane", "sphere"
SIZE = {SPACE: 6, PLANE: 3, SPHERE: 3}
"""Dimension of the motions that each kind of mechanism has room for."""


def in_room(kind: str, whole: list[Any]) -> list[Any]:
    """Of six coordinates, those of the point before those of the turn, what a kind has."""
    return {SPACE: whole, PLANE: [whole[0], whole[1], whole[5]], SPHERE: whole[3:]}[kind]


@dataclass(frozen=True, eq=False)
class LegWrench:
    """One wrench that a leg passes on with its actuator locked.

    Attributes
    ----------
    leg : int
        Number of the way from the base to the output, from 1.
    line : list of Poly
        Force and moment about the origin of the base (6,); in the plane fx, fy, mz; on the sphere
        the moment about the centre. Homogeneous: all entries of one degree in each joint.
    arms : dict of int to Poly
        What each actuated joint of the leg feels of it; a joint that feels nothing is left out.
    """

    leg: int
    line: Row
    arms: dict[int, Poly]


@dataclass(frozen=True, eq=False)
class Passive:
    """Where the passive joints of a leg are dependent themselves.

    Attributes
    ----------
    leg : int
        Number of the leg.
    joints : tuple of int
        The joints.
    value : Poly
        Zero there.
    ball : bool
        Whether they are the three hinges that a file writes for a ball.
    """

    leg: int
    joints: tuple[int, ...]
    value: Poly
    ball: bool


@dataclass(frozen=True, eq=False)
class LegWrenches:
    """All legs of a mechanism.

    Attributes
    ----------
    kind : str
        ``space``, ``plane`` or ``sphere``.
    ring : Ring
        Of all joints.
    turn : Turn
        Rotation before anything: the normal of the plane becomes z.
    carrier : LegChain
        The way along the tree, up to the output.
    output : list of Poly
        Origin of the output frame in the base, times the carrier's scale.
    ended : bool
        Whether the carrier ends in a ball (pin, hinge) at the output; else its own joints are the
        unknowns.
    wrenches : tuple of LegWrench
        Of all ways; of the others alone where the carrier has no such end.
    passive : tuple of Passive
        What else is singular.
    off : float
        By how much numbers of the file were changed to be exact.
    """

    kind: str
    ring: Ring
    turn: Turn
    carrier: LegChain
    output: Row
    ended: bool
    wrenches: tuple[LegWrench, ...]
    passive: tuple[Passive, ...]
    off: float


@once
def leg_wrenches(mechanism: Mechanism) -> LegWrenches:
    """The wrenches of all legs.

    Raises
    ------
    NotThisKind
        If a leg does not end in a ball, pin or hinge at the output, or shares passive joints.
    """
    zero = at_zero(mechanism)
    kind, turn, centre = room_of(mechanism)
    ring = make_ring(mechanism.prismatic.tolist())
    ways = leg_ways(mechanism)
    used = [j for joints, _, _ in ways for j in joints if j in mechanism.passive]
    if len(used) > len(set(used)):
        raise NotThisKind("legs share passive joints")
    wrenches: list[LegWrench] = []
    passive: list[Passive] = []
    off = 0.0
    path = path_to(mechanism, structure(mechanism).output)
    carrier = leg_chain(ring, path, zero.axis[path], zero.origins[path], turn)
    at = np.array(zero.frames[mechanism.output_id].translation)
    output = carrier.placed(carrier.point(at), carrier.scale)
    ended = False
    for number, (joints, end, ball) in enumerate(ways, 1):
        if end is None and kind != SPHERE:
            continue
        ended = ended or number == 1
        chain = leg_chain(ring, joints, zero.axis[joints], zero.origins[joints], turn)
        off = max(off, chain.off)
        found, own = _leg(mechanism, chain, number, kind, end, centre)
        wrenches += found
        passive += own
        if ball:
            # Where the three hinges that are written for a ball lie in a plane.
            axes = [h.axis for h in carrier.hinges if h.joint in ball]
            flat = dot(axes[0], cross(axes[1], axes[2]), ring.zero)
            passive.append(Passive(number, ball, flat, True))
    return LegWrenches(
        kind, ring, turn, carrier, output, ended, tuple(wrenches),
        tuple(p for p in passive if not ring.nowhere_zero(p.value)), max(off, carrier.off),
    )  # fmt: skip


@once
def room_of(mechanism: Mechanism) -> tuple[str, Turn, Array]:
    """``space``, ``plane`` or ``sphere``: what the motions of all its joints have room in.

    And the turn that makes the plane's normal z, and the sphere's centre.
    """
    drawn = Sample(mechanism, mechanism.space.sample(1, np.random.default_rng(929))[0])
    still, none = rational_turn(np.eye(3)), np.zeros(3)
    normal = plane_normal(mechanism, drawn.axis)
    if normal is not None:
        return PLANE, rational_turn(turn_to(normal).T), none
    if not mechanism.prismatic.any():
        across = [np.eye(3) - np.outer(a, a) for a in drawn.axis]
        rows = np.concatenate(across)
        right = np.concatenate([P @ p for P, p in zip(across, drawn.origins, strict=True)])
        centre, _, rank, _ = np.linalg.lstsq(rows, right, rcond=None)
        if rank == 3 and np.abs(rows @ centre - right).max() <= SMALL:
            return SPHERE, still, centre
    return SPACE, still, none


Way = tuple[list[int], Array | None, tuple[int, ...]]
"""Joints before the end of a leg, the end (3,) with all joints at zero, hinges of a ball there."""


def leg_ways(mechanism: Mechanism) -> list[Way]:
    """Each way from the base to the output.

    The first is that of the tree; its end is None where it has none of its own, and on the sphere.

    Raises
    ------
    NotThisKind
        If a loop closes elsewhere, or in another way.
    """
    built, zero, kind = structure(mechanism), at_zero(mechanism), room_of(mechanism)[0]
    if built.output == 0:
        raise NotThisKind("the output is the base")
    path = path_to(mechanism, built.output)
    out: list[Way] = [(path, None, ())]
    last = next((c for c in built.centres if built.output - 1 in c.joints), None)
    size = 3 if kind == SPACE else 1
    centred = last is not None and path[-size:] == list(last.joints)
    if kind != SPHERE and last is not None and centred and len(path) > size == len(last.joints):
        end = np.array(zero.joints[path[-size] + 1].act(last.point))
        out = [(path[:-size], end, last.joints if kind == SPACE else ())]
    for loop, inner, outer in zip(mechanism.loops, *closing(mechanism), strict=True):
        if _body(mechanism, inner) == built.output:
            inner, outer = outer, inner
        if _body(mechanism, outer) != built.output:
            raise NotThisKind("a loop closes away from the output")
        if loop.kind not in ("3d", "planar" if kind == PLANE else "3d"):
            raise NotThisKind(f"a loop of type {loop.kind} leaves no ball, pin or hinge")
        joints = path_to(mechanism, _body(mechanism, inner))
        if not joints or built.output - 1 in joints:
            raise NotThisKind("a loop ties the output to the base or to itself")
        out.append((joints, np.array(zero.frames[inner].translation), ()))
    return out


def _body(mechanism: Mechanism, frame: int) -> int:
    return int(mechanism.model.frames[frame].parentJoint)


def _leg(
    mechanism: Mechanism, chain: LegChain, number: int, kind: str, end: Array | None, centre: Array
) -> tuple[list[LegWrench], list[Passive]]:
    """The wrenches of one way, and where its passive joints are dependent."""
    zero, one = chain.ring.zero, chain.ring.one
    point = chain.position if end is None else chain.point(end)
    passive = [h for h in chain.hinges if h.joint in mechanism.passive]
    driven = [h for h in chain.hinges if h.joint in mechanism.actuated]

    def moved(hinge: Hinge) -> Row:
        """What a joint does to the end, or to the turn, up to a positive factor."""
        return hinge.axis if kind == SPHERE else chain.velocity(hinge, point, chain.scale)

    arms = [moved(h) for h in passive]
    if kind == SPHERE and end is not None:
        # A loop that closes in a point of the sphere leaves a turn about the radius there.
        middle = chain.fixed(centre)
        arms.append([b - chain.scale * m for b, m in zip(point, middle, strict=True)])
    if kind == PLANE:
        # Normal of the plane in the frame of the chain.
        normal = [one * rational(v) for v in chain.base[2]]
        choices = _planar(arms, normal, one, zero)
    else:
        choices = _spatial(chain, passive, arms, point, kind)
    found: list[LegWrench] = []
    own: list[Passive] = []
    for force in choices:
        plain, content = _primitive(force)
        own.append(Passive(number, tuple(h.joint for h in passive), content, False))
        felt = {
            h.joint: arm
            for h in driven
            if (arm := dot(plain, moved(h), zero)) != 0
        }  # fmt: skip
        found.append(LegWrench(number, _line(chain, plain, point, kind), felt))
    return found, own


def _planar(arms: list[Row], normal: Row, one: Poly, zero: Poly) -> list[Row]:
    if not arms:
        # Any two forces in the plane.
        axes = [[one if i == k else zero for i in range(3)] for k in range(3)]
        crossed = [cross(normal, a) for a in axes]
        return [c for c in crossed if any(x != 0 for x in c)][:2]
    if len(arms) == 1:
        return [cross(normal, arms[0])]
    raise NotThisKind("a leg has more passive joints than its end leaves it")


def _spatial(
    chain: LegChain, passive: list[Hinge], arms: list[Row], point: Row, kind: str
) -> list[Row]:
    one, zero = chain.ring.one, chain.ring.zero
    if len(arms) == 2:
        return [cross(arms[0], arms[1])]
    if kind == SPHERE or len(arms) > 2:
        raise NotThisKind("a leg has other passive joints than its end leaves it")
    if not arms:
        return [[one if i == k else zero for i in range(3)] for k in range(3)]
    hinge = passive[0]
    if hinge.slides:
        raise NotThisKind("a passive slide is the only passive joint of a leg")
    grown = chain.scale / hinge.scale
    reach = [b - grown * o for b, o in zip(point, hinge.origin, strict=True)]
    return [hinge.axis, reach]


def _primitive(force: Row) -> tuple[Row, Poly]:
    """A vector over what its entries share, and that."""
    parts = [x for x in force if x != 0]
    if not parts:
        raise NotThisKind("the passive joints of a leg are always dependent")
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
    """One leg as an arm.

    Attributes
    ----------
    leg : int
        Its number, from 1: that of the tree first.
    joints : tuple of str
        From the base outwards.
    task : str
        Rows of the velocity of its end.
    form : ClosedForm
        Its families; with a certificate where one was found.
    """

    leg: int
    joints: tuple[str, ...]
    task: str
    form: ClosedForm

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
    """Closed forms of the legs as arms, with certificates.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    seconds : float
        Time for the search of each leg's certificate.

    Returns
    -------
    tuple of LegProof
        One for each leg with one actuator.

    Raises
    ------
    OptionError
        If no leg ends in a ball, a pin or a hinge at the output.
    """
    try:
        ends = leg_ways(mechanism)
    except NotThisKind as why:
        raise OptionError(f"{mechanism.name}: no leg has a certificate of its own: {why}") from None
    out = tuple(_proofs(mechanism, ends, seconds))
    if not out:
        raise OptionError(
            f"{mechanism.name}: no leg has a certificate of its own: none has one actuator and "
            "ends in a ball, a pin or a hinge at the output"
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
        if normal.max() >= 1 - SMALL:
            task = ",".join(r for k, r in enumerate(_ROWS) if k != int(np.argmax(normal)))
    for number, (path, place, _) in enumerate(ends, 1):
        joints, end = path, place
        if kind == SPHERE and end is None:
            joints, end = path[:-1], centre + zero.axis[path[-1]]
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
