"""Generic points of the common zeros of two polynomials, on random slices.

To know whether some component of V(p, g) is singular it is enough to look at generic points
of it: all joints but two are put at random values, the two that remain are solved for, and
the rank of the Jacobian is taken there. A component of codimension two meets such a slice for
some pair of joints, so that all pairs together meet every component.

All of this is done modulo a prime of 62 bits, where it is exact: the points have coordinates
in finite fields, and a rank is a rank. A verdict is wrong only if a random value happens to
be a root of one of the polynomials involved, which for degrees in the thousands has a chance
of about 1e-15 (Schwartz, 1980; Zippel, 1979).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpz_mod_poly_ctx, fq_default_ctx, fq_default_poly_ctx, nmod_poly

from pinsing.closed_form.columns import Matrix
from pinsing.closed_form.prime_field import (
    WORD_PRIME,
    image,
    modular_context,
    rank_over,
    residue,
)
from pinsing.closed_form.ring import Poly, Ring, Value

_ATTEMPTS = 4


class UndecidedSlice(Exception):
    """The points of a slice were not told apart."""


class Residues:
    """Images of a ring's polynomials modulo a prime, made once each."""

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self._images: dict[int, tuple[Poly, Any]] = {}

    def of(self, poly: Poly) -> Any:
        """The image of a polynomial."""
        if id(poly) not in self._images:  # the polynomial is kept, so that its id stays its own
            self._images[id(poly)] = (poly, image(poly, self.ring, WORD_PRIME))
        return self._images[id(poly)][1]


@dataclass(frozen=True, eq=False)
class SlicePoint:
    """One common zero on a slice (and all its conjugates).

    Attributes
    ----------
    residues : Residues
        Images of polynomials.
    fixed : mapping of str to int
        Variables at random values.
    field : fq_default_ctx
        The finite field of the coordinates.
    free : mapping of int to fq_default
        The variables that were solved for, by index.
    """

    residues: Residues
    fixed: Mapping[str, int]
    field: Any
    free: Mapping[int, Any]

    def value(self, poly: Poly) -> Any:
        """Value of a polynomial of the ring."""
        total = self.field.zero()
        if poly == 0:
            return total
        powers: dict[tuple[int, int], Any] = {}
        for monomial, c in self.residues.of(poly).subs(self.fixed).to_dict().items():
            term = self.field(int(c))
            for v, exponent in enumerate(monomial):
                if exponent:
                    key = v, int(exponent)
                    if key not in powers:
                        powers[key] = self.free[v] ** int(exponent)
                    term = term * powers[key]
            total = total + term
        return total

    def is_zero(self, poly: Poly) -> bool:
        """Whether a polynomial vanishes there."""
        return bool(self.value(poly).is_zero())

    def rank(self, matrix: Matrix) -> int:
        """Rank of a matrix of polynomials there."""
        return rank_over([[self.value(x) for x in row] for row in matrix])

    def transversal(self, polys: Sequence[Poly]) -> bool:
        """Whether zero sets cross there, rather than touch: their gradients are independent."""
        nvars = self.residues.ring.nvars
        slopes = [[self.value(p.derivative(v)) for v in range(nvars)] for p in polys]
        return rank_over(slopes) == len(polys)

    def has(self, joint: int, value: Value) -> bool:
        """Whether a joint is at a value there."""
        x, *y = (self._at(v) for v in self.residues.ring.variables(joint))
        wanted = [self.field(residue(c, WORD_PRIME)) for c in value]
        if not y:
            return bool(x == wanted[0])
        return bool((x * wanted[1] - y[0] * wanted[0]).is_zero())

    def _at(self, variable: int) -> Any:
        if variable in self.free:
            return self.free[variable]
        return self.field(self.fixed[self.residues.ring.context.names()[variable]])


def slice_points(
    p: Poly,
    g: Poly,
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
) -> Iterator[SlicePoint]:
    """Common zeros of p and g on a random slice for every pair of joints.

    Parameters
    ----------
    values : mapping of joint to Value
        Joints that are at fixed values already (and occur in neither polynomial).

    Raises
    ------
    UndecidedSlice
        If the points of a slice cannot be told apart, whatever the slice.
    """
    ring = residues.ring
    of_p, of_g = set(ring.joints_of(p)), set(ring.joints_of(g))
    for pair in itertools.combinations(sorted(of_p | of_g), 2):
        if not (of_p.intersection(pair) and of_g.intersection(pair)):
            continue  # one of the two is a constant on this slice
        for _ in range(_ATTEMPTS):
            points = _points_on(p, g, pair, residues, rng, values)
            if points is not None:
                yield from points
                break
        else:
            raise UndecidedSlice


