"""A chain and its families over a small finite field, where every configuration can be visited.

The joints on the near side of a middle one fix the wrenches that do no work at any of their axes;
those on its far side must leave one of these over. So both sides are gone through once, and each
pair is a product of small matrices.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import nmod_mat

from pinsing.algebra.components import SECOND_SEED, Component
from pinsing.algebra.jacobian_matrix import in_axes
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.measures import Bool, Ints, NDArray
from pinsing.robot.nominal import PRIMES, Nominal, jacobian_modulo
from pinsing.robot.surd import parts_of, residue
from pinsing.robot.task import Task

_CHECKED = 4_000
"""Singular points of one slice that are held against the families."""

Coordinates = tuple[Ints, Ints]
"""Half-angle coordinates (x, y) of a joint; of a slider its length and 0."""
Pairs = NDArray[np.intp]


class ModularChain:
    """A chain modulo a prime."""

    def __init__(self, geometry: Nominal, prime: int) -> None:
        self.p, self.slides = prime, geometry.prismatic
        self.n = len(geometry.prismatic)
        self.turn = [
            np.array([[residue(v, prime) for v in row] for row in R]) for R in geometry.rotation
        ]
        self.shift = [np.array([residue(v, prime) for v in t]) for t in geometry.translation]

    def singular(self, chosen: Sequence[int], draw: random.Random) -> tuple[Ints, Ints]:
        """Return singular points (x, y), each (n, N), the other joints at random values."""
        # A sample of them where there are very many.
        half = len(chosen) // 2
        middle = chosen[half]
        values = [self.every(j) for j in range(self.n)]
        at: list[Coordinates] = []
        for j in range(self.n):
            pick = draw.randrange(len(values[j][0]))
            at.append((values[j][0][pick : pick + 1], values[j][1][pick : pick + 1]))
        near, far = list(at), list(at)
        for some, side in ((chosen[:half], near), (chosen[half:], far)):
            grid = np.meshgrid(*(np.arange(len(values[j][0])) for j in some), indexing="ij")
            for j, index in zip(some, grid, strict=True):
                side[j] = values[j][0][index.ravel()], values[j][1][index.ravel()]
        pairs = self._met(middle, near, far)
        if len(pairs) > _CHECKED:
            pairs = pairs[sorted(draw.sample(range(len(pairs)), _CHECKED))]
        x, y = (np.zeros((self.n, len(pairs)), dtype=np.int64) for _ in range(2))
        for j in range(self.n):
            side, index = (near, pairs[:, 0]) if j in chosen[:half] else (far, pairs[:, 1])
            for out, v in zip((x, y), side[j], strict=True):
                out[j] = v[index] if len(v) > 1 else v[0]
        return x, y

    def every(self, j: int) -> Coordinates:
        """All values of a joint: half-angle coordinates (x, y), or lengths x."""
        t = np.arange(self.p, dtype=np.int64)
        if self.slides[j]:
            return t, np.zeros_like(t)
        t = t[(t * t + 1) % self.p != 0]  # no angle is where x^2 + y^2 is zero
        return np.append(np.ones_like(t), 0), np.append(t, 1)

    def _motion(self, j: int, at: Coordinates) -> tuple[Ints, Ints]:
        """Rotations (N, 3, 3) and shifts (N, 3) of a joint."""
        x, y = at
        R = np.zeros((len(x), 3, 3), dtype=np.int64)
        t = np.zeros((len(x), 3), dtype=np.int64)
        R[:, 2, 2] = 1
        if self.slides[j]:
            R[:, 0, 0] = R[:, 1, 1] = 1
            t[:, 2] = x
            return R, t
        over = np.array([pow(int(v), -1, self.p) for v in (x * x + y * y) % self.p])
        c, s = (x * x - y * y) * over % self.p, 2 * x * y * over % self.p
        R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1] = c, -s, s, c
        return R % self.p, t

    def _screw(self, j: int, w: Ints, o: Ints) -> Ints:
        """Screws (N, 6) of joint j, its axis along w (N, 3) through o (N, 3)."""
        if self.slides[j]:
            return np.concatenate([w, np.zeros_like(w)], axis=1)
        return np.concatenate([np.cross(o, w), w], axis=1) % self.p

    def _met(self, middle: int, near: Sequence[Coordinates], far: Sequence[Coordinates]) -> Pairs:
        """Indices (k, 2) of the values of the two sides that are singular together."""
        return self._pairs(self._near(middle, near)[0], self._far(middle, far)[0])

    def _near(self, middle: int, at: Sequence[Coordinates]) -> tuple[Ints, Ints]:
        """Return screws (N, k, 6) of joints up to the middle one in its frame, and its turn."""
        p = self.p
        R, o = np.eye(3, dtype=np.int64)[None], np.zeros((1, 3), dtype=np.int64)
        screws = [self._screw(middle, R[:, 2], o)]
        for j in range(middle - 1, -1, -1):
            # The middle frame, seen from joint j's.
            R, o = self.turn[j + 1] @ R % p, (o @ self.turn[j + 1].T + self.shift[j + 1]) % p
            M, t = self._motion(j, at[j])
            R, o = M @ R % p, ((M @ o[:, :, None])[:, :, 0] + t) % p
            # Joint j's axis, seen from the middle frame: R^T z through -R^T o.
            screws.append(self._screw(j, R[:, 2], -np.einsum("nij,ni->nj", R, o) % p))
        return _stacked(screws), R

    def _far(self, middle: int, at: Sequence[Coordinates]) -> tuple[Ints, Ints, Ints]:
        """Return screws (N, k, 6) behind the middle joint in its frame, last turn, and place."""
        p = self.p
        R, o = np.eye(3, dtype=np.int64)[None], np.zeros((1, 3), dtype=np.int64)
        screws = []
        for j in range(middle + 1, self.n):
            M, t = self._motion(j - 1, at[j - 1])
            o = ((R @ t[:, :, None])[:, :, 0] + o) % p
            R = R @ M % p
            o = (R @ self.shift[j] + o) % p
            R = R @ self.turn[j] % p
            screws.append(self._screw(j, R[:, :, 2], o))
        return _stacked(screws), R, o

    def _pairs(self, near: Ints, far: Ints) -> Pairs:
        """Indices (k, 2) of the two sides where all screws together have no rank 6."""
        p = self.p
        wrenches: dict[int, tuple[list[int], list[Any]]] = {}
        for i, screws in enumerate(near.tolist()):
            free, count = nmod_mat(len(screws), 6, [v for s in screws for v in s], p).nullspace()
            if count:
                rows = [[int(free[r, c]) for r in range(6)] for c in range(int(count))]
                index, found = wrenches.setdefault(int(count), ([], []))
                index.append(i)
                found.append(rows)
        k, kept = far.shape[1], np.arange(len(far))
        if k >= 6:  # most of them leave no wrench over by themselves
            kept = np.flatnonzero(short(far.transpose(2, 1, 0).astype(np.int16), p))
            far = far[kept]
        if not len(far):
            return np.zeros((0, 2), dtype=np.intp)
        columns = far.reshape(-1, 6).T.astype(np.float32)  # sums of six products are exact
        out = []
        for count, (index, found) in wrenches.items():
            # Numbers in one product of matrices.
            step = max(1, 4_000_000 // (count * columns.shape[1]))
            for first in range(0, len(index), step):
                some = np.array(found[first : first + step], dtype=np.float32)
                work = (some.reshape(-1, 6) @ columns).astype(np.int16) % np.int16(p)
                work = work.reshape(len(some), count, len(far), k).transpose(1, 3, 0, 2)
                a, b = np.nonzero(short(work, p))
                out.append(np.stack([np.array(index)[first + a], kept[b]], axis=1))
        return np.concatenate(out) if out else np.zeros((0, 2), dtype=np.intp)


def _stacked(screws: Sequence[Ints]) -> Ints:
    if not screws:
        return np.zeros((1, 0, 6), dtype=np.int64)
    count = max(len(s) for s in screws)
    return np.stack([np.broadcast_to(s, (count, 6)) for s in screws], axis=1)


def short(A: NDArray[np.int16], p: int) -> Bool:
    """Return where matrices (m, k, ...) have a rank below m modulo a prime."""
    if len(A) == 1:
        return np.asarray(~A[0].any(axis=0))
    inverse = np.array([0] + [pow(v, -1, p) for v in range(1, p)], dtype=np.int16)
    A = A.copy()
    rank = np.zeros(A.shape[2:], dtype=np.int64)
    left = np.ones((len(A), *A.shape[2:]), dtype=bool)
    for j in range(A.shape[1]):
        usable = (A[:, j] != 0) & left
        pivot = usable.argmax(axis=0)
        has = usable.any(axis=0)
        row = np.take_along_axis(A, pivot[None, None], axis=0)[0]
        over = np.where(has, inverse[row[j]], np.int16(0))
        left &= ~((np.arange(len(A)).reshape(-1, *[1] * rank.ndim) == pivot) & has)
        factor = np.where(left, A[:, j] * over % np.int16(p), np.int16(0))
        A[:, j + 1 :] = (A[:, j + 1 :] - factor[:, None] * row[None, j + 1 :]) % np.int16(p)
        rank += has
    return np.asarray(rank < len(A))


def value_modulo(value: Value, prime: int) -> tuple[int, ...]:
    """A joint's value in a field: half-angle coordinates, a length; none at infinity."""
    bottom = math.lcm(*(part.denominator for v in value for part in parts_of(v)))
    whole = tuple(residue(v * bottom, prime) for v in value)
    if len(whole) > 1:
        return whole
    return (whole[0] * pow(bottom, -1, prime) % prime,) if bottom % prime else ()


