"""Real roots of polynomials in one joint.

What the real zeros of one irreducible polynomial are: a hypersurface, or less.

A polynomial that is positive somewhere and negative elsewhere has a hypersurface of real
zeros. One that is not has its real zeros where all derivatives vanish as well: often some
points only, such as the stretched arm in 0.3 cos q2 + 0.2 cos(q2+q3) + 0.5 = 0.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import Ordering, acb, arb, ctx, fmpq, fmpz_mat, fmpz_mpoly_ctx, fmpz_mpoly_vec, fmpz_poly

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import fourier
from pinsing.algebra.ring import Poly, Ring, Value, coefficients_by, line_of, terms_of, whole_terms
from pinsing.errors import Refusal
from pinsing.robot.surd import parts_of


@dataclass(frozen=True)
class AlgebraicValue:
    """A real algebraic number: a joint's half-angle tangent, or its metres."""

    ball: Any  # where it is; None is an infinite tangent, an angle of 180 degrees
    # coefficients of its minimal polynomial, the constant first; empty where it is infinite
    minimal: tuple[int, ...]

    def angle(self) -> float:
        """The angle in radians whose half has this tangent."""
        return math.pi if self.ball is None else float(2 * self.ball.atan())

    def exact(self, slides: bool) -> Value | None:
        """The same as a joint's value in the ring, where it is rational or infinite."""
        if self.ball is None:
            return Fraction(0), Fraction(1)
        if len(self.minimal) != 2:
            return None
        number = Fraction(-self.minimal[0], self.minimal[1])
        return (number,) if slides else (Fraction(1), number)


def real_roots(poly: Poly, joint: int, ring: Ring) -> list[AlgebraicValue]:
    """Return all distinct real values of a joint at which a polynomial in it alone is zero.

    The polynomial may be a product: a turning joint's infinite tangent, 180 degrees, is a root
    where its x divides.

    Roots of a polynomial with square roots in it are among those of its norm, the product of its
    images under all changes of the roots' signs; what is left of these is right when it is no more
    than the polynomial has complex roots.
    """
    first, last = ring.variables(joint)[0], ring.variables(joint)[-1]
    infinite = first != last and min(m[first] for m in poly.monoms()) > 0
    norm = poly
    for k in reversed(range(len(ring.roots))):
        parts = coefficients_by(norm, (ring.nvars + k,))
        if (1,) in parts:
            plain, times_root = parts.get((0,)) or ring.zero, parts[1,]
            norm = ring.reduce(plain * plain - ring.roots[k] * times_root * times_root)
    line = [f for f, _ in fmpz_poly(line_of(whole_terms(norm), last)).factor()[1]]

    def is_root(values: Sequence[acb]) -> bool:
        at = [acb(1)] * ring.nvars + [acb(d).sqrt() for d in ring.roots]
        at[last] = values[0]
        return bool(_value(poly, at).contains(0))

    met = _told_apart([line], is_root if ring.roots else bool, poly.degrees()[last])
    return [root for (root,) in met] + [AlgebraicValue(None, ())] * infinite


def _told_apart(
    lines: Sequence[Sequence[fmpz_poly]], is_zero: Callable[[Sequence[acb]], bool], count: int
) -> list[tuple[AlgebraicValue, ...]]:
    """Real ones of the ``count`` zeros, of which each coordinate is a root of one of its factors.

    Ball arithmetic throws out what is none, with ever smaller balls till no more are left.
    """
    for bits in (400, 1_600, 6_400):
        with ctx.workprec(bits):
            roots = [[(acb(z), f) for f in line for z, _ in f.complex_roots()] for line in lines]
            met = [c for c in itertools.product(*roots) if is_zero([z for z, _ in c])]
            if len(met) <= count:
                return [
                    tuple(AlgebraicValue(arb(z.real), tuple(map(int, f.coeffs()))) for z, f in c)
                    for c in met
                    if all(z.imag == 0 for z, _ in c)
                ]
    raise NotFinite("roots were not told apart")


_SHORT = (2, 60, 16)
"""Joints, terms and product of degrees of a system that is solved at once, whatever its numbers."""


class NotFinite(Refusal):
    """The solutions are not finitely many, or too many to be told apart here."""


Solution = Mapping[int, AlgebraicValue]
"""Values of all joints of a system."""


def real_solutions(polys: Sequence[Poly], ring: Ring, time: Budget) -> list[Solution]:
    """Return all real common zeros of polynomials with finitely many, or raise NotFinite."""
    # Those of short systems are found however late it is: an answer must not depend on the load of
    # a machine where it costs nothing.
    joints = sorted({j for p in polys for j in ring.joints_of(p)})
    terms = [m for p in polys for m in p.monoms()]
    degrees = (max(sum(int(m[v]) for v in ring.variables(j)) for m in terms) for j in joints)
    small = len(joints) <= _SHORT[0] and len(terms) <= _SHORT[1]
    if small and math.prod(degrees) <= _SHORT[2]:
        time = Budget(math.inf)
    return _solve(list(polys), joints, ring, time)


