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
from functools import cached_property

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool, Ints
from pinsing.algebra.equation import Equation

_SLACK = 1e-12
_FEW = 1 << 14


@dataclass(frozen=True, eq=False)
class OnBoxes:
    """What is known of one equation on N boxes.

    Attributes
    ----------
    value : (N,) array
        In the middle.
    swing : (N,) array
        The equation is within value - swing and value + swing on the box.
    gradient : (N, d) array
        In the middle.
    """

    value: Array
    swing: Array
    gradient: Array

    def take(self, rows: Ints) -> OnBoxes:
        """What is known of some of the boxes."""
        return OnBoxes(self.value[rows], self.swing[rows], self.gradient[rows])


@dataclass(frozen=True, eq=False)
class Terms:
    """An equation over d of the arm's joints, ready for boxes.

    Attributes
    ----------
    rate : (T, d) array
        Multiples of the joint values.
    power : (T, d) array of int
        Exponents of slides.
    size, phase : (T,) arrays
        ``f = sum size prod x^power cos(rate x + phase)``.
    slack : float
        Rounding, relative to the terms.
    """

    rate: Array
    power: Array
    size: Array
    phase: Array
    slack: float

    @classmethod
    def of(cls, equation: Equation, joints: tuple[int, ...]) -> Terms:
        """Terms of an equation in some joints, which are all that it has."""
        full = equation.frequencies / 2
        columns = list(joints)
        return cls(
            rate=np.ascontiguousarray(full[:, columns]),
            power=np.ascontiguousarray(equation.powers[:, columns]),
            size=np.hypot(equation.cos, equation.sin),
            phase=np.arctan2(-equation.sin, equation.cos) + full @ equation.shift,
            slack=max(_SLACK, 4 * equation.accuracy),
        )

    @property
    def d(self) -> int:
        """Number of joints."""
        return int(self.rate.shape[1])

    def __call__(self, x: Array) -> Array:
        """Values at x (..., d)."""
        value = self.size * np.cos(x @ self.rate.T + self.phase)
        if self.power.any():
            value = value * np.prod(x[..., None, :] ** self.power, axis=-1)
        return np.asarray(value.sum(axis=-1))

    def on(self, x: Array, h: Array) -> OnBoxes:
        """What is known on boxes of middles x and half widths h, both (N, d)."""
        if len(x) > _FEW:
            parts = [self.on(x[i : i + _FEW], h[i : i + _FEW]) for i in range(0, len(x), _FEW)]
            return OnBoxes(
                *(np.concatenate([getattr(p, k) for p in parts]) for k in OnBoxes.__annotations__)
            )
        wave, gradient = self._expand(x)
        top, reach = self._reach(x, h)
        noise = self.slack * top.sum(axis=1) * _grown(x)
        swing = np.abs(gradient * h).sum(axis=1) + 0.5 * (top * reach**2).sum(axis=1) + noise
        return OnBoxes(wave.sum(axis=1), swing, gradient)

    def slope(self, x: Array, h: Array, v: Array) -> tuple[Array, Array]:
        """Derivative along v in the middle of boxes, and by how much it differs on them, (N,).

        All arguments (N, d).
        """
        gradient = self._expand(x)[1]
        top, reach = self._reach(x, h)
        along = np.abs(v @ self.rate.T)
        if self.power.any():
            safe = np.maximum(np.abs(x) + h, 1e-150)
            along = along + (np.abs(v) / safe) @ self.power.T
        rounding = self.slack * _grown(x)[:, None]
        error = (top * along * (reach + rounding)).sum(axis=1)
        return np.einsum("nd,nd->n", gradient, v), error

    def curvature(self, x: Array) -> Array:
        """Second derivatives (N, d, d) at x (N, d), of an equation without slides."""
        wave = -self.size * np.cos(x @ self.rate.T + self.phase)
        return np.asarray(np.einsum("nt,ti,tj->nij", wave, self.rate, self.rate, optimize=True))

    def bend(self, x: Array, h: Array, v: Array) -> tuple[Array, Array]:
        """Second derivative along v in the middle of boxes, and by how much it differs, (N,).

        All arguments (N, d); of an equation without slides.
        """
        wave = -self.size * np.cos(x @ self.rate.T + self.phase)
        twice = (v @ self.rate.T) ** 2
        change = h @ np.abs(self.rate).T + self.slack * _grown(x)[:, None]
        return (wave * twice).sum(axis=1), (self.size * twice * change).sum(axis=1)

    def steps(self, x: Array, free: Array) -> Array:
        """Directions (N, d) in which every term grows by itself, as far as these go together.

        Least squares for ``k_t v = d f / d (k_t x)``, in joints that are ``free`` (N, d) only.
        """
        phase = x @ self.rate.T + self.phase
        wave = -self.size * np.sin(phase)
        K = self.rate[None] * free[:, None, :]
        gram = K.transpose(0, 2, 1) @ K
        trace = np.einsum("kii->k", gram)[:, None, None]
        gram = gram + np.eye(self.d) * np.maximum(1e-9 * trace, 1e-300)
        right = np.einsum("ntd,nt->nd", K, wave)[..., None]
        return np.asarray(np.linalg.solve(gram, right)[..., 0] * free)

    def _expand(self, x: Array) -> tuple[Array, Array]:
        """Terms (N, T) and gradient (N, d)."""
        phase = x @ self.rate.T + self.phase
        wave, turned = self.size * np.cos(phase), -self.size * np.sin(phase)
        if not self.power.any():
            return wave, turned @ self.rate
        product = np.prod(x[:, None, :] ** self.power, axis=-1)
        gradient = (turned * product) @ self.rate
        for j in np.flatnonzero(self.power.any(axis=0)):
            lowered = self.power.copy()
            lowered[:, j] = np.maximum(lowered[:, j] - 1, 0)
            lower = np.prod(x[:, None, :] ** lowered, axis=-1)
            gradient[:, j] += (wave * self.power[:, j] * lower).sum(axis=1)
        return wave * product, gradient

    def _reach(self, x: Array, h: Array) -> tuple[Array, Array]:
        """Largest size of each term on the boxes, and S, both (N, T)."""
        reach = h @ np.abs(self.rate).T
        if not self.power.any():
            return np.broadcast_to(self.size, reach.shape), reach
        most = np.abs(x) + h
        top = self.size * np.prod(most[:, None, :] ** self.power, axis=-1)
        return top, reach + (h / np.maximum(most, 1e-150)) @ self.power.T


