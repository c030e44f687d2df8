"""Products of single vectors in plain arithmetic: NumPy's general ones take ten times as long."""

from __future__ import annotations

import math

import numpy as np

from pinsing._types import Array

_FAR = 0.01
"""Smallest eigenvalue of normal equations from which on lines are far from parallel."""


def cross(a: Array, b: Array) -> Array:
    """Vector product of a (3,) and b (3,)."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def cross_rows(a: Array, b: Array) -> Array:
    """Vector products (n, 3) of the rows of a and b (n, 3)."""
    return np.asarray(a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]])


def length(a: Array) -> float:
    """Euclidean norm of a (k,)."""
    return math.sqrt(float(a @ a))


def nearest_to_lines(directions: Array, points: Array, least: float = 0.1) -> Array | None:
    """The point (3,) with the least sum of squared distances from lines, in plain arithmetic.

    None unless they are far from parallel: then normal equations lose no more than two digits.

    Parameters
    ----------
    directions : (k, 3) array
        Of unit length.
    points : (k, 3) array
        A point of each line.
    least : float
        The root of the sum of squared sines between the lines and any one direction is to be
        greater; 0.1 if this is less.
    """
    least = max(least**2, _FAR)
    a = d = f = float(len(directions))
    b = c = e = u = v = w = 0.0
    for (x, y, z), (p, q, r) in zip(directions.tolist(), points.tolist(), strict=True):
        a, b, c = a - x * x, b - x * y, c - x * z
        d, e, f = d - y * y, e - y * z, f - z * z
        along = p * x + q * y + r * z
        u, v, w = u + p - along * x, v + q - along * y, w + r - along * z
    low, mid, high = a - least, d - least, f - least  # Sylvester's criterion
    minor = low * mid - b * b
    if low <= 0 or minor <= 0:
        return None
    if high * minor - low * e * e - mid * c * c + 2 * b * c * e <= 0:
        return None
    # The adjugate of the symmetric matrix of rows (a, b, c), (b, d, e), (c, e, f).
    df, bf, be, ae = d * f - e * e, c * e - b * f, b * e - c * d, b * c - a * e
    af, ad = a * f - c * c, a * d - b * b
    whole = a * df + b * bf + c * be
    return np.array(
        [
            (df * u + bf * v + be * w) / whole,
            (bf * u + af * v + ae * w) / whole,
            (be * u + ae * v + ad * w) / whole,
        ]
    )
