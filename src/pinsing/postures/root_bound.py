"""Where an equation of one joint has one real root beside the known one: proven on a torus.

With ``x = tan(d / 2)``, d the angle from the known root of P, P (1 + x^2)^2 / 2x is a cubic in x
whose coefficients are trigonometric polynomials of q2 and q3. It has one real root, x = infinity
counted, exactly where its discriminant is negative. That is of degree 4 in q2 and 8 in q3: a
trigonometric sum, of which boxes show that it is negative wherever it may have its largest value.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pinsing._types import Array
from pinsing.algebra.trig_sum import TrigSum

MOST = 800_000
"""Boxes after which a proof is given up."""
_DEGREES = (4, 8)


@dataclass(frozen=True, eq=False)
class Deflated:
    """The cubic of three turning joints; vectors as in `pinsing.postures.three_joints`."""

    e: Array
    tau: Array
    constant: Array
    cosine: Array
    sine: Array

    def discriminant(self, x: Array) -> Array:
        """The discriminant at q2 and q3 (N, 2): (N,)."""
        waves = np.stack([np.cos(x), np.sin(x)])
        return _discriminant(*self._cubic(waves[:, :, 0], waves[:, :, 1], 1.0))

    def _cubic(self, second: Array, third: Array, s: float) -> tuple[Array, Array, Array, Array]:
        """Coefficients, given cosine and sine of both joints; with s = -1 bounds of their sizes.

        These are had from absolute values of all numbers, with cosines and sines of 1.
        """

        def own(a: Array) -> Array:
            return a if s > 0 else np.abs(a)

        def turning(a: Array) -> tuple[Array, Array]:  # derivatives of a cosine and a sine
            return a[1] * third[0] - s * a[0] * third[1], -s * (a[0] * third[0] + a[1] * third[1])

        constant, cosine, sine, tau, e = map(
            own, (self.constant, self.cosine, self.sine, self.tau, self.e)
        )
        v = constant[:, None] + cosine[:, None] * third[0] + sine[:, None] * third[1]
        u = (second[0] * v[0] - s * second[1] * v[1], second[1] * v[0] + second[0] * v[1])
        T, E = (k[0] * u[0] + k[1] * u[1] for k in (tau, e))
        n = 2 * np.array([constant @ cosine, constant @ sine])
        rise = np.array([cosine[2], sine[2]])
        # What v_z, h and |v|^2 are linear in: 2 x (slope - bend x) / (1 + x^2) from the root on.
        V, H, N = turning(rise), turning(n + 2 * tau[2] * rise), turning(n)
        a2, s2 = float(tau[:2] @ tau[:2]), float(e[:2] @ e[:2])
        over = 1 + e[2] ** 2 / s2
        line = [
            -s * T * H[k] / a2 - s * 2 * e[2] / s2 * E * V[k] - s * N[k] + 2 * v[2] * V[k]
            for k in (0, 1)
        ]
        square = [
            0.5 / a2 * H[0] ** 2 + 2 * over * V[0] ** 2,
            H[0] * H[1] / a2 + 4 * over * V[0] * V[1],
            0.5 / a2 * H[1] ** 2 + 2 * over * V[1] ** 2,
        ]
        return line[0], line[1] + square[0], line[0] + square[1], line[1] + square[2]

    @cached_property
    def rounding(self) -> float:
        """A bound of the error of a computed discriminant: it comes of some 120 roundings."""
        ones = np.ones((2, 1))
        return 2e-14 * float(_discriminant(*self._cubic(ones, ones, -1.0), sign=-1.0)[0])

    def expanded(self) -> TrigSum:
        """The discriminant as a sum in q2 and q3."""
        shape = tuple(4 * d for d in _DEGREES)
        grid = np.stack(np.meshgrid(*(2 * np.pi / m * np.arange(m) for m in shape), indexing="ij"))
        values = self.discriminant(grid.reshape(2, -1).T).reshape(shape)
        waves = np.fft.fft2(values) / values.size
        rates, terms = [[0, 0]], [waves[0, 0].real]
        for i in range(_DEGREES[0] + 1):
            for j in range(-_DEGREES[1], _DEGREES[1] + 1):
                if (i, j) > (0, 0):
                    rates.append([i, j])
                    terms.append(2 * waves[i, j])
        return TrigSum(np.abs(terms), np.angle(terms), rates, np.zeros_like(rates), 1e-12)


def _discriminant(c0: Array, c1: Array, c2: Array, c3: Array, sign: float = 1.0) -> Array:
    return np.asarray(
        18 * c3 * c2 * c1 * c0
        - sign * 4 * c2**3 * c0
        + c2**2 * c1**2
        - sign * 4 * c3 * c1**3
        - sign * 27 * c3**2 * c0**2
    )


def one_root_left(cubic: Deflated, most: int = MOST) -> bool:
    """Return True if the discriminant is proven negative all over the torus of q2 and q3.

    It is largest somewhere, where no box around shows that it grows in some direction. False where
    it is not negative somewhere, or was not seen to be with ``most`` boxes.
    """
    f, made = cubic.expanded(), 0
    squares = f.rate[:, [0, 0, 1, 1]] * f.rate[:, [0, 1, 0, 1]]
    steep = np.linalg.norm(f.rate, axis=1)
    # Errors of a gradient. The sum of the squares of the coefficients' errors is the mean of the
    # squares of the values' (Parseval); two of each term count.
    noise = np.sqrt(2 * len(steep)) * cubic.rounding + 1e-13 * f.amplitude.sum()
    noise *= steep.max()
    width = 2 * np.pi / 32
    at = width * (np.arange(32) + 0.5) - np.pi
    x = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    while len(x):
        made += len(x)
        h = width / 2 * (1 + 1e-9)  # a little too wide: rounding leaves no gap
        value = cubic.discriminant(x) + cubic.rounding
        if made > most or (value >= 0).any():
            return False
        angle = x @ f.rate.T + f.phase
        gradient = -(f.amplitude * np.sin(angle)) @ f.rate
        bend = -(f.amplitude * np.cos(angle)) @ squares
        reach = h * np.abs(f.rate).sum(axis=1)
        swing = h * np.abs(gradient).sum(axis=1) + h**2 / 2 * np.abs(bend).sum(axis=1)
        top = value + swing + f.amplitude @ reach**3 / 6 + 4 * h * noise
        # The derivative along the gradient, less how much it changes in the box.
        size = np.linalg.norm(gradient, axis=1)
        change = np.abs(np.einsum("nij,nj->ni", bend.reshape(-1, 2, 2), gradient)).sum(axis=1)
        rest = (f.amplitude * steep) @ reach**2 / 2 + 4 * noise
        x = x[(top >= 0) & (size**2 <= h * change + size * rest)]
        width /= 2
        corners = width / 2 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        x = (x[:, None] + corners).reshape(-1, 2)
    return True