def _points_on(
    p: Poly,
    g: Poly,
    pair: tuple[int, int],
    residues: Residues,
    rng: np.random.Generator,
    values: Mapping[int, Value],
) -> list[SlicePoint] | None:
    """Common zeros in two joints, the others at random values; None if that went wrong.

    The first joint's chart is sheared by the second's, so that no two points have the same
    first coordinate; its values are the roots of a resultant.
    """
    ring = residues.ring
    names = ring.context.names()
    fixed: dict[str, int] = {}
    for j in range(len(ring.prismatic)):
        if j not in pair:
            known = values.get(j)
            for k, v in enumerate(ring.variables(j)):
                fixed[names[v]] = residue(known[k], WORD_PRIME) if known else _random(rng)
    plane = modular_context(("t", "u"), WORD_PRIME)
    t, u = plane.gens()
    shear = _random(rng)
    charts = {pair[0]: t + shear * u, pair[1]: u}
    turn = {j: (_random(rng), _random(rng)) for j in pair}

    def coordinates(j: int, chart: Any) -> list[Any]:
        a, b = turn[j]
        return [chart] if ring.prismatic[j] else [a - b * chart, b + a * chart]

    images = [plane.constant(fixed.get(name, 0)) for name in names[: ring.nvars]]
    for j in pair:
        for v, x in zip(ring.variables(j), coordinates(j, charts[j]), strict=True):
            images[v] = x
    P, G = (residues.of(f).compose(*images, ctx=plane) for f in (p, g))
    eliminant = P.resultant(G, "u")
    if eliminant == 0:
        return None
    points = []
    for factor in _univariate(eliminant).factor()[1]:
        found = _solve(P, G, factor[0])
        if found is None:
            return None
        field, first, second = found
        at = {pair[0]: first + field(shear) * second, pair[1]: second}
        free = {
            v: x
            for j in pair
            for v, x in zip(ring.variables(j), coordinates(j, at[j]), strict=True)
        }
        squares = [
            free[ring.variables(j)[0]] ** 2 + free[ring.variables(j)[1]] ** 2
            for j in pair
            if not ring.prismatic[j]
        ]
        if not any(s.is_zero() for s in squares):  # else no angle is meant
            points.append(SlicePoint(residues, fixed, field, free))
    return points


def _solve(P: Any, G: Any, factor: Any) -> tuple[Any, Any, Any] | None:
    """Field of the roots of an irreducible factor of the resultant, and (t, u) in it."""
    modulus = _POLYNOMIALS([int(c) for c in factor.coeffs()])
    field = fq_default_ctx(
        modulus=modulus, fq_type="FQ_NMOD", check_prime=False, check_modulus=False
    )
    if factor.degree() == 1:
        root = field(int(-factor[0] / factor[1]))
    else:
        root = field([0, 1])
    over = fq_default_poly_ctx(field)
    rows = []
    for poly in (P, G):
        columns: dict[int, list[tuple[int, int]]] = {}
        for (i, k), c in poly.to_dict().items():
            columns.setdefault(int(k), []).append((int(i), int(c)))
        top = max(columns, default=0)
        powers = _powers(root, max((i for c in columns.values() for i, _ in c), default=0))
        rows.append(
            over(
                [
                    sum((field(c) * powers[i] for i, c in columns.get(k, [])), field.zero())
                    for k in range(top + 1)
                ]
            )
        )
    common = rows[0].gcd(rows[1])
    common = common.radical() if common.degree() > 0 else common
    if common.degree() != 1:
        return None
    second = -common[0] * common[1].inverse()
    return field, root, second


def _powers(x: Any, top: int) -> list[Any]:
    out = [x**0]
    for _ in range(top):
        out.append(out[-1] * x)
    return out


def _univariate(poly: Any) -> Any:
    """A polynomial in t alone, as flint's univariate kind."""
    coefficients = {int(m[0]): int(c) for m, c in poly.to_dict().items()}
    dense = [coefficients.get(i, 0) for i in range(max(coefficients) + 1)]
    return nmod_poly(dense, WORD_PRIME)


def _random(rng: np.random.Generator) -> int:
    return int(rng.integers(1, WORD_PRIME))


_POLYNOMIALS = fmpz_mod_poly_ctx(WORD_PRIME)
