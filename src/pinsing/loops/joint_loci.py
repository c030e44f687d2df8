"""Singular loci over the inputs and in the joint angles, exactly.

Over the inputs, of planar loops that a dyad closes: two links meet in a pin P, each on the end of
an actuated crank, or on a fixed pivot. With the links d1 and d2 long and v = B2 - B1 between their
ends, type 2 is where B1, P, B2 are in line,

    v.v = (d1 + d2)^2   or   v.v = (d1 - d2)^2,

and leg 1 is at type 1 where A1, B1, P are: with e the direction of its crank

    (v - d1 e).(v - d1 e) = d2^2   or   (v + d1 e).(v + d1 e) = d2^2,

so leg 2. In half-angle coordinates of the inputs these are polynomials over the rationals.

In the joint angles, from the closure equations themselves, of loops of any kind and cut.
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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation, equation
from pinsing.algebra.jacobian_matrix import determinant
from pinsing.algebra.real_roots import real_roots
from pinsing.algebra.ring import Poly, Ring, make_ring, rational
from pinsing.errors import OptionError
from pinsing.interface import JsonResult
from pinsing.loops.closure import (
    PLANE,
    SIZE,
    SPACE,
    SPHERE,
    Dyad,
    NotThisKind,
    at_zero,
    in_room,
    loop_ends,
    near_home,
    planar_dyad,
    random_closed,
    ranks,
    room_of,
    structure,
    without_length,
)
from pinsing.loops.forms import (
    Hinge,
    JointForms,
    JointLocus,
    LegChain,
    PoseEquation,
    Row,
    Turn,
    cross,
    dot,
    rational_turn,
    trig_polynomial,
    turn_to,
)
from pinsing.loops.legs import sphere_rods
from pinsing.loops.pose_loci import squares_note
from pinsing.loops.solve import SingularPoint, refine_point
from pinsing.measures import NOISE, ROUNDING, Array, ArrayLike
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import Mechanism, closing, path_to
from pinsing.robot.models import way_between

if TYPE_CHECKING:
    from pinsing.families import ClosedForm


def roots(equation: Equation, inputs: ArrayLike, free: int) -> Array:
    """Return all real values, in (-pi, pi], of one input that solve an equation."""
    # Along it the equation is rest + a cos u + b sin u, u being the angle or half of it, without
    # the rest then: values at quarters of a turn tell them.
    half = np.abs(equation.frequencies[:, free]).max() == 1
    q = np.tile(np.asarray(inputs, dtype=float), (4, 1))
    q[:, free] = np.arange(4) * np.pi / 2 - equation.shift[free]
    f = equation(q)
    rest, a, b = (f[0] + f[2]) / 2, (f[0] - f[2]) / 2, (f[1] - f[3]) / 2
    if half:
        rest, a, b = 0.0, f[0], f[2]
    most = float(np.hypot(a, b))
    if most <= NOISE * equation.size or abs(rest) > most + 1e-12 * equation.size:
        return np.zeros(0)
    # Of half an angle both are one value; and where it is met at one value alone.
    single = half or abs(rest) >= most - 1e-14 * equation.size
    spread = np.arccos(np.clip(-rest / most, -1, 1)) * np.array([1.0] if single else [1.0, -1.0])
    value = (1 + half) * (np.arctan2(b, a) + spread) - equation.shift[free]
    return np.sort(np.pi - np.mod(np.pi - value, 2 * np.pi))


@dataclass(frozen=True, eq=False)
class Locus:
    """One irreducible singular locus, as an equation in the inputs.

    Attributes
    ----------
    kind : str
        ``type 1`` or ``type 2``.
    words : str
        What is in line with what.
    equation : Equation
        Zero on the locus; joints are the inputs. Its value is in square metres: the squared
        distance that must equal a squared reach, minus that.
    points_only : bool
        Whether its real points are isolated, of codimension 2: the ends of two cranks that
        coincide, or a reach that is met at one point alone, with everything in line.
    witness : SingularPoint or None
        A verified configuration on it; None where no feasible one was found.
    """

    kind: str
    words: str
    equation: Equation
    points_only: bool
    witness: SingularPoint | None

    def __str__(self) -> str:
        found = "" if self.witness else " [no feasible configuration found]"
        points = " [isolated points]" if self.points_only else ""
        return f"{self.kind}, {self.words}: {self.equation}{points}{found}"


@dataclass(frozen=True, eq=False)
class LoopForms(JsonResult):
    """All singular loci of a mechanism over its inputs.

    Attributes
    ----------
    loci : tuple of Locus
        Irreducible over the rationals.
    complete : bool
        Whether every closed singular configuration has its inputs on one of them.
    notes : tuple of str
        What was assumed or left out.
    joint_forms : JointForms or None
        Those in the joint angles, which ``families --loops`` writes into its JSON; elsewhere they
        are asked for by themselves, with `joint_forms`.
    """

    schema: ClassVar[str] = "pinsing/loop-forms/1"

    loci: tuple[Locus, ...]
    complete: bool
    notes: tuple[str, ...]
    joint_forms: JointForms | None = field(default=None, metadata={"optional": True})

    def __str__(self) -> str:
        return "\n".join([*(str(x) for x in self.loci), *self.notes])


def loop_forms(mechanism: Mechanism) -> LoopForms | None:
    """Return closed forms of the singular loci; None where no planar dyad closes the mechanism."""
    dyad = planar_dyad(mechanism)
    if dyad is None:
        return None
    system = _LoopEquations(dyad)
    notes = list(system.notes)
    # Legs whose stretching loses an output direction: of the pin all, of the link that the dyad
    # drives, the other one's.
    legs = np.flatnonzero(dyad.cranks >= 0).tolist()
    known = dyad.at_pin() if len(legs) == 2 else (
        structure(mechanism).output - 1 == dyad.pins[1 - legs[0]]
    )  # fmt: skip
    if not known:
        notes.append(
            f"type 1 loci are left out: the output {mechanism.output} ({mechanism.task}) is "
            "neither the pin's position nor the link that the dyad drives"
        )
    loci: list[Locus] = []
    always = False
    for leg in (None, *(legs if known else ())):
        for sense, word in ((1, "stretched"), (-1, "folded")):
            inputs = system.ring.strip(system.in_line(leg, sense))
            if inputs != 0:
                loci += system.loci(leg, inputs, sense)
                continue
            always = True
            kind, where = ("type 2", "") if leg is None else (
                "type 1", f", of which no equation over the inputs tells: leg {leg + 1} is {word} "
                "there with its end at rest; the equations in the joint angles have it",
            )  # fmt: skip
            notes.append(f"{kind}: at all inputs in one assembly mode{where}")
    return LoopForms(tuple(loci), known and not always, tuple(notes))


class _LoopEquations:
    """The loop equations of a dyad over the rationals."""

    def __init__(self, dyad: Dyad) -> None:
        self.dyad = dyad
        self.notes: list[str] = []
        actuated, cranks = dyad.mechanism.actuated, dyad.cranks.tolist()
        OptionError.refuse_if(
            sorted(j for j in cranks if j >= 0) != sorted(actuated),
            "every input must turn a crank of the loop",
        )
        self.ring: Ring = make_ring([False] * len(actuated))
        gens, one, zero = self.ring.context.gens(), self.ring.one, self.ring.zero
        # Directions of the cranks times w; a fixed pivot is one of length zero that stays.
        half = [
            [gens[k] for k in self.ring.variables(actuated.index(j))] if j >= 0 else [one, zero]
            for j in cranks
        ]
        self.w = [x**2 + y**2 for x, y in half]
        self.direction = [
            (x**2 - y**2, 2 * int(sense) * x * y)
            for (x, y), sense in zip(half, dyad.senses, strict=True)
        ]
        self.cranks, pivots, self.rods = (
            [self._exact(float(x), what) for x in values]
            for what, values in (
                ("crank", abs(dyad.arms)),
                ("pivot", np.column_stack([dyad.pivots.real, dyad.pivots.imag]).ravel()),
                ("rod", dyad.rods),
            )
        )
        self.pivots = pivots[:2], pivots[2:]
        # Of each input the side whose crank it turns; angle = sense q + that at zero = sense (q +
        # offset).
        self.sides = [cranks.index(j) for j in actuated]
        self.offset = (dyad.senses * np.angle(dyad.arms))[self.sides]
        self.tried = np.random.default_rng(6151).uniform(-np.pi, np.pi, (60, len(actuated)))

    def _exact(self, value: float, what: str) -> Any:
        near = Fraction(value).limit_denominator(10**9)
        if abs(float(near) - value) > NOISE * max(1.0, abs(value)):
            self.notes.append(
                f"a {what} of {value!r} m was taken as {near} (off by {float(near) - value:.1e})"
            )
        return rational(near)

    def square(self, leg: int | None = None, sense: int = 0) -> Poly:
        """Squared distance of the cranks' ends, times W^2; the rod of a leg lengthens its crank."""
        one, two = (
            crank + (sense * rod if leg == k else 0)
            for k, (crank, rod) in enumerate(zip(self.cranks, self.rods, strict=True))
        )
        w, u = self.w
        rows = zip(*self.pivots, *self.direction, strict=True)
        away = [(b - a) * w * u + two * w * e - one * u * d for a, b, d, e in rows]
        return away[0] ** 2 + away[1] ** 2

    def in_line(self, leg: int | None, sense: int) -> Poly:
        """Return the equation of a leg, or both rods, stretched (``sense`` 1) or folded (-1)."""
        # It is a squared distance minus a squared reach, over W^2 in square metres.
        reach = self.rods[0] + sense * self.rods[1] if leg is None else self.rods[1 - leg]
        return self.square(leg, sense) - (reach * self.w[0] * self.w[1]) ** 2

    def loci(self, leg: int | None, inputs: Poly, sense: int) -> list[Locus]:
        """The factors that have real points; ``leg``, ``sense`` as in `in_line`."""
        dyad, square, kind = self.dyad, self.square(), "type 2" if leg is None else "type 1"
        gap = dyad.pivots[1] - dyad.pivots[0]
        # Lengths that turn about the pivots: the cranks, that of a leg with its rod along it.
        arms = abs(dyad.arms) + sense * dyad.rods * [leg == 0, leg == 1]
        extremes = self._extremes(gap, *arms.tolist())
        ends = [f"{'A' if j < 0 else 'B'}{k}" for k, j in enumerate(dyad.cranks, 1)]
        line = f"{', P, '.join(ends)}" if leg is None else f"A{leg + 1}, B{leg + 1}, P"
        out = []
        for factor in self.ring.factors(inputs):
            form = equation(factor, self.ring, dyad.mechanism.inputs, self.offset)
            coincide = kind == "type 2" and divmod(square, factor)[1] == 0
            # Values, zero where that is rounding.
            values = form(np.concatenate([extremes, self.tried]))
            values[np.abs(values) <= NOISE * form.size] = 0.0
            touching = extremes[values[: len(extremes)] == 0]
            if len(form.joints) == 1 and len(roots(form, [0.0], 0)):
                values = np.append(values, 0.0)
            # Where the ends coincide, rods of different lengths do not close.
            none = values.min() > 0 or values.max() < 0
            if none or (coincide and self.rods[0] != self.rods[1]):
                continue
            # It touches zero only where all is in line or two ends meet: at single points if both
            # inputs and the distance of their pivots count, else all along one of the inputs.
            single = 0 in (values.min(), values.max())
            points_only = gap != 0 and (coincide or (single and len(form.involved) == 2))
            candidates = touching if points_only else self._on(form, extremes)
            witness = _witness(dyad, leg, candidates, points_only, sense)
            words = f"{line} in line, {'stretched' if sense > 0 else 'folded'}"
            words = "B1 and B2 coincide and P turns about them" if coincide else words
            # In square metres, up to sign: squared distance minus squared reach. Type 2: |B1 B2|^2
            # - (d1 +- d2)^2. Type 1 of leg 1: |A1 + (l1 +- d1) e1 - B2|^2 - d2^2. The cosine rule
            # gives the coefficient of the highest frequency, and with it the scale.
            reach = arms if len(form.joints) > 1 else np.where(arms == 0, abs(gap), arms)
            top = int(np.argmax(np.abs(form.frequencies).sum(axis=1)))
            target = 2 * abs(float(np.prod(reach)))
            if target > 1e-12:
                form = form.scaled(target / float(np.hypot(form.cos, form.sin)[top]))
            out.append(Locus(kind, words, form, bool(points_only), witness))
        return out

    def _extremes(self, gap: complex, one: float, two: float) -> Array:
        """Inputs (k, n_a) at which the distance of two arms' ends is extreme: they tell of a locus.

        It is stationary where both arms, which turn about pivots a ``gap`` apart, lie on the line
        of the pivots, and least where the ends meet.
        """
        far, along, dyad = abs(gap), float(np.angle(gap)), self.dyad
        found = [(along + a, along + b) for a in (0.0, np.pi) for b in (0.0, np.pi)]
        # One is less than nothing where a rod is folded over a shorter crank.
        if far > 0 and one != 0 and abs(abs(one) - abs(two)) <= far <= abs(one) + abs(two):
            bend = float(np.arccos(np.clip((far**2 + one**2 - two**2) / (2 * far * one), -1, 1)))
            for turn in (bend, -bend):
                away = one * np.exp(1j * turn) - far
                found.append((along + turn, along + float(np.angle(away if two > 0 else -away))))
        out = (dyad.senses * (np.array(found) - np.angle(dyad.arms)))[:, self.sides]
        return np.asarray(np.pi - np.mod(np.pi - out, 2 * np.pi))

    def _on(self, form: Equation, extremes: Array) -> Iterator[Array]:
        """Yield inputs on a locus, as they are asked for: most often the first will do."""
        # Lines along the inputs, random ones first; small loops lie about an extreme.
        n = len(form.joints)
        for base in np.concatenate([self.tried, extremes]) if n > 1 else self.tried[:1]:
            for free in range(n):
                for value in roots(form, base, free):
                    yield np.where(np.arange(n) == free, value, base)


