"""Where an equation of one joint has one real root beside the known one: proven on a torus.

With ``x = tan(d / 2)``, d the angle from the known root of P, P (1 + x^2)^2 / 2x is a cubic in x
whose coefficients are trigonometric polynomials of q2 and q3. It has one real root, x = infinity
counted, exactly where its discriminant is negative. That is shown box by box with intervals.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool

MOST = 800_000
_SLACK = 1e-14
"""Rounding of a sum of a few products, relative to these; with room."""


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Numbers between ``low`` and ``high``, (N,) each."""

    low: Array
    high: Array

    def __add__(self, other: Enclosure) -> Enclosure:
        return Enclosure(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.high, -self.low)

    def __sub__(self, other: Enclosure) -> Enclosure:
        return self + -other

    def __mul__(self, other: Enclosure) -> Enclosure:
        ends = np.stack(
            [a * b for a in (self.low, self.high) for b in (other.low, other.high)], axis=0
        )
        return Enclosure(ends.min(axis=0), ends.max(axis=0))

    def times(self, k: float) -> Enclosure:
        """All of them times a number."""
        return Enclosure(self.low * k, self.high * k) if k >= 0 else (-self).times(-k)

    def plus(self, k: float) -> Enclosure:
        """All of them and a number."""
        return Enclosure(self.low + k, self.high + k)

    @property
    def squared(self) -> Enclosure:
        """Their squares."""
        a, b = self.low**2, self.high**2
        low = np.where((self.low < 0) & (self.high > 0), 0.0, np.minimum(a, b))
        return Enclosure(low, np.maximum(a, b))

    @property
    def size(self) -> Array:
        """Largest absolute value."""
        return np.maximum(np.abs(self.low), np.abs(self.high))


def wave(c: float, s: float, low: Array, high: Array) -> Enclosure:
    """``c cos x + s sin x`` for x from low to high."""
    size, at = float(np.hypot(c, s)), float(np.arctan2(s, c))
    a, b = low - at, high - at
    ends = np.stack([np.cos(a), np.cos(b)])
    top = np.floor(b / (2 * np.pi)) >= np.ceil(a / (2 * np.pi))
    bottom = np.floor((b - np.pi) / (2 * np.pi)) >= np.ceil((a - np.pi) / (2 * np.pi))
    return Enclosure(
        size * np.where(bottom, -1.0, ends.min(axis=0)),
        size * np.where(top, 1.0, ends.max(axis=0)),
    )


@dataclass(frozen=True, eq=False)
class Dual:
    """Values on boxes, and the derivatives by q2 and q3 there."""

    value: Enclosure
    slope: tuple[Enclosure, Enclosure]

    def __neg__(self) -> Dual:
        return Dual(-self.value, (-self.slope[0], -self.slope[1]))

    def __mul__(self, other: Dual) -> Dual:
        a, b = (_sum(self.value * other.slope[k], self.slope[k] * other.value) for k in (0, 1))
        return Dual(self.value * other.value, (a, b))

    def times(self, k: float) -> Dual:
        """All of them times a number."""
        return Dual(self.value.times(k), (self.slope[0].times(k), self.slope[1].times(k)))

    def plus(self, k: float) -> Dual:
        """All of them and a number."""
        return Dual(self.value.plus(k), self.slope)

    @property
    def squared(self) -> Dual:
        """Their squares."""
        twice = self.value.times(2.0)
        return Dual(self.value.squared, (twice * self.slope[0], twice * self.slope[1]))


