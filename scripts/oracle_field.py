"""Singular configurations of a chain over small finite fields, against stated families.

Nothing of the search is used here: the Jacobian is built from the exact placements of the
nominal chain by integers modulo a prime, at random points, and its rank by elimination is
held against membership in the exact components of the families. Both ways: a point of lower
rank on no component says that one is missing, a point of full rank on one that it is false.

The primes are 23 modulo 24: there 2 and 3 are squares and -1 is none. So x^2 + y^2 is zero at
no point, every pair (x : y) is an angle, and there are p + 1 of them, as on a real circle. A
component of codimension k is met by about one random point in p^k; points with right angles
and with joints that are equal, up to sign and right angles, are drawn more often, since that is
where structured arms have components of high codimension.

A small prime may divide what must not vanish (a length, a resultant). So what one prime says
counts only when another one says the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]

PRIMES = (23, 47)
"""Always asked: at small primes components of high codimension are met most."""
MORE_PRIMES = (71, 167, 191, 239)
"""Asked where one of the first contradicts. A component may have no point at some of them: one
with q3 = atan(a / b) has none where a root that it needs does not exist."""


def root_of(square: int, prime: int) -> int:
    """The square root of 2 or 3 that is itself a square, and products of these."""
    if square == 6:
        return root_of(2, prime) * root_of(3, prime) % prime
    roots = [x for x in range(prime) if (x * x - square) % prime == 0]
    return min(roots)


def number(value: Any, prime: int) -> int:
    """A rational number, or one with parts of 1, sqrt 2, sqrt 3, sqrt 6, modulo a prime."""
    parts = getattr(value, "parts", None) or (Fraction(value),)
    total = 0
    for square, part in zip((1, 2, 3, 6), parts, strict=False):
        if part:
            if part.denominator % prime == 0:
                raise ZeroDivisionError(f"a denominator is a multiple of {prime}")
            scale = part.numerator * pow(part.denominator, -1, prime)
            total += scale * (1 if square == 1 else root_of(square, prime))
    return total % prime


@dataclass(frozen=True)
class Points:
    """Configurations modulo a prime.

    Attributes
    ----------
    prime : int
        The prime.
    x, y : (n, N) arrays
        Half-angle coordinates of revolute joints; the value of a prismatic one is x.
    """

    prime: int
    x: Ints
    y: Ints

    def take(self, index: npt.NDArray[Any]) -> Points:
        """Some of the points."""
        return Points(self.prime, self.x[:, index], self.y[:, index])


def random_points(
    prismatic: Sequence[bool], prime: int, count: int, rng: np.random.Generator
) -> Points:
    """Half of the points uniform, half with some joints at right angles or tied to others."""
    n = len(prismatic)
    t = rng.integers(0, prime + 1, (n, count))  # prime stands for infinity
    tied = np.arange(count) >= count // 2
    how_much = rng.uniform(0.1, 0.7, count)
    for j in range(n):
        special = tied & (rng.random(count) < how_much)
        if prismatic[j]:
            t[j] = np.where(special, 0, t[j] % prime)
            continue
        quarter = rng.integers(0, 4, count)  # 0, 90, 180, -90 degrees: t = 0, 1, infinity, -1
        value = np.array([0, 1, prime, prime - 1])[quarter]
        turning = [i for i in range(j) if not prismatic[i]]
        if turning:
            other = t[rng.choice(turning, count), np.arange(count)]
            sign = rng.choice([1, -1], count)
            same = np.where(other == prime, prime, other * sign % prime)
            value = np.where(rng.random(count) < 0.35, _turned(same, quarter, prime), value)
        t[j] = np.where(special, value, t[j])
    infinite = t == prime
    slides = np.array(prismatic)[:, None]
    x = np.where(slides, t, np.where(infinite, 0, 1))
    y = np.where(slides, 0, np.where(infinite, 1, t))
    return Points(prime, x.astype(np.int64), y.astype(np.int64))


def _turned(t: Ints, quarter: Ints, prime: int) -> Ints:
    """The half-angle tangent after some right angles: (t + c) / (1 - c t), c = 0, 1, inf, -1."""
    c = np.array([0, 1, 0, prime - 1])[quarter]
    infinite = t == prime
    top = np.where(infinite, 1, t + c) % prime
    bottom = np.where(infinite, -c, 1 - c * t) % prime
    half = quarter == 2  # -1 / t
    top, bottom = np.where(half, -bottom, top) % prime, np.where(half, top, bottom) % prime
    return np.where(bottom == 0, prime, top * _inverses(prime)[bottom] % prime)


def _inverses(prime: int) -> Ints:
    return np.array([0] + [pow(i, -1, prime) for i in range(1, prime)], dtype=np.int64)


def jacobians(geometry: Any, rows: Sequence[int], points: Points) -> Ints:
    """Task Jacobians (N, m, n) modulo the prime: base axes, at the tip."""
    p = points.prime
    count = points.x.shape[1]
    inverse = _inverses(p)
    R = np.broadcast_to(np.eye(3, dtype=np.int64), (count, 3, 3))
    o = np.zeros((count, 3), dtype=np.int64)
    axes, origins = [], []
    for j in range(len(geometry.rotation)):
        C = np.array([[number(v, p) for v in row] for row in geometry.rotation[j]])
        c = np.array([number(v, p) for v in geometry.translation[j]])
        o = (o + R @ c) % p
        R = R @ C % p
        if j == len(geometry.prismatic):
            break
        axes.append(R[:, :, 2])
        origins.append(o)
        if geometry.prismatic[j]:
            o = (o + R[:, :, 2] * points.x[j][:, None]) % p
            continue
        x, y = points.x[j], points.y[j]
        over = inverse[(x * x + y * y) % p]
        cos, sin = (x * x - y * y) * over % p, 2 * x * y * over % p
        first = (R[:, :, 0] * cos[:, None] + R[:, :, 1] * sin[:, None]) % p
        second = (R[:, :, 1] * cos[:, None] - R[:, :, 0] * sin[:, None]) % p
        R = np.stack([first, second, R[:, :, 2]], axis=-1)
    columns = []
    for z, at, slides in zip(axes, origins, geometry.prismatic, strict=True):
        if slides:
            columns.append(np.concatenate([z, np.zeros_like(z)], axis=1))
        else:
            columns.append(np.concatenate([np.cross(z, o - at) % p, z], axis=1))
    return np.stack(columns, axis=-1)[:, list(rows), :] % p


def ranks(matrices: Ints, prime: int) -> Ints:
    """Rank of each matrix (N, m, n) modulo a prime, by elimination: (N,)."""
    A = matrices.copy()
    count, m, n = A.shape
    inverse = _inverses(prime)
    rank = np.zeros(count, dtype=np.int64)
    every = np.arange(count)
    for j in range(n):
        usable = (A[:, :, j] != 0) & (np.arange(m)[None, :] >= rank[:, None])
        has = usable.any(axis=1)
        pivot = np.where(has, usable.argmax(axis=1), 0)
        top = np.minimum(rank, m - 1)
        row = A[every, pivot]
        swapped = np.where(has[:, None], A[every, top], row)
        A[every, pivot] = swapped
        A[every, top] = np.where(has[:, None], row, A[every, top])
        row = row * inverse[row[:, j]][:, None] % prime
        below = has[:, None] & (np.arange(m)[None, :] > rank[:, None])
        factor = np.where(below, A[:, :, j], 0)
        A = (A - factor[:, :, None] * row[:, None, :]) % prime
        rank += has
        if (rank >= m).all():
            break
    return rank


def value(poly: Any, points: Points) -> Ints:
    """Value of an exact polynomial (x1, y1, z2, ...; s2, s3 for square roots) at the points."""
    p = points.prime
    at: list[Ints | int] = []
    for name in poly.context().names():
        kind, k = name[0], int(name[1:])
        if kind == "s":
            at.append(root_of(k, p))
        else:
            at.append({"x": points.x, "y": points.y, "z": points.x}[kind][k - 1])
    total = np.zeros(points.x.shape[1], dtype=np.int64)
    terms = poly.to_dict()
    scale = 1  # to primitive integers, which no prime divides all of
    for c in terms.values():
        scale = scale * int(c.q) // np.gcd.reduce([scale, int(c.q)], dtype=object)
    integers = {m: int(c.p) * (scale // int(c.q)) for m, c in terms.items()}
    content = np.gcd.reduce(list(integers.values()), dtype=object) if integers else 1
    for monomial, c in integers.items():
        term: Any = np.full(points.x.shape[1], c // content % p, dtype=np.int64)
        for base, exponent in zip(at, monomial, strict=True):
            for _ in range(int(exponent)):
                term = term * base % p
        total = (total + term) % p
    return total


def on_component(component: Any, points: Points) -> npt.NDArray[np.bool_]:
    """Which points lie on a component: exact joint values, and polynomials."""
    p = points.prime
    on = np.ones(points.x.shape[1], dtype=bool)
    for joint, exact in component.values.items():
        wanted = [number(v, p) for v in exact]
        if len(wanted) == 1:
            on &= points.x[joint] == wanted[0]
        else:
            on &= (points.x[joint] * wanted[1] - points.y[joint] * wanted[0]) % p == 0
    for poly in component.relations:
        left = np.flatnonzero(on)
        if not len(left):
            break
        on[left] = value(poly, points.take(left)) == 0
    return on


@dataclass(frozen=True)
class Verdict:
    """What random points modulo one prime say.

    Attributes
    ----------
    prime, points : int
        How many were looked at, modulo what.
    rank : int
        The greatest rank met.
    singular : int
        Points of a rank below the generic one.
    missed : (k, 2, n) array
        Singular points (x, y) on no component.
    false : (k, 2, n) array
        Points of full rank on a component.
    """

    prime: int
    points: int
    rank: int
    singular: int
    missed: Ints
    false: Ints


def judge(
    geometry: Any,
    rows: Sequence[int],
    rank: int,
    components: Sequence[Any],
    prime: int,
    count: int,
    seed: int,
) -> Verdict:
    """Hold the rank at random points against membership in components."""
    rng = np.random.default_rng([seed, prime])
    points = random_points(geometry.prismatic, prime, count, rng)
    found = ranks(jacobians(geometry, rows, points), prime)
    on = np.zeros(count, dtype=bool)
    for c in components:
        on |= on_component(c, points)
    singular = found < rank

    def pairs(which: npt.NDArray[np.bool_]) -> Ints:
        return np.stack([points.x[:, which], points.y[:, which]]).transpose(2, 0, 1)

    return Verdict(
        prime=prime,
        points=count,
        rank=int(found.max()),
        singular=int(singular.sum()),
        missed=pairs(singular & ~on),
        false=pairs(~singular & on),
    )


def verdicts(
    geometry: Any,
    rows: Sequence[int],
    rank: int,
    components: Sequence[Any],
    count: int,
    seed: int,
    primes: Sequence[int],
) -> Iterator[Verdict]:
    """Verdicts at one prime after the other; those that divide a denominator are passed over."""
    for prime in primes:
        try:
            yield judge(geometry, rows, rank, components, prime, count, seed)
        except ZeroDivisionError:
            continue


KINDS: Mapping[str, Callable[[Verdict, int], bool]] = {
    "missed": lambda v, rank: len(v.missed) > 0,
    "false": lambda v, rank: len(v.false) > 0,
    "rank": lambda v, rank: v.rank != rank,
}


def contradictions(
    geometry: Any,
    rows: Sequence[int],
    rank: int,
    components: Sequence[Any],
    count: int,
    seed: int,
) -> Mapping[str, tuple[Verdict, ...]]:
    """What two primes or more say against an answer, by kind; empty if nothing.

    "missed", "false" and "rank", each with the verdicts that say so. What one prime alone says
    is under "unconfirmed".
    """
    said = list(verdicts(geometry, rows, rank, components, count, seed, PRIMES))
    if not any(test(v, rank) for v in said for test in KINDS.values()):
        return {}
    said += verdicts(geometry, rows, rank, components, 4 * count, seed, MORE_PRIMES)
    out: dict[str, tuple[Verdict, ...]] = {}
    for kind, test in KINDS.items():
        against = tuple(v for v in said if test(v, rank))
        if against:
            out[kind if len(against) > 1 else "unconfirmed"] = against
    return out