def at_value(x: Ints, y: Ints, value: tuple[int, ...], prime: int) -> Bool:
    """Return which coordinates (N,) of a joint are at a value of it in the field."""
    if not value:
        return np.zeros(x.shape, dtype=bool)
    away = x - value[0] if len(value) == 1 else x * value[1] - y * value[0]
    return np.asarray(away % prime == 0)


class ModularSet:
    """A component modulo a prime."""

    def __init__(self, component: Component, ring: Ring, prime: int) -> None:
        self.p = prime
        self.values = {j: value_modulo(x, prime) for j, x in component.values.items()}
        self.relations = [_Split(_residues(r, ring, prime), prime) for r in component.relations]
        self.variables = [
            (j, k) for j in range(len(ring.prismatic)) for k in range(len(ring.variables(j)))
        ]

    def holds(self, x: Ints, y: Ints) -> Bool:
        """Return which of some points (n, N) lie on it."""
        on = np.ones(x.shape[1], dtype=bool)
        for j, v in self.values.items():
            on &= at_value(x[j], y[j], v, self.p)
        for relation in self.relations:
            left = np.flatnonzero(on)
            if not len(left):
                break
            at = np.array([(x, y)[k][j][left] for j, k in self.variables])
            on[left] = relation.value(at) == 0
        return on


