"""Boxes on which the product of all |f| has no largest value, proven.

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

import numpy as np

from pinsing._types import Array, Bool
from pinsing.postures.bound_on_boxes import OnBoxes, Terms
from pinsing.postures.boxes import Ground


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
