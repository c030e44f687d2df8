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

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int32]

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
    """A rational number, or one with parts of 1, sqrt 2, sqrt 3, sqrt 6, modulo a prime.

    Raises
    ------
    ZeroDivisionError
        If the prime divides a denominator, or the number itself, which is not zero: it then makes
        another chain of this one.
    """
    parts = getattr(value, "parts", None) or (Fraction(value),)
    total = 0
    for square, part in zip((1, 2, 3, 6), parts, strict=False):
        if part:
            if part.denominator % prime == 0:
                raise ZeroDivisionError(f"a denominator is a multiple of {prime}")
            scale = part.numerator * pow(part.denominator, -1, prime)
            total += scale * (1 if square == 1 else root_of(square, prime))
    if any(parts) and total % prime == 0:
        raise ZeroDivisionError(f"the number is a multiple of {prime}")
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
    t = rng.integers(0, prime + 1, (n, count), dtype=np.int32)  # prime stands for infinity
    tied = np.arange(count) >= count // 2
    how_much = rng.uniform(0.1, 0.7, count)
    for j in range(n):
        special = tied & (rng.random(count) < how_much)
        if prismatic[j]:
            t[j] = np.where(special, 0, t[j] % prime)
            continue
        quarter = rng.integers(
            0, 4, count, dtype=np.int32
        )  # 0, 90, 180, -90 degrees: t = 0, 1, infinity, -1
        value = np.array([0, 1, prime, prime - 1], dtype=np.int32)[quarter]
        turning = [i for i in range(j) if not prismatic[i]]
        if turning:
            other = t[np.array(turning)[rng.integers(0, len(turning), count)], np.arange(count)]
            sign = 2 * rng.integers(0, 2, count, dtype=np.int32) - 1
            same = np.where(other == prime, prime, modulo(other * sign, prime))
            value = np.where(rng.random(count) < 0.35, _turned(same, quarter, prime), value)
        t[j] = np.where(special, value, t[j])
    infinite = t == prime
    slides = np.array(prismatic)[:, None]
    x = np.where(slides, t, np.where(infinite, 0, 1))
    y = np.where(slides, 0, np.where(infinite, 1, t))
    return Points(prime, x.astype(np.int32), y.astype(np.int32))


def _turned(t: Ints, quarter: Ints, prime: int) -> Ints:
    """The half-angle tangent after some right angles: (t + c) / (1 - c t), c = 0, 1, inf, -1."""
    c = np.array([0, 1, 0, prime - 1], dtype=np.int32)[quarter]
    infinite = t == prime
    top, bottom = np.where(infinite, 1, t + c), np.where(infinite, -c, 1 - c * t)
    half = quarter == 2  # -1 / t
    top, bottom = np.where(half, -bottom, top), np.where(half, top, bottom)
    top, bottom = modulo(top, prime), modulo(bottom, prime)
    return np.where(bottom == 0, prime, modulo(top * _inverses(prime)[bottom], prime))


def _inverses(prime: int) -> Ints:
    return np.array([0] + [pow(i, -1, prime) for i in range(1, prime)], dtype=np.int32)


