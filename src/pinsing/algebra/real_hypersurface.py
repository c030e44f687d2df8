"""What the real zeros of one irreducible polynomial are: a hypersurface, or less.

A polynomial that is positive somewhere and negative elsewhere has a hypersurface of real
zeros. One that is not has its real zeros where all derivatives vanish as well: often some
points only, such as the stretched arm in 0.3 cos q2 + 0.2 cos(q2+q3) + 0.5 = 0.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from flint import arb, fmpq, fmpz_mat

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import fourier
from pinsing.algebra.real_roots import (
    AlgebraicValue,
    NotFinite,
    Solution,
    real_roots,
    real_solutions,
)
from pinsing.algebra.ring import Poly, Ring, coefficients_by
from pinsing.robot.surd import Surd, parts_of


def changes_sign(poly: Poly, ring: Ring) -> bool:
    """Whether a polynomial takes both signs, shown by its values at rational points.

    One of odd degree in some revolute joint does: a whole turn changes its sign.
    """
    lead = poly.monomial(0)  # it is homogeneous in both variables of a joint
    if any(
        (lead[s] + lead[s + 1]) % 2
        for s, slides in zip(ring.start, ring.prismatic, strict=True)
        if not slides
    ):
        return True
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(256):
        seen.add(_sign(poly, [int(k) for k in rng.integers(-9, 10, ring.nvars)], ring))
        if {1, -1} <= seen:
            return True
    return False


def _sign(poly: Poly, point: Sequence[int], ring: Ring) -> int:
    """Sign of the value at a point, 0 where it is not told from zero."""
    if ring.rational:
        value = poly(*(fmpq(x) for x in point))
        return int(value > 0) - int(value < 0)
    total: Fraction | Surd = Fraction(0)
    size = 0.0
    for m, c in ring.terms(poly).items():
        factor = 1
        for x, e in zip(point, m, strict=True):
            factor *= x**e
        total = total + c * factor
        size += sum(abs(float(p)) for p in parts_of(c)) * 2.5 * abs(factor)
    value = float(total)
    # A value with square roots counts as positive from this share of its terms on.
    return 0 if abs(value) <= 1e-6 * size else (1 if value > 0 else -1)


def _degree(poly: Poly, joint: int, ring: Ring) -> int:
    """Degree in both variables of a joint, in which the polynomial is homogeneous."""
    m = poly.monomial(0)
    return sum(int(m[v]) for v in ring.variables(joint))


def isolated_zeros(poly: Poly, ring: Ring, time: Budget) -> list[Solution] | None:
    """All real zeros of a polynomial that is proven not to change its sign; else None.

    Raises
    ------
    NotFinite
        If these are not isolated.
    """
    if not ring.rational or any(ring.prismatic[j] for j in ring.joints_of(poly)):
        return None
    if (touching := _touching(poly, ring)) is not None:
        return touching
    if not semidefinite(poly, ring, time):
        return None
    used = [v for j in ring.joints_of(poly) for v in ring.variables(j)]
    slopes = [poly.derivative(v) for v in used]
    found = real_solutions([poly, *(s for s in slopes if s != 0)], ring, time)
    if any(len(s) < len(ring.joints_of(poly)) for s in found):
        raise NotFinite
    return found


def semidefinite(poly: Poly, ring: Ring, time: Budget) -> bool:
    """Whether it is proven that a polynomial over the rationals never changes its sign.

    Factors of odd multiplicity must not. One in a single joint has no real root then; one of
    degree two in a joint, A x^2 + B x y + C y^2, has a discriminant B^2 - 4 A C that is nowhere
    positive. Nor does a sum of cosines and sines whose constant is no less than all the rest.
    """
    for f, multiplicity in poly.factor()[1]:
        time.check()
        joints = ring.joints_of(f)
        if multiplicity % 2 == 0 or not joints or _outweighed(f, ring):
            continue
        if len(joints) == 1:
            if real_roots(f, joints[0], ring):
                return False
            continue
        if not any(
            _degree(f, j, ring) == 2 and _never_positive(_discriminant(f, j, ring), ring, time)
            for j in joints
        ):
            return False
    return True


_QUARTERS = {
    0: AlgebraicValue(arb(0), (0, 1)),
    1: AlgebraicValue(arb(1), (-1, 1)),
    2: AlgebraicValue(None, ()),
    3: AlgebraicValue(arb(-1), (1, 1)),
}
"""Half-angle tangents of right angles."""


def _touching(poly: Poly, ring: Ring) -> list[Solution] | None:
    """The one real zero where all terms together just reach the constant; else None.

    There each cosine or sine is 1 or -1: linear equations modulo whole turns. With a minor of 1
    they have one solution, which is made of right angles.
    """
    joints = ring.joints_of(poly)
    constant, others = Fraction(0), Fraction(0)
    rows: list[tuple[list[int], Fraction, Fraction]] = []
    for (frequency, _), (cos, sin) in fourier(poly, ring, [0] * len(ring.prismatic)).items():
        c, s = parts_of(cos)[0], parts_of(sin)[0]
        if not any(frequency):
            constant = c
            continue
        if any(k % 2 for k in frequency) or (c and s):
            return None
        others += abs(c + s)
        rows.append(([frequency[j] // 2 for j in joints], c, s))
    if constant == 0 or abs(constant) != others or len(joints) > 6:
        return None
    minors = itertools.combinations([row for row, _, _ in rows], len(joints))
    if not any(abs(int(fmpz_mat([*map(list, m)]).det())) == 1 for m in minors):
        return None
    wanted = []  # right angles that each term's phase is
    for _, c, s in rows:
        up = (c + s) * constant < 0
        wanted.append((0 if up else 2) if c else (1 if up else 3))
    return [
        dict(zip(joints, (_QUARTERS[k] for k in turns), strict=True))
        for turns in itertools.product(range(4), repeat=len(joints))
        if all(
            (sum(a * k for a, k in zip(row, turns, strict=True)) - w) % 4 == 0
            for (row, _, _), w in zip(rows, wanted, strict=True)
        )
    ]


def _outweighed(poly: Poly, ring: Ring) -> bool:
    """Whether the constant term is as large as all others can be together, exactly."""
    if any(ring.prismatic[j] for j in ring.joints_of(poly)):
        return False
    constant, others, roots = Fraction(0), Fraction(0), arb(0)
    for (frequency, _), (cos, sin) in fourier(poly, ring, [0] * len(ring.prismatic)).items():
        c, s = parts_of(cos)[0], parts_of(sin)[0]
        if not any(frequency):
            constant = abs(c)
        elif c == 0 or s == 0:
            others += abs(c + s)
        else:
            square = c * c + s * s
            roots += (arb(square.numerator) / arb(square.denominator)).sqrt()
    left = constant - others
    if roots == 0:
        return left >= 0
    return left > 0 and bool(arb(left.numerator) / arb(left.denominator) > roots)


def _never_positive(poly: Poly, ring: Ring, time: Budget) -> bool:
    if poly == 0:
        return True
    signs = {
        _sign(poly, point, ring)
        for point in itertools.islice(itertools.product((1, 2, -3), repeat=ring.nvars), 40)
    }
    return 1 not in signs and -1 in signs and semidefinite(poly, ring, time)


def _discriminant(poly: Poly, joint: int, ring: Ring) -> Poly:
    x, y = ring.variables(joint)
    parts = coefficients_by(poly, (x, y))
    a, b, c = (parts.get((2 - k, k), 0 * poly) for k in (0, 1, 2))
    return b * b - 4 * a * c