class _Split:
    """A polynomial modulo a prime, in two groups of variables, so that powers are made once."""

    def __init__(self, terms: Mapping[tuple[int, ...], int], prime: int) -> None:
        self.p = prime
        monomials = list(terms)
        width = len(monomials[0]) if monomials else 0
        self.cut = min(
            range(width + 1),
            key=lambda c: sum(
                len({m[s] for m in monomials}) for s in (slice(None, c), slice(c, None))
            ),
        )
        groups: dict[tuple[int, ...], tuple[list[int], list[int]]] = {}
        number: dict[tuple[int, ...], int] = {}
        for m, c in terms.items():
            index, factors = groups.setdefault(m[: self.cut], ([], []))
            index.append(number.setdefault(m[self.cut :], len(number)))
            factors.append(c)
        self.first, self.second = list(groups), list(number)
        self.beside = [(np.array(i), np.array(c, dtype=float)) for i, c in groups.values()]

    def value(self, at: Ints) -> Ints:
        """At values (variables, N)."""
        total = np.zeros(at.shape[1], dtype=np.int64)
        if not self.first:
            return total
        one = _monomials(self.first, at[: self.cut], self.p)
        # Sums of products of two residues, exact in floats up to 1e12 of them.
        other = _monomials(self.second, at[self.cut :], self.p).astype(float)
        for first, (index, factors) in zip(one, self.beside, strict=True):
            total += first * ((factors @ other[index]).astype(np.int64) % self.p)
        return total % self.p