def _witness(
    dyad: Dyad, leg: int | None, candidates: Iterable[Array], points_only: bool, sense: int
) -> SingularPoint | None:
    """A verified configuration at one of some inputs, in line as asked for."""
    mechanism = dyad.mechanism
    held = [] if points_only else list(mechanism.actuated[:-1])
    # Inputs are off by rounding.
    ways = (dyad.close(x) or dyad.close(x, ROUNDING) for x in candidates)
    for q in itertools.chain.from_iterable(ways):
        bend = dyad.bend(q, leg)
        if (leg is None or abs(bend.imag) <= 1e-6) and sense * bend.real >= 0:
            point = refine_point(mechanism, q, "type 2" if leg is None else "type 1", held)
            if point.converged and np.abs(mechanism.space.wrap(point.q - q)).max() < 1e-3:
                return point
    return None


_AT_REST = "a motion of the joints leaves the output at rest"
_AS_IT_IS = rational_turn(np.eye(3))

Step = tuple[int, int]
"""A joint, and 1 where it is passed outwards, -1 where towards the base."""


def outwards(mechanism: Mechanism, body: int) -> list[Step]:
    """The way from the base to a body (a joint of the model)."""
    return [(j, 1) for j in path_to(mechanism, body)]


class _ExactTree:
    """The joints of a mechanism over the ``ring`` of all of them.

    ``turn`` is a rotation before anything: the normal of a plane becomes z. ``off``: by how much
    numbers of the file were changed to be exact.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.zero = mechanism, at_zero(mechanism)
        self.kind, normal, self.centre = room_of(mechanism)
        self.turn = rational_turn(turn_to(normal).T)
        self.ring = make_ring(mechanism.prismatic.tolist())
        self.off = 0.0

    def chain(self, joints: Sequence[int], turn: Turn, senses: Array | None = None) -> LegChain:
        """Joints one after the other, each counted in a sense (1 or -1)."""
        axes = self.zero.axis[joints]
        axes = axes if senses is None else axes * senses[:, None]
        found = LegChain(self.ring, joints, axes, self.zero.origins[joints], turn)
        self.off = max(self.off, found.off)
        return found

    def columns(
        self, steps: Sequence[Step], at: Array, turn: Turn, rests: bool = False
    ) -> Iterator[tuple[int, Row]]:
        """Yield joints, and what each does to a point and to the turn of its body: six numbers."""
        # The point (3,), with all joints at zero, is one of the last body, or of the first where it
        # ``rests``. A joint that is passed from its own body to the one before moves that the other
        # way.
        chain = self.chain([j for j, _ in steps], turn, np.array([float(s) for _, s in steps]))
        point, scale, none = chain.point(at), chain.scale, [self.ring.zero] * 3
        for hinge in chain.hinges:
            if rests:
                scale = hinge.scale
                point = [scale * x for x in chain.point(at, rests=True)]
            turned = none if hinge.slides else [scale * x for x in hinge.axis]
            yield hinge.joint, [*chain.velocity(hinge, point, scale), *turned]

    def loci(self, kind: str, words: str, rows: list[Row]) -> list[JointLocus]:
        """A determinant multiplied out and factored where it is small; as it is where not."""
        ring = self.ring
        joints = sorted({j for row in rows for x in row if x != 0 for j in ring.joints_of(x)})
        names = tuple(self.mechanism.joints[j] for j in joints)
        whole = JointLocus(kind, words, names, None, self.matrix(rows))
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
        found = self.factored(kind, words, value)
        if len(found) == 1 and len(found[0].equation.cos) > 24:  # type: ignore[union-attr]
            # One long factor: the determinant says more.
            return [replace(found[0], matrix=whole.matrix)]
        return found

    def matrix(self, rows: list[Row]) -> tuple[tuple[PoseEquation, ...], ...]:
        """Entries without what is left of numbers that were made rational."""
        out = []
        for row in rows:
            found = [trig_polynomial(x, self.ring, self.mechanism.joints) for x in row]
            most = max((float(np.abs(x.values).max(initial=0.0)) for x in found), default=0.0)
            out.append(tuple(x.without(NOISE * most) for x in found))
        return tuple(out)

    def factored(self, kind: str, words: str, value: Poly, ball: bool = False) -> list[JointLocus]:
        """The irreducible factors of a polynomial that have real zeros."""
        ring, joints, out = self.ring, self.mechanism.joints, []
        for factor in _together(ring, ring.factors(ring.strip(value))):
            found = _plain(equation(factor, ring, joints, np.zeros(len(joints))))
            names = tuple(joints[j] for j in ring.joints_of(factor))
            out.append(JointLocus(kind, words, names, found, ball=ball))
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


def _primitive(force: Row) -> tuple[Row, Poly]:
    """A vector over what its entries share, and that."""
    parts = [x for x in force if x != 0]
    NotThisKind.refuse_if(not parts, "the passive joints of a leg are always dependent")
    content = functools.reduce(lambda a, b: a.gcd(b), parts)
    return [x / content for x in force], content


class LegWrenches(_ExactTree):
    """What legs pass on with their actuators locked, and the loci: `type2`, `type1` and `alone`.

    ``wrenches``: of each the number of its leg, from 1; force and moment about the origin of the
    base (6,), in the plane fx, fy, mz, on the sphere the moment about the centre (3,), all entries
    of one degree in each joint; and by joint what the leg's actuated joints feel, where they feel
    something. The ``carrier`` is the ``way`` along the tree up to the output, whose origin is
    ``at`` with all joints at zero. Where that way has not ``ended`` in a ball (pin, hinge) its own
    joints are the unknowns, and the wrenches are those of the others.
    ``passive``: what is zero where passive joints depend on each other, by the number of their leg,
    these joints, and whether they are the three hinges that a file writes for a ball.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        super().__init__(mechanism)
        ways = leg_ways(mechanism)
        used = [j for joints, _, _ in ways for j in joints if j in mechanism.passive]
        NotThisKind.refuse_if(len(used) > len(set(used)), "legs share passive joints")
        self.wrenches: list[tuple[int, Row, dict[int, Poly]]] = []
        self.passive: dict[tuple[int, tuple[int, ...], bool], Poly] = {}
        self.way = outwards(mechanism, structure(mechanism).output)
        self.carrier = self.chain([j for j, _ in self.way], self.turn)
        self.at = np.array(self.zero.frames[mechanism.output_id].translation)
        self.ended = ways[0][1] is not None or self.kind == SPHERE
        # Of each joint of the carrier the velocity of the base's origin, and the turn.
        self.twists = (
            [] if self.ended else [*self.columns(self.way, np.zeros(3), self.turn, rests=True)]
        )
        for number, (joints, end, ball) in enumerate(ways, 1):
            if number == 1 and not self.ended:
                continue
            chain = self.chain(joints, self.turn)
            loose = number, tuple(j for j in joints if j in mechanism.passive), False
            for content in self._leg(chain, number, end):
                self._depend(loose, content)
            if ball:
                # Where the three hinges that are written for a ball lie in a plane.
                axes = [h.axis for h in self.carrier.hinges if h.joint in ball]
                flat = dot(axes[0], cross(axes[1], axes[2]), self.ring.zero)
                self._depend((number, ball, True), flat)

    def _depend(self, who: tuple[int, tuple[int, ...], bool], content: Poly) -> None:
        if not self.ring.nowhere_zero(content):
            self.passive[who] = self.passive.get(who, self.ring.one) * content

    def _leg(self, chain: LegChain, number: int, end: Array | None) -> Iterator[Poly]:
        """Add the wrenches of one way; yield what is zero where its passive joints depend."""
        zero, mechanism, sphere = self.ring.zero, self.mechanism, self.kind == SPHERE
        point = chain.position if end is None else chain.point(end)
        passive = [h for h in chain.hinges if h.joint in mechanism.passive]
        # What a joint does to the end, or to the turn, up to a positive factor.
        moved = {
            h.joint: h.axis if sphere else chain.velocity(h, point, chain.scale)
            for h in chain.hinges
        }
        arms = [moved[h.joint] for h in passive]
        if sphere and end is not None:
            # A loop that closes in a point of the sphere leaves a turn about the radius there.
            centre = chain.point(self.centre, rests=True)
            arms.append([b - chain.scale * m for b, m in zip(point, centre, strict=True)])
        for force in self._forces(chain, passive, arms, point):
            plain, content = _primitive(force)
            felt = {
                h.joint: dot(plain, moved[h.joint], zero)
                for h in chain.hinges
                if h.joint in mechanism.actuated
            }
            line = plain
            if not sphere:
                # About the origin of the base; every entry of one degree.
                whole = [*(chain.scale * x for x in plain), *cross(point, plain)]
                line = in_room(self.kind, _primitive(whole)[0])
            self.wrenches.append((number, line, {j: x for j, x in felt.items() if x != 0}))
            yield content

    def _forces(
        self, chain: LegChain, passive: list[Hinge], arms: list[Row], point: Row
    ) -> list[Row]:
        """Forces through the end of a leg that do no work on its passive joints, which move it."""
        one, zero = self.ring.one, self.ring.zero
        every = [[one if i == k else zero for i in range(3)] for k in range(3)]
        if self.kind == PLANE:
            NotThisKind.refuse_if(
                len(arms) > 1, "a leg has more passive joints than its end leaves it"
            )
            return [cross(every[2], a) for a in arms or every[:2]]
        if len(arms) == 2:
            return [cross(arms[0], arms[1])]
        NotThisKind.refuse_if(
            self.kind == SPHERE or len(arms) > 2,
            "a leg has other passive joints than its end leaves it",
        )
        if not arms:
            return every
        hinge = passive[0]
        NotThisKind.refuse_if(hinge.slides, "a passive slide is the only passive joint of a leg")
        grown = chain.scale / hinge.scale
        return [hinge.axis, [b - grown * o for b, o in zip(point, hinge.origin, strict=True)]]

    def type2(self) -> list[JointLocus]:
        """Where the output moves with the actuators locked."""
        loose = [h for h in self.carrier.hinges if h.joint in self.mechanism.passive]
        unknowns, count = SIZE[self.kind] if self.ended else len(loose), len(self.wrenches)
        why = "more actuators than freedoms, or overconstrained loops"
        NotThisKind.refuse_if(
            count != unknowns,
            f"the legs pass {count} forces where {unknowns} would fix the output: "
            + (why if count > unknowns else "too few"),
        )
        words = {
            SPACE: "the wrenches of the legs belong to one linear complex",
            PLANE: "the lines of the legs' forces meet in one point or are parallel",
            SPHERE: "the moments of the legs lie in a plane",
        }[self.kind]
        free = "the forces of the legs leave the output free"
        rows = [self._row(line, locked=True) for _, line, _ in self.wrenches]
        return self.loci("type 2", words if self.ended else free, rows)

    def type1(self) -> list[JointLocus]:
        """Where a motion leaves the output at rest."""
        mechanism, ring = self.mechanism, self.ring
        generic, task = ranks(mechanism), mechanism.task.rows
        NotThisKind.refuse_if(
            generic.output < generic.mobility or len(task) != generic.mobility,
            "the output does not show each of the freedoms once",
        )
        single = sorted(tuple(arms) for _, _, arms in self.wrenches)
        if SIZE[self.kind] == len(task) and self.ended and single == [
            (j,) for j in sorted(mechanism.actuated)
        ]:  # fmt: skip
            out = []
            for leg, _, arms in self.wrenches:
                ((joint, arm),) = arms.items()
                name = mechanism.joints[joint]
                words = f"leg {leg}: {name} does not work on the force that the leg passes"
                out += self.factored("type 1", words, arm)
            return out
        # An actuated joint is an unknown of its own, but where the carrier's joints are.
        carried = () if self.ended else tuple(h.joint for h in self.carrier.hinges)
        used = {j for _, _, arms in self.wrenches for j in arms}
        drivers = [j for j in mechanism.actuated if j in used and j not in carried]
        zero = ring.zero
        rows = [
            [*self._row(line, locked=False), *(zero - arms.get(j, zero) for j in drivers)]
            for _, line, arms in self.wrenches
        ]
        rows += [[*row, *[zero] * len(drivers)] for row in self._output_rows()]
        NotThisKind.refuse_if(
            any(len(row) != len(rows) for row in rows), "there are other equations than motions"
        )
        return self.loci("type 1", _AT_REST, [_level(row, ring) for row in rows])

    def alone(self) -> Iterator[JointLocus]:
        """Where passive joints move by themselves."""
        for (leg, joints, ball), whole in self.passive.items():
            value = math.prod(self.ring.factors(whole), start=self.ring.one)
            names = ", ".join(self.mechanism.joints[j] for j in joints)
            words = f"leg {leg}: the end of the leg is on the axis of {names}"
            if ball:
                words = f"the three hinges {names} that stand for a ball lie in a plane"
            elif len(joints) > 1:
                words = f"leg {leg}: {names} move its end the same way"
            yield from self.factored("passive", words, value, ball)

    def _row(self, line: Row, locked: bool) -> Row:
        """A wrench by the output's twist, or by the carrier's joints where they are unknown."""
        if self.ended:
            return line
        out = [
            dot(line, in_room(self.kind, twist), self.ring.zero)
            for joint, twist in self.twists
            if not locked or joint in self.mechanism.passive
        ]
        return _level(out, self.ring)

    def _output_rows(self) -> Iterator[Row]:
        """Rows of the output's velocity by the unknowns: in the axes of the base, not turned."""
        ring, task = self.ring, self.mechanism.task.rows
        if not self.ended:
            moved = [x for _, x in self.columns(self.way, self.at, _AS_IT_IS)]
            yield from ([x[k] for x in moved] for k in task)
            return
        scale, output = self.carrier.scale, self.carrier.point(self.at)
        for k in task:
            unit = [ring.number(self.turn[i][k % 3]) for i in range(3)]
            grown = [scale * u for u in unit]
            # With p the output, u . (v + w x p) = u . v + w . (p x u).
            whole = [*([ring.zero] * 3), *grown] if k >= 3 else [*grown, *cross(output, unit)]
            yield in_room(self.kind, whole)


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
    from pinsing.families import closed_form, prove
    from pinsing.robot.load import load

    try:
        ends = leg_ways(mechanism)
    except NotThisKind as why:
        raise OptionError(f"{mechanism.name}: no leg has a certificate of its own: {why}") from None
    kind, normal, centre = room_of(mechanism)
    zero = at_zero(mechanism)
    task, out = "position", []
    if kind == PLANE and np.abs(normal).max() >= 1 - ROUNDING:
        task = ",".join(r for k, r in enumerate(_ROWS) if k != int(np.argmax(np.abs(normal))))
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
        out.append(LegProof(number, names, task, form))
    OptionError.refuse_if(
        not out,
        f"{mechanism.name}: no leg has a certificate of its own: none has one actuator and "
        "ends in a ball, a pin or a hinge at the output",
    )
    return tuple(out)


