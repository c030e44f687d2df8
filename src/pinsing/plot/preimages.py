"""How many points of a plane grid of joint values are mapped to each place, by small triangles."""

from __future__ import annotations

from itertools import product

import numpy as np

from pinsing._types import Array, Ints


def count_of(at: Array, r: Array, z: Array) -> Ints:
    """How many values of two joints bring the tip to each place (r, z), (N, M), by triangles.

    ``at`` (K, L, 2) has the places of a grid of joint values.

    The map is taken to be linear on small triangles; a place is told wrong only within a share of
    about one in 10^5 of the size from where the count changes.
    """
    # Places by cells; half a cell is added so that no place is on a side of a triangle.
    u = (at[..., 0] - r[0]) / (r[1] - r[0])
    v = (at[..., 1] - z[0]) / (z[1] - z[0])
    corners = np.stack([u, v], axis=-1)
    a, b, c, d = (
        corners[i : len(u) - 1 + i, j : u.shape[1] - 1 + j].reshape(-1, 2)
        for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))
    )
    count = np.zeros((len(z), len(r)), dtype=np.int64)
    for triangle in ((a, b, c), (d, c, b)):
        _add(count, np.stack(triangle, axis=1))
    return _mended(count)


def _mended(count: Ints) -> Ints:
    """The same with what differs from all places around taken from them: next to the curves."""
    around = np.stack(
        [np.roll(count, s, (0, 1)) for s in product((-1, 0, 1), repeat=2) if s != (0, 0)]
    )
    alone = (around != count).all(axis=0)
    return np.where(alone, np.sort(around, axis=0)[4], count)


def _add(count: Ints, corners: Array) -> None:
    """Add one to the places that are inside of each triangle (K, 3, 2)."""
    first = np.ceil(corners.min(axis=1)).astype(np.int64)
    last = np.floor(corners.max(axis=1)).astype(np.int64)
    first = np.maximum(first, 0)
    last = np.minimum(last, np.array(count.shape[::-1]) - 1)
    wide = last - first + 1
    keep = (wide > 0).all(axis=1)
    corners, first, wide = corners[keep], first[keep], wide[keep]
    each = wide.prod(axis=1)
    which = np.repeat(np.arange(len(corners)), each)
    place = np.arange(int(each.sum())) - np.repeat(np.cumsum(each) - each, each)
    x = first[which] + np.stack([place % wide[which, 0], place // wide[which, 0]], axis=1)
    p = corners[which]
    sides = []
    for k in range(3):
        e = p[:, (k + 1) % 3] - p[:, k]
        g = x - p[:, k]
        sides.append(e[:, 0] * g[:, 1] - e[:, 1] * g[:, 0])
    side = np.array(sides)
    inside = (side > 0).all(axis=0) | (side < 0).all(axis=0)
    np.add.at(count, (x[inside, 1], x[inside, 0]), 1)
