"""Aspects of a slice through the workspace: what is reached without passing a singular pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool

_PALE = {
    True: ("#dfeadb", "#c4dcc9", "#d3e6e9", "#e9efcf"),
    False: ("#f3e3cf", "#efd3cd", "#e8d9ea", "#f2e9c9"),
}
LEAST = 12
"""Grid cells below which a region is not told from the roughness of the grid."""


def regions(
    inside: Bool, left_sides: Sequence[Array], turns: tuple[bool, bool] = (False, False)
) -> tuple[npt.NDArray[np.int_], list[bool]]:
    """Number the connected regions of a grid in which no left side changes its sign.

    Parameters
    ----------
    inside : (k, k) array of bool
        Where poses are reached.
    left_sides : sequence of (k, k) arrays
        Of the loci of type 2 (and constraint).
    turns : tuple of bool
        Whether columns (the abscissa) and rows go round a whole turn: then the first one is the
        last.

    Returns
    -------
    numbers : (k, k) array of int
        From 1 on, largest first; 0 where nothing is reached, or a region is a few cells.
    signs : list of bool
        Of each region, whether the product of the left sides is positive.
    """
    from scipy.ndimage import label

    pattern = np.zeros(inside.shape, dtype=int)
    for k, left in enumerate(left_sides):
        pattern += (left > 0).astype(int) << k
    found: list[tuple[int, Bool, bool]] = []
    for value in np.unique(pattern[inside]).tolist():
        numbers, count = label(inside & (pattern == value))
        even = (len(left_sides) - int(value).bit_count()) % 2 == 0
        for members in _joined(numbers, count, turns):
            cells = np.isin(numbers, members)
            if int(cells.sum()) >= LEAST:
                found.append((int(cells.sum()), cells, even))
    found.sort(key=lambda x: -x[0])
    out = np.zeros(inside.shape, dtype=int)
    for k, (_, cells, _) in enumerate(found, 1):
        out[cells] = k
    return out, [even for _, _, even in found]


def _joined(numbers: npt.NDArray[np.int_], count: int, turns: tuple[bool, bool]) -> list[list[int]]:
    """Numbers of regions, those together that meet across a whole turn."""
    group = list(range(count + 1))

    def root(k: int) -> int:
        while group[k] != k:
            k = group[k]
        return k

    pairs: list[tuple[int, int]] = []
    if turns[0]:
        pairs += zip(numbers[:, 0].tolist(), numbers[:, -1].tolist(), strict=True)
    if turns[1]:
        pairs += zip(numbers[0].tolist(), numbers[-1].tolist(), strict=True)
    for a, b in pairs:
        if a and b:
            group[root(a)] = root(b)
    out: dict[int, list[int]] = {}
    for k in range(1, count + 1):
        out.setdefault(root(k), []).append(k)
    return list(out.values())


def colors(positive: Sequence[bool]) -> list[str]:
    """A pale colour for each region: green and blue for those that are positive, else warm."""
    used = {True: 0, False: 0}
    out = []
    for sign in positive:
        shades = _PALE[sign]
        out.append(shades[used[sign] % len(shades)])
        used[sign] += 1
    return out
