"""Generic points of the common zeros of two polynomials, on random slices.

To know whether some component of V(p, g) is singular it is enough to look at points on
it: all joints but two are put at random rational values, the two that remain are solved
for exactly enough, and the rank of the Jacobian is taken there. A component of
codimension two meets such a slice for some pair of joints, so that all pairs together
meet every component.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from flint import fmpz_poly

from pinsing.closed_form.columns import Matrix
from pinsing.closed_form.ring import Poly, Ring, Value, fraction, rational

ComplexArray = npt.NDArray[np.complex128]
_SINGULAR = 1e-7
_REGULAR = 1e-5


@dataclass(frozen=True)
class NumericPoly:
    """Polynomial for evaluation at float points: exponents (T, V), coefficients (T,)."""

    exponents: npt.NDArray[np.int64]
    coefficients: npt.NDArray[np.float64]

    def __call__(self, point: ComplexArray) -> complex:
        """Value at a point (V,)."""
        if not len(self.coefficients):
            return 0j
        return complex(np.prod(point[None, :] ** self.exponents, axis=1) @ self.coefficients)

    def gradient(self, point: ComplexArray) -> ComplexArray:
        """Derivatives by all variables at a point: (V,)."""
        out = np.zeros(len(point), dtype=complex)
        for v in np.flatnonzero(self.exponents.any(axis=0)):
            lowered = self.exponents.copy()
            factor = lowered[:, v] * self.coefficients
            lowered[:, v] = np.maximum(lowered[:, v] - 1, 0)
            out[v] = np.prod(point[None, :] ** lowered, axis=1) @ factor
        return out

    def size(self, point: ComplexArray) -> float:
        """Sum of the absolute values of the terms at a point: what rounding is relative to."""
        if not len(self.coefficients):
            return 0.0
        terms = np.prod(np.abs(point)[None, :] ** self.exponents, axis=1)
        return float(terms @ np.abs(self.coefficients))


def numeric(poly: Poly, nvars: int) -> NumericPoly:
    """Prepare ``poly`` for float evaluation, its largest coefficient scaled to 1."""
    terms = list(poly.to_dict().items())
    if not terms:
        return NumericPoly(np.zeros((0, nvars), dtype=np.int64), np.zeros(0))
    coefficients = [fraction(c) for _, c in terms]
    largest = max(abs(c) for c in coefficients)
    return NumericPoly(
        np.array([m for m, _ in terms], dtype=np.int64),
        np.array([float(c / largest) for c in coefficients]),
    )


class RankTest:
    """Rank of a polynomial matrix at complex points."""

    def __init__(self, matrix: Matrix, rank: int, ring: Ring) -> None:
        self.rank = rank
        self.ring = ring
        nvars = ring.context.nvars()
        # Exact scale of each entry matters here: no scaling of coefficients one by one.
        self.entries = [
            [
                (
                    np.array(list(x.to_dict()), dtype=np.int64).reshape(-1, nvars),
                    np.array([float(fraction(c)) for c in x.to_dict().values()]),
                )
                for x in row
            ]
            for row in matrix
        ]

    def ratio(self, point: ComplexArray) -> float:
        """sigma_rank over the size of the matrix, its rows and columns balanced."""
        values = np.zeros((len(self.entries), len(self.entries[0])), dtype=complex)
        sizes = np.zeros(values.shape)
        for i, row in enumerate(self.entries):
            for k, (e, c) in enumerate(row):
                if len(c):
                    terms = np.prod(point[None, :] ** e, axis=1)
                    values[i, k] = terms @ c
                    sizes[i, k] = np.abs(terms) @ np.abs(c)
        # Balanced by the sizes of the terms: a row or column that vanishes must stay zero.
        for _ in range(2):
            for axis in (1, 0):
                size = np.linalg.norm(sizes, axis=axis, keepdims=True)
                size = np.where(size > 0, size, 1.0)
                values, sizes = values / size, sizes / size
        sigma = np.linalg.svd(values, compute_uv=False)
        # Not over sigma_1: where the whole matrix vanishes, that is rounding as well.
        whole = np.linalg.norm(sizes)
        return float(sigma[self.rank - 1] / whole) if whole > 0 else 0.0


@dataclass(frozen=True)
class SlicePoint:
    """One common zero on a slice, with its verdict."""

    point: ComplexArray
    singular: bool
    certain: bool


def random_value(rng: np.random.Generator, ring: Ring, joint: int) -> Value:
    """Small random rational value of a joint."""
    if ring.prismatic[joint]:
        return (Fraction(int(rng.integers(-97, 98)), 101),)
    return Fraction(int(rng.integers(3, 60))), Fraction(int(rng.integers(-60, 61)) or 7)


def slice_points(
    p: Poly,
    g: Poly,
    test: RankTest,
    ring: Ring,
    rng: np.random.Generator,
    values: Mapping[int, Value],
) -> Iterator[SlicePoint]:
    """Common zeros of p and g on a random slice for every pair of joints.

    Parameters
    ----------
    values : mapping of joint to Value
        Joints that are at fixed values already (and occur in neither polynomial).
    """
    joints = [j for j in range(len(ring.prismatic)) if j not in values]
    of_p, of_g = set(ring.joints_of(p)), set(ring.joints_of(g))
    for k, other in itertools.combinations(sorted(of_p | of_g), 2):
        if not ({k, other} & of_p and {k, other} & of_g):
            continue  # one of the two is a constant on this slice
        fixed = {j: random_value(rng, ring, j) for j in joints if j not in (k, other)}
        fixed.update(values)
        yield from _points_on(p, g, k, other, fixed, test, ring, rng)


def _points_on(
    p: Poly,
    g: Poly,
    first: int,
    second: int,
    fixed: Mapping[int, Value],
    test: RankTest,
    ring: Ring,
    rng: np.random.Generator,
) -> Iterator[SlicePoint]:
    """Common zeros of p and g in two joints, the others ``fixed``, with their verdicts."""
    turn = {j: _turn(ring, j, rng) for j in (first, second)}
    P = _chart(ring.substitute(p, fixed), ring, turn)
    G = _chart(ring.substitute(g, fixed), ring, turn)
    base = np.zeros(ring.context.nvars(), dtype=complex)
    for j, value in fixed.items():
        base[list(ring.variables(j))] = [float(x) for x in value]
    for t, s in _common_zeros(P, G, ring.variables(first)[-1], ring.variables(second)[-1], ring):
        point = base.copy()
        for j, chart_value in ((first, t), (second, s)):
            point[list(ring.variables(j))] = turn[j].values_at(chart_value)
        if _norms_vanish(point, ring):
            continue
        ratio = test.ratio(point)
        yield SlicePoint(point, ratio < _SINGULAR, not _SINGULAR <= ratio < _REGULAR)


def _common_zeros(
    P: Poly, G: Poly, first: int, second: int, ring: Ring
) -> Iterator[tuple[complex, complex]]:
    """Common zeros of two polynomials in two variables.

    Both coordinates come from resultants, whose roots are accurate even where zeros are
    multiple; solving one polynomial at the roots of the other only tells which go together.
    """
    without_first, without_second = _eliminate(P, G, first, ring), _eliminate(P, G, second, ring)
    if without_first.is_constant() or without_second.is_constant():
        return
    ts = np.array(univariate_roots(without_second, first))
    nvars = ring.context.nvars()
    polys = [numeric(P, nvars), numeric(G, nvars)]
    solve_in = polys[0] if P.degrees()[first] > 0 else polys[1]
    for s in univariate_roots(without_first, second):
        at = np.zeros(nvars, dtype=complex)
        at[second] = s
        near: set[int] = set()
        row = _univariate(solve_in, at, first)
        for rough in np.roots(row) if len(row) > 1 else []:
            gaps = np.abs(ts - rough) / (1.0 + np.abs(ts))
            if gaps.min() < 1e-3:
                near.add(int(np.argmin(gaps)))
        for i in sorted(near):
            at[first] = ts[i]
            if all(abs(f(at)) <= 1e-6 * f.size(at) for f in polys):
                yield complex(ts[i]), complex(s)


def _eliminate(P: Poly, G: Poly, variable: int, ring: Ring) -> Poly:
    """A polynomial without ``variable`` that vanishes where both do."""
    in_p, in_g = P.degrees()[variable] > 0, G.degrees()[variable] > 0
    if in_p and in_g:
        return P.resultant(G, ring.context.names()[variable])
    return G if in_p else P


@dataclass(frozen=True)
class _Turn:
    """Chart of a joint: (x, y) = (a - b t, b + a t), or t itself for a prismatic one."""

    a: Fraction
    b: Fraction
    prismatic: bool

    def values_at(self, t: complex) -> list[complex]:
        if self.prismatic:
            return [t]
        a, b = float(self.a), float(self.b)
        x, y = a - b * t, b + a * t
        size = max(abs(x), abs(y))
        return [x / size, y / size]


def _turn(ring: Ring, joint: int, rng: np.random.Generator) -> _Turn:
    a, b = (Fraction(int(v)) for v in rng.integers(2, 12, 2))
    return _Turn(a, b, ring.prismatic[joint])


def _chart(poly: Poly, ring: Ring, turn: Mapping[int, _Turn]) -> Poly:
    """Rewrite ``poly`` in the charts of the joints: each keeps its last variable."""
    gens = list(ring.context.gens())
    images = list(gens)
    for j, chart in turn.items():
        if chart.prismatic:
            continue
        x, y = ring.variables(j)
        t = gens[y]
        images[x] = rational(chart.a) - rational(chart.b) * t
        images[y] = rational(chart.b) + rational(chart.a) * t
    return poly.compose(*images, ctx=ring.context)


def univariate_roots(poly: Poly, variable: int) -> list[complex]:
    """Distinct complex roots of a polynomial in one variable, accurate to double precision."""
    coefficients: dict[int, Fraction] = {}
    for monomial, c in poly.to_dict().items():
        coefficients[int(monomial[variable])] = fraction(c)
    denominator = math.lcm(*(c.denominator for c in coefficients.values()))
    top = max(coefficients)
    integers = [int(coefficients.get(i, Fraction(0)) * denominator) for i in range(top + 1)]
    roots = []
    for factor, _ in fmpz_poly(integers).factor()[1]:
        roots += [complex(r) for r, _ in factor.complex_roots()]
    return roots


def _univariate(poly: NumericPoly, point: ComplexArray, variable: int) -> ComplexArray:
    """Coefficients (highest first) of ``poly`` in one variable, the others at ``point``."""
    rest = point.copy()
    rest[variable] = 1.0
    values = np.prod(rest[None, :] ** poly.exponents, axis=1) * poly.coefficients
    degree = int(poly.exponents[:, variable].max(initial=0))
    out = np.zeros(degree + 1, dtype=complex)
    np.add.at(out, degree - poly.exponents[:, variable], values)
    large = np.flatnonzero(np.abs(out) > 1e-13 * np.abs(out).max(initial=0.0))
    return out[large[0] :] if len(large) else out[:0]


def _norms_vanish(point: ComplexArray, ring: Ring) -> bool:
    """Whether some x^2 + y^2 is zero at a complex point: no angle is meant there."""
    for j, w in enumerate(ring.w):
        if w is None:
            continue
        x, y = ring.variables(j)
        size = abs(point[x]) ** 2 + abs(point[y]) ** 2
        if size > 0 and abs(point[x] ** 2 + point[y] ** 2) < 1e-6 * size:
            return True
    return False
