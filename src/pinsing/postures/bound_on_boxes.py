"""Equations on boxes: sign, or a direction in which they grow, proven by Taylor's theorem.

With x the middle of a box and h its half widths, a term ``c prod x^p cos(k x + s)`` differs from
its linear part by at most ``|c| M S^2 / 2``, M the largest product on the box and
``S = sum h_j (|k_j| + p_j / X_j)`` with X the largest |x|; its derivative along v changes by at
most ``|c| M (|k v| + sum p_j |v_j| / X_j) S``. Rounding is covered by a share of the terms' size.
"""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
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
