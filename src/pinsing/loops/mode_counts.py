"""How many modes there are, by algebra.

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
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from flint import Ordering, fmpq_mpoly_ctx, fmpq_poly

from pinsing.algebra.ring import Poly, divided_by, fraction, rational
from pinsing.loops.exact import exact_points
from pinsing.loops.forms import PoseEquation, pose_equation
from pinsing.loops.legs import Rod, Rods, carried, inside, rods, sphere_rods
from pinsing.loops.motion import home
from pinsing.loops.structure import (
    PLANE,
    Centre,
    NotThisKind,
    at_zero,
    bodies,
    output_pose,
    plane_axes,
    position_in,
    structure,
)
from pinsing.measures import ROUNDING, SEED, Array
from pinsing.robot.mechanism import Mechanism, Sample, closing, path_to
from pinsing.robot.source import kept

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
    poly, _ = _poses(t, plane[1::2], plane[::2], squares, exact.square, (1, 0))
    whole: Any = poly.discriminant("t") if int(poly.degrees()[0]) == 6 else 0
    if whole == 0:
        return ()
    names = tuple(length_name(mechanism, rod) for rod in found.rods)
    samples = _singular_squares(found)
    # Poses of one orientation that do not coincide are in the discriminant too.
    factors = (f for f, _ in whole.factor()[1] if any(_vanishes(f, at) for at in samples))
    stated = (pose_equation(f, ("t", *names)) for f in factors)
    # In the inputs, not in their squares, and without t.
    return tuple(replace(x, names=names, powers=2 * x.powers[:, 1:]) for x in stated)


def _singular_squares(found: Rods) -> list[Array]:
    """Squared lengths (3,), complex, at random singular poses of the platform."""
    rng = np.random.default_rng(SEED)
    out: list[Array] = []
    for _ in range(6):
        angle, y = rng.uniform(-np.pi, np.pi), rng.normal()
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = [R @ rod.outer[:2] for rod in found.rods]

        def lines(x: complex, turned: list[Array] = turned, y: float = y) -> Array:
            B, C = turned + np.array([x, y]), np.array([rod.inner[:2] for rod in found.rods])
            return np.column_stack([B - C, C[:, 0] * B[:, 1] - C[:, 1] * B[:, 0]])

        # Quadratic in x.
        at = np.array([-1.0, 0.0, 1.0])
        values = [np.linalg.det(lines(complex(x))) for x in at]
        for x in np.roots(np.polyfit(at, values, 2)):
            out.append((lines(complex(x))[:, :2] ** 2).sum(axis=1))
    return out


def _vanishes(factor: Poly, at: Array) -> bool:
    terms = [([int(e) for e in m][1:], fraction(c)) for m, c in factor.to_dict().items()]
    lead = max(abs(c) for _, c in terms)
    values = np.array([float(c / lead) * np.prod(at**powers) for powers, c in terms])
    return bool(abs(values.sum()) <= 1e-7 * np.abs(values).sum())


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
    pins, found, sphere = point_legs(mechanism), rods(mechanism), sphere_rods(mechanism)
    if pins is not None:
        return _solutions(pins, np.eye(3), np.asarray(pins.axes @ p))
    if found is not None:
        every = {0, 1, 5} if found.planar else set(range(6))
        shared = len({rod.joint for rod in found.rods}) < len(found.rods)
        whole = set(mechanism.task.rows) == every
        NotThisKind.refuse_if(found.tilted or found.hinged or shared or not whole)
        return _solutions(found, R, p)
    if sphere is None:
        raise NotThisKind
    return _solutions(sphere, R, np.zeros(3))


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
    U, sigma, Vt = np.linalg.svd(np.array(rows))
    NotThisKind.refuse_if(sigma[-1] <= 1e-9 * sigma[0])
    x = Vt[:3].T @ ((U.T @ np.array(right)) / sigma)
    v = Vt[3]
    # cos^2 + sin^2 = 1 along the line x + t v.
    a, b, c = v[2:] @ v[2:], 2 * x[2:] @ v[2:], x[2:] @ x[2:] - 1
    left = b * b - 4 * a * c
    NotThisKind.refuse_if(a <= ROUNDING or abs(left) <= ROUNDING)
    for root in () if left < 0 else (np.sqrt(left), -np.sqrt(left)):
        y = x + (root - b) / (2 * a) * v
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
    right = right + sizes[0] ** 2
    normal = np.cross(*rows)
    size = float(np.linalg.norm(normal))
    NotThisKind.refuse_if(size <= ROUNDING)
    x = np.linalg.lstsq(rows, right, rcond=None)[0] - centres[0]
    n = normal / size
    foot = x - (x @ n) * n
    left = float(sizes[0] ** 2 - foot @ foot)
    NotThisKind.refuse_if(abs(left) <= ROUNDING)
    return 2 * (left > 0)


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
