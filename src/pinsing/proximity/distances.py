"""How far one configuration is from each family, certified, in numbers and in words."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.nearest import GAP, SECONDS
from pinsing.errors import OptionError
from pinsing.proximity.watched import Forms, watch
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class FamilyDistance:
    """Distance to one family.

    Attributes
    ----------
    family : str
        Its name.
    lower : float
        Proven: no configuration of it is nearer. Radians, or metres over the length scale.
    upper : float
        How far ``q`` is.
    q : (n,) array
        The nearest configuration of it that was found.
    reachability : str
        Whether the family has points within the joint limits, in words, and with which joint
        values where not with all.
    """

    family: str
    lower: float
    upper: float
    q: Array
    reachability: str


@dataclass(frozen=True, eq=False)
class Distances(JsonResult):
    """Distances from one configuration, nearest first.

    Attributes
    ----------
    q : (n,) array
        Radians and metres.
    families : tuple of FamilyDistance
        All that have real points; revolute differences are wrapped, limits not considered.
    complete : bool
        Whether the closed form is complete: else a singular configuration may be nearer.
    """

    schema: ClassVar[str] = "pinsing/distances/1"

    q: Array
    families: tuple[FamilyDistance, ...]
    complete: bool


def distances(forms: Forms, q: npt.ArrayLike, *, seconds: float = SECONDS) -> Distances:
    """Certified distances from q (n,) to each family, nearest first.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm.
    q : (n,) or (nq,) array_like
        Radians and metres.
    seconds : float
        Time for each family.

    Raises
    ------
    ConfigurationError, OptionError
        If q or an option makes no sense.
    """
    watched = watch(forms)
    x = watched.check(q)
    if x.ndim != 1:
        raise OptionError(f"distances takes one configuration, got shape {x.shape}")
    found = []
    for name, family in zip(watched.names, watched.families, strict=True):
        d = family.distance(x, seconds=seconds)
        found.append(FamilyDistance(name, d.lower, d.upper, d.q, family.reach))
    found.sort(key=lambda d: (d.upper, d.lower))
    return Distances(x, tuple(found), watched.complete)


def distance_words(found: Distances, degrees: bool, prismatic: npt.NDArray[np.bool_]) -> list[str]:
    """One line a family: how far, how sure, and which joints have to move."""
    lines = []
    for d in found.families:
        moved = np.flatnonzero(np.abs(d.q - found.q) > 1e-9)
        slides, turns = bool(prismatic[moved].any()), not prismatic[moved].all()
        far = _length(d.upper, slides)
        if d.upper - d.lower > 2 * GAP:
            far = f"{_length(d.lower, slides)} to {far}"
        if slides:
            far += " (rad, and metres over the length scale)" if turns else " length scales"
        moves = [
            f"q{j + 1} {_joint(float(d.q[j] - found.q[j]), degrees, bool(prismatic[j]))}"
            for j in moved
        ]
        way = f"by {', '.join(moves)}" if moves else "on it"
        lines.append(f"{d.family}: {far}, {way}; the family is {d.reachability}")
    return lines


def _length(x: float, slides: bool) -> str:
    if slides or x == 0:
        return f"{x:.4g}" if slides else "0°"
    return f"{math.degrees(x):.4g}° ({x:.4g} rad)"


def _joint(x: float, degrees: bool, slides: bool) -> str:
    if slides:
        return f"{x:+.4g} m"
    return f"{math.degrees(x):+.4g}°" if degrees else f"{x:+.4g} rad"
