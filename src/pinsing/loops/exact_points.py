"""Points of a mechanism as exact numbers, so that three-fold symmetry about z survives.

Where points are turned into each other by a third of a turn, coordinates have square roots of 3.
With y in units of the root of 3 such a turn is rational: (x, Y) -> (-x/2 - 3Y/2, x/2 - Y/2). One
point of each orbit is rounded, the others follow exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array

_SAME = 1e-9
_DECIMALS = 12

Vector = tuple[Fraction, Fraction, Fraction]


@dataclass(frozen=True)
class ExactPoints:
    """Vectors (x, y / sqrt(square), z), exact.

    Attributes
    ----------
    square : int
        1 or 3: y is in units of its square root.
    vectors : tuple of tuple of three Fraction
        In the order given.
    off : float
        By how much a coordinate was changed at most, metres.
    """

    square: int
    vectors: tuple[Vector, ...]
    off: float


def exact_points(points: Sequence[Array]) -> ExactPoints:
    """Exact vectors near the given ones, each (3,)."""
    found = [_snapped(points, square) for square in (1, 3)]
    # As many exact turns as possible; without any, plain coordinates.
    (plain, few), (turned, many) = found
    return turned if many > few else plain


def _snapped(points: Sequence[Array], square: int) -> tuple[ExactPoints, int]:
    unit = float(np.sqrt(square))
    # Decimals, so that points that differ by a sign stay so; round ones first, the others follow.
    plain = [
        tuple(Fraction(repr(round(float(v), _DECIMALS))) for v in (p[0], p[1] / unit, p[2]))
        for p in points
    ]
    order = sorted(range(len(points)), key=lambda k: max(v.denominator for v in plain[k]))
    found: dict[int, Vector] = {}
    related = 0
    for k in order:
        images = (v for old in found.values() for v in (old, *_images(old, square)))
        image = next((v for v in images if _near(v, points[k], unit)), None)
        related += image is not None
        x, y, z = plain[k]
        found[k] = (x, y, z) if image is None else image
    out = tuple(found[k] for k in range(len(points)))
    off = max(
        (float(np.abs(_float(v, unit) - p).max()) for v, p in zip(out, points, strict=True)),
        default=0.0,
    )
    return ExactPoints(square, out, off), related


def _images(v: Vector, square: int) -> list[Vector]:
    """The vector turned about z by the angles that are rational here, and mirrored."""
    x, y, z = v
    out = [(-x, -y, z), (x, -y, z), (-x, y, z)]
    if square == 3:
        for _ in range(2):
            x, y = -x / 2 - 3 * y / 2, x / 2 - y / 2
            out += [(x, y, z), (-x, -y, z)]
    else:
        out += [(-y, x, z), (y, -x, z)]
    return [w for w in out if w != v]


def _float(v: Vector, unit: float) -> Array:
    return np.array([float(v[0]), float(v[1]) * unit, float(v[2])])


def _near(v: Vector, p: Array, unit: float) -> bool:
    return bool(np.abs(_float(v, unit) - p).max() <= _SAME)