def _solve(polys: list[Poly], joints: list[int], ring: Ring, time: Budget) -> list[Solution]:
    """Solutions with finite tangents, and those where one tangent is infinite or more."""
    polys = [p for p in polys if p != 0]
    if any(ring.is_constant(p) for p in polys):
        return []
    if not joints:
        return [{}]
    out = _finite(polys, joints, ring, time)
    for k, j in enumerate(joints):
        if ring.prismatic[j]:
            continue
        x, y = (ring.context.names()[v] for v in ring.variables(j))
        there = [p.subs({x: 0, y: 1}) for p in polys]
        rest = [i for i in joints if i != j]
        NotFinite.refuse_if(all(p == 0 for p in there) and rest)
        for s in _solve(there, rest, ring, time):
            if all(s[i].ball is not None for i in joints[:k]):  # else it was met before
                out.append({**s, j: AlgebraicValue(None, ())})
    return out


def _finite(polys: list[Poly], joints: list[int], ring: Ring, time: Budget) -> list[Solution]:
    """Solutions in half-angle tangents (and metres), square roots as variables more."""
    every, n = ring.context.names(), len(joints)
    names = [every[ring.variables(j)[-1]] for j in joints] + list(every[ring.nvars :])
    context, whole = (fmpz_mpoly_ctx.get(list(x), Ordering.lex) for x in (names, every))
    one = {every[ring.start[j]]: 1 for j in joints if not ring.prismatic[j]}
    affine = [whole.from_dict(whole_terms(p.subs(one))) for p in polys]
    system = [p.project_to_context(context) for p in affine]
    system += [s * s - d for s, d in zip(context.gens()[n:], ring.roots, strict=True)]
    lines = []
    for name in names:
        order = [x for x in names if x != name]
        line = _eliminant(_basis(system, [*order, name], time))
        if name in names[:n]:  # x^2 + y^2 is nowhere zero
            line = [f for f in line if f != fmpz_poly([1, 0, 1])]
        if not line:
            return []
        lines.append(line)
    degrees = [sum(f.degree() for f in line) for line in lines]
    # Combinations of roots that are tried.
    NotFinite.refuse_if(math.prod(degrees) > 4_096)
    eliminants = [
        sum(int(c) * x**k for k, c in enumerate(math.prod(line, start=fmpz_poly([1])).coeffs()))
        for x, line in zip(context.gens(), lines, strict=True)
    ]
    basis = _basis([*system, *eliminants], names, time)
    count = _standard_monomials(basis, degrees)

    def is_zero(values: Sequence[acb]) -> bool:
        time.check()
        return all(_value(p, values).contains(0) for p in system)

    met = _told_apart(lines, is_zero, count)
    return [
        dict(zip(joints, values, strict=False))
        for values in met
        if all(root.ball > 0 for root in values[n:])
    ]


def _basis(polys: Sequence[Any], names: Sequence[str], time: Budget) -> list[Any]:
    """Groebner basis, lexicographic, with the variables in this order."""
    time.check()
    context = fmpz_mpoly_ctx.get(list(names), Ordering.lex)
    given = fmpz_mpoly_vec([p.project_to_context(context) for p in polys], context)
    # Of a Groebner basis: polynomials, terms, bits of coefficients.
    basis, done = given.buchberger_naive(limits=(120, 400, 20_000))
    NotFinite.refuse_if(not done)
    return list(fmpz_mpoly_vec(list(basis), context).autoreduction(groebner=True))


def _eliminant(basis: Sequence[Any]) -> list[fmpz_poly]:
    """Factors whose roots the last variable has; none if there is no solution."""
    for p in basis:
        if p.is_constant():
            return []
        if not any(p.degrees()[:-1]):
            return [f for f, _ in fmpz_poly(line_of(terms_of(p), -1)).factor()[1]]
    raise NotFinite


def _value(poly: Any, at: Sequence[acb]) -> acb:
    """Value of a polynomial, a ball."""
    total = acb(0)
    for powers, c in terms_of(poly).items():
        factors = (x ** int(e) for x, e in zip(at, powers, strict=True) if e)
        total += math.prod(factors, start=acb(c))
    return total


def _standard_monomials(basis: Sequence[Any], bounds: Sequence[int]) -> int:
    """Monomials that no leading monomial of a Groebner basis divides."""
    leads = [tuple(int(e) for e in p.monomial(0)) for p in basis]
    return sum(
        not any(all(a <= b for a, b in zip(lead, m, strict=True)) for lead in leads)
        for m in itertools.product(*(range(b) for b in bounds))
    )


def changes_sign(poly: Poly, ring: Ring) -> bool:
    """Return True if a polynomial takes both signs, shown by its values at rational points."""
    # One of odd degree in some revolute joint does: a whole turn changes its sign.
    lead = poly.monomial(0)  # it is homogeneous in both variables of a joint
    if any(
        (lead[s] + lead[s + 1]) % 2
        for s, slides in zip(ring.start, ring.prismatic, strict=True)
        if not slides
    ):
        return True
    rng = np.random.default_rng(3)
    points = (rng.integers(-9, 10, ring.nvars).tolist() for _ in range(256))
    signs = (sign for at in points if (sign := _sign(poly, at, ring)))
    first = next(signs, 0)
    return -first in signs