class ClosureForms(_ExactTree):
    """Rows of Jacobians, seen from a body between the joints."""

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
        model = self.mechanism.model
        way = way_between(model, *(int(model.frames[k].parentJoint) for k in (a, b)))
        steps = [*((j - 1, -1) for j in way.up), *((j - 1, 1) for j in way.down)]
        if kind == "6d":
            return self._whole(steps)
        one, two = (self.zero.frames[k] for k in (a, b))
        places = np.array([one.translation, two.translation])
        if kind == "planar" and self.kind != PLANE:
            # In the axes of the first frame, which is the one that rests.
            return self._motion(steps, 0, places, rational_turn(np.array(one.rotation.T)))[:2]
        rows = self._motion(steps, len(steps) // 2, places, self.turn)
        return rows[: 2 if self.kind == PLANE else 3]

    def output(self) -> list[Row]:
        """Rows of the output that count; where all do they may be those of another point."""
        task = self.mechanism.task.rows
        path = outwards(self.mechanism, structure(self.mechanism).output)
        if SIZE[self.kind] == len(task) == ranks(self.mechanism).output:
            return self._whole(path)
        place = np.array(self.zero.frames[self.mechanism.output_id].translation)
        rows = self._motion(path, 0, [place, place], _AS_IT_IS)
        return [rows[k] for k in task]

    def _whole(self, steps: Sequence[Step]) -> list[Row]:
        """All of a motion between two bodies: that of a point of a body in the middle."""
        middle = len(steps) // 2
        at = self.zero.origins[steps[middle][0]]
        rows = self._motion(steps, middle, [at, at], self.turn, rests=True)
        return rows if self.kind == SPHERE else in_room(self.kind, rows)

    def _motion(
        self, steps: Sequence[Step], middle: int, places: Sequence[Array] | Array, turn: Turn,
        rests: bool = False,
    ) -> list[Row]:  # fmt: skip
        """Six rows of how the last of two places moves less the first, seen from between them."""
        rows = [[self.ring.zero] * self.mechanism.n for _ in range(6)]
        back = [(j, -sign) for j, sign in reversed(steps[:middle])]
        for side, way, at in zip((-1, 1), (back, steps[middle:]), places, strict=True):
            for joint, column in self.columns(way, at, turn, rests) if way else ():
                for k, x in enumerate(column):
                    rows[k][joint] += side * x
        return rows


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
        legs = LegWrenches(mechanism)
        loci, off = [*legs.type2(), *legs.type1(), *legs.alone()], legs.off
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
            *made.loci("type 2", words, held),
            *made.loci("type 1", _AT_REST, whole),
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
