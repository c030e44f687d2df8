"""Other readings of Table 2, under which the printed values might come out.

Every reading is a DH convention, signs of the twists, quarter-turn offsets of the joints, a
reference point, a unit of length, the first joint kept or dropped, a normalisation, and a measure.
Each is evaluated at both configurations for which the paper prints a value.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paper.printed import SURGICAL_D1, TABLE_2

ALPHA, A, D = (np.array([row[k] for row in TABLE_2], dtype=float) for k in range(3))
UNITS = {"m": 1.0, "dm": 10.0, "cm": 100.0, "mm": 1000.0}
MEASURES = (
    "σ_min",
    "σ_min²",
    "σ_min / σ_max",
    "(σ_min / σ_max)²",
    "ω",
    "ω²",
    "σ_min of the translation rows",
    "its square",
    "ω of the translation rows",
)
NORMALISATIONS = ("none", "unit columns", "unit rows", "translations over the sum of lengths")


@dataclass(frozen=True)
class Reading:
    """One way to read Table 2, and what it gives.

    Attributes
    ----------
    words : str
        How it differs from the plain one.
    measure : str
        One of MEASURES.
    third, half : float
        Its values with all joints at π/3 and at π/2.
    error : float
        Larger relative distance from the two printed values.
    """

    words: str
    measure: str
    third: float
    half: float
    error: float


@dataclass(frozen=True)
class Search:
    """All readings tried.

    Attributes
    ----------
    count : int
        How many.
    nearest : tuple of Reading
        Those nearest to both printed values.
    single : tuple of Reading
        Plain σ_min where one thing only is changed.
    within : int
        Readings that come within 1 % of both.
    """

    count: int
    nearest: tuple[Reading, ...]
    single: tuple[Reading, ...]
    within: int


def jacobians(
    alpha: np.ndarray, theta: np.ndarray, unit: float, modified: bool, point: int
) -> np.ndarray:
    """Geometric Jacobians (N, 6, 7) of the origin of frame ``point`` for joint angles (N, 7)."""
    N = len(theta)
    R, p = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))
    axes, points, origins = [], [], [p]
    for i in range(7):
        a, d = unit * A[i], unit * (SURGICAL_D1 if i == 0 else D[i])
        ca, sa = np.cos(alpha[i]), np.sin(alpha[i])
        twist = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        c, s = np.cos(theta[:, i]), np.sin(theta[:, i])
        turn = np.zeros((N, 3, 3))
        turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1
        if modified:
            p, R = p + a * R[:, :, 0], R @ twist
            axes.append(R[:, :, 2])
            points.append(p)
            p, R = p + d * R[:, :, 2], R @ turn
        else:
            axes.append(R[:, :, 2])
            points.append(p)
            p, R = p + d * R[:, :, 2], R @ turn
            p, R = p + a * R[:, :, 0], R @ twist
        origins.append(p)
    J = np.zeros((N, 6, 7))
    J[:, :3, 0] = axes[0]
    for i in range(1, 7):
        J[:, :3, i] = np.cross(axes[i], origins[point] - points[i])
        J[:, 3:, i] = axes[i]
    return J


def _normalised(J: np.ndarray, unit: float) -> Iterator[np.ndarray]:
    yield J
    columns = np.linalg.norm(J, axis=1, keepdims=True)
    yield J / np.where(columns > 0, columns, 1)
    rows = np.linalg.norm(J, axis=2, keepdims=True)
    yield J / np.where(rows > 0, rows, 1)
    scaled = J.copy()
    scaled[:, :3] /= unit * float(A.sum() + D.sum())
    yield scaled


def _measures(J: np.ndarray) -> np.ndarray:
    sigma = np.linalg.svd(J, compute_uv=False)
    moved = np.linalg.svd(J[:, :3], compute_uv=False)
    last, ratio = sigma[:, -1], sigma[:, -1] / sigma[:, 0]
    omega = sigma.prod(axis=1)
    low = moved[:, -1]
    columns = [last, last**2, ratio, ratio**2, omega, omega**2, low, low**2, moved.prod(axis=1)]
    return np.stack(columns, axis=1)


def search(third: float, half: float, offsets: bool = True) -> Search:
    """Try all readings against the two printed values; without ``offsets`` only a few thousand."""
    turns = np.array(list(itertools.product(range(4 if offsets else 1), repeat=4))) * np.pi / 2
    thetas = []
    for angle in (np.pi / 3, np.pi / 2):
        theta = np.full((len(turns), 7), angle)
        theta[:, 0] = 0.0
        # Offsets of q2 and q7 turn the arm as a whole, or nothing.
        theta[:, 2:6] += turns
        thetas.append(theta)
    found: list[Reading] = []
    single: dict[str, Reading] = {}
    count, within = 0, 0
    signs = tuple(itertools.product((1, -1), repeat=4))
    choices = itertools.product((True, False), signs, range(1, 8), UNITS.items(), (False, True))
    for modified, sign, point, (unit_name, unit), dropped in choices:
        alpha = ALPHA.copy()
        alpha[3:] *= sign
        pair = [jacobians(alpha, theta, unit, modified, point) for theta in thetas]
        if dropped:
            pair = [J[:, :, 1:] for J in pair]
        for how, one, two in zip(
            NORMALISATIONS, _normalised(pair[0], unit), _normalised(pair[1], unit), strict=True
        ):
            a, b = _measures(one), _measures(two)
            error = np.maximum(np.abs(a / third - 1), np.abs(b / half - 1))
            count += error.size
            within += int((error < 0.01).sum())
            changes = _changes(modified, sign, point, unit_name, dropped, how)
            i, j = np.unravel_index(int(error.argmin()), error.shape)
            found.append(_reading(changes, turns[i], a, b, error, int(i), int(j)))
            if len(changes) <= 1:
                kind = changes[0] if changes else "as printed"
                if "," not in kind:
                    single[kind] = _reading(changes, turns[0], a, b, error, 0, 0)
    found.sort(key=lambda r: r.error)
    return Search(count, tuple(found[:4]), tuple(single.values()), within)


def _changes(
    modified: bool, sign: tuple[int, ...], point: int, unit: str, dropped: bool, how: str
) -> list[str]:
    out = []
    if not modified:
        out.append("standard DH")
    if any(s < 0 for s in sign):
        flipped = ", ".join(f"α{i}" for i, s in enumerate(sign, 4) if s < 0)
        out.append(f"sign of {flipped}")
    if point != 7:
        out.append(f"origin of frame {point}")
    if unit != "m":
        out.append(f"lengths in {unit}")
    if dropped:
        out.append("without d1")
    if how != "none":
        out.append(how)
    return out


def _reading(
    changes: list[str],
    turns: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    error: np.ndarray,
    i: int,
    j: int,
) -> Reading:
    words = list(changes)
    if np.abs(turns).max() > 0:
        shown = ", ".join(f"q{k} + {np.degrees(t):.0f}°" for k, t in enumerate(turns, 3) if t > 0)
        words.append(shown)
    return Reading(
        "; ".join(words) or "as printed",
        MEASURES[j],
        float(a[i, j]),
        float(b[i, j]),
        float(error[i, j]),
    )