def _grown(x: Array) -> Array:
    return np.asarray(1 + np.abs(x).max(axis=1, initial=0.0))


_FIRST = 1.0  # radians, or lengths of the range: largest width of a box to begin with


@dataclass(frozen=True, eq=False)
class Ground:
    """What is subdivided.

    Attributes
    ----------
    terms : tuple of Terms
        The equations.
    low, high : (d,) arrays
        The box.
    circle : (d,) array of bool
        Which joints turn endlessly.
    scale : (d,) array
        What counts as one radian: 1, or a length for slides.
    """

    terms: tuple[Terms, ...]
    low: Array
    high: Array
    circle: Bool
    scale: Array

    @property
    def d(self) -> int:
        """Number of joints."""
        return len(self.low)

    @cached_property
    def first(self) -> Ints:
        """Boxes along each joint to begin with."""
        return np.maximum(1, np.ceil((self.high - self.low) / self.scale / _FIRST - 1e-9)).astype(
            np.int64
        )

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
        """Which limits boxes touch, (N, d): 1 the lower, -1 the upper, NaN both, else 0."""
        count = self.first * 2 ** level[:, None]
        side = np.where(~self.circle & (index == 0), 1.0, 0.0)
        side -= np.where(~self.circle & (index == count - 1), 1.0, 0.0)
        return np.where(~self.circle & (count == 1), np.nan, side)


@dataclass(frozen=True, eq=False)
class Leaves:
    """Boxes that fill the ground.

    Attributes
    ----------
    level : (N,) array of int
        How often each was halved.
    index : (N, d) array of int
        Place on the grid of its level.
    sign : (N, m) array of int
        Of the equations; 0 where unknown.
    regular : (N,) array of bool
        Whether certain or regular.
    """

    level: Ints
    index: Ints
    sign: Ints
    regular: Bool

    @property
    def certain(self) -> Bool:
        """Where all signs are known, (N,)."""
        return np.asarray((self.sign != 0).all(axis=1))

    @cached_property
    def _order(self) -> dict[int, tuple[Ints, Ints]]:
        """Keys of the boxes of each level in order, and which boxes these are."""
        out = {}
        for k in np.unique(self.level):
            rows = np.flatnonzero(self.level == k)
            keys = self._key(self.index[rows])
            order = np.argsort(keys)
            out[int(k)] = keys[order], rows[order]
        return out

    @cached_property
    def _widest(self) -> int:
        return int(self.index.max()) + 2

    def _key(self, index: Ints) -> Ints:
        out = np.zeros(len(index), dtype=np.int64)
        for j in range(index.shape[1]):
            out = out * self._widest + np.minimum(index[:, j], self._widest - 1)
        return out

    def find(self, level: Ints, index: Ints) -> Ints:
        """Which boxes have these levels and places; -1 for none."""
        hit = np.full(len(level), -1, dtype=np.int64)
        for k, (keys, rows) in self._order.items():
            mine = np.flatnonzero(level == k)
            wanted = self._key(index[mine])
            pos = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            hit[mine] = np.where(keys[pos] == wanted, rows[pos], -1)
        return hit

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
        return Leaves(
            np.concatenate([self.level, more.level]),
            np.concatenate([self.index, more.index]),
            np.concatenate([self.sign, more.sign]),
            np.concatenate([self.regular, more.regular]),
        )


