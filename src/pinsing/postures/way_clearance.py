"""How clear a way is, and how waypoints are pushed away from what is near.

All families count: one of two conditions or more separates nothing, but is singular.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from pinsing._types import Array
from pinsing.postures.joint_map import Map
from pinsing.proximity.clearance import quick

_STATIONS = 40
"""Waypoints that are pushed, at most; evenly along the way."""
_PROBE = 0.01
_STRIDE = 0.12
_ASIDE = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""How far a way bends, radians, that goes round what separates nothing."""


def lowest(chosen: Map, Q: Array) -> float:
    """Least lower bound of the clearance at some points of a polyline."""
    share = np.linspace(0, 1, 24)
    fine = np.concatenate([a + share[:, None] * (b - a) for a, b in pairwise(Q)])
    return float(quick(chosen.watched, fine).lower.min())


def shortened(
    Q: Array,
    clear: Callable[[Array], bool],
    room: Callable[[Array], float],
    until: float,
    keep: float = 0.7,
) -> Array:
    """Leave waypoints out where the straight line instead is clear, and not much nearer."""
    kept = [0]
    last = len(Q) - 1
    while kept[-1] < last:
        i = kept[-1]
        best, step = i + 1, 2
        while i + step <= last + step // 2 and time.monotonic() < until:
            j = min(i + step, last)
            line = Q[[i, j]]
            if clear(line) and room(line) >= min(keep * room(Q[i : j + 1]), 0.3):
                best = j
                if j == last:
                    break
                step *= 2
            else:
                break
        kept.append(best)
    return Q[kept]


def least(chosen: Map, path: Array) -> float:
    """A proven lower bound of the clearance of all of a polyline.

    Distance changes no faster than the configuration moves: on a piece of half-length h it is no
    less than in its middle less h.
    """
    pieces = list(pairwise(path))
    if not chosen.watched.families:
        return float("inf")
    low, high = 0.0, float("inf")
    begin = np.array([a for a, _ in pieces])
    end = np.array([b for _, b in pieces])
    out = []
    for _ in range(14):
        middle = (begin + end) / 2
        half = chosen.watched.length(end - begin) / 2
        at = quick(chosen.watched, middle).lower
        high = min(high, float(at.min()))
        bound = at - half
        fine = bound >= 0.9 * high
        out.append(bound[fine])
        begin, end, middle = begin[~fine], end[~fine], middle[~fine]
        if not len(begin):
            break
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        if len(begin) > 200_000:
            break
    if len(begin):
        middle = (begin + end) / 2
        out.append(quick(chosen.watched, middle).lower - chosen.watched.length(end - begin) / 2)
    low = min((float(x.min()) for x in out if len(x)), default=high)
    return max(low, 0.0)


def raised(chosen: Map, path: Array, until: float) -> Array:
    """A way between the same ends that is clearer, where pushing its waypoints finds one.

    Each moves along the gradient of the clearance, by differences; the way is certified anew, and
    kept only where its least clearance is larger. It is never larger than that of the ends.
    """
    if not chosen.watched.families:
        return path
    most = float(quick(chosen.watched, path[[0, -1]]).lower.min())
    best, bound = path, least(chosen, path)
    points, stride = _stations(chosen, path), _STRIDE
    for _ in range(8):
        # Share of the clearance of the nearer end at which a way is clear enough: it can have no
        # more.
        if bound >= 0.85 * most or time.monotonic() > until:
            break
        tried = _pushed(chosen, points, most, stride)
        now = least(chosen, tried) if chosen.regular(tried) else 0.0
        if now > 1.02 * bound:
            points, best, bound = tried, tried, now
        elif stride > _STRIDE / 8:
            stride /= 2
        else:
            break
    if best is path:
        return path
    # What was laid in for the push is left out again where that costs nothing.
    short = shortened(best, chosen.regular, lambda Q: lowest(chosen, Q), until, keep=0.98)
    return short if chosen.regular(short) and least(chosen, short) >= 0.9 * bound else best


def beside(chosen: Map, path: Array) -> Array | None:
    """A way between the same ends that meets no family, beside one that meets none that separates.

    What has two conditions or more is missed by nearly every way: bends of a few sizes in random
    directions are tried, the small ones first.
    """
    if chosen.regular(path):
        return path
    points = _stations(chosen, path)
    bend = np.sin(np.pi * np.linspace(0, 1, len(points)))[:, None]
    low, high = chosen.partition.low, chosen.partition.high
    rng = np.random.default_rng(0)
    for size in _ASIDE:
        for direction in rng.normal(size=(4, path.shape[1])):
            aside = size * direction / np.linalg.norm(direction) / chosen.watched.weight
            tried: Array = np.clip(points + bend * aside, low, high)
            tried[0], tried[-1] = path[0], path[-1]
            if chosen.regular(tried):
                return tried
    return None


def _stations(chosen: Map, path: Array) -> Array:
    """The ends and the waypoints of a way, with points in between, evenly by length."""
    along = np.append(0.0, np.cumsum(chosen.watched.length(np.diff(path, axis=0))))
    if along[-1] == 0:
        return path
    even = np.linspace(0.0, along[-1], _STATIONS)
    at = np.union1d(even, along) if len(path) <= _STATIONS else even
    points = np.stack([np.interp(at, along, column) for column in path.T], axis=1)
    points[0], points[-1] = path[0], path[-1]
    return points


def _pushed(chosen: Map, points: Array, most: float, stride: float) -> Array:
    """Points between the ends, those that are nearer than an end pushed away by gradient."""
    out = points.copy()
    inner = out[1:-1]
    unit = 1 / chosen.watched.weight
    low, high = chosen.partition.low, chosen.partition.high
    probe = _PROBE * np.diag(unit)
    for _ in range(4):
        here = quick(chosen.watched, inner).lower
        near = np.flatnonzero(here < most)
        if not len(near):
            break
        x = inner[near]
        ahead, behind = (
            quick(chosen.watched, (x[:, None, :] + s * probe).reshape(-1, x.shape[1])).lower
            for s in (1, -1)
        )
        slope = (ahead - behind).reshape(x.shape) / (2 * _PROBE)
        size = np.linalg.norm(slope, axis=1, keepdims=True)
        step = np.minimum(stride, np.maximum(most - here[near], 0))[:, None]
        inner[near] = np.clip(x + step * slope / np.maximum(size, 1e-12) * unit, low, high)
    return out
