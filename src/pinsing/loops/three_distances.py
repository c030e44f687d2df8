"""Three distances of a body in a plane: the polynomial of its poses, and inputs where two meet.

A body with three points at given distances from three given ones has at most six poses: with one
of the points as origin two of the three equations are linear in the position, and what is left is
of degree 6 in the tangent of half the angle. After Gosselin and Sefrioui, "Polynomial solutions for
the direct kinematic problem of planar three-degree-of-freedom parallel manipulators" (1991). Two
poses meet, at a type 2 singularity, where its discriminant in the angle is zero.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from flint import Ordering, fmpq_mpoly_ctx, fmpq_poly

from pinsing._types import Array
from pinsing.algebra.ring import Poly, divided_by, fraction, rational
from pinsing.loops.exact import ExactPoints, exact_points
from pinsing.loops.forms import PoseEquation, pose_equation
from pinsing.loops.legs import Rod, Rods, rods
from pinsing.robot.mechanism import Mechanism

_SEED = 5077
Point = tuple[Any, Any]


def planar_rods(mechanism: Mechanism) -> Rods | None:
    """The three forces of a planar mechanism; None for another one."""
    found = rods(mechanism)
    if found is None or not found.planar or len(found.rods) != 3:
        return None
    return None if any(rod.kind in ("elbow", "foot") for rod in found.rods) else found


def count_poses(mechanism: Mechanism, inputs: Array) -> int | None:
    """How many real poses given inputs (n_a,) have, by algebra; None where it does not tell."""
    found = planar_rods(mechanism)
    if found is None:
        return None
    context = fmpq_mpoly_ctx.get(["t"], Ordering.lex)
    at = dict(zip(mechanism.actuated, inputs.tolist(), strict=True))
    inner: list[Point] = []
    squares: list[Any] = []
    for rod in found.rods:
        value = np.array([at[rod.joint]])
        (C,) = rod.foot(value)
        distance = rod.distance(value, found.length(rod))
        assert distance is not None  # such rods are left out
        length = float(distance[0])
        inner.append(tuple(context.constant(rational(Fraction(v))) for v in C[:2].tolist()))
        squares.append(context.constant(rational(Fraction(length) ** 2)))
    outer = [tuple(context.constant(rational(Fraction(v))) for v in r.outer[:2].tolist())
             for r in found.rods]  # fmt: skip
    # The angle is counted from a rational turn: a pose half a turn from it has no t.
    for turn in ((1, 0), (Fraction(4, 5), Fraction(3, 5)), (Fraction(5, 13), Fraction(12, 13))):
        poly, denominator = _poses(context, inner, outer, squares, 1, turn)
        line, common = _univariate(poly), _univariate(denominator)
        if line.degree() == 6:
            break
    else:
        return None
    if line.gcd(common).degree() > 0 or line.gcd(line.derivative()).degree() > 0:
        # Two poses with one orientation, or two that coincide.
        return None
    return sum(bool(root.imag == 0) for root, _ in line.numer().complex_roots())


def input_loci(mechanism: Mechanism) -> tuple[PoseEquation, ...]:
    """Type 2 over the inputs, where these are the three distances: exact; empty elsewhere.

    The variables are the inputs, or, where a slide is not zero at no length, the length of its leg
    by its input, "(p1 + 0.5)". A point on it has two poses that meet, real or complex ones.
    """
    found = planar_rods(mechanism)
    if found is None or not all(r.kind == "strut" for r in found.rods):
        return ()
    return mechanism.once("input_loci", lambda: _input_loci(mechanism, found))


def input_degrees(mechanism: Mechanism) -> dict[str, int]:
    """Degrees of type 2 in the tangent of half of each crank's angle, the other inputs fixed.

    Empty for legs of other kinds, or where it is not told.
    """
    found = planar_rods(mechanism)
    if found is None or not all(r.kind == "crank" for r in found.rods):
        return {}
    return mechanism.once("input_degrees", lambda: _degrees(mechanism, found))


def degree_notes(mechanism: Mechanism) -> Iterator[str]:
    """The same in words, and why a locus over three distances is left out."""
    slid = planar_rods(mechanism)
    if slid is not None and all(r.kind == "strut" for r in slid.rods) and not input_loci(mechanism):
        yield (
            "the inputs alone: eliminating the pose leaves a polynomial, in general of degree 12 "
            "in the squares of the inputs; not written out where coordinates have more than five "
            "decimals"
        )
    found = input_degrees(mechanism)
    if not found:
        return
    each = ", ".join(f"{d} in tan({n}/2)" for n, d in found.items())
    most = math.prod(d + 1 for d in found.values())
    yield (
        f"the inputs alone: eliminating the pose leaves a polynomial of up to {most} terms, of "
        f"degree up to {each} (counted exactly, lengths rounded to simple fractions); not written "
        "out"
    )


def length_name(mechanism: Mechanism, rod: Rod, digits: int = 12) -> str:
    """The length of a rod that slides, by the value of its slide."""
    name = mechanism.joints[rod.sliding]
    if rod.offset == 0:
        return name
    return f"({name} {'+' if rod.offset > 0 else '-'} {abs(rod.offset):.{digits}g})"


def _poses(
    context: Any,
    inner: Sequence[Point],
    outer: Sequence[Point],
    squares: Sequence[Any],
    square: int,
    turn: tuple[Any, Any],
) -> tuple[Poly, Poly]:
    """The polynomial in t of all poses, and what divides the position.

    The angle is 2 atan(sqrt(square) t), counted from that whose cosine and sine are ``turn``; y is
    in units of sqrt(square).
    """
    t = context.gens()[0]
    n, c0, s0 = 1 + square * t**2, 1 - square * t**2, 2 * t
    # For a square of 3 the turn is none: its sine is over the root.
    a, b = (rational(Fraction(v)) for v in turn)
    c, s = a * c0 - square * b * s0, a * s0 + b * c0
    away = []
    for k in (1, 2):
        bx, by = (outer[k][i] - outer[0][i] for i in range(2))
        ex, ey = (inner[k][i] - inner[0][i] for i in range(2))
        away.append((c * bx - square * s * by - n * ex, s * bx + c * by - n * ey))
    right = []
    for k, (x, y) in enumerate(away, 1):
        size, _ = divmod(x**2 + square * y**2, n)
        right.append(n * (squares[k] - squares[0]) - size)
    below = away[0][0] * away[1][1] - away[0][1] * away[1][0]
    # 2 w . d = right, for both: w = (wx, wy / sqrt(square)) over 2 square below and 2 below.
    wx = right[0] * away[1][1] - right[1] * away[0][1]
    wy = away[0][0] * right[1] - away[1][0] * right[0]
    poly = square * wx**2 + wy**2 - 4 * square * squares[0] * below**2
    return divided_by(poly, n), below


def _univariate(poly: Poly) -> fmpq_poly:
    terms = {int(m[0]): c for m, c in poly.to_dict().items()}
    return fmpq_poly([terms.get(k, 0) for k in range(max(terms, default=0) + 1)])


def _input_loci(mechanism: Mechanism, found: Rods) -> tuple[PoseEquation, ...]:
    points = [p for rod in found.rods for p in (rod.outer, rod.inner)]
    exact = exact_points(points)
    if not _written_short(exact):
        return ()
    context = fmpq_mpoly_ctx.get(["t", "r0", "r1", "r2"], Ordering.degrevlex)
    plane = [tuple(context.constant(rational(v)) for v in p[:2]) for p in exact.vectors]
    squares = list(context.gens()[1:])
    poly, _ = _poses(context, plane[1::2], plane[::2], squares, exact.square, (1, 0))
    if int(poly.degrees()[0]) < 6:
        return ()
    whole = poly.discriminant("t")
    if whole == 0:
        return ()
    samples = _singular_squares(found)
    names = tuple(length_name(mechanism, rod) for rod in found.rods)
    kept = []
    for factor, _ in whole.factor()[1]:
        # Poses of one orientation that do not coincide are in the discriminant too.
        if any(_vanishes(factor, at) for at in samples):
            kept.append(_in_inputs(factor, names))
    return tuple(kept)


def _written_short(exact: ExactPoints) -> bool:
    """Whether the coefficients stay of a length that is found in seconds."""
    return max(v.denominator for p in exact.vectors for v in p[:2]) <= (10**5)


def _singular_squares(found: Rods) -> list[Array]:
    """Squared lengths (3,), complex, at random singular poses of the platform."""
    rng = np.random.default_rng(_SEED)
    out: list[Array] = []
    for _ in range(6):
        angle, y = rng.uniform(-np.pi, np.pi), rng.normal()
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = [R @ rod.outer[:2] for rod in found.rods]

        def lines(x: complex, turned: list[Array] = turned, y: float = y) -> Array:
            rows = []
            for b, rod in zip(turned, found.rods, strict=True):
                B, C = b + np.array([x, y]), rod.inner[:2]
                rows.append([*(B - C), C[0] * B[1] - C[1] * B[0]])
            return np.array(rows)

        # Quadratic in x.
        at = np.array([-1.0, 0.0, 1.0])
        values = [np.linalg.det(lines(complex(x))) for x in at]
        for x in np.roots(np.polyfit(at, values, 2)):
            rows = lines(complex(x))
            out.append((rows[:, :2] ** 2).sum(axis=1))
    return out


def _vanishes(factor: Poly, at: Array) -> bool:
    total, size = 0j, 0.0
    terms = {m: fraction(c) for m, c in factor.to_dict().items()}
    lead = max(terms.values(), key=abs)
    for monomial, c in terms.items():
        term = complex(float(c / lead))
        for value, power in zip(at, tuple(monomial)[1:], strict=True):
            term *= complex(value) ** int(power)
        total, size = total + term, size + abs(term)
    return abs(total) <= 1e-7 * size


def _in_inputs(factor: Poly, names: tuple[str, ...]) -> PoseEquation:
    """A polynomial in squared inputs as one in the inputs, its largest coefficient 1."""
    found = pose_equation(factor, ("t", *names))
    return replace(found, names=names, powers=2 * found.powers[:, 1:])


def _degrees(mechanism: Mechanism, found: Rods) -> dict[str, int]:
    """Each input in turn is free, the others are at random rational points of their circles."""
    context = fmpq_mpoly_ctx.get(["t", "u"], Ordering.degrevlex)
    u = context.gens()[1]
    rng = np.random.default_rng(_SEED)
    lengths = [Fraction(found.length(r)).limit_denominator(1000) for r in found.rods]
    degrees = []
    for moving in range(3):
        inner: list[Point] = []
        below = []
        for k, rod in enumerate(found.rods):
            h = u if k == moving else context.constant(int(rng.integers(2, 9)))
            n, c, s = 1 + h**2, 1 - h**2, 2 * h
            inner.append(
                tuple(
                    n * _simple(at) + c * _simple(first) + s * _simple(second)
                    for at, first, second in zip(
                        rod.inner[:2], rod.first[:2], rod.second[:2], strict=True
                    )
                )
            )
            below.append(n)
        # All lengths times the product of the denominators.
        whole = functools.reduce(lambda a, b: a * b, below)
        grown = [tuple(v * (whole / n) for v in p) for p, n in zip(inner, below, strict=True)]
        outer = [tuple(whole * _simple(v) for v in r.outer[:2]) for r in found.rods]
        squares = [whole**2 * rational(x**2) for x in lengths]
        poly, _ = _poses(context, grown, outer, squares, 1, (1, 0))
        poly = functools.reduce(
            lambda a, b: a * b,
            (f for f, _ in poly.factor()[1] if int(f.degrees()[0]) > 0),
            context.constant(1),
        )
        if int(poly.degrees()[0]) != 6:
            return {}
        parts = poly.discriminant("t").factor()[1]
        # Squared parts are poses of one orientation that do not coincide, and 1 + u^2.
        degrees.append(sum(int(f.degrees()[1]) for f, times in parts if times % 2))
    names = (mechanism.joints[rod.joint] for rod in found.rods)
    return dict(zip(names, degrees, strict=True))


def _simple(value: float) -> Any:
    return rational(Fraction(float(value)).limit_denominator(1000))