def _sign(poly: Poly, point: Sequence[int], ring: Ring) -> int:
    """Sign of the value at a point, 0 where it is not told from zero."""
    if ring.rational:
        value = poly(*map(fmpq, point))
    else:
        value = _value(poly, [*map(acb, point), *(acb(d).sqrt() for d in ring.roots)]).real
    return int(value > 0) - int(value < 0)


def isolated_zeros(poly: Poly, ring: Ring, time: Budget) -> list[Solution] | None:
    """Return all real zeros of a polynomial proven not to change its sign; else None."""
    # NotFinite if these are not isolated.
    if not ring.rational or any(ring.prismatic[j] for j in ring.joints_of(poly)):
        return None
    if (touching := _touching(poly, ring)) is not None:
        return touching
    if not semidefinite(poly, ring, time):
        return None
    used = [v for j in ring.joints_of(poly) for v in ring.variables(j)]
    slopes = [poly.derivative(v) for v in used]
    found = real_solutions([poly, *(s for s in slopes if s != 0)], ring, time)
    NotFinite.refuse_if(any(len(s) < len(ring.joints_of(poly)) for s in found))
    return found


def semidefinite(poly: Poly, ring: Ring, time: Budget) -> bool:
    """Return True if it is proven that a polynomial over the rationals never changes its sign.

    Factors of odd multiplicity must not. One in a single joint has no real root then; one of degree
    two in a joint, A x^2 + B x y + C y^2, has a discriminant B^2 - 4 A C that is nowhere positive.
    Nor does a sum of cosines and sines whose constant is no less than all the rest.
    """
    for f, multiplicity in poly.factor()[1]:
        time.check()
        joints = ring.joints_of(f)
        if multiplicity % 2 == 0 or not joints or _outweighed(f, ring):
            continue
        keeps_sign = not real_roots(f, joints[0], ring) if len(joints) == 1 else any(
            sum(f.monomial(0)[v] for v in ring.variables(j)) == 2
            and _never_positive(_discriminant(f, j, ring), ring, time)
            for j in joints
        )  # fmt: skip
        if not keeps_sign:
            return False
    return True


_QUARTERS = [*(AlgebraicValue(arb(t), (-t, 1)) for t in (-1, 0, 1)), AlgebraicValue(None, ())]
"""Half-angle tangents of the right angles from -90 to 180 degrees."""


def _waves(
    poly: Poly, ring: Ring
) -> tuple[Fraction, dict[tuple[int, ...], tuple[Fraction, Fraction]]]:
    """The constant, and by frequency what cosine and sine have; over the rationals, no slides."""
    every = fourier(poly, ring, [0] * len(ring.prismatic))
    waves = {f: (parts_of(cos)[0], parts_of(sin)[0]) for (f, _), (cos, sin) in every.items()}
    constant, _ = waves.pop((0,) * len(ring.prismatic), (Fraction(0), 0))
    return constant, waves


def _touching(poly: Poly, ring: Ring) -> list[Solution] | None:
    """Return the one real zero where all terms together just reach the constant; else None."""
    # Each cosine or sine is 1 or -1: linear equations modulo whole turns. With a minor of 1 they
    # have one solution, of right angles.
    joints, (constant, waves) = ring.joints_of(poly), _waves(poly, ring)
    if any(k % 2 for f in waves for k in f) or any(c and s for c, s in waves.values()):
        return None
    others = sum(abs(c + s) for c, s in waves.values())
    if constant == 0 or abs(constant) != others or len(joints) > 6:
        return None
    rows = [[f[j] // 2 for j in joints] for f in waves]
    minors = itertools.combinations(rows, len(joints))
    if not any(abs(int(fmpz_mat([*map(list, m)]).det())) == 1 for m in minors):
        return None
    # Right angles that each term's phase is.
    sizes = waves.values()
    wanted = [(0 if c else 1) + (0 if (c + s) * constant < 0 else 2) for c, s in sizes]
    return [
        dict(zip(joints, (_QUARTERS[k + 1] for k in turns), strict=True))
        for turns in itertools.product(range(-1, 3), repeat=len(joints))
        if all(
            (sum(a * k for a, k in zip(row, turns, strict=True)) - w) % 4 == 0
            for row, w in zip(rows, wanted, strict=True)
        )
    ]


def _outweighed(poly: Poly, ring: Ring) -> bool:
    """Return True if the constant term is as large as all others can be together, exactly."""
    if any(ring.prismatic[j] for j in ring.joints_of(poly)):
        return False
    constant, waves = _waves(poly, ring)
    left, roots = abs(constant), arb(0)
    for c, s in waves.values():
        if c == 0 or s == 0:
            left -= abs(c + s)
        else:
            square = c * c + s * s
            roots += (arb(square.numerator) / arb(square.denominator)).sqrt()
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