def _monomials(exponents: Sequence[tuple[int, ...]], at: Ints, p: int) -> Ints:
    """Products of powers (K, N) of values (variables, N)."""
    out = np.ones((len(exponents), at.shape[1]), dtype=np.int64)
    for v, powers in enumerate(zip(*exponents, strict=True)):
        table = [np.ones_like(at[v])]
        for _ in range(max(powers)):
            table.append(table[-1] * at[v] % p)
        out = out * np.array(table)[list(powers)] % p
    return out


def _residues(poly: Poly, ring: Ring, prime: int) -> dict[tuple[int, ...], int]:
    """Return a polynomial's coefficients modulo a prime, not all multiples of it."""
    # If square roots make all zero nevertheless, it counts as nowhere zero: points are left over
    # rather than taken in.
    terms = ring.terms(poly)
    parts = [part for c in terms.values() for part in parts_of(c) if part]
    bottom = math.lcm(*(part.denominator for part in parts))
    scale = Fraction(bottom, math.gcd(*(int(part * bottom) for part in parts)))
    found = {m: r for m, c in terms.items() if (r := residue(c * scale, prime))}
    return found or {(0,) * ring.nvars: 1}


class ModularRows(ModularChain):
    """A chain, each of whose joints moves on its own, and as many Jacobian rows as their rank."""

    def __init__(self, geometry: Nominal, task: Task, prime: int) -> None:
        super().__init__(geometry, prime)
        self.task = task
        self._with_base = bool(in_axes(task, False))
        self._tip_turn = np.array(
            [[residue(v, prime) for v in row] for row in geometry.tip_rotation]
        )

    def _met(self, middle: int, near: Sequence[Coordinates], far: Sequence[Coordinates]) -> Pairs:
        p = self.p
        before, R = self._near(middle, near)
        base = self.turn[0] @ R % p  # its rows are the base's axes, seen from the middle
        behind, tip_axes, tip = self._far_side(middle, far)
        # The middle joint's own axis stands still in its frame: it counts on the far side.
        still = np.broadcast_to(before[:, :1][:1], (len(behind), 1, 6))
        before, behind = before[:, 1:], np.concatenate([still, behind], axis=1)
        left = np.arange(len(behind))
        if not self._with_base:
            L = self._rows(base[:1], tip_axes, tip)
            left = left[short(self._columns(L, behind), p)]
        out = []
        # Pairs of values of the two sides whose columns are made at once.
        step = max(1, 100_000 // max(1, len(before)))
        for first in range(0, len(left), step):
            some = left[first : first + step]
            i, k = (a.ravel() for a in np.meshgrid(np.arange(len(before)), some, indexing="ij"))
            L = self._rows(base[i if len(base) > 1 else np.zeros_like(i)], tip_axes[k], tip[k])
            singular = short(self._columns(L, np.concatenate([before[i], behind[k]], axis=1)), p)
            out.append(np.stack([i[singular], k[singular]], axis=1))
        return np.concatenate(out) if out else np.zeros((0, 2), dtype=np.intp)

    def _far_side(self, middle: int, far: Sequence[Coordinates]) -> tuple[Ints, Ints, Ints]:
        """Screws behind the middle joint, axes of the tip as rows, and where it is."""
        p = self.p
        behind, R, o = self._far(middle, far)
        M, t = self._motion(self.n - 1, far[self.n - 1])
        o = ((R @ t[:, :, None])[:, :, 0] + o) % p
        R = R @ M % p
        o = (R @ self.shift[self.n] + o) % p
        R = R @ self.turn[self.n] % p @ self._tip_turn % p
        count = max(len(behind), len(R), len(o))
        axes = np.broadcast_to(R, (count, 3, 3)).transpose(0, 2, 1)
        return np.broadcast_to(behind, (count, *behind.shape[1:])), axes, _as_many(o, count)

    def _rows(self, base: Ints, tip_axes: Ints, tip: Ints) -> Ints:
        """What screws (v, w) are multiplied with (N, rows, 6), in the middle joint's frame."""
        count = max(len(base), len(tip))
        whole = np.eye(3, dtype=np.int64)[None]  # all three directions span the same in any axes
        out = []
        for r, at_tip in zip(self.task.rows, self.task.tip_rows, strict=True):
            triple = set(range(r - r % 3, r - r % 3 + 3))
            axes = whole if triple <= set(self.task.rows) else tip_axes if at_tip else base
            along = _as_many(axes[:, r % 3], count)
            both = np.zeros_like(along), along
            if r < 3:  # along . (v + w x tip) = along . v + (tip x along) . w
                both = along, np.cross(_as_many(tip, count), along) % self.p
            out.append(np.concatenate(both, axis=1))
        return np.stack(out, axis=1)

    def _columns(self, rows: Ints, screws: Ints) -> NDArray[np.int16]:
        """Rows of the Jacobian (rows, columns, N): sums of six products are exact in floats."""
        J = rows.astype(np.float32) @ screws.astype(np.float32).transpose(0, 2, 1)
        return np.asarray((J % self.p).astype(np.int16).transpose(1, 2, 0))


def _as_many(a: Ints, count: int) -> Ints:
    return np.broadcast_to(a, (count, *a.shape[1:]))


def short_everywhere(chain: ModularChain, geometry: Nominal, task: Task) -> bool:
    """Return True if the rank is short at all random points: the prime divides a length."""
    draw, rows = random.Random(SECOND_SEED), len(task.rows)
    # At which all of a chain is looked at: that each is singular by chance is 1 in 1e10.
    for _ in range(12):
        at: dict[int, tuple[Fraction, ...]] = {}
        for j, slides in enumerate(geometry.prismatic):
            x, y = chain.every(j)
            k = draw.randrange(len(x))
            at[j] = (Fraction(int(x[k])),) if slides else (Fraction(int(x[k])), Fraction(int(y[k])))
        flat = [v for row in jacobian_modulo(geometry, task, chain.p, draw, at) for v in row]
        if nmod_mat(rows, len(geometry.prismatic), flat, chain.p).rank() == rows:
            return False
    return True


def joints_that_matter(geometry: Nominal, task: Task) -> tuple[int, ...]:
    """Return joints on which the rows' rank depends: not those that turn all axes alike."""
    # These leave each minor as it is, up to one sign; decided at random points modulo a prime.
    draw = random.Random(SECOND_SEED)
    n, prime = len(geometry.prismatic), PRIMES[0]

    def drawn(j: int) -> tuple[Fraction, ...]:
        first = Fraction(draw.randrange(1, prime))
        return (first,) if geometry.prismatic[j] else (Fraction(1), first)

    mixing = nmod_mat(n, len(task.rows), [draw.randrange(prime) for _ in task.rows * n], prime)

    def volume(values: Mapping[int, Sequence[Fraction]]) -> int:
        """A sum of all minors, each with a factor of its own, up to its sign."""
        rows = jacobian_modulo(geometry, task, prime, draw, values)
        flat = [x for row in rows for x in row]
        size = int((nmod_mat(len(rows), n, flat, prime) * mixing).det())
        return min(size, prime - size)

    matter = set[int]()
    # Random configurations at which a joint is moved, to see whether that matters to the rank.
    for _ in range(3):
        at = {j: drawn(j) for j in range(n)}
        here = volume(at)
        for j in range(n):
            if j not in matter and volume({**at, j: drawn(j)}) != here:
                matter.add(j)
    return tuple(sorted(matter))