def is_regular(
    ground: Ground, known: Sequence[OnBoxes], open_: Sequence[int], x: Array, h: Array, side: Array
) -> Bool:
    """Whether for all signs of the open equations the product of all |f| grows somewhere to.

    ``known`` is of the same K boxes as x, h and side, (K, d).
    """
    if len(open_) > ground.d:
        return np.zeros(len(x), dtype=bool)
    good = np.ones(len(x), dtype=bool)
    for bits in range(1 << len(open_)):
        s = [1.0 if bits >> i & 1 else -1.0 for i in range(len(open_))]
        grows = np.zeros(len(x), dtype=bool)
        for direction in (_together, _by_gradient):
            left = np.flatnonzero(good & ~grows)
            if not len(left):
                break
            here = [k.take(left) for k in known]
            v = direction(ground, here, open_, s, x[left], side[left])
            grows[left] = _grows(ground, here, open_, s, x[left], h[left], v)
        left = np.flatnonzero(good & ~grows)
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
        if len(ground.terms) == 1 or i in open_:
            slope, error = terms.slope(x, h, v)
            rate = s[open_.index(i)] * slope - error
            sure &= rate > 0
            growth += np.maximum(rate, 0) / (np.abs(k.value) + k.swing)
        else:
            slope, error = terms.slope(x, h, v)
            growth -= (np.abs(slope) + error) / (np.abs(k.value) - k.swing)
    return np.asarray(sure & (growth > 0))


def _inward(v: Array, side: Array, free: Array) -> tuple[Array, Array, bool]:
    """Directions without what leads out of a limit, and the joints that are left."""
    outward = np.where(np.isnan(side), v != 0, side * v < 0)
    return np.where(outward, 0.0, v), np.where(outward, 0.0, free), bool(outward.any())


def _together(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    side: Array,
) -> Array:
    """Directions in which every term of the only open equation grows; else `_by_gradient`."""
    terms = ground.terms[open_[0]]
    if len(open_) > 1 or terms.power.any():
        return _by_gradient(ground, known, open_, s, x, side)
    free = np.ones(side.shape) * ground.scale
    for _ in range(3):
        v, free, changed = _inward(s[0] * terms.steps(x, free), side, free)
        if not changed:
            break
    return v


def _by_gradient(
    ground: Ground,
    known: Sequence[OnBoxes],
    open_: Sequence[int],
    s: Sequence[float],
    x: Array,
    side: Array,
) -> Array:
    """Directions in which all open s f grow to first order, none of them out of a limit."""
    A = np.stack([known[i].gradient for i in open_], axis=1)  # (K, u, d)
    free = np.ones(side.shape) * ground.scale
    for _ in range(3):
        B = A * free[:, None, :]
        if len(s) == 1:
            v = s[0] * B[:, 0] * free
        else:
            gram = B @ B.transpose(0, 2, 1)
            trace = np.einsum("kii->k", gram)[:, None, None]
            gram = gram + np.eye(len(s)) * np.maximum(trace * 1e-12, 1e-300)
            size = np.sqrt(np.einsum("kii->ki", gram))
            weight = np.linalg.solve(gram, (np.array(s) * size)[..., None])[..., 0]
            v = np.einsum("kud,ku->kd", B, weight) * free
        v, free, changed = _inward(v, side, free)
        if not changed:
            break
    return v


def growing(terms: Terms, scale: Array, known: OnBoxes, x: Array, h: Array, side: Array) -> Bool:
    """Whether one equation has no largest |f| of either sign on boxes, (K,).

    Parameters
    ----------
    terms : Terms
        The equation.
    scale : (d,) array
        What counts as one radian.
    known : OnBoxes
        What is known of it on the boxes.
    x, h, side : (K, d) arrays
        Middles, half widths, and limits that the boxes touch.
    """
    nothing = np.zeros(len(scale))
    ground = Ground((terms,), nothing, nothing, nothing.astype(bool), scale)
    return is_regular(ground, [known], [0], x, h, side)


def _bends(ground: Ground, s: float, x: Array, h: Array, side: Array) -> Bool:
    """Whether s f is convex all over each box along some line that keeps to the limits."""
    terms = ground.terms[0]
    if terms.power.any():
        return np.zeros(len(x), dtype=bool)
    free = np.where(side == 0, ground.scale, 0.0)
    H = s * terms.curvature(x) * free[:, :, None] * free[:, None, :]
    v = np.linalg.eigh(H)[1][:, :, -1] * free
    bend, error = terms.bend(x, h, v)
    return np.asarray(s * bend > error)
