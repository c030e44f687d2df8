"""Planar loops closed by a dyad: all their modes, and their singular loci over the inputs, exactly.

The 5R (RR-RR) and the four-bar (RR-R): two links meet in a pin P. Each hangs on the end of an
actuated crank, or on a fixed pivot; so the passive angles follow from the intersection of two
circles. With the links d1 and d2 long and v = B2 - B1 between their ends, type 2 is where B1, P, B2
are in line,

    v.v = (d1 + d2)^2   or   v.v = (d1 - d2)^2,

and leg 1 is at type 1 where A1, B1, P are: with e the direction of its crank

    (v - d1 e).(v - d1 e) = d2^2   or   (v + d1 e).(v + d1 e) = d2^2,

so leg 2. In half-angle coordinates of the inputs these are polynomials over the rationals.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from pinsing.algebra.equation import Equation, equation
from pinsing.algebra.ring import Poly, Ring, make_ring, rational
from pinsing.errors import OptionError
from pinsing.interface import JsonResult
from pinsing.loops.closure import at_zero, bodies, groups, plane_axes, position_in
from pinsing.loops.forms import JointForms
from pinsing.loops.singular_points import SingularPoint, refine_point
from pinsing.measures import NOISE, Array, ArrayLike
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import Mechanism, Sample, closing, path_to


@dataclass(frozen=True, eq=False)
class Side:
    """One half of the loop, at the zero of its joints, in the plane."""

    pivot: Array  # (2,): fixed point A, metres
    # joint that turns the crank A-B; None if the link of the dyad hangs on A itself (B = A)
    crank: int | None
    crank_sign: float  # sense of that joint in the plane
    # crank_length and crank_angle: metres, radians
    crank_length: float
    crank_angle: float
    pin: int  # passive joint at B
    pin_sign: float  # sense of that joint
    # rod_length and rod_angle: of the link B-P
    rod_length: float
    rod_angle: float

    def end(self, turn: ArrayLike) -> Array:
        """B (..., 2), metres, with the crank turned by angles (...) in the plane."""
        return self.pivot + self.crank_length * _unit(np.asarray(turn) + self.crank_angle)

    def turned(self, q: Array) -> Array:
        """Angle (...) in the plane by which the crank is turned at q (..., n)."""
        return self.crank_sign * q[..., self.crank] if self.crank is not None else 0 * q[..., 0]


@dataclass(frozen=True, eq=False)
class Dyad:
    """The loop of a mechanism that two links close in a pin."""

    mechanism: Mechanism  # the whole
    sides: tuple[Side, Side]  # the first as in the loop's first frame
    basis: Array  # (2, 3): axes of the plane, in those of the root

    def ends(self, inputs: ArrayLike) -> tuple[Array, Array]:
        """Points B1 and B2 that the dyad hangs on, each (..., 2), at inputs (..., n_a)."""
        q = np.zeros((*np.shape(inputs)[:-1], self.mechanism.n))
        q[..., list(self.mechanism.actuated)] = inputs
        one, two = (side.end(side.turned(q)) for side in self.sides)
        return one, two

    def pin(self, inputs: ArrayLike, left: bool) -> Array:
        """P (..., 2) at inputs (..., n_a), to the left or right of B1 -> B2; NaN if infeasible."""
        first, second = self.ends(inputs)
        gap = second - first
        distance = np.linalg.norm(gap, axis=-1)
        d1, d2 = self.sides[0].rod_length, self.sides[1].rod_length
        with np.errstate(invalid="ignore", divide="ignore"):
            along = (distance**2 + d1**2 - d2**2) / (2 * distance)
            square = d1**2 - along**2
            square = np.where(np.abs(square) <= NOISE * d1**2, 0.0, square)
            height = np.sqrt(square) * (1 if left else -1)
            unit = gap / distance[..., None]
        across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
        return np.asarray(first + along[..., None] * unit + height[..., None] * across)

    def configuration(self, inputs: ArrayLike, left: bool) -> Array:
        """All joints (..., n) of one assembly mode at inputs (..., n_a); NaN if infeasible."""
        return self.reaching(inputs, self.pin(inputs, left))

    def reaching(self, inputs: ArrayLike, P: Array) -> Array:
        """All joints (..., n) at inputs (..., n_a) whose rods reach for P (..., 2)."""
        inputs = np.asarray(inputs, dtype=float)
        q = np.zeros((*inputs.shape[:-1], self.mechanism.n))
        q[..., list(self.mechanism.actuated)] = inputs
        for side, B in zip(self.sides, self.ends(inputs), strict=True):
            reach = P - B
            angle = np.arctan2(reach[..., 1], reach[..., 0]) - side.rod_angle - side.turned(q)
            q[..., side.pin] = side.pin_sign * angle
        return self.mechanism.space.wrap(q)

    def link_directions(self, q: ArrayLike, side: int) -> tuple[Array, Array]:
        """Unit vectors (..., 2) along the crank and the rod of a side at q (..., n)."""
        q = np.asarray(q, dtype=float)
        this = self.sides[side]
        turned = this.turned(q)
        rod = turned + this.pin_sign * q[..., this.pin] + this.rod_angle
        return _unit(turned + this.crank_angle), _unit(rod)

    def elbow_sine(self, q: ArrayLike, side: int) -> Array:
        """Sine (...) of the angle from crank to rod at q (..., n), zero if straight."""
        crank, rod = self.link_directions(q, side)
        return np.asarray(crank[..., 0] * rod[..., 1] - crank[..., 1] * rod[..., 0])

    def at_pin(self) -> bool:
        """Whether the output is the position of the pin, in the plane."""
        mechanism, frames = self.mechanism, self.mechanism.model.frames
        output = frames[mechanism.output_id]
        pins = [frames[k] for (k,) in closing(mechanism)]
        meets = any(
            output.parentJoint == p.parentJoint
            and np.allclose(output.placement.translation, p.placement.translation, atol=1e-12)
            for p in pins
        )
        return meets and position_in(self.basis, mechanism.task.rows)

    def close(self, inputs: ArrayLike) -> tuple[Array, ...]:
        """Return all configurations (n,) at inputs (n_a,): two, one at type 2, or none."""
        # Two of many where both links are equally long and their ends coincide: P is free on a
        # circle.
        inputs = self.mechanism.check_inputs(inputs)
        first, second = self.ends(inputs)
        if np.linalg.norm(second - first) <= NOISE and np.isclose(
            self.sides[0].rod_length, self.sides[1].rod_length, rtol=1e-12
        ):
            around = [first + self.sides[0].rod_length * _unit(turn) for turn in (0.0, np.pi)]
            return tuple(self.reaching(inputs, P) for P in around)
        ways = [self.configuration(inputs, left) for left in (True, False)]
        found = [q for q in ways if np.isfinite(q).all()]
        return tuple(found[k] for k, *_ in groups(found, 1e-12, self.mechanism.space.wrap))

    def excess(self, inputs: Array) -> float:
        """By how much the ends are too far apart for the rods or too near, metres; or negative."""
        gap = float(np.linalg.norm(np.subtract(*self.ends(inputs))))
        d1, d2 = (side.rod_length for side in self.sides)
        return max(gap - d1 - d2, abs(d1 - d2) - gap)

    def touching(self, inputs: Array) -> tuple[Array, ...]:
        """The one configuration where the circles of the rods touch, for inputs off by rounding."""
        first, second = self.ends(inputs)
        gap, d1 = float(np.linalg.norm(second - first)), self.sides[0].rod_length
        if abs(self.excess(inputs)) > 1e-9 or gap == 0:
            return ()
        along = np.sign(gap**2 + d1**2 - self.sides[1].rod_length ** 2) * d1
        return (self.reaching(inputs, first + along * (second - first) / gap),)

    def working_modes(self, point: ArrayLike) -> tuple[Array, ...]:
        """All configurations (n,) that put the pin at a point (2,) of the plane: up to four."""
        point = np.asarray(point, dtype=float)
        choices: list[list[tuple[float, ...]]] = []
        for side in self.sides:
            reach = point - side.pivot
            far, length, rod = float(np.linalg.norm(reach)), side.crank_length, side.rod_length
            if side.crank is None:
                choices.append([()] if abs(far - rod) <= 1e-9 * rod else [])
                continue
            cosine = (far**2 + length**2 - rod**2) / (2 * far * length) if far > 0 else np.inf
            away = float(np.arctan2(reach[1], reach[0])) - side.crank_angle
            bend = float(np.arccos(np.clip(cosine, -1, 1)))
            turns = [] if abs(cosine) > 1 + NOISE else [bend, -bend] if bend > 0 else [0.0]
            choices.append([(side.crank_sign * (away + turn),) for turn in turns])
        cranks = [side.crank for side in self.sides if side.crank is not None]
        every = (
            dict(zip(cranks, (*one, *two), strict=True)) for one, two in itertools.product(*choices)
        )
        actuated = self.mechanism.actuated
        return tuple(self.reaching([values[j] for j in actuated], point) for values in every)


@kept
def planar_dyad(mechanism: Mechanism) -> Dyad | None:
    """Return the dyad that closes a single planar loop; None if the mechanism is another."""
    # Asked for: one loop; each of its frames at the end of an actuated crank and a passive link, or
    # of a passive link alone; all axes parallel; both frames in one plane; no other joint.
    zero, plane = at_zero(mechanism), plane_axes(mechanism)
    kinds = [loop.kind for loop in mechanism.loops]
    if kinds not in (["planar"], ["3d"]) or mechanism.prismatic.any() or plane is None:
        return None
    basis, normal = plane[0][:2], plane[0][2]
    paths = [path_to(mechanism, body) for body in bodies(mechanism)[0]]
    ends = [np.array(zero.frames[k].translation) for (k,) in closing(mechanism)]
    one, two = (
        _side(mechanism, path, zero, zero.axis @ normal, basis, end)
        for path, end in zip(paths, ends, strict=True)
    )
    # Ends that miss each other along the axes never close as points in space.
    apart = kinds == ["3d"] and abs(float((ends[0] - ends[1]) @ normal)) > 1e-9
    if one is None or two is None or apart or sum(map(len, paths)) != mechanism.n:
        return None
    return Dyad(mechanism, (one, two), basis)


def _side(
    mechanism: Mechanism, path: list[int], zero: Sample, senses: Array, basis: Array, end: Array
) -> Side | None:
    if [j in mechanism.actuated for j in path] not in ([True, False], [False]):
        return None
    points = [basis @ zero.origins[j] for j in path]
    rod = basis @ end - points[-1]
    length = float(np.linalg.norm(rod))
    crank = points[-1] - points[0]
    crank_length = float(np.linalg.norm(crank))
    if length <= 0 or (len(path) == 2 and crank_length <= 0):
        return None
    return Side(
        pivot=points[0],
        crank=path[0] if len(path) == 2 else None,
        crank_sign=float(np.sign(senses[path[0]])) if len(path) == 2 else 1.0,
        crank_length=crank_length,
        crank_angle=float(np.arctan2(crank[1], crank[0])),
        pin=path[-1],
        pin_sign=float(np.sign(senses[path[-1]])),
        rod_length=length,
        rod_angle=float(np.arctan2(rod[1], rod[0])),
    )


def _unit(angle: ArrayLike) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def roots(equation: Equation, inputs: ArrayLike, free: int) -> Array:
    """Return all real values, in (-pi, pi], of one input that solve an equation."""
    # Along it the equation is rest + a cos u + b sin u, u being the angle or half of it.
    turns = equation.frequencies[:, free]
    q = np.array(inputs, dtype=float)
    q[free] = -equation.shift[free]
    phase = (q + equation.shift) @ (equation.frequencies.T / 2)
    cos, sin = np.cos(phase), np.sin(phase)
    even = equation.cos * cos + equation.sin * sin
    odd = np.sign(turns) * (equation.sin * cos - equation.cos * sin)
    a, b, rest = even[turns != 0].sum(), odd.sum(), even[turns == 0].sum()
    most = float(np.hypot(a, b))
    if most <= NOISE * equation.size or abs(rest) > most + 1e-12 * equation.size:
        return np.zeros(0)
    # Of half an angle both are one value; and where it is met at one value alone.
    single = np.abs(turns).max() == 1 or abs(rest) >= most - 1e-14 * equation.size
    spread = np.arccos(np.clip(-rest / most, -1, 1)) * np.array([1.0] if single else [1.0, -1.0])
    value = 2 * (np.arctan2(b, a) + spread) / np.abs(turns).max() - equation.shift[free]
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
    legs = [k for k, side in enumerate(dyad.sides) if side.crank is not None]
    output = int(mechanism.model.frames[mechanism.output_id].parentJoint) - 1
    known = dyad.at_pin() if len(legs) == 2 else output == dyad.sides[1 - legs[0]].pin
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
        actuated = dyad.mechanism.actuated
        cranks = [actuated.index(s.crank) for s in dyad.sides if s.crank is not None]
        OptionError.refuse_if(
            sorted(cranks) != list(range(len(actuated))),
            "every input must turn a crank of the loop",
        )
        self.ring: Ring = make_ring([False] * len(actuated))
        self.offset = np.zeros(len(actuated))
        # Directions of the cranks times w; a fixed pivot is one of length zero that stays.
        self.w: list[Poly] = []
        self.direction: list[tuple[Poly, Poly]] = []
        for side in dyad.sides:
            x, y = self.ring.one, self.ring.zero
            if side.crank is not None:
                j = actuated.index(side.crank)
                x, y = (self.ring.context.gens()[k] for k in self.ring.variables(j))
                # angle = sign q + crank_angle = sign (q + offset)
                self.offset[j] = side.crank_sign * side.crank_angle
            self.w.append(x**2 + y**2)
            self.direction.append((x**2 - y**2, 2 * int(side.crank_sign) * x * y))
        self.cranks = [self._exact(side.crank_length, "crank") for side in dyad.sides]
        self.pivots = [[self._exact(float(x), "pivot") for x in s.pivot] for s in dyad.sides]
        self.rods = tuple(self._exact(side.rod_length, "rod") for side in dyad.sides)
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
        gap = dyad.sides[1].pivot - dyad.sides[0].pivot
        # Lengths that turn about the pivots: the cranks, that of a leg with its rod along it.
        arms = [
            side.crank_length + (sense * side.rod_length if leg == k else 0.0)
            for k, side in enumerate(dyad.sides)
        ]
        extremes = _extremes(dyad, gap, arms)
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
            both = coincide or (single and len(form.involved) == 2)
            points_only = bool(np.any(gap != 0)) and both
            candidates = touching if points_only else self._on(form, extremes)
            witness = _witness(dyad, leg, candidates, points_only, sense)
            ends = [f"{'A' if s.crank is None else 'B'}{k}" for k, s in enumerate(dyad.sides, 1)]
            line = f"{', P, '.join(ends)}" if leg is None else f"A{leg + 1}, B{leg + 1}, P"
            words = f"{line} in line, {'stretched' if sense > 0 else 'folded'}"
            words = "B1 and B2 coincide and P turns about them" if coincide else words
            # In square metres, up to sign: squared distance minus squared reach. Type 2: |B1 B2|^2
            # - (d1 +- d2)^2. Type 1 of leg 1: |A1 + (l1 +- d1) e1 - B2|^2 - d2^2. The cosine rule
            # gives the coefficient of the highest frequency, and with it the scale.
            reach = (
                arms if len(form.joints) > 1 else [x or float(np.linalg.norm(gap)) for x in arms]
            )
            top = int(np.argmax(np.abs(form.frequencies).sum(axis=1)))
            size = float(np.hypot(form.cos, form.sin)[top])
            target = 2 * abs(reach[0] * reach[1])
            form = form.scaled(target / size) if target > 1e-12 else form
            out.append(Locus(kind, words, form, points_only, witness))
        return out

    def _on(self, form: Equation, extremes: Array) -> Iterator[Array]:
        """Yield inputs on a locus, as they are asked for: most often the first will do."""
        # Lines along the inputs, random ones first; small loops lie about an extreme.
        n = len(form.joints)
        for base in np.concatenate([self.tried, extremes]) if n > 1 else self.tried[:1]:
            for free in range(n):
                for value in roots(form, base, free):
                    yield np.where(np.arange(n) == free, value, base)


def _extremes(dyad: Dyad, gap: Array, arms: Sequence[float]) -> Array:
    """Return inputs (k, n_a) at which the distance of the ends of two arms is extreme.

    It decides on a locus. It is stationary where both arms, which turn about pivots a ``gap`` (2,)
    apart, lie on the line of the pivots, and least where the ends meet.
    """
    far, along = float(np.linalg.norm(gap)), float(np.arctan2(gap[1], gap[0]))
    found = [(along + a, along + b) for a in (0.0, np.pi) for b in (0.0, np.pi)]
    for one, two in (arms, [-x for x in arms]):
        if far > 0 and one != 0 and abs(abs(one) - abs(two)) <= far <= abs(one) + abs(two):
            bend = float(np.arccos(np.clip((far**2 + one**2 - two**2) / (2 * far * one), -1, 1)))
            for turn in (bend, -bend):
                away = one * np.array([np.cos(turn), np.sin(turn)]) - [far, 0.0]
                away = away if two > 0 else -away
                found.append((along + turn, along + float(np.arctan2(away[1], away[0]))))
    out = np.zeros((len(found), len(dyad.mechanism.inputs)))
    for side, angle in zip(dyad.sides, np.array(found).T, strict=True):
        if side.crank is not None:
            k = dyad.mechanism.actuated.index(side.crank)
            out[:, k] = side.crank_sign * (angle - side.crank_angle)
    return np.pi - np.mod(np.pi - out, 2 * np.pi)


def _witness(
    dyad: Dyad, leg: int | None, candidates: Iterable[Array], points_only: bool, sense: int
) -> SingularPoint | None:
    """A verified configuration at one of some inputs, in line as asked for."""
    mechanism = dyad.mechanism
    held = [] if points_only else list(mechanism.actuated[:-1])
    for q in itertools.chain.from_iterable(dyad.close(x) or dyad.touching(x) for x in candidates):
        straight = leg is None or abs(float(dyad.elbow_sine(q, leg))) <= 1e-6
        # Unit vectors that agree where a leg, or both rods, are stretched.
        links = [dyad.link_directions(q, k) for k in (0, 1)]
        first, second = (links[0][1], -links[1][1]) if leg is None else links[leg]
        if straight and sense * float(first @ second) >= 0:
            point = refine_point(mechanism, q, "type 2" if leg is None else "type 1", held)
            if point.converged and np.abs(mechanism.space.wrap(point.q - q)).max() < 1e-3:
                return point
    return None