@dataclass(frozen=True, eq=False)
class Deflated:
    """The cubic of three turning joints; vectors as in `pinsing.postures.three_joints`."""

    e: Array
    tau: Array
    constant: Array
    cosine: Array
    sine: Array

    @cached_property
    def _h(self) -> Array:
        """Coefficients of cos and sin in |v|^2 and in h, (2, 2)."""
        n = 2 * np.array([self.constant @ self.cosine, self.constant @ self.sine])
        m = np.array([self.cosine[2], self.sine[2]])
        return np.stack([n, n + 2 * self.tau[2] * m])

    def open_boxes(self, low: Array, high: Array) -> Bool:
        """Boxes of q2 and q3 (N, 2) where the discriminant may have its largest value, and be >= 0.

        It has that where both derivatives are zero: the torus has no edge.
        """
        whole, half = self._discriminant(low, high), (high - low) / 2
        swing = sum(whole.slope[k].size * half[:, k] for k in (0, 1)) * (1 + _SLACK)
        top = np.minimum(whole.value.high, self.at((low + high) / 2).high + swing)
        level = [(s.low <= 0) & (s.high >= 0) for s in whole.slope]
        return np.asarray((top >= 0) & level[0] & level[1])

    def at(self, x: Array) -> Enclosure:
        """The discriminant at points (N, 2), with its rounding."""
        return self._discriminant(x, x).value

    def _discriminant(self, low: Array, high: Array) -> Dual:
        (n, h), c, s = self._h, self.cosine, self.sine

        def turning(c: float, s: float) -> Dual:
            return _wave(c, s, low, high, (0, 1))

        rise = np.array([c[2], s[2]])
        # What v_z, h and |v|^2 are linear in: 2 x (slope - bend x) / (1 + x^2) from the root on.
        V, H, N = ((turning(k[1], -k[0]), -turning(k[0], k[1])) for k in (rise, h, n))
        vz = turning(c[2], s[2]).plus(float(self.constant[2]))
        T, E = self._along(self.tau, low, high), self._along(self.e, low, high)
        a2 = float(self.tau[:2] @ self.tau[:2])
        s2 = float(self.e[:2] @ self.e[:2])
        ez = float(self.e[2])
        line = [
            _total(
                (T * H[k]).times(-1 / a2),
                (E * V[k]).times(-2 * ez / s2),
                -N[k],
                (vz * V[k]).times(2.0),
            )
            for k in (0, 1)
        ]
        over = 1 + ez * ez / s2
        square = [
            _total(H[0].squared.times(0.5 / a2), V[0].squared.times(2 * over)),
            _total((H[0] * H[1]).times(1 / a2), (V[0] * V[1]).times(4 * over)),
            _total(H[1].squared.times(0.5 / a2), V[1].squared.times(2 * over)),
        ]
        c0 = line[0]
        c1 = _total(line[1], square[0])
        c2 = _total(line[0], square[1])
        c3 = _total(line[1], square[2])
        return _total(
            (c3 * c2 * (c1 * c0)).times(18.0),
            (c2.squared * (c2 * c0)).times(-4.0),
            c2.squared * c1.squared,
            (c3 * c1 * c1.squared).times(-4.0),
            (c3.squared * c0.squared).times(-27.0),
        )

    def _along(self, k: Array, low: Array, high: Array) -> Dual:
        """The part of ``Rz(q2) v`` along a vector, heights left out."""
        parts = []
        # A product of cosines is half a sum of cosines of sums: no width is counted twice.
        for place, v in enumerate((self.constant, self.cosine, self.sine)):
            C, S = float(k[:2] @ v[:2]), float(k[1] * v[0] - k[0] * v[1])
            if place == 0:
                parts.append(_wave(C, S, low, high, (1, 0)))
            elif place == 1:
                parts.append(_wave(C / 2, S / 2, low, high, (1, 1)))
                parts.append(_wave(C / 2, S / 2, low, high, (1, -1)))
            else:
                parts.append(_wave(-S / 2, C / 2, low, high, (1, 1)))
                parts.append(_wave(S / 2, -C / 2, low, high, (1, -1)))
        return _total(*parts)


def _wave(c: float, s: float, low: Array, high: Array, k: tuple[int, int]) -> Dual:
    """``c cos x + s sin x`` for ``x = k . (q2, q3)`` on boxes."""
    a = low[:, 0] * k[0] + (low if k[1] >= 0 else high)[:, 1] * k[1]
    b = high[:, 0] * k[0] + (high if k[1] >= 0 else low)[:, 1] * k[1]
    slope = wave(s, -c, a, b)
    return Dual(wave(c, s, a, b), (slope.times(k[0]), slope.times(k[1])))


def _total(*parts: Dual) -> Dual:
    """Sum of values, and of derivatives."""
    slopes = (_sum(*(p.slope[k] for p in parts)) for k in (0, 1))
    return Dual(_sum(*(p.value for p in parts)), (next(slopes), next(slopes)))


def _sum(*parts: Enclosure) -> Enclosure:
    """Their sum, made wider by what rounding may have done to it and to them."""
    low, high = sum(p.low for p in parts), sum(p.high for p in parts)
    slack = _SLACK * sum(p.size for p in parts)
    return Enclosure(np.asarray(low - slack), np.asarray(high + slack))


def one_root_left(cubic: Deflated, most: int = MOST) -> bool:
    """Whether the discriminant is proven negative all over the torus of q2 and q3.

    False where it is not negative somewhere, or was not seen to be with ``most`` boxes.
    """
    count = 32
    edge = np.linspace(-np.pi, np.pi, count + 1)
    # Ends that are a little too wide: rounding of pi leaves no gap.
    edge[[0, -1]] += [-1e-9, 1e-9]
    first, second = (g.ravel() for g in np.meshgrid(edge[:-1], edge[:-1], indexing="ij"))
    high1, high2 = (g.ravel() for g in np.meshgrid(edge[1:], edge[1:], indexing="ij"))
    low, high = np.stack([first, second], axis=1), np.stack([high1, high2], axis=1)
    made = 0
    while len(low):
        made += len(low)
        if made > most:
            return False
        middle = (low + high) / 2
        if (cubic.at(middle).high >= 0).any():
            return False
        left = cubic.open_boxes(low, high)
        low, high, middle = low[left], high[left], middle[left]
        corners = []
        for i in (0, 1):
            for j in (0, 1):
                pick = np.array([i, j], dtype=bool)
                corners.append((np.where(pick, middle, low), np.where(pick, high, middle)))
        low = np.concatenate([c[0] for c in corners])
        high = np.concatenate([c[1] for c in corners])
    return True
