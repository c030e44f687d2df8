"""Singular loci over the pose of the output, in closed form, where each leg passes one force.

Type 2 (and constraint): the forces that the legs pass on with the actuators locked are dependent.
Their Plücker coordinates are polynomials in the pose, and in the inputs where these move their
inner ends; the determinant of six of them (three in the plane) is the equation, exactly. After
Merlet, "Singular configurations of parallel manipulators and Grassmann geometry" (1989), "Parallel
Robots" (2006), chapters 2 and 6, and St-Onge and Gosselin, "Singularity analysis and representation
of the general Gough-Stewart platform" (2000), who give its degree: three in the position. With what
each actuator feels of them and the motions of the output that its rows leave out, a determinant
too, comes type 1. Of legs on cranks, rails or driven feet in space the determinants have tens of
thousands of terms: they stay determinants, and `closing` says which poses and inputs go together.

The rotation is that of a quaternion (e0, e1, e2, e3), homogeneous: multiplied by its squared length
N. With y in units of a root, e1 and e3 are as well, and all stays rational.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import determinant
from pinsing.algebra.ring import Poly, coefficients_by, divided_by, make_ring
from pinsing.loops.closure import (
    PLANE,
    SPACE,
    SPHERE,
    in_room,
    near_home,
    output_pose,
    planar_dyad,
    random_closed,
    ranks,
    structure,
)
from pinsing.loops.forms import (
    TURNS,
    PoseEquation,
    PoseFamily,
    PoseForms,
    PoseLocus,
    Row,
    Vector,
    cross,
    determinant_equation,
    dot,
    exact_points,
    has_real_points,
    planar_equation,
    pose_equation,
    quaternion_turn,
    random_variables,
    short_fraction,
)
from pinsing.loops.legs import (
    Rod,
    Rods,
    input_loci,
    legs_of,
    length_name,
    point_legs,
    quarter_circles,
    rods,
    sphere_rods,
    written,
)
from pinsing.loops.motion import home, pose_of
from pinsing.measures import ROUNDING, Array
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import Mechanism


class PoseRing:
    """The ring of one mechanism, and its ``legs``: the rods over it.

    ``level``: the output keeps the orientation of the base axes, its rotation is left out;
    ``unit``: the quaternion is of length 1, N = 1, and nothing is homogeneous; ``quarter``: links
    on the sphere are quarter circles, C is across the actuated axis and B, whatever the inputs,
    which are left out.
    """

    def __init__(
        self, rods: Rods, level: bool = False, unit: bool = False, quarter: bool = False
    ) -> None:
        self.rods, self.level, self.unit, self.quarter = rods, level, unit, quarter
        joints, none = rods.mechanism.joints, np.zeros(3)
        # Of a level output B as seen from C: parallel rods are exactly so.
        vectors: list[Array] = []
        for r in rods.rods:
            points = [r.outer - r.inner if level else r.outer, r.inner, r.first, r.second]
            vectors += [*rods.flattened(np.array(points))]
            vectors += [none if r.hinge is None else r.hinge, r.across]
        self.exact = exact_points(vectors)
        self.square = self.exact.square  # y, e1 and e3 are in units of its root
        # Inputs that occur, since they move the inner ends of rods.
        self.drivers = tuple(dict.fromkeys(r.joint for r in rods.rods if r.moved))
        position = {SPACE: ("x", "y", "z"), PLANE: ("x", "y"), SPHERE: ()}[rods.kind]
        turn = () if level else ("e0", "e3") if rods.planar else TURNS
        inputs = [] if quarter else [n for r in rods.rods for n in r.variables(joints[r.joint])]
        self.names: tuple[str, ...] = (*position, *turn, *dict.fromkeys(inputs))
        self.odd = tuple(k for k, n in enumerate(self.names) if n in ("y", "e1", "e3"))
        self.ring = make_ring([True] * len(self.names))
        self.number = self.ring.number
        e = [self.number(v) for v in (1, 0, 0, 0)] if level else [*map(self.variable, TURNS)]
        self.R, N = quaternion_turn(e, self.square)  # rotation matrix times N
        self.N = self.number(1) if unit else N
        exact = iter(self.exact.vectors)
        self.legs = [ExactRod(self, rod, *itertools.islice(exact, 6)) for rod in rods.rods]

    def variable(self, name: str) -> Poly:
        """A variable; zero for one that this ring leaves out."""
        gens = self.ring.context.gens()
        return gens[self.names.index(name)] if name in self.names else self.number(0)

    def product(self, a: Row, b: Row) -> Row:
        """Vector product times the root, with y in units of it."""
        x, y, z = cross(a, b)
        return [self.square * x, y, self.square * z]

    def dot(self, a: Row, b: Row) -> Poly:
        """Scalar product of vectors with y in units of the root."""
        return a[0] * b[0] + self.square * a[1] * b[1] + a[2] * b[2]

    def without_norm(self, poly: Poly) -> Poly:
        """Divide by N as often as it goes: it is 1."""
        return poly if self.N.is_constant() else divided_by(poly, self.N)

    def lines(self) -> list[Row]:
        """All wrenches: of each rod, and of its hinge."""
        out = []
        for leg in self.legs:
            out += [leg.line] if leg.rod.hinge is None else [leg.line, leg.wrench(leg.hinge)]
        return out

    def determinant(self, rows: list[Row], roots: Sequence[int] = ()) -> PoseEquation:
        """Return the determinant of rows, unexpanded, with ``roots`` of `square` a column."""
        # Without ``roots`` those of wrenches: forces, then moments.
        roots = roots or ((0, 1, 1) if self.rods.planar else (0, 1, 0, 1, 0, 1))
        return determinant_equation(rows, self.names, self.odd, self.square, roots)

    def multiplied_out(self, rows: list[Row]) -> Poly:
        """The determinant of rows, multiplied out."""
        return determinant(rows, self.ring, Budget(math.inf))

    def equation(self, poly: Poly) -> PoseEquation:
        """A polynomial as an equation; in the plane in the angle of the output."""
        if self.rods.planar and not self.level:
            half = (self.names.index("e0"), self.names.index("e3"))
            return planar_equation(poly, self.names, self.odd, self.square, half)
        return pose_equation(poly, self.names, self.odd, self.square)


class ExactRod:
    """A rod and what it passes, in polynomials: B, C, and the vectors of `Rod`.

    Times N are ``outer`` (B), ``turned`` (B as seen from the output's origin), ``direction``
    (B - C) and the ``force``, of one across C B times the root as well; ``inner`` is C, ``motion``
    its velocity by the actuator.
    """

    def __init__(self, ring: PoseRing, rod: Rod, *vectors: Vector) -> None:
        self.ring, self.rod, joints = ring, rod, ring.rods.mechanism.joints
        self.slides = bool(ring.rods.mechanism.prismatic[rod.joint])
        self.own, self.middle, self.first, second, self.hinge, self.axis = (
            [ring.number(x) for x in v] for v in vectors
        )
        if ring.level:
            self.own = _sum(self.own, self.middle)
        self.turned = [dot(row, self.own, ring.number(0)) for row in ring.R]
        self.outer = _sum([ring.N * ring.variable(n) for n in "xyz"], self.turned)
        # Cosine and sine of the crank before C; the slide's value, and 0.
        names = (*rod.variables(joints[rod.joint]), "", "")
        c, s = (ring.variable(n) for n in names[:2])
        self.moved = [c * a + s * b for a, b in zip(self.first, second, strict=True)]
        self.inner = _sum(self.middle, self.moved)
        if ring.quarter:
            self.inner = ring.product(self.axis, self.outer)
        self.motion = self.first if self.slides else [
            c * b - s * a for a, b in zip(self.first, second, strict=True)
        ]  # fmt: skip
        self.force = self.direction = _sum(self.outer, self.inner, -ring.N)
        if rod.side:
            self.force = ring.product(self.axis, self.direction)
        if rod.side == 2:
            self.force = ring.product(self.force, self.direction)

    def wrench(self, force: Row) -> Row:
        """A force through B; three numbers in the plane."""
        whole = [*(self.ring.N * x for x in force), *cross(self.outer, force)]
        return in_room(self.ring.rods.kind, whole)

    @property
    def line(self) -> Row:
        """Plücker coordinates of the force about the origin; three numbers in the plane."""
        if self.rod.side:
            return self.wrench(self.force)
        return in_room(self.ring.rods.kind, [*self.direction, *cross(self.inner, self.outer)])

    @property
    def arm(self) -> Poly:
        """Force along C B in the direction in which the actuator moves C."""
        # Of a crank (cos first + sin second) is across the motion of C: from its middle will do.
        C = self.inner if self.slides else self.middle
        return self.ring.dot(_sum(self.outer, C, -self.ring.N), self.motion)

    def length(self, length: Fraction) -> Poly:
        """What is zero where C and B are at their distance, N times (B - C)^2 - length^2."""
        ring, joint = self.ring, self.ring.rods.mechanism.joints[self.rod.joint]
        away = _sum([ring.variable(n) for n in "xyz"], self.middle, -1)
        arm = ring.dot(self.first, self.first)
        if self.slides:
            arm = arm * ring.variable(joint) ** 2
        fixed = ring.dot(away, away) + ring.dot(self.own, self.own) + arm - ring.number(length**2)
        fixed -= 2 * ring.dot(away, self.moved)
        return ring.N * fixed + 2 * ring.dot(_sum(away, self.moved, -1), self.turned)

    def about_output(self, force: Row) -> Row:
        """A force through B, times N, and its moment about the output, without task rows."""
        whole = [*(self.ring.N * x for x in force), *cross(self.turned, force)]
        return [x for k, x in enumerate(whole) if k not in self.ring.rods.mechanism.task.rows]


def _sum(a: Row, b: Row, times: Any = 1) -> Row:
    """A vector, and another one so many times."""
    return [x + times * y for x, y in zip(a, b, strict=True)]


def counts_hinges(ring: PoseRing) -> bool:
    """Whether forces along hinges and rows of the output are six together."""
    hinges = sum(rod.hinge is not None for rod in ring.rods.rods)
    return hinges > 0 and hinges + len(ring.rods.mechanism.task.rows) == 6


def every_position(ring: PoseRing, poly: Any) -> Iterator[PoseFamily]:
    """Yield families of orientations at which ``poly`` vanishes for all positions."""
    # Where some components of the quaternion are zero, all its coefficients are, or share a factor.
    names, gens = ring.names, ring.ring.context.names()
    turn = [k for k, n in enumerate(names) if n in TURNS]
    others = [k for k in range(len(names)) if k not in turn]
    coefficients = list(coefficients_by(poly, others).values())
    found: list[tuple[set[int], Any]] = []
    subspaces = (itertools.combinations(turn, count) for count in range(len(turn)))
    for chosen in itertools.chain.from_iterable(subspaces):
        values, zero = dict.fromkeys([gens[k] for k in chosen], 0), set(chosen)
        rest = [x for x in (c.subs(values) for c in coefficients) if x != 0]
        factors = [ring.number(0)]
        if rest:
            common = functools.reduce(lambda a, b: a.gcd(b), rest)
            factors = [f for f, _ in common.factor()[1]]
        known = [f.subs(values) for z, f in found if z <= zero]
        for factor in factors:
            left = [n for k, n in enumerate(names) if k in turn and k not in zero]
            vanish = tuple(names[k] for k in chosen)
            equations: tuple[PoseEquation, ...] = ()
            if factor != 0:
                equations = (pose_equation(factor, names, ring.odd, ring.square),)
                # A single component that vanishes is a smaller subspace, seen there.
                used = sum(n in left for n in equations[0].used) if len(factor) > 1 else 0
                if used == 0 or (used > 1 and not has_real_points(equations[0])):
                    continue
            if not any(f == 0 or (factor != 0 and divmod(f, factor)[1] == 0) for f in known):
                found.append((zero, factor))
                yield PoseFamily(_words(vanish, left, equations), vanish, equations)


def _words(vanish: tuple[str, ...], left: list[str], equations: tuple[PoseEquation, ...]) -> str:
    """What orientations are with components of the quaternion zero and equations of the others."""
    axes = [{"e1": "x", "e2": "y", "e3": "z"}[n] for n in left if n != "e0"]
    turned = len(left) > len(axes)
    conditions = [*(f"{n} = 0" for n in vanish), *map(str, equations)]
    words = f"orientations with {', '.join(conditions)}"
    if len(left) == 1 and not equations:
        words = "not turned at all" if turned else f"half a turn about {axes[0]}"
    elif len(left) == 2:
        bends: list[float] = []
        for x in equations:
            # Real values of the second component over the first.
            line = np.bincount(x.powers[:, x.names.index(left[1])], x.values)
            bends += [math.atan(r.real) for r in np.roots(line[::-1]) if abs(r.imag) <= 1e-9]
        if turned:
            angles = _listed([2 * b for b in bends]) if equations else "any angle"
            words = f"turned by {angles} about {axes[0]}"
        else:
            where = f"an axis at {_listed(bends)} from {axes[0]} towards {axes[1]}"
            plane = f"any axis in the plane of {axes[0]} and {axes[1]}"
            words = f"half a turn about {where if equations else plane}"
    return f"{words}: singular at every position"


def _listed(values: list[float]) -> str:
    """Angles, radians, in degrees: ``±90°``."""
    degrees = sorted({round(math.degrees(v), 6) + 0.0 for v in values})
    plus = [d for d in degrees if d > 0]
    if [-d for d in reversed(plus)] == [d for d in degrees if d < 0] and 0.0 not in degrees:
        return " or ".join(f"±{d:.6g}°" for d in plus)
    return " or ".join(f"{d:.6g}°" for d in degrees)


PROOFS = "exact over the rationals at each step; certificates are of each leg alone (--prove)"


def with_inputs(pose: str, loops: str, article: str) -> str:
    """That equations are in the pose and the inputs together."""
    return (
        f"the equations are in the {pose} and the inputs together: {article} {pose} and inputs "
        f"that close the {loops} are singular if and only if one of them is zero"
    )


def made_exact(ring: PoseRing) -> Iterator[str]:
    """By how much coordinates were changed."""
    if ring.exact.off > 1e-12:
        yield f"coordinates were made exact, by at most {ring.exact.off:.1e} m"


def in_plane(found: Rods, turns: bool = True) -> Iterator[str]:
    """What x, y, and φ where the output ``turns``, are in a plane that is not that of the base."""
    if not found.tilted or (not turns and np.abs(found.axes - np.eye(3)).max() <= 1e-9):
        return
    x, y, n = (written(a) for a in found.axes)
    if not turns:
        yield f"x and y are in the plane of the mechanism: x along {x} of the base, y along {y}"
        return
    yield (
        f"x, y and φ are in the plane of the mechanism: x along {x} of the base, y along {y}, "
        f"φ about {n}, zero where {written(found.own[:, 0])} of the output is along x"
    )


def notes_on(ring: PoseRing) -> list[str]:
    """What the equations leave open, and what they rest on."""
    found, rods = ring.rods, ring.rods.rods
    kinds, sliding = {rod.kind for rod in rods}, [rod for rod in rods if rod.sliding >= 0]
    alone, hinges = _alone(found), found.hinged and not ring.unit
    alone_there = "passive joints move by themselves (below)"
    aside = f", or {alone_there}" if alone else ""
    untold = hinges and not counts_hinges(ring)
    also = "also " * (hinges or any(rod.moved or rod.kind == "elbow" for rod in rods))
    across = " or is along the axis of its first joint" * (
        ring.unit and any(r.side for r in sliding)
    )
    else_ = f"else only where {alone_there}" if alone else "nowhere else"
    what = "a pose and inputs that close the loops are"
    if not ring.drivers:
        what = "a pose that closes the loops is"
    whole = len(found.mechanism.task.rows) == 6 or not ring.unit
    strokes = found.planar and kinds == {"strut"} and not input_loci(found.mechanism)
    # Notes by whether they are true.
    notes = [
        (
            bool(sliding) and untold,
            "type 1 is not in these equations: the rows of the output and the hinges are not "
            "six together; the equations in the joint angles have it",
        ),
        (
            bool(sliding) and whole and not untold,
            f"type 1: {also}where a leg has no length{_short(found, sliding)}{across}; {else_}",
        ),
        *((ring.unit, text) for text in _rows_notes(found)),
        (
            ring.unit and bool(ring.drivers or found.hinged),
            f"{what} singular if and only if one of the loci is zero{aside}",
        ),
        (
            ring.unit and bool(ring.drivers),
            "the pose alone: eliminating the inputs by their closure (each quadratic) "
            f"multiplies {2 ** len(ring.drivers)} working modes; not done",
        ),
        *((not ring.unit, text) for text in in_plane(found)),
        (bool(ring.drivers) and not ring.unit, with_inputs("pose", "loops", "a") + aside),
        (
            found.planar and kinds == {"crank"},
            "the pose alone: eliminating the three inputs by their closure (each quadratic) "
            "multiplies eight working modes, to degree 44 in x and y at a given angle, 42 with "
            "legs of equal lengths (Bonev and Gosselin 2001); not done",
        ),
        (
            strokes,
            "the inputs alone: eliminating the pose leaves a polynomial, in general of degree "
            "12 in the squares of the inputs; not written out where coordinates have more than "
            "five decimals",
        ),
        (
            hinges,
            "poses of this mechanism keep the outer end of each leg in the plane across its "
            f"hinge; such a pose is singular if and only if one of the equations holds{aside}",
        ),
        (
            bool(alone),
            "passive joints that move by themselves, the output at rest, are not in these "
            f"equations: {alone}; the equations in the joint angles have each",
        ),
        (not ring.unit, PROOFS),
        (
            ring.unit,
            "determinants are exact and not multiplied out; certificates are of each leg alone "
            "(--prove)",
        ),
    ]
    return [*made_exact(ring), *(text for holds, text in notes if holds)]


def _short(found: Rods, legs: Sequence[Rod]) -> str:
    """Where slides have no length, unless they are counted from there; whether limits allow it."""
    mechanism, slides = found.mechanism, {r.sliding: r for r in legs}
    named = [f"{length_name(mechanism, r, 6).strip('()')} = 0" for r in slides.values() if r.offset]
    where = f" ({' or '.join(named)})" if named else ""
    reached = any(
        mechanism.lower[k] + r.offset <= 0 <= mechanism.upper[k] + r.offset
        for k, r in slides.items()
    )
    return where + ("" if reached else ", which the limits exclude")


def _alone(found: Rods) -> str:
    """Passive joints at one point that can be dependent by themselves, and where they are."""
    mechanism = found.mechanism
    kinds = {
        2: "universal joints whose rod lies in the plane of their two axes, as along the first one",
        3: "balls written as three hinges, which lie in a plane",
    }
    centres = [] if found.planar else [c.joints for c in structure(mechanism).centres]
    named = {
        words: [", ".join(mechanism.joints[j] for j in c) for c in centres if len(c) == count]
        for count, words in kinds.items()
    }
    return "; ".join(f"{words} ({'; '.join(joints)})" for words, joints in named.items() if joints)


def _rows_notes(found: Rods) -> Iterator[str]:
    """What the rows of the determinant are, leg by leg."""
    yield (
        "rows of the determinant of type 2: a force f through B and its moment B x f about the "
        "origin of the base; B = (x, y, z) + R b with R the rotation of e0, e1, e2, e3"
    )
    for k, rod in enumerate(found.rods, 1):
        force = ("B - C", "a x (B - C)", "(a x (B - C)) x (B - C)")[rod.side]
        C = rod.foot_text(found.mechanism.joints[rod.joint])
        text = f"force {k}: f = {force}, b = {written(rod.outer)}, C = {C}"
        if rod.side:
            text += f", a = {written(rod.across)}"
        if rod.hinge is not None:
            text += f"; and f = {written(rod.hinge)}, across which B - C stays"
        if rod.moved:
            text += f"; it closes where |B - C| = {found.length(rod):.6g} m"
        yield text


def locus_distance(mechanism: Mechanism, forms: PoseForms, q: Array) -> float:
    """Return the least value of the equations at q (n,), over the size that terms can have."""
    # Lengths count with the size of the mechanism, all else with 1: a term that is zero by itself,
    # as in ``e3 = 0``, says how near it is.
    at = variables_at(mechanism, q)
    found = legs_of(mechanism)
    places = [] if found is None else [p for r in found.rods for p in (r.inner, r.outer)]
    reach = max((float(np.linalg.norm(p)) for p in places), default=mechanism.length_scale)
    reach = max(reach, *(abs(at[n]) for n in "xyz"))
    # Beside equations in the quaternion those without it are of a level output.
    turned = "e0" in forms.variables and "z" in forms.variables and abs(at["e0"]) < 1 - 1e-9
    loci = [x for x in forms.loci if not turned or "e0" in x.equation.names]
    return min(_relative(locus.equation, at, reach) for locus in loci)


def variables_at(mechanism: Mechanism, q: Array) -> dict[str, float]:
    """Values of the variables of equations at a configuration q (n,)."""
    found = legs_of(mechanism)
    there = output_pose(mechanism, q)
    pose = pose_of(there if found is None else found.placed(there))
    out = dict(zip("xyz", pose.position, strict=True))
    out |= {f"e{k}": e for k, e in enumerate(pose.quaternion)}
    for name, value in [("φ", pose.angles[2]), *zip(mechanism.joints, q.tolist(), strict=True)]:
        out[name] = value
        out[f"cos {name}"], out[f"sin {name}"] = float(np.cos(value)), float(np.sin(value))
    return out


def _relative(equation: PoseEquation, at: dict[str, float], reach: float) -> float:
    """Its value, or a determinant's least singular value over the largest, by what they can be."""
    x = np.array([at[n] for n in equation.names])
    turning = [n in TURNS or n.startswith(("cos ", "sin ")) for n in equation.names]
    most = np.where(turning, 1.0, np.maximum(np.abs(x), reach))
    entries = equation.matrix or ((equation,),)
    sizes = np.array([[_size(e, most) for e in row] for row in entries])
    level = np.array([[float(e(x)) for e in row] for row in entries])
    for axis in (0, 1):
        largest = sizes.max(axis=axis, keepdims=True)
        sizes, level = (M / np.where(largest > 0, largest, 1.0) for M in (sizes, level))
    sigma = np.linalg.svd(level, compute_uv=False)
    size = sigma[0] if equation.matrix else 1.0
    return float(sigma[-1] / size) if size > 0 else 0.0


def _size(equation: PoseEquation, most: Array) -> float:
    """What its largest term can be."""
    return float(np.abs(np.prod(most**equation.powers, axis=1) * equation.values).max(initial=0.0))


@kept
def pose_forms(mechanism: Mechanism) -> PoseForms | None:
    """Return closed forms over the pose; None where a leg passes other things than one force.

    A spherical mechanism of three legs has them over its orientation, a five-bar on slides, or a
    welded one, over the position of its middle pin.

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
    ranks(mechanism)
    found = rods(mechanism)
    if found is not None:
        return _forms(mechanism, found)
    sphere = sphere_rods(mechanism)
    return _point_forms(mechanism) if sphere is None else _sphere_forms(mechanism, sphere)


Part = tuple[str, str, Any, bool]
"""Kind, words, a polynomial, and whether it has real points whatever its signs."""


def _loci(ring: PoseRing, parts: Iterable[Part]) -> list[PoseLocus]:
    """Loci of polynomials that are taken as they are, each once."""
    seen: dict[tuple[str, str], Part] = {}
    for part in parts:
        seen.setdefault((part[0], str(part[2])), part)
    each = ((kind, words, ring.equation(poly), sure) for kind, words, poly, sure in seen.values())
    return [PoseLocus(k, words, x, sure or has_real_points(x)) for k, words, x, sure in each]


def _factors(kind: str, words: str, poly: Any, sure: bool = False) -> Iterator[Part]:
    for factor, _ in poly.factor()[1] if poly != 0 else ():
        yield kind, words, factor, sure


def _sphere_forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    """Over the orientation, and the inputs where they do not drop out."""
    ring = PoseRing(found, quarter=quarter_circles(found))
    two, ones = _moments(ring)
    squares = squares_note(found)
    # Sums of squares have real zeros too: turns by which an outer axis meets a base axis.
    real = bool(squares)
    parts = [*_factors("type 2", "the planes of the outer links meet in one line", two, real)]
    for k, (rod, one) in enumerate(zip(found.rods, ones, strict=True), 1):
        words = f"leg {k} is folded or stretched: {mechanism.joints[rod.joint]} turns nothing"
        parts += _factors("type 1", words, one, real)
    inputs = "both links of each leg are quarter circles: the inputs drop out"
    if not ring.quarter:
        inputs = with_inputs("orientation", "loops", "an")
    exact = f"axes were made exact, by at most {ring.exact.off:.1e}" * (ring.exact.off > 1e-12)
    notes = (*filter(None, (squares, inputs, exact)), PROOFS)
    always = "" if two != 0 else (
        "architecture singularity: the moments of the legs lie in a plane at every orientation"
    )  # fmt: skip
    return PoseForms(ring.names, always, tuple(_loci(ring, parts)), (), (), True, notes)


def _moments(ring: PoseRing) -> tuple[Poly, list[Poly]]:
    """Zero where the moments of legs on the sphere lie in a plane; and where none works by each."""
    ones = [ring.dot(leg.axis, leg.line) for leg in ring.legs]
    return ring.without_norm(ring.multiplied_out(ring.lines())), [*map(ring.without_norm, ones)]


def squares_note(found: Rods) -> str:
    """Return what a sum of squares says; empty where type 2 is none."""
    # With the base in the axes u and the output in the axes w, both at right angles, the moments'
    # determinant has squares only: it is zero where some components of the quaternion are.
    U, W = (np.array([getattr(r, name) for r in found.rods]) for name in ("across", "outer"))
    right = max(float(np.abs(A @ A.T - np.eye(3)).max()) for A in (U, W)) <= ROUNDING
    if not right or not quarter_circles(found):
        return ""
    unit = zip(found.rods, np.eye(3), strict=True)
    straight = replace(found, rods=tuple(replace(r, outer=e, across=e) for r, e in unit))
    type2, type1 = _moments(ring := PoseRing(straight, quarter=True))
    zeros = _zeros(type2, len(TURNS))
    gens = ring.ring.context.names()
    at_zeros = [dict.fromkeys([gens[k] for k in zero], 0) for zero in zeros]
    if not zeros or not all(any(p.subs(at) == 0 for p in type1) for at in at_zeros):
        return ""
    squares = pose_equation(type2, ("f0", "f1", "f2", "f3"))
    return (
        "counted from where the outer axes are along those of the base, by f0, f1, f2, f3, type 2 "
        f"is a sum of squares, {squares}: zero only where two of them are, and there a leg is of "
        "type 1 (proven)"
    )


def _zeros(poly: Poly, count: int) -> list[frozenset[int]]:
    """Least sets of variables that are zero on the real zeros of a sum of squares; else none."""
    terms = [(tuple(int(e) for e in m), c) for m, c in poly.to_dict().items()]
    if len({c > 0 for _, c in terms}) != 1 or any(e % 2 for m, _ in terms for e in m):
        return []
    out: list[frozenset[int]] = []
    for size in range(1, count):
        for chosen in itertools.combinations(range(count), size):
            hit = all(any(m[k] for k in chosen) for m, _ in terms)
            if hit and not any(known <= set(chosen) for known in out):
                out.append(frozenset(chosen))
    return out


def _point_forms(mechanism: Mechanism) -> PoseForms | None:
    """Return forms of a five-bar over its middle pin, the output, and the inputs, or None."""
    # Each leg passes one force on the pin, along its rod. None, too, where the inputs alone will
    # do.
    found = point_legs(mechanism)
    if found is None or planar_dyad(mechanism) is not None:
        return None
    ring = PoseRing(found, level=True)
    (a, b, _), (c, d, _) = (leg.direction for leg in ring.legs)
    both = _factors("type 2", "both rods are in line", a * d - b * c)
    loci = [*_loci(ring, both), *_type1(ring)]
    both_in = with_inputs("position", "loop", "a")
    notes = (*in_plane(found, turns=False), both_in, *made_exact(ring), PROOFS)
    return PoseForms(ring.names, "", tuple(loci), (), (), True, notes, (), _closing(ring))


def _forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    turning = not found.planar and any(rod.moved or rod.side for rod in found.rods)
    plain = not any(rod.side or rod.hinge is not None for rod in found.rods)
    turned = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max() > 1e-9
    level = turning and plain and set(mechanism.task.rows) == {0, 1, 2} and not turned
    if turning and not level:
        return _turning_forms(mechanism, found)
    ring = PoseRing(found, level)
    lines = ring.lines()
    # Zero as a polynomial where every pose is singular.
    together = ring.without_norm(ring.multiplied_out(lines))
    notes = [
        "equations without e0, e1, e2, e3 are of an output that keeps the axes of the base (its "
        "translational mode) and count there alone, where they are what the determinants come "
        "down to; the determinants hold whether it is turned or not"
    ] * level
    notes += made_exact(ring) if level and together != 0 else notes_on(ring)
    if together != 0 and _dependent(ring.determinant(lines)):
        notes.append(
            "the coordinates of the file make the lines dependent to 1e-9 of their size, at every "
            "pose tried; that is taken for what is meant"
        )
        together = ring.number(0)
    ones = _type1(ring)
    if together == 0:
        words = _architecture(found)
        return PoseForms(ring.names, words, tuple(ones), (), (), True, tuple(notes))
    loci = (*_loci(ring, _split(ring, together)), *ones)
    if level:
        # Of an output that is not turned, then the determinants that hold for a turned one, too.
        every = _turning_forms(mechanism, found)
        more = [replace(x, words=f"turned or not, {x.words}") for x in every.loci]
        said = tuple(dict.fromkeys([*notes, *every.notes]))
        return replace(every, loci=(*loci, *more), notes=said)
    words = "over the inputs, where two assembly modes meet"
    inputs = tuple(PoseLocus("type 2", words, x, has_real_points(x)) for x in input_loci(mechanism))
    return PoseForms(
        ring.names, "", loci,
        tuple(every_position(ring, together)), tuple(_at_home(mechanism, ring, together)),
        not found.hinged or counts_hinges(ring), tuple(notes), inputs, _closing(ring),
    )  # fmt: skip


def _architecture(found: Rods) -> str:
    """Words for lines that are dependent at every pose."""
    a, b = (np.array([getattr(r, end) for r in found.rods]) for end in ("inner", "outer"))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    # Whether the outer points are the inner ones moved, turned and scaled.
    U, sigma, Vt = np.linalg.svd(a.T @ b)
    size = float(sigma.sum() / (a**2).sum())
    near = np.abs(size * a @ (U @ Vt) - b).max() <= 1e-9 * max(1.0, float(np.abs(b).max()))
    why = "the leg lines are dependent whatever the pose"
    if near and not any(r.moved or r.side for r in found.rods):
        why = f"platform and base {'triangles' if len(a) == 3 else 'hexagons'} are similar"
    return f"architecture singularity: {why}: singular at every pose"


def _turning_forms(mechanism: Mechanism, found: Rods) -> PoseForms:
    """Of legs on cranks, rails or driven feet in space: determinants, or one leg's equation."""
    ring = PoseRing(found, unit=True)
    notes = notes_on(ring)
    two, closing = ring.determinant(ring.lines()), _closing(ring)
    if _dependent(two):
        return PoseForms(
            ring.names, _architecture(found), (), (), (), True, tuple(notes), (), closing
        )
    kind = "type 2 or constraint" if found.hinged or len(mechanism.task.rows) < 6 else "type 2"
    which = "forces that the legs pass" if any(rod.side for rod in found.rods) else "rod lines"
    words = f"the {which} and {_HINGED}" if found.hinged else f"the six {which} {_COMPLEX}"
    loci = (PoseLocus(kind, words, two, has_real_points(two)),)
    ones = _turning_type1(ring)
    if ones is None:
        notes.append(
            "type 1 is not in these equations: the output does not show each of the freedoms once; "
            "the equations in the joint angles have it"
        )
    made = PoseForms(ring.names, "", loci, (), (), ones is not None, tuple(notes), (), closing)
    tried = near_home(mechanism) + random_closed(mechanism, 6, np.random.default_rng(2719))
    always = len(tried) >= 4 and max(locus_distance(mechanism, made, q) for q in tried) <= 1e-10
    words = (
        f"{kind} at each of the {len(tried)} closed configurations tried: taken for singular at "
        "every pose"
    )
    return replace(made, loci=(*loci, *(ones or ())), architecture=words if always else "")


def _closing(ring: PoseRing) -> tuple[PoseEquation, ...]:
    """Lengths of rods that are no actuators, and planes of hinges, by pose and inputs."""
    out = []
    for leg in ring.legs:
        if leg.rod.moved:
            out.append(leg.length(short_fraction(ring.rods.length(leg.rod))))
        if leg.rod.hinge is not None and ring.unit:
            out.append(ring.dot(leg.direction, leg.hinge))
    return tuple(ring.equation(x) for x in out)


def _dependent(found: PoseEquation) -> bool:
    """Whether the rows of a determinant are dependent, to the rounding of a file, at random."""
    M = found.entries(random_variables(found.names, 6))
    M = M / np.maximum(np.linalg.norm(M, axis=-1), 1e-300)[..., None]
    sigma = np.linalg.svd(M, compute_uv=False)
    return bool((sigma[:, -1] <= 1e-9 * sigma[:, 0]).all())


_COMPLEX = "belong to one linear complex"
_HINGED = f"the forces along the hinges through the same points {_COMPLEX}"


def _turning_type1(ring: PoseRing) -> list[PoseLocus] | None:
    """Where a motion leaves the output at rest; None where these equations do not tell."""
    mechanism = ring.rods.mechanism
    task, inputs = mechanism.task.rows, list(mechanism.actuated)
    zero, rows, felt = ring.number(0), [], []
    for leg, force, feels in _wrenches(ring):
        felt.append(leg.rod.joint)
        moments = [feels if j == leg.rod.joint else zero for j in inputs]
        rows.append([*leg.about_output(force), *moments])
    if len(task) == 6 and sorted(felt) == sorted(inputs):
        return _type1(ring)
    if len(inputs) != len(task) or len(rows) != 6:
        return None
    left = [k % 2 for k in range(6) if k not in task]
    found = ring.determinant(rows, (*left, *[0] * len(inputs)))
    if _dependent(found):
        return None
    words = "a motion of the joints leaves the rows of the output at rest"
    return [PoseLocus("type 1", words, found, has_real_points(found))]


def _wrenches(ring: PoseRing) -> Iterator[tuple[ExactRod, Row, Poly]]:
    """Yield each force, through the outer end of its rod, and what its actuated joint feels."""
    # Of forces across a rod up to a factor that is zero only where the force is.
    for leg in ring.legs:
        yield leg, leg.force, leg.arm if leg.rod.moved else ring.dot(leg.force, leg.force)
        if leg.rod.hinge is not None:
            slides = leg.rod.moved and leg.slides
            yield leg, leg.hinge, ring.dot(leg.hinge, leg.motion) if slides else ring.number(0)


def _split(ring: PoseRing, together: Any) -> Iterator[Part]:
    """Factors of the determinant with what each means."""
    hinged = ring.rods.hinged
    *numbers, last = range(1, len(ring.rods.rods) + 1)
    names = f"the lines of legs {', '.join(map(str, numbers))} and {last}"
    words = f"{names} meet in one point or are parallel" if ring.rods.planar else (
        f"{names} and {_HINGED}" if hinged else f"the six leg lines {_COMPLEX}"
    )  # fmt: skip
    whole = ("type 2 or constraint" if hinged else "type 2", words, together)
    known = [*_parallelograms(ring), whole]
    for factor, _ in together.factor()[1]:
        kind, what, _ = next(x for x in known if divmod(x[2], factor)[1] == 0)
        yield kind, what, factor, False


def _parallelograms(ring: PoseRing) -> list[tuple[str, str, Any]]:
    """With the output level and two rods a crank: determinants of directions and of normals."""
    mine = [[leg for leg in ring.legs if leg.rod.joint == joint] for joint in ring.drivers]
    if not ring.level or [len(pair) for pair in mine] != [2, 2, 2]:
        return []
    directions, others = ([pair[k].direction for pair in mine] for k in (0, 1))
    if not all(d == e for d, e in zip(directions, others, strict=True)):
        return []
    apart = (_sum(two.outer, one.outer, -1) for one, two in mine)
    normals = [cross(gap, d) for gap, d in zip(apart, directions, strict=True)]
    plane = "the rods are parallel to a plane, or two pairs of them to each other"
    turns = "the normals of the three parallelograms are parallel to a plane: the output can turn"
    return [
        ("type 2", plane, ring.multiplied_out(directions)),
        ("constraint", turns, ring.multiplied_out(normals)),
    ]


def _type1(ring: PoseRing) -> list[PoseLocus]:
    """Where a motion that the hinges allow, or a leg's own, leaves the output at rest."""
    parts: list[Part] = []
    if counts_hinges(ring):
        legs = [leg for leg in ring.legs if leg.rod.hinge is not None]
        value = ring.multiplied_out([leg.about_output(leg.hinge) for leg in legs])
        if value != 0:  # the output shows each of the freedoms
            words = "a motion that the hinges allow leaves the rows of the output at rest"
            parts += _factors("type 1", words, ring.without_norm(value))
    for k, leg in enumerate(ring.legs, 1):
        name = ring.rods.mechanism.joints[leg.rod.joint]
        for words, reach in leg.rod.type1(k, name, ring.rods.planar, ring.level):
            if reach is None:
                parts += _factors("type 1", words, ring.without_norm(leg.arm))
            else:
                # A circle, or its centre: real points, whatever its signs.
                parts.append(("type 1", words, leg.length(short_fraction(reach)), True))
    return _loci(ring, parts)


def _at_home(mechanism: Mechanism, ring: PoseRing, together: Any) -> Iterator[PoseLocus]:
    """The locus where the output is turned as at home, if that is not at all."""
    placed = ring.rods.placed(output_pose(mechanism, home(mechanism)))
    turned = np.abs(placed.rotation - np.eye(3)).max() > 1e-9
    if ring.drivers or turned:
        return
    gens = ring.ring.context.names()
    left = together.subs({gens[k]: int(n == "e0") for k, n in enumerate(ring.names) if n in TURNS})
    for kind, words, factor, _ in _factors("type 2", "with the output turned as at home", left):
        found = pose_equation(factor, ring.names, ring.odd, ring.square)
        yield PoseLocus(kind, words, found, has_real_points(found))
