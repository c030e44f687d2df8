"""Equations on boxes: sign, or a direction in which they grow, proven by Taylor's theorem.

With x the middle of a box and h its half widths, a term ``c prod x^p cos(k x + s)`` differs from
its linear part by at most ``|c| M S^2 / 2``, M the largest product on the box and
``S = sum h_j (|k_j| + p_j / X_j)`` with X the largest |x|; its derivative along v changes by at
most ``|c| M (|k v| + sum p_j |v_j| / X_j) S``. Rounding is covered by a share of the terms' size.

Boxes of different sizes that fill a range of joint values.

Boxes on which the product of all |f| has no largest value, proven.

For given signs of the equations a point of a box is no largest value of the product, among points
within the limits, if

- the product grows along some direction that does not leave the limits which the box touches: a
  bound of the derivative all over the box shows it; or
- there is one equation, and along some line that keeps to the limits |f| is strictly convex: then
  it is larger on one side or the other, whatever its slope. This settles saddles, such as where
  the zeros of f cross each other on a limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from pinsing.algebra.equation import Equation
from pinsing.algebra.trig_sum import TrigSum
from pinsing.measures import Array, Bool, Ints, NDArray


@dataclass(frozen=True, eq=False)
class OnBoxes:
    """What is known of one equation on N boxes."""

    value: Array  # (N,): in the middle
    swing: Array  # (N,): the equation is within value - swing and value + swing on the box
    gradient: Array  # (N, d): in the middle

    def take(self, rows: Ints) -> OnBoxes:
        """Return what is known of some of the boxes."""
        return OnBoxes(self.value[rows], self.swing[rows], self.gradient[rows])


def sum_of(equation: Equation, joints: tuple[int, ...]) -> TrigSum:
    """An equation over some of the arm's joints, which are all that it has, ready for boxes."""
    rate, columns = equation.frequencies / 2, list(joints)
    return TrigSum(
        amplitude=np.hypot(equation.cos, equation.sin),
        phase=np.arctan2(-equation.sin, equation.cos) + rate @ equation.shift,
        rate=rate[:, columns],
        power=equation.powers[:, columns],
        noise=max(1e-12, 4 * equation.accuracy),
    )


def on_boxes(f: TrigSum, x: Array, h: Array) -> OnBoxes:
    """Return what is known of a sum on boxes of middles x and half widths h, both (N, d)."""
    few = 1 << 14
    if len(x) > few:
        parts = [on_boxes(f, x[i : i + few], h[i : i + few]) for i in range(0, len(x), few)]
        return OnBoxes(
            *(np.concatenate([getattr(p, k) for p in parts]) for k in OnBoxes.__annotations__)
        )
    at, most = f.at(x), np.abs(x) + h
    noise = f.noise * f.sizes(most).sum(axis=1) * _grown(x)
    bend = f.bend(most, h @ np.abs(f.rate).T, h)
    return OnBoxes(at.value, np.abs(at.gradient * h).sum(axis=1) + 0.5 * bend + noise, at.gradient)


def slope(f: TrigSum, x: Array, h: Array, v: Array) -> tuple[Array, Array]:
    """Return the derivative along v in the middle of boxes (N, d), and its change on them, (N,)."""
    most = np.maximum(np.abs(x) + h, 1e-150)
    along, reach = np.abs(v @ f.rate.T), h @ np.abs(f.rate).T
    if len(f.slides):
        along, reach = along + (np.abs(v) / most) @ f.power.T, reach + (h / most) @ f.power.T
    error = (f.sizes(most) * along * (reach + f.noise * _grown(x)[:, None])).sum(axis=1)
    return np.einsum("nd,nd->n", f.at(x).gradient, v), error


def growth_steps(f: TrigSum, x: Array, free: Array) -> Array:
    """Return directions (N, d) in which all terms grow by themselves, as far as possible."""
    # Least squares for ``k_t v = d f / d (k_t x)``, in joints that are ``free`` (N, d) only.
    wave = -f.amplitude * np.sin(x @ f.rate.T + f.phase)
    K = f.rate[None] * free[:, None, :]
    gram = K.transpose(0, 2, 1) @ K
    trace = np.einsum("kii->k", gram)[:, None, None]
    gram = gram + np.eye(x.shape[1]) * np.maximum(1e-9 * trace, 1e-300)
    right = np.einsum("ntd,nt->nd", K, wave)[..., None]
    return np.asarray(np.linalg.solve(gram, right)[..., 0] * free)


