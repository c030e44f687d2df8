"""The nearest point of conditions, with a proof that none is much nearer."""

from __future__ import annotations

import numpy as np

from pinsing._batch import engine
from pinsing._dataclass import dataclass
from pinsing._types import Array, Ints
from pinsing.algebra.box_search import Limits, search
from pinsing.algebra.conditions import Conditions
from pinsing.errors import OptionError

GAP = 1e-6
"""Upper less lower bound at which a search ends."""

SECONDS = 1.0
"""Time for one configuration."""

_BOXES = 5_000_000
_FAR = 100.0


@dataclass(frozen=True)
class SearchOptions:
    """How long, and among which points, the nearest one is searched.

    Attributes
    ----------
    gap : float
        Upper less lower bound at which a search may end, in weighted coordinates.
    seconds : float
        For one configuration; after it the bounds reached so far are returned.
    within_limits : bool
        Whether only points within the joint limits count. Otherwise revolute differences are
        wrapped, and all values of prismatic joints allowed.
    """

    gap: float = GAP
    seconds: float = SECONDS
    within_limits: bool = False

    def __post_init__(self) -> None:
        if not self.gap > 0:
            raise OptionError(f"gap must be positive, got {self.gap!r}")
        if not self.seconds > 0:
            raise OptionError(f"seconds must be positive, got {self.seconds!r}")


@dataclass(frozen=True, eq=False)
class Nearest:
    """Nearest points of conditions.

    Attributes
    ----------
    lower, upper : (N,) arrays
        No point is nearer than ``lower``, one was found at ``upper``; weighted coordinates. Both
        are infinite where there is proven to be none; ``upper`` alone where none was found.
    family : (N,) array of int
        Family of the point found, -1 without any.
    q : (N, n) array
        The points found, joint values.
    boxes : (N,) array of int
        Boxes that were looked at.
    """

    lower: Array
    upper: Array
    family: Ints
    q: Array
    boxes: Ints


def nearest_points(
    conditions: Conditions,
    Q: Array,
    lower: Array,
    upper: Array,
    options: SearchOptions,
    *,
    compiled: bool = True,
) -> Nearest:
    """Nearest points of conditions to Q (N, n), by best-first branch and bound.

    Parameters
    ----------
    conditions : Conditions
        The families.
    Q : (N, n) array
        Joint values, finite.
    lower, upper : (n,) or (families, n) arrays
        Joint limits, infinite where there are none; perhaps those of each family.
    options : SearchOptions
        Gap, time, and whether limits count.
    compiled : bool
        Whether the compiled engine is used where there is one.
    """
    X = conditions.scaled(Q)
    N, n = X.shape
    low = np.ascontiguousarray(np.asarray(lower, dtype=float) * conditions.weight)
    high = np.ascontiguousarray(np.asarray(upper, dtype=float) * conditions.weight)
    far = _FAR + float(np.abs(X).max(initial=0.0))
    handle = conditions.compiled() if compiled else None
    if handle is None:
        shape = (conditions.families, n)
        both = np.broadcast_to(low, shape), np.broadcast_to(high, shape)
        limits = Limits(*both, options.within_limits, far)
        found = [search(conditions, x, limits, options.gap, options.seconds) for x in X]
        return Nearest(
            lower=np.array([f.lower for f in found]),
            upper=np.array([f.upper for f in found]),
            family=np.array([f.family for f in found], dtype=np.int64),
            q=np.array([f.x for f in found]).reshape(N, n) / conditions.weight,
            boxes=np.array([f.boxes for f in found], dtype=np.int64),
        )
    least, most = np.empty(N), np.empty(N)
    family, boxes = np.empty(N, dtype=np.int64), np.empty(N, dtype=np.int64)
    points = np.empty((N, n))
    handle.nearest(
        X,
        low,
        high,
        options.within_limits,
        far,
        options.gap,
        options.seconds,
        _BOXES,
        least,
        most,
        family,
        boxes,
        points,
        engine.cpu_count(),
    )
    return Nearest(least, most, family, points / conditions.weight, boxes)