def modulo(values: Ints, prime: int) -> Ints:
    """The values modulo a prime: faster than numpy's own remainder, which divides one by one."""
    return np.asarray(values - values // prime * prime)


def jacobians(geometry: Any, rows: Sequence[int], points: Points) -> Ints:
    """Task Jacobians (m, n, N) modulo the prime: base axes, at the tip."""
    p = points.prime
    count = points.x.shape[1]
    inverse = _inverses(p)
    zero = np.zeros(count, dtype=np.int32)
    R = [[zero + int(a == b) for a in range(3)] for b in range(3)]  # column by column
    o = [zero, zero, zero]
    axes, origins = [], []
    for j in range(len(geometry.rotation)):
        C = [[number(v, p) for v in row] for row in geometry.rotation[j]]
        c = [number(v, p) for v in geometry.translation[j]]
        o = [_sum([o[a], *(R[i][a] * c[i] for i in range(3) if c[i])], p) for a in range(3)]
        R = [
            [_sum([R[i][a] * C[i][k] for i in range(3) if C[i][k]], p) for a in range(3)]
            for k in range(3)
        ]
        if j == len(geometry.prismatic):
            break
        axes.append(R[2])
        origins.append(o)
        if geometry.prismatic[j]:
            o = [_sum([o[a], R[2][a] * points.x[j]], p) for a in range(3)]
            continue
        x, y = points.x[j], points.y[j]
        over = inverse[modulo(x * x + y * y, p)]
        cos = modulo(modulo(x * x - y * y, p) * over, p)
        sin = modulo(modulo(2 * x * y, p) * over, p)
        first = [_sum([R[0][a] * cos, R[1][a] * sin], p) for a in range(3)]
        second = [_sum([R[1][a] * cos, -R[0][a] * sin], p) for a in range(3)]
        R = [first, second, R[2]]
    columns = []
    for z, at, slides in zip(axes, origins, geometry.prismatic, strict=True):
        if slides:
            columns.append([*z, zero, zero, zero])
            continue
        arm = [modulo(o[a] - at[a], p) for a in range(3)]
        turned = [_sum([z[a] * arm[b], -z[b] * arm[a]], p) for a, b in ((1, 2), (2, 0), (0, 1))]
        columns.append([*turned, *z])
    return np.stack([np.stack([c[r] for c in columns]) for r in rows])


def _sum(parts: Sequence[Ints], prime: int) -> Ints:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return modulo(total, prime)


def ranks(matrices: Ints, prime: int) -> Ints:
    """Rank of each matrix (m, n, N) modulo a prime, by elimination: (N,)."""
    A = matrices.copy()
    m, n, count = A.shape
    inverse = _inverses(prime)
    rank = np.zeros(count, dtype=np.int32)
    left = np.ones((m, count), dtype=bool)  # rows that were no pivot so far
    for j in range(n):
        usable = (A[:, j] != 0) & left
        pivot = usable.argmax(axis=0)
        has = usable.any(axis=0)
        row = np.take_along_axis(A, pivot[None, None, :], axis=0)[0]
        over = np.where(has, inverse[row[j]], 0)
        left &= ~((np.arange(m)[:, None] == pivot) & has)
        factor = np.where(left, modulo(A[:, j] * over, prime), 0)
        A[:, j + 1 :] = modulo(A[:, j + 1 :] - factor[:, None] * row[None, j + 1 :], prime)
        rank += has
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
    terms = poly.to_dict()
    scale = math.lcm(*(int(c.q) for c in terms.values())) if terms else 1
    # to primitive integers, which no prime divides all of
    integers = {tuple(map(int, m)): int(c.p) * (scale // int(c.q)) for m, c in terms.items()}
    content = math.gcd(*integers.values()) if integers else 1
    residues = {m: r for m, c in integers.items() if (r := c // content % p)}
    total = _nested(residues, at, 0, p)
    return np.zeros(points.x.shape[1], dtype=np.int32) + total


def _nested(
    terms: Mapping[tuple[int, ...], int], at: Sequence[Ints | int], v: int, prime: int
) -> Ints | int:
    """Value of terms that differ in the variables from the v-th on, by Horner's rule."""
    if not terms:
        return 0
    if v == len(at):
        return next(iter(terms.values()))
    by_power: dict[int, dict[tuple[int, ...], int]] = {}
    for m, c in terms.items():
        by_power.setdefault(m[v], {})[m] = c
    total: Ints | int = 0
    for power in range(max(by_power), -1, -1):
        if not isinstance(total, int) or total:
            total = total * at[v]
        if power in by_power:
            total = total + _nested(by_power[power], at, v + 1, prime)
        if isinstance(total, int):
            total %= prime
        else:
            total = modulo(total, prime)
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
    by_rank: Sequence[Any] = (),
) -> Verdict:
    """Hold the rank at random points against membership in components.

    Those of ``by_rank`` are stated together with the rank: they hold at regular points too.
    """
    rng = np.random.default_rng([seed, prime])
    points = random_points(geometry.prismatic, prime, count, rng)
    found = ranks(jacobians(geometry, rows, points), prime)
    nowhere = np.zeros((1, count), dtype=bool)
    on = np.any([*nowhere, *(on_component(c, points) for c in components)], axis=0)
    singular = found < rank
    stated = np.any([on, *(on_component(c, points) for c in by_rank)], axis=0)

    def pairs(which: npt.NDArray[np.bool_]) -> Ints:
        return np.stack([points.x[:, which], points.y[:, which]]).transpose(2, 0, 1)

    return Verdict(
        prime=prime,
        points=count,
        rank=int(found.max()),
        singular=int(singular.sum()),
        missed=pairs(singular & ~stated),
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
    by_rank: Sequence[Any] = (),
) -> Iterator[Verdict]:
    """Verdicts at one prime after the other; those that divide a number are passed over."""
    for prime in primes:
        try:
            yield judge(geometry, rows, rank, components, prime, count, seed, by_rank)
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
    kinds: Sequence[str] = tuple(KINDS),
    by_rank: Sequence[Any] = (),
) -> Mapping[str, tuple[Verdict, ...]]:
    """What two primes or more say against an answer, by kind; empty if nothing.

    "missed", "false" and "rank" (those of ``kinds``), each with the verdicts that say so. What one
    prime alone says is under "unconfirmed".
    """
    tests = {kind: KINDS[kind] for kind in kinds}
    said = list(verdicts(geometry, rows, rank, components, count, seed, PRIMES, by_rank))
    if not any(test(v, rank) for v in said for test in tests.values()):
        return {}
    said += verdicts(geometry, rows, rank, components, 4 * count, seed, MORE_PRIMES, by_rank)
    out: dict[str, tuple[Verdict, ...]] = {}
    for kind, test in tests.items():
        against = tuple(v for v in said if test(v, rank))
        if against:
            out[kind if len(against) > 1 else "unconfirmed"] = against
    return out