def _grown(x: Array) -> Array:
    return np.asarray(1 + np.abs(x).max(axis=1, initial=0.0))


@dataclass(frozen=True, eq=False)
class Ground:
    """What is subdivided."""

    terms: tuple[TrigSum, ...]  # the equations
    # low and high: (d,): the box
    low: Array
    high: Array
    circle: Bool  # (d,): which joints turn endlessly
    scale: Array  # (d,): what counts as one radian: 1, or a length for slides

    @property
    def d(self) -> int:
        """Number of joints."""
        return len(self.low)

    @cached_property
    def first(self) -> Ints:
        """Boxes along each joint to begin with: none is wider than a radian or a length."""
        return np.maximum(1, np.ceil((self.high - self.low) / self.scale - 1e-9)).astype(np.int64)

    @cached_property
    def flips(self) -> Ints:
        """Bits of the equations that change sign once round each joint, (d,)."""
        odd = [
            [bool((np.round(2 * t.rate[:, j]).astype(np.int64) % 2 != 0).any()) for t in self.terms]
            for j in range(self.d)
        ]
        bits = [sum(1 << i for i, o in enumerate(row) if o) for row in odd]
        return np.where(self.circle, np.array(bits, dtype=np.int64), 0)

    def boxes(self, level: Ints, index: Ints) -> tuple[Array, Array]:
        """Middles and half widths (N, d) of boxes."""
        width = (self.high - self.low) / (self.first * 2.0 ** level[:, None])
        return self.low + (index + 0.5) * width, width / 2

    def sides(self, level: Ints, index: Ints) -> Array:
        """Return which limits boxes touch, (N, d): 1 the lower, -1 the upper, NaN both, else 0."""
        count = self.first * 2 ** level[:, None]
        side = np.where(~self.circle & (index == 0), 1.0, 0.0)
        side -= np.where(~self.circle & (index == count - 1), 1.0, 0.0)
        return np.where(~self.circle & (count == 1), np.nan, side)


@dataclass(frozen=True, eq=False)
class Leaves:
    """Boxes that fill the ground."""

    level: Ints  # (N,): how often each was halved
    index: Ints  # (N, d): place on the grid of its level
    sign: Ints  # (N, layers, m): of the equations; 0 where unknown
    regular: Bool  # (N,): whether certain or regular on every layer

    @cached_property
    def _order(self) -> tuple[NDArray[np.bytes_], Ints]:
        """Keys of the boxes in order, and which boxes these are."""
        keys = _keys(self.level, self.index)
        order = np.argsort(keys)
        return keys[order], order

    def find(self, level: Ints, index: Ints) -> Ints:
        """Return which boxes have these levels and places; -1 for none."""
        (keys, rows), wanted = self._order, _keys(level, index)
        pos = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[pos] == wanted, rows[pos], -1)

    def take(self, which: Bool) -> Leaves:
        """Some of them."""
        return Leaves(self.level[which], self.index[which], self.sign[which], self.regular[which])

    def halves(self, which: Bool) -> tuple[Ints, Ints]:
        """Levels and places of what some of the boxes are halved into along every joint."""
        d = self.index.shape[1]
        corner = np.stack(np.meshgrid(*([np.arange(2)] * d), indexing="ij"), axis=-1).reshape(-1, d)
        index = (2 * self.index[which][:, None, :] + corner).reshape(-1, d)
        return np.repeat(self.level[which] + 1, 2**d), index

    def with_more(self, more: Leaves) -> Leaves:
        """These and others."""
        names = ("level", "index", "sign", "regular")
        return Leaves(*(np.concatenate([getattr(self, k), getattr(more, k)]) for k in names))


def _keys(level: Ints, index: Ints) -> NDArray[np.bytes_]:
    """Levels and places as bytes: one integer has no room for many joints."""
    both = np.column_stack([level, index]).astype(">u4")
    return both.view(f"S{4 * both.shape[1]}").ravel()


def is_regular(
    ground: Ground, known: Sequence[OnBoxes], open_: Sequence[int], x: Array, h: Array, side: Array
) -> Bool:
    """Return whether the product of all |f| grows somewhere, for all open equations' signs."""
    if len(open_) > ground.d:
        return np.zeros(len(x), dtype=bool)
    good = np.ones(len(x), dtype=bool)
    for s in product((-1.0, 1.0), repeat=len(open_)):
        grows = ~good
        for together in (True, False):
            left = np.flatnonzero(~grows)
            if not len(left):
                break
            here = [k.take(left) for k in known]
            v = _direction(ground, here, open_, s, x[left], side[left], together)
            grows[left] = _grows(ground, here, open_, s, x[left], h[left], v)
        left = np.flatnonzero(~grows)
        if len(left) and len(ground.terms) == 1:
            grows[left] = _bends(ground, s[0], x[left], h[left], side[left])
        good &= grows
        if not good.any():
            break
    return good


def _grows(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    h: Array,
    v: Array,
) -> Bool:
    """Whether along v every open s f grows on the box, and the product of all |f| with them."""
    sure = np.ones(len(x), dtype=bool)
    growth = np.zeros(len(x))
    for i, (terms, k) in enumerate(zip(ground.terms, known, strict=True)):
        rise, error = slope(terms, x, h, v)
        if len(ground.terms) == 1 or i in open_:
            rate = s[open_.index(i)] * rise - error
            sure &= rate > 0
            growth += np.maximum(rate, 0) / (np.abs(k.value) + k.swing)
        else:
            growth -= (np.abs(rise) + error) / (np.abs(k.value) - k.swing)
    return np.asarray(sure & (growth > 0))


def _direction(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    side: Array,
    together: bool,
) -> Array:
    """Directions in which all open s f grow to first order, none of them out of a limit.

    Those in which every term grows, if ``together``, and there is one equation without slides.
    """
    terms, free = ground.terms[open_[0]], np.ones(side.shape) * ground.scale
    together &= len(open_) == 1 and not len(terms.slides)
    A = np.stack([known[i].gradient for i in open_], axis=1)  # (K, u, d)
    for _ in range(3):
        B = A * free[:, None, :]
        if together:
            v = s[0] * growth_steps(terms, x, free)
        elif len(s) == 1:
            v = s[0] * B[:, 0] * free
        else:
            gram = B @ B.transpose(0, 2, 1)
            trace = np.einsum("kii->k", gram)[:, None, None]
            gram = gram + np.eye(len(s)) * np.maximum(trace * 1e-12, 1e-300)
            size = np.sqrt(np.einsum("kii->ki", gram))
            weight = np.linalg.solve(gram, (np.array(s) * size)[..., None])[..., 0]
            v = np.einsum("kud,ku->kd", B, weight) * free
        outward = np.where(np.isnan(side), v != 0, side * v < 0)
        v, free = np.where(outward, 0.0, v), np.where(outward, 0.0, free)
        if not outward.any():
            break
    return v


def _bends(ground: Ground, s: float, x: Array, h: Array, side: Array) -> Bool:
    """Return whether s f is convex all over each box along some line that keeps to the limits."""
    terms = ground.terms[0]
    if len(terms.slides):
        return np.zeros(len(x), dtype=bool)
    free = np.where(side == 0, ground.scale, 0.0)
    wave = -terms.amplitude * np.cos(x @ terms.rate.T + terms.phase)
    H = np.einsum("nt,ti,tj->nij", s * wave, terms.rate, terms.rate, optimize=True)
    v = np.linalg.eigh(H * free[:, :, None] * free[:, None, :])[1][:, :, -1] * free
    twice = (v @ terms.rate.T) ** 2
    change = h @ np.abs(terms.rate).T + terms.noise * _grown(x)[:, None]
    error = (terms.amplitude * twice * change).sum(axis=1)
    return np.asarray(s * (wave * twice).sum(axis=1) > error)
